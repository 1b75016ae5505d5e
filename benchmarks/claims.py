"""Claims of Manor 2015 about the speed graph, measured.

* Appendix B: near a point obstacle the path of a disc robot is found in a polygon around the disc. How far is
  that from the exact arc?
* Lemma 3.5.1, Prop. 3.6.1, Appendix C: travel time grows along every ray from the optimal crossing points,
  and is convex in them.
* Sec. 3.6.1: Newton's method converges within five to ten iterations, each O(n^3).
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.random_worlds import random_problem
from vnav_drake.arcs import solve_legs
from vnav_drake.braking import UniformBraking
from vnav_drake.homotopy import build_gates
from vnav_drake.plan import Path
from vnav_drake.problem import End, NoPathError, Problem
from vnav_drake.robot import Robot
from vnav_drake.speed_graph import speed_graph
from vnav_drake.speed_graph.chart import Chart
from vnav_drake.speed_graph.initial import structure_of
from vnav_drake.speed_graph.newton import ITERATIONS
from vnav_drake.speed_graph.optimum import ClassSolver
from vnav_drake.speed_graph.sampled import build_sampled, k_best_classes
from vnav_drake.speed_graph.state import State
from vnav_drake.speed_graph.structure import Kind
from vnav_drake.voronoi import build_diagram
from vnav_drake.world import Obstacle, World

Array = NDArray[np.float64]

LAW = UniformBraking(max_braking=1.0)
RADIUS = 0.4  # [m], of the robot of Appendix B
ENDS = ((0.7, 0.6), (1.5, 0.6), (0.42, 0.42))  # distance [m] from the point at start and goal
SWEEP = 2.0  # [rad]
SIDES = (8, 16, 32, 64, 128)  # of the polygon around the disc
FAR = 30.0  # [m]: the room's walls are farther from every path than the polygon

WORLDS = 100
RAYS = 40  # a class
STEPS = 24  # along a ray
SHIFT = 0.05  # of a border's length, by which crossings are moved
ROUNDING = 1e-12  # relative: what a time may fall by without falling


@dataclass(frozen=True)
class Polygonal:
    """The approximation of Appendix B for one pair of ends."""

    sides: int
    claimed: float  # [s], of the fastest path near the polygon, at the speeds that the polygon allows
    actual: float  # [s], of the same path at the speeds that the point allows
    exact: float  # [s], of the exact arc
    compute_time: float  # [s]


def polygonal(sides: int, first: float, last: float) -> Polygonal:
    """Least time from (first, -SWEEP / 2) to (last, SWEEP / 2), polar about a polygon tangent to the disc.

    The polygon goes right round the disc, a tangent point between two sides at the middle of the sweep. Its
    fastest path is that of a speed graph in a large room, which is certified.
    """
    turn = 2.0 * math.pi * (np.arange(sides) + 0.5) / sides
    ring = RADIUS / math.cos(math.pi / sides) * np.column_stack([np.cos(turn), np.sin(turn)])
    room = [(-FAR, -FAR), (FAR, -FAR), (FAR, FAR), (-FAR, FAR)]
    world = World.build(room, [Obstacle(tuple(map(tuple, ring.tolist())))])
    ends = [
        End(position=(r * math.cos(a), r * math.sin(a)))
        for r, a in ((first, -0.5 * SWEEP), (last, 0.5 * SWEEP))
    ]
    problem = Problem(world=world, robot=Robot(radius=0.0), braking=LAW, start=ends[0], goal=ends[1])
    begun = time.perf_counter()
    best = speed_graph(problem, classes=1, with_published=False).classes[0]
    took = time.perf_counter() - begun
    exact = solve_legs(LAW, RADIUS, [True], [first - RADIUS], [last - RADIUS], [SWEEP]).time[0]
    return Polygonal(sides, best.travel_time, _time_near_point(best.path), float(exact), took)


def _time_near_point(path: Path) -> float:
    """Travel time [s] of a disc robot along a path near a point at the origin: Gauss's rule on each arc."""
    node, weight = np.polynomial.legendre.leggauss(8)
    along = 0.5 * (node + 1.0) * path.piece_length[:, None]
    turned = 0.5 * path.curvature[:, None] * along  # of the chord from the arc's start, against its tangent
    chord = along * np.sinc(turned / np.pi)
    angle = path.heading[:, None] + turned
    x, y = path.x[:-1, None] + chord * np.cos(angle), path.y[:-1, None] + chord * np.sin(angle)
    slowness = 1.0 / LAW.speed(np.hypot(x, y) - RADIUS)
    return float((0.5 * path.piece_length * (slowness @ weight)).sum())


@dataclass(frozen=True)
class Rays:
    """How travel time behaves around optimal crossing points."""

    classes: int
    rays: int
    falling: int  # rays along which the time falls somewhere
    falling_valid: int  # of these, with every leg inside its cell up to there
    chords: int
    not_convex: int  # chords of the box whose middle takes longer than the mean of its ends
    not_quasiconvex: int  # ... longer than both of its ends
    least_eigenvalue: float  # of the Hessian at any of the optima, divided by the largest


def rays(first: int, worlds: int) -> Rays:
    """Rays and chords in the box of crossing points, of paths in random worlds that cross borders only.

    As in the source a leg is the optimal arc near its own feature, as if there were no other one.
    """
    rng = np.random.default_rng(0)
    classes = ray_count = falling = falling_valid = chords = bent = bulging = 0
    least = math.inf
    for seed in range(first, first + worlds):
        found = _crossing_only(random_problem(seed).problem)
        if found is None:
            continue
        solver, state = found
        moving = np.array([i for i, j in enumerate(state.structure.joins) if j.kind is Kind.CROSS])
        u = np.array([j.u for j in state.structure.joins])
        low, high = np.sort(
            solver.diagram.curves.span[[state.structure.joins[i].border for i in moving]], axis=1
        ).T
        classes += 1
        least = min(least, _least_eigenvalue(solver, state, moving))
        for _ in range(RAYS):
            target = rng.uniform(low, high)
            samples = [_at(solver, state, u, moving, target, t) for t in np.linspace(0.0, 1.0, STEPS)]
            values = np.array([s.time for s in samples])
            drop = np.flatnonzero(np.diff(values) < -ROUNDING * values[:-1])
            ray_count += 1
            if len(drop):
                falling += 1
                inside = [
                    float(solver.beyond(s, 20)[0].max(initial=0.0)) <= 1e-7 for s in samples[: drop[0] + 2]
                ]
                falling_valid += all(inside)
            other = rng.uniform(low, high)
            ends = [values[-1], _at(solver, state, u, moving, other, 1.0).time]
            middle = _at(solver, state, u, moving, 0.5 * (target + other), 1.0).time
            chords += 1
            bent += middle > 0.5 * sum(ends) * (1.0 + ROUNDING)
            bulging += middle > max(ends) * (1.0 + ROUNDING)
    return Rays(classes, ray_count, falling, falling_valid, chords, bent, bulging, least)


def _at(solver: ClassSolver, state: State, u: Array, moving: Array, target: Array, part: float) -> State:
    """The path whose crossing points are a part of the way from the optimal ones to a target."""
    where = u.copy()
    where[moving] += part * (target - u[moving])
    sweeps = np.zeros(len(state.structure.pieces))
    sweeps[state.leg] = state.flight.sweep
    return solver.solver.state(state.structure.moved(where, sweeps))


def _least_eigenvalue(solver: ClassSolver, state: State, moving: Array) -> float:
    """Smallest over largest eigenvalue of the Hessian of the time by arc length along the borders."""
    count = len(moving)
    u = np.array([j.u for j in state.structure.joins])
    size = 1e-4 * max(1.0, float(np.hypot(*np.ptp(state.place, axis=0))))

    def value(shift: Array) -> float:
        return float(_at(solver, state, u, moving, u[moving] + shift, 1.0).time)

    unit = size * np.eye(count)
    matrix = np.array(
        [[value(a + b) - value(a - b) - value(b - a) + value(-a - b) for b in unit] for a in unit]
    )
    eigenvalues = np.linalg.eigvalsh(0.5 * (matrix + matrix.T))
    return float(eigenvalues[0] / eigenvalues[-1])


def _solved(problem: Problem, classes: int) -> list[tuple[ClassSolver, State, int]]:
    """Certified optima of the first classes of the graph, and Newton's iterations."""
    level = problem.robot.radius
    try:
        diagram = build_diagram(problem.world, level)
        sampled = build_sampled(problem, diagram, build_gates(diagram.restricted(level), level))
        routes = k_best_classes(sampled, classes)
    except NoPathError:
        return []
    solver = ClassSolver(sampled.diagram, Chart(problem.world, problem.braking, level))
    out = []
    for route in routes:
        found = solver.optimum(structure_of(problem, solver.cut, solver.chart, route))
        if not found.failed:
            out.append((solver, found.state, len(found.history)))
    return out


def _crossing_only(problem: Problem) -> tuple[ClassSolver, State] | None:
    """The optimum of the first class whose path does nothing but cross two borders or more."""
    for solver, state, _ in _solved(problem, 3):
        kinds = [j.kind for j in state.structure.joins[1:-1]]
        if len(kinds) >= 2 and all(kind is Kind.CROSS for kind in kinds):
            return solver, state
    return None


def iterations(first: int, worlds: int) -> Array:
    """(n, 3): joins of certified optima, Newton's iterations from the graph's route, and from moved joins.

    Paths that cross borders only are also solved again, each join moved by up to `SHIFT` of its border's
    length; the last column is NaN for others.
    """
    rng = np.random.default_rng(1)
    rows = []
    for seed in range(first, first + worlds):
        for solver, state, count in _solved(random_problem(seed).problem, 3):
            joins, again = state.structure.joins, math.nan
            moving = np.array([i for i, j in enumerate(joins) if j.kind is Kind.CROSS])
            if 0 < len(moving) == len(joins) - 2:
                u = np.array([j.u for j in joins])
                span = np.sort(solver.diagram.curves.span[[joins[i].border for i in moving]], axis=1)
                shift = rng.uniform(-SHIFT, SHIFT, len(moving)) * np.ptp(span, axis=1)
                target = np.clip(u[moving] + shift, *span.T)
                found = solver.optimum(_at(solver, state, u, moving, target, 1.0).structure)
                if not found.failed and len(found.history) <= ITERATIONS:
                    again = len(found.history) - 1
            rows.append((len(joins) - 2, count, again))
    return np.array(rows, dtype=float).reshape(-1, 3)


def main() -> None:
    """Print what was measured."""
    print("Appendix B: polygon around the disc instead of the exact arc, relative excess of travel time")
    print(f"{'start, goal [m]':<18}{'sides':>6}{'claimed':>11}{'actual':>11}{'time [ms]':>11}")
    for first, last in ENDS:
        for sides in SIDES:
            p = polygonal(sides, first, last)
            claimed, actual = p.claimed / p.exact - 1.0, p.actual / p.exact - 1.0
            print(
                f"{f'{first}, {last}':<18}{sides:6d}{claimed:11.1e}{actual:11.1e}{1e3 * p.compute_time:11.0f}"
            )
    begun = time.perf_counter()
    solve_legs(LAW, RADIUS, np.ones(10_000, dtype=bool), 0.3, np.linspace(0.1, 1.0, 10_000), SWEEP)
    print(f"exact arc: {1e3 * (time.perf_counter() - begun) / 10_000:.4f} ms, in batches of 10,000")

    r = rays(0, WORLDS)
    print(f"\nSec. 3.5, 3.6, App. C: {r.classes} classes, {r.rays} rays from the optimum, {r.chords} chords")
    print(f"rays along which the time falls: {r.falling}; with all legs in their cells: {r.falling_valid}")
    print(f"chords with a middle slower than their mean: {r.not_convex}; than both ends: {r.not_quasiconvex}")
    print(f"smallest eigenvalue of the Hessian at an optimum over the largest: {r.least_eigenvalue:.1e}")

    n = iterations(0, WORLDS)
    near = n[np.isfinite(n[:, 2]), 2]
    print(f"\nSec. 3.6.1: Newton's method, {len(n)} certified optima")
    print(
        f"{len(near)} that only cross borders, from crossings moved by up to {100.0 * SHIFT:.0f} % of them:"
    )
    print(f"  iterations: median {np.median(near):.0f}, most {near.max():.0f}")
    print("from the route of the graph, changes of structure included:")
    for low, high in ((0, 3), (4, 7), (8, 15), (16, 31), (32, 10_000)):
        part = n[(n[:, 0] >= low) & (n[:, 0] <= high), 1]
        if len(part):
            middle, most = np.median(part), part.max()
            print(
                f"  {low} joins or more: {len(part)} paths, iterations: median {middle:.0f}, most {most:.0f}"
            )


if __name__ == "__main__":
    main()
