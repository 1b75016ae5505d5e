"""An affine function below the slowness 1/V on each triangle, as good as it gets where the flow is.

Derived. The speed law V(d) is concave, zero at the distance `level` from a feature, so n(l) = 1/V as a
function of the distance l to a feature is convex and decreasing: it lies above each of its tangents, and
above 1/v_max. With the speed w at the point of contact as parameter there are no square roots: the law
v t_r + v^2/(2 a_b) = l - level gives the distance l_w = level + w t_r + w^2/(2 a_b), the slope
dV/dl = a_b/(w + a_b t_r), and so

    n(l) >= 1/w - s(w) (l - l_w),    s(w) = a_b / (w^2 (w + a_b t_r)),    for every w > 0.

Without reaction time this is n(l_w) (1.5 - (l - level)/(2 (l_w - level))). Distance to a convex feature is
convex, so on a triangle it is at most the affine interpolant of its values at the corners, and as s > 0
the tangent at the interpolant is below the tangent at the distance. The true clearance is at most the
distance to any one feature, so each such affine function is below 1/V, and so is every convex combination
of them: across a ridge, where two features are equally near, a combination is better than either.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vnav_drake.braking import UniformBraking

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]

FURTHEST = 0.55  # contact at this share of the greatest distance at least: the tangent stays positive
SLOWEST = 1e-4  # of the speeds at contact, as a share of the greatest in the world: no slower one matters
WEIGHT_GRID = 2.0**-20  # weights are multiples of it, so that two of them add up to one exactly
CAP = -1  # in place of a feature: the constant 1/v_max


@dataclass(frozen=True)
class Law:
    """The braking law as a function of the distance to a feature."""

    braking: UniformBraking
    level: float  # [m], distance where the safe speed is zero
    slowest: float = 0.0  # [m/s], of tangents: any speed is valid, and a solver likes moderate numbers

    @classmethod
    def within(cls, braking: UniformBraking, level: float, size: float) -> Law:
        """The law in a world of diameter `size` [m]."""
        free = cls(braking, level)
        return cls(braking, level, SLOWEST * float(free.speed(np.array(level + 0.5 * size))))

    def speed(self, distance: Array) -> Array:
        """V [m/s] without the cap of v_max; same shape."""
        return replace(self.braking, margin=0.0, max_speed=math.inf).speed(distance - self.level)

    def slowness(self, distance: Array) -> Array:
        """1/V [s/m], infinite where the robot cannot be; same shape."""
        with np.errstate(divide="ignore"):
            return np.asarray(1.0 / np.minimum(self.speed(distance), self.braking.max_speed))

    def tangent(self, speed: Array, distance: Array) -> Array:
        """The tangent of 1/V at contact speed w [m/s] and a distance [m]; they broadcast."""
        a, t = self.braking.max_braking, self.braking.reaction_time
        contact = self.level + speed * (t + speed / (2.0 * a))
        slope = a / (speed * speed * (speed + a * t))
        return np.asarray(1.0 / speed - slope * (distance - contact))


@dataclass(frozen=True)
class Choice:
    """For each of t triangles two tangents: the best where the flow is, and one across a ridge."""

    feature: Indices  # (t, 2), row of the features, or `CAP`
    speed: Array  # (t, 2) [m/s] at the contact
    corner: Array  # (t, 2, 3) [s/m], values of both at the corners
    ridge: Mask  # (t,), whether a combination of both may be better than the first alone

    @classmethod
    def constant(cls, count: int) -> Choice:
        """The constant 1 for all triangles, with which u measures lengths."""
        return cls(
            np.full((count, 2), CAP),
            np.ones((count, 2)),
            np.ones((count, 2, 3)),
            np.zeros(count, dtype=bool),
        )

    def of(self, rows: Indices) -> Choice:
        """That of some of the triangles."""
        return Choice(self.feature[rows], self.speed[rows], self.corner[rows], self.ridge[rows])


def choose(law: Law, distance: Array, candidate: Indices, flow: Array) -> Choice:
    """The best tangents for triangles.

    Parameters
    ----------
    distance : (t, c, 3) [m], of the corners to each of c candidate features.
    candidate : (t, c), rows of the features; the same may come more than once.
    flow : (t, 3), barycentric coordinates of the place where the minorant should be good.
    """
    here = np.einsum("tck,tk->tc", distance, flow)
    furthest = law.level + FURTHEST * (distance.max(axis=2) - law.level)
    contact = np.maximum(here, furthest)
    speed = np.maximum(law.speed(contact), law.slowest)
    corner = law.tangent(speed[..., None], distance)
    value = np.einsum("tck,tk->tc", corner, flow)
    rows = np.arange(len(candidate))
    first = np.argmax(value, axis=1)
    # Another one is of use where it is the greater at some corner.
    gain = (corner - corner[rows, first][:, None]).max(axis=2)
    gain[candidate == candidate[rows, first][:, None]] = -np.inf
    second = np.argmax(np.where(gain > 0.0, value, -np.inf), axis=1)
    both = np.stack([first, second], axis=1)
    feature = np.take_along_axis(candidate, both, axis=1)
    speed = np.take_along_axis(speed, both, axis=1)
    corner = np.take_along_axis(corner, both[..., None], axis=1)
    ridge = gain[rows, second] > 0.0
    slowest = 1.0 / law.braking.max_speed
    if slowest > 0.0:
        capped = value[rows, first] < slowest
        feature[capped, 0], corner[capped, 0] = CAP, slowest
        below = ~capped & (corner[:, 0].min(axis=1) < slowest) & ~ridge
        feature[below, 1], corner[below, 1] = CAP, slowest
        ridge |= below
        ridge[capped] = (corner[capped, 1] > slowest).any(axis=1)
    return Choice(feature, speed, corner, ridge)
