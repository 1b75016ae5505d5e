"""Did a simulated vehicle follow its trajectory, on its wheels, beside the path and on time?"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from systems.run import SimulationRun
from vnav_drake.plan import Trajectory

Array = NDArray[np.float64]

SAMPLING = 5e-3  # [s], of the trajectory that a run is compared with


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
    """Compare a run with its trajectory, up to the planned end.

    The cause is what went wrong first in kind: a fall explains a slide, a slide explains leaving the path.
    """
    # rows may lie far apart in time, above all where the plan starts from rest
    count = math.ceil(trajectory.travel_time / SAMPLING) + 1
    times = np.linspace(trajectory.t[0], trajectory.t[-1], count)
    x, y, course = trajectory.at(times)[:3]
    _, nearest = cKDTree(np.column_stack([x, y])).query(np.column_stack([run.x, run.y]))
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
