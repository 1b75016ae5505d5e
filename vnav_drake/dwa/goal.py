"""The last arc: exactly to the goal, once it is near."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from vnav_drake.biarcs import biarcs
from vnav_drake.dwa.window import curvature_window
from vnav_drake.plan import Path, Trajectory
from vnav_drake.problem import End, PlanningError, Problem
from vnav_drake.speed_profile import fastest_profile

Array = NDArray[np.float64]

SPEED_JUMP = 1e-12  # [m/s]: the last arc begins with the speed the robot has
FIRST_LOOK = 65  # samples of the last arc
NO_CHORD = 1e-9  # [m]: nearer than this the goal is reached


def goal_curvature(place: Array, heading: Array, goal: Array) -> Array:
    """Curvature [1/m] of the arcs that begin with `heading` (k,) [rad] at `place` and pass the goal; (k,)."""
    chord = goal - place
    angle = math.atan2(chord[1], chord[0]) - heading
    return np.asarray(2.0 * np.sin(angle) / max(math.hypot(*chord), NO_CHORD))


def arc_to_goal(place: Array, heading: float, goal: End) -> Path | None:
    """The arc from a pose to the goal, at most half a circle; two arcs where the goal has a heading.

    None where there is none: the goal lies behind, or is here.
    """
    chord = goal.point - place
    size = math.hypot(*chord)
    angle = math.remainder(math.atan2(chord[1], chord[0]) - heading, 2.0 * math.pi)
    if size <= NO_CHORD or abs(angle) >= 0.5 * math.pi:
        return None
    if goal.heading is None:
        whole = size / float(np.sinc(angle / math.pi))
        return Path.from_arcs(place, heading, [2.0 * angle / whole], [whole])
    ends = np.array([heading, goal.heading])
    tangents = np.column_stack([np.cos(ends), np.sin(ends)])
    _, _, curvature, length = biarcs(np.stack([place, goal.point]), tangents)
    if not (np.isfinite(length).all() and (length > 0.0).all()):
        return None
    return Path.from_arcs(place, heading, curvature, length)


def drive_to_goal(
    problem: Problem, start: End, curvature: float | None, lasting: float, longest: float
) -> Trajectory | None:
    """The fastest motion along the arc from `start` (with heading) to the goal; None where it is not allowed.

    Parameters
    ----------
    curvature : [1/m], of the arc that the robot is on, and `lasting` [s], since when; None: wheels free.
    longest : [m], a longer arc is not tried.
    """
    if start.heading is None:
        raise ValueError("the last arc needs a heading to begin with")
    path = arc_to_goal(start.point, start.heading, problem.goal)
    if path is None or path.length > longest:
        return None
    if np.abs(path.curvature).max() > problem.robot.max_curvature or not _looks_free(problem, path):
        return None
    try:
        motion = fastest_profile(
            dataclasses.replace(problem, start=start), path, model="full", ends="problem"
        )
    except PlanningError:
        return None
    wanted = start.fixed_speed
    if wanted is not None and abs(float(motion.v[0]) - wanted) > SPEED_JUMP:
        return None
    return motion if _steering_follows(problem, motion, curvature, lasting) else None


def _looks_free(problem: Problem, path: Path) -> bool:
    """Whether samples of the path are: a quick no, before its profile is made."""
    x, y, *_ = path.at(np.linspace(0.0, path.length, FIRST_LOOK))
    room = problem.clearance(np.column_stack([x, y])) - problem.braking.margin
    return bool(room.min() > 0.0)


def _steering_follows(problem: Problem, motion: Trajectory, curvature: float | None, lasting: float) -> bool:
    """Whether the wheels can turn at each jump of the curvature within the shorter of both pieces."""
    bend, dt = motion.curvature[:-1], np.diff(motion.t)
    first = np.concatenate([[0], np.flatnonzero(np.diff(bend) != 0.0) + 1])
    pieces = np.add.reduceat(dt, first)
    before = [curvature, *bend[first][:-1]]
    times = np.minimum(np.concatenate([[lasting], pieces[:-1]]), pieces)
    for old, new, time in zip(before, bend[first], times, strict=True):
        low, high = curvature_window(problem.robot, old, float(time))
        if not low <= new <= high and new != old:
            return False
    return True
