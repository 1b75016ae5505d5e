"""Positions along the edges of a sampled speed graph."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vnav_drake.arcs import leg_points
from vnav_drake.speed_graph.sampled import SampledGraph
from vnav_drake.speed_graph.search import Found

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


def edge_points(graph: SampledGraph, edge: Indices, pieces: int = 16) -> Array:
    """Points (n, pieces + 1, 2) [m] along edges (n,), from tail to head.

    Evenly spaced in u along borders, in the parameter of `leg_points` along legs.
    """
    row = np.asarray(edge, dtype=np.int64)
    share = np.linspace(0.0, 1.0, pieces + 1)
    out = np.empty((len(row), pieces + 1, 2))
    strip, curve = graph.strip[row], graph.curve[row]
    leg = strip >= 0
    law, radius = graph.problem.braking, graph.problem.robot.radius
    k = strip[leg]
    ends = [graph.samples.clearance[n[row[leg]]] for n in (graph.edges.tail, graph.edges.head)]
    d1, d2 = (np.maximum(d, law.margin) for d in ends)
    theta = graph.theta[row[leg]]
    span = theta[:, 1] - theta[:, 0]
    if len(k):
        moved, d = leg_points(law, radius, graph.strips.at_point[k], d1, d2, span, share)
        out[leg] = graph.strips.points(k, theta[:, :1] + moved, d + radius)
    low, high = graph.parameter[row[~leg]].T
    out[~leg] = graph.diagram.curves.take(curve[~leg]).points(low[:, None] + (high - low)[:, None] * share)
    return out


def path_points(graph: SampledGraph, path: Found, pieces: int = 16) -> Array:
    """Points (n, 2) [m] of a path found in the graph, in its direction."""
    parts = edge_points(graph, path.edge, pieces)
    parts[~path.forward] = parts[~path.forward, ::-1]
    if len(parts) == 0:
        return graph.samples.point[[graph.start]]
    return np.concatenate([parts[:, :-1].reshape(-1, 2), parts[-1, -1:]])
