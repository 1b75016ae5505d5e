"""Does the file describe one continuous motion, and is its travel time the time that motion takes?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verify.judge.finding import Check, Place, finding
from verify.judge.geometry import Surroundings
from verify.judge.motion import Motion

Array = NDArray[np.float64]

SUM_TOLERANCE = 1e-8  # [m], [m/s], [rad], of all rows together: a motion of 6000 rows has 1e-11
ROUNDINGS = 4.0  # units of rounding in each row's numbers: motions have up to 1
MOST_HEADING = 100.0  # [rad], at the start, as scenario files allow
CLOCK_TOLERANCE = 1e-9  # [s], the first row's time
CLEARANCE_TOLERANCE = 1e-6  # [m]: far above rounding at 100 m, far below any real gap
CIRCLE_WIDENING = 6e-4  # relative: planners see a circle as a polygon around it, at most this much wider

_EPSILON = float(np.finfo(np.float64).eps)


@dataclass(frozen=True)
class _Error:
    """One kind of error: of every row, and how much there may be in all."""

    rows: Array
    amount: float  # sum or greatest of `rows`
    allowed: float
    unit: str
    words: str


def check_arithmetic(motion: Motion, surroundings: Surroundings, radius: float) -> Check:
    """The check `travel_time`: each row leads exactly to the next, so that no time is lost or won.

    `a dt = v1 - v0`; the mean speed times dt is the length of the arc that ends in the next row's
    position and heading; times never decrease and begin at zero; a row that takes no time moves
    nothing (it may turn: a kink, judged by `steering`); and the clearance column is what the geometry
    says. The errors of all rows together must stay within `SUM_TOLERANCE` and the rounding of the
    numbers, so that many rows cannot add up what each alone may be off: the columns `a` and `curvature`
    then are what the speeds, headings and places say. `worst` is minus the amount of the first error
    beyond, in its unit.
    """
    errors = [
        _greatest(
            np.abs(motion.t[:1]), CLOCK_TOLERANCE, "s", "the clock starts at another time than zero by"
        ),
        _greatest(np.maximum(-motion.duration, 0.0), 0.0, "s", "time runs backwards by"),
        *_row_errors(motion),
        _clearance_error(motion, surroundings, radius),
    ]
    broken = [error for error in errors if not error.amount <= error.allowed]
    if not broken:
        text = f"{len(motion.t)} rows lead to each other; travel time {motion.travel_time:.6f} s"
        return finding("travel_time", -errors[2].amount, "m", _place(motion, 0), text)
    error = broken[0]
    row = int(np.argmax(error.rows))
    text = f"row {row + 1}: {error.words} {error.rows[row]:.3g} {error.unit}"
    if error.amount > error.rows[row]:
        text += f", all rows together {error.amount:.3g} {error.unit}"
    place = _place(motion, row)
    return finding("travel_time", -error.amount, error.unit, place, text, tolerance=error.allowed)


def turn_errors(motion: Motion) -> tuple[Array, Array]:
    """Error [rad] of each row's turn against the next heading, and what rounding explains; (m - 1,) each.

    A row that takes no time turns nothing, so its error is a kink.
    """
    turned = motion.heading[:-1] + motion.curvature[:-1] * motion.step - motion.heading[1:]
    error = np.abs(np.remainder(turned + np.pi, 2.0 * np.pi) - np.pi)
    bend = np.where(motion.moving, np.abs(motion.curvature[:-1]), 0.0)
    # Rounding explains no more because somebody counts headings from a million turns on.
    largest = min(float(np.abs(motion.heading).max()), MOST_HEADING + float(np.abs(bend * motion.step).sum()))
    return error, _rounding(2.0 * (largest + np.pi) + bend * _travel_scale(motion))


def _row_errors(motion: Motion) -> list[_Error]:
    """Errors of each row against the next: position, speed, heading."""
    row = np.arange(len(motion.step))
    reached = motion.position(row, motion.step)
    away = np.hypot(reached[:, 0] - motion.x[1:], reached[:, 1] - motion.y[1:])
    gain = np.abs(motion.v[1:] - motion.v[:-1] - motion.a[:-1] * motion.duration)
    turn, turn_rounding = turn_errors(motion)
    turn, turn_rounding = np.where(motion.moving, (turn, turn_rounding), 0.0)
    # Positions may have been added up along a piece as long as the world is wide.
    wide = max(float(np.abs(motion.x).max()), float(np.abs(motion.y).max()))
    clock = np.abs(motion.t[1:]) + np.abs(motion.t[:-1])
    fast = np.abs(motion.v[1:]) + np.abs(motion.v[:-1])
    gained = _rounding(fast + np.where(motion.moving, np.abs(motion.a[:-1]), 0.0) * clock)
    return [
        _sum(
            away,
            _rounding(wide + _travel_scale(motion)),
            "m",
            "the next row is not where this one leads: off by",
        ),
        _sum(gain, gained, "m/s", "the speed does not change by a dt: off by"),
        _sum(turn, turn_rounding, "rad", "the heading does not change by the curvature: off by"),
    ]


def _travel_scale(motion: Motion) -> Array:
    """Length [m] of each row, at the size its clock's and speed's rounding has; (m - 1,)."""
    clock = np.abs(motion.t[1:]) + np.abs(motion.t[:-1])
    return 0.5 * (np.abs(motion.v[1:]) + np.abs(motion.v[:-1])) * clock


def _rounding(size: Array) -> Array:
    return ROUNDINGS * _EPSILON * size


def _sum(rows: Array, rounding: Array, unit: str, words: str) -> _Error:
    return _Error(rows, float(rows.sum()), SUM_TOLERANCE + float(rounding.sum()), unit, words)


def _greatest(rows: Array, allowed: float, unit: str, words: str) -> _Error:
    return _Error(rows, float(rows.max(initial=0.0)), allowed, unit, words)


def _clearance_error(motion: Motion, surroundings: Surroundings, radius: float) -> _Error:
    """How far the clearance column is from the geometry, beyond what circles as polygons explain."""
    exact = surroundings.distance(np.column_stack([motion.x, motion.y])) - radius
    below, above = exact - motion.clearance, motion.clearance - exact
    error = np.maximum(above, below - CIRCLE_WIDENING * surroundings.largest_circle)
    words = "the clearance column is not the clearance: off by"
    return _greatest(np.maximum(error, 0.0), CLEARANCE_TOLERANCE, "m", words)


def _place(motion: Motion, row: int) -> Place:
    return Place(t=float(motion.t[row]), x=float(motion.x[row]), y=float(motion.y[row]))
