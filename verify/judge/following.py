"""Which place of the planned path is the vehicle beside, and how far across, behind or ahead is it?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verify.judge.motion import Motion

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

SPACING = 5e-3  # [m], of the points along the path: an arc of curvature 2/m bulges 6 um between two
MOST_POINTS = 400_000  # along a very long path, which are then further apart
WIDEST = 4000  # points searched for one sample
REACH = 0.05  # [m], searched beyond what the vehicle moved, forwards and backwards


@dataclass(frozen=True)
class Following:
    """The vehicle relative to the planned path, at each sample."""

    across: Array  # (n,) [m], distance from the path, not negative
    behind: Array  # (n,) [s], after the plan left the place beside the vehicle, at least 0
    lag: Array  # (n,) [m], along the path behind the place planned for the same time; negative ahead


def follow(t: Array, points: Array, motion: Motion) -> Following:
    """Follow the vehicle along the path of `motion` from its start.

    The place beside the vehicle is the nearest point of the path near the one before, so that a path that
    crosses itself is followed the way round it leads. Whatever place is found, what is said about it is
    true: a vehicle that lost the way is only further off. Beyond both ends the path goes straight on.

    Parameters
    ----------
    t : (n,) [s], within the motion; points : (n, 2) [m].
    """
    travelled = np.concatenate([[0.0], np.cumsum(motion.step)])
    count = int(np.clip(np.ceil(travelled[-1] / SPACING), 1, MOST_POINTS))
    marks = np.linspace(0.0, travelled[-1], count + 1)
    row = _row(travelled, marks)
    path = motion.position(row, marks - travelled[row])
    across, along = _beside(points, path, marks, _nearest(points, path, travelled[-1] / count))
    leaving = _row(travelled, along)
    inside = np.clip(along - travelled[leaving], 0.0, motion.step[leaving])
    left = np.where(along < travelled[-1], motion.time(leaving, inside), motion.t[-1])
    now = np.clip(np.searchsorted(motion.t, t, side="right") - 1, 0, len(motion.t) - 2)
    elapsed = t - motion.t[now]
    planned = travelled[now] + (motion.v[now] + 0.5 * motion.a[now] * elapsed) * elapsed
    return Following(across=across, behind=np.maximum(t - left, 0.0), lag=planned - along)


def _row(travelled: Array, along: Array) -> Rows:
    """The last row that begins at or before each arc length: a robot that waits leaves with it."""
    return np.clip(np.searchsorted(travelled, along, side="right") - 1, 0, len(travelled) - 2)


def _nearest(points: Array, path: Array, spacing: float) -> Rows:
    """Index of the point of the path beside each of `points`; (n,)."""
    moved = np.hypot(*np.diff(points, axis=0, prepend=points[:1]).T)
    reach = np.minimum((moved + REACH) / max(spacing, SPACING / MOST_POINTS) + 2.0, WIDEST).astype(np.int64)
    found = np.empty(len(points), dtype=np.int64)
    x, y, here = path[:, 0], path[:, 1], 0
    for i, (px, py) in enumerate(points.tolist()):  # each from the one before
        low, high = max(here - int(reach[i]), 0), here + int(reach[i]) + 1
        here = low + int(np.argmin((x[low:high] - px) ** 2 + (y[low:high] - py) ** 2))
        found[i] = here
    return found


def _beside(points: Array, path: Array, marks: Array, nearest: Rows) -> tuple[Array, Array]:
    """Distance [m] from the nearer of the two pieces at a mark, and arc length [m] of the foot; (n,) each."""
    last = len(path) - 2
    across = np.full(len(points), np.inf)
    along = np.zeros(len(points))
    for first in (np.maximum(nearest - 1, 0), np.minimum(nearest, last)):
        begin, piece = path[first], path[first + 1] - path[first]
        offset = points - begin
        square = np.sum(piece * piece, axis=1)
        part = np.divide(
            np.sum(offset * piece, axis=1), square, out=np.zeros_like(square), where=square > 0.0
        )
        part = np.clip(part, np.where(first == 0, -np.inf, 0.0), np.where(first == last, np.inf, 1.0))
        away = np.hypot(*(offset - part[:, None] * piece).T)
        nearer = away < across
        across = np.where(nearer, away, across)
        foot = marks[first] + part * (marks[first + 1] - marks[first])
        along = np.where(nearer, foot, along)
    return across, along
