"""Labels at curves instead of legends: each label goes where it hides nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.text import Text
from matplotlib.transforms import Bbox
from numpy.typing import NDArray

from verify.report.palette import INK, PAPER
from verify.report.svg import Halo, arrange
from verify.report.svg_tree import Rim

Array = NDArray[np.float64]

_SAMPLES = 1500  # points of a curve that a label must not cover
_PLACES = 48  # places along its curve at which a label is tried


@dataclass(frozen=True, kw_only=True)
class Curve:
    """A drawn curve and what to write at it."""

    x: Array
    y: Array
    text: str = ""  # no label when empty
    colour: str = INK.light


def halo(text: Text) -> Text:
    """A rim in the colour of the ground, so that grid lines do not cross the letters."""
    text.set_path_effects([Halo(Rim(width=3.0, colour=PAPER.light))])
    return text


def label_curves(
    axes: Axes,
    curves: Sequence[Curve],
    *,
    size: float = 10.0,
    gaps: tuple[float, ...] = (4.0, 12.0),
) -> None:
    """Write each curve's text beside it where it covers fewest points of all the curves.

    Call it when the limits of the axes are final. Labels are horizontal, stay inside the axes and keep one
    of the distances `gaps` [px] from their curve.
    """
    figure = axes.figure.figure
    arrange(figure)
    dense = [_dense(axes, curve) for curve in curves]
    points = np.concatenate(dense) if dense else np.empty((0, 2))
    frame = axes.get_window_extent()
    taken: list[Bbox] = []
    for curve, own in zip(curves, dense, strict=True):
        inside = own[np.all((own >= frame.min) & (own <= frame.max), axis=1)]
        if not curve.text or not len(inside):
            continue
        text = axes.text(0, 0, curve.text, color=curve.colour, fontsize=size, ha="center", va="center")
        box = text.get_window_extent()
        half = np.array([box.width, box.height]) / 2.0
        spots = inside[np.linspace(0, len(inside) - 1, _PLACES).astype(np.int64)]
        candidates = np.concatenate(
            [spots + np.array([0.0, sign * (half[1] + gap)]) for sign in (1, -1) for gap in gaps]
        )
        room = np.maximum(half + 2.0, 0.0)
        candidates[:, 0] = np.clip(
            candidates[:, 0], frame.x0 + room[0], max(frame.x1 - room[0], frame.x0 + room[0])
        )
        costs = _costs(candidates, half, points, frame, taken)
        best = candidates[int(np.argmin(costs))]
        x, y = axes.transData.inverted().transform(best)
        text.set_position((float(x), float(y)))
        halo(text)
        taken.append(Bbox([best - half, best + half]))


def label_points(
    axes: Axes,
    points: Sequence[tuple[str, Array]],
    away: float,
    curves: Sequence[Curve],
    colour: str = INK.light,
) -> None:
    """Write the name of each point (2,) beside it, at the corner where it covers fewest points of the curves.

    And no text that is there before. Call it when the limits of the axes are final. `away` [px]: how far
    from its point, across and along.
    """
    arrange(axes.figure.figure)
    dense = [_dense(axes, curve) for curve in curves]
    covered, frame = np.concatenate([np.empty((0, 2)), *dense]), axes.get_window_extent()
    taken = [Bbox(text.get_window_extent().get_points()) for text in axes.texts if text.get_text()]
    for number, (name, point) in enumerate(points):
        text = axes.annotate(
            name, (point[0], point[1]), (0, 0), textcoords="offset points", ha="center", va="center",
            weight="bold", zorder=6, color=colour,
        )  # fmt: skip
        box, at = text.get_window_extent(), axes.transData.transform(point)
        half = np.array([box.width, box.height]) / 2.0
        centre = np.array([frame.x0 + frame.x1, frame.y0 + frame.y1]) / 2.0
        inward = np.where(at < centre, 1.0, -1.0)
        candidates = at + inward * [[1, 1], [1, -1], [-1, 1], [-1, -1]] * (away + half)
        costs = _costs(candidates, half, covered, frame, taken)
        for key, (_, where) in enumerate(points):
            if key == number:
                continue
            other = axes.transData.transform(where)
            # a name about as near to another point would be taken for its
            costs += 500.0 * (np.hypot(*(candidates - other).T) < 1.5 * np.hypot(*(candidates - at).T))
        best = candidates[int(np.argmin(costs))]
        text.set_position(tuple(best - at))
        halo(text)
        taken.append(Bbox([best - half, best + half]))


def _dense(axes: Axes, curve: Curve) -> Array:
    """The curve in pixels, sampled evenly along its drawn length."""
    pixels = axes.transData.transform(np.column_stack([curve.x, curve.y]))
    pixels = pixels[np.all(np.isfinite(pixels), axis=1)]
    if len(pixels) < 2:
        return pixels
    run = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(pixels, axis=0).T))])
    at = np.linspace(0.0, run[-1], _SAMPLES)
    return np.column_stack([np.interp(at, run, pixels[:, 0]), np.interp(at, run, pixels[:, 1])])


def _costs(centres: Array, half: Array, points: Array, frame: Bbox, taken: Sequence[Bbox]) -> Array:
    """(n,) how bad a label of half size `half` is at each of `centres` (n, 2): what it covers and leaves."""
    low, high = centres - half - 2.0, centres + half + 2.0
    x, y = points.T
    covered = (x > low[:, :1]) & (x < high[:, :1]) & (y > low[:, 1:]) & (y < high[:, 1:])
    outside = np.sum(np.maximum(frame.min - low, 0.0) + np.maximum(high - frame.max, 0.0), axis=1)
    overlaps = sum(
        (np.all((low <= box.max) & (high >= box.min), axis=1) for box in taken),
        np.zeros(len(centres), np.int64),
    )
    middle = np.abs(centres[:, 0] - 0.5 * (frame.x0 + frame.x1)) / max(frame.width, 1.0)
    return np.count_nonzero(covered, axis=1) + 50.0 * outside + 1000.0 * overlaps + middle
