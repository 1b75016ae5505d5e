"""Smooth curves as circular arcs, which is what paths are made of."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def biarcs(points: Array, tangents: Array) -> tuple[Array, Array, Array, Array]:
    """Two circular arcs between each two points (n + 1, 2) [m], tangent to unit vectors (n + 1, 2) there.

    Returns starts (2 n, 2) [m], headings [rad] there, curvatures [1/m] and lengths [m], all (2 n,). The arcs
    have equal tangent lengths d. Standard: d solves 2 (1 - t0.t1) d^2 + 2 v.(t0 + t1) d = v.v, v the chord.
    """
    t0, t1 = tangents[:-1], tangents[1:]
    chord = np.diff(points, axis=0)
    both = np.einsum("ij,ij->i", chord, t0 + t1)
    apart = np.einsum("ij,ij->i", t0 - t1, t0 - t1)  # 2 (1 - t0.t1)
    square = np.einsum("ij,ij->i", chord, chord)
    d = square / (both + np.sqrt(both * both + apart * square))
    middle = 0.5 * (points[:-1] + points[1:] + d[:, None] * (t0 - t1))
    starts = np.stack([points[:-1], middle], axis=1).reshape(-1, 2)
    ends = np.stack([middle, points[1:]], axis=1).reshape(-1, 2)
    step = ends - starts
    chord_length = np.hypot(step[:, 0], step[:, 1])
    # the first arc is tangent to t0 at its start, the second to t1 at its end
    tangent = np.stack([t0, t1], axis=1).reshape(-1, 2)
    cross = tangent[:, 0] * step[:, 1] - tangent[:, 1] * step[:, 0]
    half = np.arctan2(cross, np.einsum("ij,ij->i", tangent, step))  # half the turn; its sign at a start
    half[1::2] = -half[1::2]
    length = chord_length / np.sinc(half / np.pi)
    heading = np.arctan2(tangent[:, 1], tangent[:, 0])
    heading[1::2] -= 2.0 * half[1::2]
    return starts, heading, 2.0 * half / length, length
