"""Points along the arcs of `disc`, and their radial action.

Derived. With chi = log z, s = 2 cosh(chi) + 2 l, and along an arc chi'^2 = s^2 - kappa^2 has its zeros
nearest to the real axis at +-c, cosh c = kappa / 2 - l, or +-i c, cos c = kappa / 2 - l. So chi = +-c cosh u
or c sinh u makes all that is integrated analytic, through turning points and close to the critical circle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ellipj, ellipkinc

from vnav_drake.arcs.contact import lifted
from vnav_drake.arcs.disc import Ends, angle, ends_of, solve

Array = NDArray[np.float64]

_LEAST_SCALE = 1e-7  # of c: what is smaller changes the grid, not the points
_AT_CIRCLE = 1e-4  # of chi: its cube is below rounding
_LARGEST = 1e75  # of kappa and of 1 / z where V = 0
_LEAST = 1e-300  # keeps logarithms and quotients finite at V = 0


@dataclass(frozen=True)
class _Course:
    """chi as a function of u, from u[:, 0] to u[:, 1]; columns (n, 1)."""

    lag: float
    kappa: Array
    inner: NDArray[np.bool_]  # below the invariant of the critical circle: no turning point
    side: Array  # inner: sign of the change of chi; else sign of chi
    scale: Array  # c
    u: Array  # (n, 2)

    @classmethod
    def of(cls, e: Ends, kappa: Array, cos1: Array, cos2: Array) -> _Course:
        chi = np.log(np.maximum(np.stack([e.y, e.x], axis=-1), 1.0 / _LARGEST))
        gap = 0.5 * (0.5 * kappa - e.lag - 1.0)  # sinh^2(c / 2) or -sin^2(c / 2)
        inner = (gap < 0.0) | (chi[:, 0] * chi[:, 1] < 0.0)
        half = np.sqrt(np.abs(gap))
        scale = np.where(inner, 2.0 * np.arcsin(np.minimum(half, 1.0)), 2.0 * np.arcsinh(half))
        scale = np.maximum(scale, _LEAST_SCALE)[:, None]
        away = np.sign(np.stack([cos1, cos2], axis=-1)) * np.sign(chi)
        turned = away * np.arccosh(np.maximum(np.abs(chi) / scale, 1.0))
        u = np.where(inner[:, None], np.arcsinh(chi / scale), turned)
        side = np.where(inner, np.where(e.b < 0.0, -1.0, 1.0), np.where(chi.sum(axis=1) < 0.0, -1.0, 1.0))
        return cls(e.lag, kappa[:, None], inner[:, None], side[:, None], scale, u)

    def at(self, u: Array) -> tuple[Array, Array, Array]:
        """chi, |dchi/du| and the rate chi' = sqrt(s^2 - kappa^2) with its sign, (n, k) each."""
        sinh, cosh = np.sinh(u), np.cosh(u)
        chi = self.scale * np.where(self.inner, sinh, self.side * cosh)
        gap = 0.5 * (1.0 + self.lag - 0.5 * self.kappa)
        near, far = (np.sinh(self.scale * np.sinh(0.5 * u) ** 2), np.sinh(self.scale * np.cosh(0.5 * u) ** 2))
        excess = 4.0 * np.where(self.inner, np.maximum(np.sinh(0.5 * chi) ** 2 + gap, 0.0), near * far)
        total = 2.0 * np.cosh(chi) + 2.0 * self.lag + self.kappa
        sign = np.where(self.inner, self.side, self.side * np.sign(u))
        return (chi, self.scale * np.where(self.inner, cosh, np.abs(sinh)), sign * np.sqrt(excess * total))


def radial_action(e: Ends, kappa: Array, cos1: Array, cos2: Array, nodes: int) -> Array:
    """(n,) integral of 2 (1 + l/z) |cos beta| |dz|, that is T / sqrt(L / 2a) - kappa theta.

    Gauss-Legendre quadrature in u with 3 `nodes`.
    """
    node, weight = np.polynomial.legendre.leggauss(3 * nodes)
    course = _Course.of(e, np.minimum(kappa, _LARGEST), cos1, cos2)
    middle, half = course.u.mean(axis=1, keepdims=True), 0.5 * np.diff(course.u, axis=1)
    chi, speed, rate = course.at(middle + half * node)
    value = 2.0 * (np.exp(chi) + e.lag) * speed * np.abs(rate) / (2.0 * np.cosh(chi) + 2.0 * e.lag)
    action = np.abs(half[:, 0]) * (value @ weight)
    return np.asarray(action)


def disc_points(
    accel: float, lag: float, level: float, v1: Array, v2: Array, span: Array, fraction: Array
) -> tuple[Array, Array]:
    """Swept angle [rad] and safe speed [m/s], (n, k) each, at `fraction` (n, k) of the course.

    Parameters as in `disc_legs`.
    """
    given, (v1, v2) = (v1, v2), lifted(accel, v1, v2, level * np.minimum(span, 1.0))
    e = ends_of(accel, lag, level, v1, v2)
    m, left = solve(e, span)
    kappa, cos1, cos2 = e.invariants(m)
    kappa = np.minimum(kappa, _LARGEST)
    unit = np.sqrt(2.0 * accel * level)
    if lag > 0.0:
        theta, z = _lagging(e, kappa, cos1, cos2, fraction)
    else:
        theta, z = _prompt(e, m, left, kappa, cos1, cos2, fraction)
    circling, near = _circling(e, span, fraction)
    theta, z = (np.where(circling, fraction * span[:, None], theta), np.where(circling, near, z))
    theta, z = np.clip(theta, 0.0, span[:, None]), unit * z
    for at, s, v in ((0.0, np.zeros_like(span), given[0]), (1.0, span, given[1])):
        theta, z = (np.where(fraction == at, s[:, None], theta), np.where(fraction == at, v[:, None], z))
    return theta, z


def _circling(e: Ends, span: Array, fraction: Array) -> tuple[NDArray[np.bool_], Array]:
    """Whether both ends lie at the critical circle, and z along such arcs by equal angles.

    Close to the circle 4 (1 + l)^2 chi'' = s ds/dchi is d2chi / dtheta2 = chi / (1 + l), up to cubes of chi.
    """
    y, x = (np.log(np.clip(end, 0.5, 2.0))[:, None] for end in (e.y, e.x))
    reach = np.maximum(span, _LEAST_SCALE)[:, None] / np.sqrt(1.0 + e.lag)
    back, forth = np.sinh((1.0 - fraction) * reach), np.sinh(fraction * reach)
    chi = (y * back + x * forth) / np.sinh(reach)
    return np.maximum(np.abs(y), np.abs(x)) < _AT_CIRCLE, np.exp(chi)


def _lagging(e: Ends, kappa: Array, cos1: Array, cos2: Array, fraction: Array) -> tuple[Array, Array]:
    """Angle and z at `fraction` of u.

    The angle is that of the arc from the start, whose m = tan((beta_1 - beta) / 2) / M is had from
    sin beta_1 - sin beta = kappa B M / N and sin beta_1 + sin beta = kappa E / N.
    """
    course = _Course.of(e, kappa, cos1, cos2)
    chi, _, rate = course.at(course.u[:, :1] + fraction * np.diff(course.u, axis=1))
    z = np.exp(chi)
    start = np.broadcast_to(e.y[:, None], z.shape)
    part = Ends.of(e.lag, start, z)
    cos = rate / (2.0 * np.cosh(chi) + 2.0 * e.lag)
    cos1 = np.broadcast_to(cos1[:, None], z.shape)
    with np.errstate(divide="ignore", invalid="ignore"):
        straight = course.kappa * part.b / (part.n * (cos1 + cos))
        turned = part.n * (cos - cos1) / (course.kappa * part.e * part.m)
        m = np.where(cos1 * cos >= 0.0, straight, turned)
    m = np.where((course.kappa > 0.0) & (fraction > 0.0) & np.isfinite(m), np.maximum(m, 0.0), 0.0)
    m = np.minimum(m, part.top)
    return angle(part, m, 1.0 - (m / part.top) ** 2), z


def _prompt(
    e: Ends, m: Array, left: Array, kappa: Array, cos1: Array, cos2: Array, fraction: Array
) -> tuple[Array, Array]:
    """Angle and z at `fraction` of tau, the integral of dz / sqrt Q, without lag.

    With S = sinh(chi), S'^2 = (1 + S^2)(4 - kappa^2 + 4 S^2), so that S is k' sc(2 tau + c), k = kappa / 2,
    up to kappa = 2, and +-K nc(kappa tau + c), K^2 = kappa^2 / 4 - 1, modulus 2 / kappa, beyond.
    """
    d1, d2 = e.b**2 + (m * e.e) ** 2, 1.0 + (m * e.m) ** 2
    product = np.where(d1 > 0.0, d1 * d2, 1.0)
    excess = left * (e.b - m * e.p * e.m) * (e.b + m * e.p * e.m) / product  # 1 - kappa^2 / 4
    inner = ((excess > 0.0) | ((e.x - 1.0) * (e.y - 1.0) < 0.0))[:, None]
    bound = np.maximum(np.sqrt(np.abs(excess)), _LEAST_SCALE)[:, None]
    with np.errstate(divide="ignore"):
        ends = np.stack([0.5 * (e.y - 1.0 / e.y), 0.5 * (e.x - 1.0 / e.x)], axis=-1)
    rising = np.where(e.b < 0.0, -1.0, 1.0)[:, None]
    side = np.where(ends.sum(axis=1) < 0.0, -1.0, 1.0)[:, None]
    kappa = kappa[:, None]
    modulus = np.minimum(np.where(inner, 0.25 * kappa**2, 4.0 / np.maximum(kappa, 2.0) ** 2), 1.0)
    away = np.sign(np.stack([cos1, cos2], axis=-1)) * np.sign(ends)
    turning = np.arccos(np.clip(bound / np.maximum(np.abs(ends), bound), 0.0, 1.0))
    v = ellipkinc(np.where(inner, np.arctan2(ends, bound), away * turning), modulus)
    at = v[:, :1] + fraction * (v[:, 1:] - v[:, :1])
    sn, cn, dn, _ = ellipj(at, np.broadcast_to(modulus, at.shape))
    cn = np.maximum(np.abs(cn), _LEAST)
    sinh = bound * np.where(inner, sn, side) / cn
    grown = np.abs(sinh) + np.hypot(1.0, sinh)
    z = np.where(sinh > 0.0, grown, 1.0 / grown)
    change = np.where(inner, 2.0 * rising * dn, side * kappa * np.abs(dn) * sn) / cn
    beta = np.arctan2(kappa, change * bound / cn / np.hypot(1.0, sinh))
    tau = (at - v[:, :1]) / np.where(inner, 2.0 * rising, np.maximum(kappa, _LEAST))
    with np.errstate(divide="ignore", invalid="ignore"):
        beta1 = np.where(e.y > 0.0, np.arctan2(kappa[:, 0], cos1 * (e.y + 1.0 / e.y)), 0.0)
    return kappa * tau + beta1[:, None] - beta, z
