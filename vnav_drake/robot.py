"""The wheeled robot: its body and the limits that physics and actuators put on it."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from functools import cached_property

GRAVITY = 9.81  # [m/s^2]


@dataclass(frozen=True, kw_only=True)
class Robot:
    """A disc-shaped four-wheeled robot (Manor 2015, Lemma A.1).

    A radius of zero is a point robot: the idealisation of the source's first chapters. Raises
    ValueError when a number is out of its range.
    """

    radius: float  # [m], of the disc that contains the body
    mass: float = 40.0  # [kg]
    wheelbase: float = 0.5  # [m]
    track: float = 0.4  # [m]
    com_height: float = 0.12  # [m], centre of mass above the floor
    friction: float = 0.6  # mu, tyre on floor
    max_braking: float = 1.0  # a_b [m/s^2]
    max_acceleration: float = 1.0  # a_max [m/s^2]
    max_speed: float = math.inf  # [m/s]
    max_steering: float = 0.6  # omega_max [rad], of the mean front wheel
    max_steering_rate: float = math.inf  # [rad/s]

    def __post_init__(self) -> None:
        for name in (field.name for field in fields(self)):
            number = getattr(self, name)
            may_be_zero = name in ("radius", "com_height")
            may_be_infinite = name in ("max_speed", "max_steering_rate")
            in_range = number >= 0.0 if may_be_zero else number > 0.0
            if not in_range or (math.isinf(number) and not may_be_infinite):
                rule = "zero or more" if may_be_zero else "positive"
                finite = "" if may_be_infinite else " and finite"
                raise ValueError(f"{name} = {number!r}: must be {rule}{finite}")
        if self.max_steering >= 0.5 * math.pi:
            raise ValueError(f"max_steering = {self.max_steering!r}: must be below pi/2 [rad]")

    @cached_property
    def friction_acceleration(self) -> float:
        """mu g [m/s^2]: radius of the friction circle (eq. A.2)."""
        return self.friction * GRAVITY

    @cached_property
    def tip_acceleration(self) -> float:
        """g w / (2 h) [m/s^2]: lateral acceleration at which the inner wheels lift (eq. A.3)."""
        if self.com_height == 0.0:
            return math.inf
        return GRAVITY * self.track / (2.0 * self.com_height)

    @cached_property
    def max_curvature(self) -> float:
        """1 / r_kin [1/m], r_kin = l sqrt(1/4 + 1/tan^2(omega_max)) (eq. A.1)."""
        return 1.0 / (self.wheelbase * math.sqrt(0.25 + 1.0 / math.tan(self.max_steering) ** 2))

    def steering_angle(self, curvature: float) -> float:
        """Steering angle [rad] of a path of this curvature [1/m] at the centre of mass.

        Inverse of eq. (A.1), the centre of mass midway between the axles:
        sin(beta) = kappa l / 2 and tan(omega) = 2 tan(beta).
        """
        sine = 0.5 * curvature * self.wheelbase
        return math.atan(2.0 * sine / math.sqrt(1.0 - sine * sine))

    def reserved_lateral_acceleration(self) -> float:
        """Lateral acceleration [m/s^2] that leaves full braking inside the friction circle.

        sqrt((mu g)^2 - a_b^2), zero when braking alone takes all the friction.
        """
        return math.sqrt(max(0.0, self.friction_acceleration**2 - self.max_braking**2))
