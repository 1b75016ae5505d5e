"""The four-wheeled vehicle as a MultibodyPlant: sliding and tipping come from contact, nothing is told.

A chassis on four wheels, the front ones on steered knuckles. Every wheel has a drive, which gives the torque
it is told, and a brake: an implicit damper that slows the wheel with at most its torque limit, and holds it
when it stands. Tyres are spheres in point contact with Coulomb friction. Frames: x forward, y left, z up, the
origin of the chassis on the floor midway between the axles.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import (
    AddContactMaterial,
    CollisionFilterDeclaration,
    HalfSpace,
    ProximityProperties,
    SceneGraph,
    Sphere,
)
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import (
    AddMultibodyPlant,
    CoulombFriction,
    MultibodyPlant,
    MultibodyPlantConfig,
)
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    Frame,
    PdControllerGains,
    RevoluteJoint,
    RigidBody,
    RotationalInertia,
    SpatialInertia,
    UnitInertia,
)
from pydrake.systems.framework import Context, DiagramBuilder

from systems.rolling import SINK, STEERING_LAG, WHEEL_RADIUS
from systems.single_track import State
from systems.supervisor import BRAKE_TIME
from vnav_drake.robot import GRAVITY, Robot

Array = NDArray[np.float64]

PLANT_STEP = 2e-3  # [s]
STICTION_SPEED = 1e-3  # [m/s]: tyres creep by about this much below the limit of friction
WHEELS = ("front_left", "front_right", "rear_left", "rear_right")  # the order of all arrays of four
# Times that limit, which a brake can give: in a turn the outer wheels carry up to twice as much.
BRAKE_RESERVE = 2.0
LEAST_SHARE = 1e-3  # of the braking, that a wheel gets which would lift: brakes have some limit above zero
WHEEL_MASS = 0.01  # of the robot's
KNUCKLE_MASS = 0.005
DISSIPATION = 20.0  # [s/m], of the contact, for a wheelbase of 0.5 m
STEERING_STIFFNESS = 400.0  # [N m/rad], for 40 kg on a wheelbase of 0.5 m


def _worth_telling(record: logging.LogRecord) -> bool:
    """Drake warns of every half space that soft bodies do not feel it; there are none here."""
    return "half spaces are not currently supported for deformable" not in record.getMessage()


logging.getLogger("drake").addFilter(_worth_telling)


@dataclass(frozen=True, kw_only=True)
class WheelGeometry:
    """Where the wheels stand and what their brakes can do; arrays (4,) in the order of `WHEELS`."""

    radius: float  # [m], of a wheel
    x: Array  # [m], from the middle of the robot, forward
    y: Array  # [m], to the left
    spin_mass: float  # [kg]: what turning all four wheels adds to the mass that is accelerated
    brake_limit: Array  # [N m], on the straight

    @classmethod
    def of(cls, robot: Robot) -> WheelGeometry:
        """Of a robot; `brake_limit` is what gives `max_braking` on the straight.

        The floor pushes against each wheel in proportion to its load at that deceleration; besides, a brake
        slows its own wheel.
        """
        radius = WHEEL_RADIUS * robot.wheelbase
        front = np.array([1.0, 1.0, -1.0, -1.0])
        left = np.array([1.0, -1.0, 1.0, -1.0])
        spin_mass = 4 * 0.5 * WHEEL_MASS * robot.mass  # solid discs
        shift = 2.0 * robot.com_height * robot.max_braking / (robot.wheelbase * GRAVITY)
        share = np.maximum(0.25 * (1.0 + front * shift), LEAST_SHARE)
        return cls(
            radius=radius,
            x=0.5 * robot.wheelbase * front,
            y=0.5 * robot.track * left,
            spin_mass=spin_mass,
            brake_limit=radius * (share * robot.mass + 0.25 * spin_mass) * robot.max_braking,
        )

    def steering(self, angle: float) -> tuple[float, float]:
        """Angles [rad] of the left and right front wheel that turn about one point with the rear axle.

        `angle` is that of a wheel midway between them (Ackermann).
        """
        run = (self.x[0] - self.x[2]) * math.tan(angle)
        base = self.x[0] - self.x[2]
        return (
            math.atan2(run * base, base * base - self.y[0] * run),
            math.atan2(run * base, base * base - self.y[1] * run),
        )


@dataclass(frozen=True, kw_only=True)
class FourWheel:
    """The plant and where its numbers are."""

    plant: MultibodyPlant
    scene_graph: SceneGraph
    robot: Robot
    wheels: WheelGeometry
    wheel_bodies: tuple[int, ...]  # index of each wheel's body
    drives: tuple[int, ...]  # row of each drive in the actuation
    brakes: tuple[int, ...]
    brake_limit: Array  # (4,) [N m], the most that a brake gives
    steers: tuple[int, int]  # left, right
    spins: tuple[int, ...]  # of each wheel in the velocities

    @property
    def states(self) -> int:
        """Number of positions and velocities."""
        return int(self.plant.num_multibody_states())

    def set_state(self, context: Context, state: State, forward: float = 0.0) -> None:
        """Put the vehicle on the floor in a state of motion, its wheels rolling; `context` of the plant.

        Each wheel has sunk in by what it carries in that turn while it accelerates by `forward` [m/s^2].
        """
        plant, heading = self.plant, state.heading
        values = np.zeros(self.states)
        robot, depth = self.robot, SINK * self.robot.wheelbase
        # loads m g / 4 (1 -+ 2 h a / (l g)) and so on, so the difference of both sides' depths over their gap
        lean = 4.0 * depth * robot.com_height / GRAVITY
        pitch = -lean * forward / robot.wheelbase**2
        roll = lean * state.longitudinal_velocity * state.yaw_rate / robot.track**2
        pose = RollPitchYaw(roll, pitch, heading).ToQuaternion().wxyz()
        values[:7] = [*pose, state.x, state.y, -depth]
        count = plant.num_positions()
        along, left, turn = state.longitudinal_velocity, state.lateral_velocity, state.yaw_rate
        cosine, sine = math.cos(heading), math.sin(heading)
        values[count + 2] = turn
        values[count + 3 : count + 5] = [cosine * along - sine * left, sine * along + cosine * left]
        angles = (*self.wheels.steering(state.steering), 0.0, 0.0)
        for name, angle in zip(("left", "right"), angles[:2], strict=True):
            values[plant.GetJointByName(f"steer_{name}").position_start()] = angle
        for spin, x, y, angle in zip(self.spins, self.wheels.x, self.wheels.y, angles, strict=True):
            rolling = (along - turn * y) * math.cos(angle) + (left + turn * x) * math.sin(angle)
            values[count + spin] = rolling / self.wheels.radius
        plant.SetPositionsAndVelocities(context, values)


def add_four_wheel(
    builder: DiagramBuilder, robot: Robot, step: float = PLANT_STEP, *, believed: Robot | None = None
) -> FourWheel:
    """Add the vehicle of a robot on a flat floor to a diagram; `step` of the plant [s].

    `believed` is the robot for which brakes, tyres and servos were made, by default the same.

    Raises
    ------
    ValueError : the robot is a point.
    """
    if robot.radius == 0.0:
        raise ValueError("a point robot has no wheels: simulate it as a single track")
    config = MultibodyPlantConfig(
        time_step=step,
        discrete_contact_approximation="lagged",
        contact_model="point",
        stiction_tolerance=STICTION_SPEED,
    )
    plant, scene_graph = AddMultibodyPlant(config, builder)
    made_for = believed or robot
    wheels = WheelGeometry.of(robot)
    limits = BRAKE_RESERVE * WheelGeometry.of(made_for).brake_limit
    tyre = _tyre(robot, made_for)
    plant.RegisterCollisionGeometry(plant.world_body(), RigidTransform(), HalfSpace(), "floor", tyre)
    chassis = plant.AddRigidBody("chassis", _chassis_inertia(robot, wheels.radius))
    spins = []
    for i, name in enumerate(WHEELS):
        hub: Frame = plant.AddFrame(
            FixedOffsetFrame(
                f"hub_{name}",
                chassis.body_frame(),
                RigidTransform([wheels.x[i], wheels.y[i], wheels.radius]),
            )
        )
        if name.startswith("front"):
            hub = _knuckle(plant, robot, made_for, hub, name.removeprefix("front_"), wheels.radius)
        inertia = UnitInertia.SolidCylinder(wheels.radius, 0.5 * wheels.radius, [0.0, 1.0, 0.0])
        wheel = plant.AddRigidBody(
            f"wheel_{name}", SpatialInertia(WHEEL_MASS * robot.mass, np.zeros(3), inertia)
        )
        spin = plant.AddJoint(RevoluteJoint(f"spin_{name}", hub, wheel.body_frame(), [0.0, 1.0, 0.0]))
        plant.RegisterCollisionGeometry(wheel, RigidTransform(), Sphere(wheels.radius), f"tyre_{name}", tyre)
        plant.AddJointActuator(f"drive_{name}", spin)
        limit = float(limits[i])
        brake = plant.AddJointActuator(f"brake_{name}", spin, limit)
        soft = BRAKE_TIME * robot.max_braking / wheels.radius  # [rad/s]
        brake.set_controller_gains(PdControllerGains(p=0.0, d=limit / soft))
        spins.append(spin)
    plant.Finalize()
    # wheels of a narrow robot overlap; they touch the floor, not each other
    tyres = plant.CollectRegisteredGeometries([plant.GetBodyByName(f"wheel_{name}") for name in WHEELS])
    scene_graph.collision_filter_manager().Apply(CollisionFilterDeclaration().ExcludeWithin(tyres))

    def rows(kind: str, names: Sequence[str]) -> tuple[int, ...]:
        return tuple(plant.GetJointActuatorByName(f"{kind}_{name}").input_start() for name in names)

    left, right = rows("steer", ("left", "right"))
    return FourWheel(
        plant=plant,
        scene_graph=scene_graph,
        robot=robot,
        wheels=wheels,
        wheel_bodies=tuple(int(plant.GetBodyByName(f"wheel_{name}").index()) for name in WHEELS),
        drives=rows("drive", WHEELS),
        brakes=rows("brake", WHEELS),
        brake_limit=limits,
        steers=(left, right),
        spins=tuple(spin.velocity_start() for spin in spins),
    )


def _knuckle(
    plant: MultibodyPlant, robot: Robot, made_for: Robot, hub: Frame, side: str, radius: float
) -> Frame:
    """A knuckle that turns about the vertical through the wheel's centre, held by a stiff servo."""
    mass = KNUCKLE_MASS * robot.mass
    inertia = UnitInertia.SolidSphere(0.5 * radius)
    body: RigidBody = plant.AddRigidBody(f"knuckle_{side}", SpatialInertia(mass, np.zeros(3), inertia))
    joint = plant.AddJoint(RevoluteJoint(f"steer_{side}", hub, body.body_frame(), [0.0, 0.0, 1.0]))
    servo = plant.AddJointActuator(f"steer_{side}", joint)
    scale = made_for.mass / 40.0 * (made_for.wheelbase / 0.5) ** 2
    stiffness = STEERING_STIFFNESS * scale
    servo.set_default_rotor_inertia(0.01 * scale)
    servo.set_default_gear_ratio(1.0)
    servo.set_controller_gains(PdControllerGains(p=stiffness, d=STEERING_LAG * stiffness))
    return body.body_frame()


def _tyre(robot: Robot, made_for: Robot) -> ProximityProperties:
    """Friction of tyre and floor, and a contact stiff enough that a wheel at rest sinks by `SINK`.

    Tyre and floor have the same stiffness, so that each takes half.
    """
    properties = ProximityProperties()
    stiffness = 2.0 * 0.25 * made_for.mass * GRAVITY / (SINK * made_for.wheelbase)
    AddContactMaterial(
        dissipation=DISSIPATION * math.sqrt(0.5 / robot.wheelbase),
        point_stiffness=stiffness,
        friction=CoulombFriction(robot.friction, robot.friction),
        properties=properties,
    )
    return properties


def _chassis_inertia(robot: Robot, radius: float) -> SpatialInertia:
    """The chassis with which all bodies have the robot's mass, height and yaw inertia m (l^2 + w^2)/12.

    Roll and pitch inertia are those of a box that reaches as far above the centre of mass as below, at
    least as high as the wheels.
    """
    light = 4.0 * WHEEL_MASS + 2.0 * KNUCKLE_MASS
    mass = (1.0 - light) * robot.mass
    height = (robot.com_height - light * radius) / (1.0 - light)
    back = KNUCKLE_MASS * robot.wheelbase / (1.0 - light)  # the knuckles, in front, are balanced
    l2, w2, box = robot.wheelbase**2, robot.track**2, max(2.0 * robot.com_height, 2.0 * radius)
    # less what wheels and knuckles have already, each a point at its corner, at the height of the hubs; of
    # all three axes, so that what is left is the inertia of a body for every length, width and height
    across, along = (
        robot.mass * w2 * (1.0 / 12.0 - 0.25 * light),
        robot.mass * l2 * (1.0 / 12.0 - 0.25 * light) - mass * back * back,
    )
    lower, higher = robot.com_height - radius, height - robot.com_height
    upward = robot.mass * box * box / 12.0 - robot.mass * light * lower**2 - mass * higher**2
    roll, pitch, yaw = across + upward, along + upward, across + along
    about = RotationalInertia(roll, pitch, yaw)
    centre = [-back, 0.0, height]
    return SpatialInertia.MakeFromCentralInertia(mass, centre, about)
