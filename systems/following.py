"""Did a simulated vehicle follow its trajectory, on its wheels, beside the path and on time?"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from systems.run import SimulationRun
from vnav_drake.plan import Trajectory

Array = NDArray[np.float64]

SAMPLING = 5e-3  # [s], of the trajectory that a run is compared with
REACH = 3.0  # [s], at least, before and after: what is further off its time is late in any case
ROWS_AT_ONCE = 4096


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


def _beside(run: SimulationRun, times: Array, x: Array, y: Array, within: float) -> NDArray[np.intp]:
    """Sample of the motion nearest to each row of the run, among those `within` [s] of its time.

    A path may cross itself, so a place says little without its time.
    """
    step = float(times[1] - times[0]) if len(times) > 1 else SAMPLING
    reach = min(math.ceil(within / step), len(times) - 1)
    window = np.arange(-reach, reach + 1)
    found = np.empty(len(run.t), dtype=np.intp)
    for first in range(0, len(run.t), ROWS_AT_ONCE):  # bounds the memory
        rows = slice(first, first + ROWS_AT_ONCE)
        now = np.rint((run.t[rows] - times[0]) / step).astype(np.intp)
        near = np.clip(now[:, None] + window, 0, len(times) - 1)
        away = (x[near] - run.x[rows, None]) ** 2 + (y[near] - run.y[rows, None]) ** 2
        found[rows] = near[np.arange(len(now)), np.argmin(away, axis=1)]
    return found


def following(run: SimulationRun, trajectory: Trajectory, tolerance: Tolerance) -> Following:
    """Compare a run with its trajectory, up to the planned end.

    The cause is what went wrong first in kind: a fall explains a slide, a slide explains leaving the path.
    """
    # rows may lie far apart in time, above all where the plan starts from rest
    count = math.ceil(trajectory.travel_time / SAMPLING) + 1
    times = np.linspace(trajectory.t[0], trajectory.t[-1], count)
    x, y, course = trajectory.at(times)[:3]
    nearest = _beside(run, times, x, y, max(REACH, 2.0 * tolerance.late(trajectory)))
    heading = course[nearest]
    dx, dy = run.x - x[nearest], run.y - y[nearest]
    across = np.abs(dy * np.cos(heading) - dx * np.sin(heading))
    during = run.t <= trajectory.t[-1]
    during[0] = True
    sideways = float(np.max(across[during]))
    late = float(np.max((run.t - times[nearest])[during]))
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
