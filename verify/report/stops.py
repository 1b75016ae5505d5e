"""The recorded emergency stops as they are drawn: how far each one went, and how near to what."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from verify.evidence import STOPS, EvidenceError
from verify.judge.stops_file import read_stops
from vnav_drake.braking import UniformBraking
from vnav_drake.problem import Problem

Array = NDArray[np.float64]

LEAST_CLAIM = 0.05  # [m]: a stop that claims less says nothing by its ratio


@dataclass(frozen=True, kw_only=True, eq=False)
class StopPaths:
    """Stops one after the other: stop i owns the rows first[i] to first[i + 1] - 1."""

    model: str
    instant: Array  # (n,) [s], when the stop is commanded
    straightened: NDArray[np.bool_]  # (n,), else the steering is held
    first: NDArray[np.int64]  # (n + 1,)
    t: Array  # (m,) [s] since the instant
    x: Array  # (m,) [m]
    y: Array  # (m,) [m]
    v: Array  # (m,) [m/s]

    def __len__(self) -> int:
        return len(self.instant)

    @property
    def begin(self) -> NDArray[np.int64]:
        """(n,) the first row of each stop."""
        return self.first[:-1]

    @property
    def speed(self) -> Array:
        """(n,) [m/s] at which each stop begins."""
        return self.v[self.begin]

    @property
    def driven(self) -> Array:
        """(n,) [m], the way of each stop along its rows."""
        way = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(self.x), np.diff(self.y)))])
        return way[self.first[1:] - 1] - way[self.begin]

    @property
    def displacement(self) -> Array:
        """(n,) [m], how far from its beginning each stop ever is."""
        rows = np.diff(self.first)
        x, y = (np.repeat(values[self.begin], rows) for values in (self.x, self.y))
        return np.asarray(np.maximum.reduceat(np.hypot(self.x - x, self.y - y), self.begin))

    def claimed(self, braking: UniformBraking) -> Array:
        """(n,) [m], the braking distance v t_r + v^2/(2 a_b) of each stop, without margin."""
        v = self.speed
        return v * braking.reaction_time + v * v / (2.0 * braking.max_braking)

    def speed_after(self, delay: float) -> Array:
        """(n,) [m/s], `delay` [s] after each instant; of a stop that ends before, the last one."""
        return self._after(delay, self.v)

    def won(self, braking: UniformBraking) -> Array:
        """(n,) [m], what each stop needs beyond its claim as its speed changes until the brakes act.

        Derived: with the way s and the speed w at the end of the reaction time t_r,
        s - v t_r + (w^2 - v^2)/(2 a_b). Negative where the plan slows down.
        """
        delay, v = braking.reaction_time, self.speed
        steps = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(self.x), np.diff(self.y)))])
        way = self._after(delay, steps - np.repeat(steps[self.begin], np.diff(self.first)))
        later = self.speed_after(delay)
        return way - v * delay + (later * later - v * v) / (2.0 * braking.max_braking)

    def _after(self, delay: float, values: Array) -> Array:
        """(n,) `values` (m,) interpolated `delay` [s] after each instant."""
        span = float(self.t.max()) + delay + 1.0  # one clock for all stops, one after the other
        shift = span * np.repeat(np.arange(len(self)), np.diff(self.first))
        at = span * np.arange(len(self)) + np.minimum(delay, self.t[self.first[1:] - 1])
        return np.interp(at, self.t + shift, values)

    def nearest(self, problem: Problem) -> tuple[Array, NDArray[np.int64]]:
        """(n,) [m] least clearance of the robot's disc in the rows of each stop, and the row it is in."""
        clearance = problem.clearance(np.column_stack([self.x, self.y]))
        least = np.minimum.reduceat(clearance, self.begin)
        hit = np.flatnonzero(clearance == np.repeat(least, np.diff(self.first)))
        return least, hit[np.searchsorted(hit, self.begin)]

    def paths(self) -> Iterator[tuple[Array, Array]]:
        """x and y [m] of each stop."""
        for start, end in zip(self.first[:-1].tolist(), self.first[1:].tolist(), strict=True):
            yield self.x[start:end], self.y[start:end]


def read_stop_paths(folder: Path) -> tuple[StopPaths | None, str]:
    """The stops of a result folder, or None and why there are none."""
    try:
        file = read_stops(folder)
    except EvidenceError as error:
        return None, str(error)
    if file is None:
        return None, f"{STOPS} was not written"
    return StopPaths(
        model=file.model, instant=file.instant, straightened=file.straightened, first=file.first,
        t=file.t, x=file.x, y=file.y, v=file.v,
    ), ""  # fmt: skip
