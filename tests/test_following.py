"""Whether a run followed its motion: beside the path and on time, on paths that meet themselves, too."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from systems_motions import circle, drive

from systems.following import Tolerance, following
from systems.run import SimulationRun, run_columns
from vnav_drake.plan import Path, Trajectory

HELD = {"arrived": True, "fell": False, "slid": False, "wheel_lift": False}
TOLERANCE = Tolerance(sideways=0.05, lateness=0.01, least_lateness=0.1)

# Straight on, once round a circle of radius 1 m back to the same place and course, straight on.
LOOP = drive(
    Path.from_arcs((0.0, 0.0), 0.0, [0.0, 1.0, 0.0], [4.0, 2.0 * math.pi, 4.0]),
    start=1.0,
    end=1.0,
    cruise=1.0,
)


def run(motion: Trajectory, *, behind: float = 0.0, left: float = 0.0, **facts: bool) -> SimulationRun:
    """A vehicle that is `behind` [s] the motion and `left` [m] of it all along."""
    t = np.arange(0.0, motion.t[-1], 0.01)
    x, y, heading, v, *_ = motion.at(t - behind)
    columns = dict.fromkeys(run_columns(), np.zeros(len(t))) | {
        "t": t,
        "x": x - left * np.sin(heading),
        "y": y + left * np.cos(heading),
        "heading": heading,
        "v": v,
    }
    return SimulationRun(model="single_track", channels={}, step=0.01, details=HELD | facts, **columns)


def test_a_vehicle_on_its_motion_follows_it_where_the_path_meets_itself():
    found = following(run(LOOP), LOOP, TOLERANCE)
    # samples are 5 ms apart and speeds 1 m/s: the nearest is at most 2.5 mm off, across a curve of 1/m 3e-6 m
    assert found.cause == ""
    assert found.sideways <= 1e-5
    assert abs(found.lateness) <= 2.5e-3 + 1e-9


@pytest.mark.parametrize(("behind", "cause"), [(0.09, ""), (0.16, "is late")])
def test_lateness_is_told_in_seconds(behind, cause):
    # 14.3 s in all: a hundredth of that, 0.143 s, is allowed
    found = following(run(LOOP, behind=behind), LOOP, TOLERANCE)
    assert found.lateness == pytest.approx(behind, abs=2.5e-3 + 1e-9)
    assert found.cause == cause


@pytest.mark.parametrize(("left", "cause"), [(0.04, ""), (-0.06, "leaves the path")])
def test_distance_from_the_path_is_told_in_metres(left, cause):
    found = following(run(LOOP, left=left), LOOP, TOLERANCE)
    assert found.sideways == pytest.approx(abs(left), abs=1e-4)
    assert found.cause == cause


@pytest.mark.parametrize(
    ("facts", "cause"),
    [
        ({"slid": True, "fell": True, "wheel_lift": True}, "falls"),
        ({"slid": True, "wheel_lift": True}, "slides"),
        ({"wheel_lift": True}, "lifts its wheels"),
        ({"pitch_lift": True}, "lifts its wheels"),
        ({"arrived": False}, "does not arrive"),
    ],
)
def test_the_gravest_cause_is_told(facts, cause):
    assert following(run(LOOP, **facts), LOOP, TOLERANCE).cause == cause


def test_two_turns_of_a_circle_are_told_apart():
    # 2.2 m/s round a radius of 1 m: the second turn is only 2 pi / 2.2 = 2.86 s after the first
    turns = circle(1.0, 2.2, turns=2.0)
    found = following(run(turns), turns, TOLERANCE)
    assert found.cause == ""
    assert found.sideways <= 1e-8  # the foot is exact, up to the iteration's end
    assert abs(found.lateness) <= 1e-8
    # 3 mm outside it drives beside the same places at the same times
    assert following(run(turns, left=-0.003), turns, TOLERANCE).sideways == pytest.approx(0.003, abs=1e-8)


def test_a_late_start_is_told_although_the_path_comes_by_again():
    found = following(run(LOOP, behind=0.5), LOOP, TOLERANCE)
    assert found.cause == "is late"
    assert found.lateness == pytest.approx(0.5, abs=1e-8)
    assert found.sideways <= 1e-8


def test_a_vehicle_that_cuts_the_loop_leaves_the_path():
    # straight on at 1 m/s where the loop about (4, 1) begins: the foot stays on it, though the end of the
    # path is beneath the vehicle; after 14.28 s, at x = 14.28, the circle of 1 m is hypot(10.28, 1) - 1 away
    t = np.arange(0.0, LOOP.t[-1], 0.01)
    astray = replace(run(LOOP), x=t, y=np.zeros(len(t)), heading=np.zeros(len(t)))
    found = following(astray, LOOP, TOLERANCE)
    assert found.cause == "leaves the path"
    assert found.sideways == pytest.approx(math.hypot(10.28, 1.0) - 1.0, rel=1e-9)


def test_a_motion_whose_clock_starts_late_is_followed_from_its_first_row():
    later = replace(LOOP, t=LOOP.t + 7.0)
    found, same = (following(run(LOOP, behind=0.05), motion, TOLERANCE) for motion in (later, LOOP))
    assert found.cause == same.cause == ""
    assert found.lateness == pytest.approx(same.lateness, abs=1e-12)
