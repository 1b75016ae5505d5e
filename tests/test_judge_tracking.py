"""Tracking: records made from a plan by known errors."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from judged import arcs_motion, setting

from verify.judge.motion import Motion
from verify.judge.tracking import GOAL_LIMIT, Record, Run, Wheels, judge_run

WHERE = setting()


def plan() -> Motion:
    return arcs_motion((5.0, 2.0), 0.0, [(30.0, 0.0)], [1.0, 1.0], WHERE)  # 30 s at 1 m/s


def record(motion: Motion, period: float = 0.01) -> Record:
    t = np.append(np.arange(0.0, motion.t[-1], period), motion.t[-1])
    points, heading = motion.at(t)
    return Record(t, points[:, 0], points[:, 1], heading, np.interp(t, motion.t, motion.v))


def run(motion: Motion, driven: Record) -> Run:
    return judge_run(driven, motion, (35.0, 2.0), WHERE.surroundings, WHERE.limits)


def test_a_perfect_run_has_no_error():
    result = run(plan(), record(plan()))
    assert result.check.status == "passed"
    assert result.figures["max_tracking_error"] == pytest.approx(0.0, abs=1e-12)
    assert result.figures["min_clearance"] == pytest.approx(1.5, abs=2e-8)
    # 1 mm before the goal at 1 m/s, at the next sample
    assert result.figures["travel_time"] == pytest.approx(30.0, abs=0.011)


def test_an_offset_run_has_that_lateral_error():
    driven = record(plan())
    result = run(plan(), replace(driven, y=driven.y + 0.04))
    assert result.figures["max_lateral_error"] == pytest.approx(0.04, abs=1e-12)
    assert result.check.status == "passed"
    off = run(plan(), replace(driven, y=driven.y + 0.06))
    assert off.check.status == "failed"
    assert "0.0600 m beside" in off.check.message


@pytest.mark.parametrize(("late", "status"), [(0.15, "passed"), (0.29, "passed"), (0.31, "failed")])
def test_a_run_may_be_late_by_a_hundredth_of_the_planned_time(late: float, status: str):
    # At 1 m/s so much behind is so late; of 30 s, 0.30 s are allowed. It catches up before the goal.
    driven = record(plan())
    behind = late * np.clip(np.minimum(driven.t, 30.0 - driven.t), 0.0, 1.0)
    result = run(plan(), replace(driven, x=driven.x - behind))
    assert result.figures["max_tracking_error"] == pytest.approx(late, abs=1e-12)
    assert result.figures["max_lateness"] == pytest.approx(late, abs=1e-9)
    assert result.figures["max_lateral_error"] == pytest.approx(0.0, abs=1e-12)
    assert result.check.status == status
    assert ("s behind schedule" in result.check.message) == (status == "failed")


def test_on_a_short_way_a_tenth_of_a_second_is_allowed():
    motion = arcs_motion((5.0, 2.0), 0.0, [(3.0, 0.0)], [1.0, 1.0], WHERE)  # 3 s
    driven = record(motion)
    for late, status in ((0.09, "passed"), (0.11, "failed")):
        behind = replace(driven, x=driven.x - late * np.clip(np.minimum(driven.t, 3.0 - driven.t), 0.0, 1.0))
        assert judge_run(behind, motion, (8.0, 2.0), WHERE.surroundings, WHERE.limits).check.status == status


@pytest.mark.parametrize(("ahead", "status"), [(0.09, "passed"), (0.11, "failed")])
def test_a_run_ahead_of_its_plan_is_not_the_plan_s_run(ahead: float, status: str):
    driven = record(plan())
    early = replace(driven, x=driven.x + ahead * np.clip(np.minimum(driven.t, 30.0 - driven.t), 0.0, 1.0))
    result = run(plan(), early)
    assert result.check.status == status
    assert ("m ahead of schedule" in result.check.message) == (status == "failed")


def test_millimetres_near_rest_are_not_late():
    # Braking at 1 m/s^2, 15 mm before its end the plan has sqrt(2 * 0.015) = 0.17 s to go.
    where = setting(goal={"speed": "rest"})
    motion = arcs_motion((5.0, 2.0), 0.0, [(29.5, 0.0), (0.5, 0.0)], [1.0, 1.0, 0.0], where)
    driven = record(motion, 0.001)
    result = run(motion, replace(driven, x=np.minimum(driven.x, 34.985)))
    assert result.figures["max_lateness"] == 0.0
    assert result.figures["goal_distance"] == pytest.approx(0.015, abs=1e-9)
    assert result.check.status == "passed"


def loop() -> Motion:
    """Twice round a circle of radius 1 m at 1 m/s, which crosses itself everywhere."""
    where = setting()
    return arcs_motion((20.0, 1.0), 0.0, [(2.0 * math.pi, 1.0)] * 2, [1.0] * 3, where)


def test_the_way_is_followed_round_by_round():
    # 50 mm outside the second round, and 0.09 s late throughout: not on the first round at another time.
    motion = loop()
    driven = record(motion)
    theta = np.maximum(driven.t - 0.09, 0.0)
    radius = 1.0 + np.where(theta > 2.0 * math.pi, 0.04, 0.0)
    off = replace(driven, x=20.0 + radius * np.sin(theta), y=2.0 - radius * np.cos(theta))
    result = judge_run(off, motion, (20.0, 1.0), WHERE.surroundings, WHERE.limits)
    # the path is compared in chords of 5 mm, 3 um within the circle
    assert result.figures["max_lateral_error"] == pytest.approx(0.04, abs=4e-6)
    assert result.figures["max_lateness"] == pytest.approx(0.09, abs=1e-4)


def test_a_run_that_leaves_out_a_round_is_failed():
    motion = loop()
    driven = record(motion)
    half = replace(driven, t=driven.t[: len(driven.t) // 2], **{
        name: getattr(driven, name)[: len(driven.t) // 2] for name in ("x", "y", "heading", "v")
    })  # fmt: skip
    rest = driven.t[len(driven.t) // 2 :]
    still = Record(
        driven.t,
        *(np.append(getattr(half, name), np.full(len(rest), getattr(half, name)[-1]))
          for name in ("x", "y", "heading", "v")),
    )  # fmt: skip
    result = judge_run(still, motion, (20.0, 1.0), WHERE.surroundings, WHERE.limits)
    assert result.figures["goal_distance"] < 0.01  # half way round it is at the goal already
    assert "behind schedule" in result.check.message


def stopover() -> Motion:
    """To x = 10 in 5.5 s, 5 s of waiting there, and on to the goal."""
    there = arcs_motion((5.0, 2.0), 0.0, [(4.5, 0.0), (0.5, 0.0)], [1.0, 1.0, 0.0], WHERE)
    onward = arcs_motion((10.0, 2.0), 0.0, [(0.5, 0.0), (24.5, 0.0)], [0.0, 1.0, 1.0], WHERE)
    columns = {n: np.append(getattr(there, n), getattr(onward, n)) for n in there.__dataclass_fields__}
    columns["t"][3:] += there.t[-1] + 5.0
    columns["a"][2] = columns["curvature"][2] = 0.0
    return Motion(**columns)


def test_who_comes_late_to_where_the_plan_waits_is_in_time_for_its_departure():
    # 0.25 s late on the way to the stop, of 36 s in all, which allow 0.36 s; then none of the 5 s counts.
    motion = stopover()
    driven = record(motion)
    points, _ = motion.at(np.where(driven.t < 8.0, np.maximum(driven.t - 0.25, 0.0), driven.t))
    result = run(motion, replace(driven, x=points[:, 0]))
    assert result.figures["max_lateness"] == pytest.approx(0.25, abs=1e-3)
    assert result.check.status == "passed"


def test_who_waits_short_of_where_the_plan_waits_is_late():
    # 30 mm short: sqrt(2 * 0.03) = 0.245 s before the plan stands, which then stands 5 s.
    motion = stopover()
    driven = record(motion)
    short = np.where(driven.t < 10.5, np.minimum(driven.x, 9.97), driven.x)
    result = run(motion, replace(driven, x=short))
    assert result.figures["max_lateness"] == pytest.approx(5.245, abs=0.02)
    assert "behind schedule" in result.check.message


def test_a_point_robot_that_drives_through_a_wall_collides():
    where = setting(
        robot={"radius": 0.0, "wheelbase": 0.1, "track": 0.1},
        world={"obstacles": [{"vertices": [[20.0, 0.0], [20.0, 3.0]]}]},
    )
    motion = plan()
    for period in (0.01, 0.009):  # with a sample on the wall, and without
        driven = record(motion, period)
        result = judge_run(driven, motion, (35.0, 2.0), where.surroundings, where.limits)
        assert result.check.status == "failed"
        assert "collision" in result.check.message


def test_a_run_that_stops_short_is_failed():
    driven = record(plan())
    kept = driven.x < 35.0 - 2 * GOAL_LIMIT
    short = Record(*(getattr(driven, name)[kept] for name in ("t", "x", "y", "heading", "v")))
    result = run(plan(), short)
    assert "came no closer to the goal" in result.check.message
    assert result.check.status == "failed"


def test_a_slow_run_is_failed_for_its_time():
    driven = record(plan())
    slow = replace(driven, t=driven.t * 1.02)
    assert "instead of 30.000 s" in run(plan(), slow).check.message


def test_a_run_through_an_obstacle_between_two_samples_is_failed():
    # samples 0.09 m apart on both sides of a point 0.499 m beside the path: least distance below the radius
    where = setting(world={"obstacles": [{"vertices": [[20.0, 1.501]]}]})
    motion = plan()
    result = judge_run(record(motion, 0.09), motion, (35.0, 2.0), where.surroundings, where.limits)
    assert result.figures["min_clearance"] == pytest.approx(-0.001, abs=1e-5)
    assert "collision" in result.check.message


def test_a_record_with_a_hole_or_a_jump_is_failed():
    driven = record(plan())
    kept = (driven.t < 10.0) | (driven.t > 11.0)
    hole = Record(*(getattr(driven, name)[kept] for name in ("t", "x", "y", "heading", "v")))
    assert "no sample for" in run(plan(), hole).check.message
    jump = replace(driven, y=driven.y + np.where(np.abs(driven.t - 10.0) < 0.005, 0.04, 0.0))
    assert "jumps" in run(plan(), jump).check.message


def test_arrival_at_rest_is_the_time_of_coming_within_ten_micrometres():
    # Braking at 1 m/s^2 to rest: 10 um before the end is sqrt(2 * 1e-5) = 4.5 ms before it.
    where = setting(goal={"speed": "rest"})
    motion = arcs_motion((5.0, 2.0), 0.0, [(29.5, 0.0), (0.5, 0.0)], [1.0, 1.0, 0.0], where)
    driven = record(motion, 0.001)
    waiting = np.arange(1, 1000) * 1e-3
    still = Record(
        np.append(driven.t, driven.t[-1] + waiting),
        *(
            np.append(getattr(driven, n), np.full(999, getattr(driven, n)[-1]))
            for n in ("x", "y", "heading", "v")
        ),
    )
    result = run(motion, still)
    assert result.figures["travel_time"] == pytest.approx(motion.travel_time - math.sqrt(2e-5), abs=1.1e-3)
    assert result.check.status == "passed"


def test_who_stops_two_millimetres_too_far_was_not_early():
    # From 0.2 m/s at 0.1 m/s^2: 2 s, 0.2 m to rest. 2 mm further on it passes the goal sqrt(2 * 0.002 / 0.1)
    # = 0.2 s before it rests, which is twice what a run may be early.
    where = setting(goal={"position": [5.2, 2.0], "speed": "rest"})
    motion = arcs_motion((5.0, 2.0), 0.0, [(0.2, 0.0)], [0.2, 0.0], where)
    driven = record(motion)
    too_far = np.where(driven.x > 5.1, 0.002, 0.02 * (driven.x - 5.0))
    result = judge_run(
        replace(driven, x=driven.x + too_far), motion, (5.2, 2.0), where.surroundings, where.limits
    )
    assert result.check.status == "passed", result.check.message
    assert result.figures["travel_time"] == pytest.approx(2.0, abs=0.03)
    assert result.figures["goal_distance"] < 1e-3  # it did pass the goal


def test_lifting_the_inner_wheels_fails():
    # g w / (2 h) is where the inner wheels lift; a hair more fails, a hair less does not.
    driven = record(plan(), 0.01)
    for share, status in ((0.999, "passed"), (1.001, "failed")):
        sway = np.full(len(driven.t), -share * WHERE.limits.tip)
        result = run(plan(), replace(driven, lateral_acceleration=sway))
        assert result.check.status == status
    assert "inner wheels lifted" in result.check.message


def on_four_wheels(**wheels: np.ndarray) -> Record:
    """The perfect run with wheel loads, tilt and modes of a vehicle that keeps all wheels on the floor."""
    driven = record(plan())
    still = np.zeros(len(driven.t))
    columns = {"loads": np.full((len(still), 4), 100.0), "tilt": still, "mode": still, **wheels}
    return replace(driven, wheels=Wheels(**columns))


def four_wheels(driven: Record) -> Run:
    return judge_run(driven, plan(), (35.0, 2.0), WHERE.surroundings, WHERE.limits, vehicle="four_wheel")


def unloaded(wheels: list[int], rows: int) -> np.ndarray:
    """Loads of four wheels, some of which carry nothing in a number of rows from 10 s on."""
    loads = np.full((len(record(plan()).t), 4), 100.0)
    loads[1000 : 1000 + rows, wheels] = 0.0
    return loads


@pytest.mark.parametrize("pair", [[0, 2], [1, 3], [0, 1], [2, 3]])  # left, right, front, rear
@pytest.mark.parametrize(("rows", "status"), [(1, "passed"), (20, "passed"), (21, "failed")])
def test_a_side_or_an_axle_in_the_air_for_a_fifth_of_a_second_fails(pair: list[int], rows: int, status: str):
    # Twenty-one rows of 10 ms span 200 ms, twenty 190 ms.
    result = four_wheels(on_four_wheels(loads=unloaded(pair, rows)))
    assert result.check.status == status
    if status == "failed":
        assert "two wheels were in the air for 0.2 s or longer, at t = 10.000 s" in result.check.message


@pytest.mark.parametrize(
    ("wheels", "status"), [([0], "passed"), ([0, 3], "passed"), ([0, 1, 2, 3], "failed")]
)
def test_wheels_without_load_on_either_side_do_not_tip(wheels: list[int], status: str):
    # One wheel, or the two on a diagonal: neither a side nor an axle is without load.
    assert four_wheels(on_four_wheels(loads=unloaded(wheels, 300))).check.status == status


def test_a_record_in_which_no_wheel_ever_carries_anything_fails():
    assert four_wheels(on_four_wheels(loads=0.0 * unloaded([], 0))).check.status == "failed"


@pytest.mark.parametrize(
    ("share", "status"), [(0.91, "passed"), (1.09, "passed"), (0.89, "failed"), (1.11, "failed")]
)
def test_the_floor_carries_the_weight(share: float, status: str):
    # 40 kg: 392.4 N in all
    loads = np.full((len(record(plan()).t), 4), share * 98.1)
    result = four_wheels(on_four_wheels(loads=loads))
    assert result.check.status == status
    if status == "failed":
        told = f"wheels that carry {share * 392.4:.1f} N on average, where the robot weighs 392.4 N"
        assert told in result.check.message


def test_loads_of_a_nanonewton_are_no_loads():
    result = four_wheels(on_four_wheels(loads=np.full((len(record(plan()).t), 4), 1e-9)))
    assert "wheels that carry 0.0 N" in result.check.message


@pytest.mark.parametrize(("every", "status"), [(120, "passed"), (80, "failed")])
def test_two_wheels_in_the_air_again_and_again_fail(every: int, status: str):
    # 20 rows, 0.19 s and half a row on either side, of every 120 or 80: 1/6 or 1/4 of the run, of which 1/5
    # is allowed. The other side carries all of the weight.
    loads = np.full((len(record(plan()).t), 4), 98.1)
    up = np.arange(len(loads)) % every < 20
    loads[up] = [0.0, 196.2, 0.0, 196.2]
    result = four_wheels(on_four_wheels(loads=loads))
    assert result.check.status == status
    if status == "failed":
        assert "two wheels were in the air for 25% of the run, 20% is allowed" in result.check.message


def test_the_acceleration_of_four_wheels_says_nothing_of_their_loads():
    sway = np.full(len(record(plan()).t), 2.0 * WHERE.limits.tip)
    driven = replace(on_four_wheels(), lateral_acceleration=sway)
    assert four_wheels(driven).check.status == "passed"


@pytest.mark.parametrize(
    ("columns", "status"),
    [
        ({"mode": 3.0}, "failed"),
        ({"mode": 2.0}, "passed"),
        ({"tilt": math.radians(31.0)}, "failed"),
        ({"tilt": -math.radians(31.0)}, "failed"),
        ({"tilt": math.radians(29.0)}, "passed"),
    ],
)
def test_a_vehicle_that_falls_fails(columns: dict[str, float], status: str):
    t = record(plan()).t
    late = {name: np.where(t > 20.0, value, 0.0) for name, value in columns.items()}
    result = four_wheels(on_four_wheels(**late))
    assert result.check.status == status
    assert ("the vehicle fell, at t = 20.010 s" in result.check.message) == (status == "failed")


def test_a_record_of_another_model_is_no_run_of_the_one_asked_for():
    assert "where four_wheel was to drive" in four_wheels(record(plan())).check.message
    result = run(plan(), on_four_wheels())
    assert "a run of the model four_wheel, where single_track was to drive" in result.check.message
    assert result.check.status == "failed"


def test_a_vehicle_that_never_moves_is_judged_too():
    t = np.arange(0.0, 30.0, 0.05)
    still = Record(t, np.full(len(t), 5.0), np.full(len(t), 2.0), np.zeros(len(t)), np.zeros(len(t)))
    result = run(plan(), still)
    assert result.check.status == "failed"
    assert result.figures["goal_distance"] == pytest.approx(30.0)
