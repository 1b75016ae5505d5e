"""A trajectory as a schedule: sampled in time, slower where a bend takes all the friction."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, uniform_filter1d

from systems.single_track import State
from vnav_drake.plan import Trajectory

Array = NDArray[np.float64]

BEND_FRICTION = 0.96  # of the friction circle in bends: beyond, the schedule slows down
BEND_SHARE = 0.2  # of the friction, taken sideways: that is a bend
PACE_CHANGE = 0.3  # [s], over which the schedule changes its rate
SLOWEST_PACE = 0.5  # whatever the plan


@dataclass(frozen=True, kw_only=True)
class Samples:
    """The schedule every so many seconds; arrays (n,)."""

    duration: float  # [s]: the travel time, longer where a bend takes all the friction
    arc_length: Array  # [m]
    speed: Array  # [m/s]
    acceleration: Array  # [m/s^2], mean over the sample, as a command is held
    course: Array  # [rad], direction of travel, unwrapped
    curvature: Array  # [1/m]


@dataclass(frozen=True, kw_only=True)
class Demand:
    """A trajectory sampled every `period` seconds, with what the vehicle must do there; arrays (n,)."""

    period: float  # [s]
    duration: float  # [s], of the schedule: the travel time, longer where a bend takes all the friction
    arc_length: Array  # [m]
    speed: Array  # [m/s], of the centre of mass along the path
    course: Array  # [rad], direction of travel, unwrapped
    heading: Array  # [rad], of the body
    lateral_velocity: Array  # [m/s], in the body's frame
    yaw_rate: Array  # [rad/s]
    steering: Array  # [rad]
    steering_command: Array  # [rad], leads `steering` by the lag of the servo
    force: Array  # [N], drive force

    def state(self, trajectory: Trajectory) -> State:
        """State of a vehicle that is exactly on the first row."""
        slip_angle = self.course[0] - self.heading[0]
        return State(
            float(trajectory.x[0]),
            float(trajectory.y[0]),
            float(self.heading[0]),
            float(trajectory.v[0] * math.cos(slip_angle)),
            float(trajectory.v[0] * math.sin(slip_angle)),
            float(self.yaw_rate[0]),
            float(self.steering[0]),
        )


def shrinking_average(values: Array, half: int) -> Array:
    """Mean over `half` samples to either side, fewer near the ends, which stay as they are. Same shape."""
    count = len(values)
    row = np.arange(count)
    reach = np.minimum(half, np.minimum(row, count - 1 - row))
    total = np.concatenate([[0.0], np.cumsum(values)])
    mean: Array = (total[row + reach + 1] - total[row - reach]) / (2 * reach + 1)
    return mean


def moving_average(values: Array, half: int) -> Array:
    """Mean over `half` samples to either side; the ends are continued. Same shape."""
    padded = np.concatenate([np.full(half, values[0]), values, np.full(half, values[-1])])
    total = np.concatenate([[0.0], np.cumsum(padded)])
    return (total[2 * half + 1 :] - total[: -2 * half - 1]) / (2 * half + 1)


def paced(trajectory: Trajectory, friction: float, period: float) -> Samples:
    """Sample a trajectory every `period` [s]; `friction` is mu g [m/s^2], infinite to keep to the plan.

    The schedule runs at the rate 1 except around bends that take more than `BEND_FRICTION` of the friction:
    at a rate p speeds are p times and accelerations p^2 times the planned ones, which leaves something to
    correct with.
    """
    time, pace, duration = _clock(trajectory, friction, period)
    _, _, course, v, _, curvature = trajectory.at(time)
    row = np.clip(np.searchsorted(trajectory.t, time, side="right") - 1, 0, len(trajectory.t) - 2)
    s = trajectory.arc_length[row] + 0.5 * (trajectory.v[row] + v) * (time - trajectory.t[row])
    v = pace * np.maximum(v, 0.0)
    a = np.append(np.diff(v), 0.0) / period
    a[-2:] = trajectory.a[-1]
    return Samples(
        duration=duration, arc_length=s, speed=v, acceleration=a, course=course, curvature=curvature
    )


def _clock(trajectory: Trajectory, friction: float, period: float) -> tuple[Array, Array, float]:
    """Times of the trajectory [s] at which a schedule samples it, its rate there, and its duration [s]."""
    count = max(math.ceil(trajectory.travel_time / period - 1e-9), 1) + 1
    t = np.minimum(trajectory.t[0] + period * np.arange(count), trajectory.t[-1])
    _, _, _, v, a, curvature = trajectory.at(t)
    side = v * v * np.abs(curvature)
    used = np.where(side > BEND_SHARE * friction, np.hypot(a, side) / friction, 0.0)
    slow = 1.0 - np.minimum(np.sqrt(BEND_FRICTION / np.maximum(used, BEND_FRICTION)), 1.0)
    if not slow.any():
        return t, np.ones(count), trajectory.travel_time
    size = 2 * round(0.5 * PACE_CHANGE / period) + 1
    slow = uniform_filter1d(maximum_filter1d(slow, size, mode="nearest"), size, mode="nearest")
    rate = 1.0 - np.minimum(slow, 1.0 - SLOWEST_PACE)
    clock = np.concatenate([[0.0], np.cumsum(np.diff(t) * 0.5 * (1.0 / rate[1:] + 1.0 / rate[:-1]))])
    duration = float(clock[-1])
    grid = np.minimum(period * np.arange(max(math.ceil(duration / period - 1e-9), 1) + 1), duration)
    return np.interp(grid, clock, t), np.interp(grid, clock, rate), duration
