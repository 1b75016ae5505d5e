"""Colours of speeds as numbers, for pictures that matplotlib does not draw: the same map as everywhere."""

from __future__ import annotations

import matplotlib
import numpy as np
from numpy.typing import ArrayLike, NDArray

from verify.report.palette import SPEED_MAP


def speed_colours(speed: ArrayLike, top: float) -> NDArray[np.float64]:
    """Red, green and blue (..., 3) in 0 to 1 of speeds (...) [m/s] on the scale from 0 to `top` [m/s]."""
    share = np.clip(np.asarray(speed, dtype=float) / top, 0.0, 1.0)
    return np.asarray(matplotlib.colormaps[SPEED_MAP](share), dtype=float)[..., :3]
