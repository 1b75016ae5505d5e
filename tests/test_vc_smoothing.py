"""Corners rounded by circles: closed forms, what does not fit, and every limit between the rows."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from benchmarks.random_worlds import random_problem
from vnav_drake.braking import UniformBraking
from vnav_drake.problem import End, PlanningError, Problem
from vnav_drake.robot import GRAVITY, Robot
from vnav_drake.vc_method.realise import Realisation, _free_speeds, realise
from vnav_drake.vc_method.road import Road
from vnav_drake.vc_method.smoothing import corners_of, round_corners, smallest_radius
from vnav_drake.voronoi import Curves, build_diagram
from vnav_drake.voronoi.curves import empty, linear
from vnav_drake.voronoi.network import build_network
from vnav_drake.voronoi_route.search import fastest_route
from vnav_drake.world import Obstacle, World

LATERAL = 0.5  # [m/s^2], tip-over limit of the robot of these tests
KERB = Obstacle(((-1.0, -0.05), (12.0, -0.05)))  # a wall beside the road along y = 0
HALL = ((-30.0, -30.0), (30.0, -30.0), (30.0, 30.0), (-30.0, 30.0))


def polyline(points: list[tuple[float, float]]) -> Curves:
    """Straight curves; their distances serve the time with corners alone, which no test here asks for."""
    p = np.array(points, dtype=float)
    far = np.full(len(p) - 1, 20.0)
    return linear(p[:-1], p[1:], far, far)


def asked(
    points: list[tuple[float, float]], *, wheelbase: float = 0.2, obstacles: tuple = (), **ends
) -> Problem:
    """A robot of at most 1 m/s far from all walls, so that r_min(v) = 1 / LATERAL = 2 m wherever it fits."""
    return Problem(
        world=World.build(HALL, obstacles),
        # g w / (2 h) = LATERAL; friction is no limit
        robot=Robot(
            radius=0.0, wheelbase=wheelbase, track=0.2, com_height=GRAVITY * 0.1 / LATERAL, friction=1.0
        ),
        braking=UniformBraking(max_braking=1.0, max_speed=1.0),
        start=ends.pop("start", End(position=points[0])),
        goal=ends.pop("goal", End(position=points[-1])),
    )


def demand_smooth(result: Realisation) -> None:
    path = result.path
    assert np.abs(path.kinks).max(initial=0.0) <= 1e-9
    ends = np.cumsum(path.piece_length)
    x, y, _, _ = path.at(np.nextafter(ends, 0.0))
    assert np.hypot(x - path.x[1:], y - path.y[1:]).max() <= 1e-8


def test_a_right_angle_is_rounded_by_the_circle_of_its_speed():
    # r_min(1 m/s) = 2 m touches both sides 2 m from the corner: 4 m of road become pi m of arc, all at 1 m/s.
    points = [(0.0, 0.0), (10.0, 0.0), (10.0, 10.0)]
    result = realise(asked(points), polyline(points))
    demand_smooth(result)
    assert result.consistent
    assert not result.shortfalls
    assert result.radius == pytest.approx([2.0], rel=1e-3)
    assert result.turn == pytest.approx([math.pi / 2.0], abs=1e-9)
    assert result.trajectory.length == pytest.approx(16.0 + math.pi, abs=2e-3)
    assert result.trajectory.travel_time == pytest.approx(16.0 + math.pi, abs=2e-3)
    # the middle of the arc: R (sqrt 2 - 1) from the corner, on its bisector
    inward = result.radius[0] * (1.0 - math.sqrt(0.5))
    assert result.point[0] == pytest.approx([10.0 - inward, inward], abs=1e-8)


def test_turns_to_the_right_mirror_those_to_the_left():
    points = [(0.0, 0.0), (10.0, 0.0), (13.0, 4.0), (20.0, 4.0)]
    mirrored = [(x, -y) for x, y in points]
    left, right = (realise(asked(p), polyline(p)) for p in (points, mirrored))
    assert right.turn == pytest.approx(-left.turn, abs=1e-9)
    assert right.radius == pytest.approx(left.radius, rel=1e-9)
    assert right.trajectory.travel_time == pytest.approx(left.trajectory.travel_time, rel=1e-9)


def test_corners_that_share_a_short_side_are_slowed_down_not_skipped():
    # Tangent lengths R tan(45 deg) = R: two must share 1 m, so R is 0.5 m and v = sqrt(LATERAL R).
    points = [(0.0, 0.0), (10.0, 0.0), (10.0, 1.0), (20.0, 1.0)]
    result = realise(asked(points), polyline(points))
    demand_smooth(result)
    assert not result.shortfalls
    assert result.radius == pytest.approx([0.5, 0.5], rel=3e-3)
    assert np.all(result.wanted > result.radius)
    assert result.speed == pytest.approx(np.sqrt(LATERAL * result.radius), rel=1e-5)


def test_an_arc_that_is_too_small_is_held_to_the_speed_of_its_turn_up_to_its_far_end():
    # The two arcs share 1 m, so R is 0.5 m; where turning counts, v^2 = LATERAL R all along, both ends too.
    points = [(0.0, 0.0), (10.0, 0.0), (10.0, 1.0), (20.0, 1.0)]
    problem, road = asked(points), Road.of(polyline(points))
    rounding = round_corners(problem, road, corners_of(problem, road), np.full(2, 2.0), None)
    radius = rounding.arcs.radius
    assert radius == pytest.approx([0.5, 0.5], rel=3e-3)
    speed = _free_speeds(problem, rounding, np.ones(2, dtype=bool))
    assert speed == pytest.approx(np.sqrt(LATERAL * radius), rel=1e-9)


def test_a_corner_too_tight_for_the_wheels_is_told_with_its_place():
    # As above, but r_kin = l sqrt(1/4 + 1/tan^2(omega)) = 1.545 m for l = 1 m; 0.5 m is the best that fits.
    # Turning by r_kin to the left and back climbs 1 m within sqrt(4 r_kin - 1) = 2.28 m at least. To pass
    # under (9.6, 0.1) it begins at most sqrt(0.2 r_kin) = 0.56 m before, ends as near to (10.4, 0.9): 1.92 m.
    points = [(0.0, 0.0), (10.0, 0.0), (10.0, 1.0), (20.0, 1.0)]
    between = (Obstacle(((9.6, 0.1),)), Obstacle(((10.4, 0.9),)))
    ends = {"start": End(position=points[0], heading=0.0), "goal": End(position=points[-1], heading=0.0)}
    result = realise(asked(points, wheelbase=1.0, obstacles=between, **ends), polyline(points))
    demand_smooth(result)
    assert result.radius == pytest.approx([0.5, 0.5], rel=3e-3)
    steering = [text for text in result.shortfalls if text.startswith("steering")]
    assert len(steering) == len(result.shortfalls) >= 1
    assert "(9.5" in steering[0]


def test_two_corners_to_different_sides_are_driven_around_together():
    # The same road without the two points: turn, straight, turn, both by r_kin. No way with that radius
    # climbs 1 m within less than 2.28 m (above), and none over 20 m is shorter than sqrt(20^2 + 1).
    points = [(0.0, 0.0), (10.0, 0.0), (10.0, 1.0), (20.0, 1.0)]
    steering = math.sqrt(0.25 + 1.0 / math.tan(0.6) ** 2)
    ends = {"start": End(position=points[0], heading=0.0), "goal": End(position=points[-1], heading=0.0)}
    result = realise(asked(points, wheelbase=1.0, **ends), polyline(points))
    demand_smooth(result)
    assert not result.shortfalls
    assert result.radius == pytest.approx([steering], rel=1e-6)
    assert result.turn == pytest.approx([0.0], abs=1e-9)
    assert math.sqrt(401.0) < result.trajectory.length < 20.5
    bend = result.path.curvature
    assert np.abs(bend).max() == pytest.approx(1.0 / steering, rel=1e-6)
    rising = np.cumsum(result.path.piece_length)[np.flatnonzero(bend)]
    assert rising[-1] - rising[0] + result.path.piece_length[np.flatnonzero(bend)[0]] >= 2.28


def test_two_near_corners_become_one_arc():
    # Twice 45 degrees, 0.2 m apart: two arcs of r_kin = 0.309 m do not fit (2 r tan(22.5 deg) = 0.256 m). The
    # outer lines meet 0.2 sin(45 deg) behind the first corner, and the arc of 2 m begins 2 m before that.
    side = 0.2 * math.sqrt(0.5)
    points = [(0.0, 0.0), (10.0, 0.0), (10.0 + side, side), (10.0 + side, 10.0)]
    result = realise(asked(points), polyline(points))
    demand_smooth(result)
    assert not result.shortfalls
    assert result.radius == pytest.approx([2.0], rel=1e-3)
    assert result.path.x[1] == pytest.approx(10.0 + side - result.radius[0], abs=1e-8)


def test_no_obstacle_comes_between_the_arc_and_the_road():
    # A point 0.4 m inside of both sides: sqrt(2) (R - 0.4) from the arc's centre, which must be less than R,
    # so R < 0.4 sqrt(2) / (sqrt(2) - 1) = 1.366 m. The arc of 2 m is as free, but beyond the point.
    points = [(0.0, 0.0), (10.0, 0.0), (10.0, 10.0)]
    result = realise(asked(points, obstacles=(Obstacle(((9.6, 0.4),)),)), polyline(points))
    demand_smooth(result)
    assert result.radius[0] < 0.4 * math.sqrt(2.0) / (math.sqrt(2.0) - 1.0)
    assert not result.shortfalls


def test_a_short_first_leg_is_left_along_an_arc_from_the_start():
    # 0.2 m of leg have no room for r_kin = 0.309 m. The arc of radius R from the start touches the road
    # sqrt(2 R l - l^2) behind the corner: (R - l)^2 + x^2 = R^2.
    points = [(0.0, 0.2), (0.0, 0.0), (10.0, 0.0)]
    result = realise(asked(points), polyline(points))
    demand_smooth(result)
    assert not result.shortfalls
    radius = result.radius[0]
    assert radius == pytest.approx(2.0, rel=1e-3)
    assert result.path.x[1] == pytest.approx(math.sqrt(0.4 * radius - 0.04), abs=1e-8)
    # With a heading it swings out by r_kin - 0.2 m beyond the road, where there is room for that.
    ends = {"start": End(position=points[0], heading=-0.5 * math.pi)}
    swung = realise(asked(points, **ends), polyline(points))
    demand_smooth(swung)
    assert not swung.shortfalls
    lowest = swung.path.at(np.linspace(0.0, 1.0, 2001))[1].min()
    assert lowest <= 0.2 - math.sqrt(0.01 + 0.04 / math.tan(0.6) ** 2) + 1e-5
    held = asked(points, obstacles=(KERB,), **ends)
    assert "steering" in realise(held, polyline(points)).shortfalls[0]


def test_headings_and_speeds_that_cannot_be_met_are_told():
    points = [(0.0, 0.2), (0.0, 0.0), (10.0, 0.0)]
    ends = {
        "start": End(position=points[0], speed=1.0, heading=0.0),
        "goal": End(position=points[-1], heading=1.0),
    }
    result = realise(asked(points, obstacles=(KERB,), **ends), polyline(points))
    for what in ("start at 1 m/s", "start heading", "goal heading", "steering"):
        assert sum(text.startswith(what) for text in result.shortfalls) == 1


@pytest.mark.parametrize("rate", [1e-3, 0.05, 0.5])
def test_where_the_wheels_turn_slowly_the_robot_waits_for_them(rate):
    points = [(0.0, 0.0), (10.0, 0.0), (10.0, 10.0)]
    problem = asked(points)
    slow = dataclasses.replace(problem, robot=dataclasses.replace(problem.robot, max_steering_rate=rate))
    quick, found = realise(problem, polyline(points)), realise(slow, polyline(points))
    assert found.shortfalls == ()
    # One bend: the wheels turn in and back, each for as long as the bend lasts at most.
    motion = found.trajectory
    bend = np.flatnonzero(motion.curvature[:-1] != 0.0)
    angle = problem.robot.steering_angle(float(motion.curvature[bend[0]]))
    lasts = motion.t[bend[-1] + 1] - motion.t[bend[0]]
    assert angle / lasts <= rate
    assert motion.travel_time >= quick.trajectory.travel_time
    # No slower than it must be: along the bend it is held to a constant speed, or it was slow enough before.
    if motion.travel_time > quick.trajectory.travel_time * (1.0 + 1e-9):
        assert angle / lasts == pytest.approx(rate, rel=0.2)


def test_fixed_speeds_at_the_ends_that_the_wheels_do_not_allow_are_told():
    points = [(0.0, 0.0), (1.0, 0.0), (1.0, 10.0)]
    problem = asked(points, start=End(position=points[0], speed=0.8))
    slow = dataclasses.replace(problem, robot=dataclasses.replace(problem.robot, max_steering_rate=1e-3))
    assert any(text.startswith("start at") for text in realise(slow, polyline(points)).shortfalls)


def test_a_route_without_length_is_refused():
    with pytest.raises(PlanningError, match="no length"):
        realise(asked([(0.0, 0.0), (1.0, 0.0)]), empty())


def test_smallest_radius_is_that_of_lemma_a1():
    # r_kin = l sqrt(1/4 + 1/tan^2 omega), and v^2 / min(mu g, g w / (2 h)) beyond (Manor 2015, Lemma A.1)
    problem = asked([(0.0, 0.0), (1.0, 0.0)], wheelbase=0.5)
    steering = 0.5 * math.sqrt(0.25 + 1.0 / math.tan(0.6) ** 2)
    assert smallest_radius(problem, np.array([0.0, 3.0])) == pytest.approx([steering, 9.0 / LATERAL])


def random_route(seed: int, **robot) -> tuple[Problem, Curves]:
    drawn = random_problem(seed).problem
    problem = dataclasses.replace(drawn, robot=dataclasses.replace(drawn.robot, **robot))
    network = build_network(problem, build_diagram(problem.world, problem.robot.radius), problem.robot.radius)
    route = fastest_route(network)
    assert route is not None
    return problem, route.curves


@pytest.mark.parametrize("seed", [0, 2, 5, 7, 8, 10])
@pytest.mark.parametrize("speed", ["safe", "rest"])
def test_every_limit_holds_between_the_rows_or_is_told(seed, speed):
    problem, curves = random_route(seed, max_acceleration=0.6)
    start, goal = (dataclasses.replace(end, speed=speed) for end in (problem.start, problem.goal))
    problem = dataclasses.replace(problem, start=start, goal=goal)
    result = realise(problem, curves)
    demand_smooth(result)
    motion = result.trajectory
    x, y, _, v, a, bend = motion.at(np.linspace(0.0, motion.travel_time, 30_001))
    assert np.min(problem.clearance(np.column_stack([x, y])) - problem.braking.distance(v)) >= 0.0
    assert np.max(v * v * np.abs(bend)) <= problem.lateral_limit * (1.0 + 1e-9)
    assert np.max(a) <= 0.6 * (1.0 + 1e-9)
    assert np.min(a) >= -problem.robot.max_braking * (1.0 + 1e-9)
    assert np.max(a**2 + (v * v * bend) ** 2) <= problem.robot.friction_acceleration**2 * (1.0 + 1e-9)
    assert [motion.x[0], motion.y[0]] == pytest.approx(problem.start.position, abs=1e-9)
    assert [motion.x[-1], motion.y[-1]] == pytest.approx(problem.goal.position, abs=1e-9)
    if speed == "rest":
        assert motion.v[[0, -1]] == pytest.approx([0.0, 0.0], abs=1e-9)
    too_tight = np.max(np.abs(bend)) > problem.robot.max_curvature * (1.0 + 1e-9)
    assert too_tight == any(text.startswith("steering") for text in result.shortfalls)
    # an arc is never smaller than its own speed allows
    lateral = problem.lateral_limit
    assert np.all(result.speed**2 <= lateral * result.radius * (1.0 + 1e-9))


@pytest.mark.parametrize("seed", [0, 5, 8])
@pytest.mark.parametrize("acceleration", [1.0, 0.4])
def test_every_row_drives_at_some_limit(seed, acceleration):
    # Bang-bang, on the braking limit, or at the limit of turning (Manor 2015, sec. 2.6). Rows and the
    # slow-down that makes them provable cost under 1e-3.
    problem, curves = random_route(seed, max_acceleration=acceleration)
    motion = realise(problem, curves).trajectory
    clearance = problem.clearance(np.column_stack([motion.x, motion.y]))
    at_limit = motion.v / problem.braking.speed(clearance)
    a, bend = motion.a[:-1], np.abs(motion.curvature[:-1])
    lateral = np.maximum(motion.v[1:], motion.v[:-1]) ** 2 * bend
    used = np.max(
        [
            a / acceleration,
            -a / problem.robot.max_braking,
            lateral / problem.lateral_limit,
            np.hypot(a, lateral) / problem.robot.friction_acceleration,
            np.maximum(at_limit[1:], at_limit[:-1]),
            # a joint of two bends keeps to the tighter one
            motion.v[1:] ** 2 * np.append(bend[1:], 0.0) / problem.lateral_limit,
            motion.v[:-1] ** 2 * np.append(0.0, bend[:-1]) / problem.lateral_limit,
        ],
        axis=0,
    )
    slack = used[np.diff(motion.t) > 0.0] < 1.0 - 1e-3
    # the row in which one limit takes over from another may use neither in full; never two on end
    assert not np.any(slack[1:] & slack[:-1])
    assert np.sum(slack) <= 0.02 * len(slack)
