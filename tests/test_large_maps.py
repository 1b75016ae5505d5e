"""The large worlds of the benchmark are what they are said to be."""

import numpy as np
import pytest
import shapely

from benchmarks.large_maps import BOXES, HALL, ROOM, field_of_hexagons, hall_of_boxes


@pytest.mark.parametrize("make", [hall_of_boxes, field_of_hexagons])
def test_a_seed_gives_one_world_and_another_seed_another(make):
    one, same, other = make(3), make(3), make(4)
    assert np.array_equal(one.world.vertices, same.world.vertices)
    assert (one.start, one.goal) == (same.start, same.goal)
    assert one.world.vertices.shape != other.world.vertices.shape or not np.array_equal(
        one.world.vertices, other.world.vertices
    )


def test_the_hall_has_its_boxes():
    world = hall_of_boxes().world
    assert world.bounds == (0.0, 0.0, HALL, HALL)
    assert len(world.obstacles) == BOXES == 90
    for obstacle in world.obstacles:
        sides = np.diff(np.array([*obstacle.vertices, obstacle.vertices[0]]), axis=0)
        # a rectangle: opposite sides are equal, neighbours at right angles
        assert sides[0] == pytest.approx(-sides[2], abs=1e-9)
        assert sides[0] @ sides[1] == pytest.approx(0.0, abs=1e-9)


def test_the_field_has_1600_vertices():
    # the corners of 266 hexagons and of the square around them: 6 * 266 + 4
    world = field_of_hexagons().world
    assert sum(len(o.vertices) for o in world.obstacles) + 4 == 1600


@pytest.mark.parametrize("make", [hall_of_boxes, field_of_hexagons])
def test_the_robot_gets_from_start_to_goal(make):
    # Start and goal lie in one part of the floor shrunk by the radius: obstacles widened by it (the corners
    # of the widened shapes cut slightly inwards, so half of the spare room is asked for as well).
    problem = make()
    floor = shapely.Polygon(problem.world.boundary)
    level = problem.robot.radius + 0.5 * ROOM
    solid = shapely.union_all([shapely.Polygon(o.vertices) for o in problem.world.obstacles])
    parts = shapely.get_parts(floor.buffer(-level).difference(solid.buffer(level)))
    ends = shapely.points([problem.start.position, problem.goal.position])
    assert any(part.covers(ends[0]) and part.covers(ends[1]) for part in parts)
