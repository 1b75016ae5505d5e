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

    Evenly spaced in u along borders, in the parameter of `leg_points` along legs. Legs of a robot without
    extent turn sharply where they pass close to a point: half of their points are evenly spaced in angle.
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
        at_point = graph.strips.at_point[k]
        fraction = np.tile(share, (len(k), 1))
        if radius + law.margin == 0.0:
            fraction[at_point] = _by_angle(d1[at_point], d2[at_point], span[at_point], pieces)
        moved, d = leg_points(law, radius, at_point, d1, d2, span, fraction)
        out[leg] = graph.strips.points(k, theta[:, :1] + moved, d + radius)
    low, high = graph.parameter[row[~leg]].T
    out[~leg] = graph.diagram.curves.take(curve[~leg]).points(low[:, None] + (high - low)[:, None] * share)
    return out


def _by_angle(r1: Array, r2: Array, span: Array, pieces: int) -> Array:
    """Fractions (n, pieces + 1), half of them even, half of them at even steps of the swept angle.

    Derived: with w = sqrt(z) the leg is a straight line from q1 = sqrt(r1) to q2 = sqrt(r2), seen from zero
    under the angle span / 2. By the law of sines it is seen under phi at the fraction
    q1 sin(phi) / (q1 sin(phi) + q2 sin(span / 2 - phi)).
    """
    even = pieces // 2
    half = 0.5 * np.maximum(span, 1e-6)[:, None]
    phi = half * (np.arange(pieces - even) + 0.5) / (pieces - even)
    near, far = np.sqrt(r1)[:, None] * np.sin(phi), np.sqrt(r2)[:, None] * np.sin(half - phi)
    fraction = near / np.maximum(near + far, np.finfo(float).tiny)
    return np.sort(np.concatenate([np.tile(np.linspace(0.0, 1.0, even + 1), (len(r1), 1)), fraction], axis=1))


def path_points(graph: SampledGraph, path: Found, pieces: int = 16) -> Array:
    """Points (n, 2) [m] of a path found in the graph, in its direction."""
    parts = edge_points(graph, path.edge, pieces)
    parts[~path.forward] = parts[~path.forward, ::-1]
    if len(parts) == 0:
        return graph.samples.point[[graph.start]]
    return np.concatenate([parts[:, :-1].reshape(-1, 2), parts[-1, -1:]])
