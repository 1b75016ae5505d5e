"""Does the file describe one continuous motion, and is its travel time the time that motion takes?"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from verify.judge.finding import Check, Place, finding
from verify.judge.geometry import Surroundings
from verify.judge.motion import Motion

Array = NDArray[np.float64]

POSE_TOLERANCE = 1e-8  # [m], [rad], [m/s]: rounding gives 1e-10 at 100 m, and 1e-8 gains nobody time
CLOCK_TOLERANCE = 1e-9  # [s], the first row's time
CLEARANCE_TOLERANCE = 1e-6  # [m]: far above rounding at 100 m, far below any real gap
CIRCLE_WIDENING = 6e-4  # relative: planners see a circle as a polygon around it, at most this much wider


def check_arithmetic(motion: Motion, surroundings: Surroundings, radius: float) -> Check:
    """The check `travel_time`: each row leads exactly to the next, so that no time is lost or won.

    `a dt = v1 - v0`; the mean speed times dt is the length of the arc that ends in the next row's
    position and heading; times never decrease and begin at zero; a row that takes no time moves
    nothing (it may turn: a kink, judged by `steering`); and the clearance column is what the geometry
    says. `worst` is minus the greatest error, in the unit of that error.
    """
    errors = [
        (np.array([abs(motion.t[0])]), CLOCK_TOLERANCE, "s", "the clock starts at another time than zero by"),
        (np.maximum(-motion.duration, 0.0), 0.0, "s", "time runs backwards by"),
        *_row_errors(motion),
        _clearance_error(motion, surroundings, radius),
    ]
    broken = [entry for entry in errors if (entry[0] > entry[1]).any()]
    if not broken:
        value = max(float(error.max(initial=0.0)) for error, *_ in errors[2:4])
        text = f"{len(motion.t)} rows lead to each other; travel time {motion.travel_time:.6f} s"
        return finding("travel_time", -value, "m", _place(motion, 0), text)
    error, tolerance, unit, words = broken[0]
    row = int(np.argmax(error))
    text = f"row {row + 1}: {words} {error[row]:.9f} {unit}"
    return finding("travel_time", -float(error[row]), unit, _place(motion, row), text, tolerance=tolerance)


def _row_errors(motion: Motion) -> list[tuple[Array, float, str, str]]:
    """Errors of each row against the next: position, speed, heading."""
    row = np.arange(len(motion.step))
    reached = motion.position(row, motion.step)
    away = np.hypot(reached[:, 0] - motion.x[1:], reached[:, 1] - motion.y[1:])
    gain = np.abs(motion.v[1:] - motion.v[:-1] - motion.a[:-1] * motion.duration)
    turned = motion.heading[:-1] + motion.curvature[:-1] * motion.step - motion.heading[1:]
    turn = np.abs(np.remainder(turned + np.pi, 2.0 * np.pi) - np.pi)
    turn = np.where(motion.moving, turn, 0.0)
    return [
        (away, POSE_TOLERANCE, "m", "the next row is not where this one leads: off by"),
        (gain, POSE_TOLERANCE, "m/s", "the speed does not change by a dt: off by"),
        (turn, POSE_TOLERANCE, "rad", "the heading does not change by the curvature: off by"),
    ]


def _clearance_error(
    motion: Motion, surroundings: Surroundings, radius: float
) -> tuple[Array, float, str, str]:
    """How far the clearance column is from the geometry, beyond what circles as polygons explain."""
    exact = surroundings.distance(np.column_stack([motion.x, motion.y])) - radius
    below, above = exact - motion.clearance, motion.clearance - exact
    error = np.maximum(above, below - CIRCLE_WIDENING * surroundings.largest_circle)
    return (
        np.maximum(error, 0.0),
        CLEARANCE_TOLERANCE,
        "m",
        "the clearance column is not the clearance: off by",
    )


def _place(motion: Motion, row: int) -> Place:
    return Place(t=float(motion.t[row]), x=float(motion.x[row]), y=float(motion.y[row]))
