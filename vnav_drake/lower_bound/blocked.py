"""Which triangles no motion can enter: near one feature all over, or within what is solid."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray

from vnav_drake.lower_bound.features import Features
from vnav_drake.world import World

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

FREE = np.iinfo(np.int64).min  # instead of a reason: the triangle is kept
OUTSIDE = -1  # reason: outside the boundary; -2 - k: inside polygon obstacle k; f >= 0: near feature f
ROUNDING = 1e-13  # relative: nearer than the level by this much, so that another rounding agrees


class Solids:
    """The outside of the boundary and the insides of polygon obstacles."""

    def __init__(self, world: World) -> None:
        self._hall = world.boundary
        shapely.prepare(self._hall)
        polygon: list[shapely.Polygon] = []
        self._index: list[int] = []
        for k, obstacle in enumerate(world.obstacles):
            if obstacle.circle is None and len(obstacle.vertices) >= 3:
                polygon.append(shapely.Polygon(obstacle.vertices))
                self._index.append(k)
        self._polygon = np.array(polygon, dtype=object)
        shapely.prepare(self._polygon)
        self._tree = shapely.STRtree(polygon)

    def reasons(self, corners: Array) -> Indices:
        """Why triangles (t, 3, 2) [m] are solid, or `FREE`; (t,)."""
        found = np.full(len(corners), FREE)
        middle = shapely.points(corners.mean(axis=1))
        which, solid = self._tree.query(middle, predicate="within")
        triangle = shapely.polygons(corners)
        covered = shapely.covers(self._polygon[solid], triangle[which])
        found[which[covered]] = -2 - np.array(self._index, dtype=np.int64)[solid[covered]]
        away = np.flatnonzero(~shapely.intersects(self._hall, middle))
        apart = shapely.relate_pattern(self._hall, triangle[away], "F********")
        found[away[apart]] = OUTSIDE
        return found


def blocked_by(
    features: Features, solids: Solids, level: float, corners: Array, distance: Array, candidate: Indices
) -> Indices:
    """Why triangles (t, 3, 2) [m] are blocked, or `FREE`; (t,).

    Parameters
    ----------
    level : [m], distance to a feature where the safe speed is zero.
    distance, candidate : (t, c, 3) [m] and (t, c), corners to candidate features.
    """
    size = float(np.abs(features.table).max())
    deep = distance.max(axis=2) <= level * (1.0 - ROUNDING) - ROUNDING * size
    which = np.argmax(deep, axis=1)
    near = deep[np.arange(len(deep)), which]
    reason = np.where(near, candidate[np.arange(len(deep)), which], FREE)
    rest = np.flatnonzero(~near)
    reason[rest] = solids.reasons(corners[rest])
    return reason
