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
CHUNK = 4096  # triangles compared with sides at once


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
    outlines = _Outlines.of(features)
    solid = np.flatnonzero((reason < 0) & ~strange)
    parts = [solid[first : first + CHUNK] for first in range(0, len(solid), CHUNK)]
    met = [_met(file, rows, outlines, exact) for rows in parts]
    crossed = np.concatenate(met) if met else np.zeros(0, dtype=bool)
    refuse("dropped, but a side of what it is said to lie in or outside of runs through it:", solid[crossed])
    clear = [rows[~hit] for rows, hit in zip(parts, met, strict=True)]
    inside = [_inside(file, rows, outlines, exact) for rows in clear]
    for rows, within_outline in zip(clear, inside, strict=True):
        outside = reason[rows] == OUTSIDE
        refuse("dropped as outside the boundary, but inside it:", rows[outside & within_outline])
        refuse("dropped as inside an obstacle, but outside of it:", rows[~outside & ~within_outline])
    return faults


def _all_near(file: CertificateFile, rows: Indices, features: Features, limits: Limits, exact: bool) -> Mask:
    corners = file.points[file.dropped[rows]].reshape(-1, 2)
    table = np.repeat(features.table[file.blocked_by[rows]], 3, axis=0)
    near = within(corners, table, limits.radius, limits.margin, exact=exact)
    return np.asarray(near.reshape(-1, 3).all(axis=1))


def _pairs(boxes: NDArray[np.object_], wanted: Indices, outlines: _Outlines) -> tuple[Indices, Indices]:
    """Rows of `boxes` and sides whose boxes meet and that answer for what is wanted."""
    row, side = outlines.tree.query(boxes)
    fits = outlines.answers[side] == wanted[row]
    return row[fits], side[fits]


def _met(file: CertificateFile, rows: Indices, outlines: _Outlines, exact: bool) -> Mask:
    """Whether a side of the outline that triangle `rows` names meets the open triangle; same length.

    Separating lines: an open convex polygon and a segment are disjoint where a line along a side of
    one of them has them on different sides, as 0 is then outside an edge of the polygon of
    differences, and each of its edges is parallel to one of theirs. Touching is not meeting.
    """
    corner = file.points[file.dropped[rows]]
    low, high = corner.min(axis=1), corner.max(axis=1)
    boxes = shapely.box(low[:, 0], low[:, 1], high[:, 0], high[:, 1])
    row, side = _pairs(boxes, file.blocked_by[rows].astype(np.int64), outlines)
    a, b, triangle = outlines.start[side], outlines.end[side], corner[row]
    apart = np.zeros(len(row), dtype=bool)
    for i in range(3):
        ends = (triangle[:, i], triangle[:, (i + 1) % 3])
        apart |= (orientation(*ends, a, exact=exact) <= 0) & (orientation(*ends, b, exact=exact) <= 0)
    turns = np.stack([orientation(a, b, triangle[:, i], exact=exact) for i in range(3)])
    # A side of no length has no line; its point belongs to the sides before and after it.
    apart |= ((turns >= 0).all(axis=0) | (turns <= 0).all(axis=0)) & (a != b).any(axis=1)
    hit = np.zeros(len(rows), dtype=bool)
    hit[row[~apart]] = True
    return hit


def _inside(file: CertificateFile, rows: Indices, outlines: _Outlines, exact: bool) -> Mask:
    """Whether the triangles lie inside the outline that each names, which must not meet them; same length.

    A ray to the right from a point of the open triangle crosses the outline an odd number of times. The
    point is (2 v0 + v1 + v2) / 4, a lattice point of a quarter of the unit, hence exact; no side runs
    through it, and a side counts with its lower end only.
    """
    corner = file.vertices[file.dropped[rows]]
    point = file.metres((corner.sum(axis=1) + corner[:, 0]) * 0.25)
    rays = shapely.box(
        point[:, 0], point[:, 1], max(outlines.right, float(point[:, 0].max(initial=0.0))), point[:, 1]
    )
    row, side = _pairs(rays, file.blocked_by[rows].astype(np.int64), outlines)
    a, b, p = outlines.start[side], outlines.end[side], point[row]
    upward, downward = (a[:, 1] <= p[:, 1]) & (b[:, 1] > p[:, 1]), (a[:, 1] > p[:, 1]) & (b[:, 1] <= p[:, 1])
    turn = orientation(a, b, p, exact=exact)
    crossed = (upward & (turn > 0)) | (downward & (turn < 0))
    return np.asarray(np.bincount(row, crossed, len(rows)).astype(np.int64) % 2 == 1)
