"""Curves along a motion, ready to draw: thinned with their extremes kept, jumps shown as jumps."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray

from verify.report.evidence import SimulatedRun
from vnav_drake.plan import Trajectory
from vnav_drake.problem import Problem

Array = NDArray[np.float64]

BUCKETS = 450  # a picture is at most about 900 pixels wide: two extremes in every two pixels


def thinned(x: Array, y: Array, buckets: int = BUCKETS) -> tuple[Array, Array]:
    """At most `4 buckets` of the points (x, y), x ascending: first, least, greatest and last of each bucket.

    Drawn as a line at that resolution it covers the same pixels as all the points.
    """
    n = len(x)
    if n <= 4 * buckets:
        return x, y
    edges = np.unique(np.linspace(0, n, buckets + 1).astype(np.int64))
    kept = {0, n - 1}
    for start, end in pairwise(edges.tolist()):
        part = y[start:end]
        kept.update((start, end - 1, start + int(part.argmin()), start + int(part.argmax())))
    index = np.array(sorted(kept))
    return x[index], y[index]


def thinned_path(x: Array, y: Array, size: float) -> tuple[Array, Array]:
    """A polyline that stays within size / 5000 of the given one: less than a quarter pixel on a map."""
    line = np.column_stack([x, y])
    if len(line) < 3:
        return x, y
    simple = shapely.get_coordinates(shapely.simplify(shapely.LineString(line), size / 5000.0))
    return simple[:, 0], simple[:, 1]


@dataclass(frozen=True)
class RowEnds:
    """Both ends of every row of a trajectory: what is limited is extreme there.

    Curvature and tangential acceleration are constant within a row and jump between rows.
    Shapes (2 (m - 1),).
    """

    t: Array  # [s]
    s: Array  # [m]
    x: Array  # [m]
    y: Array  # [m]
    v: Array  # [m/s]
    a: Array  # [m/s^2]
    curvature: Array  # [1/m]
    clearance: Array  # [m]

    @property
    def lateral(self) -> Array:
        """v^2 kappa [m/s^2], left turns positive."""
        return self.v * self.v * self.curvature


def in_steps(motion: Trajectory, steps: int) -> tuple[Array, Array, Array, Array]:
    """t [s], s [m], v [m/s] and clearance [m] at `steps` equal times within each row: v(s) is curved there.

    Exact but for the clearance, which is linear between rows here.
    """
    part = np.arange(steps) / steps
    t = np.append((motion.t[:-1, None] + np.diff(motion.t)[:, None] * part).ravel(), motion.t[-1])
    clearance = np.interp(t, motion.t, motion.clearance)
    return t, distance_at(motion, t), np.interp(t, motion.t, motion.v), clearance


def row_ends(motion: Trajectory) -> RowEnds:
    """The rows of `motion` cut open at every joint; rows of no duration (kinks) are left out."""
    lasting = np.flatnonzero(np.diff(motion.t) > 0.0)

    def both(values: Array) -> Array:
        return np.stack([values[lasting], values[lasting + 1]], axis=1).ravel()

    def constant(values: Array) -> Array:
        return np.repeat(values[lasting], 2)

    return RowEnds(
        t=both(motion.t),
        s=both(motion.arc_length),
        x=both(motion.x),
        y=both(motion.y),
        v=both(motion.v),
        a=constant(motion.a),
        curvature=constant(motion.curvature),
        clearance=both(motion.clearance),
    )


@dataclass(frozen=True, kw_only=True)
class Margin:
    """How far one limit is from being reached, along the motion; negative where it is broken."""

    key: str
    name: str
    formula: str
    unit: str
    t: Array  # (k,) [s]
    value: Array  # (k,) [unit]
    x: Array  # (k,) [m]
    y: Array  # (k,) [m]

    @property
    def worst(self) -> int:
        """Index of the least margin."""
        return int(np.argmin(self.value))


def margins(motion: Trajectory, problem: Problem) -> tuple[Margin, ...]:
    """Margins of all limits of this robot (Manor 2015, eqs. (3.13), (A.1) to (A.3)), to draw only."""
    rows, robot, braking = row_ends(motion), problem.robot, problem.braking
    lateral = np.abs(rows.lateral)
    acceleration = "m/s²"
    found = [
        (
            "braking",
            "Braking distance",
            "d − braking distance(v)",
            "m",
            rows.clearance - braking.distance(rows.v),
        ),
        ("clearance", "Clearance", "d", "m", rows.clearance),
        (
            "friction",
            "Friction circle",
            "μg − √(a² + (v²κ)²)",
            acceleration,
            robot.friction_acceleration - np.hypot(rows.a, lateral),
        ),
        ("tip", "Tip-over", "g w / 2h − v²|κ|", acceleration, robot.tip_acceleration - lateral),
        (
            "reserve",
            "Friction reserve",
            "√((μg)² − a_b²) − v²|κ|",
            acceleration,
            robot.reserved_lateral_acceleration() - lateral if problem.friction_reserve else None,
        ),
        ("steering", "Steering", "1/r_kin − |κ|", "1/m", robot.max_curvature - np.abs(rows.curvature)),
        ("drive", "Drive", "a_max − a", acceleration, robot.max_acceleration - rows.a),
        ("brakes", "Brakes", "a + a_b", acceleration, rows.a + robot.max_braking),
        (
            "speed",
            "Top speed",
            "v_max − v",
            "m/s",
            robot.max_speed - rows.v if math.isfinite(robot.max_speed) else None,
        ),
    ]
    return tuple(
        Margin(key=key, name=name, formula=formula, unit=unit, t=rows.t, value=value, x=rows.x, y=rows.y)
        for key, name, formula, unit, value in found
        if value is not None and bool(np.all(np.isfinite(value)))
    )


@dataclass(frozen=True)
class Mesh:
    """Pieces of constant curvature: the intervals on which a collocation plan bends."""

    s: Array  # (n + 1,) [m], knots along the path
    x: Array  # (n + 1,) [m]
    y: Array  # (n + 1,) [m]

    @property
    def lengths(self) -> Array:
        """(n,) [m]"""
        return np.diff(self.s)


def mesh_of(motion: Trajectory) -> Mesh:
    """Knots where the curvature of `motion` changes, and both ends."""
    s = motion.arc_length
    change = np.flatnonzero((np.diff(motion.curvature[:-1]) != 0.0) | (np.diff(s[:-1]) == 0.0)) + 1
    index = np.unique(np.concatenate([[0], change, [len(s) - 1]]))
    index = index[np.concatenate([[True], np.diff(s[index]) > 0.0])]
    return Mesh(s[index], motion.x[index], motion.y[index])


def distance_at(motion: Trajectory, t: Array) -> Array:
    """Path length [m] covered at times `t` [s] within the motion; exact."""
    i = np.clip(np.searchsorted(motion.t, t, side="right") - 1, 0, len(motion.t) - 2)
    dt = t - motion.t[i]
    return motion.arc_length[i] + (motion.v[i] + 0.5 * motion.a[i] * dt) * dt


@dataclass(frozen=True)
class Tracking:
    """The simulated run against the plan, at the times of the run. Shapes (m,)."""

    t: Array  # [s]
    lateral: Array  # [m], left of the plan positive
    along: Array  # [m], how far ahead of the plan's clock
    speed_error: Array  # [m/s], simulated minus planned speed at the same time
    plan_x: Array  # [m], nearest point of the plan
    plan_y: Array  # [m]
    plan_heading: Array  # [rad]


def tracking(plan: Trajectory, run: SimulatedRun) -> Tracking:
    """Errors of the run, measured across and along the plan near where the plan should be at that time."""
    lasting = np.concatenate([[True], np.diff(plan.arc_length) > 0.0])
    s, x, y = plan.arc_length[lasting], plan.x[lasting], plan.y[lasting]
    heading = np.unwrap(plan.heading[lasting])
    clock = np.clip(run.t, plan.t[0], plan.t[-1])
    target = distance_at(plan, clock)
    along = target.copy()
    for _ in range(4):  # Newton steps of the projection on a curve of small bend
        h = np.interp(along, s, heading)
        step = (run.x - np.interp(along, s, x)) * np.cos(h) + (run.y - np.interp(along, s, y)) * np.sin(h)
        along = np.clip(along + step, s[0], s[-1])
    h, px, py = np.interp(along, s, heading), np.interp(along, s, x), np.interp(along, s, y)
    lateral = (run.y - py) * np.cos(h) - (run.x - px) * np.sin(h)
    planned = np.interp(clock, plan.t, plan.v)
    return Tracking(run.t, lateral, along - target, run.v - planned, px, py, h)
