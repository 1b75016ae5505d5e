"""The single-track vehicle alone: forces, invariances, order of its integration."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from systems.single_track import Body, SingleTrackVehicle, State, state_derivatives, tyre_forces
from systems.tyre import CORNERING_STIFFNESS, brush_force, brush_slip, brush_slope, full_slide
from vnav_drake.robot import GRAVITY, Robot

ROBOT = Robot(radius=0.4)
BODY = Body.of(ROBOT)


def coast(robot: Robot, state: State, steering: float, force: float, duration: float, step: float) -> State:
    """Open loop with constant commands."""
    builder = DiagramBuilder()
    vehicle = builder.AddSystem(SingleTrackVehicle(robot))
    command = builder.AddSystem(ConstantVectorSource([steering, force]))
    builder.Connect(command.get_output_port(), vehicle.get_input_port())
    simulator = Simulator(builder.Build())
    ApplySimulatorConfig(
        SimulatorConfig(integration_scheme="runge_kutta3", max_step_size=step, use_error_control=False),
        simulator,
    )
    simulator.get_mutable_context().SetContinuousState(list(state))
    simulator.AdvanceTo(duration)
    return State(*simulator.get_context().get_continuous_state_vector().CopyToVector())


def random_states(count: int) -> list[State]:
    rng = np.random.default_rng(7)
    low = [-5, -5, -4, -3, -2, -6, -0.6]
    return [State(*row) for row in rng.uniform(low, -np.array(low), (count, 7)).tolist()]


def test_brush_tyre_is_linear_at_first_and_all_friction_when_it_slides():
    # Fiala: f = mu (1 - (1 - z/3)^3), z = c s / mu: slope c at 0, mu at z = 3, half way mu (1 - 1/8)
    mu = 0.6
    assert brush_force(1e-7, mu) == pytest.approx(CORNERING_STIFFNESS * 1e-7, rel=1e-5)
    assert brush_force(0.5 * full_slide(mu), mu) == pytest.approx(mu * 7 / 8, rel=1e-12)
    assert brush_force(full_slide(mu), mu) == mu
    assert brush_force(-10.0, mu) == -mu


def test_brush_slip_inverts_brush_force():
    slip = np.linspace(-0.99, 0.99, 41) * full_slide(0.6)
    force = np.array([brush_force(s, 0.6) for s in slip])
    np.testing.assert_allclose(brush_slip(force, 0.6), slip, atol=1e-12)
    h = 1e-8  # the second derivative jumps at zero slip
    slope = [(brush_force(s + h, 0.6) - brush_force(s - h, 0.6)) / (2 * h) for s in slip]
    np.testing.assert_allclose(brush_slope(slip, 0.6), slope, atol=1e-5)


def test_tyres_never_exceed_friction_and_carry_the_weight():
    # the sum of two vectors, each within mu times its load, is within mu times the weight
    weight = BODY.mass * GRAVITY
    for state in random_states(300):
        for force in (-100.0, 0.0, 100.0):
            f = tyre_forces(BODY, state, force)
            assert math.hypot(f.longitudinal, f.lateral) <= BODY.friction * weight * (1 + 1e-12)
            assert 0.0 <= f.front_load <= weight


def test_tyres_without_drive_only_take_energy():
    # each tyre pushes against its slip, so the power F . v + M r is never positive
    for state in random_states(300):
        f = tyre_forces(BODY, state, 0.0)
        power = f.longitudinal * state.longitudinal_velocity + f.lateral * state.lateral_velocity
        assert power + f.yaw_moment * state.yaw_rate <= 1e-9


def test_mirrored_state_has_mirrored_derivative():
    sign = np.array([1, -1, -1, 1, -1, -1, -1])
    for state in random_states(50):
        left = state_derivatives(BODY, state, 0.2, 15.0)
        right = state_derivatives(BODY, (sign * np.array(state)).tolist(), -0.2, 15.0)
        np.testing.assert_allclose(right, sign * np.array(left), rtol=1e-12, atol=1e-12)


def test_load_moves_forward_in_braking():
    # N_f = m (g + h a_b / b) / 2 with b half the wheelbase: moments about the rear contact
    f = tyre_forces(BODY, State(0, 0, 0, 2.0, 0, 0, 0), -BODY.mass)
    assert f.front_load == pytest.approx(0.5 * 40 * (GRAVITY + 0.12 * 1.0 / 0.25), rel=1e-12)


@pytest.mark.parametrize(("friction", "deceleration"), [(0.6, 1.0), (0.05, 0.05 * GRAVITY)])
def test_braking_distance_is_that_of_the_weaker_of_brakes_and_friction(friction, deceleration):
    # constant deceleration: v^2 / (2 a) in v / a, exact for a Runge-Kutta scheme of third order
    robot = replace(ROBOT, friction=friction)
    end = coast(robot, State(0, 0, 0, 2.0, 0, 0, 0), 0.0, -1000.0, 2.0 / deceleration, 2.5e-3)
    assert end.x == pytest.approx(4.0 / (2.0 * deceleration), rel=1e-9)
    assert end.longitudinal_velocity == pytest.approx(0.0, abs=1e-9)


def test_integration_converges_with_third_order():
    # error ~ h^3: successive differences shrink by 8. Short enough a steering angle to stay on the smooth
    # part of the tyre; the loss of the two fast modes (3 c g l^2/(l^2 + w^2)/v = 120 1/s) is resolved.
    start = State(0, 0, 0, 1.5, 0, 0, 0)
    ends = [np.array(coast(ROBOT, start, 0.1, 10.0, 0.6, h)) for h in (2e-3, 1e-3, 5e-4, 2.5e-4)]
    change = [np.abs(b - a)[:6].max() for a, b in pairwise(ends)]
    ratios = np.array(change[:-1]) / change[1:]
    assert np.all((ratios > 6.0) & (ratios < 10.5)), ratios


def test_steering_keeps_its_rate_and_angle():
    robot = replace(ROBOT, max_steering_rate=0.5)
    still = State(0, 0, 0, 0, 0, 0, 0)
    assert coast(robot, still, 5.0, 0.0, 0.4, 2.5e-3).steering == pytest.approx(0.2, rel=1e-6)  # 0.5 * 0.4
    assert coast(robot, still, 5.0, 0.0, 4.0, 2.5e-3).steering == pytest.approx(0.6, rel=1e-6)


def test_standing_vehicle_stands():
    still = State(1.0, 2.0, 0.7, 0, 0, 0, 0.3)
    assert coast(ROBOT, still, 0.3, 0.0, 5.0, 2.5e-3)[:6] == still[:6]


@pytest.mark.parametrize("track", [1e-3, 0.4])
def test_stiffest_body_is_stable_at_the_largest_step(track):
    # yaw and sideslip of a vehicle that hardly rolls must die out, whatever the body (see rolling_speed)
    end = coast(replace(ROBOT, track=track), State(0, 0, 0, 0.01, 0.01, 0.05, 0), 0.0, 0.0, 1.0, 2.5e-3)
    assert abs(end.yaw_rate) < 1e-6
    assert abs(end.lateral_velocity) < 1e-6


def test_spinning_vehicle_loses_at_most_mu_g():
    # |dv/dt| <= mu g on any motion: after t, v >= v0 - mu g t, and it comes to rest
    start = State(0, 0, 0, 2.0, 2.0, 6.0, 0.6)
    speed = math.hypot(2.0, 2.0)
    after = coast(ROBOT, start, 0.6, 0.0, 0.2, 1.25e-3)
    assert math.hypot(after.longitudinal_velocity, after.lateral_velocity) >= speed - 0.6 * GRAVITY * 0.2
    late = coast(ROBOT, start, 0.0, -40.0, 1.0, 1.25e-3)
    assert math.hypot(late.longitudinal_velocity, late.lateral_velocity) < speed
