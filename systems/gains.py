"""Steering feedback along a trajectory, for a vehicle whose tyres slip and for one whose wheels roll.

Both give gains (n, 5) of the steering command on the errors of (distance left of the path [m], heading
[rad], lateral velocity [m/s], yaw rate [rad/s], steering angle [rad]).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from systems.feedforward import SlippingDemand
from systems.regulator import finite_horizon_gains
from systems.rolling import STEERING_LAG, RollingDemand
from systems.single_track import STEERING_TIME_CONSTANT, Body
from vnav_drake.robot import Robot

Array = NDArray[np.float64]

# Bryson's rule: weights are one over the square of what is acceptable
LATERAL_SCALE = 0.1  # [m]
COURSE_SCALE = 0.1  # [rad]
YAW_RATE_SCALE = 2.0  # [rad/s]
STEERING_SCALE = 0.1  # [rad]
CORRECTING_SHARE = 0.2  # of grip and tip-over limit, that corrections of a rolling vehicle should take
SLOWEST = 0.05  # [m/s]: below, curvature is not taken from yaw rate over speed
COURSE_SPEED = 0.3  # [m/s]: below, lateral velocity is not read as a change of course


def slipping_gains(body: Body, wanted: SlippingDemand) -> Array:
    """Gains (n, 5) for tyres that slip.

    Linearised about the demand with e the distance left of the path:
    e' = w + v psi, psi' = r - v kappa^2 e, m w' = -C_f (w + b r) - C_r (w - b r) + C_d delta - m v r,
    m k^2 r' = b (-C_f (w + b r) + C_r (w - b r) + C_d delta), delta' = (command - delta) / tau.
    Discretised by the trapezoidal rule, which is stable for the stiff tyres at low speed. What counts is the
    error of course, psi + w / v: it takes the place of psi in the state, so that the weights are constant.
    """
    n, h = len(wanted.speed), wanted.period
    v, b, m = wanted.speed, body.half_base, body.mass
    c_f, c_r, c_d = wanted.front_stiffness, wanted.rear_stiffness, wanted.steering_stiffness
    curvature = np.where(v > SLOWEST, wanted.yaw_rate / np.maximum(v, SLOWEST), 0.0)
    inertia = m * body.gyration_squared
    a = np.zeros((n, 5, 5))
    a[:, 0, 1], a[:, 0, 2] = v, 1.0
    a[:, 1, 0], a[:, 1, 3] = -v * curvature**2, 1.0
    a[:, 2, 2], a[:, 2, 3], a[:, 2, 4] = -(c_f + c_r) / m, b * (c_r - c_f) / m - v, c_d / m
    a[:, 3, 2], a[:, 3, 3] = b * (c_r - c_f) / inertia, -b * b * (c_f + c_r) / inertia
    a[:, 3, 4] = b * c_d / inertia
    a[:, 4, 4] = -1.0 / STEERING_TIME_CONSTANT
    servo = np.zeros((n, 5, 1))
    servo[:, 4, 0] = 1.0 / STEERING_TIME_CONSTANT
    half = np.eye(5) - 0.5 * h * a
    step = np.linalg.solve(half, np.eye(5) + 0.5 * h * a)
    kick = np.linalg.solve(half, h * servo)
    into = np.tile(np.eye(5), (n + 1, 1, 1))
    into[:-1, 1, 2] = 1.0 / np.maximum(v, COURSE_SPEED)
    into[-1] = into[-2]
    back = 2.0 * np.eye(5) - into[:-1]  # the inverse: the identity and one entry beside the diagonal
    cost = np.diag([LATERAL_SCALE**-2, COURSE_SCALE**-2, 0.0, YAW_RATE_SCALE**-2, 0.0])
    found = finite_horizon_gains(
        into[1:] @ step @ back, (into[1:] @ kick)[:, :, 0], h, cost, STEERING_SCALE**-2
    )
    return np.einsum("nk,nkj->nj", found, into[:-1])


def rolling_dynamics(wheelbase: float, v: Array, steering: Array, curvature: Array) -> Array:
    """Matrices (n, 3, 3) of the errors of (e [m], psi [rad], delta [rad]) about a rolling motion.

    v [m/s], steering [rad] and curvature of the path [1/m] are (n,). With psi and beta relative to the path's
    course the motion itself is e' = v sin(psi + beta), delta' = -delta / tau and
    psi' = v cos(beta) tan(delta) / l - v kappa cos(psi + beta) / (1 - kappa e).
    """
    tangent = np.tan(steering)
    beta = np.arctan(0.5 * tangent)
    sway = 0.5 * (1.0 + tangent**2) / (1.0 + 0.25 * tangent**2)  # d beta / d delta
    turn = (np.cos(beta) * (1.0 + tangent**2) - np.sin(beta) * tangent * sway) / wheelbase
    a = np.zeros((len(v), 3, 3))
    a[:, 0, 1], a[:, 0, 2] = v, v * sway
    a[:, 1, 0] = -v * curvature**2
    a[:, 1, 2] = v * turn
    a[:, 2, 2] = -1.0 / STEERING_LAG
    return a


def rolling_gains(robot: Robot, wanted: RollingDemand) -> Array:
    """Gains (n, 5) for wheels that roll without slip, as far as friction reaches.

    Heading and place follow the steering angle alone: with beta(delta) = atan(tan(delta) / 2) from the body
    to the direction of travel, e' = v (psi + beta), psi' = v cos(beta) tan(delta) / l - v kappa^2 e,
    delta' = (command - delta) / tau. Discretised exactly for matrices held over a sample. Steering counts by
    the lateral acceleration that it asks for, v^2 delta / l, against what grip and tip-over allow.
    """
    n, h, v = len(wanted.speed), wanted.period, wanted.speed
    a = rolling_dynamics(robot.wheelbase, v, wanted.steering, wanted.curvature)
    servo = np.array([[0.0], [0.0], [1.0 / STEERING_LAG]])
    # exp(h A) and its integral by their series: h / tau is 1/2, the ninth term is 1e-7 of the first
    term, whole, power = np.tile(np.eye(3), (n, 1, 1)), np.zeros((n, 3, 3)), np.zeros((n, 3, 3))
    for k in range(1, 9):
        whole += term / k * h
        power += term
        term = term @ a * (h / k)
    allowed = CORRECTING_SHARE * min(robot.friction_acceleration, robot.tip_acceleration)
    scale = np.minimum(STEERING_SCALE, robot.wheelbase * allowed / np.maximum(v, COURSE_SPEED) ** 2)
    cost = np.diag([LATERAL_SCALE**-2, COURSE_SCALE**-2, 0.0])
    found = finite_horizon_gains(power, scale[:, None] * (whole @ servo)[:, :, 0], h, cost, 1.0)
    gains = np.zeros((n, 5))
    gains[:, [0, 1, 4]] = scale[:, None] * found
    return gains
