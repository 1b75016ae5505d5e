"""What the robot must keep away from, as convex sets: sides, walls, points and discs, as given.

Obstacles are not united here. A side inside another obstacle is part of what blocks the way, so the
distance to it is still an upper bound of the true distance, which is all that a lower bound needs.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray

from vnav_drake.world import World

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Features:
    """Segments, each widened to all points within its radius r of it; a disc is a segment of length zero."""

    table: Array  # (f, 5) [m]: ends a and b, radius r; the boundary's sides first, then obstacle by obstacle
    walls: Mask  # (f,), obstacles without thickness that part what is on both sides

    @classmethod
    def of(cls, world: World) -> Features:
        """The features of a world as it was given."""
        parts = [_sides(shapely.get_coordinates(world.boundary.exterior)[:-1])]
        wall = [np.zeros(len(parts[0]), dtype=bool)]
        for obstacle in world.obstacles:
            if obstacle.circle is not None:
                x, y, radius = obstacle.circle
                parts.append(np.array([[x, y, x, y, radius]]))
            else:
                parts.append(_sides(np.array(obstacle.vertices, dtype=float)))
            wall.append(np.full(len(parts[-1]), len(obstacle.vertices) == 2))
        return cls(np.concatenate(parts), np.concatenate(wall))

    @cached_property
    def _tree(self) -> shapely.STRtree:
        a, b, r = self.table[:, :2], self.table[:, 2:4], self.table[:, 4]
        shapes = shapely.linestrings(np.stack([a, b], axis=1))
        dots = (a == b).all(axis=1)
        shapes[dots] = shapely.buffer(shapely.points(a[dots]), r[dots], quad_segs=24)
        shapes[dots & (r == 0.0)] = shapely.points(a[dots & (r == 0.0)])
        return shapely.STRtree(shapes, node_capacity=4)

    def nearest(self, points: Array) -> Indices:
        """Row of the nearest feature of points (n, 2) [m]; (n,). Discs are seen as polygons here."""
        return np.asarray(self._tree.query_nearest(shapely.points(points), all_matches=False)[1])

    def within(self, points: Array, far: Array) -> tuple[Indices, Indices]:
        """All pairs of a point (n, 2) [m] and a feature at most `far` (n,) [m] from it: rows of both."""
        row, which = self._tree.query(shapely.points(points), predicate="dwithin", distance=far)
        return np.asarray(row), np.asarray(which)

    def distance(self, points: Array, which: Indices) -> Array:
        """Distance [m] of points (..., 2) [m] to feature `which` (...), negative within a disc; (...)."""
        a, b, r = self.table[which, :2], self.table[which, 2:4], self.table[which, 4]
        along = b - a
        square = np.einsum("...i,...i->...", along, along)
        part = np.einsum("...i,...i->...", points - a, along) / np.where(square > 0.0, square, 1.0)
        gap = points - (a + np.clip(part, 0.0, 1.0)[..., None] * along)
        return np.asarray(np.hypot(gap[..., 0], gap[..., 1]) - r)


def _sides(vertices: Array) -> Array:
    """Sides of a polygon, the one of a wall, or the point itself, as rows of the table."""
    ends = np.roll(vertices, -1, axis=0)
    rows = np.concatenate([vertices, ends, np.zeros((len(vertices), 1))], axis=1)
    return rows[:1] if len(vertices) == 2 else rows
