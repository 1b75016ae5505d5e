"""The fastest speed along chains of Voronoi arcs, exactly.

Derived. Let s be arc length and w = v^2. The braking limit is w <= B(s) = V(d(s))^2, the drive limits are
-2 a_b <= dw/ds <= 2 a_max. The greatest such w is

    w(s) = min( min over t <= s of B(t) + 2 a_max (s - t),  min over t >= s of B(t) + 2 a_b (t - s) ),

end speeds being one more term each. Along each curve d is convex in s, and so is B below the greatest speed,
where dB/ds = 2 a V / (V + a t_r) dd/ds grows with both. So a pass along one curve has three parts: it gains
on the limit at full drive until it meets it, follows it until dB/ds exceeds what the drive can give, and
leaves it along the tangent. Hence the whole profile is bang-bang or on the limit, as in Manor 2015, sec. 2.6.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vnav_drake.braking import UniformBraking
from vnav_drake.robot import Robot
from vnav_drake.voronoi import LINEAR, Curves, travel_time
from vnav_drake.voronoi.times import slow_part

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]

BOUNDARY, ACCELERATE, BRAKE = 0, 1, 2

ROUNDING = 1e-12  # of v^2: a ramp this near to the limit is the limit
_BISECTIONS = 60  # halve an interval of parameters to rounding


@dataclass(frozen=True)
class ArcProfile:
    """Rows in order of travel: on the limit V(d), accelerating at a_max, or braking at a_b."""

    curves: Curves  # (p,) the stretch of each row, in the direction of travel
    curve: Indices  # (p,) row of the curves that were given
    chain: Indices  # (p,)
    mode: Indices  # (p,) BOUNDARY, ACCELERATE or BRAKE
    begin: Array  # (p,) [m], arc length from the start of the chain
    end: Array  # (p,) [m]
    square: Array  # (p, 2) [m^2/s^2], v^2 at both ends; linear in arc length unless on the limit
    time: Array  # (p,) [s]


def arc_minimum_time(
    curves: Curves,
    chain: ArrayLike,
    braking: UniformBraking,
    robot: Robot,
    *,
    start_speed: ArrayLike = np.inf,
    end_speed: ArrayLike = np.inf,
) -> Array:
    """Least travel time [s] along each of k chains of arcs; see `arc_profile` for the parameters. (k,)

    Infinite where the law stops the robot for ever, which takes a reaction time and V = 0.
    """
    profile = arc_profile(curves, chain, braking, robot, start_speed=start_speed, end_speed=end_speed)
    number = np.asarray(chain, dtype=np.int64)
    count = int(number.max()) + 1 if len(number) else 0
    time: Array = np.bincount(profile.chain, weights=profile.time, minlength=count).astype(float)
    return time


def arc_profile(
    curves: Curves,
    chain: ArrayLike,
    braking: UniformBraking,
    robot: Robot,
    *,
    start_speed: ArrayLike = np.inf,
    end_speed: ArrayLike = np.inf,
) -> ArcProfile:
    """The fastest speed along chains of arcs under V(d), a_max and a_b of the robot.

    Parameters
    ----------
    curves : (m,), in the direction of travel, end to end within a chain, at distance >= radius + margin.
    chain : (m,) the chain of each curve, 0, 1, ..., not decreasing.
    start_speed, end_speed : scalar or (k,) [m/s], the speed at the ends is at most this; infinite is the
        safe speed.

    Raises
    ------
    ValueError : `chain` decreases or has another length.
    """
    number = np.asarray(chain, dtype=np.int64)
    if number.shape != (len(curves),) or np.any(np.diff(number) < 0) or np.any(number[:1] < 0):
        raise ValueError("chain: one number for each curve is needed, zero or more, not decreasing")
    if len(number) == 0:
        none = np.zeros(0)
        return ArcProfile(curves, number, number, number, none, none, np.zeros((0, 2)), none)
    ends = np.stack(np.broadcast_arrays(start_speed, end_speed, np.empty(int(number[-1]) + 1))[:2])
    limit = _Limit.of(curves, number, braking, robot.radius)
    given = np.square(ends.astype(float))[:, limit.chain]
    ahead = _pass(limit, given[0], robot.max_acceleration)
    back = _pass(limit.backwards(), given[1, ::-1], robot.max_braking).backwards()
    return _combine(limit, ahead, back, robot)


@dataclass(frozen=True)
class _Limit:
    """Curves cut where they meet the greatest speed, with B(s) along them."""

    curves: Curves  # (p,)
    curve: Indices  # (p,)
    chain: Indices  # (p,)
    flat: Mask  # (p,) at the greatest speed all along
    begin: Array  # (p,) [m], arc length from the start of the chain
    braking: UniformBraking
    radius: float

    @classmethod
    def of(cls, curves: Curves, chain: Indices, braking: UniformBraking, radius: float) -> _Limit:
        curve, flat = np.arange(len(curves)), np.zeros(len(curves), dtype=bool)
        if np.isfinite(braking.max_speed):
            cap = radius + float(braking.distance(braking.max_speed))
            slow = slow_part(curves, np.sort(curves.span, axis=1), cap)
            slow = np.where((curves.span[:, 0] > curves.span[:, 1])[:, None], slow[:, ::-1], slow)
            marks = np.column_stack([curves.span[:, 0], slow, curves.span[:, 1]])
            curve = np.repeat(curve, 3)
            flat = np.tile([True, False, True], len(curves))
            curves = curves.take(curve).cut(np.stack([marks[:, :-1], marks[:, 1:]], axis=-1).reshape(-1, 2))
        some = curves.span[:, 0] != curves.span[:, 1]
        curves, curve, flat = curves.take(some), curve[some], flat[some]
        return cls(curves, curve, chain[curve], flat, _begin(curves, chain[curve]), braking, radius)

    def backwards(self) -> _Limit:
        """The same road the other way; chains and rows in reverse order."""
        curves = self.curves.reversed(np.ones(len(self.curves), dtype=bool)).take(
            np.arange(len(self.curves))[::-1]
        )
        chain = self.chain[-1:] - self.chain[::-1] if len(self.chain) else self.chain
        begin = _begin(curves, chain)
        return _Limit(curves, self.curve[::-1], chain, self.flat[::-1], begin, self.braking, self.radius)

    def square(self, u: Array, rows: Indices | None = None) -> Array:
        """B [m^2/s^2] at parameters u of rows."""
        curves = self.curves if rows is None else self.curves.take(rows)
        clearance = curves.distance(u) - self.radius
        return np.square(self.braking.speed(clearance))

    def place(self, u: Array, rows: Indices | None = None) -> Array:
        """Arc length [m] from the start of the chain."""
        curves = self.curves if rows is None else self.curves.take(rows)
        begin = self.begin if rows is None else self.begin[rows]
        shape = (-1,) + (1,) * (u.ndim - 1)
        origin = curves.arc_length(curves.span[:, 0]).reshape(shape)
        return np.asarray(begin.reshape(shape) + np.abs(curves.arc_length(u) - origin))

    def leaving(self, accel: float) -> Array:
        """(p,) parameter after which dB/ds exceeds 2 `accel`; the end of the curve if never."""
        curves, sign = self.curves, _direction(self.curves)
        start, end = curves.span.T
        share = accel / self.braking.max_braking
        is_linear = curves.kind == LINEAR
        # Without reaction time: dd/ds = share, and dd/ds = u / hypot(size, u) on what is not straight in d.
        reach = share * curves.size / np.sqrt(1.0 - share * share) if share < 1.0 else np.inf
        leave = np.where(is_linear, np.where(sign * curves.slope > share, start, end), sign * reach)
        low, high = np.minimum(start, end), np.maximum(start, end)
        leave = np.where(self.flat, end, np.clip(leave, low, high))
        if self.braking.reaction_time > 0.0:
            rows = np.flatnonzero(~self.flat)
            leave[rows] = self._bisect(rows, start[rows], end[rows], accel)
        return leave

    def _bisect(self, rows: Indices, start: Array, end: Array, accel: float) -> Array:
        """With reaction time: dB/ds = 2 a V / (V + a t_r) dd/ds grows along the curve."""
        curves, sign = self.curves.take(rows), _direction(self.curves)[rows]
        lag = self.braking.max_braking * self.braking.reaction_time

        def steep(u: Array) -> Mask:
            size = np.hypot(curves.size, u)
            rise = sign * np.where(curves.kind == LINEAR, curves.slope, u / np.where(size > 0.0, size, 1.0))
            v = np.sqrt(self.square(u, rows))
            return self.braking.max_braking * v * rise > accel * (v + lag)

        a, b = np.where(steep(end), start, end), end
        for _round in range(_BISECTIONS):
            middle = 0.5 * (a + b)
            beyond = steep(middle)
            a, b = np.where(beyond, a, middle), np.where(beyond, middle, b)
        return np.where(steep(start), start, a)


@dataclass(frozen=True)
class _Pass:
    """min over t <= s of B(t) + 2 accel (s - t), in three parts: ramp, B, ramp; (p,) each."""

    meet: Array  # parameter at which the ramp meets B
    leave: Array  # parameter at which it leaves B
    first: Array  # [m^2/s^2], w of the first ramp carried back to the start of the chain
    second: Array  # [m^2/s^2]

    def backwards(self) -> _Pass:
        """A pass along `limit.backwards()`, told in rows of `limit`; its ramps begin at the chain's end."""
        return _Pass(self.meet[::-1], self.leave[::-1], self.first[::-1], self.second[::-1])


def _pass(limit: _Limit, given: Array, accel: float) -> _Pass:
    start = limit.curves.span[:, 0]
    leave = limit.leaving(accel)
    own = limit.square(leave) - 2.0 * accel * limit.place(leave)
    first = np.searchsorted(limit.chain, limit.chain)
    least = np.minimum(given, _running_least(own, first))
    before = np.where(first == np.arange(len(own)), given, np.concatenate([given[:1], least[:-1]]))
    below = before + 2.0 * accel * limit.begin < limit.square(start)
    meet = np.where(below, leave, start)
    rows = np.flatnonzero(below & (before > own))
    a, b = start[rows], leave[rows]
    for _round in range(_BISECTIONS):
        middle = 0.5 * (a + b)
        ramp = before[rows] + 2.0 * accel * limit.place(middle, rows)
        still = ramp < limit.square(middle, rows)
        a, b = np.where(still, middle, a), np.where(still, b, middle)
    meet[rows] = 0.5 * (a + b)
    return _Pass(meet, leave, before, np.minimum(before, own))


def _combine(limit: _Limit, ahead: _Pass, back: _Pass, robot: Robot) -> ArcProfile:
    """The lesser of both passes, cut into rows of one kind each."""
    up, down = 2.0 * robot.max_acceleration, 2.0 * robot.max_braking
    curves, sign = limit.curves, _direction(limit.curves)[:, None]
    length = _chain_length(limit)
    start, end = curves.span.T
    # Ramps up and down cross at most once; in all four ways, each within the row.
    high = np.column_stack([back.first, back.first, back.second, back.second]) + down * length[:, None]
    low = np.column_stack([ahead.first, ahead.second, ahead.first, ahead.second])
    finite = np.isfinite(high) & np.isfinite(low)
    cross = np.where(finite, (high - np.where(finite, low, 0.0)) / (up + down), limit.begin[:, None])
    cross = np.clip(cross, limit.begin[:, None], (limit.begin + curves.length)[:, None])
    direct = sign * (cross - limit.begin[:, None])
    at_cross = curves.at_arc_length(curves.arc_length(start)[:, None] + direct)
    inner = np.column_stack([at_cross, ahead.meet, ahead.leave, back.meet, back.leave])
    inner = np.clip(inner, np.minimum(start, end)[:, None], np.maximum(start, end)[:, None])
    marks = sign * np.sort(sign * np.column_stack([start, inner, end]), axis=1)
    marks[:, 0], marks[:, -1] = start, end
    middle = 0.5 * (marks[:, :-1] + marks[:, 1:])
    s, left = limit.place(middle), length[:, None] - limit.place(middle)
    on_limit = limit.square(middle)
    way = sign * middle
    rising = _ramp(way, sign, ahead.meet, ahead.leave, ahead.first, ahead.second, up * s)
    falling = _ramp(-way, -sign, back.meet, back.leave, back.first, back.second, down * left)
    mode = np.argmin(np.stack([on_limit * (1.0 - ROUNDING), rising, falling]), axis=0)
    keep = marks[:, :-1] != marks[:, 1:]
    piece, part = np.nonzero(keep)
    kind = mode[piece, part]
    new = np.ones(len(piece), dtype=bool)
    new[1:] = (piece[1:] != piece[:-1]) | (kind[1:] != kind[:-1])
    head = np.flatnonzero(new)
    tail = np.append(head[1:], len(piece)) - 1
    row, kind = piece[head], kind[head]
    span = np.column_stack([marks[row, part[head]], marks[row, part[tail] + 1]])
    rows = curves.take(row).cut(span)
    place = limit.place(span, row)
    # The ramp of a row is the one at its middle.
    square = limit.square(span, row)
    lift_up = rising[row, part[head]] - up * s[row, part[head]]
    lift_down = falling[row, part[head]] - down * left[row, part[head]]
    square = np.where((kind == ACCELERATE)[:, None], lift_up[:, None] + up * place, square)
    back_from = down * (length[row][:, None] - place)
    square = np.maximum(np.where((kind == BRAKE)[:, None], lift_down[:, None] + back_from, square), 0.0)
    time = _times(limit, rows, kind, place, square)
    return ArcProfile(rows, limit.curve[row], limit.chain[row], kind, place[:, 0], place[:, 1], square, time)


def _ramp(
    way: Array, sign: Array, meet: Array, leave: Array, first: Array, second: Array, gain: Array
) -> Array:
    """w of the ramp at places `way` along the travel (p, k); infinite where the pass follows the limit."""
    on_first, on_second = way <= sign * meet[:, None], way >= sign * leave[:, None]
    ramp = np.where(on_second, second[:, None], np.where(on_first, first[:, None], np.inf))
    return np.asarray(ramp + gain)


def _times(limit: _Limit, rows: Curves, kind: Indices, place: Array, square: Array) -> Array:
    speed = np.sqrt(square).sum(axis=1)
    time = 2.0 * np.diff(place, axis=1)[:, 0] / np.where(speed > 0.0, speed, 1.0)
    follow = kind == BOUNDARY
    time[follow] = travel_time(rows.take(follow), limit.braking, limit.radius)
    return time


def _direction(curves: Curves) -> Array:
    return np.where(curves.span[:, 1] >= curves.span[:, 0], 1.0, -1.0)


def _begin(curves: Curves, chain: Indices) -> Array:
    total = np.concatenate([[0.0], np.cumsum(curves.length)])[: len(chain)]
    return np.asarray(total - total[np.searchsorted(chain, chain)]) if len(chain) else total


def _chain_length(limit: _Limit) -> Array:
    """(p,) [m], length of each row's chain."""
    last = np.searchsorted(limit.chain, limit.chain, side="right") - 1
    return np.asarray((limit.begin + limit.curves.length)[last])


def _running_least(values: Array, first: Indices) -> Array:
    """Least value from row `first` (p,) to each row, by doubling."""
    least, index, shift = values.copy(), np.arange(len(values)), 1
    while np.any(index - first >= shift):
        inside = (index - first)[shift:] >= shift
        least[shift:] = np.where(inside, np.minimum(least[shift:], least[:-shift]), least[shift:])
        shift *= 2
    return least
