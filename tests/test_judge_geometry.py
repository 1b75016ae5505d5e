"""Distances of the judge against plain formulas, and its continuous-time bound against dense sampling."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from judged import arcs_motion

from verify.judge.continuous import RESOLUTION, Need, least_margin
from verify.judge.geometry import Surroundings
from verify.judge.motion import Motion
from vnav_drake.scenario import load_scenario

SQUARE = [[-10, -10], [10, -10], [10, 10], [-10, 10]]


def test_distances_to_boundary_polygon_wall_point_and_circle():
    world = Surroundings(
        SQUARE,
        [
            np.array([[2.0, 2.0], [4.0, 2.0], [4.0, 4.0], [2.0, 4.0]]),
            np.array([[-8.0, 0.0], [-4.0, 0.0]]),
            np.array([[0.0, -5.0]]),
        ],
        [[5.0, -5.0, 1.5]],
    )
    points = [[0, 8], [3, 1], [1, 1], [-6, 1], [-3, 0], [0, -4], [5, -2], [5, -5], [3, 2.5], [12, 0]]
    # by hand: wall y=10; polygon side; its corner; wall segment, beyond its end; point; circle; its
    # centre is 1.5 inside; 0.5 inside the polygon; 2 outside the hall
    exact = [2.0, 1.0, math.sqrt(2.0), 1.0, 1.0, 1.0, 1.5, -1.5, -0.5, -2.0]
    assert world.distance(points) == pytest.approx(exact, abs=1e-12)


def test_distance_within_overlapping_polygons_is_the_deepest():
    box = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]])
    world = Surroundings(SQUARE, [box, box + np.array([1.0, 0.0])], [])
    # (3, 2) is 1 m inside the first (to x = 4) and 2 m inside the second
    assert world.distance([[3.0, 2.0]]) == pytest.approx([-2.0])


def test_boundary_distance_ignores_obstacles_and_is_negative_outside():
    world = Surroundings(SQUARE, [np.array([[0.0, 0.0]])], [])
    assert world.boundary_distance([[0.0, 1.0], [11.0, 0.0]]) == pytest.approx([9.0, -1.0])


def straight(start: tuple[float, float], end: tuple[float, float], v0: float, v1: float) -> Motion:
    heading = math.atan2(end[1] - start[1], end[0] - start[0])
    return arcs_motion(start, heading, [(math.dist(start, end), 0.0)], [v0, v1])


def test_one_row_whose_ends_are_fine_but_whose_middle_hits_a_point():
    # From (-5, 0) to (5, 0) past the point (0, 0.1): least distance 0.1 at the middle, robot radius 0.4.
    world = Surroundings(SQUARE, [np.array([[0.0, 0.1]])], [])
    least = least_margin(straight((-5, 0), (5, 0), 1.0, 1.0), world.distance, Need(constant=0.4))
    assert least.proven == pytest.approx(-0.3, abs=1e-3 * 0.3)
    assert least.proven <= least.attained
    assert (least.x, least.y, least.t) == pytest.approx((0.0, 0.0, 5.0), abs=0.1)


def test_an_arc_around_a_point_keeps_its_distance_exactly():
    # Half a circle of radius 2 about the origin: distance 2 throughout.
    world = Surroundings(SQUARE, [np.array([[0.0, 0.0]])], [])
    around = arcs_motion((2.0, 0.0), math.pi / 2, [(2.0 * math.pi, 0.5)], [1.0, 1.0])
    least = least_margin(around, world.distance, Need(constant=0.5, quadratic=0.5))
    assert least.proven == pytest.approx(2.0 - 0.5 - 0.5, abs=1.1 * RESOLUTION)


def test_an_arc_beside_a_point_is_nearest_in_its_middle():
    # Circle of radius 3 about (0, 0), point at (0, 4.5): nearest at (0, 3), 1.5 away.
    world = Surroundings(SQUARE, [np.array([[0.0, 4.5]])], [])
    arc = arcs_motion((3.0, 0.0), math.pi / 2, [(3.0 * math.pi, 1.0 / 3.0)], [1.0, 1.0])
    least = least_margin(arc, world.distance, Need(constant=0.0))
    assert least.proven == pytest.approx(1.5, abs=1.1 * RESOLUTION)
    assert (least.x, least.y) == pytest.approx((0.0, 3.0), abs=1e-2)


def test_the_reaction_distance_of_a_row_that_starts_from_rest_is_bounded_tightly():
    # v = sqrt(2 s) from rest, away from a wall on the left at clearance 2 + s: margin
    # m(s) = 2 + s - t_r v - v^2/2 = 2 - t_r sqrt(2 s) falls to 2 - t_r * 2 at s = 2 with t_r = 0.5: 1.
    world = Surroundings([[-2, -50], [90, -50], [90, 50], [-2, 50]], [], [])
    row = straight((0, 0), (2, 0), 0.0, 2.0)
    least = least_margin(row, world.distance, Need(constant=0.0, linear=0.5, quadratic=0.5))
    assert least.proven == pytest.approx(1.0, abs=1.1 * RESOLUTION)


SCENARIOS = sorted((Path(__file__).parents[1] / "scenarios").glob("*.yaml"))


@pytest.mark.parametrize("file", SCENARIOS, ids=lambda file: file.stem)
def test_planner_and_judge_measure_the_same_distances(file: Path):
    # Two independent ways: united features with exact signs there, raw vertices here. Circles are
    # exact here and polygons around them there, at most 0.054 % wider (1/cos(pi/96) - 1).
    case = load_scenario(file)
    judged = Surroundings.from_spec(case.spec.world)
    x0, y0, x1, y1 = case.problem.world.bounds
    points = np.random.default_rng(1).uniform([x0, y0], [x1, y1], (5000, 2))
    theirs, ours = case.problem.world.distance(points), judged.distance(points)
    free = (theirs > 1e-6) & (ours > 1e-6)
    assert ((theirs > 1e-6) == (ours > 1e-6)).mean() > 0.999
    slack = 5.4e-4 * judged.largest_circle
    assert (ours[free] - theirs[free] >= -1e-8).all()
    assert (ours[free] - theirs[free] <= 1e-8 + slack).all()


coordinate = st.floats(-4.0, 4.0)


@given(
    start=st.tuples(coordinate, coordinate),
    heading=st.floats(-3.2, 3.2),
    length=st.floats(0.05, 6.0),
    turn=st.floats(-6.0, 6.0),
    speeds=st.tuples(st.floats(0.0, 2.0), st.floats(0.01, 2.0)),
    points=st.lists(st.tuples(coordinate, coordinate), min_size=1, max_size=4),
    circle=st.tuples(coordinate, coordinate, st.floats(0.05, 1.0)),
    reaction=st.floats(0.0, 0.5),
)
def test_the_bound_is_never_above_dense_sampling_and_close_below_it(
    start, heading, length, turn, speeds, points, circle, reaction
):
    solid = np.array([[5.0, 5.0], [8.0, 5.0], [5.0, 8.0]])
    world = Surroundings(SQUARE, [np.array([p]) for p in points] + [solid], [circle])
    motion = arcs_motion(start, heading, [(length, turn / length)], speeds)
    need = Need(constant=0.3, linear=reaction, quadratic=0.5)
    least = least_margin(motion, world.distance, need)
    along = np.linspace(0.0, length, 3001)
    row = np.zeros(len(along), dtype=np.int64)
    sampled = world.distance(motion.position(row, along)) - need.at(motion.speed(row, along))
    # 1e-12: rounding of the sampled values themselves
    assert least.proven <= sampled.min() + 1e-12
    coarse = max(1.1 * RESOLUTION, 1.1e-3 * abs(min(least.attained, 0.0)))
    assert least.proven >= least.attained - coarse
    assert least.attained >= sampled.min() - length / 3000 * (1 + 4 * reaction + 4)  # Lipschitz, speeds <= 2
