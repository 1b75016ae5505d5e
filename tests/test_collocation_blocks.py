"""Analytic derivatives against central differences, for every constraint block."""

import numpy as np
import pytest

from vnav_drake.braking import UniformBraking
from vnav_drake.collocation.blocks import (
    Layout,
    arc_chord,
    clearance_block,
    drive_block,
    friction_block,
    geometry_block,
    lateral_block,
    sinc_and_slope,
    travel_time,
)
from vnav_drake.collocation.hermite_simpson import HermiteSimpson
from vnav_drake.collocation.turning import rate_block, steering_and_slope
from vnav_drake.convex import ConvexPieces
from vnav_drake.problem import End, Problem
from vnav_drake.robot import Robot
from vnav_drake.world import Obstacle, World

N = 7
LAYOUT = Layout(N)
SHARES = np.array([0.1, 0.2, 0.05, 0.15, 0.2, 0.1, 0.2])
RUN = np.arange(1, 6)
WORLD = World.build(
    [(-9, -9), (9, -9), (9, 9), (-9, 9)], [Obstacle(((3, 3), (5, 3), (4, 6))), Obstacle(((-4, 0),))]
)
PROBLEM = Problem(
    world=WORLD,
    robot=Robot(radius=0.3, com_height=0.5, max_steering_rate=1.0),
    braking=UniformBraking(max_braking=1.0, reaction_time=0.2, margin=0.05),
    start=End(position=(0, 0)),
    goal=End(position=(1, 1)),
)


def blocks():
    pieces = ConvexPieces.of(WORLD)
    knot = np.repeat([1, 2, 4], len(pieces.corners))
    piece = np.tile(np.arange(len(pieces.corners)), 3)
    yield geometry_block(LAYOUT, SHARES, RUN)
    yield clearance_block(LAYOUT, PROBLEM, pieces, knot, piece)
    yield drive_block(LAYOUT, PROBLEM, SHARES, RUN)
    yield friction_block(LAYOUT, PROBLEM, SHARES, RUN)
    yield lateral_block(LAYOUT, PROBLEM, SHARES, RUN)
    yield rate_block(LAYOUT, PROBLEM.robot, 1.0, SHARES, RUN)
    yield from HermiteSimpson().blocks(LAYOUT, PROBLEM, SHARES, RUN, "full", 1.0)


@pytest.mark.parametrize("block", list(blocks()), ids=lambda block: block.name)
def test_derivative_of_a_block(block):
    rng = np.random.default_rng(4)
    everything = np.concatenate(
        [
            rng.uniform(-2, 2, LAYOUT.knots),
            rng.uniform(-2, 2, LAYOUT.knots),
            rng.uniform(-1, 1, LAYOUT.knots),
            rng.uniform(0.5, 2, LAYOUT.knots),
            [6.0],
            rng.uniform(-0.6, 0.6, 2 * N + 1),
        ]
    )
    z = everything[block.variables]
    value, data = block.evaluate(z)
    assert value.shape == block.lower.shape == block.upper.shape
    step = 1e-6
    numeric = np.stack(
        [(block.evaluate(z + e)[0] - block.evaluate(z - e)[0]) / (2 * step) for e in step * np.eye(len(z))],
        axis=1,
    )
    np.testing.assert_allclose(block.jacobian(data), numeric, atol=2e-8, rtol=2e-8)


def test_travel_time_derivative():
    v, step = np.random.default_rng(0).uniform(0.5, 2, N + 1), 1e-6
    _, by_v, by_length = travel_time(v, SHARES, 6.0)
    numeric = [
        (travel_time(v + e, SHARES, 6.0)[0] - travel_time(v - e, SHARES, 6.0)[0]) / (2 * step)
        for e in step * np.eye(N + 1)
    ]
    np.testing.assert_allclose(by_v, numeric, atol=1e-8)
    longer, shorter = travel_time(v, SHARES, 6.0 + step)[0], travel_time(v, SHARES, 6.0 - step)[0]
    assert by_length == pytest.approx((longer - shorter) / (2 * step), abs=1e-8)


def test_sinc_is_smooth_across_its_series():
    x = np.array([-0.5, -1.001e-3, -0.999e-3, 0.0, 1e-9, 0.999e-3, 1.001e-3, 0.5])
    value, slope = sinc_and_slope(x)
    np.testing.assert_allclose(value, np.sinc(x / np.pi), rtol=1e-15)
    # d/dx sin(x)/x = -x/3 + x^3/30 - ..., next term x^5/840
    near = np.abs(x) < 0.01
    np.testing.assert_allclose(slope[near], (-x / 3 + x**3 / 30)[near], rtol=1e-9, atol=1e-18)


def test_chord_of_a_quarter_circle():
    # Radius 2, from heading 0 to pi/2: the chord is (2, 2).
    chord, _ = arc_chord(np.array([0.0]), np.array([np.pi / 2]), np.array([np.pi]))
    np.testing.assert_allclose(chord[:, 0], [2, 2], atol=1e-14)


def test_steering_angle_of_the_sharpest_turn():
    # At kappa = 1/r_kin the steering is omega_max, by eq. (A.1).
    robot = Robot(radius=0.4)
    angle, _ = steering_and_slope(robot, np.array([robot.max_curvature, -robot.max_curvature, 0.0]))
    np.testing.assert_allclose(angle, [0.6, -0.6, 0.0], atol=1e-14)
