"""Optimal arcs near one feature, many at once, whatever the feature and the speed law."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vnav_drake.arcs.capped import capped_legs, capped_points
from vnav_drake.arcs.free import free_legs, free_points
from vnav_drake.braking import UniformBraking

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Legs:
    """n time-optimal arcs, each as if its feature were the only one in the world.

    The gradient of the time by (d1, d2, span) is (-outward[0] / V1, outward[1] / V2, invariant).
    """

    time: Array  # (n,) [s]; infinite where V = 0 at an end and there is a reaction time
    outward: Array  # (n, 2) cosine between the direction of travel and away from the feature, start and end
    invariant: Array  # (n,) dT/dspan: [s/m] near a wall, [s/rad] near a point; Clairaut's k
    hessian: Array | None  # (n, 3, 3) second derivatives of the time by (d1, d2, span)


def solve_legs(
    law: UniformBraking,
    radius: float,
    at_point: ArrayLike,
    d1: ArrayLike,
    d2: ArrayLike,
    span: ArrayLike,
    *,
    hessian: bool = False,
    nodes: int = 16,
) -> Legs:
    """Least travel times between points near one wall or one point obstacle.

    Parameters
    ----------
    law : speed law V(d).
    radius : of the robot [m]; near a point the distance to it is d + radius.
    at_point : (n,) whether the feature is a point.
    d1, d2 : (n,) clearance at start and end [m], at least law.margin.
    span : (n,) zero or more: advance along a wall [m], angle swept around a point [rad]. Near a point where
        radius and margin are zero, the least time from 2 pi on is that through the point itself.

    nodes : a third of those of the one quadrature left, that of the time near points with a reaction time: 16
        are exact to 1e-14, 8 to 1e-8. Tangents, invariants and Hessians do not depend on it.

    Notes
    -----
    At ends at the margin (V = 0) without a reaction time, the tangents are +-1; the Hessian is infinite or
    NaN there, for legs of no length, whose invariant is that of a tangential leg, and at ends exactly on the
    clearance of the greatest speed, where second derivatives jump. Near a point and within
    z = sqrt(room / level) < 0.01 of contact at both ends, times lose relative digits as 1e-16 / z^2.

    Raises
    ------
    ValueError : a clearance below the margin, a negative span or a number that is not finite.
    """
    at, low, high, s = _checked(law, at_point, d1, d2, span)
    count = len(s)
    time, outward, invariant = np.zeros(count), np.zeros((count, 2)), np.zeros(count)
    second = np.zeros((count, 3, 3)) if hessian else None
    solver = free_legs if np.isinf(law.max_speed) else capped_legs
    for mask in (at, ~at):
        index = np.flatnonzero(mask)
        if index.size == 0:
            continue
        part = solver(law, radius, bool(at[index[0]]), low[index], high[index], s[index], hessian, nodes)
        time[index], outward[index], invariant[index] = part[:3]
        if second is not None and part[3] is not None:
            second[index] = part[3]
    return Legs(time, outward, invariant, second)


def leg_points(
    law: UniformBraking,
    radius: float,
    at_point: ArrayLike,
    d1: ArrayLike,
    d2: ArrayLike,
    span: ArrayLike,
    fraction: ArrayLike,
) -> tuple[Array, Array]:
    """Points of the arcs that `solve_legs` measures.

    `fraction` (n, k) or (k,), from 0 (start) to 1 (end), of a parameter that grows along the arc. Returns
    how far the foot has come, in [0, span], and the clearance [m], (n, k) each. Raises as `solve_legs`.
    """
    at, low, high, s = _checked(law, at_point, d1, d2, span)
    f = np.asarray(fraction, dtype=float)
    f = np.broadcast_to(f, (len(s), f.shape[-1]))
    offset, clearance = np.zeros(f.shape), np.zeros(f.shape)
    solver = free_points if np.isinf(law.max_speed) else capped_points
    for mask in (at, ~at):
        index = np.flatnonzero(mask)
        if index.size:
            part = (low[index], high[index], s[index], f[index])
            offset[index], clearance[index] = solver(law, radius, bool(at[index[0]]), *part)
    return offset, clearance


def _checked(
    law: UniformBraking, at_point: ArrayLike, d1: ArrayLike, d2: ArrayLike, span: ArrayLike
) -> tuple[Mask, Array, Array, Array]:
    at, low, high, s = np.broadcast_arrays(
        np.atleast_1d(np.asarray(at_point, dtype=bool)), *(np.asarray(v, dtype=float) for v in (d1, d2, span))
    )
    for name, values, least in (("d1", low, law.margin), ("d2", high, law.margin), ("span", s, 0.0)):
        bad = np.flatnonzero(~((values >= least) & (values < np.inf)))
        if bad.size:
            raise ValueError(
                f"leg {bad[0]}: {name} = {values[bad[0]]!r}: must be finite and at least {least!r}"
            )
    return at, low, high, s
