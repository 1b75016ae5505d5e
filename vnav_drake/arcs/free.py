"""Optimal arcs near one wall or one point where no greatest speed holds: which closed form applies."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vnav_drake.arcs.disc import angle, ends_of
from vnav_drake.arcs.disc_legs import disc_legs
from vnav_drake.arcs.disc_paths import disc_points
from vnav_drake.arcs.point import point_legs, point_points
from vnav_drake.arcs.wall import wall_legs, wall_points
from vnav_drake.braking import UniformBraking

Array = NDArray[np.float64]
Solution = tuple[Array, Array, Array, Array | None]  # time, outward, invariant, Hessian by (d1, d2, span)


def free_legs(
    law: UniformBraking,
    radius: float,
    at_point: bool,
    d1: Array,
    d2: Array,
    span: Array,
    hessian: bool,
    nodes: int,
) -> Solution:
    """Legs near one kind of feature, at speeds of the braking distance alone; see `solve_legs`."""
    accel, lag = law.max_braking, law.max_braking * law.reaction_time
    level = radius + law.margin
    if not at_point:
        return wall_legs(accel, lag, law.speed(d1), law.speed(d2), span, hessian)
    if lag > 0.0 or level > 0.0:
        level = max(level, _least_level(lag, accel))
        return disc_legs(accel, lag, level, law.speed(d1), law.speed(d2), span, hessian, nodes)
    return point_legs(accel, d1, d2, span, hessian)


def free_points(
    law: UniformBraking, radius: float, at_point: bool, d1: Array, d2: Array, span: Array, fraction: Array
) -> tuple[Array, Array]:
    """Foot offset and clearance of points of such legs; see `leg_points`."""
    accel, lag = law.max_braking, law.max_braking * law.reaction_time
    level = radius + law.margin
    if at_point and lag == 0.0 and level == 0.0:
        return point_points(d1, d2, span, fraction)
    v1, v2 = law.speed(d1), law.speed(d2)
    if at_point:
        level = max(level, _least_level(lag, accel))
        offset, speed = disc_points(accel, lag, level, v1, v2, span, fraction)
    else:
        offset, speed = wall_points(accel, lag, v1, v2, span, fraction)
    return offset, law.distance(speed)


def bulges(law: UniformBraking, radius: float, at_point: bool, clearance: float) -> bool:
    """Whether arcs along this clearance are pushed outwards: r / V falls there (near a wall 1 / V does)."""
    slope = law.max_braking / (float(law.speed(clearance)) + law.max_braking * law.reaction_time)
    return not at_point or (radius + clearance) * slope > float(law.speed(clearance))


def attach_span(law: UniformBraking, radius: float, at_point: bool, d: Array, cap: float) -> Array:
    """Span (n,) of the arcs that start at clearance d (n,) and come to `cap` >= d tangentially from below.

    Near a wall the integral of (V + lag) tan(alpha) / a dV with V = V_cap sin(alpha); near a point the arc
    with cos(beta_2) = 0, m^2 = -B / (E M) (`disc`). The arcs must bulge at `cap`.
    """
    accel, lag = law.max_braking, law.max_braking * law.reaction_time
    v, top = law.speed(d), law.speed(np.full_like(d, cap))
    if at_point:
        e = ends_of(accel, lag, max(radius + law.margin, _least_level(lag, accel)), v, top)
        m = np.sqrt(np.maximum(e.b, 0.0) / (e.e * np.maximum(-e.m, np.finfo(float).tiny)))
        m = np.minimum(m, e.top)
        return angle(e, m, 1.0 - (m / e.top) ** 2)
    sine = np.minimum(v / top, 1.0)
    cosine = np.sqrt((1.0 - sine) * (1.0 + sine))
    turn = np.arctan2(cosine, sine)  # pi / 2 - alpha
    return np.asarray(top / accel * (0.5 * top * (turn + sine * cosine) + lag * cosine))


def _least_level(lag: float, accel: float) -> float:
    """Level [m] that stands for zero where radius and margin are zero and there is a lag.

    With a lag all is smooth down to level zero, but the unit of speed in `disc` is that of the level.
    Distances are off by 1e-14 of lag^2 / a, the scale at which braking takes over from the lag.
    """
    return 1e-14 * lag * lag / accel
