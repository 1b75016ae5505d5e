"""One continuous motion: what the rows of a trajectory file mean."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

COLUMNS = ("t", "x", "y", "heading", "v", "a", "curvature", "clearance")


@dataclass(frozen=True)
class Motion:
    """Rows of a trajectory file.

    From row i to row i + 1 the robot follows a circular arc of `curvature[i]` with the constant
    tangential acceleration `a[i]`, so the square of its speed is linear in the distance travelled.
    """

    t: Array  # (m,) [s]
    x: Array  # (m,) [m]
    y: Array  # (m,) [m]
    heading: Array  # (m,) [rad]
    v: Array  # (m,) [m/s]
    a: Array  # (m,) [m/s^2]
    curvature: Array  # (m,) [1/m], left turns positive
    clearance: Array  # (m,) [m], as the planner saw it

    @classmethod
    def from_rows(cls, rows: Array) -> Motion:
        """From an array (m, 8) in the order of `COLUMNS`."""
        return cls(*(np.ascontiguousarray(column) for column in rows.T))

    @cached_property
    def duration(self) -> Array:
        """(m - 1,) [s], of each row."""
        return np.diff(self.t)

    @cached_property
    def step(self) -> Array:
        """(m - 1,) [m], travelled in each row: mean speed times duration, exact."""
        return 0.5 * (self.v[:-1] + self.v[1:]) * self.duration

    @cached_property
    def moving(self) -> NDArray[np.bool_]:
        """(m - 1,), rows that take time: all but kinks."""
        return self.duration > 0.0

    @property
    def travel_time(self) -> float:
        """[s]"""
        return float(self.t[-1] - self.t[0])

    @property
    def length(self) -> float:
        """[m]"""
        return float(self.step.sum())

    def speed(self, row: Rows, along: Array) -> Array:
        """Speed [m/s] a distance `along` [m] into each of `row`; same shape."""
        step = np.where(self.step[row] > 0.0, self.step[row], 1.0)
        part = along / step
        before, after = self.v[:-1][row] ** 2, self.v[1:][row] ** 2
        return np.sqrt(np.maximum(before + part * (after - before), 0.0))

    def time(self, row: Rows, along: Array) -> Array:
        """Time [s] at which the robot is a distance `along` [m] into each of `row`; same shape."""
        twice_mean = self.v[:-1][row] + self.speed(row, along)
        return self.t[:-1][row] + np.divide(
            2.0 * along, twice_mean, out=np.zeros_like(along), where=twice_mean > 0.0
        )

    def position(self, row: Rows, along: Array) -> Array:
        """Points (..., 2) [m] a distance `along` [m] into each of `row`.

        An arc of length s and turn b has the chord s sin(b/2)/(b/2) in the direction of the mean
        heading.
        """
        half = 0.5 * self.curvature[:-1][row] * along
        chord = along * np.sinc(half / np.pi)
        mean = self.heading[:-1][row] + half
        x = self.x[:-1][row] + chord * np.cos(mean)
        y = self.y[:-1][row] + chord * np.sin(mean)
        return np.stack([x, y], axis=-1)

    def at(self, time: Array) -> tuple[Array, Array]:
        """Points (n, 2) [m] and headings (n,) [rad] at times (n,) [s], held before and after."""
        clipped = np.clip(time, self.t[0], self.t[-1])
        row = np.clip(np.searchsorted(self.t, clipped, side="right") - 1, 0, len(self.t) - 2)
        elapsed = clipped - self.t[row]
        along = (self.v[row] + 0.5 * self.a[row] * elapsed) * elapsed
        return self.position(row, along), self.heading[row] + self.curvature[row] * along
