"""Did a simulated vehicle follow its trajectory, on its wheels, beside the path and on time?"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from systems.run import SimulationRun
from vnav_drake.plan import Trajectory, arc_step

Array = NDArray[np.float64]

CONVERGED = 1e-9  # [m], of arc length
MOST_STEPS = 6  # of Newton's method; beside the path two or three suffice
LEAST_SLOPE = 0.5  # of 1 - kappa e, which is zero at the centre of curvature


@dataclass(frozen=True, kw_only=True)
class Tolerance:
    """What counts as following."""

    sideways: float  # [m], from the path
    lateness: float  # of the travel time ...
    least_lateness: float  # [s], ... at least

    def late(self, trajectory: Trajectory) -> float:
        """How late [s] the vehicle may be."""
        return max(self.lateness * trajectory.travel_time, self.least_lateness)


@dataclass(frozen=True, kw_only=True)
class Following:
    """How well a run followed its trajectory."""

    cause: str  # why it does not count as following; empty when it does
    sideways: float  # [m], greatest distance from the path
    lateness: float  # [s], greatest


def following(run: SimulationRun, trajectory: Trajectory, tolerance: Tolerance) -> Following:
    """Compare a run with its trajectory, up to the planned end; the run's clock starts with the first row.

    The cause is what went wrong first in kind: a fall explains a slide, a slide explains leaving the path.
    """
    lengths = trajectory.arc_length
    feet = _feet(trajectory, lengths, run.x, run.y)
    row = np.clip(np.searchsorted(lengths, feet, side="right") - 1, 0, len(lengths) - 2)
    part = feet - lengths[row]
    during = run.t <= trajectory.travel_time
    during[0] = True
    sideways = float(np.max(_away(trajectory, lengths[-1], feet, row, part, run)[during]))
    late = float(np.max((run.t - _passed(trajectory, row, part))[during]))
    facts = run.details
    causes = (
        (facts["fell"], "falls"),
        (facts["slid"], "slides"),
        (facts["wheel_lift"] or facts.get("pitch_lift", False), "lifts its wheels"),
        (sideways > tolerance.sideways, "leaves the path"),
        (late > tolerance.late(trajectory), "is late"),
        (not facts["arrived"], "does not arrive"),
    )
    return Following(
        cause=next((words for holds, words in causes if holds), ""), sideways=sideways, lateness=late
    )


def _feet(trajectory: Trajectory, lengths: Array, x: Array, y: Array) -> Array:
    """Arc length [m] of the foot of each place (m,) on the path, each by Newton's method from the one before.

    So a path that meets itself is followed the way round it leads. A vehicle far off the path may lose it:
    then the foot is no foot, and the distance from it too large.
    """
    end = float(lengths[-1])
    marks, px, py, heading, curvature = (
        column.tolist()
        for column in (lengths, trajectory.x, trajectory.y, trajectory.heading, trajectory.curvature)
    )
    last = len(marks) - 2
    found = np.empty(len(x))
    s = 0.0
    for k, (at_x, at_y) in enumerate(zip(x.tolist(), y.tolist(), strict=True)):
        for _ in range(MOST_STEPS):
            i = min(max(bisect_right(marks, s) - 1, 0), last)
            turn = curvature[i] * (s - marks[i])
            half = 0.5 * turn
            chord = (s - marks[i]) * (math.sin(half) / half if abs(half) > 1e-9 else 1.0)
            dx = at_x - px[i] - chord * math.cos(heading[i] + half)
            dy = at_y - py[i] - chord * math.sin(heading[i] + half)
            cosine, sine = math.cos(heading[i] + turn), math.sin(heading[i] + turn)
            slope = max(1.0 - curvature[i] * (dy * cosine - dx * sine), LEAST_SLOPE)
            before, s = s, min(max(s + (dx * cosine + dy * sine) / slope, 0.0), end)
            if abs(s - before) < CONVERGED:
                break
        found[k] = s
    return found


def _away(
    trajectory: Trajectory, end: float, feet: Array, row: NDArray[np.intp], part: Array, run: SimulationRun
) -> Array:
    """Distance [m] from the path (m,), which goes straight on beyond both ends."""
    start, curvature = trajectory.heading[row], trajectory.curvature[row]
    dx, dy = arc_step(start, curvature, part)
    dx, dy = run.x - trajectory.x[row] - dx, run.y - trajectory.y[row] - dy
    course = start + curvature * part
    along = dx * np.cos(course) + dy * np.sin(course)
    across = dy * np.cos(course) - dx * np.sin(course)
    beyond = ((feet <= 0.0) & (along < 0.0)) | ((feet >= end) & (along > 0.0))
    return np.where(beyond, np.abs(across), np.hypot(along, across))


def _passed(trajectory: Trajectory, row: NDArray[np.intp], part: Array) -> Array:
    """Time [s] (m,), since the first row, at which the motion leaves the place `part` [m] after a row."""
    v, a = trajectory.v[row], trajectory.a[row]
    # part = v t + a t^2 / 2, without cancellation; standing still the place is the row's own
    mean = 0.5 * (v + np.sqrt(np.maximum(v * v + 2.0 * a * part, 0.0)))
    spent = np.divide(part, mean, out=np.zeros_like(part), where=mean > 0.0)
    step = trajectory.t[row + 1] - trajectory.t[row]
    return trajectory.t[row] - trajectory.t[0] + np.clip(spent, 0.0, step)
