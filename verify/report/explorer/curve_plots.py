"""Bokeh's models of the curves: speed, margins, and acceleration in the friction circle."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
from bokeh.models import ColumnDataSource, Range1d
from bokeh.models.annotations import Label, Span
from bokeh.plotting import figure
from numpy.typing import NDArray

from verify.report.explorer.motions import DrawnMargin, DrawnMotion
from verify.report.explorer.plots import GROUND, LETTERS, OVER, WORDS, dashes, empty, new_plot
from verify.report.palette import HOLDING, INK, LIMIT, MUTED, PAPER, Tone, method, rank_tone
from vnav_drake.problem import Problem

Array = NDArray[np.float64]
Sources = Mapping[str, ColumnDataSource]

LIMIT_DASH = [7, 3]
ALIGNED = {"min_border_left": 66}  # [px]: one instant stands in one line in both plots of time
HALF, TALL = 0.13, 0.11  # of a plot 560 px wide and 200 px high: words of some 20 letters
HIGH = 1.18  # of the greatest speed that is shown: room for words

# Margins have the colours of what holds a motion, wherever that is drawn.
MARGIN_TONES: Mapping[str, Tone] = {
    "braking": HOLDING["zone"],
    "clearance": HOLDING["none"],
    **{key: HOLDING[key] for key in ("friction", "tip", "reserve", "steering", "drive", "brakes", "speed")},
}


def speed_plot(
    problem: Problem,
    sources: Sources,
    executed: str,
    ranks: Sequence[int],
    motion: DrawnMotion,
    time: Range1d,
) -> figure:
    """v(t) of the motion followed, below its limits; of other motions and classes when they are chosen."""
    columns = motion.columns
    t, v, safe, bend = (columns[name] for name in ("t", "v", "safe", "bend"))
    disc = problem.zone is None
    top = HIGH * max(float(v.max()), float(np.nanmax(safe)) if disc else 0.0, 1e-3)
    plot = new_plot(
        "speed",
        "time [s]",
        "speed [m/s]",
        x_range=time,
        y_range=Range1d(start=0.0, end=top),
        tools="xpan,xwheel_zoom",
        **ALIGNED,
    )
    for key, source in sources.items():
        if key.startswith("plan-") and key != executed:
            look = method(key.removeprefix("plan-"))
            plot.line(
                "t", "v", source=source, name=f"speed-{key}", line_color=look.light, line_width=1.6,
                line_dash=dashes(look.dash, 2), visible=False,
            )  # fmt: skip
    for rank in ranks:
        plot.line(
            "t", "v", source=sources[f"class-{rank}"], name=f"speed-class-{rank}", visible=False,
            line_color=rank_tone(rank).light, line_width=2.4,
        )  # fmt: skip
    own = sources[executed]
    plot.scatter("t", "bend", source=own, size=2.6, marker="circle", fill_color=MUTED.light, line_color=None)
    tone = method(executed.removeprefix("plan-"))
    plot.line("t", "v", source=own, line_color=tone.light, line_width=2.6, name="speed-executed")
    plot.line("t", "safe", source=own, line_color=LIMIT.light, line_width=1.5, line_dash=LIMIT_DASH)
    shown = [np.column_stack([t, values]) for values in (v, safe, bend)]
    named = [(0, "speed", tone.text)]
    if np.any(safe < top):  # beyond what the zone was looked at there is none
        named.append((1, "safe speed V(d)" if disc else "safe speed of the zone", LIMIT.light))
    if np.any(bend < top):
        named.append((2, "limit of the bend", MUTED.light))
    frame = (float(t[0]), float(t[-1]), 0.0, top)
    limit = problem.robot.max_speed
    right = _freer_on_the_right(shown, limit, frame)
    wide = 2.0 * HALF * (frame[1] - frame[0])
    corner = [(frame[1] - 0.5 * wide if right else frame[0] + 0.5 * wide, limit)] if limit < top else []
    if corner:
        shown.append(np.column_stack([t, np.full_like(t, limit)]))
    places = label_places(shown, [k for k, *_ in named], frame, corner)
    for (_, words, colour), place in zip(named, places, strict=True):
        _words(plot, place, words, colour)
    if np.isfinite(limit):  # other motions may reach what this one is far from
        _level(plot, limit)
        plot.add_layout(
            _label((frame[right], limit), f"v_max = {limit:g} m/s", LIMIT.light,
                   align="right" if right else "left",
                   name="speed-limit", visible=limit < top)
        )  # fmt: skip
    _time_cursor(plot, "speed")
    return plot


def margins_plot(margins: Sequence[DrawnMargin], time: Range1d) -> figure:
    """The share of each limit that is left, or one margin in its unit; which, the script decides."""
    plot = new_plot(
        "margins", "time [s]", "left of each limit [%]", x_range=time, y_range=Range1d(start=-6.0, end=106.0),
        tools="xpan,xwheel_zoom", **ALIGNED,
    )  # fmt: skip
    _level(plot, 0.0)
    source = empty("margin-lines", "t", *(margin.key for margin in margins))
    for margin in margins:
        plot.line(
            "t", margin.key, source=source, name=f"margin-{margin.key}", line_width=2,
            line_color=MARGIN_TONES[margin.key].light,
        )  # fmt: skip
    plot.line(
        "t", "value", source=empty("margin-class", "t", "value"), name="margin-class", line_width=2.4,
        line_color=INK.light, line_dash=[5, 2], visible=False,
    )  # fmt: skip
    plot.scatter(
        "x", "y", source=empty("least", "x", "y"), size=13, marker="circle", fill_color=None,
        line_color=INK.light, line_width=1.8,
    )  # fmt: skip
    words = plot.text(
        "x", "y", text="text", source=empty("least-words", "x", "y", "text", "align"), y_offset=-10,
        text_align="align", text_color=INK.light, **LETTERS,
    )  # fmt: skip
    words.glyph.update(**GROUND)
    _time_cursor(plot, "margins")
    return plot


def friction_plot(problem: Problem, sources: Sources, executed: str, ranks: Sequence[int]) -> figure:
    """Acceleration across and along the path in the friction circle, with all its limits."""
    robot = problem.robot
    plot = new_plot("friction", "across the path v²κ [m/s²], left positive", "along the path a [m/s²]",
                    x_range=Range1d(start=-1.0, end=1.0), y_range=Range1d(start=-1.0, end=1.0))  # fmt: skip
    grip = robot.friction_acceleration
    _circle(plot, grip, LIMIT.light, LIMIT_DASH)
    _circle(plot, robot.max_braking, MUTED.light, [2, 3])
    _words(plot, (0.0, grip), f"friction μg = {grip:.2f} m/s²", LIMIT.light, align="center")
    for value, words in ((robot.max_acceleration, "drive a_max"), (-robot.max_braking, "brakes −a_b")):
        _level(plot, value)
        _words(plot, (0.0, value), words, LIMIT.light, align="center", below=value < 0.0)
    sides = [(robot.tip_acceleration, "tip-over")]
    if problem.friction_reserve:
        sides.append((robot.reserved_lateral_acceleration(), "friction reserve"))
    for value, words in sides:
        if value <= 1.05 * grip:
            for sign in (-1.0, 1.0):
                plot.add_layout(
                    Span(location=sign * value, dimension="height", line_color=LIMIT.light,
                         line_dash=LIMIT_DASH, line_width=1.3)
                )  # fmt: skip
            plot.add_layout(
                Label(x=value, y=0.0, text=f"{words} {value:.2f} m/s²", angle=math.pi / 2, y_offset=0,
                      x_offset=-3, text_color=LIMIT.light, text_align="center", text_baseline="bottom",
                      **WORDS)
            )  # fmt: skip
    for rank in ranks:
        plot.scatter(
            "turn", "a", source=sources[f"class-{rank}"], name=f"friction-class-{rank}", visible=False,
            size=6, marker="circle", fill_color=None, line_color=rank_tone(rank).light, line_width=1.2,
        )  # fmt: skip
    tone = method(executed.removeprefix("plan-"))
    plot.scatter(
        "turn", "a", source=sources[executed], size=3.6, marker="circle", fill_color=tone.light,
        line_color=None, name="friction-executed",
    )  # fmt: skip
    cursor = empty("friction-cursor", "x", "y", "x0", "y0")
    plot.segment("x0", "y0", "x", "y", source=cursor, line_color=INK.light, line_width=2, level=OVER)
    plot.scatter(
        "x", "y", source=cursor, size=10, marker="circle", fill_color=PAPER.light, line_color=INK.light,
        line_width=2.2, level=OVER,
    )  # fmt: skip
    return plot


def friction_reach(problem: Problem, motion: DrawnMotion) -> float:
    """[m/s^2] from the middle of the friction plot to its rim: what is used, or all."""
    used = float(np.max(np.hypot(motion.columns["a"], motion.columns["turn"])))
    grip = problem.robot.friction_acceleration
    near = 1.35 * max(used, problem.robot.max_braking, problem.robot.max_acceleration)
    return near if near < 0.7 * grip else 1.12 * max(grip, used)


def label_places(
    curves: Sequence[Array],
    named: Sequence[int],
    frame: tuple[float, float, float, float],
    others: Sequence[tuple[float, float]] = (),
) -> list[tuple[float, float]]:
    """Where the words of some curves stand: just above their own, where they cover least of all.

    Parameters
    ----------
    curves : (n, 2) each, NaN where there is nothing.
    named : which of them have words.
    frame : x and y at which the plot begins and ends: x0, x1, y0, y1.
    others : the middle of the foot of other words, which these keep off.

    Returns
    -------
    The middle of the foot of each, as a point of its curve.
    """
    x0, x1, y0, y1 = frame
    low, size = np.array([x0, y0]), np.maximum([x1 - x0, y1 - y0], 1e-12)
    unit = [(curve - low) / size for curve in curves]
    every = np.concatenate(unit)
    half, tall = HALF, TALL
    taken = [(np.array(middle) - low) / size for middle in others]
    places = []
    for k in named:
        own = unit[k][np.isfinite(unit[k][:, 1])]
        inside = own[(own[:, 0] > half) & (own[:, 0] < 1.0 - half) & (own[:, 1] < 1.0 - tall)]
        spots = inside[:: max(1, len(inside) // 60)] if len(inside) else own[len(own) // 2 :][:1]
        off = every[None] - spots[:, None]
        covered = (np.abs(off[..., 0]) < half) & (off[..., 1] > 0.01) & (off[..., 1] < tall)
        cost = np.count_nonzero(covered, axis=1).astype(float)
        for other in taken:
            apart = np.abs(spots - other)
            cost += 1e4 * ((apart[:, 0] < 2.0 * half) & (apart[:, 1] < tall))
        best = spots[int(np.argmin(cost))]
        taken.append(best)
        places.append((float(x0 + best[0] * size[0]), float(y0 + best[1] * size[1])))
    return places


def _freer_on_the_right(
    curves: Sequence[Array], level: float, frame: tuple[float, float, float, float]
) -> bool:
    """Whether words at the right end of a level cover no more of the curves than at the left end."""
    x0, x1, y0, y1 = frame
    x, y = np.concatenate(curves).T
    near = (y > level + 0.01 * (y1 - y0)) & (y < level + TALL * (y1 - y0))
    part = (x[near] - x0) / max(x1 - x0, 1e-12)
    return bool(np.count_nonzero(part > 1.0 - 2.0 * HALF) <= np.count_nonzero(part < 2.0 * HALF))


def _words(
    plot: figure,
    at: tuple[float, float],
    words: str,
    colour: str,
    *,
    align: Literal["left", "right", "center"] = "center",
    below: bool = False,
) -> None:
    plot.add_layout(_label(at, words, colour, align=align, below=below))


def _label(
    at: tuple[float, float],
    words: str,
    colour: str,
    *,
    align: Literal["left", "right", "center"],
    below: bool = False,
    **more: Any,
) -> Label:
    return Label(
        x=at[0], y=at[1], text=words, text_color=colour, text_align=align, y_offset=-3 if below else 3,
        text_baseline="top" if below else "bottom", **GROUND, **WORDS, **more,
    )  # fmt: skip


def _level(plot: figure, value: float) -> None:
    plot.add_layout(
        Span(location=value, dimension="width", line_color=LIMIT.light, line_dash=LIMIT_DASH, line_width=1.3)
    )


def _circle(plot: figure, radius: float, colour: str, dash: Sequence[int]) -> None:
    plot.circle(
        x=[0.0],
        y=[0.0],
        radius=radius,
        fill_color=None,
        line_color=colour,
        line_dash=list(dash),
        line_width=1.5,
    )


def _time_cursor(plot: figure, name: str) -> None:
    plot.add_layout(
        Span(name=f"{name}-line", location=0.0, dimension="height", line_color=INK.light, line_width=1.3,
             level=OVER)
    )  # fmt: skip
    plot.scatter(
        "x", "y", source=empty(f"{name}-dots", "x", "y", "colour"), size=9, marker="circle",
        fill_color="colour", line_color=PAPER.light, line_width=1.5, level=OVER,
    )  # fmt: skip
