"""Arcs with both ends (nearly) at rest: they leave and come back upright, too steep for closed forms."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_UPRIGHT = 1e-6  # of the speed gained falling over the span: its cube is below rounding


def lifted(accel: float, v1: Array, v2: Array, span: Array) -> tuple[Array, Array]:
    """Speeds [m/s] at both ends, where both are less raised to 1e-6 sqrt(2 a span); `span` in [m]."""
    least = _UPRIGHT * np.sqrt(2.0 * accel * span)
    least = np.where(np.maximum(v1, v2) < least, least, 0.0)
    return np.maximum(v1, least), np.maximum(v2, least)


def upright_time(accel: float, lag: float, high: Array, low: Array) -> Array:
    """Time [s] straight out from speed `low` to speed `high`: the integral of (V + lag) / (a V) dV.

    Infinite with a lag where `low` is zero, even for `high` = `low`, which is where a leg starts or ends.
    """
    time = (high - low) / accel
    if lag > 0.0:
        moving = low > 0.0
        ratio = np.where(moving, high, 1.0) / np.where(moving, low, 1.0)
        time = np.where(moving, time + lag / accel * np.log(ratio), np.inf)
    return np.asarray(time)
