"""How long a stopping distance fits, for many places, features and headings, and the pace that follows.

Derived. For a heading theta the set of places q from which a zone with stopping distance s touches a convex
feature f is f (+) (-s R(theta) E) (+) disc. These sets grow concavely in s (Minkowski sums of convex sets),
so the greatest stopping distance D_f(q, theta) that keeps clear of f is convex in q. 1/V as a function of it
is convex and falls, so it lies above its tangents: for every w > 0

    1/V(q, theta) >= 1/w + s(w) (D(w) - D_f(q, theta)),    s(w) = a_b / (w^2 (w + a_b t_r)),

and on a triangle above the affine interpolant of the right side's values at the corners (see `minorant`).
"""

from __future__ import annotations

import json
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from vnav_drake.lower_bound.features import Features
from vnav_drake.lower_bound.minorant import CAP, FURTHEST, Choice, Law, choose
from vnav_drake.lower_bound.shape import Shape, body_radius, shape_of
from vnav_drake.problem import Problem
from vnav_drake.zones.convex_zone import ConvexZone, GaugeZone
from vnav_drake.zones.touch import slope_zero

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

STEPS = 9  # of the search for the direction in which a corner is touched
CANDIDATES = 4  # features that a triangle chooses from
CHUNK = 2**19  # stopping distances at once


@dataclass(frozen=True)
class ZoneLaw:
    """The speed that a zone allows: its shape, the disc that it is around, and the law of braking."""

    shape: Shape
    reach: float  # [m], of the robot's disc with its margin
    law: Law  # of the stopping distance: level zero
    extent: float  # radius of a disc that holds the shape

    def rooms(self, table: Array, points: Array, heading: Array) -> Array:
        """Greatest stopping distance [m] that keeps clear of features.

        Parameters
        ----------
        table : (n, 5) [m], features. points : (n, 2) [m]. heading : (n, h) [rad].

        Returns
        -------
        (n, h), zero where the disc itself touches.
        """
        found = np.empty(heading.shape)
        step = max(1, CHUNK // max(1, heading.shape[1]))
        for k in range(0, len(points), step):
            rows = slice(k, k + step)
            found[rows] = self._rooms(table[rows], points[rows], heading[rows])
        return found

    def _rooms(self, table: Array, points: Array, heading: Array) -> Array:
        first, last = table[:, :2] - points, table[:, 2:4] - points
        reach = self.reach + table[:, 4]
        along = last - first
        length = np.hypot(along[:, 0], along[:, 1])
        wall = length > 0.0
        unit = along / np.where(wall, length, 1.0)[:, None]
        across = np.stack([-unit[:, 1], unit[:, 0]], axis=1)
        offset = np.einsum("ni,ni->n", first, across)
        across *= np.where(offset < 0.0, -1.0, 1.0)[:, None]
        beside = np.stack([-across[:, 1], across[:, 0]], axis=1)
        h, slope = self.shape.support(np.arctan2(across[:, 1], across[:, 0])[:, None] - heading)
        room = np.maximum(np.abs(offset) - reach, 0.0)[:, None] / h
        touch = room * slope  # where on the line, along `beside`
        ends = np.stack([np.einsum("ni,ni->n", end, beside) for end in (first, last)])
        low, high = ends.argmin(axis=0), ends.argmax(axis=0)
        below, above = touch < ends.min(axis=0)[:, None], touch > ends.max(axis=0)[:, None]
        outside = below | above | ~wall[:, None]
        row, column = np.nonzero(outside)
        end = np.where(below[row, column], low[row], high[row])
        corner = np.where(end[:, None] == 0, first[row], last[row])
        room[row, column] = self._to_points(corner, reach[row], heading[row, column])
        return room

    def _to_points(self, points: Array, reach: Array, heading: Array) -> Array:
        """The same for single points (n, 2) [m] from the centre, one heading (n,) each."""
        far = np.hypot(points[:, 0], points[:, 1])
        around = reach > 0.0
        shift = np.zeros_like(points)
        rows = np.flatnonzero(around & (far > reach))
        if rows.size:
            n = self._touched(points[rows], far[rows], reach[rows], heading[rows])
            shift[rows] = reach[rows, None] * np.stack([np.cos(n), np.sin(n)], axis=1)
        inside = far <= reach
        shift[inside] = points[inside]
        x, y = (points - shift).T
        cos, sin = np.cos(heading), np.sin(heading)
        return self.shape.gauge(cos * x + sin * y, cos * y - sin * x)

    def _touched(self, points: Array, far: Array, reach: Array, heading: Array) -> Array:
        """Direction (n,) in which (n.p - reach) / h(n) is greatest (searched, not to the end)."""
        towards = np.arctan2(points[:, 1], points[:, 0])
        half = np.arccos(reach / far)
        body = towards - heading

        def slope(turn: Array) -> Array:
            h, dh = self.shape.support(body + turn)
            return np.asarray(-far * np.sin(turn) * h - (far * np.cos(turn) - reach) * dh)

        return towards + slope_zero(slope, -half, half, STEPS)

    def nearest(
        self, features: Features, points: Array, heading: Array, beyond: Array, count: int
    ) -> Indices:
        """The features that stop a robot first at points (n, 2) [m] with a heading (n,): (n, count) rows.

        Those up to `beyond` (n,) [m] farther than needed for the place itself are looked at, too; where there
        are fewer than `count`, the last repeats.
        """
        close = features.nearest(points)
        room = self.rooms(features.table[close], points, heading[:, None])[:, 0]
        far = self.reach + self.extent * room + beyond
        row, which = features.within(points, far)
        row, which = np.concatenate([np.arange(len(points)), row]), np.concatenate([close, which])
        key = np.unique(row * len(features.table) + which)
        row, which = key // len(features.table), key % len(features.table)
        room = self.rooms(features.table[which], points[row], heading[row][:, None])[:, 0]
        order = np.lexsort((room, row))
        row, which = row[order], which[order]
        begin = np.searchsorted(row, np.arange(len(points)))
        many = np.bincount(row, minlength=len(points))
        return np.asarray(which[begin[:, None] + np.minimum(np.arange(count), many[:, None] - 1)])

    def choice(self, features: Features, corners: Array, place: Array, heading: Array) -> Choice:
        """The best two features for triangles (t, 3, 2) [m], at a place (t, 3) in them and a heading (t,)."""
        middle = corners.mean(axis=1)
        width = np.hypot(*(corners[:, 1] - corners[:, 2]).T)
        candidate = self.nearest(features, middle, heading, width, CANDIDATES)
        room = self.corner_rooms(features, corners, candidate, heading[:, None])[..., 0]
        return choose(self.law, room, candidate, place)

    def corner_rooms(self, features: Features, corners: Array, feature: Indices, heading: Array) -> Array:
        """Stopping distances [m] (t, k, 3, h) at corners (t, 3, 2) to features (t, k), headings (t, h)."""
        count, slots = feature.shape
        points = np.broadcast_to(corners[:, None], (count, slots, 3, 2)).reshape(-1, 2)
        which = np.repeat(feature.ravel(), 3)
        angles = np.repeat(heading, 3 * slots, axis=0)
        room = self.rooms(features.table[which], points, angles)
        return room.reshape(count, slots, 3, -1)

    def pace(self, features: Features, points: Array, heading: Array) -> Array:
        """1/V [s/m] at points (n, 2) [m] with a heading (n,) [rad]; infinite where the robot cannot be."""
        which = self.nearest(features, points, heading, np.zeros(len(points)), 1)[:, 0]
        room = self.rooms(features.table[which], points, heading[:, None])[:, 0]
        return self.law.slowness(room)

    def minorants(
        self, features: Features, corners: Array, choice: Choice, place: Array, heading: Array
    ) -> Array:
        """Lower bounds of 1/V [s/m] at corners (t, 2, 3, h) for both features and headings (t, h).

        For each heading the tangent touches at the stopping distance of the place (t, 3), as in `choose`;
        where the constant 1/v_max is better there, it is taken.
        """
        room = self.corner_rooms(features, corners, np.maximum(choice.feature, 0), heading)
        speed = self.contact(room, place)
        corner = self.law.tangent(speed[:, :, None], room)
        steady = 1.0 / self.law.braking.max_speed
        value = np.einsum("tkch,tc->tkh", corner, place)
        capped = (choice.feature == CAP)[..., None] | (value < steady)
        return np.asarray(np.where(capped[:, :, None], steady, corner))

    def contact(self, room: Array, place: Array) -> Array:
        """Speed [m/s] at contact (t, k, h) for stopping distances (t, k, 3, h) and places (t, 3)."""
        here = np.einsum("tkch,tc->tkh", room, place)
        touch = np.maximum(here, FURTHEST * room.max(axis=2))
        return np.asarray(np.maximum(self.law.speed(touch), self.law.slowest))


def zone_law(problem: Problem) -> ZoneLaw | None:
    """The law of a problem's zone; None where it limits no speed or does not depend on the heading.

    It limits none where it is no stopping distance times a shape, or has no disc around the robot in its
    shape.
    """
    zone = problem.zone
    if not isinstance(zone, GaugeZone) or type(zone).support is not GaugeZone.support:
        return None
    shape = shape_of(zone)
    if shape is None:
        return None
    law = Law.within(problem.braking, 0.0, problem.world.diameter)
    return ZoneLaw(shape, body_radius(zone), law, zone.extent)


def named(zone: ConvexZone) -> str:
    """Type and parameters of a zone as JSON, with what was derived of them."""
    common = {field.name for field in fields(ConvexZone)}
    own = {field.name: getattr(zone, field.name) for field in fields(zone) if field.name not in common}
    return json.dumps({"type": zone.type_name, **own}, default=str)
