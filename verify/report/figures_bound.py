"""How the bracket closed: proven bound and best time over mesh size and compute time."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from numpy.typing import NDArray

from verify.report.curves import halo
from verify.report.figures_mesh import logarithmic
from verify.report.numbers import bracket, count, duration, percent_beside, seconds_proven, significant
from verify.report.palette import INK, LIMIT, RULE, method
from verify.report.svg import WIDE, Picture, both_widths, new_figure, to_svg

Array = NDArray[np.float64]

HEIGHT = 190.0  # [px] of one row of panels
LEAST_GAP = 1e-9  # ratio: what is drawn where the gap is zero or less


@dataclass(frozen=True, kw_only=True)
class Closing:
    """The rounds of refinement: what each proved, and what the result is compared with."""

    triangles: Array  # (r,)
    seconds: Array  # (r,) [s] of computing since the beginning
    lower: Array  # (r,) [s], proven by the round
    upper: float | None  # [s], least time of a feasible plan of the same model
    upper_method: str  # whose that is, "" when there is none
    gap_limit: float | None = None  # ratio, of the gate

    @property
    def best(self) -> Array:
        """The greatest bound so far (r,) [s]: a round that ends early may prove less than one before it."""
        return np.asarray(np.maximum.accumulate(self.lower))


def draw_closing(data: Closing) -> Picture:
    """Both bounds over triangles and compute time, and below them the gap on a logarithmic axis."""
    rows = "; ".join(
        f"{count(n)} triangles, {duration(t)}: {seconds_proven(low)}"
        for n, t, low in zip(data.triangles, data.seconds, data.lower, strict=True)
    )
    best = f" The best time found is {_ends(data)[1]}." if data.upper is not None else ""
    if len(data.lower) == 1:
        heading, marks = "The bracket after the only round", "The triangle mark is the round: a certificate."
    else:
        closes = data.best[-1] > data.best[0]
        heading = "The bracket closes as the mesh is refined" if closes else "The bracket, round by round"
        marks = "Each triangle mark is a round: a certificate of its own. The step is the best bound so far."
    shaded = (
        " The least travel time lies in the shaded bracket, whichever way it takes. Below, the height of the "
        "bracket as a share of the bound."
        if data.upper is not None
        else ""
    )
    described = {
        "key": "bound-closing",
        "title": heading,
        "description": f"Proven lower bound by round of refinement: {rows}.{best}",
    }
    return both_widths(partial(_draw, data), described, heading=heading, caption=marks + shaded)


def _ends(data: Closing) -> tuple[str, str]:
    """The proven bound and the best time found, the latter empty where there is none."""
    best = float(data.best[-1])
    return (seconds_proven(best), "") if data.upper is None else bracket(best, data.upper)


def _draw(data: Closing, described: dict[str, str], width: float) -> Markup:
    wide, gaps = width == WIDE, data.upper is not None
    kinds = ["bounds", "gap"] if gaps else ["bounds"]
    xs = [("triangles", data.triangles), ("compute time [s]", data.seconds)]
    figure = new_figure(width, HEIGHT * len(kinds) * (1 if wide else 2) + 30.0)
    if wide:
        panels = figure.subplots(len(kinds), 2, sharex="col", sharey="row", squeeze=False)
    else:
        panels = figure.subplots(2 * len(kinds), 1, squeeze=False).reshape(2, len(kinds)).T
    for column, (name, x) in enumerate(xs):
        for row, kind in enumerate(kinds):
            axes = panels[row, column]
            first = column == 0 or not wide
            (_bounds if kind == "bounds" else _gap)(axes, data, x, first)
            axes.set_xscale("log")
            _decades(axes, x)
            if row == len(kinds) - 1 or not wide:
                axes.set_xlabel(name)
    return to_svg(figure, **described)


def _decades(axes: Axes, x: Array) -> None:
    """Limits with a little room, and ticks at 1, 2 and 5 times powers of ten."""
    low, high = 0.8 * float(x.min()), 1.25 * float(x.max())
    axes.set_xlim(low, high)
    powers = 10.0 ** np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1)
    steps = (1.0, 2.0, 5.0) if high / low < 300.0 else (1.0,)
    ticks = [p * s for p in powers for s in steps if low <= p * s <= high]
    labels = [count(t) if t >= 100.0 else f"{t:g}" for t in ticks]
    if len(ticks) < 2:  # of one or two rounds, say
        ticks = np.unique(x[[0, -1]]).tolist()
        labels = [count(t) if t >= 100.0 else significant(t, 2) for t in ticks]
    axes.set_xticks(ticks, labels)
    axes.minorticks_off()


def _bounds(axes: Axes, data: Closing, x: Array, named: bool) -> None:
    look, best = method("lower_bound"), data.best
    far = np.append(x, 1.25 * x[-1])
    held = np.append(best, best[-1])
    shown = [*data.lower, *([data.upper] if data.upper is not None else [])]
    room = max(float(np.ptp(shown)), 1e-6 * float(max(shown)))
    axes.set_ylim(min(shown) - 0.22 * room, max(shown) + 0.28 * room)
    if data.upper is not None:
        above = method(data.upper_method)
        axes.fill_between(far, held, data.upper, step="post", color=RULE.light, lw=0.0)
        axes.plot([0.8 * x[0], far[-1]], [data.upper] * 2, color=above.light, lw=2.0)
        if named:
            _say(
                axes,
                f"best found: {_ends(data)[1]}, {above.label}",
                (1.0, data.upper),
                (-4, 5),
                "bottom",
                above.text,
            )
    axes.plot(far, held, color=look.light, lw=1.6, drawstyle="steps-post")
    axes.plot(x, data.lower, look.marker, color=look.light, ms=6)
    if named:
        _say(
            axes,
            f"proven: {_ends(data)[0]}",
            (1.0, float(best[-1])),
            (-4, -9),
            "top",
            INK.light,
        )
        axes.set_ylabel("travel time [s]")
    axes.yaxis.get_major_formatter().set_useOffset(False)  # type: ignore[attr-defined]


def _gap(axes: Axes, data: Closing, x: Array, named: bool) -> None:
    ratio = np.maximum((data.upper or 0.0) / data.best - 1.0, LEAST_GAP)
    far, held = np.append(x, 1.25 * x[-1]), np.append(ratio, ratio[-1])
    axes.plot(far, 100.0 * held, color=INK.light, lw=1.6, drawstyle="steps-post")
    axes.plot(x, 100.0 * ratio, method("lower_bound").marker, color=INK.light, ms=6)
    if named:
        _say(
            axes,
            f"gap {percent_beside(float(ratio[-1]), data.gap_limit)}",
            (1.0, 100.0 * float(ratio[-1])),
            (-4, -7),
            "top",
            LIMIT.light,
        )
        axes.set_ylabel("gap [%]")
    logarithmic(axes, 30.0 * float(ratio.min()), 100.0 * float(ratio.max()))


def _say(
    axes: Axes, text: str, at: tuple[float, float], offset: tuple[float, float], va: str, colour: str
) -> None:
    """Words at the right rim: `at` is a share of the width and a value."""
    halo(
        axes.annotate(
            text, at, offset, xycoords=("axes fraction", "data"), textcoords="offset points", ha="right",
            va=va, fontsize=10.5, weight="bold", color=colour,
        )
    )  # fmt: skip
