"""Optimal arcs near a point obstacle that keeps the robot's centre at a distance (uniform law, level > 0).

Derived. With the level L > 0 where V = 0, r = L (1 + z^2), V = sqrt(2 a L) z, the metric ds^2 / V^2 is
(L / 2a) (4 dz^2 + s^2 dtheta^2), s = z + 1/z. Clairaut's invariant is kappa = s sin(beta), beta the angle
from the outward normal, and with Q = (1 + z^2)^2 - kappa^2 z^2

    dtheta = 2 kappa z^2 dz / ((1 + z^2) sqrt Q) = kappa dz / sqrt Q - dbeta,
    dT = sqrt(L/2a) 2 (1 + z^2) dz / sqrt Q:

the integral of the third kind splits off as -dbeta, since 2 z^2 / (1 + z^2) = 1 - (1 - z^2) / (1 + z^2) and
(1 - z^2) dz / z^2 = -ds.
The addition theorem of elliptic integrals (B. Carlson, "Computing elliptic integrals by duplication", 1979)
then joins both ends. For ends y, x put A = x + y, B = x - y, P = xy + 1, M = xy - 1,
N = (1 + x^2)(1 + y^2) = A^2 + M^2 = B^2 + P^2. The arcs between them are one family in m in [0, P / A),

    D1 = B^2 + m^2 A^2,  D2 = P^2 + m^2 M^2,  q = P^2 - m^2 A^2,  kappa = 2 m N / sqrt(D1 D2),
    cos beta_2, cos beta_1 = (B P +- m^2 A M) / sqrt(D1 D2),
    theta = 2 m N R_F(N D2, N q, q D2) + 2 atan(m M / P),
    T = sqrt(L/2a) [2 P sqrt(D1 / D2) + (4/3) m^2 N^2 (sqrt(D1) / D2) R_D(N q / D2, q, N)],

through turning points and across the critical circle r = 2 L (z = 1, least r / V) alike, without branches.
With m = (P / A) tanh(nu) the angle is proportional to nu near zero and grows as 2 nu far out, so that Newton's
method needs few steps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ellipj, ellipkinc, elliprd, elliprf

Array = NDArray[np.float64]

_ITERATIONS = 40
_CONVERGED = 4e-15  # relative step of the unknown, a few roundings
_ROUNDING = 4e-16  # [rad]: of an angle that is a difference of two of order one
_LEAST_SUM = 1e-100  # of z at the ends: keeps P / A finite where both are zero


@dataclass(frozen=True)
class _Ends:
    """The combinations of both ends that everything is made of."""

    y: Array
    x: Array
    a: Array
    b: Array
    p: Array
    m: Array
    n: Array

    @classmethod
    def of(cls, y: Array, x: Array) -> _Ends:
        n = (1.0 + x * x) * (1.0 + y * y)
        return cls(y, x, np.maximum(x + y, _LEAST_SUM), x - y, x * y + 1.0, x * y - 1.0, n)

    def take(self, index: NDArray[np.int64]) -> _Ends:
        return _Ends(*(getattr(self, name)[index] for name in ("y", "x", "a", "b", "p", "m", "n")))


def _angle(e: _Ends, nu: Array) -> tuple[Array, Array]:
    """theta(nu) and its derivative."""
    tanh = np.tanh(nu)
    open_ = 1.0 / np.cosh(nu) ** 2
    m = e.p / e.a * tanh
    q = e.p * e.p * open_
    d2 = e.p * e.p + (m * e.m) ** 2
    first, second, third = e.n * d2, e.n * q, q * d2
    value = elliprf(first, second, third)
    theta = 2.0 * m * e.n * value + 2.0 * np.arctan2(m * e.m, e.p)
    d2_slope, q_slope = 2.0 * m * e.m * e.m, -2.0 * m * e.a * e.a
    fall = (
        elliprd(second, third, first) * e.n * d2_slope
        + elliprd(first, third, second) * e.n * q_slope
        + elliprd(first, second, third) * (q_slope * d2 + q * d2_slope)
    )
    slope = 2.0 * e.n * (value - m * fall / 6.0) + 2.0 * e.m * e.p / d2
    return theta, slope * e.p / e.a * open_


def _solve(e: _Ends, span: Array) -> Array:
    """nu (n,) of the arcs that sweep the angle `span`."""
    nu = np.zeros_like(span)
    open_ = np.flatnonzero(span > 0.0)
    flat = _angle(e.take(open_), np.zeros(open_.size))[1]
    far = 2.0 * np.log(2.0 * np.sqrt(e.n) / (e.a + e.p)) + 2.0 * np.arctan2(e.m, e.a)
    nu[open_] = np.minimum(span[open_] / flat, np.maximum(0.5 * (span - far)[open_], 0.0) + 1.0)
    for _ in range(_ITERATIONS):
        if open_.size == 0:
            break
        theta, slope = _angle(e.take(open_), nu[open_])
        step = (theta - span[open_]) / slope
        new = np.maximum(nu[open_] - np.clip(step, -2.0, 2.0), 0.25 * nu[open_])
        moved = np.abs(new - nu[open_]) > _CONVERGED * new + _ROUNDING / slope
        nu[open_] = new
        open_ = open_[moved]
    return nu


def _invariants(e: _Ends, nu: Array) -> tuple[Array, Array, Array, Array]:
    """m, and kappa, cos beta_1, cos beta_2."""
    m = e.p / e.a * np.tanh(nu)
    root = np.hypot(e.b, m * e.a) * np.hypot(e.p, m * e.m)
    safe = np.where(root > 0.0, root, 1.0)
    along, across = e.b * e.p / safe, m * m * e.a * e.m / safe
    with np.errstate(divide="ignore"):
        widest = np.maximum(e.y + 1.0 / e.y, e.x + 1.0 / e.x)
    kappa = np.where(root > 0.0, 2.0 * m * e.n / safe, widest)
    return m, kappa, along - across, along + across


def disc_legs(
    accel: float, level: float, d1: Array, d2: Array, span: Array, hessian: bool
) -> tuple[Array, Array, Array, Array | None]:
    """Time, outward, invariant and Hessian by (d1, d2, span) of arcs near a point, level > 0.

    `d1`, `d2` (n,) [m], zero or more, are distances beyond the level: V = sqrt(2 accel d).
    The Hessian is infinite or NaN where a d is zero or the leg has no length.
    """
    e = _Ends.of(np.sqrt(d1 / level), np.sqrt(d2 / level))
    nu = _solve(e, span)
    m, kappa, cos1, cos2 = _invariants(e, nu)
    scale = np.sqrt(level / (2.0 * accel))
    side1, d2_ = np.hypot(e.b, m * e.a), e.p * e.p + (m * e.m) ** 2
    q = (e.p / np.cosh(nu)) ** 2
    second = elliprd(e.n * q / d2_, q, e.n)
    time = scale * side1 * (2.0 * e.p / np.sqrt(d2_) + (4.0 / 3.0) * (m * e.n) ** 2 / d2_ * second)
    outward = np.stack([cos1, cos2], axis=-1)
    if not hessian:
        return time, outward, scale * kappa, None
    with np.errstate(divide="ignore", invalid="ignore"):
        h = scale * _hessian(e, m, q)
        per_d = np.stack([1.0 / (2.0 * level * e.y), 1.0 / (2.0 * level * e.x)], axis=-1)
        # d2T/dd2 = T_zz (dz/dd)^2 + T_z d2z/dd2, with T_z = -+ 2 cos(beta) scale
        bend = np.stack([cos1 / e.y**3, -cos2 / e.x**3], axis=-1) / (2.0 * level * level)
        h[:, :2] *= per_d[:, :, None]
        h[:, :, :2] *= per_d[:, None, :]
        h[:, (0, 1), (0, 1)] += scale * bend
    return time, outward, scale * kappa, h


def _hessian(e: _Ends, m: Array, q: Array) -> Array:
    """Derivatives of the gradient (-2 cos beta_1, 2 cos beta_2, kappa) of T / sqrt(L/2a) by (y, x, theta)."""
    zero, one = np.zeros_like(m), np.ones_like(m)
    # rows: derivatives by y, x, m
    a, b, p, mm = (
        np.stack(rows) for rows in ((one, one, zero), (-one, one, zero), (e.x, e.y, zero), (e.x, e.y, zero))
    )
    by_m = np.stack([zero, zero, one])
    n = np.stack([2.0 * e.y * (1.0 + e.x**2), 2.0 * e.x * (1.0 + e.y**2), zero])
    d1, d2 = e.b**2 + (m * e.a) ** 2, e.p**2 + (m * e.m) ** 2
    d1_ = 2.0 * (e.b * b + m * e.a**2 * by_m + m * m * e.a * a)
    d2_ = 2.0 * (e.p * p + m * e.m**2 * by_m + m * m * e.m * mm)
    q_ = 2.0 * (e.p * p - m * e.a**2 * by_m - m * m * e.a * a)
    root = np.sqrt(d1 * d2)
    log_root = 0.5 * (d1_ / d1 + d2_ / d2)
    kappa, along, across = 2.0 * m * e.n / root, e.b * e.p / root, m * m * e.a * e.m / root
    kappa_ = 2.0 * (by_m * e.n + m * n) / root - kappa * log_root
    along_ = (b * e.p + e.b * p) / root - along * log_root
    across_ = (2.0 * m * e.a * e.m * by_m + m * m * (a * e.m + e.a * mm)) / root - across * log_root
    first, second, third = e.n * d2, e.n * q, q * d2
    value = elliprf(first, second, third)
    fall = (
        elliprd(second, third, first) * (n * d2 + e.n * d2_)
        + elliprd(first, third, second) * (n * q + e.n * q_)
        + elliprd(first, second, third) * (q_ * d2 + q * d2_)
    )
    theta_ = 2.0 * ((by_m * e.n + m * n) * value - m * e.n * fall / 6.0)
    theta_ += 2.0 * ((by_m * e.m + m * mm) * e.p - m * e.m * p) / d2
    gradient = np.stack([-2.0 * (along_ - across_), 2.0 * (along_ + across_), kappa_])  # (3, 3, n)
    by_angle = gradient[:, 2] / theta_[2]
    h = np.stack(
        [gradient[:, 0] - by_angle * theta_[0], gradient[:, 1] - by_angle * theta_[1], by_angle], axis=1
    )
    h = np.moveaxis(h, -1, 0)
    return 0.5 * (h + np.swapaxes(h, 1, 2))


def disc_points(
    accel: float, level: float, d1: Array, d2: Array, span: Array, fraction: Array
) -> tuple[Array, Array]:
    """Swept angle [rad] and distance beyond the level [m], (n, k) each.

    `fraction` (n, k) divides the integral of dz / sqrt Q, tau. With S = sinh(log z),
    S'^2 = (1 + S^2)(4 - kappa^2 + 4 S^2), so that S is k' sc(2 tau + c), k = kappa / 2, up to kappa = 2, and
    +-K nc(kappa tau + c), K^2 = kappa^2 / 4 - 1, modulus 2 / kappa, beyond.
    """
    e = _Ends.of(np.sqrt(d1 / level), np.sqrt(d2 / level))
    nu = _solve(e, span)
    m, kappa, cos1, cos2 = _invariants(e, nu)
    side1, side2 = e.b**2 + (m * e.a) ** 2, e.p**2 + (m * e.m) ** 2
    q = (e.p / np.cosh(nu)) ** 2
    safe = np.where(side1 > 0.0, side1 * side2, 1.0)
    excess = q * (e.b - m * e.m) * (e.b + m * e.m) / safe  # 1 - kappa^2 / 4
    with np.errstate(divide="ignore"):
        ends = np.stack([0.5 * (e.y - 1.0 / e.y), 0.5 * (e.x - 1.0 / e.x)], axis=-1)
    inner = (excess > 0.0)[:, None]
    bound = np.sqrt(np.abs(excess))[:, None]
    modulus = np.where(inner, 0.25 * kappa[:, None] ** 2, 4.0 / np.maximum(kappa[:, None], 2.0) ** 2)
    turning = np.arccos(np.clip(bound / np.maximum(np.abs(ends), bound), 0.0, 1.0))
    away = np.sign(np.stack([cos1, cos2], axis=-1)) * np.sign(ends)
    amplitude = np.where(inner, np.arctan2(ends, bound), away * turning)
    v = ellipkinc(amplitude, modulus)
    at = v[:, :1] + fraction * (v[:, 1:] - v[:, :1])
    sn, cn, dn, _ = ellipj(at, np.broadcast_to(modulus, at.shape))
    side = np.where(ends.sum(axis=1) < 0.0, -1.0, 1.0)[:, None]
    cn = np.maximum(np.abs(cn), 1e-300)
    sinh = bound * np.where(inner, sn, side) / cn
    z = np.where(sinh > 0.0, sinh + np.hypot(1.0, sinh), 1.0 / (np.hypot(1.0, sinh) + np.abs(sinh)))
    rising = np.where(e.b < 0.0, -1.0, 1.0)[:, None]
    rate = np.where(inner, 2.0 * rising * bound * dn, side * kappa[:, None] * bound * np.abs(dn) * sn) / cn**2
    beta = np.arctan2(kappa[:, None], rate / np.hypot(1.0, sinh))
    tau = (at - v[:, :1]) / np.where(inner, 2.0 * rising, kappa[:, None])
    start = np.arctan2(kappa, cos1 * (e.y + 1.0 / e.y))[:, None]
    theta = kappa[:, None] * tau + start - beta
    return np.clip(theta, 0.0, span[:, None]), level * z * z
