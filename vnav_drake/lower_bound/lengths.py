"""Zones from which no bound of the speed follows: the least time for a way of known least length."""

from __future__ import annotations

import math

import numpy as np

from vnav_drake.problem import Problem
from vnav_drake.zones.shapes import ProtectiveField

DIRECTIONS = 5760  # in which a body of unknown form is measured


def standing_radius(problem: Problem) -> float:
    """Radius [m] of a disc in the zone at standstill."""
    least = problem.robot.radius + problem.braking.margin
    zone = problem.zone
    if not isinstance(zone, ProtectiveField):
        return least
    angle = np.linspace(-math.pi, math.pi, DIRECTIONS, endpoint=False)
    return max(least, float(zone.body(angle)[0].min()))


def drive_time(problem: Problem, length: float) -> float:
    """Least time [s] of any motion at least `length` [m] long between the problem's ends; zero: unbounded.

    Derived. The fastest motion along a path of one length speeds up with a_max to a peak p, cruises there if
    p = v_max, and brakes with a_b; its time grows with the length. A safe end has the best speed from which
    the other end's can be reached within the length.
    """
    gain, brake = problem.robot.max_acceleration, problem.braking.max_braking
    top = problem.braking.max_speed
    ends = problem.start.fixed_speed, problem.goal.fixed_speed
    if ends == (None, None) and math.isinf(top):
        return 0.0
    v0, v1 = (top if speed is None else min(speed, top) for speed in ends)
    if ends[0] is None:
        v0 = min(v0, math.sqrt(v1 * v1 + 2.0 * brake * length))
    if ends[1] is None:
        v1 = min(v1, math.sqrt(v0 * v0 + 2.0 * gain * length))
    energy = length + v0 * v0 / (2.0 * gain) + v1 * v1 / (2.0 * brake)
    peak = max(min(math.sqrt(2.0 * energy * gain * brake / (gain + brake)), top), v0, v1)
    ramps = (peak**2 - v0**2) / (2.0 * gain) + (peak**2 - v1**2) / (2.0 * brake)
    return (peak - v0) / gain + (peak - v1) / brake + max(0.0, length - ramps) / peak
