"""Mesh refinement: solve, retime in continuous time, split where the two disagree, repeat."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vnav_drake.collocation.mesh import Mesh
from vnav_drake.collocation.program import ARCS, Solution, solve
from vnav_drake.collocation.transcription import Transcription
from vnav_drake.collocation.turning import greatest_steering_rate
from vnav_drake.convex import ConvexPieces
from vnav_drake.plan import Model, Path, Trajectory
from vnav_drake.problem import PlanningError, Problem
from vnav_drake.speed_profile import fastest_profile
from vnav_drake.zones.speed import least_gap

Array = NDArray[np.float64]

FIRST_REACH = 2.0  # [m]: a seed may be metres from the optimum
REACH = 0.5  # [m], once a solution guides
RATE_BACKOFF = 0.99  # the profile is faster than the program in places, and then the steering too
FEW = 0.05  # share of new intervals with which a zone that depends on the heading is not solved again
BULK = 0.95  # share of the whole disagreement that the intervals to split must carry (Doerfler marking)


@dataclass(frozen=True)
class Budget:
    """Counted work, so that runs repeat exactly."""

    intervals: int  # of the first mesh
    most_intervals: int
    rounds: int
    gain: float  # relative improvement of the travel time below which refinement ends

    @property
    def scout(self) -> Budget:
        """What a seed gets to show what it is worth: one solve, two when the first fails."""
        return replace(self, most_intervals=2 * self.intervals, rounds=2, gain=SCOUT_GAIN)


SCOUT_GAIN = 2.0  # no gain reaches it, so that the first safe geometry ends the search
BUDGETS = {
    "quick": Budget(intervals=60, most_intervals=160, rounds=4, gain=2e-5),
    "full": Budget(intervals=80, most_intervals=400, rounds=8, gain=2e-6),
}
# Each step of a zone that depends on the heading costs more, and the last digits are lost in its kinks.
ZONE_BUDGETS = {
    "quick": Budget(intervals=60, most_intervals=120, rounds=3, gain=5e-4),
    "full": Budget(intervals=80, most_intervals=400, rounds=6, gain=1.5e-4),
}
# Where speeds jump, the first safe geometry is good to some thousandths; the next ones cost ten times more.
JUMPING_BUDGETS = {
    "quick": Budget(intervals=60, most_intervals=180, rounds=3, gain=SCOUT_GAIN),
    "full": Budget(intervals=80, most_intervals=240, rounds=3, gain=SCOUT_GAIN),
}


def budget_of(problem: Problem, effort: str) -> Budget:
    """What a problem's zone is worth."""
    if problem.zone is None:
        return BUDGETS[effort]
    return (ZONE_BUDGETS if problem.has_variational_optimum else JUMPING_BUDGETS)[effort]


@dataclass(frozen=True)
class Round:
    """One solve, for the report. `worst_violation` is of the program's own motion between its knots."""

    round: int
    intervals: int
    iterations: int
    status: str
    solver_time: float  # [s]
    program_time: float  # [s] of travel, at the program's knots
    travel_time: float | None  # [s], of the retimed motion; None when the geometry is not safe
    worst_violation: float  # [m], of the braking distance

    def in_seconds(self, unit: float) -> dict[str, object]:
        """As a table row, times of travel in units of `unit` [s] turned into seconds."""
        row = asdict(self)
        for key in ("program_time", "travel_time"):
            row[key] = None if row[key] is None else row[key] * unit
        return row


@dataclass(frozen=True)
class Refined:
    """The best motion of all rounds and how it was found."""

    path: Path
    trajectory: Trajectory
    mesh: Mesh
    rounds: tuple[Round, ...]
    fault: str = ""  # of the solver, when it ended the refinement early


def refine(
    problem: Problem,
    guess: Mesh,
    model: Model,
    budget: Budget,
    progress: Callable[[int, float], None] | None = None,
    transcription: Transcription = ARCS,
) -> Refined:
    """Alternate between the program and the continuous-time profile on its geometry.

    Knot constraints say nothing between knots, so each solution is retimed on short rows, which is
    safe everywhere. Where program and retimed motion take different times the mesh is too coarse. A fault
    of the solver ends the refinement; what earlier rounds found stands.

    Raises
    ------
    PlanningError : no round gave a geometry with a safe profile; the message has the last reason.
    """
    pieces = ConvexPieces.of(problem.world)
    best: tuple[Path, Trajectory, Mesh] | None = None
    rounds: list[Round] = []
    reason, fault, reach, unsafe = "no round ran", "", FIRST_REACH, False
    limit = problem.robot.max_steering_rate if model == "full" else math.inf
    allowed = limit
    for number in range(1, budget.rounds + 1):
        try:
            solution = solve(
                problem,
                guess,
                pieces,
                model,
                reach=reach,
                keep_near=unsafe,
                steering_rate=allowed,
                transcription=transcription,
            )
        except PlanningError as error:
            reason = fault = f"round {number}: {error}"
            break
        mesh = solution.mesh
        try:
            path = solution.geometry.path(problem, model)
            if model == "full":
                _require_steerable(path, problem)
            trajectory = fastest_profile(problem, path, model=model)
        except PlanningError as error:
            reason, unsafe = str(error), True
            rounds.append(_round(number, solution, None, problem))
            if 2 * guess.intervals > budget.most_intervals:
                break
            guess = guess.split(np.full(guess.intervals, 2))
            continue
        rounds.append(_round(number, solution, trajectory, problem))
        if progress is not None:
            progress(mesh.intervals, trajectory.travel_time)
        gain = 1.0 if best is None else 1.0 - trajectory.travel_time / best[1].travel_time
        rate = 0.0 if math.isinf(limit) else greatest_steering_rate(trajectory, problem.robot)
        if rate > limit:
            reason = f"the steering would turn at {rate:.3f} rad/s, more than {limit:.3f} rad/s"
            allowed *= RATE_BACKOFF * limit / rate
            gain = 1.0
        elif gain > 0.0:
            best = (path, trajectory, mesh)
        spare = budget.most_intervals - mesh.intervals
        held = unsafe and problem.zone is not None
        if (abs(gain) < budget.gain and not held) or (spare <= 0 and rate <= limit):
            break  # not where the knots were held to the guess
        counts = split_counts(mesh, trajectory, spare)
        if problem.zone is not None and rate <= limit and counts.sum() < (1.0 + FEW) * len(counts):
            break  # what is lost, is lost in a few kinks, where no mesh is fine enough
        guess, reach = mesh.split(counts), REACH
    if best is None:
        raise PlanningError(f"collocation found no safe geometry ({model} model): {reason}")
    return Refined(*best, tuple(rounds), fault)


def _require_steerable(path: Path, problem: Problem) -> None:
    sharpest, limit = float(np.abs(path.curvature).max()), problem.robot.max_curvature
    if sharpest > limit:
        raise PlanningError(f"it bends with {sharpest:.4f} 1/m, the steering allows {limit:.4f} 1/m")


def split_counts(mesh: Mesh, trajectory: Trajectory, most: int) -> NDArray[np.int64]:
    """In how many parts to cut each interval: 2 where the times of program and profile differ most.

    At most `most` new intervals.
    """
    ends = np.concatenate([[0.0], np.cumsum(mesh.shares)]) * trajectory.length
    ends[-1] = trajectory.length
    exact = np.diff(np.interp(ends, trajectory.arc_length, trajectory.t))
    planned = 2.0 * mesh.shares * mesh.length / (mesh.v[1:] + mesh.v[:-1])
    differs = np.abs(exact - planned)
    order = np.argsort(-differs, kind="stable")
    total = np.cumsum(differs[order])
    marked = order[: min(most, 1 + int(np.searchsorted(total, BULK * total[-1])))]
    counts = np.ones(mesh.intervals, dtype=np.int64)
    counts[marked] = 2
    return counts


def between_knots(problem: Problem, mesh: Mesh, samples: int = 8) -> Array:
    """(n,) [m], how much clearance each interval of the program's own motion lacks at most, sampled."""
    fine = mesh.split(np.full(mesh.intervals, samples))
    if problem.zone is None:
        lack = problem.braking.distance(fine.v) - problem.clearance(fine.points)
    else:
        poses = np.column_stack([fine.points, fine.theta])
        lack = -least_gap(problem.zone, problem.world, poses, fine.v)
    inner = lack[:-1].reshape(mesh.intervals, samples)
    return np.maximum(inner.max(axis=1), 0.0)


def _round(number: int, solution: Solution, trajectory: Trajectory | None, problem: Problem) -> Round:
    return Round(
        round=number,
        intervals=solution.mesh.intervals,
        iterations=solution.iterations,
        status=solution.status,
        solver_time=solution.solve_time,
        program_time=solution.travel_time,
        travel_time=None if trajectory is None else trajectory.travel_time,
        worst_violation=float(between_knots(problem, solution.geometry).max()),
    )
