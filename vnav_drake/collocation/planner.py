"""The two plans of direct collocation: the variational model, and the full robot."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Literal

from vnav_drake.collocation.refine import BUDGETS, refine
from vnav_drake.collocation.seed import first_mesh
from vnav_drake.collocation.units import unit_braking
from vnav_drake.plan import Model, Path, Plan
from vnav_drake.problem import Problem
from vnav_drake.speed_profile import fastest_profile

Effort = Literal["quick", "full"]
Progress = Callable[[str], None]


def plan_variational(
    problem: Problem, seed: Path, *, effort: Effort = "full", progress: Progress | None = None
) -> Plan:
    """The fastest path under the braking distance and the greatest speed alone, near `seed`.

    Certifies the analytic methods, which solve the same model. End speeds are safe, as in
    Manor 2015, ch. 3. The result is a local optimum; near the optimum of its homotopy class it
    is the global one of that class, as the class has a single optimum.

    Raises
    ------
    PlanningError : no safe geometry was found from this seed.
    """
    return _plan(problem, seed, "collocation", "variational", effort, progress)


def plan_full(
    problem: Problem, seed: Path, *, effort: Effort = "full", progress: Progress | None = None
) -> Plan:
    """The fastest motion near `seed` within every limit of the robot, end speeds and headings included.

    Raises
    ------
    PlanningError : no motion was found from this seed that satisfies every limit.
    """
    return _plan(problem, seed, "refined", "full", effort, progress)


def _plan(
    problem: Problem, seed: Path, method: str, model: Model, effort: Effort, progress: Progress | None
) -> Plan:
    begun = time.perf_counter()
    budget = BUDGETS[effort]
    scaled, unit = unit_braking(problem)
    report = None if progress is None else _in_seconds(progress, unit)
    result = refine(scaled, first_mesh(scaled, seed, budget.intervals), model, budget, report)
    trajectory = fastest_profile(problem, result.path, model=model)
    details = {
        "solver": "SNOPT",
        "transcription": "arcs",
        "intervals": result.mesh.intervals,
        "iterations": sum(entry.iterations for entry in result.rounds),
        "compute_time": time.perf_counter() - begun,
        "history": [entry.in_seconds(unit) for entry in result.rounds],
    }
    return Plan(method=method, model=model, trajectory=trajectory, path=result.path, details=details)


def _in_seconds(progress: Progress, unit: float) -> Callable[[int, float], None]:
    return lambda intervals, time: progress(f"{intervals} intervals, {time * unit:.4f} s")
