"""From a route along Voronoi arcs to a motion (Manor 2015, sec. 2.6).

The corners at nodes are replaced by arcs of radius r_min(v) tangent to the arcs that meet there, v the
greatest speed that the profile has on the arc; the arc moves the path, the path the speed, so both are
iterated. Where such an arc does not fit a smaller one is taken, and the robot is slower there; where that is
smaller than the wheels can turn the stretch is driven around by circles of their least radius (`steering`).
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vnav_drake.plan import Path, Trajectory
from vnav_drake.problem import PlanningError, Problem
from vnav_drake.speed_profile import fastest_profile
from vnav_drake.vc_method.profile import ArcProfile, arc_minimum_time, arc_profile
from vnav_drake.vc_method.road import Road
from vnav_drake.vc_method.smoothing import (
    Corners,
    Rounding,
    corners_of,
    kinks_only,
    round_corners,
    smallest_radius,
    smooth_path,
)
from vnav_drake.vc_method.steering import EASE, widened
from vnav_drake.voronoi import Curves

__all__ = ["ArcProfile", "Realisation", "arc_minimum_time", "arc_profile", "realise"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]

ROUNDS = 30  # of radius and speed; each halves what is left, about
CONSISTENT = 1e-3  # relative: a radius this near to r_min(v) is r_min(v)
SPACING = 0.02  # [m], of the samples from which the speed at a corner is taken
_CURVATURE_ROUNDING = 1e-9  # relative
_HEADING_ROUNDING = 1e-6  # [rad]


@dataclass(frozen=True)
class Realisation:
    """A smooth path along a route, the fastest motion on it, and what of the robot it cannot meet."""

    path: Path
    trajectory: Trajectory
    point: Array  # (n, 2) [m], middle of what rounds each corner, in order of travel
    turn: Array  # (n,) [rad], left positive
    radius: Array  # (n,) [m]
    wanted: Array  # (n,) [m], r_min of the speed that braking and drive allow there
    speed: Array  # (n,) [m/s], greatest on the arc
    consistent: bool  # every arc that fits has the radius r_min(v) of its greatest speed
    arc_time: float  # [s], along the arcs themselves with corners and all
    shortfalls: tuple[str, ...]  # what cannot be met, and where


def realise(problem: Problem, curves: Curves) -> Realisation:
    """Smooth a route and drive it as fast as the robot can.

    Parameters
    ----------
    curves : from start to goal, end to end in the direction of travel, at distance >= radius + margin.

    Raises
    ------
    PlanningError : no motion along the route exists: no curve, or no safe speed somewhere.
    """
    road = Road.of(curves)
    if len(road.curves) == 0:
        raise PlanningError("the route has no length: there is nothing to drive along")
    rounding, wanted, consistent = _consistent_rounding(problem, road)
    path, owner, replaced = widened(problem, *smooth_path(problem, rounding))
    trajectory, unmet = _profile(problem, path)
    kept = np.zeros(len(rounding.corners), dtype=bool)
    kept[owner[owner >= 0]] = True
    shown = np.flatnonzero(kept & ~rounding.corners.gentle)
    middle = _middles(path, owner, shown)
    speed = _speeds(path, owner, trajectory, shown)
    radius, turn = rounding.arcs.radius.copy(), rounding.arcs.turn.copy()
    radius[owner[replaced]] = EASE / problem.robot.max_curvature
    turn[owner[replaced]] = 0.0
    np.add.at(turn, owner[replaced], (path.curvature * path.piece_length)[replaced])
    time = arc_minimum_time(
        road.curves,
        np.zeros(len(road.curves), dtype=np.int64),
        problem.braking,
        problem.robot,
        start_speed=np.inf if problem.start.fixed_speed is None else problem.start.fixed_speed,
        end_speed=np.inf if problem.goal.fixed_speed is None else problem.goal.fixed_speed,
    )
    return Realisation(
        path,
        trajectory,
        middle,
        turn[shown],
        radius[shown],
        wanted[shown],
        speed,
        consistent,
        float(time[0]),
        (*unmet, *_steering(problem, path), *_rate(problem, path, trajectory), *_headings(problem, path)),
    )


def _consistent_rounding(problem: Problem, road: Road) -> tuple[Rounding, Array, bool]:
    """Radii r_min(v) of speeds v on the arcs that they make."""
    corners = corners_of(problem, road)
    radius = _first_radius(problem, road, corners)
    consistent, last = False, None
    for _ in range(ROUNDS):
        rounding = last = round_corners(problem, road, corners, radius, last)
        failed = ~rounding.arcs.fits & ~corners.gentle
        if np.any(failed):
            fewer = kinks_only(road, corners, failed)
            if len(fewer) == len(corners) and np.array_equal(fewer.stretch, corners.stretch):
                at = road.at(corners.stretch[failed, 0], after=False)[0][0]
                raise PlanningError(f"no arc of any radius rounds the corner at ({at[0]:.3f}, {at[1]:.3f}) m")
            corners, last = fewer, None
            radius = _first_radius(problem, road, corners)
            continue
        short = rounding.arcs.radius < radius * (1.0 - CONSISTENT)
        target = smallest_radius(problem, _free_speeds(problem, rounding, short))
        found = rounding.arcs.radius
        large = found > radius * (1.0 + CONSISTENT)
        settled = large | (target >= found * (1.0 - CONSISTENT))
        settled &= short | (target <= found * (1.0 + CONSISTENT))
        settled |= corners.gentle
        if np.all(settled):
            consistent = True
            break
        radius = np.where(settled, radius, np.sqrt(found * np.minimum(target, 1e6)))
    return rounding, radius, consistent


def _first_radius(problem: Problem, road: Road, corners: Corners) -> Array:
    ends = [road.at(corners.stretch[:, k], after=False)[0] for k in (0, 1)]
    speed = np.maximum(*(problem.safe_speed(end) for end in ends))
    return np.minimum(smallest_radius(problem, speed), 1e6)


def _free_speeds(problem: Problem, rounding: Rounding, short: Mask) -> Array:
    """Greatest speed (n,) [m/s] on each arc by braking and drive; turning counts at `short` arcs alone.

    On samples: two running minima are the forward and the backward pass.
    """
    path, owner = smooth_path(problem, rounding)
    count = np.maximum(1, np.ceil(path.piece_length / SPACING)).astype(np.int64)
    fine = path.subdivided(count)
    corner = np.repeat(owner, count)
    square = np.square(problem.safe_speed(np.column_stack([fine.x, fine.y])))
    held = corner >= 0
    held[held] = short[corner[held]]
    turning = np.full(len(square), np.inf)
    cap = problem.lateral_limit / np.abs(fine.curvature[held])
    np.minimum.at(turning, np.flatnonzero(held), cap)
    np.minimum.at(turning, np.flatnonzero(held) + 1, cap)
    square = np.minimum(square, turning)
    for node, end in ((0, problem.start), (-1, problem.goal)):
        if end.fixed_speed is not None:
            square[node] = min(square[node], end.fixed_speed**2)
    s = np.concatenate([[0.0], np.cumsum(fine.piece_length)])
    up, down = 2.0 * problem.robot.max_acceleration, 2.0 * problem.robot.max_braking
    square = np.minimum.accumulate(square - up * s) + up * s
    square = np.minimum.accumulate((square + down * s)[::-1])[::-1] - down * s
    greatest = np.zeros(len(rounding.corners))
    on = np.flatnonzero(corner >= 0)
    np.maximum.at(greatest, corner[on], np.maximum(square[on], square[on + 1]))
    return np.sqrt(np.maximum(greatest, 0.0))


def _profile(problem: Problem, path: Path) -> tuple[Trajectory, list[str]]:
    """The fastest motion; an end speed that no motion on this path has gives way, and is told."""
    safe = {
        name: dataclasses.replace(end, speed="safe")
        for name, end in (("start", problem.start), ("goal", problem.goal))
    }
    held = _wheels_in_time(problem, path)
    kept: list[str] = []
    freed: dict[str, object] = {}
    while True:
        try:
            asked = dataclasses.replace(problem, **freed)  # type: ignore[arg-type]
            return fastest_profile(asked, path, model="full", at_most=held), kept
        except PlanningError as error:
            name = next((n for n in safe if str(error).startswith(f"{n} at ") and n not in freed), None)
            if name is None:
                raise
            kept.append(str(error))
            freed[name] = safe[name]


def _wheels_in_time(problem: Problem, path: Path) -> Array | None:
    """Greatest speeds (n,) [m/s] on the pieces that leave the wheels their time; None where they need none.

    Derived: curvature is constant in pieces, and a jump stands for a steady turn of the wheels that may last
    as long as the shorter of the pieces that meet there. A stretch of length L and equal curvature takes
    L/v at least, so at v <= L rate/omega the jumps at both ends of at most omega have their time.
    """
    rate = problem.robot.max_steering_rate
    if not np.isfinite(rate) or len(path.curvature) < 2:
        return None
    first = np.concatenate([[0], np.flatnonzero(np.diff(path.curvature) != 0.0) + 1])
    length = np.add.reduceat(path.piece_length, first)
    bend = np.clip(path.curvature[first], -problem.robot.max_curvature, problem.robot.max_curvature)
    jump = np.abs(np.diff([problem.robot.steering_angle(float(k)) for k in bend]))
    turn = np.maximum(np.append(jump, 0.0), np.append(0.0, jump))
    with np.errstate(divide="ignore"):
        speed = length * rate / turn
    return np.repeat(speed, np.diff(np.append(first, len(path.curvature))))


def _middles(path: Path, owner: Indices, shown: Indices) -> Array:
    begin = np.concatenate([[0.0], np.cumsum(path.piece_length)])
    first, last = np.searchsorted(_order(owner), shown), np.searchsorted(_order(owner), shown, side="right")
    x, y, _, _ = path.at(0.5 * (begin[first] + begin[last]))
    return np.column_stack([x, y])


def _order(owner: Indices) -> Indices:
    """Owners with pieces of road counted to the corner before, half a step on, so that they ascend."""
    return np.where(owner >= 0, owner, np.maximum.accumulate(owner) + 0.5)


def _speeds(path: Path, owner: Indices, trajectory: Trajectory, shown: Indices) -> Array:
    """Greatest speed (k,) [m/s] of the motion on the arc of each corner."""
    begin = np.concatenate([[0.0], np.cumsum(path.piece_length)])
    middle = 0.5 * (trajectory.arc_length[1:] + trajectory.arc_length[:-1])
    piece = np.clip(np.searchsorted(begin, middle, side="right") - 1, 0, len(owner) - 1)
    greatest = np.zeros(int(owner.max(initial=-1)) + 1)
    on = np.flatnonzero((owner[piece] >= 0) & (path.curvature[piece] != 0.0))
    np.maximum.at(greatest, owner[piece[on]], np.maximum(trajectory.v[on], trajectory.v[on + 1]))
    return greatest[shown]


def _steering(problem: Problem, path: Path) -> list[str]:
    """Stretches that bend more than the wheels can, each once at its tightest."""
    bend = np.abs(path.curvature)
    tight = bend > problem.robot.max_curvature * (1.0 + _CURVATURE_ROUNDING)
    first = np.flatnonzero(tight & ~np.concatenate([[False], tight[:-1]]))
    out = []
    for i in first:
        stop = int(np.argmin(np.append(tight[i:], False))) + i
        k = i + int(np.argmax(bend[i:stop]))
        out.append(
            f"steering: radius {1.0 / bend[k]:.4g} m at ({path.x[k]:.3f}, {path.y[k]:.3f}) m, "
            f"the wheels turn no tighter than {1.0 / problem.robot.max_curvature:.4g} m"
        )
    return out


def _rate(problem: Problem, path: Path, trajectory: Trajectory) -> list[str]:
    """The jump of the wheels that takes longest beside the time there is, if more than there is."""
    rate = problem.robot.max_steering_rate
    if not np.isfinite(rate) or len(path.curvature) < 2:
        return []
    begin = np.concatenate([[0.0], np.cumsum(path.piece_length)])
    time = np.diff(np.interp(begin, trajectory.arc_length, trajectory.t))
    bend = np.clip(path.curvature, -problem.robot.max_curvature, problem.robot.max_curvature)
    jump = np.abs(np.diff([problem.robot.steering_angle(float(k)) for k in bend]))
    lacking = jump - rate * np.minimum(time[1:], time[:-1])
    k = int(np.argmax(lacking))
    if lacking[k] <= 0.0:
        return []
    where = f"({path.x[k + 1]:.3f}, {path.y[k + 1]:.3f}) m"
    return [f"steering rate: the wheels jump by {jump[k]:.3g} rad at {where}, faster than {rate:g} rad/s"]


def _headings(problem: Problem, path: Path) -> list[str]:
    out = []
    for name, end, heading in (
        ("start", problem.start, path.heading[0]),
        ("goal", problem.goal, path.end_heading[-1]),
    ):
        if end.heading is not None:
            off = (heading - end.heading + np.pi) % (2.0 * np.pi) - np.pi
            if abs(off) > _HEADING_ROUNDING:
                out.append(
                    f"{name} heading: {end.heading:.4g} rad is asked for at ({end.position[0]:.3f}, "
                    f"{end.position[1]:.3f}) m, the route has {heading:.4g} rad"
                )
    return out
