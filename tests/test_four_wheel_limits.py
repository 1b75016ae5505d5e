"""The four-wheeled vehicle at its limits: braking distance, slide, wheel lift, fall, tracking near them.

`benchmarks/four_wheel.py` measures the same at more points.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from systems_motions import circle, corridors, enlarged, lateral_error, s_curve, straight

from benchmarks.vehicle_alone import crossover, lift_onset, limit, rising_circle, slide_onset
from systems import simulate
from systems.diagram import tracking_diagram
from systems.simulation import started
from systems.stops import ROWS, emergency_stops
from vnav_drake.plan import Trajectory
from vnav_drake.robot import Robot

ROBOT = Robot(radius=0.4)
SMALL = Robot(radius=0.12, mass=3.0, wheelbase=0.12, track=0.1, com_height=0.03)
TALL = replace(ROBOT, com_height=0.5, friction=1.5)  # tips at 3.92 m/s^2, slides at 14.7


def straight_stop(believed: Robot, actual: Robot, speed: float) -> float:
    """Braking distance on a straight over v^2 / 2 [s^2/m]."""
    motion = straight(1.5, start=speed, end=speed, cruise=speed)
    loop = tracking_diagram(believed, motion, model="four_wheel", actual=actual)
    simulator = started(loop, loop.start)
    context = simulator.get_mutable_context()
    loop.ask_to_stop(context, 0.2, straightened=False)
    simulator.AdvanceTo(0.2)
    first = loop.vehicle.state(context)
    simulator.AdvanceTo(0.7 + speed / min(actual.max_braking, actual.friction_acceleration))
    last = loop.vehicle.state(context)
    assert abs(last.longitudinal_velocity) < 1e-3
    return 2.0 * math.hypot(last.x - first.x, last.y - first.y) / first.longitudinal_velocity**2


@pytest.mark.parametrize(("robot", "speed"), [(ROBOT, 1.0), (ROBOT, 2.0), (SMALL, 1.0), (TALL, 1.5)])
def test_brakes_at_their_limit_stop_within_v_squared_over_twice_a_b(robot, speed):
    # torque for m a_b at the tyres; within 20 ms of standing they give less: at most a_b (20 ms)^2 more way
    assert straight_stop(robot, robot, speed) * 1.0 == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("speed", [1.0, 3.0])
def test_locked_wheels_stop_within_v_squared_over_twice_mu_g(speed):
    # brakes made for a grip that the floor does not have: all wheels lock, all friction brakes
    strong = replace(ROBOT, max_braking=7.5)
    ratio = straight_stop(replace(strong, friction=2.0), strong, speed) * ROBOT.friction_acceleration
    assert 0.98 <= ratio <= 1.03


def test_brakes_that_reach_the_grip_let_the_wheels_roll_and_come_to_rest():
    # all friction brakes, which is as short as can be, and less within 20 ms near standing
    edge = replace(ROBOT, max_braking=ROBOT.friction_acceleration)
    ratio = straight_stop(edge, edge, 2.0) * ROBOT.friction_acceleration
    assert 0.99 <= ratio <= 1.04
    stop = emergency_stops(edge, straight(3.0, start=2.0, end=2.0, cruise=2.0), count=1).rows
    # once the load has shifted to the front axle, which takes a swing of the body; locked wheels would slip
    # at the speed itself
    rolling = stop[(stop[:, ROWS.index("v")] > 0.2) & (stop[:, ROWS.index("t")] >= 0.1)]
    assert rolling[:, ROWS.index("slip")].max() <= 0.02


def test_very_steep_turns_are_driven_slowly():
    # 78 degrees of steering: sin(beta) = kappa l / 2 = 0.875, tan(omega) = 2 tan(beta)
    robot = replace(ROBOT, max_steering=1.4)
    run = simulate(robot, circle(1.0 / 3.5, 0.3))
    assert run.details["ended"] == "arrived"
    assert not run.details["slid"]


@pytest.mark.parametrize(("robot", "bases"), [(ROBOT, 3.0), (ROBOT, 6.0), (SMALL, 4.0)])
def test_slide_begins_where_the_turn_takes_all_friction(robot, bases):
    # v^2 / R = mu g (Manor 2015, eq. A.2), R in wheelbases
    onset = slide_onset(robot, bases * robot.wheelbase)
    assert onset is not None
    assert 0.97 <= onset <= 1.05


@pytest.mark.parametrize(("robot", "bases"), [(TALL, 3.0), (TALL, 8.0)])
def test_wheels_lift_where_the_turn_tips(robot, bases):
    # v^2 / R = g w / (2 h) (Manor 2015, eq. A.3); spinning wheels take 1 % of it, see the loads in a turn
    onset = lift_onset(robot, bases * robot.wheelbase)
    assert onset is not None
    assert 0.97 <= onset <= 1.02


def test_low_robot_slides_and_high_robot_tips():
    # mu g = g w / (2 h) at h = w / (2 mu)
    assert crossover(ROBOT, 2.0, spread=0.08, steps=2) == pytest.approx(1.0, abs=0.06)


def test_neither_happens_below_the_limits():
    for robot in (ROBOT, TALL):
        drive = rising_circle(robot, 2.0, 0.6 * limit(robot), 0.93 * limit(robot), rise=0.2)
        assert drive.slide() is None
        assert drive.lift() is None


def wide_s_curve(share: float) -> Trajectory:
    """S-curve of 2 m radius that takes a share of the friction in its middle."""
    speed = math.sqrt(share * ROBOT.friction_acceleration)
    return enlarged(s_curve(start=speed, end=speed, cruise=speed), 2.0)


@pytest.mark.parametrize("share", [0.7, 0.95])
def test_s_curve_near_the_grip_limit_is_tracked(share):
    motion = wide_s_curve(share)
    run = simulate(ROBOT, motion)
    assert lateral_error(motion, run.x, run.y).max() < 0.03
    assert run.details["travel_time"] == pytest.approx(motion.travel_time, rel=0.01)
    assert not run.details["slid"]


def test_s_curve_beyond_the_grip_limit_slides_off_the_path():
    # no force exceeds mu m g, so what the path asks for cannot be given, and something must give
    motion = wide_s_curve(1.1)
    run = simulate(ROBOT, motion, slowing=False)
    assert run.details["slid"]
    assert run.details["slide_onset"] < motion.travel_time
    assert lateral_error(motion, run.x, run.y).max() > 0.05


def test_schedule_slows_down_where_a_bend_takes_more_than_the_grip():
    # speeds times sqrt(0.96 / 1.1) in the bend: held, and late by at most 1 / 0.934 - 1 = 7.1 %
    motion = wide_s_curve(1.1)
    run = simulate(ROBOT, motion)
    assert lateral_error(motion, run.x, run.y).max() < 0.03
    late = run.details["travel_time"] / motion.travel_time - 1.0
    assert 0.01 < late < math.sqrt(1.1 / 0.96) - 1.0


def test_tip_over_ends_the_run_in_bounded_time():
    # twice the tip limit, held by the tyres: it falls, within the first circle
    motion = circle(2.0, math.sqrt(2.0 * TALL.tip_acceleration * 2.0), turns=3.0)
    run = simulate(TALL, motion, slowing=False)
    assert run.details["ended"] == "fallen"
    assert run.details["fell"]
    assert not run.details["arrived"]
    assert "travel_time" not in run.details
    assert run.t[-1] < motion.travel_time
    assert run.channels["mode"][-1] == 3.0
    assert run.channels["tilt"][-1] > math.radians(30.0)
    assert all(np.isfinite(column).all() for column in run.columns.values())


def test_wheels_that_lift_are_told():
    # 5 % beyond the tip limit for a turn of a circle: a side is off the floor for longer than a swing
    motion = circle(2.0, math.sqrt(1.05 * TALL.tip_acceleration * 2.0))
    run = simulate(TALL, motion, slowing=False)
    below = simulate(TALL, circle(2.0, math.sqrt(0.9 * TALL.tip_acceleration * 2.0)))
    assert run.details["wheel_lift"] or run.details["fell"]
    assert not below.details["wheel_lift"]
    assert not below.details["fell"]
    # inner side: 1 - 0.9, less what the spinning wheels take, after the swing of the start
    assert below.channels["least_side"][below.t > 1.0].min() > 0.05


def test_far_beyond_friction_the_run_ends_in_bounded_time():
    motion = circle(1.5, 3.0, turns=2.0)  # 6 m/s^2 where there is 1
    run = simulate(replace(ROBOT, friction=1.0 / 9.81), motion, slowing=False)
    assert run.details["slid"]
    assert run.details["ended"] in ("out_of_time", "standing")
    assert run.t[-1] <= 1.1 * motion.travel_time + 2.0 + 1e-2


@pytest.mark.parametrize(("length", "end"), [(0.05, 0.0), (0.3, 0.0), (0.3, 0.8)])
def test_very_short_routes_are_driven(length, end):
    # from rest; the shortest is a tenth of the wheelbase and takes 0.45 s
    motion = straight(length, start=0.0, end=min(end, math.sqrt(2.0 * length) - 1e-6), cruise=2.0)
    run = simulate(ROBOT, motion)
    assert run.details["arrived"]
    assert math.hypot(run.x[-1] - motion.x[-1], run.y[-1] - motion.y[-1]) < 5e-3
    assert run.details["travel_time"] == pytest.approx(motion.travel_time, abs=0.05)


@pytest.mark.parametrize("name", ["max_steering_rate", "max_steering"])
def test_steering_keeps_its_limits(name):
    robot = replace(ROBOT, **{name: 0.8 if name == "max_steering_rate" else 0.25})
    run = simulate(robot, corridors(start=1.0, end=1.0, cruise=1.0, straights=(1.0, 0.5)))
    if name == "max_steering":
        assert np.abs(run.steering_command).max() <= 0.25 + 1e-12
    else:
        # commands are given every 10 ms; rows at the same instants
        assert np.abs(np.diff(run.steering_command)).max() <= 0.8 * 0.01 + 1e-9
