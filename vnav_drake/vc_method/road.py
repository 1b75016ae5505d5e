"""A route as one curve of its arc length, and where a car cannot follow it: kinks and bends too tight."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from vnav_drake.voronoi import PARABOLA, Curves
from vnav_drake.voronoi.paths import SHORTEST

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

KINK = 5e-10  # [rad]: half of what the speed profile takes for rounding


@dataclass(frozen=True)
class Road:
    """Curves end to end in the direction of travel, none of them empty."""

    curves: Curves  # (m,)

    @classmethod
    def of(cls, curves: Curves) -> Road:
        """Without stretches that are only rounding."""
        return cls(curves.take(curves.length > SHORTEST))

    @cached_property
    def joints(self) -> Array:
        """(m + 1,) [m], arc length at the ends of the curves."""
        return np.concatenate([[0.0], np.cumsum(self.curves.length)])

    @property
    def length(self) -> float:
        """[m]"""
        return float(self.joints[-1])

    def at(self, s: Array, *, after: bool) -> tuple[Array, Array, Array]:
        """Points (n, 2) [m], unit tangents (n, 2) and curvatures (n,) [1/m] at arc lengths (n,) [m].

        At a joint those of the curve behind it (`after`) or before it.
        """
        row = np.searchsorted(self.joints, s, side="right" if after else "left") - 1
        row = np.clip(row, 0, len(self.curves) - 1)
        curves, u = self.curves.take(row), self._parameter(row, s)
        return curves.points(u), curves.tangents(u), curves.curvature(u)

    def between(self, begin: float, end: float) -> Curves:
        """The curves from arc length `begin` to `end` [m]."""
        low = np.maximum(self.joints[:-1], begin)
        high = np.minimum(self.joints[1:], end)
        row = np.flatnonzero(high - low > SHORTEST)
        span = np.column_stack([self._parameter(row, low[row]), self._parameter(row, high[row])])
        whole = np.column_stack([low[row] == self.joints[row], high[row] == self.joints[row + 1]])
        some = self.curves.take(row)
        return some.cut(np.where(whole, some.span, span))

    def _parameter(self, row: Indices, s: Array) -> Array:
        curves = self.curves.take(row)
        start, end = curves.span.T
        sign = np.where(end >= start, 1.0, -1.0)
        u = curves.at_arc_length(curves.arc_length(start) + sign * (s - self.joints[row]))
        return np.clip(u, np.minimum(start, end), np.maximum(start, end))

    @cached_property
    def kinks(self) -> Array:
        """(m - 1,) [rad], turn at the inner joints, left positive."""
        tangent = self.curves.tangents(self.curves.span)
        before, behind = tangent[:-1, 1], tangent[1:, 0]
        cross = before[:, 0] * behind[:, 1] - before[:, 1] * behind[:, 0]
        return np.arctan2(cross, np.einsum("ij,ij->i", before, behind))

    def obstructions(self, max_curvature: float) -> tuple[Array, Array]:
        """Stretches (k, 2) [m] of arc length that a car cannot follow, in order, and their turns (k,) [rad].

        A kink is a stretch of no length. A parabola bends more than `max_curvature` where
        1 / (p (1 + (u/p)^2)^1.5) does. Stretches that touch are one.
        """
        at = np.flatnonzero(np.abs(self.kinks) > KINK)
        kinks = np.column_stack([self.joints[at + 1]] * 2)
        is_parabola = self.curves.kind == PARABOLA
        p = np.where(is_parabola, self.curves.size, 1.0)
        reach = p * np.sqrt(np.maximum((1.0 / (p * max_curvature)) ** (2.0 / 3.0) - 1.0, 0.0))
        reach = np.where(is_parabola, reach, 0.0)
        span = np.clip(self.curves.span, -reach[:, None], reach[:, None])
        tight = np.flatnonzero((reach > 0.0) & (span[:, 0] != span[:, 1]))
        some = self.curves.take(tight)
        from_start = np.abs(some.arc_length(span[tight]) - some.arc_length(some.span[:, :1]))
        bends = self.joints[tight][:, None] + from_start
        turned = np.diff(np.arctan(span[tight] / some.size[:, None]), axis=1)[:, 0]
        bend_turn = np.sign(some.curvature(some.middle)) * np.abs(turned)
        stretch, turn = np.concatenate([kinks, bends]), np.concatenate([self.kinks[at], bend_turn])
        order = np.lexsort([stretch[:, 1], stretch[:, 0]])
        return _united(stretch[order], turn[order])


def _united(stretch: Array, turn: Array) -> tuple[Array, Array]:
    if len(stretch) == 0:
        return stretch.reshape(0, 2), turn
    reach = np.maximum.accumulate(stretch[:, 1])
    new = np.concatenate([[True], stretch[1:, 0] > reach[:-1] + SHORTEST])
    group = np.cumsum(new) - 1
    head = np.flatnonzero(new)
    last = np.append(head[1:], len(stretch)) - 1
    return np.column_stack([stretch[head, 0], reach[last]]), np.bincount(group, weights=turn).astype(float)
