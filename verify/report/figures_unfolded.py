"""The vc-method's route unfolded: speed over arc length below the roof of the free space."""

from __future__ import annotations

from functools import partial

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.patches import PathPatch
from numpy.typing import NDArray

from verify.report.curves import Curve, halo, label_curves
from verify.report.drawings import UnfoldedDrawing, VcDrawing
from verify.report.figures_motion import LIMIT_DASH
from verify.report.figures_space import one_outline
from verify.report.numbers import count
from verify.report.palette import INK, LIMIT, MUTED, PAPER, RACK, Dash, method
from verify.report.svg import WIDE, Picture, both_widths, new_axes, to_svg

Array = NDArray[np.float64]

# How the profile runs: name, colour, dash, width. Apart by width and dash as well as by colour.
RUNS: dict[str, tuple[str, str, Dash, float]] = {
    "boundary": ("on the limit V(d)", method("vc_method").text, "solid", 4.0),
    "accelerate": ("accelerating at a_max", method("refined").text, (0, (6, 1.5)), 2.6),
    "brake": ("braking at a_b", method("simulation").text, (0, (1.6, 1.2)), 2.6),
}
MOST_RADII = 20  # more corners than that are marked without their radius
MOST_NUMBERS = 40  # more stacks than that are not numbered


def draw_unfolded(drawing: VcDrawing) -> Picture:
    """Speed over arc length along the route: roof, cells, profile, motion and corners."""
    found = drawing.unfolded
    kinds = [name for name in RUNS if any(kind == name for kind, _, _ in found.pieces)]
    runs = ", ".join(RUNS[name][0] for name in kinds)
    described = {
        "key": "vc-unfolded",
        "title": "Speed along the route, unfolded",
        "description": f"Speed over arc length through {count(len(found.stacks))} stacks of cells, "
        f"{count(len(found.saddles))} saddles between them. The profile runs {runs}, below the roof V(d).",
    }
    return both_widths(
        partial(_draw, found),
        described,
        heading="Speed along the route, unfolded",
        caption="Over the arc length of the route along the Voronoi arcs, corners and all. "
        "Below the roof lies free space, cut by vertical partitions at the saddles (×) and by horizontal "
        "ones at the heights of saddles and maxima; the cells of the chain are tinted, their vertices "
        "joined by dotted steps. The thin line is the motion on the smooth path, rings the corners that "
        "were rounded. Compare Manor 2015, Fig. 2.10.",
    )


def _draw(found: UnfoldedDrawing, described: dict[str, str], width: float) -> Markup:
    wide = width == WIDE
    figure, axes = new_axes(width, 400 if wide else 320, x="arc length [m]", y="speed [m/s]")
    axes.grid(False)
    top = 1.24 * max(float(found.roof.max()), float(found.driven[:, 1].max(initial=0.0)))
    axes.set_xlim(0.0, float(found.s[-1]))
    axes.set_ylim(0.0, top)
    axes.fill_between(found.s, found.roof, top, color=RACK.light, alpha=0.55, lw=0, zorder=0.5)
    _cells(axes, found, top, wide)
    axes.plot(found.s, found.roof, color=LIMIT.light, lw=1.2, ls=LIMIT_DASH, zorder=3)
    look = method("vc_method")
    labelled = [Curve(x=found.s, y=found.roof)]
    for kind, (_, colour, dash, broad) in RUNS.items():
        ways = one_outline([np.column_stack([s, v]) for k, s, v in found.pieces if k == kind])
        width = broad if wide else 0.75 * broad
        axes.add_patch(
            PathPatch(ways, fill=False, edgecolor=colour, ls=dash, lw=width, capstyle="butt", zorder=4)
        )
    for kind, (words, colour, _, _) in RUNS.items():
        longest = max(
            ((s, v) for k, s, v in found.pieces if k == kind),
            key=lambda piece: np.ptp(piece[0]),
            default=None,
        )
        if longest is not None:
            labelled.append(Curve(x=longest[0], y=longest[1], text=words if wide else kind, colour=colour))
    axes.plot(*found.driven.T, color=INK.light, lw=1.0, zorder=5)
    labelled.append(Curve(x=found.driven[:, 0], y=found.driven[:, 1]))
    axes.plot(
        found.saddles[:, 0], found.saddles[:, 1], "X", mfc=LIMIT.light, mec=INK.light, ms=7, mew=0.8, zorder=6
    )
    axes.plot(
        found.corners[:, 0], found.corners[:, 1], "o", mfc=PAPER.light, mec=look.text, ms=6, mew=1.6, zorder=7
    )
    if wide and len(found.corners) <= MOST_RADII:
        _radii(axes, found)
    label_curves(axes, labelled, size=9.5)
    return to_svg(figure, **described)


def _cells(axes: Axes, found: UnfoldedDrawing, top: float, wide: bool) -> None:
    """Partitions where the route passes them, and the cells of its chain."""
    look = method("vc_method")
    for number, stack in enumerate(found.stacks, 1):
        inside = (found.s >= stack.begin) & (found.s <= stack.end)
        s, roof, bottom = found.s[inside], found.roof[inside], 0.0
        for height, used in zip(stack.tops, stack.used, strict=True):
            if used:
                axes.fill_between(
                    s, bottom, np.clip(roof, bottom, height), color=look.light, alpha=0.22, lw=0, zorder=0.6
                )
            below = np.where(roof >= height, height, np.nan)
            axes.plot(s, below, color=MUTED.light, lw=0.8, zorder=1)
            bottom = height
        if len(found.stacks) <= MOST_NUMBERS:
            axes.text(
                0.5 * (stack.begin + stack.end), 0.985 * top, str(number), ha="center", va="top",
                fontsize=10 if wide else 8, weight="bold", color=INK.light,
            )  # fmt: skip
    walls = [np.array([(s, 0.0), (s, v)]) for s, v in found.saddles.tolist()]
    axes.add_patch(PathPatch(one_outline(walls), fill=False, edgecolor=LIMIT.light, lw=1.6, zorder=2))
    rules = [np.array([(s, 0.0), (s, np.interp(s, found.s, found.roof))]) for s in found.nodes.tolist()]
    axes.add_patch(
        PathPatch(one_outline(rules), fill=False, edgecolor=MUTED.light, lw=0.7, ls=(0, (1, 2)), zorder=1)
    )
    axes.plot(*found.chain.T, "o", color=look.text, ms=4, ls=(0, (1, 1.5)), lw=1.0, zorder=2)


def _radii(axes: Axes, found: UnfoldedDrawing) -> None:
    for s, v, radius, _ in found.corners.tolist():
        halo(
            axes.annotate(
                f"r {radius:.2g} m", (s, v), (0, -9), textcoords="offset points", ha="center", va="top",
                fontsize=9, color=method("vc_method").text, zorder=8,
            )
        )  # fmt: skip
