"""Stretches too tight for the wheels: the ways around them, against Dubins paths, and homotopy classes."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from benchmarks.random_worlds import random_problem
from tests.test_vc_smoothing import asked, demand_smooth, polyline
from vnav_drake.braking import UniformBraking
from vnav_drake.collocation.dubins import dubins_path
from vnav_drake.homotopy import build_gates, class_of
from vnav_drake.plan import Path
from vnav_drake.problem import End
from vnav_drake.vc_method import vc_method
from vnav_drake.vc_method.realise import realise
from vnav_drake.vc_method.steering import NOTHING, SIDES, SNAP, Poses, _quickest, turn_straight_turn
from vnav_drake.voronoi import build_diagram
from vnav_drake.world import Obstacle

LETTERS = {1.0: "L", -1.0: "R"}


def drawn_poses(rng: np.random.Generator, count: int) -> Poses:
    return Poses(np.arange(count, dtype=float), rng.uniform(0, 4, (count, 2)), rng.uniform(-3, 3, count))


def test_ways_are_the_dubins_paths_that_turn_by_less_than_half_a_turn():
    rng, radius = np.random.default_rng(5), 0.7
    leave, meet = drawn_poses(rng, 200), drawn_poses(rng, 200)
    ways = turn_straight_turn(leave, meet, radius)
    found = {
        (int(s), *np.sign(bend[[0, 2]])): length
        for s, bend, length in zip(ways.leave.s, ways.curvature, ways.length, strict=True)
    }
    expected = 0
    for i in range(200):
        for one, other in SIDES:
            # the closed forms of Shkel and Lumelsky 2001
            word = f"{LETTERS[one]}S{LETTERS[other]}"
            path = dubins_path(leave.point[i], leave.heading[i], meet.point[i], meet.heading[i], radius, word)
            turns = [] if path is None else np.abs(path.curvature * path.piece_length)
            if path is None or max(turns) > math.pi:
                assert (i, one, other) not in found
                continue
            expected += 1
            assert found[i, one, other].sum() == pytest.approx(path.length, rel=1e-9)
    assert len(found) == expected
    assert expected > 50


def test_ways_begin_and_end_as_asked():
    rng = np.random.default_rng(6)
    ways = turn_straight_turn(drawn_poses(rng, 100), drawn_poses(rng, 100), 0.5)
    points = ways.points()
    np.testing.assert_allclose(points[:, 0, 0], ways.leave.point, atol=1e-12)
    np.testing.assert_allclose(points[:, -1, -1], ways.meet.point, atol=1e-9)
    off = ways.leave.heading + (ways.curvature * ways.length).sum(axis=1) - ways.meet.heading
    np.testing.assert_allclose(np.remainder(off + math.pi, 2.0 * math.pi), math.pi, atol=1e-9)


@pytest.mark.parametrize("part", [0, 1, 2])
def test_no_way_has_a_part_too_short_to_keep(part):
    # Turn, straight, turn of 1 m each by circles of 1 m, one of them 4e-7 m long instead: the poses at its
    # ends have that way among theirs. Without the part it would miss by 4e-7 m or turn by 4e-7 rad at once.
    length = np.ones(3)
    length[part] = 4e-7
    path = Path.from_arcs((0.0, 0.0), 0.3, [1.0, 0.0, -1.0], length)
    leave = Poses(np.zeros(1), np.array([[0.0, 0.0]]), np.array([0.3]))
    end = np.array([[path.x[-1], path.y[-1]]])
    ways = turn_straight_turn(leave, Poses(np.array([path.length]), end, path.end_heading[-1:]), 1.0)
    assert np.all((ways.length <= NOTHING) | (ways.length >= SNAP))


@pytest.mark.parametrize(("aside", "free"), [(0.07, False), (0.3, True)])
def test_a_way_that_is_free_at_its_samples_alone_is_not_taken(aside, free):
    # Two quarter turns of 0.5 m climb 1 m; the one way round them from 1.5 m before to 1.5 m behind is left,
    # straight, right. A point beside the straight part, halfway between two samples (16 to a part), is
    # sqrt(0.07^2 + (L / 32)^2) > 0.1 m from both, the robot's radius, and 0.07 m from the way between them.
    path = Path.from_arcs((-5.0, 0.0), 0.0, [0.0, 2.0, -2.0, 0.0], [5.0, math.pi / 4.0, math.pi / 4.0, 5.0])
    marks = (3.5, 3.5, 5.0 + math.pi / 2.0 + 1.5, 5.0 + math.pi / 2.0 + 1.5)
    (x, y, heading, _) = path.at(np.array(marks[1:3]))
    leave, meet = (
        Poses(np.array([marks[k + 1]]), np.array([[x[k], y[k]]]), heading[k : k + 1]) for k in (0, 1)
    )
    straight = turn_straight_turn(leave, meet, 1.0).points()[0, 1]
    along = (straight[4] - straight[3]) / math.dist(straight[4], straight[3])
    beside = 0.5 * (straight[3] + straight[4]) + aside * np.array([-along[1], along[0]])
    ends = [(-5.0, 0.0), (6.0, 1.0)]
    problem = asked(ends, obstacles=(Obstacle((tuple(beside.tolist()),)),))
    problem = dataclasses.replace(problem, robot=dataclasses.replace(problem.robot, radius=0.1))
    assert problem.world.distance(straight).min() > 0.1
    assert (_quickest(problem, path, marks, 1.0) is not None) == free


def test_ways_round_two_stretches_do_not_overlap():
    # Both climbs of 1 m are too tight for r_kin = 1.545 m and 6 m apart: a way round the first may end, and
    # one round the second begin, anywhere between them (REACH = 5 radii), but not the one behind the other.
    points = [(-13.0, 0.0), (-3.0, 0.0), (-3.0, 1.0), (3.0, 1.0), (3.0, 2.0), (13.0, 2.0)]
    ends = {"start": End(position=points[0], heading=0.0), "goal": End(position=points[-1], heading=0.0)}
    result = realise(asked(points, wheelbase=1.0, **ends), polyline(points))
    demand_smooth(result)
    assert not result.shortfalls
    assert len(result.radius) == 2


def test_the_margin_counts_around_tight_corners():
    # From (0, 0.2) downwards every circle of r_kin = 0.309 m reaches y = 0.2 - 0.309 = -0.109, 0.091 m from a
    # kerb at y = -0.2 or nearer. The road at y = 0 keeps 0.15 m, so with that margin the tight turn remains.
    points, kerb = [(0.0, 0.2), (0.0, 0.0), (10.0, 0.0)], Obstacle(((-1.0, -0.2), (12.0, -0.2)))
    start = End(position=points[0], heading=-0.5 * math.pi)
    problem = asked(points, obstacles=(kerb,), start=start)
    assert not realise(problem, polyline(points)).shortfalls
    law = UniformBraking(max_braking=1.0, max_speed=1.0, margin=0.15)
    result = realise(dataclasses.replace(problem, braking=law), polyline(points))
    assert [text.split(":")[0] for text in result.shortfalls] == ["steering"]
    x, y, *_ = result.path.at(np.linspace(0.0, result.path.length, 2001))
    assert problem.world.distance(np.column_stack([x, y])).min() >= 0.15 - 1e-9


@pytest.mark.parametrize("seed", [0, 8, 18, 33, 42])
def test_long_robots_follow_routes_with_tight_corners_in_the_same_class(seed):
    # r_kin = 0.77 m whatever the disc: these routes have corners where no circle of that radius fits.
    asked = random_problem(seed).problem
    result = vc_method(asked)
    motion = result.realisation
    assert motion.shortfalls == ()
    least = 1.0 / asked.robot.max_curvature
    assert np.any(np.abs(motion.radius / least - 1.0) < 1e-6)
    assert np.abs(motion.path.curvature).max() <= asked.robot.max_curvature
    curves = result.route.curves
    u = curves.span[:, :1] + np.diff(curves.span, axis=1) * np.linspace(0.0, 1.0, 201)
    along = curves.points(u).reshape(-1, 2)
    along = along[np.append(True, np.hypot(*np.diff(along, axis=0).T) > 1e-9)]
    radius = asked.robot.radius
    gates = build_gates(build_diagram(asked.world, radius).restricted(radius), radius)
    assert class_of(gates, motion.path) == class_of(gates, along)
