"""Proximity cells: which one a point lies in, and the foot coordinate along its feature."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vnav_drake.voronoi.curves import LINEAR, PARABOLA, Curves
from vnav_drake.world import World

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


def cell_of(world: World, points: ArrayLike) -> Indices:
    """Proximity cells (see `VoronoiDiagram`) that contain points (..., 2) [m]; shape (...)."""
    p = np.asarray(points, dtype=float)
    _, _, index = world.nearest(p)
    edges = len(world.edges)
    is_edge = index < edges
    if edges == 0:
        return 2 * edges + world.isolated[index]
    edge = world.edges[np.where(is_edge, index, 0)]
    a, b = world.vertices[edge[..., 0]], world.vertices[edge[..., 1]]
    along = b - a
    side = along[..., 0] * (p - a)[..., 1] - along[..., 1] * (p - a)[..., 0] < 0.0
    cell = 2 * index + side
    cell = np.where(np.sum((p - a) * along, axis=-1) <= 0.0, 2 * edges + edge[..., 0], cell)
    cell = np.where(np.sum((p - b) * along, axis=-1) >= 0.0, 2 * edges + edge[..., 1], cell)
    if len(world.isolated):
        lone = world.isolated[np.clip(index - edges, 0, len(world.isolated) - 1)]
        cell = np.where(is_edge, cell, 2 * edges + lone)
    return cell


def foot_coordinate(world: World, cell: int, curves: Curves) -> Array:
    """(n, 2) where the feet of curves' ends lie on the feature of a cell that they border or lie in.

    At an edge [m] from its first vertex. At a vertex the angle [rad] seen from it: curves keep their
    true turn, and start between 0 and 2 pi (halfway along) from the middle of the walls that meet
    there, so that a sector of free space has no jump; at an isolated point from the direction -x.
    """
    edges = len(world.edges)
    if cell < 2 * edges:
        a, b = world.vertices[world.edges[cell // 2]]
        along: Array = (curves.ends - a) @ ((b - a) / np.hypot(*(b - a)))
        return along
    vertex = cell - 2 * edges
    place = world.vertices[vertex]
    neighbours = world.edges[(world.edges == vertex).any(axis=1)].sum(axis=1) - vertex
    toward = world.vertices[neighbours] - place
    balance = (toward / np.hypot(toward[:, 0], toward[:, 1])[:, None]).sum(axis=0)
    reference = np.arctan2(balance[1], balance[0]) if len(neighbours) else np.pi
    middle = curves.middle
    offset, tangent = curves.points(middle) - place, curves.tangents(middle)
    angle = np.mod(np.arctan2(offset[:, 1], offset[:, 0]) - reference, 2.0 * np.pi)
    turn = np.sign(offset[:, 0] * tangent[:, 1] - offset[:, 1] * tangent[:, 0])
    # Seen from its focus a parabola turns by 2 atan(u / p), a line at distance h by atan(u / h).
    u = np.column_stack([curves.span, middle])
    is_secondary = curves.kind == LINEAR
    size = np.where(curves.size > 0.0, curves.size, 1.0)[:, None]
    seen = np.arctan(u / size) * np.where(curves.kind == PARABOLA, 2.0, 1.0)[:, None]
    swing = np.abs(seen[:, :2] - seen[:, 2:]) * np.array([-1.0, 1.0])
    return angle[:, None] + np.where(is_secondary[:, None], 0.0, turn[:, None] * swing)
