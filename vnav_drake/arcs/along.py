"""Travel along Voronoi arcs at the greatest safe speed: times, tangents and derivatives.

An arc equidistant from two features is itself time-optimal between its points (Manor 2015, Sec. 3.4.5), where
the speed still grows with clearance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vnav_drake.braking import UniformBraking
from vnav_drake.voronoi import PARABOLA, Curves, travel_time

Array = NDArray[np.float64]


@dataclass(frozen=True)
class CurveLegs:
    """Travel along n curves, from `curves.span[:, 0]` to `curves.span[:, 1]`."""

    time: Array  # (n,) [s]
    tangent: Array  # (n, 2, 2) unit vectors in the direction of travel, at start and end
    slope: Array  # (n, 2) derivatives of the time by the parameters u of start and end [s/m]


def along_curves(law: UniformBraking, radius: float, curves: Curves) -> CurveLegs:
    """Times along curves for a disc of `radius` [m], tangents and derivatives at both ends.

    A curve of no length travels in the direction of its axis. Infinite derivatives where V = 0; infinite
    times where the robot would come to rest on the way.
    """
    u = curves.span
    size = np.where(curves.kind == PARABOLA, curves.size, 1.0)[:, None]
    stretch = np.where(curves.kind[:, None] == PARABOLA, np.hypot(1.0, u / size), 1.0)  # ds/du
    direction = np.where(u[:, 1] >= u[:, 0], 1.0, -1.0)[:, None]
    with np.errstate(divide="ignore"):
        slope = direction * np.array([-1.0, 1.0]) * stretch / law.speed(curves.distance(u) - radius)
    return CurveLegs(travel_time(curves, law, radius), curves.tangents(u), slope)
