"""The fastest profile: exact on simple paths, safe between its rows, and never beaten."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vnav_drake.braking import UniformBraking
from vnav_drake.plan import Path
from vnav_drake.problem import End, PlanningError, Problem
from vnav_drake.robot import Robot
from vnav_drake.speed_profile import fastest_profile, row_sag
from vnav_drake.world import Obstacle, World

LAW = UniformBraking(max_braking=1.0)
ROBOT = Robot(radius=0.4)


def corridor(speed="safe", law=LAW, robot=ROBOT):
    # 4 m wide, 40 m long; on the centre line from x = 5 to 35 the side walls are nearest: d = 1.6 m
    world = World.build([(0, 0), (40, 0), (40, 4), (0, 4)])
    start, goal = End(position=(5, 2), speed=speed), End(position=(35, 2), speed=speed)
    return Problem(world=world, robot=robot, braking=law, start=start, goal=goal)


def line(problem):
    return Path.polyline([problem.start.position, problem.goal.position])


def test_centre_of_a_corridor_at_the_braking_limit():
    # V = sqrt(2 a d) with d = 2 - 0.4; 30 m at V. Rows and the slow-down cost under 1e-5.
    time = fastest_profile(corridor(), line(corridor()), model="variational").travel_time
    assert time == pytest.approx(30 / math.sqrt(3.2), rel=1e-5)
    assert time >= 30 / math.sqrt(3.2)


def test_rest_to_rest_is_a_trapezoid():
    # Ramps of V/a at both ends, each covering V^2/(2 a): T = L/V + V/a for equal limits.
    problem = corridor("rest")
    time = fastest_profile(problem, line(problem), model="full").travel_time
    v = math.sqrt(3.2)
    assert time == pytest.approx(30 / v + v, rel=1e-5)
    ramps = fastest_profile(problem, line(problem), model="variational", ends="problem").travel_time
    assert ramps == pytest.approx(time, rel=1e-9)


def test_unequal_drive_limits():
    # Accelerating at 0.5: T = L/V + V/2 (1/a_b + 1/a_max).
    problem = corridor("rest", robot=dataclasses.replace(ROBOT, max_acceleration=0.5))
    v = math.sqrt(3.2)
    expected = 30 / v + v / 2 * (1 + 2)
    assert fastest_profile(problem, line(problem), model="full").travel_time == pytest.approx(
        expected, rel=1e-5
    )


def test_numeric_end_speed_is_met():
    problem = corridor(0.7)
    trajectory = fastest_profile(problem, line(problem), model="full")
    assert trajectory.v[[0, -1]] == pytest.approx([0.7, 0.7], rel=2e-6)


def test_reaction_time_and_margin():
    # v t_r + v^2/2 + m = d: v = -t_r + sqrt(t_r^2 + 2 (d - m)).
    law = UniformBraking(max_braking=1.0, reaction_time=0.3, margin=0.1)
    problem = corridor(law=law)
    v = -0.3 + math.sqrt(0.09 + 2 * 1.5)
    time = fastest_profile(problem, line(problem), model="variational").travel_time
    assert time == pytest.approx(30 / v, rel=1e-5)


@pytest.mark.parametrize("reaction_time", [0.05, 0.2, 0.5, 1.0])
def test_reaction_time_on_a_path_with_kinks_and_changing_clearance(reaction_time):
    # From the wall to the middle of a corridor and along it: V(d) changes, then is constant.
    law = UniformBraking(max_braking=1.0, reaction_time=reaction_time)
    problem = corridor(law=law)
    path = Path.polyline([(5, 0.6), (5, 2), (35, 2), (35, 3.3)])
    trajectory = fastest_profile(problem, path, model="variational")
    x, y, _, v, _, _ = trajectory.at(np.linspace(0, trajectory.travel_time, 20_000))
    assert np.min(problem.clearance(np.column_stack([x, y])) - law.distance(v)) >= 0


def test_circle_at_the_friction_limit():
    # Far from walls, radius 2 m: v^2/R = mu g.
    world = World.build([(-50, -50), (50, -50), (50, 50), (-50, 50)])
    robot = Robot(radius=0.4, friction=0.2, max_braking=1.0)
    problem = Problem(
        world=world, robot=robot, braking=LAW, start=End(position=(2, 0)), goal=End(position=(-2, 0))
    )
    half = Path.from_arcs((2, 0), math.pi / 2, [0.5], [2 * math.pi])
    time = fastest_profile(problem, half, model="full").travel_time
    assert time == pytest.approx(2 * math.pi / math.sqrt(0.2 * 9.81 * 2), rel=1e-5)


def test_braking_in_a_bend_keeps_to_the_friction_circle(monkeypatch):
    # With a_b = mu g = F, w = v^2 obeys dw/ds = -2 sqrt(F^2 - (kappa w)^2): w = (F/kappa) sin(2 kappa s)
    # counted back from rest, by separation of variables. A row brakes as hard as its faster end
    # allows, so the profile converges from below, with the first order in the row length.
    world = World.build([(-50, -50), (50, -50), (50, 50), (-50, 50)])
    robot = Robot(radius=0.4, friction=1.0 / 9.81, max_braking=1.0)
    length, kappa = 1.2, 0.5
    path = Path.from_arcs((0, 0), 0.0, [kappa], [length])
    goal = End(position=(float(path.x[-1]), float(path.y[-1])), speed="rest")
    problem = Problem(world=world, robot=robot, braking=LAW, start=End(position=(0, 0)), goal=goal)
    errors = []
    for longest_row in (0.02, 0.005):
        monkeypatch.setattr("vnav_drake.speed_profile.LONGEST_ROW", longest_row)
        trajectory = fastest_profile(problem, path, model="full")
        left = np.maximum(length - trajectory.arc_length, 0.0)
        errors.append(np.sqrt(np.sin(2 * kappa * left) / kappa) - trajectory.v)
    assert min(np.min(e) for e in errors) >= -1e-9
    assert np.max(errors[0]) < 3e-3
    assert np.max(errors[1]) < 0.35 * np.max(errors[0])


@settings(max_examples=30)
@given(st.integers(0, 10_000), st.sampled_from([0.0, 0.4]), st.sampled_from([0.0, 0.25]))
def test_never_unsafe_between_rows(seed, radius, reaction_time):
    rng = np.random.default_rng(seed)
    points = [Obstacle(((float(x), float(y)),)) for x, y in rng.uniform(3, 17, (12, 2))]
    world = World.build([(0, 0), (20, 0), (20, 20), (0, 20)], points)
    law = UniformBraking(max_braking=1.0, reaction_time=reaction_time)
    robot = Robot(radius=radius)
    path = Path.from_arcs(
        rng.uniform(3, 17, 2), rng.uniform(-3, 3), rng.uniform(-0.8, 0.8, 6), rng.uniform(0.2, 1, 6)
    )
    end = End(position=(float(path.x[-1]), float(path.y[-1])), speed="rest")
    problem = Problem(
        world=world,
        robot=robot,
        braking=law,
        start=End(position=(float(path.x[0]), float(path.y[0]))),
        goal=end,
    )
    try:
        trajectory = fastest_profile(problem, path, model="full")
    except PlanningError:
        return  # it runs into an obstacle
    t = np.linspace(0, trajectory.travel_time, 20_000)
    x, y, _, v, a, kappa = trajectory.at(t)
    clearance = world.distance(np.column_stack([x, y])) - radius
    assert np.min(clearance - law.distance(v)) >= -1e-12
    assert np.max(a) <= robot.max_acceleration * (1 + 1e-9)
    assert np.min(a) >= -robot.max_braking * (1 + 1e-9)
    assert np.max(np.hypot(a, v * v * kappa)) <= robot.friction_acceleration * (1 + 1e-9)


@given(st.integers(0, 10_000))
def test_row_sag_bounds_the_dip_of_the_distance(seed):
    rng = np.random.default_rng(seed)
    world = World.build(
        [(0, 0), (10, 0), (10, 10), (0, 10)],
        [Obstacle(((float(x), float(y)),)) for x, y in rng.uniform(2, 8, (3, 2))],
    )
    path = Path.from_arcs(
        rng.uniform(1, 9, 2), rng.uniform(-3, 3), rng.uniform(-2, 2, 1), rng.uniform(0.01, 0.5, 1)
    )
    if not np.all(world.is_floor(np.column_stack([path.x, path.y]))):
        return
    distance = world.distance(np.column_stack([path.x, path.y]))
    sag = row_sag(distance, path.piece_length, path.curvature)[0]
    part = np.linspace(0, 1, 101)
    x, y, _, _ = path.at(part * path.length)
    chord = distance[0] + part * (distance[1] - distance[0])
    assert np.all(world.distance(np.column_stack([x, y])) >= chord - sag - 1e-12)


def test_a_path_through_a_wall_is_refused():
    world = World.build([(0, 0), (10, 0), (10, 10), (0, 10)], [Obstacle(((5, 2), (5, 8)))])
    problem = Problem(
        world=world,
        robot=Robot(radius=0.2),
        braking=LAW,
        start=End(position=(2, 5)),
        goal=End(position=(8, 5)),
    )
    with pytest.raises(PlanningError, match="no safe speed at"):
        fastest_profile(problem, line(problem), model="variational")


def test_a_kink_is_for_the_variational_model_only():
    problem = corridor()
    path = Path.polyline([(5, 2), (20, 2.5), (35, 2)])
    trajectory = fastest_profile(problem, path, model="variational")
    same = np.flatnonzero(np.diff(trajectory.t) == 0.0)
    assert len(same) == 1
    assert trajectory.heading[same[0]] > 0 > trajectory.heading[same[0] + 1]
    with pytest.raises(PlanningError, match="kink"):
        fastest_profile(problem, path, model="full")
