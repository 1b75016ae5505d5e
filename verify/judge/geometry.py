"""How far is a point from everything: distances from the scenario's own vertices, through Shapely.

Nothing here comes from the planners' `world` module: the judge builds its own geometry from the raw
numbers of the scenario file. Circles are exact circles here, not the polygons the planners see.
"""

from __future__ import annotations

from typing import Any, Self

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

CHUNK = 200_000  # pairs of points and circles handled at once


class Surroundings:
    """The hall's boundary and its obstacles as sets in the plane, with signed distances.

    The signed distance is the least over the obstacles of the distance to each (negative inside a
    polygon or circle) and of the distance to the outside of the hall (negative outside). It is
    1-Lipschitz, and where it is positive it is the distance to one closed set.
    """

    def __init__(self, boundary: ArrayLike, obstacles: list[Array], circles: ArrayLike) -> None:
        """Take raw numbers.

        Parameters
        ----------
        boundary : (n, 2) [m], a simple polygon, not closed by repetition.
        obstacles : (k, 2) [m] each; one vertex is a point, two a wall, three or more a polygon.
        circles : (c, 3) [m], centre x, centre y and radius.
        """
        hall = np.asarray(boundary, dtype=float)
        self._hall = shapely.Polygon(hall)
        shapely.prepare(self._hall)
        self._hall_tree = shapely.STRtree(_sides(hall))
        solids = [shapely.Polygon(vertices) for vertices in obstacles if len(vertices) >= 3]
        self._solids = np.array(solids, dtype=object)
        self._solid_tree = shapely.STRtree(solids)
        self._mass = shapely.union_all(solids) if solids else shapely.Polygon()
        shapely.prepare(self._mass)
        parts = [_sides(hall), *(_sides(vertices) for vertices in obstacles)]
        self._tree = shapely.STRtree(np.concatenate(parts))
        self._circles = np.asarray(circles, dtype=float).reshape(-1, 3)

    @classmethod
    def from_spec(cls, world: Any) -> Self:
        """From the `world` section of a scenario as parsed: raw vertices and circles."""
        vertices = [np.array(o.vertices, dtype=float) for o in world.obstacles if o.vertices]
        circles = [(*o.circle.center, o.circle.radius) for o in world.obstacles if o.circle is not None]
        return cls(world.boundary, vertices, circles)

    @property
    def largest_circle(self) -> float:
        """[m], radius of the largest circular obstacle; zero without one."""
        return float(self._circles[:, 2].max(initial=0.0))

    def boundary_distance(self, points: ArrayLike) -> Array:
        """Signed distance [m] of points (n, 2) [m] to the hall's boundary, negative outside; (n,)."""
        p = np.asarray(points, dtype=float)
        return _nearest(self._hall_tree, p) * np.where(self._within(self._hall, p), 1.0, -1.0)

    def distance(self, points: ArrayLike) -> Array:
        """Signed distance [m] of points (n, 2) [m] to the nearest obstacle or boundary; (n,)."""
        p = np.asarray(points, dtype=float)
        gap = _nearest(self._tree, p)
        outside = np.flatnonzero(~self._within(self._hall, p))
        gap[outside] = -_nearest(self._hall_tree, p[outside])
        buried = np.flatnonzero(self._within(self._mass, p))
        if buried.size:
            which, solid = self._solid_tree.query(shapely.points(p[buried]), predicate="intersects")
            depth = shapely.distance(shapely.points(p[buried[which]]), shapely.boundary(self._solids[solid]))
            gap[buried] = np.minimum(gap[buried], 0.0)
            np.minimum.at(gap, buried[which], -depth)
        return np.minimum(gap, self._circle_distance(p))

    def along(self, points: ArrayLike, first: ArrayLike) -> tuple[Array, Array]:
        """Least signed distance [m] along each of several polylines, and at each of their points.

        Exact where a polyline stays outside of everything. Where it does not, the distance is that of its
        deepest point, or 0 where it only crosses a side between two points.

        Parameters
        ----------
        points : (m, 2) [m]; first : (n + 1,) indices, polyline i has the points first[i]:first[i + 1], >= 2.

        Returns
        -------
        (n,), (m,)
        """
        p, begin = np.asarray(points, dtype=float), np.asarray(first, dtype=np.int64)
        at_points = self.distance(p)
        deepest = np.minimum.reduceat(at_points, begin[:-1])
        owner = np.repeat(np.arange(len(begin) - 1), np.diff(begin))
        between = _nearest_to(self._tree, shapely.linestrings(p, indices=owner))
        if len(self._circles):
            piece = np.delete(np.arange(len(p)), begin[1:] - 1)  # from each point to the next of its polyline
            gap = self._circle_distance_of_pieces(p[piece], p[piece + 1])
            between = np.minimum(between, np.minimum.reduceat(gap, begin[:-1] - np.arange(len(begin) - 1)))
        return np.minimum(between, deepest), at_points

    def _circle_distance_of_pieces(self, start: Array, end: Array) -> Array:
        """Least distance [m] of each straight piece from (k, 2) to (k, 2) to the circles; (k,)."""
        gap = np.empty(len(start))
        size = max(1, CHUNK // len(self._circles))
        for low in range(0, len(start), size):
            p, along = start[low : low + size, None, :], (end - start)[low : low + size, None, :]
            to_centre = self._circles[None, :, :2] - p
            square = np.sum(along * along, axis=2)
            part = np.sum(to_centre * along, axis=2)
            part = np.divide(part, square, out=np.zeros_like(part), where=square > 0.0)
            off = to_centre - np.clip(part, 0.0, 1.0)[..., None] * along
            gap[low : low + size] = (np.hypot(off[..., 0], off[..., 1]) - self._circles[:, 2]).min(axis=1)
        return gap

    @staticmethod
    def _within(area: shapely.Geometry, points: Array) -> NDArray[np.bool_]:
        return np.asarray(shapely.contains_xy(area, points[:, 0], points[:, 1]))

    def _circle_distance(self, points: Array) -> Array:
        gap = np.full(len(points), np.inf)
        if not len(self._circles):
            return gap
        size = max(1, CHUNK // len(self._circles))
        for first in range(0, len(points), size):
            p = points[first : first + size]
            offset = p[:, None, :] - self._circles[None, :, :2]
            away = np.hypot(offset[..., 0], offset[..., 1]) - self._circles[:, 2]
            gap[first : first + size] = away.min(axis=1)
        return gap


def _sides(vertices: Array) -> NDArray[np.object_]:
    """The sides of a polygon, the one of a wall, or the point itself, as Shapely geometries."""
    if len(vertices) == 1:
        return np.asarray(shapely.points(vertices))
    ends = np.stack([vertices, np.roll(vertices, -1, axis=0)], axis=1)
    return np.asarray(shapely.linestrings(ends[:1] if len(vertices) == 2 else ends))


def _nearest(tree: shapely.STRtree, points: Array) -> Array:
    return _nearest_to(tree, np.asarray(shapely.points(points))) if len(points) else np.empty(0)


def _nearest_to(tree: shapely.STRtree, shapes: NDArray[np.object_]) -> Array:
    """Distance [m] of each of one or more shapes to the nearest in the tree; (n,)."""
    found, gap = tree.query_nearest(shapes, all_matches=False, return_distance=True)
    ordered = np.empty(len(shapes))
    ordered[found[0]] = gap
    return ordered
