"""Large worlds, the same for a seed on every machine: a hall of boxes, and fields of hexagons of any size.

In both a robot can get from start to goal with `ROOM` to spare on either side: a layout where it cannot is
drawn again.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import shapely
from numpy.typing import NDArray

from vnav_drake.braking import UniformBraking
from vnav_drake.problem import End, Problem
from vnav_drake.robot import Robot
from vnav_drake.world import Obstacle, World

Array = NDArray[np.float64]

ROOM = 0.1  # [m] of clearance at least, somewhere along a way from start to goal
ATTEMPTS = 50  # layouts drawn before giving up
BOXES = 90
HALL = 40.0  # [m], side of the hall of boxes
LONGEST = 5.0  # [m], side of a box
HEXAGONS = 266  # with the four corners of the field 6 * 266 + 4 = 1,600 vertices
PITCH = 3.0  # [m] between hexagons
EDGE = 0.05  # [m] that obstacles stay away from the boundary
CORNER = 1.5  # [m] from both sides of a corner: where start and goal should be


def hall_of_boxes(seed: int = 0, *, radius: float = 0.3) -> Problem:
    """40 x 40 m with 90 rectangles of 0.5 to 5 m, every other one turned; they may overlap.

    Parameters
    ----------
    seed : of the layout.
    radius : of the robot [m].

    Raises
    ------
    ValueError : no layout was found in which the robot gets from start to goal.
    """
    rng = np.random.default_rng([seed, 1])
    return _drawn(f"seed {seed}: hall of boxes", HALL, radius, lambda: [_box(rng) for _ in range(BOXES)])


def field_of_hexagons(seed: int = 0, *, radius: float = 0.2, hexagons: int = HEXAGONS) -> Problem:
    """1,600 vertices: 266 irregular hexagons, convex or not, one in each cell of a grid with 3 m pitch.

    Parameters
    ----------
    seed : of the layout.
    radius : of the robot [m].
    hexagons : how many; neighbours may overlap, so that vertices are about 6 each, and 4.

    Raises
    ------
    ValueError : no layout was found in which the robot gets from start to goal.
    """
    rng = np.random.default_rng([seed, 2])
    row = math.isqrt(hexagons - 1) + 1
    cell = np.stack(np.divmod(np.arange(hexagons), row), axis=1)
    side = PITCH * row + 1.0

    def rings() -> list[Array]:
        center = PITCH * (cell + 0.5) + 0.5 + rng.uniform(-0.4, 0.4, (hexagons, 2))
        angle = 2.0 * math.pi * np.arange(6) / 6.0 + rng.uniform(0.0, 1.0, (hexagons, 1))
        reach = rng.uniform(0.3, 1.5, (hexagons, 6, 1))
        corners = center[:, None] + reach * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        return list(np.clip(corners, EDGE, side - EDGE))

    return _drawn(f"seed {seed}: field of hexagons", side, radius, rings)


def _drawn(what: str, side: float, radius: float, rings: Callable[[], list[Array]]) -> Problem:
    """The first layout drawn in which a way joins start and goal."""
    for _attempt in range(ATTEMPTS):
        problem = _joined(side, rings(), radius)
        if problem is not None:
            return problem
    raise ValueError(f"{what}: no way through in {ATTEMPTS} layouts")


def _box(rng: np.random.Generator) -> Array:
    """Corners (4, 2) [m] of a rectangle in the hall."""
    while True:
        half = 0.5 * rng.uniform(0.5, LONGEST, 2)
        turn = rng.uniform(0.0, math.pi) if rng.random() < 0.5 else 0.0
        axes = np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
        ring = half * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]) @ axes
        ring += rng.uniform(0.0, HALL, 2)
        if ring.min() >= EDGE and ring.max() <= HALL - EDGE:
            return np.asarray(ring)


def _joined(side: float, rings: list[Array], radius: float) -> Problem | None:
    """The problem from the lower-left corner to the upper-right one; None when no way joins them.

    The ends are those places of the widest part of the free space that are nearest to where they should be.
    """
    hall = shapely.box(0.0, 0.0, side, side)
    level = radius + ROOM
    # Shapely's round corners lie within the true ones, by less than `slack`.
    slack = 2.0 * level * (1.0 - math.cos(0.25 * math.pi / 16.0))
    solid = shapely.union_all([shapely.Polygon(ring) for ring in rings])
    free = hall.buffer(-level).difference(solid.buffer(level + slack, quad_segs=16))
    parts = shapely.get_parts(free)
    widest = parts[int(np.argmax(shapely.area(parts)))]
    wanted = shapely.points([[CORNER, CORNER], [side - CORNER, side - CORNER]])
    ends = shapely.get_coordinates(shapely.shortest_line(widest, wanted))[::2]
    if math.dist(ends[0], ends[1]) < side:
        return None
    boundary = [(0.0, 0.0), (side, 0.0), (side, side), (0.0, side)]
    obstacles = [Obstacle(tuple(map(tuple, r.tolist())), f"O{i}") for i, r in enumerate(rings, start=1)]
    start, goal = (End(position=(float(x), float(y))) for x, y in ends)
    return Problem(
        world=World.build(boundary, obstacles),
        robot=Robot(radius=radius),
        braking=UniformBraking(max_braking=1.0),
        start=start,
        goal=goal,
    )
