"""How much is left: by how much a motion can be sped up, and what an inexact model of the robot costs."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter1d

from systems.following import Following, Tolerance, following
from systems.parallel import in_parallel
from systems.simulation import check_motion, simulate
from vnav_drake.plan import Trajectory
from vnav_drake.robot import Robot

TOLERANCE = Tolerance(sideways=0.05, lateness=0.01, least_lateness=0.1)  # the limits of the check `tracking`
MOST_FACTOR = 4.0  # of the speeds: faster is not looked at
RESOLUTION = 0.01  # of the factor
SAMPLING = 2e-3  # [s], of the demand
LASTING = 0.2  # [s] of the plan, for which a demand must last to count
OVER = 1.1  # of the analytic limit, at which a vehicle must not hold
OFF_BY = 0.1  # of friction, mass and height
OFF_SIDE, OFF_HEADING = 0.03, math.radians(2.0)  # [m], [rad], of the initial pose


@dataclass(frozen=True, kw_only=True)
class Trial:
    """A run at speeds scaled by a factor."""

    factor: float
    demand: float  # greatest share of the analytic limit that it asks for, see `analytic_demand`
    cause: str  # why it does not hold; empty when it does


@dataclass(frozen=True, kw_only=True)
class Margin:
    """By how much the whole speed profile can be scaled."""

    factor: float  # greatest one at which the vehicle held
    ended_by: str  # what went wrong at the next; empty when nothing did up to `MOST_FACTOR`
    analytic: float  # at which the demand reaches the limit of grip or tipping; infinite without demand
    analytic_by: str  # "friction circle", "tip-over"
    trials: tuple[Trial, ...]
    over: Trial | None  # at `OVER` times the analytic limit; None where that is beyond `MOST_FACTOR`


@dataclass(frozen=True, kw_only=True)
class Disturbed:
    """A run of a vehicle that is not what the controller believes."""

    case: str
    found: Following
    travel_time: float | None  # [s]; None when it does not arrive


@dataclass(frozen=True, kw_only=True)
class Studies:
    """What is known of a motion beyond its run."""

    margin: Margin
    robustness: tuple[Disturbed, ...]


def find_margin(
    robot: Robot,
    trajectory: Trajectory,
    *,
    model: str = "four_wheel",
) -> Margin:
    """Scale the speeds of a motion until the vehicle slides, tips, leaves the path or is late.

    The drive and the brakes are given what the scaled motion needs, c^2 times the robot's: else a drive at
    its limit would be all that one learns. The schedule does not slow down in bends. Bisection on the factor
    c, to `RESOLUTION`; that the vehicle holds at all smaller factors is taken for granted.

    Raises
    ------
    ValueError for a trajectory that is none, SimulationError when Drake fails.
    """
    check_motion(trajectory)
    demand, by = analytic_demand(robot, trajectory)
    analytic = 1.0 / math.sqrt(demand) if demand > 0.0 else math.inf
    trials: list[Trial] = []

    def holds(factor: float) -> bool:
        trials.append(_trial(robot, trajectory, factor, demand, model))
        return not trials[-1].cause

    low, high = 0.0, min(MOST_FACTOR, 1.25 * analytic)
    if holds(high) and high < MOST_FACTOR:
        low, high = high, MOST_FACTOR
        if holds(high):
            low = high
    elif not trials[-1].cause:
        low = high
    if low < high:
        first = min(max(0.9 * analytic, 0.5 * high), 0.95 * high)
        low, high = (first, high) if holds(first) else (low, first)
        while high - low > RESOLUTION * high:
            middle = 0.5 * (low + high) if low > 0.0 else 0.8 * high
            low, high = (middle, high) if holds(middle) else (low, middle)
    failed = [trial for trial in trials if trial.cause]
    least = min(failed, key=lambda trial: trial.factor, default=None)
    beyond = math.sqrt(OVER) * analytic
    over = _trial(robot, trajectory, beyond, demand, model) if beyond <= MOST_FACTOR else None
    return Margin(
        factor=low,
        ended_by="" if least is None else least.cause,
        analytic=analytic,
        analytic_by=by,
        trials=tuple(sorted(trials, key=lambda trial: trial.factor)),
        over=over,
    )


def analytic_demand(robot: Robot, trajectory: Trajectory) -> tuple[float, str]:
    """Greatest share of the friction circle or of the tip-over limit that lasts `LASTING`, and of which.

    A peak of a few milliseconds, where pieces of a plan meet, is over before a tyre has slid or a body has
    tipped.
    """
    time = np.arange(0.0, trajectory.travel_time, SAMPLING)
    _, _, _, v, a, curvature = trajectory.at(trajectory.t[0] + time)
    side = v * v * np.abs(curvature)
    window = min(round(LASTING / SAMPLING), len(time))
    grip = _lasting(np.hypot(a, side), window) / robot.friction_acceleration
    tip = _lasting(side, window) / robot.tip_acceleration
    return (grip, "friction circle") if grip >= tip else (tip, "tip-over")


def _lasting(values: NDArray[np.float64], window: int) -> float:
    """Greatest level that all of `window` neighbouring values reach somewhere."""
    return (
        float(minimum_filter1d(values, window, mode="constant", cval=0.0).max()) if window > 1 else values[0]
    )


def scaled(trajectory: Trajectory, factor: float) -> Trajectory:
    """The same path, `factor` times as fast."""
    return replace(
        trajectory, t=trajectory.t / factor, v=trajectory.v * factor, a=trajectory.a * factor * factor
    )


def _trial(robot: Robot, trajectory: Trajectory, factor: float, demand: float, model: str) -> Trial:
    strong = replace(
        robot,
        max_acceleration=robot.max_acceleration * factor**2,
        max_braking=robot.max_braking * factor**2,
    )
    motion = scaled(trajectory, factor)
    run = simulate(strong, motion, model=model, slowing=False)
    return Trial(factor=factor, demand=demand * factor**2, cause=following(run, motion, TOLERANCE).cause)


def study(
    robot: Robot,
    trajectory: Trajectory,
    *,
    model: str = "four_wheel",
    workers: int = 1,
    progress: Callable[[str], None] = lambda _text: None,
) -> Studies:
    """`find_margin`, and a run of each of the `disturbances`; the pieces are shared by the `workers`.

    Raises
    ------
    ValueError for a trajectory that is none, SimulationError when Drake fails, WorkerError when a worker
    process is killed.
    """
    cases = disturbances(robot)
    tasks = [(None, robot, trajectory, model), *((case, robot, trajectory, model) for case in cases)]

    def told(done: int) -> None:
        progress(f"{done} of {len(tasks)}")

    found = in_parallel(_piece, tasks, workers, told)
    margin = next(piece for piece in found if isinstance(piece, Margin))
    return Studies(margin=margin, robustness=tuple(piece for piece in found if isinstance(piece, Disturbed)))


@dataclass(frozen=True, kw_only=True)
class Disturbance:
    """What differs from what the controller believes."""

    case: str  # in words
    actual: Robot
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)  # along, left [m], turned left [rad], at the start


def disturbances(robot: Robot) -> list[Disturbance]:
    """Friction, mass and height of the centre of mass 10 % off, and a start that is not on the path.

    The start is 3 cm to either side, or turned by 2 degrees to either side. Drive and brakes stay as strong
    as they are.
    """
    names = {"friction": "friction", "mass": "mass", "com_height": "height of the centre of mass"}
    cases = [
        Disturbance(
            case=f"{words} {100.0 * change:+.0f} %",
            actual=replace(robot, **{key: (1.0 + change) * getattr(robot, key)}),
        )
        for key, words in names.items()
        for change in (-OFF_BY, OFF_BY)
    ]
    for sign, side in ((1.0, "left"), (-1.0, "right")):
        beside = f"start {100.0 * OFF_SIDE:.0f} cm to the {side}"
        turned = f"start turned {math.degrees(OFF_HEADING):.0f} degrees to the {side}"
        cases += [
            Disturbance(case=beside, actual=robot, offset=(0.0, sign * OFF_SIDE, 0.0)),
            Disturbance(case=turned, actual=robot, offset=(0.0, 0.0, sign * OFF_HEADING)),
        ]
    return cases


def _piece(case: Disturbance | None, robot: Robot, trajectory: Trajectory, model: str) -> Margin | Disturbed:
    """The limits finder without a case, else the run of a case."""
    if case is None:
        return find_margin(robot, trajectory, model=model)
    run = simulate(robot, trajectory, model=model, actual=case.actual, initial_offset=case.offset)
    return Disturbed(
        case=case.case,
        found=following(run, trajectory, TOLERANCE),
        travel_time=run.details.get("travel_time"),
    )
