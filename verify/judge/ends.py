"""The proven extra time of ends that are not at the safe speed."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq

from verify.judge.geometry import Surroundings
from verify.judge.limits import Limits


def end_cost(limits: Limits, surroundings: Surroundings, start: Any, goal: Any) -> float:
    """Time [s] E such that no motion with these end speeds beats T* + E; zero for safe ends.

    T* is the optimum of the variational model, whose ends are safe. E is the sum over both ends,
    valid when the start and the goal are at least both cut lengths apart; otherwise zero, which is
    always true.
    """
    cuts = [
        _cut(limits, surroundings, start, limits.acceleration),
        _cut(limits, surroundings, goal, limits.braking),
    ]
    apart = math.dist(start.position, goal.position)
    if apart < sum(length for length, _ in cuts):
        return 0.0
    return sum(cost for _, cost in cuts)


def _cut(limits: Limits, surroundings: Surroundings, end: Any, rate: float) -> tuple[float, float]:
    """Cut length [m] and extra time [s] of one end with a fixed speed.

    Derived. Let the motion start at S with speed v0, where the clearance is c, and gain speed at a
    `rate` A at most (a goal is the same backwards, with A = a_b). Cut it after the arc length s. To
    get there takes at least t(s) = (sqrt(v0^2 + 2 A s) - v0)/A. The cut lies within s of S, and as
    clearance is 1-Lipschitz the straight chord to it takes at most the integral of dl/V(c - l) from 0
    to s. T* obeys the triangle inequality, so the motion takes at least T* + t(s) - integral, for
    every s < c. The difference grows while v0^2 + 2 A s <= V(c - s)^2, and the s of equality is the
    best. For the uniform law without reaction time, margin and speed limit, V(d)^2 = 2 a_b d, hence

        s1 = (2 a_b c - v0^2) / (2 (a_b + A)),
        E  = (sqrt(v0^2 + 2 A s1) - v0)/A - sqrt(2/a_b) (sqrt(c) - sqrt(c - s1)),

    which for v0 = 0 is sqrt(2 c/a_b) (sqrt(1 + a_b/A) - 1). For other laws s1 is found by root
    finding and the integral numerically; any s gives a true bound.
    """
    if end.speed == "safe":
        return 0.0, 0.0
    speed = 0.0 if end.speed == "rest" else float(end.speed)
    clearance = float(surroundings.distance(np.array([end.position]))[0]) - limits.radius
    if clearance <= limits.margin or limits.safe_speed(clearance) <= speed:
        return 0.0, 0.0
    braking = limits.braking
    if limits.reaction_time == 0.0 and limits.margin == 0.0 and math.isinf(limits.speed):
        length = (2.0 * braking * clearance - speed**2) / (2.0 * (braking + rate))
        chord = math.sqrt(2.0 / braking) * (math.sqrt(clearance) - math.sqrt(clearance - length))
    else:

        def faster(s: float) -> float:
            return speed**2 + 2.0 * rate * s - limits.safe_speed(clearance - s) ** 2

        length = brentq(faster, 0.0, clearance - limits.margin, xtol=1e-12)

        def slowness(s: float) -> float:
            return 1.0 / limits.safe_speed(clearance - s)

        chord = quad(slowness, 0.0, length, epsabs=1e-12, limit=200)[0]
    reach = (math.sqrt(speed**2 + 2.0 * rate * length) - speed) / rate
    return length, max(0.0, reach - chord)
