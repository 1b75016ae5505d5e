"""The four-wheeled vehicle: geometry, loads, brakes, invariances of its runs."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from systems_motions import circle, corridors, lateral_error, mirrored, s_curve, straight

from systems import run_columns, simulate
from systems.diagram import tracking_diagram
from systems.four_wheel import WHEELS, FourWheel, WheelGeometry, add_four_wheel
from systems.rolling import SINK, swing_time
from systems.simulation import started
from systems.single_track import State
from systems.wheels import RECORD, wheel_loads
from vnav_drake.robot import GRAVITY, Robot

ROBOT = Robot(radius=0.4)
SMALL = Robot(radius=0.12, mass=3.0, wheelbase=0.12, track=0.1, com_height=0.03)
LARGE = Robot(radius=0.5, mass=40.0, wheelbase=0.6, track=0.5, com_height=0.2)
ROBOTS = {"usual": ROBOT, "small": SMALL, "large": LARGE}


def built(robot: Robot) -> tuple[FourWheel, Simulator]:
    builder = DiagramBuilder()
    vehicle = add_four_wheel(builder, robot)
    return vehicle, Simulator(builder.Build())


def per_wheel(run, name: str) -> np.ndarray:
    return np.stack([run.channels[f"{name}_{wheel}"] for wheel in WHEELS])


@pytest.fixture(scope="module")
def curve():
    return s_curve(start=0.5, end=0.5, cruise=1.5)


@pytest.fixture(scope="module")
def curve_run(curve):
    return simulate(ROBOT, curve)


@pytest.fixture(scope="module")
def turn():
    """A steady turn to the left at half of the friction, R = 3 m: v^2 / R = mu g / 2."""
    return simulate(ROBOT, circle(3.0, math.sqrt(0.5 * ROBOT.friction_acceleration * 3.0), turns=0.5))


@pytest.mark.parametrize("angle", [-0.55, -0.1, 0.02, 0.4, 0.6])
def test_axes_of_all_wheels_meet_in_one_point(angle):
    # Ackermann: the axis of a wheel at (x, y) turned by d passes through (x, y) + s (-sin d, cos d). It meets
    # the line of the rear axle, x = -l/2, at one y for both front wheels, that of a mean one: l / tan(angle)
    wheels = WheelGeometry.of(ROBOT)
    x, y = wheels.x[:2], wheels.y[:2]
    turned = np.array(wheels.steering(angle))
    meets = y + (x + 0.5 * ROBOT.wheelbase) / np.tan(turned)
    np.testing.assert_allclose(meets, ROBOT.wheelbase / math.tan(angle), rtol=1e-12)


def test_the_mean_angle_is_read_back_from_both_wheels():
    loop = tracking_diagram(ROBOT, circle(2.0, 1.0), model="four_wheel")
    context = loop.diagram.CreateDefaultContext()
    for angle in (-0.5, 0.0, 0.3):
        state = State(1.0, -2.0, 0.7, 0.8, 0.1, 0.4, angle)
        loop.begin(context, state)
        np.testing.assert_allclose(loop.vehicle.state(context), state, atol=1e-12)


@pytest.mark.parametrize("name", ROBOTS)
def test_bodies_together_have_mass_height_and_yaw_inertia_of_the_robot(name):
    # m, (0, 0, h) and m (l^2 + w^2) / 12 about the vertical through it; wheels and knuckles are taken as
    # points at the corners there: their own inertia adds less than (4 * 0.01 + 2 * 0.005) m r^2, r = 0.16 l
    robot = ROBOTS[name]
    vehicle, simulator = built(robot)
    plant = vehicle.plant
    context = plant.GetMyContextFromRoot(simulator.get_context())
    assert plant.CalcTotalMass(context) == pytest.approx(robot.mass, rel=1e-12)
    vehicle.set_state(plant.GetMyMutableContextFromRoot(simulator.get_mutable_context()), State(*[0.0] * 7))
    centre = plant.CalcCenterOfMassPositionInWorld(context)
    sink = 1e-3 * robot.wheelbase
    np.testing.assert_allclose(centre, [0.0, 0.0, robot.com_height - sink], atol=1e-12)
    whole = plant.CalcSpatialInertia(
        context,
        plant.world_frame(),
        plant.GetBodyIndices(plant.GetBodyByName("chassis").model_instance()),
    ).Shift(centre)
    yaw = whole.CalcRotationalInertia().CopyToFullMatrix3()[2, 2]
    box = robot.mass * (robot.wheelbase**2 + robot.track**2) / 12.0
    assert 0.0 <= yaw - box <= 0.05 * robot.mass * (0.16 * robot.wheelbase) ** 2


def test_loads_in_a_steady_turn_are_those_of_moments(turn):
    # a rigid body on four wheels: moments about the contact points; the elastic tyres share the load of the
    # turn between front and rear within the lean of the body
    steady = turn.t > 1.0
    loads = per_wheel(turn, "load")[:, steady]
    forward = turn.longitudinal_force[steady].mean() / ROBOT.mass
    expected = wheel_loads(ROBOT, WheelGeometry.of(ROBOT), forward, turn.lateral_acceleration[steady].mean())
    np.testing.assert_allclose(loads.mean(axis=1), expected, rtol=0.02)
    left, right = loads[[0, 2]].sum(axis=0), loads[[1, 3]].sum(axis=0)
    # moments about the line of the centre of mass: (N_right - N_left) w / 2 = m a h; and the wheels, with
    # spin momentum m_s r v, are turned by v / R, which takes m_s r v^2 / R (m_s: 2 % of the mass, r = 0.08 m)
    arm = ROBOT.com_height + 0.02 * 0.08
    moment = ROBOT.mass * turn.lateral_acceleration[steady] * arm
    np.testing.assert_allclose((right - left) * 0.5 * ROBOT.track, moment, rtol=5e-3)


def test_loads_sum_to_the_weight(turn):
    # nothing moves up or down but by the millimetres of the tyres
    total = per_wheel(turn, "load")[:, 1:].sum(axis=0)
    np.testing.assert_allclose(total, ROBOT.mass * GRAVITY, rtol=5e-3)


def test_loads_of_a_body_that_lifts_are_on_the_other_wheels():
    # beyond the tip limit all is on the outer side, beyond pitch-over all on the front
    wheels = WheelGeometry.of(ROBOT)
    tip = ROBOT.tip_acceleration
    np.testing.assert_allclose(wheel_loads(ROBOT, wheels, 0.0, 1.2 * tip)[[0, 2]], 0.0)
    assert wheel_loads(ROBOT, wheels, 0.0, 1.2 * tip).sum() == pytest.approx(ROBOT.mass * GRAVITY)
    pitch = GRAVITY * ROBOT.wheelbase / (2.0 * ROBOT.com_height)
    np.testing.assert_allclose(wheel_loads(ROBOT, wheels, -1.1 * pitch, 0.0)[2:], 0.0)


def test_steady_turn_has_the_acceleration_of_its_radius(turn):
    # a = v^2 / R and r = v / R; across the path, from which the body is turned by asin(l / (2 R)) (rolling)
    steady = turn.t > 1.0
    beta = np.arctan2(turn.lateral_velocity, turn.longitudinal_velocity)[steady]
    np.testing.assert_allclose(beta, math.asin(0.5 * 0.5 / 3.0), atol=5e-3)
    np.testing.assert_allclose(turn.yaw_rate[steady], turn.v[steady] / 3.0, rtol=5e-3)
    along, across = turn.longitudinal_force[steady] / ROBOT.mass, turn.lateral_acceleration[steady]
    sideways = across * np.cos(beta) - along * np.sin(beta)
    np.testing.assert_allclose(sideways, turn.v[steady] ** 2 / 3.0, rtol=5e-3)


@pytest.mark.parametrize("name", ROBOTS)
def test_straight_motion_is_as_planned_and_ends_at_rest(name):
    # from rest at full drive to rest at full brakes: the floor gives m a, wheels and released brakes take
    # none of it, and m v^2 / 2 is the work of the tyres
    robot = ROBOTS[name]
    motion = straight(1.5, start=0.0, end=0.0, cruise=1.0)
    run = simulate(robot, motion)
    assert run.details["arrived"]
    assert run.details["travel_time"] == pytest.approx(motion.travel_time, rel=0.01)
    assert math.hypot(run.x[-1] - motion.x[-1], run.y[-1] - motion.y[-1]) < 5e-3
    assert np.abs(run.v[-1]) < 5e-3  # the body nods on its tyres when the wheels stand
    assert run.v.min() > -5e-3
    speeding = (run.t > 0.3) & (run.t < 0.8)
    np.testing.assert_allclose(run.longitudinal_force[speeding], robot.mass * 1.0, rtol=0.02)
    along = np.hypot(run.x - run.x[0], run.y - run.y[0])
    force = run.longitudinal_force
    work = np.concatenate([[0.0], np.cumsum(0.5 * (force[1:] + force[:-1]) * np.diff(along))])
    # the force jumps by m a within a row of 10 ms a few times, at up to 1 m/s
    np.testing.assert_allclose(work, 0.5 * robot.mass * run.v**2, atol=0.02 * robot.mass)
    assert not run.details["slid"]
    assert not run.details["wheel_lift"]


def test_released_brakes_give_no_torque():
    # torque = drive + brake; all four together give r F (1 + what turning the wheels adds, 2 % of the mass)
    motion = straight(2.0, start=0.0, end=1.9, cruise=1.9)
    run = simulate(ROBOT, motion)
    steady = (run.t > 0.3) & (run.t < run.t[-1] - 0.1)
    given = per_wheel(run, "torque")[:, steady].sum(axis=0)
    wheels = WheelGeometry.of(ROBOT)
    told = wheels.radius * run.force_command[steady] * (1.0 + wheels.spin_mass / ROBOT.mass)
    np.testing.assert_allclose(given, told, rtol=1e-2)


def test_brakes_hold_a_standing_vehicle():
    # after a stop in a bend, wheels turned: ten seconds on nothing has moved by more than a hundredth of a mm
    motion = circle(1.5, 1.0)
    loop = tracking_diagram(ROBOT, motion, model="four_wheel")
    simulator = started(loop, loop.start)
    context = simulator.get_mutable_context()
    loop.ask_to_stop(context, 0.5, straightened=False)
    simulator.AdvanceTo(3.0)
    first = np.array(loop.vehicle.state(context))
    simulator.AdvanceTo(6.0)
    later = np.array(loop.vehicle.state(context))
    np.testing.assert_allclose(later[:3], first[:3], atol=1e-5)
    assert np.abs(later[3:6]).max() < 1e-4


def test_mirrored_trajectory_gives_the_mirrored_run(curve, curve_run):
    # the contact solver sweeps the wheels in one order, left and right are not the same to it: it ends
    # within its relative tolerance of 1e-6 a step
    run = simulate(ROBOT, mirrored(curve))
    tolerance = 1e-4
    for name in ("y", "heading", "lateral_velocity", "yaw_rate", "steering"):
        np.testing.assert_allclose(
            getattr(run, name), -getattr(curve_run, name), atol=tolerance, err_msg=name
        )
    for name in ("x", "v"):
        np.testing.assert_allclose(getattr(run, name), getattr(curve_run, name), atol=tolerance, err_msg=name)
    loads, other = per_wheel(run, "load")[:, 1:], per_wheel(curve_run, "load")[[1, 0, 3, 2], 1:]
    np.testing.assert_allclose(loads, other, atol=0.01 * ROBOT.mass * GRAVITY)


def test_turned_and_moved_trajectory_gives_the_same_run(curve, curve_run):
    # what differs is rounding, and by it now and then one more round of the contact solver, whose relative
    # tolerance is 1e-6: micrometres. Headings cross pi on the way, and the quaternion is not a unit one.
    angle, cosine, sine = 2.0, math.cos(2.0), math.sin(2.0)
    x, y = cosine * curve.x - sine * curve.y + 30.0, sine * curve.x + cosine * curve.y - 7.0
    run = simulate(ROBOT, replace(curve, x=x, y=y, heading=curve.heading + angle))
    np.testing.assert_allclose(run.x, cosine * curve_run.x - sine * curve_run.y + 30.0, atol=1e-5)
    np.testing.assert_allclose(run.y, sine * curve_run.x + cosine * curve_run.y - 7.0, atol=1e-5)
    np.testing.assert_allclose(run.v, curve_run.v, atol=1e-4)


def test_runs_repeat_bit_by_bit(curve, curve_run):
    run = simulate(ROBOT, curve)
    for name, column in run.columns.items():
        assert np.array_equal(column, curve_run.columns[name]), name


def test_result_does_not_depend_on_the_step(curve, curve_run):
    # first order in the step: tyres creep by about a millimetre a second less at half of it. Along the path
    # that is time, a thousandth; across it feedback takes most of it back.
    fine = simulate(ROBOT, curve, step=1e-3)
    assert fine.details["travel_time"] == pytest.approx(curve_run.details["travel_time"], rel=1e-3)
    for run in (fine, curve_run):
        assert lateral_error(curve, run.x, run.y).max() < 5e-3
    x, y = (np.interp(curve_run.t, fine.t, column) for column in (fine.x, fine.y))
    apart = np.hypot(x - curve_run.x, y - curve_run.y)
    assert apart.max() < 1e-3 * curve.length


def test_run_starts_on_the_first_row_and_ends_on_the_goal_line(curve, curve_run):
    assert (curve_run.x[0], curve_run.y[0]) == (curve.x[0], curve.y[0])
    assert curve_run.v[0] == pytest.approx(curve.v[0], rel=1e-12)
    course = curve.heading[-1]
    beyond = (curve_run.x[-1] - curve.x[-1]) * math.cos(course)
    beyond += (curve_run.y[-1] - curve.y[-1]) * math.sin(course)
    # the last step at constant speed to the line: off by at most a dt^2 / 2, and one step of the plant
    assert abs(beyond) < 0.5 * 2e-3 + 1e-4


def test_columns_are_those_of_both_models_and_then_its_own(curve_run, tmp_path):
    assert (*run_columns()[1:], *curve_run.channels) == RECORD
    file = tmp_path / "simulation.csv"
    curve_run.to_csv(file)
    header = file.read_text(encoding="utf-8").splitlines()[0].split(",")
    rows = np.loadtxt(file, delimiter=",", skiprows=1)
    for name, column in zip(header, rows.T, strict=True):
        assert np.array_equal(column, curve_run.columns[name]), name
    gaps = np.diff(curve_run.t)
    np.testing.assert_allclose(gaps[:-1], 0.01, atol=1e-9)
    assert 0.0 < gaps[-1] <= 0.01 + 1e-9


def test_warehouse_corner_is_tracked():
    motion = corridors(start=0.0, end=0.0, cruise=1.9, straights=(4.0, 3.0))
    run = simulate(ROBOT, motion)
    assert lateral_error(motion, run.x, run.y).max() < 0.02
    assert run.details["travel_time"] == pytest.approx(motion.travel_time, rel=0.01)
    assert not run.details["slid"]


def test_a_vehicle_that_is_heavier_than_believed_is_driven_by_the_believed_force():
    # 20 % more mass on the same torque: a = F / (1.2 m), less what feedback, capped by the drive, cannot add
    motion = straight(2.0, start=0.0, end=1.9, cruise=1.9)
    run = simulate(ROBOT, motion, actual=replace(ROBOT, mass=1.2 * ROBOT.mass))
    part = (run.t > 0.5) & (run.t < 1.5)
    slope = np.polyfit(run.t[part], run.v[part], 1)[0]
    assert slope == pytest.approx(1.0 / 1.2, rel=0.02)


def test_point_robot_unknown_model_and_step_are_refused(curve):
    with pytest.raises(ValueError, match="point robot"):
        simulate(Robot(radius=0.0), curve)
    with pytest.raises(ValueError, match="model = 'bicycle'"):
        simulate(ROBOT, curve, model="bicycle")
    with pytest.raises(ValueError, match="step = "):
        simulate(ROBOT, curve, step=5e-3)


@pytest.mark.parametrize("model", ["four_wheel", "single_track"])
def test_reversing_is_refused(model):
    motion = straight(1.0, start=0.5, end=0.5, cruise=0.5)
    back = replace(motion, v=np.append(motion.v[:-1], -0.5))
    with pytest.raises(ValueError, match="reversing is not supported"):
        simulate(ROBOT, back, model=model)


@pytest.mark.parametrize("robot", [replace(ROBOT, com_height=0.5), replace(LARGE, com_height=0.9)])
def test_a_body_rolls_to_and_fro_in_its_swing_time(robot):
    # track below wheelbase, so rolling is the slower swing; damping, 0.2 of critical, lengthens it by 2 %
    vehicle, simulator = built(robot)
    context = vehicle.plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    vehicle.set_state(context, State(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    values = vehicle.plant.GetPositionsAndVelocities(context).copy()
    lean = 0.2 * SINK * robot.wheelbase / robot.track  # no wheel leaves the floor
    values[:4] = [math.cos(0.5 * lean), math.sin(0.5 * lean), 0.0, 0.0]
    vehicle.plant.SetPositionsAndVelocities(context, values)
    simulator.Initialize()
    rolls = []
    for tick in range(1, 400):
        simulator.AdvanceTo(tick * 2e-3)
        rolls.append(vehicle.plant.GetPositions(context)[1])
    falling = [k for k in range(1, len(rolls)) if rolls[k - 1] > 0.0 >= rolls[k]]
    period = (falling[1] - falling[0]) * 2e-3
    assert period == pytest.approx(swing_time(robot), rel=0.1)


@pytest.mark.parametrize("forward", [3.0, -3.0])
def test_a_run_begins_with_the_loads_of_its_acceleration(forward):
    # the body leans as it will while it accelerates: the first loads are of the closed form, not of rest
    robot = replace(LARGE, com_height=0.4, friction=1.0, max_acceleration=3.0, max_braking=3.0)
    start, end = (1.0, 4.0) if forward > 0.0 else (4.0, 1.0)
    motion = straight(2.5, start=start, end=end, cruise=4.0, rate=3.0)
    run = simulate(robot, motion)
    expected = wheel_loads(robot, WheelGeometry.of(robot), forward, 0.0)
    found = per_wheel(run, "load")[:, 1:6].mean(axis=1)
    np.testing.assert_allclose(found, expected, rtol=0.1)
    at_rest = robot.mass * GRAVITY / 4.0
    assert np.all(np.abs(expected - at_rest) > 0.3 * at_rest)
