"""Whether a run followed its motion: beside the path and on time, on paths that meet themselves, too."""

from __future__ import annotations

import math

import numpy as np
import pytest
from systems_motions import drive

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
