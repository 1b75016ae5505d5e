"""Which side of a line a point is on, without rounding: all numbers are doubles, hence fractions."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Signs = NDArray[np.int64]

_UNSURE = 16.0 * float(np.finfo(np.float64).eps)  # relative: more than all roundings of the product


def side_of(a: Array, b: Array, points: Array) -> Signs:
    """Side of the line from a to b on which points are, all (..., 2): 1 left, -1 right, 0 on it.

    They broadcast; what floating point cannot decide is decided with fractions.
    """
    a, b, points = np.broadcast_arrays(a, b, points)
    one = (b[..., 0] - a[..., 0]) * (points[..., 1] - a[..., 1])
    two = (b[..., 1] - a[..., 1]) * (points[..., 0] - a[..., 0])
    sign = np.sign(one - two).astype(np.int64)
    unsure = np.argwhere(np.abs(one - two) <= _UNSURE * (np.abs(one) + np.abs(two)))
    for where in map(tuple, unsure):
        value = orientation(a[where], b[where], points[where])
        sign[where] = (value > 0) - (value < 0)
    return sign


def orientation(a: Array, b: Array, point: Array) -> Fraction:
    """Twice the signed area of a triangle, three points (2,)."""
    (ax, ay), (bx, by), (px, py) = (map(Fraction, map(float, p)) for p in (a, b, point))
    return (bx - ax) * (py - ay) - (by - ay) * (px - ax)


def within_ends(a: Array, b: Array, points: Array) -> NDArray[np.bool_]:
    """Whether points on the line through a and b, (n, 2) each, lie between them or on them."""
    low, high = np.minimum(a, b), np.maximum(a, b)
    return np.asarray(((low <= points) & (points <= high)).all(axis=-1))
