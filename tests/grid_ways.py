"""Ways to drive found on a grid, and proven times along them: upper bounds without any planner."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from tests.worlds import distance_by_shapely
from vnav_drake.problem import Problem

Array = NDArray[np.float64]

REACH = 3  # [cells] that an edge of the grid's graph spans at most, along each axis
SAMPLES = 4  # of clearance along an edge
LEAST = 0.01  # [m] of clearance at these
FINE = 0.002  # [m] between samples of clearance along a way


def safe_speed(problem: Problem, clearance: Array) -> Array:
    """Root [m/s] of v t_r + v^2/(2 a_b) + m = d (Manor 2015, eq. (3.13), with lag, margin), at most v_max."""
    law = problem.braking
    lag, room = law.max_braking * law.reaction_time, np.maximum(clearance - law.margin, 0.0)
    return np.minimum(np.sqrt(lag**2 + 2.0 * law.max_braking * room) - lag, law.max_speed)


def clearance_of(problem: Problem, points: Array) -> Array:
    """Clearance (...) [m] at points (..., 2), by Shapely from the obstacles as given."""
    world = problem.world
    boundary = shapely.get_coordinates(world.boundary.exterior)[:-1]
    flat = distance_by_shapely(boundary, list(world.obstacles), points.reshape(-1, 2))
    return np.asarray(flat - problem.robot.radius).reshape(points.shape[:-1])


def grid(problem: Problem, cells: int) -> tuple[Array, float]:
    """Nodes (rows, columns, 2) [m] over the world's bounds, and their distance [m]."""
    x0, y0, x1, y1 = problem.world.bounds
    cell = max(x1 - x0, y1 - y0) / cells
    x, y = np.arange(x0, x1 + 0.5 * cell, cell), np.arange(y0, y1 + 0.5 * cell, cell)
    return np.stack(np.meshgrid(x, y), axis=-1), cell


def way_on_grid(problem: Problem, cells: int) -> Array:
    """Corners (n, 2) [m] of a fast polyline from goal to start; (0, 2) when the grid shows none."""
    nodes, cell = grid(problem, cells)
    count, number = nodes.shape[0] * nodes.shape[1], np.arange(nodes.shape[0] * nodes.shape[1])
    points = np.concatenate([nodes.reshape(-1, 2), [problem.start.point, problem.goal.point]])
    free = clearance_of(problem, points) > LEAST
    row, column = np.divmod(number, nodes.shape[1])
    tail, head = [], []
    for i in range(REACH + 1):
        for j in range(-REACH, REACH + 1):
            if math.gcd(i, j) == 1 and (i > 0 or j > 0):
                inside = (row + i < nodes.shape[0]) & (column + j >= 0) & (column + j < nodes.shape[1])
                tail.append(number[inside])
                head.append(number[inside] + i * nodes.shape[1] + j)
    for end in (count, count + 1):
        near = np.flatnonzero(np.hypot(*(points[:count] - points[end]).T) < REACH * cell)
        tail.append(np.full(len(near), end))
        head.append(near)
    ends = np.stack([np.concatenate(tail), np.concatenate(head)], axis=1)
    ends = ends[free[ends].all(axis=1)]
    a, b = points[ends[:, 0]], points[ends[:, 1]]
    share = np.linspace(0.0, 1.0, SAMPLES)[:, None]
    clearance = clearance_of(problem, a[:, None] + share * (b - a)[:, None])
    passable = clearance.min(axis=1) > LEAST
    slowness = (1.0 / safe_speed(problem, clearance[passable])).mean(axis=1)
    ends, weight = ends[passable], np.hypot(*(b - a)[passable].T) * slowness
    matrix = coo_array((weight, (ends[:, 0], ends[:, 1])), shape=(count + 2, count + 2)).tocsr()
    _, before = dijkstra(matrix, directed=False, indices=count, return_predecessors=True)
    if before[count + 1] < 0:
        return np.empty((0, 2))
    chain = [count + 1]
    while chain[-1] != count:
        chain.append(int(before[chain[-1]]))
    return np.asarray(points[chain])


def time_at_most(problem: Problem, corners: Array) -> float:
    """A proven upper bound [s] of the time along a polyline with these corners (n, 2) [m], n >= 2.

    Derived: clearance is 1-Lipschitz, so between two places h apart with clearances d0 and d1 it is nowhere
    below (d0 + d1 - h)/2, and the piece takes at most h / V((d0 + d1 - h)/2).
    """
    pieces = [
        np.linspace(a, b, max(1, math.ceil(math.dist(a, b) / FINE)) + 1)[:-1] for a, b in pairwise(corners)
    ]
    points = np.concatenate([*pieces, corners[-1:]])
    clearance, h = clearance_of(problem, points), np.hypot(*np.diff(points, axis=0).T)
    least = safe_speed(problem, 0.5 * (clearance[1:] + clearance[:-1] - h))
    with np.errstate(divide="ignore"):
        return float((h / least).sum())
