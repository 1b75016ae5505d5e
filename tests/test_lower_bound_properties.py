"""The lower bound is below whatever can be driven, and close to it where the optimum is known exactly.

Two kinds of expectations. *Below*: any motion of the variational model, any exact time, whoever found it; a
single failure would refute the bound. *Close*: the solver must not hide behind small numbers, so where the
optimum is known the gap is bounded too, generously, as the budgets here are small.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from benchmarks.random_worlds import random_problem
from tests.grid_ways import clearance_of, grid, safe_speed, time_at_most, way_on_grid
from tests.speed_graph_worlds import moved_problem, swapped
from tests.test_speed_graph_graphs import problem_in
from tests.worlds import rectangle
from vnav_drake.lower_bound import lower_bound
from vnav_drake.problem import NoPathError, PlanningError, Problem
from vnav_drake.speed_graph import speed_graph
from vnav_drake.voronoi_route import plan_voronoi_route
from vnav_drake.world import Obstacle, World, circle_obstacle

ROUNDING = 1e-9  # relative, of times by quadrature and of class optima (their own bound is 1e-11)
LAWS = [
    {},
    {"reaction_time": 0.3},
    {"margin": 0.1},
    {"max_speed": 1.4},
    {"max_braking": 2.0, "reaction_time": 0.2, "margin": 0.05, "max_speed": 1.6},
]
BUDGET = 4_000  # triangles of all programs together: two rounds, as a rule
# Worlds of benchmarks.random_worlds with a body: points, walls, rectangles and stars of all three families.
SEEDS = range(6)
HALL = [(-20.0, 0.0), (30.0, 0.0), (30.0, 40.0), (-20.0, 40.0)]


def bound(problem: Problem, budget: int = BUDGET) -> float:
    return lower_bound(problem, budget=budget).travel_time


@cache
def world_of(seed: int) -> Problem:
    return random_problem(seed, radius=0.2).problem


@cache
def bound_of(seed: int) -> float:
    return bound(world_of(seed))


@cache
def optimum_of(seed: int) -> float:
    """The fastest class's own time [s]: that of a path that can be driven, so no bound may be above it."""
    return speed_graph(world_of(seed), classes=1, with_published=False).classes[0].travel_time


# -- below whatever can be driven


@pytest.mark.parametrize("seed", SEEDS)
def test_no_plan_beats_the_bound(seed):
    below = bound_of(seed)
    route = plan_voronoi_route(world_of(seed)).details["exact_time"]
    assert below <= route * (1.0 + ROUNDING)
    assert below <= optimum_of(seed) * (1.0 + ROUNDING)
    assert optimum_of(seed) / below - 1.0 <= 0.1


@pytest.mark.parametrize("seed", SEEDS)
def test_no_way_on_a_grid_beats_the_bound(seed):
    # No planner, no solver: a graph search on a grid gives the polyline, and clearance being 1-Lipschitz a
    # time in which it can certainly be driven.
    corners = way_on_grid(world_of(seed), 50)
    assert len(corners) >= 2
    assert bound_of(seed) <= time_at_most(world_of(seed), corners)


@pytest.mark.parametrize("seed", [100, 102, 103])
def test_no_plan_of_a_point_robot_beats_the_bound(seed):
    problem = random_problem(seed, radius=0.0).problem
    best = speed_graph(problem, classes=1, with_published=False).classes[0].travel_time
    assert bound(problem) <= best * (1.0 + ROUNDING)


@pytest.mark.parametrize("seed", [0, 3, 5])
def test_fast_marching_does_not_get_there_sooner(seed):
    # The upwind scheme's time is no bound by itself, on either side: it interpolates arrival times linearly
    # between nodes and takes the slowness of the node that is reached for the whole step. Its error falls
    # with the cell, about at first order: T_h = T + O(h). So halving the cell changes it by half the error at
    # 2 h, which is the error at h, and T_h + |T_2h - T_h| is above T but for terms of higher order.
    pytest.importorskip("skfmm")
    coarse, fine = (_marched(world_of(seed), cells) for cells in (80, 160))
    assert bound_of(seed) <= fine + abs(coarse - fine)
    assert bound_of(seed) >= 0.9 * (fine - abs(coarse - fine))


def _marched(problem: Problem, cells: int) -> float:
    """Arrival time [s] at the goal by scikit-fmm, second order; the front starts as a circle of two cells."""
    import skfmm

    nodes, cell = grid(problem, cells)
    speed = safe_speed(problem, clearance_of(problem, nodes))
    around = np.hypot(*np.moveaxis(nodes - problem.start.point, -1, 0)) - 2.0 * cell
    masked = np.ma.MaskedArray(around, speed <= 0.0)
    arrival = np.ma.filled(skfmm.travel_time(masked, np.maximum(speed, 1e-12), dx=cell, order=2), np.inf)
    # from the goal's four neighbours straight to it, at the slower speed of both ends
    goal = problem.goal.point
    near = np.argsort(np.hypot(*np.moveaxis(nodes - goal, -1, 0)).ravel())[:4]
    gap = np.hypot(*(nodes.reshape(-1, 2)[near] - goal).T)
    slow = np.minimum(speed.ravel()[near], safe_speed(problem, clearance_of(problem, goal)))
    own = safe_speed(problem, clearance_of(problem, problem.start.point))
    return float((arrival.ravel()[near] + gap / slow).min() + 2.0 * cell / own)


# -- close to exact times


def straight_away(problem: Problem, near: float, far: float) -> float:
    """Time [s] from clearance `near` to `far` [m] straight away from a wall or a point.

    Derived: no motion is faster, as it takes the integral of |dd|/V(d) at least. As d = m + w t_r + w^2/(2a),
    dd/w = (t_r/w + 1/a) dw, so it takes t_r ln(w2/w1) + (w2 - w1)/a up to v_max, and the rest at v_max.
    """
    law = problem.braking
    w1, w2 = (float(safe_speed(problem, np.array(d))) for d in (near, far))
    reached = law.margin + w2 * law.reaction_time + w2**2 / (2.0 * law.max_braking)  # clearance that w2 needs
    cruise = max(0.0, far - max(near, reached)) / w2
    return law.reaction_time * math.log(w2 / w1) + (w2 - w1) / law.max_braking + cruise


@pytest.mark.parametrize("law", LAWS)
def test_straight_away_from_a_wall(law):
    problem = problem_in(World.build(HALL), (0.0, 0.8), (0.0, 5.3), 0.3, **law)
    exact = straight_away(problem, 0.5, 5.0)
    assert exact * (1.0 - 2e-3) <= bound(problem) <= exact * (1.0 + ROUNDING)


@pytest.mark.parametrize("law", LAWS)
def test_straight_away_from_a_point(law):
    # The clearance of a point at distance r is r - rho: radial motion, integral of |dr|/V(r - rho).
    world = World.build([(-20, -20), (20, -20), (20, 20), (-20, 20)], [Obstacle(((0.0, 0.0),))])
    way = np.array([0.6, 0.8])
    problem = problem_in(world, tuple(0.7 * way), tuple(4.3 * way), 0.3, **law)
    exact = straight_away(problem, 0.4, 4.0)
    assert exact * (1.0 - 2e-3) <= bound(problem) <= exact * (1.0 + ROUNDING)


def test_a_circle_is_a_disc_and_not_the_polygon_around_it():
    # From the disc of radius 1: clearance r - 1 - rho. A corner of the octagon around it is at 1/cos(pi/8) =
    # 1.082 m: were it the obstacle, the clearance at the start, in that direction, would be 0.4 - 0.082 m.
    disc = circle_obstacle((0.0, 0.0), 1.0, sides=8)
    world = World.build([(-20, -20), (20, -20), (20, 20), (-20, 20)], [disc])
    problem = problem_in(world, (1.7, 0.0), (5.3, 0.0), 0.3)
    exact = straight_away(problem, 0.4, 4.0)
    slower = straight_away(problem, 0.4 - (1.0 / math.cos(math.pi / 8.0) - 1.0), 4.0)
    found = bound(problem)
    assert exact * (1.0 - 2e-3) <= found <= exact * (1.0 + ROUNDING)
    assert found < slower * (1.0 - 1e-2)


@pytest.mark.parametrize(
    ("law", "shift"), [*((law, 0.0) for law in LAWS), (LAWS[0], 0.137), (LAWS[4], 0.137)]
)
def test_the_centre_line_of_a_corridor(law, shift):
    # Clearance is 2 - 0.5 m at most, so no motion of 14 m is faster than 14/V(1.5), and the centre line is
    # driven at that speed. Shifted, the ridge runs across triangles and no edge lies on it.
    hall = np.array([(0.0, 0.0), (24.0, 0.0), (24.0, 4.0), (0.0, 4.0)]) + shift
    problem = problem_in(
        World.build(hall), (5.0 + shift, 2.0 + shift), (19.0 + shift, 2.0 + shift), 0.5, **law
    )
    exact = 14.0 / float(safe_speed(problem, np.array(1.5)))
    assert exact * (1.0 - 1e-2) <= bound(problem) <= exact * (1.0 + ROUNDING)


def test_a_corridor_wider_than_the_speed_limit_asks_for_takes_its_length_over_that():
    # V is v_max = 1 m/s wherever clearance is above 0.5 m: on a band of 2 m about the straight way of 14 m.
    problem = problem_in(
        World.build([(0, 0), (24, 0), (24, 4), (0, 4)]), (5.0, 1.7), (19.0, 2.1), 0.5, max_speed=1.0
    )
    exact = math.hypot(14.0, 0.4)
    assert exact * (1.0 - 1e-5) <= bound(problem) <= exact * (1.0 + ROUNDING)


@pytest.mark.parametrize(("r", "angle", "braking"), [(1.5, 2.6, 1.0), (3.0, 1.1, 0.5), (0.4, 3.0, 4.0)])
def test_two_places_near_one_point(r, angle, braking):
    # Manor 2015, eq. (3.12): sqrt(2/a) |sqrt(z_T) - sqrt(z_S)| for a point robot and |angle| <= pi.
    world = World.build([(-20, -20), (20, -20), (20, 20), (-20, 20)], [Obstacle(((0.0, 0.0),))])
    goal = (r * math.cos(angle), r * math.sin(angle))
    problem = problem_in(world, (2.0, 0.0), goal, max_braking=braking)
    square = 2.0 + r - 2.0 * math.sqrt(2.0 * r) * math.cos(0.5 * angle)
    exact = math.sqrt(2.0 / braking * square)
    assert exact * (1.0 - 5e-3) <= bound(problem) <= exact * (1.0 + ROUNDING)


@pytest.mark.parametrize(
    ("c", "first", "last", "braking"), [(0.5, 0.8, 5.0, 1.0), (0.8, 0.5, 3.0, 2.0), (0.4, 2.0, 4.5, 0.5)]
)
def test_two_places_near_one_wall(c, first, last, braking):
    # Manor 2015, eq. (3.9): the cycloid x = (xi - sin xi)/(2 c^2), y = (1 - cos xi)/(2 c^2) takes
    # (xi_T - xi_S)/(c sqrt(2 a)); it is the only geodesic between its points, as curvature is negative.
    def place(xi):
        return (xi - math.sin(xi)) / (2.0 * c * c), (1.0 - math.cos(xi)) / (2.0 * c * c)

    problem = problem_in(World.build(HALL), place(first), place(last), max_braking=braking)
    exact = (last - first) / (c * math.sqrt(2.0 * braking))
    assert exact * (1.0 - 5e-3) <= bound(problem) <= exact * (1.0 + ROUNDING)


# -- invariances: the optimum is the same, so each bound is below it and near it


@pytest.mark.parametrize(
    ("angle", "shift", "mirror"),
    [(0.0, (137.3, -42.1), False), (0.5 * math.pi, (0.0, 0.0), False), (0.0, (0.0, 0.0), True)],
)
@pytest.mark.parametrize("seed", [8, 9])
def test_the_same_problem_elsewhere_has_the_same_bound(seed, angle, shift, mirror):
    moved = bound(moved_problem(world_of(seed), angle, shift, mirror))
    assert optimum_of(seed) * 0.98 <= moved <= optimum_of(seed) * (1.0 + ROUNDING)


@pytest.mark.parametrize("seed", [8])
def test_the_way_back_has_the_same_bound(seed):
    assert optimum_of(seed) * 0.98 <= bound(swapped(world_of(seed))) <= optimum_of(seed) * (1.0 + ROUNDING)


@pytest.mark.parametrize("factor", [0.01, 50.0])
def test_time_scales_with_one_over_the_root_of_braking(factor):
    # V = sqrt(2 a_b d): every motion takes 1/sqrt(factor) of the time.
    problem = world_of(8)
    scaled = bound(replace(problem, braking=replace(problem.braking, max_braking=factor))) * math.sqrt(factor)
    assert optimum_of(8) * 0.98 <= scaled <= optimum_of(8) * (1.0 + ROUNDING)


# -- at the limits


@pytest.mark.parametrize("radius", [0.0, 0.3])
def test_an_end_on_the_wall_where_no_speed_is_safe(radius):
    # The integral of dd / sqrt(2 d) from 0 to 2 is 2: V = 0 at one end, and the time is finite all the same.
    for ends in (((0.0, radius), (0.0, radius + 2.0)), ((0.0, radius + 2.0), (0.0, radius))):
        problem = problem_in(World.build(HALL), *ends, radius)
        assert 2.0 * (1.0 - 2e-2) <= bound(problem) <= 2.0 * (1.0 + ROUNDING)


def test_both_ends_on_the_wall():
    # A whole arch of the cycloid, from cusp to cusp: 2 pi/(2 c^2) = 3 m wide, in 2 pi/(c sqrt(2 a)).
    problem = problem_in(World.build(HALL), (0.0, 0.0), (3.0, 0.0))
    exact = 2.0 * math.pi / (math.sqrt(math.pi / 3.0) * math.sqrt(2.0))
    assert exact * (1.0 - 6e-2) <= bound(problem) <= exact * (1.0 + ROUNDING)


@pytest.mark.parametrize(
    ("start", "radius"), [((0.0, 0.2), 0.3), ((-25.0, 5.0), 0.3), ((2.5, 2.5), 0.3), ((2.5, 2.5), 0.0)]
)
def test_an_end_where_the_robot_cannot_be_is_refused(start, radius):
    # too near a wall, outside the boundary, within an obstacle: with a body and without
    world = World.build(HALL, [rectangle(1.0, 1.0, 3.0, 3.0)])
    with pytest.raises(PlanningError):
        lower_bound(problem_in(world, start, (0.0, 9.0), radius), budget=BUDGET)
    with pytest.raises(PlanningError):
        lower_bound(problem_in(world, (0.0, 9.0), start, radius), budget=BUDGET)


@pytest.mark.parametrize(
    ("barrier", "radius"),
    [
        (Obstacle(((5.0, 0.0), (5.0, 4.0))), 0.3),  # a wall right across
        (Obstacle(((5.0, 0.0), (5.0, 3.5))), 0.3),  # a gap of 0.5 m for a robot of 0.6 m
        (rectangle(4.5, 0.0, 1.0, 4.0), 0.0),  # a block, for a point
    ],
)
def test_a_goal_out_of_reach_has_no_bound(barrier, radius):
    world = World.build([(0, 0), (10, 0), (10, 4), (0, 4)], [barrier])
    with pytest.raises(NoPathError):
        lower_bound(problem_in(world, (2.0, 2.0), (8.0, 2.0), radius), budget=12_000)


def test_a_part_of_the_floor_that_cannot_be_reached_does_no_harm():
    # The wall parts the hall; on the start's side it is as if the hall ended there.
    whole = World.build([(0, 0), (20, 0), (20, 4), (0, 4)], [Obstacle(((12.0, 0.0), (12.0, 4.0)))])
    half = World.build([(0, 0), (12, 0), (12, 4), (0, 4)])
    parts, alone = (problem_in(world, (2.0, 1.0), (9.0, 2.5), 0.3) for world in (whole, half))
    best = speed_graph(alone, classes=1, with_published=False).classes[0].travel_time
    for problem in (parts, alone):
        assert best * 0.99 <= bound(problem) <= best * (1.0 + ROUNDING)


def test_a_robot_that_barely_fits():
    # A gap of 0.601 m for a robot of 0.6 m, between walls that end there: V = sqrt(2 * 0.0005) = 0.032 m/s.
    walls = [Obstacle(((5.0, 0.0), (5.0, 2.0))), Obstacle(((5.0, 2.601), (5.0, 4.0)))]
    world = World.build([(0, 0), (10, 0), (10, 4), (0, 4)], walls)
    problem = problem_in(world, (2.0, 2.0), (8.0, 2.0), 0.3)
    best = speed_graph(problem, classes=1, with_published=False).classes[0].travel_time
    assert best * 0.8 <= bound(problem, 12_000) <= best * (1.0 + ROUNDING)


def test_a_point_robot_is_not_bounded_by_the_way_through_a_thin_wall():
    # V vanishes on the wall only: a curve with |q'| <= V gets through in 2 sqrt(2 * 1 / a_b), from 1 m before
    # it to 1 m behind. No motion does, as it keeps clear of the wall, so more can be proven.
    world = World.build(HALL, [Obstacle(((-10.0, 10.0), (10.0, 10.0)))])
    problem = problem_in(world, (0.0, 9.0), (0.0, 11.0))
    through = 2.0 * math.sqrt(2.0)
    round_it = speed_graph(problem, classes=1, with_published=False).classes[0].travel_time
    assert 2.0 * through < bound(problem) <= round_it * (1.0 + ROUNDING)
