"""Run a vehicle along a trajectory and record what it did."""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import Context

from systems.diagram import INTEGRATION_STEP, LOG_PERIOD, REST_SPEED, TrackingDiagram, tracking_diagram
from systems.four_wheel import PLANT_STEP, WHEELS
from systems.run import (
    LIFT_TIME,
    NO_LOAD,
    SLIDE_DEMAND,
    SLIDE_TIME,
    SLIP_LOAD,
    SLIP_SPEED,
    SimulationRun,
    run_columns,
    sustained,
)
from systems.single_track import Motion, State
from systems.supervisor import STANDING, Mode, Order
from systems.wheels import FROM_CONTACT, RECORD
from vnav_drake.plan import Trajectory
from vnav_drake.robot import GRAVITY, Robot

Array = NDArray[np.float64]

INTEGRATION_SCHEME = "runge_kutta3"  # of the single track; the four-wheeled plant steps by itself
STEPS = (PLANT_STEP, 0.5 * PLANT_STEP)  # [s], of the four-wheeled plant
SETTLING_TIME = 2.0  # [s], allowed after the planned end ...
SETTLING_SHARE = 0.1  # ... and this share of the planned time
ARRIVED = 1e-2  # [m/s], slower than this at a goal at rest it has arrived
NEAR_GOAL = 0.5  # [m], of arc length from the end: the goal line is not mistaken for another crossing
LONG_RUN = 1000.0  # [s], from which on rows are further apart ...
SPARSEST = 9  # ... up to this many times, for the judge wants one every 0.1 s
GLANCE = 0.25  # [s], between two looks whether the vehicle has fallen


class SimulationError(Exception):
    """The simulation could not be run or finished; the message says why. Physics never raises this."""


def simulate(
    robot: Robot,
    trajectory: Trajectory,
    *,
    model: str = "four_wheel",
    actual: Robot | None = None,
    step: float = PLANT_STEP,
    initial_offset: tuple[float, float, float] = (0.0, 0.0, 0.0),
    slowing: bool = True,
) -> SimulationRun:
    """Let a vehicle follow a trajectory and record it.

    Parameters
    ----------
    robot : mass, axles, friction and limits of the vehicle as the controller knows them.
    trajectory : at least two rows. The vehicle starts on the first row, as if it had driven up to it: its
        body turned so that it moves along the course, steering and yaw rate of the bend.
    model : "four_wheel", or "single_track", which is all that a point robot can be.
    actual : the vehicle that drives, where it is another than the controller believes.
    step : of the four-wheeled plant [s]: 2 ms, or 1 ms to look closer.
    initial_offset : (along [m], left [m], turned left [rad]) from the first row.
    slowing : let the schedule slow down where a bend takes nearly all the friction.

    Returns
    -------
    SimulationRun, which ends when the vehicle passes the goal line (or stands, where the trajectory ends at
    rest) or has fallen, at the latest 2 s and 10 % of the travel time after the planned end. `details`:
    `ended` ("arrived", "fallen", "standing", "out_of_time"), `arrived`, `travel_time` [s] (present when
    arrived), `slid`, `slide_onset` [s] (present when slid), `wheel_lift`, `lift_onset` [s] (present when
    lifted), `fell`, `max_lateral_acceleration` [m/s^2], `integrator`, `compute_time` [s],
    `real_time_factor`. Lifted are both wheels of a side or an axle; one alone may be where a robot brakes in
    a bend, and it does not tip. `least_load`: of a wheel, over a quarter of the weight. A single track never
    lifts a wheel: there `wheel_lift` is lateral acceleration above the robot's tip limit at some row, and
    `pitch_lift` an axle without load.

    Raises
    ------
    ValueError for a model, step or trajectory as not allowed above, SimulationError when Drake fails.
    """
    check_motion(trajectory)
    if model not in ("four_wheel", "single_track"):
        raise ValueError(f"model = {model!r}: must be four_wheel or single_track")
    if step not in STEPS:
        raise ValueError(f"step = {step!r}: must be one of {STEPS} [s]")
    began = time.perf_counter()
    try:
        loop = tracking_diagram(
            robot,
            trajectory,
            model=model,
            actual=actual,
            step=step,
            slowing=slowing,
            log_period=LOG_PERIOD * min(max(math.ceil(trajectory.travel_time / LONG_RUN), 1), SPARSEST),
        )
        simulator = started(loop, shifted(loop.start, trajectory, initial_offset))
        context = simulator.get_mutable_context()
        ended = drive(simulator, loop, trajectory)
        record = loop.log.FindLog(context)
        times, rows = record.sample_times().copy(), record.data().copy()
    except RuntimeError as error:
        raise SimulationError(f"{model}: Drake stopped: {error}") from error
    compute_time = time.perf_counter() - began
    return recorded(actual or robot, trajectory, loop, times, rows, ended, compute_time)


def check_motion(trajectory: Trajectory) -> None:
    """Refuse a trajectory that is none with a ValueError."""
    if len(trajectory.t) < 2 or not trajectory.travel_time > 0.0:
        raise ValueError(f"trajectory: {len(trajectory.t)} rows: must have at least two and take time")
    for name in ("t", "x", "y", "heading", "v", "a", "curvature"):
        if not np.isfinite(getattr(trajectory, name)).all():
            raise ValueError(f"trajectory: column {name}: must be finite")
    slowest = int(np.argmin(trajectory.v))
    if trajectory.v[slowest] < -REST_SPEED:
        raise ValueError(
            f"trajectory: column v: row {slowest}: {trajectory.v[slowest]:g} m/s: reversing is not supported,"
            " must be zero or more"
        )


def started(loop: TrackingDiagram, state: State) -> Simulator:
    """A simulator of the loop with the vehicle in a state."""
    simulator = Simulator(loop.diagram)
    config = SimulatorConfig(
        integration_scheme=INTEGRATION_SCHEME, max_step_size=INTEGRATION_STEP, use_error_control=False
    )
    ApplySimulatorConfig(config, simulator)
    loop.begin(simulator.get_mutable_context(), state)
    simulator.Initialize()
    return simulator


def shifted(start: State, trajectory: Trajectory, offset: tuple[float, float, float]) -> State:
    """A state moved (along [m], left [m]) and turned [rad] from the first row of a trajectory."""
    along, left, turned = offset
    course = float(trajectory.heading[0])
    return start._replace(
        x=start.x + along * math.cos(course) - left * math.sin(course),
        y=start.y + along * math.sin(course) + left * math.cos(course),
        heading=start.heading + turned,
    )


def mode_of(loop: TrackingDiagram, context: Context) -> Mode:
    """What the supervisor is at."""
    memory = loop.supervisor.GetMyContextFromRoot(context).get_discrete_state_vector()
    return Mode(int(Order(*memory.CopyToVector().tolist()).mode))


def drive(simulator: Simulator, loop: TrackingDiagram, trajectory: Trajectory) -> str:
    """Advance to the end of the run; how it ended, see `simulate`."""
    context = simulator.get_mutable_context()
    planned, rest_end, period = trajectory.travel_time, float(trajectory.v[-1]) <= REST_SPEED, loop.period
    latest = planned + SETTLING_TIME + SETTLING_SHARE * planned
    ticks = math.ceil(latest / period)
    # nothing can arrive before the vehicle is near the goal: a glance now and then until there
    first = max(int(0.8 * planned / period), 0)
    glance = max(round(GLANCE / period), 1)
    ended = "out_of_time"
    for tick in [*range(glance, first, glance), *range(first, ticks + 1)]:
        simulator.AdvanceTo(tick * period)
        state = loop.vehicle.state(context)
        if not all(map(math.isfinite, state)):
            raise SimulationError(f"{loop.model}: the state is not finite at t = {context.get_time():.3f} s")
        if mode_of(loop, context) == Mode.FALLEN:
            ended = "fallen"
            break
        if tick >= first and _arrives(simulator, loop, trajectory, state, rest_end):
            ended = "arrived"
            break
    else:
        speed = math.hypot(state.longitudinal_velocity, state.lateral_velocity)
        ended = "standing" if speed < STANDING else ended
    loop.diagram.ForcedPublish(context)
    return ended


def _arrives(
    simulator: Simulator, loop: TrackingDiagram, trajectory: Trajectory, state: State, rest_end: bool
) -> bool:
    """Whether the vehicle has arrived, or does within the next period, to which it is then advanced."""
    context = simulator.get_mutable_context()
    ahead, closing, beside = _goal_line(state, loop, context, trajectory)
    near = beside > trajectory.length - NEAR_GOAL
    if rest_end:
        return near and mode_of(loop, context) == Mode.STOPPED
    if near and ahead > 0.0 and closing > 0.0 and ahead < closing * loop.period:
        simulator.AdvanceTo(context.get_time() + ahead / closing)
        return True
    return near and ahead <= 0.0


def _goal_line(
    state: State, loop: TrackingDiagram, context: Context, trajectory: Trajectory
) -> tuple[float, float, float]:
    """Distance to the goal line [m], speed towards it [m/s], arc length beside the vehicle [m]."""
    course = float(trajectory.heading[-1])
    cosine, sine = math.cos(course), math.sin(course)
    ahead = (float(trajectory.x[-1]) - state.x) * cosine + (float(trajectory.y[-1]) - state.y) * sine
    turned = state.heading - course
    closing = state.longitudinal_velocity * math.cos(turned) - state.lateral_velocity * math.sin(turned)
    memory = loop.source.GetMyContextFromRoot(context).get_discrete_state_vector()
    return ahead, closing, float(memory.GetAtIndex(1))


def recorded(
    robot: Robot,
    trajectory: Trajectory,
    loop: TrackingDiagram,
    times: Array,
    rows: Array,
    ended: str,
    compute_time: float,
) -> SimulationRun:
    """The run of a log (times (m,), rows (channels, m)) and what it shows."""
    keep = np.append(np.diff(times) > 0.0, True)  # the last row may fall on a logged instant
    t = times[keep]
    four = loop.model == "four_wheel"
    names = RECORD if four else Motion._fields
    motion = dict(zip(names, rows[:, keep], strict=True))
    motion["heading"] = np.unwrap(motion["heading"])
    if four:  # nothing presses the wheels onto the floor before the first step: as after it
        for name in FROM_CONTACT:
            motion[name][0] = motion[name][min(1, len(t) - 1)]
    common = {name: motion.pop(name) for name in run_columns() if name != "t"}
    shown = _four_wheel_details(t, motion) if four else _single_track_details(robot, t, common, motion)
    details: dict[str, Any] = {
        "ended": ended,
        "arrived": ended == "arrived",
        "fell": ended == "fallen",
        **shown,
        "max_lateral_acceleration": float(np.abs(common["lateral_acceleration"]).max()),
        "compute_time": compute_time,
        "real_time_factor": float(t[-1]) / compute_time,
    }
    if ended == "arrived":
        at_rest = float(trajectory.v[-1]) <= REST_SPEED
        details["travel_time"] = _arrival(t, common["v"], rest_end=at_rest)
    step = loop.vehicle_step
    return SimulationRun(model=loop.model, t=t, step=step, channels=motion, details=details, **common)


def _four_wheel_details(t: Array, channels: dict[str, Array]) -> dict[str, Any]:
    loads = np.stack([channels[f"load_{wheel}"] for wheel in WHEELS])
    slips = np.stack([channels[f"slip_{wheel}"] for wheel in WHEELS])
    share = loads.sum(axis=0).mean() / 4.0
    sliding = ((slips > SLIP_SPEED) & (loads > SLIP_LOAD * share)).any(axis=0)
    slide = sustained(t, sliding, SLIDE_TIME, float(np.diff(t).max()))
    # the first row is before the first step, when nothing has pressed the wheels onto the floor
    lift = sustained(t[1:], channels["least_side"][1:] <= NO_LOAD, LIFT_TIME, float(np.diff(t).max()))
    found: dict[str, Any] = {
        "slid": slide is not None,
        "wheel_lift": lift is not None,
        "least_load": float(channels["least_load"][1:].min(initial=1.0)),
        "integrator": "discrete, lagged contact",
    }
    if slide is not None:
        found["slide_onset"] = slide
    if lift is not None:
        found["lift_onset"] = lift
    return found


def _single_track_details(
    robot: Robot, t: Array, common: dict[str, Array], channels: dict[str, Array]
) -> dict[str, Any]:
    demand = np.maximum(channels["front_demand"], channels["rear_demand"])
    slide = sustained(t, demand > SLIDE_DEMAND, SLIDE_TIME, float(np.diff(t).max()))
    load, weight = channels["front_load"], robot.mass * GRAVITY
    side = float(np.abs(common["lateral_acceleration"]).max())
    found: dict[str, Any] = {
        "slid": slide is not None,
        "wheel_lift": side > robot.tip_acceleration,
        "pitch_lift": bool(np.any((load <= 0.0) | (load >= weight))),
        "integrator": f"{INTEGRATION_SCHEME}, fixed step",
    }
    if slide is not None:
        found["slide_onset"] = slide
    return found


def _arrival(t: Array, v: Array, *, rest_end: bool) -> float:
    """Time [s] of arrival: the last row, or the one from which on the vehicle hardly moves."""
    if not rest_end:
        return float(t[-1])
    moving = np.flatnonzero(np.abs(v) >= min(ARRIVED, 0.01 * float(np.abs(v).max())))
    return float(t[min(moving[-1] + 1, len(t) - 1)]) if len(moving) else 0.0
