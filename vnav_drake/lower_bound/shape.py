"""The shape of a braking zone for the lower bound: its support function, its gauge, and the disc around it.

The gauge of a convex set E that holds 0 is gamma(z) = the least s with z in s E: convex, and gamma(s z) = s
gamma(z). A zone D(v) E (+) disc touches an obstacle first when D = gamma(z) for some z from its centre to the
obstacle, less a vector of the disc: **any such z bounds the stopping distance from above**, so no search
needs to be trusted.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray

from vnav_drake.zones.convex_zone import LEAST_INSCRIBED, GaugeZone
from vnav_drake.zones.shapes import EllipseZone, PolygonZone

Array = NDArray[np.float64]

SIDES = 5760  # of the polygon in a shape that is known by its support function only
INSIDE = 1.0 - 1e-5  # of that polygon is taken, as others may find another one in the same shape


class Shape(ABC):
    """A convex set E with 0 inside, in shares of the stopping distance; zero angle is straight ahead."""

    smooth = True  # whether the support function has no kinks

    @abstractmethod
    def support(self, angle: Array) -> tuple[Array, Array]:
        """How far E reaches in a direction [rad], and the slope of that; same shape."""

    @abstractmethod
    def gauge(self, x: Array, y: Array) -> Array:
        """The least s with (x, y) in s E; same shape."""


@dataclass(frozen=True)
class Ellipse(Shape):
    """Semi-axes `long` ahead and `wide` to the side around a centre ahead of 0, less than `long` away."""

    long: float
    wide: float
    centre: float

    def support(self, angle: Array) -> tuple[Array, Array]:
        cos, sin = np.cos(angle), np.sin(angle)
        root = np.hypot(self.long * cos, self.wide * sin)
        slope = (self.wide**2 - self.long**2) * sin * cos / root
        return self.centre * cos + root, slope - self.centre * sin

    def gauge(self, x: Array, y: Array) -> Array:
        """Derived: the root s >= 0 of (x/A - s k)^2 + (y/B)^2 = s^2, k = centre/A."""
        a, square = x / self.long, np.square(x / self.long) + np.square(y / self.wide)
        k = self.centre / self.long
        if k == 0.0:
            return np.sqrt(square)
        rest = (1.0 - k) * (1.0 + k)
        root = np.sqrt(np.square(a * k) + rest * square)
        ahead = a > 0.0
        with np.errstate(invalid="ignore"):
            return np.where(ahead, square / np.where(ahead, a * k + root, 1.0), (root - a * k) / rest)


@dataclass(frozen=True)
class Polygon(Shape):
    """A convex polygon with 0 inside; corners (k, 2) anticlockwise."""

    corners: Array
    smooth: bool = False

    @cached_property
    def _sides(self) -> tuple[Array, Array, Array, Array]:
        """By the angle of its first corner, sides: that angle, normal over distance; angles of normals."""
        ring = self.corners[np.argsort(np.arctan2(self.corners[:, 1], self.corners[:, 0]), kind="stable")]
        along = np.roll(ring, -1, axis=0) - ring
        normal = np.stack([along[:, 1], -along[:, 0]], axis=1)
        over = normal / np.einsum("ki,ki->k", normal, ring)[:, None]
        return np.arctan2(ring[:, 1], ring[:, 0]), over, np.arctan2(normal[:, 1], normal[:, 0]), ring

    def support(self, angle: Array) -> tuple[Array, Array]:
        _, _, normal, ring = self._sides
        order = np.argsort(normal, kind="stable")
        turned = np.remainder(angle + math.pi, 2.0 * math.pi) - math.pi
        after = np.searchsorted(normal[order], turned) - 1  # beyond this normal its side's second corner
        x, y = ring[(order[after] + 1) % len(ring)].transpose(-1, *range(np.ndim(angle)))
        cos, sin = np.cos(angle), np.sin(angle)
        return x * cos + y * sin, y * cos - x * sin

    def gauge(self, x: Array, y: Array) -> Array:
        first, over, _, _ = self._sides
        side = np.searchsorted(first, np.arctan2(y, x), side="right") - 1
        return np.asarray(over[side, 0] * x + over[side, 1] * y)


def shape_of(zone: GaugeZone) -> Shape | None:
    """The shape of a zone, or a polygon in it; None where it has no disc around 0 in it."""
    if zone.inscribed < LEAST_INSCRIBED:
        return None
    if isinstance(zone, EllipseZone):
        return Ellipse(zone.ahead - zone.centre, zone.lateral_ratio, zone.centre)
    if isinstance(zone, PolygonZone):
        return Polygon(_anticlockwise(np.asarray(zone.vertices, dtype=float)))
    angle = np.linspace(-math.pi, math.pi, SIDES, endpoint=False)
    h, slope = zone.shape(angle)
    cos, sin = np.cos(angle), np.sin(angle)
    touching = np.stack([h * cos - slope * sin, h * sin + slope * cos], axis=1)
    return Polygon(_anticlockwise(INSIDE * touching), smooth=not len(zone.kinks))


def body_radius(zone: GaugeZone) -> float:
    """Radius [m] of a disc in the zone at standstill."""
    angle = np.linspace(-math.pi, math.pi, 4 * SIDES, endpoint=False)
    return float(zone.body(angle)[0].min())


def _anticlockwise(corners: Array) -> Array:
    """The hull of points (k, 2)."""
    hull = shapely.geometry.polygon.orient(shapely.MultiPoint(corners).convex_hull)
    return np.asarray(shapely.get_coordinates(hull)[:-1])
