"""The free parts of a world and their Euler characteristics, from its geometry alone."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray

from vnav_drake.problem import PlanningError
from vnav_drake.voronoi.check import free_faces
from vnav_drake.world import World

QUARTER = 64  # chords of a quarter circle


def free_components(world: World, level: float) -> tuple[NDArray[np.object_], NDArray[np.int64]]:
    """Connected parts of {distance >= level} as polygons, and their Euler characteristics.

    A part has 1 minus the number of its holes. The features are widened by polygons inside and outside of
    the exact round ones, and both must agree; no Voronoi arc is used. The polygons are those of the wider
    ones, within the exact parts.

    Parameters
    ----------
    level : [m], zero or more. Zero means the open free space, walls and points without depth left out.

    Raises
    ------
    ValueError : `level` is negative or not finite.
    PlanningError : the two do not agree: the level is within 1e-4 of itself of one where parts join or end.
    """
    if not 0.0 <= level < np.inf:
        raise ValueError(f"level = {level!r}: must be zero or more and finite [m]")
    if level == 0.0:
        return free_faces(world)
    narrow, wide = (_parts(world, level * grown) for grown in (1.0, 1.0 / np.cos(np.pi / (4 * QUARTER))))
    holes = [np.array([len(p.interiors) for p in parts], dtype=np.int64) for parts in (narrow, wide)]
    if len(narrow) == len(wide):
        part, inside = shapely.STRtree(narrow).query(shapely.point_on_surface(wide), predicate="within")
        if np.array_equal(part, np.arange(len(wide))) and len(np.unique(inside)) == len(narrow):
            same = bool((holes[0][inside] == holes[1]).all())
            if same:
                return wide, 1 - holes[1]
    raise PlanningError(f"free space changes its topology too close to distance {level:.9g} m to tell")


def euler_characteristic(world: World, level: float) -> tuple[int, ...]:
    """Components minus holes of each free part, in the order of `free_components`, which see."""
    return tuple(int(c) for c in free_components(world, level)[1])


def _parts(world: World, reach: float) -> NDArray[np.object_]:
    lines = shapely.linestrings(world.vertices[world.edges])
    points = shapely.points(world.vertices[world.isolated])
    grown = shapely.buffer(np.concatenate([lines, points]), reach, quad_segs=QUARTER)
    free = shapely.difference(world.floor, shapely.union_all(grown))
    parts = shapely.get_parts(free)
    return parts[shapely.get_type_id(parts) == shapely.GeometryType.POLYGON]
