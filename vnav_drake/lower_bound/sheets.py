"""Triangles that a wall without thickness cuts through stand twice, so that u may jump across it.

For a point robot V = 0 only on the wall itself, and the time to the other side is finite in ds/V: a
continuous u could prove no more than the way through the wall. For a disc the strip where V = 0 is as wide as
the disc, but it is dropped only where triangles are smaller than that. A motion keeps clear of the wall,
though, so it sees only one side of a cut triangle. Each side has a copy of the triangle, with control values
of its own, and copies are joined where a motion can get from one into the other: at every
edge that has a point in both parts.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from vnav_drake.lower_bound.cover import Cover
from vnav_drake.lower_bound.exact import orientation, side_of, within_ends
from vnav_drake.lower_bound.mesh import edges_of

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]

WHOLE = 0  # instead of a side


@dataclass(frozen=True, eq=False)
class Sheets:
    """The kept triangles, those that a wall cuts through twice."""

    rows: Indices  # (c,), row of the mesh
    side: Indices  # (c,), `WHOLE`, or f + 1 left and -(f + 1) right of feature f
    corner: Indices  # (c, 3), vertices: those of the mesh come first, further copies of them follow
    place: Indices  # (n,), vertex of the mesh of each vertex

    def at(self, row: int, cover: Cover, point: Array) -> int:
        """Which of the copies of mesh triangle `row` a point (2,) [m] in it belongs to."""
        for copy in np.flatnonzero(self.rows == row):
            side = int(self.side[copy])
            if side == WHOLE or _signs(cover, np.array([abs(side) - 1]), point)[0] * side > 0:
                return int(copy)
        raise ValueError("the point lies on the wall that cuts its triangle")  # see `_walls`


def sheets(cover: Cover) -> Sheets:
    """All kept triangles, once or twice."""
    kept = cover.kept
    walls = _walls(cover)
    if not len(walls):
        corner = cover.mesh.triangles[kept]
        return Sheets(kept, np.zeros(len(kept), np.int64), corner, np.arange(len(cover.mesh.vertices)))
    cut = _cutting(cover, kept, walls)
    twice = np.flatnonzero(cut >= 0)
    first = np.where(cut >= 0, cut + 1, WHOLE)
    rows = np.concatenate([kept, kept[twice]])
    side = np.concatenate([first, -first[twice]])
    other = np.full(len(kept), -1)
    other[twice] = len(kept) + np.arange(len(twice))
    return _joined(cover, rows, side, _meetings(cover, kept, walls, side, other))


def _walls(cover: Cover) -> Indices:
    """Features that are walls to be told apart by their sides; none where the robot keeps a margin.

    With an end on a wall there is no telling on which side a motion sets out.
    """
    ground = cover.ground
    walls = np.flatnonzero(ground.features.walls)
    if ground.law.braking.margin > 0.0:
        return walls[:0]
    a, b = _ends(cover, walls)
    for end in (ground.start, ground.goal):
        if ((side_of(a, b, end) == 0) & within_ends(a, b, end)).any():
            return walls[:0]
    return walls


def _ends(cover: Cover, features: Indices) -> tuple[Array, Array]:
    table = cover.ground.features.table[features]
    return table[:, :2], table[:, 2:4]


def _signs(cover: Cover, features: Indices, points: Array) -> Indices:
    """Sides of points (n, 2) [m] of the lines of features (n,)."""
    return side_of(*_ends(cover, features), points)


def _cutting(cover: Cover, kept: Indices, walls: Indices) -> Indices:
    """For each kept triangle a wall that cuts it in two, from side to side, or -1; (k,)."""
    corners = cover.corners(kept)
    a, b = _ends(cover, walls)
    lines = shapely.linestrings(np.stack([a, b], axis=1))
    triangle, which = shapely.STRtree(shapely.polygons(corners)).query(lines)[::-1]
    wall, three = walls[which], corners[triangle]
    a, b = _ends(cover, wall)
    sign = side_of(a[:, None], b[:, None], three)  # (pairs, 3)
    through = (sign.max(axis=1) > 0) & (sign.min(axis=1) < 0)
    for i in range(3):
        j = (i + 1) % 3
        crossed = sign[:, i] * sign[:, j] < 0  # the chord ends on this side: it must be on the wall
        ends = [side_of(three[:, i], three[:, j], end) for end in (a, b)]
        through &= ~crossed | (ends[0] * ends[1] <= 0)
        through &= (sign[:, i] != 0) | within_ends(a, b, three[:, i])
    cut = np.full(len(kept), -1)
    cut[triangle[through][::-1]] = wall[through][::-1]
    return cut


def _meetings(
    cover: Cover, kept: Indices, walls: Indices, side: Indices, other: Indices
) -> tuple[Indices, Indices]:
    """Pairs of corners, numbered 3 copy + corner, that are one vertex.

    `other` (k,) is the second copy of each kept triangle, -1 without one.
    """
    triangles = cover.mesh.triangles[kept]
    edge, of_edge = edges_of(triangles)
    order = np.argsort(of_edge.ravel(), kind="stable")
    shared = np.flatnonzero(np.bincount(of_edge.ravel()) == 2)
    begin = np.searchsorted(of_edge.ravel()[order], shared)
    one, two = order[begin], order[begin + 1]  # 3 triangle + opposite corner, on both sides of each edge
    passable = ~_on_wall(cover, edge[shared], walls)
    one, two, shared = one[passable], two[passable], shared[passable]
    pairs: list[tuple[Indices, Indices]] = []
    for first in (False, True):
        for second in (False, True):
            a, b = (np.where(flag, other[k // 3], k // 3) for flag, k in ((first, one), (second, two)))
            meet = np.flatnonzero((a >= 0) & (b >= 0))
            meet = meet[_touch(cover, edge[shared[meet]], side[a[meet]], side[b[meet]])]
            for end in range(2):
                vertex = edge[shared[meet], end][:, None]
                pairs.append(
                    (
                        3 * a[meet] + np.argmax(triangles[one[meet] // 3] == vertex, axis=1),
                        3 * b[meet] + np.argmax(triangles[two[meet] // 3] == vertex, axis=1),
                    )
                )
    return np.concatenate([p[0] for p in pairs]), np.concatenate([p[1] for p in pairs])


def _on_wall(cover: Cover, edge: Indices, walls: Indices) -> Mask:
    """Which edges (e, 2) lie on a wall all along: nobody crosses them."""
    points = cover.mesh.points[edge]
    a, b = _ends(cover, walls)
    lines = shapely.linestrings(np.stack([a, b], axis=1))
    which, wall = shapely.STRtree(lines).query(shapely.linestrings(points))
    a, b = _ends(cover, walls[wall])
    on = np.ones(len(which), dtype=bool)
    for end in range(2):
        p = points[which, end]
        on &= (side_of(a, b, p) == 0) & within_ends(a, b, p)
    found = np.zeros(len(edge), dtype=bool)
    found[which[on]] = True
    return found


def _touch(cover: Cover, edge: Indices, one: Indices, two: Indices) -> Mask:
    """Whether the parts of two copies, by their sides (e,), have a point of an edge (e, 2) in common."""
    ends = cover.mesh.points[edge]
    inside = np.ones((2, len(edge), 2), dtype=np.int64)  # copy, edge, end
    for k, side in enumerate((one, two)):
        part = np.flatnonzero(side != WHOLE)
        wall = np.abs(side[part]) - 1
        for end in range(2):
            inside[k, part, end] = np.sign(side[part]) * _signs(cover, wall, ends[part, end])
    held: Mask = inside > 0
    meet: Mask = np.any(np.all(held, axis=0), axis=1)
    # Each part holds another end: they meet if they overlap between them.
    for e in np.flatnonzero(~meet & np.all(np.any(held, axis=2), axis=0)):
        meet[e] = _overlap(cover, ends[e], int(one[e]), int(two[e]))
    return meet


def _overlap(cover: Cover, ends: Array, one: int, two: int) -> bool:
    """Whether two half-lines along an edge that begin at different ends of it overlap."""
    share = Fraction(0)  # of the edge that is in either part
    for side in (one, two):
        (a,), (b,) = _ends(cover, np.array([abs(side) - 1]))
        value = [(1 if side > 0 else -1) * orientation(a, b, end) for end in ends]
        share += max(value) / (max(value) - min(value))
    return share > 1


def _joined(cover: Cover, rows: Indices, side: Indices, meetings: tuple[Indices, Indices]) -> Sheets:
    """Corners that meet get one number: that of the mesh for one copy, further numbers for others."""
    count = 3 * len(rows)
    graph = coo_array((np.ones(len(meetings[0])), meetings), shape=(count, count))
    label = connected_components(graph, directed=False)[1]
    place_of = cover.mesh.triangles[rows].ravel()
    _, first = np.unique(label, return_index=True)
    place = place_of[first]  # of each label
    number = np.empty(len(place), dtype=np.int64)
    _, leading = np.unique(place, return_index=True)
    further = np.ones(len(place), dtype=bool)
    further[leading] = False
    total = len(cover.mesh.vertices)
    number[leading] = place[leading]
    number[further] = total + np.arange(int(further.sum()))
    return Sheets(
        rows, side, number[label].reshape(-1, 3), np.concatenate([np.arange(total), place[further]])
    )
