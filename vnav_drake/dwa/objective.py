"""What the dynamic window approach prefers: heading, free way, speed."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vnav_drake.dwa.window import Choices, free_length
from vnav_drake.problem import Problem

Array = NDArray[np.float64]

GRID = 128  # points across the world where the greatest clearance is looked for
TIE = 1e-9  # of the objective: nearer values count as equal, so that rounding decides nothing


@dataclass(frozen=True, kw_only=True)
class Objective:
    """G(r, v) = alpha head(r, v) + beta dist(r, v) + gamma vel(r, v) (Manor 2015, Sec. 2.7.2).

    Each term lies in [0, 1], as Fox, Burgard and Thrun 1997, sec. 4.2, normalise theirs:

    * head = 1 - |theta|/pi, theta the angle from the robot's heading to the goal, both taken where the
      robot comes to rest when it brakes with all its strength after the window (as they do);
    * dist = the length of the arc until contact, over `look`, 1 where that is not less (their large
      constant for arcs that meet nothing); of a circle half a turn counts at most, see Notes;
    * vel = speed at the end of the window over `top_speed`.

    Their smoothing over neighbouring choices is left out, as in the source's G.

    Notes
    -----
    A small circle meets nothing, so that its free way has no end, though after half a turn it leads back.
    Where dist weighs as much as head, tight circles would be worth as much as the freest way there is, and
    the robot would go round in them.
    """

    weights: tuple[float, float, float]  # alpha, beta, gamma
    goal: Array  # (2,) [m]
    top_speed: float  # [m/s]
    look: float  # [m]

    def values(self, problem: Problem, options: Choices) -> Array:
        """G of every choice, (n, k); minus infinity where it is not admissible."""
        place, heading = options.arcs.at(options.moving + options.stopping)
        to_goal = self.goal - place
        bearing = np.arctan2(to_goal[..., 1], to_goal[..., 0])
        deviation = np.abs(np.remainder(bearing - heading + math.pi, 2.0 * math.pi) - math.pi)
        alpha, beta, gamma = self.weights
        total = alpha * (1.0 - deviation / math.pi)
        total = total + beta * self.freedom(problem, options) + gamma * options.speed / self.top_speed
        return np.where(options.admissible, total, -math.inf)

    def freedom(self, problem: Problem, options: Choices) -> Array:
        """The term dist of every choice, (n, k) or (k,), in [0, 1]; void where a choice is not admissible.

        A subclass may read it in another way.
        """
        open_arcs = np.flatnonzero(options.admissible.any(axis=0))
        free = np.zeros(len(options.arcs.curvature))
        free[open_arcs] = free_length(problem, options.arcs.take(open_arcs), self.look)
        return np.asarray(np.minimum(free, half_turn(options.arcs.curvature)) / self.look)


def half_turn(curvature: Array) -> Array:
    """Length [m] of half a circle of each curvature [1/m]; infinite where it is zero. Same shape."""
    bend = np.abs(curvature)
    return np.divide(math.pi, bend, out=np.full(bend.shape, math.inf), where=bend > 0.0)


def best(values: Array) -> tuple[int, ...] | None:
    """Index of the greatest value, the first among equals; None when there is none but -infinity."""
    flat = np.ravel(values)
    greatest = float(flat.max(initial=-math.inf))
    if greatest == -math.inf:
        return None
    first = int(np.argmax(flat >= greatest - TIE))
    return tuple(int(i) for i in np.unravel_index(first, values.shape))


def top_speed(problem: Problem) -> float:
    """Greatest safe speed [m/s] anywhere on the floor, from above, within the spacing of a grid."""
    x0, y0, x1, y1 = problem.world.bounds
    x, y = np.linspace(x0, x1, GRID), np.linspace(y0, y1, GRID)
    points = np.stack(np.meshgrid(x, y), axis=-1)
    reach = 0.5 * math.hypot(x[1] - x[0], y[1] - y[0])
    return float(problem.braking.speed(problem.clearance(points).max() + reach))
