"""The motion with the zone against uniform braking: speeds, time gained, and what holds it where."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from numpy.typing import NDArray

from verify.report.curves import Curve, halo, label_curves
from verify.report.figures_zone import Frame, frame_of, framed, runs
from verify.report.palette import HOLDING, INK, LIMIT, MUTED, RULE, Dash, method
from verify.report.series import thinned
from verify.report.svg import WIDE, Picture, arrange, new_figure, to_svg
from verify.report.zone_along import KEYS, LIMITS, ZoneAlong
from verify.report.zone_gain import Gain

Array = NDArray[np.float64]

_Line = tuple[Curve, str, Dash, float]  # curve, colour, dash and width

HEADROOM = 1.3  # of the motion's top speed, up to which speeds are drawn
SPEED_HEIGHT, GAIN_HEIGHT, ROW_HEIGHT = 230.0, 130.0, 19.0  # [px]


@dataclass(frozen=True, kw_only=True)
class GainData:
    """The motion, uniform braking beside it, and how the motion looks."""

    along: ZoneAlong
    gain: Gain | None
    plan: str  # method of the motion
    subject: str  # what it is called


def limit_shown(along: ZoneAlong) -> bool:
    """Whether the greatest speed that the zone allows comes anywhere down to the speeds drawn."""
    return bool(np.any(along.fastest < HEADROOM * along.v.max()))


def draw_gain(data: GainData) -> tuple[Picture, dict[str, Frame]]:
    """Three panels over one path length: speeds, time gained, what holds the motion; where axes lie."""
    along, found = data.along, data.gain
    share = np.diff(along.s, prepend=0.0) / along.s[-1]
    told = ", ".join(
        f"{words} on {100.0 * share[along.limit == k].sum():.0f} %"
        for k, words in enumerate(LIMITS.values())
        if np.any(along.limit == k)
    )
    gained = "" if found is None else f" Uniform braking takes {found.total:.3f} s more in all."
    described = {
        "key": "zone-gain",
        "title": "Speed with the zone against uniform braking, and what limits it",
        "description": f"Speed of the {data.subject} over path length"
        f"{' below the greatest speed its zone allows' if limit_shown(along) else ''}."
        f"{gained} What holds it: {told}.",
    }
    return framed(partial(_panels, data), described)


def _panels(data: GainData, described: dict[str, str], width: float) -> tuple[Markup, Frame]:
    along, found = data.along, data.gain
    keys = [k for k in range(len(KEYS)) if np.any(along.limit == k)]
    heights = [SPEED_HEIGHT, *([GAIN_HEIGHT] if found is not None else []), ROW_HEIGHT * len(keys) + 8.0]
    figure = new_figure(width, sum(heights) + 24.0 * len(heights) + 40.0)
    panels = figure.subplots(len(heights), 1, sharex=True, height_ratios=heights)
    _speeds(panels[0], data, short=width < WIDE)
    if found is not None:
        _gained(panels[1], found)
    _held(panels[-1], along, keys)
    panels[-1].set_xlabel("path length [m]")
    panels[0].set_xlim(0.0, along.s[-1])
    arrange(figure)
    _label_speeds(panels[0], data, short=width < WIDE)
    frame = dict(frame_of(panels[0]))
    frame["top"] = [frame_of(panels[0])["top"][0], frame_of(panels[-1])["top"][1]]
    return to_svg(figure, **described), frame


def _curves(data: GainData, *, short: bool) -> list[_Line]:
    """Curve, colour of its line, dash and width; the motion last."""
    along, look, other = data.along, method(data.plan), method("uniform")
    limit = "V by zone" if short else "greatest speed with the zone at this pose"
    drawn: list[_Line] = []
    if limit_shown(along):
        curve = Curve(x=along.s, y=along.fastest, text=limit, colour=LIMIT.light)
        drawn.append((curve, LIMIT.light, (0, (5, 2)), 1.3))
    if data.gain is not None:
        curve = Curve(x=along.s, y=data.gain.v, text="uniform braking", colour=other.text)
        drawn.append((curve, other.light, other.dash, 1.6))
    words = data.subject.removesuffix(" motion")
    return [*drawn, (Curve(x=along.s, y=along.v, text=words, colour=look.text), look.light, "solid", 2.2)]


def _speeds(axes: Axes, data: GainData, *, short: bool) -> None:
    for curve, colour, dash, width in _curves(data, short=short):
        axes.plot(*thinned(curve.x, curve.y), color=colour, ls=dash, lw=width, dash_capstyle="butt")
    axes.set_ylim(0.0, HEADROOM * float(data.along.v.max()) or 1.0)
    axes.set_ylabel("speed [m/s]")
    axes.locator_params(axis="y", nbins=5)


def _label_speeds(axes: Axes, data: GainData, *, short: bool) -> None:
    label_curves(axes, [curve for curve, *_ in _curves(data, short=short)])


def _gained(axes: Axes, found: Gain) -> None:
    """How much longer uniform braking took to get to each place."""
    axes.fill_between(found.s, 0.0, found.saved, color=HOLDING["zone"].light, alpha=0.18, lw=0)
    axes.plot(*thinned(found.s, found.saved), color=HOLDING["zone"].light, lw=1.8)
    axes.axhline(0.0, color=MUTED.light, lw=0.8)
    axes.set_ylabel("gained [s]")
    axes.locator_params(axis="y", nbins=4)
    last = float(found.saved[-1])
    words = axes.annotate(
        f"{last:+.3f} s".replace("-", "−"), (found.s[-1], last), (-4, -4 if last > 0.0 else 4), ha="right",
        textcoords="offset points", va="top" if last > 0.0 else "bottom", color=INK.light, weight="bold",
    )  # fmt: skip
    halo(words)


def _held(axes: Axes, along: ZoneAlong, keys: list[int]) -> None:
    """One row a limit, filled where it holds the motion."""
    edges = np.concatenate([along.s[:1], 0.5 * (along.s[1:] + along.s[:-1]), along.s[-1:]])
    for first, last in runs(along.limit):
        row, key = keys.index(int(along.limit[first])), KEYS[along.limit[first]]
        bar = [(edges[first], edges[last + 1] - edges[first])]
        axes.broken_barh(bar, (row - 0.36, 0.72), color=HOLDING[key].light, lw=0)
    axes.set_ylim(len(keys) - 0.5, -0.5)
    axes.set_yticks(range(len(keys)), [LIMITS[KEYS[k]] for k in keys], fontsize=9)
    axes.grid(axis="y", visible=False)
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_color(RULE.light)
