"""Run a vehicle along a trajectory and record what it did."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path as FilePath
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import Context

from systems.diagram import LOG_PERIOD, REST_SPEED, TrackingDiagram, tracking_diagram
from systems.single_track import Motion, State
from systems.tracking import CONTROL_PERIOD
from vnav_drake.plan import Trajectory
from vnav_drake.robot import GRAVITY, Robot

Array = NDArray[np.float64]

INTEGRATION_SCHEME = "runge_kutta3"
DEFAULT_STEP = 2.5e-3  # [s]
MAX_STEP = 2.5e-3  # [s], see `systems.tyre.rolling_speed`
SETTLING_TIME = 2.0  # [s], allowed after the planned end ...
SETTLING_SHARE = 0.1  # ... and this share of the planned time
STANDING = 1e-3  # [m/s], slower than this the vehicle stands
ARRIVED = 1e-2  # [m/s], slower than this at a goal at rest it has arrived
NEAR_GOAL = 0.5  # [m], of arc length from the end: the goal line is not mistaken for another crossing
SLIDE_DEMAND = 1.001  # friction asked over friction there: beyond rounding of a plan on the limit
SLIDE_TIME = 0.1  # [s], sustained: sliding


class SimulationError(Exception):
    """The simulation could not be run or finished; the message says why. Physics never raises this."""


@dataclass(frozen=True, kw_only=True)
class SimulationRun:
    """A recorded run; arrays (m,), about every 10 ms, the last row at the end of the run."""

    model: str  # "single_track"
    t: Array  # [s], from the start
    x: Array  # [m], centre of mass
    y: Array  # [m]
    heading: Array  # [rad], of the body, unwrapped; the direction of travel is heading + atan2(v_lat, v_long)
    v: Array  # [m/s], speed of the centre of mass, negative when rolling backwards
    longitudinal_velocity: Array  # [m/s], along the body
    lateral_velocity: Array  # [m/s], to the left of the body
    yaw_rate: Array  # [rad/s]
    steering: Array  # [rad]
    steering_command: Array  # [rad]
    force_command: Array  # [N]
    longitudinal_force: Array  # [N], on the body, along it
    lateral_acceleration: Array  # [m/s^2], on the body, to its left
    front_demand: Array  # friction asked of the axle over friction there; above 1 it slides
    rear_demand: Array
    front_load: Array  # [N], on the front axle
    step: float  # [s], of the integrator
    details: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "details", MappingProxyType(dict(self.details)))

    def to_csv(self, file: FilePath) -> None:
        """Write the rows with 17 significant digits, so that reading gives back every bit."""
        names = run_columns()
        rows = np.column_stack([getattr(self, name) for name in names])
        np.savetxt(file, rows, fmt="%.17g", delimiter=",", header=",".join(names), comments="")


def run_columns() -> tuple[str, ...]:
    """Names of the recorded columns, in the order of the file."""
    return tuple(f.name for f in fields(SimulationRun) if f.name not in {"model", "step", "details"})


def simulate(
    robot: Robot,
    trajectory: Trajectory,
    *,
    step: float = DEFAULT_STEP,
    initial_offset: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> SimulationRun:
    """Let a single-track vehicle follow a trajectory and record it.

    Parameters
    ----------
    robot : mass, axles, friction and limits of the vehicle; its radius is not used.
    trajectory : at least two rows. The vehicle starts on the first row, as if it had driven up to it: its
        body turned so that the centre of mass moves along the course, steering and yaw rate of the bend.
    step : of the integrator [s], at most 2.5 ms; the control period of 5 ms must be a multiple.
    initial_offset : (along [m], left [m], turned left [rad]) from there.

    Returns
    -------
    SimulationRun, which ends when the vehicle passes the goal line (or stands, where the trajectory ends at
    rest), at the latest 2 s and 10 % of the travel time after the planned end. `details`: `arrived`,
    `travel_time` [s] (present when arrived), `slid`, `slide_onset` [s] (present when slid), `wheel_lift`
    (lateral acceleration above the robot's tip limit at some row), `pitch_lift` (an axle without load),
    `max_lateral_acceleration` [m/s^2], `integrator`, `compute_time` [s], `real_time_factor`.

    Raises
    ------
    ValueError for a step or trajectory as not allowed above, SimulationError when Drake fails.
    """
    if not 0.0 < step <= MAX_STEP or abs(CONTROL_PERIOD / step - round(CONTROL_PERIOD / step)) > 1e-9:
        raise ValueError(
            f"step = {step!r}: must be positive, at most {MAX_STEP} and divide {CONTROL_PERIOD} [s]"
        )
    if len(trajectory.t) < 2 or not trajectory.travel_time > 0.0:
        raise ValueError(f"trajectory: {len(trajectory.t)} rows: must have at least two and take time")
    for name in ("t", "x", "y", "heading", "v", "a", "curvature"):
        if not np.isfinite(getattr(trajectory, name)).all():
            raise ValueError(f"trajectory: column {name}: must be finite")
    began = time.perf_counter()
    try:
        loop = tracking_diagram(robot, trajectory)
        simulator = Simulator(loop.diagram)
        config = SimulatorConfig(
            integration_scheme=INTEGRATION_SCHEME, max_step_size=step, use_error_control=False
        )
        ApplySimulatorConfig(config, simulator)
        context = simulator.get_mutable_context()
        loop.set_state(context, _shifted(loop.start, trajectory, initial_offset))
        simulator.Initialize()
        arrived = _drive(simulator, loop, trajectory)
        record = loop.log.FindLog(context)
        times, rows = record.sample_times().copy(), record.data().copy()
    except RuntimeError as error:
        raise SimulationError(f"single_track: Drake stopped: {error}") from error
    compute_time = time.perf_counter() - began
    return _run(robot, trajectory, times, rows, step, arrived, compute_time)


def _shifted(start: State, trajectory: Trajectory, offset: tuple[float, float, float]) -> State:
    along, left, turned = offset
    course = float(trajectory.heading[0])
    return start._replace(
        x=start.x + along * math.cos(course) - left * math.sin(course),
        y=start.y + along * math.sin(course) + left * math.cos(course),
        heading=start.heading + turned,
    )


def _drive(simulator: Simulator, loop: TrackingDiagram, trajectory: Trajectory) -> bool:
    """Advance to the end of the run; True when the vehicle arrived."""
    context = simulator.get_mutable_context()
    planned, rest_end = trajectory.travel_time, float(trajectory.v[-1]) <= REST_SPEED
    latest = planned + SETTLING_TIME + SETTLING_SHARE * planned
    ticks = math.ceil(latest / CONTROL_PERIOD)
    # nothing can end before the vehicle is near the goal: one call to get there
    first = max(int(0.8 * planned / CONTROL_PERIOD), 0)
    arrived = False
    for tick in range(first, ticks + 1):
        simulator.AdvanceTo(tick * CONTROL_PERIOD)
        state = loop.state(context)
        if not all(map(math.isfinite, state)):
            break
        ahead, closing, beside = _goal_line(state, loop, context, trajectory)
        near = beside > trajectory.length - NEAR_GOAL
        if rest_end:
            ended = _schedule_time(loop, context) >= loop.duration - 1e-9
            speed = math.hypot(state.longitudinal_velocity, state.lateral_velocity)
            arrived = ended and near and speed < STANDING
        elif near and ahead <= 0.0:
            arrived = True
        elif near and closing > 0.0 and ahead < closing * CONTROL_PERIOD:
            simulator.AdvanceTo(context.get_time() + ahead / closing)
            arrived = True
        if arrived:
            break
    loop.diagram.ForcedPublish(context)
    return arrived


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


def _schedule_time(loop: TrackingDiagram, context: Context) -> float:
    memory = loop.source.GetMyContextFromRoot(context).get_discrete_state_vector()
    return float(memory.GetAtIndex(0))


def _run(
    robot: Robot,
    trajectory: Trajectory,
    times: Array,
    rows: Array,
    step: float,
    arrived: bool,
    compute_time: float,
) -> SimulationRun:
    keep = np.append(np.diff(times) > 0.0, True)  # the last row may fall on a logged instant
    t = times[keep]
    motion = dict(zip(Motion._fields, rows[:, keep], strict=True))
    slide = _sustained(t, np.maximum(motion["front_demand"], motion["rear_demand"]) > SLIDE_DEMAND)
    side = float(np.abs(motion["lateral_acceleration"]).max())
    weight = robot.mass * GRAVITY
    load = motion["front_load"]
    details: dict[str, Any] = {
        "arrived": arrived,
        "slid": slide is not None,
        "wheel_lift": side > robot.tip_acceleration,
        "pitch_lift": bool(np.any((load <= 0.0) | (load >= weight))),
        "max_lateral_acceleration": side,
        "integrator": f"{INTEGRATION_SCHEME}, fixed step",
        "compute_time": compute_time,
        "real_time_factor": float(t[-1]) / compute_time,
    }
    if slide is not None:
        details["slide_onset"] = slide
    if arrived:
        details["travel_time"] = _arrival(t, motion["v"], rest_end=float(trajectory.v[-1]) <= REST_SPEED)
    return SimulationRun(model="single_track", t=t, step=step, details=details, **motion)


def _sustained(t: Array, sliding: NDArray[np.bool_]) -> float | None:
    """Start [s] of the first stretch of at least `SLIDE_TIME` in which `sliding` holds throughout."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], sliding, [False]]).astype(int)))
    starts, ends = edges[::2], edges[1::2] - 1
    long = t[ends] - t[starts] >= SLIDE_TIME - 0.5 * LOG_PERIOD
    return float(t[starts[long][0]]) if long.any() else None


def _arrival(t: Array, v: Array, *, rest_end: bool) -> float:
    """Time [s] of arrival: the last row, or the one from which on the vehicle is slower than `ARRIVED`."""
    if not rest_end:
        return float(t[-1])
    moving = np.flatnonzero(np.abs(v) >= ARRIVED)
    return float(t[min(moving[-1] + 1, len(t) - 1)]) if len(moving) else 0.0
