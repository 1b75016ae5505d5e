"""When is a run of the dynamic window approach stuck: no arc, standing still, circling, getting nowhere."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from vnav_drake.problem import Problem

Reason = Literal["no_admissible_arc", "standing", "oscillation", "no_progress", "too_many_decisions"]

STANDING_WINDOWS = 10  # windows in a row...
STANDING_SHARE = 1e-3  # ...that together are slower than this part of the top speed
RETURN_DISTANCE = 0.05  # of the smallest turning radius: a place counts as the same
RETURN_ANGLE = 0.05  # [rad]: a heading counts as the same
RETURN_SPEED = 0.05  # of the top speed
RETURNS = 2  # earlier visits in the same state that make an oscillation
PROGRESS = 1e-3  # of the world's diameter: coming this much nearer to the goal is progress


@dataclass(frozen=True, kw_only=True)
class Stuck:
    """Why, when and where a run gave up."""

    reason: Reason
    time: float  # [s]
    place: tuple[float, float]  # [m]
    message: str


@dataclass
class Watch:
    """Looks at the state before each decision and says when the run is stuck.

    A run is deterministic, so coming back to the same state again and again is no way to get anywhere.
    """

    problem: Problem
    top_speed: float  # [m/s]
    per_window: float = 1.0  # decisions, at least one
    _rows: NDArray[np.float64] = field(default_factory=lambda: np.empty((64, 6)))  # grows by doubling
    _count: int = 0
    _nearest: float = math.inf  # [m] to the goal
    _nearest_length: float = 0.0  # [m], travelled then

    def stuck(
        self, time: float, place: tuple[float, float], heading: float, speed: float, length: float
    ) -> Stuck | None:
        """Judge the state (length: travelled so far [m]) and remember it."""
        found = self._standing(time, length) or self._circling(place, heading, speed, length)
        found = found or self._nowhere(place, length)
        if self._count == len(self._rows):
            self._rows = np.concatenate([self._rows, np.empty_like(self._rows)])
        self._rows[self._count] = (time, *place, heading, speed, length)
        self._count += 1
        return None if found is None else Stuck(reason=found[0], time=time, place=place, message=found[1])

    @property
    def _seen(self) -> NDArray[np.float64]:
        """(n, 6): time, x, y, heading, speed, length so far, one row a decision."""
        return self._rows[: self._count]

    def _standing(self, time: float, length: float) -> tuple[Reason, str] | None:
        row = self._count - math.ceil(STANDING_WINDOWS * self.per_window)
        if row < 0:
            return None
        since = self._seen[row]
        if length - since[-1] >= STANDING_SHARE * self.top_speed * (time - since[0]):
            return None
        return "standing", f"moved {length - since[-1]:.3g} m in {time - since[0]:.3g} s"

    def _circling(
        self, place: tuple[float, float], heading: float, speed: float, length: float
    ) -> tuple[Reason, str] | None:
        radius, seen = 1.0 / self.problem.robot.max_curvature, self._seen
        same = np.hypot(seen[:, 1] - place[0], seen[:, 2] - place[1]) <= RETURN_DISTANCE * radius
        turned = np.abs(np.remainder(seen[:, 3] - heading + math.pi, 2.0 * math.pi) - math.pi)
        same &= (turned <= RETURN_ANGLE) & (np.abs(seen[:, 4] - speed) <= RETURN_SPEED * self.top_speed)
        visits = seen[same & (length - seen[:, 5] >= radius), 5]
        # Two rows of one visit lie closer together than the robot's smallest circle is wide.
        count = 0 if len(visits) == 0 else 1 + int(np.sum(np.diff(visits) >= radius))
        if count < RETURNS:
            return None
        return "oscillation", f"here for the {count + 1}. time with this heading and speed"

    def _nowhere(self, place: tuple[float, float], length: float) -> tuple[Reason, str] | None:
        goal = self.problem.goal.point
        distance = math.hypot(goal[0] - place[0], goal[1] - place[1])
        if distance <= self._nearest - PROGRESS * self.problem.world.diameter:
            self._nearest, self._nearest_length = distance, length
        x0, y0, x1, y1 = self.problem.world.bounds
        way = length - self._nearest_length
        if way <= 2.0 * (x1 - x0 + y1 - y0):
            return None
        return "no_progress", f"no nearer to the goal than {self._nearest:.3f} m for the last {way:.1f} m"
