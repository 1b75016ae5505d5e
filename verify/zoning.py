"""Zones that depend on the heading: what methods for uniform braking solve in their place.

Their paths are driven again with the zone itself, so that every motion that is kept obeys the zone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from vnav_drake.collocation import Effort, Seed, plan_full
from vnav_drake.plan import Model, Path, Plan
from vnav_drake.problem import PlanningError, Problem
from vnav_drake.speed_profile import fastest_profile

OPTIMUM = "collocation"  # the plan of the variational model with the zone itself
UNIFORM = "uniform"  # the plan of the same robot with uniform braking


def stand_in(problem: Problem) -> tuple[Problem, str]:
    """The problem with uniform braking that analytic methods solve, and what its disc is to the zone.

    "inner" and "outer" as `Problem.isotropic` says; "uniform" where the zone has neither: the disc of its own
    stopping distance, which proves nothing but may show the way.
    """
    if problem.zone is None:
        return problem, ""
    try:
        return problem.isotropic()
    except PlanningError:
        return replace(problem, zone=None), UNIFORM


def contained(problem: Problem) -> Problem:
    """The problem with uniform braking whose disc holds the zone, for methods that go where they please.

    Raises
    ------
    PlanningError : no disc holds the zone.
    """
    if problem.zone is None:
        return problem
    law = problem.zone.outer_law()
    if law is None:
        raise PlanningError(f"needs a disc that holds the braking zone {problem.zone.type_name!r}")
    return replace(problem, braking=law, zone=None)


def with_zone(problem: Problem, plan: Plan, kind: str) -> Plan:
    """A plan of the stand-in, driven with the zone itself.

    Its details tell of the stand-in: `relaxation`, with the kind and the travel time [s] there. With a disc
    around the zone the motion is safe as it is, and kept: there may be no bound to the zone's own speeds.

    Raises
    ------
    PlanningError : the path cannot be driven with the zone.
    """
    if problem.zone is None:
        return plan
    details = {**plan.details, "relaxation": {"kind": kind, "travel_time": plan.travel_time}}
    kept = replace(plan, details=details)
    if kind == "outer":
        return kept
    if plan.path is None:
        raise PlanningError(f"{plan.method} gave no path to drive with the braking zone")
    model: Model = "variational" if plan.model == "variational" else "full"
    return replace(kept, trajectory=fastest_profile(problem, plan.path, model=model, ends="safe"))


def plan_uniform(
    problem: Problem, seeds: Sequence[Seed], effort: Effort, progress: Callable[[str], None]
) -> Plan:
    """The same robot with uniform braking: what the zone is compared with, and a way to begin with.

    Raises
    ------
    PlanningError : no motion was found.
    """
    plan = plan_full(replace(problem, zone=None), seeds, effort=effort, progress=progress)
    return replace(plan, method=UNIFORM)


def zone_seeds(seeds: Sequence[Seed], uniform: Plan | None, name: Callable[[Path], str]) -> list[Seed]:
    """The seeds of the full model: the way with uniform braking first, which is safe and smooth.

    It stands for the analytic ones of its class.
    """
    if uniform is None or uniform.path is None:
        return list(seeds)
    found = name(uniform.path)
    first = Seed(uniform.path, UNIFORM, homotopy_class=found, as_mesh=False)
    return [first, *(seed for seed in seeds if seed.method == OPTIMUM or seed.homotopy_class != found)]
