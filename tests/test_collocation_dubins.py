"""Dubins paths end where they should, and lead to loops that no path along obstacles shows."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vnav_drake.braking import UniformBraking
from vnav_drake.collocation import plan_full
from vnav_drake.collocation.dubins import WORDS, dubins_path, dubins_seeds
from vnav_drake.plan import Path
from vnav_drake.problem import End, Problem
from vnav_drake.robot import Robot
from vnav_drake.world import Obstacle, World

HALL = [(0, 0), (20, 0), (20, 20), (0, 20)]
angles = st.floats(-math.pi, math.pi)
places = st.tuples(st.floats(-5, 5), st.floats(-5, 5))


@given(places, angles, places, angles, st.floats(0.3, 3.0))
def test_every_word_that_reaches_ends_at_the_goal_pose(start, first, goal, last, radius):
    if math.dist(start, goal) < 1e-3:
        return
    for word in WORDS:
        path = dubins_path(np.array(start), first, np.array(goal), last, radius, word)
        if path is None:
            continue
        assert (path.x[-1], path.y[-1]) == pytest.approx(goal, abs=1e-6)
        assert math.remainder(path.end_heading[-1] - last, 2 * math.pi) == pytest.approx(0, abs=1e-6)
        assert np.max(np.abs(path.curvature)) <= 1 / radius + 1e-12


def test_a_half_turn_and_a_straight():
    # From (0, 0) heading east to (-3, 2) heading west, radius 1: a left half circle, then 3 m straight.
    path = dubins_path(np.zeros(2), 0.0, np.array([-3.0, 2.0]), math.pi, 1.0, "LSL")
    assert path.length == pytest.approx(math.pi + 3.0)


def problem(start, goal, obstacles=()):
    return Problem(
        world=World.build(HALL, obstacles),
        robot=Robot(radius=0.4),
        braking=UniformBraking(max_braking=1.0),
        start=start,
        goal=goal,
    )


@pytest.mark.parametrize("place", [(10.0, 10.3), (7.0, 10.0)], ids=["beside", "behind"])
def test_a_loop_is_found_in_an_empty_hall(place):
    start = End(position=(10, 10), speed="rest", heading=0.0)
    goal = End(position=place, speed="rest", heading=0.0)
    plan = plan_full(problem(start, goal), Path.polyline([start.position, place]), effort="quick")
    rows = plan.trajectory
    assert math.remainder(rows.heading[-1], 2 * math.pi) == pytest.approx(0, abs=1e-9)
    assert (rows.x[-1], rows.y[-1]) == pytest.approx(place, abs=1e-9)
    # at the least turning radius no closed loop is shorter than its circle
    assert plan.length >= 2 * math.pi / Robot(radius=0.4).max_curvature - 1e-6
    assert {row["method"] for row in plan.details["seeds"]} == {"given", "dubins"}


def test_seeds_are_clear_of_obstacles_and_only_for_headings():
    start, goal = End(position=(4, 10), heading=0.0), End(position=(16, 10), heading=0.0)
    wall = [Obstacle(((10, 4), (10, 16)))]
    assert dubins_seeds(problem(End(position=(4, 10)), End(position=(16, 10)))) == []
    assert dubins_seeds(problem(start, goal, wall)) == []
    for seed in dubins_seeds(problem(start, goal)):
        x, y, _, _ = seed.path.at(np.linspace(0, seed.path.length, 2000))
        assert np.min(problem(start, goal).clearance(np.column_stack([x, y]))) > 0
