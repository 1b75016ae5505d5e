"""Collocation against exact solutions, identities and its own alternative transcription."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.optimize import brentq

from tests.worlds import moved, moved_world, rectangle
from vnav_drake.braking import UniformBraking
from vnav_drake.collocation import plan_full, plan_variational
from vnav_drake.collocation.hermite_simpson import HermiteSimpson
from vnav_drake.collocation.refine import BUDGETS, refine
from vnav_drake.collocation.seed import first_mesh, shortcut
from vnav_drake.collocation.turning import greatest_steering_rate
from vnav_drake.plan import Path
from vnav_drake.problem import End, PlanningError, Problem
from vnav_drake.robot import Robot
from vnav_drake.world import Obstacle, World

LAW = UniformBraking(max_braking=1.0)
POINT = Robot(radius=0.0, wheelbase=0.1, max_steering=1.2)
HALL = [(0, 0), (32, 0), (32, 31), (0, 31)]
RACKS = [rectangle(x, y, 10.0, 5.0) for x in (4.0, 15.0) for y in (4.0, 10.0, 16.0, 22.0)]
BOTTOM_LEFT = [(28.5, 1.9), (16.0, 2.0), (3.5, 2.0), (2.0, 3.5), (2.0, 22.0)]
# Figures of an earlier study with other methods (a cone program over a mesh bounds every path from below,
# Newton's method on the structure of the path gives the optimum of a class); not derived in this repository.
WAREHOUSE_LOWER, WAREHOUSE_OPTIMUM = 25.44124, 25.4416876


def problem(world, robot, start, goal, law=LAW):
    return Problem(world=world, robot=robot, braking=law, start=start, goal=goal)


def warehouse(robot=None, speed="safe", law=LAW):
    start, goal = End(position=(28.5, 1.9), speed=speed), End(position=(2.0, 22.0), speed=speed)
    return problem(World.build(HALL, RACKS), robot or Robot(radius=0.4), start, goal, law)


@pytest.fixture(scope="module")
def warehouse_optimum():
    return plan_variational(warehouse(), Path.polyline(BOTTOM_LEFT))


def cycloid_time(dx, y0, y1):
    """Brachistochrone along a wall: x = R (xi - sin xi), y = R (1 - cos xi); T = sqrt(R) (xi_1 - xi_0)."""

    def ends(radius):
        xi0, xi1 = (math.acos(1 - y / radius) for y in (y0, y1))
        return xi0, 2 * math.pi - xi1  # over the top

    def miss(radius):
        xi0, xi1 = ends(radius)
        return radius * (xi1 - math.sin(xi1) - xi0 + math.sin(xi0)) - dx

    radius = brentq(miss, 0.5 * max(y0, y1) + 1e-12, 50, xtol=1e-14)
    xi0, xi1 = ends(radius)
    return math.sqrt(radius) * (xi1 - xi0)


@pytest.mark.parametrize("seed", [[(0, 1), (6, 2)], [(0, 1), (0, 20), (6, 20), (6, 2)]])
def test_single_wall_is_the_cycloid(seed):
    # Speed sqrt(2 a y) is that of a body sliding down from the wall: the brachistochrone, eq. (3.9).
    exact = cycloid_time(6.0, 1.0, 2.0)
    assert exact == pytest.approx(3.1956696, abs=1e-7)
    world = World.build([(-50, 0), (50, 0), (50, 100), (-50, 100)])
    plan = plan_variational(
        problem(world, POINT, End(position=(0, 1)), End(position=(6, 2))), Path.polyline(seed)
    )
    assert exact <= plan.travel_time <= exact * (1 + 2e-5)


def test_single_point_is_a_straight_line_in_the_square_root_plane():
    # ds / sqrt(2 a |z|) = sqrt(2/a) |d sqrt(z)| is flat: T = sqrt(2/a) |sqrt z_T - sqrt z_S|.
    exact = math.sqrt(2) * abs(np.sqrt(2 - 0.5j) - np.sqrt(-1.5 + 1j))
    world = World.build([(-50, -50), (50, -50), (50, 50), (-50, 50)], [Obstacle(((0, 0),))])
    ends = End(position=(2, -0.5)), End(position=(-1.5, 1))
    plan = plan_variational(problem(world, POINT, *ends), Path.polyline([(2, -0.5), (0, 1), (-1.5, 1)]))
    assert exact <= plan.travel_time <= exact * (1 + 2e-5)


def test_corridor_runs_along_its_centre():
    # Half-width 1 m, radius 0.4 m: V = sqrt(2 * 0.6); the centre line is where the robot is fastest.
    world = World.build([(0, 0), (60, 0), (60, 2), (0, 2)])
    ends = End(position=(5, 1)), End(position=(55, 1))
    plan = plan_variational(
        problem(world, Robot(radius=0.4), *ends), Path.polyline([(5, 1), (25, 1.2), (55, 1)])
    )
    exact = 50 / math.sqrt(1.2)
    assert exact <= plan.travel_time <= exact * (1 + 2e-5)


def test_warehouse_optimum_lies_in_the_trusted_interval(warehouse_optimum):
    assert WAREHOUSE_LOWER <= warehouse_optimum.travel_time <= WAREHOUSE_OPTIMUM * (1 + 2e-5)


def test_warehouse_from_rest_to_rest():
    # From below: 25.44124 s plus what ends at rest cost at least, sqrt(2 c) (sqrt(1 + 1) - 1) each
    # (clearance c = 1.5 and 1.6 m, a_max = a_b = 1), valid for paths longer than both cut lengths.
    least = WAREHOUSE_LOWER + sum(math.sqrt(2 * c) * (math.sqrt(2) - 1) for c in (1.5, 1.6))
    plan = plan_full(warehouse(speed="rest"), Path.polyline(BOTTOM_LEFT))
    assert least <= plan.travel_time <= 27.29
    assert plan.trajectory.v[[0, -1]] == pytest.approx([0, 0])


def test_four_times_the_braking_halves_the_time(warehouse_optimum):
    # V scales with sqrt(a_b), so every travel time with 1/sqrt(a_b) (THEORY: uniform law).
    robot = Robot(radius=0.4, max_braking=4.0, max_acceleration=4.0)
    fast = warehouse(robot, law=UniformBraking(max_braking=4.0))
    time = plan_variational(fast, Path.polyline(BOTTOM_LEFT)).travel_time
    assert 2 * time == pytest.approx(warehouse_optimum.travel_time, rel=1e-6)


@pytest.mark.parametrize("angle", [0.3, 2.0])
def test_moving_the_world_changes_nothing(angle, warehouse_optimum):
    shift = (100.0, -37.0)
    world = moved_world(HALL, RACKS, angle, shift)
    start, goal = (tuple(moved(p, angle, shift).tolist()) for p in ((28.5, 1.9), (2.0, 22.0)))
    there = problem(world, Robot(radius=0.4), End(position=start), End(position=goal))
    plan = plan_variational(there, Path.polyline(moved(BOTTOM_LEFT, angle, shift)))
    assert plan.travel_time == pytest.approx(warehouse_optimum.travel_time, rel=3e-6)


def test_acceleration_along_the_optimum_is_the_braking_limit(warehouse_optimum):
    # Ray equation of the speed law inside a proximity cell: |acceleration| = a_b (Manor 2015, app. D).
    # Cells meet at ridges, where it is less; a tenth of the path near its corner is inside cells.
    path, rows = warehouse_optimum.path, warehouse_optimum.trajectory
    middle = np.cumsum(path.piece_length) - 0.5 * path.piece_length
    turning = np.abs(path.curvature) > 0.2
    assert np.count_nonzero(turning) > 10
    at = np.searchsorted(rows.arc_length, middle[turning]) - 1
    total = np.hypot(rows.a[at], rows.v[at] ** 2 * rows.curvature[at])
    assert np.median(total) == pytest.approx(1.0, rel=0.02)


def test_hermite_simpson_finds_the_same_optimum(warehouse_optimum):
    here = warehouse()
    guess = first_mesh(here, Path.polyline(BOTTOM_LEFT), 60)
    result = refine(here, guess, "variational", BUDGETS["quick"], transcription=HermiteSimpson())
    assert result.trajectory.travel_time == pytest.approx(warehouse_optimum.travel_time, rel=1e-4)
    assert result.trajectory.travel_time >= WAREHOUSE_LOWER


@pytest.mark.parametrize(
    ("robot", "name"),
    [
        (Robot(radius=0.4, friction=1 / 9.81), "slippery"),
        (Robot(radius=0.4, com_height=2.5, track=0.4), "tall: tips at 0.785 m/s^2"),
        (Robot(radius=0.4, max_steering=0.15), "steers little"),
        (Robot(radius=0.4, max_acceleration=0.3), "weak drive"),
        (Robot(radius=0.4, max_speed=1.2), "slow"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_full_model_obeys_every_limit_between_rows_too(robot, name):
    law = UniformBraking(max_braking=1.0, max_speed=robot.max_speed)
    here = warehouse(robot, "rest", law)
    rows = plan_full(here, Path.polyline(BOTTOM_LEFT), effort="quick").trajectory
    x, y, _, v, a, kappa = rows.at(np.linspace(0, rows.travel_time, 50_000))
    clearance = here.clearance(np.column_stack([x, y]))
    assert np.min(clearance - law.distance(v)) >= 0
    assert np.max(v) <= robot.max_speed
    assert np.max(np.abs(kappa)) <= robot.max_curvature
    assert -robot.max_braking <= np.min(a)
    assert np.max(a) <= robot.max_acceleration
    assert np.max(np.hypot(a, v * v * kappa)) <= robot.friction_acceleration * (1 + 1e-9)
    assert np.max(v * v * np.abs(kappa)) <= robot.tip_acceleration * (1 + 1e-9)
    assert (x[-1], y[-1]) == pytest.approx(here.goal.position, abs=1e-9)


def test_each_limit_can_only_cost_time(warehouse_optimum):
    free = plan_full(warehouse(), Path.polyline(BOTTOM_LEFT)).travel_time
    assert free == pytest.approx(warehouse_optimum.travel_time, rel=1e-5)  # nothing binds at mu = 0.6
    tight = plan_full(warehouse(Robot(radius=0.4, max_steering=0.1)), Path.polyline(BOTTOM_LEFT)).travel_time
    assert tight > free * (1 + 1e-4)


def test_end_headings_are_met():
    here = warehouse(speed="rest")
    here = dataclasses.replace(
        here,
        start=dataclasses.replace(here.start, heading=math.pi / 2),
        goal=dataclasses.replace(here.goal, heading=-math.pi),
    )
    rows = plan_full(here, Path.polyline(BOTTOM_LEFT), effort="quick").trajectory
    assert math.remainder(rows.heading[0] - math.pi / 2, 2 * math.pi) == pytest.approx(0, abs=1e-9)
    assert math.remainder(rows.heading[-1] + math.pi, 2 * math.pi) == pytest.approx(0, abs=1e-9)


def test_steering_rate_is_kept_and_costs_time():
    slow = Robot(radius=0.4, max_steering_rate=0.3)
    plan = plan_full(warehouse(slow, "rest"), Path.polyline(BOTTOM_LEFT), effort="quick")
    assert greatest_steering_rate(plan.trajectory, slow) <= 0.3
    free = plan_full(warehouse(speed="rest"), Path.polyline(BOTTOM_LEFT), effort="quick")
    assert greatest_steering_rate(free.trajectory, slow) > 0.3
    assert plan.travel_time > free.travel_time


def test_narrow_gaps_do_not_hide_between_knots():
    # The class through three 1 m gaps, 0.1 m of clearance in each: knots alone would cut the corners.
    through_gaps = [(28.5, 1.9), (28, 9.5), (14.5, 9.5), (14.5, 21.5), (2, 21.5), (2, 22)]
    plan = plan_variational(warehouse(), Path.polyline(through_gaps))
    # optimum of this class in the same study: 79.756 s
    assert 79.755 <= plan.travel_time <= 79.756 * (1 + 1e-4)
    first = plan.details["history"][0]
    assert first["worst_violation"] > 1e-3  # so the check between knots does matter


def test_a_shortcut_is_never_much_slower_than_its_seed_and_hits_nothing():
    world = World.build(HALL, RACKS)
    here = problem(world, Robot(radius=0.4), End(position=(28.5, 1.9)), End(position=(2, 22)))
    detour = Path.polyline([(28.5, 1.9), (28.5, 9.5), (29, 1.5), (10, 1.0), (1, 1), (3.0, 15), (2, 22)])
    short = shortcut(here, detour)
    assert short.length < detour.length
    x, y, _, _ = short.at(np.linspace(0, short.length, 5000))
    assert np.min(world.distance(np.column_stack([x, y]))) >= 0.4 - 1e-9


def test_an_impossible_turn_is_refused_not_returned():
    # Start and goal a foot apart, facing each other's back, with hardly any steering and no room to loop.
    world = World.build([(0, 0), (3, 0), (3, 1), (0, 1)])
    robot = Robot(radius=0.4, max_steering=0.02)
    ends = End(position=(1.2, 0.5), heading=0.0), End(position=(1.6, 0.5), heading=math.pi)
    with pytest.raises(PlanningError, match="full model"):
        plan_full(problem(world, robot, *ends), Path.polyline([(1.2, 0.5), (1.6, 0.5)]), effort="quick")
