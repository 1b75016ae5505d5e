"""The simulation as stages: the run, the emergency stops, how much is left; and what is told of it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from systems import SimulationRun, margins, simulate, tracking_diagram
from systems.following import following
from systems.margins import Disturbed, Studies, Trial
from systems.stops import StopRecords, emergency_stops
from verify import evidence
from verify.replay import write_replay
from verify.stages import Progress, Stages
from vnav_drake.plan import Plan
from vnav_drake.problem import Problem
from vnav_drake.scenario import Scenario

SHOWN = 6  # stops drawn in the replay
MANY_STOPS = 40  # instants from which on it pays to start worker processes


def main_model(scenario: Scenario) -> str:
    """The model whose run and stops are judged: of both the four-wheeled one."""
    asked = scenario.simulation.model
    return "four_wheel" if asked == "both" else asked


def drive_prescreen(stages: Stages, plan: Plan) -> SimulationRun | None:
    """The single track's run where both models are asked for."""
    scenario = stages.scenario
    if scenario.simulation.model != "both":
        return None
    robot = scenario.problem.robot
    return stages.run("single_track", lambda: simulate(robot, plan.trajectory, model="single_track"))


def stop_everywhere(stages: Stages, plan: Plan) -> StopRecords | None:
    """The emergency stops along the executed motion; None where none are asked for."""
    scenario = stages.scenario
    settings, problem, told = scenario.simulation, scenario.problem, stages.told("emergency stops")
    if settings.stops == 0:
        return None
    return stages.run(
        "emergency_stops",
        lambda: emergency_stops(
            problem.robot,
            plan.trajectory,
            count=settings.stops,
            model=main_model(scenario),
            reaction_time=problem.braking.reaction_time,
            workers=stages.workers if settings.stops >= MANY_STOPS else 1,
            progress=told,
        ),
    )


def study(stages: Stages, plan: Plan) -> Studies | None:
    """Limits finder and robustness sweep of the executed motion, where asked for.

    None also where the run did not hold: what a vehicle bears that cannot follow its motion as it is planned
    says nothing.
    """
    scenario, run = stages.scenario, stages.done.run
    if not scenario.simulation.studies or run is None:
        return None
    if following(run, plan.trajectory, margins.TOLERANCE).cause:
        return None
    robot, model, told = scenario.problem.robot, main_model(scenario), stages.told("studies")
    return stages.run(
        "studies",
        lambda: margins.study(robot, plan.trajectory, model=model, workers=stages.workers, progress=told),
    )


def wiring(scenario: Scenario, done: Progress) -> Any:
    """The Drake diagram that drove the executed motion; None where nothing drove."""
    plan = done.plans.get(done.executed or "")
    if plan is None or done.run is None:
        return None
    return tracking_diagram(scenario.problem.robot, plan.trajectory, model=done.run.model).diagram


def show_replay(stages: Stages, folder: Path) -> None:
    """Write the run to look at, with the stops that come closest to something drawn on the floor."""
    scenario, done = stages.scenario, stages.done
    plan, run = done.plans.get(done.executed or ""), done.run
    if plan is None or run is None:
        return

    def work() -> None:
        write_replay(
            folder / evidence.REPLAY,
            scenario=scenario,
            trajectory=plan.trajectory,
            run=run.columns,
            stops=[] if done.stops is None else closest_stops(scenario.problem, done.stops),
            zone=None if done.fields is None else done.fields.field_set,
        )

    stages.run("replay", work, only_for="the replay")


def closest_stops(problem: Problem, stops: StopRecords) -> list[NDArray[np.float64]]:
    """Paths (k, 2) [m] of the stops that come closest to something, in order; none without stops."""
    if len(stops.instant) == 0:
        return []
    clearance = problem.clearance(stops.rows[:, 1:3])
    least = np.minimum.reduceat(clearance, stops.first[:-1])
    return [stops.rows[stops.first[i] : stops.first[i + 1], 1:3] for i in np.argsort(least)[:SHOWN].tolist()]


def about_studies(studies: Studies) -> dict[str, Any]:
    """The entries `margin` and `robustness` of the result."""
    margin = studies.margin
    found: dict[str, Any] = {
        "factor": margin.factor,
        "ended_by": margin.ended_by or "nothing",
        "runs": [_trial(trial) for trial in margin.trials],
    }
    if math.isfinite(margin.analytic):
        found |= {"analytic": margin.analytic, "analytic_by": margin.analytic_by}
    if margin.over is not None:
        found["over"] = _trial(margin.over) | {"flagged": bool(margin.over.cause)}
    return {"margin": found, "robustness": [_disturbed(case) for case in studies.robustness]}


def _trial(trial: Trial) -> dict[str, Any]:
    return {
        "factor": trial.factor,
        "demand": trial.demand,
        "holds": not trial.cause,
        "cause": trial.cause,
    }


def _disturbed(case: Disturbed) -> dict[str, Any]:
    found: Mapping[str, Any] = {
        "case": case.case,
        "holds": not case.found.cause,
        "cause": case.found.cause,
        "max_lateral_error": case.found.sideways,
        "max_lateness": case.found.lateness,
        "travel_time": case.travel_time,
        "least_load": case.least_load,
        "slid": case.slid,
    }
    return {key: value for key, value in found.items() if value is not None}
