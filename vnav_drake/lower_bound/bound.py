"""The greatest lower bound that a mesh allows, and a finer mesh where it is lost, again and again."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from vnav_drake.lower_bound.assembly import Assembly, assemble, certified
from vnav_drake.lower_bound.certificate import Certificate
from vnav_drake.lower_bound.cover import Cover, Ground
from vnav_drake.lower_bound.lengths import drive_time
from vnav_drake.lower_bound.program import Setting, Solution, solve
from vnav_drake.lower_bound.refinement import first_cover, losses, worst
from vnav_drake.problem import NoPathError, PlanningError, Problem

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

Effort = Literal["quick", "full"]
Stop = Literal["gap", "budget", "time", "precision", "fault"]
BUDGET = {"quick": 25_000, "full": 150_000}  # triangles of all programs together
GROWTH = 1.35  # of the number of triangles from round to round
AGAIN = 2  # times that a mesh is used with a zone: each time the sets of gradients are closer to what matters
PRECISION = 0.003  # the solver's tolerance as a share of the gap that is expected
FINEST, COARSEST = 1e-9, 1e-4  # of the solver's tolerance
UNBOUNDED = (
    "the braking zone limits the speed for some headings only, and with speeds free at both ends and no "
    "greatest speed no time follows from the length of the way: no lower bound"
)
GOOD = frozenset({"Solved", "AlmostSolved"})
SLIGHT = 1e-3  # relative gain of a length that counts as none: the gap to a motion is some per cent
STALLED_LENGTH = 2  # rounds of that kind after which it is precise enough
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
    """No motion of the variational model takes less than `travel_time`, and the certificate proves it.

    With a braking zone from which no bound of the speed follows the certificate proves a length, and no
    motion of the full robot between the ends that are asked for takes less.
    """

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
    if ground.lengths and not drive_time(problem, 1.0) > 0.0:
        raise PlanningError(UNBOUNDED)
    cover = first_cover(ground, problem.world.bounds)
    best: Certificate | None = None
    least = 0.0  # [s], what `best` proves
    rounds: list[Round] = []
    spent = stalled = same = 0
    while True:
        try:
            assembly = assemble(cover)
            solution = _solution(assembly, 1.0 if best is None else _expected(cover, least, upper))
            certificate = certified(problem, assembly, solution)
        except NoPathError:
            raise
        except (MemoryError, RuntimeError, PlanningError):  # RuntimeError: what Drake's solvers raise
            if best is None:
                raise
            return LowerBound(
                certificate=best, travel_time=least, rounds=tuple(rounds), stopped="fault"
            )  # what was proven before stays proven
        found = certificate.travel_time
        if ground.lengths:
            found = drive_time(problem, found)
        triangles = len(assembly.copies)
        spent += triangles
        rounds.append(
            Round(
                triangles=triangles,
                lower_bound=found,
                status=solution.status,
                seconds=time.perf_counter() - begun,
            )
        )
        better = best is None or found > least
        slight = ground.lengths and 0.0 < found <= least * (1.0 + SLIGHT)
        stalled = stalled + 1 if slight or not better else 0
        if best is None or better:
            best, least = certificate, found
        if progress is not None:
            progress(_told(rounds[-1], least, upper))
        many = STALLED_LENGTH if ground.lengths else STALLED if ground.zone is None else STALLED * AGAIN
        stop = _stop(least, upper, gap, spent + GROWTH * triangles > budget, stalled >= many)
        late = time_limit is not None and rounds[-1].seconds > time_limit
        stop = stop or ("time" if late else None)
        if stop is not None:
            break
        if certificate.travel_time > 0.0:  # else the flow known before must do
            cover = _with_flow(assembly, solution)
        same = same + 1 if cover.ground.zone is not None and same + 1 < AGAIN else 0
        if same == 0:
            marks = worst if cover.time.any() else _everywhere
            cover = cover.grown(marks, int(GROWTH * len(cover.kept)) + 1)
    if not least > 0.0:
        raise PlanningError("no lower bound was found: " + ", ".join({r.status for r in rounds}))
    return LowerBound(certificate=best, travel_time=least, rounds=tuple(rounds), stopped=stop)


def _everywhere(cover: Cover) -> Mask:
    return np.ones(len(cover.time), dtype=bool)


def _stop(lower: float, upper: float | None, gap: float, spent: bool, stalled: bool) -> Stop | None:
    if upper is not None and lower > 0.0 and upper / lower - 1.0 <= gap:
        return "gap"
    if stalled:
        return "precision"
    return "budget" if spent else None


def _told(last: Round, lower: float, upper: float | None) -> str:
    room = f", gap {upper / lower - 1.0:.4%}" if upper is not None and lower > 0.0 else ""
    return f"{last.triangles} triangles, at least {lower:.4f} s{room}"


def _expected(cover: Cover, least: float, upper: float | None) -> float:
    """The gap expected of the next program, relative: what is lost on the mesh, at most what is open."""
    expected = float(losses(cover).sum())
    if upper is not None and least > 0.0:
        expected = min(expected, upper / least - 1.0)
    return expected


def _solution(assembly: Assembly, expected: float) -> Solution:
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
        solution = solve(assembly.elements, assembly.start, assembly.goal, setting)
        if solution.status in GOOD:
            break
    return solution


def _with_flow(assembly: Assembly, solution: Solution) -> Cover:
    """The cover with where the flow is, and how much of the travel time it spends there."""
    cover, rows = assembly.cover, assembly.rows
    time_in = np.zeros(len(cover.time))
    np.add.at(time_in, rows, solution.time.sum(axis=1))
    push = np.zeros_like(cover.flow)
    np.add.at(push, rows, solution.push)
    known = (time_in > FLOWS) & (push.sum(axis=1) > 0.0)
    flow = cover.flow.copy()
    flow[known] = WHERE_FLOWS * push[known] / push[known].sum(axis=1, keepdims=True)
    flow[known] += (1.0 - WHERE_FLOWS) / 3.0
    heading = cover.heading
    if solution.drift is not None:
        heading = _headings(assembly, solution, solution.drift, known)
    return replace(cover, flow=flow, time=time_in, heading=heading)


def _headings(assembly: Assembly, solution: Solution, flow: Array, known: Mask) -> Array:
    """Where the flow goes (t,) [rad], and where there is none, where u rises."""
    cover, rows = assembly.cover, assembly.rows
    drift = np.zeros((len(cover.time), 2))
    np.add.at(drift, rows, flow)
    rise = np.zeros_like(drift)
    np.add.at(rise, rows, assembly.elements.gradient(solution.values).mean(axis=1))
    way = np.where(known[:, None], drift, rise)
    moving = np.hypot(way[:, 0], way[:, 1]) > 0.0
    return np.where(moving, np.arctan2(way[:, 1], way[:, 0]), cover.heading)
