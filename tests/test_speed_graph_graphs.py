"""Strips, the sampled and the published speed graph: geometry, times that no path beats, exact cases."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from tests.worlds import ROOM, obstacle_lists, rectangle, rooms
from vnav_drake.arcs import leg_points
from vnav_drake.braking import UniformBraking
from vnav_drake.problem import End, NoPathError, Problem
from vnav_drake.robot import Robot
from vnav_drake.scenario import load_scenario
from vnav_drake.speed_graph.cells import build_strips
from vnav_drake.speed_graph.drawing import path_points
from vnav_drake.speed_graph.published import build_published, k_best_published, search_published
from vnav_drake.speed_graph.sampled import SampledGraph, build_sampled, k_best_classes, search_sampled
from vnav_drake.voronoi import build_diagram
from vnav_drake.world import Obstacle, World

Array = NDArray[np.float64]
SCENARIOS = Path(__file__).resolve().parents[1] / "scenarios"


def problem_in(
    world: World, start: tuple[float, float], goal: tuple[float, float], radius: float = 0.0, **law: float
) -> Problem:
    """Safe ends; a_b = 1 m/s^2 unless told."""
    braking = UniformBraking(**{"max_braking": 1.0, **law})
    robot = Robot(radius=radius)
    return Problem(
        world=world, robot=robot, braking=braking, start=End(position=start), goal=End(position=goal)
    )


def graph_of(problem: Problem, spacing: float | None = None) -> SampledGraph:
    return build_sampled(problem, build_diagram(problem.world), spacing=spacing)


def random_problem(boundary, obstacles, radius: float, rng: np.random.Generator, **law: float) -> Problem:
    """Start and goal at random where the robot fits."""
    world = World.build(boundary, obstacles)
    points = rng.uniform(-1.0, 20.0, (200, 2))
    points = points[world.distance(points) > radius + law.get("margin", 0.0) + 0.01]
    assume(len(points) >= 2)
    return problem_in(world, tuple(points[0].tolist()), tuple(points[1].tolist()), radius, **law)


def legs_against_the_world(graph: SampledGraph, count: int) -> Array:
    """True distance minus that of the leg's own feature (n, count) [m] at places along all legs."""
    leg = np.flatnonzero(graph.strip >= 0)
    strip, theta = graph.strip[leg], graph.theta[leg]
    law, radius = graph.problem.braking, graph.problem.robot.radius
    d1, d2 = (graph.samples.clearance[n[leg]] for n in (graph.edges.tail, graph.edges.head))
    span = theta[:, 1] - theta[:, 0]
    moved, d = leg_points(
        law, radius, graph.strips.at_point[strip], d1, d2, span, np.linspace(0.0, 1.0, count)
    )
    points = graph.strips.points(strip, theta[:, :1] + moved, d + radius)
    return graph.problem.world.distance(points) - (d + radius)


@settings(max_examples=30)
@given(rooms, obstacle_lists, st.sampled_from([0.0, 0.2, 0.5]))
def test_strip_coordinates_name_the_same_places_as_the_borders(boundary, obstacles, level):
    diagram = build_diagram(World.build(boundary, obstacles)).restricted(level)
    strips = build_strips(diagram)
    side = np.flatnonzero(strips.side_strip >= 0)
    # every arc that is open on both sides bounds two strips
    assert (strips.side_strip[np.repeat(diagram.primary, 2)] >= 0).all()
    curve = side // 2
    for part in (0.0, 0.3, 1.0):
        span = diagram.curves.span[curve]
        u = (1.0 - part) * span[:, 0] + part * span[:, 1]
        curves = diagram.curves.take(curve)
        r = curves.distance(u)
        theta, strip = strips.theta(side, u), strips.side_strip[side]
        assert np.abs(strips.points(strip, theta, r) - curves.points(u)).max() < 1e-7
        assert (theta > strips.low[strip] - 1e-6).all()
        assert (theta < strips.high[strip] + 1e-6).all()
        arc = diagram.primary[curve]
        assert np.abs(strips.height(strip, theta)[arc] - r[arc]).max() < 1e-6


@settings(max_examples=25)
@given(
    rooms,
    obstacle_lists,
    st.sampled_from([0.0, 0.15, 0.4]),
    st.sampled_from([{}, {"margin": 0.05}, {"reaction_time": 0.3}]),
    st.integers(0, 2**32 - 1),
)
def test_every_leg_stays_where_its_feature_is_nearest(boundary, obstacles, radius, law, seed):
    # then the time of the leg is that of the robot, and no graph time is below the truth
    problem = random_problem(boundary, obstacles, radius, np.random.default_rng(seed), **law)
    try:
        graph = graph_of(problem)
    except NoPathError:
        return
    excess = legs_against_the_world(graph, 101)
    assert np.abs(excess).max(initial=0.0) < 1e-7


@pytest.mark.parametrize("name", ["warehouse", "four_point_room"])
def test_times_are_those_of_the_paths_drawn(name):
    # Independent quadrature: polylines of n and 2 n pieces an edge, Gauss points on each, the clearance that
    # of the world; the error of a polyline falls as 1/n^2, so (4 T(2n) - T(n)) / 3 leaves 1/n^4.
    problem = load_scenario(SCENARIOS / f"{name}.yaml").problem
    graph = graph_of(problem)
    node, weight = np.polynomial.legendre.leggauss(6)
    for path in search_sampled(graph, 3).paths:
        time = []
        for pieces in (60, 120):
            points = path_points(graph, path, pieces)
            step = np.diff(points, axis=0)
            places = points[:-1, None] + step[:, None] * (0.5 + 0.5 * node)[:, None]
            inverse = 1.0 / problem.safe_speed(places)
            time.append(float((np.hypot(*step.T) * (inverse @ (0.5 * weight))).sum()))
        assert (4.0 * time[1] - time[0]) / 3.0 == pytest.approx(path.time, rel=1e-6)


@pytest.mark.parametrize(
    ("name", "low", "high"),
    [
        # trusted intervals of the optimum, derived in the scenario files
        ("warehouse", 25.44124, 25.44170),
        ("four_point_room", 7.31757, 7.31761),
    ],
)
def test_graph_times_converge_to_the_optimum_from_above(name, low, high):
    problem = load_scenario(SCENARIOS / f"{name}.yaml").problem
    coarse, fine = (k_best_classes(graph_of(problem, spacing), 1)[0].time for spacing in (0.4, 0.1))
    assert coarse >= low
    assert fine >= low
    assert coarse <= 1.002 * high
    # smooth optimum, kinks where samples do not lie on it: second order, at least half of it seen
    assert fine - high <= (coarse - low) / 4.0


def test_corridor_centre_line_runs_at_the_braking_limit():
    # Half-width 2 m, radius 0.5 m, a_b = 1 m/s^2: V = sqrt(2 * 1.5); 30 m take 30 / V. Both ends on the arc.
    world = World.build([(0, 0), (40, 0), (40, 4), (0, 4)])
    (route,) = k_best_classes(graph_of(problem_in(world, (5, 2), (35, 2), 0.5)), 3)
    assert route.time == pytest.approx(30.0 / math.sqrt(3.0), rel=1e-12)
    assert route.word == ()
    assert route.cell.tolist() == [-1]
    assert (route.border >= 0).all()  # both ends lie on the arc


def test_two_places_near_one_point_are_joined_by_its_parabola():
    # Manor 2015, eq. (3.12): T^2 = (2 / a) (r1 + r2 - 2 sqrt(r1 r2) cos(span / 2)), far from everything else
    world = World.build([(-50, -50), (50, -50), (50, 50), (-50, 50)], [Obstacle(((0.0, 0.0),))])
    for angle in (0.5, 2.5, -2.0):
        goal = (2.0 * math.cos(angle), 2.0 * math.sin(angle))
        route = k_best_classes(graph_of(problem_in(world, (1.0, 0.0), goal)), 1)[0]
        square = 2.0 * (3.0 - 2.0 * math.sqrt(2.0) * math.cos(angle / 2.0))
        assert route.time == pytest.approx(math.sqrt(square), rel=1e-12)
        assert route.turn.tolist() == [int(math.copysign(1, angle))]


def test_the_chord_is_faster_than_the_arc_at_the_greatest_speed():
    # v_max = 0.5 m/s, reached 0.125 m from obstacles: the straight way of 12 m past a point takes 24 s.
    world = World.build(ROOM, [Obstacle(((10.0, 4.0),))])
    problem = problem_in(world, (4.0, 6.0), (16.0, 6.0), max_speed=0.5)
    route = k_best_classes(graph_of(problem, 1.0), 1)[0]
    assert route.time >= 24.0 - 1e-9
    assert route.time <= 24.0 * 1.01


def test_a_start_right_below_the_ridge_is_joined():
    # all legs to samples further along would cross the ridge; at the ridge V = sqrt(2 * 2)
    world = World.build([(0, 0), (40, 0), (40, 4), (0, 4)])
    for gap in (1e-3, 1e-6):
        route = k_best_classes(graph_of(problem_in(world, (5, 2 - gap), (35, 2 + gap))), 1)[0]
        assert 15.0 <= route.time <= 15.0 + 0.1


def test_an_end_at_rest_on_a_wall_is_joined():
    # Straight down until the disc touches the wall, V = sqrt(2 d): from d = 1.5 that takes sqrt(2 * 1.5).
    world = World.build([(0, 0), (40, 0), (40, 4), (0, 4)])
    route = k_best_classes(graph_of(problem_in(world, (20, 2), (20, 0.5), 0.5)), 1)[0]
    assert route.time == pytest.approx(math.sqrt(2.0 * 1.5), rel=1e-9)


def test_a_passage_is_open_down_to_the_width_of_the_robot():
    # Two walls across the room with a gap of 1 m between them.
    world = World.build(ROOM, [Obstacle(((0.0, 10.0), (9.5, 10.0))), Obstacle(((10.5, 10.0), (20.0, 10.0)))])
    (route,) = k_best_classes(graph_of(problem_in(world, (5, 5), (5, 15), 0.4999999)), 1)
    assert np.isfinite(route.time)
    # At exactly the width, clearance falls as u^2 and V as u: the time, the integral of du / u, diverges.
    for radius in (0.5, 0.5000001):
        with pytest.raises(NoPathError):
            k_best_classes(graph_of(problem_in(world, (5, 5), (5, 15), radius)), 1)


def test_equal_ends_take_no_time():
    world = World.build(ROOM, [rectangle(5, 5, 2, 2)])
    for place in ((3.0, 4.0), (10.0, 2.5)):
        route = k_best_classes(graph_of(problem_in(world, place, place, 0.2)), 1)[0]
        assert route.time == 0.0
        assert route.word == ()
        assert route.stops == 1


def test_swapped_ends_take_the_same_time_on_the_way_back():
    problem = load_scenario(SCENARIOS / "four_point_room.yaml").problem
    back = problem_in(problem.world, problem.goal.position, problem.start.position, problem.robot.radius)
    for one, other in zip(
        k_best_classes(graph_of(problem), 4), k_best_classes(graph_of(back), 4), strict=True
    ):
        assert other.time == pytest.approx(one.time, rel=1e-12)
        assert other.word == tuple(-g for g in reversed(one.word))


def test_routes_are_chains_of_legs_and_borders():
    problem = load_scenario(SCENARIOS / "warehouse.yaml").problem
    graph = graph_of(problem)
    part = graph.diagram
    for route in k_best_classes(graph, 6):
        assert len(route.cell) == len(route.along) == len(route.turn) == route.stops - 1
        assert ((route.cell >= 0) != (route.along >= 0)).all()
        assert route.border[0] == -1  # inside a cell
        inner = part.curves.take(route.border[1:-1]).points(route.parameter[1:-1])
        place = np.vstack([problem.start.point, inner, problem.goal.point])
        for k in range(route.stops - 1):
            ends = place[k : k + 2]
            if route.cell[k] >= 0:
                # both stops lie in the cell: its feature is as near as the nearest
                strip = np.flatnonzero(graph.strips.cell == route.cell[k])[0]
                reach = [graph.strips.coordinates(p)[1][strip] for p in ends]
                assert reach == pytest.approx(problem.world.distance(ends).tolist(), abs=1e-9)
            else:
                curve = part.curves.take([route.along[k]])
                u = ((ends - curve.origin) @ curve.axis[0])[None]
                assert np.abs(curve.points(u)[0] - ends).max() < 1e-9
                assert (u >= curve.span[0, 0] - 1e-9).all()
                assert (u <= curve.span[0, 1] + 1e-9).all()


def test_ends_without_room_and_parts_that_are_not_joined_are_refused():
    world = World.build(ROOM, [Obstacle(((0.0, 10.0), (20.0, 10.0)))])
    with pytest.raises(NoPathError, match="separate parts"):
        k_best_classes(graph_of(problem_in(world, (5, 5), (5, 15))), 1)
    with pytest.raises(NoPathError, match=r"goal \(5, 9.9\) is 0.1 m from"):
        graph_of(problem_in(world, (5, 5), (5, 9.9), 0.2))
    with pytest.raises(ValueError, match=r"spacing = 0.0: must be positive"):
        graph_of(problem_in(world, (5, 5), (5, 6)), 0.0)


def test_the_published_graph_has_a_node_at_the_least_clearance_of_every_arc():
    # Manor 2015, Definition 15
    problem = load_scenario(SCENARIOS / "four_point_room.yaml").problem
    graph = build_published(graph_of(problem))
    part = graph.sampled.diagram
    curves = part.curves.take(part.arcs)
    least = curves.points(curves.least_distance_at)
    gap = np.hypot(*(least[:, None] - graph.point[None, :-2]).transpose(2, 0, 1))
    assert gap.min(axis=1).max() < 1e-9
    # and no others
    assert gap.min(axis=0).max() < 1e-9


@settings(max_examples=15)
@given(rooms, obstacle_lists, st.integers(0, 2**32 - 1))
def test_no_published_class_is_faster_than_in_the_sampled_graph(boundary, obstacles, seed):
    problem = random_problem(boundary, obstacles, 0.2, np.random.default_rng(seed))
    try:
        graph = graph_of(problem)
        sampled = {p.word: p.time for p in search_sampled(graph, 12).paths}
    except NoPathError:
        return
    published = build_published(graph)
    found = search_published(published, 3).paths
    slowest = max(sampled.values()) if len(sampled) == 12 else math.inf
    assert found[0].time >= min(sampled.values()) * (1 - 1e-12)
    for path in found:
        # a class missing among the sampled graph's twelve best is slower than all of them
        assert path.time >= sampled.get(path.word, slowest) * (1 - 1e-12)


def test_published_routes_end_where_the_problem_does():
    problem = load_scenario(SCENARIOS / "warehouse.yaml").problem
    graph = build_published(graph_of(problem))
    for route in k_best_published(graph, 3):
        assert route.border[0] == -1  # inside a cell
        assert ((route.cell >= 0) != (route.along >= 0)).all()
