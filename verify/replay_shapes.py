"""Triangles of the replay: floor plans extruded, paths as ribbons on the floor, discs and rings.

A mesh is an array (n, 3, 3) [m]: n triangles of three corners each. No corner is shared, so that every face
gets a normal of its own and edges look sharp.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from vnav_drake.world import World

Array = NDArray[np.float64]

WALL_SHARE = 1.0 / 350.0  # thickness of walls and posts, which have none, over the world's diameter
MITRE = 3.0  # greatest widening of a ribbon at a bend


def drawn_thickness(world: World) -> float:
    """Thickness [m] with which walls and points are drawn, as they have none of their own."""
    return WALL_SHARE * world.diameter


def solids(world: World) -> list[shapely.Polygon]:
    """Floor plans of what stands on the floor: polygons as they are, walls and points thickened."""
    half = 0.5 * drawn_thickness(world)
    walls = shapely.linestrings(np.asarray(world.walls, dtype=float).reshape(-1, 2, 2))
    posts = shapely.points(world.vertices[world.isolated])
    around = [
        *shapely.buffer(walls, half, cap_style="square", join_style="mitre"),
        *shapely.buffer(posts, 1.5 * half, quad_segs=4),
    ]
    return [*world.blocked, *polygons(shapely.intersection(shapely.union_all(around), world.boundary))]


def outer_wall(world: World) -> list[shapely.Polygon]:
    """The wall around the floor, outside of it."""
    around = world.boundary.buffer(drawn_thickness(world), join_style="mitre")
    return polygons(shapely.difference(around, world.boundary))


def polygons(shape: shapely.Geometry) -> list[shapely.Polygon]:
    """The polygons of a geometry that have an area."""
    return [part for part in shapely.get_parts(shape) if isinstance(part, shapely.Polygon) and part.area > 0]


def plate(shapes: Sequence[shapely.Polygon], height: float) -> Array:
    """Polygons, holes left out, as triangles (n, 3, 3) [m] at `height` [m] that look upwards."""
    if not shapes:
        return np.zeros((0, 3, 3))
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(np.asarray(shapes, dtype=object)))
    triangles = shapely.get_parts(triangles)  # collections of each polygon first
    flat = shapely.get_coordinates(triangles).reshape(-1, 4, 2)[:, :3]
    one, other = flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0]
    clockwise = one[:, 0] * other[:, 1] < one[:, 1] * other[:, 0]
    flat[clockwise] = flat[clockwise, ::-1]
    return np.concatenate([flat, np.full((*flat.shape[:2], 1), height)], axis=-1)


def outlines(shapes: Sequence[shapely.Polygon]) -> Array:
    """All edges (n, 2, 2) [m] of polygons, the solid to the left."""
    rings, edges = shapely.get_rings(shapely.orient_polygons(np.asarray(shapes, dtype=object))), []
    for ring in rings:
        corners = shapely.get_coordinates(ring)
        edges.append(np.stack([corners[:-1], corners[1:]], axis=1))
    return np.concatenate([np.zeros((0, 2, 2)), *edges])


def extruded(shapes: Sequence[shapely.Polygon], height: float) -> Array:
    """Polygons as solids from the floor to `height` [m], without their undersides: (n, 3, 3) [m]."""
    edges = outlines(shapes)
    foot = np.concatenate([edges, np.zeros((len(edges), 2, 1))], axis=-1)
    top = foot + np.array([0.0, 0.0, height])
    lower = np.stack([foot[:, 0], foot[:, 1], top[:, 1]], axis=1)
    upper = np.stack([foot[:, 0], top[:, 1], top[:, 0]], axis=1)
    return np.concatenate([plate(shapes, height), lower, upper])


def ribbon(points: ArrayLike, half_width: float, height: float) -> tuple[Array, NDArray[np.int64]]:
    """A flat band along a line on the floor.

    Parameters
    ----------
    points : (n, 2) [m], n >= 2; a point that repeats the one before is passed over.
    half_width : [m];  height : [m], above the floor.

    Returns
    -------
    Triangles (m, 3, 3) [m] that look upwards, and (m, 3) the row of `points` that each corner belongs to.
    Empty for a line without length.

    Notes
    -----
    At a bend of angle b the corners lie half_width / cos(b / 2) off, on the bisector, as in a mitre joint,
    but at most `MITRE` times as far.
    """
    line = np.asarray(points, dtype=float)
    moved = np.append(True, np.any(np.diff(line, axis=0) != 0.0, axis=1))
    rows = np.flatnonzero(moved)
    line = line[rows]
    if len(line) < 2:
        return np.zeros((0, 3, 3)), np.zeros((0, 3), dtype=np.int64)
    step = np.diff(line, axis=0)
    step /= np.hypot(step[:, 0], step[:, 1])[:, None]
    before, after = np.vstack([step[:1], step]), np.vstack([step, step[-1:]])
    along = before + after
    size = np.hypot(along[:, 0], along[:, 1])  # 2 cos(b / 2)
    turned_back = size < 2.0 / MITRE
    along = np.where(turned_back[:, None], before, along / np.where(turned_back, 1.0, size)[:, None])
    off = half_width * np.where(turned_back, 1.0, 2.0 / np.where(turned_back, 1.0, size))
    left = line + off[:, None] * np.column_stack([-along[:, 1], along[:, 0]])
    right = 2.0 * line - left
    flat = np.concatenate(
        [
            np.stack([right[:-1], right[1:], left[1:]], axis=1),
            np.stack([right[:-1], left[1:], left[:-1]], axis=1),
        ]
    )
    i = np.arange(len(line) - 1)
    owner = np.concatenate([np.stack([i, i + 1, i + 1], axis=1), np.stack([i, i + 1, i], axis=1)])
    return np.concatenate([flat, np.full((*flat.shape[:2], 1), height)], axis=-1), rows[owner]


def fan(outline: Array, height: float) -> Array:
    """A convex outline (k, 2) [m] around the origin, filled: triangles (k, 3, 3) [m] that look upwards."""
    a, b = outline, np.roll(outline, -1, axis=0)
    flat = np.stack([np.zeros_like(a), a, b], axis=1)
    return np.concatenate([flat, np.full((*flat.shape[:2], 1), height)], axis=-1)


def rim(outline: Array, share: float, height: float) -> Array:
    """The rim of a convex outline (k, 2) [m], from `share` of it outwards: triangles that look upwards."""
    a, b = outline, np.roll(outline, -1, axis=0)
    flat = np.concatenate([np.stack([share * a, a, b], axis=1), np.stack([share * a, b, share * b], axis=1)])
    return np.concatenate([flat, np.full((*flat.shape[:2], 1), height)], axis=-1)


def ring(inner: float, outer: float, height: float, centre: ArrayLike = (0.0, 0.0), sides: int = 72) -> Array:
    """A flat ring, a disc where `inner` is 0: triangles (n, 3, 3) [m] that look upwards."""
    angle = 2.0 * math.pi * np.arange(sides + 1) / sides
    unit = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(sides + 1)])
    a, b = inner * unit, outer * unit
    faces = [np.stack([a[:-1], b[:-1], b[1:]], axis=1)]
    if inner > 0.0:
        faces.append(np.stack([a[:-1], b[1:], a[1:]], axis=1))
    return np.concatenate(faces) + np.append(np.asarray(centre, dtype=float), height)
