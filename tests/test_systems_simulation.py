"""The closed loop of the single track: what it does with a trajectory, at, below and beyond the limits."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import Diagram
from systems_motions import circle, corridors, drive, lateral_error, mirrored, s_curve, straight

import systems
from systems import diagram_graphviz, run_columns
from systems.diagram import tracking_diagram
from systems.single_track import Motion
from vnav_drake.plan import Path, Trajectory
from vnav_drake.robot import Robot

simulate = partial(systems.simulate, model="single_track")

ROBOT = Robot(radius=0.4)
SLIPPERY = Robot(radius=0.4, friction=1.0 / 9.81)  # mu g = a_b = 1 m/s^2


def fixed_step(diagram: Diagram, step: float = 2.5e-3) -> Simulator:
    simulator = Simulator(diagram)
    ApplySimulatorConfig(
        SimulatorConfig(integration_scheme="runge_kutta3", max_step_size=step, use_error_control=False),
        simulator,
    )
    return simulator


@pytest.fixture(scope="module")
def curve():
    return s_curve(start=0.5, end=0.5, cruise=1.5)


@pytest.fixture(scope="module")
def curve_run(curve):
    return simulate(ROBOT, curve)


@pytest.mark.parametrize("share", [0.3, 0.7, 0.95])
def test_steady_circle_has_the_acceleration_of_its_radius(share):
    # a = v^2 / R, r = v / R; the acceleration is across the path, the body turned by beta with
    # sin(beta) = l / (2 R) less the rear slip, at most 0.18 rad: 1 - cos(0.18) = 1.6 %
    radius = 3.0
    speed = math.sqrt(share * ROBOT.friction_acceleration * radius)
    run = simulate(ROBOT, circle(radius, speed))
    steady = run.t > 1.0
    beta = np.arctan2(run.lateral_velocity, run.longitudinal_velocity)[steady]
    along = run.longitudinal_force[steady] / ROBOT.mass
    across = run.lateral_acceleration[steady] * np.cos(beta) - along * np.sin(beta)
    used = math.sqrt(share * ROBOT.friction_acceleration * radius) ** 2 / radius
    np.testing.assert_allclose(across, used, rtol=2e-3)
    np.testing.assert_allclose(run.yaw_rate[steady], speed / radius, rtol=2e-3)
    np.testing.assert_allclose(run.v[steady], speed, rtol=2e-3)
    assert lateral_error(circle(radius, speed), run.x, run.y).max() < 5e-3
    assert not run.details["slid"]
    # both axles carry half the force: friction used is a / (mu g), and what load transfer and slip drag add
    assert run.channels["front_demand"][steady].max() == pytest.approx(share, abs=0.04)


@pytest.mark.parametrize("excess", [1.1, 1.5])
def test_beyond_friction_the_vehicle_slides_outwards_and_is_flagged(excess):
    # No force exceeds mu m g. From a tangent start at radius R and speed v the distance from the centre
    # after t is at least sqrt(R^2 + (v t)^2) - mu g t^2 / 2, which grows beyond R when v^2 > mu g R.
    radius, limit = 3.0, ROBOT.friction_acceleration
    speed = math.sqrt(excess * limit * radius)
    run = simulate(ROBOT, circle(radius, speed))
    outward = np.hypot(run.x, run.y - radius) - radius
    first = run.t <= 0.3
    least = np.sqrt(radius**2 + (speed * run.t) ** 2) - 0.5 * limit * run.t**2 - radius
    assert np.all(outward[first] >= least[first] - 1e-9)
    assert np.all(np.diff(outward[first]) > 0.0)
    assert outward[first][-1] > 0.01
    assert run.details["slid"]
    assert run.lateral_acceleration.max() <= limit * (1 + 1e-9)


def test_far_beyond_friction_the_run_ends_in_bounded_time():
    motion = circle(1.5, 3.0, turns=2.0)  # 6 m/s^2 where there is 1
    run = simulate(SLIPPERY, motion)
    assert not run.details["arrived"]
    assert "travel_time" not in run.details
    assert run.t[-1] <= 1.1 * motion.travel_time + 2.0 + 1e-2
    assert all(np.isfinite(getattr(run, name)).all() for name in run_columns())
    assert lateral_error(motion, run.x, run.y).max() > 1.0


def test_tracked_braking_takes_v_squared_over_twice_a_b():
    motion = straight(6.0, start=2.0, end=0.0, cruise=2.0)
    run = simulate(ROBOT, motion)
    brakes_on = run.v < 2.0 - 1e-3
    first, last = np.flatnonzero(brakes_on)[[0, -1]]
    distance = math.hypot(run.x[last] - run.x[first], run.y[last] - run.y[first])
    assert distance == pytest.approx(run.v[first] ** 2 / 2.0, rel=0.01)
    assert run.details["travel_time"] == pytest.approx(motion.travel_time, rel=0.01)


def test_kinetic_energy_is_the_work_of_the_tyres():
    # straight: d(m v^2 / 2) = F dx
    run = simulate(ROBOT, straight(4.0, start=0.0, end=0.0, cruise=1.5))
    along = np.hypot(run.x - run.x[0], run.y - run.y[0])
    work = np.concatenate(
        [[0.0], np.cumsum(0.5 * (run.longitudinal_force[1:] + run.longitudinal_force[:-1]) * np.diff(along))]
    )
    energy = 0.5 * ROBOT.mass * run.v**2
    # the force jumps twice, once from 0 and once to it within 10 ms rows: 40 N * 15 mm
    np.testing.assert_allclose(work, energy, atol=1.3)


def test_mirrored_trajectory_gives_the_mirrored_run(curve, curve_run):
    run = simulate(ROBOT, mirrored(curve))
    for name in ("y", "heading", "lateral_velocity", "yaw_rate", "steering", "lateral_acceleration"):
        np.testing.assert_allclose(getattr(run, name), -getattr(curve_run, name), atol=1e-9, err_msg=name)
    for name in ("t", "x", "v", "longitudinal_force"):
        np.testing.assert_allclose(getattr(run, name), getattr(curve_run, name), atol=1e-9, err_msg=name)


def test_turned_and_moved_trajectory_gives_the_same_run(curve, curve_run):
    angle, cosine, sine = 2.0, math.cos(2.0), math.sin(2.0)
    x, y = cosine * curve.x - sine * curve.y + 30.0, sine * curve.x + cosine * curve.y - 7.0
    run = simulate(ROBOT, replace(curve, x=x, y=y, heading=curve.heading + angle))
    np.testing.assert_allclose(run.x, cosine * curve_run.x - sine * curve_run.y + 30.0, atol=1e-9)
    np.testing.assert_allclose(run.y, sine * curve_run.x + cosine * curve_run.y - 7.0, atol=1e-9)
    np.testing.assert_allclose(run.v, curve_run.v, atol=1e-9)


def test_runs_repeat_bit_by_bit(curve, curve_run):
    run = simulate(ROBOT, curve)
    for name in run.columns:
        assert np.array_equal(run.columns[name], curve_run.columns[name]), name


def test_all_that_changes_is_in_the_context(curve):
    def simulator():
        loop = tracking_diagram(ROBOT, curve)
        sim = fixed_step(loop.diagram)
        loop.begin(sim.get_mutable_context(), loop.start)
        return loop, sim

    loop, first = simulator()
    first.AdvanceTo(2.0)
    snapshot = first.get_context().Clone()
    first.AdvanceTo(4.0)
    other_loop, second = simulator()
    second.AdvanceTo(0.5)  # its own past must not matter
    second.get_mutable_context().SetTimeStateAndParametersFrom(snapshot)
    second.Initialize()
    second.AdvanceTo(4.0)
    assert loop.vehicle.state(first.get_context()) == other_loop.vehicle.state(second.get_context())


def test_tracks_an_s_curve_within_a_centimetre_and_a_percent(curve, curve_run):
    # the team's bound for warehouse-like motion is a few centimetres and 1 %
    assert lateral_error(curve, curve_run.x, curve_run.y).max() < 0.01
    assert curve_run.details["travel_time"] == pytest.approx(curve.travel_time, rel=0.01)
    assert curve_run.details["arrived"]
    assert not curve_run.details["slid"]


@pytest.mark.parametrize(("end", "cruise"), [(0.0, 1.9), (1.0, 2.0)])
def test_tracks_a_warehouse_corner(end, cruise):
    motion = corridors(start=end, end=end, cruise=cruise)
    run = simulate(ROBOT, motion)
    assert lateral_error(motion, run.x, run.y).max() < 0.02
    assert run.details["travel_time"] == pytest.approx(motion.travel_time, rel=0.01)
    assert math.hypot(run.x[-1] - motion.x[-1], run.y[-1] - motion.y[-1]) < 0.02


def test_corner_at_all_the_friction_is_still_followed():
    # mu g = 1 and v^2 kappa = 1: nothing is left to correct with, so it gives way by centimetres
    motion = corridors(start=0.0, end=0.0, cruise=math.sqrt(1.5))
    run = simulate(SLIPPERY, motion)
    assert run.details["arrived"]
    assert lateral_error(motion, run.x, run.y).max() < 0.15
    assert run.details["travel_time"] == pytest.approx(motion.travel_time, rel=0.02)


def test_run_starts_on_the_first_row(curve, curve_run):
    assert curve_run.t[0] == 0.0
    assert (curve_run.x[0], curve_run.y[0]) == (curve.x[0], curve.y[0])
    assert curve_run.v[0] == pytest.approx(curve.v[0], rel=1e-12)
    motion = circle(2.0, 1.5)  # in a bend the direction of travel, not the body, is the planned heading
    run = simulate(ROBOT, motion)
    course = run.heading[0] + math.atan2(run.lateral_velocity[0], run.longitudinal_velocity[0])
    assert course == pytest.approx(motion.heading[0], abs=1e-9)


def test_run_with_a_moving_end_ends_on_the_goal_line(curve, curve_run):
    course = curve.heading[-1]
    beyond = (curve_run.x[-1] - curve.x[-1]) * math.cos(course)
    beyond += (curve_run.y[-1] - curve.y[-1]) * math.sin(course)
    # one step at constant speed to the line: off by at most a_max dt^2 / 2 with dt = 5 ms
    assert abs(beyond) < 1.0 * 5e-3**2


@pytest.mark.parametrize("length", [0.3, 5.0])
def test_rest_to_rest_ends_standing_near_the_goal(length):
    motion = straight(length, start=0.0, end=0.0, cruise=2.0)
    run = simulate(ROBOT, motion)
    assert run.details["arrived"]
    assert abs(run.v[-1]) < 1e-3
    assert math.hypot(run.x[-1] - motion.x[-1], run.y[-1] - motion.y[-1]) < 2e-3
    assert all(np.isfinite(getattr(run, name)).all() for name in run_columns())
    assert run.v.min() > -1e-2  # it does not roll back


def test_nothing_moves_while_standing_after_a_bend():
    # five seconds after the planned end: no creep, no swing, no jitter of body or steering
    path = Path.from_arcs((0.0, 0.0), 0.0, [0.0, 0.8], [2.0, 2.0])
    motion = drive(path, start=0.0, end=0.0, cruise=1.0)
    loop = tracking_diagram(ROBOT, motion)
    simulator = fixed_step(loop.diagram)
    loop.begin(simulator.get_mutable_context(), loop.start)
    states = []
    for late in (1.0, 3.0, 6.0):
        simulator.AdvanceTo(motion.travel_time + late)
        states.append(np.array(loop.vehicle.state(simulator.get_context())))
    assert np.isfinite(states).all()
    np.testing.assert_allclose(states[1], states[0], atol=1e-6)
    np.testing.assert_allclose(states[2], states[1], atol=1e-9)


def test_offset_from_the_path_dies_out():
    motion = straight(10.0, start=1.0, end=1.0, cruise=1.0)
    run = simulate(ROBOT, motion, initial_offset=(0.0, 0.1, 0.1))
    error = lateral_error(motion, run.x, run.y)
    assert error[0] == pytest.approx(0.1, abs=1e-6)
    assert error[run.t > 6.0].max() < 1e-3


def test_result_does_not_depend_on_the_step_of_the_integrator(curve):
    ends = []
    for step in (2.5e-3, 0.625e-3):
        loop = tracking_diagram(ROBOT, curve)
        simulator = fixed_step(loop.diagram, step)
        loop.begin(simulator.get_mutable_context(), loop.start)
        simulator.AdvanceTo(curve.travel_time)
        ends.append(loop.vehicle.state(simulator.get_context()))
    np.testing.assert_allclose(ends[0][:3], ends[1][:3], atol=1e-4)


def test_slow_steering_is_prepared_for():
    # a rate that takes 0.2 s for the steering step of 0.5 1/m (0.25 rad); the path is cut by
    # kappa (v T)^2 / 24 when curvature ramps over T: 0.5 * 0.3^2 / 24 = 2 mm, the servo's limits add to that
    path = Path.from_arcs((0.0, 0.0), 0.0, [0.0, 0.5, 0.0], [4.0, 3.0, 4.0])
    motion = drive(path, start=1.0, end=1.0, cruise=1.5)
    run = simulate(replace(ROBOT, max_steering_rate=1.25), motion)
    assert np.abs(np.diff(run.steering) / np.diff(run.t)).max() <= 1.25 * (1 + 1e-6)
    assert lateral_error(motion, run.x, run.y).max() < 0.02


def test_wheel_lift_is_flagged_above_the_tip_limit():
    # tip limit g w / (2 h) = 9.81 * 0.4 / (2 * 0.6) = 3.27 m/s^2, below mu g = 5.886
    tall = replace(ROBOT, com_height=0.6)
    above = simulate(tall, circle(2.0, math.sqrt(1.05 * 3.27 * 2.0)))
    below = simulate(tall, circle(2.0, math.sqrt(0.90 * 3.27 * 2.0)))
    assert above.details["wheel_lift"]
    assert not below.details["wheel_lift"]


def test_csv_gives_back_every_bit(curve_run, tmp_path):
    file = tmp_path / "simulation.csv"
    curve_run.to_csv(file)
    header = file.read_text(encoding="utf-8").splitlines()[0].split(",")
    assert header[:5] == ["t", "x", "y", "heading", "v"]
    rows = np.loadtxt(file, delimiter=",", skiprows=1)
    for name, column in zip(header, rows.T, strict=True):
        assert np.array_equal(column, curve_run.columns[name]), name


def test_rows_are_ten_milliseconds_apart_and_in_order(curve_run):
    gaps = np.diff(curve_run.t)
    np.testing.assert_allclose(gaps[:-1], 0.01, atol=1e-9)
    assert 0.0 < gaps[-1] <= 0.01 + 1e-9
    assert (*run_columns()[1:], *curve_run.channels) == Motion._fields


@pytest.mark.parametrize("step", [0.0, -1e-3, 5e-3, 2.5e-3, math.nan])
def test_step_outside_its_range_is_refused(curve, step):
    with pytest.raises(ValueError, match="step = "):
        simulate(ROBOT, curve, step=step)


def test_trajectory_that_is_none_is_refused(curve):
    with pytest.raises(ValueError, match="column x"):
        simulate(ROBOT, replace(curve, x=np.append(curve.x[:-1], math.nan)))
    columns = ("t", "x", "y", "heading", "v", "a", "curvature", "clearance")
    with pytest.raises(ValueError, match="at least two"):
        simulate(ROBOT, Trajectory(*(getattr(curve, name)[:1] for name in columns)))


def test_diagram_names_its_parts(curve):
    source = diagram_graphviz(ROBOT, curve)
    for name in ("trajectory", "tracking", "supervisor", "single_track", "log"):
        assert name in source
