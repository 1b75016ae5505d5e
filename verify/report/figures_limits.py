"""How far the speed can be scaled before the vehicle no longer holds."""

from __future__ import annotations

from functools import partial

from markupsafe import Markup
from matplotlib.axes import Axes

from verify.report.curves import halo
from verify.report.numbers import significant
from verify.report.palette import INK, LIMIT, MUTED, PAPER, method
from verify.report.story_limits import Margin, short
from verify.report.svg import WIDE, Picture, both_widths, new_axes, to_svg

MOST_NAMED = 4  # causes written beside crosses, those of the least factors
MOST_FACTOR = 20.0  # what is beyond is drawn at the edge: nobody drives it


def draw_limits(found: Margin) -> Picture:
    """One axis of factors of the speed: runs that held and runs that did not, and the analytic limit."""
    runs = [*found.trials, *([] if found.over is None else [found.over])]
    held, broke = ([run for run in runs if run.holds == kind] for kind in (True, False))
    spoken = [
        f"{len(held)} runs held"
        + (f", up to factor {significant(max(r.factor for r in held))}" if held else "")
    ]
    if broke:
        spoken.append(f"{len(broke)} did not, from factor {significant(min(r.factor for r in broke))} on")
    if found.analytic is not None:
        spoken.append(f"the analytic limit is at {significant(found.analytic)}")
    described = {
        "key": "limits",
        "title": "How far the speed can be scaled",
        "description": "; ".join(spoken) + ".",
    }
    return both_widths(
        partial(_draw, found),
        described,
        heading="How far the speed can be scaled",
        caption="One mark a run at that many times the planned speed: a dot where it held, a cross where it "
        "did not. At 1 it is driven as planned, and only there are braking zone and emergency stops "
        "examined: a factor that holds is no safe speed.",
    )


def _draw(found: Margin, described: dict[str, str], width: float) -> Markup:
    wide, look = width == WIDE, method("simulation")
    figure, axes = new_axes(width, 150 if wide else 176, x="times the planned speed", y="")
    runs = [*found.trials, *([] if found.over is None else [found.over])]
    limit = None if found.analytic is None else min(found.analytic, MOST_FACTOR)
    known = [1.0, *(min(run.factor, MOST_FACTOR) for run in runs), *([] if limit is None else [limit])]
    low, high = min(known), max(known)
    pad = 0.06 * max(high - low, 0.1)
    axes.set_xlim(low - pad, high + pad)
    axes.set_ylim(-1.0, 1.0)
    axes.set_yticks([])
    axes.spines["left"].set_visible(False)
    axes.axhline(0.0, color=MUTED.light, lw=0.8, zorder=0)
    axes.axvline(1.0, color=MUTED.light, lw=1.2)
    _write(axes, "as planned", 1.0, -0.8, MUTED.light, low, high)
    if limit is not None:
        axes.axvline(limit, color=LIMIT.light, lw=1.4, ls="--")
        _write(axes, f"analytic: {short(found.analytic_by)}", limit, 0.9, LIMIT.light, low, high)
    if found.factor is not None and 0.0 < found.factor <= MOST_FACTOR:
        axes.plot(
            [low - pad, found.factor], [0.0, 0.0], color=look.light, lw=4.0, solid_capstyle="butt", zorder=1
        )
        _write(
            axes,
            f"holds up to {significant(found.factor)}",
            found.factor,
            -0.38,
            look.text,
            low,
            high,
            bold=True,
        )
    for run in runs:
        at = min(run.factor, MOST_FACTOR)
        if run.holds:
            axes.plot(at, 0.0, "o", ms=7, mfc=look.light, mec=PAPER.light, mew=1.0, zorder=3)
        else:
            axes.plot(at, 0.0, "X", ms=9, mfc=LIMIT.light, mec=PAPER.light, mew=1.0, zorder=3)
    broke = sorted((run for run in runs if not run.holds and run.cause), key=lambda run: run.factor)
    shown: list[tuple[float, str]] = []
    for run in broke:
        cause = short(run.cause)
        if len(shown) < MOST_NAMED and all(cause != other for _, other in shown):
            shown.append((min(run.factor, MOST_FACTOR), cause))
    for k, (at, cause) in enumerate(shown):
        _write(axes, cause, at, 0.3 + 0.26 * (k % 2), INK.light, low, high)
    return to_svg(figure, **described)


def _write(
    axes: Axes, text: str, x: float, y: float, colour: str, low: float, high: float, *, bold: bool = False
) -> None:
    right = x > low + 0.65 * (high - low)
    halo(
        axes.annotate(
            text, (x, y), (-5 if right else 5, 0), textcoords="offset points", va="center",
            ha="right" if right else "left", fontsize=10, color=colour, weight="bold" if bold else "normal",
        )
    )  # fmt: skip
