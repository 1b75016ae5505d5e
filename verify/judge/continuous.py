"""The least margin over a whole motion, proven between the rows and not only sampled.

Distance to a closed set is 1-Lipschitz and, where it is at least D > 0, semiconcave with constant
1/D. Along an arc of curvature kappa its second derivative is therefore at most c = 1/D + |kappa|, and
on a piece of length h with end values m0, m1

    m(s) >= m0 + (m1 - m0) s/h - c s (h - s)/2.

The braking distance is quadratic in the speed and v^2 is linear in s, so its quadratic part is exact
under linear interpolation. The reaction part t_r v exceeds its chord by at most
t_r (v1 - v0)^2 / (4 (v0 + v1)) (sqrt is concave; the gap is widest where v = (v0 + v1)/2).
Pieces on which this is not tight enough are halved.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verify.judge.motion import Motion

Array = NDArray[np.float64]

RESOLUTION = 1e-8  # [m]: proven and attained least margins agree to this; 1 % of the check tolerance
COARSE = 1e-3  # relative resolution where the margin is clearly negative: enough to say by how much
CONTACT = 1e-7  # [m], of a centre from an obstacle: cannot be told from touching it; ends keep 1e-6 m
BUDGET = 3_000_000  # distance evaluations; a coarser (still proven) bound is returned beyond it


@dataclass(frozen=True, kw_only=True)
class Need:
    """Distance to obstacles that a robot's centre needs at speed v: `constant + linear v + quadratic v^2`."""

    constant: float  # [m], radius and margin
    linear: float = 0.0  # [s], reaction time
    quadratic: float = 0.0  # [s^2/m], 1/(2 a_b)

    def at(self, speed: Array) -> Array:
        """[m], same shape as `speed` [m/s]."""
        return self.constant + (self.linear + self.quadratic * speed) * speed


@dataclass(frozen=True, kw_only=True)
class LeastMargin:
    """The least of distance minus need over a motion."""

    proven: float  # [m], no instant has less
    attained: float  # [m], at the place below
    t: float  # [s]
    x: float  # [m]
    y: float  # [m]


def least_margin(motion: Motion, distance: Callable[[Array], Array], need: Need) -> LeastMargin:
    """Least of `distance(position) - need(speed)` over the continuous motion.

    `distance` takes points (n, 2) [m] and must be 1-Lipschitz and, where positive, the distance to a
    closed set. The result is a lower bound within `RESOLUTION` of a value that is attained, unless
    `BUDGET` runs out first; then `proven` is lower but still proven.
    """
    row = np.arange(len(motion.step))
    begin, end = np.zeros(len(row)), motion.step.copy()
    gap_begin = distance(motion.position(row, begin))
    gap_end = distance(motion.position(row, end))
    proven, best, spent = np.inf, np.inf, 2 * len(row)
    place = (0, 0.0)
    while True:
        v_begin, v_end = motion.speed(row, begin), motion.speed(row, end)
        margin_begin, margin_end = gap_begin - need.at(v_begin), gap_end - need.at(v_end)
        for margin, along in ((margin_begin, begin), (margin_end, end)):
            least = int(np.argmin(margin))
            if margin[least] < best:
                best, place = float(margin[least]), (int(row[least]), float(along[least]))
        length = end - begin
        nearest = (gap_begin + gap_end - length) / 2.0  # 1-Lipschitz: no point of the piece is nearer
        lower = nearest - need.at(np.maximum(v_begin, v_end))
        clear = nearest > 0.0
        bend = 1.0 / np.where(clear, nearest, 1.0) + np.abs(motion.curvature[row])
        smooth = parabola_minimum(margin_begin, margin_end, bend, length)
        smooth -= need.linear * root_excess(v_begin, v_end)
        lower = np.where(clear, np.maximum(lower, smooth), lower)
        lower = np.where(length > 0.0, lower, np.minimum(margin_begin, margin_end))
        resolution = RESOLUTION if best > -RESOLUTION / COARSE else COARSE * -best
        undecided = lower < best - resolution
        proven = min(proven, float(lower[~undecided].min(initial=np.inf)))
        if not undecided.any() or spent > BUDGET:
            proven = min(proven, float(lower[undecided].min(initial=np.inf)))
            break
        row, begin, end = row[undecided], begin[undecided], end[undecided]
        gap_begin, gap_end = gap_begin[undecided], gap_end[undecided]
        middle = 0.5 * (begin + end)
        gap_middle = distance(motion.position(row, middle))
        spent += len(row)
        row = np.concatenate([row, row])
        begin, end = np.concatenate([begin, middle]), np.concatenate([middle, end])
        gap_begin = np.concatenate([gap_begin, gap_middle])
        gap_end = np.concatenate([gap_middle, gap_end])
    at_row, at_along = np.array([place[0]]), np.array([place[1]])
    (x, y) = motion.position(at_row, at_along)[0]
    t = float(motion.time(at_row, at_along)[0])
    return LeastMargin(proven=min(proven, best), attained=best, t=t, x=float(x), y=float(y))


def parabola_minimum(begin: Array, end: Array, bend: Array, length: Array) -> Array:
    """Least value over 0 <= s <= h of begin + (end - begin) s/h - bend s (h - s)/2."""
    sag = bend * length * length
    rise = end - begin
    inside = (np.abs(rise) < 0.5 * sag) & (sag > 0.0)
    vertex = 0.5 * (begin + end) - sag / 8.0 - rise * rise / (2.0 * np.where(inside, sag, 1.0))
    return np.where(inside, vertex, np.minimum(begin, end))


def root_excess(begin: Array, end: Array) -> Array:
    """Greatest excess of the speed over the straight line between its end values along a piece [m/s]."""
    total = begin + end
    return np.divide((end - begin) ** 2, 4.0 * total, out=np.zeros_like(total), where=total > 0.0)
