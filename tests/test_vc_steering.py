"""Stretches too tight for the wheels: the ways around them, against Dubins paths, and homotopy classes."""

from __future__ import annotations

import math

import numpy as np
import pytest

from benchmarks.random_worlds import random_problem
from vnav_drake.collocation.dubins import dubins_path
from vnav_drake.homotopy import build_gates, class_of
from vnav_drake.vc_method import vc_method
from vnav_drake.vc_method.steering import SIDES, Poses, turn_straight_turn
from vnav_drake.voronoi import build_diagram

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
