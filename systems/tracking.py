"""Following a trajectory: where the vehicle should be, and what it must do to get there.

Lateral: discrete linear-quadratic regulator along the trajectory, finite horizon, on the errors relative
to the path. Longitudinal: feed-forward force with proportional feedback of position and speed along the path.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from systems.feedforward import Demand, demand
from systems.single_track import STEERING_TIME_CONSTANT, Body, State
from systems.tyre import SLIP_REGULARISATION, full_slide, rolling_speed
from vnav_drake.plan import Trajectory
from vnav_drake.robot import GRAVITY, Robot

Array = NDArray[np.float64]

CONTROL_PERIOD = 5e-3  # [s]

# Bryson's rule: weights are one over the square of what is acceptable
LATERAL_SCALE = 0.1  # [m]
COURSE_SCALE = 0.1  # [rad]
YAW_RATE_SCALE = 2.0  # [rad/s]
STEERING_SCALE = 0.1  # [rad]

POSITION_GAIN = 9.0  # [1/s^2], along the path: errors decay like exp(-3 t), critically damped
SPEED_GAIN = 6.0  # [1/s]
STOPPING_GAIN = 20.0  # [1/s], of speed once the motion has ended at rest: the brakes are on
AT_GOAL = 0.02  # [m], the brakes are put on within this distance
LAG_ALLOWED = 0.02  # [m], behind schedule before the schedule waits
LAG_WAITING = 0.10  # [m], more than that: it stands
FRONT_SLIP = 1.5  # of the slip at which a tyre slides, allowed at the front:
# more gives no more force, but the servo needs a little to get there in time
LEAST_BRAKING_SHARE = 0.3  # of the friction that braking may take in a bend however hard the bend


class Target(NamedTuple):
    """What the controller is told, in this order (output port `target`)."""

    x: float  # [m], point of the path beside the vehicle
    y: float  # [m]
    course: float  # [rad], of the path there
    row: float  # sample of the trajectory there, fractional
    lag: float  # [m], along the path, positive when the vehicle is behind schedule
    speed: float  # [m/s], of the schedule
    force: float  # [N], drive force of the schedule
    path_speed: float  # [m/s], planned for the point beside the vehicle
    path_force: float  # [N]
    ended: float  # 1 when the schedule has ended, else 0
    arc_length: float  # [m], of the point of the path beside the vehicle


def lateral_gains(body: Body, wanted: Demand) -> Array:
    """Gains (n, 5) of the steering command on (e, heading, lateral velocity, yaw rate, steering) errors.

    Linearised about the demand with e the distance left of the path:
    e' = w + v psi, psi' = r - v kappa^2 e, m w' = -C_f (w + b r) - C_r (w - b r) + C_d delta - m v r,
    m k^2 r' = b (-C_f (w + b r) + C_r (w - b r) + C_d delta), delta' = (command - delta) / tau.
    Discretised by the trapezoidal rule, which is stable for the stiff tyres at low speed; Riccati recursion
    backwards from the last sample.
    """
    n, h = len(wanted.speed), wanted.period
    v, b, m = wanted.speed, body.half_base, body.mass
    c_f, c_r, c_d = wanted.front_stiffness, wanted.rear_stiffness, wanted.steering_stiffness
    curvature = np.where(v > 0.05, wanted.yaw_rate / np.maximum(v, 0.05), 0.0)
    inertia = m * body.gyration_squared
    a = np.zeros((n, 5, 5))
    a[:, 0, 1], a[:, 0, 2] = v, 1.0
    a[:, 1, 0], a[:, 1, 3] = -v * curvature**2, 1.0
    a[:, 2, 2], a[:, 2, 3], a[:, 2, 4] = -(c_f + c_r) / m, b * (c_r - c_f) / m - v, c_d / m
    a[:, 3, 2], a[:, 3, 3] = b * (c_r - c_f) / inertia, -b * b * (c_f + c_r) / inertia
    a[:, 3, 4] = b * c_d / inertia
    a[:, 4, 4] = -1.0 / STEERING_TIME_CONSTANT
    input_gain = np.zeros((n, 5, 1))
    input_gain[:, 4, 0] = 1.0 / STEERING_TIME_CONSTANT
    half = np.eye(5) - 0.5 * h * a
    step = np.linalg.solve(half, np.eye(5) + 0.5 * h * a)
    kick = np.linalg.solve(half, h * input_gain)[:, :, 0]
    # course error = psi + w / v
    course = np.zeros((n, 5))
    course[:, 1], course[:, 2] = 1.0, 1.0 / np.maximum(v, 0.3)
    cost = course[:, :, None] * course[:, None, :] / COURSE_SCALE**2
    cost[:, 0, 0] += 1.0 / LATERAL_SCALE**2
    cost[:, 3, 3] += 1.0 / YAW_RATE_SCALE**2
    effort = 1.0 / STEERING_SCALE**2
    gains = np.zeros((n, 5))
    value = cost[-1].copy()
    for k in range(n - 1, -1, -1):
        pull = kick[k] @ value
        gains[k] = (pull @ step[k]) / (effort + pull @ kick[k])
        closed = step[k] - np.outer(kick[k], gains[k])
        value = cost[k] + step[k].T @ value @ closed
        value = 0.5 * (value + value.T)
    return gains


@dataclass(frozen=True)
class _Row:
    """A trajectory as plain lists, for scalar look-ups."""

    arc_length: list[float]
    x: list[float]
    y: list[float]
    heading: list[float]
    curvature: list[float]


class TrajectorySource(LeafSystem):  # type: ignore[misc]
    """Where the vehicle should be: a point of the path beside it, and the schedule along the path.

    The schedule runs in real time while the vehicle is less than `LAG_ALLOWED` behind it and slows down
    beyond: a plan at its limits leaves nothing to catch up with. The discrete state is (schedule time [s]
    since the first row, arc length [m] beside the vehicle), updated every `CONTROL_PERIOD`.

    Input port
        `state` (7): `State` of the vehicle.
    Output port
        `target` (11): `Target`.
    """

    def __init__(self, trajectory: Trajectory, wanted: Demand) -> None:
        super().__init__()
        moving = np.append(np.diff(trajectory.arc_length) > 0.0, True)
        rows = (trajectory.arc_length, trajectory.x, trajectory.y, trajectory.heading, trajectory.curvature)
        self._rows = _Row(*(column[moving].tolist() for column in rows))
        self._length = trajectory.length
        self._duration = wanted.duration
        self._period = wanted.period
        self._schedule = tuple(c.tolist() for c in (wanted.arc_length, wanted.speed, wanted.force))
        self.DeclareDiscreteState(2)
        self.DeclareVectorInputPort("state", len(State._fields))
        self.DeclareVectorOutputPort("target", len(Target._fields), self._target)
        self.DeclarePeriodicDiscreteUpdateEvent(CONTROL_PERIOD, 0.0, self._advance)

    def _beside(self, arc_length: float, x: float, y: float) -> tuple[float, float, float, float]:
        """Foot of the vehicle on the path: arc length, x, y, course; two Newton steps from the last foot."""
        r = self._rows
        s = arc_length
        for _ in range(2):
            foot_x, foot_y, course, curvature = self._point(s)
            dx, dy = x - foot_x, y - foot_y
            cosine, sine = math.cos(course), math.sin(course)
            # along = d(distance^2)/ds / 2; the slope is 1 - kappa e, kept away from the centre of curvature
            slope = max(1.0 - curvature * (dy * cosine - dx * sine), 0.5)
            s = min(max(s + (dx * cosine + dy * sine) / slope, 0.0), r.arc_length[-1])
        foot_x, foot_y, course, _ = self._point(s)
        return s, foot_x, foot_y, course

    def _point(self, s: float) -> tuple[float, float, float, float]:
        r = self._rows
        i = min(max(bisect_right(r.arc_length, s) - 1, 0), len(r.x) - 2)
        along = s - r.arc_length[i]
        half = 0.5 * r.curvature[i] * along
        chord = along * (math.sin(half) / half if abs(half) > 1e-9 else 1.0)
        mean = r.heading[i] + half
        return r.x[i] + chord * math.cos(mean), r.y[i] + chord * math.sin(mean), mean + half, r.curvature[i]

    def _target(self, context: Context, output: BasicVector) -> None:
        time, last = context.get_discrete_state_vector().CopyToVector().tolist()
        state = self.get_input_port(0).Eval(context).tolist()
        s, x, y, course = self._beside(last, state[0], state[1])
        lengths, speeds, forces = self._schedule
        i = min(max(bisect_right(lengths, s) - 1, 0), len(lengths) - 2)
        gap = lengths[i + 1] - lengths[i]
        row = i + (min((s - lengths[i]) / gap, 1.0) if gap > 0.0 else 0.0)
        where = min(time / self._period, len(lengths) - 1.0)
        k = min(int(where + 1e-6), len(lengths) - 2)
        part = where - k
        position = lengths[k] + part * (lengths[k + 1] - lengths[k])
        along = (state[0] - x) * math.cos(course) + (state[1] - y) * math.sin(course)  # beyond either end
        lag = position - s - along
        pace = self._pace(lag)
        ended = time >= self._duration - 1e-9
        output.SetFromVector(
            Target(
                x,
                y,
                course,
                row,
                lag,
                pace * (speeds[k] + part * (speeds[k + 1] - speeds[k])),
                0.0 if ended else forces[k],
                speeds[i] + (row - i) * (speeds[i + 1] - speeds[i]),
                forces[i],
                1.0 if ended else 0.0,
                s,
            )
        )

    @staticmethod
    def _pace(lag: float) -> float:
        """Rate of schedule time: 1 on time, 0 when the schedule stands and waits."""
        return 1.0 - min(max((lag - LAG_ALLOWED) / (LAG_WAITING - LAG_ALLOWED), 0.0), 1.0)

    def _advance(self, context: Context, values: DiscreteValues) -> None:
        time = float(context.get_discrete_state_vector().GetAtIndex(0))
        target = Target(*self.get_output_port().Eval(context).tolist())
        time = min(time + self._pace(target.lag) * CONTROL_PERIOD, self._duration)
        values.get_mutable_vector().SetFromVector([time, target.arc_length])


class TrackingController(LeafSystem):  # type: ignore[misc]
    """Steering and drive force that keep the vehicle on its target.

    The command is the discrete state, updated every `CONTROL_PERIOD` and held between.

    Input ports
        `state` (7): `State` of the vehicle; `target` (11): `Target`.
    Output port
        `command` (2): steering angle [rad], drive force [N].
    """

    def __init__(self, robot: Robot, wanted: Demand, *, rest_end: bool) -> None:
        super().__init__()
        self._body = Body.of(robot)
        self._rest_end = rest_end
        self._gains = lateral_gains(self._body, wanted).tolist()
        columns = (
            wanted.course - wanted.heading,
            wanted.lateral_velocity,
            wanted.yaw_rate,
            wanted.steering,
            wanted.steering_command,
            wanted.speed,
        )
        self._table = np.column_stack(columns).tolist()
        index = self.DeclareDiscreteState([float(wanted.steering[0]), 0.0])
        self.DeclareVectorInputPort("state", len(State._fields))
        self.DeclareVectorInputPort("target", len(Target._fields))
        self.DeclareStateOutputPort("command", index)
        self.DeclarePeriodicDiscreteUpdateEvent(CONTROL_PERIOD, 0.0, self._update)

    def _update(self, context: Context, values: DiscreteValues) -> None:
        state = State(*self.get_input_port(0).Eval(context).tolist())
        target = Target(*self.get_input_port(1).Eval(context).tolist())
        values.get_mutable_vector().SetFromVector([self._steering(state, target), self._force(state, target)])

    def _steering(self, state: State, target: Target) -> float:
        k = min(int(target.row), len(self._table) - 2)
        part = target.row - k
        angle, lateral, yaw_rate, steering, command, speed = (
            p + part * (q - p) for p, q in zip(self._table[k], self._table[k + 1], strict=True)
        )
        ratio = min(max(state.longitudinal_velocity, 0.0) / max(speed, 0.1), 2.0)
        dx, dy = state.x - target.x, state.y - target.y
        turn = state.heading + angle - target.course
        g = self._gains[k]
        feedback = (
            g[0] * (dy * math.cos(target.course) - dx * math.sin(target.course))
            + g[1] * math.remainder(turn, 2.0 * math.pi)
            + g[2] * (state.lateral_velocity - ratio * lateral)
            + g[3] * (state.yaw_rate - ratio * yaw_rate)
            + g[4] * (state.steering - steering)
        )
        limit = self._body.max_steering
        return min(max(self._gripping(state, command - feedback), -limit), limit)

    def _gripping(self, state: State, angle: float) -> float:
        """The steering angle nearest to `angle` at which the front tyre does not slide more than it must."""
        forward = max(state.longitudinal_velocity, SLIP_REGULARISATION)
        moving = math.atan((state.lateral_velocity + self._body.half_base * state.yaw_rate) / forward)
        most = math.atan(FRONT_SLIP * full_slide(self._body.friction) * rolling_speed(forward) / forward)
        return min(max(angle, moving - most), moving + most)

    def _force(self, state: State, target: Target) -> float:
        body = self._body
        speed = math.hypot(state.longitudinal_velocity, state.lateral_velocity)
        speed = math.copysign(speed, state.longitudinal_velocity)
        if self._rest_end and target.ended and target.lag < AT_GOAL:
            force = -body.mass * STOPPING_GAIN * speed
        else:
            pull = POSITION_GAIN * target.lag + SPEED_GAIN * (target.speed - speed)
            # no faster than planned for this place, however late: the plan may be at its limits
            feed = target.path_force
            if (
                feed < 0.0
            ):  # dv/dt = (dv/ds) v: a slower vehicle needs less braking to stay on v(s), none at rest
                feed *= min(max(speed, 0.0) / max(target.path_speed, 1e-3), 1.0)
            cap = feed + body.mass * SPEED_GAIN * (target.path_speed - speed)
            force = min(target.force + body.mass * pull, cap)
        # friction left by the bend; some is always left to braking, or too fast would stay too fast
        whole = body.friction * body.mass * GRAVITY
        side = min(body.mass * abs(speed * state.yaw_rate) / whole, 1.0)
        room = whole * math.sqrt(1.0 - side * side)
        force = max(force, -max(room, LEAST_BRAKING_SHARE * whole), body.min_force)
        return min(force, room, body.max_force)


def sampled(robot: Robot, trajectory: Trajectory) -> Demand:
    """The demand of a trajectory on a robot at the rate of the controller."""
    return demand(Body.of(robot), trajectory, CONTROL_PERIOD)
