"""The limits of the robot, recomputed from the scenario's raw numbers."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

GRAVITY = 9.81  # [m/s^2]


@dataclass(frozen=True, kw_only=True)
class Limits:
    """What the robot may do, and how it brakes. `math.inf` means: not limited."""

    radius: float  # [m]
    mass: float  # [kg]
    wheelbase: float  # l [m]
    track: float  # w [m]
    braking: float  # a_b [m/s^2]
    acceleration: float  # a_max [m/s^2]
    speed: float  # v_max, and of fields that are given the greatest of their speeds [m/s]
    grip: float  # mu g [m/s^2] (Manor 2015, eq. A.2)
    tip: float  # g w / (2 h) [m/s^2] (eq. A.3)
    reserve: float  # sqrt((mu g)^2 - a_b^2) [m/s^2] if braking is to stay available in turns
    curvature: float  # 1 / (l sqrt(1/4 + 1/tan^2 omega_max)) [1/m] (eq. A.1)
    steering_rate: float  # [rad/s]
    reaction_time: float  # [s]
    margin: float  # [m]

    @classmethod
    def from_spec(cls, spec: Any) -> Limits:
        """From a parsed scenario's raw numbers (`Scenario.spec`)."""
        robot, braking = spec.robot, spec.braking
        grip = robot.friction * GRAVITY
        tip = 0.5 * GRAVITY * robot.track / robot.com_height if robot.com_height > 0.0 else math.inf
        leftover = math.sqrt(max(0.0, (grip - robot.max_braking) * (grip + robot.max_braking)))
        sine, cosine = math.sin(robot.max_steering), math.cos(robot.max_steering)
        return cls(
            radius=robot.radius,
            mass=robot.mass,
            wheelbase=robot.wheelbase,
            track=robot.track,
            braking=robot.max_braking,
            acceleration=robot.max_acceleration,
            speed=min(math.inf if robot.max_speed is None else robot.max_speed, _last_field(braking.zone)),
            grip=grip,
            tip=tip,
            reserve=leftover if braking.friction_reserve else math.inf,
            curvature=sine / (robot.wheelbase * math.sqrt(cosine**2 + 0.25 * sine**2)),
            steering_rate=math.inf if robot.max_steering_rate is None else robot.max_steering_rate,
            reaction_time=braking.reaction_time,
            margin=braking.margin,
        )

    @property
    def reserves_friction(self) -> bool:
        """Whether full braking is to stay available in turns."""
        return math.isfinite(self.reserve)

    def steering_angle(self, curvature: Array) -> Array:
        """Angle [rad] of the mean front wheel on a path of `curvature` [1/m] at the centre of mass.

        The centre of mass lies midway between the axles and moves at the angle beta to the body:
        sin beta = kappa l / 2, tan omega = 2 tan beta. Beyond |kappa| = 2 / l the wheel stands at a
        right angle.
        """
        slip = np.arcsin(np.clip(0.5 * self.wheelbase * curvature, -1.0, 1.0))
        return np.arctan2(2.0 * np.sin(slip), np.cos(slip))

    def safe_speed(self, clearance: float) -> float:
        """Greatest speed [m/s] from which the robot stops within `clearance` [m], at most v_max.

        The positive root of v t_r + v^2 / (2 a_b) + m = d.
        """
        lag = self.braking * self.reaction_time
        room = max(0.0, clearance - self.margin)
        return min(self.speed, math.sqrt(lag * lag + 2.0 * self.braking * room) - lag)


def _last_field(zone: Any) -> float:
    """The speed [m/s] above which no field that the scenario gives is for."""
    fields = zone.parameters.get("fields") if zone.type == "field_set" else None
    return max((float(field["max_speed"]) for field in fields), default=math.inf) if fields else math.inf
