"""The gradient inequality in floating point: |grad u| rounded up against the minorant rounded down.

u = 2^-53 is the unit roundoff below, and an operation on doubles returns x (1 + d), |d| <= u; n of them in
a row err by at most n u / (1 - n u) (N. Higham, "Accuracy and Stability of Numerical Algorithms", 2002,
sec. 3.1). Bounds are given with one u to spare and more, which also covers the rounding in computing them.
`hypot` is taken to be within 4 u. `TINY` covers products that underflow.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from verify.judge.certificate.minorant import Corners, Minorants

Array = NDArray[np.float64]

ROUNDING = 2.0**-53  # u
TINY = 1e-290  # far above what underflows, far below anything that counts


def slack(corners: Corners, minorants: Minorants) -> Array:
    """Lower bounds of (m_i - |g_i|) / m_i at the corners (t, 3); below zero where not shown to hold."""
    above, below = gradient_above(corners), minorant_below(minorants)
    still = above == 0.0
    room = np.where(below > 0.0, below, 1.0)
    relative = np.where(below > 0.0, (below - above) / room, np.where(still & (below == 0.0), 0.0, -np.inf))
    return np.asarray(np.where(np.isfinite(relative), relative - 4.0 * ROUNDING * np.abs(relative), relative))


def gradient_above(corners: Corners) -> Array:
    """Upper bounds of |grad u| [s/m] at the corners (t, 3).

    Both differences of controls have a relative error u, as the controls are doubles; the sides are integers
    below 2^42, hence exact. So each component of G = a_j e_k - a_k e_j (turned by a right angle) errs by
    3 u (|a_j e_k| + |a_k e_j|), taken componentwise, and G by 3 u B, B = |a_j| |e_k| + |a_k| |e_j|: 4 u
    with the rounding of B. Then |grad u| = 2 |G| / (unit D) with seven roundings more (hypot 4, the sum, D
    as a double, the quotient), which 32 u covers; the unit is a power of two.
    """
    ahead, back = (corners.towards[..., i] - corners.own for i in (0, 1))
    side = corners.sides.astype(np.float64)
    e_j, e_k = side[..., 0, :], side[..., 1, :]
    x = ahead * e_k[..., 1] - back * e_j[..., 1]
    y = back * e_j[..., 0] - ahead * e_k[..., 0]
    size = np.abs(ahead) * _length(e_k) + np.abs(back) * _length(e_j)
    area = corners.twice_area.astype(np.float64) * (0.5 * corners.unit)
    above = (np.hypot(x, y) + 4.0 * ROUNDING * size) / area[:, None] * (1.0 + 32.0 * ROUNDING)
    return np.where(size > 0.0, above + TINY, 0.0)


def minorant_below(minorants: Minorants) -> Array:
    """Lower bounds of the minorants [s/m] at the corners (t, 3).

    The numerator of a tangent is a sum of four terms with six roundings at most on the way of each, so
    8 u times the sum of their sizes is taken off; the distance was rounded up before. The denominator has
    four roundings, quotient, weight and sum K + 2, so (K + 16) u of the sum of sizes is taken off. Where
    weights sum above 1 the sum is divided by them.
    """
    law = minorants.limits
    triangle, slot = minorants.tangents
    w = minorants.speed[triangle, slot]
    weight = minorants.weight[triangle, slot]
    feature = minorants.features[minorants.feature[triangle, slot]]
    corner = minorants.points[minorants.triangles[triangle]]
    far = distance_above(corner, feature[:, None, :])  # (p, 3)
    lag = law.braking * law.reaction_time
    speedy = (1.5 * w * w + 2.0 * lag * w)[:, None]
    fixed = law.radius + law.margin
    above = speedy + law.braking * (fixed - far)
    size = speedy + law.braking * (fixed + np.abs(far))
    slowness = weight / (w * w * (w + lag))
    terms = slowness[:, None] * (above - 8.0 * ROUNDING * size)
    steady = minorants.constant / law.speed
    count, slots = minorants.weight.shape
    total = np.repeat(steady.sum(axis=1)[:, None], 3, axis=1)
    sizes = total.copy()
    for corner_number in range(3):
        total[:, corner_number] += np.bincount(triangle, terms[:, corner_number], count)
        sizes[:, corner_number] += np.bincount(triangle, np.abs(terms[:, corner_number]), count)
    below = total - (slots + 16.0) * ROUNDING * sizes - np.where(sizes > 0.0, TINY, 0.0)
    weights = minorants.weight.sum(axis=1) * (1.0 + (slots + 1.0) * ROUNDING)
    # A negative bound only gets lower by not being divided.
    return np.where(below > 0.0, below / np.maximum(weights, 1.0)[:, None] * (1.0 - 4.0 * ROUNDING), below)


def distance_above(points: Array, features: Array) -> Array:
    """Upper bounds of the distance [m] of points (..., 2) to features (..., 5) [m], radius taken off; (...).

    Any point of the segment is as far away as the segment or farther, so the foot point
    a + s b', s from 0 to 1, need not be the nearest. The vector p - a - s (b - a) errs in each component
    by u |p - a| and 3 u |b - a| and its own rounding, 4 u with that of their lengths.
    """
    from_a = points - features[..., :2]
    along = features[..., 2:4] - features[..., :2]
    length = np.einsum("...i,...i->...", along, along)
    part = np.einsum("...i,...i->...", from_a, along)
    with np.errstate(over="ignore"):
        part = np.clip(part / np.where(length > 0.0, length, 1.0), 0.0, 1.0)
    away = _length(from_a - part[..., None] * along)
    error = 4.0 * ROUNDING * (2.0 * away + _length(from_a) + _length(along)) + TINY
    radius = features[..., 4]
    gap = (away + error) - radius
    return np.asarray(gap + 2.0 * ROUNDING * np.abs(gap))


def _length(vectors: Array) -> Array:
    return np.asarray(np.hypot(vectors[..., 0], vectors[..., 1]))
