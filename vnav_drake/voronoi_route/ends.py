"""Travel time of a route whose ends have given speeds."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from vnav_drake.problem import Problem
from vnav_drake.voronoi import Curves, travel_time

Array = NDArray[np.float64]

Limit = Callable[[NDArray[np.int64], Array], Array]  # v^2 at arc lengths on given curves

SAMPLES = 65  # of each curve, between which a speed limit and a ramp are taken to cross at most once
_BISECTIONS = 60


def time_with_ends(problem: Problem, curves: Curves) -> float:
    """Travel time [s] along a route with v^2 <= min(V(d)^2, v0^2 + 2 a_max s, v1^2 + 2 a_b s').

    s and s' are the arc lengths from start and goal; a safe end has no such limit. Ramps are integrated
    in closed form, the rest by `travel_time`; the crossings are found to rounding.
    """
    length = curves.length
    begin = np.concatenate([[0.0], np.cumsum(length)])
    total = float(begin[-1])
    ramps = _ramps(problem, total)
    if not ramps or len(curves) == 0:
        return float(travel_time(curves, problem.braking, problem.robot.radius).sum())
    s = begin[:-1, None] + length[:, None] * np.linspace(0.0, 1.0, SAMPLES)
    marks = [s[:, [0]], s[:, [-1]]]
    limits: list[Limit] = [lambda i, x: _safe_square(problem, curves, begin, i, x), *ramps]
    rows = np.broadcast_to(np.arange(len(curves))[:, None], s.shape)
    for j, one in enumerate(limits):
        for other in limits[:j]:
            marks.append(_crossings(one, other, rows, s))
    grid = np.sort(np.concatenate(marks, axis=1), axis=1)
    a, b = grid[:, :-1], grid[:, 1:]
    row = np.broadcast_to(np.arange(len(curves))[:, None], a.shape)[b > a]
    a, b = a[b > a], b[b > a]
    values = np.array([f(row, 0.5 * (a + b)) for f in limits])
    active = np.argmin(values, axis=0)
    time = 0.0
    for k, ramp in enumerate(ramps, start=1):
        here = active == k
        ends = [np.sqrt(np.maximum(ramp(row[here], x[here]), 0.0)) for x in (a, b)]
        time += float((2.0 * (b - a)[here] / (ends[0] + ends[1])).sum())
    here = active == 0
    pieces = curves.take(row[here])
    span = np.column_stack([_parameter(curves, begin, row[here], x[here]) for x in (a, b)])
    # The ends of curves stay exact.
    at_end = np.column_stack([a[here] == begin[row[here]], b[here] == begin[row[here] + 1]])
    span = np.where(at_end, pieces.span, span)
    return time + float(travel_time(pieces.cut(span), problem.braking, problem.robot.radius).sum())


def end_cost_bound(problem: Problem, least_length: float) -> float:
    """A lower bound [s] of what the ends add to the safe time of any route of at least this length.

    Derived: cut the route after s1 = c a_b / (a_b + a), a the acceleration at this end, c its clearance.
    Reaching s1 from rest takes at least sqrt(2 s1 / a); at the safe speed at most the integral of
    ds / V(c - s), as clearance falls at rate 1 at most. The difference is
    sqrt(2 c / a_b) (sqrt(1 + a_b / a) - 1). Zero where the law has a reaction time or a greatest speed.
    """
    braking = problem.braking
    if braking.reaction_time > 0.0 or math.isfinite(braking.max_speed):
        return 0.0
    bound, cut = 0.0, 0.0
    for end, accel in ((problem.start, problem.robot.max_acceleration), (problem.goal, braking.max_braking)):
        if end.fixed_speed != 0.0:
            continue
        room = max(float(problem.clearance(end.point)) - braking.margin, 0.0)
        bound += math.sqrt(2.0 * room / braking.max_braking) * (
            math.sqrt(1.0 + braking.max_braking / accel) - 1.0
        )
        cut += room * braking.max_braking / (braking.max_braking + accel)
    return bound if cut <= least_length else 0.0


def _ramps(problem: Problem, total: float) -> list[Limit]:
    """Bounds of v^2 at arc lengths s from the start, one a fixed end."""
    ramps: list[Limit] = []
    if problem.start.fixed_speed is not None:
        v0, accel = problem.start.fixed_speed, problem.robot.max_acceleration
        ramps.append(lambda i, s: v0 * v0 + 2.0 * accel * s)
    if problem.goal.fixed_speed is not None:
        v1, brake = problem.goal.fixed_speed, problem.braking.max_braking
        ramps.append(lambda i, s: v1 * v1 + 2.0 * brake * (total - s))
    return ramps


def _parameter(curves: Curves, begin: Array, row: NDArray[np.int64], s: Array) -> Array:
    some = curves.take(row)
    origin = some.arc_length(some.span[:, 0])
    sign = np.where(some.span[:, 1] >= some.span[:, 0], 1.0, -1.0)
    u = some.at_arc_length(origin + sign * (s - begin[row]))
    return np.clip(u, some.span.min(axis=1), some.span.max(axis=1))


def _safe_square(problem: Problem, curves: Curves, begin: Array, row: NDArray[np.int64], s: Array) -> Array:
    flat_row, flat = np.broadcast_to(row, s.shape).reshape(-1), s.reshape(-1)
    u = _parameter(curves, begin, flat_row, flat)
    distance = curves.take(flat_row).distance(u)
    return (problem.braking.speed(distance - problem.robot.radius) ** 2).reshape(s.shape)


def _crossings(one: Limit, other: Limit, row: NDArray[np.int64], s: Array) -> Array:
    """Where two limits cross between samples (n, k): (n, k - 1); elsewhere the first sample again."""
    value = one(row, s) - other(row, s)
    low, high = s[:, :-1], s[:, 1:]
    changes = (value[:, :-1] < 0.0) != (value[:, 1:] < 0.0)
    out = np.repeat(s[:, :1], s.shape[1] - 1, axis=1)
    i, j = np.nonzero(changes)
    a, b, negative = low[i, j], high[i, j], value[i, j] < 0.0
    for _round in range(_BISECTIONS):
        middle = 0.5 * (a + b)
        same = (one(i, middle) < other(i, middle)) == negative
        a, b = np.where(same, middle, a), np.where(same, b, middle)
    out[i, j] = 0.5 * (a + b)
    return out
