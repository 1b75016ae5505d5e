"""Constraint blocks: values and analytic sparse derivatives for runs of knots, in plain numpy.

Knot k has x, y, theta (heading) and v (speed); interval i, from knot i to i + 1, is a share f_i of the
path's length L. Everything is per block so that Drake calls Python a handful of times an
iteration, not once a knot.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vnav_drake.convex import ConvexPieces
from vnav_drake.problem import Problem

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True)
class Block:
    """`lower <= value(z) <= upper` with z = variables[columns], and dvalue/dz by (row, col)."""

    name: str
    variables: Index  # (n,), which of the program's variables
    rows: Index  # (nnz,) of the derivative
    cols: Index  # (nnz,), positions in `variables`
    evaluate: Callable[[Array], tuple[Array, Array]]  # z (n,) -> value (m,), derivative (nnz,)
    lower: Array  # (m,)
    upper: Array  # (m,)

    def jacobian(self, data: Array) -> Array:
        """Dense (m, n) from the values of the pattern."""
        dense = np.zeros((len(self.lower), len(self.variables)))
        dense[self.rows, self.cols] = data
        return dense


@dataclass(frozen=True)
class Layout:
    """Where the variables stand: x, y, theta, v of all knots, then the length L."""

    intervals: int

    @property
    def knots(self) -> int:
        return self.intervals + 1

    @property
    def size(self) -> int:
        return 4 * self.knots + 1

    @property
    def length(self) -> int:
        """Index of L."""
        return 4 * self.knots

    def x(self, k: Index | int) -> Index:
        """Indices of x at knots k; y, theta and v follow likewise."""
        return np.asarray(k, dtype=np.int64)

    def y(self, k: Index | int) -> Index:
        return np.asarray(k, dtype=np.int64) + self.knots

    def theta(self, k: Index | int) -> Index:
        return np.asarray(k, dtype=np.int64) + 2 * self.knots

    def v(self, k: Index | int) -> Index:
        return np.asarray(k, dtype=np.int64) + 3 * self.knots


def sinc_and_slope(x: Array) -> tuple[Array, Array]:
    """sin(x)/x and its derivative; series below 1e-3, where they are exact to rounding."""
    small = np.abs(x) < 1e-3
    safe = np.where(small, 1.0, x)
    square = x * x
    value = np.where(small, 1.0 - square / 6.0 * (1.0 - square / 20.0), np.sin(safe) / safe)
    slope = np.where(small, -x / 3.0 * (1.0 - square / 10.0), (np.cos(safe) - value) / safe)
    return value, slope


def arc_chord(theta0: Array, theta1: Array, ds: Array) -> tuple[Array, Array]:
    """Chord of circular arcs and its derivatives.

    Parameters
    ----------
    theta0, theta1, ds : (n,) [rad], [rad], [m], heading at both ends and arc length.

    Returns
    -------
    (2, n) [m], and (2, 3, n): by theta0, theta1, ds.
    """
    mean = 0.5 * (theta0 + theta1)
    shape, slope = sinc_and_slope(0.5 * (theta1 - theta0))
    along = np.stack([np.cos(mean), np.sin(mean)])
    across = np.stack([-along[1], along[0]])
    stretch, turn = 0.5 * slope * along, 0.5 * shape * across
    by = np.stack([ds * (turn - stretch), ds * (turn + stretch), shape * along], axis=1)
    return ds * shape * along, by


def geometry_block(layout: Layout, shares: Array, intervals: Index) -> Block:
    """p_1 - p_0 = chord of the arc from heading theta_0 to theta_1 of length f L."""
    n = len(intervals)
    knots = np.append(intervals, intervals[-1] + 1)
    k, f = np.arange(n), shares[intervals]
    variables = np.concatenate([layout.x(knots), layout.y(knots), layout.theta(knots), [layout.length]])
    m = n + 1
    last = np.full(n, 3 * m)
    rows, cols = [], []
    for axis in (0, 1):
        at = axis * m + k
        rows += [axis * n + k] * 5
        cols += [at, at + 1, 2 * m + k, 2 * m + k + 1, last]

    def evaluate(z: Array) -> tuple[Array, Array]:
        theta, length = z[2 * m : 3 * m], z[-1]
        chord, by = arc_chord(theta[:-1], theta[1:], f * length)
        step = np.stack([np.diff(z[:m]), np.diff(z[m : 2 * m])])
        ones = np.ones(n)
        data = [part for a in (0, 1) for part in (-ones, ones, -by[a, 0], -by[a, 1], -f * by[a, 2])]
        return (step - chord).ravel(), np.concatenate(data)

    zero = np.zeros(2 * n)
    return Block("geometry", variables, np.concatenate(rows), np.concatenate(cols), evaluate, zero, zero)


def clearance_block(
    layout: Layout, problem: Problem, pieces: ConvexPieces, knot: Index, piece: Index
) -> Block:
    """Signed distance from knots to pieces, less the radius, is at least the braking distance.

    One row for each pair (knot[i], piece[i]); `knot` must be sorted.
    """
    used, which = np.unique(knot, return_inverse=True)
    m, n = len(used), len(knot)
    variables = np.concatenate([layout.x(used), layout.y(used), layout.v(used)])
    row = np.arange(n)
    radius, law = problem.robot.radius, problem.braking

    def evaluate(z: Array) -> tuple[Array, Array]:
        points, v = np.stack([z[:m], z[m : 2 * m]], axis=1), z[2 * m :]
        gap, gradient = pieces.signed_distance(piece, points[which])
        value = gap - radius - law.distance(v)[which]
        return value, np.concatenate([gradient[:, 0], gradient[:, 1], -law.distance_slope(v)[which]])

    cols = np.concatenate([which, m + which, 2 * m + which])
    return Block("clearance", variables, np.tile(row, 3), cols, evaluate, np.zeros(n), np.full(n, np.inf))


def drive_block(layout: Layout, problem: Problem, shares: Array, intervals: Index) -> Block:
    """-a_b <= (v_1^2 - v_0^2) / (2 f L) <= a_max."""
    n = len(intervals)
    knots = np.append(intervals, intervals[-1] + 1)
    variables = np.append(layout.v(knots), layout.length)
    k, f = np.arange(n), shares[intervals]

    def evaluate(z: Array) -> tuple[Array, Array]:
        v, length = z[:-1], z[-1]
        step = f * length
        a = np.diff(v * v) / (2.0 * step)
        return a, np.concatenate([-v[:-1] / step, v[1:] / step, -a / length])

    robot = problem.robot
    return Block(
        "drive",
        variables,
        np.tile(k, 3),
        np.concatenate([k, k + 1, np.full(n, n + 1)]),
        evaluate,
        np.full(n, -robot.max_braking),
        np.full(n, robot.max_acceleration),
    )


def friction_block(layout: Layout, problem: Problem, shares: Array, intervals: Index) -> Block:
    """(a^2 + (v^2 kappa)^2) / (mu g)^2 <= 1 at both ends of each interval.

    Exact for the whole interval: a and kappa are constant on it and v^2 is linear.
    """
    grip = problem.robot.friction_acceleration

    def combine(a: Array, lateral: Array) -> tuple[Array, Array, Array]:
        value = (a * a + lateral * lateral) / grip**2
        return value, 2.0 * a / grip**2, 2.0 * lateral / grip**2

    return _turning_block("friction", layout, shares, intervals, combine, -np.inf, 1.0)


def lateral_block(layout: Layout, problem: Problem, shares: Array, intervals: Index) -> Block:
    """|v^2 kappa| <= tip-over limit, or the friction reserve, at both ends of each interval."""
    limit = problem.lateral_limit

    def combine(a: Array, lateral: Array) -> tuple[Array, Array, Array]:
        return lateral, np.zeros_like(a), np.ones_like(a)

    return _turning_block("lateral", layout, shares, intervals, combine, -limit, limit)


def _turning_block(
    name: str,
    layout: Layout,
    shares: Array,
    intervals: Index,
    combine: Callable[[Array, Array], tuple[Array, Array, Array]],
    lower: float,
    upper: float,
) -> Block:
    """A function of a and v^2 kappa at both ends of each interval; `combine` also gives its slopes."""
    n = len(intervals)
    m = n + 1
    knots = np.append(intervals, intervals[-1] + 1)
    variables = np.concatenate([layout.theta(knots), layout.v(knots), [layout.length]])
    k, f = np.arange(n), shares[intervals]
    one_end = [k, k + 1, m + k, m + k + 1, np.full(n, 2 * m)]

    def evaluate(z: Array) -> tuple[Array, Array]:
        theta, v, length = z[:m], z[m : 2 * m], z[-1]
        step = f * length
        a, kappa = np.diff(v * v) / (2.0 * step), np.diff(theta) / step
        values, data = [], []
        for end in (0, 1):
            speed = v[end : n + end]
            square = speed * speed
            value, by_a, by_lateral = combine(a, square * kappa)
            turn = by_lateral * square / step
            by_v = [-by_a * v[:-1] / step, by_a * v[1:] / step]
            by_v[end] = by_v[end] + 2.0 * by_lateral * speed * kappa
            by_length = -(by_a * a + by_lateral * square * kappa) / length
            values.append(value)
            data += [-turn, turn, *by_v, by_length]
        return np.concatenate(values), np.concatenate(data)

    rows = np.concatenate([np.tile(k, 5), np.tile(n + k, 5)])
    cols = np.concatenate(one_end + one_end)
    return Block(name, variables, rows, cols, evaluate, np.full(2 * n, lower), np.full(2 * n, upper))


def travel_time(v: Array, shares: Array, length: float) -> tuple[float, Array, float]:
    """Sum of 2 f L / (v_0 + v_1) [s], and its derivatives by v (n + 1,) and L."""
    total = v[1:] + v[:-1]
    pace = 2.0 * shares / total
    slope = -pace / total * length
    by_v = np.concatenate([slope, [0.0]]) + np.concatenate([[0.0], slope])
    share = float(pace.sum())
    return share * length, by_v, share
