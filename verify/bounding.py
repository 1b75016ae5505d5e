"""The global lower bound as a stage: a certificate that no motion is faster, as tight as its gate asks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from verify.aim import aimed_gap, is_pursued
from vnav_drake.lower_bound import LowerBound, lower_bound
from vnav_drake.plan import Plan
from vnav_drake.problem import NoPathError, PlanningError
from vnav_drake.scenario import Scenario
from vnav_drake.zones.catalogue import field_set
from vnav_drake.zones.field_set import FieldSet

METHOD = "quadratic certificate (second-order cone program)"
OPTIMA = ("speed_graph", "collocation")  # plans of the variational model, whose gap is certified
EMERGENCY = 900.0  # [s] after which no further round is begun, told as `stopped: time`; runs take seconds
WITHIN = 1.0 - 1e-6  # of the gate's limit is aimed at: the checker rounds the bound down


def run_lower_bound(
    scenario: Scenario,
    plans: Mapping[str, Plan],
    overrides: Mapping[str, float],
    progress: Callable[[str], None],
) -> LowerBound:
    """Bound the travel time of every motion from below.

    Parameters
    ----------
    plans : by method; the least time of the variational optima among them says when the gap is reached.
    overrides : limits of gates given on the command line.
    progress : is told rounds, triangles and the gap so far.

    Raises
    ------
    PlanningError : no certificate was found, or the scenario's fields are not for what it would prove.
    NoPathError : there is no path for this robot, and no plan says otherwise.
    """
    _require_fields_that_hold_the_base(scenario)
    optima = OPTIMA if scenario.problem.has_variational_optimum else ("refined",)
    upper = min((plans[name].travel_time for name in optima if name in plans), default=None)
    try:
        return lower_bound(
            scenario.problem,
            upper=upper,
            gap=aimed_gap(scenario, overrides) * WITHIN,
            time_limit=EMERGENCY,
            effort=scenario.plan.effort if is_pursued(scenario, overrides) else "quick",
            progress=progress,
        )
    except NoPathError as error:
        if not plans:
            raise
        raise PlanningError(f"it finds no way where there is a plan: {error}") from error
    except (MemoryError, RuntimeError) as error:  # also what Drake's solvers raise
        words = str(error).partition("\n")[0]
        raise PlanningError(f"{type(error).__name__}{words and ': '}{words}") from error


def _require_fields_that_hold_the_base(scenario: Scenario) -> None:
    """A bound for the base zone is one for fields that hold it; others may allow faster motions."""
    asked, problem = scenario.spec.braking.zone, scenario.problem
    if asked.type != FieldSet.type_name or "fields" not in asked.parameters:
        return
    reserve = problem.robot.reserved_lateral_acceleration() if problem.friction_reserve else None
    fields = field_set(asked.parameters, problem.braking, problem.robot.radius, reserve)
    if fields is None or fields.narrower is None:
        return
    i = fields.narrower
    raise PlanningError(
        f"not run: braking.zone.fields[{i}] does not hold the base zone at {fields.max_speeds[i]:g} m/s, so "
        "the fields may allow motions that are faster than a bound for the base zone says"
    )


def about(bound: LowerBound) -> dict[str, Any]:
    """How the bound was found, for `lower_bound` in result.json; what it proves is for the judge to say."""
    rounds = [
        {
            "triangles": step.triangles,
            "lower_bound": step.lower_bound,
            "status": step.status,
            "seconds": step.seconds,
        }
        for step in bound.rounds
    ]
    return {"method": METHOD, "stopped": bound.stopped, "rounds": rounds}
