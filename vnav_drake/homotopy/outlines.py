"""Which obstacle of a scenario a point of the walls belongs to, what it is called, and where on it."""

from __future__ import annotations

import re
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray

from vnav_drake.world import SNAP, World

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

BOUNDARY = "boundary"
DIRECT = "direct"
ON_OUTLINE = 10.0 * SNAP  # [m]: a point this near to an outline lies on it; uniting moves vertices by SNAP

# A name that can stand in a class name: nothing that separates, marks or counts tokens.
_PLAIN = re.compile(r"(?![-#\s])[^,/\r\n]*(?<!\s)")
_COUNTED = re.compile(r".*\.\d+")


def obstacle_names(world: World) -> tuple[str, ...]:
    """Names of the obstacles as given, then that of the outer boundary.

    Obstacles without a name, or with one that cannot stand in the name of a class (empty, "boundary",
    "direct", with "/" or ",", beginning with "-", "#" or a space, ending with a space or "." and digits),
    are called "#1", "#2", ... by their place in the scenario.
    """
    given = (o.name for o in world.obstacles)
    return (*(n if _stands(n) else f"#{i}" for i, n in enumerate(given, start=1)), BOUNDARY)


def _stands(name: str) -> bool:
    plain = bool(name) and _PLAIN.fullmatch(name) is not None and _COUNTED.fullmatch(name) is None
    return plain and name not in {BOUNDARY, DIRECT}


class Outlines:
    """The outlines of all obstacles as given, the outer boundary last."""

    def __init__(self, world: World) -> None:
        rings = [np.asarray(o.vertices, dtype=float) for o in world.obstacles]
        rings.append(shapely.get_coordinates(world.boundary.exterior)[:-1])
        self._lines = np.array([_outline(ring) for ring in rings], dtype=object)
        self._closed = np.array([len(ring) > 2 for ring in rings])
        self._is_point = np.array([len(ring) == 1 for ring in rings])

    @cached_property
    def _tree(self) -> shapely.STRtree:
        return shapely.STRtree(self._lines)

    def owner(self, points: Array) -> Indices:
        """Index (n,) of the obstacle whose outline holds each point (n, 2): the first of several."""
        spots = shapely.points(points)
        near, which = self._tree.query(spots, predicate="dwithin", distance=ON_OUTLINE)
        found = np.full(len(points), len(self._lines))
        np.minimum.at(found, near, which)
        lost = np.flatnonzero(found == len(self._lines))
        if len(lost):
            found[lost] = self._tree.query_nearest(spots[lost], all_matches=False)[1]
        return found

    def position(self, which: Indices, points: Array) -> Array:
        """Arc length [m] (n,) of points (n, 2) along outlines, from their first vertex as given.

        It runs in the order in which the vertices are given, so that it does not change when the
        whole scenario is moved, turned or mirrored. Zero at a point obstacle.
        """
        along = np.zeros(len(points))
        long = ~self._is_point[which]
        along[long] = shapely.line_locate_point(self._lines[which[long]], shapely.points(points[long]))
        closing = self._closed[which] & (along >= shapely.length(self._lines[which]) - ON_OUTLINE)
        return np.where(closing, 0.0, along)

    def circumference(self, which: Indices) -> Array:
        """Length [m] (n,) after which positions begin anew; infinite for walls and points."""
        return np.where(self._closed[which], shapely.length(self._lines[which]), np.inf)


def _outline(ring: Array) -> shapely.Geometry:
    if len(ring) == 1:
        return shapely.Point(ring[0])
    return shapely.LineString(ring if len(ring) == 2 else np.concatenate([ring, ring[:1]]))
