"""The greatest lower bound that a mesh allows, and a finer mesh where it is lost, again and again."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from vnav_drake.lower_bound.certificate import Certificate
from vnav_drake.lower_bound.cover import Cover, Ground, barycentric
from vnav_drake.lower_bound.mesh import edges_of
from vnav_drake.lower_bound.program import Elements, Functional, Setting, Solution, solve
from vnav_drake.lower_bound.refinement import first_cover, losses, worst
from vnav_drake.problem import NoPathError, PlanningError, Problem

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

Effort = Literal["quick", "full"]
Stop = Literal["gap", "budget", "time", "precision"]
BUDGET = {"quick": 25_000, "full": 150_000}  # triangles of all programs together
GROWTH = 1.35  # of the number of triangles from round to round
PRECISION = 0.003  # the solver's tolerance as a share of the gap that is expected
FINEST, COARSEST = 1e-9, 1e-4  # of the solver's tolerance
GOOD = frozenset({"Solved", "AlmostSolved"})
SAFETY = 1e-9  # the gradient stays this share below its bound, so that other roundings agree
ROUNDING = 1e-12  # relative, of a difference of two values of u
STALLED = 3  # rounds without a better bound after which the solver's precision is the limit
WHERE_FLOWS = 0.9  # the minorant is made good at the flow's place, moved this far from the middle
FLOWS = 1e-9  # share of the travel time from which a triangle's flow is known


@dataclass(frozen=True, kw_only=True)
class Round:
    """One cone program."""

    triangles: int
    lower_bound: float  # [s], proven on this mesh
    status: str  # the solver's own word
    seconds: float  # since the beginning


@dataclass(frozen=True, kw_only=True, eq=False)
class LowerBound:
    """No motion of the variational model takes less than `travel_time`, and the certificate proves it."""

    certificate: Certificate
    travel_time: float  # [s]
    rounds: tuple[Round, ...]
    stopped: Stop  # why no finer mesh was tried


def lower_bound(
    problem: Problem,
    *,
    upper: float | None = None,
    gap: float = 0.0,
    effort: Effort = "full",
    budget: int | None = None,
    time_limit: float | None = None,
    progress: Callable[[str], None] | None = None,
) -> LowerBound:
    """Bound the travel time of every path in every homotopy class from below.

    Parameters
    ----------
    upper, gap : stop when upper / lower - 1 <= gap; `upper` [s] is the time of the best motion known.
    effort, budget : how many triangles all cone programs together may have.
    time_limit : [s], an emergency stop between programs; results with it do not repeat exactly.

    Raises
    ------
    NoPathError : start and goal are not connected for this robot.
    PlanningError : no certificate was found.
    """
    begun = time.perf_counter()
    budget = BUDGET[effort] if budget is None else budget
    ground = Ground.of(problem)
    cover = first_cover(ground, problem.world.bounds)
    best: Certificate | None = None
    rounds: list[Round] = []
    spent = stalled = 0
    while True:
        rows, elements, start, goal = _elements(cover)
        solution = _solution(elements, start, goal, _expected(cover, best, upper))
        certificate = _certificate(problem, cover, rows, elements, start, goal, solution)
        spent += len(rows)
        rounds.append(
            Round(
                triangles=len(rows),
                lower_bound=certificate.travel_time,
                status=solution.status,
                seconds=time.perf_counter() - begun,
            )
        )
        better = best is None or certificate.travel_time > best.travel_time
        stalled = 0 if better else stalled + 1
        best = certificate if best is None or better else best
        if progress is not None:
            progress(_told(rounds[-1], best.travel_time, upper))
        stop = _stop(best.travel_time, upper, gap, spent + GROWTH * len(rows) > budget, stalled)
        if stop is None and time_limit is not None and rounds[-1].seconds > time_limit:
            stop = "time"
        if stop is not None:
            break
        if certificate.travel_time > 0.0:  # else the flow known before must do
            cover = _with_flow(cover, rows, solution)
        cover = cover.grown(worst, int(GROWTH * len(cover.kept)) + 1)
    if not best.travel_time > 0.0:
        raise PlanningError("no lower bound was found: " + ", ".join({r.status for r in rounds}))
    return LowerBound(certificate=best, travel_time=best.travel_time, rounds=tuple(rounds), stopped=stop)


def _stop(lower: float, upper: float | None, gap: float, spent: bool, stalled: int) -> Stop | None:
    if upper is not None and lower > 0.0 and upper / lower - 1.0 <= gap:
        return "gap"
    if stalled >= STALLED:
        return "precision"
    return "budget" if spent else None


def _told(last: Round, lower: float, upper: float | None) -> str:
    room = f", gap {upper / lower - 1.0:.4%}" if upper is not None and lower > 0.0 else ""
    return f"{last.triangles} triangles, at least {lower:.4f} s{room}"


def _elements(cover: Cover) -> tuple[Indices, Elements, Functional, Functional]:
    """The kept triangles connected to the start, their control values, and u at start and goal.

    Raises
    ------
    NoPathError : the goal is not connected to the start.
    """
    kept = cover.kept
    triangles = cover.mesh.triangles[kept]
    count = len(cover.mesh.vertices)
    pairs = triangles[:, [0, 1, 0, 2]].reshape(-1, 2)
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    part = connected_components(graph, directed=False)[1][triangles[:, 0]]
    ends = [int(np.searchsorted(kept, cover.locate(p))) for p in (cover.ground.start, cover.ground.goal)]
    if part[ends[0]] != part[ends[1]]:
        raise NoPathError("start and goal are not connected for this robot: blocked triangles part them")
    connected = part == part[ends[0]]
    rows = kept[connected]
    triangles = cover.mesh.triangles[rows]
    used, vertex = np.unique(triangles, return_inverse=True)
    vertex = vertex.reshape(-1, 3)
    edge, of_edge = edges_of(triangles)
    control = np.empty((len(rows), 3, 3), dtype=np.int64)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        control[:, i, i] = vertex[:, i]
        control[:, j, k] = control[:, k, j] = len(used) + of_edge[:, i]
    elements = Elements(cover.corners(rows), control, cover.choice(rows), len(used) + len(edge))
    start, goal = (
        _functional(elements, int(connected[:end].sum()), point)
        for end, point in zip(ends, (cover.ground.start, cover.ground.goal), strict=True)
    )
    return rows, elements, start, goal


def _functional(elements: Elements, row: int, point: Array) -> Functional:
    """u at a point (2,) [m] in triangle `row`."""
    share = barycentric(elements.corners[row : row + 1], point)[0]
    return Functional(point, elements.control[row].ravel(), np.outer(share, share).ravel())


def _expected(cover: Cover, best: Certificate | None, upper: float | None) -> float:
    """The gap expected of the next program, relative: what is lost on the mesh, at most what is open."""
    if best is None:
        return 1.0
    expected = float(losses(cover).sum())
    if upper is not None and best.travel_time > 0.0:
        expected = min(expected, upper / best.travel_time - 1.0)
    return expected


def _solution(elements: Elements, start: Functional, goal: Functional, expected: float) -> Solution:
    """Of the first setting with which the solver succeeds, else of the last one.

    A coarse tolerance while the mesh is coarse is faster, and the flow then spreads over all routes that
    are nearly as fast, so that they are refined together.
    """
    tolerance = float(np.clip(PRECISION * expected, FINEST, COARSEST))
    for setting in (
        Setting(tolerance),
        Setting(tolerance, regularization=1e-10),
        Setting(10.0 * tolerance, regularization=1e-7, step=0.9),
        Setting(10.0 * tolerance, regularization=1e-6, equilibrate=False),
    ):
        solution = solve(elements, start, goal, setting)
        if solution.status in GOOD:
            break
    return solution


def _proven(elements: Elements, solution: Solution) -> Array:
    """The control values scaled down until every corner keeps its bound, whatever the solver said."""
    bound = elements.bounds(solution.weight)
    values = solution.values
    for _ in range(5):  # scaling rounds anew, which shows where triangles are tiny
        slope = elements.gradient(values)
        ratio = float((np.hypot(slope[..., 0], slope[..., 1]) / bound).max()) * (1.0 + SAFETY)
        if ratio <= 1.0:
            return values
        values = values / (ratio * (1.0 + 1e-12))
    return np.zeros_like(values)


def _certificate(
    problem: Problem,
    cover: Cover,
    rows: Indices,
    elements: Elements,
    start: Functional,
    goal: Functional,
    solution: Solution,
) -> Certificate:
    """u on the whole mesh: zero on parts that no motion from the start reaches."""
    values = _proven(elements, solution)
    kept, mesh, choice = cover.kept, cover.mesh, cover.choice(cover.kept)
    triangles = mesh.triangles[kept]
    edge, of_edge = edges_of(triangles)
    u_vertex, u_edge = np.zeros(len(mesh.vertices)), np.zeros(len(edge))
    mine = np.searchsorted(kept, rows)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        u_vertex[triangles[mine, i]] = values[elements.control[:, i, i]]
        u_edge[of_edge[mine, i]] = values[elements.control[:, j, k]]
    share = np.ones(len(kept))
    share[mine] = solution.weight
    ends = values[goal.number] @ goal.factor, values[start.number] @ start.factor
    size = float(np.abs(values).max(initial=0.0))
    blocked = np.setdiff1d(np.arange(len(mesh.triangles)), kept)
    law = problem.braking
    return Certificate(
        vertices=mesh.vertices,
        origin=mesh.lattice.origin,
        unit=mesh.lattice.unit,
        box=np.array(mesh.lattice.box, dtype=np.int64),
        triangles=triangles,
        dropped=mesh.triangles[blocked],
        blocked_by=cover.reason[blocked],
        edges=edge,
        u_vertex=u_vertex,
        u_edge=u_edge,
        feature=choice.feature,
        speed=choice.speed,
        weight=np.stack([share, 1.0 - share], axis=1),
        start_triangle=int(np.searchsorted(kept, cover.locate(cover.ground.start))),
        goal_triangle=int(np.searchsorted(kept, cover.locate(cover.ground.goal))),
        features=cover.ground.features.table,
        start=cover.ground.start,
        goal=cover.ground.goal,
        law=np.array([problem.robot.radius, law.max_braking, law.reaction_time, law.margin, law.max_speed]),
        travel_time=max(0.0, float(ends[0] - ends[1]) - ROUNDING * size),
    )


def _with_flow(cover: Cover, rows: Indices, solution: Solution) -> Cover:
    """The cover with where the flow is, and how much of the travel time it spends there."""
    share = solution.time.sum(axis=1)
    time_in = np.zeros(len(cover.time))
    time_in[rows] = share
    known = share > FLOWS
    push = solution.push[known]
    flow = cover.flow.copy()
    flow[rows[known]] = WHERE_FLOWS * push / push.sum(axis=1, keepdims=True) + (1.0 - WHERE_FLOWS) / 3.0
    return replace(cover, flow=flow, time=time_in)
