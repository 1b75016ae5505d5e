"""Gains along a trajectory: Drake's regulator against Riccati's equation, and what the feedback does."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are
from systems_motions import circle, mirrored, s_curve

from systems.feedforward import demand
from systems.gains import rolling_dynamics, rolling_gains, slipping_gains
from systems.regulator import finite_horizon_gains
from systems.rolling import rolling_demand
from systems.single_track import Body
from vnav_drake.robot import Robot

ROBOT = Robot(radius=0.4)
PERIOD = 0.01


def riccati(step: np.ndarray, kick: np.ndarray, cost: np.ndarray, effort: float) -> np.ndarray:
    """Gains (n, k) by Bellman's recursion from the last sample, where the cost is that of the state alone."""
    value, found = cost, []
    for a, b in zip(step[::-1], kick[::-1, :, None], strict=True):
        gain = np.linalg.solve(effort + b.T @ value @ b, b.T @ value @ a)
        value = cost + a.T @ value @ (a - b @ gain)
        found.append(gain[0])
    return np.array(found[::-1])


def test_constant_matrices_far_from_the_end_give_the_stationary_regulator():
    # after 2000 samples the recursion has converged to the solution of the algebraic equation
    a = np.array([[1.0, 0.01], [0.05, 0.99]])
    b = np.array([0.0, 0.02])
    cost, effort = np.diag([100.0, 4.0]), 0.3
    value = solve_discrete_are(a, b[:, None], cost, [[effort]])
    expected = b @ value @ a / (effort + b @ value @ b)
    found = finite_horizon_gains(np.tile(a, (2000, 1, 1)), np.tile(b, (2000, 1)), PERIOD, cost, effort)
    assert found.shape == (2000, 2)
    np.testing.assert_allclose(found[0], expected, rtol=1e-6)


@pytest.mark.parametrize("size", [1, 3, 5])
def test_varying_matrices_give_the_gains_of_bellmans_recursion(size):
    rng = np.random.default_rng(size)
    step = np.eye(size) + 0.05 * rng.standard_normal((40, size, size))
    kick = rng.standard_normal((40, size))
    root = rng.standard_normal((size, size))
    cost, effort = root @ root.T, 0.7
    found = finite_horizon_gains(step, kick, PERIOD, cost, effort)
    np.testing.assert_allclose(found, riccati(step, kick, cost, effort), rtol=1e-9, atol=1e-12)


def test_rolling_errors_obey_the_derivatives_of_the_rolling_motion():
    # central differences of the kinematic single track about a motion along a path of curvature kappa: with
    # c = psi + beta - beta_0, e' = v sin(c) and psi' as in the code, its path's turn over (1 - kappa e)
    wheelbase, lag = 0.5, 0.02
    rng = np.random.default_rng(5)
    for _ in range(20):
        v, delta0, kappa = rng.uniform(0.2, 4.0), rng.uniform(-1.0, 1.0), rng.uniform(-1.5, 1.5)
        beta0 = np.arctan(0.5 * np.tan(delta0))

        def rate(x, v=v, delta0=delta0, kappa=kappa, beta0=beta0):
            e, psi, delta = x
            beta = np.arctan(0.5 * np.tan(delta))
            course = psi + beta - beta0
            turn = v * np.cos(beta) * np.tan(delta) / wheelbase
            along = v * kappa * np.cos(course) / (1.0 - kappa * e)
            return np.array([v * np.sin(course), turn - along, -(delta - delta0) / lag])

        base, size = np.array([0.0, 0.0, delta0]), 1e-6
        steps = size * np.eye(3)
        expected = np.stack([(rate(base + d) - rate(base - d)) / (2.0 * size) for d in steps], axis=1)
        found = rolling_dynamics(wheelbase, np.array([v]), np.array([delta0]), np.array([kappa]))[0]
        np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-6)


def test_last_gain_is_that_of_one_step():
    # one step left: minimise |A x + B u|_Q^2 + R u^2 over u
    a, b = np.array([[0.9, 0.2], [0.0, 1.1]]), np.array([0.3, 1.0])
    cost, effort = np.diag([2.0, 5.0]), 0.4
    found = finite_horizon_gains(np.tile(a, (3, 1, 1)), np.tile(b, (3, 1)), PERIOD, cost, effort)
    np.testing.assert_allclose(found[-1], b @ cost @ a / (effort + b @ cost @ b), rtol=1e-12)


def test_feedback_steers_back_to_the_path():
    # u = -K x: left of the path, or turned left, the command goes right; and less so the faster it drives, as
    # what counts is the lateral acceleration v^2 delta / l
    slow = rolling_gains(ROBOT, rolling_demand(ROBOT, circle(3.0, 0.5), PERIOD))
    fast = rolling_gains(ROBOT, rolling_demand(ROBOT, circle(3.0, 3.0), PERIOD))
    for gains in (slow, fast):
        assert (gains[:-200, :2] > 0.0).all()
    assert (fast[10, :2] < slow[10, :2]).all()


def test_loop_with_rolling_wheels_is_stable_all_along():
    # e' = v (psi + delta / 2), psi' = v delta / l, delta' = (u - delta) / tau for small angles: errors of any
    # kind die out on a motion of several seconds, computed with Euler steps of 1 ms
    v = 1.5
    motion = s_curve(start=v, end=v, cruise=v)
    gains = rolling_gains(ROBOT, rolling_demand(ROBOT, motion, PERIOD))
    x, h = np.eye(3), 1e-3
    for k in range(round(4.0 / h)):
        g = gains[min(int(k * h / PERIOD), len(gains) - 1)][[0, 1, 4]]
        rate = np.stack([v * (x[1] + 0.5 * x[2]), v * x[2] / ROBOT.wheelbase, (-g @ x - x[2]) / 0.02])
        x = x + h * rate
    assert np.abs(x).max() < 0.02


def test_gains_of_mirrored_bends_are_equal():
    # errors and command all change their sign; the square of the curvature does not
    left = circle(2.0, 1.5)
    for gains in (
        lambda m: rolling_gains(ROBOT, rolling_demand(ROBOT, m, PERIOD)),
        lambda m: slipping_gains(Body.of(ROBOT), demand(Body.of(ROBOT), m, 0.005)),
    ):
        np.testing.assert_allclose(gains(mirrored(left)), gains(left), rtol=1e-9, atol=1e-12)


def test_no_gain_is_infinite_from_rest():
    motion = s_curve(start=0.0, end=0.0, cruise=1.0)
    gains = rolling_gains(ROBOT, rolling_demand(ROBOT, motion, PERIOD))
    assert np.isfinite(gains).all()
    # at rest steering moves nothing: to ask for more than a radian for an error of 0.1 m would be noise
    assert np.abs(gains[:, 0]).max() < 10.0
