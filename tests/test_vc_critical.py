"""Critical points of position-velocity space: exact cases, independent minima, the sum rule."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize_scalar

from benchmarks.random_worlds import random_problem
from tests.worlds import distance_by_shapely, moved, moved_world, rectangle
from vnav_drake.braking import UniformBraking
from vnav_drake.problem import PlanningError, Problem
from vnav_drake.vc_method import (
    MAXIMUM,
    SADDLE,
    CriticalPoints,
    critical_points,
    euler_characteristic,
    free_components,
)
from vnav_drake.vc_method.cells import feet_of
from vnav_drake.voronoi import VoronoiDiagram, build_diagram
from vnav_drake.world import Obstacle, World

Array = NDArray[np.float64]

LAW = UniformBraking(max_braking=1.0)
SQUARE = ((0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0))
# Rooms of 6 x 6 m joined by a corridor 2 m wide and 8 m long.
TWO_ROOMS = (
    *((0.0, 0.0), (6.0, 0.0), (6.0, 2.0), (14.0, 2.0), (14.0, 0.0), (20.0, 0.0)),
    *((20.0, 6.0), (14.0, 6.0), (14.0, 4.0), (6.0, 4.0), (6.0, 6.0), (0.0, 6.0)),
)
# A third room of 6 x 6 m above the second, joined by a corridor of 2 m as wide and 4 m as long.
THREE_ROOMS = (
    *((0.0, 0.0), (6.0, 0.0), (6.0, 2.0), (14.0, 2.0), (14.0, 0.0), (20.0, 0.0)),
    *((20.0, 6.0), (18.0, 6.0), (18.0, 10.0), (20.0, 10.0), (20.0, 16.0), (14.0, 16.0)),
    *((14.0, 10.0), (16.0, 10.0), (16.0, 6.0), (14.0, 6.0), (14.0, 4.0), (6.0, 4.0)),
    *((6.0, 6.0), (0.0, 6.0)),
)
# Two rooms joined by a corridor 2 m wide that turns at a right angle.
BENT = (
    *((0.0, 0.0), (6.0, 0.0), (6.0, 2.0), (14.0, 2.0), (14.0, 10.0)),
    *((16.0, 10.0), (16.0, 16.0), (10.0, 16.0), (10.0, 10.0), (12.0, 10.0)),
    *((12.0, 4.0), (6.0, 4.0), (6.0, 6.0), (0.0, 6.0)),
)


def critical_of(
    boundary: ArrayLike, obstacles: list[Obstacle] | None = None, radius: float = 0.5, **law: float
) -> tuple[CriticalPoints, VoronoiDiagram]:
    braking = UniformBraking(max_braking=1.0, **law)
    world = World.build(boundary, obstacles or [])
    diagram = build_diagram(world, radius).restricted(radius + braking.margin)
    return critical_points(diagram, braking), diagram


def critical_in(problem: Problem) -> tuple[CriticalPoints, VoronoiDiagram]:
    level = problem.robot.radius + problem.braking.margin
    diagram = build_diagram(problem.world, problem.robot.radius).restricted(level)
    return critical_points(diagram, problem.braking), diagram


def ends_of(extent: Array) -> Array:
    """Ends of plateaus (n, 2, 2) in order of x, then y."""
    order = np.lexsort([extent[..., 1].round(6), extent[..., 0].round(6)])
    return np.take_along_axis(extent, order[..., None], axis=1)


def test_a_corridor_of_constant_width_is_one_saddle_as_long_as_its_walls():
    # Between the walls y = 2 and y = 4 clearance is 1 - 0.5; past their ends (x = 6 and x = 14) the arc runs
    # between two corners, where it rises.
    critical, _ = critical_of(TWO_ROOMS)
    saddle = critical.saddles
    assert critical.multiplicity[saddle] == [1]
    np.testing.assert_allclose(critical.clearance[saddle], 0.5, atol=1e-12)
    np.testing.assert_allclose(critical.speed[saddle], 1.0, atol=1e-12)  # V = sqrt(2 * 1 * 0.5)
    np.testing.assert_allclose(critical.point[saddle], [[10.0, 3.0]], atol=1e-9)
    np.testing.assert_allclose(ends_of(critical.extent[saddle]), [[[6.0, 3.0], [14.0, 3.0]]], atol=1e-9)


def test_a_room_with_a_door_has_a_plateau_of_greatest_clearance():
    # Clearance is 3 - 0.5 where only the walls y = 0 and y = 6 are as near: from x = 3 (the wall x = 0) to
    # where the door's corner (6, 2) is 3 m away, x = 6 - sqrt(3^2 - 1^2).
    critical, diagram = critical_of(TWO_ROOMS)
    top = critical.maxima
    np.testing.assert_allclose(critical.clearance[top], 2.5, atol=1e-12)
    left = ends_of(critical.extent[top])[np.argmin(critical.point[top][:, 0])]
    np.testing.assert_allclose(left, [[3.0, 3.0], [6.0 - math.sqrt(8.0), 3.0]], atol=1e-9)
    assert (critical.node[top] >= 0).all()
    np.testing.assert_array_equal(diagram.nodes[critical.node[top]], critical.point[top])


def test_corridors_in_a_row_are_a_saddle_each():
    critical, _ = critical_of(THREE_ROOMS)
    assert len(critical.maxima) == 3
    np.testing.assert_allclose(critical.clearance[critical.saddles], 0.5, atol=1e-12)
    order = np.argsort(critical.point[critical.saddles][:, 0])
    extent = ends_of(critical.extent[critical.saddles][order])
    expected = [[[6.0, 3.0], [14.0, 3.0]], [[17.0, 6.0], [17.0, 10.0]]]
    np.testing.assert_allclose(extent, expected, atol=1e-9)


def test_an_l_shaped_corridor_has_a_maximum_in_its_bend():
    # t from both outer walls and from the inner corner, sqrt(2) (2 - t) = t: t = 4 - 2 sqrt(2).
    critical, _ = critical_of(BENT)
    np.testing.assert_allclose(critical.clearance[critical.saddles], [0.5, 0.5], atol=1e-12)
    assert len(critical.maxima) == 3
    bend = 4.0 - 2.0 * math.sqrt(2.0)
    lowest = critical.maxima[np.argmin(critical.clearance[critical.maxima])]
    assert critical.clearance[lowest] == pytest.approx(bend - 0.5, abs=1e-12)
    np.testing.assert_allclose(critical.point[lowest], [14.0 - bend, 2.0 + bend], atol=1e-9)


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.2345, math.pi / 4])
@pytest.mark.parametrize("boundary", [TWO_ROOMS, THREE_ROOMS, BENT])
def test_plateaus_stay_one_point_each_when_the_world_is_turned(boundary: ArrayLike, angle: float):
    # Turned coordinates are rounded, so that no wall is exactly parallel to another.
    world = moved_world(boundary, [], angle, (3.7, -12.1))
    critical = critical_points(build_diagram(world, 0.5), LAW)
    upright, _ = critical_of(boundary)
    assert np.bincount(critical.kind).tolist() == np.bincount(upright.kind).tolist()
    for kind in (SADDLE, MAXIMUM):
        one, other = (np.sort(c.clearance[c.kind == kind]) for c in (critical, upright))
        np.testing.assert_allclose(one, other, atol=1e-9)
    ends = np.sort(np.hypot(*np.diff(critical.extent, axis=1)[:, 0].T))
    expected = np.sort(np.hypot(*np.diff(upright.extent, axis=1)[:, 0].T))
    np.testing.assert_allclose(ends, expected, atol=1e-6)


def test_a_long_corridor_that_widens_a_little_has_no_saddle_inside():
    # 20 m, from 2 m to 2.02 m wide: far above rounding, so that clearance just rises along it.
    wedge = [(0.0, 0.0), (20.0, 0.0), (20.0, 2.02), (0.0, 2.0)]
    critical, _ = critical_of(wedge)
    assert len(critical.saddles) == 0
    assert len(critical.maxima) == 1
    assert critical.point[critical.maxima][0, 0] > 18.0


def test_a_convex_room_has_one_maximum_and_no_saddle():
    # The incircle of the 3-4-5 triangle: radius 1, centre (1, 1).
    critical, _ = critical_of([(0.0, 0.0), (4.0, 0.0), (0.0, 3.0)], radius=0.2)
    assert critical.kind.tolist() == [MAXIMUM]
    np.testing.assert_allclose(critical.point, [[1.0, 1.0]], atol=1e-12)
    np.testing.assert_allclose(critical.clearance, [0.8], atol=1e-12)
    np.testing.assert_allclose(critical.speed, [math.sqrt(1.6)], atol=1e-12)


def test_four_arcs_that_meet_at_a_node_are_one_maximum_between_four_saddles():
    # Points at (5 +- 1, 5 +- 1): sqrt(2) from the centre, and 1 from the middles of the sides between them.
    points = [Obstacle(((5.0 + x, 5.0 + y),)) for x in (-1.0, 1.0) for y in (-1.0, 1.0)]
    critical, diagram = critical_of(SQUARE, points, radius=0.1)
    centre = np.flatnonzero(np.hypot(*(critical.point - 5.0).T) < 1e-9)
    assert critical.kind[centre].tolist() == [MAXIMUM]
    assert len(diagram.incident(int(critical.node[centre[0]]))[0]) == 4
    assert critical.clearance[centre] == pytest.approx(math.sqrt(2.0) - 0.1, abs=1e-12)
    near = np.flatnonzero((np.hypot(*(critical.point - 5.0).T) < 1.5) & (critical.kind == SADDLE))
    np.testing.assert_allclose(critical.clearance[near], [0.9] * 4, atol=1e-12)
    # All around: four points take four holes out of the room.
    assert critical.index.sum() == 1 - 4


def test_parts_that_no_way_joins_are_counted_apart():
    # A wall with a door of 0.8 m: too narrow for a radius of 0.5 m.
    wall = [rectangle(4.9, 0.0, 0.2, 4.6), rectangle(4.9, 5.4, 0.2, 4.6)]
    critical, diagram = critical_of(SQUARE, wall)
    assert euler_characteristic(diagram.world, 0.5) == (1, 1)
    assert critical.kind.tolist() == [MAXIMUM, MAXIMUM]
    joined, diagram = critical_of(SQUARE, wall, radius=0.3)
    assert euler_characteristic(diagram.world, 0.3) == (1,)
    assert np.sort(joined.kind).tolist() == [SADDLE, MAXIMUM, MAXIMUM]


def test_a_margin_narrows_free_space_and_slows_down():
    # Clearance is measured from the robot's disc: 1 - 0.5 in the corridor, of which 0.2 is the margin.
    critical, _ = critical_of(TWO_ROOMS, margin=0.2)
    saddle = critical.saddles
    np.testing.assert_allclose(critical.clearance[saddle], 0.5, atol=1e-12)
    np.testing.assert_allclose(critical.speed[saddle], math.sqrt(0.6), atol=1e-12)
    shut, _ = critical_of(TWO_ROOMS, margin=0.6)
    assert len(shut.saddles) == 0


def test_a_greatest_speed_caps_the_speeds_and_moves_nothing():
    free, _ = critical_of(TWO_ROOMS)
    capped, _ = critical_of(TWO_ROOMS, max_speed=1.5)
    np.testing.assert_array_equal(capped.point, free.point)
    np.testing.assert_allclose(capped.speed, np.minimum(free.speed, 1.5))


def test_levels_are_checked():
    world = World.build(SQUARE)
    with pytest.raises(ValueError, match="level = -1"):
        euler_characteristic(world, -1.0)
    with pytest.raises(PlanningError, match="too close"):
        # Two points 1 m apart: free space around them closes at 0.5 m exactly.
        euler_characteristic(World.build(SQUARE, [Obstacle(((4.5, 5.0),)), Obstacle(((5.5, 5.0),))]), 0.5)


def assert_sum_rule(seed: int) -> None:
    """Maxima less saddles with multiplicity is components less holes, in every part of free space."""
    problem = random_problem(seed).problem
    critical, diagram = critical_in(problem)
    level = diagram.radius
    parts, expected = free_components(problem.world, level)
    spots = shapely.points(critical.point)
    near = max(2e-4 * level, 1e-9)  # the parts lie a little inside the exact ones
    row, part = shapely.STRtree(parts).query(spots, predicate="dwithin", distance=near)
    assert np.array_equal(row, np.arange(len(critical))), "each point lies in one part"
    found = np.zeros(len(parts), dtype=int)
    np.add.at(found, part, critical.index)
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("first", range(0, 200, 50))
def test_the_sum_rule_holds_in_random_worlds(first: int):
    for seed in range(first, first + 50):
        assert_sum_rule(seed)


def obstacles_of(problem: Problem) -> tuple[Array, list[Obstacle]]:
    return np.array(problem.world.boundary.exterior.coords)[:-1], list(problem.world.obstacles)


@pytest.mark.parametrize("seed", range(12))
def test_saddles_are_exact_minima_of_clearance_along_their_arcs(seed: int):
    # Distances by Shapely from the obstacles as given: sampled densely, then refined.
    problem = random_problem(seed).problem
    critical, diagram = critical_in(problem)
    boundary, obstacles = obstacles_of(problem)
    for row in critical.saddles:
        arc = diagram.curves.take([critical.border[row]])

        def gap(u: float | Array, arc=arc) -> Array:
            points = arc.points(np.atleast_1d(u)[None])[0]
            return distance_by_shapely(boundary, obstacles, points) - problem.robot.radius

        np.testing.assert_allclose(
            arc.points(critical.parameter[[row]])[0], critical.point[row], rtol=0.0, atol=1e-9
        )
        span = np.sort(arc.span[0])
        u = np.linspace(*span, 401)
        sampled = gap(u)
        best = int(np.argmin(sampled))
        low, high = u[max(best - 1, 0)], u[min(best + 1, 400)]
        found = minimize_scalar(
            lambda x: float(gap(x)[0]), bounds=(low, high), method="bounded", options={"xatol": 1e-10}
        )
        least = min(float(found.fun), float(sampled.min()))
        assert critical.clearance[row] == pytest.approx(least, abs=1e-9)
        assert gap(float(critical.parameter[row]))[0] == pytest.approx(critical.clearance[row], abs=1e-9)


@pytest.mark.parametrize("seed", range(40))
def test_maxima_have_the_clearance_of_their_nodes(seed: int):
    problem = random_problem(seed).problem
    critical, diagram = critical_in(problem)
    boundary, obstacles = obstacles_of(problem)
    top = critical.maxima
    np.testing.assert_array_equal(critical.point[top], diagram.nodes[critical.node[top]])
    measured = distance_by_shapely(boundary, obstacles, critical.point[top]) - problem.robot.radius
    np.testing.assert_allclose(critical.clearance[top], measured, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(critical.speed, problem.braking.speed(critical.clearance))


def directions_to_feet(world: World, point: Array, distance: float) -> Array:
    """Angles [rad], sorted, at which the nearest points of all features as near as `distance` are seen."""
    tree = world.edge_tree
    near = tree.query(shapely.Point(point), predicate="dwithin", distance=distance + 1e-7)
    feet = [
        shapely.get_coordinates(shapely.shortest_line(tree.geometries[i], shapely.Point(point)))[0]
        for i in near
    ]
    offset = np.array(feet) - point
    return np.sort(np.arctan2(offset[:, 1], offset[:, 0]))


def widest_gap(angles: Array) -> float:
    return float(np.diff(np.append(angles, angles[0] + 2.0 * math.pi)).max())


@pytest.mark.parametrize("seed", range(30))
def test_the_conditions_of_the_thesis_hold_in_generic_worlds(seed: int):
    # Manor 2015, Sec. 2.4.1: Type I where the normals of two vc-obstacles are opposite, that is between its
    # two feet; Type II at nodes inside the hull of their feet: no half-plane of directions without a foot.
    # Nodes and arcs at plateaus are left out: there the world is not generic.
    problem = random_problem(seed, family="mixed").problem
    critical, diagram = critical_in(problem)
    world, rows = problem.world, diagram.arcs
    arcs, ends = diagram.curves.take(rows), diagram.ends[rows]
    is_level = np.abs(np.diff(arcs.distance(arcs.span), axis=1)[:, 0]) < 1e-9
    generic = np.ones(len(diagram.nodes), dtype=bool)
    generic[ends[is_level]] = False
    node = np.unique(ends)
    inner = node[generic[node] & (diagram.node_distance[node] > diagram.radius)]
    gaps = np.array(
        [widest_gap(directions_to_feet(world, diagram.nodes[n], diagram.node_distance[n])) for n in inner]
    )
    # At an exact half turn the arc goes straight on: the node only marks where a wall ends.
    inside = inner[gaps < math.pi - 1e-9]
    top = critical.node[critical.maxima]
    assert len(inside) > 0
    np.testing.assert_array_equal(np.sort(inside), np.sort(top[generic[top]]))

    tried = generic[ends].all(axis=1) & (arcs.least_distance > diagram.radius)
    lowest = arcs.points(arcs.least_distance_at)
    feet = feet_of(world, diagram.feature(diagram.cells[rows]), lowest)
    offset = feet - lowest[:, None]
    size = np.hypot(offset[..., 0], offset[..., 1])
    cosine = np.einsum("ij,ij->i", offset[:, 0], offset[:, 1]) / np.maximum(size.prod(axis=1), 1e-300)
    between = rows[tried & (cosine < -1.0 + 1e-12)]
    saddle = critical.border[critical.saddles]
    np.testing.assert_array_equal(
        np.sort(between), np.sort(saddle[generic[diagram.ends[saddle]].all(axis=1)])
    )


def test_turned_worlds_have_the_same_critical_points():
    problem = random_problem(3).problem
    critical, _ = critical_in(problem)
    boundary, obstacles = obstacles_of(problem)
    world = moved_world(boundary, obstacles, 0.7, (5.0, -3.0))
    turned = critical_points(
        build_diagram(world, problem.robot.radius).restricted(problem.robot.radius), problem.braking
    )
    expected = moved(critical.point, 0.7, (5.0, -3.0))
    for kind in (SADDLE, MAXIMUM):
        one, other = expected[critical.kind == kind], turned.point[turned.kind == kind]
        gap = np.hypot(*(one[:, None] - other[None]).transpose(2, 0, 1))
        assert len(one) == len(other)
        assert gap.min(axis=1).max(initial=0.0) < 1e-6
