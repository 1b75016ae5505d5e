"""Motions as columns of numbers at instants: what the linked views draw."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verify.report.evidence import SimulatedRun
from verify.report.series import Margin, distance_at, margins
from verify.report.zone_along import HIGHEST, ZoneAlong
from vnav_drake.plan import Trajectory
from vnav_drake.problem import Problem

Array = NDArray[np.float64]

INSTANTS = 1000  # of the motion that the cursor follows
FEWER = 300  # of a motion that is drawn beside it


@dataclass(frozen=True, kw_only=True)
class DrawnMargin:
    """One limit as the views name it; `scale` is what its share is taken of, None where that changes."""

    key: str
    name: str
    unit: str
    formula: str
    scale: float | None


@dataclass(frozen=True, kw_only=True, eq=False)
class DrawnMotion:
    """Columns (n,) of one motion, in SI units, all at the instants of column t."""

    columns: Mapping[str, Array]

    @property
    def end(self) -> float:
        """[s]"""
        return float(self.columns["t"][-1])


def instants(motion: Trajectory, most: int, found: tuple[Margin, ...] = ()) -> Array:
    """Times [s]: about `most` at even steps, every kink, and those of the least of each margin."""
    even = np.linspace(motion.t[0], motion.t[-1], most)
    kinks = motion.t[:-1][np.diff(motion.t) == 0.0]
    worst = np.array([margin.t[margin.worst] for margin in found])
    return np.unique(np.concatenate([even, kinks, worst]))


def least_around(margin: Margin, t: Array) -> Array:
    """The least of a margin (n,) around each of the rising times `t` (n,): up to half way to the next ones.

    So the least of what is drawn is the least of all.
    """
    least = np.interp(t, margin.t, margin.value)
    owner = np.searchsorted(0.5 * (t[1:] + t[:-1]), margin.t)
    np.minimum.at(least, owner, margin.value)
    return least


def scales(problem: Problem) -> Mapping[str, float]:
    """The limit that each margin counts down from, by key of `series.margins`; same units."""
    robot = problem.robot
    return {
        "friction": robot.friction_acceleration,
        "tip": robot.tip_acceleration,
        "reserve": robot.reserved_lateral_acceleration() if problem.friction_reserve else 0.0,
        "steering": robot.max_curvature,
        "drive": robot.max_acceleration,
        "brakes": robot.max_braking,
        "speed": robot.max_speed,
    }


def drawn_margins(problem: Problem, found: tuple[Margin, ...]) -> list[DrawnMargin]:
    """What of each margin does not change along the motion."""
    known = scales(problem)
    return [
        DrawnMargin(
            key=margin.key, name=margin.name, unit=margin.unit, formula=margin.formula,
            scale=known.get(margin.key),
        )
        for margin in found
    ]  # fmt: skip


def margins_of(problem: Problem, motion: Trajectory, along: ZoneAlong | None) -> tuple[Margin, ...]:
    """`series.margins`; where the braking zone is no disc its distance from what is nearest leads them."""
    found = margins(motion, problem)
    if along is None:
        return found
    return (*filter(None, [along.margin()]), *(m for m in found if m.key != "braking"))


def followed(problem: Problem, motion: Trajectory, along: ZoneAlong | None) -> DrawnMotion:
    """The motion that the cursor follows, to draw.

    Columns: t, x, y, v, a, turn (v^2 kappa), nearest_x, nearest_y, safe (greatest safe speed there), bend
    (greatest speed in that bend, NaN where it is no limit in sight), `margin.KEY` of each margin and
    `share.braking`, the share of the room that braking leaves. What the cursor tells, `cursor` has.
    """
    found = margins_of(problem, motion, along)
    t = instants(motion, INSTANTS, found)
    x, y, _, v, a, curvature = motion.at(t)
    points = np.column_stack([x, y])
    clearance = problem.clearance(points)
    nearest = problem.world.nearest(points)[1]
    braking = problem.braking.distance(v)
    if along is None:
        safe, room = problem.braking.speed(clearance), clearance
    else:
        safe = np.interp(distance_at(motion, t), along.s, along.fastest)
        room = problem.braking.distance(safe)
        safe = np.where(safe < 0.999 * HIGHEST * float(along.v.max()), safe, np.nan)  # not looked at beyond
    columns = {
        "t": t, "x": x, "y": y, "v": v, "a": a, "turn": v * v * curvature, "nearest_x": nearest[:, 0],
        "nearest_y": nearest[:, 1], "safe": safe, "bend": _bend(problem, curvature, v),
    }  # fmt: skip
    return DrawnMotion(columns={**columns, **_left(found, t), "share.braking": _share(braking, room)})


def compared(problem: Problem, motion: Trajectory) -> DrawnMotion:
    """A motion drawn beside it in all views: columns t, x, y, v, a, turn, margins and `share.braking`.

    Without the braking margin where the problem's zone is no disc: such a motion was not planned for it.
    """
    found = tuple(m for m in margins(motion, problem) if problem.zone is None or m.key != "braking")
    t = instants(motion, FEWER, found)
    x, y, _, v, a, curvature = motion.at(t)
    columns = {"t": t, "x": x, "y": y, "v": v, "a": a, "turn": v * v * curvature, **_left(found, t)}
    if problem.zone is None:
        room = problem.clearance(np.column_stack([x, y]))
        columns["share.braking"] = _share(problem.braking.distance(v), room)
    return DrawnMotion(columns=columns)


def passed(motion: Trajectory) -> DrawnMotion:
    """A motion of which only path and speed are drawn: columns t, x, y, v."""
    t = instants(motion, FEWER)
    x, y, _, v, *_ = motion.at(t)
    return DrawnMotion(columns={"t": t, "x": x, "y": y, "v": v})


def recorded(run: SimulatedRun) -> DrawnMotion:
    """The simulated run in the same columns."""
    t = np.linspace(run.t[0], run.t[-1], FEWER)
    values = {name: np.interp(t, run.t, getattr(run, name)) for name in ("x", "y", "v")}
    return DrawnMotion(columns={"t": t, **values})


def _left(found: tuple[Margin, ...], t: Array) -> dict[str, Array]:
    return {f"margin.{margin.key}": least_around(margin, t) for margin in found}


def _share(braking: Array, room: Array) -> Array:
    """1 - braking / room, no less than -1; -1 where there is no room."""
    used = np.divide(braking, room, out=np.full_like(braking, 2.0), where=room > 0.0)
    return np.maximum(1.0 - used, -1.0)


def _bend(problem: Problem, curvature: Array, v: Array) -> Array:
    """Greatest speed [m/s] in each bend; NaN where it is beyond what a plot of the speeds shows."""
    bend = np.abs(curvature)
    square = np.divide(problem.lateral_limit, bend, out=np.full_like(bend, np.inf), where=bend > 0.0)
    return np.where(square < (2.0 * float(v.max())) ** 2, np.sqrt(square), np.nan)
