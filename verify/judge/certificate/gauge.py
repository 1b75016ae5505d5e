"""The gauge of a zone's shape, never too small: the least s with z in s E, for E as the scenario has it.

gamma(z) = max over n of n.z / h(n) is convex and grows with the length of z, gamma(s z) = s gamma(z). For a
set that is known by its support function h alone, a polygon inside is taken: between two directions a support
function lies above the continuations of the sinusoids through its values to the left and to the right of them
(the line through two tangents' common point supports no point beyond it), so it is at least the greater of
both. That needs h to be the support function of a convex set, which `zones.shapes` looks at and nothing here
proves.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from verify.judge.zones import Shape
from verify.judge.zones import shapes as sets

Array = NDArray[np.float64]

DIRECTIONS = 5760  # in which a set of unknown form is asked
LEAST_INSIDE = 1e-6  # share of the stopping distance: with less around the centre the gauge is no number
NEAR = 1e-6  # share of a step: where continuations meet that near an end, the end is enough
ROUNDING = 1e-12  # relative, that a set is taken smaller: far more than all roundings here


class Gauge(ABC):
    """Of a convex set with the origin inside."""

    inscribed: float  # a disc of this radius around the origin lies in E

    @abstractmethod
    def __call__(self, x: Array, y: Array) -> Array:
        """An upper bound of the least s with (x, y) in s E, but for rounding; same shape."""

    @abstractmethod
    def touch(self, angle: Array) -> tuple[Array, Array]:
        """The point of E that is farthest in a direction [rad]; only looked at, never relied on."""


@dataclass(frozen=True)
class EllipseGauge(Gauge):
    """((x - c)/A)^2 + (y/B)^2 <= 1 with |c| < A."""

    centre: float
    long: float
    wide: float
    inscribed: float

    def __call__(self, x: Array, y: Array) -> Array:
        """The root s >= 0 of (x/A - s c/A)^2 + (y/B)^2 = s^2, without cancellation."""
        u, k = x / self.long, self.centre / self.long
        square = u * u + np.square(y / self.wide)
        root = np.sqrt(np.square(u * k) + (1.0 - k * k) * square)
        forward = u * k > 0.0
        return np.where(
            forward, square / np.where(forward, u * k + root, 1.0), (root - u * k) / (1.0 - k * k)
        ) * (1.0 + ROUNDING)

    def touch(self, angle: Array) -> tuple[Array, Array]:
        cos, sin = np.cos(angle), np.sin(angle)
        root = np.hypot(self.long * cos, self.wide * sin)
        return self.centre + self.long**2 * cos / root, self.wide**2 * sin / root


class FacetGauge(Gauge):
    """All p with n_j.p <= h_j: angles of the n_j rising, h_j positive."""

    def __init__(self, angle: Array, reach: Array) -> None:
        """Take normals' angles (k,) [rad] and distances (k,), three or more all around."""
        # n.z / h is greatest for a corner of the hull of the n / h: other facets are not needed, and would
        # make the sectors below ambiguous where several meet in one corner.
        over = np.stack([np.cos(angle), np.sin(angle)], axis=1) / reach[:, None]
        hull = shapely.geometry.polygon.orient(shapely.MultiPoint(over).convex_hull)
        over = shapely.get_coordinates(hull)[:-1]
        turn = np.arctan2(over[:, 1], over[:, 0])
        order = np.argsort(turn)
        self._angle, self._over = turn[order], over[order]
        self.inscribed = float(reach.min())
        following = np.roll(self._over, -1, axis=0)
        # Where facets j and j + 1 meet both n.p / h are 1.
        cross = self._over[:, 0] * following[:, 1] - self._over[:, 1] * following[:, 0]
        self._corner = (
            np.stack([following[:, 1] - self._over[:, 1], self._over[:, 0] - following[:, 0]], axis=1)
            / cross[:, None]
        )
        turn = np.arctan2(self._corner[:, 1], self._corner[:, 0])
        self._begin = int(np.argmin(turn))
        self._turn = np.roll(turn, -self._begin)

    def __call__(self, x: Array, y: Array) -> Array:
        """The greatest n.z / h of the facet in whose sector z lies and of those beside it."""
        found = np.searchsorted(self._turn, np.arctan2(y, x)) + self._begin
        best = np.full(np.shape(x), 0.0)
        for beside in (-1, 0, 1):
            over = self._over[(found + beside) % len(self._over)]
            best = np.maximum(best, over[..., 0] * x + over[..., 1] * y)
        return best * (1.0 + ROUNDING)

    def touch(self, angle: Array) -> tuple[Array, Array]:
        turned = np.remainder(angle + math.pi, 2.0 * math.pi) - math.pi
        corner = self._corner[np.searchsorted(self._angle, turned) - 1]
        return corner[..., 0], corner[..., 1]


def gauge_of(shape: Shape) -> Gauge | None:
    """The gauge of a shape, or of a polygon in it; None where there is no disc around the origin in it."""
    if isinstance(shape, sets.Disc):
        return EllipseGauge(0.0, shape.radius, shape.radius, shape.radius)
    if isinstance(shape, sets.Ellipse):
        behind = shape.long - shape.centre
        inside = shape.inscribed
        return None if behind < LEAST_INSIDE else EllipseGauge(shape.centre, shape.long, shape.wide, inside)
    if shape.inscribed < LEAST_INSIDE:
        return None
    if isinstance(shape, sets.Hull):
        normal: Array = np.unique(shape.kinks)
        return FacetGauge(normal, shape.support(normal))
    return _inside(shape)


def _inside(shape: Shape) -> FacetGauge:
    """A polygon in a set of which only the support function is known."""
    step = 2.0 * math.pi / DIRECTIONS
    angle: Array = -math.pi + step * np.arange(DIRECTIONS, dtype=float)
    h = shape.support(angle) * (1.0 - ROUNDING)
    before, after, beyond = np.roll(h, 1), np.roll(h, -1), np.roll(h, -2)
    # Where the continuation from the left, h at first, meets that from the right, `after` at last.
    first = h - (2.0 * math.cos(step) * after - beyond)
    last = (2.0 * math.cos(step) * h - before) - after
    turn = np.arctan2(first * math.sin(step), first * math.cos(step) - last)
    meet = (h * np.sin(step + turn) - before * np.sin(turn)) / math.sin(step)
    between = (turn > NEAR * step) & (turn < (1.0 - NEAR) * step)
    return FacetGauge(
        np.concatenate([angle, (angle + turn)[between]]),
        np.concatenate([h, meet[between] * (1.0 - ROUNDING)]),
    )
