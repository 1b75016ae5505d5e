"""The speed graph as published: Manor 2015, Definition 15.

Nodes are the places of least clearance on every Voronoi arc, possibly an end of it. Two nodes on the border
of a common Voronoi cell, that of a whole obstacle, are joined by the fastest path within that cell, through
its proximity cells and along Voronoi arcs where it saturates (Sec. 3.5). These paths are taken from the
sampled graph, restricted to the cells of the obstacle: their times are upper bounds that converge with its
spacing. Walls that touch are one obstacle, the boundary with all that touches it another.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from vnav_drake.speed_graph.route import Route
from vnav_drake.speed_graph.sampled import SampledGraph, demand_paths, gate_numbers
from vnav_drake.speed_graph.search import Edges, SearchResult, search_classes, shortest_paths

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class PublishedGraph:
    """Nodes and edges of Definition 15, start and goal attached in the cells that hold them."""

    sampled: SampledGraph
    node: Indices  # (n,) the nodes in the sampled graph, start and goal last
    edges: Edges  # between rows of `node`; not every pair has an edge
    obstacle: Indices  # (e,) in whose Voronoi cell each edge runs
    path_edge: tuple[Indices, ...]  # of each edge: edges of the sampled graph from tail to head
    path_forward: tuple[Mask, ...]  # and whether they are used from their own tail to head

    @property
    def point(self) -> Array:
        """(n, 2) [m]"""
        return self.sampled.samples.point[self.node]

    @property
    def node_count(self) -> int:
        """Number of nodes, start and goal included."""
        return len(self.node)

    @property
    def start(self) -> int:
        """Its row of `node`."""
        return len(self.node) - 2

    @property
    def goal(self) -> int:
        """Its row of `node`."""
        return len(self.node) - 1


def obstacle_of_cells(graph: SampledGraph) -> Indices:
    """Number of the obstacle (from 0) that each proximity cell of the world belongs to."""
    world = graph.diagram.world
    count, edges = len(world.vertices), world.edges
    link = coo_array((np.ones(len(edges)), edges.T), shape=(count, count))
    _, of_vertex = connected_components(link, directed=False)
    return np.concatenate([np.repeat(of_vertex[edges[:, 0]], 2), of_vertex]).astype(np.int64)


def build_published(graph: SampledGraph) -> PublishedGraph:
    """The published graph of the same problem, its edges timed on the sampled graph."""
    owner = obstacle_of_cells(graph)
    cells = graph.diagram.cells
    node = np.append(np.setdiff1d(_least_clearance_nodes(graph), (graph.start, graph.goal)), graph.start)
    node = np.append(node, graph.goal)
    obstacle, member = _borders(graph, owner, node)
    leg = graph.strip >= 0
    # an edge along an arc lies in both cells beside it
    sides = np.where(leg[:, None], owner[graph.strips.cell[graph.strip]][:, None], owner[cells[graph.curve]])
    half = np.argsort(sides.reshape(-1), kind="stable")
    begin = np.searchsorted(sides.reshape(-1)[half], np.arange(owner.max(initial=-1) + 2))
    found: dict[tuple[int, int, bytes], tuple[int, float, Indices, Mask]] = {}
    for o in np.unique(obstacle).tolist():
        rows = member[obstacle == o]
        inside = np.unique(half[begin[o] : begin[o + 1]] // 2)
        for i, j, time, edge, forward in _cell_paths(graph.edges, inside, node, rows):
            found.setdefault((i, j, edge.tobytes()), (o, time, edge, forward))
    return _collect(graph, node, found)


def k_best_published(graph: PublishedGraph, k: int, through: Sequence[str] = ()) -> list[Route]:
    """As `k_best_classes`, on the published graph.

    The times are those of this graph. The routes are those of its edges on the sampled graph, less the
    spurs where one edge runs back along the one before.
    """
    result = search_published(graph, k, through)
    routes = []
    for path in result.paths:
        parts = [_oriented(graph, int(e), bool(f)) for e, f in zip(path.edge, path.forward, strict=True)]
        edge = np.concatenate([np.zeros(0, dtype=np.int64), *(p[0] for p in parts)])
        forward = np.concatenate([np.zeros(0, dtype=bool), *(p[1] for p in parts)])
        keep = _without_spurs(edge, forward)
        routes.append(graph.sampled.route(path.time, path.word, edge[keep], forward[keep]))
    return routes


def search_published(graph: PublishedGraph, k: int, through: Sequence[str] = ()) -> SearchResult:
    """As `k_best_published`, but the edges used and the number of labels."""
    numbers = gate_numbers(graph.sampled.gates, through)
    result = search_classes(graph.edges, graph.node_count, graph.start, graph.goal, k, numbers)
    demand_paths(graph.sampled.problem, result, through)
    return result


def _least_clearance_nodes(graph: SampledGraph) -> Indices:
    """Nodes of the sampled graph at the least clearance of every Voronoi arc."""
    samples, curves = graph.samples, graph.diagram.curves
    at = curves.least_distance_at[samples.station_curve]
    miss = np.abs(samples.station_parameter - at)
    order = np.lexsort([miss, samples.station_curve])
    _, first = np.unique(samples.station_curve[order], return_index=True)
    pick = order[first]
    return np.unique(samples.station_node[pick[graph.diagram.primary[samples.station_curve[pick]]]])


def _borders(graph: SampledGraph, owner: Indices, node: Indices) -> tuple[Indices, Indices]:
    """Pairs (obstacle, row of `node`): which nodes lie on the borders of an obstacle's cell, or in it."""
    samples = graph.samples
    row = np.full(len(samples.point), -1)
    row[node] = np.arange(len(node))
    beside = owner[graph.diagram.cells[samples.station_curve]]
    terminal = np.isin(samples.station_node, (graph.start, graph.goal))
    used = (row[samples.station_node] >= 0) & (graph.diagram.primary[samples.station_curve] | terminal)
    obstacle = np.concatenate([beside[used].reshape(-1), owner[graph.strips.cell[samples.free_strip]]])
    member = np.concatenate([np.repeat(row[samples.station_node[used]], 2), row[samples.free_node]])
    pairs = np.unique(np.column_stack([obstacle, member]), axis=0)
    return pairs[:, 0], pairs[:, 1]


def _cell_paths(
    edges: Edges, inside: Indices, node: Indices, rows: Indices
) -> list[tuple[int, int, float, Indices, Mask]]:
    """Fastest paths between nodes of one obstacle over the edges `inside` its cell."""
    part = edges.take(inside)
    used, index = np.unique(np.concatenate([part.tail, part.head, node[rows]]), return_inverse=True)
    local = part.moved(index[: len(part)], index[len(part) : 2 * len(part)])
    ends = index[2 * len(part) :]
    out = []
    time, by = shortest_paths(local, len(used), ends)
    tail, head = local.tail.tolist(), local.head.tolist()
    for i in range(len(rows)):
        reached_by = by[i].tolist()
        for j in range(i + 1, len(rows)):
            if not np.isfinite(time[i, ends[j]]) or rows[i] == rows[j]:
                continue
            place, way, onward = int(ends[j]), [], []
            while reached_by[place] >= 0:
                e = reached_by[place]
                forward = head[e] == place
                way.append(e)
                onward.append(forward)
                place = tail[e] if forward else head[e]
            edge = inside[np.array(way[::-1], dtype=np.int64)]
            out.append(
                (
                    int(rows[i]),
                    int(rows[j]),
                    float(time[i, ends[j]]),
                    edge,
                    np.array(onward[::-1], dtype=bool),
                )
            )
    return out


def _collect(
    graph: SampledGraph,
    node: Indices,
    found: dict[tuple[int, int, bytes], tuple[int, float, Indices, Mask]],
) -> PublishedGraph:
    letters: list[int] = []
    begin = []
    crosses = graph.edges.word_begin != graph.edges.word_end
    for _, _, edge, forward in found.values():
        begin.append(len(letters))
        for k in np.flatnonzero(crosses[edge]).tolist():
            letters += graph.edges.letters_of(int(edge[k]), bool(forward[k]))
    bounds = np.array([*begin, len(letters)], dtype=np.int64)
    ends = np.array([key[:2] for key in found], dtype=np.int64).reshape(-1, 2)
    edges = Edges(
        ends[:, 0],
        ends[:, 1],
        np.array([value[1] for value in found.values()]),
        bounds[:-1],
        bounds[1:],
        np.array(letters, dtype=np.int64),
    )
    return PublishedGraph(
        graph,
        node,
        edges,
        np.array([value[0] for value in found.values()], dtype=np.int64),
        tuple(value[2] for value in found.values()),
        tuple(value[3] for value in found.values()),
    )


def _oriented(graph: PublishedGraph, edge: int, forward: bool) -> tuple[Indices, Mask]:
    way, onward = graph.path_edge[edge], graph.path_forward[edge]
    return (way, onward) if forward else (way[::-1], ~onward[::-1])


def _without_spurs(edge: Indices, forward: Mask) -> Indices:
    """Positions that remain when an edge followed by itself in the other direction is cut out."""
    kept: list[int] = []
    for i in range(len(edge)):
        if kept and edge[kept[-1]] == edge[i] and forward[kept[-1]] != forward[i]:
            kept.pop()
        else:
            kept.append(i)
    return np.array(kept, dtype=np.int64)
