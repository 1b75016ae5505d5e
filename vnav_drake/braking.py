"""How fast is safe: the uniform braking law, and what every other braking zone is asked.

Manor 2015, eq. (3.13), with the reaction time and margin of safety-scanner practice: the robot
must be able to stop within its clearance, `v t_r + v^2 / (2 a_b) + m <= d`. Zones that depend on the heading
(Manor 2015, Secs. 3.8, 4.3) are in `vnav_drake.zones`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class UniformBraking:
    """The same braking distance in every direction. Raises ValueError when a number is out of its range."""

    max_braking: float  # a_b [m/s^2], positive
    reaction_time: float = 0.0  # t_r [s]
    margin: float = 0.0  # m [m]
    max_speed: float = math.inf  # v_max [m/s]

    isotropic = True

    def __post_init__(self) -> None:
        if not 0.0 < self.max_braking < math.inf:
            raise ValueError(f"max_braking = {self.max_braking!r}: must be positive and finite [m/s^2]")
        for name in ("reaction_time", "margin"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise ValueError(f"{name} = {getattr(self, name)!r}: must be zero or more and finite")
        if not self.max_speed > 0.0:
            raise ValueError(f"max_speed = {self.max_speed!r}: must be positive [m/s]")

    def distance(self, speed: ArrayLike) -> Array:
        """Clearance [m] that a robot at `speed` [m/s] needs; same shape."""
        v = np.asarray(speed, dtype=float)
        return v * self.reaction_time + v * v / (2.0 * self.max_braking) + self.margin

    def distance_slope(self, speed: ArrayLike) -> Array:
        """Derivative of `distance` [s]; same shape as `speed`."""
        v = np.asarray(speed, dtype=float)
        return self.reaction_time + v / self.max_braking

    def speed(self, clearance: ArrayLike) -> Array:
        """Greatest safe speed V(d) [m/s] at clearance d [m]; zero where d <= margin."""
        room = np.maximum(np.asarray(clearance, dtype=float) - self.margin, 0.0)
        lag = self.max_braking * self.reaction_time
        # 2 a d / (lag + sqrt(lag^2 + 2 a d)): the positive root without cancellation
        twice = 2.0 * self.max_braking * room
        root = np.sqrt(lag * lag + twice)
        v = root if lag == 0.0 else twice / (lag + root)
        return np.minimum(v, self.max_speed)

    def speed_slope(self, clearance: ArrayLike) -> Array:
        """V'(d) [1/s]; zero at the speed cap and where d <= margin."""
        d = np.asarray(clearance, dtype=float)
        v = self.speed(d)
        moving = (v > 0.0) & (v < self.max_speed)
        slope = self.max_braking / np.where(moving, v + self.max_braking * self.reaction_time, 1.0)
        return np.where(moving, slope, 0.0)


class BrakingZone(Protocol):
    """What must be free of obstacles at a pose and a speed; convex, and never smaller at a higher speed.

    All that planners, bounds and pictures ask of a zone follows from its support function:
    `zones.speed.safe_speed` the greatest safe speed at poses, `zones.touch.separation` the signed distance to
    convex obstacles with its derivatives, `zones.rows` the same between the samples of a path, the lower
    bound the set of velocities. New zones derive from `zones.convex_zone.GaugeZone`, which asks for the
    shape alone, or from `ConvexZone`.
    """

    @property
    def law(self) -> UniformBraking:
        """Stopping distance, margin and greatest speed."""

    @property
    def radius(self) -> float:
        """Of the robot's disc [m]."""

    @property
    def isotropic(self) -> bool:
        """Whether it is the same for all headings: then uniform braking and its closed forms serve."""

    def support(self, angle: ArrayLike, speed: ArrayLike) -> tuple[Array, Array, Array]:
        """How far it reaches in directions [rad] of the body's frame at speeds [m/s], and both slopes."""

    def outline(self, speed: float) -> Array:
        """Its boundary (m, 2) [m] at a speed, in the body's frame."""

    def inner_law(self) -> UniformBraking | None:
        """Uniform braking whose disc lies in it: the isotropic relaxation, where there is one."""

    def outer_law(self) -> UniformBraking | None:
        """Uniform braking whose disc holds it, where there is one."""
