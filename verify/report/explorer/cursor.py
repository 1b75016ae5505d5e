"""What the cursor reads off the motion followed: its own rows, and curves that need no more than a few knots.

Between rows a motion goes along a circular arc with constant tangential acceleration. Rows that continue
each other with nearly the same acceleration and curvature are sent as one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from verify.report.zone_along import ZoneAlong
from vnav_drake.plan import Trajectory
from vnav_drake.problem import Problem

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

SHARE = 1e-3  # of the least limit: how far an acceleration may be from the motion's own
DRIFT = 2e-4  # [m], by which joined rows may leave the path before the next row corrects it
CLEAR = 1e-3  # [m], how far a clearance may be from that of the place
SPACING = 1e-3  # [m] along the path between the places whose clearance is asked for
MOST = 200_000  # of these places


@dataclass(frozen=True, kw_only=True, eq=False)
class Followed:
    """The motion as the cursor reads it.

    `rows`: t, x, y, heading, v of where each row begins, and the `a` and `curvature` that hold from there to
    the next; the last one is the end. `clearance`: t and value, linear between. `zone`: where the braking
    zone is no disc its distance from what is nearest, t and value; `safe`: the greatest safe speed, s and
    value. All in SI units, (n,) each.
    """

    rows: Columns
    acceleration: float  # [m/s^2], how far a and v^2 kappa are from the motion's own at most
    clearance: Columns
    zone: Columns | None
    safe: Columns | None


def followed_rows(problem: Problem, motion: Trajectory, along: ZoneAlong | None) -> Followed:
    """Rows and curves of the motion that the cursor follows."""
    robot = problem.robot
    within = SHARE * min(robot.friction_acceleration, robot.max_acceleration, robot.max_braking)
    gap = None if along is None else along.margin()
    return Followed(
        rows=joined(motion, within, SHARE * robot.max_curvature),
        acceleration=within,
        clearance=_clearance(problem, motion),
        zone=None if gap is None else {"t": gap.t, "value": gap.value},
        safe=None if along is None else {"s": along.s, "value": along.fastest},
    )


def joined(motion: Trajectory, acceleration: float, curvature: float) -> dict[str, Array]:
    """Rows of `motion`, as few as keep a and v^2 kappa within `acceleration` and kappa within `curvature`.

    Each begins where the motion is and holds the middle of what is joined in it. Rows of no duration (kinks)
    end what is joined and are left out.

    Returns
    -------
    t, x, y, heading, v, a, curvature, (n + 1,) each; the last row repeats the last a and curvature.
    """
    lasting = np.diff(motion.t) > 0.0
    fastest = np.maximum(motion.v[:-1], motion.v[1:])
    found: list[tuple[int, float, float]] = []  # first row, a, curvature
    low_a = high_a = low_k = high_k = top = start = end = 0.0
    rows = zip(lasting.tolist(), motion.a.tolist(), motion.curvature.tolist(), fastest.tolist(),
               motion.arc_length[1:].tolist(), strict=False)  # fmt: skip
    begun = False
    for i, (lasts, a, k, v, s) in enumerate(rows):
        if not lasts:
            begun, end = False, s
            continue
        if begun:
            a0, a1, k0, k1 = min(low_a, a), max(high_a, a), min(low_k, k), max(high_k, k)
            speed, bend = max(top, v), k1 - k0
            if (
                a1 - a0 <= 2.0 * acceleration
                and bend * speed * speed <= 2.0 * acceleration
                and bend <= 2.0 * curvature
                and bend * (s - start) ** 2 <= 4.0 * DRIFT
            ):
                low_a, high_a, low_k, high_k, top = a0, a1, k0, k1, speed
                found[-1] = (found[-1][0], 0.5 * (a0 + a1), 0.5 * (k0 + k1))
                end = s
                continue
        low_a, high_a, low_k, high_k, top, begun, start, end = a, a, k, k, v, True, end, s
        found.append((i, a, k))
    index = np.array([i for i, *_ in found] + [len(motion.t) - 1])
    held = np.array([row[1:] for row in (*found, found[-1])])
    begin = {name: getattr(motion, name)[index] for name in ("t", "x", "y", "heading", "v")}
    return {**begin, "a": held[:, 0], "curvature": held[:, 1]}


def knots(x: Array, y: Array, within: float) -> NDArray[np.int64]:
    """Which of the points (n,), x rising, a broken line through them needs to stay `within` of each."""
    steepest = float(np.max(np.abs(np.diff(y) / np.diff(x)), initial=0.0))
    stretched = x * max(20.0 * steepest, 1e-9)  # so that beside the line is above or below it
    line = shapely.simplify(shapely.LineString(np.column_stack([stretched, y])), 0.99 * within)
    return np.searchsorted(stretched, shapely.get_coordinates(line)[:, 0])


def _clearance(problem: Problem, motion: Trajectory) -> dict[str, Array]:
    """Within `CLEAR`: clearance changes by no more than the way between the places that are asked."""
    steps = np.clip(np.ceil(np.diff(motion.arc_length) / SPACING), 1, None).astype(int)
    while steps.sum() > MOST and steps.max() > 1:
        steps = (steps + 1) // 2
    row = np.repeat(np.arange(len(steps)), steps)
    part = (np.arange(len(row)) - np.repeat(np.cumsum(steps) - steps, steps)) / steps[row]
    t = np.unique(np.append(motion.t[row] + part * np.diff(motion.t)[row], motion.t[-1]))
    x, y, *_ = motion.at(t)
    value = problem.clearance(np.column_stack([x, y]))
    kept = knots(t, value, 0.4 * CLEAR)
    return {"t": t[kept], "value": value[kept]}


def braking_law(problem: Problem) -> list[float]:
    """Stopping distance [m] as a polynomial of speed [m/s], lowest power first."""
    law = problem.braking
    return [law.margin, law.reaction_time, 0.5 / law.max_braking]
