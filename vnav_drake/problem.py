"""The question: a world, a robot, how it may brake, and where it must go."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vnav_drake.braking import UniformBraking
from vnav_drake.robot import Robot
from vnav_drake.world import World
from vnav_drake.zones.convex_zone import ConvexZone

Array = NDArray[np.float64]


class PlanningError(Exception):
    """A method could not give an answer; the message says which and why."""


class NoPathError(PlanningError):
    """No path exists for this robot between these ends: bad input, not a failure of a method."""


class NoClassError(PlanningError):
    """There are paths, but none through the gates that were asked for: bad input too."""


@dataclass(frozen=True, kw_only=True)
class End:
    """Start or goal of the motion."""

    position: tuple[float, float]  # [m]
    speed: float | Literal["safe", "rest"] = "safe"  # [m/s]
    heading: float | None = None  # [rad], free when None

    @property
    def point(self) -> Array:
        """(2,) [m]"""
        return np.array(self.position, dtype=float)

    @property
    def fixed_speed(self) -> float | None:
        """[m/s], or None at a safe end, where the robot may have any safe speed."""
        if self.speed == "safe":
            return None
        return 0.0 if self.speed == "rest" else float(self.speed)


@dataclass(frozen=True, kw_only=True)
class Problem:
    """Everything a planner needs to know."""

    world: World
    robot: Robot
    braking: UniformBraking  # how far it needs to stop; where `zone` is None, in every direction
    zone: ConvexZone | None = None  # what must be free where that depends on the heading; of the same law
    friction_reserve: bool = False  # keep full braking available while turning
    start: End
    goal: End

    def isotropic(self) -> tuple[Problem, Literal["inner", "outer"]]:
        """The problem that methods for uniform braking solve in place of this one.

        Returns
        -------
        A problem without `zone`, and what its disc is to the zone: "inner", in it, so that nothing is slower
        than with the zone; or "outer", around it, so that what is safe with the disc is safe with the zone.

        Raises
        ------
        PlanningError : the zone has neither.
        """
        if self.zone is None:
            return self, "inner"
        inner, outer = self.zone.inner_law(), self.zone.outer_law()
        if inner is not None:
            return replace(self, braking=inner, zone=None), "inner"
        if outer is not None:
            return replace(self, braking=outer, zone=None), "outer"
        raise PlanningError(f"the braking zone {self.zone.type_name!r} has no disc in it and none around it")

    def clearance(self, points: ArrayLike) -> Array:
        """Signed clearance d [m] of the robot's disc at points (..., 2) [m]; shape (...)."""
        return self.world.distance(points) - self.robot.radius

    def safe_speed(self, points: ArrayLike) -> Array:
        """Greatest safe speed [m/s] at points (..., 2) [m]; shape (...)."""
        return self.braking.speed(self.clearance(points))

    @property
    def has_variational_optimum(self) -> bool:
        """Whether the zone alone bounds speeds everywhere: with a disc in it, not as a scanner's field."""
        return self.zone is None or self.zone.inner_law() is not None

    @property
    def lateral_limit(self) -> float:
        """Greatest v^2 |kappa| [m/s^2] allowed: sliding, tip-over, and the friction reserve if asked for."""
        limit = min(self.robot.friction_acceleration, self.robot.tip_acceleration)
        if self.friction_reserve:
            limit = min(limit, self.robot.reserved_lateral_acceleration())
        return limit
