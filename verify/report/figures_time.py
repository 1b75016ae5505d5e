"""The bracket: all travel times on one axis, the proven bound on the left."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.transforms import Transform

from verify.report.curves import halo
from verify.report.numbers import percent_or_times, seconds, seconds_proven
from verify.report.palette import BAD_FILL, INK, LIMIT, MUTED, PAPER, method
from verify.report.svg import NARROW, WIDE, Picture, drawing_style, new_axes, to_svg

FAR = 1.4  # times the least time: what lies beyond, and is not what is asked about, is an arrow at the edge


@dataclass(frozen=True, kw_only=True)
class BracketRow:
    """One travel time of the bracket."""

    method: str
    travel_time: float  # [s]
    breaks: str = ""  # what a motion of the full model breaks, in a few words
    astray: bool = False  # goes by another way than asked for: not compared


@dataclass(frozen=True, kw_only=True)
class BracketData:
    """Travel times from top to bottom, and what they are compared with."""

    rows: Sequence[BracketRow]
    reference: str  # method whose time is 0 %
    executed: str  # method whose motion is executed
    upper: float | None = None  # [s], what the proven bound is held against; None: no bracket
    full_bound: float | None = None  # [s], what no motion of the full robot can beat


def draw_bracket(data: BracketData) -> Picture:
    """Dot plot of travel times; distances from the reference in percent beside it."""
    spoken = "; ".join(
        ", ".join(filter(None, [f"{method(r.method).label} {_figure(r)}", *_notes(r)])) for r in data.rows
    )
    described = {
        "key": "bracket",
        "title": "Travel times on one axis",
        "description": f"Dots on a time axis, one row a method: {spoken}.",
    }
    with drawing_style():
        return Picture(
            **described,
            svg=_draw(data, described, narrow=False),
            narrow=_draw(data, {**described, "key": "bracket-narrow"}, narrow=True),
            caption="Arrows at the right edge: times far beyond the axis."
            if any(row.travel_time > _axis_end(data) for row in data.rows)
            else "",
        )


def _figure(row: BracketRow) -> str:
    return (seconds_proven if row.method == "lower_bound" else seconds)(row.travel_time)


def _notes(row: BracketRow) -> tuple[str, str]:
    return row.breaks, "by another way than asked for" if row.astray else ""


def _draw(data: BracketData, described: dict[str, str], *, narrow: bool) -> Markup:
    rows, end = data.rows, _axis_end(data)
    pitch = 58 if narrow else 34
    figure, axes = new_axes(NARROW if narrow else WIDE, 56 + pitch * len(rows), x="travel time [s]", y="")
    middle = 0.5 * (min(r.travel_time for r in rows) + end)
    reference = next((r.travel_time for r in rows if r.method == data.reference), None)
    for i, row in enumerate(rows):
        look = method(row.method)
        bold = "bold" if row.method == data.executed else "normal"
        if reference is not None and not row.astray:
            axes.plot([reference, row.travel_time], [i, i], color=look.light, lw=2.5, solid_capstyle="butt")
        fill, edge, line = (PAPER, look, 1.8) if row.breaks else (look, INK, 0.8)
        place, marker = (1.0, ">") if row.travel_time > end else (row.travel_time, look.marker)
        axes.plot(
            place,
            i,
            marker,
            color=fill.light,
            ms=9,
            mec=edge.light,
            mew=line,
            clip_on=False,
            transform=axes.get_yaxis_transform() if row.travel_time > end else axes.transData,
        )
        if row.breaks:
            far, left = row.travel_time > end, row.travel_time < middle
            _write(
                axes,
                row.breaks,
                (1.0 if far else row.travel_time, i),  # beside its mark
                (-5 if left else 5, -7),
                look.text,
                "normal",
                ha="left" if left else "right",
                va="top",
                fontsize=11 if narrow else 9,
                xycoords=axes.get_yaxis_transform() if far else "data",
            )
        share = ""
        if row.astray:
            share = "another way"
        elif reference is not None:
            same = row.method == data.reference
            share = "reference" if same else percent_or_times(row.travel_time / reference - 1.0)
        if narrow:
            axes.axhspan(i - 0.58, i - 0.22, color=PAPER.light, lw=0.0, zorder=1.5)  # no line crosses letters
            for words, at, side in ((look.label, 0.0, "left"), (f"{_figure(row)}  {share}", 1.0, "right")):
                _write(axes, words, (at, i), (0, 14), look.text, bold, ha=side, va="bottom", fontsize=12)
            continue
        for words, at, offset, side in (
            (look.label, 0.0, (-14, 0), "right"),
            (_figure(row), 1.0, (76, 0), "right"),
            (share, 1.0, (152, 0), "right"),
        ):
            _write(axes, words, (at, i), offset, look.text, bold, ha=side, va="center", fontsize=11)
    _draw_proven(axes, data, narrow=narrow)
    if reference is not None:
        axes.axvline(
            reference,
            color=LIMIT.light if data.reference == "lower_bound" else MUTED.light,
            lw=1,
            ls="--",
            zorder=0,
        )
    least = min(r.travel_time for r in rows)
    pad = max(0.05 * (end - least), 2e-4 * end)
    axes.set_xlim(least - pad, end + pad)
    axes.set_ylim(len(rows) - 0.5, -0.58 if narrow else -0.5)
    axes.set_yticks([])
    axes.spines["left"].set_visible(False)
    axes.locator_params(axis="x", nbins=4 if narrow else 8)
    axes.xaxis.get_major_formatter().set_useOffset(False)  # type: ignore[attr-defined]
    return to_svg(figure, **described)


def _axis_end(data: BracketData) -> float:
    """The latest time [s] that is drawn to scale: one far off must not hide what lies between the others.

    The motion executed, what the bound is held against and the reference are never far off.
    """
    near = [row.travel_time for row in data.rows if row.method in (data.executed, data.reference)]
    least = min(row.travel_time for row in data.rows)
    held = max([least, *near, *([] if data.upper is None else [data.upper])])
    return max(held, *(row.travel_time for row in data.rows if row.travel_time <= FAR * least))


def _draw_proven(axes: Axes, data: BracketData, *, narrow: bool) -> None:
    """The bracket of the proven bound, on its row and over all rows, and that of the full robot."""
    rows = {row.method: (i, row.travel_time) for i, row in enumerate(data.rows)}
    if "lower_bound" not in rows:
        return
    i, proven = rows["lower_bound"]
    half = 0.18 if narrow else 0.28  # of a row
    axes.axvspan(0.0, proven, color=BAD_FILL.light, lw=0.0, zorder=-1)
    axes.axvline(proven, color=INK.light, lw=1.4, zorder=1)
    if data.upper is not None:
        edge = [proven, proven, data.upper, data.upper]
        axes.plot(edge, [i - half, i + half, i + half, i - half], color=INK.light, lw=1.4)
    if data.full_bound is not None and "refined" in rows:
        k, time = rows["refined"]
        axes.plot([data.full_bound] * 2, [k - half, k + half], color=INK.light, lw=2.4)
        axes.plot([data.full_bound, time], [k + half] * 2, color=INK.light, lw=1.0)


def _write(
    axes: Axes,
    text: str,
    at: tuple[float, float],
    offset: tuple[float, float],
    colour: str,
    weight: str,
    xycoords: str | tuple[str, str] | Transform = ("axes fraction", "data"),
    **place: Any,
) -> None:
    """Text beside a row: `at` in shares of the width and rows unless said otherwise, `offset` in pixels."""
    halo(
        axes.annotate(
            text,
            at,
            offset,
            xycoords=xycoords,
            textcoords="offset points",
            color=colour,
            weight=weight,
            **place,
        )
    )
