"""Each rule of the judge: an exact motion that keeps it, and one that breaks it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from judged import arcs_motion, edited, setting

from verify.judge.checks import Setting, check_motion
from verify.judge.finding import Check
from verify.judge.motion import Motion

LIMIT = math.sqrt(3.0)  # [m/s]: sqrt(2 a_b d) at d = 1.5 m, on the centre line of the hall


def along_hall(where: Setting, speed: float = 1.0, *, rows: int = 30, y: float = 2.0) -> Motion:
    return arcs_motion((5.0, y), 0.0, [(30.0 / rows, 0.0)] * rows, [speed] * (rows + 1), where)


def judged(motion: Motion, where: Setting, model: str = "full") -> dict[str, Check]:
    return {check.name: check for check in check_motion(motion, "plan", model, where)}


def failed(motion: Motion, where: Setting) -> set[str]:
    return {name for name, check in judged(motion, where).items() if check.status == "failed"}


def test_a_plain_motion_along_the_hall_passes_everything():
    where = setting()
    checks = judged(along_hall(where), where)
    assert {name for name, check in checks.items() if check.status != "passed"} == set()
    assert set(checks) == {
        "boundary", "start", "goal", "clearance", "braking_distance", "friction_circle", "tip_over",
        "steering", "drive", "speed", "travel_time",
    }  # fmt: skip
    assert checks["clearance"].worst == pytest.approx(1.5, abs=2e-8)  # 2 m to the wall, radius 0.5 m
    assert checks["boundary"].worst == pytest.approx(1.5, abs=2e-8)
    assert checks["braking_distance"].worst == pytest.approx(1.5 - 0.5, abs=2e-8)  # v^2/2 = 0.5 m


def test_the_braking_margin_at_the_limit_is_zero():
    where = setting()
    check = judged(along_hall(where, LIMIT), where)["braking_distance"]
    assert check.worst == pytest.approx(0.0, abs=2e-8)
    assert check.status == "passed"


def test_just_above_the_braking_limit_fails_by_what_the_law_says():
    where = setting()
    check = judged(along_hall(where, LIMIT + 1e-3), where)["braking_distance"]
    excess = LIMIT * 1e-3 + 0.5e-6  # ((v + e)^2 - v^2) / 2
    assert check.status == "failed"
    assert check.worst == pytest.approx(-excess, rel=2e-3)  # resolution 1e-3 of a violation


def test_too_fast_only_in_the_middle_of_a_row_is_caught():
    # A point 1 m beside the straight path: clearance sqrt(1 + s^2) - 0.5, so V = 1 m/s in the middle of a row
    # that is 20 m long; its ends lie at clearance 1.5 m (the walls).
    where = setting(world={"obstacles": [{"vertices": [[20.0, 1.0]]}]})
    row = arcs_motion((5.0, 2.0), 0.0, [(5.0, 0.0), (20.0, 0.0), (5.0, 0.0)], [1.05] * 4, where)
    ends = where.surroundings.distance(np.column_stack([row.x, row.y])) - 0.5
    assert (ends > 1.05**2 / 2).all()
    check = judged(row, where)["braking_distance"]
    assert check.status == "failed"
    assert check.worst == pytest.approx(0.5 - 1.05**2 / 2, rel=2e-3)
    assert check.at is not None
    assert check.at.x == pytest.approx(20.0, abs=0.1)


def test_reaction_time_and_margin_count():
    # v t_r + v^2/2 + m = 0.5 + 0.5 + 0.25 leaves 0.25 of 1.5 m.
    where = setting(braking={"reaction_time": 0.5, "margin": 0.25})
    check = judged(along_hall(where), where)["braking_distance"]
    assert check.worst == pytest.approx(0.25, abs=2e-8)


def test_leaving_the_hall_fails_boundary_and_clearance():
    where = setting()
    out = arcs_motion((5.0, 2.0), 0.0, [(36.0, 0.0)], [1.0, 1.0], where)
    checks = judged(out, where)
    assert checks["boundary"].status == checks["clearance"].status == "failed"
    assert checks["boundary"].worst == pytest.approx(-1.5, rel=2e-3)  # 1 m beyond the wall, plus the radius


def test_grazing_an_obstacle_fails_clearance_but_not_boundary():
    # A circle of radius 0.3 whose centre is 0.7 beside the path: 0.4 away, robot radius 0.5.
    where = setting(world={"obstacles": [{"circle": {"center": [20.0, 1.3], "radius": 0.3}}]})
    checks = judged(along_hall(where, 0.3, rows=1), where)
    assert checks["clearance"].worst == pytest.approx(-0.1, rel=2e-3)
    assert checks["boundary"].status == "passed"


POINT = {"radius": 0.0, "wheelbase": 0.1, "track": 0.1}


def room(obstacle: list[list[float]]) -> Setting:
    """A room of 10 x 10 m with one obstacle, for a point robot on the line y = 4 from x = 2 to 8."""
    return setting(
        world={"boundary": [[0, 0], [10, 0], [10, 10], [0, 10]], "obstacles": [{"vertices": obstacle}]},
        robot=POINT,
        start={"position": [2.0, 4.0]},
        goal={"position": [8.0, 4.0]},
    )


def through(where: Setting, *, least: float = 0.0) -> Motion:
    """Straight on, at the braking limit of the wall x = 5: v^2 = 2 |x - 5|, but for 1e-6."""
    x = np.unique(np.concatenate([np.linspace(2.0, 8.0, 61), [5.0]]))
    speed = np.sqrt(2.0 * np.maximum(np.minimum(np.abs(x - 5.0), np.minimum(x, 10.0 - x)), least)) * (
        1 - 1e-6
    )
    return arcs_motion((2.0, 4.0), 0.0, [(step, 0.0) for step in np.diff(x)], speed, where)


@pytest.mark.parametrize(
    "obstacle",
    [
        [[5, 0], [5, 8]],
        [[5, 4], [5, 8]],  # grazes the end of the wall
        [[5, 4]],
        [[5, 0], [5.0000015, 0], [5.0000015, 8], [5, 8]],
    ],
    ids=["wall", "end of a wall", "point", "plate"],
)
def test_a_point_robot_does_not_pass_through_obstacles_without_depth(obstacle: list[list[float]]):
    where = room(obstacle)
    checks = judged(through(where), where)
    assert checks["clearance"].status == "failed"
    assert "touches or crosses" in checks["clearance"].message
    assert checks["clearance"].violation == 1.0
    assert checks["clearance"].at is not None
    assert checks["clearance"].at.x == pytest.approx(5.0, abs=1e-6)
    # hardly anything else can see it: there is no inside to be in, and the speed at the wall is zero
    assert {n for n, c in checks.items() if c.status == "failed"} <= {
        "clearance",
        "drive",
        "braking_distance",
    }


def test_a_point_robot_may_pass_close_to_the_end_of_a_wall():
    where = room([[5, 4.001], [5, 8]])  # 1 mm beside the path
    assert judged(through(where, least=1e-3), where)["clearance"].status == "passed"


@pytest.mark.parametrize(
    ("end", "change"),
    [
        ("start", {"start": {"position": [5.0, 2.1]}}),
        ("start", {"start": {"speed": "rest"}}),
        ("start", {"start": {"speed": 0.9}}),
        ("start", {"start": {"heading": 0.1}}),
        ("goal", {"goal": {"position": [35.0, 1.9]}}),
        ("goal", {"goal": {"speed": "rest"}}),
        ("goal", {"goal": {"heading": -3.0}}),
    ],
)
def test_each_demand_on_an_end_is_judged(end: str, change: dict[str, Any]):
    where = setting(**change)
    assert failed(along_hall(where), where) == {end}


def test_headings_agree_by_whole_turns():
    where = setting(start={"heading": 2 * math.pi}, goal={"heading": 0.0})
    assert failed(along_hall(where), where) == set()


def bend(where: Setting, speed: float, radius: float) -> Motion:
    """A quarter circle, then straight: ends are not where they should be."""
    arcs = [(radius * math.pi / 2, 1.0 / radius), (0.1, 0.0)]
    return arcs_motion((20.0, 1.0), 0.0, arcs, [speed] * 3, where)


def test_friction_circle_is_v_squared_over_r():
    where = setting(robot={"friction": 0.2, "com_height": 0.01})  # mu g = 1.962, tips at 196
    speed = math.sqrt(1.962)  # at R = 1: v^2/R = mu g, exactly the limit
    assert judged(bend(where, speed, 1.0), where)["friction_circle"].worst == pytest.approx(0.0, abs=1e-12)
    check = judged(bend(where, 1.01 * speed, 1.0), where)["friction_circle"]
    assert check.status == "failed"
    assert check.violation == pytest.approx(1.01**2 - 1.0, rel=1e-9)


def test_friction_circle_adds_braking_and_turning():
    # v = 1 at R = 1 gives 1 m/s^2 sideways; with a = 1 m/s^2 along, sqrt(2) in all (first row's end, v = 1).
    where = setting(robot={"friction": 0.14})  # 1.3734 m/s^2 < sqrt 2
    motion = arcs_motion((20.0, 1.0), 0.0, [(0.375, 1.0), (0.1, 0.0)], [0.5, 1.0, 1.0], where)
    check = judged(motion, where)["friction_circle"]
    assert check.worst == pytest.approx(0.14 * 9.81 - math.sqrt(2.0), abs=1e-12)


def test_friction_reserve_keeps_full_braking_while_turning():
    # mu g = 1.2508, a_b = 1: sqrt(mu^2 g^2 - 1) = 0.7513 m/s^2 remain for turning; 0.9 m/s^2 is too much.
    robot = {"friction": 0.1275}
    fast = bend(setting(robot=robot), math.sqrt(0.9), 1.0)
    assert judged(fast, setting(robot=robot))["friction_circle"].status == "passed"
    where = setting(robot=robot, braking={"friction_reserve": True})
    check = judged(fast, where)["friction_circle"]
    left = math.sqrt((0.1275 * 9.81) ** 2 - 1.0)
    assert check.worst == pytest.approx(left - 0.9, abs=1e-12)
    assert check.status == "failed"


def test_tip_over_is_half_g_track_over_height():
    where = setting(robot={"com_height": 1.0, "track": 0.3})  # g w / (2 h) = 1.4715
    check = judged(bend(where, math.sqrt(1.5), 1.0), where)["tip_over"]
    assert check.worst == pytest.approx(9.81 * 0.3 / 2.0 - 1.5, abs=1e-12)
    assert check.status == "failed"
    assert judged(bend(where, math.sqrt(1.47), 1.0), where)["tip_over"].status == "passed"


def test_steering_limits_curvature():
    # omega_max = 0.6, l = 0.5: r_kin = 0.5 sqrt(1/4 + 1/tan^2 0.6) (Manor 2015, eq. (A.1))
    radius = 0.5 * math.sqrt(0.25 + 1.0 / math.tan(0.6) ** 2)
    where = setting()
    assert judged(bend(where, 0.2, 1.0001 * radius), where)["steering"].status == "passed"
    check = judged(bend(where, 0.2, 0.99 * radius), where)["steering"]
    assert check.violation == pytest.approx(1.0 / 0.99 - 1.0, rel=1e-9)
    assert check.status == "failed"


def test_an_unlimited_steering_rate_is_said():
    where = setting()
    assert "not limited" in judged(along_hall(where), where)["steering"].message


def test_steering_rate_is_taken_over_the_shorter_of_two_runs():
    # Straight for 2 s (two rows, one run), then curvature 0.5 for 1 s: the wheels turn within 1 s.
    # tan omega = 2 tan(asin(kappa l / 2)) with kappa l / 2 = 0.125.
    angle = math.atan(2.0 * math.tan(math.asin(0.125)))
    arcs = [(1.0, 0.0), (1.0, 0.0), (1.0, 0.5)]
    for factor, status in ((1.001, "passed"), (0.999, "failed")):
        where = setting(robot={"max_steering_rate": factor * angle})
        motion = arcs_motion((10.0, 1.5), 0.0, arcs, [1.0] * 4, where)
        check = judged(motion, where)["steering"]
        assert check.status == status
    assert check.worst == pytest.approx(-0.001 * angle, rel=1e-6)
    assert check.unit == "rad/s"
    assert "constant in pieces" in check.message


def test_a_long_straight_gives_no_time_to_turn_the_wheels_in_the_bend_after_it():
    # 10 s straight, then a bend of 1 s: 0.2 rad within 1 s, not within the 5.5 s between the middles.
    curvature = 2.0 / 0.5 * math.sin(math.atan(0.5 * math.tan(0.2)))
    where = setting(robot={"max_steering_rate": 0.19})
    motion = arcs_motion((10.0, 1.5), 0.0, [(10.0, 0.0), (1.0, curvature)], [1.0] * 3, where)
    check = judged(motion, where)["steering"]
    assert check.worst == pytest.approx(-0.01, abs=1e-9)
    assert check.status == "failed"


def test_a_heading_that_jumps_fails_steering():
    where = setting()
    corner = arcs_motion((20.0, 1.0), 0.0, [(1.0, 0.0), (1.0, 0.0)], [1.0] * 3, where)
    turned = {name: np.insert(getattr(corner, name), 1, getattr(corner, name)[1]) for name in
              ("t", "x", "y", "heading", "v", "a", "curvature", "clearance")}  # fmt: skip
    turned["heading"][2:] += math.pi / 2
    turned["x"][3], turned["y"][3] = 21.0, 2.0
    turned["clearance"][3] = 1.5
    check = judged(Motion(**turned), where)["steering"]
    assert (check.status, check.unit) == ("failed", "rad")
    assert check.worst == pytest.approx(-math.pi / 2)
    assert judged(Motion(**turned), where)["travel_time"].status == "passed"


def with_row(motion: Motion, at: int, **values: float) -> Motion:
    """The motion with row `at` doubled, the first of both with other values."""
    columns = {name: getattr(motion, name) for name in motion.__dataclass_fields__}
    columns = {name: np.insert(column, at, column[at]) for name, column in columns.items()}
    for name, value in values.items():
        columns[name][at] = value
    return Motion(**columns)


@pytest.mark.parametrize(("end", "row"), [("start", 0), ("goal", -1)])
def test_a_row_without_duration_does_not_fake_the_heading_of_an_end(end: str, row: int):
    where = setting(**{end: {"heading": 1.0}})
    straight = along_hall(where)
    at = 0 if row == 0 else len(straight.t) - 1
    faked = with_row(straight, at)
    faked.heading[row] = 1.0
    assert judged(faked, where)["travel_time"].status == "passed"  # a kink alone takes no time
    assert failed(faked, where) == {end, "steering"}
    assert judged(faked, where)["steering"].worst == pytest.approx(-1.0, abs=1e-12)
    # what the motion really does is judged: heading 0 at both ends
    assert failed(faked, setting(**{end: {"heading": 0.0}})) == {"steering"}


def test_a_turn_between_two_rows_without_duration_is_a_kink():
    where = setting()
    motion = with_row(with_row(along_hall(where), 7), 8, heading=0.5)
    assert failed(motion, where) == {"steering"}


def test_many_kinks_too_small_to_see_add_up():
    # 4000 rows of 7.5 mm; at each, a step of 5e-7 rad: 2e-3 rad in all. Every other one turns back.
    where = setting()
    fine = along_hall(where, rows=4000)
    headings = np.where(np.arange(4000) % 2 == 0, 2.5e-7, -2.5e-7)
    columns = {name: np.repeat(getattr(fine, name), 2)[1:-1] for name in fine.__dataclass_fields__}
    columns["heading"] = np.repeat(headings, 2)
    x, y = [5.0], [2.0]
    for heading in headings:
        x.append(x[-1] + 0.0075 * math.cos(heading))
        y.append(y[-1] + 0.0075 * math.sin(heading))
    columns["x"], columns["y"] = np.repeat(x, 2)[1:-1], np.repeat(y, 2)[1:-1]
    motion = Motion(**columns)
    assert judged(motion, where)["travel_time"].status == "passed"
    check = judged(motion, where)["steering"]
    assert check.status == "failed"
    assert "many small steps" in check.message


@pytest.mark.parametrize(
    ("before", "after", "excess"),
    [(1.0, 1.5, 0.25), (1.5, 0.5, 0.0), (1.6, 0.5, 0.155)],  # (v1^2 - v0^2)/2 over 1 m, against 1 m/s^2
)
def test_drive_limits_both_ways(before: float, after: float, excess: float):
    where = setting(robot={"max_acceleration": 0.375, "max_braking": 1.0})
    motion = arcs_motion((20.0, 2.0), 0.0, [(1.0, 0.0)], [before, after], where)
    check = judged(motion, where)["drive"]
    if excess:
        assert check.worst == pytest.approx(-excess, abs=1e-12)
        assert check.status == "failed"
    else:
        assert check.worst == pytest.approx(0.0, abs=1e-12)  # (0.25 - 2.25)/2 = -1 m/s^2: at the limit
        assert check.status == "passed"


def test_speed_limit_and_reversing():
    where = setting(robot={"max_speed": 1.0})
    assert failed(along_hall(where, 1.0), where) == set()
    check = judged(along_hall(where, 1.25), where)["speed"]
    assert (check.status, check.violation) == ("failed", pytest.approx(0.25))
    backwards = arcs_motion((20.0, 2.0), 0.0, [(1.0, 0.0)], [1.0, 1.0], where)
    assert judged(edited(backwards, "v", 1, -1.1), where)["speed"].status == "failed"


@pytest.mark.parametrize(
    ("column", "by"),
    [
        ("t", 0.05), ("x", 1e-6), ("y", 0.3), ("heading", 1e-6), ("v", 1e-6), ("a", 1e-3),
        ("curvature", 1e-3), ("clearance", 3e-6),
    ],
)  # fmt: skip
def test_any_edited_number_breaks_the_travel_time_check(column: str, by: float):
    where = setting()
    arcs = [(1.0, 0.0), (1.0, 0.2), (1.0, -0.2), (1.0, 0.0)]
    motion = arcs_motion((20.0, 1.5), 0.0, arcs, [1.0, 1.2, 1.1, 1.0, 0.9], where)
    assert judged(motion, where)["travel_time"].status == "passed"
    check = judged(edited(motion, column, 2, by), where)["travel_time"]
    assert check.status == "failed"
    assert "row" in check.message


def test_errors_of_many_rows_add_up():
    # 600,000 rows of 2 us: the column says 1 m/s^2, the limit, but the speed gains 1.0045 m/s^2. Each row
    # is 9e-9 m/s off, the whole 5.4e-3 m/s.
    where = setting(start={"speed": "rest"}, goal={"position": [5.7232, 2.0]})
    t = 2e-6 * np.arange(600_001)
    v = 1.0045 * t
    x = 5.0 + 0.5 * 1.0045 * t * t
    zero, one = np.zeros_like(t), np.ones_like(t)
    motion = Motion(t, x, 2.0 * one, zero, v, one, zero, 1.5 * one)
    assert np.abs(np.diff(v) - motion.duration).max() < 1e-8
    check = judged(motion, where)["travel_time"]
    assert check.status == "failed"
    assert (check.unit, check.worst) == ("m/s", pytest.approx(-0.0045 * 1.2, rel=1e-6))
    assert "all rows together" in check.message
    t, zero, one = t[::20], zero[::20], one[::20]
    honest = Motion(t, 5.0 + 0.5 * t * t, 2.0 * one, zero, t, one, zero, 1.5 * one)
    assert judged(honest, where)["travel_time"].status == "passed"


@pytest.mark.parametrize(("column", "unit"), [("y", "m"), ("curvature", "rad")])
def test_small_errors_of_place_and_heading_add_up_too(column: str, unit: str):
    # 3000 rows of 10 mm, each 4e-9 m, or 4e-8 1/m * 10 mm = 4e-10 rad, off.
    where = setting()
    motion = along_hall(where, rows=3000)
    drift = 4e-9 * np.arange(3001) if column == "y" else np.full(3001, 4e-8)
    check = judged(replace(motion, **{column: getattr(motion, column) + drift}), where)["travel_time"]
    assert (check.status, check.unit) == ("failed", unit)
    assert check.worst == pytest.approx(-1.2e-5 if unit == "m" else -1.2e-6, rel=1e-3)


def test_absurd_numbers_where_they_mean_nothing_buy_no_rounding():
    # Acceleration and curvature of a row without duration, and whole turns added to all headings.
    where = setting()
    motion = along_hall(where)
    jump = with_row(motion, 10, a=1e12, curvature=1e12)
    assert failed(jump, where) == set()
    faster = np.where(np.arange(32) > 10, 1.001, 1.0)
    t = np.concatenate([[0.0], np.cumsum(np.diff(jump.x) / (0.5 * (faster[1:] + faster[:-1])))])
    assert judged(replace(jump, v=faster, t=t), where)["travel_time"].unit == "m/s"
    turned = replace(jump, heading=np.where(np.arange(32) > 10, 1e-5, 0.0))
    assert judged(turned, where)["steering"].status == "failed"
    wound = replace(motion, heading=2.0 * math.pi * 1e10 + 1e-5 * (np.arange(31) % 2))
    assert {"travel_time", "steering"} <= failed(wound, where)


def test_far_from_the_origin_only_rounding_is_allowed_for():
    # Neighbouring numbers lie 1.5e-11 m apart at 1e5 m: 4,000 rows may be off by 6e-8 m, a true error not.
    far, rows = 9.9e4, 4_000
    corners = [[far, 0], [far + 400, 0], [far + 400, 4], [far, 4]]
    where = setting(
        world={"boundary": corners}, start={"position": [far + 5, 2]}, goal={"position": [far + 395, 2]}
    )
    motion = arcs_motion((far + 5.0, 2.0), 0.0, [(390.0 / rows, 0.0)] * rows, [1.0] * (rows + 1), where)
    assert judged(motion, where)["travel_time"].status == "passed"
    assert judged(edited(motion, "x", 100, 1e-5), where)["travel_time"].status == "failed"


def test_a_removed_row_breaks_the_travel_time_check():
    where = setting()
    arcs = [(1.0, 0.0), (1.0, 0.2), (1.0, -0.2), (1.0, 0.0)]
    motion = arcs_motion((20.0, 1.5), 0.0, arcs, [1.0, 1.2, 1.1, 1.0, 0.9], where)
    fields = motion.__dataclass_fields__
    gone = Motion(**{name: np.delete(getattr(motion, name), 2) for name in fields})
    assert judged(gone, where)["travel_time"].status == "failed"


@pytest.mark.parametrize("by", [1.0, -5.0])
def test_a_clock_that_starts_elsewhere_or_runs_backwards_fails(by: float):
    where = setting()
    motion = along_hall(where)
    late = replace(motion, t=motion.t + 1.0) if by > 0 else edited(motion, "t", 10, by)
    assert judged(late, where)["travel_time"].status == "failed"


def test_the_variational_model_promises_no_end_speed_and_no_friction():
    where = setting(start={"speed": "rest"}, robot={"friction": 0.11, "com_height": 1.0, "track": 0.2})
    arcs = [(0.5, 1.0), (0.5, -1.0)]
    motion = arcs_motion((5.0, 2.0), 0.0, arcs, [1.1] * 3, where)
    checks = check_motion(motion, "plan", "variational", where)
    promised = {check.name: check.status for check in checks if check.promised}
    other = {check.name: check.status for check in checks if not check.promised}
    assert promised == {
        "boundary": "passed", "start": "passed", "goal": "failed", "clearance": "passed",
        "braking_distance": "passed", "speed": "passed", "travel_time": "passed",
    }  # fmt: skip
    assert other == {
        "start": "failed", "friction_circle": "failed", "tip_over": "failed", "steering": "passed",
        "drive": "passed",
    }  # fmt: skip
    assert all("not promised" in c.message for c in checks if not c.promised and c.status == "failed")
