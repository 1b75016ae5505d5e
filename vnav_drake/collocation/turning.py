"""How fast the steering may turn: the limit between neighbouring arcs.

A path of arcs has steps in its curvature. The steering angle is read as the line through the middles
(in time) of the arcs, so its rate between two arcs is the step over the time between their middles.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vnav_drake.collocation.blocks import Block, Layout
from vnav_drake.plan import Trajectory
from vnav_drake.robot import Robot

Array = NDArray[np.float64]
Index = NDArray[np.int64]


def steering_and_slope(robot: Robot, curvature: Array) -> tuple[Array, Array]:
    """Steering angle [rad] and its derivative by curvature [rad m]; inverse of eq. (A.1)."""
    sine = 0.5 * robot.wheelbase * curvature
    cosine = np.sqrt(1.0 - sine * sine)
    tangent = sine / cosine
    return np.arctan(2.0 * tangent), robot.wheelbase / (cosine**3 * (1.0 + 4.0 * tangent**2))


def rate_block(layout: Layout, robot: Robot, rate: float, shares: Array, first: Index) -> Block:
    """|omega_2 - omega_1| <= rate (dt_1 + dt_2) / 2 for intervals `first` and the ones after them.

    Two rows each, one a sign: +-(omega_2 - omega_1) - rate (dt_1 + dt_2)/2 <= 0.
    """
    n = len(first)
    m = n + 2
    knots = np.concatenate([first, [first[-1] + 1, first[-1] + 2]])
    f = shares[np.append(first, first[-1] + 1)]
    variables = np.concatenate([layout.theta(knots), layout.v(knots), [layout.length]])
    k = np.arange(n)
    cols = [k, k + 1, k + 2, m + k, m + k + 1, m + k + 2, np.full(n, 2 * m)]

    def evaluate(z: Array) -> tuple[Array, Array]:
        theta, v, length = z[:m], z[m : 2 * m], z[-1]
        step = f * length
        kappa = np.diff(theta) / step
        omega, slope = steering_and_slope(robot, kappa)
        total = v[1:] + v[:-1]
        half = rate * step / total  # rate dt / 2
        by_v = half / total
        allowed = half[1:] + half[:-1]
        by_theta = slope / step
        turn = omega[1:] - omega[:-1]
        one, two = by_theta[:-1], by_theta[1:]
        turn_by = [one, -one - two, two]
        turn_by_length = -(slope * kappa)[1:] / length + (slope * kappa)[:-1] / length
        slack_by = [by_v[:-1], by_v[:-1] + by_v[1:], by_v[1:], -allowed / length]
        values = [turn - allowed, -turn - allowed]
        data = []
        for sign in (1.0, -1.0):
            data += [sign * part for part in turn_by] + slack_by[:3]
            data.append(sign * turn_by_length + slack_by[3])
        return np.concatenate(values), np.concatenate(data)

    rows = np.concatenate([np.tile(k, 7), np.tile(n + k, 7)])
    return Block(
        "steering_rate",
        variables,
        rows,
        np.concatenate(cols + cols),
        evaluate,
        np.full(2 * n, -np.inf),
        np.zeros(2 * n),
    )


def greatest_steering_rate(trajectory: Trajectory, robot: Robot) -> float:
    """[rad/s], between the middles of neighbouring stretches of equal curvature."""
    kappa, t = trajectory.curvature[:-1], trajectory.t
    begins = np.concatenate([[0], 1 + np.flatnonzero(np.diff(kappa) != 0.0)])
    if len(begins) < 2:
        return 0.0
    ends = np.append(begins[1:], len(kappa))
    middle = 0.5 * (t[begins] + t[ends])
    omega, _ = steering_and_slope(robot, kappa[begins])
    return float(np.max(np.abs(np.diff(omega)) / np.diff(middle)))
