"""Random worlds for property tests, and distances computed from the obstacles as given."""

from __future__ import annotations

import math

import numpy as np
import shapely
from hypothesis import strategies as st
from numpy.typing import ArrayLike, NDArray

from vnav_drake.world import Obstacle, World

Array = NDArray[np.float64]

SIDE = 20.0  # [m], of the room of the random worlds
ROOM = ((0.0, 0.0), (SIDE, 0.0), (SIDE, SIDE), (0.0, SIDE))
# [m]: an L with a slanted foot, not convex
BENT_ROOM = ((0.0, 0.0), (SIDE, -1.0), (SIDE, 9.0), (9.0, 9.0), (9.0, SIDE), (0.0, SIDE))


def rectangle(x: float, y: float, width: float, height: float, name: str = "") -> Obstacle:
    """A box with its lower-left corner at (x, y) [m]."""
    return Obstacle(((x, y), (x + width, y), (x + width, y + height), (x, y + height)), name)


def moved(points: ArrayLike, angle: float, shift: ArrayLike) -> Array:
    """Points (..., 2) turned about the origin by `angle` [rad], then shifted [m]."""
    cosine, sine = math.cos(angle), math.sin(angle)
    return np.asarray(points, dtype=float) @ np.array([[cosine, sine], [-sine, cosine]]) + np.asarray(shift)


def moved_world(boundary: ArrayLike, obstacles: list[Obstacle], angle: float, shift: ArrayLike) -> World:
    """The same world at another place."""
    turned = [Obstacle(tuple(map(tuple, moved(o.vertices, angle, shift).tolist()))) for o in obstacles]
    return World.build(moved(boundary, angle, shift), turned)


def geometry(obstacle: Obstacle) -> shapely.Geometry:
    """The obstacle alone, for Shapely."""
    kinds = {1: shapely.Point, 2: shapely.LineString}
    return kinds.get(len(obstacle.vertices), shapely.Polygon)(
        obstacle.vertices[0] if len(obstacle.vertices) == 1 else obstacle.vertices
    )


def distance_by_shapely(boundary: ArrayLike, obstacles: list[Obstacle], points: Array) -> Array:
    """Signed distance (n,) [m] of points (n, 2) from the obstacles as given.

    On the floor: the least of the distances to the boundary line and to each obstacle, nothing
    united. Elsewhere: minus the distance to the floor, the complement of all solids.
    """
    hall, shapes = shapely.Polygon(boundary), [geometry(o) for o in obstacles]
    spots = shapely.points(points)
    solid = [s for s in shapes if isinstance(s, shapely.Polygon)]
    on_floor = shapely.contains(hall, spots) & ~np.any(
        [shapely.intersects(s, spots) for s in solid] or [False], 0
    )
    outside = np.min([shapely.distance(s, spots) for s in [hall.exterior, *shapes]], axis=0)
    floor = hall.difference(shapely.union_all(solid)) if solid else hall
    return np.where(on_floor, outside, -shapely.distance(floor, spots))


coordinates = st.floats(1.0, 8.0) | st.floats(1.0, SIDE - 1.0).map(round).map(float).filter(
    lambda c: c <= 8.0
)
anywhere = st.floats(-2.0, SIDE + 2.0)


@st.composite
def stars(draw: st.DrawFn) -> Obstacle:
    """A simple polygon, star-shaped about its centre, convex or not."""
    center = np.array(draw(st.tuples(coordinates, coordinates)))
    reach = float(np.min([center, SIDE - center])) - 0.5
    count = draw(st.integers(3, 8))
    gap = np.array(draw(st.lists(st.floats(0.2, 1.0), min_size=count, max_size=count)))
    angle = np.cumsum(gap) * 2.0 * math.pi / gap.sum()
    # no gap reaches half a turn, so that the rays in order make a simple polygon
    if gap.max() / gap.sum() > 0.48:
        angle = 2.0 * math.pi * np.arange(count) / count
    radius = np.array(draw(st.lists(st.floats(0.3, min(3.0, reach + 0.3)), min_size=count, max_size=count)))
    ring = center + radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    return Obstacle(tuple(map(tuple, ring.tolist())))


@st.composite
def boxes(draw: st.DrawFn) -> Obstacle:
    """A box on a grid of 1 m: many touch, overlap or share an edge."""
    x, y = draw(st.integers(0, 7)), draw(st.integers(0, 7))
    width, height = draw(st.integers(1, 8 - x)), draw(st.integers(1, 8 - y))
    return rectangle(float(x), float(y), float(width), float(height))


walls = st.tuples(st.tuples(coordinates, coordinates), st.tuples(coordinates, coordinates)).filter(
    lambda w: math.dist(*w) > 0.05
)
obstacle_lists = st.lists(
    st.one_of(
        stars().filter(lambda o: shapely.Polygon(BENT_ROOM).covers(geometry(o))),
        boxes(),
        walls.map(Obstacle),
        st.tuples(st.tuples(coordinates, coordinates)).map(Obstacle),
    ),
    max_size=7,
)
rooms = st.sampled_from([ROOM, BENT_ROOM])
query_points = st.lists(st.tuples(anywhere, anywhere), min_size=1, max_size=40).map(np.array)
