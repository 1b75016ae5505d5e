"""Following a trajectory: where the vehicle should be, and what it must do to get there.

Lateral: feed-forward with a finite-horizon linear-quadratic regulator along the trajectory (`systems.gains`),
on the errors relative to the path. Longitudinal: feed-forward force with proportional feedback of position
and speed along the path.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from systems.schedule import Demand
from systems.single_track import Body, State
from systems.tyre import SLIP_REGULARISATION
from vnav_drake.plan import Trajectory
from vnav_drake.robot import GRAVITY, Robot

Array = NDArray[np.float64]

POSITION_GAIN = 9.0  # [1/s^2], along the path: errors decay like exp(-3 t), critically damped
SPEED_GAIN = 6.0  # [1/s]
STOPPING_GAIN = 20.0  # [1/s], of speed once the motion has ended at rest: the brakes are on
AT_GOAL = 0.02  # [m], the brakes are put on within this distance
LAG_ALLOWED = 0.02  # [m], behind schedule before the schedule waits
LAG_WAITING = 0.10  # [m], more than that: it stands
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
    since the first row, arc length [m] beside the vehicle), updated every period of the demand.

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
        self.DeclarePeriodicDiscreteUpdateEvent(wanted.period, 0.0, self._advance)

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
        time = min(time + self._pace(target.lag) * self._period, self._duration)
        values.get_mutable_vector().SetFromVector([time, target.arc_length])


class TrackingController(LeafSystem):  # type: ignore[misc]
    """Steering and drive force that keep the vehicle on its target.

    Nothing is remembered here: whoever reads the command holds it.

    Input ports
        `state` (7): `State` of the vehicle; `target` (11): `Target`.
    Output port
        `command` (2): steering angle [rad], drive force [N].
    """

    def __init__(
        self, robot: Robot, wanted: Demand, gains: Array, *, front_slip: float, rest_end: bool
    ) -> None:
        """`gains` (n, 5): see `systems.gains`; `front_slip`: tangent of the slip angle allowed in front."""
        super().__init__()
        self._body = Body.of(robot)
        self._rest_end, self._front_slip = rest_end, front_slip
        self._gains = gains.tolist()
        columns = (
            wanted.course - wanted.heading,
            wanted.lateral_velocity,
            wanted.yaw_rate,
            wanted.steering,
            wanted.steering_command,
            wanted.speed,
        )
        self._table = np.column_stack(columns).tolist()
        self.DeclareVectorInputPort("state", len(State._fields))
        self.DeclareVectorInputPort("target", len(Target._fields))
        self.DeclareVectorOutputPort("command", 2, self._command)

    def _command(self, context: Context, output: BasicVector) -> None:
        state = State(*self.get_input_port(0).Eval(context).tolist())
        target = Target(*self.get_input_port(1).Eval(context).tolist())
        output.SetFromVector([self._steering(state, target), self._force(state, target)])

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
        """The steering angle nearest to `angle` at which the front tyre does not slide more than it must.

        The slower it is, the more it may: a slow vehicle does not slide, whatever the angle.
        """
        forward = state.longitudinal_velocity
        sideways = state.lateral_velocity + self._body.half_base * state.yaw_rate
        speed = math.hypot(forward, sideways)
        if forward <= 0.0 or speed < 0.1 * SLIP_REGULARISATION:
            return angle
        moving = math.atan(sideways / forward)
        most = math.atan(self._front_slip) * (1.0 + (SLIP_REGULARISATION / speed) ** 4)
        return min(max(angle, moving - most), moving + most)

    def _force(self, state: State, target: Target) -> float:
        body = self._body
        speed = state.speed
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
