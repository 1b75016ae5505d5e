"""Travel time along curves at the greatest safe speed: the integral of ds / V(d).

Derived. With rho' = radius + margin, the room is delta = r - rho' and, with lag = a t_r,
1 / V = (lag + sqrt(lag^2 + 2 a delta)) / (2 a delta).

* LINEAR: with dd = (V + lag) / a dV the integral is [dV + lag log(V1 / V0)] / (a |slope|), written here
  without the cancellation at small slopes.
* ROOT (r^2 = h^2 + u^2): sigma^2 = h^2 - rho'^2. For sigma^2 > 0 put u = sigma sinh w; then
  delta = sigma^2 cosh^2 w / (r + rho'), du = sigma cosh w dw. For sigma^2 < 0 put u = tau cosh w,
  tau^2 = -sigma^2; then sinh and cosh change places. For sigma = 0 put u = exp w. Without lag the
  integrand is sqrt((r + rho') / (2 a)): the singularity at V = 0 is gone.
* PARABOLA (r = (p^2 + u^2) / (2 p)): the same with sigma^2 = p (p - 2 rho') and
  delta = sigma^2 cosh^2 w / (2 p), ds = sqrt(1 + (u/p)^2) sigma cosh w dw.

With lag, sinh w in the denominator has a zero at w = 0: there put w = log(1 + exp v). In w and v the
integrands are analytic in a strip of half-width about pi / 2 around the real axis, so Gauss-Legendre
panels no wider than 1 with 12 nodes are exact to rounding. With a reaction time the integral diverges
where V reaches zero, and the result is infinity.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vnav_drake.braking import UniformBraking
from vnav_drake.voronoi.curves import LINEAR, PARABOLA, Curves

Array = NDArray[np.float64]

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)
_PANEL = 1.0  # greatest width in w
_TINY = 1e-300  # keeps logarithms finite where the result is infinite anyway


def travel_time(curves: Curves, braking: UniformBraking, radius: float) -> Array:
    """Time [s] along each curve (n,) at the greatest safe speed of a disc of `radius` [m].

    The distance along every curve must be at least `radius + braking.margin` (up to rounding).
    Infinite where the robot would come to rest on the way.
    """
    span = np.sort(curves.span, axis=1)
    if np.isinf(braking.max_speed):
        return _below_cap(curves, span, braking, radius)
    slow = slow_part(curves, span, radius + float(braking.distance(braking.max_speed)))
    s = curves.arc_length(slow)
    fast = np.maximum(curves.length - (s[:, 1] - s[:, 0]), 0.0)
    return _below_cap(curves, slow, braking, radius) + fast / braking.max_speed


def slow_part(curves: Curves, span: Array, cap: float) -> Array:
    """Where the distance is below `cap`: one increasing interval (n, 2) each, as distance is convex."""
    low, high = span.T
    is_linear = curves.kind == LINEAR
    with np.errstate(over="ignore"):
        meets = (cap - curves.size) / np.where(curves.slope != 0.0, curves.slope, 1.0)
    cross = np.clip(meets, low, high)
    begin = np.where(curves.slope < 0.0, cross, low)
    end = np.where(curves.slope > 0.0, cross, high)
    end = np.where((curves.slope == 0.0) & (curves.size >= cap), begin, end)
    reach = level_parameter(curves, cap)
    begin = np.where(is_linear, begin, np.clip(-reach, low, high))
    end = np.where(is_linear, end, np.clip(reach, low, high))
    return np.column_stack([begin, end])


def level_parameter(curves: Curves, level: float) -> Array:
    """|u| at which the distance of ROOT and PARABOLA curves is `level` [m]; 0 if always above."""
    p = curves.size
    square = np.where(curves.kind == PARABOLA, p * (2.0 * level - p), (level - p) * (level + p))
    return np.sqrt(np.maximum(square, 0.0))


def _below_cap(curves: Curves, span: Array, braking: UniformBraking, radius: float) -> Array:
    """The integral with V as if there were no greatest speed."""
    time = np.zeros(len(curves))
    is_linear = curves.kind == LINEAR
    level = radius + braking.margin
    time[is_linear] = _linear_time(curves.take(is_linear), span[is_linear], braking, level)
    time[~is_linear] = _curved_time(curves.take(~is_linear), span[~is_linear], braking, level)
    return time


def _linear_time(curves: Curves, span: Array, braking: UniformBraking, level: float) -> Array:
    accel, lag = braking.max_braking, braking.max_braking * braking.reaction_time
    room = np.maximum((curves.size - level)[:, None] + curves.slope[:, None] * span, 0.0)
    root = np.sqrt(lag * lag + 2.0 * accel * room)
    speed = 2.0 * accel * room / np.where(root + lag > 0.0, root + lag, 1.0)
    slow, fast = speed.min(axis=1), speed.max(axis=1)
    length = span[:, 1] - span[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = (fast - slow) / slow
        stretch = np.where(ratio > 0.0, np.log1p(ratio) / ratio, 1.0) / slow if lag > 0.0 else 0.0
        time = 2.0 * length / (slow + fast + 2.0 * lag) * (1.0 + lag * stretch)
    if lag > 0.0:
        time = np.where(slow > 0.0, time, np.inf)
    return np.where(length > 0.0, time, 0.0)


def _curved_time(curves: Curves, span: Array, braking: UniformBraking, level: float) -> Array:
    """Quadrature in w (see the module's notes); span increasing, (n, 2)."""
    if len(curves) == 0:
        return np.zeros(0)
    accel, lag = braking.max_braking, braking.max_braking * braking.reaction_time
    p = curves.size
    is_parabola = curves.kind == PARABOLA
    square = np.where(is_parabola, p * (p - 2.0 * level), (p - level) * (p + level))
    above = square > 0.0
    scale = np.sqrt(np.abs(square))
    touching = scale == 0.0  # V = 0 at u = 0: no finite time across, logarithmic towards it
    unit = np.where(touching, 1.0, scale)
    x = span / unit[:, None]
    magnitude = np.sort(np.abs(x), axis=1)
    w = np.where(above[:, None], np.arcsinh(x), np.arccosh(np.maximum(magnitude, 1.0)))
    w = np.where(touching[:, None], np.log(np.maximum(magnitude, _TINY)), w)
    soft = (lag > 0.0) & ~above & ~touching
    w = np.where(soft[:, None], np.log(np.expm1(np.where(soft[:, None], np.maximum(w, _TINY), 1.0))), w)
    panels = max(1, int(np.ceil((w[:, 1] - w[:, 0]).max(initial=0.0) / _PANEL)))
    edges = w[:, :1] + np.diff(w, axis=1) * np.linspace(0.0, 1.0, panels + 1)
    half = 0.5 * np.diff(edges, axis=1)
    node = (edges[:, :-1] + half)[:, :, None] + half[:, :, None] * _NODES
    column = (slice(None), None, None)
    softened = np.logaddexp(0.0, np.where(soft[column], node, 0.0))
    node = np.where(soft[column], softened, node)
    growth = np.exp(np.where(touching[column], node, 0.0))
    sinh = np.where(touching[column], growth, np.sinh(node))
    cosh = np.where(touching[column], growth, np.cosh(node))
    u = unit[column] * np.where(above[column], sinh, cosh)
    other = np.where(above[column], cosh, sinh)
    ratio = np.divide(1.0, p, out=np.zeros_like(p), where=is_parabola)[column] * u
    r = curves.distance(u.reshape(len(u), -1)).reshape(u.shape)
    reach = np.where(is_parabola[column], 2.0 * p[column], r + level)  # delta = (unit other)^2 / reach
    stretch = np.hypot(1.0, ratio)
    if lag == 0.0:
        value = stretch * np.sqrt(reach / (2.0 * accel))
    else:
        moment = unit[column] * other
        room = moment * moment / reach
        value = stretch * reach * (lag + np.sqrt(lag * lag + 2.0 * accel * room)) / (2.0 * accel * moment)
    value = np.where(soft[column], -np.expm1(-softened) * value, value)
    time = (half * (value @ _WEIGHTS)).sum(axis=1)
    stuck = touching & (span[:, 0] <= 0.0) & (span[:, 1] >= 0.0)
    if lag > 0.0:
        stuck |= ~above & (magnitude[:, 0] <= 1.0)
    return np.where(stuck & (span[:, 1] > span[:, 0]), np.inf, time)
