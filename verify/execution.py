"""From a plan to what the vehicle executes: driven in simulation, and slowed until it holds.

A plan at the very limit of the friction circle leaves nothing for the controller to correct with. Such a
motion is timed again along the same path with a smaller share of the friction, until the simulated
vehicle follows it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from systems.simulation import SimulationRun, simulate
from verify.judge.checks import Setting
from verify.judge.motion import COLUMNS, Motion
from verify.judge.tracking import Record, judge_run
from vnav_drake.plan import Plan, Trajectory
from vnav_drake.problem import PlanningError
from vnav_drake.scenario import Scenario
from vnav_drake.speed_profile import fastest_profile

GRIP_SHARES = (0.975, 0.95, 0.925, 0.9, 0.85, 0.8, 0.7)  # of the friction, tried in turn


@dataclass(frozen=True)
class Execution:
    """The motion to execute and the vehicle's run along it."""

    plan: Plan
    run: SimulationRun


def execute(scenario: Scenario, plan: Plan) -> Execution:
    """Drive the plan; where the vehicle strays, leave the controller part of the friction.

    The plan returned has `grip_share` among its details when it was slowed, and `full_grip_time` [s], what
    it took before. When no share helps the first run stands, for the judge to see.

    Raises
    ------
    SimulationError : the simulation could not finish.
    """
    problem, setting = scenario.problem, Setting.from_spec(scenario.spec)
    first = Execution(plan, simulate(problem.robot, plan.trajectory))
    if plan.path is None or _follows(first.run, plan.trajectory, setting):
        return first
    for share in GRIP_SHARES:
        careful = replace(problem.robot, friction=share * problem.robot.friction)
        try:
            slower = fastest_profile(replace(problem, robot=careful), plan.path, model="full")
        except PlanningError:
            break
        run = simulate(problem.robot, slower)
        if _follows(run, slower, setting):
            details = dict(plan.details) | {"grip_share": share, "full_grip_time": plan.travel_time}
            return Execution(replace(plan, trajectory=slower, details=details), run)
    return first


def _follows(run: SimulationRun, trajectory: Trajectory, setting: Setting) -> bool:
    """Whether the judge will be content: the same rule, so that both cannot differ."""
    motion = Motion(*(getattr(trajectory, name) for name in COLUMNS))
    record = Record(*(np.asarray(column) for column in (run.t, run.x, run.y, run.heading, run.v)))
    goal, limits = setting.goal.position, setting.limits
    return judge_run(record, motion, goal, setting.surroundings, limits.radius).check.status == "passed"
