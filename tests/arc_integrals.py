"""Clairaut's integrals by adaptive quadrature, knowing nothing of closed forms."""

from __future__ import annotations

import math
from collections.abc import Callable

from scipy.integrate import quad
from scipy.optimize import brentq

from vnav_drake.braking import UniformBraking


def clairaut(
    law: UniformBraking,
    radius: float,
    at_point: bool,
    d1: float,
    d2: float,
    k: float,
    outward: tuple[float, float],
) -> tuple[float, float]:
    """Span and time of the arc with invariant k between clearances d1 and d2, without a greatest speed.

    With R = r near a point and 1 near a wall: dspan = k V dd / (R sqrt(R^2 - k^2 V^2)), dT = R dd / (V root).
    An arc whose tangent has different signs at its ends turns at the clearance t where R = k V. It is
    integrated from there to both ends in w with |d - t| = w^2, as the integrands have a root at t; from
    d = V t_r + V^2 / (2 a) + m follows R - k V = (d - t)(dR/dd - k / (t_r + (V + V_t) / (2 a))).
    """

    def reach(d: float) -> float:
        return radius + d if at_point else 1.0

    def excess(d: float) -> float:
        return reach(d) - k * float(law.speed(d))

    def both(d: float, root: float) -> tuple[float, float]:
        v = float(law.speed(d))
        return k * v / (reach(d) * root), reach(d) / (v * root)

    def straight(d: float) -> tuple[float, float]:
        return both(d, math.sqrt(excess(d) * (reach(d) + k * float(law.speed(d)))))

    low, high = min(d1, d2), max(d1, d2)
    if outward[0] * outward[1] > 0.0:
        return _integrals(straight, low, high)
    # r / V is least at the critical clearance V = sqrt(2 a (radius + margin)): arcs turn before it
    critical = float(law.distance(math.sqrt(2.0 * law.max_braking * (radius + law.margin))))
    critical = max(critical, 1e-9 * low)  # V = 0 at the point itself is a root too
    bulges = outward[0] > 0.0
    beyond = critical if at_point else float(law.distance(1.1 / k))
    turn = brentq(excess, high if bulges else critical, beyond if bulges else low, xtol=1e-15, rtol=1e-15)
    at_turn = float(law.speed(turn))

    def turned(w: float) -> tuple[float, float]:
        d = turn - w * w if bulges else turn + w * w
        v = float(law.speed(d))
        slope = float(at_point) - k / (law.reaction_time + (v + at_turn) / (2.0 * law.max_braking))
        return both(d, 0.5 * math.sqrt(abs(slope) * (reach(d) + k * v)))

    parts = [_integrals(turned, 0.0, math.sqrt(max(abs(d - turn), 0.0))) for d in (d1, d2)]
    return parts[0][0] + parts[1][0], parts[0][1] + parts[1][1]


def _integrals(both: Callable[[float], tuple[float, float]], low: float, high: float) -> tuple[float, float]:
    span, time = (
        quad(lambda x, i=i: both(x)[i], low, high, epsabs=1e-14, epsrel=1e-12, limit=200)[0] for i in (0, 1)
    )
    return float(span), float(time)
