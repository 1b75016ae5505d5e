"""The run: one choice after another until the goal is reached or the robot is stuck."""

from __future__ import annotations

import math
import time as clock
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from vnav_drake.dwa.goal import NO_CHORD, drive_to_goal, goal_curvature
from vnav_drake.dwa.objective import Objective, best, top_speed
from vnav_drake.dwa.stuck import Reason, Stuck, Watch
from vnav_drake.dwa.window import (
    Arcs,
    choices,
    curvature_window,
    greatest_deceleration,
    window_speeds,
)
from vnav_drake.plan import Plan, Trajectory, arc_step
from vnav_drake.problem import End, PlanningError, Problem

Array = NDArray[np.float64]

CURVATURES = 41  # in the window, besides the one now, zero, and that of the arc through the goal
SPEEDS = 21  # in the window
HEADINGS = 36  # at a start without heading, besides that towards the goal
START_SPEEDS = (1.0, 0.95, 0.9, 0.8, 0.6, 0.4, 0.2, 0.0)  # of the safe speed, at a start at safe speed
MOST_WINDOWS = 2000  # of motion, whatever the step
MOST_DECISIONS = 20_000  # whatever the step: some minutes of computing


@dataclass(frozen=True, kw_only=True)
class DwaRun:
    """What came of it. A run that got stuck ends at rest where it gave up."""

    trajectory: Trajectory
    reached: bool  # the goal exactly, with its speed, and heading where it has one
    stuck: Stuck | None  # None when the goal is reached
    decisions: int
    goal_distance: float  # [m], at the end
    compute_time: float  # [s]
    settings: dict[str, object] = field(default_factory=dict)

    @property
    def travel_time(self) -> float:
        """[s]"""
        return self.trajectory.travel_time

    @property
    def length(self) -> float:
        """[m]"""
        return self.trajectory.length

    @property
    def plan(self) -> Plan:
        """As a plan of the full model, method "dwa"; `details` hold what the run found."""
        details: dict[str, object] = {
            "reached": self.reached,
            "decisions": self.decisions,
            "goal_distance": self.goal_distance,
            "compute_time": self.compute_time,
            **self.settings,
        }
        if self.stuck is not None:
            details["stuck"] = {
                "reason": self.stuck.reason,
                "time": self.stuck.time,
                "place": self.stuck.place,
                "message": self.stuck.message,
            }
        return Plan(method="dwa", model="full", trajectory=self.trajectory, details=details)


@dataclass
class _Motion:
    """The rows so far and the state after them."""

    place: Array  # (2,) [m]
    heading: float  # [rad]
    speed: float  # [m/s]
    time: float = 0.0  # [s]
    length: float = 0.0  # [m]
    curvature: float | None = None  # [1/m], of the last row
    lasting: float = math.inf  # [s], of the last rows of that curvature
    rows: list[tuple[float, ...]] = field(default_factory=list)  # t, x, y, heading, v, a, curvature

    @property
    def spot(self) -> tuple[float, float]:
        """The place [m]."""
        return float(self.place[0]), float(self.place[1])

    def drive(self, curvature: float, after: float, duration: float) -> None:
        """One row: an arc with constant tangential acceleration to the speed `after`."""
        rate = (after - self.speed) / duration
        self.rows.append((self.time, *self.place, self.heading, self.speed, rate, curvature))
        step = 0.5 * (self.speed + after) * duration
        dx, dy = arc_step(self.heading, curvature, step)
        self.place = self.place + np.array([dx, dy])
        self.heading += curvature * step
        self.time += duration
        self.length += step
        self.lasting = duration + (self.lasting if curvature == self.curvature else 0.0)
        self.speed, self.curvature = after, curvature

    def trajectory(self, problem: Problem, last: Trajectory | None) -> Trajectory:
        """All rows, `last` appended as it stands."""
        *_, rate, curvature = self.rows[-1] if self.rows else (0.0, 0.0)
        table = [*self.rows, (self.time, *self.place, self.heading, self.speed, rate, curvature)]
        if last is not None:
            table.pop()
            columns = (last.t + self.time, last.x, last.y, last.heading, last.v, last.a, last.curvature)
            table += list(zip(*(column.tolist() for column in columns), strict=True))
        t, x, y, heading, v, a, bend = np.array(table).T
        return Trajectory(t, x, y, heading, v, a, bend, problem.clearance(np.column_stack([x, y])))


def plan_dwa(
    problem: Problem,
    *,
    weights: tuple[float, float, float] = (1.0, 1.0, 1.0),
    window: float = 1.0,
    step: float | None = None,
    most_decisions: int | None = None,
    objective: type[Objective] = Objective,
) -> DwaRun:
    """Drive to the goal by the dynamic window approach (Fox, Burgard and Thrun 1997).

    Parameters
    ----------
    weights : alpha, beta, gamma of heading, free way and speed; zero or more, not all zero.
    window : [s], for which an arc and a speed are chosen.
    step : [s], after which the robot chooses again, at most the window; None: the window, so that the
        robot moves along one circular arc in each window (Manor 2015, Sec. 2.7.2).
    most_decisions : the budget. None: `MOST_WINDOWS` windows of motion, and `MOST_DECISIONS` at most. A run
        that spends it ends for the reason "too_many_decisions", which says nothing of the method.
    objective : what is preferred, `Objective` or a class derived from it.

    Returns
    -------
    DwaRun. Every row of its trajectory obeys all limits of the robot and the braking condition in
    continuous time, whether the goal is reached or not.

    Raises
    ------
    ValueError : a weight, the window, the step or the budget is out of its range.
    PlanningError : start and goal are the same point, or the robot cannot stop safely from its start.

    Notes
    -----
    Differences from the published method, all of which the robot or the comparison demand: arcs are
    those of a steered robot, curvature and not angular velocity is chosen; the braking condition holds
    all along the arc (see `choices`); of a circle half a turn counts as free way (see `Objective`); near
    the goal, the fastest motion along the arc that ends there exactly is taken as soon as it is safe. A
    start without heading takes the heading of the best first choice. Nothing is random.
    """
    begin = clock.perf_counter()
    replan = window if step is None else step
    _require(weights, window, replan, most_decisions)
    if math.dist(problem.start.position, problem.goal.position) <= NO_CHORD:
        raise PlanningError("start and goal are the same point: there is no way to plan")
    top = top_speed(problem)
    prefers = objective(
        weights=weights,
        goal=problem.goal.point,
        top_speed=top,
        look=top * window + float(problem.braking.distance(top)),
    )
    motion, last = _begin(problem, prefers, window)
    budget = most_decisions_of(window, replan) if most_decisions is None else most_decisions
    watch, found, decisions = Watch(problem, top, window / replan), None, 0
    while last is None and found is None:
        found = watch.stuck(motion.time, motion.spot, motion.heading, motion.speed, motion.length)
        if found is None and decisions == budget:
            found = _spent(problem, motion, budget)
        if found is None:
            found = _decide(problem, prefers, motion, window, replan)
            decisions += 1
            last = None if found is not None else _last_arc(problem, motion, window)
    while last is None and motion.speed > 0.0:
        _brake(problem, motion, math.inf)
    if last is None and not motion.rows:
        motion.drive(0.0, 0.0, window)  # a motion has at least one row: it waits
    trajectory = motion.trajectory(problem, last)
    end = (float(trajectory.x[-1]), float(trajectory.y[-1]))
    return DwaRun(
        trajectory=trajectory,
        reached=last is not None,
        stuck=found,
        decisions=decisions,
        goal_distance=math.dist(end, problem.goal.position),
        compute_time=clock.perf_counter() - begin,
        settings={"weights": tuple(weights), "window": window, "step": replan},
    )


def most_decisions_of(window: float, step: float) -> int:
    """The budget of decisions: the same time of motion for every step, as far as computing allows."""
    return min(MOST_DECISIONS, math.ceil(MOST_WINDOWS * window / step))


def _spent(problem: Problem, motion: _Motion, budget: int) -> Stuck:
    left = math.dist(motion.spot, problem.goal.position)
    spent = f"the budget of {budget} decisions is spent after {motion.time:.3f} s of motion"
    return _stuck("too_many_decisions", motion, f"{spent}, {left:.3f} m from the goal; nothing else stops it")


def _stuck(reason: Reason, motion: _Motion, message: str) -> Stuck:
    return Stuck(reason=reason, time=motion.time, place=motion.spot, message=message)


def _decide(
    problem: Problem, objective: Objective, motion: _Motion, window: float, step: float
) -> Stuck | None:
    """One decision, driven; or why there is none."""
    choice = _choose(problem, objective, motion, window, step)
    if choice is not None:
        curvature, after = choice
        if step < window:
            after = motion.speed + (after - motion.speed) * step / window
        motion.drive(curvature, after, step)
    elif motion.speed > 0.0:
        _brake(problem, motion, step)
    elif not _turn_wheels(problem, objective, motion, window, step):
        return _stuck("no_admissible_arc", motion, "at rest, and no arc from here is admissible")
    return None


def _require(weights: tuple[float, ...], window: float, step: float, most_decisions: int | None) -> None:
    if len(weights) != 3 or not all(0.0 <= w < math.inf for w in weights) or not any(weights):
        raise ValueError(f"weights = {weights!r}: must be three finite numbers, zero or more, not all zero")
    if not 0.0 < window < math.inf:
        raise ValueError(f"window = {window!r}: must be positive and finite [s]")
    if not 0.0 < step <= window:
        raise ValueError(f"step = {step!r}: must be positive and at most the window, {window!r} s")
    if most_decisions is not None and most_decisions < 1:
        raise ValueError(f"most_decisions = {most_decisions!r}: must be at least 1")


def _begin(problem: Problem, objective: Objective, window: float) -> tuple[_Motion, Trajectory | None]:
    """The state at the start; or the whole motion, where one arc leads to the goal at once."""
    start = problem.start
    bearing = math.atan2(*(problem.goal.point - start.point)[::-1])
    if start.heading is not None:
        headings = np.array([start.heading])
    else:
        turn = 2.0 * math.pi * np.arange(HEADINGS) / HEADINGS
        headings = bearing + np.concatenate([[0.0], turn[1:]])
    safe = float(problem.safe_speed(start.point))
    fixed = start.fixed_speed
    speeds = [safe * part for part in START_SPEEDS] if fixed is None else [fixed]
    at_goal = End(position=start.position, speed=start.speed, heading=float(headings[0]))
    last = drive_to_goal(problem, at_goal, None, math.inf, _reach(problem, speeds[0], window))
    if last is not None:
        return _Motion(start.point, float(headings[0]), float(last.v[0])), last
    low, high = curvature_window(problem.robot, None, window)
    bends = _by_size(np.linspace(low, high, CURVATURES))
    arcs = Arcs(start.point, np.repeat(headings, len(bends)), np.tile(bends, len(headings)))
    values = []
    for speed in speeds:
        after = window_speeds(problem, start.point, speed, window, SPEEDS)
        values.append(objective.values(problem, choices(problem, arcs, speed, after, window)))
    chosen = best(np.stack(values))
    if chosen is None:
        if 0.0 in speeds:
            return _Motion(start.point, float(headings[0]), 0.0), None
        x, y = start.position
        raise PlanningError(
            f"from the start ({x:g}, {y:g}) m at {speeds[-1]:g} m/s no arc lets the robot stop safely"
        )
    return _Motion(start.point, float(arcs.heading[chosen[2]]), speeds[chosen[0]]), None


def _by_size(curvature: Array) -> Array:
    """Straight first, left before right, each value once."""
    unique = np.unique(np.append(curvature, 0.0))
    return unique[np.lexsort((-unique, np.abs(unique)))]


def _choose(
    problem: Problem, objective: Objective, motion: _Motion, window: float, step: float
) -> tuple[float, float] | None:
    """Curvature [1/m] and speed at the end of the window [m/s] of the best admissible choice."""
    return _choose_within(
        problem,
        objective,
        motion,
        window,
        curvature_window(problem.robot, motion.curvature, _turning(motion, step)),
    )


def _turning(motion: _Motion, step: float) -> float:
    """How long [s] the wheels may turn about now: no longer than the pieces before and after."""
    return min(step, motion.lasting)


def _choose_within(
    problem: Problem, objective: Objective, motion: _Motion, window: float, bounds: tuple[float, float]
) -> tuple[float, float] | None:
    low, high = bounds
    heading = np.array([motion.heading])
    wished = np.append(goal_curvature(motion.place, heading, objective.goal), 0.0)
    if motion.curvature is not None:
        wished = np.append(wished, motion.curvature)
    wished = wished[(low <= wished) & (wished <= high)]
    grid = np.linspace(low, high, CURVATURES)
    bends = _by_size(np.append(grid, wished))
    bends = bends[(low <= bends) & (bends <= high)]
    arcs = Arcs(motion.place, np.repeat(heading, len(bends)), bends)
    speeds = window_speeds(problem, motion.place, motion.speed, window, SPEEDS)
    options = choices(problem, arcs, motion.speed, speeds, window)
    chosen = best(objective.values(problem, options))
    return None if chosen is None else (float(bends[chosen[1]]), float(speeds[chosen[0]]))


def _turn_wheels(problem: Problem, objective: Objective, motion: _Motion, window: float, step: float) -> bool:
    """At rest: wait for the steering on its way to the best arc, if any is admissible."""
    now = motion.curvature
    if now is None or math.isinf(problem.robot.max_steering_rate):
        return False
    wished = _choose_within(problem, objective, motion, window, curvature_window(problem.robot, None, step))
    if wished is None:
        return False
    low, high = curvature_window(problem.robot, now, _turning(motion, step))
    motion.drive(min(max(wished[0], low), high), 0.0, step)
    return True


def _brake(problem: Problem, motion: _Motion, longest: float) -> None:
    """One row along the arc that the robot is on, braking, at most `longest` [s].

    Safe without looking: the last choice was admissible, its stop included, and whoever brakes earlier
    is nowhere faster.
    """
    curvature = 0.0 if motion.curvature is None else motion.curvature
    braking = float(greatest_deceleration(problem, motion.speed, curvature))
    until_rest = motion.speed / braking
    if until_rest <= longest:
        motion.drive(curvature, 0.0, until_rest)
    else:
        motion.drive(curvature, motion.speed - braking * longest, longest)


def _reach(problem: Problem, speed: float, window: float) -> float:
    """Length [m] within a window and the stop after it, at most."""
    fast = speed + problem.robot.max_acceleration * window
    return 0.5 * (speed + fast) * window + fast * fast / (2.0 * problem.robot.max_braking)


def _last_arc(problem: Problem, motion: _Motion, window: float) -> Trajectory | None:
    here = End(position=motion.spot, speed=motion.speed, heading=motion.heading)
    longest = _reach(problem, motion.speed, window)
    return drive_to_goal(problem, here, motion.curvature, motion.lasting, longest)
