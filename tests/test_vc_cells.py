"""Stacks, cells, partitions and the adjacency graph: exact cases, and Shapely's cut of random worlds."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from numpy.typing import ArrayLike, NDArray

from benchmarks.large_maps import field_of_hexagons
from benchmarks.random_worlds import random_problem
from tests.worlds import distance_by_shapely, rectangle
from vnav_drake.braking import UniformBraking
from vnav_drake.problem import End, NoPathError, Problem
from vnav_drake.robot import Robot
from vnav_drake.vc_method import (
    AdjacencyGraph,
    CellDecomposition,
    CellRoute,
    build_adjacency,
    critical_points,
    decompose,
    free_components,
    search,
)
from vnav_drake.vc_method.adjacency import Cost
from vnav_drake.vc_method.profile import arc_minimum_time
from vnav_drake.voronoi import build_diagram
from vnav_drake.voronoi_route import plan_voronoi_route
from vnav_drake.world import Obstacle, World

Array = NDArray[np.float64]

SQUARE = ((0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0))
HALL = ((0.0, 0.0), (40.0, 0.0), (40.0, 40.0), (0.0, 40.0))


def rooms(corridor: float) -> list[tuple[float, float]]:
    """A room of 6 x 6 m and one of 4 x 4 m, joined by a corridor 2 m wide and `corridor` [m] long."""
    end = 6.0 + corridor
    return [
        *((0.0, 0.0), (6.0, 0.0), (6.0, 2.0), (end, 2.0), (end, 1.0), (end + 4.0, 1.0)),
        *((end + 4.0, 5.0), (end, 5.0), (end, 4.0), (6.0, 4.0), (6.0, 6.0), (0.0, 6.0)),
    ]


def problem(
    boundary: ArrayLike,
    obstacles: list[Obstacle] | None = None,
    start: tuple[float, float] = (1.0, 1.0),
    goal: tuple[float, float] = (9.0, 9.0),
    *,
    radius: float = 0.5,
    max_acceleration: float = 1.0,
    speed: float | str = "safe",
    **law: float,
) -> Problem:
    return Problem(
        world=World.build(boundary, obstacles or []),
        robot=Robot(radius=radius, max_acceleration=max_acceleration),
        braking=UniformBraking(max_braking=1.0, **law),
        start=End(position=start, speed=speed),
        goal=End(position=goal, speed=speed),
    )


def decomposed(asked: Problem) -> CellDecomposition:
    level = asked.robot.radius + asked.braking.margin
    diagram = build_diagram(asked.world, asked.robot.radius).restricted(level)
    return decompose(critical_points(diagram, asked.braking), diagram)


def graph_of(asked: Problem, cost: Cost = "realised") -> AdjacencyGraph:
    return build_adjacency(decomposed(asked), asked.braking, asked.robot, cost)


def test_three_obstacles_make_a_stack_of_four_cells():
    # The thesis's Fig. 2.7. Saddles halfway between the points, at half their distances; the maximum at the
    # circumcentre of an acute triangle, R = a b c / (4 area).
    a, b, c = (18.0, 18.0), (22.0, 18.5), (20.5, 22.0)
    decomposition = decomposed(problem(HALL, [Obstacle((p,)) for p in (a, b, c)]))
    sides = sorted([math.dist(a, b), math.dist(b, c), math.dist(c, a)])
    area = 0.5 * abs((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
    reach = [*(0.5 * side for side in sides), math.prod(sides) / (4.0 * area)]
    heights = [math.sqrt(2.0 * (r - 0.5)) for r in reach]  # V = sqrt(2 a_b d), a_b = 1
    critical = decomposition.critical
    centre = np.argmin(np.hypot(*(critical.point - (20.2, 19.6)).T) + 1e3 * (critical.kind == 1))
    stack = next(s for s in decomposition.stacks if s.maximum == centre)
    assert len(set(stack.saddles)) == 3
    np.testing.assert_allclose(stack.heights, heights, rtol=1e-12)
    assert [cell.bottom for cell in stack.cells] == [0.0, *(cell.top for cell in stack.cells[:-1])]
    assert len(stack.cells) == 4


def test_four_arcs_at_a_node_make_five_cells_or_fewer_where_heights_agree():
    # The thesis's Fig. 2.8: points on a circle of 3 m, seen from its centre at these angles apart [deg].
    # Saddles at 3 sin(gap / 2); equal ones share their horizontal partition.
    for gaps, cells in (((80.0, 86.0, 92.0, 102.0), 5), ((80.0, 100.0, 80.0, 100.0), 3), ((90.0,) * 4, 2)):
        angle = 0.77 + np.radians(np.cumsum(gaps))  # turned, so that equal heights differ by rounding
        ring = 20.0 + 3.0 * np.column_stack([np.cos(angle), np.sin(angle)])
        decomposition = decomposed(problem(HALL, [Obstacle((tuple(p),)) for p in ring.tolist()]))
        top = np.flatnonzero(np.hypot(*(decomposition.critical.point - 20.0).T) < 1e-6)
        stack = next(s for s in decomposition.stacks if s.maximum == top[0])
        reach = [*sorted({round(3.0 * math.sin(math.radians(g) / 2.0), 12) for g in gaps}), 3.0]
        np.testing.assert_allclose(stack.heights, [math.sqrt(2.0 * (r - 0.5)) for r in reach], rtol=1e-9)
        assert len(stack.cells) == cells
        assert len(stack.saddles) == 4


def test_a_convex_room_is_one_stack_of_one_cell():
    # 10 m wide: V = sqrt(2 (5 - 0.5)) = 3 at the centre.
    decomposition = decomposed(problem(SQUARE))
    (stack,) = decomposition.stacks
    assert (stack.saddles, stack.heights) == ((), (3.0,))
    assert decomposition.share_of_four == 0.0
    assert decomposition.vertical_partitions == ()
    graph = build_adjacency(decomposition, UniformBraking(max_braking=1.0), Robot(radius=0.5))
    assert graph.size == (1, 0)
    np.testing.assert_allclose(graph.position, [[5.0, 5.0]], atol=1e-12)
    np.testing.assert_allclose(graph.speed, [1.5])


def test_a_plateau_is_cut_halfway():
    # Corridor from x = 6 to x = 14: the partition through (10, 3), between the walls y = 2 and y = 4.
    decomposition = decomposed(problem(rooms(8.0)))
    (partition,) = decomposition.vertical_partitions
    np.testing.assert_allclose(partition.point, [10.0, 3.0], atol=1e-9)
    feet = partition.feet[np.argsort(partition.feet[:, 1])]
    np.testing.assert_allclose(feet, [[10.0, 2.0], [10.0, 4.0]], atol=1e-9)
    assert partition.height == pytest.approx(1.0, abs=1e-12)
    assert [len(s.cells) for s in decomposition.stacks] == [2, 2]


def test_a_speed_limit_merges_the_heights_above_it():
    # Saddle and maxima of `rooms` at 1, sqrt(5) and sqrt(3) m/s.
    decomposition = decomposed(problem(rooms(8.0), max_speed=0.8))
    assert [s.heights for s in decomposition.stacks] == [(0.8,), (0.8,)]


@pytest.mark.parametrize("seed", range(40))
def test_shapely_cuts_random_worlds_into_the_same_stacks(seed: int):
    # Free space at v = 0 without the lower edges of the vertical partitions (Manor 2015, Fig. 2.6): as many
    # parts as stacks, one maximum in each. Around a point robot walls and points get a little depth.
    asked = random_problem(seed).problem
    decomposition = decomposed(asked)
    level = max(decomposition.diagram.radius, 1e-6)
    parts, _ = free_components(asked.world, level)
    edges = [shapely.LineString(p.feet) for p in decomposition.vertical_partitions]
    cut = shapely.buffer(shapely.multilinestrings(edges), 1e-6, quad_segs=1) if edges else shapely.Polygon()
    floor = shapely.get_parts(shapely.difference(parts, cut))
    tops = shapely.points(decomposition.critical.point[decomposition.maximum])
    row, part = shapely.STRtree(floor).query(tops, predicate="dwithin", distance=2e-4 * level)
    assert np.array_equal(row, np.arange(len(tops)))
    assert len(np.unique(part)) == len(tops)
    large = shapely.area(floor) > 1e-4 * level * shapely.length(floor)
    assert set(np.flatnonzero(large)) <= set(part)


@pytest.mark.parametrize("seed", range(60))
def test_stacks_keep_their_invariants(seed: int):
    asked = random_problem(seed).problem
    decomposition = decomposed(asked)
    critical = decomposition.critical
    boundary = np.array(asked.world.boundary.exterior.coords)[:-1]
    # each saddle joins one side more than its multiplicity; every arc lies in a stack
    sides = np.bincount(decomposition.side_saddle, minlength=len(critical))[critical.saddles]
    np.testing.assert_array_equal(sides, critical.multiplicity[critical.saddles] + 1)
    in_stacks = {b for stack in decomposition.stacks for b in stack.borders}
    assert in_stacks == set(decomposition.diagram.arcs.tolist())
    for stack in decomposition.stacks:
        speeds = critical.speed[[*stack.saddles, stack.maximum]]
        assert stack.heights[-1] == speeds.max() == critical.speed[stack.maximum]
        assert list(stack.heights) == sorted(set(stack.heights))
        for speed in speeds[speeds > 0.0]:
            assert np.abs(np.array(stack.heights) - speed).min() < 1e-6
        bottoms = [cell.bottom for cell in stack.cells]
        assert bottoms == [0.0, *stack.heights[:-1]]
    for partition in decomposition.vertical_partitions:
        reach = critical.clearance[partition.saddle] + asked.robot.radius
        np.testing.assert_allclose(
            np.hypot(*(partition.feet - partition.point).T), [reach, reach], rtol=0.0, atol=1e-8
        )
        # straight: the feet are opposite, and the way between them is free
        assert math.dist(*partition.feet) == pytest.approx(2.0 * reach, abs=1e-8)
        way = np.linspace(*partition.feet, 9)[1:-1]
        clear = distance_by_shapely(boundary, list(asked.world.obstacles), way)
        expected = reach - np.hypot(*(way - partition.point).T)
        np.testing.assert_allclose(clear, expected, rtol=0.0, atol=1e-7)
    for i, partition in enumerate(decomposition.horizontal_partitions):
        assert partition.height == decomposition.cell_top[i]
        assert partition.stack == decomposition.cell_stack[i]
        assert partition.critical


def test_stacks_of_four_cells_are_some_of_all():
    # The thesis calls four cells generic; here the share is counted from the stacks one by one.
    share, four, total = [], 0, 0
    for seed in range(40):
        decomposition = decomposed(random_problem(seed).problem)
        count = sum(len(stack.cells) == 4 for stack in decomposition.stacks)
        share.append(decomposition.share_of_four)
        assert share[-1] == pytest.approx(count / len(decomposition.stacks))
        four, total = four + count, total + len(decomposition.stacks)
    assert 0.0 < four / total < 1.0


def test_the_published_cost_is_the_formula_of_section_2_5():
    # Speeds sqrt(2 (3 - 0.5)), 1 and sqrt(2 (2 - 0.5)) at the maxima and at the saddle between them:
    # (v_i - v_ij) / a_b + (v_j - v_ij) / a_max with a_b = 1, a_max = 0.5.
    big, small, passage = math.sqrt(5.0), math.sqrt(3.0), 1.0
    forwards = (big - passage) / 1.0 + (small - passage) / 0.5
    backwards = (small - passage) / 1.0 + (big - passage) / 0.5
    for corridor in (2.0, 8.0, 30.0):  # its length counts for nothing: the fault of the formula
        graph = graph_of(problem(rooms(corridor), max_acceleration=0.5), "published")
        (weight,) = graph.weight
        first = graph.decomposition.side_stack[graph.type_a_sides[0, 0]]
        x = graph.decomposition.critical.point[graph.decomposition.maximum[first], 0]
        expected = (forwards, backwards) if x < 6.0 else (backwards, forwards)
        np.testing.assert_allclose(weight, expected, rtol=1e-12)


def test_the_realised_cost_grows_with_the_corridor():
    # At the limit of the corridor, 1 m/s, every metre takes a second; the ways in and out stay the same.
    time = {
        corridor: graph_of(problem(rooms(corridor), max_acceleration=0.5)).weight
        for corridor in (2.0, 8.0, 30.0)
    }
    for one, other in itertools.pairwise(time):
        np.testing.assert_allclose(np.sort(time[other] - time[one]), other - one, rtol=0.0, atol=1e-9)


def test_an_unknown_cost_is_refused():
    asked = problem(SQUARE)
    with pytest.raises(ValueError, match="cost = 'shortest'"):
        build_adjacency(decomposed(asked), asked.braking, asked.robot, "shortest")  # type: ignore[arg-type]


@pytest.mark.parametrize("seed", range(20))
def test_the_graph_has_one_type_a_edge_a_saddle_and_stairs_in_each_stack(seed: int):
    graph = graph_of(random_problem(seed).problem)
    decomposition, critical = graph.decomposition, graph.decomposition.critical
    assert len(graph.type_a) == len(critical.saddles)  # all of multiplicity one
    assert len(graph.type_b) == len(decomposition.cell_stack) - len(decomposition.maximum)
    stack, tops = decomposition.cell_stack, decomposition.cell_top
    for (one, other), saddle in zip(graph.type_a, graph.saddle, strict=True):
        for cell in (one, other):
            lowest = cell == decomposition.first_cell[stack[cell]]
            assert tops[cell] == pytest.approx(critical.speed[saddle], abs=1e-6) or (
                lowest and critical.speed[saddle] == 0.0
            )
    lower, upper = graph.type_b.T
    np.testing.assert_array_equal(stack[lower], stack[upper])
    np.testing.assert_array_equal(tops[lower], decomposition.cell_bottom[upper])
    # cells are at most two a saddle and one a maximum, edges at most three a saddle
    cells, edges = graph.size
    assert cells <= 2 * len(critical.saddles) + len(critical.maxima)
    assert edges <= 3 * len(critical.saddles)


def test_the_graph_grows_with_the_number_of_vertices():
    # A Voronoi diagram of n vertices and as many edges has O(n) arcs: one saddle each at most.
    asked = field_of_hexagons()
    vertices = len(asked.world.vertices)
    cells, edges = graph_of(asked).size
    assert cells <= 3 * vertices
    assert edges <= 3 * vertices


def assert_follows(asked: Problem, graph: AdjacencyGraph, route: CellRoute) -> None:
    """Cells are neighbours, arcs join end to end, and the saddles lie on them in order."""
    steps = {frozenset(e) for e in [*graph.type_a.tolist(), *graph.type_b.tolist()]}
    for pair in itertools.pairwise(route.cells):
        assert frozenset(pair) in steps
    ends = route.curves.ends
    assert len(route.borders) == len(route.curves)
    if len(ends):
        np.testing.assert_allclose(ends[0, 0], asked.start.point, atol=1e-6)
        np.testing.assert_allclose(ends[-1, 1], asked.goal.point, atol=1e-6)
        np.testing.assert_allclose(ends[1:, 0], ends[:-1, 1], atol=1e-6)
    on_arcs = route.borders >= 0
    for row in np.flatnonzero(on_arcs):
        arc = graph.decomposition.diagram.curves.take([route.borders[row]])
        np.testing.assert_array_equal(arc.origin, route.curves.take([row]).origin)
    # no stretch is followed back at once
    for i in range(len(route.curves) - 1):
        if on_arcs[i] and route.borders[i] == route.borders[i + 1]:
            assert np.sign(np.diff(route.curves.span[i])) == np.sign(np.diff(route.curves.span[i + 1]))
    points = graph.decomposition.critical.point[list(route.saddles)].reshape(-1, 2)
    low, high = route.curves.span.min(axis=1), route.curves.span.max(axis=1)
    last = -1
    for point in points:
        u = np.einsum("ij,ij->i", point - route.curves.origin, route.curves.axis)
        miss = np.hypot(*(route.curves.points(np.clip(u, low, high)) - point).T)
        rows = np.flatnonzero(miss < 1e-6)
        assert rows.max() >= last
        last = int(rows[rows >= last].min())


@pytest.mark.parametrize("cost", ["published", "realised"])
@pytest.mark.parametrize("seed", range(25))
def test_routes_through_random_worlds(seed: int, cost: Cost):
    asked = random_problem(seed).problem
    graph = graph_of(asked, cost)
    route = search(graph, asked)
    assert_follows(asked, graph, route)
    # On the same arcs nothing beats the fastest route of all (which may also go straight).
    fastest = plan_voronoi_route(asked).details["exact_time"]
    assert route.travel_time >= fastest - 1e-9


def brute_force(graph: AdjacencyGraph, start: int, goal: int) -> float:
    """Least published cost from stack to stack, by trying every edge again and again (Bellman and Ford)."""
    stacks = graph.decomposition.side_stack[graph.type_a_sides]
    cost = {start: 0.0}
    for _round in range(len(graph.decomposition.maximum)):
        for (one, other), (ahead, back) in zip(stacks.tolist(), graph.weight.tolist(), strict=True):
            for a, b, w in ((one, other, ahead), (other, one, back)):
                if a in cost and cost[a] + w < cost.get(b, math.inf):
                    cost[b] = cost[a] + w
    return cost.get(goal, math.inf)


@pytest.mark.parametrize("seed", range(15))
def test_the_published_search_finds_the_least_sum(seed: int):
    asked = random_problem(seed).problem
    graph = graph_of(asked, "published")
    route = search(graph, asked)
    stack = graph.decomposition.cell_stack
    expected = brute_force(graph, int(stack[route.cells[0]]), int(stack[route.cells[-1]]))
    assert route.cost == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("seed", range(12))
def test_the_realised_search_finds_the_least_sum_between_maxima(seed: int):
    # From a maximum to another one the ways to the first and from the last saddle are whole Type A edges.
    # Braking and accelerating differ, so that there and back do too.
    drawn = random_problem(seed).problem
    robot = Robot(radius=drawn.robot.radius, max_acceleration=0.4)
    decomposition = decomposed(drawn)
    graph = build_adjacency(decomposition, drawn.braking, robot)
    assert (graph.weight[:, 0] != graph.weight[:, 1]).any()
    reached = 0
    for start, goal in ((0, -1), (-1, 0), (1, len(decomposition.maximum) // 2)):
        one, other = decomposition.critical.point[decomposition.maximum[[start, goal]]]
        asked = replace(drawn, robot=robot, start=End(position=tuple(one)), goal=End(position=tuple(other)))
        first, last = (i % len(decomposition.maximum) for i in (start, goal))
        expected = brute_force(graph, first, last)
        if math.isinf(expected):
            with pytest.raises(NoPathError):
                search(graph, asked)
        else:
            assert search(graph, asked).cost == pytest.approx(expected, abs=1e-9)
            reached += 1
    assert reached > 0


def test_a_route_in_one_stack_passes_no_saddle():
    # Along the diagonals of the room: from (2, 2) to (8, 2) over the centre, where V is greatest.
    asked = problem(SQUARE, start=(2.0, 2.0), goal=(8.0, 2.0))
    graph = graph_of(asked)
    route = search(graph, asked)
    assert (route.cells, route.saddles) == ((0,), ())
    assert route.curves.length.sum() == pytest.approx(2.0 * math.hypot(3.0, 3.0))
    # d = s / sqrt(2) from the corner along a diagonal: 2 sqrt(2) (sqrt(2 (5 - 0.5)) - sqrt(2 (2 - 0.5))) by
    # T = 2 L / (V_0 + V_1), V linear under the root; a_max = a_b never binds, as V V' = a_b / sqrt(2).
    leg = 2.0 * math.hypot(3.0, 3.0) / (math.sqrt(9.0) + math.sqrt(3.0))
    assert route.travel_time == pytest.approx(2.0 * leg, rel=1e-9)
    assert route.cost == pytest.approx(route.travel_time)


def test_both_costs_disagree_where_a_corridor_is_long():
    # Two ways from a left room to a right one: straight through a corridor 1.6 m wide and 30 m long, or round
    # through rooms with doors; the formula sees only the speeds at maxima and saddles.
    wall = [rectangle(6.0, 0.0, 30.0, 4.2), rectangle(6.0, 5.8, 30.0, 4.2)]
    boundary = [(0.0, 0.0), (42.0, 0.0), (42.0, 10.0), (0.0, 10.0)]
    asked = problem(boundary, wall, (3.0, 5.0), (39.0, 5.0))
    published, realised = (search(graph_of(asked, c), asked) for c in ("published", "realised"))
    assert published.saddles == realised.saddles
    # V = sqrt(2 * 0.3) in the corridor: 30 m take 38.7 s at least, more than the formula's few seconds.
    assert realised.cost > 30.0 / math.sqrt(0.6)
    assert published.cost < 8.0


def test_a_stack_that_meets_itself_is_left_and_entered_by_the_same_saddle():
    # A hall of 16 x 10 m with a point 2 m from its left wall: one saddle at (1, 5) and one maximum, a plateau
    # of 5 m from x = 7 on. The tree of arcs joins both sides of the saddle only round the point.
    hall = [(0.0, 0.0), (16.0, 0.0), (16.0, 10.0), (0.0, 10.0)]
    asked = problem(hall, [Obstacle(((2.0, 5.0),))], (1.0, 3.5), (1.0, 6.5))
    graph = graph_of(asked)
    (stack,) = graph.decomposition.stacks
    assert len(stack.saddles) == 2
    assert len(set(stack.saddles)) == 1
    route, round_about = search(graph, asked), search(graph_of(asked, "published"), asked)
    assert_follows(asked, graph, route)
    assert_follows(asked, graph, round_about)
    assert (len(route.saddles), len(round_about.saddles)) == (1, 0)
    assert route.cost == pytest.approx(route.travel_time)
    # Through the saddle: two legs to the parabola x = (2^2 + y^2) / (2 * 2), and 3 m of height along it.
    assert route.curves.length.sum() < 5.0
    assert route.travel_time < round_about.travel_time


def test_ends_on_nodes_on_arcs_at_saddles_and_in_pockets():
    graph = graph_of(problem(rooms(8.0)))
    critical = graph.decomposition.critical
    node = tuple(critical.point[critical.maxima[0]].tolist())
    saddle = tuple(critical.point[critical.saddles[0]].tolist())
    places = [node, saddle, (8.0, 3.0), (12.0, 3.0), (0.6, 0.6), (0.6, 5.4), (10.0, 2.6)]
    for start, goal in itertools.permutations(places, 2):
        asked = problem(rooms(8.0), start=start, goal=goal)
        route = search(graph, asked)
        assert_follows(asked, graph, route)
        # the arcs lead from one side of x = 10 to the other exactly when they pass the saddle
        beyond = (start[0] - 10.0) * (goal[0] - 10.0) < 0.0
        if 10.0 not in (start[0], goal[0]):
            assert len(route.saddles) == (1 if beyond else 0)


def test_ends_at_rest_take_longer_and_begin_in_the_lowest_cell():
    safe, rest = (problem(rooms(8.0), goal=(16.0, 3.0), speed=s) for s in ("safe", "rest"))
    one, other = (search(graph_of(asked), asked) for asked in (safe, rest))
    assert other.travel_time > one.travel_time
    decomposition = decomposed(rest)
    assert decomposition.cell_bottom[other.cells[0]] == 0.0
    assert decomposition.cell_bottom[other.cells[-1]] == 0.0


@pytest.mark.parametrize("name", ["start", "goal"])
@pytest.mark.parametrize(("seed", "place"), [(37, (8.04, 7.21)), (16, (30.75, 11.47))])
def test_the_speed_at_an_end_decides_the_route(name: str, seed: int, place: tuple[float, float]):
    # Drawn places from where the first saddle is another one for who starts at rest with a slow drive. The
    # same backwards in time: slow brakes, and the last saddle is another one for who must stop there. Each of
    # the two routes must be the faster one for its own end speeds.
    drawn = random_problem(seed).problem
    slow = {"max_acceleration": 0.4} if name == "start" else {"max_braking": 0.4}
    robot = Robot(radius=drawn.robot.radius, **slow)
    graph = build_adjacency(decomposed(drawn), drawn.braking, robot)
    other = "goal" if name == "start" else "start"
    routes, times = {}, {}
    for speed in ("safe", "rest"):
        ends = {name: End(position=place, speed=speed), other: End(position=drawn.goal.position)}
        routes[speed] = search(graph, replace(drawn, robot=robot, **ends))
    for speed, by in itertools.product(routes, routes):
        given = {
            "start_speed" if name == "start" else "end_speed": np.array([0.0 if speed == "rest" else np.inf])
        }
        chain = routes[by].curves
        number = np.zeros(len(chain), dtype=np.int64)
        (times[speed, by],) = arc_minimum_time(chain, number, drawn.braking, robot, **given)
    assert set(routes["safe"].saddles).isdisjoint(routes["rest"].saddles)
    assert times["safe", "safe"] < times["safe", "rest"]
    assert times["rest", "rest"] < times["rest", "safe"]


def test_no_route_says_why():
    wall = [rectangle(4.9, 0.0, 0.2, 4.6), rectangle(4.9, 5.4, 0.2, 4.6)]
    asked = problem(SQUARE, wall)
    with pytest.raises(NoPathError, match=r"0\.8 m wide"):
        search(graph_of(asked), asked)
    blocked = problem(SQUARE, wall, start=(0.2, 5.0))
    with pytest.raises(NoPathError, match="start"):
        search(graph_of(asked), blocked)
