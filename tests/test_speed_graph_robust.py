"""Class optima of random worlds: a certified path, checked without the planner's code, or a named refusal."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest

from benchmarks.random_worlds import random_problem
from tests.speed_graph_worlds import (
    Case,
    clearance_of,
    moved_problem,
    swapped,
    tight_problem,
    time_along,
    voronoi_start,
)
from tests.test_speed_graph_graphs import problem_in
from vnav_drake.homotopy import build_gates, word_of
from vnav_drake.problem import NoPathError, PlanningError, Problem
from vnav_drake.speed_graph import ClassOptimum, speed_graph
from vnav_drake.speed_graph.optimum import CLASS, NODE, POINT, RESIDUAL, RIDGE
from vnav_drake.speed_graph.sampled import k_best_classes
from vnav_drake.voronoi import build_diagram
from vnav_drake.voronoi_route import plan_voronoi_route
from vnav_drake.world import Obstacle, World

WORLDS = 30  # of the shared generator: points, walls, polygons; near, far and in line; radii 0, 0.1 and 0.3 m
TIGHT = 14  # with gaps down to 1e-5 m, every other room not convex


@dataclass(frozen=True)
class Answer:
    """A problem and its three best classes; none when start and goal are not joined."""

    name: str
    problem: Problem
    classes: tuple[ClassOptimum, ...]


@cache
def answers() -> tuple[Answer, ...]:
    problems = [(f"world {seed}", random_problem(seed).problem) for seed in range(WORLDS)]
    problems += [(f"tight {seed}", tight_problem(seed)) for seed in range(TIGHT)]
    out = []
    for name, problem in problems:
        try:
            found = speed_graph(problem, classes=3, with_published=False).classes
        except NoPathError:
            found = ()
        out.append(Answer(name, problem, found))
    return tuple(out)


def certified() -> Iterator[tuple[Answer, ClassOptimum]]:
    return ((a, c) for a in answers() for c in a.classes if c.certified)


def test_nearly_all_of_the_three_best_classes_are_certified():
    found = [(a.name, c) for a in answers() for c in a.classes]
    failed = [(name, c.rank, c.failed) for name, c in found if not c.certified]
    assert len(found) >= 2.5 * (WORLDS + TIGHT)
    assert len(failed) <= 0.01 * len(found), failed
    assert {f for _, _, names in failed for f in names} <= {RESIDUAL, RIDGE, CLASS, NODE, POINT}
    assert all(c.certified == (not c.failed) for _, c in found)


def test_where_there_is_no_path_there_is_no_way_along_the_voronoi_arcs():
    for a in answers():
        if not a.classes:
            with pytest.raises(NoPathError):
                plan_voronoi_route(a.problem)


def test_certified_paths_keep_clear_have_no_kinks_and_take_their_time():
    for a, c in certified():
        # samples lie on the path itself, and the path starts and ends where asked
        assert clearance_of(a.problem, c.points).min() > 0.0, a.name
        assert (
            np.hypot(*(c.points[[0, -1]] - [a.problem.start.position, a.problem.goal.position]).T).max()
            == 0.0
        )
        assert np.abs(c.path.kinks).max(initial=0.0) < 1e-6, a.name
        assert c.optimality_bound <= 1e-7 * c.travel_time, a.name
        time = time_along(a.problem, c.path)
        # arcs through 41 samples a leg: less near where it winds closely round a point
        assert c.travel_time * (1.0 - 1e-8) <= time <= c.travel_time * (1.0 + 2e-5), a.name


@pytest.mark.parametrize("seed", [0, 3, 25])
def test_times_are_those_of_paths_sampled_ever_more_densely(seed):
    case = Case.of(random_problem(seed).problem)
    for route in k_best_classes(case.graph, 3):
        found = case.optimum(route)
        if not found.failed:
            assert case.time_by_polylines(found) == pytest.approx(found.time, rel=1e-8)


def test_certified_paths_are_in_their_class_and_no_slower_than_in_the_graph():
    for a, c in certified():
        level = a.problem.robot.radius
        gates = build_gates(build_diagram(a.problem.world).restricted(level), level)
        assert word_of(gates, c.path) == c.word, a.name
        assert c.travel_time <= c.graph_time * (1.0 + 1e-12), a.name


def test_times_lie_between_bounds_of_any_path():
    # d <= d0 + r at distance r from either end: T >= both integrals of dr / sqrt(2 (d0 + r)) up to half way
    for a, c in certified():
        way = float(np.hypot(*np.subtract(a.problem.start.position, a.problem.goal.position)))
        room = clearance_of(a.problem, np.array([a.problem.start.position, a.problem.goal.position]))
        least = (np.sqrt(2.0 * (room + 0.5 * way)) - np.sqrt(2.0 * room)).sum()
        assert c.travel_time >= least * (1.0 - 1e-12), a.name
        assert c.length >= way * (1.0 - 1e-12), a.name


@pytest.mark.parametrize("seed", range(0, 24, 3))
def test_a_start_along_voronoi_arcs_leads_to_the_same_optimum(seed):
    problem = random_problem(seed, side=10.0).problem
    try:
        case = Case.of(problem)
        start = voronoi_start(case)
    except NoPathError:
        return
    found = case.optimum(start)
    known = {c.word: c for c in speed_graph(problem, classes=4, with_published=False).classes}
    if start.word in known:
        assert not found.failed
        assert known[start.word].certified
        assert found.time == pytest.approx(known[start.word].travel_time, rel=1e-9)


@pytest.mark.parametrize("seed", [1, 2, 4])
def test_moved_mirrored_and_reversed_problems_have_the_same_optima(seed):
    problem = random_problem(seed, side=10.0, obstacles=6, family="mixed").problem
    times = [c.travel_time for c in speed_graph(problem, classes=2, with_published=False).classes]
    for other in (moved_problem(problem, 0.3, (40.0, -7.0), mirror=True), swapped(problem)):
        found = speed_graph(other, classes=2, with_published=False).classes
        assert all(c.certified for c in found)
        assert [c.travel_time for c in found] == pytest.approx(times, rel=1e-9)


@pytest.mark.parametrize("cut", [0.1, 0.01, 1e-3, 1e-4])
def test_small_features_change_little(cut):
    # A box with a corner cut off: free space grows, and clearance by at most cut / sqrt 2, so times
    # lie between those of the whole box and of a robot smaller by that.
    def time(corner: float, radius: float) -> float:
        ring = [(3.0, 4.0), (7.0 - corner, 4.0), (7.0, 4.0 + corner), (7.0, 6.0), (3.0, 6.0)]
        vertices = ring if corner > 0.0 else [(3.0, 4.0), (7.0, 4.0), (7.0, 6.0), (3.0, 6.0)]
        world = World.build([(0, 0), (10, 0), (10, 10), (0, 10)], [Obstacle(tuple(vertices), "B")])
        problem = problem_in(world, (5.0, 1.0), (5.5, 9.0), radius)
        (best,) = speed_graph(problem, classes=1, with_published=False).classes
        assert best.certified
        return best.travel_time

    assert time(0.0, 0.1 - cut / math.sqrt(2.0)) <= time(cut, 0.1) <= time(0.0, 0.1)


@pytest.mark.parametrize("gap", [1e-3, 1e-8])
def test_gaps_too_small_to_resolve_are_refused_by_name(gap):
    # three parallel walls `gap` m apart: an answer, or a message that says what was not found
    walls = [Obstacle(((3.0, 2.0 + gap * i), (7.0, 4.0 + gap * i)), f"W{i}") for i in range(3)]
    world = World.build([(0, 0), (10, 0), (10, 10), (0, 10)], walls)
    problem = problem_in(world, (5.0, 1.0), (5.0, 6.0), 0.1)
    try:
        found = speed_graph(problem, classes=2, with_published=False).classes
    except PlanningError as refusal:
        said = [str(refusal)[:24]]
    else:
        said = [",".join(c.failed) for c in found if not c.certified]
    assert set(said) <= {"no valid Voronoi diagram", RESIDUAL, RIDGE, NODE, CLASS}
