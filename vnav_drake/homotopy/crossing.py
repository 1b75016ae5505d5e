"""Where a polyline crosses segments, decided exactly for the floating-point numbers given.

Exact predicates and a symbolic shift (H. Edelsbrunner and E. P. Mucke, "Simulation of simplicity", ACM
Transactions on Graphics 9, 1990): the polyline counts as moved by (e, e^2), e positive and smaller than
anything. Then none of its vertices lies on the line of a segment and no end of a segment on the polyline,
so that two segments with a common end are crossed there once or not at all, never half.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import shapely
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

BLOCK = 32  # at most so many pieces of the polyline share one box in the search for segments near it
BLOCKS = 64  # boxes at least, if there are so many pieces: few pieces are long ones
# Relative error of a computed determinant of differences: J. R. Shewchuk, "Adaptive precision floating-point
# arithmetic and fast robust geometric predicates", Discrete & Computational Geometry 18, 1997, Sec. 4.1.
ROUNDING = (3.0 + 16.0 * 2.0**-53) * 2.0**-53


def orientation(a: Array, b: Array, c: Array) -> NDArray[np.int8]:
    """Exact sign (n,) of the turn a, b, c (n, 2): +1 to the left, -1 to the right, 0 straight on or back."""
    left = (a[:, 0] - c[:, 0]) * (b[:, 1] - c[:, 1])
    right = (a[:, 1] - c[:, 1]) * (b[:, 0] - c[:, 0])
    turn = left - right
    sign = np.sign(turn).astype(np.int8)
    for i in np.flatnonzero(np.abs(turn) <= ROUNDING * (np.abs(left) + np.abs(right))).tolist():
        ax, ay, bx, by, cx, cy = (Fraction(float(v)) for p in (a[i], b[i], c[i]) for v in p)
        exact = (ax - cx) * (by - cy) - (ay - cy) * (bx - cx)
        sign[i] = (exact > 0) - (exact < 0)
    return sign


def crossings(
    points: Array, start: Array, end: Array, tree: shapely.STRtree
) -> tuple[Indices, Array, Indices, NDArray[np.int8]]:
    """All crossings of a polyline with segments, in order along the polyline.

    Parameters
    ----------
    points : (n, 2) [m], finite; repeated points are allowed.
    start, end : (m, 2) [m], the segments; both ends differ.
    tree : of the boxes of the segments (`box_tree`).

    Returns
    -------
    Piece of the polyline (k,), fraction of it (k,) from 0 to 1, segment (k,), and +1 where the polyline goes
    from the left of its segment to the right, -1 the other way (k,).
    """
    piece, segment = _near(points, start, end, tree)
    a, b = start[segment], end[segment]
    x, y = points[piece], points[piece + 1]
    before, after = _side_of_point(a, b, x), _side_of_point(a, b, y)
    passing = before != after
    piece, segment, before = piece[passing], segment[passing], before[passing]
    a, b, x, y = a[passing], b[passing], x[passing], y[passing]
    between = _side_of_end(x, y, a) != _side_of_end(x, y, b)
    piece, segment, before = piece[between], segment[between], before[between]
    a, b, x, y = a[between], b[between], x[between], y[between]
    heights = [np.abs(_cross(b - a, p - a)) for p in (x, y)]
    total = heights[0] + heights[1]
    part = np.where(total > 0.0, heights[0] / np.where(total > 0.0, total, 1.0), 0.5)
    order = np.lexsort([part, piece])
    return piece[order], part[order], segment[order], before[order]


def box_tree(start: Array, end: Array) -> shapely.STRtree:
    """Spatial index of the boxes of segments (m, 2) to (m, 2) [m]."""
    low, high = np.minimum(start, end), np.maximum(start, end)
    return shapely.STRtree(shapely.box(low[:, 0], low[:, 1], high[:, 0], high[:, 1]))


def _near(points: Array, start: Array, end: Array, tree: shapely.STRtree) -> tuple[Indices, Indices]:
    """Pairs of a piece of the polyline and a segment whose boxes meet."""
    low, high = np.minimum(points[:-1], points[1:]), np.maximum(points[:-1], points[1:])
    count = len(low)
    if count == 0 or len(start) == 0:
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    size = min(max(count // BLOCKS, 1), BLOCK)
    first = np.arange(0, count, size)
    block_low, block_high = np.minimum.reduceat(low, first), np.maximum.reduceat(high, first)
    block, segment = tree.query(
        shapely.box(block_low[:, 0], block_low[:, 1], block_high[:, 0], block_high[:, 1])
    )
    piece = (first[block][:, None] + np.arange(size)).reshape(-1)
    segment = np.repeat(segment, size)
    real = piece < count
    piece, segment = piece[real], segment[real]
    a, b = start[segment], end[segment]
    meet = (low[piece] <= np.maximum(a, b)).all(axis=1) & (high[piece] >= np.minimum(a, b)).all(axis=1)
    return piece[meet], segment[meet]


def _side_of_point(a: Array, b: Array, x: Array) -> NDArray[np.int8]:
    """Side (n,) of the line a, b on which x + (e, e^2) lies: the sign of turn + cross(b - a, (e, e^2))."""
    sign = orientation(a, b, x)
    tie = np.where(a[:, 1] != b[:, 1], np.sign(a[:, 1] - b[:, 1]), np.sign(b[:, 0] - a[:, 0]))
    return np.where(sign == 0, tie.astype(np.int8), sign)


def _side_of_end(x: Array, y: Array, a: Array) -> NDArray[np.int8]:
    """Side (n,) of the moved line x, y on which a lies: the sign of turn - cross(y - x, (e, e^2))."""
    sign = orientation(x, y, a)
    tie = np.where(x[:, 1] != y[:, 1], np.sign(y[:, 1] - x[:, 1]), np.sign(x[:, 0] - y[:, 0]))
    return np.where(sign == 0, tie.astype(np.int8), sign)


def _cross(u: Array, v: Array) -> Array:
    return np.asarray(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0], dtype=np.float64)
