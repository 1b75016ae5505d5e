"""Voronoi arcs cut into slopes: stretches on which clearance rises from one end to the other.

Derived. Distance along every arc is convex (`voronoi.curves`), so that it has at most one interior
minimum; cut there, an arc is two slopes. At a node the arc between two neighbouring feet that are seen at
an angle gamma of each other leaves with d' = -cos(gamma / 2), falling for gamma < pi. As the angles around a
node sum up to 2 pi, at most one arc rises to first order, and an arc of constant clearance goes on
straight or ends: a plateau is a straight line, never a fork and never a ring.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from vnav_drake.voronoi import LINEAR, Curves, VoronoiDiagram

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]

LEVEL = 4e-9  # of the world's diameter: clearances this near are one, as nodes this near are (voronoi.nodes)
EXACT = 1e-12  # of the world's diameter: rounding of a clearance


@dataclass(frozen=True)
class Slopes:
    """The arcs of a diagram between vertices: its nodes, interior minima, and middles of level arcs.

    The first `len(diagram.nodes)` vertices are the nodes; those without arcs have no slope.
    """

    curves: Curves  # (p,) from the low end to the high end
    border: Indices  # (p,) row of `diagram.curves`
    low: Indices  # (p,) vertex
    high: Indices  # (p,) vertex
    level: Mask  # (p,) rises by no more than what counts as equal
    points: Array  # (v, 2) [m]
    distance: Array  # (v,) [m], to the nearest feature
    cut_border: Indices  # (v,) the arc that was cut there, -1 at nodes
    cut_parameter: Array  # (v,) [m], on that arc, 0 at nodes
    node_count: int
    rounding: float  # [m], of a distance

    @cached_property
    def used(self) -> Mask:
        """(v,) whether any slope ends there."""
        return np.bincount(np.concatenate([self.low, self.high]), minlength=len(self.points)) > 0

    @cached_property
    def plateau(self) -> Indices:
        """(v,) number of the connected stretch of equal clearance that a vertex belongs to."""
        count = len(self.points)
        low, high = self.low[self.level], self.high[self.level]
        link = coo_array((np.ones(len(low)), (low, high)), shape=(count, count))
        return connected_components(link, directed=False)[1].astype(np.int64)

    @cached_property
    def rising(self) -> Indices:
        """(v,) number of slopes that rise from a vertex, level ones left out."""
        return np.bincount(self.low[~self.level], minlength=len(self.points))


def cut_into_slopes(diagram: VoronoiDiagram) -> Slopes:
    """All Voronoi arcs of a diagram, cut at interior minima; level straight ones halfway."""
    rows = diagram.arcs
    arcs, ends = diagram.curves.take(rows), diagram.ends[rows]
    equal = LEVEL * diagram.world.diameter
    drift = np.abs(np.diff(arcs.distance(arcs.span), axis=1)[:, 0])
    is_level = (arcs.kind == LINEAR) & (drift <= equal)
    cut = np.flatnonzero(arcs.has_interior_minimum | is_level)
    whole = np.setdiff1d(np.arange(len(arcs)), cut)
    u = np.where(is_level, arcs.middle, 0.0)[cut]
    vertex = len(diagram.nodes) + np.arange(len(cut))
    at_cut = arcs.take(cut)
    points = np.concatenate([diagram.nodes, at_cut.points(u)])
    distance = np.concatenate([diagram.node_distance, at_cut.distance(u)])
    index = np.concatenate([whole, cut, cut])
    span = np.concatenate(
        [
            arcs.span[whole],
            np.column_stack([at_cut.span[:, 0], u]),
            np.column_stack([u, at_cut.span[:, 1]]),
        ]
    )
    pair = np.concatenate(
        [
            ends[whole],
            np.column_stack([ends[cut, 0], vertex]),
            np.column_stack([vertex, ends[cut, 1]]),
        ]
    )
    curves = arcs.take(index).cut(span)
    reach = curves.distance(span)
    down = reach[:, 0] > reach[:, 1]
    low, high = np.where(down[:, None], pair[:, ::-1], pair).T
    return Slopes(
        curves.reversed(down),
        rows[index],
        low,
        high,
        np.abs(reach[:, 1] - reach[:, 0]) <= equal,
        points,
        distance,
        np.concatenate([np.full(len(diagram.nodes), -1), rows[cut]]),
        np.concatenate([np.zeros(len(diagram.nodes)), u]),
        len(diagram.nodes),
        EXACT * diagram.world.diameter,
    )
