"""Limits of the robot (Manor 2015, Lemma A.1) and the braking law (eq. 3.13, reaction time and margin)."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vnav_drake.braking import UniformBraking
from vnav_drake.robot import GRAVITY, Robot

finite = st.floats(0.1, 5.0)
laws = st.builds(
    UniformBraking,
    max_braking=finite,
    reaction_time=st.one_of(st.just(0.0), st.floats(0.01, 2.0)),
    margin=st.floats(0.0, 0.5),
)


def test_smallest_turning_radius_of_lemma_a1():
    # eq. (A.1) with tan(omega_max) = 1/2: r_kin = l sqrt(1/4 + 4) = l sqrt(17) / 2.
    robot = Robot(radius=0.4, wheelbase=0.8, max_steering=math.atan(0.5))
    assert 1.0 / robot.max_curvature == pytest.approx(0.4 * math.sqrt(17.0), rel=1e-14)


def test_largest_steering_angle_gives_the_largest_curvature():
    robot = Robot(radius=0.4, wheelbase=0.6, max_steering=0.55)
    assert robot.steering_angle(robot.max_curvature) == pytest.approx(0.55, rel=1e-12)


@given(wheelbase=st.floats(0.1, 3.0), angle=st.floats(-1.4, 1.4))
def test_steering_angle_follows_from_the_turning_centre(wheelbase: float, angle: float):
    # The centre of turning lies on the rear axle's line, l / tan(omega) to the left of the rear axle's
    # middle; the centre of mass is l / 2 ahead of that.
    if abs(angle) < 1e-3:
        angle = 1e-3
    radius = math.copysign(math.hypot(wheelbase / math.tan(angle), 0.5 * wheelbase), angle)
    robot = Robot(radius=0.4, wheelbase=wheelbase)
    assert robot.steering_angle(1.0 / radius) == pytest.approx(angle, rel=1e-9)


def test_straight_ahead_needs_no_steering():
    assert Robot(radius=0.4).steering_angle(0.0) == 0.0


def test_tall_robot_tips_at_2_58():
    # eq. (A.3): g w / (2 h) = 9.81 * 0.5 / 1.9 = 4.905 / 1.9
    robot = Robot(radius=0.4, track=0.5, com_height=0.95)
    assert robot.tip_acceleration == pytest.approx(4.905 / 1.9, rel=1e-14)
    assert round(robot.tip_acceleration, 2) == 2.58


def test_robot_with_its_mass_on_the_floor_never_tips():
    assert Robot(radius=0.4, com_height=0.0).tip_acceleration == math.inf


def test_friction_circle_has_radius_mu_g():
    assert Robot(radius=0.4, friction=0.5).friction_acceleration == pytest.approx(4.905, rel=1e-14)


def test_reserved_lateral_acceleration_and_full_braking_fill_the_friction_circle():
    # A 3-4-5 triangle: mu g = 5, a_b = 3 leave 4 for turning.
    robot = Robot(radius=0.4, friction=5.0 / GRAVITY, max_braking=3.0)
    assert robot.reserved_lateral_acceleration() == pytest.approx(4.0, rel=1e-12)


def test_nothing_is_reserved_when_braking_takes_all_the_friction():
    robot = Robot(radius=0.4, friction=1.0 / GRAVITY, max_braking=1.0)
    assert robot.reserved_lateral_acceleration() == pytest.approx(0.0, abs=1e-7)


def test_safe_speed_without_reaction_time_is_the_square_root_of_twice_a_d():
    # eq. (3.13): V = sqrt(2 a_b d); a_b = 2, d = 4 give 4.
    assert UniformBraking(max_braking=2.0).speed(4.0) == pytest.approx(4.0, rel=1e-15)


def test_safe_speed_with_reaction_time_and_margin():
    # v t_r + v^2 / (2 a_b) + m = 3 * 0.5 + 9 / 6 + 0.25 = 3.25
    law = UniformBraking(max_braking=3.0, reaction_time=0.5, margin=0.25)
    assert law.speed(3.25) == pytest.approx(3.0, rel=1e-15)
    assert law.distance(3.0) == pytest.approx(3.25, rel=1e-15)


@given(law=laws, room=st.floats(1e-6, 50.0))
def test_the_distance_of_the_safe_speed_is_the_clearance(law: UniformBraking, room: float):
    clearance = law.margin + room
    assert law.distance(law.speed(clearance)) == pytest.approx(clearance, rel=1e-12)


@given(law=laws, short=st.floats(-5.0, 0.0))
def test_no_speed_is_safe_within_the_margin(law: UniformBraking, short: float):
    assert law.speed(law.margin + short) <= 1e-15
    assert law.speed_slope(law.margin - 0.1 + short) == 0.0


@given(law=laws, room=st.floats(0.01, 50.0))
def test_slopes_are_the_derivatives(law: UniformBraking, room: float):
    # Central differences with relative step 1e-5: truncation h^2 V'''/6 is below 1e-9 of V' here,
    # as V varies on the scale of the room.
    clearance = law.margin + room
    step = 1e-5 * room
    difference = (law.speed(clearance + step) - law.speed(clearance - step)) / (2.0 * step)
    assert law.speed_slope(clearance) == pytest.approx(difference, rel=1e-7)
    speed = float(law.speed(clearance))
    step = 1e-3 * speed  # the law is quadratic: central differences have no truncation error
    difference = (law.distance(speed + step) - law.distance(speed - step)) / (2.0 * step)
    assert law.distance_slope(speed) == pytest.approx(difference, rel=1e-9)


@given(law=laws, room=st.floats(1e-3, 50.0))
def test_slopes_of_inverse_functions_are_reciprocal(law: UniformBraking, room: float):
    clearance = law.margin + room
    product = law.speed_slope(clearance) * law.distance_slope(law.speed(clearance))
    assert product == pytest.approx(1.0, rel=1e-12)


@given(braking=finite, room=st.floats(0.0, 50.0), factor=st.floats(0.1, 10.0))
def test_uniform_law_scales_as_the_root_of_the_braking(braking: float, room: float, factor: float):
    slow, fast = UniformBraking(max_braking=braking), UniformBraking(max_braking=braking * factor)
    assert fast.speed(room) == pytest.approx(math.sqrt(factor) * slow.speed(room), rel=1e-12)


@given(law=laws, factor=st.floats(0.1, 10.0), room=st.floats(1e-3, 50.0))
def test_law_keeps_its_form_when_lengths_are_scaled(law: UniformBraking, factor: float, room: float):
    # Lengths times c at the same a_b: times and speeds grow by sqrt(c).
    root = math.sqrt(factor)
    scaled = UniformBraking(
        max_braking=law.max_braking, reaction_time=root * law.reaction_time, margin=factor * law.margin
    )
    # the room itself carries the rounding of margin + room, 1e-16 / 1e-3 at worst
    speed = law.speed(law.margin + room)
    assert scaled.speed(factor * (law.margin + room)) == pytest.approx(root * speed, rel=1e-9)


def test_short_reaction_time_approaches_none():
    # V = -lag + sqrt(lag^2 + 2 a d) with lag = a t_r: to first order V falls by lag = 1e-9 m/s.
    clearance = np.linspace(0.1, 10.0, 50)
    none, short = (
        UniformBraking(max_braking=1.0, reaction_time=0.0),
        UniformBraking(max_braking=1.0, reaction_time=1e-9),
    )
    assert none.speed(clearance) - short.speed(clearance) == pytest.approx(1e-9, rel=1e-5)


def test_long_reaction_time_loses_no_digits():
    # lag = 1e6 m/s: V = 2 a d / (lag + sqrt(lag^2 + 2 a d)) = d / t_r up to d / (a t_r^2) = 1e-12.
    law = UniformBraking(max_braking=1.0, reaction_time=1e6)
    assert law.speed(1.0) == pytest.approx(1e-6, rel=1e-11)


def test_speed_is_capped_with_slope_zero():
    law = UniformBraking(max_braking=1.0, max_speed=2.0)
    # sqrt(2 d) reaches 2 at d = 2.
    clearance = np.array([1.9, 2.1, 50.0])
    assert law.speed(clearance) == pytest.approx([math.sqrt(3.8), 2.0, 2.0])
    assert law.speed_slope(clearance) == pytest.approx([1.0 / math.sqrt(3.8), 0.0, 0.0])


def test_one_call_answers_arrays_of_any_shape():
    law = UniformBraking(max_braking=1.0, reaction_time=0.1)
    clearance = np.linspace(-1.0, 3.0, 12).reshape(3, 4)
    for function in (law.speed, law.speed_slope, law.distance, law.distance_slope):
        table = function(clearance)
        assert table.shape == (3, 4)
        assert table[1, 2] == function(clearance[1, 2])


@pytest.mark.parametrize(
    ("name", "bad"),
    [
        *[
            (name, 0.0)
            for name in ("mass", "wheelbase", "track", "friction", "max_braking", "max_acceleration")
        ],
        *[(name, 0.0) for name in ("max_speed", "max_steering", "max_steering_rate")],
        *[(name, -0.1) for name in ("radius", "com_height", "mass", "max_speed")],
        *[(name, math.nan) for name in ("radius", "mass", "max_speed", "max_steering", "max_steering_rate")],
        *[(name, math.inf) for name in ("radius", "friction", "max_braking", "com_height")],
        ("max_steering", 0.5 * math.pi),
    ],
)
def test_robots_that_cannot_be_are_refused(name: str, bad: float):
    with pytest.raises(ValueError, match=f"^{name} = "):
        Robot(**{"radius": 0.4, name: bad})


@pytest.mark.parametrize(
    ("name", "bad"),
    [
        *[("max_braking", bad) for bad in (0.0, -1.0, math.nan, math.inf)],
        *[(name, bad) for name in ("reaction_time", "margin") for bad in (-0.1, math.nan, math.inf)],
        *[("max_speed", bad) for bad in (0.0, math.nan)],
    ],
)
def test_braking_laws_that_cannot_be_are_refused(name: str, bad: float):
    with pytest.raises(ValueError, match=f"^{name} = "):
        UniformBraking(**{"max_braking": 1.0, name: bad})
