"""The knots of one mesh: a guess for the program, or its solution."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vnav_drake.collocation.blocks import arc_chord
from vnav_drake.plan import Model, Path
from vnav_drake.problem import Problem

Array = NDArray[np.float64]

CLOSING_STEPS = 8
CLOSING_TOLERANCE = 1e-14  # of the path length


@dataclass(frozen=True)
class Mesh:
    """A guess, or a solution: arcs of f L from knot to knot."""

    shares: Array  # (n,) f, positive, sum 1
    x: Array  # (n + 1,) [m]
    y: Array  # (n + 1,) [m]
    theta: Array  # (n + 1,) [rad], unwrapped
    v: Array  # (n + 1,) [m/s]
    length: float  # [m]

    @property
    def intervals(self) -> int:
        return len(self.shares)

    @property
    def points(self) -> Array:
        """(n + 1, 2) [m]"""
        return np.column_stack([self.x, self.y])

    def path(self, problem: Problem, model: Model) -> Path:
        """The arcs laid end to end, bent by the least change that ends them exactly at the goal.

        The solver leaves gaps of its tolerance between the arcs. Newton's method on the headings and
        the length with least-norm steps; it converges quadratically.
        """
        start, goal = problem.start.point, problem.goal.point
        heading = problem.goal.heading if model == "full" else None
        turns = model == "variational" or problem.start.heading is None
        theta, length, n = self.theta.copy(), self.length, self.intervals
        for _ in range(CLOSING_STEPS):
            chord, by = arc_chord(theta[:-1], theta[1:], self.shares * length)
            slope = np.zeros((3, n + 2))
            slope[:2, :n] += by[:, 0]
            slope[:2, 1 : n + 1] += by[:, 1]
            slope[:2, n + 1] = by[:, 2] @ self.shares
            slope[:2, 0] *= turns
            gap = np.append(start + chord.sum(axis=1) - goal, 0.0)
            if heading is not None:
                gap[2] = math.remainder(theta[-1] - heading, 2.0 * math.pi)
                slope[2, n] = 1.0
            if np.max(np.abs(gap)) <= CLOSING_TOLERANCE * max(1.0, length):
                break
            step = np.linalg.lstsq(slope, gap, rcond=None)[0]
            theta -= step[: n + 1]
            length -= float(step[-1])
        ds = self.shares * length
        return Path.from_arcs(start, float(theta[0]), np.diff(theta) / ds, ds)

    def split(self, counts: NDArray[np.int64]) -> Mesh:
        """The same motion with interval i cut into `counts[i]` >= 1 equal parts."""
        ds = self.shares * self.length
        heading, kappa = self.theta[:-1], np.diff(self.theta) / ds
        fine = Path(self.x, self.y, heading, kappa, ds).subdivided(counts)
        i = np.repeat(np.arange(len(counts)), counts)
        part = (np.arange(len(i)) - np.repeat(np.cumsum(counts) - counts, counts)) / counts[i]
        square = np.square(self.v)
        v = np.append(np.sqrt(square[i] + part * np.diff(square)[i]), self.v[-1])
        theta = np.append(fine.heading, self.theta[-1])
        return Mesh(self.shares[i] / counts[i], fine.x, fine.y, theta, v, self.length)


def chained(shares: Array, x: float, y: float, theta: Array, v: Array, length: float) -> Mesh:
    """A mesh whose knots lie where its arcs lead from (x, y)."""
    chord, _ = arc_chord(theta[:-1], theta[1:], shares * length)
    ends = np.concatenate([np.zeros((2, 1)), np.cumsum(chord, axis=1)], axis=1)
    return Mesh(shares, x + ends[0], y + ends[1], theta, v, length)
