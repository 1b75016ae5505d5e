"""The gradient inequality in rational arithmetic: integers over powers of two, rounded only where named.

Squares of gradients, areas, numerators and denominators are exact. Rounded are the distance to a feature (up:
that lowers the minorant), each weighted tangent (down) and the slack that is reported (down), all far
below what doubles resolve. `slack` is below zero exactly where the inequality with these fails.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from verify.judge.certificate.dyadic import Dyadic
from verify.judge.certificate.minorant import Corners, Minorants
from verify.judge.certificate.signs import squared_distance

Array = NDArray[np.float64]

DISTANCE_PLACES = 96  # 2^-96 m
TANGENT_PLACES = 160  # 2^-160 s/m: tangents of 1e-9 s/m keep 40 digits
SLACK_PLACES = 80


def slack(corners: Corners, minorants: Minorants) -> Array:
    """Lower bounds of (m_i - |g_i|) / m_i at the corners (t, 3); below zero where it does not hold.

    |g| = 2 sqrt(N) / (unit D) with N = |a_j e_k - a_k e_j|^2, so |g| <= m where m >= 0 and
    R = 4 N / (m unit D)^2 <= 1. The root of R, rounded up to a multiple of a power of two, is at most 1
    exactly where R is.
    """
    square, below = _gradient_square(corners), _minorant(minorants)
    positive, still = below.sign() > 0, square.sign() == 0
    area = Dyadic(corners.twice_area.astype(object)[:, None], 0).scaled(_power(corners.unit))
    room = below * area
    divisor = room * room
    safe = Dyadic(np.where(positive, divisor.numerator, 1), divisor.places)
    ratio = square.scaled(2).over(safe, 2 * SLACK_PLACES, up=True).root_up(SLACK_PLACES)
    found = (Dyadic.of(np.ones(1)) - ratio).float_below()
    return np.where(positive, found, np.where(still & (below.sign() == 0), 0.0, -np.inf))


def _gradient_square(corners: Corners) -> Dyadic:
    """N (t, 3)."""
    own = Dyadic.of(corners.own)
    towards = Dyadic.of(corners.towards)
    ahead, back = towards[..., 0] - own, towards[..., 1] - own
    side = Dyadic.integers(corners.sides)
    x, y = (ahead * side[..., 1, i] - back * side[..., 0, i] for i in (0, 1))
    return x * x + y * y


def _minorant(minorants: Minorants) -> Dyadic:
    """Lower bounds of the minorants (t, 3) [s/m]."""
    law = minorants.limits
    count, slots = minorants.weight.shape
    total = Dyadic.integers(np.zeros((count, 3), dtype=np.int64)).scaled(-TANGENT_PLACES)
    sums = total.numerator
    steady = minorants.constant
    if math.isfinite(law.speed):
        terms = Dyadic.of(steady).over(Dyadic.of(law.speed), TANGENT_PLACES, up=False)
        sums = sums + terms.numerator.sum(axis=1)[:, None]
    triangle, slot = minorants.tangents
    terms = _tangents(minorants, triangle, slot)
    for number in range(slots):  # a triangle has one term a slot
        here = slot == number
        sums[triangle[here]] += terms.numerator[here]
    weights = Dyadic.of(minorants.weight)
    spread = Dyadic(np.maximum(weights.numerator.sum(axis=1), 1 << weights.places)[:, None], weights.places)
    divided = Dyadic(sums, TANGENT_PLACES).over(spread, TANGENT_PLACES, up=False)
    # A negative bound only gets lower by not being divided.
    return Dyadic(np.minimum(divided.numerator, sums), TANGENT_PLACES)


def _tangents(minorants: Minorants, triangle: NDArray[np.int64], slot: NDArray[np.int64]) -> Dyadic:
    """Weighted tangents (p, 3) at the corners, rounded down to `TANGENT_PLACES`."""
    law = minorants.limits
    w = Dyadic.of(minorants.speed[triangle, slot])[:, None]
    weight = Dyadic.of(minorants.weight[triangle, slot])[:, None]
    braking = Dyadic.of(law.braking)
    lag = braking * Dyadic.of(law.reaction_time)
    fixed = Dyadic.of(law.radius) + Dyadic.of(law.margin)
    far = _distances(minorants, triangle, slot)
    square = w * w
    above = Dyadic.of(1.5) * square + Dyadic.of(2.0) * lag * w + braking * (fixed - far)
    return (weight * above).over(square * (w + lag), TANGENT_PLACES, up=False)


def _distances(minorants: Minorants, triangle: NDArray[np.int64], slot: NDArray[np.int64]) -> Dyadic:
    """Distances (p, 3) [m] from the corners to the features, rounded up; each pair once."""
    feature = minorants.feature[triangle, slot]
    count = len(minorants.features)
    pairs = minorants.triangles[triangle] * count + feature[:, None]
    distinct, which = np.unique(pairs, return_inverse=True)
    points, features = minorants.points[distinct // count], minorants.features[distinct % count]
    square, divisor = squared_distance(points, features)
    gap = square.over(divisor, 2 * DISTANCE_PLACES, up=True).root_up(DISTANCE_PLACES)
    return (gap - Dyadic.of(features[:, 4]))[which.reshape(pairs.shape)]


def _power(unit: float) -> int:
    """The power of two that the unit is."""
    return math.frexp(unit)[1] - 1
