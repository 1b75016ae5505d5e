"""k best homotopy classes: against exhaustive search, words against the gates, demanded gates."""

from __future__ import annotations

import heapq
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.test_speed_graph_graphs import graph_of, random_problem
from tests.worlds import obstacle_lists, rooms
from vnav_drake.homotopy import reduced
from vnav_drake.problem import NoPathError
from vnav_drake.scenario import load_scenario
from vnav_drake.speed_graph.drawing import path_points
from vnav_drake.speed_graph.sampled import k_best_classes, search_sampled
from vnav_drake.speed_graph.search import Edges, search_classes

SCENARIOS = Path(__file__).resolve().parents[1] / "scenarios"


def random_edges(rng: np.random.Generator, nodes: int, count: int) -> Edges:
    """A random multigraph of `nodes` nodes whose edges cross up to two of three gates."""
    tail = rng.integers(0, nodes, count)
    head = (tail + rng.integers(1, nodes, count)) % nodes
    size = rng.choice([0, 0, 1, 2], count)
    bounds = np.concatenate([[0], np.cumsum(size)])
    letters = rng.integers(1, 4, bounds[-1]) * rng.choice([-1, 1], bounds[-1])
    return Edges(tail, head, rng.uniform(0.1, 1.0, count), bounds[:-1], bounds[1:], letters)


def exhaustive(
    edges: Edges, start: int, goal: int, k: int, through: tuple[int, ...] = (), budget: int = 20000
) -> list[tuple[float, tuple[int, ...]]] | None:
    """Dijkstra over all pairs (node, word), without bounds, limits or estimates; None: too many pairs."""
    queue = [(0.0, start, ())]
    done, found = set(), []
    while queue and len(found) < k:
        time, node, word = heapq.heappop(queue)
        if (node, word) in done:
            continue
        done.add((node, word))
        if len(done) > budget:
            return None
        it = iter(map(abs, word))
        if node == goal and all(gate in it for gate in through):
            found.append((time, word))
        for e in range(len(edges)):
            for forward in (True, False):
                a, b = (edges.tail[e], edges.head[e]) if forward else (edges.head[e], edges.tail[e])
                if a == node:
                    new = reduced((*word, *edges.letters_of(e, forward)))
                    heapq.heappush(queue, (time + float(edges.time[e]), int(b), new))
    return found


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1), st.integers(1, 5), st.sampled_from([(), (), (1,), (2, 1)]))
def test_classes_are_those_of_exhaustive_search(seed, k, through):
    rng = np.random.default_rng(seed)
    edges = random_edges(rng, 6, 9)
    expected = exhaustive(edges, 0, 5, k + 1, through)
    if expected is None:
        return
    # classes of equal time may come in any order, and the last of them may be either
    every = np.array([time for time, _ in expected])
    alone = [int((np.abs(every - time) < 1e-9).sum()) == 1 for time in every[:k]]
    expected = expected[:k]
    result = search_classes(edges, 6, 0, 5, k, [frozenset({gate}) for gate in through])
    assert [p.time for p in result.paths] == pytest.approx([time for time, _ in expected], rel=1e-12)
    assert len({p.word for p in result.paths}) == len(expected)
    for path, (_, word), sole in zip(result.paths, expected, alone, strict=True):
        assert path.word == word or not sole
    for path in result.paths:
        letters = [g for e, f in zip(path.edge, path.forward, strict=True) for g in edges.letters_of(e, f)]
        assert reduced(letters) == path.word
        assert edges.time[path.edge].sum() == pytest.approx(path.time, rel=1e-12)


def test_no_class_and_no_path_are_told_apart_from_a_wrong_question():
    edges = Edges(*(np.array(v) for v in ([0], [1], [1.0], [0], [1])), np.array([1]))
    assert search_classes(edges, 3, 0, 2, 2).paths == ()
    assert search_classes(edges, 3, 0, 1, 2, through=[frozenset({2})]).paths == ()
    assert [p.word for p in search_classes(edges, 3, 0, 1, 2, through=[frozenset({1})]).paths] == [(1,)]
    with pytest.raises(ValueError, match="k = 0"):
        search_classes(edges, 3, 0, 1, 0)


@settings(max_examples=20)
@given(rooms, obstacle_lists, st.sampled_from([0.0, 0.2]), st.integers(0, 2**32 - 1))
def test_words_are_those_that_the_gates_give_the_path_drawn(boundary, obstacles, radius, seed):
    problem = random_problem(boundary, obstacles, radius, np.random.default_rng(seed))
    try:
        graph = graph_of(problem)
        paths = search_sampled(graph, 5).paths
    except NoPathError:
        return
    assert len({p.word for p in paths}) == len(paths)
    assert (np.diff([p.time for p in paths]) >= 0.0).all()
    for path in paths:
        assert graph.gates.word(path_points(graph, path, 64)) == path.word


def test_the_narrow_class_of_the_warehouse_is_found_when_asked_for():
    # Through the gaps O4/O6, O3/O4, O1/O3: 25 m of them at sqrt(2 * 0.1) m/s at most take 55.9 s at least,
    # the optimum about 69.2 s (reconstruction of Manor 2015, Sec. 3.7).
    graph = graph_of(load_scenario(SCENARIOS / "warehouse.yaml").problem)
    tokens = ("O4/O6", "O3/O4", "O1/O3")
    routes = k_best_classes(graph, 2, tokens)
    for route in routes:
        names = [graph.gates.tokens[abs(g) - 1] for g in route.word]
        order = iter(names)
        assert all(token in order for token in tokens)
    assert routes[0].time >= 25.0 / np.sqrt(0.2)
    assert routes[0].time == pytest.approx(69.2, abs=0.2)


def test_a_token_that_names_no_gate_is_refused():
    graph = graph_of(load_scenario(SCENARIOS / "four_point_room.yaml").problem)
    with pytest.raises(ValueError, match="'P1/P9' is no passage"):
        k_best_classes(graph, 1, ("P1/P9",))


def test_a_token_may_be_written_either_way_round():
    # a passage between two obstacles has no first one
    graph = graph_of(load_scenario(SCENARIOS / "warehouse.yaml").problem)
    given = k_best_classes(graph, 2, ("O4/O6", "O3/O4", "O1/O3"))
    turned = k_best_classes(graph, 2, ("O6/O4", "O4/O3", "O3/O1"))
    assert [route.word for route in given] == [route.word for route in turned]


def test_tokens_are_not_read_from_one_string():
    graph = graph_of(load_scenario(SCENARIOS / "four_point_room.yaml").problem)
    with pytest.raises(ValueError, match="must be a sequence of tokens"):
        k_best_classes(graph, 1, "P1/P3")
