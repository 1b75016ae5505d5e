"""Between the four-wheeled vehicle and those who think of it as one body: what its wheels are told and do."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import AbstractValue
from pydrake.multibody.plant import ContactResults
from pydrake.systems.framework import BasicVector, Context, InputPortIndex, LeafSystem

from systems.four_wheel import WHEELS, FourWheel, WheelGeometry
from systems.single_track import State, gyration_squared
from systems.supervisor import BRAKE_FRICTION, BRAKE_TIME, LEAST_BRAKING, Order
from vnav_drake.robot import GRAVITY, Robot

Array = NDArray[np.float64]

# Ports of the switch that gives the brakes' target speed; its port 0 is the selector.
BRAKES_RELEASED, BRAKES_ON = 1, 2

COMMON = (
    "x",
    "y",
    "heading",
    "v",
    "longitudinal_velocity",
    "lateral_velocity",
    "yaw_rate",
    "steering",
    "steering_command",
    "force_command",
    "longitudinal_force",
    "lateral_acceleration",
)
OWN = (
    *(f"load_{wheel}" for wheel in WHEELS),  # [N]
    *(f"slip_{wheel}" for wheel in WHEELS),  # [m/s], speed of the contact patch over the floor
    *(f"torque_{wheel}" for wheel in WHEELS),  # [N m], of drive and brake, negative slows
    "tilt",  # [rad]
    "least_load",  # of the wheels, over a quarter of the weight
    "least_side",  # load of the two sides and the two axles, over half the weight: at 0 the robot tips
    "mode",
)
RECORD = COMMON + OWN  # what is recorded of the vehicle, in this order
# what of it contact tells
FROM_CONTACT = ("longitudinal_force", "lateral_acceleration", *OWN[:12], "least_load", "least_side")


def wheel_loads(robot: Robot, wheels: WheelGeometry, forward: float, left: float) -> Array:
    """Loads (4,) [N] on the wheels of a rigid body that accelerates by `forward`, `left` [m/s^2].

    Each axle and each side carries what the moments about the other ask for, at least nothing; a wheel
    carries its share of both.
    """
    h, weight = robot.com_height, robot.mass * GRAVITY
    along = 0.5 - np.sign(wheels.x) * h * forward / (robot.wheelbase * GRAVITY)
    across = 0.5 - np.sign(wheels.y) * h * left / (robot.track * GRAVITY)
    found: Array = weight * np.clip(along, 0.0, 1.0) * np.clip(across, 0.0, 1.0)
    return found


class WheelCommands(LeafSystem):  # type: ignore[misc]
    """Shares what the vehicle is told among its wheels.

    Drive and braking force go to the wheels in proportion to their loads. Brakes are on or off, and strong: a
    drive takes back what its brake would give beyond what slows the robot by `max_braking`, or beyond the
    friction that the turn leaves the wheel, which so rolls on instead of locking.

    Input port
        `order` (7): `Order`.
    Output ports
        `torque` (actuators) [N m]; `targets` (2 actuators): angles [rad] of the steering servos, all else
        zero; `brakes`: index of the port that gives the brakes' target speed.
    """

    def __init__(self, vehicle: FourWheel, robot: Robot, period: float) -> None:
        """`period` [s] between orders."""
        super().__init__()
        self._vehicle, self._robot, self._period = vehicle, robot, period
        self._wheels = WheelGeometry.of(robot)
        self._count = vehicle.plant.num_actuators()
        self.DeclareVectorInputPort("order", len(Order._fields))
        ticket = {self.input_port_ticket(self.get_input_port(0).get_index())}
        self.DeclareVectorOutputPort("torque", self._count, self._torque, ticket)
        self.DeclareVectorOutputPort("targets", 2 * self._count, self._targets, ticket)
        self.DeclareAbstractOutputPort(
            "brakes", lambda: AbstractValue.Make(InputPortIndex(BRAKES_RELEASED)), self._brakes, ticket
        )

    def _order(self, context: Context) -> Order:
        return Order(*self.get_input_port(0).Eval(context).tolist())

    def _torque(self, context: Context, output: BasicVector) -> None:
        order, robot, wheels = self._order(context), self._robot, self._wheels
        torque = np.zeros(self._count)
        if order.brake:
            loads = wheel_loads(robot, wheels, -robot.max_braking, order.lateral)
            side = loads * abs(order.lateral) / GRAVITY
            whole = BRAKE_FRICTION * robot.friction * loads
            room = np.sqrt(np.maximum(whole**2 - side**2, (LEAST_BRAKING * whole) ** 2))
            # what slows the robot by a_b along its way, and its turning: m v^2 / 2 (1 + k^2 kappa^2)
            turning = 1.0 + gyration_squared(robot) * order.bend**2
            push = robot.mass * robot.max_braking * turning * loads / max(loads.sum(), 1e-9)
            # a brake slows its wheel, too, for which the floor need not push
            own = 0.25 * wheels.spin_mass * robot.max_braking
            taken = np.maximum(
                self._vehicle.brake_limit - wheels.radius * (np.minimum(push, room) + own), 0.0
            )
            # a brake gives its limit only while its wheel turns: taking back more would drive the vehicle
            ahead = abs(order.speed) - self._period * robot.max_braking  # when the order ends
            share = min(max(ahead / (BRAKE_TIME * robot.max_braking), 0.0), 1.0)
            share = math.copysign(share, order.speed)
            torque[list(self._vehicle.drives)] = share * taken
        else:
            loads = wheel_loads(robot, wheels, order.force / robot.mass, order.lateral)
            force = order.force * (1.0 + wheels.spin_mass / robot.mass)
            torque[list(self._vehicle.drives)] = wheels.radius * force * loads / max(loads.sum(), 1e-9)
        output.SetFromVector(torque)

    def _targets(self, context: Context, output: BasicVector) -> None:
        targets = np.zeros(2 * self._count)
        targets[list(self._vehicle.steers)] = self._wheels.steering(self._order(context).steering)
        output.SetFromVector(targets)

    def _brakes(self, context: Context, output: AbstractValue) -> None:
        output.set_value(InputPortIndex(BRAKES_ON if self._order(context).brake else BRAKES_RELEASED))


class Sensing(LeafSystem):  # type: ignore[misc]
    """The four-wheeled vehicle as one body in the plane, and what its wheels do.

    Input ports
        `plant` (positions and velocities); `contact`: `ContactResults`; `actuation` (actuators) [N m];
        `order` (7): `Order`, for the record.
    Output ports
        `state` (7): `State` of the point midway between the axles, on the floor; `tilt` (1) [rad];
        `record`: what `RECORD` names.
    """

    def __init__(self, vehicle: FourWheel) -> None:
        super().__init__()
        plant = vehicle.plant
        self._vehicle = vehicle
        self._positions = plant.num_positions()
        self._steers = [
            int(plant.GetJointByName(f"steer_{side}").position_start()) for side in ("left", "right")
        ]
        self._of_body = {body: i for i, body in enumerate(vehicle.wheel_bodies)}
        self.DeclareVectorInputPort("plant", vehicle.states)
        self.DeclareAbstractInputPort("contact", AbstractValue.Make(ContactResults()))
        self.DeclareVectorInputPort("actuation", plant.num_actuators())
        self.DeclareVectorInputPort("order", len(Order._fields))
        ticket = {self.input_port_ticket(self.get_input_port(0).get_index())}
        self.DeclareVectorOutputPort("state", len(State._fields), self._state, ticket)
        self.DeclareVectorOutputPort("tilt", 1, self._tilt, ticket)
        self.DeclareVectorOutputPort("record", len(RECORD), self._record)

    def _state(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(list(self._body(self.get_input_port(0).Eval(context).tolist())))

    def _body(self, values: list[float]) -> State:
        qw, qx, qy, qz, x, y = values[:6]
        _, _, turn, east, north = values[self._positions : self._positions + 5]
        # the plant's steps let the quaternion grow: nothing here takes it for a unit one
        heading = math.atan2(2.0 * (qw * qz + qx * qy), qw * qw + qx * qx - qy * qy - qz * qz)
        cosine, sine = math.cos(heading), math.sin(heading)
        left, right = (math.tan(values[i]) for i in self._steers)
        wheels = self._vehicle.wheels
        base, half = float(wheels.x[0] - wheels.x[2]), float(wheels.y[0])
        bend = 0.5 * (left / (base + half * left) + right / (base - half * right))  # inverse of Ackermann
        return State(
            x,
            y,
            heading,
            east * cosine + north * sine,
            north * cosine - east * sine,
            turn,
            math.atan(base * bend),
        )

    def _tilt(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector([self._leaning(self.get_input_port(0).Eval(context).tolist())])

    @staticmethod
    def _leaning(values: list[float]) -> float:
        """Angle [rad] of the body's vertical from the plumb line."""
        qw, qx, qy, qz = values[:4]
        across, along = qx * qx + qy * qy, qw * qw + qz * qz
        return 2.0 * math.atan2(math.sqrt(across), math.sqrt(along))

    def _record(self, context: Context, output: BasicVector) -> None:
        values = self.get_input_port(0).Eval(context).tolist()
        order = Order(*self.get_input_port(3).Eval(context).tolist())
        state = self._body(values)
        torque = self.get_input_port(2).Eval(context)
        loads, slips, force = self._contact(self.get_input_port(1).Eval(context))
        cosine, sine = math.cos(state.heading), math.sin(state.heading)
        vehicle = self._vehicle
        weight = vehicle.robot.mass * GRAVITY
        front, rear = loads[0] + loads[1], loads[2] + loads[3]
        left, right = loads[0] + loads[2], loads[1] + loads[3]
        braked = -1.0 if order.brake else 0.0
        output.SetFromVector(
            [
                state.x,
                state.y,
                state.heading,
                state.speed,
                state.longitudinal_velocity,
                state.lateral_velocity,
                state.yaw_rate,
                state.steering,
                order.steering,
                order.force + braked * vehicle.robot.mass * vehicle.robot.max_braking,
                force[0] * cosine + force[1] * sine,
                (force[1] * cosine - force[0] * sine) / vehicle.robot.mass,
                *loads,
                *slips,
                *(torque[list(vehicle.drives)] + torque[list(vehicle.brakes)]).tolist(),
                self._leaning(values),
                min(loads) / (0.25 * weight),
                min(left, right, front, rear) / (0.5 * weight),
                order.mode,
            ]
        )

    def _contact(self, results: ContactResults) -> tuple[list[float], list[float], list[float]]:
        """Load [N] and slip [m/s] of each wheel, and the force (x, y) [N] of the floor on all of them."""
        loads, slips, force = [0.0] * 4, [0.0] * 4, [0.0, 0.0]
        for i in range(results.num_point_pair_contacts()):
            info = results.point_pair_contact_info(i)
            push = info.contact_force()  # on B
            first, second = int(info.bodyA_index()), int(info.bodyB_index())
            wheel, sign = (
                (self._of_body[second], 1.0) if second in self._of_body else (self._of_body[first], -1.0)
            )
            loads[wheel] = sign * float(push[2])
            slips[wheel] = float(info.slip_speed())
            force[0] += sign * float(push[0])
            force[1] += sign * float(push[1])
        return loads, slips, force
