"""Does u jump across walls only? Decided exactly.

Let V vanish at d = 0 only (no margin). A motion has d > 0 at all times but perhaps the first and the last,
when it is at S and G, which lie on no wall; so it is on no wall at any time. In a triangle that wall f cuts
through, the chord of f's line is wall, so the motion is strictly on one side there, in the part of one
copy. On a side of two triangles, copies whose parts hold the same point have the same controls: they agree.
At a vertex off all obstacles go round it: neighbours share a side on which the vertex lies in both parts, so
all of them have the same value; S and G are looked at by themselves. And parts are open in their
triangles: a copy that holds q(t0) holds q(t) at all times near t0 when q(t) is in its triangle. So u(q(t))
has one value at each time and is continuous.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from verify.judge.certificate.dyadic import Dyadic
from verify.judge.certificate.file import CertificateFile
from verify.judge.certificate.sheets import Sheets
from verify.judge.certificate.signs import orientation
from verify.judge.certificate.wording import listed, place_of, side_of
from verify.judge.features import BOUNDARY, Features
from verify.judge.question import Question

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]
Signs = NDArray[np.int8]

CHUNK = 500_000  # pairs of sides and walls compared at once, at most
MOST_PAIRS = 2_000_000  # in all: far above what a mesh has that was not made to be slow


def check_continuity(file: CertificateFile, sheets: Sheets, question: Question, *, exact: bool) -> list[str]:
    """Faults of copies: for this robot, of the walls they name, where they must agree, and at both ends."""
    if not sheets.used:
        return []
    walls = _walls(question.features)
    faults = [*_needless(file, sheets, question, walls, exact), *sheets.faults]
    named = np.abs(file.side.astype(np.int64)) - 1
    strange = np.flatnonzero((named >= 0) & ~walls[named])

    def tell(row: int) -> str:
        return place_of(file, file.triangles[row].astype(np.int64))

    if strange.size:
        return [*faults, *listed("cut by what is no wall:", strange, tell)]
    return [
        *faults,
        *listed("not cut through by its wall:", _not_through(file, sheets, question.features, exact), tell),
        *_jumps(file, sheets, question.features, walls, exact),
        *_ends(file, question, exact),
    ]


def _walls(features: Features) -> Mask:
    """(f,), which features are obstacles with two vertices: segments that no outline closes."""
    others = [BOUNDARY, *features.polygons, *features.circles]
    long = (features.table[:, :2] != features.table[:, 2:4]).any(axis=1)
    return np.asarray(long & ~np.isin(features.owner, others))


def _needless(
    file: CertificateFile, sheets: Sheets, question: Question, walls: Mask, exact: bool
) -> list[str]:
    """Whether copies are allowed at all: V must vanish at d = 0 only, and no end may lie on a wall."""
    limits, faults = question.setting.limits, []
    if limits.margin > 0.0:
        vertex = int(file.triangles[np.argmax(file.side != 0), 0])
        if sheets.place is not None:
            vertex = int(np.argmax(sheets.place != np.arange(len(sheets.place))))
        x, y = file.points[vertex]
        faults.append(
            f"copies, as at ({x:.9g}, {y:.9g}) m, are for a robot without margin; "
            f"this one has {limits.margin:g} m"
        )
    rows = np.flatnonzero(walls)
    for name, end in (("start", question.setting.start), ("goal", question.setting.goal)):
        place = np.tile(np.array(end.position, dtype=float), (len(rows), 1))
        if _on(question.features, rows, place, exact).any():
            x, y = end.position
            faults.append(
                f"copies are not allowed where an end lies on a wall: the {name} ({x:.9g}, {y:.9g}) m"
            )
    return faults


def _not_through(file: CertificateFile, sheets: Sheets, features: Features, exact: bool) -> Indices:
    """Pairs whose wall does not cut the closed triangle from rim to rim; their left copies' rows.

    The line must have corners strictly on both sides, and its chord must lie on the wall: so both of the
    chord's ends. One is a corner on the line, or the crossing of the line with a side, which is on the wall
    where the wall's ends are not both strictly on one side of it.
    """
    rows = sheets.pairs[:, 0]
    corner = file.points[file.triangles[rows]]
    wall = file.side[rows].astype(np.int64) - 1
    a, b = features.table[wall, :2], features.table[wall, 2:4]
    turn = np.stack([orientation(a, b, corner[:, i], exact=exact) for i in range(3)])
    bad = ~((turn > 0).any(axis=0) & (turn < 0).any(axis=0))
    for i in range(3):
        j = (i + 1) % 3
        before, after = (orientation(corner[:, i], corner[:, j], end, exact=exact) for end in (a, b))
        bad |= (turn[i] * turn[j] < 0) & (before * after > 0)
        bad |= (turn[i] == 0) & ~_between(a, b, corner[:, i])
    return rows[bad]


def _jumps(file: CertificateFile, sheets: Sheets, features: Features, walls: Mask, exact: bool) -> list[str]:
    """Sides with a point off all walls at which two copies hold different values."""
    kept, count = file.triangles.astype(np.int64), len(file.vertices)
    start, end = kept.ravel(), np.roll(kept, -1, axis=1).ravel()
    p, q = sheets.at(start), sheets.at(end)
    key = np.minimum(p, q) * count + np.maximum(p, q)
    ahead, back = np.flatnonzero(p < q), np.flatnonzero(p > q)
    ahead = ahead[np.argsort(key[ahead], kind="stable")]
    first, last = (np.searchsorted(key[ahead], key[back], side) for side in ("left", "right"))
    pairs = []
    for nth in (0, 1):  # in a tiling a directed side is that of one triangle: of one copy or two
        here = first + nth < last
        pairs.append((ahead[first[here] + nth], back[here]))
    one, other = (np.concatenate(part) for part in zip(*pairs, strict=True))
    torn = (start[one] != end[other]) | (end[one] != start[other])
    one, other = one[torn], other[torn]
    low, high = file.points[start[one]], file.points[end[one]]
    met = _parts_meet(file, one // 3, other // 3, (low, high), features, exact)
    one, low, high = one[met], low[met], high[met]
    covered = _on_one_wall(low, high, features, walls, exact)
    if covered is None:
        return ["more walls run near the sides where u jumps than can be compared with them"]
    _, which = np.unique(key[one[~covered]], return_index=True)
    return listed(
        "u may jump, without a wall all along, across",
        one[~covered][which],
        lambda k: side_of(file, int(start[k]), int(end[k])),
    )


def _parts_meet(
    file: CertificateFile,
    one: Indices,
    other: Indices,
    ends: tuple[Array, Array],
    features: Features,
    exact: bool,
) -> Mask:
    """Whether a point of the side from `ends[0]` to `ends[1]` (k, 2) lies in the parts of both rows (k,).

    A part is open where its wall's line crosses. Two parts that have no end of the side in common meet
    where each has one, and the crossings are in the right order: with h >= 0 the height over the
    line on its own side, linear along the side, from p on h_1 > 0 up to h_1(p) / (h_1(p) - h_1(q)), and
    h_2 > 0 from -h_2(p) / (h_2(q) - h_2(p)) to q; the former is greater where h_1(p) h_2(q) > h_1(q) h_2(p).
    """
    mine, its = (
        [_side_of_wall(file, rows, place, features, exact) > 0 for place in ends] for rows in (one, other)
    )
    met = (mine[0] & its[0]) | (mine[1] & its[1])
    for near, far in ((0, 1), (1, 0)):
        rows = np.flatnonzero(~met & mine[near] & its[far])
        if rows.size:
            p, q = ends[near][rows], ends[far][rows]
            h = [[_height(file, r[rows], x, features) for x in (p, q)] for r in (one, other)]
            met[rows] = (h[0][0] * h[1][1] - h[0][1] * h[1][0]).sign() > 0
    return np.asarray(met)


def _side_of_wall(
    file: CertificateFile, rows: Indices, places: Array, features: Features, exact: bool
) -> Signs:
    """1 where the part of a kept triangle (k,) is on the same side of its wall as a place (k, 2), and
    where the triangle is whole; -1 on the other side, 0 on the wall's line; (k,).
    """
    side = file.side[rows].astype(np.int64)
    found = np.ones(len(rows), dtype=np.int8)
    cut = np.flatnonzero(side)
    table = features.table[np.abs(side[cut]) - 1]
    turn = orientation(table[:, :2], table[:, 2:4], places[cut], exact=exact)
    found[cut] = turn * np.sign(side[cut]).astype(np.int8)
    return found


def _height(file: CertificateFile, rows: Indices, places: Array, features: Features) -> Dyadic:
    """Distance of places (k, 2) to the line of the wall that cuts a triangle (k,), times the wall's length
    [m^2]; positive on the side of the triangle's part.
    """
    side = file.side[rows].astype(np.int64)
    table = features.table[np.abs(side) - 1]
    a, b, p = (Dyadic.of(points) for points in (table[:, :2], table[:, 2:4], places))
    u, w = b - a, p - a
    return (u[:, 0] * w[:, 1] - u[:, 1] * w[:, 0]) * Dyadic.integers(np.sign(side))


def _on_one_wall(low: Array, high: Array, features: Features, walls: Mask, exact: bool) -> Mask | None:
    """Whether sides from `low` to `high` (k, 2) lie on one wall each; None above `MOST_PAIRS`."""
    rows = np.flatnonzero(walls)
    found = np.zeros(len(low), dtype=bool)
    if not rows.size:
        return found
    table = features.table[rows]
    a, b = np.minimum(table[:, :2], table[:, 2:4]), np.maximum(table[:, :2], table[:, 2:4])
    tree = shapely.STRtree(shapely.box(a[:, 0], a[:, 1], b[:, 0], b[:, 1]))
    step, compared = max(1, CHUNK // len(rows)), 0
    for first in range(0, len(low), step):
        p, q = low[first : first + step], high[first : first + step]
        which, wall = tree.query(shapely.points(p), predicate=None)
        compared += len(which)
        if compared > MOST_PAIRS:
            return None
        on = _on(features, rows[wall], p[which], exact) & _on(features, rows[wall], q[which], exact)
        found[first + which[on]] = True
    return found


def _on(features: Features, rows: Indices, places: Array, exact: bool) -> Mask:
    """Whether places (k, 2) lie on the segments of features (k,)."""
    a, b = features.table[rows, :2], features.table[rows, 2:4]
    return np.asarray((orientation(a, b, places, exact=exact) == 0) & _between(a, b, places))


def _between(a: Array, b: Array, places: Array) -> Mask:
    """Whether places (k, 2) on the line through a and b lie between them: their coordinates do."""
    inside = (places >= np.minimum(a, b)) & (places <= np.maximum(a, b))
    return np.asarray(inside.all(axis=1))


def _ends(file: CertificateFile, question: Question, exact: bool) -> list[str]:
    """Start and goal strictly in the part of their triangle; a vertex there has one value."""
    faults = []
    for name, triangle, end in (
        ("start", int(file.start_triangle), question.setting.start),
        ("goal", int(file.goal_triangle), question.setting.goal),
    ):
        x, y = end.position
        told = f"the {name} ({x:.9g}, {y:.9g}) m"
        if not _held(file, np.array([triangle]), end.position, question.features, exact).all():
            faults.append(f"{told} is not on the side of the wall for which its triangle stands")
        here = np.flatnonzero((file.points == np.array([x, y])).all(axis=1))
        rows, corner = np.nonzero(np.isin(file.triangles, here))
        held = _held(file, rows, end.position, question.features, exact)
        if len(np.unique(file.triangles[rows, corner][held])) > 1:
            faults.append(f"u has more than one value at {told}")
    return faults


def _held(
    file: CertificateFile, rows: Indices, position: Sequence[float], features: Features, exact: bool
) -> Mask:
    """Whether a position [m] is strictly on the side of each row's wall; (k,), true for whole triangles."""
    places = np.tile(np.array(position, dtype=float), (len(rows), 1))
    return np.asarray(_side_of_wall(file, rows, places, features, exact) > 0)
