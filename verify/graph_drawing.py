"""Edges of speed graphs as the curves they are, ready to draw."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from verify.report.drawings import MOST_EDGES, GraphDrawing, share
from vnav_drake.arcs import leg_points

if TYPE_CHECKING:
    from vnav_drake.speed_graph.sampled import SampledGraph

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

PARTS = np.linspace(0.0, 1.0, 7)  # of an edge, where it has its points


def sampled_drawing(graph: SampledGraph) -> GraphDrawing:
    """The sampled graph with at most MOST_EDGES of its edges, evenly picked."""
    picked = share(len(graph.edges), MOST_EDGES)
    return GraphDrawing(
        kind="sampled",
        nodes=graph.samples.point,
        edges=edge_lines(graph, picked),
        total=len(graph.edges),
    )


def edge_lines(graph: SampledGraph, edge: Indices) -> Array:
    """Points (k, p, 2) [m] along edges (k,): optimal arcs within a cell, or pieces of borders."""
    lines = np.empty((len(edge), len(PARTS), 2))
    is_leg = graph.strip[edge] >= 0
    lines[is_leg] = _legs(graph, edge[is_leg])
    border = edge[~is_leg]
    u = graph.parameter[border]
    curves = graph.diagram.curves.take(graph.curve[border])
    lines[~is_leg] = curves.points(u[:, :1] + PARTS * (u[:, 1:] - u[:, :1]))
    return lines


def _legs(graph: SampledGraph, edge: Indices) -> Array:
    strip, theta = graph.strip[edge], graph.theta[edge]
    law, radius = graph.problem.braking, graph.problem.robot.radius
    ends = [graph.samples.clearance[node[edge]] for node in (graph.edges.tail, graph.edges.head)]
    d1, d2 = (np.maximum(d, law.margin) for d in ends)
    span = theta[:, 1] - theta[:, 0]
    swept, clearance = leg_points(law, radius, graph.strips.at_point[strip], d1, d2, span, PARTS)
    return graph.strips.points(strip, theta[:, :1] + swept, clearance + radius)
