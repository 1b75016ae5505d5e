"""The three curves that Voronoi arcs and straight legs are made of, with the distance along them.

Every curve has a natural parameter u [m] and the exact distance r(u) to its nearest feature:

* LINEAR: a straight line, r = size + slope u (between two walls, borders of proximity cells, straight
  legs near a wall);
* ROOT: a straight line, r = hypot(size, u) (between two points, straight legs near a point);
* PARABOLA: focus a point, directrix a wall, r = (size^2 + u^2) / (2 size), u measured along the wall.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

LINEAR, ROOT, PARABOLA = 0, 1, 2


@dataclass(frozen=True)
class Curves:
    """Many curves at once; parameters u have shape (n,) or (n, k), one row a curve.

    A position is `origin + u axis + h(u) normal` with h = 0 for straight ones and h = r for parabolas.
    """

    kind: Indices  # (n,)
    origin: Array  # (n, 2) [m]
    axis: Array  # (n, 2) unit vectors
    normal: Array  # (n, 2) unit vectors, perpendicular to the axis
    size: Array  # (n,) [m]; PARABOLA: distance of the focus from the directrix
    slope: Array  # (n,), zero unless LINEAR
    span: Array  # (n, 2) [m], u at start and end; decreasing when traversed against the axis

    def __len__(self) -> int:
        return len(self.kind)

    def take(self, index: ArrayLike) -> Curves:
        """The curves of an index or mask array, in its order."""
        return Curves(*(getattr(self, f.name)[np.asarray(index)] for f in fields(self)))

    def cut(self, span: Array) -> Curves:
        """The same curves between other parameters (n, 2)."""
        return Curves(self.kind, self.origin, self.axis, self.normal, self.size, self.slope, span)

    @classmethod
    def join(cls, parts: list[Curves]) -> Curves:
        """One after the other."""
        return cls(*(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(cls)))

    def reversed(self, backwards: NDArray[np.bool_]) -> Curves:
        """The curves marked in `backwards` (n,) traversed from end to start."""
        return self.cut(np.where(backwards[:, None], self.span[:, ::-1], self.span))

    def distance(self, u: ArrayLike) -> Array:
        """Distance r(u) [m] to the nearest feature, of a robot without extent."""
        v, kind, size, slope = self._columns(u)
        straight = np.where(kind == LINEAR, size + slope * v, np.hypot(size, v))
        return np.where(kind == PARABOLA, _parabola_height(size, v), straight)

    def points(self, u: ArrayLike) -> Array:
        """Positions [m], shape u.shape + (2,)."""
        v, kind, size, _ = self._columns(u)
        height = np.where(kind == PARABOLA, _parabola_height(size, v), 0.0)
        shape = (len(self),) + (1,) * (v.ndim - 1) + (2,)
        origin, axis, normal = (a.reshape(shape) for a in (self.origin, self.axis, self.normal))
        return origin + v[..., None] * axis + height[..., None] * normal

    def tangents(self, u: ArrayLike) -> Array:
        """Unit vectors in the direction of travel, shape u.shape + (2,)."""
        v, kind, size, _ = self._columns(u)
        rise = np.where(kind == PARABOLA, v / np.where(kind == PARABOLA, size, 1.0), 0.0)
        shape = (len(self),) + (1,) * (v.ndim - 1) + (2,)
        axis, normal = self.axis.reshape(shape), self.normal.reshape(shape)
        sign = self._direction.reshape(shape[:-1])
        return (sign / np.hypot(1.0, rise))[..., None] * (axis + rise[..., None] * normal)

    def curvature(self, u: ArrayLike) -> Array:
        """Curvature [1/m] in the direction of travel, left turns positive; same shape as u."""
        v, kind, size, _ = self._columns(u)
        p = np.where(kind == PARABOLA, size, 1.0)
        side = self.axis[:, 0] * self.normal[:, 1] - self.axis[:, 1] * self.normal[:, 0]
        sign = (self._direction * side).reshape(kind.shape)
        return np.where(kind == PARABOLA, sign / (p * (1.0 + (v / p) ** 2) ** 1.5), 0.0)

    def arc_length(self, u: ArrayLike) -> Array:
        """Signed arc length [m] from u = 0 in the direction of the axis; same shape as u."""
        v, kind, size, _ = self._columns(u)
        p = np.where(kind == PARABOLA, size, 1.0)
        x = v / p
        return np.where(kind == PARABOLA, 0.5 * p * (x * np.hypot(1.0, x) + np.arcsinh(x)), v)

    def at_arc_length(self, s: ArrayLike) -> Array:
        """Parameter u at signed arc length s [m] from u = 0 (inverse of `arc_length`)."""
        length, kind, size, _ = self._columns(s)
        p = np.where(kind == PARABOLA, size, 1.0)
        goal = 2.0 * length / p
        x = np.sign(goal) * np.minimum(np.abs(goal) / 2.0, np.sqrt(np.abs(goal)))
        for _round in range(8):  # Newton; the function is convex for x > 0 and the guess above its root
            x = x - (x * np.hypot(1.0, x) + np.arcsinh(x) - goal) / (2.0 * np.hypot(1.0, x))
        return np.where(kind == PARABOLA, x * p, length)

    @property
    def length(self) -> Array:
        """(n,) [m]"""
        s = self.arc_length(self.span)
        return np.abs(s[:, 1] - s[:, 0])

    @property
    def ends(self) -> Array:
        """(n, 2, 2) [m], start and end positions."""
        return self.points(self.span)

    @property
    def middle(self) -> Array:
        """(n,) parameter halfway between the ends."""
        return 0.5 * (self.span[:, 0] + self.span[:, 1])

    @property
    def least_distance_at(self) -> Array:
        """(n,) parameter at which the distance is least; an end, or u = 0 inside."""
        low, high = self.span.min(axis=1), self.span.max(axis=1)
        at_end = np.where(self.distance(low) <= self.distance(high), low, high)
        return np.where(self.has_interior_minimum, 0.0, at_end)

    @property
    def least_distance(self) -> Array:
        """(n,) [m]"""
        return self.distance(self.least_distance_at)

    @property
    def has_interior_minimum(self) -> NDArray[np.bool_]:
        """(n,) whether the distance is least strictly between the ends (a saddle of clearance)."""
        return (self.kind != LINEAR) & (self.span.min(axis=1) < 0.0) & (self.span.max(axis=1) > 0.0)

    @property
    def _direction(self) -> Array:
        return np.where(self.span[:, 1] >= self.span[:, 0], 1.0, -1.0)

    def _columns(self, u: ArrayLike) -> tuple[Array, Indices, Array, Array]:
        v = np.asarray(u, dtype=float)
        shape = (len(self),) + (1,) * (v.ndim - 1)
        return v, self.kind.reshape(shape), self.size.reshape(shape), self.slope.reshape(shape)


def _parabola_height(p: Array, u: Array) -> Array:
    return (p * p + u * u) / (2.0 * np.where(p > 0.0, p, 1.0))


def linear(start: Array, end: Array, distance_start: Array, distance_end: Array) -> Curves:
    """Straight curves (n, 2) to (n, 2) [m] along which the distance is linear."""
    step = end - start
    length = np.hypot(step[:, 0], step[:, 1])
    axis = step / length[:, None]
    return Curves(
        np.full(len(start), LINEAR),
        start,
        axis,
        _left(axis),
        np.asarray(distance_start, dtype=float),
        (distance_end - distance_start) / length,
        np.column_stack([np.zeros(len(start)), length]),
    )


def near_point(start: Array, end: Array, point: Array) -> Curves:
    """Straight curves (n, 2) to (n, 2) whose nearest feature is `point` (n, 2), not on the line."""
    axis = end - start
    axis = axis / np.hypot(axis[:, 0], axis[:, 1])[:, None]
    normal = _left(axis)
    offset = np.einsum("ij,ij->i", start - point, normal)
    along = np.column_stack([np.einsum("ij,ij->i", q - point, axis) for q in (start, end)])
    origin = point + offset[:, None] * normal
    return Curves(
        np.full(len(start), ROOT), origin, axis, normal, np.abs(offset), np.zeros(len(start)), along
    )


def between_points(start: Array, end: Array, one: Array, other: Array) -> Curves:
    """Bisectors of points `one` and `other` (n, 2), from near `start` to near `end` (n, 2)."""
    gap = other - one
    width = np.hypot(gap[:, 0], gap[:, 1])
    axis = _left(gap / width[:, None])
    axis = axis * _sign(np.einsum("ij,ij->i", end - start, axis))[:, None]
    origin = 0.5 * (one + other)
    along = np.column_stack([np.einsum("ij,ij->i", q - origin, axis) for q in (start, end)])
    return Curves(
        np.full(len(start), ROOT), origin, axis, _left(axis), 0.5 * width, np.zeros(len(start)), along
    )


def point_and_wall(start: Array, end: Array, point: Array, wall: Array, direction: Array) -> Curves:
    """Parabolas with focus `point` and the line through `wall` (all (n, 2)) as directrix."""
    axis = direction * _sign(np.einsum("ij,ij->i", end - start, direction))[:, None]
    normal = _left(axis)
    height = np.einsum("ij,ij->i", point - wall, normal)
    normal = normal * _sign(height)[:, None]
    size = np.abs(height)
    origin = point - size[:, None] * normal
    along = np.column_stack([np.einsum("ij,ij->i", q - origin, axis) for q in (start, end)])
    return Curves(np.full(len(start), PARABOLA), origin, axis, normal, size, np.zeros(len(start)), along)


def empty() -> Curves:
    """No curves."""
    none, pair = np.zeros(0), np.zeros((0, 2))
    return Curves(np.zeros(0, dtype=np.int64), pair, pair, pair, none, none, pair)


def _left(v: Array) -> Array:
    return np.column_stack([-v[:, 1], v[:, 0]])


def _sign(x: Array) -> Array:
    return np.where(x < 0.0, -1.0, 1.0)
