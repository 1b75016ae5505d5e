"""Braking zones as convex sets that turn with the robot and grow with its speed.

A zone is what must be free of obstacles at a pose (x, y, theta) and a speed v, the robot's body in it. It is
told by its support function h(angle, v): how far it reaches from the robot's centre in a direction of the
body's frame, zero straight ahead. All else follows from h.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vnav_drake.braking import UniformBraking

Array = NDArray[np.float64]

ANGLES = 720  # at which an unknown shape is measured
# Share of the stopping distance: with a smaller disc inside nothing is said about speeds. 1e-3 is enough,
# however it is rounded.
LEAST_INSCRIBED = 0.999e-3


@dataclass(frozen=True, kw_only=True)
class ConvexZone(ABC):
    """A convex zone around a disc robot. Subclasses give `support`; it must not shrink with speed."""

    law: UniformBraking  # stopping distance, margin and greatest speed
    radius: float  # of the robot's disc [m]

    type_name: ClassVar[str] = ""  # as scenarios name it
    isotropic: ClassVar[bool] = False

    @abstractmethod
    def support(self, angle: ArrayLike, speed: ArrayLike) -> tuple[Array, Array, Array]:
        """How far the zone, body and margin with it, reaches in a direction.

        Parameters
        ----------
        angle : [rad] from straight ahead, anticlockwise. speed : [m/s]. They broadcast.

        Returns
        -------
        h [m], dh/dangle [m/rad] (at a kink that of either side), dh/dspeed [s], which is zero or more.
        """

    @property
    def kinks(self) -> Array:
        """Angles [rad] where h is not differentiable; (k,)."""
        return np.empty(0)

    @property
    def steps(self) -> Array:
        """Speeds [m/s] above which the zone jumps, where it grows in steps; (k,)."""
        return np.empty(0)

    def inner_law(self) -> UniformBraking | None:
        """Uniform braking whose disc lies in the zone: with it nothing is slower. None if there is none."""
        return None

    def outer_law(self) -> UniformBraking | None:
        """Uniform braking whose disc holds the zone: what is safe with it is safe. None if there is none."""
        return None

    def with_law(self, law: UniformBraking) -> Self:
        """The zone of the same shape with another stopping distance."""
        return replace(self, law=law)

    def outline(self, speed: float, points: int = 96) -> Array:
        """Boundary (m, 2) [m] in the body's frame, anticlockwise: the point that touches each tangent."""
        even = np.linspace(-math.pi, math.pi, points, endpoint=False)
        sides = np.concatenate([self.kinks - 1e-9, self.kinks + 1e-9])
        angle = np.sort(np.concatenate([even, sides]))
        h, slope, _ = self.support(angle, np.full(len(angle), float(speed)))
        along = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        across = np.stack([-along[:, 1], along[:, 0]], axis=1)
        return h[:, None] * along + slope[:, None] * across


@dataclass(frozen=True, kw_only=True)
class GaugeZone(ConvexZone):
    """D(v) E (+) body: a convex shape E, as long as the stopping distance D(v), around the body.

    E holds 0 and the point (1, 0), so that a straight stop stays in the zone, and the zone only shrinks on
    the way (docs/braking_zones.md). Subclasses give `shape`, the support function of E.
    """

    @abstractmethod
    def shape(self, angle: Array) -> tuple[Array, Array]:
        """Support function of E and its slope [1], [1/rad], at angles [rad]; same shape."""

    def body(self, angle: Array) -> tuple[Array, Array]:
        """Support function of the zone at standstill [m] and its slope; here a disc with the margin."""
        return np.full_like(angle, self.radius + self.law.margin), np.zeros_like(angle)

    def support(self, angle: ArrayLike, speed: ArrayLike) -> tuple[Array, Array, Array]:
        angle, speed = np.asarray(angle, dtype=float), np.asarray(speed, dtype=float)
        shape, shape_slope = self.shape(angle)
        body, body_slope = self.body(angle)
        far = self.law.distance(speed) - self.law.margin
        by_angle = np.asarray(body_slope + far * shape_slope)
        return np.asarray(body + far * shape), by_angle, np.asarray(self.law.distance_slope(speed) * shape)

    @cached_property
    def extent(self) -> float:
        """Radius of a disc around the centre that holds E."""
        return self.measured_extent()

    @cached_property
    def inscribed(self) -> float:
        """Radius of a disc around the centre that lies in E."""
        return self.measured_inscribed()

    def measured_extent(self) -> float:
        """An upper bound of the true radius: E lies within its tangents at even angles."""
        return float(self.shape(_EVEN)[0].max()) / math.cos(math.pi / ANGLES)

    def measured_inscribed(self) -> float:
        """A lower bound of the true radius: h changes by at most `extent` a radian."""
        return max(0.0, float(self.shape(_EVEN)[0].min()) - self.extent * math.pi / ANGLES)

    def inner_law(self) -> UniformBraking | None:
        if self.inscribed < LEAST_INSCRIBED:
            return None
        return self._scaled(self.inscribed, float(self.body(_EVEN)[0].min()))

    def outer_law(self) -> UniformBraking | None:
        return self._scaled(self.extent, float(self.body(_EVEN)[0].max()) / math.cos(math.pi / ANGLES))

    def _scaled(self, share: float, body: float) -> UniformBraking:
        """The law whose disc has the radius body + share D(v)."""
        law = self.law
        if share == 1.0 and body <= self.radius + law.margin:
            return law
        return UniformBraking(
            max_braking=law.max_braking / share,
            reaction_time=law.reaction_time * share,
            margin=max(body - self.radius, 0.0),
            max_speed=law.max_speed,
        )


@dataclass(frozen=True, kw_only=True)
class WidenedZone(GaugeZone):
    """Another zone with E grown by a disc of `share`, which evens out jumps of the speed."""

    of: GaugeZone
    share: float

    def shape(self, angle: Array) -> tuple[Array, Array]:
        shape, slope = self.of.shape(angle)
        return shape + self.share, slope

    def body(self, angle: Array) -> tuple[Array, Array]:
        return self.of.body(angle)

    @property
    def kinks(self) -> Array:
        return self.of.kinks


_EVEN = np.linspace(-math.pi, math.pi, ANGLES, endpoint=False)
