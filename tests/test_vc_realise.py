"""The realised speed along Voronoi arcs: against dense passes, closed forms, and what bang-bang means."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.random_worlds import random_problem
from vnav_drake.braking import UniformBraking
from vnav_drake.problem import NoPathError
from vnav_drake.robot import Robot
from vnav_drake.vc_method.profile import ACCELERATE, BOUNDARY, BRAKE
from vnav_drake.vc_method.realise import arc_minimum_time, arc_profile
from vnav_drake.voronoi import Curves, build_diagram, travel_time
from vnav_drake.voronoi.curves import between_points, linear
from vnav_drake.voronoi.network import build_network
from vnav_drake.voronoi_route.search import fastest_route

LAWS = [
    {},
    {"reaction_time": 0.3},
    {"max_speed": 0.9},
    {"reaction_time": 0.2, "margin": 0.05, "max_speed": 1.1},
]


def dense_passes(curves: Curves, braking: UniformBraking, robot: Robot, speeds: tuple[float, float], n: int):
    """Arc lengths, speeds and time by a forward and a backward recursion over n rows of each curve.

    Within a row v^2 is taken as linear, which is exact on ramps and of second order on the limit.
    """
    place, square, offset = [], [], 0.0
    for i in range(len(curves)):
        curve = curves.take([i])
        s = curve.arc_length(curve.span)[0]
        at = np.linspace(s[0], s[1], n + 1)
        u = curve.at_arc_length(at[None])
        square.append(braking.speed(curve.distance(u)[0] - robot.radius) ** 2)
        place.append(offset + np.abs(at - s[0]))
        offset += abs(s[1] - s[0])
    s, w = np.concatenate(place), np.concatenate(square).tolist()
    w[0], w[-1] = min(w[0], speeds[0] ** 2), min(w[-1], speeds[1] ** 2)
    step = np.diff(s).tolist()
    for i, h in enumerate(step):
        w[i + 1] = min(w[i + 1], w[i] + 2.0 * robot.max_acceleration * h)
    for i in range(len(step) - 1, -1, -1):
        w[i] = min(w[i], w[i + 1] + 2.0 * robot.max_braking * step[i])
    v = np.sqrt(np.maximum(w, 0.0))
    some = np.diff(s) > 0.0
    return s, v, float((2.0 * np.diff(s)[some] / (v[1:] + v[:-1])[some]).sum())


def speeds_at(profile, braking: UniformBraking, radius: float, s: np.ndarray) -> np.ndarray:
    """v [m/s] of the rows of one chain at arc lengths s."""
    row = np.clip(np.searchsorted(profile.begin, s, side="right") - 1, 0, len(profile.begin) - 1)
    part = (s - profile.begin[row]) / (profile.end - profile.begin)[row]
    ramp = profile.square[row, 0] * (1.0 - part) + profile.square[row, 1] * part
    curves = profile.curves.take(row)
    ends = curves.arc_length(curves.span)
    u = curves.at_arc_length(ends[:, 0] + (ends[:, 1] - ends[:, 0]) * part)
    limit = braking.speed(curves.distance(u) - radius)
    return np.where(profile.mode[row] == BOUNDARY, limit, np.sqrt(np.maximum(ramp, 0.0)))


def route_of(seed: int, law: dict, robot: dict) -> tuple[Curves, UniformBraking, Robot] | None:
    """The fastest route along arcs in a random world; None where the robot finds no way."""
    drawn = random_problem(seed).problem
    asked = dataclasses.replace(
        drawn,
        robot=dataclasses.replace(drawn.robot, max_braking=1.0, **robot),
        braking=UniformBraking(max_braking=1.0, **law),
    )
    level = asked.robot.radius + asked.braking.margin
    diagram = build_diagram(asked.world, asked.robot.radius)
    try:
        route = fastest_route(build_network(asked, diagram, level))
    except NoPathError:
        return None
    return None if route is None or len(route.curves) == 0 else (route.curves, asked.braking, asked.robot)


@settings(max_examples=25, deadline=None)
@given(
    st.integers(0, 10_000),
    st.sampled_from(LAWS),
    st.floats(0.02, 1.0),
    st.sampled_from([(math.inf, math.inf), (0.0, 0.0), (0.3, 0.1), (0.0, math.inf)]),
)
def test_profile_is_that_of_dense_passes(seed, law, accel, ends):
    found = route_of(seed, law, {"max_acceleration": accel})
    if found is None:
        return
    curves, braking, robot = found
    profile = arc_profile(
        curves, np.zeros(len(curves), int), braking, robot, start_speed=ends[0], end_speed=ends[1]
    )
    # Three times as many rows each time: the recursion has settled where its own time has.
    times = [dense_passes(curves, braking, robot, ends, n) for n in (300, 900)]
    settled = abs(times[1][2] - times[0][2]) / times[1][2]
    if not settled <= 1e-6:  # near a place where the law lets the robot come to rest
        s, v, _ = times[1]
        away = v > 0.05
        assert speeds_at(profile, braking, robot.radius, s)[away] == pytest.approx(v[away], abs=2e-4)
        return
    s, v, time = times[1]
    assert profile.time.sum() == pytest.approx(time, rel=1e-6)
    # Between rows the recursion is too fast by at most the bend of B over a row; in v^2.
    assert speeds_at(profile, braking, robot.radius, s) ** 2 == pytest.approx(v**2, abs=2e-4)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.sampled_from(LAWS), st.floats(0.02, 1.0))
def test_every_row_is_on_the_limit_or_at_full_drive(seed, law, accel):
    # Bang-bang or on the boundary (Manor 2015, sec. 2.6), and never beyond a limit.
    found = route_of(seed, law, {"max_acceleration": accel})
    if found is None:
        return
    curves, braking, robot = found
    profile = arc_profile(curves, np.zeros(len(curves), int), braking, robot, start_speed=0.0)
    assert profile.begin[0] == 0.0
    assert profile.begin[1:] == pytest.approx(profile.end[:-1], abs=1e-9)
    assert profile.square[1:, 0] == pytest.approx(profile.square[:-1, 1], abs=1e-8)
    length = profile.end - profile.begin
    gain = np.diff(profile.square, axis=1)[:, 0]
    up, down = profile.mode == ACCELERATE, profile.mode == BRAKE
    assert gain[up] == pytest.approx(2.0 * accel * length[up], abs=1e-9)
    assert gain[down] == pytest.approx(-2.0 * length[down], abs=1e-9)
    s = np.linspace(0.0, profile.end[-1], 4001)
    v = speeds_at(profile, braking, robot.radius, s)
    row = np.clip(np.searchsorted(profile.begin, s, side="right") - 1, 0, len(length) - 1)
    part = (s - profile.begin[row]) / length[row]
    along = profile.curves.take(row)
    span = along.arc_length(along.span)
    u = along.at_arc_length(span[:, 0] + (span[:, 1] - span[:, 0]) * part)
    limit = braking.speed(along.distance(u) - robot.radius)
    assert np.all(v <= limit + 1e-9)
    change = np.diff(v**2) / np.diff(s)
    assert np.all(change <= 2.0 * accel + 1e-6)
    assert np.all(change >= -2.0 - 1e-6)


def hall_line(length: float = 30.0, half: float = 2.0) -> Curves:
    return linear(np.array([[0.0, 0.0]]), np.array([[length, 0.0]]), np.full(1, half), np.full(1, half))


def test_corridor_from_rest_to_rest():
    # d = 1.6 m all along: V = sqrt(3.2); ramps of V/a in time and V^2/(2 a) in length.
    braking, v = UniformBraking(max_braking=1.0), math.sqrt(3.2)
    for accel in (1.0, 0.4):
        robot = Robot(radius=0.4, max_acceleration=accel)
        time = arc_minimum_time(hall_line(), [0], braking, robot, start_speed=0.0, end_speed=0.0)
        assert time == pytest.approx([30.0 / v + 0.5 * v * (1.0 / accel + 1.0)], rel=1e-12)


def test_short_corridor_never_reaches_the_limit():
    # From rest to rest over L < V^2/2 (1/a + 1/b): peak w = 2 L / (1/a + 1/b), T = sqrt(w) (1/a + 1/b).
    braking, robot = UniformBraking(max_braking=1.0), Robot(radius=0.4, max_acceleration=0.25)
    ramps = 1.0 / 0.25 + 1.0
    time = arc_minimum_time(hall_line(1.0), [0], braking, robot, start_speed=0.0, end_speed=0.0)
    assert time == pytest.approx([math.sqrt(2.0 * ramps)], rel=1e-12)


def test_leaving_a_saddle_along_the_tangent():
    # Two points 2 h apart, point robot: B = 2 b sqrt(h^2 + s^2) rises at 2 b s / r, which is 2 a at
    # s* = h q / sqrt(1 - q^2), q = a / b. From there on w = B(s*) + 2 a (s - s*).
    h, q, reach = 0.5, 0.6, 4.0
    curve = between_points(
        np.array([[0.0, 0.0]]), np.array([[0.0, reach]]), np.array([[-h, 0.0]]), np.array([[h, 0.0]])
    )
    profile = arc_profile(curve, [0], UniformBraking(max_braking=1.0), Robot(radius=0.0, max_acceleration=q))
    leave = h * q / math.sqrt(1.0 - q * q)
    assert profile.mode.tolist() == [BOUNDARY, ACCELERATE]
    assert profile.end[0] == pytest.approx(leave, rel=1e-12)
    begin = 2.0 * math.hypot(h, leave)
    end = begin + 2.0 * q * (reach - leave)
    assert profile.square[1] == pytest.approx([begin, end], rel=1e-12)
    assert profile.time[1] == pytest.approx((math.sqrt(end) - math.sqrt(begin)) / q, rel=1e-12)


def test_equal_limits_give_the_time_at_the_braking_limit():
    # Along any path |dB/ds| = 2 a_b |dd/ds| <= 2 a_b, so with a_max = a_b the limit itself can be driven.
    for seed in range(6):
        found = route_of(seed, {}, {"max_acceleration": 1.0})
        if found is not None:
            curves, braking, robot = found
            time = arc_minimum_time(curves, np.zeros(len(curves), int), braking, robot)
            assert time == pytest.approx([travel_time(curves, braking, robot.radius).sum()], rel=1e-9)


def test_many_chains_are_timed_as_each_alone():
    found = route_of(3, {"reaction_time": 0.1, "max_speed": 1.0}, {"max_acceleration": 0.3})
    assert found is not None
    curves, braking, robot = found
    chain = np.arange(len(curves)) // 2
    start = np.where(np.arange(chain[-1] + 1) % 2 == 0, 0.2, np.inf)
    together = arc_minimum_time(curves, chain, braking, robot, start_speed=start)
    alone = [
        arc_minimum_time(
            curves.take(chain == k),
            np.zeros(int((chain == k).sum()), int),
            braking,
            robot,
            start_speed=start[k],
        )[0]
        for k in range(chain[-1] + 1)
    ]
    assert together == pytest.approx(alone, rel=1e-9)


def test_chain_numbers_are_checked():
    braking, robot = UniformBraking(max_braking=1.0), Robot(radius=0.4)
    with pytest.raises(ValueError, match="chain"):
        arc_minimum_time(hall_line(), [0, 1], braking, robot)
    with pytest.raises(ValueError, match="chain"):
        arc_minimum_time(Curves.join([hall_line(), hall_line()]), [1, 0], braking, robot)
