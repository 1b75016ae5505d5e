"""Where a zone and convex obstacles come closest: the direction that separates them best, and by how much.

For a unit vector n in the body's frame, min over the obstacle's corners of n.p less h(n) is how far the line
n.p = h(n), which touches the zone, stays clear of the obstacle. The greatest over n is their distance, or
minus the least shift that would part them. **Any n gives a valid lower bound**: no search needs to be trusted.

As a function of the angle of n it satisfies f + f'' <= 0 (h is a support function, the rest a minimum of
cosines), so f is concave wherever it is positive, and its slope there falls through zero once.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vnav_drake.zones.convex_zone import ConvexZone, GaugeZone

Array = NDArray[np.float64]

GRID = 32  # directions of the first look
STEPS = 40  # of the search for the slope's zero, at most
ANGLE = 1e-12  # [rad], of the search
LONGEST = 1e9  # [m]: a longer stopping distance is none at all
NEWTON = 60  # steps of the search for the greatest stopping distance, at most; five or so are usual


@dataclass(frozen=True)
class Touch:
    """Zone against obstacles, one by one."""

    gap: Array  # (n,) [m], negative where the obstacle reaches into the zone
    angle: Array  # (n,) [rad] in the body's frame, towards the obstacle
    corner: Array  # (n, 2) [m], the corner that is nearest in that direction


def separation(zone: ConvexZone, corners: Array, speed: Array) -> Touch:
    """Signed distance between zones at these speeds and obstacles.

    Parameters
    ----------
    corners : (n, k, 2) [m], of convex obstacles in the frame of the body, in order, repeats allowed.
    speed : (n,) [m/s].
    """
    x, y = corners[..., 0], corners[..., 1]
    speed = speed[:, None]
    even = np.linspace(-math.pi, math.pi, GRID, endpoint=False)
    grid = np.sort(np.concatenate([even, _principal(zone.kinks)]))
    first = _values(zone, x, y, np.broadcast_to(grid, (len(x), len(grid))), speed)
    best = np.argmax(first, axis=1)
    start = grid[best]
    low = start - (2.0 * math.pi / GRID)
    high = start + (2.0 * math.pi / GRID)
    smooth = _slope_zero(zone, x, y, low, high, speed)
    edge = np.roll(corners, -1, axis=1) - corners
    normals = np.arctan2(edge[..., 0], -edge[..., 1])  # inwards: from the robot to the obstacle
    angle = np.concatenate([smooth[:, None], start[:, None], normals, normals + math.pi], axis=1)
    value = _values(zone, x, y, angle, speed)
    top = np.argmax(value, axis=1)[:, None]
    angle = np.take_along_axis(angle, top, axis=1)
    nearest = np.argmin(x * np.cos(angle) + y * np.sin(angle), axis=1)
    gap = np.take_along_axis(value, top, axis=1)[:, 0]
    return Touch(gap, angle[:, 0], corners[np.arange(len(x)), nearest])


def stopping_room(zone: GaugeZone, corners: Array) -> tuple[Array, Array]:
    """Greatest stopping distance with which obstacles stay out of the zone, one by one.

    Parameters
    ----------
    corners : (n, k, 2) [m], as for `separation`.

    Returns
    -------
    (n,) [m], zero where the body itself does not fit, infinite where no length of the zone reaches the
    obstacle; and (n,) [rad], the direction in the body's frame that shows it.

    Notes
    -----
    Newton's method: the gap is a convex, falling function of the stopping distance (a maximum of straight
    lines), so each step stays on the safe side, and the steps converge quadratically.
    """
    law = zone.law
    room = np.zeros(len(corners))
    angle = np.zeros(len(corners))
    active = np.arange(len(corners))
    for _ in range(NEWTON):
        touch = separation(zone, corners[active], _speed_of(zone, room[active]))
        angle[active] = touch.angle
        shape, _ = zone.shape(touch.angle)
        with np.errstate(divide="ignore"):
            step = np.where(touch.gap > 0.0, touch.gap / np.maximum(shape, 0.0), 0.0)
        room[active] += step
        endless = room[active] > LONGEST
        room[active[endless]] = math.inf
        going = ~endless & (step > 4.0 * np.finfo(float).eps * (law.margin + zone.radius + room[active]))
        active = active[going]
        if len(active) == 0:
            break
    return room, angle


def _speed_of(zone: GaugeZone, room: Array) -> Array:
    """The speed [m/s] whose stopping distance is `room` [m], whatever the greatest speed is."""
    a_b, lag = zone.law.max_braking, zone.law.max_braking * zone.law.reaction_time
    root = np.sqrt(lag * lag + 2.0 * a_b * room)
    return np.asarray(root if lag == 0.0 else 2.0 * a_b * room / (lag + root))


def _values(zone: ConvexZone, x: Array, y: Array, angle: Array, speed: Array) -> Array:
    """Gap [m] in directions (n, m) of obstacles with corners (n, k)."""
    cos, sin = np.cos(angle), np.sin(angle)
    least = x[:, :1] * cos + y[:, :1] * sin
    for k in range(1, x.shape[1]):
        np.minimum(least, x[:, k : k + 1] * cos + y[:, k : k + 1] * sin, out=least)
    return np.asarray(least - zone.support(angle, speed)[0])


def _slope_zero(zone: ConvexZone, x: Array, y: Array, low: Array, high: Array, speed: Array) -> Array:
    """Angle (n,) in brackets where the gap's slope changes from rising to falling (Illinois method)."""

    def slope(angle: Array) -> Array:
        cos, sin = np.cos(angle)[:, None], np.sin(angle)[:, None]
        nearest = np.argmin(x * cos + y * sin, axis=1)[:, None]
        rise = np.take_along_axis(y * cos - x * sin, nearest, axis=1)
        return np.asarray((rise - zone.support(angle[:, None], speed)[1])[:, 0])

    at_low, at_high = slope(low), slope(high)
    angle, side = 0.5 * (low + high), np.zeros(len(low))
    for _ in range(STEPS):
        bracketed = (at_low > 0.0) & (at_high < 0.0)
        secant = high - at_high * (high - low) / np.where(bracketed, at_high - at_low, 1.0)
        angle = np.clip(np.where(bracketed, secant, 0.5 * (low + high)), low, high)
        here = slope(angle)
        rises = here > 0.0
        at_high = np.where(rises & (side > 0), 0.5 * at_high, at_high)
        at_low = np.where(~rises & (side < 0), 0.5 * at_low, at_low)
        moved = np.where(rises, angle - low, high - angle)
        low, at_low = np.where(rises, angle, low), np.where(rises, here, at_low)
        high, at_high = np.where(rises, high, angle), np.where(rises, at_high, here)
        side = np.where(rises, 1.0, -1.0)
        if np.all(np.minimum(moved, high - low) < ANGLE):
            break
    return angle


def _principal(angle: Array) -> Array:
    """Angles from -pi to pi."""
    return np.asarray(np.remainder(angle + math.pi, 2.0 * math.pi) - math.pi)
