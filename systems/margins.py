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
LEAST_FACTOR, MOST_FACTOR = 0.5, 4.0  # of the speeds: slower and faster is not looked at
RESOLUTION = 0.01  # of the factor
FIRST = 0.95  # of the analytic limit, where most vehicles still hold
STRIDE = 0.1  # of the factor: how far the next trial is where one end of the bracket is missing
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

    factor: float  # greatest one at which the vehicle held; 0 when it held at none that was tried
    ended_by: str  # what went wrong at the least factor that failed; empty when none did up to `MOST_FACTOR`
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
    least_load: float | None  # of a wheel, over a quarter of the weight; None for a single track
    slid: bool


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
    c, to `RESOLUTION`, between the greatest that held and the least that failed; that the vehicle holds at
    all smaller factors is taken for granted. Where it holds at none down to `LEAST_FACTOR` the factor is 0.

    Raises
    ------
    ValueError for a trajectory that is none, SimulationError when Drake fails.
    """
    check_motion(trajectory)
    demand, by = analytic_demand(robot, trajectory)
    analytic = _limit(demand)
    trials: list[Trial] = []

    def holds(factor: float) -> bool:
        trials.append(_trial(robot, trajectory, factor, demand, model))
        return not trials[-1].cause

    over = over_the_limit(robot, trajectory, model=model)
    held = over.factor if over is not None and not over.cause else 0.0
    failed = over.factor if over is not None and over.cause else math.inf
    factor = _bisected(holds, held, failed, FIRST * analytic)
    every = trials if over is None else [*trials, over]
    least = min((trial for trial in every if trial.cause), key=lambda trial: trial.factor, default=None)
    return Margin(
        factor=factor,
        ended_by="" if least is None else least.cause,
        analytic=analytic,
        analytic_by=by,
        trials=tuple(sorted(trials, key=lambda trial: trial.factor)),
        over=over,
    )


def over_the_limit(robot: Robot, trajectory: Trajectory, *, model: str = "four_wheel") -> Trial | None:
    """The run at speeds that ask for `OVER` times the analytic limit; None beyond `MOST_FACTOR`.

    Raises
    ------
    As `find_margin`.
    """
    check_motion(trajectory)
    demand, _ = analytic_demand(robot, trajectory)
    factor = math.sqrt(OVER) * _limit(demand)
    return _trial(robot, trajectory, factor, demand, model) if factor <= MOST_FACTOR else None


def _limit(demand: float) -> float:
    """Factor of the speeds at which a demand reaches 1; infinite without demand."""
    return 1.0 / math.sqrt(demand) if demand > 0.0 else math.inf


def _bisected(holds: Callable[[float], bool], held: float, failed: float, guess: float) -> float:
    """Greatest factor that holds, to `RESOLUTION`; 0 when none did.

    `held` and `failed` bracket it: the greatest factor known to hold, 0 where none is, and the least known to
    fail, infinite where none is. `guess` is tried first where it is between them.
    """
    guess, stride = min(max(guess, LEAST_FACTOR), MOST_FACTOR), STRIDE
    while True:
        if held < guess < failed:
            factor = guess
        elif math.isinf(failed):
            if held >= MOST_FACTOR:
                return held
            factor, stride = min(held * (1.0 + stride), MOST_FACTOR), 2.0 * stride
        elif held == 0.0:
            if failed <= LEAST_FACTOR:
                return held
            factor, stride = max(failed / (1.0 + stride), LEAST_FACTOR), 2.0 * stride
        elif failed - held <= RESOLUTION * held:
            return held
        else:
            factor = 0.5 * (held + failed)
        if holds(factor):
            held = factor
        else:
            failed = factor


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
    return float(minimum_filter1d(values, window, mode="constant", cval=0.0).max())


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
        least_load=run.details.get("least_load"),
        slid=run.details["slid"],
    )
