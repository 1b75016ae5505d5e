"""k best distinct homotopy classes of a graph whose edges cross gates.

Label-setting search. A label is a node with the reduced word of a path to it; at every node the k fastest
words are enough, since k faster prefixes give k faster paths with different words however the path goes on.
The labels are settled in order of time plus the exact time to the goal (A*: P. Hart, N. Nilsson and
B. Raphael, "A formal basis for the heuristic determination of minimum cost paths", 1968). Paths that follow
the shortest-path trees of start and goal but for one edge give k classes at once, and with them a bound that
rules out most of the graph beforehand.
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Word = tuple[int, ...]

ROUNDING = 1e-12  # relative: sums of the same times in another order differ by less
THROUGH_LABELS = 4  # times as many labels at a node when gates are demanded: some words fail at the goal


@dataclass(frozen=True)
class Edges:
    """Undirected edges; from `tail` to `head` they cross the gates `letters[word_begin:word_end]`."""

    tail: Indices  # (e,)
    head: Indices  # (e,)
    time: Array  # (e,) [s], zero or more
    word_begin: Indices  # (e,)
    word_end: Indices  # (e,)
    letters: Indices  # signed gates, 1-based

    def __len__(self) -> int:
        return len(self.tail)

    def take(self, index: Indices) -> Edges:
        """The edges of an index array."""
        ends = (self.tail[index], self.head[index], self.time[index])
        return Edges(*ends, self.word_begin[index], self.word_end[index], self.letters)

    def moved(self, tail: Indices, head: Indices) -> Edges:
        """The same edges between other nodes."""
        return Edges(tail, head, self.time, self.word_begin, self.word_end, self.letters)

    def letters_of(self, edge: int, forward: bool) -> list[int]:
        """Signed gates along an edge in the given direction."""
        part: list[int] = self.letters[self.word_begin[edge] : self.word_end[edge]].tolist()
        return part if forward else [-g for g in reversed(part)]


@dataclass(frozen=True)
class Found:
    """The fastest path of one class."""

    time: float  # [s]
    word: Word
    edge: Indices  # (j,) in order
    forward: NDArray[np.bool_]  # (j,) whether each is used from tail to head


@dataclass(frozen=True)
class SearchResult:
    """Classes, fastest first, and how much work they were."""

    paths: tuple[Found, ...]
    labels: int  # settled
    bound: float  # [s] above which nothing was looked at; infinite when there was none


class _Words:
    """Reduced words as numbers, so that labels are compared at once."""

    def __init__(self, through: Sequence[frozenset[int]]) -> None:
        self.words: list[Word] = [()]
        self._number: dict[Word, int] = {(): 0}
        self._next: dict[tuple[int, int], int] = {}
        self._through = through
        self.layer = [0]

    def append(self, number: int, letter: int) -> int:
        """The word after one more crossing."""
        key = (number, letter)
        known = self._next.get(key)
        if known is not None:
            return known
        word = self.words[number]
        word = word[:-1] if word and word[-1] == -letter else (*word, letter)
        known = self._number.setdefault(word, len(self.words))
        if known == len(self.words):
            self.words.append(word)
            self.layer.append(self._count(word))
        self._next[key] = known
        return known

    def extend(self, number: int, letters: Sequence[int]) -> int:
        """The word after several crossings."""
        for letter in letters:
            number = self.append(number, letter)
        return number

    def _count(self, word: Word) -> int:
        """How many of the demanded gates the word crosses in their order."""
        done = 0
        for letter in word:
            if done < len(self._through) and abs(letter) in self._through[done]:
                done += 1
        return done


def search_classes(
    edges: Edges, count: int, start: int, goal: int, k: int, through: Sequence[frozenset[int]] = ()
) -> SearchResult:
    """The fastest path in each of the k fastest homotopy classes.

    Parameters
    ----------
    edges : of a graph of nodes 0 to `count - 1`.
    through : sets of gates (1-based) of which the reduced word must cross one each, in this order, in
        either direction. With
        any, the number of labels at a node is a limit that could in theory hide a class.

    Returns
    -------
    Fewer than k classes where the graph has no more.

    Raises
    ------
    ValueError : k is not positive.
    """
    if k < 1:
        raise ValueError(f"k = {k!r}: must be 1 or more")
    words = _Words(through)
    (ahead, behind), (ahead_edge, behind_edge) = shortest_paths(edges, count, np.array([goal, start]))
    if not np.isfinite(ahead[start]):
        return SearchResult((), 0, np.inf)
    bound = _bound(edges, words, behind, behind_edge, ahead, ahead_edge, k, len(through))
    layers = _layers(edges, count, goal, through, ahead)
    return _settle(edges, words, layers, behind, start, goal, k, bound)


def _directed(
    edges: Edges, time: Array, tail: Indices, head: Indices, count: int
) -> tuple[csr_array, Indices]:
    """Matrix of the fastest edge between each two nodes, and which edge that is for each entry."""
    order = np.lexsort([time, head, tail])
    t, h = tail[order], head[order]
    new = np.append(True, (np.diff(t) != 0) | (np.diff(h) != 0)) if len(t) else np.zeros(0, dtype=bool)
    pick = order[new]
    begin = np.searchsorted(tail[pick], np.arange(count + 1))
    # an entry of zero would mean no edge
    weight = np.maximum(time[pick], np.finfo(float).tiny)
    return csr_array((weight, head[pick], begin), shape=(count, count)), pick % len(edges)


def shortest_paths(edges: Edges, count: int, sources: Indices) -> tuple[Array, Indices]:
    """Least times (s, count) [s] from sources (s,) to all nodes, and the edges by which they are reached.

    The edge is -1 at the source itself and where there is no path.
    """
    tail, head = np.concatenate([edges.tail, edges.head]), np.concatenate([edges.head, edges.tail])
    graph, number = _directed(edges, np.tile(edges.time, 2), tail, head, count)
    time, before = dijkstra(graph, indices=np.asarray(sources), return_predecessors=True)
    row, reached = np.nonzero(before >= 0)
    by = np.full(before.shape, -1)
    key = np.repeat(np.arange(count), np.diff(graph.indptr)) * count + graph.indices
    want = before[row, reached].astype(np.int64) * count + reached
    by[row, reached] = number[np.searchsorted(key, want)]
    return time, by


def _tree_words(edges: Edges, words: _Words, time: Array, by: Indices) -> Indices:
    """Word (count,) from the tree's root to each node; -1 if not reached."""
    out = np.full(len(time), -1)
    order = np.argsort(time, kind="stable")
    order = order[np.isfinite(time[order])]
    tail, head = edges.tail.tolist(), edges.head.tolist()
    begin, end = edges.word_begin.tolist(), edges.word_end.tolist()
    pending = order.tolist()
    reached_by = by.tolist()
    known: dict[int, int] = {}
    while pending:
        later = []
        for node in pending:
            edge = reached_by[node]
            if edge < 0:
                known[node] = 0
                continue
            forward = head[edge] == node
            parent = tail[edge] if forward else head[edge]
            if parent not in known:  # times of zero leave the order open
                later.append(node)
                continue
            word = known[parent]
            if begin[edge] != end[edge]:
                word = words.extend(word, edges.letters_of(edge, forward))
            known[node] = word
        if len(later) == len(pending):
            break
        pending = later
    for node, word in known.items():
        out[node] = word
    return out


def _bound(
    edges: Edges,
    words: _Words,
    behind: Array,
    behind_edge: Indices,
    ahead: Array,
    ahead_edge: Indices,
    k: int,
    layers: int,
) -> float:
    """Time of the k-th class among paths along both trees but for one edge; inf if there are fewer."""
    there = _tree_words(edges, words, behind, behind_edge)
    back = _tree_words(edges, words, ahead, ahead_edge)
    tail, head = np.concatenate([edges.tail, edges.head]), np.concatenate([edges.head, edges.tail])
    time = behind[tail] + np.tile(edges.time, 2) + ahead[head]
    row = np.flatnonzero(np.isfinite(time))
    row = row[np.argsort(time[row], kind="stable")]
    edge = row % len(edges)
    crosses = edges.word_begin[edge] != edges.word_end[edge]
    # paths with the same two tree words and no crossing on the edge are in the same class
    key = np.stack([there[tail[row]], back[head[row]], np.where(crosses, row, -1)])
    _, first = np.unique(key, axis=1, return_index=True)
    seen: set[Word] = set()
    for i in np.sort(first).tolist():
        r = int(row[i])
        word = words.extend(int(there[tail[r]]), edges.letters_of(int(edge[i]), r < len(edges)))
        inverse = [-g for g in reversed(words.words[int(back[head[r]])])]
        word = words.extend(word, inverse)
        if words.layer[word] == layers:
            seen.add(words.words[word])
            if len(seen) == k:
                return float(time[r])
    return float("inf")


def _layers(edges: Edges, count: int, goal: int, through: Sequence[frozenset[int]], ahead: Array) -> Array:
    """Least time to the goal (L + 1, count) when the first 0 .. L demanded gates are crossed already."""
    demanded = len(through)
    out = np.empty((demanded + 1, count))
    out[demanded] = ahead
    if demanded == 0:
        return out
    both = 2 * len(edges)
    tail, head = np.concatenate([edges.tail, edges.head]), np.concatenate([edges.head, edges.tail])
    step = np.tile(np.arange(demanded + 1)[:, None], (1, both))
    for e in np.flatnonzero(edges.word_begin != edges.word_end).tolist():
        for row, forward in ((e, True), (e + len(edges), False)):
            letters = edges.letters_of(e, forward)
            for layer in range(demanded):
                now = layer
                for letter in letters:
                    if now < demanded and abs(letter) in through[now]:
                        now += 1
                step[layer, row] = now
    offset = count * np.arange(demanded + 1)[:, None]
    all_tail, all_head = (tail + offset).reshape(-1), (head + count * step).reshape(-1)
    time = np.tile(edges.time, 2 * (demanded + 1))
    # from the goal backwards
    graph, _ = _directed(edges, time, all_head, all_tail, count * (demanded + 1))
    return dijkstra(graph, indices=count * demanded + goal).reshape(demanded + 1, count)


def _settle(
    edges: Edges, words: _Words, layers: Array, behind: Array, start: int, goal: int, k: int, bound: float
) -> SearchResult:
    demanded = len(layers) - 1
    limit = bound * (1.0 + ROUNDING)
    least = layers[demanded]
    begin, edge_of, node_to, time_of, least_of, crosses = _adjacency(edges, behind, least, limit)
    height = [row.tolist() for row in layers]
    per_node = k if demanded == 0 else THROUGH_LABELS * k
    settled: dict[int, int] = {}
    best: dict[tuple[int, int], float] = {(start, 0): 0.0}
    queue: list[tuple[float, int, float, int, int, int, int]] = []
    counter = 0
    infinite = float("inf")
    if height[0][start] < infinite:
        queue.append((height[0][start], counter, 0.0, start, 0, -1, -1))
    parent: list[tuple[int, int]] = []  # of each label: the one before, row of the adjacency
    done: set[tuple[int, int]] = set()
    goals: list[tuple[float, int, int]] = []
    layer_of = words.layer
    while queue and len(goals) < k:
        _, _, time, node, word, previous, row = heapq.heappop(queue)
        if (node, word) in done:
            continue
        layer = layer_of[word]
        slot = node * (demanded + 1) + layer
        if settled.get(slot, 0) >= per_node:
            continue
        settled[slot] = settled.get(slot, 0) + 1
        done.add((node, word))
        number = len(parent)
        parent.append((previous, row))
        if node == goal and layer == demanded:
            goals.append((time, word, number))
        room = limit - time
        for r in range(begin[node], begin[node + 1]):
            if least_of[r] > room:
                break
            to = node_to[r]
            letters = crosses[r]
            new = word if letters is None else words.extend(word, letters)
            reach = time + time_of[r]
            f = reach + height[layer_of[new]][to]
            if f > limit or f == infinite:
                continue
            key = (to, new)
            if reach < best.get(key, infinite) and key not in done:
                best[key] = reach
                counter += 1
                heapq.heappush(queue, (f, counter, reach, to, new, number, r))
    paths = []
    for time, word, number in goals:
        used = np.array([edge_of[r] for r in _trace(parent, number)], dtype=np.int64)
        paths.append(Found(time, words.words[word], used % len(edges), used < len(edges)))
    return SearchResult(tuple(paths), len(parent), bound)


def _trace(parent: list[tuple[int, int]], label: int) -> list[int]:
    """Rows by which a label was reached, from the start."""
    rows = []
    while parent[label][0] >= 0:
        rows.append(parent[label][1])
        label = parent[label][0]
    return rows[::-1]


def _adjacency(
    edges: Edges, behind: Array, least: Array, limit: float
) -> tuple[list[int], list[int], list[int], list[float], list[float], list[list[int] | None]]:
    """Directed edges that a path within the limit can use, grouped by their node, the most promising first.

    Offsets by node; edge (+ number of edges when used backwards), node reached, time, time to the goal that
    way, letters (None for most).
    """
    tail, head = np.concatenate([edges.tail, edges.head]), np.concatenate([edges.head, edges.tail])
    time = np.tile(edges.time, 2)
    to_goal = time + least[head]
    useful = np.flatnonzero((behind[tail] + to_goal <= limit) & np.isfinite(to_goal))
    useful = useful[np.lexsort([to_goal[useful], tail[useful]])]
    begin = np.searchsorted(tail[useful], np.arange(len(behind) + 1))
    edge = useful % len(edges)
    crossing = edges.word_begin[edge] != edges.word_end[edge]
    letters: list[list[int] | None] = [None] * len(useful)
    for i in np.flatnonzero(crossing).tolist():
        letters[i] = edges.letters_of(int(edge[i]), bool(useful[i] < len(edges)))
    return (
        begin.tolist(),
        useful.tolist(),
        head[useful].tolist(),
        time[useful].tolist(),
        to_goal[useful].tolist(),
        letters,
    )
