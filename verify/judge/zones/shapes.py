"""Convex sets told by their support function: how far each reaches in a direction, and no further than where.

Own formulas: nothing here comes from the planners' zones. All sets hold the origin, so every support function
is zero or more. Angles are those of the body's frame, zero straight ahead, anticlockwise.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

SAMPLES = 1440  # directions in which a set of unknown form is measured


class Shape(ABC):
    """A convex set that holds the origin."""

    @abstractmethod
    def support(self, angle: Array) -> Array:
        """Greatest of n.p over the set for n = (cos, sin) of `angle` [rad]; same shape, unit of the set."""

    @property
    @abstractmethod
    def extent(self) -> float:
        """No point of the set is further from the origin; so neither h nor |dh/dangle| is greater."""

    @property
    @abstractmethod
    def inscribed(self) -> float:
        """A disc of this radius around the origin lies in the set: h is never less."""

    @property
    def kinks(self) -> Array:
        """(k,) [rad], where h is not differentiable."""
        return np.empty(0)


@dataclass(frozen=True)
class Disc(Shape):
    """Around the origin."""

    radius: float

    def support(self, angle: Array) -> Array:
        return np.full_like(angle, self.radius)

    @property
    def extent(self) -> float:
        return self.radius

    @property
    def inscribed(self) -> float:
        return self.radius


@dataclass(frozen=True)
class Ellipse(Shape):
    """Along the axes, its centre ahead of the origin: h = c cos + sqrt(A^2 cos^2 + B^2 sin^2)."""

    centre: float  # c, 0 <= c <= A
    long: float  # A
    wide: float  # B

    def support(self, angle: Array) -> Array:
        cos = np.cos(angle)
        return np.asarray(self.centre * cos + np.hypot(self.long * cos, self.wide * np.sin(angle)))

    def _distance(self, cosine: float) -> float:
        """Of the boundary point (c + A C, B S) from the origin, C = cos and S = sin of its parameter."""
        return math.hypot(self.centre + self.long * cosine, self.wide * math.sqrt(1.0 - cosine * cosine))

    @cached_property
    def _turning(self) -> float:
        """C where (c + A C)^2 + B^2 (1 - C^2), a parabola in C, turns: c A / (B^2 - A^2), cut at -1 and 1."""
        bend = (self.wide - self.long) * (self.wide + self.long)
        return min(1.0, max(-1.0, self.centre * self.long / bend)) if bend != 0.0 else 1.0

    @property
    def extent(self) -> float:
        return max(self._distance(cosine) for cosine in (-1.0, 1.0, self._turning))

    @property
    def inscribed(self) -> float:
        return min(self._distance(cosine) for cosine in (-1.0, 1.0, self._turning))


@dataclass(frozen=True)
class Straight(Shape):
    """The segment from the origin to the point 1 ahead."""

    def support(self, angle: Array) -> Array:
        return np.maximum(np.cos(angle), 0.0)

    @property
    def extent(self) -> float:
        return 1.0

    @property
    def inscribed(self) -> float:
        return 0.0

    @property
    def kinks(self) -> Array:
        return np.array([-0.5 * math.pi, 0.5 * math.pi])


@dataclass(frozen=True)
class Box(Shape):
    """A rectangle along the axes, around the origin."""

    long: float  # half its length
    wide: float  # half its width

    def support(self, angle: Array) -> Array:
        return np.asarray(self.long * np.abs(np.cos(angle)) + self.wide * np.abs(np.sin(angle)))

    @property
    def extent(self) -> float:
        return math.hypot(self.long, self.wide)

    @property
    def inscribed(self) -> float:
        return min(self.long, self.wide)

    @property
    def kinks(self) -> Array:
        return 0.5 * math.pi * np.arange(-2.0, 2.0)


class Hull(Shape):
    """A convex polygon."""

    def __init__(self, vertices: ArrayLike) -> None:
        """Take the hull of points (n, 2) that enclose an area and the origin."""
        hull = shapely.MultiPoint(np.asarray(vertices, dtype=float)).convex_hull
        ring = shapely.get_coordinates(shapely.geometry.polygon.orient(hull))[:-1]
        edge = np.roll(ring, -1, axis=0) - ring
        normal = np.arctan2(-edge[:, 0], edge[:, 1])  # of the edge from each corner to the next
        first = int(np.argmin(normal))
        self._ring: Array = np.roll(ring, -first, axis=0)
        self._normal: Array = np.roll(normal, -first)

    def support(self, angle: Array) -> Array:
        """Of the corner between the edges whose normals enclose the angle."""
        turned = np.remainder(angle + math.pi, 2.0 * math.pi) - math.pi
        corner = self._ring[np.searchsorted(self._normal, turned) % len(self._ring)]
        return np.asarray(corner[..., 0] * np.cos(angle) + corner[..., 1] * np.sin(angle))

    @property
    def extent(self) -> float:
        return float(np.hypot(*self._ring.T).max())

    @property
    def inscribed(self) -> float:
        return max(0.0, float(self.support(self._normal).min()))

    @property
    def kinks(self) -> Array:
        return self._normal


class Measured(Shape):
    """A set whose support function is somebody else's; that it is one, and finite, is looked at."""

    def __init__(self, function: Callable[[Array], Array], kinks: ArrayLike = ()) -> None:
        """Take a function of angles [rad].

        Raises
        ------
        ValueError : not a support function of a convex set that holds the origin, at `SAMPLES` directions.

        Notes
        -----
        Derived. A set lies within its tangents at even angles d apart, whose corners are at most
        max(h) / cos(d/2) from the origin. Of a support function h(a - d) + h(a + d) >= 2 h(a) cos d, as the
        normals at a - d and a + d add up to 2 cos d times that at a. With |dh/da| <= extent, h falls by at
        most extent d/2 between the angles.
        """
        self._function = function
        self._kinks = np.asarray(kinks, dtype=float).ravel()
        even = np.linspace(-math.pi, math.pi, SAMPLES, endpoint=False)
        h = self.support(even)
        if h.shape != even.shape or not np.isfinite(h).all():
            raise ValueError("its support function is not a finite number for every angle")
        step = 2.0 * math.pi / SAMPLES
        slack = 1e-9 * (1.0 + float(np.abs(h).max()))
        if (h < -slack).any():
            raise ValueError("its support function is negative: it does not hold the robot's centre")
        if (np.roll(h, 1) + np.roll(h, -1) < 2.0 * math.cos(step) * h - slack).any():
            raise ValueError("its support function is not that of a convex set")
        self._extent = float(h.max()) / math.cos(0.5 * step)
        self._inscribed = max(0.0, float(h.min()) - self._extent * 0.5 * step)

    def support(self, angle: Array) -> Array:
        return np.asarray(self._function(np.asarray(angle, dtype=float)), dtype=float)

    @property
    def extent(self) -> float:
        return self._extent

    @property
    def inscribed(self) -> float:
        return self._inscribed

    @property
    def kinks(self) -> Array:
        return self._kinks
