"""Cost of the speed graph against the size of the world, and against fast marching at equal error.

The peer is scikit-fmm (second order) on a grid, with the same exact distances; its error is that of its
travel time at the goal against the certified optimum. Finer grids are taken until the error is at most
EQUAL.
"""

from __future__ import annotations

import math
import os
import statistics
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import skfmm
from numpy.typing import NDArray

from vnav_drake.braking import UniformBraking
from vnav_drake.homotopy import build_gates
from vnav_drake.problem import End, Problem
from vnav_drake.robot import Robot
from vnav_drake.scenario import load_scenario
from vnav_drake.speed_graph import speed_graph
from vnav_drake.speed_graph.chart import Chart
from vnav_drake.speed_graph.classes import refine
from vnav_drake.speed_graph.optimum import ClassSolver
from vnav_drake.speed_graph.published import build_published
from vnav_drake.speed_graph.sampled import build_sampled, k_best_classes
from vnav_drake.voronoi import build_diagram
from vnav_drake.world import Obstacle, World

Array = NDArray[np.float64]

GALLERY = Path(__file__).parent.parent / "scenarios"
HEXAGONS = (1, 4, 16, 50, 116, 333)  # 10 to 2,002 vertices
CLASSES = 3
ROUNDS = 3
EQUAL = 1e-4  # relative error
GRIDS = (250, 500, 1000, 2000)  # cells along the longer side
FITTED_FROM = 100  # vertices: below that fixed costs show
STAGES = ("Voronoi diagram", "sampled graph", "published graph", "search, 3 classes", "3 class optima")


def hexagons(count: int) -> Problem:
    """Irregular hexagons, each in its own 3 m square of a square room, crossed from corner to corner."""
    rng = np.random.default_rng(7)
    row = math.ceil(math.sqrt(count))
    side = 3.0 * row + 1.5
    center = (
        3.0 * np.stack(np.divmod(np.arange(count), row), axis=1) + 2.25 + rng.uniform(-0.3, 0.3, (count, 2))
    )
    angle = 2.0 * math.pi * np.arange(6) / 6.0 + rng.uniform(0.0, 1.0, (count, 1))
    reach = rng.uniform(0.3, 1.0, (count, 6, 1))
    rings = center[:, None] + reach * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    obstacles = [Obstacle(tuple(map(tuple, ring.tolist()))) for ring in rings]
    world = World.build([(0.0, 0.0), (side, 0.0), (side, side), (0.0, side)], obstacles)
    return _problem(world, 0.05, (0.4, 0.5), (side - 0.5, side - 0.4))


def racks(columns: int, rows: int) -> Problem:
    """A warehouse like that of the gallery, with more racks: 10 m x 5 m, gaps of 1 m, corridors of 4 m."""
    places = [(4.0 + 11.0 * i, 4.0 + 6.0 * j) for i in range(columns) for j in range(rows)]
    obstacles = [Obstacle(((x, y), (x + 10.0, y), (x + 10.0, y + 5.0), (x, y + 5.0))) for x, y in places]
    width, height = 11.0 * columns + 7.0, 6.0 * rows + 7.0
    world = World.build([(0.0, 0.0), (width, 0.0), (width, height), (0.0, height)], obstacles)
    return _problem(world, 0.4, (width - 3.5, 1.9), (2.0, height - 9.0))


def gallery(name: str) -> Problem:
    """The problem of a scenario file."""
    return load_scenario(GALLERY / f"{name}.yaml").problem


def _problem(world: World, radius: float, start: tuple[float, float], goal: tuple[float, float]) -> Problem:
    law, robot = UniformBraking(max_braking=1.0), Robot(radius=radius)
    return Problem(world=world, robot=robot, braking=law, start=End(position=start), goal=End(position=goal))


def stages(problem: Problem) -> dict[str, float]:
    """Time [s] of each stage."""
    clock, last = {}, time.perf_counter()

    def lap(stage: str) -> None:
        nonlocal last
        now = time.perf_counter()
        clock[stage], last = now - last, now

    level = problem.robot.radius
    diagram = build_diagram(problem.world, problem.robot.radius)
    lap(STAGES[0])
    gates = build_gates(diagram.restricted(level), level)
    sampled = build_sampled(problem, diagram, gates)
    lap(STAGES[1])
    build_published(sampled)
    lap(STAGES[2])
    routes = k_best_classes(sampled, CLASSES)
    lap(STAGES[3])
    solver = ClassSolver(sampled.diagram, Chart(problem.world, problem.braking, problem.robot.radius))
    for route in routes:
        refine(problem, solver, gates, route)
    lap(STAGES[4])
    return clock


def against_size() -> None:
    """Print the times of the stages for growing worlds and the exponents that fit them."""
    print(f"irregular hexagons, median time [s] of {ROUNDS}")
    print(f"{'vertices':>9}" + "".join(f"{stage:>19}" for stage in STAGES))
    count, times = [], []
    for number in HEXAGONS:
        problem = hexagons(number)
        runs = [stages(problem) for _ in range(ROUNDS)]
        count.append(len(problem.world.vertices))
        times.append([statistics.median(run[stage] for run in runs) for stage in STAGES])
        print(f"{count[-1]:9d}" + "".join(f"{t:19.3f}" for t in times[-1]), flush=True)
    large = np.array(count) >= FITTED_FROM
    slope = np.polyfit(np.log(np.array(count)[large]), np.log(np.array(times)[large]), 1)[0]
    fitted = ", ".join(f"{stage} {e:.2f}" for stage, e in zip(STAGES, slope, strict=True))
    print(f"exponent of n, from {FITTED_FROM} vertices: {fitted}")


def whole(name: str, problem: Problem, classes: int, aim: float) -> None:
    """Print how long diagram, graph, ranking and optima take together."""
    times = []
    for _ in range(ROUNDS):
        begun = time.perf_counter()
        found = speed_graph(problem, classes=classes, with_published=False)
        times.append(time.perf_counter() - begun)
    sure = sum(c.certified for c in found.classes)
    print(
        f"{name:<24}{len(problem.world.vertices):9d}{classes:9d}{statistics.median(times):9.2f}{aim:9.0f}"
        f"{sure:6d} of {len(found.classes)}{'':<2}{found.classes[0].travel_time:14.7f}",
        flush=True,
    )


def marched(problem: Problem, cells: int) -> tuple[float, float, float]:
    """Travel time [s] by fast marching, and how long [s] distances and marching took.

    The zero contour is a circle of two cells about the start, whose own time is added at the start's speed.
    """
    begun = time.perf_counter()
    low, high = problem.world.vertices.min(axis=0), problem.world.vertices.max(axis=0)
    h = float((high - low).max()) / cells
    x, y = (np.arange(a, b + 0.5 * h, h) for a, b in zip(low, high, strict=True))
    grid = np.stack(np.meshgrid(x, y), axis=-1)
    clearance = problem.world.distance(grid.reshape(-1, 2)).reshape(grid.shape[:2]) - problem.robot.radius
    distances = time.perf_counter() - begun
    speed = np.sqrt(2.0 * problem.braking.max_braking * np.maximum(clearance, 0.0))
    start, goal = problem.start.point, problem.goal.point
    around = 2.0 * h
    contour = np.ma.MaskedArray(np.hypot(*np.moveaxis(grid - start, -1, 0)) - around, speed <= 0.0)
    arrival = skfmm.travel_time(contour, np.maximum(speed, 1e-12), dx=h, order=2)
    row, column = ((goal - low) / h)[::-1]
    i, j = min(int(row), len(y) - 2), min(int(column), len(x) - 2)
    a, b = row - i, column - j
    corners = arrival[i : i + 2, j : j + 2]
    value = float(np.array([1.0 - a, a]) @ corners @ np.array([1.0 - b, b]))
    own = float(problem.world.distance(start[None])[0]) - problem.robot.radius
    total = value + around / math.sqrt(2.0 * problem.braking.max_braking * own)
    return total, distances, time.perf_counter() - begun - distances


def against_marching(name: str, problem: Problem) -> None:
    """Print what fast marching needs for the error that is demanded, as a ratio to the speed graph."""
    times = []
    for _ in range(ROUNDS):
        begun = time.perf_counter()
        best = speed_graph(problem, classes=1, with_published=False).classes[0]
        times.append(time.perf_counter() - begun)
    own = statistics.median(times)
    bound = best.optimality_bound / best.travel_time
    print(f"{name}: speed graph, fastest class {own:.3f} s, relative bound {bound:.0e}")
    for cells in GRIDS:
        value, distances, marching = marched(problem, cells)
        error = abs(value / best.travel_time - 1.0)
        print(
            f"  {cells:5d} cells: error {error:.1e}, distances {distances:.2f} s, marching {marching:.2f} s,"
            f" ratio {(distances + marching) / own:.1f}, of marching alone {marching / own:.1f}",
            flush=True,
        )
        if error <= EQUAL:
            print(f"  equal error {EQUAL:.0e} reached")
            return
    print(f"  error {EQUAL:.0e} not reached: at equal error the ratio is larger than the last one")


def main() -> None:
    """Print all three tables."""
    print(f"load of the machine: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    against_size()
    head = f"{'diagram to optima':<24}{'vertices':>9}{'classes':>9}{'time [s]':>9}{'aim [s]':>9}"
    print(f"\n{head}{'certified':>11}{'best T [s]':>14}")
    cases: Sequence[tuple[str, Callable[[], Problem], int, float]] = (
        ("four-point room", lambda: gallery("four_point_room"), 6, 1.0),
        ("warehouse", lambda: gallery("warehouse"), 6, 1.0),
        ("warehouse of 400 racks", lambda: racks(20, 20), 3, 15.0),
    )
    for name, make, classes, aim in cases:
        whole(name, make(), classes, aim)
    print(f"\nagainst scikit-fmm {skfmm.__version__}, relative error {EQUAL:.0e}")
    for name, make, _, _ in cases[:2]:
        against_marching(name, make())


if __name__ == "__main__":
    main()
