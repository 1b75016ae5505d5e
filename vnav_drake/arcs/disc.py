"""Optimal arcs near a point obstacle that keeps the robot's centre at a distance (level > 0).

Derived. Let L > 0 be the distance to the point where V = 0 (radius and margin), V = sqrt(2 a L) z,
lag = a t_r, l = lag / sqrt(2 a L). Then r = L n(z), n = z^2 + 2 l z + 1, and the metric ds^2 / V^2 is
L / (2 a) times

    4 (1 + l/z)^2 dz^2 + s^2 dtheta^2,   s = n / z = z + 1/z + 2 l.

Clairaut's invariant is kappa = s sin(beta), beta the angle from the outward normal. With
Q = n^2 - kappa^2 z^2

    dtheta = 2 kappa z (z + l) dz / (n sqrt Q) = kappa dz / sqrt Q - dbeta,

as 2 z (z + l) = n + (z^2 - 1) and (z^2 - 1) dz = z^2 ds: the integral of the third kind is elementary.
The addition theorem of elliptic integrals (B. Carlson, "Computing elliptic integrals by duplication", 1979)
with a Landen transformation joins both ends. For ends y, x put A = x + y, B = x - y, P = xy + 1, M = xy - 1,
N = n(x) n(y), E = A P + 4 l x y. The arcs between them are one family in m from 0 to m*, where
kappa = 2 + 2 l is that of the critical circle z = 1 (least r / V):

    D1 = B^2 + m^2 E^2,  D2 = 1 + m^2 M^2,  kappa = 2 m N / sqrt(D1 D2),
    cos beta_2, cos beta_1 = (B +- m^2 E M) / sqrt(D1 D2),
    theta = 2 m sqrt(2 N / D2) R_F(p + p^2 / 2 + g / 2, p + 1 - t, p + 1 + t) + 2 atan(m M),
    p = (P + l A - m^2 E (A + l P)) / sqrt(N D2),  t = m sqrt(D1 / D2),  g = 1 - t^2,

through turning points and across the critical circle alike, without branches. With m = m* tanh(nu) the angle
is proportional to nu near zero and linear in nu far out, so that Newton's method needs few steps. Without lag
the time is in closed form too,

    T = sqrt(L / 2a) sqrt(D1 / D2) [2 + (4/3) m^2 N^2 / sqrt(D2) R_D(N q / D2, P^2 q, N)],  q = 1 - m^2 A^2;

with lag it is sqrt(L / 2a) times kappa theta plus the radial action (`disc_paths`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import elliprd, elliprf

Array = NDArray[np.float64]

_ITERATIONS = 40
_CONVERGED = 4e-15  # relative step of the unknown, a few roundings
_ROUNDING = 4e-16  # [rad]: of an angle that is a difference of two of order one
_LEAST = 1e-300  # keeps R_F finite at m*, where it has no limit
_LEAST_SUM = 1e-100  # of z at the ends: keeps m* finite where both are zero
_ON_CIRCLE = 1e-12  # of cos beta: the critical circle itself, where m* is 0 / 0


@dataclass(frozen=True)
class Ends:
    """The combinations of both ends (y, x) that everything is made of; (n,) each."""

    lag: float  # l
    y: Array
    x: Array
    a: Array
    b: Array
    p: Array
    m: Array
    n: Array
    e: Array
    top: Array  # m*

    @classmethod
    def of(cls, lag: float, y: Array, x: Array) -> Ends:
        """Of ends z = y and z = x, zero or more."""
        a, p = np.maximum(x + y, _LEAST_SUM), x * y + 1.0
        n = (x * x + 2.0 * lag * x + 1.0) * (y * y + 2.0 * lag * y + 1.0)
        e, m = a * p + 4.0 * lag * x * y, x * y - 1.0
        top = _largest(lag, y, x, m, n, e) if lag > 0.0 else 1.0 / a
        return cls(lag, y, x, a, x - y, p, m, n, e, top)

    def take(self, index: NDArray[np.int64]) -> Ends:
        """The ends of some legs."""
        names = ("y", "x", "a", "b", "p", "m", "n", "e", "top")
        return Ends(self.lag, *(getattr(self, name)[index] for name in names))

    def invariants(self, m: Array) -> tuple[Array, Array, Array]:
        """kappa, cos beta_1 and cos beta_2 of the arcs m; a leg of no length counts as tangential."""
        root = np.hypot(self.b, m * self.e) * np.hypot(1.0, m * self.m)
        moved = root > 0.0
        safe = np.where(moved, root, 1.0)
        along, across = self.b / safe, m * m * self.e * self.m / safe
        with np.errstate(divide="ignore"):
            still = self.y + 1.0 / self.y + 2.0 * self.lag
        kappa = np.where(moved, 2.0 * m * self.n / safe, still)
        return (kappa, np.clip(along - across, -1.0, 1.0), np.clip(along + across, -1.0, 1.0))


@dataclass(frozen=True)
class Arguments:
    """What R_F is taken of, and what that is made of."""

    d1: Array
    d2: Array
    p: Array
    t: Array
    first: Array
    second: Array
    third: Array

    @classmethod
    def of(cls, e: Ends, m: Array, left: Array) -> Arguments:
        """`left` = 1 - m^2 / m*^2, apart to keep its digits; without lag, p and g are products with it."""
        square = m * m
        wide = square * e.e * e.e
        d1, d2 = e.b * e.b + wide, 1.0 + square * e.m * e.m
        t = m * np.sqrt(d1 / d2)
        if e.lag > 0.0:
            p = e.p + e.lag * e.a - square * e.e * (e.a + e.lag * e.p)
            g = 1.0 + square * ((e.m - e.b) * (e.m + e.b) - wide)
        else:
            p, g = e.p * left, (1.0 + square * e.p * e.p) * left
        p, g = p / np.sqrt(e.n * d2), g / d2
        first, second = p + 0.5 * (p * p + g), p + g / (1.0 + t)
        return cls(d1, d2, p, t, np.maximum(first, 0.0), np.maximum(second, _LEAST), p + 1.0 + t)


def angle(e: Ends, m: Array, left: Array) -> Array:
    """Angle [rad] swept by the arcs of parameter m."""
    q = Arguments.of(e, m, left)
    half = m * np.sqrt(2.0 * e.n / q.d2) * elliprf(q.first, q.second, q.third) + np.arctan(m * e.m)
    return np.asarray(2.0 * half)


def _angle_slope(e: Ends, m: Array, left: Array) -> tuple[Array, Array]:
    """Swept angle and its derivative by m > 0."""
    q = Arguments.of(e, m, left)
    value = elliprf(q.first, q.second, q.third)
    factor = m * np.sqrt(2.0 * e.n / q.d2)
    d2 = m * e.m * e.m / q.d2  # halves of logarithmic derivatives
    p = -2.0 * m * e.e * (e.a + e.lag * e.p) / np.sqrt(e.n * q.d2) - q.p * d2
    t = q.t / m + q.t * (m * e.e * e.e / q.d1 - d2)
    fall = (
        elliprd(q.second, q.third, q.first) * (p + p * q.p - q.t * t)
        + elliprd(q.first, q.third, q.second) * (p - t)
        + elliprd(q.first, q.second, q.third) * (p + t)
    )
    theta = 2.0 * factor * value + 2.0 * np.arctan(m * e.m)
    return theta, 2.0 * factor * ((1.0 / m - d2) * value - fall / 6.0) + 2.0 * e.m / q.d2


def solve(e: Ends, span: Array) -> tuple[Array, Array]:
    """m and 1 - m^2 / m*^2, (n,), of the arcs that sweep the angle `span` (n,) [rad]."""
    nu, lagging = np.zeros_like(span), float(e.lag > 0.0)
    largest = e.top
    open_ = np.flatnonzero(span > 0.0)
    p = (e.p + e.lag * e.a) / np.sqrt(e.n)
    flat = 2.0 * np.sqrt(2.0 * e.n) * elliprf(p + 0.5 * p * p + 0.5, 1.0 + p, 1.0 + p) + 2.0 * e.m
    flat = np.maximum(flat * largest, _LEAST)[open_]
    nu[open_] = np.minimum(span[open_] / flat, 0.5 * span[open_] + 1.0)
    for _ in range(_ITERATIONS):
        if open_.size == 0:
            break
        part, top, at = e.take(open_), largest[open_], nu[open_]
        left = 1.0 / np.cosh(at) ** 2
        theta, slope = _angle_slope(part, top * np.tanh(at), left)
        slope = slope * top * left
        step = (theta - span[open_]) / slope
        new = np.maximum(at - np.clip(step, -2.0, 2.0), 0.25 * at)
        nu[open_] = new
        open_ = open_[np.abs(new - at) > _CONVERGED * new + _ROUNDING * (1.0 / slope + lagging / left)]
    return largest * np.tanh(nu), 1.0 / np.cosh(nu) ** 2


def _largest(lag: float, y: Array, x: Array, m: Array, n: Array, e: Array) -> Array:
    """m*: of the arcs that come to the critical circle from both ends, without arriving."""
    kappa = 2.0 + 2.0 * lag
    to_y, to_x = (
        (1.0 - z) * np.sqrt(z * z + (2.0 + 4.0 * lag) * z + 1.0) / (z * z + 2.0 * lag * z + 1.0)
        for z in (y, x)
    )
    apart = to_y * to_x <= 0.0  # on either side: cos beta_1 = to_y, cos beta_2 = -to_x have one sign
    with np.errstate(divide="ignore", invalid="ignore"):
        through = kappa * (x - y) / (n * (to_y - to_x))
        around = -n * (to_y + to_x) / (kappa * e * m)
    on_circle = (np.abs(to_y) < _ON_CIRCLE) & (np.abs(to_x) < _ON_CIRCLE)
    return np.where(on_circle, n / (kappa * e * np.sqrt(1.0 + lag)), np.where(apart, through, around))


def ends_of(accel: float, lag: float, level: float, v1: Array, v2: Array) -> Ends:
    """Ends by safe speeds [m/s]; see `disc_legs`."""
    unit = np.sqrt(2.0 * accel * level)
    return Ends.of(lag / unit, v1 / unit, v2 / unit)
