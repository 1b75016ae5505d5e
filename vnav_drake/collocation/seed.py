"""From any safe path to a first guess for the program."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from vnav_drake.collocation.mesh import Mesh
from vnav_drake.collocation.program import LEAST_SPEED
from vnav_drake.plan import Path
from vnav_drake.problem import Problem
from vnav_drake.speed_profile import KINK_TOLERANCE
from vnav_drake.zones.speed import safe_speed

Array = NDArray[np.float64]

SAMPLES = 72  # of the seed, between which straight legs may cut corners
LEG_POINTS = 24  # midpoints at which a leg's travel time is summed
MOST_PIECES = 400  # a smooth seed with no more arcs than this is its own mesh
GRID = 50  # samples an interval on which the knots are placed
SEED_SPEED = 0.95  # of the safe speed: strictly inside the limits


@dataclass(frozen=True)
class Seed:
    """A path from start to goal to begin with, and the method it is from."""

    path: Path
    method: str = "given"
    travel_time: float | None = None  # [s], of what it leads to in the variational model, where known
    homotopy_class: str = ""  # its name, where known
    as_mesh: bool = (
        True  # its own arcs are the first mesh, where it is smooth and has no more than MOST_PIECES
    )
    far: bool = False  # known to go a long way round: short-cut first, as kinked ones are


def first_mesh(
    problem: Problem, seed: Path, intervals: int, *, as_mesh: bool = True, far: bool = False
) -> Mesh:
    """A guess from `seed`: its own arcs when it is smooth and coarse, else arcs along it or a short cut.

    Intervals of a smooth and coarse seed are no longer than the path's length over `intervals`. A smooth
    seed of many arcs, or whose arcs say nothing about a mesh, gives `intervals` knots on itself with its
    headings; a kinked one, or one that goes far round, is short-cut first.
    """
    smooth = not far and bool(np.all(np.abs(seed.kinks) <= KINK_TOLERANCE))
    if smooth and as_mesh and len(seed.curvature) <= MOST_PIECES:
        parts = np.ceil(seed.piece_length / seed.length * intervals * (1.0 - 1e-9)).astype(np.int64)
        seed = seed.subdivided(np.maximum(parts, 1))
        theta = np.append(seed.heading, seed.end_heading[-1])
        shares = seed.piece_length / seed.length
        return _with_speed(problem, Mesh(shares, seed.x, seed.y, theta, np.ones(len(theta)), seed.length))
    short = seed if smooth else shortcut(problem, seed)
    s = _knots(problem, short, intervals)
    x, y, theta, _ = short.at(s)
    if smooth:
        return _with_speed(
            problem, Mesh(np.diff(s) / short.length, x, y, theta, np.ones(len(x)), short.length)
        )
    chord = np.unwrap(np.arctan2(np.diff(y), np.diff(x)))
    theta = np.concatenate([chord[:1], 0.5 * (chord[1:] + chord[:-1]), chord[-1:]])
    shares = np.diff(s) / short.length
    return _with_speed(problem, Mesh(shares, x, y, theta, np.ones(len(x)), short.length))


def shortcut(problem: Problem, seed: Path) -> Path:
    """The fastest polyline through samples of `seed` at the safe speed, by dynamic programming.

    Legs between neighbouring samples follow the seed, so the result is never slower than the seed by
    more than the quadrature error; other legs are straight and clear of every obstacle.
    """
    x, y, _, _ = seed.at(np.linspace(0.0, seed.length, SAMPLES))
    points = np.column_stack([x, y])
    i, j = np.triu_indices(SAMPLES, 1)
    lines = shapely.linestrings(np.stack([points[i], points[j]], axis=1))
    hit = problem.world.edge_tree.query(lines, predicate="dwithin", distance=problem.robot.radius)[0]
    free = np.ones(len(i), dtype=bool)
    free[hit] = False
    free |= j == i + 1
    i, j = i[free], j[free]
    part = (np.arange(LEG_POINTS) + 0.5) / LEG_POINTS
    along = points[i, None] + part[None, :, None] * (points[j] - points[i])[:, None]
    speed = np.maximum(problem.safe_speed(along), LEAST_SPEED)
    cost = np.hypot(*(points[j] - points[i]).T) * np.mean(1.0 / speed, axis=1)
    best, before = np.full(SAMPLES, math.inf), np.zeros(SAMPLES, dtype=np.int64)
    best[0] = 0.0
    order = np.argsort(j, kind="stable")
    begins = np.searchsorted(j[order], np.arange(SAMPLES + 1))
    for k in range(1, SAMPLES):
        legs = order[begins[k] : begins[k + 1]]
        total = best[i[legs]] + cost[legs]
        least = int(np.argmin(total))
        best[k], before[k] = total[least], i[legs[least]]
    chain = [SAMPLES - 1]
    while chain[-1] > 0:
        chain.append(int(before[chain[-1]]))
    return Path.polyline(points[chain[::-1]])


def _knots(problem: Problem, path: Path, intervals: int) -> Array:
    """Arc lengths (intervals + 1,) [m], even in the mean of length and time: denser in narrow places."""
    s = np.linspace(0.0, path.length, GRID * intervals + 1)
    x, y, _, _ = path.at(s)
    pace = 1.0 / np.maximum(problem.safe_speed(np.column_stack([x, y])), LEAST_SPEED)
    time = np.concatenate([[0.0], np.cumsum(0.5 * (pace[1:] + pace[:-1]))])
    measure = s / s[-1] + time / time[-1]
    return np.interp(np.linspace(0.0, measure[-1], intervals + 1), measure, s)


def _with_speed(problem: Problem, mesh: Mesh) -> Mesh:
    if problem.zone is None:
        fastest = problem.safe_speed(mesh.points)
    else:
        fastest = safe_speed(problem.zone, problem.world, np.column_stack([mesh.points, mesh.theta]))
    speed = np.maximum(SEED_SPEED * fastest, LEAST_SPEED)
    return Mesh(mesh.shares, mesh.x, mesh.y, mesh.theta, speed, mesh.length)
