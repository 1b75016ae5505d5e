"""On which side, how far: geometric questions about doubles, answered without rounding errors.

Where a bound of the rounding error decides a question in floating point it is decided so, the rest in
integers; with `exact` all of it in integers. Both give the same answers.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from verify.judge.certificate.dyadic import Dyadic
from verify.judge.certificate.floating import ROUNDING, TINY, distance_above

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Signs = NDArray[np.int8]


def orientation(a: Array, b: Array, c: Array, *, exact: bool) -> Signs:
    """1 where a, b, c (n, 2) turn left, -1 where right, 0 where they lie on a line; (n,).

    The filter: J. R. Shewchuk, "Adaptive precision floating-point arithmetic and fast robust geometric
    predicates", 1997, sec. 4.3: the determinant's error is at most (3 + 16 u) u of the sum of its two
    products, u the unit roundoff; 4 u here, and `TINY` for products that underflow.
    """
    left = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1])
    right = (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    twice_area = left - right
    sign = np.sign(twice_area).astype(np.int8)
    unsure = np.abs(twice_area) <= 4.0 * ROUNDING * (np.abs(left) + np.abs(right)) + TINY
    rows = np.arange(len(a)) if exact else np.flatnonzero(unsure)
    if rows.size:
        p, q, r = (Dyadic.of(points[rows]) for points in (a, b, c))
        u, w = q - p, r - p
        sign[rows] = (u[:, 0] * w[:, 1] - u[:, 1] * w[:, 0]).sign()
    return sign


def within(points: Array, features: Array, reach: float, margin: float, *, exact: bool) -> Mask:
    """Whether each point (n, 2) [m] is at most `reach + margin` from its feature (n, 5) [m]; (n,).

    `reach` and `margin` [m] are not added up in floating point, as their sum may round.
    """
    room = (reach + margin) * (1.0 - 4.0 * ROUNDING)
    near = distance_above(points, features) <= room
    rows = np.arange(len(points)) if exact else np.flatnonzero(~near)
    if rows.size:
        square, divisor = squared_distance(points[rows], features[rows])
        limit = Dyadic.of(features[rows, 4]) + Dyadic.of(reach) + Dyadic.of(margin)
        near[rows] = square.not_above(limit * limit * divisor)
    return near


def squared_distance(points: Array, features: Array) -> tuple[Dyadic, Dyadic]:
    """Squared distance of points (n, 2) [m] to the segments of features (n, 5) [m], as a quotient.

    Returns dividend and divisor (n,) each: [m^4] and [m^2] where the inside of the segment is nearest,
    [m^2] and 1 where an end is. The radius is left out.
    """
    p, a, b = Dyadic.of(points), Dyadic.of(features[:, :2]), Dyadic.of(features[:, 2:4])
    along, from_a, from_b = b - a, p - a, p - b
    part, length = _dot(along, from_a), _dot(along, along)
    before = part.sign() <= 0
    after = ~before & length.not_above(part)
    area = along[:, 0] * from_a[:, 1] - along[:, 1] * from_a[:, 0]
    square = area * area
    ends, beyond = _dot(from_a, from_a), _dot(from_b, from_b)
    return _choose(before, ends, _choose(after, beyond, square)), _divisor(before | after, length)


def _dot(u: Dyadic, w: Dyadic) -> Dyadic:
    return u[:, 0] * w[:, 0] + u[:, 1] * w[:, 1]


def _choose(mask: Mask, yes: Dyadic, no: Dyadic) -> Dyadic:
    """`yes` where the mask holds, `no` elsewhere."""
    one, other, places = yes.aligned(no)
    return Dyadic(np.where(mask, one, other), places)


def _divisor(at_end: Mask, length: Dyadic) -> Dyadic:
    return Dyadic(np.where(at_end, 1 << length.places, length.numerator), length.places)
