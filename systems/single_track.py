"""The dynamic single-track vehicle: two axles on the centre line, tyres that slide."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from pydrake.systems.framework import BasicVector, Context, ContinuousState, LeafSystem

from systems.tyre import brush_force, full_slide, rolling_speed
from vnav_drake.robot import GRAVITY, Robot

STEERING_TIME_CONSTANT = 0.03  # [s], first-order steering servo


class State(NamedTuple):
    """Continuous state of the vehicle, in this order."""

    x: float  # [m], centre of mass
    y: float  # [m]
    heading: float  # [rad], of the body
    longitudinal_velocity: float  # [m/s], of the centre of mass, along the body
    lateral_velocity: float  # [m/s], to the left of the body
    yaw_rate: float  # [rad/s]
    steering: float  # [rad], of the front axle, left positive

    @property
    def speed(self) -> float:
        """[m/s], negative when rolling backwards."""
        size = math.hypot(self.longitudinal_velocity, self.lateral_velocity)
        return math.copysign(size, self.longitudinal_velocity)


class Forces(NamedTuple):
    """What acts on the body at one instant."""

    longitudinal: float  # [N], along the body
    lateral: float  # [N], to the left of the body
    yaw_moment: float  # [N m]
    front_demand: float  # friction asked of the axle over friction there; above 1 it slides
    rear_demand: float
    front_load: float  # [N]; zero when the front lifts


class Motion(NamedTuple):
    """What is recorded of the vehicle, in this order (output port `motion`)."""

    x: float  # [m], centre of mass
    y: float  # [m]
    heading: float  # [rad], of the body
    v: float  # [m/s], speed of the centre of mass, negative when rolling backwards
    longitudinal_velocity: float  # [m/s]
    lateral_velocity: float  # [m/s]
    yaw_rate: float  # [rad/s]
    steering: float  # [rad]
    steering_command: float  # [rad]
    force_command: float  # [N]
    longitudinal_force: float  # [N], on the body, along it
    lateral_acceleration: float  # [m/s^2], on the body, to its left
    front_demand: float  # friction asked of the axle over friction there
    rear_demand: float
    front_load: float  # [N]


def gyration_squared(robot: Robot) -> float:
    """k^2 [m^2], yaw inertia over mass, of a box as long as the wheelbase and as wide as the track."""
    return (robot.wheelbase**2 + robot.track**2) / 12.0


@dataclass(frozen=True, kw_only=True)
class Body:
    """Mass and axles of the vehicle: centre of mass midway, a uniform box on its wheels.

    The box is as long as the wheelbase and as wide as the track: k^2 = (l^2 + w^2) / 12.
    """

    mass: float  # [kg]
    half_base: float  # [m], from the centre of mass to either axle
    com_height: float  # [m]
    gyration_squared: float  # k^2 [m^2], yaw inertia over mass
    friction: float
    min_force: float  # [N], full braking
    max_force: float  # [N], full drive
    max_steering: float  # [rad]
    max_steering_rate: float  # [rad/s]

    @classmethod
    def of(cls, robot: Robot) -> Body:
        """The body of a robot."""
        return cls(
            mass=robot.mass,
            half_base=0.5 * robot.wheelbase,
            com_height=robot.com_height,
            gyration_squared=gyration_squared(robot),
            friction=robot.friction,
            min_force=-robot.mass * robot.max_braking,
            max_force=robot.mass * robot.max_acceleration,
            max_steering=robot.max_steering,
            max_steering_rate=robot.max_steering_rate,
        )


def tyre_forces(body: Body, state: Sequence[float], force: float) -> Forces:
    """Tyre forces for a drive force [N] (negative brakes), shared by the axles in proportion to their load.

    Per unit of load both axles then get the same drive force u, and with a cornering stiffness in
    proportion to load the lateral force depends on slip alone: the force over load (u, f) of an axle is known
    before its load is. It is scaled back onto the friction circle when longer than mu. With p_f, p_r the
    forward parts of the two, load transfer N_f = m (g - h a_x / b) / 2, N_r = m g - N_f (b half the
    wheelbase) and m a_x = N_f p_f + N_r p_r give a_x = g (p_f + p_r) / (2 + h (p_f - p_r) / b).
    """
    _, _, _, forward, sideways, yaw_rate, steering = state
    mu, b, h = body.friction, body.half_base, body.com_height
    drive = min(max(force, body.min_force), body.max_force) / (body.mass * GRAVITY)
    cosine, sine = math.cos(steering), math.sin(steering)
    front_side = sideways + b * yaw_rate
    slip_f = (front_side * cosine - forward * sine) / rolling_speed(forward * cosine + front_side * sine)
    slip_r = (sideways - b * yaw_rate) / rolling_speed(forward)
    side_f, side_r = -brush_force(slip_f, mu), -brush_force(slip_r, mu)
    demand_f, demand_r = math.hypot(drive, side_f) / mu, math.hypot(drive, side_r) / mu
    scale_f, scale_r = 1.0 / max(demand_f, 1.0), 1.0 / max(demand_r, 1.0)
    forward_f = scale_f * (drive * cosine - side_f * sine)
    left_f = scale_f * (drive * sine + side_f * cosine)
    forward_r, left_r = scale_r * drive, scale_r * side_r
    spread = max(2.0 + h * (forward_f - forward_r) / b, 0.1)  # near zero only where an axle has lifted anyway
    acceleration = GRAVITY * (forward_f + forward_r) / spread
    weight = body.mass * GRAVITY
    load_f = min(max(0.5 * (weight - body.mass * h * acceleration / b), 0.0), weight)
    load_r = weight - load_f
    whole = full_slide(mu)
    return Forces(
        load_f * forward_f + load_r * forward_r,
        load_f * left_f + load_r * left_r,
        b * (load_f * left_f - load_r * left_r),
        max(demand_f, abs(slip_f) / whole),
        max(demand_r, abs(slip_r) / whole),
        load_f,
    )


def state_derivatives(
    body: Body, state: Sequence[float], steering_command: float, force: float
) -> tuple[float, float, float, float, float, float, float]:
    """Time derivatives of `State`: Newton-Euler in the frame of the body, and the steering servo.

    The servo follows its command with `STEERING_TIME_CONSTANT`, within the robot's steering angle and rate.
    """
    _, _, heading, forward, sideways, yaw_rate, steering = state
    forces = tyre_forces(body, state, force)
    cosine, sine = math.cos(heading), math.sin(heading)
    target = min(max(steering_command, -body.max_steering), body.max_steering)
    rate = (target - steering) / STEERING_TIME_CONSTANT
    rate = min(max(rate, -body.max_steering_rate), body.max_steering_rate)
    return (
        forward * cosine - sideways * sine,
        forward * sine + sideways * cosine,
        yaw_rate,
        forces.longitudinal / body.mass + yaw_rate * sideways,
        forces.lateral / body.mass - yaw_rate * forward,
        forces.yaw_moment / (body.mass * body.gyration_squared),
        rate,
    )


class SingleTrackVehicle(LeafSystem):  # type: ignore[misc]
    """Dynamic bicycle in the plane; all that changes is its continuous `State`.

    Input port
        `command` (2): steering angle [rad] and drive force [N], negative brakes.
    Output ports
        `state` (7): `State`; `motion` (15): `Motion`.
    """

    def __init__(self, robot: Robot) -> None:
        super().__init__()
        self.body = Body.of(robot)
        index = self.DeclareContinuousState(len(State._fields))
        self.DeclareVectorInputPort("command", 2)
        self.DeclareStateOutputPort("state", index)
        self.DeclareVectorOutputPort("motion", len(Motion._fields), self._motion)

    def DoCalcTimeDerivatives(self, context: Context, derivatives: ContinuousState) -> None:  # noqa: N802
        """Drake calls this."""
        state = context.get_continuous_state_vector().CopyToVector().tolist()
        steering, force = self.get_input_port(0).Eval(context).tolist()
        derivatives.get_mutable_vector().SetFromVector(state_derivatives(self.body, state, steering, force))

    def _motion(self, context: Context, output: BasicVector) -> None:
        state = State(*context.get_continuous_state_vector().CopyToVector().tolist())
        steering, force = self.get_input_port(0).Eval(context).tolist()
        forces = tyre_forces(self.body, state, force)
        output.SetFromVector(
            Motion(
                state.x,
                state.y,
                state.heading,
                state.speed,
                state.longitudinal_velocity,
                state.lateral_velocity,
                state.yaw_rate,
                state.steering,
                steering,
                force,
                forces.longitudinal,
                forces.lateral / self.body.mass,
                forces.front_demand,
                forces.rear_demand,
                forces.front_load,
            )
        )
