"""Hermite-Simpson in the path domain: the other transcription of the same program.

The curvature is a quadratic in each interval, given at its ends and middle; position and heading satisfy
Simpson's rule (Hargraves and Paris 1987; Betts 2010, sec. 4.6). Fourth order in the interval, where
arcs are of second order, but the limits on turning hold at three points only.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydrake.solvers import MathematicalProgram

from vnav_drake.collocation.blocks import Block, Layout
from vnav_drake.collocation.mesh import Mesh, chained
from vnav_drake.collocation.transcription import LIMIT_SHARE
from vnav_drake.collocation.turning import steering_and_slope
from vnav_drake.plan import Model
from vnav_drake.problem import Problem
from vnav_drake.robot import Robot

Array = NDArray[np.float64]
Index = NDArray[np.int64]

ARCS_AN_INTERVAL = 8  # of the geometry handed on: the quadratic curvature in steps of equal turn


class HermiteSimpson:
    """Extra variables: curvature at the knots (n + 1), then at the middles (n)."""

    name = "hermite_simpson"

    def extra(self, intervals: int) -> int:
        return 2 * intervals + 1

    def guess(self, mesh: Mesh) -> Array:
        kappa = np.diff(mesh.theta) / (mesh.shares * mesh.length)
        ends = np.concatenate([kappa[:1], 0.5 * (kappa[1:] + kappa[:-1]), kappa[-1:]])
        return np.concatenate([ends, kappa])

    def blocks(
        self, layout: Layout, problem: Problem, shares: Array, run: Index, model: Model, rate: float
    ) -> list[Block]:
        blocks = [_defects(layout, shares, run)]
        if model == "full":
            blocks.append(_turning(layout, problem, shares, run))
            if np.isfinite(rate):
                blocks.append(_steering_rate(layout, problem.robot, rate, shares, run))
        return blocks

    def limit_steering(
        self, prog: MathematicalProgram, z: Array, layout: Layout, problem: Problem, shares: Array
    ) -> None:
        limit = problem.robot.max_curvature * LIMIT_SHARE
        kappa = z[layout.size :]
        prog.AddBoundingBoxConstraint(np.full(len(kappa), -limit), np.full(len(kappa), limit), kappa)

    def geometry(self, mesh: Mesh, extra: Array) -> Mesh:
        n, parts = mesh.intervals, ARCS_AN_INTERVAL
        ends, middle = extra[: n + 1], extra[n + 1 :]
        s = np.arange(parts) / parts
        # integrals from 0 to s of the Lagrange polynomials of 0, 1/2 and 1
        left = s * (1.0 + s * (-1.5 + s * (2.0 / 3.0)))
        centre, right = s * s * (2.0 - s * (4.0 / 3.0)), s * s * (-0.5 + s * (2.0 / 3.0))
        turn = np.outer(ends[:-1], left) + np.outer(middle, centre) + np.outer(ends[1:], right)
        ds = mesh.shares * mesh.length
        theta = mesh.theta[:-1, None] + ds[:, None] * turn
        square = np.square(mesh.v)
        v = np.sqrt(square[:-1, None] + s * np.diff(square)[:, None])
        shares = np.repeat(mesh.shares / parts, parts)
        theta, v = np.append(theta, mesh.theta[-1]), np.append(v, mesh.v[-1])
        return chained(shares, mesh.x[0], mesh.y[0], theta, v, mesh.length)


def _curvatures(layout: Layout, run: Index) -> tuple[Index, Index]:
    """Indices of the curvature at the knots of `run`, and at its middles."""
    first = layout.size
    return first + np.append(run, run[-1] + 1), first + layout.knots + run


def _defects(layout: Layout, shares: Array, run: Index) -> Block:
    """Simpson's rule for heading and position, the middle heading by Hermite interpolation."""
    n = len(run)
    m = n + 1
    knots = np.append(run, run[-1] + 1)
    at_knots, at_middles = _curvatures(layout, run)
    variables = np.concatenate(
        [layout.x(knots), layout.y(knots), layout.theta(knots), at_knots, at_middles, [layout.length]]
    )
    k, f = np.arange(n), shares[run]
    last = np.full(n, 4 * m + n)
    turning = [3 * m + k, 3 * m + k + 1, 4 * m + k]
    cols = [2 * m + k, 2 * m + k + 1, *turning, last]
    rows = [k] * 6
    for axis in (0, 1):
        cols += [axis * m + k, axis * m + k + 1, 2 * m + k, 2 * m + k + 1, *turning[:2], last]
        rows += [(1 + axis) * n + k] * 7

    def evaluate(z: Array) -> tuple[Array, Array]:
        theta, kappa, middle, length = z[2 * m : 3 * m], z[3 * m : 4 * m], z[4 * m : 4 * m + n], z[-1]
        h = f * length
        simpson = (kappa[:-1] + 4.0 * middle + kappa[1:]) / 6.0
        bend = (kappa[:-1] - kappa[1:]) / 8.0
        centre = 0.5 * (theta[:-1] + theta[1:]) + h * bend
        one = np.ones(n)
        values = [np.diff(theta) - h * simpson]
        data = [-one, one, -h / 6.0, -h / 6.0, -4.0 * h / 6.0, -f * simpson]
        for axis, quarter in enumerate((0.0, -0.5 * np.pi)):  # sin a = cos(a - pi/2)
            at_ends, at_centre = np.cos(theta + quarter), np.cos(centre + quarter)
            slope_ends, slope_centre = -np.sin(theta + quarter), -np.sin(centre + quarter)
            mean = (at_ends[:-1] + 4.0 * at_centre + at_ends[1:]) / 6.0
            by_centre = -h * 4.0 / 6.0 * slope_centre
            values.append(np.diff(z[axis * m : (axis + 1) * m]) - h * mean)
            data += [
                -one,
                one,
                -h / 6.0 * slope_ends[:-1] + 0.5 * by_centre,
                -h / 6.0 * slope_ends[1:] + 0.5 * by_centre,
                by_centre * h / 8.0,
                -by_centre * h / 8.0,
                -f * mean + by_centre * f * bend,
            ]
        return np.concatenate(values), np.concatenate(data)

    zero = np.zeros(3 * n)
    return Block("defects", variables, np.concatenate(rows), np.concatenate(cols), evaluate, zero, zero)


def _turning(layout: Layout, problem: Problem, shares: Array, run: Index) -> Block:
    """Friction circle, then lateral limit, at both ends and the middle of each interval."""
    n = len(run)
    m = n + 1
    knots = np.append(run, run[-1] + 1)
    at_knots, at_middles = _curvatures(layout, run)
    variables = np.concatenate([layout.v(knots), at_knots, at_middles, [layout.length]])
    k, f = np.arange(n), shares[run]
    grip, limit = problem.robot.friction_acceleration, problem.lateral_limit
    bends = (m + k, 2 * m + k, m + k + 1)
    weights = ((1.0, 0.0), (0.5, 0.5), (0.0, 1.0))  # of v_0^2 and v_1^2 in v^2 there
    rows, cols = [], []
    for place, bend in enumerate(bends):
        rows += [place * n + k] * 4 + [(3 + place) * n + k] * 3
        cols += [k, k + 1, bend, np.full(n, 2 * m + n), k, k + 1, bend]

    def evaluate(z: Array) -> tuple[Array, Array]:
        v, length = z[:m], z[-1]
        step = f * length
        a = np.diff(v * v) / (2.0 * step)
        circle, sides, data = [], [], []
        for bend, (w0, w1) in zip(bends, weights, strict=True):
            square = w0 * v[:-1] ** 2 + w1 * v[1:] ** 2
            kappa = z[bend]
            lateral = square * kappa
            circle.append((a * a + lateral * lateral) / grip**2)
            sides.append(lateral / limit)
            by_a, by_lateral = 2.0 * a / grip**2, 2.0 * lateral / grip**2
            slope0, slope1 = 2.0 * w0 * v[:-1] * kappa, 2.0 * w1 * v[1:] * kappa
            data += [
                -by_a * v[:-1] / step + by_lateral * slope0,
                by_a * v[1:] / step + by_lateral * slope1,
                by_lateral * square,
                -by_a * a / length,
                slope0 / limit,
                slope1 / limit,
                square / limit,
            ]
        return np.concatenate(circle + sides), np.concatenate(data)

    lower = np.concatenate([np.full(3 * n, -np.inf), np.full(3 * n, -1.0)])
    return Block(
        "turning", variables, np.concatenate(rows), np.concatenate(cols), evaluate, lower, np.ones(6 * n)
    )


def _steering_rate(layout: Layout, robot: Robot, rate: float, shares: Array, run: Index) -> Block:
    """|omega_middle - omega_end| <= rate dt / 2, each half of an interval taking half its time."""
    n = len(run)
    m = n + 1
    knots = np.append(run, run[-1] + 1)
    at_knots, at_middles = _curvatures(layout, run)
    variables = np.concatenate([layout.v(knots), at_knots, at_middles, [layout.length]])
    k, f = np.arange(n), shares[run]
    rows, cols = [], []
    for half in (0, 1):
        for sign in (0, 1):
            rows += [(2 * half + sign) * n + k] * 5
            cols += [m + k + half, 2 * m + k, k, k + 1, np.full(n, 2 * m + n)]

    def evaluate(z: Array) -> tuple[Array, Array]:
        v, kappa, middle, length = z[:m], z[m : 2 * m], z[2 * m : 2 * m + n], z[-1]
        total = v[1:] + v[:-1]
        allowed = rate * f * length / total
        centre, centre_slope = steering_and_slope(robot, middle)
        end, end_slope = steering_and_slope(robot, kappa)
        values, data = [], []
        for half in (0, 1):
            side = slice(half, n + half)
            turn = centre - end[side]
            for sign in (1.0, -1.0):
                values.append(sign * turn - allowed)
                data += [-sign * end_slope[side], sign * centre_slope]
                data += [allowed / total, allowed / total, -allowed / length]
        return np.concatenate(values), np.concatenate(data)

    upper = np.zeros(4 * n)
    return Block(
        "steering_rate",
        variables,
        np.concatenate(rows),
        np.concatenate(cols),
        evaluate,
        np.full(4 * n, -np.inf),
        upper,
    )
