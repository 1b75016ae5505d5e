"""Optimal arcs near a point obstacle where the speed is zero at the point itself (uniform law, level zero).

Derived. With w = sqrt(z), the obstacle at z = 0, the metric |dz| / sqrt(2 a |z|) becomes sqrt(2/a) |dw|. That
is flat: T = sqrt((2/a)(r1 + r2 - 2 sqrt(r1 r2) cos(span/2))), with the parabola of Manor 2015, eq. (3.12).
From span = 2 pi on the least time is that of the way through the point, sqrt(2/a)(sqrt(r1) + sqrt(r2)).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def point_legs(
    accel: float, r1: Array, r2: Array, span: Array, hessian: bool
) -> tuple[Array, Array, Array, Array | None]:
    """Time, outward, invariant and Hessian by (r1, r2, span) of arcs near a point; all (n,)."""
    q1, q2, half = np.sqrt(r1), np.sqrt(r2), 0.5 * np.minimum(span, 2.0 * np.pi)
    scale = np.sqrt(2.0 / accel)
    sine, versine = np.sin(half), 2.0 * np.sin(0.5 * half) ** 2
    gap = np.sqrt((q2 - q1) ** 2 + 2.0 * q1 * q2 * versine)
    safe = np.where(gap > 0.0, gap, 1.0)
    rise = q2 - q1
    outward = np.stack([rise - q2 * versine, rise + q1 * versine], axis=-1) / safe[:, None]
    time = scale * gap
    turned = 0.5 * scale * q1 * q2 * sine / safe
    invariant = np.where(gap > 0.0, turned, 0.5 * scale * np.maximum(q1, q2))
    if not hessian:
        return time, outward, invariant, None
    # T^2 = F, so H = (F'' / 2 - grad T grad T^t) / T
    cosine = 1.0 - versine
    with np.errstate(divide="ignore", invalid="ignore"):
        gradient = np.stack(
            [
                -0.5 * scale * outward[:, 0] / q1,
                0.5 * scale * outward[:, 1] / q2,
                np.where(span < 2.0 * np.pi, turned, 0.0),
            ],
            axis=-1,
        )
        half_f = np.empty((len(q1), 3, 3))
        half_f[:, 0, 0] = 0.5 * q2 * cosine / q1**3
        half_f[:, 1, 1] = 0.5 * q1 * cosine / q2**3
        half_f[:, 0, 1] = half_f[:, 1, 0] = -0.5 * cosine / (q1 * q2)
        half_f[:, 0, 2] = half_f[:, 2, 0] = 0.5 * q2 * sine / q1
        half_f[:, 1, 2] = half_f[:, 2, 1] = 0.5 * q1 * sine / q2
        half_f[:, 2, 2] = 0.5 * q1 * q2 * cosine
        half_f *= 1.0 / accel
        h = (half_f - gradient[:, :, None] * gradient[:, None, :]) / time[:, None, None]
    return time, outward, invariant, h


def point_points(r1: Array, r2: Array, span: Array, fraction: Array) -> tuple[Array, Array]:
    """Swept angle [rad] and distance to the point [m], (n, k) each, at `fraction` (n, k) of the time."""
    half = 0.5 * np.minimum(span, 2.0 * np.pi)[:, None]
    q1, q2 = np.sqrt(r1)[:, None], np.sqrt(r2)[:, None]
    x = (1.0 - fraction) * q1 + fraction * q2 * np.cos(half)
    y = fraction * q2 * np.sin(half)
    angle = np.where((x == 0.0) & (y == 0.0), half * (fraction > 0.5), 2.0 * np.arctan2(y, x))
    return np.clip(angle, 0.0, span[:, None]), x * x + y * y
