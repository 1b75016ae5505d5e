"""The shortest way along Voronoi arcs, whatever time it takes."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from scipy.integrate import quad

from benchmarks.random_worlds import random_problem
from benchmarks.reproduction.two_rooms import is_upper, two_room_office
from vnav_drake.braking import UniformBraking
from vnav_drake.problem import End, NoPathError, Problem
from vnav_drake.robot import Robot
from vnav_drake.vc_method import vc_method
from vnav_drake.voronoi import build_diagram, shortest_route
from vnav_drake.voronoi.network import build_network
from vnav_drake.voronoi_route.search import routes
from vnav_drake.world import Obstacle, World


def ring(start, goal, radius=0.2):
    """A square hall of 10 m with a square pillar of 4 m in its middle."""
    pillar = Obstacle(((3.0, 3.0), (7.0, 3.0), (7.0, 7.0), (3.0, 7.0)))
    world = World.build([(0, 0), (10, 0), (10, 10), (0, 10)], [pillar])
    return Problem(
        world=world,
        robot=Robot(radius=radius),
        braking=UniformBraking(max_braking=1.0),
        start=End(position=start),
        goal=End(position=goal),
    )


def length_of(problem):
    return float(shortest_route(problem, build_diagram(problem.world, problem.robot.radius)).length.sum())


def quarter_round_the_corner():
    """Between the pillar's corner (3, 3) and the wall x = 0, from (1.5, 3) to the diagonal.

    Equal distances: x = hypot(x - 3, y - 3), so x = (9 + (y - 3)^2) / 6, dx/dy = (y - 3) / 3; on the diagonal
    x = (3 - x) sqrt(2), x = 3 sqrt(2) / (1 + sqrt(2)).
    """
    end = 3.0 * math.sqrt(2.0) / (1.0 + math.sqrt(2.0))
    return quad(lambda y: math.hypot(1.0, (y - 3.0) / 3.0), end, 3.0)[0]


def test_round_one_corner_of_a_ring():
    # Two straight pieces of 2 m and both halves of the corner.
    expected = 4.0 + 2.0 * quarter_round_the_corner()
    assert length_of(ring((1.5, 5.0), (5.0, 1.5))) == pytest.approx(expected, rel=1e-12)


def test_ends_beside_the_arcs_are_joined_straight_away_from_the_nearest_wall():
    # 0.5 m more at each end: from 1 m beside the outer wall to the middle, 1.5 m from it.
    expected = 5.0 + 2.0 * quarter_round_the_corner()
    assert length_of(ring((1.0, 5.0), (5.0, 1.0))) == pytest.approx(expected, rel=1e-12)


def test_curves_lie_end_to_end_from_start_to_goal():
    problem = ring((1.0, 5.0), (9.0, 6.0))
    ends = shortest_route(problem, build_diagram(problem.world, 0.2)).ends
    assert ends[0, 0] == pytest.approx((1.0, 5.0), abs=1e-9)
    assert ends[-1, 1] == pytest.approx((9.0, 6.0), abs=1e-9)
    assert np.allclose(ends[:-1, 1], ends[1:, 0], rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("seed", [1, 4, 6])
def test_no_simple_route_is_shorter(seed):
    problem = random_problem(seed).problem
    diagram = build_diagram(problem.world, problem.robot.radius)
    network = build_network(problem, diagram, problem.robot.radius + problem.braking.margin)
    known = [float(route.curves.length.sum()) for _, route in zip(range(300), routes(network), strict=False)]
    assert len(known) > 1
    assert length_of(problem) <= min(known) * (1.0 + 1e-12)
    if len(known) < 300:  # all of them
        assert length_of(problem) == pytest.approx(min(known), rel=1e-12)


def test_the_shortest_is_not_the_fastest():
    # Fig. 2.15: from delta = 3 on the vc-method takes the upper passage, the shortest route the lower one.
    problem = two_room_office(4.0)
    diagram = build_diagram(problem.world, problem.robot.radius)
    assert not is_upper(shortest_route(problem, diagram))
    assert is_upper(vc_method(problem, diagram).route.curves)


def test_a_robot_too_wide_is_told_where():
    # 3 m beside the pillar: a radius of 1.5 m and more does not fit through, but into the corners.
    problem = ring((1.7, 1.7), (8.3, 8.3), radius=1.6)
    diagram = build_diagram(problem.world, 1.6)
    with pytest.raises(NoPathError, match="the widest way is 3 m wide"):
        shortest_route(problem, diagram)


def test_an_end_without_room():
    problem = ring((0.1, 5.0), (5.0, 1.5))
    with pytest.raises(NoPathError, match="start"):
        shortest_route(problem, build_diagram(problem.world, 0.2))


def test_a_margin_counts_as_body():
    problem = ring((1.7, 1.7), (8.3, 8.3), radius=1.4)
    problem = dataclasses.replace(problem, braking=UniformBraking(max_braking=1.0, margin=0.2))
    diagram = build_diagram(problem.world, 1.4)
    with pytest.raises(NoPathError):
        shortest_route(problem, diagram)
