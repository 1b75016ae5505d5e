"""Speed graphs ready to draw: their edges as the curves they are, no more of them than a picture holds."""

from __future__ import annotations

import numpy as np

from verify.report.drawings import MOST_LINES, GraphDrawing, share
from vnav_drake.speed_graph.drawing import edge_points
from vnav_drake.speed_graph.published import PublishedGraph
from vnav_drake.speed_graph.sampled import SampledGraph

PIECES = 6  # straight ones that a line is drawn with


def sampled_drawing(graph: SampledGraph) -> GraphDrawing:
    """The sampled graph with at most MOST_LINES of its edges, evenly picked."""
    picked = share(len(graph.edges), MOST_LINES)
    return GraphDrawing(
        kind="sampled",
        nodes=graph.samples.point,
        lines=edge_points(graph, picked, PIECES),
        shown=len(picked),
        total=len(graph.edges),
    )


def published_drawing(graph: PublishedGraph) -> GraphDrawing:
    """The published graph: each edge as the path through the sampled graph that it stands for."""
    total = len(graph.edges)
    most = total
    while True:
        picked = share(total, most)
        steps = [graph.path_edge[edge] for edge in picked.tolist()]
        used = np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *steps]))
        if len(used) <= MOST_LINES or most <= 1:
            break
        most //= 2
    return GraphDrawing(
        kind="published",
        nodes=graph.point,
        lines=edge_points(graph.sampled, used, PIECES),
        shown=len(picked),
        total=total,
    )
