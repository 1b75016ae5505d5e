"""Labels at curves instead of legends: each label goes where it hides nothing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patheffects import withStroke
from matplotlib.text import Text
from matplotlib.transforms import Bbox
from numpy.typing import NDArray

from verify.report.palette import INK, PAPER

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
    text.set_path_effects([withStroke(linewidth=3.0, foreground=PAPER.light)])
    return text


def label_curves(
    axes: Axes, curves: Sequence[Curve], *, size: float = 10.0, gaps: tuple[float, ...] = (4.0, 12.0)
) -> None:
    """Write each curve's text beside it where it covers fewest points of all the curves.

    Call it when the limits of the axes are final. Labels are horizontal, stay inside the axes and keep one
    of the distances `gaps` [px] from their curve.
    """
    figure = axes.figure.figure
    figure.draw_without_rendering()
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
        costs = [_cost(c, half, points, frame, taken) for c in candidates]
        best = candidates[int(np.argmin(costs))]
        x, y = axes.transData.inverted().transform(best)
        text.set_position((float(x), float(y)))
        halo(text)
        taken.append(Bbox([best - half, best + half]))


def label_points(axes: Axes, points: Mapping[str, Array], away: float, curves: Sequence[Curve]) -> None:
    """Write the name of each point (2,) beside it, at the corner where it covers fewest points of the curves.

    Call it when the limits of the axes are final. `away` [px]: how far from its point, across and along.
    """
    axes.figure.figure.draw_without_rendering()
    dense = [_dense(axes, curve) for curve in curves]
    covered, frame = np.concatenate([np.empty((0, 2)), *dense]), axes.get_window_extent()
    taken: list[Bbox] = []
    for name, point in points.items():
        text = axes.annotate(
            name, (point[0], point[1]), (0, 0), textcoords="offset points", ha="center", va="center",
            weight="bold", zorder=6,
        )  # fmt: skip
        box, at = text.get_window_extent(), axes.transData.transform(point)
        half = np.array([box.width, box.height]) / 2.0
        centre = np.array([frame.x0 + frame.x1, frame.y0 + frame.y1]) / 2.0
        inward = np.where(at < centre, 1.0, -1.0)
        candidates = at + inward * [[1, 1], [1, -1], [-1, 1], [-1, -1]] * (away + half)
        costs = np.array([_cost(c, half, covered, frame, taken) for c in candidates])
        others = axes.transData.transform([points[key] for key in points if key != name])
        for other in others:  # a name about as near to another point would be taken for its
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


def _cost(centre: Array, half: Array, points: Array, frame: Bbox, taken: Sequence[Bbox]) -> float:
    low, high = centre - half - 2.0, centre + half + 2.0
    covered = np.count_nonzero(np.all((points > low) & (points < high), axis=1))
    outside = sum(
        max(0.0, e) for e in (frame.x0 - low[0], high[0] - frame.x1, frame.y0 - low[1], high[1] - frame.y1)
    )
    overlaps = sum(Bbox([low, high]).overlaps(other) for other in taken)
    middle = abs(centre[0] - 0.5 * (frame.x0 + frame.x1)) / max(frame.width, 1.0)
    return float(covered) + 50.0 * outside + 1000.0 * overlaps + middle
