"""Times, tangents and derivatives of the arcs of `disc`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import elliprd, elliprf

from vnav_drake.arcs.contact import lifted, upright_time
from vnav_drake.arcs.disc import Arguments, Ends, ends_of, solve
from vnav_drake.arcs.disc_paths import radial_action

Array = NDArray[np.float64]


def disc_legs(
    accel: float, lag: float, level: float, v1: Array, v2: Array, span: Array, hessian: bool, nodes: int
) -> tuple[Array, Array, Array, Array | None]:
    """Time, outward, invariant and Hessian by (d1, d2, span) of arcs near a point.

    Parameters
    ----------
    accel [m/s^2], lag = accel * reaction time [m/s], level [m] > 0: distance to the point where V = 0.
    v1, v2 : (n,) safe speeds at start and end [m/s], zero or more.
    span : (n,) [rad], zero or more.
    nodes : a third of those of the quadrature of the time with a lag.

    Notes
    -----
    Infinite time where a speed is zero and lag > 0; infinite Hessian where a speed is zero.
    """
    given, (v1, v2) = (v1, v2), lifted(accel, v1, v2, level * np.minimum(span, 1.0))
    e = ends_of(accel, lag, level, v1, v2)
    m, left = solve(e, span)
    kappa, cos1, cos2 = e.invariants(m)
    scale = np.sqrt(level / (2.0 * accel))
    if lag > 0.0:
        turned = np.multiply(kappa, span, out=np.zeros_like(span), where=span > 0.0)
        time = turned + radial_action(e, kappa, cos1, cos2, nodes)
    else:
        time = _time(e, m, left)
    time = scale * time + np.where(
        v1 + v2 > 0.0, upright_time(accel, lag, v1, given[0]) + upright_time(accel, lag, v2, given[1]), 0.0
    )
    outward = np.stack([cos1, cos2], axis=-1)
    return (time, outward, scale * kappa, scale * _hessian(e, m, left, level) if hessian else None)


def _time(e: Ends, m: Array, left: Array) -> Array:
    """T / sqrt(L / 2a) without lag."""
    d1, d2 = e.b * e.b + (m * e.e) ** 2, 1.0 + (m * e.m) ** 2
    second = elliprd(e.n * left / d2, np.maximum(e.p * e.p * left, np.finfo(float).tiny), e.n)
    return np.asarray(np.sqrt(d1 / d2) * (2.0 + (4.0 / 3.0) * (m * e.n) ** 2 / np.sqrt(d2) * second))


def _hessian(e: Ends, m: Array, left: Array, level: float) -> Array:
    """Derivatives by (d1, d2, theta) of the gradient (-cos beta_1 / (L y), cos beta_2 / (L x), kappa).

    With theta(y, x, m) given, dm = (dtheta - theta_y dy - theta_x dx) / theta_m; dd = 2 L (z + l) dz.
    """
    zero, one = np.zeros_like(m), np.ones_like(m)
    lag, square = e.lag, m * m
    by_m = np.stack([zero, zero, one])  # rows: derivatives by y, x, m
    a, b, p = (np.stack([one, one, zero]), np.stack([-one, one, zero]), np.stack([e.x, e.y, zero]))
    wide = a * e.p + e.a * p + 4.0 * lag * p
    n = 2.0 * e.n * np.stack([(e.y + lag) / _n(lag, e.y), (e.x + lag) / _n(lag, e.x), zero])
    with np.errstate(divide="ignore", invalid="ignore"):
        q = Arguments.of(e, m, left)
        d1 = 2.0 * (e.b * b + m * e.e**2 * by_m + square * e.e * wide) / q.d1  # logarithmic
        d2 = 2.0 * (m * e.m**2 * by_m + square * e.m * p) / q.d2
        root = np.sqrt(q.d1 * q.d2)
        kappa, along, across = (2.0 * m * e.n / root, e.b / root, square * e.e * e.m / root)
        kappa_ = 2.0 * (by_m * e.n + m * n) / root - kappa * 0.5 * (d1 + d2)
        along_ = b / root - along * 0.5 * (d1 + d2)
        across_ = (2.0 * m * e.e * e.m * by_m + square * (wide * e.m + e.e * p)) / root
        across_ -= across * 0.5 * (d1 + d2)
        cross = e.a + lag * e.p
        p_ = p + lag * a - 2.0 * m * e.e * cross * by_m - square * (wide * cross + e.e * (a + lag * p))
        p_ = p_ / np.sqrt(e.n * q.d2) - 0.5 * q.p * (n / e.n + d2)
        t_ = np.where(m > 0.0, by_m * np.sqrt(q.d1 / q.d2) + 0.5 * q.t * (d1 - d2), by_m * np.sqrt(q.d1))
        value = elliprf(q.first, q.second, q.third)
        fall = (
            elliprd(q.second, q.third, q.first) * (p_ * (1.0 + q.p) - q.t * t_)
            + elliprd(q.first, q.third, q.second) * (p_ - t_)
            + elliprd(q.first, q.second, q.third) * (p_ + t_)
        )
        factor = np.sqrt(2.0 * e.n / q.d2)
        theta_ = 2.0 * factor * ((by_m + 0.5 * m * (n / e.n - d2)) * value - m * fall / 6.0)
        theta_ += 2.0 * (by_m * e.m + m * p) / q.d2
        start = -(along_ - across_) / e.y
        start[0] += (along - across) / e.y**2
        end = (along_ + across_) / e.x
        end[1] -= (along + across) / e.x**2
        gradient = np.stack([start / level, end / level, kappa_])  # (3, 3, n)
        by_angle = gradient[:, 2] / theta_[2]
        rate = 0.5 / level / np.stack([e.y + lag, e.x + lag])
        h = np.stack([*((gradient[:, i] - by_angle * theta_[i]) * rate[i] for i in (0, 1)), by_angle], axis=1)
        h = np.moveaxis(h, -1, 0)
        return np.asarray(0.5 * (h + np.swapaxes(h, 1, 2)))


def _n(lag: float, z: Array) -> Array:
    return z * z + 2.0 * lag * z + 1.0
