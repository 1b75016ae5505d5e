"""Routes through the network in order of travel time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import dijkstra, yen

from vnav_drake.voronoi import Curves
from vnav_drake.voronoi.network import Network

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

FIRST_BATCH = 4  # routes asked for at once; four times as many each time they are used up


@dataclass(frozen=True)
class Route:
    """Curves laid end to end in the direction of travel."""

    curves: Curves
    time: float  # [s], at the greatest safe speed


@dataclass(frozen=True)
class _Chain:
    pieces: tuple[int, ...]
    vertices: tuple[int, ...]  # one more than pieces


def fastest_route(network: Network) -> Route | None:
    """The fastest route, or None when there is none."""
    if network.start == network.goal:
        return Route(network.curves.take(np.zeros(0, dtype=np.int64)), 0.0)
    usable = np.isfinite(network.time)
    graph = _graph(network.ends[usable], network.time[usable], network.vertex_count)
    time, before = dijkstra(graph, indices=network.start, return_predecessors=True)
    if not np.isfinite(time[network.goal]):
        return None
    piece = {frozenset(pair): i for i, pair in enumerate(network.ends.tolist())}
    vertices = [network.goal]
    while vertices[-1] != network.start:
        vertices.append(int(before[vertices[-1]]))
    vertices.reverse()
    pieces = [piece[frozenset(pair)] for pair in pairwise(vertices)]
    return _route(network, pieces, vertices)


def routes(network: Network) -> Iterator[Route]:
    """All simple routes, fastest first (Yen's algorithm on the arcs that lie between branchings)."""
    if network.start == network.goal:
        return
    chains = _chains(network)
    label = {v: i for i, v in enumerate(sorted({v for c in chains for v in (c.vertices[0], c.vertices[-1])}))}
    if network.start not in label or network.goal not in label:
        return
    ends = np.array([(label[c.vertices[0]], label[c.vertices[-1]]) for c in chains])
    time = np.array([network.time[list(c.pieces)].sum() for c in chains])
    graph = _graph(ends, time, len(label))
    chain_of = {frozenset(pair): i for i, pair in enumerate(ends.tolist())}
    start, goal = label[network.start], label[network.goal]
    given, batch = 0, FIRST_BATCH
    while True:
        found, before = yen(graph, start, goal, batch, return_predecessors=True)
        for row in range(given, len(found)):
            yield _assemble(network, chains, chain_of, before[row], ends, start, goal)
        if len(found) < batch:
            return
        given, batch = len(found), 4 * batch


def _assemble(
    network: Network,
    chains: list[_Chain],
    chain_of: dict[frozenset[int], int],
    before: Indices,
    ends: Indices,
    start: int,
    goal: int,
) -> Route:
    stops = [goal]
    while stops[-1] != start:
        stops.append(int(before[stops[-1]]))
    stops.reverse()
    pieces: list[int] = []
    vertices = [network.start]
    for a, b in pairwise(stops):
        i = chain_of[frozenset((a, b))]
        chain = chains[i]
        forward = ends[i, 0] == a
        pieces += chain.pieces if forward else chain.pieces[::-1]
        vertices += (chain.vertices if forward else chain.vertices[::-1])[1:]
    return _route(network, pieces, vertices)


def _route(network: Network, pieces: list[int], vertices: list[int]) -> Route:
    index = np.array(pieces, dtype=np.int64)
    backwards = network.ends[index, 0] != np.array(vertices[:-1])
    return Route(network.curves.take(index).reversed(backwards), float(network.time[index].sum()))


def _graph(ends: Indices, time: Array, count: int) -> csr_array:
    rows, columns = np.concatenate([ends, ends[:, ::-1]]).T.astype(np.int32)  # yen takes no other
    return csr_array(coo_array((np.tile(time, 2), (rows, columns)), shape=(count, count)))


def _chains(network: Network) -> list[_Chain]:
    """Dead ends removed, and pieces joined where only two meet; chains with equal ends are kept apart."""
    around: dict[int, dict[int, int]] = {}
    for i, (a, b) in enumerate(network.ends.tolist()):
        if np.isfinite(network.time[i]) and a != b:
            around.setdefault(a, {})[b] = i
            around.setdefault(b, {})[a] = i
    terminals = {network.start, network.goal}
    bare = [v for v, others in around.items() if len(others) == 1 and v not in terminals]
    while bare:
        v = bare.pop()
        for other in around.pop(v):
            del around[other][v]
            if len(around[other]) == 1 and other not in terminals:
                bare.append(other)
            elif not around[other] and other not in terminals:
                del around[other]
                if other in bare:
                    bare.remove(other)
    stops = {v for v, others in around.items() if len(others) != 2} | (terminals & around.keys())
    chains, used = [], set()
    for v in sorted(stops):
        for first, piece in around[v].items():
            if piece in used:
                continue
            pieces, vertices = [piece], [v, first]
            while vertices[-1] not in stops:
                here = vertices[-1]
                following = next(w for w in around[here] if around[here][w] != pieces[-1])
                pieces.append(around[here][following])
                vertices.append(following)
            used.update(pieces)
            chains.append(_Chain(tuple(pieces), tuple(vertices)))
    return _apart([c for c in chains if c.vertices[0] != c.vertices[-1]])


def _apart(chains: list[_Chain]) -> list[_Chain]:
    """Chains that join the same stops are cut in two, as a graph holds one edge between two vertices."""
    out, seen = [], set()
    for chain in sorted(chains, key=lambda c: len(c.pieces)):
        key = frozenset((chain.vertices[0], chain.vertices[-1]))
        if key in seen:
            out.append(_Chain(chain.pieces[:1], chain.vertices[:2]))
            out.append(_Chain(chain.pieces[1:], chain.vertices[1:]))
        else:
            seen.add(key)
            out.append(chain)
    return out
