"""Optimal arcs near a straight wall, in closed form but for one unknown.

Derived. With V the safe speed and lag = a t_r, clearance grows by dd = (V + lag) / a dV, and Clairaut's
invariant near a wall is sin(alpha) = k V, alpha the angle from the outward normal to the direction of travel.
So alpha grows steadily along the arc, through the turning point too, and with W = alpha_2 - alpha_1

    x = 1/(2a) [(V1^2 + V2^2)(W - sin W cos W) + 2 V1 V2 (sin W - W cos W)] / sin^2 W
        + (lag/a)(V1 + V2) tan(W/2),
    T = (1/a) [(W / sin W) S + 2 lag atanh(S / (V1 + V2))],   k = sin W / S,
    S^2 = (V2 - V1)^2 + 4 V1 V2 sin^2(W/2)

(V1, V2 and 1/k are two sides of a triangle and the diameter of its circumcircle). Without lag this is the
cycloid of Manor 2015, eq. (3.9). The unknown is u = tan(W/2) in [0, inf): x(u) starts straight and
ends as a square, convex in between, so that Newton's method from the parabola through both ends converges.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vnav_drake.arcs.contact import lifted, upright_time

Array = NDArray[np.float64]

_ITERATIONS = 30
_CONVERGED = 4e-15  # relative step of the unknown, a few roundings
_SERIES_BELOW = 0.5  # [rad]: above, the difference loses a digit at most; below, the series ends under 1e-17
_TINY = 1e-300  # keeps quotients finite where the result is infinite anyway
_ORDERS = np.arange(1, 11)
_FACTORIALS = np.cumprod(np.arange(1.0, 22.0))[2 * _ORDERS]  # (2 n + 1)!
_SIGNS = np.where(_ORDERS % 2, 1.0, -1.0)
_TURN = _SIGNS * 2.0 ** (2 * _ORDERS) / _FACTORIALS  # (W - sin W cos W) / W, powers of W^2
_MIX = _SIGNS * 2.0 * _ORDERS / _FACTORIALS  # (sin W - W cos W) / W, powers of W^2


def _series(coefficients: Array, square: Array) -> Array:
    value = np.zeros_like(square)
    for c in coefficients[::-1]:
        value = (value + c) * square
    return value


def _kernels(w: Array, sine: Array, cosine: Array) -> tuple[Array, Array]:
    """(W - sin W cos W) / sin^2 W and (sin W - W cos W) / sin^2 W; zero at W = 0."""
    small = w < _SERIES_BELOW
    square = np.where(small, w * w, 0.0)
    turn = np.where(small, w * _series(_TURN, square), w - sine * cosine)
    mix = np.where(small, w * _series(_MIX, square), sine - w * cosine)
    below = np.where(sine > 0.0, sine * sine, 1.0)
    return turn / below, mix / below


def _advance(accel: float, lag: float, v1: Array, v2: Array, u: Array) -> tuple[Array, Array, Array]:
    """x(u) [m], its derivative by u, and W."""
    w = 2.0 * np.arctan(u)
    cosine_square = 1.0 / (1.0 + u * u)
    sine, cosine = 2.0 * u * cosine_square, (1.0 - u * u) * cosine_square
    turn, mix = _kernels(w, sine, cosine)
    x = 0.5 * ((v1 * v1 + v2 * v2) * turn + 2.0 * v1 * v2 * mix) / accel
    # d turn / dW = 2 - 2 cot W turn, d mix / dW = W / sin W - 2 cot W mix, and dW / du = 2 cos^2(W/2)
    at_zero = sine == 0.0
    safe = np.where(at_zero, 1.0, sine)
    turn_slope = np.where(at_zero, 2.0 / 3.0, 2.0 - 2.0 * cosine / safe * turn)
    mix_slope = np.where(at_zero, 1.0 / 3.0, (w - 2.0 * cosine * mix) / safe)
    slope = 0.5 * ((v1 * v1 + v2 * v2) * turn_slope + 2.0 * v1 * v2 * mix_slope) / accel
    stretch = lag / accel * (v1 + v2)
    return x + stretch * u, slope * 2.0 * cosine_square + stretch, w


def solve_turn(accel: float, lag: float, v1: Array, v2: Array, span: Array) -> Array:
    """tan(W/2) (n,) of the arcs between speeds v1, v2 [m/s] that advance by `span` [m] along the wall."""
    squares, product = ((v1 * v1 + v2 * v2) / (2.0 * accel), 2.0 * v1 * v2 / (2.0 * accel))
    first = (4.0 * squares + 2.0 * product) / 3.0 + lag / accel * (v1 + v2)
    second = 0.25 * np.pi * (squares + product)
    discriminant = np.sqrt(first * first + 4.0 * second * span)
    u = np.where(span > 0.0, 2.0 * span / np.where(discriminant > 0.0, first + discriminant, 1.0), 0.0)
    open_ = np.flatnonzero(u > 0.0)
    for _ in range(_ITERATIONS):
        if open_.size == 0:
            break
        x, slope, _ = _advance(accel, lag, v1[open_], v2[open_], u[open_])
        step = (x - span[open_]) / slope
        new = np.maximum(u[open_] - step, 0.25 * u[open_])
        moved = np.abs(new - u[open_]) > _CONVERGED * new
        u[open_] = new
        open_ = open_[moved]
    return u


def wall_legs(
    accel: float, lag: float, v1: Array, v2: Array, span: Array, hessian: bool
) -> tuple[Array, Array, Array, Array | None]:
    """Time, outward, invariant and Hessian by (d1, d2, span) of arcs near a wall.

    Parameters
    ----------
    accel [m/s^2], lag = accel * reaction time [m/s].
    v1, v2 : (n,) safe speeds at start and end [m/s], zero or more.
    span : (n,) [m], zero or more.

    Notes
    -----
    Infinite time where a speed is zero and lag > 0; infinite Hessian where a speed is zero.
    """
    given, (v1, v2) = (v1, v2), lifted(accel, v1, v2, span)
    u = solve_turn(accel, lag, v1, v2, span)
    cosine_square = 1.0 / (1.0 + u * u)
    half = u * u * cosine_square  # sin^2(W/2)
    sine, w = 2.0 * u * cosine_square, 2.0 * np.arctan(u)
    rise = v2 - v1
    side = np.sqrt(rise * rise + 4.0 * v1 * v2 * half)
    safe = np.where(side > 0.0, side, 1.0)
    unmoved = side == 0.0
    time = np.where(u > 0.0, w / np.where(u > 0.0, sine, 1.0), 1.0) * side / accel
    if lag > 0.0:
        total = np.where(v1 + v2 > 0.0, v1 + v2, 1.0)
        ratio = side / total
        gap = 4.0 * v1 * v2 * cosine_square / (total * total)  # 1 - ratio^2
        time = time + lag / accel * np.log1p(2.0 * ratio * (1.0 + ratio) / np.maximum(gap, _TINY))
    time = time + np.where(
        v1 + v2 > 0.0, upright_time(accel, lag, v1, given[0]) + upright_time(accel, lag, v2, given[1]), 0.0
    )
    outward = np.stack([rise + 2.0 * v1 * half, rise - 2.0 * v2 * half], axis=-1) / safe[:, None]
    with np.errstate(divide="ignore"):
        invariant = np.where(unmoved, 1.0 / np.maximum(v1, v2), sine / safe)
    if not hessian:
        return time, outward, invariant, None
    return time, outward, invariant, _hessian(accel, lag, v1, v2, u, side)


def _hessian(accel: float, lag: float, v1: Array, v2: Array, u: Array, side: Array) -> Array:
    """Derivative of the gradient (-c1/V1, c2/V2, k) at constant (V1, V2, W), and of W through x = span."""
    cosine_square = 1.0 / (1.0 + u * u)
    sine, cosine, w = (2.0 * u * cosine_square, (1.0 - u * u) * cosine_square, 2.0 * np.arctan(u))
    turn, mix = _kernels(w, sine, cosine)
    _, slope, _ = _advance(accel, lag, v1, v2, u)
    with np.errstate(divide="ignore", invalid="ignore"):
        x = np.stack(
            [
                (v1 * turn + v2 * mix + lag * u) / accel,
                (v2 * turn + v1 * mix + lag * u) / accel,
                slope / (2.0 * cosine_square),
            ],
            axis=-1,
        )
        s1, s2, s3 = ((v1 - v2 * cosine) / side, (v2 - v1 * cosine) / side, v1 * v2 * sine / side)
        p1, p2, k = ((v1 * cosine - v2) / (v1 * side), (v2 * cosine - v1) / (v2 * side), sine / side)
        partial = np.empty((len(u), 3, 3))
        partial[:, 0] = np.stack([v2 / (v1 * v1 * side), -1.0 / (v1 * side), -sine / side], axis=-1)
        partial[:, 1] = np.stack([-1.0 / (v2 * side), v1 / (v2 * v2 * side), -sine / side], axis=-1)
        partial[:, 2] = np.stack([np.zeros_like(u), np.zeros_like(u), cosine / side], axis=-1)
        through = np.stack([s1, s2, s3], axis=-1) / side[:, None]
        partial -= np.stack([p1, p2, k], axis=-1)[:, :, None] * through[:, None, :]
        by_w = partial[:, :, 2] / x[:, 2:]
        h = partial.copy()
        h[:, :, 2] = by_w
        h[:, :, :2] -= by_w[:, :, None] * x[:, None, :2]
        h[:, :, 0] *= (accel / (v1 + lag))[:, None]
        h[:, :, 1] *= (accel / (v2 + lag))[:, None]
        return 0.5 * (h + np.swapaxes(h, 1, 2))


def wall_points(
    accel: float, lag: float, v1: Array, v2: Array, span: Array, fraction: Array
) -> tuple[Array, Array]:
    """Advance along the wall [m] and safe speed [m/s], (n, k) each, at `fraction` (n, k) of the turn W."""
    given, (v1, v2) = (v1, v2), lifted(accel, v1, v2, span)
    w = 2.0 * np.arctan(solve_turn(accel, lag, v1, v2, span))[:, None]
    straight = w < 1e-8  # there sine and argument agree to 1e-17
    sine = np.where(straight, 1.0, np.sin(w))
    back = np.where(straight, 1.0 - fraction, np.sin((1.0 - fraction) * w) / sine)
    forth = np.where(straight, fraction, np.sin(fraction * w) / sine)
    v = back * v1[:, None] + forth * v2[:, None]
    start = np.broadcast_to(v1[:, None], v.shape)
    x, _, _ = _advance(accel, lag, start, v, np.tan(0.5 * fraction * w))
    x = np.where(fraction == 1.0, span[:, None], np.clip(x, 0.0, span[:, None]))
    v = np.where(fraction == 0.0, given[0][:, None], v)
    return x, np.where(fraction == 1.0, given[1][:, None], v)
