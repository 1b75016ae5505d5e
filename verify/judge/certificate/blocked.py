"""Can the robot move nowhere in the dropped triangles? Decided exactly.

A triangle is blocked where all three corners are at most rho + m from one feature: the distance to a
convex set is convex, so it is at most that everywhere in the triangle, and the safe speed there is zero. Or
where it lies outside the boundary, or inside a polygon obstacle: no side of that outline meets the open
triangle, so all of it lies on one side of the outline, on that of any one of its points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from verify.judge.certificate.file import CertificateFile
from verify.judge.certificate.signs import orientation, within
from verify.judge.certificate.wording import listed, place_of
from verify.judge.features import BOUNDARY, Features
from verify.judge.limits import Limits

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]

OUTSIDE = -1  # blocked by being outside the boundary; -2 - k: inside obstacle k
CHUNK = 500_000  # pairs of triangles and sides compared at once, at most
MOST_PAIRS = 2_000_000  # in all: a hundred times what a mesh has that was not made to be slow


@dataclass(frozen=True, eq=False)
class _Outlines:
    """Sides of the boundary and of all polygon obstacles."""

    start: Array  # (m, 2) [m]
    end: Array  # (m, 2) [m]
    answers: Indices  # (m,) the value of `blocked_by` that names the side's outline
    tree: shapely.STRtree
    right: float  # [m], no outline reaches beyond this x

    @classmethod
    def of(cls, features: Features) -> _Outlines:
        solid = np.isin(features.owner, [BOUNDARY, *features.polygons])
        start, end = features.table[solid, :2], features.table[solid, 2:4]
        owner = features.owner[solid]
        low, high = np.minimum(start, end), np.maximum(start, end)
        tree = shapely.STRtree(shapely.box(low[:, 0], low[:, 1], high[:, 0], high[:, 1]))
        answers = np.where(owner == BOUNDARY, OUTSIDE, -2 - owner)
        return cls(start, end, answers, tree, float(high[:, 0].max()))


def check_blocked(file: CertificateFile, features: Features, limits: Limits, *, exact: bool) -> list[str]:
    """Faults of dropped triangles that are not shown to be blocked."""
    reason = file.blocked_by.astype(np.int64)
    faults: list[str] = []

    def refuse(kind: str, rows: Indices) -> None:
        faults.extend(listed(kind, file.dropped[rows].astype(np.int64), lambda t: place_of(file, t)))

    known = np.array([OUTSIDE, *(-2 - index for index in features.polygons)])
    strange = (reason >= len(features.table)) | ((reason < 0) & ~np.isin(reason, known))
    refuse("blocked_by names neither a feature nor a polygon obstacle:", np.flatnonzero(strange))
    near = np.flatnonzero((reason >= 0) & ~strange)
    refuse(
        "dropped, but a corner is farther from its feature than the robot must stay:",
        near[~_all_near(file, near, features, limits, exact)],
    )
    solid = np.flatnonzero((reason < 0) & ~strange)
    through, inside = _against_outlines(file, solid, _Outlines.of(features), exact)
    if through is None or inside is None:
        return [*faults, "more sides run near the dropped triangles than can be compared with them"]
    refuse("dropped, but a side of what it is said to lie in or outside of runs through it:", solid[through])
    outside = reason[solid] == OUTSIDE
    refuse("dropped as outside the boundary, but inside it:", solid[~through & outside & inside])
    refuse("dropped as inside an obstacle, but outside of it:", solid[~through & ~outside & ~inside])
    return faults


def _all_near(file: CertificateFile, rows: Indices, features: Features, limits: Limits, exact: bool) -> Mask:
    corners = file.points[file.dropped[rows]].reshape(-1, 2)
    table = np.repeat(features.table[file.blocked_by[rows]], 3, axis=0)
    near = within(corners, table, limits.radius, limits.margin, exact=exact)
    return np.asarray(near.reshape(-1, 3).all(axis=1))


def _against_outlines(
    file: CertificateFile, rows: Indices, outlines: _Outlines, exact: bool
) -> tuple[Mask, Mask] | tuple[None, None]:
    """Whether the outline that each triangle names meets it, and whether it lies inside, where it does not.

    None where this would take more than `MOST_PAIRS` comparisons.
    """
    through, inside = np.zeros(len(rows), dtype=bool), np.zeros(len(rows), dtype=bool)
    step, compared = max(1, CHUNK // len(outlines.start)), 0
    for first in range(0, len(rows), step):
        part = slice(first, first + step)
        corner = file.vertices[file.dropped[rows[part]]]
        wanted = file.blocked_by[rows[part]].astype(np.int64)
        for answer, test in ((through, _meets), (inside, _contains)):
            answer[part], pairs = test(file, corner, wanted, outlines, exact)
            compared += pairs
        if compared > MOST_PAIRS:
            return None, None
    return through, inside


def _pairs(low: Array, high: Array, wanted: Indices, outlines: _Outlines) -> tuple[Indices, Indices, int]:
    """Boxes (r,) and sides that meet, if the side answers for what is wanted (r,); and all pairs, counted."""
    row, side = outlines.tree.query(shapely.box(low[:, 0], low[:, 1], high[:, 0], high[:, 1]))
    fits = outlines.answers[side] == wanted[row]
    return row[fits], side[fits], len(row)


def _meets(
    file: CertificateFile, lattice: Indices, wanted: Indices, outlines: _Outlines, exact: bool
) -> tuple[Mask, int]:
    """Whether a side of its outline meets each open triangle (r, 3, 2); (r,).

    Separating lines: an open convex polygon and a segment are disjoint where a line along a side of
    one of them has them on different sides, as 0 is then outside an edge of the polygon of
    differences, and each of its edges is parallel to one of theirs. Touching is not meeting.
    """
    corner = file.metres(lattice)
    row, side, compared = _pairs(corner.min(axis=1), corner.max(axis=1), wanted, outlines)
    a, b, triangle = outlines.start[side], outlines.end[side], corner[row]
    apart = np.zeros(len(row), dtype=bool)
    for i in range(3):
        ends = (triangle[:, i], triangle[:, (i + 1) % 3])
        apart |= (orientation(*ends, a, exact=exact) <= 0) & (orientation(*ends, b, exact=exact) <= 0)
    turns = np.stack([orientation(a, b, triangle[:, i], exact=exact) for i in range(3)])
    # A side of no length has no line; its point belongs to the sides before and after it.
    apart |= ((turns >= 0).all(axis=0) | (turns <= 0).all(axis=0)) & (a != b).any(axis=1)
    return np.bincount(row[~apart], minlength=len(lattice)) > 0, compared


def _contains(
    file: CertificateFile, lattice: Indices, wanted: Indices, outlines: _Outlines, exact: bool
) -> tuple[Mask, int]:
    """Whether each triangle (r, 3, 2) lies inside its outline, no side of which may meet it; (r,).

    A ray to the right from a point of the open triangle crosses the outline an odd number of times. The
    point is (2 v0 + v1 + v2) / 4, a lattice point of a quarter of the unit, hence exact; no side runs
    through it, and a side counts with its lower end only.
    """
    point = file.metres((lattice.sum(axis=1) + lattice[:, 0]) * 0.25)
    far = np.column_stack([np.maximum(point[:, 0], outlines.right), point[:, 1]])
    row, side, compared = _pairs(point, far, wanted, outlines)
    a, b, p = outlines.start[side], outlines.end[side], point[row]
    upward = (a[:, 1] <= p[:, 1]) & (b[:, 1] > p[:, 1])
    downward = (b[:, 1] <= p[:, 1]) & (a[:, 1] > p[:, 1])
    turn = orientation(a, b, p, exact=exact)
    crossed = (upward & (turn > 0)) | (downward & (turn < 0))
    return np.bincount(row[crossed], minlength=len(lattice)) % 2 == 1, compared
