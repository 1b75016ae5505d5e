"""The proven extra time of ends that are not at the safe speed."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq

from verify.judge.geometry import Surroundings
from verify.judge.limits import Limits
from verify.judge.zones import Zone
from verify.judge.zones.zone import GaugeZone


def end_cost(
    limits: Limits, surroundings: Surroundings, start: Any, goal: Any, zone: Zone | None = None
) -> float:
    """Time [s] E such that no motion with these end speeds beats T* + E; zero for safe ends.

    T* is the optimum of the variational model, whose ends are safe. E is the sum over both ends of
    `_cost`, cut off at lengths that together do not exceed the distance from start to goal: where the
    best lengths are longer, both are shortened in proportion, as any length gives a true bound.

    Of a zone that is not a disc a disc around it gives the time along the chords (`_cost`): what is safe with
    that is safe with the zone, so the chord takes no longer than it says. Zero where there is none.
    """
    ends = ((start, limits.acceleration), (goal, limits.braking))
    if zone is not None:
        around = disc_around(limits, zone)
        if around is None:
            return 0.0
        limits = around
    clear = [_clearance(limits, surroundings, end) for end, _ in ends]
    best = [_best_cut(limits, end, rate, c) for (end, rate), c in zip(ends, clear, strict=True)]
    total = sum(best)
    if total == 0.0:
        return 0.0
    share = min(1.0, math.dist(start.position, goal.position) / total)
    return sum(
        _cost(limits, end, rate, c, share * cut)
        for (end, rate), c, cut in zip(ends, clear, best, strict=True)
    )


def disc_around(limits: Limits, zone: Zone) -> Limits | None:
    """The limits with uniform braking whose disc holds the zone at every speed; None where none is known.

    D(v) E (+) body lies in the disc of radius R_body + R_E D(v), R the greatest distances from the centre.
    """
    if not isinstance(zone, GaugeZone):
        return None
    return _with_disc(limits, zone.shape.extent, zone.body.extent)


def _with_disc(limits: Limits, share: float, body: float) -> Limits:
    """The law whose disc has the radius `body` + `share` D(v)."""
    return replace(
        limits,
        braking=limits.braking / share,
        reaction_time=limits.reaction_time * share,
        margin=body - limits.radius,
    )


def straight_time(
    limits: Limits, surroundings: Surroundings, start: Any, goal: Any, zone: Zone | None = None
) -> float:
    """Least time [s] of any motion with these end speeds: the straight way with nothing in it.

    Derived. No path is shorter than the distance D from start to goal, and along a path the drive limits
    and v_max are those of a double integrator, whose least time grows with the length. It speeds up
    with a_max to the peak p and brakes with a_b, (p^2 - v0^2)/(2 a_max) + (p^2 - v1^2)/(2 a_b) = D, or
    cruises at v_max in between. A safe end has any speed up to V(d) there, of which the best is the greatest
    that the other end's speed can be reached from within D. Where even p = max(v0, v1) takes more than D the
    path is longer, and the time that of this p. With a zone that is not a disc V is that of a disc inside,
    with which nothing is slower; without one only v_max limits it.
    """
    v0, v1 = (_speed(limits, surroundings, end, zone) for end in (start, goal))
    gain, brake = limits.acceleration, limits.braking
    distance = math.dist(start.position, goal.position)
    if start.speed == "safe":
        v0 = min(v0, math.sqrt(v1 * v1 + 2.0 * brake * distance))
    if goal.speed == "safe":
        v1 = min(v1, math.sqrt(v0 * v0 + 2.0 * gain * distance))
    energy = distance + v0 * v0 / (2.0 * gain) + v1 * v1 / (2.0 * brake)
    peak = math.sqrt(2.0 * energy * gain * brake / (gain + brake))
    peak = max(min(peak, limits.speed), v0, v1)
    ramps = (peak**2 - v0**2) / (2.0 * gain) + (peak**2 - v1**2) / (2.0 * brake)
    cruise = max(0.0, distance - ramps) / peak
    return (peak - v0) / gain + (peak - v1) / brake + cruise


def _clearance(limits: Limits, surroundings: Surroundings, end: Any) -> float:
    return float(surroundings.distance(np.array([end.position]))[0]) - limits.radius


def _speed(limits: Limits, surroundings: Surroundings, end: Any, zone: Zone | None) -> float:
    if end.speed == "safe":
        if zone is not None:
            if not isinstance(zone, GaugeZone) or zone.shape.inscribed == 0.0:
                return limits.speed
            limits = _with_disc(limits, zone.shape.inscribed, zone.body.inscribed)
        return limits.safe_speed(_clearance(limits, surroundings, end))
    return 0.0 if end.speed == "rest" else float(end.speed)


def _is_plain(limits: Limits) -> bool:
    """Whether V(d)^2 = 2 a_b d."""
    return limits.reaction_time == 0.0 and limits.margin == 0.0 and math.isinf(limits.speed)


def _best_cut(limits: Limits, end: Any, rate: float, clearance: float) -> float:
    """Length [m] at which `_cost` is greatest; zero where nothing is to be gained."""
    if end.speed == "safe":
        return 0.0
    speed = 0.0 if end.speed == "rest" else float(end.speed)
    if clearance <= limits.margin or limits.safe_speed(clearance) <= speed:
        return 0.0
    if _is_plain(limits):
        return (2.0 * limits.braking * clearance - speed**2) / (2.0 * (limits.braking + rate))

    def faster(s: float) -> float:
        return speed**2 + 2.0 * rate * s - limits.safe_speed(clearance - s) ** 2

    return float(brentq(faster, 0.0, clearance - limits.margin, xtol=1e-12))


def _cost(limits: Limits, end: Any, rate: float, clearance: float, length: float) -> float:
    """Extra time [s] of one end with a fixed speed, cut off after `length` [m].

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
    finding and the integral numerically.
    """
    if length == 0.0:
        return 0.0
    speed = 0.0 if end.speed == "rest" else float(end.speed)
    if _is_plain(limits):
        chord = math.sqrt(2.0 / limits.braking) * (math.sqrt(clearance) - math.sqrt(clearance - length))
    else:
        chord = quad(lambda s: 1.0 / limits.safe_speed(clearance - s), 0.0, length, epsabs=1e-12, limit=200)[
            0
        ]
    reach = (math.sqrt(speed**2 + 2.0 * rate * length) - speed) / rate
    return max(0.0, reach - chord)
