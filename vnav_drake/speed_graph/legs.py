"""Legs within strips: solved in batches, and checked to stay below the ridge."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vnav_drake.arcs import leg_points, solve_legs
from vnav_drake.braking import UniformBraking
from vnav_drake.speed_graph.cells import Strips
from vnav_drake.speed_graph.members import Members, Pairs

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]

TOUCH = 1e-10  # relative: a leg this far above the ridge still counts as below it, rounding left aside
_COARSE = np.array([0.5, 0.25, 0.75])  # fractions of a leg that reject most of those that leave
_FINE = 16  # pieces into which a leg is divided for the final check
_FINE_CAPPED = 64  # with a greatest speed: such legs have stretches of different nature
_ROUNDS = 3  # of moving to the least gap between leg and ridge


def valid_legs(
    law: UniformBraking, radius: float, strips: Strips, members: Members, pairs: Pairs, clearance: Array
) -> tuple[Pairs, Array]:
    """The pairs whose legs stay in their strip, and their times [s].

    Parameters
    ----------
    clearance : (m,) [m] of the members.

    Notes
    -----
    A leg that starts below the tangent of the arc it starts on never meets that arc again: both would
    be fastest between the two points, and near one feature there is one fastest path only (its metric is
    not positively curved). So the arcs at both ends are decided by
    tangents, exactly; only arcs between them need heights. With a greatest speed arcs of the diagram need
    not be fastest there, and all legs from such places are checked by heights.
    """
    d1, d2 = clearance[pairs.first], clearance[pairs.second]
    strip = members.strip[pairs.first]
    legs = solve_legs(law, radius, strips.at_point[strip], d1, d2, pairs.span)
    capped = law.speed(clearance) >= law.max_speed
    start_free, end_free = capped[pairs.first], capped[pairs.second]
    below = legs.outward[:, 0] <= members.outward_after[pairs.first] + TOUCH
    below &= -legs.outward[:, 1] <= members.outward_before[pairs.second] + TOUCH
    below &= np.isfinite(legs.time)
    doubtful = np.flatnonzero(below & ((pairs.between > 0) | start_free | end_free) & (pairs.span > 0.0))
    below[doubtful] = _under_ridge(law, radius, strips, members, pairs.take(doubtful), clearance)
    return pairs.take(below), legs.time[below]


def _under_ridge(
    law: UniformBraking, radius: float, strips: Strips, members: Members, pairs: Pairs, clearance: Array
) -> Mask:
    """Which legs stay below the ridge all along; the least gap is found between check points too."""
    strip, theta = members.strip[pairs.first], members.theta[pairs.first]
    d1, d2 = clearance[pairs.first], clearance[pairs.second]
    at_point = strips.at_point[strip]

    def gap(rows: Indices, fraction: Array) -> Array:
        """Ridge minus leg over the ridge's distance, (k, j), at `fraction` (k, j) of legs `rows` (k,)."""
        moved, d = leg_points(law, radius, at_point[rows], d1[rows], d2[rows], pairs.span[rows], fraction)
        over = np.broadcast_to(strip[rows][:, None], moved.shape)
        height = strips.height(over, theta[rows][:, None] + moved)
        return (height - (d + radius)) / height

    keep = np.arange(len(pairs))
    keep = keep[(gap(keep, np.broadcast_to(_COARSE, (len(keep), len(_COARSE)))) >= -TOUCH).all(axis=1)]
    fine = _FINE if np.isinf(law.max_speed) else _FINE_CAPPED
    share = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, fine + 1))
    values = gap(keep, np.broadcast_to(share, (len(keep), len(share))))
    fits = (values[:, 1:-1] >= -TOUCH).all(axis=1)
    keep, values = keep[fits], values[fits]
    # where the gap has a valley between check points, follow it down
    low = np.minimum(values[:, :-2], values[:, 2:]) - values[:, 1:-1]
    drop = np.maximum(values[:, :-2], values[:, 2:]) - values[:, 1:-1]
    row, column = np.nonzero((low >= 0.0) & (values[:, 1:-1] < 2.0 * drop))
    sound = np.ones(len(keep), dtype=bool)
    left, middle, right = share[column], share[column + 1], share[column + 2]
    f_left, f_middle, f_right = values[row, column], values[row, column + 1], values[row, column + 2]
    for _round in range(_ROUNDS):
        if len(row) == 0:
            break
        spot = _vertex(left, middle, right, f_left, f_middle, f_right)
        f_spot = gap(keep[row], spot[:, None])[:, 0]
        sound[row[f_spot < -TOUCH]] = False
        inner, f_inner = np.where(f_spot < f_middle, spot, middle), np.minimum(f_spot, f_middle)
        outer, f_outer = np.where(f_spot < f_middle, middle, spot), np.maximum(f_spot, f_middle)
        before = outer < inner
        left, f_left = np.where(before, outer, left), np.where(before, f_outer, f_left)
        right, f_right = np.where(before, right, outer), np.where(before, f_right, f_outer)
        middle, f_middle = inner, f_inner
    out = np.zeros(len(pairs), dtype=bool)
    out[keep[sound]] = True
    return out


def _vertex(a: Array, b: Array, c: Array, fa: Array, fb: Array, fc: Array) -> Array:
    """Where the parabola through three points (a < b < c) is least; near b when b is not a valley."""
    p, q = (b - a) * (fb - fc), (b - c) * (fb - fa)
    below = p - q
    shift = np.divide((b - a) * p - (b - c) * q, 2.0 * below, out=np.zeros_like(b), where=np.abs(below) > 0.0)
    place = b - shift
    margin = 0.02 * (c - a)
    # a point that is tried again tells nothing
    place = np.where(np.abs(place - b) < 1e-3 * (c - a), b + np.where(c - b > b - a, margin, -margin), place)
    return np.clip(place, a, c)
