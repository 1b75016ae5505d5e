"""Who decides: follow the trajectory, stop in an emergency, stand, or admit that the robot has fallen."""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from systems.single_track import State
from systems.tracking import AT_GOAL, Target
from vnav_drake.robot import Robot

FALLEN = math.radians(30.0)  # tilt beyond which a robot has fallen
STANDING = 1e-3  # [m/s], slower than this the vehicle stands
SLOW_TURN = 0.1  # [m/s]: slower, a robot is not taken to turn more tightly
STRAIGHTENING = 1.5  # [rad/s]: wheels that jump straight would throw the robot off
NEVER = math.inf  # [s], time of a stop that nobody asks for
BRAKE_TIME = 0.02  # [s] before standing still, in which a brake gives less than its limit
BRAKE_FRICTION = 0.98  # of the friction, that brakes may take together with the turn: beyond, wheels lock
LEAST_BRAKING = 0.3  # of the friction, however hard the turn: a robot that only turned would never stop


class Mode(IntEnum):
    """What the supervisor is at."""

    TRACK = 0
    EMERGENCY_STOP = 1
    STOPPED = 2
    FALLEN = 3


class Order(NamedTuple):
    """What the vehicle is told, in this order (output port `order`); also the supervisor's memory."""

    mode: float  # a `Mode`
    steering: float  # [rad], of the mean front wheel
    force: float  # [N], of the drive, negative slows
    brake: float  # 1: the brakes are on, 0: off
    lateral: float  # [m/s^2], acceleration to the left, with which the force is shared among the wheels
    speed: float  # [m/s], along the body: brakes give less and less within `BRAKE_TIME` of standing
    bend: float  # [1/m], sharpest turn since the brakes came on: its energy has to be braked, too


class Supervisor(LeafSystem):  # type: ignore[misc]
    """Decides every `period` what the vehicle is told until the next time.

    An emergency stop that is asked for at time T begins at T + `reaction_time`: until then the robot follows
    its trajectory, as it knows of nothing. Then the brakes are on, and the wheels are held at their
    angle or straightened, as fast as the steering allows and by `STRAIGHTENING` at most.

    Input ports
        `state` (7): `State`; `tilt` (1) [rad], if the vehicle can; `target` (11): `Target`; `command` (2):
        steering angle [rad] and drive force [N] that follow the trajectory; `stop` (2): time [s] of the
        emergency, `NEVER` for none, and whether the wheels are straightened (1) or held (0).
    Output port
        `order` (7): `Order`.
    """

    def __init__(self, robot: Robot, period: float, *, reaction_time: float, rest_end: bool) -> None:
        super().__init__()
        self._limit, self._step = robot.max_steering, robot.max_steering_rate * period
        self._straightening = STRAIGHTENING * period
        self._reaction_time, self._rest_end = reaction_time, rest_end
        index = self.DeclareDiscreteState(len(Order._fields))
        self.DeclareVectorInputPort("state", len(State._fields))
        self.DeclareVectorInputPort("tilt", 1)
        self.DeclareVectorInputPort("target", len(Target._fields))
        self.DeclareVectorInputPort("command", 2)
        self.DeclareVectorInputPort("stop", 2)
        self.DeclareStateOutputPort("order", index)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def set_steering(self, context: Context, angle: float) -> None:
        """The angle [rad] at which the wheels were told to stand before the first decision."""
        order = Order(Mode.TRACK, angle, 0.0, 0.0, 0.0, 0.0, 0.0)
        context.get_mutable_discrete_state_vector().SetFromVector(list(order))

    def _update(self, context: Context, values: DiscreteValues) -> None:
        last = Order(*context.get_discrete_state_vector().CopyToVector().tolist())
        state = State(*self.get_input_port(0).Eval(context).tolist())
        mode = self._mode(context, last, state)
        speed = state.longitudinal_velocity
        lateral = speed * state.yaw_rate
        if mode == Mode.TRACK:
            steering, force = self.get_input_port(3).Eval(context).tolist()
            order = Order(mode, self._within_rate(last.steering, steering), force, 0.0, lateral, speed, 0.0)
        else:
            straightened = self.get_input_port(4).Eval(context)[1] > 0.5
            wanted = last.steering
            if straightened and mode == Mode.EMERGENCY_STOP:
                wanted -= math.copysign(min(abs(wanted), self._straightening), wanted)
            angle = self._within_rate(last.steering, wanted)
            bend = max(last.bend, abs(lateral) / max(speed * speed, SLOW_TURN**2))
            order = Order(mode, angle, 0.0, 1.0, lateral, speed, bend)
        values.get_mutable_vector().SetFromVector(list(order))

    def _mode(self, context: Context, last: Order, state: State) -> Mode:
        """The mode that follows; nothing leads back from fallen and stopped."""
        now = Mode(int(last.mode))
        tilt = self.get_input_port(1)  # a vehicle in the plane has none
        if now == Mode.FALLEN or (tilt.HasValue(context) and tilt.Eval(context)[0] > FALLEN):
            return Mode.FALLEN
        standing = math.hypot(state.longitudinal_velocity, state.lateral_velocity) < STANDING
        if now == Mode.EMERGENCY_STOP and standing:
            return Mode.STOPPED
        if now != Mode.TRACK:
            return now
        asked = float(self.get_input_port(4).Eval(context)[0])
        if context.get_time() >= asked + self._reaction_time - 1e-9:
            return Mode.EMERGENCY_STOP
        if self._rest_end and standing:
            target = Target(*self.get_input_port(2).Eval(context).tolist())
            if target.ended and target.lag < AT_GOAL:
                return Mode.STOPPED
        return Mode.TRACK

    def _within_rate(self, before: float, wanted: float) -> float:
        """The angle nearest to the wanted one that the steering reaches in one period."""
        angle = min(max(wanted, before - self._step), before + self._step)
        return min(max(angle, -self._limit), self._limit)


class SingleTrackOrders(LeafSystem):  # type: ignore[misc]
    """Steering angle and force of a single-track vehicle that is told an order; brakes are a force, too.

    The brakes give `max_braking`, or what the turn leaves of the friction, and less within `BRAKE_TIME`
    of standing still.

    Input ports
        `order` (7): `Order`; `state` (7): `State`.
    Output port
        `command` (2): steering angle [rad], force [N].
    """

    def __init__(self, robot: Robot) -> None:
        super().__init__()
        self._robot = robot
        self.DeclareVectorInputPort("order", len(Order._fields))
        self.DeclareVectorInputPort("state", len(State._fields))
        self.DeclareVectorOutputPort("command", 2, self._command)

    def _command(self, context: Context, output: BasicVector) -> None:
        order = Order(*self.get_input_port(0).Eval(context).tolist())
        force = order.force
        if order.brake:
            robot, speed = self._robot, float(self.get_input_port(1).Eval(context)[3])
            grip = BRAKE_FRICTION * robot.friction_acceleration
            left = math.sqrt(max(grip * grip - order.lateral**2, (LEAST_BRAKING * grip) ** 2))
            share = min(max(speed / (BRAKE_TIME * robot.max_braking), -1.0), 1.0)
            force = -robot.mass * share * min(robot.max_braking, left)
        output.SetFromVector([order.steering, force])
