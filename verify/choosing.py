"""Which plan to execute: the variational optimum where nothing is left to refine, else the refined one."""

from __future__ import annotations

from collections.abc import Mapping

from systems import SimulationError, SimulationRun, simulate
from verify.execution import follows
from verify.judge import SAME_TIME
from verify.library import check
from vnav_drake.plan import Plan
from vnav_drake.scenario import Scenario


def optimum_to_execute(scenario: Scenario, plans: Mapping[str, Plan]) -> Plan | None:
    """The plan that stands for the variational optimum, if the full robot may execute it as it is.

    It must pass every check of the full robot, ends included, and no other plan may be faster.
    Whether it is the optimum, within the gate, is for the certificate to say.
    """
    optima = [plans[name] for name in ("speed_graph", "collocation") if name in plans]
    if not optima:
        return None
    optimum = optima[0]  # exact where braking is uniform
    if scenario.problem.zone is not None:
        optimum = min(optima, key=lambda plan: plan.travel_time)
    arrived = [plan for plan in plans.values() if plan.details.get("reached", True)]
    if any(plan.travel_time * (1.0 + SAME_TIME) < optimum.travel_time for plan in arrived):
        return None
    passes = all(found.status == "passed" for found in check(scenario, optimum))
    return optimum if passes else None


def drive_as_planned(scenario: Scenario, plan: Plan, model: str) -> SimulationRun | None:
    """The vehicle's run along the plan; None where it cannot follow it."""
    try:
        run = simulate(scenario.problem.robot, plan.trajectory, model=model)
    except SimulationError:
        return None
    return run if follows(run, plan.trajectory) else None
