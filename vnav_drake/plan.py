"""What every method returns: a path, the motion along it, and how it was found."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path as FilePath
from types import MappingProxyType
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Model = Literal["variational", "full"]

COLUMNS = ("t", "x", "y", "heading", "v", "a", "curvature", "clearance")


def arc_step(heading: ArrayLike, curvature: ArrayLike, length: ArrayLike) -> tuple[Array, Array]:
    """Displacement [m] along circular arcs that start with `heading` [rad]; shapes broadcast.

    The chord of an arc of length s and turn b = kappa s is s sin(b/2)/(b/2) long and points along
    the mean heading.
    """
    length = np.asarray(length, dtype=float)
    half = 0.5 * np.asarray(curvature, dtype=float) * length
    chord = length * np.sinc(half / math.pi)
    mean = np.asarray(heading, dtype=float) + half
    return chord * np.cos(mean), chord * np.sin(mean)


@dataclass(frozen=True)
class Path:
    """Circular arcs (straight ones with curvature 0) laid end to end.

    The heading may jump between pieces (a kink), as along a Voronoi diagram; positions never do.
    """

    x: Array  # (n + 1,) [m], ends of the pieces
    y: Array  # (n + 1,) [m]
    heading: Array  # (n,) [rad], at the start of each piece, unwrapped
    curvature: Array  # (n,) [1/m], left turns positive
    piece_length: Array  # (n,) [m], positive

    @classmethod
    def from_arcs(
        cls, start: ArrayLike, heading: float, curvature: ArrayLike, piece_length: ArrayLike
    ) -> Path:
        """A smooth path: every piece begins with the heading with which the one before ends."""
        curvature = np.asarray(curvature, dtype=float)
        piece_length = np.asarray(piece_length, dtype=float)
        headings = heading + np.concatenate([[0.0], np.cumsum(curvature * piece_length)])[:-1]
        dx, dy = arc_step(headings, curvature, piece_length)
        x0, y0 = np.asarray(start, dtype=float)
        x = x0 + np.concatenate([[0.0], np.cumsum(dx)])
        y = y0 + np.concatenate([[0.0], np.cumsum(dy)])
        return cls(x, y, headings, curvature, piece_length)

    @classmethod
    def polyline(cls, points: ArrayLike) -> Path:
        """Straight pieces through `points` (n + 1, 2) [m]; consecutive points must differ."""
        p = np.asarray(points, dtype=float)
        step = np.diff(p, axis=0)
        heading = np.unwrap(np.arctan2(step[:, 1], step[:, 0]))
        return cls(p[:, 0], p[:, 1], heading, np.zeros(len(step)), np.hypot(step[:, 0], step[:, 1]))

    @property
    def length(self) -> float:
        """[m]"""
        return float(self.piece_length.sum())

    @property
    def end_heading(self) -> Array:
        """(n,) [rad], at the end of each piece."""
        return self.heading + self.curvature * self.piece_length

    @property
    def kinks(self) -> Array:
        """(n - 1,) [rad], jump of the heading at each inner joint."""
        jump = self.heading[1:] - self.end_heading[:-1]
        return (jump + math.pi) % (2.0 * math.pi) - math.pi

    def at(self, s: ArrayLike) -> tuple[Array, Array, Array, Array]:
        """x, y [m], heading [rad] and curvature [1/m] at arc lengths `s` [m]; same shape as `s`."""
        distance = np.asarray(s, dtype=float)
        ends = np.concatenate([[0.0], np.cumsum(self.piece_length)])
        i = np.clip(np.searchsorted(ends, distance, side="right") - 1, 0, len(self.heading) - 1)
        along = distance - ends[i]
        dx, dy = arc_step(self.heading[i], self.curvature[i], along)
        heading = self.heading[i] + self.curvature[i] * along
        return self.x[i] + dx, self.y[i] + dy, heading, self.curvature[i]

    def subdivided(self, pieces: NDArray[np.int64]) -> Path:
        """The same curve, piece i cut into `pieces[i]` >= 1 equal parts."""
        i = np.repeat(np.arange(len(pieces)), pieces)
        part = np.arange(len(i)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
        step = self.piece_length[i] / pieces[i]
        along = part * step
        dx, dy = arc_step(self.heading[i], self.curvature[i], along)
        return Path(
            np.append(self.x[i] + dx, self.x[-1]),
            np.append(self.y[i] + dy, self.y[-1]),
            self.heading[i] + self.curvature[i] * along,
            self.curvature[i],
            step,
        )


@dataclass(frozen=True)
class Trajectory:
    """A motion, row by row; see CSV columns in the user guide.

    Between rows i and i + 1 the robot moves on a circular arc of `curvature[i]` with the constant
    tangential acceleration `a[i]`; the last row repeats the last arc's values. Two rows at the same
    time and place with different headings are a kink (only in plans of the variational model).
    """

    t: Array  # (m,) [s]
    x: Array  # (m,) [m]
    y: Array  # (m,) [m]
    heading: Array  # (m,) [rad], unwrapped
    v: Array  # (m,) [m/s]
    a: Array  # (m,) [m/s^2]
    curvature: Array  # (m,) [1/m]
    clearance: Array  # (m,) [m]

    @property
    def travel_time(self) -> float:
        """[s]"""
        return float(self.t[-1] - self.t[0])

    @property
    def arc_length(self) -> Array:
        """(m,) [m], from the first row: trapezoids are exact as the acceleration is constant."""
        step = 0.5 * (self.v[1:] + self.v[:-1]) * np.diff(self.t)
        return np.concatenate([[0.0], np.cumsum(step)])

    @property
    def length(self) -> float:
        """[m]"""
        return float(self.arc_length[-1])

    def at(self, t: ArrayLike) -> tuple[Array, Array, Array, Array, Array, Array]:
        """x, y, heading, v, a, curvature at times `t` [s], clipped to the motion; same shape."""
        time = np.clip(np.asarray(t, dtype=float), self.t[0], self.t[-1])
        i = np.clip(np.searchsorted(self.t, time, side="right") - 1, 0, len(self.t) - 2)
        dt = time - self.t[i]
        v = self.v[i] + self.a[i] * dt
        along = 0.5 * (self.v[i] + v) * dt
        dx, dy = arc_step(self.heading[i], self.curvature[i], along)
        heading = self.heading[i] + self.curvature[i] * along
        return self.x[i] + dx, self.y[i] + dy, heading, v, self.a[i], self.curvature[i]

    def to_csv(self, file: FilePath) -> None:
        """Write the rows with 17 significant digits, so that reading gives back every bit."""
        rows = np.column_stack([getattr(self, name) for name in COLUMNS])
        np.savetxt(file, rows, fmt="%.17g", delimiter=",", header=",".join(COLUMNS), comments="")


@dataclass(frozen=True, kw_only=True)
class Plan:
    """One method's answer for one problem."""

    method: str  # "voronoi_route", "collocation", "refined", ...
    model: Model  # which constraints it means to satisfy
    trajectory: Trajectory
    path: Path | None = None  # the geometry in the method's own pieces, which can seed another
    details: Mapping[str, Any] = field(default_factory=dict)  # solver, iterations, graph size, ...

    def __post_init__(self) -> None:
        object.__setattr__(self, "details", MappingProxyType(dict(self.details)))

    @property
    def travel_time(self) -> float:
        """[s]"""
        return self.trajectory.travel_time

    @property
    def length(self) -> float:
        """[m]"""
        return self.trajectory.length
