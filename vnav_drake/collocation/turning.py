"""How fast the steering may turn: the limit between neighbouring arcs.

A path of arcs has steps in its curvature. A steering that turns at a limited rate ramps from one arc's angle
to the next; the ramp must fit into either arc, so the rate is the step over the shorter of their times.
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
    """|omega_2 - omega_1| <= rate dt_1 and <= rate dt_2 for intervals `first` and the ones after them.

    Four rows each, for either interval and either sign: +-(omega_2 - omega_1) - rate dt <= 0.
    """
    n = len(first)
    m = n + 2
    knots = np.concatenate([first, [first[-1] + 1, first[-1] + 2]])
    f = shares[np.append(first, first[-1] + 1)]
    variables = np.concatenate([layout.theta(knots), layout.v(knots), [layout.length]])
    k = np.arange(n)
    rows, cols = [], []
    for row, which in enumerate((0, 0, 1, 1)):
        rows += [row * n + k] * 6
        cols += [k, k + 1, k + 2, m + k + which, m + k + which + 1, np.full(n, 2 * m)]

    def evaluate(z: Array) -> tuple[Array, Array]:
        theta, v, length = z[:m], z[m : 2 * m], z[-1]
        step = f * length
        kappa = np.diff(theta) / step
        omega, slope = steering_and_slope(robot, kappa)
        total = v[1:] + v[:-1]
        allowed = 2.0 * rate * step / total
        slower = allowed / total
        by_theta = slope / step
        turn = omega[1:] - omega[:-1]
        turn_by = [by_theta[:-1], -by_theta[:-1] - by_theta[1:], by_theta[1:]]
        turn_by_length = (slope[:-1] * kappa[:-1] - slope[1:] * kappa[1:]) / length
        values, data = [], []
        for mine in (slice(None, -1), slice(1, None)):
            for sign in (1.0, -1.0):
                values.append(sign * turn - allowed[mine])
                data += [sign * part for part in turn_by] + [slower[mine], slower[mine]]
                data.append(sign * turn_by_length - allowed[mine] / length)
        return np.concatenate(values), np.concatenate(data)

    return Block(
        "steering_rate",
        variables,
        np.concatenate(rows),
        np.concatenate(cols),
        evaluate,
        np.full(4 * n, -np.inf),
        np.zeros(4 * n),
    )


def greatest_steering_rate(trajectory: Trajectory, robot: Robot) -> float:
    """[rad/s], each step of the steering over the shorter of the two stretches of equal curvature."""
    kappa, t = trajectory.curvature[:-1], trajectory.t
    begins = np.concatenate([[0], 1 + np.flatnonzero(np.diff(kappa) != 0.0)])
    if len(begins) < 2:
        return 0.0
    duration = np.diff(np.append(t[begins], t[-1]))
    omega, _ = steering_and_slope(robot, kappa[begins])
    return float(np.max(np.abs(np.diff(omega)) / np.minimum(duration[1:], duration[:-1])))
