"""Random planning problems, the same for a seed on every machine.

Three families, chosen by the seed: `mixed` (points, walls, rectangles and stars anywhere), `near` (the
same, and as many that leave a gap of 1 mm to 2.5 radii to another one) and `aligned` (boxes, walls and
points on a grid: collinear edges, touching corners, passages of equal width). Polygons are convex or not;
obstacles may overlap.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import shapely
from numpy.typing import NDArray

from vnav_drake.braking import UniformBraking
from vnav_drake.problem import End, Problem
from vnav_drake.robot import Robot
from vnav_drake.world import Obstacle, World, WorldError

Array = NDArray[np.float64]

FAMILIES = ("mixed", "near", "aligned")
SHARES = (0.6, 0.2, 0.2)
SIDES = (10.0, 20.0, 40.0)  # [m] of the square room
RADII = (0.0, 0.1, 0.3)  # [m]
KINDS = (0.2, 0.25, 0.4, 0.15)  # points, walls, rectangles, stars
EDGE = 0.02  # [m] that vertices stay away from the room's walls
ROOM = 0.05  # [m] of clearance at least at the ends
APART = 0.5  # of the side, between start and goal at least
ATTEMPTS = 100  # layouts drawn before giving up


@dataclass(frozen=True)
class RandomProblem:
    """A problem and what kind it is."""

    problem: Problem
    family: str
    side: float  # [m]


def random_problem(
    seed: int,
    *,
    family: str | None = None,
    obstacles: int | None = None,
    side: float | None = None,
    radius: float | None = None,
    braking: UniformBraking | None = None,
) -> RandomProblem:
    """The problem of a seed; what is not given is drawn, with 4 to 24 obstacles.

    Start and goal have clearance and lie at least half a side apart. A way between them may not exist.

    Raises
    ------
    ValueError : no such family, or no layout with room for both ends was found.
    """
    rng = np.random.default_rng(seed)
    drawn = str(rng.choice(FAMILIES, p=SHARES))
    family = drawn if family is None else family
    if family not in FAMILIES:
        raise ValueError(f"family = {family!r}: must be one of {', '.join(FAMILIES)}")
    of_seed = float(rng.choice(SIDES)), float(rng.choice(RADII)), int(rng.integers(4, 25))
    side = of_seed[0] if side is None else side
    radius = of_seed[1] if radius is None else radius
    count = of_seed[2] if obstacles is None else obstacles
    law = UniformBraking(max_braking=1.0) if braking is None else braking
    layout: dict[str, Callable[[np.random.Generator, int, float, float], list[Array]]] = {
        "mixed": _mixed,
        "near": _near,
        "aligned": _aligned,
    }
    boundary = [(0.0, 0.0), (side, 0.0), (side, side), (0.0, side)]
    for _attempt in range(ATTEMPTS):
        shapes = layout[family](rng, count, side, radius)
        placed = [Obstacle(tuple(map(tuple, s.tolist())), f"O{i}") for i, s in enumerate(shapes, start=1)]
        try:
            world = World.build(boundary, placed)
        except WorldError:
            continue
        ends = _ends(rng, world, side, radius + law.margin)
        if ends is not None:
            problem = Problem(
                world=world,
                robot=Robot(radius=radius),
                braking=law,
                start=End(position=ends[0]),
                goal=End(position=ends[1]),
            )
            return RandomProblem(problem, family, side)
    raise ValueError(f"seed {seed}: no layout with room for start and goal in {ATTEMPTS} attempts")


def with_wheels_inside(problem: Problem) -> Problem:
    """The problem with a robot whose wheelbase and track fit in its disc, as scenario files demand.

    A point robot, which is exempt, becomes a small one: 0.3 m by 0.24 m.
    """
    size = problem.robot.radius if problem.robot.radius > 0.0 else 0.25
    robot = replace(problem.robot, wheelbase=1.2 * size, track=0.96 * size, com_height=0.2 * size)
    return replace(problem, robot=robot)


def _ends(
    rng: np.random.Generator, world: World, side: float, level: float
) -> tuple[tuple[float, float], tuple[float, float]] | None:
    points = rng.uniform(0.0, side, (400, 2))
    points = points[world.distance(points) > level + ROOM]
    if len(points) == 0:
        return None
    far = np.flatnonzero(np.hypot(*(points - points[0]).T) > APART * side)
    if len(far) == 0:
        return None
    start, goal = points[0].tolist(), points[far[0]].tolist()
    return (start[0], start[1]), (goal[0], goal[1])


def _shape(rng: np.random.Generator, scale: float) -> Array:
    """Vertices (k, 2) [m] of one obstacle about the origin, at most about 2 `scale` from it."""
    kind = int(rng.choice(4, p=KINDS))
    if kind == 0:
        return np.zeros((1, 2))
    turn = float(rng.uniform(0.0, math.pi)) if rng.random() < 0.5 else 0.0
    axes = np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
    if kind == 1:
        half = 0.5 * rng.uniform(0.5, 4.0) * scale
        return np.array([[-half, 0.0], [half, 0.0]]) @ axes
    if kind == 2:
        width, height = 0.5 * rng.uniform(0.5, 3.0, 2) * scale
        return np.array([[-width, -height], [width, -height], [width, height], [-width, height]]) @ axes
    corners = int(rng.integers(5, 9))
    angle = np.sort(rng.uniform(0.0, 2.0 * math.pi, corners))
    reach = rng.uniform(0.4, 2.0, corners) * scale
    return reach[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])


def _geometry(shape: Array) -> shapely.Geometry:
    if len(shape) == 1:
        return shapely.Point(shape[0])
    return shapely.LineString(shape) if len(shape) == 2 else shapely.Polygon(shape)


def _fits(shape: Array, side: float) -> bool:
    inside = bool(shape.min() >= EDGE and shape.max() <= side - EDGE)
    return inside and bool(_geometry(shape).is_valid)


def _mixed(rng: np.random.Generator, count: int, side: float, _radius: float) -> list[Array]:
    scale = side / 20.0
    shapes: list[Array] = []
    for _ in range(40 * count):
        if len(shapes) == count:
            break
        shape = _shape(rng, scale) + rng.uniform(0.05, 0.95, 2) * side
        if _fits(shape, side):
            shapes.append(shape)
    return shapes


def _near(rng: np.random.Generator, count: int, side: float, radius: float) -> list[Array]:
    shapes = _mixed(rng, (count + 1) // 2, side, radius)
    for _ in range(40 * count):
        if len(shapes) >= count or not shapes:
            break
        neighbour = shapes[int(rng.integers(len(shapes)))]
        angle = rng.uniform(0.0, 2.0 * math.pi)
        way = np.array([math.cos(angle), math.sin(angle)])
        gap = math.exp(rng.uniform(math.log(1e-3), math.log(max(2.5 * radius, 0.3))))
        shape = _beside(_shape(rng, side / 20.0) + neighbour.mean(axis=0), neighbour, way, gap)
        if _fits(shape, side):
            shapes.append(shape)
    return shapes


def _beside(shape: Array, neighbour: Array, way: Array, gap: float) -> Array:
    """The shape moved along `way` until it is `gap` [m] from its neighbour, to 1e-9 m."""
    other = _geometry(neighbour)
    low, high = 0.0, 1.0
    while _geometry(shape + high * way).distance(other) < gap:
        high *= 2.0
    while high - low > 1e-9:
        middle = 0.5 * (low + high)
        if _geometry(shape + middle * way).distance(other) < gap:
            low = middle
        else:
            high = middle
    return shape + high * way


def _aligned(rng: np.random.Generator, count: int, side: float, _radius: float) -> list[Array]:
    unit, cells = side / 20.0, 20
    shapes: list[Array] = []
    for _ in range(count):
        x, y = rng.integers(1, cells - 1, 2)
        kind = int(rng.choice(3, p=(0.2, 0.3, 0.5)))
        w, h = (min(int(n), cells - 1 - int(o)) for n, o in zip(rng.integers(1, 4, 2), (x, y), strict=True))
        if kind == 0:
            shape = np.array([[x, y]])
        elif kind == 1:
            shape = np.array([[x, y], [x + w, y]] if rng.random() < 0.5 else [[x, y], [x, y + h]])
        else:
            shape = np.array([[x, y], [x + w, y], [x + w, y + h], [x, y + h]])
        shapes.append(shape * unit)
    return shapes
