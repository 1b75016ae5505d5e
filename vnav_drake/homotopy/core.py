"""The part of a diagram that tells homotopy classes apart: its 2-core, as chains between branchings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from vnav_drake.voronoi import VoronoiDiagram

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]

SHORT = 0.05  # of its least distance to a feature: a chain this short is a crossing that was drawn inexactly


@dataclass(frozen=True)
class Core:
    """Voronoi arcs without dead ends, grouped into chains."""

    arcs: Indices  # (k,), rows of the diagram's curves
    ends: Indices  # (k, 2), rows of the diagram's nodes
    chain: Indices  # (k,), numbered from 0
    least: Array  # (chains,) [m], least distance to a feature
    gateless: Mask  # (chains,) short, and not part of a ring of short ones


def find_core(diagram: VoronoiDiagram) -> Core:
    """The 2-core of a diagram's Voronoi arcs.

    Dead ends are dropped one after the other; arcs are joined at nodes where two meet. A component
    without a branching is one chain. Short chains (SHORT) carry no gate where they form no ring.
    """
    arcs, count = diagram.arcs, len(diagram.nodes)
    while True:
        degree = np.bincount(diagram.ends[arcs].reshape(-1), minlength=count)
        inner = (degree[diagram.ends[arcs]] > 1).all(axis=1)
        if inner.all():
            break
        arcs = arcs[inner]
    ends = diagram.ends[arcs]
    half_node, half_arc = ends.reshape(-1), np.repeat(np.arange(len(arcs)), 2)
    order = np.argsort(half_node, kind="stable")
    passing = half_arc[order][degree[half_node[order]] == 2].reshape(-1, 2)
    link = coo_array((np.ones(len(passing)), passing.T), shape=(len(arcs), len(arcs)))
    chains, chain = connected_components(link, directed=False) if len(arcs) else (0, half_arc)
    chain = chain.astype(np.int64)
    curves = diagram.curves.take(arcs)
    least = np.full(chains, np.inf)
    np.minimum.at(least, chain, curves.least_distance)
    length = np.bincount(chain, weights=curves.length, minlength=chains)
    outer = degree[half_node] > 2
    stops = np.full((chains, 2), -1)
    by_chain = np.argsort(chain[half_arc[outer]], kind="stable")
    pairs = half_node[outer][by_chain].reshape(-1, 2)
    stops[chain[half_arc[outer]][by_chain][::2]] = pairs
    return Core(arcs, ends, chain, least, _gateless(stops, length <= SHORT * least, count))


def _gateless(stops: Indices, short: Mask, count: int) -> Mask:
    """Which short chains (mask (m,)) lie in trees of short chains; `stops` (m, 2) are their end nodes."""
    rows = np.flatnonzero(short & (stops[:, 0] >= 0))
    gateless = np.zeros(len(short), dtype=bool)
    link = coo_array((np.ones(len(rows)), stops[rows].T), shape=(count, count))
    groups, label = connected_components(link, directed=False)
    edges = np.bincount(label[stops[rows, 0]], minlength=groups)
    gateless[rows] = (edges == np.bincount(label, minlength=groups) - 1)[label[stops[rows, 0]]]
    return gateless


def pieces(core: Core, gated: Indices) -> Indices:
    """Pieces (g, 2) of free space before and behind gates in rows `gated` of the core (growing u)."""
    used, index = np.unique(core.ends, return_inverse=True)
    ends = index.reshape(-1, 2)
    open_arcs = np.ones(len(ends), dtype=bool)
    open_arcs[gated] = False
    link = coo_array((np.ones(int(open_arcs.sum())), ends[open_arcs].T), shape=(len(used), len(used)))
    _, label = connected_components(link, directed=False)
    return label.astype(np.int64)[ends[gated]]
