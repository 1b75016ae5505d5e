"""Zones that are taken at their word: whether they are nested and convex, looked at where they are used."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from verify.judge.zones.zone import Zone

Array = NDArray[np.float64]

SPEEDS = 64  # of those driven, from the least to the greatest
DIRECTIONS = 1440
ROUNDING = 1e-9  # relative to the zone's size


def sampled_faults(zone: Zone, speed: Array) -> tuple[str, ...]:
    """What is wrong with a zone at speeds (n,) [m/s] that are driven, at `SPEEDS` of them and standing.

    Notes
    -----
    Derived. Of a support function h(a - d) + h(a + d) >= 2 h(a) cos d, as the normals at a - d and a + d add
    up to 2 cos d times that at a: h + h'' >= 0 without derivatives. Of zones that do not shrink h does not
    fall with speed. Between samples nothing is shown.
    """
    driven = np.unique(np.append(speed, 0.0))
    some = driven[np.unique(np.linspace(0, len(driven) - 1, SPEEDS).round().astype(int))]
    step = 2.0 * np.pi / DIRECTIONS
    angle: Array = -np.pi + step * np.arange(DIRECTIONS, dtype=float)
    h = zone.support(angle, some[:, None])
    if h.shape != (len(some), DIRECTIONS) or not np.isfinite(h).all():
        return ("its support function is not a finite number for every angle and speed",)
    slack = ROUNDING * (1.0 + np.abs(h).max(axis=1, keepdims=True))
    faults = []
    fall = (h[:-1] - h[1:] - slack[1:]).max(axis=1, initial=-np.inf)
    if (fall > 0.0).any():
        k = int(np.argmax(fall))
        faults.append(f"it shrinks from {some[k]:.6g} to {some[k + 1]:.6g} m/s, by {fall[k]:.3g} m")
    dent = (2.0 * np.cos(step) * h - np.roll(h, 1, axis=1) - np.roll(h, -1, axis=1) - slack).max(axis=1)
    if (dent > 0.0).any():
        faults.append(f"it is not convex at {some[int(np.argmax(dent))]:.6g} m/s")
    return tuple(faults)
