"""Straight legs at a constant speed, near a wall or a point, and rides along a constant clearance."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def straight_legs(
    speed: float, at_point: bool, r1: Array, r2: Array, span: Array, hessian: bool
) -> tuple[Array, Array, Array, Array | None]:
    """Time, outward, invariant and Hessian by (r1, r2, span) of straight legs at `speed` [m/s].

    `r1`, `r2` (n,) [m] are distances to the wall, or to the point (span below pi [rad]). The length D is the
    root of F, so that its Hessian is (F'' / 2 - D' D') / D.
    """
    rise = r2 - r1
    versine = 2.0 * np.sin(0.5 * span) ** 2 if at_point else np.zeros_like(span)
    across = r1 * r2 * np.sin(span) if at_point else span
    length = np.sqrt(rise * rise + (2.0 * r1 * r2 * versine if at_point else span * span))
    moved = length > 0.0
    safe = np.where(moved, length, 1.0)
    outward = np.stack([rise - r2 * versine, rise + r1 * versine], axis=-1) / safe[:, None]
    still = np.maximum(r1, r2) if at_point else np.ones_like(span)
    invariant = np.where(moved, across / safe, still)
    if not hessian:
        return length / speed, outward, invariant / speed, None
    h = np.zeros((len(span), 3, 3))
    h[:, 0, 0] = h[:, 1, 1] = 1.0
    h[:, 0, 1] = h[:, 1, 0] = versine - 1.0
    h[:, 2, 2] = r1 * r2 * (1.0 - versine) if at_point else 1.0
    if at_point:
        h[:, 0, 2] = h[:, 2, 0] = r2 * np.sin(span)
        h[:, 1, 2] = h[:, 2, 1] = r1 * np.sin(span)
    slope = np.stack([-outward[:, 0], outward[:, 1], invariant], axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        h = (h - slope[:, :, None] * slope[:, None, :]) / (length * speed)[:, None, None]
    return length / speed, outward, invariant / speed, h


def straight_points(
    at_point: bool, r1: Array, r2: Array, span: Array, fraction: Array
) -> tuple[Array, Array]:
    """Foot offset and distance (n, k) at `fraction` (n, k) of the length."""
    r1, r2, span = r1[:, None], r2[:, None], span[:, None]
    if not at_point:
        return fraction * span, (1.0 - fraction) * r1 + fraction * r2
    x, y = ((1.0 - fraction) * r1 + fraction * r2 * np.cos(span), fraction * r2 * np.sin(span))
    return np.arctan2(y, x), np.hypot(x, y)


def ride_slope(speed: Array, slope: Array, r: Array, invariant: float, at_point: bool) -> tuple[Array, Array]:
    """|cos beta|, and the derivative of |cos beta| / V by d, (n,), of arcs with a given invariant k.

    From sin(beta) = k V / r (near a wall k V): the derivative of the root of 1 / V^2 - (k / r)^2.
    `slope` = V' [1/s].
    """
    turn = invariant / r if at_point else np.full_like(r, invariant)
    cosine = np.sqrt(np.maximum((1.0 - turn * speed) * (1.0 + turn * speed), 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        change = -slope / speed**3 + (turn * turn / r if at_point else 0.0)
        return cosine, change * speed / cosine
