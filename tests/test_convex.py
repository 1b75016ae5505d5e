"""Convex pieces: together they give the signed distance of the world, one smooth part each."""

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from vnav_drake.convex import ConvexPieces, convex_parts
from vnav_drake.world import Obstacle, World

NOTCHED_HALL = [(0, 0), (32, 0), (32, 31), (16, 20), (0, 31)]  # one reflex corner
HOOK = Obstacle(((2, 2), (8, 2), (8, 8), (6, 8), (6, 4), (2, 4)))
OBSTACLES = [HOOK, Obstacle(((20, 5), (22, 5), (22, 7))), Obstacle(((1, 1),)), Obstacle(((1, 5), (1, 9)))]


@pytest.fixture(scope="module")
def world():
    return World.build(NOTCHED_HALL, OBSTACLES)


def all_pairs(count, pieces):
    n = len(pieces.corners)
    return np.repeat(np.arange(count), n), np.tile(np.arange(n), count)


def test_least_signed_distance_on_the_floor_is_the_worlds(world):
    pieces = ConvexPieces.of(world)
    points = np.random.default_rng(0).uniform(0, 32, (3000, 2))
    points = points[world.is_floor(points)]
    i, j = all_pairs(len(points), pieces)
    least = pieces.signed_distance(j, points[i])[0].reshape(len(points), -1).min(axis=1)
    np.testing.assert_allclose(least, world.distance(points), atol=1e-12)


def test_some_piece_is_negative_wherever_there_is_no_floor(world):
    pieces = ConvexPieces.of(world)
    points = np.random.default_rng(1).uniform(-5, 37, (3000, 2))
    points = points[~world.is_floor(points)]
    i, j = all_pairs(len(points), pieces)
    least = pieces.signed_distance(j, points[i])[0].reshape(len(points), -1).min(axis=1)
    assert np.all(least <= 1e-12)


def test_gradient_agrees_with_central_differences(world):
    pieces = ConvexPieces.of(world)
    points = np.random.default_rng(2).uniform(0, 32, (500, 2))
    i, j = all_pairs(len(points), pieces)
    step = 1e-6
    numeric = [
        (pieces.signed_distance(j, points[i] + e)[0] - pieces.signed_distance(j, points[i] - e)[0])
        / (2 * step)
        for e in step * np.eye(2)
    ]
    gradient = pieces.signed_distance(j, points[i])[1]
    assert np.quantile(np.abs(gradient - np.column_stack(numeric)).max(axis=1), 0.999) < 1e-7


def test_signed_distance_inside_a_square_is_the_depth():
    # Square of side 2: 0.3 m below its upper edge the nearest way out is 0.3 m.
    world = World.build([(0, 0), (10, 0), (10, 10), (0, 10)], [Obstacle(((4, 4), (6, 4), (6, 6), (4, 6)))])
    pieces = ConvexPieces.of(world)
    i, j = all_pairs(1, pieces)
    depth, gradient = pieces.signed_distance(j, np.array([[5.2, 5.7]])[i])
    k = int(np.argmin(depth))
    assert depth[k] == pytest.approx(-0.3, abs=1e-12)
    np.testing.assert_allclose(gradient[k], [0, 1], atol=1e-12)


@given(st.integers(0, 10_000))
def test_convex_parts_tile_the_polygon(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 14))
    angle = np.sort(rng.uniform(0, 2 * np.pi, n))
    reach = rng.uniform(0.3, 3.0, n)
    polygon = shapely.Polygon(np.column_stack([reach * np.cos(angle), reach * np.sin(angle)]))
    if not polygon.is_valid or polygon.area < 1e-3:
        return
    parts = [shapely.Polygon(ring) for ring in convex_parts(polygon)]
    assert sum(part.area for part in parts) == pytest.approx(polygon.area, rel=1e-6)
    assert shapely.union_all(parts).symmetric_difference(polygon).area < 1e-6 * polygon.area
    for part in parts:
        assert part.convex_hull.area == pytest.approx(part.area, rel=1e-12)


def test_parts_of_a_polygon_with_a_hole_leave_the_hole_free():
    ring = shapely.box(0, 0, 6, 6).difference(shapely.box(2, 2, 4, 4))
    parts = [shapely.Polygon(part) for part in convex_parts(ring)]
    assert sum(part.area for part in parts) == pytest.approx(32.0)
    assert all(part.intersection(shapely.box(2, 2, 4, 4)).area < 1e-12 for part in parts)
    assert len(parts) <= 8


def test_near_finds_every_piece_within_reach(world):
    pieces = ConvexPieces.of(world)
    points = np.random.default_rng(3).uniform(0, 32, (200, 2))
    reach = np.full(200, 3.0)
    i, j = all_pairs(200, pieces)
    gap = pieces.signed_distance(j, points[i])[0]
    expected = {(a, b) for a, b, g in zip(i, j, gap, strict=True) if g <= 3.0}
    assert set(zip(*pieces.near(points, reach), strict=True)) == expected
