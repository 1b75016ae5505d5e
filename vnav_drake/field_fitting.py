"""Which speeds should a few switched fields have, so that a route loses little time, and what does it lose?

Along a route the base zone allows a speed V(s). Fields of the speeds c_1 < c_2 < ... allow the greatest c
that is not above V(s), as zones are nested in speed. Where that is below the planned speed v(s), the way ds
takes ds (1/c - 1/v) longer. The speeds that make the sum least follow by dynamic programming over speeds that
V(s) takes: raising a c to the next of them changes no field of any place and loses less. Ramps between the
cases are not in the sum; `drive_fields` gives the true motion, with them and all limits of the robot.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vnav_drake.plan import Path, Trajectory
from vnav_drake.problem import PlanningError, Problem
from vnav_drake.speed_profile import SPEED_REDUCTION, fastest_profile
from vnav_drake.zones.convex_zone import ConvexZone
from vnav_drake.zones.field_set import FieldSet
from vnav_drake.zones.rows import GaugeRows, SteppedRows, row_limits
from vnav_drake.zones.shapes import DiscZone

Array = NDArray[np.float64]
Cases = NDArray[np.intp]

CANDIDATES = 400  # speeds among which the cases choose, at most
KNOTS = 1200  # places among which switches choose besides those where another field becomes free
SWITCH = 1e-9  # [s]: of schedules that lose the same, the one with fewer switches
ROUNDING = 1e-12  # share of a speed


@dataclass(frozen=True, kw_only=True)
class FieldRun:
    """A motion under a field set and which field is watched along it."""

    field_set: FieldSet
    trajectory: Trajectory
    case: Cases  # (m,) from 0, of each row of the motion until the next
    dwell: float = 0.0  # [s] asked for between two switches; 0: the speed alone chooses the field

    @property
    def switches(self) -> Cases:
        """Rows with which another field begins; (k,), the first row is none."""
        return np.flatnonzero(np.diff(self.case)) + 1


def base_zone(problem: Problem) -> ConvexZone:
    """The zone whose fields are fitted: the problem's, or the disc of uniform braking."""
    if isinstance(problem.zone, FieldSet):
        return problem.zone.base
    return problem.zone or DiscZone(law=problem.braking, radius=problem.robot.radius)


def with_base(problem: Problem) -> Problem:
    """The problem with the base zone in place of a field set."""
    if not isinstance(problem.zone, FieldSet):
        return problem
    base = problem.zone.base
    return replace(problem, zone=None if isinstance(base, DiscZone) else base)


def with_fields(problem: Problem, field_set: FieldSet) -> Problem:
    """The problem whose zone is the field set; no faster than its last field allows."""
    return replace(problem, zone=field_set, braking=field_set.law)


def fit_fields(problem: Problem, trajectory: Trajectory, count: int) -> FieldSet:
    """Fields of the base zone's shape whose speeds cost a planned motion the least time.

    Parameters
    ----------
    problem : its zone is that of the fields, at other speeds.
    trajectory : the planned motion, without kinks.
    count : of fields, at most; fewer where the route takes fewer speeds.

    Raises
    ------
    PlanningError : the base zone is not free along the path.
    ValueError : a count below one.
    """
    if count < 1:
        raise ValueError(f"count = {count!r}: must be one or more")
    allowed, planned, length = _speeds_along(problem, trajectory)
    speeds = best_speeds(allowed, planned, length, count)
    base = base_zone(problem)
    return FieldSet(law=problem.braking, radius=base.radius, base=base, max_speeds=tuple(speeds.tolist()))


def best_speeds(allowed: Array, planned: Array, length: Array, count: int) -> Array:
    """Speeds of `count` cases that cost the least time, rising; fewer where fewer do as well.

    Parameters
    ----------
    allowed, planned : (n,) [m/s], positive: greatest and planned speed of each piece of the route.
    length : (n,) [m]

    Notes
    -----
    With pieces sorted by the speed allowed, a case serves a run of them, and the cost of the cases from some
    speed upwards does not depend on those below: `least[i]`, for case speeds whose lowest is candidate i.
    """
    order = np.argsort(allowed, kind="stable")
    allowed, planned, length = allowed[order], planned[order], length[order]
    candidates = _candidates(allowed, planned, length)
    slower = np.maximum(1.0 / candidates[:, None] - 1.0 / planned, 0.0) * length
    lost = np.concatenate([np.zeros((len(candidates), 1)), np.cumsum(slower, axis=1)], axis=1)
    begin = np.searchsorted(allowed, candidates, side="left")
    # between[i, j]: pieces that allow candidate i but not j go at candidate i
    between = lost[:, begin] - np.take_along_axis(lost, begin[:, None], axis=1)
    later = np.arange(len(candidates))
    between[later[:, None] >= later] = math.inf
    least = lost[:, -1] - lost[later, begin]
    following = []
    for _ in range(count - 1):
        choice = between + least
        then = np.argmin(choice, axis=1)
        better = choice[later, then] < least
        following.append(np.where(better, then, -1))
        least = np.where(better, choice[later, then], least)
    chosen = [0]
    for then in reversed(following):
        if then[chosen[-1]] >= 0:  # else fewer cases do as well
            chosen.append(int(then[chosen[-1]]))
    return candidates[chosen]


def _candidates(allowed: Array, planned: Array, length: Array) -> Array:
    """Speeds that cases may have, rising: the least allowed first, others evenly over the time planned."""
    share = np.cumsum(length / planned)
    at = np.searchsorted(share, np.linspace(0.0, share[-1], CANDIDATES))
    useful = np.minimum(allowed[np.minimum(at, len(allowed) - 1)], planned.max())
    return np.unique(np.concatenate([[min(allowed[0], planned.max())], useful]))


def drive_fields(
    problem: Problem, trajectory: Trajectory, field_set: FieldSet, *, dwell: float = 0.0
) -> FieldRun:
    """The fastest motion of the full robot along a planned path under a field set.

    Parameters
    ----------
    trajectory : the planned motion, in rows as short as `fastest_profile` makes them.
    dwell : [s], positive: the field is chosen by the place instead of by the speed alone, so that
        none is watched for less than this (but for the first, and the last, where the route ends).

    Raises
    ------
    PlanningError : the least field is not free somewhere.
    """
    rows, free = free_cases(problem, trajectory, field_set)
    speeds = np.asarray(field_set.max_speeds)
    own = with_base(problem) if field_set.polygons is None else with_fields(problem, field_set)
    motion = fastest_profile(own, rows, model="full", at_most=speeds[free])
    if dwell <= 0.0:
        faster = np.maximum(motion.v[:-1], motion.v[1:])
        case = field_set.case(np.append(faster, motion.v[-1]))
        return FieldRun(field_set=field_set, trajectory=motion, case=case)
    held = _schedule(rows, free, motion, speeds, dwell)
    motion = fastest_profile(own, rows, model="full", at_most=speeds[held])
    s = motion.arc_length
    middle = np.append(0.5 * (s[1:] + s[:-1]), s[-1])
    case = held[np.searchsorted(np.cumsum(rows.piece_length)[:-1], middle)]
    return FieldRun(field_set=field_set, trajectory=motion, case=case, dwell=dwell)


def free_cases(problem: Problem, trajectory: Trajectory, field_set: FieldSet) -> tuple[Path, Cases]:
    """The path in short rows, and which is the largest field that is free all along each, (n,) from 0.

    Fields of the base's shape are free where the base zone is at their speeds, so its own continuous limits
    serve; fields of their own shape are tried.

    Raises
    ------
    PlanningError : not even the least field is free somewhere.
    """
    own = with_base(problem) if field_set.polygons is None else with_fields(problem, field_set)
    rows, allowed = steady_limits(own, trajectory)
    least = field_set.max_speeds[0]
    free = np.searchsorted(np.asarray(field_set.max_speeds), allowed * (1.0 + ROUNDING), side="right") - 1
    blocked = np.flatnonzero(free < 0)
    if len(blocked) > 0:
        i = blocked[0]
        raise PlanningError(
            f"the least field, of {least:.4g} m/s, is not free at ({rows.x[i]:.3f}, {rows.y[i]:.3f}) m, "
            f"where at most {allowed[i]:.4g} m/s are safe"
        )
    return rows, free


def steady_limits(problem: Problem, trajectory: Trajectory) -> tuple[Path, Array]:
    """The path in short rows, and a speed (n,) [m/s] with which the zone is free all along each.

    At a steady speed nothing but the turn of the zone lies between the ends of a row (see `zones.rows`): with
    the room n.p - h_body and the shape h_E at either end it is free for stopping distances D with

        D h_E + (|kappa| + kappa^2 (R_body + R D)) l^2 / 8 <= n.p - h_body.
    """
    rows, zone = path_along(trajectory), problem.zone
    if zone is None:
        motion = fastest_profile(problem, rows, model="variational", ends="safe")
        rows = path_along(motion)
        moving = np.diff(motion.arc_length) > 0.0
        slower = np.minimum(motion.v[1:], motion.v[:-1])[moving]
        return rows, slower / (1.0 - SPEED_REDUCTION)
    limits = row_limits(problem, zone, rows)
    if isinstance(limits, SteppedRows):
        return rows, limits.row_speed
    if not isinstance(limits, GaugeRows):
        raise TypeError(f"rows of {type(limits).__name__} have no steady speed")
    bend, short = np.abs(limits.curvature), limits.length**2 / 8.0
    sag = ((bend + bend**2 * limits.body) * short)[limits.row]
    shape = limits.shape + (bend**2 * limits.zone.extent * short)[limits.row, None]
    spare = limits.free - sag[:, None]
    with np.errstate(divide="ignore"):
        far = np.where(shape > 0.0, spare / np.where(shape > 0.0, shape, 1.0), math.inf)
    room = np.full(len(rows.piece_length), limits.furthest)
    np.minimum.at(room, limits.row, np.where(spare > 0.0, far, 0.0).min(axis=1))
    law = limits.zone.law
    return rows, law.speed(room + law.margin)


def path_along(trajectory: Trajectory) -> Path:
    """The arcs of a motion, one a row; rows without length are left out."""
    length = np.diff(trajectory.arc_length)
    row = np.flatnonzero(length > 0.0)
    return Path(
        np.append(trajectory.x[row], trajectory.x[-1]),
        np.append(trajectory.y[row], trajectory.y[-1]),
        trajectory.heading[row],
        trajectory.curvature[row],
        length[row],
    )


def _speeds_along(problem: Problem, trajectory: Trajectory) -> tuple[Array, Array, Array]:
    """Allowed and planned speed [m/s] and length [m] of short pieces of the route, (n,) each."""
    rows, allowed = steady_limits(with_base(problem), trajectory)
    ends = np.concatenate([[0.0], np.cumsum(rows.piece_length)])
    # v^2 is linear along each row of the plan
    planned = np.sqrt(np.interp(ends, trajectory.arc_length, np.square(trajectory.v)))
    return allowed, 0.5 * (planned[1:] + planned[:-1]), rows.piece_length


def _schedule(rows: Path, free: Cases, motion: Trajectory, speeds: Array, dwell: float) -> Cases:
    """Which field to watch on each piece, (n,), none for less than `dwell` [s], so that little time is lost.

    Notes
    -----
    Dynamic programming over the places of the switches. From one to the next a single field is watched, at
    best the largest that is free all along. Times are those of `motion`, which is no slower anywhere than the
    motion with the schedule, so no stay gets shorter. The ramps are again not in the sum.
    """
    ends = np.concatenate([[0.0], np.cumsum(rows.piece_length)])
    time = np.interp(ends, motion.arc_length, motion.t)
    last = np.clip(np.searchsorted(time, np.linspace(0.0, time[-1], KNOTS)), 0, len(ends) - 1)
    switchable = np.flatnonzero(np.diff(free)) + 1
    knot = np.unique(np.concatenate([[0], last, switchable, [len(ends) - 1]]))
    pieces = np.diff(time)
    at = rows.piece_length[:, None]
    lost = np.maximum(at / speeds - pieces[:, None], 0.0)  # (n, cases)
    total = np.concatenate([np.zeros((1, len(speeds))), np.cumsum(lost, axis=0)])[knot]
    ceiling = np.minimum.reduceat(free, knot[:-1])
    when, n = time[knot], len(knot)
    best, previous, watched = np.full(n, math.inf), np.zeros(n, dtype=int), np.zeros(n, dtype=int)
    best[0] = 0.0
    for j in range(1, n):
        first = np.arange(j)
        field = np.minimum.accumulate(ceiling[:j][::-1])[::-1]  # of a stay from knot i to knot j
        cost = best[:j] + total[j, field] - total[first, field] + SWITCH
        short = when[j] - when[:j] < dwell
        cost = np.where(short & (first > 0) & (j < n - 1), math.inf, cost)
        previous[j] = int(np.argmin(cost))
        best[j], watched[j] = cost[previous[j]], field[previous[j]]
    held = np.empty(len(free), dtype=np.intp)
    j = n - 1
    while j > 0:
        held[knot[previous[j]] : knot[j]] = watched[j]
        j = previous[j]
    return held
