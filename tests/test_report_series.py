"""What the report draws and how it writes numbers: exact cases."""

from __future__ import annotations

import math
import re

import matplotlib
import numpy as np
import pytest
from report_case import corner_path, motion, warehouse

from verify.report import numbers, palette
from verify.report.evidence import SimulatedRun
from verify.report.series import distance_at, in_steps, margins, mesh_of, row_ends, thinned, tracking
from verify.report.text import label, plain, visible
from vnav_drake.plan import Trajectory


def arc_motion(
    *, radius: float, speed: float, angle: float, rows: int, acceleration: float = 0.0
) -> Trajectory:
    """A left turn about (0, radius) from the origin, in rows of equal length."""
    s = np.linspace(0.0, radius * angle, rows)
    v = np.sqrt(speed**2 + 2.0 * acceleration * s)
    t = (v - speed) / acceleration if acceleration else s / speed
    heading = s / radius
    x, y = radius * np.sin(heading), radius * (1.0 - np.cos(heading))
    one = np.ones(rows)
    return Trajectory(t, x, y, heading, v, acceleration * one, one / radius, one)


def test_thinning_keeps_both_ends_and_every_extreme_of_a_bucket():
    x = np.arange(10_000.0)
    y = np.zeros(10_000)
    y[[17, 5003, 9998]] = (3.0, -2.0, 7.0)  # single points between thousands of others
    few_x, few_y = thinned(x, y, 100)
    assert len(few_x) <= 400
    assert (few_x[0], few_x[-1]) == (0.0, 9999.0)
    assert {17.0, 5003.0, 9998.0} <= set(few_x)
    assert np.all(np.diff(few_x) > 0.0)
    assert (few_y.max(), few_y.min()) == (7.0, -2.0)


def test_few_points_are_left_alone():
    x = np.arange(50.0)
    assert thinned(x, x)[0] is x


def test_row_ends_hold_the_acceleration_of_their_own_row():
    # Two rows: 1 m/s^2 up for 1 s from rest, then 2 m/s^2 down for 0.5 s: v = 0, 1, 0.
    path = Trajectory(
        np.array([0.0, 1.0, 1.5]), np.array([0.0, 0.5, 0.75]), np.zeros(3), np.zeros(3),
        np.array([0.0, 1.0, 0.0]), np.array([1.0, -2.0, -2.0]), np.array([0.1, -0.2, -0.2]), np.ones(3),
    )  # fmt: skip
    rows = row_ends(path)
    assert rows.v.tolist() == [0.0, 1.0, 1.0, 0.0]
    assert rows.a.tolist() == [1.0, 1.0, -2.0, -2.0]
    assert rows.lateral.tolist() == pytest.approx(
        [0.0, 0.1, -0.2, 0.0]
    )  # v^2 kappa on both sides of the joint


def test_kinks_have_no_duration_and_draw_nothing():
    path = Trajectory(
        np.array([0.0, 1.0, 1.0, 2.0]), np.array([0.0, 1.0, 1.0, 1.0]), np.array([0.0, 0.0, 0.0, 1.0]),
        np.array([0.0, 0.0, math.pi / 2, math.pi / 2]), np.ones(4), np.zeros(4), np.zeros(4), np.ones(4),
    )  # fmt: skip
    assert row_ends(path).t.tolist() == [0.0, 1.0, 1.0, 2.0]


def test_distance_within_a_row_is_quadratic_in_time():
    # From rest at 0.8 m/s^2: s = 0.4 t^2.
    path = arc_motion(radius=5.0, speed=1e-9, angle=1.0, rows=12, acceleration=0.8)
    t = np.linspace(0.0, path.t[-1], 57)
    assert distance_at(path, t) == pytest.approx(0.4 * t**2, abs=1e-7)
    fine_t, fine_s, fine_v, _ = in_steps(path, 5)
    assert len(fine_t) == 5 * 11 + 1
    assert fine_v == pytest.approx(np.sqrt(1.6 * fine_s), abs=1e-4)  # v^2 = 2 a s


def test_margins_of_a_steady_turn_have_their_closed_forms():
    # Speed v, radius r, clearance 1 m: braking 1 - v^2/2, friction 0.6 g - v^2/r, tip 0.4 g / 0.24 - v^2/r.
    problem = warehouse().problem
    found = {m.key: m for m in margins(arc_motion(radius=4.0, speed=1.2, angle=0.5, rows=20), problem)}
    assert found["braking"].value == pytest.approx(1.0 - 1.2**2 / 2.0)
    assert found["friction"].value == pytest.approx(0.6 * 9.81 - 1.44 / 4.0)
    assert found["tip"].value == pytest.approx(9.81 * 0.4 / 0.24 - 1.44 / 4.0)
    assert found["drive"].value == pytest.approx(1.0)
    assert found["steering"].value == pytest.approx(problem.robot.max_curvature - 0.25)
    assert "speed" not in found  # this robot has no top speed
    assert "reserve" not in found  # and keeps no friction in reserve


def test_the_worst_point_is_the_least_margin():
    path = arc_motion(radius=4.0, speed=0.5, angle=1.0, rows=30, acceleration=0.3)
    friction = next(m for m in margins(path, warehouse().problem) if m.key == "friction")
    assert friction.value[friction.worst] == friction.value.min()
    assert friction.t[friction.worst] == path.t[-1]  # fastest, so most friction, at the end


def test_the_mesh_has_one_interval_for_each_curvature():
    # Straight, arc, straight, each cut into many rows: three intervals of the lengths of the pieces.
    path = corner_path(1.6)
    mesh = mesh_of(motion(warehouse(), path, share=0.9, ends=0.0))
    assert mesh.lengths == pytest.approx(path.piece_length, rel=1e-6)


@pytest.mark.parametrize("offset", [0.02, -0.05])
def test_tracking_error_is_the_distance_across_the_plan(offset):
    # A run on the concentric circle of radius r - offset, in step with the plan: offset to the left.
    radius = 4.0
    plan = arc_motion(radius=radius, speed=1.0, angle=1.5, rows=3000)
    angle = plan.heading
    run = SimulatedRun(
        plan.t,
        (radius - offset) * np.sin(angle),
        radius - (radius - offset) * np.cos(angle),
        angle,
        plan.v + 0.1,
    )
    errors = tracking(plan, run)
    assert errors.lateral == pytest.approx(offset, abs=1e-6)
    assert errors.along == pytest.approx(0.0, abs=1e-6)
    assert errors.speed_error == pytest.approx(0.1)


def test_a_run_behind_its_plan_lags_by_speed_times_delay():
    plan = arc_motion(radius=50.0, speed=2.0, angle=0.5, rows=4000)
    late = plan.t >= 0.1
    x, y, heading, v, *_ = plan.at(plan.t[late] - 0.1)
    errors = tracking(plan, SimulatedRun(plan.t[late], x, y, heading, v))
    assert errors.along == pytest.approx(-0.2, abs=1e-6)
    assert errors.lateral == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(
    ("ratio", "text"),
    [(0.0, "0.000 %"), (2.96e-5, "0.003 %"), (1e-7, "< 0.001 %"), (-1e-7, "> −0.001 %"), (0.0605, "6.05 %"),
     (0.123, "12.3 %"), (-0.02, "−2.00 %"), (None, "–")],
)  # fmt: skip
def test_percentages_have_the_digits_they_deserve(ratio, text):
    assert numbers.percent(ratio).replace("\u00a0", " ") == text


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (0.0012, "m", "1.20 mm"),
        (3.2e-6, "m", "3.20 µm"),
        (1.234, "m", "1.23 m"),
        (4e-12, "m", "< 1 nm"),
        (0.0, "m", "0 m"),
        (-0.12, "1/m", "−0.120 1/m"),
        (2.3e-8, "1", "2.30 × 10⁻⁸"),
        (25.44163, "s", "25.442 s"),
        (None, "m", "–"),
    ],
)
def test_margins_are_written_in_a_fitting_unit(value, unit, text):
    assert numbers.with_unit(value, unit).replace("\u00a0", " ") == text


@pytest.mark.parametrize(
    ("value", "text"), [(1e-6, "10⁻⁶"), (0.05, "0.05"), (2e-9, "2 × 10⁻⁹"), (0.0, "0"), (math.nan, "–")]
)
def test_limits_are_written_as_they_were_given(value, text):
    assert numbers.exact(value).replace("\u00a0", " ") == text


@pytest.mark.parametrize("value", [None, "3", True, math.nan, math.inf, [1.0], {"a": 1}])
def test_what_is_no_finite_number_is_absent(value):
    assert numbers.number_in({"a": {"b": value}}, "a", "b") is None


def test_every_light_colour_stands_for_one_variable():
    variables = palette.variable_of_colour()
    names = palette.css_variables(dark=False)
    assert len(variables) == len(re.findall(r"--[\w-]+:", names))  # no colour has two names
    assert all(re.fullmatch(r"#[0-9a-f]{6}", colour) for colour in variables)
    shades = {
        matplotlib.colors.to_hex(c) for c in matplotlib.colormaps[palette.SPEED_MAP](np.linspace(0, 1, 256))
    }
    assert not shades & set(variables)  # the speed colours stay as they are


def luminance(colour: str) -> float:
    """Relative luminance, WCAG 2.2."""
    c = np.array(matplotlib.colors.to_rgb(colour))
    linear = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def contrast(one: str, other: str) -> float:
    dark, light = sorted((luminance(one), luminance(other)))
    return (light + 0.05) / (dark + 0.05)


@pytest.mark.parametrize(
    "look", [*palette.METHODS.values(), palette.method("unheard_of")], ids=lambda look: look.key
)
def test_words_in_method_colours_can_be_read_on_both_grounds(look):
    # 4.5 is the least contrast of text, WCAG 2.2, success criterion 1.4.3.
    assert contrast(look.text, palette.PAPER.light) >= 4.5
    assert contrast(look.dark, palette.PAPER.dark) >= 4.5


def test_no_two_methods_look_alike_without_colour():
    assert len({look.marker for look in palette.METHODS.values()}) == len(palette.METHODS)


def test_names_for_pictures_are_short_plain_and_drawable():
    assert label("rack\u202e\u0000 7\n") == "rack 7"
    assert label("漢字") == "□□"
    assert len(label("x" * 500)) == 24
    assert plain("\u2066a\u2069\tb") == "a b"


def test_hidden_characters_of_a_file_become_visible():
    assert visible("a\u202eb\r\nc\td\u0007") == "a⟨U+202E⟩b\nc\td⟨U+0007⟩"
