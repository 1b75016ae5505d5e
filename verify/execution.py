"""From a plan to what the vehicle executes: driven in simulation, and slowed until it holds.

A plan at the very limit of friction or tip-over leaves nothing for the controller to correct with. Such a
motion is planned again with a smaller share of both limits, until the simulated vehicle follows it on all
wheels. Slowing along the same path instead costs over a hundred times as much on the slippery warehouse.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from systems.simulation import SimulationRun, simulate
from verify.judge.checks import Setting
from verify.judge.motion import COLUMNS, Motion
from verify.judge.tracking import Record, judge_run
from vnav_drake.collocation import plan_full
from vnav_drake.plan import Plan, Trajectory
from vnav_drake.problem import PlanningError
from vnav_drake.scenario import Scenario

GRIP_SHARES = (0.975, 0.95, 0.9, 0.85, 0.8)  # of the friction and tip-over limits, tried in turn


@dataclass(frozen=True)
class Execution:
    """The motion to execute and the vehicle's run along it."""

    plan: Plan
    run: SimulationRun


def execute(scenario: Scenario, plan: Plan) -> Execution:
    """Drive the plan; where the vehicle strays, leave the controller part of the limits.

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
        robot = problem.robot
        careful = replace(robot, friction=share * robot.friction, com_height=robot.com_height / share)
        try:
            slower = plan_full(replace(problem, robot=careful), plan.path, effort=scenario.plan.effort)
        except PlanningError:
            break
        run = simulate(robot, slower.trajectory)
        if _follows(run, slower.trajectory, setting):
            before = {"seeds": plan.details["seeds"], "full_grip_time": plan.travel_time}
            return Execution(replace(slower, details={**slower.details, **before, "grip_share": share}), run)
    return first


def _follows(run: SimulationRun, trajectory: Trajectory, setting: Setting) -> bool:
    """Whether the judge will be content: the same rule, so that both cannot differ."""
    motion = Motion(*(getattr(trajectory, name) for name in COLUMNS))
    columns = (run.t, run.x, run.y, run.heading, run.v, run.lateral_acceleration)
    record = Record(*(np.asarray(column) for column in columns))
    goal, limits = setting.goal.position, setting.limits
    return judge_run(record, motion, goal, setting.surroundings, limits).check.status == "passed"
