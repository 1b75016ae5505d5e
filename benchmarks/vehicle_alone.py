"""The four-wheeled vehicle alone, without the systems that steer it: circles at slowly rising speed.

Steering is held at the angle of the circle, and a drive force as small as the rise of speed needs goes to the
wheels in proportion to their loads. What happens first, a slide or wheels off the floor, is the vehicle's
own doing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, DiagramBuilder

from systems.four_wheel import PLANT_STEP, FourWheel, add_four_wheel
from systems.run import LIFT_TIME, NO_LOAD, SLIDE_TIME, SLIP_SPEED, sustained
from systems.single_track import State
from systems.wheels import wheel_loads
from vnav_drake.robot import Robot

Array = NDArray[np.float64]

PERIOD = 0.01  # [s], of the force that keeps the speed
SETTLING = 0.5  # [s], until the body has found its angle in the bend
SPEED_GAIN = 10.0  # [1/s]
SUM_GAIN = 20.0  # [1/s^2], of the sum of speed errors: the wheels' drag in a bend is not known
RISE = 0.05  # [1/s], of the speed at the limit: 10 % of the demand take a second


@dataclass(frozen=True, kw_only=True)
class Circle:
    """A recorded drive; arrays (m,) or (m, 4) by wheel."""

    t: Array  # [s]
    x: Array  # [m]
    y: Array  # [m]
    speed: Array  # [m/s]
    yaw_rate: Array  # [rad/s]
    load: Array  # (m, 4) [N]
    slip: Array  # (m, 4) [m/s]
    tilt: Array  # [rad]
    radius: float  # [m], for which the wheels are steered

    @property
    def acceleration(self) -> Array:
        """v^2 / R [m/s^2], R of the circle for which the wheels are steered; (m,)."""
        return np.square(self.speed) / self.radius

    @property
    def side_load(self) -> Array:
        """Load of the lighter side over half of the whole; (m,)."""
        left, right = self.load[:, [0, 2]].sum(axis=1), self.load[:, [1, 3]].sum(axis=1)
        return 2.0 * np.minimum(left, right) / np.maximum(left + right, 1e-9)

    def slide(self) -> float | None:
        """Where [m/s^2] a wheel begins to slide for a while; None if none does."""
        sliding = ((self.slip > SLIP_SPEED) & (self.load > 0.0)).any(axis=1)
        return self._onset(sliding, SLIDE_TIME)

    def lift(self) -> float | None:
        """Where [m/s^2] a side leaves the floor for a while; None if none does."""
        return self._onset(self.side_load <= NO_LOAD, LIFT_TIME)

    def widened(self, share: float = 0.05) -> float | None:
        """Where [m/s^2] the circle driven, v / r, has become wider by a share; None if it does not."""
        return self._onset(self.speed > (1.0 + share) * self.radius * self.yaw_rate, SLIDE_TIME)

    def _onset(self, holds: NDArray[np.bool_], least: float) -> float | None:
        begun = sustained(self.t, holds & (self.t > SETTLING), least, PERIOD)
        return None if begun is None else float(np.interp(begun, self.t, self.acceleration))


def rising_circle(
    robot: Robot, radius: float, first: float, last: float, *, step: float = PLANT_STEP, rise: float = RISE
) -> Circle:
    """Drive a circle to the left, the speed rising until v^2 / R is `last` [m/s^2] or the robot has fallen.

    It begins at `first` [m/s^2]; `rise` [1/s] of the speed at the end a second. `step` [s] of the plant.
    """
    builder = DiagramBuilder()
    vehicle = add_four_wheel(builder, robot, step)
    simulator = Simulator(builder.Build())
    context = vehicle.plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    steering, beta = robot.steering_angle(1.0 / radius), math.asin(0.5 * robot.wheelbase / radius)
    begin, end = math.sqrt(first * radius), math.sqrt(last * radius)
    along, left = begin * math.cos(beta), begin * math.sin(beta)
    vehicle.set_state(context, State(0.0, 0.0, -beta, along, left, begin / radius, steering))
    pull, total, rows = rise * end, 0.0, []
    for k in range(round((end - begin) / (pull * PERIOD))):
        rows.append(_row(vehicle, context, k * PERIOD))
        if rows[-1][-1] > 0.5:  # [rad], of tilt: it lies on its side soon
            break
        error = begin + pull * k * PERIOD - rows[-1][3]
        total += error * PERIOD
        force = robot.mass * (pull + SPEED_GAIN * error + SUM_GAIN * total)
        _tell(vehicle, context, steering, force, rows[-1][3] * rows[-1][4])
        simulator.AdvanceTo((k + 1) * PERIOD)
    table = np.array(rows[1:])  # the first is before the first step, when nothing has pressed the wheels down
    t, x, y, speed, yaw_rate = table[:, :5].T
    load, slip, tilt = table[:, 5:9], table[:, 9:13], table[:, 13]
    return Circle(
        t=t, x=x, y=y, speed=speed, yaw_rate=yaw_rate, load=load, slip=slip, tilt=tilt, radius=radius
    )


def limit(robot: Robot) -> float:
    """The least of mu g and g w / (2 h) [m/s^2] (Manor 2015, eqs. A.2 and A.3)."""
    return min(robot.friction_acceleration, robot.tip_acceleration)


def slide_onset(robot: Robot, radius: float, step: float = PLANT_STEP) -> float | None:
    """v^2 / R over mu g at which a wheel begins to slide; None if none does up to 1.15."""
    grip = robot.friction_acceleration
    found = rising_circle(robot, radius, 0.85 * grip, 1.15 * grip, step=step).slide()
    return None if found is None else found / grip


def lift_onset(robot: Robot, radius: float, step: float = PLANT_STEP) -> float | None:
    """v^2 / R over g w / (2 h) at which a side leaves the floor; None if none does up to 1.15."""
    tip = robot.tip_acceleration
    found = rising_circle(robot, radius, 0.85 * tip, 1.15 * tip, step=step).lift()
    return None if found is None else found / tip


def slides_first(robot: Robot, radius: float, step: float = PLANT_STEP) -> bool:
    """Whether a robot slides before it lifts a side, at rising speed on a circle."""
    drive = rising_circle(robot, radius, 0.85 * limit(robot), 1.25 * limit(robot), step=step)
    slide, lift = drive.slide(), drive.lift()
    if slide is None and lift is None:
        raise ValueError(f"radius = {radius!r}: the robot neither slides nor lifts a side")
    return lift is None or (slide is not None and slide < lift)


def _tell(vehicle: FourWheel, context: Context, steering: float, force: float, lateral: float) -> None:
    """Set the servos' targets, the drives' torques for a force [N], and the brakes free."""
    plant, wheels, count = vehicle.plant, vehicle.wheels, vehicle.plant.num_actuators()
    loads = wheel_loads(vehicle.robot, wheels, 0.0, lateral)
    torque, targets = np.zeros(count), np.zeros(2 * count)
    torque[list(vehicle.drives)] = wheels.radius * force * loads / loads.sum()
    targets[list(vehicle.steers)] = wheels.steering(steering)
    velocity = plant.GetVelocities(context)
    for brake, spin in zip(vehicle.brakes, vehicle.spins, strict=True):
        targets[count + brake] = velocity[spin]
    plant.get_actuation_input_port().FixValue(context, torque)
    servo = plant.GetJointActuatorByName("steer_left").model_instance()
    plant.get_desired_state_input_port(servo).FixValue(context, targets)


def _row(vehicle: FourWheel, context: Context, t: float) -> list[float]:
    """t, x, y, speed, yaw rate, loads, slips, tilt."""
    plant = vehicle.plant
    values = plant.GetPositionsAndVelocities(context)
    velocity = values[plant.num_positions() :]
    load, slip = [0.0] * 4, [0.0] * 4
    if t > 0.0:
        results = plant.get_contact_results_output_port().Eval(context)
        for i in range(results.num_point_pair_contacts()):
            info = results.point_pair_contact_info(i)
            bodies = (int(info.bodyA_index()), int(info.bodyB_index()))
            wheel = next(k for k, body in enumerate(vehicle.wheel_bodies) if body in bodies)
            load[wheel], slip[wheel] = abs(float(info.contact_force()[2])), float(info.slip_speed())
    tilt = 2.0 * math.atan2(math.hypot(values[1], values[2]), math.hypot(values[0], values[3]))
    speed = math.hypot(velocity[3], velocity[4])
    return [t, values[4], values[5], speed, velocity[2], *load, *slip, tilt]


def crossover(robot: Robot, radius: float, spread: float = 0.2, steps: int = 6) -> float:
    """Height of the centre of mass above which a robot tips before it slides, over w / (2 mu) (Derived).

    mu g = g w / (2 h) there. Bisection between 1 - `spread` and 1 + `spread`, `steps` times.

    Raises
    ------
    ValueError : it slides at the upper height, or tips at the lower one.
    """
    height = robot.track / (2.0 * robot.friction)
    low, high = 1.0 - spread, 1.0 + spread

    def slides(share: float) -> bool:
        return slides_first(replace(robot, com_height=share * height), radius)

    if not slides(low) or slides(high):
        raise ValueError(f"spread = {spread!r}: no crossover in between")
    for _ in range(steps):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if slides(middle) else (low, middle)
    return 0.5 * (low + high)
