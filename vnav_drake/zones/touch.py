"""Where a zone and convex obstacles come closest: the direction that separates them best, and by how much.

For a unit vector n in the body's frame, min over the obstacle's corners of n.p less h(n) is how far the line
n.p = h(n), which touches the zone, stays clear of the obstacle. The greatest over n is their distance, or
minus the least shift that would part them. **Any n gives a valid lower bound**: no search needs trust.

As a function of the angle of n it satisfies f + f'' <= 0 (h is a support function, the rest a minimum of
cosines), so f is concave wherever it is positive, and its slope there falls through zero once.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vnav_drake.zones.convex_zone import ConvexZone, GaugeZone

Array = NDArray[np.float64]

GRID = 24  # directions of the first look, besides those of edges, kinks and the nearest point
STEPS = 40  # of the search for the slope's zero, at most; ten or so are usual
ANGLE = 1e-10  # [rad], of the search
SAME = 1e-8  # [rad], between looks; at half of this from the best one its value is good to 1e-16
LONGEST = 1e9  # a direction in which E reaches less than one in this many does not limit its length


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
    speed = speed[:, None]

    def gap(angle: Array) -> Array:
        return np.asarray(_least(corners, angle)[0] - zone.support(angle, speed)[0])

    def slope(angle: Array) -> Array:
        return np.asarray(_least(corners, angle)[1] - zone.support(angle, speed)[1])

    angle, value = _greatest(zone, corners, gap, slope)
    nearest = np.argmin(np.einsum("nkj,nj->nk", corners, _unit(angle)), axis=1)
    return Touch(value, angle, corners[np.arange(len(corners)), nearest])


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
    The greatest over n of (min n.p - h_body(n)) / h_E(n), a concave function over a convex one, both
    homogeneous: as a function of the angle it rises, then falls, wherever it is positive.
    """

    def parts(angle: Array) -> tuple[Array, Array, Array, Array]:
        near, near_slope = _least(corners, angle)
        body, body_slope = zone.body(angle)
        shape, shape_slope = zone.shape(angle)
        return near - body, near_slope - body_slope, shape, shape_slope

    def room(angle: Array) -> Array:
        free, _, shape, _ = parts(angle)
        far = free / np.maximum(shape, 1.0 / LONGEST)
        return np.where(free > 0.0, far, free)  # what does not fit is below what does

    def slope(angle: Array) -> Array:
        free, free_slope, shape, shape_slope = parts(angle)
        return np.where(free > 0.0, free_slope * shape - free * shape_slope, free_slope)

    angle, value = _greatest(zone, corners, room, slope)
    endless = (value > 0.0) & (zone.shape(angle)[0] <= 1.0 / LONGEST)
    return np.where(endless, math.inf, np.maximum(value, 0.0)), angle


def outside_shape(zone: GaugeZone, points: Array) -> tuple[Array, Array]:
    """How far points (n, 2) lie outside E, in units of the stopping distance, and in which direction (n,)."""
    corners = points[:, None, :]

    def gap(angle: Array) -> Array:
        return np.asarray(_least(corners, angle)[0] - zone.shape(angle)[0])

    def slope(angle: Array) -> Array:
        return np.asarray(_least(corners, angle)[1] - zone.shape(angle)[1])

    angle, value = _greatest(zone, corners, gap, slope)
    return value, angle


def _greatest(
    zone: ConvexZone,
    corners: Array,
    value: Callable[[Array], Array],
    slope: Callable[[Array], Array],
) -> tuple[Array, Array]:
    """Where a function of the angle, (n, m) to (n, m), is greatest, (n,), and how great it is, (n,).

    Looked at in directions that must not be missed; then the slope's zero between the neighbours of the
    best one.
    """
    fixed = np.concatenate([np.linspace(-math.pi, math.pi, GRID, endpoint=False), zone.kinks])
    looks = np.concatenate([np.broadcast_to(fixed, (len(corners), len(fixed))), _directions(corners)], axis=1)
    looks = np.remainder(looks + math.pi, 2.0 * math.pi) - math.pi
    seen = value(looks)
    rows, best = np.arange(len(corners)), np.argmax(seen, axis=1)
    angle, most = looks[rows, best], seen[rows, best]
    away = np.remainder(looks - angle[:, None], 2.0 * math.pi)
    away[(away < SAME) | (away > 2.0 * math.pi - SAME)] = math.nan  # looks may repeat
    low, high = angle - 2.0 * math.pi + np.nanmax(away, axis=1), angle + np.nanmin(away, axis=1)
    beside = slope(np.stack([angle - SAME, angle + SAME], axis=1))
    on_kink = (beside[:, 0] > 0.0) & (beside[:, 1] < 0.0)  # nothing is left to find
    low = np.where(on_kink | (beside[:, 1] > 0.0), angle, low)
    high = np.where(on_kink | (beside[:, 1] <= 0.0), angle, high)
    found = slope_zero(lambda here: slope(here[:, None])[:, 0], low, high)
    there = value(found[:, None])[:, 0]
    return np.where(there > most, found, angle), np.maximum(there, most)


def _least(corners: Array, angle: Array) -> tuple[Array, Array]:
    """min over corners (n, k, 2) of n.p for directions (n, m), and its slope; (n, m) each."""
    cos, sin = np.cos(angle), np.sin(angle)
    x, y = corners[:, 0, :1], corners[:, 0, 1:]
    least, across = x * cos + y * sin, y * cos - x * sin
    for k in range(1, corners.shape[1]):
        x, y = corners[:, k, :1], corners[:, k, 1:]
        along = x * cos + y * sin
        nearer = along < least
        least = np.where(nearer, along, least)
        across = np.where(nearer, y * cos - x * sin, across)
    return least, across


def _directions(corners: Array) -> Array:
    """Directions (n, 2 k) [rad] that may part an obstacle: its edges' normals, its nearest points."""
    edge = np.roll(corners, -1, axis=1) - corners
    square = np.einsum("nkj,nkj->nk", edge, edge)
    share = -np.einsum("nkj,nkj->nk", corners, edge) / np.where(square > 0.0, square, 1.0)
    foot = corners + np.clip(share, 0.0, 1.0)[..., None] * edge
    normal = np.arctan2(edge[..., 0], -edge[..., 1])  # inwards, from the robot to an anticlockwise polygon
    return np.concatenate([normal, np.arctan2(foot[..., 1], foot[..., 0])], axis=1)


def slope_zero(slope: Callable[[Array], Array], low: Array, high: Array, steps: int = STEPS) -> Array:
    """Angle (n,) in brackets where the slope, (n,) to (n,), changes from positive to negative.

    Illinois method, Dowell and Jarratt 1971, with that many steps at most. Where the slope jumps it closes in
    on the jump.
    """
    at_low, at_high = slope(low), slope(high)
    angle, side = 0.5 * (low + high), np.zeros(len(low))
    for _ in range(steps):
        bracketed = (at_low > 0.0) & (at_high < 0.0)
        secant = high - at_high * (high - low) / np.where(bracketed, at_high - at_low, 1.0)
        new = np.clip(np.where(bracketed, secant, 0.5 * (low + high)), low, high)
        here = slope(new)
        rises = here > 0.0
        at_high = np.where(rises & (side > 0), 0.5 * at_high, at_high)
        at_low = np.where(~rises & (side < 0), 0.5 * at_low, at_low)
        low, at_low = np.where(rises, new, low), np.where(rises, here, at_low)
        high, at_high = np.where(rises, high, new), np.where(rises, at_high, here)
        side = np.where(rises, 1.0, -1.0)
        moved, angle = np.abs(new - angle), new
        if np.all((moved < ANGLE) | (high - low < ANGLE)):
            break
    return angle


def _unit(angle: Array) -> Array:
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def into_body(corners: Array, x: Array, y: Array, heading: Array) -> Array:
    """Points (m, k, 2) [m] of the world in the frames of bodies at x, y, heading (m,)."""
    dx, dy = corners[..., 0] - x[:, None], corners[..., 1] - y[:, None]
    cos, sin = np.cos(heading)[:, None], np.sin(heading)[:, None]
    return np.stack([cos * dx + sin * dy, cos * dy - sin * dx], axis=-1)
