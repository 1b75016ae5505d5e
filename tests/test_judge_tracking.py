"""Tracking: records made from a plan by known errors."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from judged import arcs_motion, setting

from verify.judge.motion import Motion
from verify.judge.tracking import GOAL_LIMIT, Record, Run, judge_run

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


def test_a_late_run_has_that_tracking_error():
    # 0.15 s late at 1 m/s: 0.15 m behind
    driven = record(plan())
    late = replace(driven, x=np.maximum(driven.x - 0.15, 5.0))
    result = run(plan(), late)
    assert result.figures["max_tracking_error"] == pytest.approx(0.15, abs=1e-12)
    assert result.check.worst == pytest.approx(-0.05, abs=1e-12)
    assert "from the planned place" in result.check.message
    assert "at t =" in result.check.message


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


def test_lifting_the_inner_wheels_fails():
    # g w / (2 h) is where the inner wheels lift; a hair more fails, a hair less does not.
    driven = record(plan(), 0.01)
    for share, status in ((0.999, "passed"), (1.001, "failed")):
        sway = np.full(len(driven.t), -share * WHERE.limits.tip)
        result = run(plan(), replace(driven, lateral_acceleration=sway))
        assert result.check.status == status
    assert "inner wheels lifted" in result.check.message


def test_a_vehicle_that_never_moves_is_judged_too():
    t = np.arange(0.0, 30.0, 0.05)
    still = Record(t, np.full(len(t), 5.0), np.full(len(t), 2.0), np.zeros(len(t)), np.zeros(len(t)))
    result = run(plan(), still)
    assert result.check.status == "failed"
    assert result.figures["goal_distance"] == pytest.approx(30.0)
