"""Forces between tyres and floor, per unit of wheel load.

Everything here is normalised by the load of the axle: a force of `mu` is all the friction there is.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

CORNERING_STIFFNESS = 10.0  # [1/rad], slope of lateral force over load; rubber tyres have 0.1 to 0.2 a degree
SLIP_REGULARISATION = 0.3  # [m/s], added in squares to the rolling speed where slip divides by it; see below


def brush_force(slip: float, friction: float) -> float:
    """Lateral force over load of a brush tyre that rolls freely (Fiala's cubic), odd in the slip.

    `slip` is the tangent of the slip angle, `friction` is mu. The force has slope
    `CORNERING_STIFFNESS` at zero and is exactly mu from slip `full_slide(friction)` on.
    """
    z = CORNERING_STIFFNESS * slip / friction
    size = abs(z)
    if size >= 3.0:
        return math.copysign(friction, slip)
    return friction * z * (1.0 - size / 3.0 + size * size / 27.0)


def full_slide(friction: float) -> float:
    """Tangent of the slip angle at which the whole contact patch slides."""
    return 3.0 * friction / CORNERING_STIFFNESS


def brush_slip(force: ArrayLike, friction: float) -> Array:
    """Tangent of the slip angle that gives a lateral force over load, |force| <= friction; same shape.

    Inverse of `brush_force`: f / mu = 1 - (1 - z / 3)^3.
    """
    used = np.asarray(force, dtype=float) / friction
    return np.copysign(full_slide(friction) * (1.0 - np.cbrt(1.0 - np.abs(used))), used)


def brush_slope(slip: ArrayLike, friction: float) -> Array:
    """Derivative of `brush_force` by the slip; same shape."""
    left = np.maximum(1.0 - np.abs(np.asarray(slip, dtype=float)) / full_slide(friction), 0.0)
    return CORNERING_STIFFNESS * left * left


def rolling_speed(forward: float) -> float:
    """Speed [m/s] by which lateral velocity is divided to get the slip: sqrt(v^2 + v0^2).

    The plain slip angle is 0 / 0 at rest and makes the tyre infinitely stiff near it. With v0 the tyre is
    a viscous damper at rest, whose time constant is at least v0 / (3 c g), c the cornering stiffness:
    3 c g l^2 / (l^2 + w^2) is the rate at which yaw decays on a box-shaped body of length l and width w.
    With v0 = 0.3 m/s that rate is below 981 1/s, inside the stability region of a third-order Runge-Kutta
    step of 2.5 ms (|lambda h| < 2.51) for every robot. What it costs: at speed v the slip velocity is that of
    a tyre rolling at sqrt(v^2 + v0^2), below 2 mm/s at the 0.1 m/s^2 that a curve of 1 m takes at v0.
    """
    return math.hypot(forward, SLIP_REGULARISATION)
