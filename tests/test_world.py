"""Distances of the world against Shapely on the obstacles as given, exact cases and invariances."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from tests.worlds import (
    BENT_ROOM,
    ROOM,
    SIDE,
    distance_by_shapely,
    moved,
    moved_world,
    obstacle_lists,
    query_points,
    rectangle,
    rooms,
)
from vnav_drake.world import Obstacle, World, WorldError, circle_obstacle

Array = NDArray[np.float64]

GRID = 2e-9  # [m]: obstacles that touch are united on a grid of 1e-9 m, which moves a vertex by less


@given(room=rooms, obstacles=obstacle_lists, points=query_points)
def test_distance_agrees_with_shapely(room, obstacles: list[Obstacle], points: Array):
    world = World.build(room, obstacles)
    expected = distance_by_shapely(room, obstacles, points)
    assert world.distance(points) == pytest.approx(expected, abs=GRID)


@given(room=rooms, obstacles=obstacle_lists, points=query_points)
def test_gradient_is_the_slope_of_the_distance(room, obstacles: list[Obstacle], points: Array):
    world = World.build(room, obstacles)
    distance, gradient = world.distance_and_gradient(points)
    assert np.array_equal(distance, world.distance(points))
    step = 1e-6
    probes = points[:, None, None] + step * np.array([[[1, 0], [-1, 0]], [[0, 1], [0, -1]]])
    values, _, nearest = world.nearest(probes)
    signed = world.distance(probes)
    # Away from the ridges one feature is nearest at all probes. There the slope changes by at most
    # step / d over a step, no more smoothly than that: the foot may pass from an edge to its end.
    smooth = (np.abs(distance) > 0.05) & np.all(nearest == nearest[:, :1, :1], axis=(1, 2))
    smooth &= np.all(np.abs(values) > 0.04, axis=(1, 2))
    difference = (signed[..., 0] - signed[..., 1]) / (2.0 * step)
    assert gradient[smooth] == pytest.approx(difference[smooth], abs=step / 0.04)
    assert np.hypot(*gradient[np.abs(distance) > GRID].T) == pytest.approx(1.0, rel=1e-12)


@given(room=rooms, obstacles=obstacle_lists, points=query_points)
def test_foot_points_lie_on_the_nearest_feature(room, obstacles: list[Obstacle], points: Array):
    world = World.build(room, obstacles)
    gap, foot, which = world.nearest(points)
    assert np.hypot(*(points - foot).T) == pytest.approx(gap, abs=1e-12)
    edges = world.vertices[world.edges]
    for spot, index in zip(foot, which, strict=True):
        if index < len(edges):
            assert shapely.distance(shapely.LineString(edges[index]), shapely.Point(spot)) < 1e-12
        else:
            assert np.array_equal(spot, world.vertices[world.isolated[index - len(edges)]])


@given(room=rooms, obstacles=obstacle_lists, points=query_points)
def test_distance_changes_no_faster_than_the_place(room, obstacles: list[Obstacle], points: Array):
    distance = World.build(room, obstacles).distance(points)
    change = np.abs(distance[:, None] - distance[None, :])
    apart = np.hypot(*np.moveaxis(points[:, None] - points[None, :], -1, 0))
    assert np.all(change <= apart + GRID)


@given(
    room=rooms,
    obstacles=obstacle_lists,
    points=query_points,
    angle=st.floats(-math.pi, math.pi),
    shift=st.tuples(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0)),
)
def test_moving_the_world_moves_nothing_else(room, obstacles, points: Array, angle: float, shift):
    here, there = World.build(room, obstacles), moved_world(room, obstacles, angle, shift)
    expected, gradient = here.distance_and_gradient(points)
    distance, turned = there.distance_and_gradient(moved(points, angle, shift))
    assert distance == pytest.approx(expected, abs=GRID)
    # Where another feature is as near, either gradient is right: compare where the foot is the same.
    foot = moved(here.nearest(points)[1], angle, shift)
    same = np.hypot(*(there.nearest(moved(points, angle, shift))[1] - foot).T) < 1e-6
    clear = same & (np.abs(expected) > 0.05)
    assert turned[clear] == pytest.approx(moved(gradient, angle, (0.0, 0.0))[clear], abs=1e-6)


TOUCHING = {
    "boxes side by side": ([rectangle(2, 2, 2, 2), rectangle(4, 3, 2, 2)], 12, 12),
    "boxes that share a corner": ([rectangle(2, 2, 2, 2), rectangle(4, 4, 2, 2)], 11, 12),
    "boxes that overlap": ([rectangle(2, 2, 2, 2), rectangle(3, 3, 2, 2)], 12, 12),
    "four boxes around a court": (
        [rectangle(2, 2, 6, 1), rectangle(2, 7, 6, 1), rectangle(2, 3, 1, 4), rectangle(7, 3, 1, 4)],
        12,
        12,
    ),
    "a box inside another": ([rectangle(2, 2, 6, 6), rectangle(3, 3, 2, 2)], 8, 8),
    "a box against the room's side": ([rectangle(0, 3, 2, 2)], 8, 8),
    "a corner against the room's side": ([Obstacle(((0, 5), (2, 4), (2, 6)))], 7, 8),
    "a box across the room": ([rectangle(4, 0, 2, SIDE)], 8, 8),
    "walls that cross": ([Obstacle(((2, 2), (6, 6))), Obstacle(((2, 6), (6, 2)))], 9, 8),
    "a T of walls": ([Obstacle(((2, 5), (8, 5))), Obstacle(((5, 5), (5, 8)))], 8, 7),
    "an L of walls": ([Obstacle(((2, 5), (8, 5))), Obstacle(((8, 5), (8, 8)))], 7, 6),
    "a wall in two stretches": ([Obstacle(((2, 5), (5, 5))), Obstacle(((5, 5), (8, 5)))], 6, 5),
    "walls that overlap": ([Obstacle(((2, 5), (6, 5))), Obstacle(((4, 5), (8, 5)))], 6, 5),
    "a wall from the room's side": ([Obstacle(((0, 5), (4, 5)))], 6, 6),
    "a wall along the room's side": ([Obstacle(((2, 0), (5, 0)))], 4, 4),
    "a wall across the room": ([Obstacle(((5, 0), (5, SIDE)))], 6, 7),
    "a wall out of a box": ([rectangle(2, 2, 2, 2), Obstacle(((3, 3), (8, 3.7)))], 10, 10),
    "a wall from a box's side": ([rectangle(2, 2, 2, 2), Obstacle(((4, 3), (8, 3.7)))], 10, 10),
    "a wall along a box's side": ([rectangle(2, 2, 2, 2), Obstacle(((2, 4), (8, 4)))], 9, 9),
    "a wall within a box": ([rectangle(2, 2, 4, 4), Obstacle(((3, 3), (5, 4)))], 8, 8),
    "a point on a wall": ([Obstacle(((2, 5), (8, 5))), Obstacle(((5, 5),))], 6, 5),
    "a point on a box's side": ([rectangle(2, 2, 2, 2), Obstacle(((4, 3),))], 8, 8),
    "a point within a box": ([rectangle(2, 2, 2, 2), Obstacle(((3, 3),))], 8, 8),
    "the same point twice": ([Obstacle(((4, 3),)), Obstacle(((4, 3),))], 5, 4),
}


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.1, 2.345])
@pytest.mark.parametrize("case", TOUCHING)
def test_what_touches_is_united_at_any_angle(case: str, angle: float):
    # Vertices and edges counted by hand, the room's four of each included. Rotated corners meet only
    # up to rounding; the features must be the same all the same.
    obstacles, vertices, edges = TOUCHING[case]
    world = moved_world(ROOM, obstacles, angle, (3.1, -1.7))
    assert (len(world.vertices), len(world.edges)) == (vertices, edges)
    ends = world.vertices[world.edges]
    assert np.hypot(*(ends[:, 1] - ends[:, 0]).T).min() > 0.8  # no splinters


def test_overlapping_squares_leave_an_l_shaped_gap_around_their_corners():
    # [2, 6]^2 and [4, 8]^2 meet in [4, 6]^2; the union has re-entrant corners at (4, 6) and (6, 4).
    world = World.build(ROOM, [rectangle(2, 2, 4, 4), rectangle(4, 4, 4, 4)])
    cases = {
        (3.0, 7.0): 1.0,  # 1 m above the lower square and 1 m left of the upper
        (3.5, 6.2): 0.2,  # nearest is the top of the lower square
        (1.2, 1.2): 0.8 * math.sqrt(2.0),  # its corner (2, 2)
        (9.0, 9.0): math.sqrt(2.0),  # the corner (8, 8)
        (5.0, 5.0): -math.sqrt(2.0),  # in both: both corners (4, 6) and (6, 4) are sqrt(2) off
        (4.0, 4.5): -1.5,  # edges inside the union do not count: the corner (4, 6) is nearest
        (3.0, 3.0): -1.0,  # the left and lower sides
    }
    assert world.distance(list(cases)) == pytest.approx(list(cases.values()), abs=GRID)
    assert len(world.blocked) == 1
    assert world.blocked[0].area == pytest.approx(16.0 + 16.0 - 4.0, rel=1e-9)


def test_wall_within_a_polygon_is_no_feature():
    # The centre of [2, 6]^2 is 2 m deep although a wall passes through it.
    world = World.build(ROOM, [rectangle(2, 2, 4, 4), Obstacle(((3, 3), (5, 5)))])
    assert world.distance([4.0, 4.0]) == pytest.approx(-2.0)
    assert world.walls == ()


def test_wall_is_cut_where_it_enters_a_polygon():
    # From the centre of [2, 6]^2 to (10, 4): the stretch outside is x in [6, 10].
    world = World.build(ROOM, [rectangle(2, 2, 4, 4), Obstacle(((4, 4), (10, 4)))])
    assert len(world.walls) == 1
    assert np.sort(world.walls[0][:, 0]) == pytest.approx([6.0, 10.0])
    assert world.distance([[8.0, 5.5], [5.0, 4.0], [12.0, 4.0]]) == pytest.approx([1.5, -1.0, 2.0])


def test_walls_and_points_have_two_sides():
    world = World.build(ROOM, [Obstacle(((5, 5), (9, 5))), Obstacle(((12, 12),))])
    distance, gradient = world.distance_and_gradient([[7, 6], [7, 4], [4, 5], [12, 13], [15, 16]])
    assert distance == pytest.approx([1.0, 1.0, 1.0, 1.0, 4.0])  # the last from the room's side y = 20
    assert gradient == pytest.approx(np.array([[0, 1], [0, -1], [-1, 0], [0, 1], [0, -1]]), abs=1e-15)


def test_distance_on_features_is_zero_and_so_is_the_gradient():
    world = World.build(ROOM, [rectangle(2, 2, 2, 2), Obstacle(((6, 6), (9, 6))), Obstacle(((12, 12),))])
    on = [[0, 5], [2, 3], [4, 4], [7, 6], [6, 6], [12, 12]]
    distance, gradient = world.distance_and_gradient(on)
    assert np.array_equal(distance, np.zeros(6))
    assert np.array_equal(gradient, np.zeros((6, 2)))


def test_gradient_points_out_of_obstacles_from_inside():
    # 0.5 m inside the left side of [2, 6]^2: the distance grows towards the left, to the floor.
    world = World.build(ROOM, [rectangle(2, 2, 4, 4)])
    distance, gradient = world.distance_and_gradient([2.5, 4.0])
    assert distance == pytest.approx(-0.5)
    assert gradient == pytest.approx([-1.0, 0.0])


def test_outside_the_boundary_is_negative():
    world = World.build(ROOM, [])
    assert world.distance([[-3.0, 10.0], [-3.0, -4.0]]) == pytest.approx([-3.0, -5.0])
    assert not world.is_floor([-3.0, 10.0])


def test_boundary_need_not_be_convex():
    # The bent room's re-entrant corner is (9, 9).
    world = World.build(BENT_ROOM, [])
    assert world.distance([[8.0, 8.0], [12.0, 13.0]]) == pytest.approx([math.sqrt(2.0), -4.0 + 1.0])
    assert np.array_equal(world.is_floor([[8.0, 8.0], [12.0, 13.0]]), [True, False])


def test_split_edges_of_a_polygon_are_joined():
    # A triangle with extra vertices within its sides.
    split = Obstacle(((2, 2), (4, 2), (6, 2), (4, 4), (3, 3)))
    world = World.build(ROOM, [split])
    assert len(world.vertices) == 4 + 3
    assert len(world.edges) == 4 + 3
    boundary = [(0, 0), (7, 0), (SIDE, 0), (SIDE, SIDE), (0, SIDE), (0, 1)]
    assert len(World.build(boundary, []).vertices) == 4


def test_untouched_obstacles_keep_every_bit():
    ring = ((2.1, 2.2), (4.3, 2.4), (3.7, 5.5))
    world = World.build(ROOM, [Obstacle(ring), rectangle(10, 10, 2, 2), rectangle(11, 11, 2, 2)])
    assert {tuple(v) for v in world.vertices.tolist()} >= set(ring)


def test_orientation_and_order_do_not_matter():
    obstacles = [rectangle(2, 2, 4, 4), rectangle(4, 4, 4, 4), Obstacle(((1, 9), (12, 13)))]
    backward = [Obstacle(o.vertices[::-1]) for o in reversed(obstacles)]
    one, other = World.build(ROOM, obstacles), World.build(ROOM[::-1], backward)
    assert np.array_equal(one.vertices, other.vertices)
    assert np.array_equal(one.edges, other.edges)


def test_circle_is_enclosed_by_its_polygon():
    # The inscribed circle touches every side: apothem = radius; corners at radius / cos(pi / 96).
    ring = np.array(circle_obstacle((3.0, 4.0), 0.4).vertices)
    middle = 0.5 * (ring + np.roll(ring, -1, axis=0))
    assert np.hypot(*(middle - (3.0, 4.0)).T) == pytest.approx(0.4, rel=1e-12)
    assert np.hypot(*(ring - (3.0, 4.0)).T) == pytest.approx(0.4 / math.cos(math.pi / 96), rel=1e-12)


def test_one_call_answers_arrays_of_any_shape():
    world = World.build(ROOM, [rectangle(2, 2, 2, 2)])
    points = np.random.default_rng(1).uniform(0, SIDE, (3, 4, 2))
    distance, gradient = world.distance_and_gradient(points)
    assert (distance.shape, gradient.shape) == ((3, 4), (3, 4, 2))
    gap, foot, which = world.nearest(points)
    assert (gap.shape, foot.shape, which.shape) == ((3, 4), (3, 4, 2), (3, 4))
    assert np.shape(world.distance(points[1, 2])) == ()
    assert world.distance(points[1, 2]) == distance[1, 2]
    assert world.distance(np.zeros((0, 2))).shape == (0,)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_points_that_are_not_finite_are_refused(bad: float):
    world = World.build(ROOM, [])
    with pytest.raises(ValueError, match="not finite"):
        world.distance([[1.0, 1.0], [bad, 1.0]])


def test_size_is_that_of_the_boundary():
    world = World.build([(-1, 2), (2, 2), (2, 6), (-1, 6)], [])
    assert world.bounds == (-1.0, 2.0, 2.0, 6.0)
    assert world.diameter == pytest.approx(5.0)


NAN, INF = math.nan, math.inf
BAD_BOUNDARIES = {
    "no vertex": ([], "at least one vertex"),
    "two vertices": ([(0, 0), (1, 0)], "at least three vertices"),
    "on one line": ([(0, 0), (1, 0), (2, 0)], "Self-intersection"),
    "bow tie": ([(0, 0), (1, 1), (1, 0), (0, 1)], "Self-intersection"),
    "NaN": ([(0, 0), (NAN, 1), (1, 0)], "vertex 1 = .*nan.*must be finite"),
    "infinite": ([(0, 0), (1, 1), (INF, 0)], "vertex 2 = .*inf.*must be finite"),
    "three coordinates": (np.zeros((4, 3)), "two coordinates"),
}


@pytest.mark.parametrize("case", BAD_BOUNDARIES)
def test_bad_boundaries_are_refused(case: str):
    vertices, message = BAD_BOUNDARIES[case]
    with pytest.raises(WorldError, match=message) as caught:
        World.build(vertices)
    assert caught.value.obstacle is None
    assert "boundary" in str(caught.value)


BAD_OBSTACLES = {
    "no vertex": ((), "at least one vertex"),
    "NaN point": (((NAN, 1),), "vertex 0 .*must be finite"),
    "NaN wall": (((1, 1), (1, NAN)), "vertex 1 .*must be finite"),
    "infinite polygon": (((1, 1), (2, 1), (INF, 1)), "vertex 2 .*must be finite"),
    "wall of no length": (((1, 1), (1, 1)), "the same point"),
    "flat polygon": (((1, 1), (2, 1), (3, 1)), "Self-intersection"),
    "bow tie": (((1, 1), (2, 2), (2, 1), (1, 2)), "Self-intersection"),
    "point outside": (((SIDE + 1, 1),), "outside the boundary"),
    "wall half outside": (((1, 1), (-1, 1)), "outside the boundary"),
    "polygon half outside": (((1, 1), (SIDE + 1, 1), (5, 5)), "outside the boundary"),
}


@pytest.mark.parametrize("case", BAD_OBSTACLES)
def test_bad_obstacles_are_refused_by_name_and_index(case: str):
    vertices, message = BAD_OBSTACLES[case]
    good = rectangle(8, 8, 2, 2)
    with pytest.raises(WorldError, match=message) as caught:
        World.build(ROOM, [good, Obstacle(vertices), good])
    assert caught.value.obstacle == 1
    assert "obstacle 1" in str(caught.value)
    with pytest.raises(WorldError, match=r"^pillar"):
        World.build(ROOM, [good, Obstacle(vertices, name="pillar")])


def test_wall_that_leaves_a_bent_room_between_its_ends_is_refused():
    with pytest.raises(WorldError, match="outside the boundary"):
        World.build(BENT_ROOM, [Obstacle(((8, 19), (19, 8)))])


def test_obstacles_may_not_cover_the_whole_floor():
    with pytest.raises(WorldError, match="cover the whole floor"):
        World.build(ROOM, [rectangle(0, 0, 12, SIDE), rectangle(10, 0, SIDE - 10, SIDE)])


def test_world_of_2000_vertices_agrees_with_brute_force():
    # 333 hexagons on a grid, none touching: 4 + 1998 vertices.
    rng = np.random.default_rng(7)
    centers = 3.0 * np.stack(np.divmod(np.arange(333), 19), axis=1) + 2.0 + rng.uniform(-0.3, 0.3, (333, 2))
    angle = 2.0 * math.pi * np.arange(6) / 6 + rng.uniform(0, 1, (333, 1))
    rings = centers[:, None] + rng.uniform(0.3, 1.0, (333, 6, 1)) * np.stack(
        [np.cos(angle), np.sin(angle)], -1
    )
    obstacles = [Obstacle(tuple(map(tuple, ring.tolist()))) for ring in rings]
    world = World.build([(0, 0), (60, 0), (60, 60), (0, 60)], obstacles)
    assert len(world.vertices) == len(world.edges) == 2002
    points = rng.uniform(0, 60, (300, 2))
    start, end = world.vertices[world.edges[:, 0]], world.vertices[world.edges[:, 1]]
    along = end - start
    part = np.einsum("pej,ej->pe", points[:, None] - start, along) / np.einsum("ej,ej->e", along, along)
    foot = start + np.clip(part, 0.0, 1.0)[..., None] * along
    gap = np.hypot(*np.moveaxis(points[:, None] - foot, -1, 0)).min(axis=1)
    assert np.abs(world.distance(points)) == pytest.approx(gap, abs=1e-12)


def test_obstacle_that_stands_free_keeps_the_floor_around_it():
    # One rack touches the wall, the other stands free; 20 x 20 m less 1 x 2 m less 10 x 5 m.
    rack, shelf = [(4, 12), (14, 12), (14, 17), (4, 17)], [(0, 4), (1, 4), (1, 6), (0, 6)]
    hall = [(0, 0), (20, 0), (20, 20), (0, 20)]
    world = World.build(hall, [Obstacle(tuple(shelf)), Obstacle(tuple(rack))])
    assert world.floor.area == pytest.approx(400 - 2 - 50, rel=1e-12)
