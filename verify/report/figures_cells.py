"""The vc-method on the map: stacks of cells, critical points, and the routes that both costs choose."""

from __future__ import annotations

from functools import partial

import numpy as np
import shapely
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.patches import PathPatch

from verify.report.curves import halo
from verify.report.drawings import VcDrawing
from verify.report.figures_map import draw_ends, draw_world, map_height, outline
from verify.report.figures_space import one_outline, shown_words
from verify.report.figures_unfolded import MOST_NUMBERS
from verify.report.numbers import count
from verify.report.palette import ARC, CASING, INK, LIMIT, PAPER, method
from verify.report.series import thinned_path
from verify.report.svg import WIDE, Picture, both_widths, new_axes, to_svg
from vnav_drake.problem import Problem

OTHER_DASH = (0, (2.5, 1.5))


def draw_cells(problem: Problem, drawing: VcDrawing) -> Picture:
    """Arcs, bottom edges of vertical partitions, saddles and maxima, the chain of stacks and the routes."""
    space = drawing.space
    other = "" if drawing.other is None else f" Dashed: the route that the {drawing.other_cost} costs choose."
    described = {
        "key": "vc-cells",
        "title": "Map of the cells and the route",
        "description": f"Voronoi arcs, {count(len(space.saddles))} saddles with the bottom edges of their "
        f"vertical partitions, {count(len(space.maxima))} maxima, and the route through "
        f"{count(len(drawing.unfolded.stacks))} stacks.{other}",
    }
    return both_widths(
        partial(_draw, problem, drawing),
        described,
        heading="Cells from above",
        caption="Saddles (×) with the bottom edges of their vertical partitions, maxima (△), and the stacks "
        f"that the route passes, numbered as in the unfolded profile.{other} {shown_words(space)}",
    )


def _draw(problem: Problem, drawing: VcDrawing, described: dict[str, str], width: float) -> Markup:
    world, space, wide = problem.world, drawing.space, width == WIDE
    figure, axes = new_axes(width, map_height(world, width, bar=False), x="x [m]", y="y [m]")
    draw_world(axes, world, names=False)
    look, thin = method("vc_method"), 1.0 if wide else 0.65
    for i, stack in enumerate(drawing.unfolded.stacks):
        for polygon in shapely.get_parts(stack.ground):
            if isinstance(polygon, shapely.Polygon) and not polygon.is_empty:
                axes.add_patch(
                    PathPatch(
                        outline(polygon), facecolor=look.light, alpha=(0.22, 0.36)[i % 2], lw=0, zorder=0.7
                    )
                )
    size = world.diameter
    rough = size if wide else 4.0 * size
    arcs = [
        np.column_stack(thinned_path(arc[:, 0], arc[:, 1], rough)) for arc in drawing.arcs if len(arc) > 1
    ]
    axes.add_patch(PathPatch(one_outline(arcs), fill=False, edgecolor=ARC.light, lw=0.7))
    axes.add_patch(PathPatch(one_outline(list(space.feet)), fill=False, edgecolor=LIMIT.light, lw=1.4 * thin))
    if drawing.other is not None:
        axes.plot(
            *thinned_path(drawing.other[:, 0], drawing.other[:, 1], size), color=INK.light, lw=1.8 * thin,
            ls=OTHER_DASH, dash_capstyle="butt", zorder=3,
        )  # fmt: skip
    route = thinned_path(drawing.route[:, 0], drawing.route[:, 1], size)
    axes.plot(*route, color=CASING.light, lw=4.4 * thin, zorder=3)
    axes.plot(*route, color=look.light, lw=3.0 * thin, zorder=3)
    _points(axes, drawing, thin)
    if len(drawing.unfolded.stacks) <= MOST_NUMBERS:
        _numbers(axes, drawing, 10 if wide else 7)
    draw_ends(axes, problem, None)
    return to_svg(figure, **described)


def _points(axes: Axes, drawing: VcDrawing, thin: float) -> None:
    for points, marker, face in (
        (drawing.space.saddles, "X", LIMIT.light),
        (drawing.space.maxima, "^", PAPER.light),
    ):
        axes.plot(
            points[:, 0], points[:, 1], marker, ms=7 * thin, mfc=face, mec=INK.light, mew=0.8 * thin,
            ls="none", zorder=4,
        )  # fmt: skip


def _numbers(axes: Axes, drawing: VcDrawing, size: float) -> None:
    """The number of each stack beside the middle of the route's way through it."""
    run = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(drawing.route, axis=0).T))])
    for number, stack in enumerate(drawing.unfolded.stacks, 1):
        middle = 0.5 * (stack.begin + stack.end) / drawing.unfolded.s[-1] * run[-1]
        here, ahead = (
            np.array([np.interp(at, run, drawing.route[:, k]) for k in (0, 1)])
            for at in (middle, middle + 0.01 * run[-1])
        )
        along = (ahead - here) / max(float(np.hypot(*(ahead - here))), 1e-300)
        halo(
            axes.annotate(
                str(number), (here[0], here[1]), (-12 * along[1], 12 * along[0]),
                textcoords="offset points", ha="center", va="center", fontsize=size, weight="bold",
                color=INK.light, zorder=6,
            )
        )  # fmt: skip
