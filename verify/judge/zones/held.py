"""Stops with the steering held: where they lead, and whether the robot stays in the zone that it claims.

An arc of length l and curvature kappa from the origin, straight ahead at first, ends at l P(kappa l) with
P(x) = (sin x, 1 - cos x) / x, the mean of (cos xs, sin xs) over s from 0 to 1. So |P''| <= 1/3.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from verify.judge.continuous import RESOLUTION, LeastMargin
from verify.judge.limits import Limits
from verify.judge.motion import Motion
from verify.judge.zones.separation import CHUNK, separation
from verify.judge.zones.zone import Zone

Array = NDArray[np.float64]

ROUNDS = 40  # of halving turns; a coarser (still proven) bound is returned beyond them
SPEED_ROUNDS = 30  # the same of speeds, for zones of which only little is known
MOST_PARTS = 4000  # ranges of speeds that are halved at once


def outside(zone: Zone, radius: float, points: Array, speed: Array) -> Array:
    """How far a disc of `radius` [m] is outside of the zone, less than zero where it is inside.

    Parameters
    ----------
    points : (n, 2) [m], its centre in the frame of the pose that claims the zone, x along its course.
    speed : (n,) [m/s], at that pose.

    Returns
    -------
    (n,) [m], the greatest of n.p + radius - h(n) over unit vectors n
    """
    found = np.empty(len(points))
    for first in range(0, len(points), CHUNK):
        here = slice(first, first + CHUNK)
        p = points[here]
        found[here] = separation(zone, np.hstack([p, p]), np.full(len(p), -radius), speed[here])[0]
    return found


def arc_point(length: Array, curvature: Array) -> Array:
    """Where arcs of `length` [m] and `curvature` [1/m] from the origin along x end; (..., 2) [m]."""
    half = 0.5 * curvature * length
    chord = length * np.sinc(half / np.pi)
    return np.stack([chord * np.cos(half), chord * np.sin(half)], axis=-1)


def held_way(speed: Array, curvature: Array, limits: Limits) -> Array:
    """Length [m] of stops with the steering held, in which turning and braking share the friction.

    Parameters
    ----------
    speed : (n,) [m/s]; curvature : (n,) [1/m].

    Notes
    -----
    Derived. After the reaction time the robot loses speed at min(a_b, sqrt((mu g)^2 - kappa^2 u^2)) with
    u = v^2, so it goes the integral of du / (2 a). With u* = sqrt((mu g)^2 - a_b^2) / |kappa| that is
    u / (2 a_b) up to u*, and [asin(|kappa| u / (mu g)) - asin(|kappa| u* / (mu g))] / (2 |kappa|) beyond. A
    bend that is sharper than friction allows is taken at its limit.
    """
    bend, square = np.abs(curvature), speed * speed
    left = math.sqrt(max(0.0, (limits.grip - limits.braking) * (limits.grip + limits.braking)))
    plain = np.minimum(square, np.divide(left, bend, out=np.full_like(bend, np.inf), where=bend > 0.0))
    share = [np.arcsin(np.minimum(bend * u / limits.grip, 1.0)) for u in (square, plain)]
    shared = np.divide(share[0] - share[1], 2.0 * bend, out=np.zeros_like(bend), where=square > plain)
    return np.asarray(speed * limits.reaction_time + 0.5 * plain / limits.braking + shared)


def least_arc_room(motion: Motion, zone: Zone, limits: Limits) -> LeastMargin | None:
    """Least room that stops with full braking and the steering held leave in the zone; None without motion.

    With friction in reserve a stop from the speed v takes an arc as long as the stopping distance D(v). The
    robot's disc must be in the zone all along, for all curvatures up to the row's.

    Notes
    -----
    Derived. Which speeds within a row are the worst the zone says (`worst_speeds`). Zones do not shrink with
    speed and an arc of one curvature is part of a longer one, so over a range of speeds no stop leaves more
    than the arc of the greatest speed leaves the zone of the least. Ranges for which that is not tight enough
    are halved, and so it is shown for all speeds of a row.
    """
    moving = np.flatnonzero(motion.moving)
    if not moving.size:
        return None
    index, low, high = zone.worst_speeds(motion.v[moving], motion.v[moving + 1])
    row = moving[index]
    shown = _worst(motion, zone, limits, row, low, high)
    wide = high > low
    best, at = (-math.inf, 0) if wide.all() else _most(np.where(wide, -math.inf, shown[1]), row)
    proven = float(shown[0][~wide].max(initial=-math.inf))
    row, low, high, upper = row[wide], low[wide], high[wide], shown[0][wide]
    for speed in (low, high):
        if len(row):
            best, at = max((best, at), _most(_worst(motion, zone, limits, row, speed, speed)[1], row))
    for _ in range(SPEED_ROUNDS):
        open_parts = upper > max(best, 0.0) + RESOLUTION
        proven = max(proven, float(upper[~open_parts].max(initial=-math.inf)))
        row, low, high, upper = row[open_parts], low[open_parts], high[open_parts], upper[open_parts]
        if not len(row) or len(row) > MOST_PARTS:
            break
        middle = 0.5 * (low + high)
        best, at = max((best, at), _most(_worst(motion, zone, limits, row, middle, middle)[1], row))
        row = np.concatenate([row, row])
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
        upper = _worst(motion, zone, limits, row, low, high)[0]
    proven = max(proven, float(upper.max(initial=-math.inf)))
    there = at + int(motion.v[at + 1] > motion.v[at])
    t, x, y = (float(values[there]) for values in (motion.t, motion.x, motion.y))
    return LeastMargin(proven=-max(proven, best), attained=-best, t=t, x=x, y=y)


def _most(excess: Array, row: NDArray[np.int64]) -> tuple[float, int]:
    """The greatest and its row."""
    most = int(np.argmax(excess))
    return float(excess[most]), int(row[most])


def _worst(
    motion: Motion, zone: Zone, limits: Limits, row: NDArray[np.int64], least: Array, most: Array
) -> tuple[Array, Array]:
    """How far arcs of the stops from speeds `most` leave the zones of speeds `least` [m/s], (n,) each.

    Returns
    -------
    (n,) [m], an upper bound and what is attained; only the greatest of all bounds is tight.

    Notes
    -----
    Derived. The centre is at s D P(s x) after the share s of the arc, x = kappa D. The positions at which the
    disc is in the zone form a convex set that holds the origin, so with D P(y) for all y up to x all
    s D P(s y) are in it. For a fixed n the excess is n.D P(y) less what does not depend on y, so over turns
    from y0 to y1 its greatest over n is at most the greater of its end values plus D (y1 - y0)^2 / 24. Parts
    of which that is not tight enough are halved.
    """
    far = most * limits.reaction_time + 0.5 * most * most / limits.braking
    low, high = np.zeros(len(row)), far * motion.curvature[row]
    part = np.arange(len(row))

    def excess(which: NDArray[np.int64], turn: Array) -> Array:
        bend = np.divide(turn, far[which], out=np.zeros_like(turn), where=far[which] > 0.0)
        return outside(zone, limits.radius, arc_point(far[which], bend), least[which])

    at_low, at_high = excess(part, low), excess(part, high)
    bound, attained = np.full(len(row), -math.inf), np.full(len(row), -math.inf)
    for turn in range(ROUNDS):
        np.maximum.at(attained, part, np.maximum(at_low, at_high))
        upper = np.maximum(at_low, at_high) + far[part] * (high - low) ** 2 / 24.0
        open_parts = (upper > attained.max() + RESOLUTION) & (turn < ROUNDS - 1)
        np.maximum.at(bound, part[~open_parts], upper[~open_parts])
        if not open_parts.any():
            break
        part, low, high = part[open_parts], low[open_parts], high[open_parts]
        middle = 0.5 * (low + high)
        at_middle = excess(part, middle)
        at_low, at_high = (
            np.concatenate([at_low[open_parts], at_middle]),
            np.concatenate([at_middle, at_high[open_parts]]),
        )
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
        part = np.concatenate([part, part])
    return bound, attained
