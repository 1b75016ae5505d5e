"""Optimal arcs near one feature where a greatest speed holds.

Beyond the clearance c where braking allows the greatest speed, arcs are straight. A leg is one of

* one arc below c, or one straight line beyond it;
* an arc from below that crosses c and goes on straight, in one direction;
* a ride: arcs or straight lines that touch c tangentially, and c itself between them. Only where r / V (1 / V
  near a wall) falls towards c from below, so that neither side is faster;
* a dip: straight, an arc below c, straight, where r / V grows towards c (points only).

Derived. All pieces of a leg share Clairaut's invariant k, which says that tangents join smoothly. With the
piece i of span o_i, second derivatives h_i = d2T_i/do_i^2 and c_i = d2T_i/do_i dd_i,

    eta = 1 / sum(1 / h_i),  dk/dspan = eta,  dk/dd_i = eta c_i / h_i,
    d2T/dd_i dd_j = [i = j] (d2T_i/dd_i^2 - c_i^2 / h_i) + eta (c_i / h_i) (c_j / h_j).

On a ride k is that of c, and each end feels its own attachment only.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vnav_drake.arcs.free import Solution, attach_span, bulges, free_legs, free_points
from vnav_drake.arcs.straight import ride_slope, straight_legs, straight_points
from vnav_drake.braking import UniformBraking

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]

_NODES = 16  # of quadratures, where only shares of the time are needed
_ITERATIONS = 80
_CONVERGED = 4e-15  # relative to the span


@dataclass(frozen=True)
class _Case:
    """One kind of feature under one law."""

    free: UniformBraking  # without the greatest speed
    speed: float  # [m/s], the greatest
    radius: float  # [m]
    at_point: bool
    cap: float  # [m], clearance c
    nodes: int  # of quadratures

    @classmethod
    def of(cls, law: UniformBraking, radius: float, at_point: bool, nodes: int) -> _Case:
        free = replace(law, max_speed=np.inf)
        return cls(free, law.max_speed, radius, at_point, float(free.distance(law.max_speed)), nodes)

    @property
    def edge(self) -> float:
        """Distance r of the feature from c [m]; 1 near a wall, where it is not used."""
        return self.radius + self.cap if self.at_point else 1.0

    def distance(self, d: Array) -> Array:
        return d + self.radius if self.at_point else d

    def arcs(self, d1: Array, d2: Array, span: Array, hessian: bool = True) -> Solution:
        return free_legs(self.free, self.radius, self.at_point, d1, d2, span, hessian, self.nodes)

    def lines(self, d1: Array, d2: Array, span: Array, hessian: bool = True) -> Solution:
        return straight_legs(self.speed, self.at_point, self.distance(d1), self.distance(d2), span, hessian)

    def attach_span(self, d: Array) -> Array:
        """Span of the arc from d < c that touches c."""
        return attach_span(self.free, self.radius, self.at_point, d, self.cap)

    def touch_span(self, d: Array) -> Array:
        """Span of the straight line from d >= c that touches c, infinite near a wall beyond c."""
        if not self.at_point:
            return np.where(d > self.cap, np.inf, 0.0)
        r = self.distance(d)
        return np.arctan2(np.sqrt(np.maximum((r - self.edge) * (r + self.edge), 0.0)), self.edge)


@dataclass(frozen=True)
class Pieces:
    """Legs, in order of growing end clearance, as three pieces; those not needed have span zero."""

    level: Array  # (n, 4) [m], clearance at the ends of the pieces
    span: Array  # (n, 3)
    line: Mask  # (n, 3) straight at the greatest speed
    ride: Mask  # (n,) the second piece runs along c
    single: Mask  # (n,) the second piece is all


def capped_legs(
    law: UniformBraking,
    radius: float,
    at_point: bool,
    d1: Array,
    d2: Array,
    span: Array,
    hessian: bool,
    nodes: int,
) -> Solution:
    """Legs near one kind of feature under a law with a greatest speed; see `solve_legs`."""
    case = _Case.of(law, radius, at_point, nodes)
    back = d1 > d2
    low, high = np.minimum(d1, d2), np.maximum(d1, d2)
    pieces = _split(case, low, high, span)
    count = len(span)
    parts = [_piece(case, pieces, i, hessian) for i in range(3)]
    time = parts[0][0] + parts[1][0] + parts[2][0]
    single = pieces.single
    two = ~single & ~pieces.ride & (pieces.span[:, 1] == 0.0)
    outward, k = parts[1][1].copy(), parts[1][2].copy()
    outward[two] = np.stack([parts[0][1][two, 0], parts[2][1][two, 1]], axis=-1)
    k[two] = parts[0][2][two]
    for column, part in ((0, parts[0]), (1, parts[2])):
        dips = ~single & ~pieces.ride & ~two & (pieces.span[:, 2 * column] > 0.0)
        outward[dips, column] = part[1][dips, column]
    second = None
    if hessian:
        second = np.zeros((count, 3, 3))
        second[single] = _second(parts[1])[single]
        joined = np.flatnonzero(~single & ~pieces.ride)
        second[joined] = _joined([_second(p)[joined] for p in parts], two[joined])
    riding = np.flatnonzero(pieces.ride)
    if riding.size:
        k[riding] = case.edge / case.speed
        for column, d in ((0, low[riding]), (1, high[riding])):
            cosine, change = _ride(case, d)
            sign = np.where(d < case.cap, -1.0, 1.0)  # of dT/dd
            outward[riding, column] = sign * cosine * (2 * column - 1)
            if second is not None:
                second[riding, column, column] = sign * change
    outward[back] = -outward[back, ::-1]
    if second is not None:
        order = np.array([1, 0, 2])
        second[back] = second[back][:, order][:, :, order]
    return time, outward, k, second


def capped_points(
    law: UniformBraking, radius: float, at_point: bool, d1: Array, d2: Array, span: Array, fraction: Array
) -> tuple[Array, Array]:
    """Foot offset and clearance, (n, k) each, the pieces taking shares of `fraction` by their times."""
    case = _Case.of(law, radius, at_point, _NODES)
    back = (d1 > d2)[:, None]
    pieces = _split(case, np.minimum(d1, d2), np.maximum(d1, d2), span)
    f = np.where(back, 1.0 - fraction, fraction)
    times = np.stack([_piece(case, pieces, i, False)[0] for i in range(3)], axis=-1)
    times = np.where(np.isfinite(times), times, 1.0)
    total = times.sum(axis=1)
    share = np.cumsum(times, axis=1) / np.where(total > 0.0, total, 1.0)[:, None]
    offset, clearance = np.zeros(f.shape), np.zeros(f.shape)
    for i in range(3):
        low = share[:, i - 1 : i] if i else np.zeros((len(span), 1))
        width = share[:, i : i + 1] - low
        inside = (f >= low) & (width > 0.0) if i else np.full(f.shape, True)
        local = np.clip((f - low) / np.where(width > 0.0, width, 1.0), 0.0, 1.0)
        before = pieces.span[:, :i].sum(axis=1)[:, None]
        x, d = _piece_points(case, pieces, i, local)
        offset, clearance = (np.where(inside, before + x, offset), np.where(inside, d, clearance))
    offset = np.where(back, span[:, None] - offset, offset)
    for at, s, d in ((0.0, np.zeros_like(span), d1), (1.0, span, d2)):
        offset = np.where(fraction == at, s[:, None], offset)
        clearance = np.where(fraction == at, d[:, None], clearance)
    return np.clip(offset, 0.0, span[:, None]), clearance


def _ride(case: _Case, d: Array) -> tuple[Array, Array]:
    fast = d >= case.cap
    speed = np.where(fast, case.speed, case.free.speed(d))
    slope = np.where(fast, 0.0, case.free.speed_slope(d))
    return ride_slope(speed, slope, case.distance(d), case.edge / case.speed, case.at_point)


def _split(case: _Case, low: Array, high: Array, span: Array) -> Pieces:
    """How legs with low <= high run."""
    count = len(span)
    level = np.stack([low, low, high, high], axis=-1)
    spans = np.stack([np.zeros(count), span, np.zeros(count)], axis=-1)
    fast_low, fast_high = low >= case.cap, high > case.cap
    line = np.zeros((count, 3), dtype=bool)
    line[:, 1] = fast_low
    pushed = bulges(case.free, case.radius, case.at_point, case.cap)
    reach = np.zeros((count, 2))  # spans of arcs and lines from either end to where they touch c
    for column, (d, fast) in enumerate(((low, fast_low), (high, high >= case.cap))):
        reach[fast, column] = case.touch_span(d[fast])
        if pushed:
            reach[~fast, column] = case.attach_span(d[~fast])
    over = span > reach.sum(axis=1)
    ride = over & pushed
    dip = np.flatnonzero(over & fast_low & ~ride)
    cross = np.flatnonzero(~fast_low & fast_high & ~ride)
    level[ride, 1:3] = case.cap
    spans[ride] = np.column_stack([reach[:, 0], span - reach.sum(axis=1), reach[:, 1]])[ride]
    line[ride] = np.stack([fast_low, np.zeros(count, dtype=bool), high >= case.cap], axis=-1)[ride]
    if dip.size:
        level[dip, 1:3] = case.cap
        line[dip] = [True, False, True]
        spans[dip] = _dip(case, low[dip], high[dip], span[dip])
    if cross.size:
        level[cross, 1:3] = case.cap
        line[cross] = [False, False, True]
        first = _cross(case, low[cross], high[cross], span[cross], reach[cross], pushed)
        spans[cross] = np.stack([first, np.zeros(cross.size), span[cross] - first], axis=-1)
    single = ~ride
    single[dip] = single[cross] = False
    return Pieces(level, spans, line, ride, single)


def _cross(case: _Case, low: Array, high: Array, span: Array, reach: Array, pushed: bool) -> Array:
    """Span below c of legs that cross it once: both pieces have the same invariant."""
    cap = np.full_like(low, case.cap)

    def mismatch(i: Indices, x: Array) -> tuple[Array, Array]:
        below = case.arcs(low[i], cap[i], x)
        beyond = case.lines(cap[i], high[i], span[i] - x)
        return below[2] - beyond[2], _second(below)[:, 2, 2] + _second(beyond)[:, 2, 2]

    most = np.minimum(span, reach[:, 0]) if pushed else span
    return _root(mismatch, np.maximum(span - reach[:, 1], 0.0), most, span)


def _dip(case: _Case, low: Array, high: Array, span: Array) -> Array:
    """Spans (n, 3) of straight lines from and to clearances >= c with an arc below c between them."""
    ends = case.distance(np.stack([low, high], axis=-1))

    def lines(i: Indices, arc: Array, hessian: bool) -> tuple[Array, Array]:
        """Spans (n, 2) of lines that join an arc smoothly, and the derivative of their sum by its span."""
        cap = np.full_like(arc, case.cap)
        part = case.arcs(cap, cap, arc, hessian)
        cosine = -part[1][:, 0]  # at c, of the line that goes out
        sine = np.minimum(part[2] * case.speed / case.edge, 1.0)
        ratio = case.edge / ends[i]
        far, height = sine[:, None] * ratio, (1.0 - ratio) * (1.0 + ratio)
        far_cosine = np.sqrt(height + (ratio * cosine[:, None]) ** 2)
        spans = np.arctan2(sine, cosine)[:, None] - np.arctan2(far, far_cosine)
        if not hessian:
            return spans, np.zeros_like(arc)
        with np.errstate(divide="ignore", invalid="ignore"):
            by_sine = 1.0 / cosine[:, None] - ratio / far_cosine
            return spans, by_sine.sum(axis=1) * _second(part)[:, 2, 2] * case.speed / case.edge

    def mismatch(i: Indices, x: Array) -> tuple[Array, Array]:
        spans, slope = lines(i, x, True)
        return x + spans.sum(axis=1) - span[i], 1.0 + slope

    arc = _root(mismatch, np.zeros_like(span), span, span)
    outer, _ = lines(np.arange(len(span)), arc, False)
    middle = np.maximum(span - outer.sum(axis=1), 0.0)
    return np.stack([outer[:, 0], middle, outer[:, 1]], axis=-1)


def _root(
    function: Callable[[Indices, Array], tuple[Array, Array]], low: Array, high: Array, scale: Array
) -> Array:
    """Roots (n,) between low (value <= 0) and high (value >= 0): Newton's method, halving where it fails.

    `function(rows, x)` gives values and derivatives of some rows.
    """
    low, high = low.copy(), high.copy()
    x = 0.5 * (low + high)
    last = high - low
    rows = np.flatnonzero(last > 0.0)
    for _ in range(_ITERATIONS):
        if rows.size == 0:
            break
        at = x[rows]
        value, slope = function(rows, at)
        low[rows] = np.where(value <= 0.0, at, low[rows])
        high[rows] = np.where(value >= 0.0, at, high[rows])
        with np.errstate(divide="ignore", invalid="ignore"):
            new = at - value / slope
        middle = 0.5 * (low[rows] + high[rows])
        slow = ~(np.abs(new - at) < 0.5 * last[rows])
        new = np.where((new > low[rows]) & (new < high[rows]) & ~slow, new, middle)
        last[rows] = np.abs(new - at)
        x[rows] = new
        rows = rows[(last[rows] > _CONVERGED * scale[rows]) & (value != 0.0)]
    return x


def _piece(case: _Case, pieces: Pieces, i: int, hessian: bool) -> Solution:
    """Solution of the i-th pieces, zero where there is none; on a ride the time only."""
    count = len(pieces.ride)
    time, outward, k = np.zeros(count), np.zeros((count, 2)), np.zeros(count)
    second = np.zeros((count, 3, 3)) if hessian else None
    d1, d2, span, line = (pieces.level[:, i], pieces.level[:, i + 1], pieces.span[:, i], pieces.line[:, i])
    riding = pieces.ride & (i == 1)
    time[riding] = span[riding] * case.edge / case.speed
    there = ~riding & ((span > 0.0) | (d1 != d2) | (i == 1))
    for mask, solve in ((there & line, case.lines), (there & ~line, case.arcs)):
        rows = np.flatnonzero(mask)
        if rows.size:
            part = solve(d1[rows], d2[rows], span[rows], hessian)
            time[rows], outward[rows], k[rows] = part[:3]
            if second is not None:
                second[rows] = _second(part)
    return time, outward, k, second


def _piece_points(case: _Case, pieces: Pieces, i: int, fraction: Array) -> tuple[Array, Array]:
    offset = fraction * pieces.span[:, i : i + 1]
    clearance = np.broadcast_to(pieces.level[:, i : i + 1], fraction.shape).copy()
    d1, d2, span, line = (pieces.level[:, i], pieces.level[:, i + 1], pieces.span[:, i], pieces.line[:, i])
    there = ~(pieces.ride & (i == 1)) & ((span > 0.0) | (d1 != d2))
    rows = np.flatnonzero(there & line)
    if rows.size:
        r1, r2 = case.distance(d1[rows]), case.distance(d2[rows])
        offset[rows], r = straight_points(case.at_point, r1, r2, span[rows], fraction[rows])
        clearance[rows] = r - case.distance(np.zeros(1))
    rows = np.flatnonzero(there & ~line)
    if rows.size:
        part = (d1[rows], d2[rows], span[rows], fraction[rows])
        offset[rows], clearance[rows] = free_points(case.free, case.radius, case.at_point, *part)
    return offset, clearance


def _second(part: Solution) -> Array:
    """The Hessian of a solution that has been asked for it."""
    return np.asarray(part[3])


def _joined(parts: list[Array], two: Mask) -> Array:
    """Hessians (n, 3, 3) of legs from those of three pieces; `two`: without the second."""
    first, _, last = parts
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = [1.0 / h[:, 2, 2] for h in parts]
        eta = 1.0 / (inverse[0] + np.where(two, 0.0, inverse[1]) + inverse[2])
        share = np.stack(
            [first[:, 0, 2] * inverse[0], last[:, 1, 2] * inverse[2], np.ones_like(eta)], axis=-1
        )
        h = eta[:, None, None] * share[:, :, None] * share[:, None, :]
        h[:, 0, 0] += first[:, 0, 0] - first[:, 0, 2] ** 2 * inverse[0]
        h[:, 1, 1] += last[:, 1, 1] - last[:, 1, 2] ** 2 * inverse[2]
    return h
