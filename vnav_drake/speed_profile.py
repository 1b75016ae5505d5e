"""The fastest speed along a given path that is safe at every instant, not only at samples.

The path is cut into short rows; along a row v^2 is linear in arc length. Distance to a closed set is
semiconcave, so with D_min > 0 on a row of length h and curvature kappa

    d(s) >= lerp(d_0, d_h) - (1 / D_min + |kappa|) h^2 / 8                (Derived, see `row_sag`)

and the braking condition over the whole row follows from its two ends and this one term. The
tangential and lateral limits are extreme at a row's ends exactly.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from vnav_drake.plan import Model, Path, Trajectory
from vnav_drake.problem import PlanningError, Problem
from vnav_drake.zones.rows import RowLimits, held_arc_limit, row_limits

Array = NDArray[np.float64]

SPEED_REDUCTION = 1e-6  # the whole profile is slowed by this factor, so that margins are provably >= 0
SAG_SHARE = 4e-6  # part of the clearance that a row's sag may cost, which sets the row length
LONGEST_ROW = 0.02  # [m], on paths of ordinary length
FEWEST_ROWS, MOST_ROWS = 50, 20_000  # about: very short paths need shorter rows, very long ones longer
SHORTEST_ROW = 2e-4  # [m]
KINK_TOLERANCE = 1e-9  # [rad]: a smaller jump of the heading is rounding
ROUNDING = 1e-12  # [m], far below what the slow-down of the whole profile gives back
REPAIR_ROUNDS = 20  # of the reaction-time term; two are usual
STRAIGHT = 1e9  # [m], a stopping distance beyond any


def fastest_profile(
    problem: Problem,
    path: Path,
    *,
    model: Model,
    ends: Literal["safe", "problem"] | None = None,
    at_most: Array | None = None,
) -> Trajectory:
    """The fastest motion along `path`.

    Parameters
    ----------
    model : "variational": braking distance and greatest speed alone. "full": also the friction
        circle, tip-over, the friction reserve and the drive limits.
    ends : "safe" ignores the end speeds that the problem asks for (the default of the variational
        model, as Manor 2015, ch. 3 assumes), "problem" obeys them. In the variational model they
        are met by ramps at the drive limits from start and goal alone.
    at_most : (n,) [m/s], positive: a speed that each piece of the path is held to besides.

    Raises
    ------
    PlanningError : the path comes too close to an obstacle, or kinks where the robot must move.

    Notes
    -----
    Two passes are optimal: at each place the reachable v^2 form an interval that begins at a
    value from which slower is always possible, as in Pham and Pham 2018 (TOPP-RA), sec. III.
    """
    if ends is None:
        ends = "safe" if model == "variational" else "problem"
    if model == "full" and np.any(np.abs(path.kinks) > KINK_TOLERANCE):
        raise PlanningError("the path has a kink, which a wheeled robot cannot follow without stopping")
    rows = _rows(problem, path)
    points = np.column_stack([rows.x, rows.y])
    distance = problem.world.distance(points)
    clearance = distance - problem.robot.radius
    sag = row_sag(distance, rows.piece_length, rows.curvature)
    held = np.inf if at_most is None else _held(rows, path, at_most)
    if problem.zone is None:
        limits: RowLimits = _DiscRows(problem, clearance, sag)
        needed = _at_nodes(sag)
    else:
        limits = row_limits(problem, problem.zone, rows)
        needed = np.zeros(len(clearance))
    for _ in range(REPAIR_ROUNDS):
        limit = np.square(np.minimum(limits.speed(needed), held))
        square = _speed_squares(problem, rows, limit, model, ends)
        excess = limits.lacking(square)
        if np.all(excess <= ROUNDING):
            break
        needed = needed + 1.5 * _at_nodes(np.maximum(excess, 0.0))
    else:
        worst = int(np.argmax(excess))
        raise PlanningError(
            f"no speed profile keeps the braking zone free between the rows of the path: at "
            f"({rows.x[worst]:.3f}, {rows.y[worst]:.3f}) m it lacks {excess[worst]:.2e} m"
        )
    stuck = np.flatnonzero((square[1:] == 0.0) & (square[:-1] == 0.0))  # never both ends: FEWEST_ROWS
    if len(stuck) > 0:
        x, y = points[stuck[0]]
        raise PlanningError(f"no safe speed at ({x:.3f}, {y:.3f}) m, clearance {clearance[stuck[0]]:.2e} m")
    return _trajectory(rows, np.sqrt(square) * (1.0 - SPEED_REDUCTION), clearance)


def row_sag(distance: Array, length: Array, curvature: Array) -> Array:
    """How far [m] the clearance can fall below its chord along each row; zero where it cannot.

    Parameters
    ----------
    distance : (n + 1,) [m], to the nearest obstacle, at the ends of the rows.
    length, curvature : (n,) [m], [1/m] of the rows.

    Returns
    -------
    (n,) [m]; infinite where the row could touch an obstacle.

    Notes
    -----
    Derived: along the row the distance r to any one point p of the obstacles has
    `r'' = (1 - r'^2)/r + (curvature term) <= 1/r + |kappa|`, so r lies above its chord less
    `(1/D_min + |kappa|) h^2/8`. The distance is the least of the r, and the chord of the least lies
    below each chord. D_min is bounded by the 1-Lipschitz property from both ends.
    """
    least = 0.5 * (distance[1:] + distance[:-1] - length)
    safe = least > 0.0
    bend = 1.0 / np.where(safe, least, 1.0) + np.abs(curvature)
    return np.where(safe, bend * length**2 / 8.0, math.inf)


def _rows(problem: Problem, path: Path) -> Path:
    """The path in rows short enough that the sag costs no more than SAG_SHARE of the clearance."""
    longest = min(max(LONGEST_ROW, path.length / MOST_ROWS), path.length / FEWEST_ROWS)
    shortest = min(SHORTEST_ROW, longest)
    coarse = path.subdivided(_counts(path.piece_length, 2.5 * longest))
    distance = problem.world.distance(np.column_stack([coarse.x, coarse.y]))
    least = np.maximum(0.5 * (distance[1:] + distance[:-1] - coarse.piece_length), shortest)
    room = np.maximum(least - problem.robot.radius - problem.braking.margin, shortest)
    bend = 1.0 / least + np.abs(coarse.curvature)
    row = np.clip(np.sqrt(8.0 * SAG_SHARE * room / bend), shortest, longest)
    return coarse.subdivided(_counts(coarse.piece_length, row))


def _counts(length: Array, longest: Array | float) -> NDArray[np.int64]:
    return np.maximum(1, np.ceil(length / longest)).astype(np.int64)


def _at_nodes(row_value: Array) -> Array:
    """The greater of the values of the two rows that meet at each node."""
    padded = np.concatenate([[0.0], row_value, [0.0]])
    return np.maximum(padded[1:], padded[:-1])


def _held(rows: Path, path: Path, at_most: Array) -> Array:
    """The lesser of what the two rows at each node are held to, (n + 1,) [m/s]."""
    middle = np.cumsum(rows.piece_length) - 0.5 * rows.piece_length
    piece = np.searchsorted(np.cumsum(path.piece_length)[:-1], middle)
    row = np.concatenate([[np.inf], at_most[piece], [np.inf]])
    return np.minimum(row[1:], row[:-1])


def _speed_squares(problem: Problem, rows: Path, limit: Array, model: Model, ends: str) -> Array:
    """Greatest v^2 [m^2/s^2] at each node, (n + 1,), where `limit` is that of braking."""
    limit = limit.copy()
    if ends == "problem":
        for end, node in ((problem.start, 0), (problem.goal, -1)):
            if end.fixed_speed is not None:
                limit[node] = min(limit[node], (end.fixed_speed / (1.0 - SPEED_REDUCTION)) ** 2)
    if model == "full":
        bend = _at_nodes(np.abs(rows.curvature))
        bound = np.full_like(limit, math.inf)
        np.divide(problem.lateral_limit, bend, out=bound, where=bend > 0.0)
        square = _two_passes(problem, rows, np.minimum(np.minimum(limit, bound), _held_arcs(problem, bend)))
        _require_end_speeds(problem, square)
        return square
    if ends == "problem":
        s = np.concatenate([[0.0], np.cumsum(rows.piece_length)])
        limit = np.minimum(limit, limit[0] + 2.0 * problem.robot.max_acceleration * s)
        limit = np.minimum(limit, limit[-1] + 2.0 * problem.robot.max_braking * (s[-1] - s))
    return limit


def _require_end_speeds(problem: Problem, square: Array) -> None:
    for name, end, reached in (("start", problem.start, square[0]), ("goal", problem.goal, square[-1])):
        wanted = end.fixed_speed
        if wanted is not None and math.sqrt(reached) < wanted:
            raise PlanningError(
                f"{name} at {wanted:g} m/s cannot be met on this path: at most {math.sqrt(reached):.6g} m/s"
            )


def _two_passes(problem: Problem, rows: Path, limit: Array) -> Array:
    """Limits of braking (backward), then of acceleration (forward)."""
    robot = problem.robot
    square = limit.tolist()
    steps, bends = rows.piece_length.tolist(), rows.curvature.tolist()
    grip = robot.friction_acceleration
    for i in range(len(steps) - 1, -1, -1):
        square[i] = min(square[i], _reachable(square[i + 1], steps[i], bends[i], robot.max_braking, grip))
    for i in range(len(steps)):
        square[i + 1] = min(
            square[i + 1], _reachable(square[i], steps[i], bends[i], robot.max_acceleration, grip)
        )
    return np.array(square)


def _reachable(square: float, step: float, bend: float, drive: float, grip: float) -> float:
    """Greatest v^2 at the faster end of a row whose slower end has v^2 = `square`.

    With w the result: (w - square)/(2 h) <= drive, and at the faster end, where the friction circle
    is tightest, ((w - square)/(2 h))^2 + (kappa w)^2 <= grip^2.
    """
    w = square + 2.0 * step * drive
    if drive * drive + (bend * w) ** 2 <= grip * grip:
        return w
    turn = (2.0 * step * bend) ** 2
    root = (2.0 * step * grip) ** 2 * (1.0 + turn) - turn * square * square
    return (square + math.sqrt(max(root, 0.0))) / (1.0 + turn)


def _held_arcs(problem: Problem, bend: Array) -> Array:
    """Greatest v^2 (n,) at which the held arc of curvature `bend` stays in the zone, with the reserve."""
    limit, law = held_arc_limit(problem), problem.braking
    if limit is None:
        return np.full_like(bend, math.inf)
    return np.asarray(np.square(law.speed(np.minimum(limit.stopping_distance(bend), STRAIGHT) + law.margin)))


@dataclass(frozen=True)
class _DiscRows:
    """Rows under uniform braking."""

    problem: Problem
    clearance: Array  # (n + 1,) [m]
    sag: Array  # (n,) [m]

    def speed(self, needed: Array) -> Array:
        return self.problem.braking.speed(self.clearance - needed)

    def lacking(self, square: Array) -> Array:
        """The reaction time: v t_r bulges above its chord, as v^2 is linear.

        The square root lies above its chord by at most (v_1 - v_0)^2 / (4 (v_0 + v_1)).
        """
        law = self.problem.braking
        v = np.sqrt(square)
        spare = self.clearance - law.distance(v)
        total = v[1:] + v[:-1]
        bulge = np.diff(v) ** 2 / (4.0 * np.where(total > 0.0, total, 1.0))
        # spare is itself a chord; both ends have it, so the lesser bounds the row
        lacking = law.reaction_time * bulge + self.sag - np.minimum(spare[1:], spare[:-1])
        return np.where(law.reaction_time * bulge > 0.0, lacking, 0.0)


def _trajectory(rows: Path, v: Array, clearance: Array) -> Trajectory:
    dt = 2.0 * rows.piece_length / (v[1:] + v[:-1])
    a = np.diff(np.square(v)) / (2.0 * rows.piece_length)
    t = np.concatenate([[0.0], np.cumsum(dt)])
    table = np.column_stack(
        [t, rows.x, rows.y, np.append(rows.heading, rows.end_heading[-1]), v]
        + [np.append(column, column[-1]) for column in (a, rows.curvature)]
        + [clearance]
    )
    kink = np.flatnonzero(np.abs(rows.kinks) > KINK_TOLERANCE)
    arrive = table[kink + 1].copy()  # the same instant, before the turn
    arrive[:, 3] = rows.end_heading[kink]
    arrive[:, 5:7] = table[kink, 5:7]
    return Trajectory(*np.insert(table, kink + 1, arrive, axis=0).T)
