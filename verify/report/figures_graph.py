"""The speed graphs on the map: nodes and edges, thinned where there are too many to see."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline
from numpy.typing import NDArray

from verify.report.drawings import GraphDrawing, share
from verify.report.figures_map import draw_ends, draw_world, map_height
from verify.report.numbers import count
from verify.report.palette import INK, MUTED, method
from verify.report.svg import PANEL, Picture, drawing_style, new_axes, to_svg
from vnav_drake.problem import Problem

Array = NDArray[np.float64]

FEW_NODES = 200  # up to which nodes and edges are drawn to be seen one by one
MOST_NODES = 4000

_WORDS = {
    "sampled": ("The sampled graph", "samples on all borders of the proximity cells, legs within a cell"),
    "published": (
        "The published graph",
        "a node at the least clearance of each Voronoi arc, joined by the fastest paths within the Voronoi "
        "cell of an obstacle (Manor 2015, Definition 15)",
    ),
}


def draw_graphs(problem: Problem, graphs: Sequence[GraphDrawing]) -> Sequence[Picture]:
    """One map for each graph."""
    with drawing_style():
        return [_graph(problem, graph) for graph in graphs]


def _graph(problem: Problem, graph: GraphDrawing) -> Picture:
    key = f"graph-{graph.kind}"
    title, made_of = _WORDS.get(graph.kind, (f"The {graph.kind} graph", "nodes and edges"))
    nodes = graph.nodes[share(len(graph.nodes), MOST_NODES)]
    shown = f"{count(graph.total)} edges"
    if graph.shown < graph.total:
        shown = f"{count(graph.shown)} of {shown} are drawn, evenly picked"
    else:
        shown += ", all drawn"
    told = f"{count(len(graph.nodes))} nodes, {shown}"
    if len(nodes) < len(graph.nodes):
        told += f"; {count(len(nodes))} of the nodes are drawn"
    caption = f"{made_of[:1].upper()}{made_of[1:]}. {told}."
    svg = _draw(problem, nodes, graph.lines, {"key": key, "title": title, "description": caption})
    return Picture(key=key, title=title, description=caption, svg=svg, heading=title, caption=caption)


def _draw(problem: Problem, nodes: Array, lines: Array, described: dict[str, str]) -> Markup:
    figure, axes = new_axes(PANEL, map_height(problem.world, PANEL, bar=False), x="x [m]", y="y [m]")
    draw_world(axes, problem.world, names=False)
    look = method("speed_graph")
    few = len(nodes) <= FEW_NODES
    _lines(axes, lines, look.text, 0.8 if few else 0.35)
    dots = _distinct(nodes, problem.world.diameter / 600.0)
    axes.plot(*dots.T, "o", color=INK.light if few else MUTED.light, ms=3.4 if few else 1.4, mew=0)
    draw_ends(axes, problem, None)
    return to_svg(figure, **described)


def _lines(axes: Axes, lines: Array, colour: str, width: float) -> None:
    """All lines as one outline: a fraction of the size of one element each."""
    if not len(lines):
        return
    codes = np.full(lines.shape[:2], Outline.LINETO)
    codes[:, 0] = Outline.MOVETO
    outline = Outline(lines.reshape(-1, 2), codes.ravel())
    axes.add_patch(PathPatch(outline, fill=False, edgecolor=colour, lw=width, alpha=0.7))


def _distinct(points: Array, step: float) -> Array:
    """One of the points for each grid cell of side `step`."""
    cell = np.round(points / step).astype(np.int64)
    return points[np.sort(np.unique(cell, axis=0, return_index=True)[1])]
