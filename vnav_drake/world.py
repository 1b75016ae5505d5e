"""The world: a bounded floor with polygons, wall segments and points on it, and distances to them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

SNAP = 1e-9  # [m]: grid on which touching obstacles are united; far below any real gap
INSIDE_TOLERANCE = 1e-9  # [m]: an obstacle may touch the boundary up to rounding
COLLINEAR = 2.0 * SNAP  # [m]: a vertex nearer than this to the line between its neighbours is no corner


class WorldError(ValueError):
    """The geometry breaks a rule; `obstacle` is the index of the culprit, None for the boundary."""

    def __init__(self, message: str, obstacle: int | None = None) -> None:
        super().__init__(message)
        self.obstacle = obstacle


@dataclass(frozen=True)
class Obstacle:
    """One vertex is a point, two are a wall segment, three or more a simple polygon."""

    vertices: tuple[tuple[float, float], ...]  # [m], either orientation
    name: str = ""
    circle: tuple[float, float, float] | None = None  # [m], x, y, radius: the disc that a polygon stands for


def circle_obstacle(center: tuple[float, float], radius: float, sides: int = 96, name: str = "") -> Obstacle:
    """The regular polygon around a circle: never inside it, at most 0.054 % wider (96 sides)."""
    angle = 2.0 * math.pi * np.arange(sides) / sides
    reach = radius / math.cos(math.pi / sides)
    ring = np.column_stack([center[0] + reach * np.cos(angle), center[1] + reach * np.sin(angle)])
    disc = (float(center[0]), float(center[1]), float(radius))
    return Obstacle(tuple((float(x), float(y)) for x, y in ring), name, disc)


class World:
    """Obstacles united within one outer boundary, with exact distances.

    Build it with `World.build`. Features are the vertices and edges of what remains: overlaps are
    united, walls are cut where they cross, and vertices within a straight edge are dropped.
    """

    boundary: shapely.Polygon  # as given
    obstacles: tuple[Obstacle, ...]  # as given
    floor: shapely.Polygon | shapely.MultiPolygon  # boundary minus polygons; walls not removed
    blocked: tuple[shapely.Polygon, ...]  # disjoint united polygon obstacles
    vertices: Array  # (n, 2) [m]
    edges: NDArray[np.int64]  # (m, 2), rows of `vertices`
    isolated: NDArray[np.int64]  # (k,), vertices without edges: point obstacles
    walls: tuple[Array, ...]  # (2, 2) [m] each, stretches of walls on the floor, cut where they meet

    def __init__(
        self,
        boundary: shapely.Polygon,
        obstacles: tuple[Obstacle, ...],
        blocked: tuple[shapely.Polygon, ...],
        floor: shapely.Polygon | shapely.MultiPolygon,
        walls: Array,
        points: Array,
    ) -> None:
        self.boundary, self.obstacles = boundary, obstacles
        self.blocked, self.floor = blocked, floor
        shapely.prepare(self.floor)
        corners, self.edges = _edges(np.concatenate([_segments(shapely.boundary(floor)), walls]))
        lines = shapely.multilinestrings(shapely.linestrings(corners[self.edges]))
        apart = np.unique(points[shapely.distance(shapely.points(points), lines) > SNAP], axis=0)
        self.isolated = len(corners) + np.arange(len(apart))
        self.vertices = np.concatenate([corners, apart])
        ends, joined = _edges(walls)
        self.walls = tuple(ends[joined])

    @classmethod
    def build(cls, boundary: ArrayLike, obstacles: Iterable[Obstacle] = ()) -> World:
        """Unite the obstacles and check the geometry.

        Parameters
        ----------
        boundary : (n, 2) [m], a simple polygon, either orientation, not closed by repetition.
        obstacles : points, walls and simple polygons inside the boundary; they may touch and overlap.

        Raises
        ------
        WorldError : a coordinate is not finite, a polygon is degenerate or crosses itself, an obstacle
            leaves the boundary, or obstacles cover the whole floor.
        """
        obstacles = tuple(obstacles)
        hall = _simple_polygon(_coordinates(boundary, "the boundary", None), "the boundary", None)
        shapes = [_shape(obstacle, i) for i, obstacle in enumerate(obstacles)]
        around = hall.buffer(INSIDE_TOLERANCE, join_style="mitre")
        shapely.prepare(around)
        for i, shape in enumerate(shapes):
            if not around.covers(shape):
                what = obstacles[i].name or f"obstacle {i}"
                raise WorldError(f"{what} lies outside the boundary, at least in part", i)
        solid = [s for s in shapes if isinstance(s, shapely.Polygon)]
        walls = [s for s in shapes if isinstance(s, shapely.LineString)]
        floor, mass, stretches = _arrange(hall, solid, walls)
        if floor.is_empty:
            raise WorldError("the obstacles cover the whole floor")
        points = np.array(
            [(s.x, s.y) for s in shapes if isinstance(s, shapely.Point) and not mass.contains(s)]
        )
        return cls(hall, obstacles, tuple(_polygons(mass)), floor, stretches, points.reshape(-1, 2))

    @cached_property
    def _ends(self) -> tuple[Array, Array]:
        """Ends of all edges, isolated points last as edges of length zero: (m + k, 2) each."""
        point = self.vertices[self.isolated]
        start = np.concatenate([self.vertices[self.edges[:, 0]], point])
        end = np.concatenate([self.vertices[self.edges[:, 1]], point])
        return start, end

    @cached_property
    def edge_tree(self) -> shapely.STRtree:
        """Spatial index of all edges, isolated points last."""
        start, end = self._ends
        lines = shapely.linestrings(np.stack([start, end], axis=1))
        lines[len(self.edges) :] = shapely.points(start[len(self.edges) :])
        return shapely.STRtree(lines, node_capacity=4)  # nearest queries: twice as fast as with 10

    def is_floor(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Whether points (..., 2) [m] lie strictly inside the boundary and outside all polygons."""
        p = np.asarray(points, dtype=float)
        return np.asarray(shapely.contains_xy(self.floor, p[..., 0], p[..., 1]))

    def nearest(self, points: ArrayLike) -> tuple[Array, Array, NDArray[np.int64]]:
        """Distance [m], foot point [m] and index of the nearest edge of points (..., 2) [m].

        Shapes (...), (..., 2), (...). An index from `len(edges)` on names the isolated point
        `isolated[index - len(edges)]`. Raises ValueError when a coordinate is not finite.
        """
        p = np.asarray(points, dtype=float)
        if not np.isfinite(p).all():
            raise ValueError("distances are asked at points that are not finite")
        flat = p.reshape(-1, 2)
        which = self.edge_tree.query_nearest(shapely.points(flat), all_matches=False)[1]
        start, end = self._ends
        a, along = start[which], end[which] - start[which]
        square = np.einsum("ij,ij->i", along, along)
        part = np.einsum("ij,ij->i", flat - a, along) / np.where(square > 0.0, square, 1.0)
        foot = a + np.clip(part, 0.0, 1.0)[:, None] * along
        gap = np.hypot(*(flat - foot).T)
        shape = p.shape[:-1]
        return gap.reshape(shape), foot.reshape(p.shape), which.reshape(shape)

    def distance(self, points: ArrayLike) -> Array:
        """Signed distance [m] to the nearest obstacle or boundary of points (..., 2) [m]; (...).

        Negative inside polygon obstacles and outside the boundary.
        """
        return np.where(self.is_floor(points), 1.0, -1.0) * self.nearest(points)[0]

    def distance_and_gradient(self, points: ArrayLike) -> tuple[Array, Array]:
        """Signed distance [m] and its gradient (a unit vector; zero at distance zero).

        Shapes (...) and (..., 2). On a Voronoi arc the gradient is that of one nearest feature.
        """
        p = np.asarray(points, dtype=float)
        gap, foot, _ = self.nearest(p)
        sign = np.where(self.is_floor(p), 1.0, -1.0)
        size = gap[..., None]
        away = np.divide(p - foot, size, out=np.zeros_like(p), where=size > 0.0)
        return sign * gap, sign[..., None] * away

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """x_min, y_min, x_max, y_max [m]"""
        x0, y0, x1, y1 = self.boundary.bounds
        return float(x0), float(y0), float(x1), float(y1)

    @property
    def diameter(self) -> float:
        """Diagonal of the bounding box [m]."""
        x0, y0, x1, y1 = self.bounds
        return math.hypot(x1 - x0, y1 - y0)


def _coordinates(vertices: ArrayLike, what: str, index: int | None) -> Array:
    """The vertices as a finite array (n, 2) [m], n >= 1."""
    array = np.asarray(vertices, dtype=float)
    if array.ndim != 2 or array.shape[1] != 2 or len(array) == 0:
        raise WorldError(f"{what}: needs at least one vertex of two coordinates", index)
    if not np.isfinite(array).all():
        bad = int(np.flatnonzero(~np.isfinite(array).all(axis=1))[0])
        raise WorldError(f"{what}: vertex {bad} = {array[bad].tolist()}: must be finite [m]", index)
    return array


def _simple_polygon(vertices: Array, what: str, index: int | None) -> shapely.Polygon:
    if len(vertices) < 3:
        raise WorldError(f"{what}: a polygon needs at least three vertices", index)
    polygon = shapely.Polygon(vertices)
    if not polygon.is_valid:
        raise WorldError(f"{what}: {shapely.is_valid_reason(polygon)}", index)
    if polygon.area <= 0.0:
        raise WorldError(f"{what} encloses no area", index)
    return polygon


def _shape(obstacle: Obstacle, index: int) -> shapely.Geometry:
    what = obstacle.name or f"obstacle {index}"
    vertices = _coordinates(obstacle.vertices, what, index)
    if len(vertices) == 1:
        return shapely.Point(vertices[0])
    if len(vertices) == 2:
        if math.dist(vertices[0], vertices[1]) <= SNAP:
            raise WorldError(f"{what}: both ends of the wall are the same point", index)
        return shapely.LineString(vertices)
    return _simple_polygon(vertices, what, index)


def _touching(shapes: Sequence[shapely.Geometry]) -> NDArray[np.bool_]:
    """Which shapes touch another one, up to the grid."""
    pairs = shapely.STRtree(shapes).query(shapes, predicate="dwithin", distance=SNAP)
    mask = np.zeros(len(shapes), dtype=bool)
    mask[pairs[0, pairs[0] != pairs[1]]] = True
    return mask


def _arrange(
    hall: shapely.Polygon, solid: list[shapely.Polygon], walls: list[shapely.LineString]
) -> tuple[shapely.Geometry, shapely.Geometry, Array]:
    """The floor, the union of the polygons, and the stretches of walls (k, 2, 2) [m] on the floor.

    Shapes that touch nothing keep every bit. All others are cut in one go where they meet, with snap
    rounding (J. Hobby, "Practical segment intersection with finite precision output", 1999): each line
    runs through the grid cells of all vertices and crossings on it, so that what touches up to a
    rounding error has exactly the same vertices and edges there. Uniting first and cutting later
    would leave slivers or not by chance.
    """
    touching = _touching([hall.exterior, *solid, *walls])
    lines = [shapely.LineString(s.coords) for s in [hall.exterior, *(p.exterior for p in solid), *walls]]
    noded = shapely.union_all([line for line, t in zip(lines, touching, strict=True) if t], grid_size=SNAP)
    faces = shapely.get_parts(shapely.polygonize(shapely.get_parts(noded)))
    spots = shapely.point_on_surface(faces)
    within = np.zeros(len(faces), dtype=bool)
    cut = [p for p, t in zip(solid, touching[1:], strict=False) if t]  # others lie within a face, not over it
    within[shapely.STRtree(cut).query(spots, predicate="within")[0]] = True
    within |= shapely.area(faces) < SNAP * shapely.length(faces)  # a gap that the grid cannot show
    united = shapely.union_all(faces[within])
    if touching[0]:
        floor = shapely.union_all(faces[~within & shapely.contains(hall, spots)])
    else:
        floor = hall.difference(united)
    alone = shapely.MultiPolygon([p for p, t in zip(solid, touching[1:], strict=False) if not t])
    floor = floor.difference(alone)
    pieces = [_segments(wall) for wall, t in zip(walls, touching[1 + len(solid) :], strict=True) if not t]
    stretches = np.concatenate([_segments(noded), *pieces])
    middle = stretches.mean(axis=1)
    on_floor = shapely.contains_xy(floor, middle[:, 0], middle[:, 1])
    on_floor &= shapely.distance(shapely.points(middle), shapely.boundary(floor)) > SNAP
    return floor, shapely.union_all([united, alone]), stretches[on_floor]


def _polygons(geometry: shapely.Geometry) -> list[shapely.Polygon]:
    return [part for part in shapely.get_parts(geometry) if not part.is_empty]


def _segments(lines: shapely.Geometry) -> Array:
    """All straight pieces (n, 2, 2) [m] of lines."""
    coordinates, line = shapely.get_coordinates(shapely.get_parts(lines), return_index=True)
    same = line[1:] == line[:-1]
    return np.stack([coordinates[:-1][same], coordinates[1:][same]], axis=1)


def _edges(pairs: Array) -> tuple[Array, NDArray[np.int64]]:
    """Vertices (n, 2) and edges (m, 2) of straight pieces (k, 2, 2) that meet at ends only.

    Vertices within a straight line are dropped.
    """
    vertices, index = np.unique(pairs.reshape(-1, 2), axis=0, return_inverse=True)
    edges = np.unique(np.sort(index.reshape(-1, 2), axis=1), axis=0)
    neighbours: dict[int, set[int]] = {}
    for i, j in edges.tolist():
        neighbours.setdefault(i, set()).add(j)
        neighbours.setdefault(j, set()).add(i)
    for i, around in neighbours.items():
        if len(around) == 2 and _is_straight(vertices, i, *around):
            j, k = around
            if k in neighbours[j]:
                continue  # a triangle of no height would vanish
            neighbours[j].symmetric_difference_update({i, k})
            neighbours[k].symmetric_difference_update({i, j})
            around.clear()
    kept = np.array(sorted(i for i, around in neighbours.items() if around), dtype=np.int64)
    rank = {int(i): r for r, i in enumerate(kept)}
    joined = sorted((rank[i], rank[j]) for i, around in neighbours.items() for j in around if i < j)
    return vertices[kept], np.array(joined, dtype=np.int64).reshape(-1, 2)


def _is_straight(vertices: Array, middle: int, one: int, other: int) -> bool:
    u, w = vertices[middle] - vertices[one], vertices[other] - vertices[middle]
    return (
        abs(float(u[0] * w[1] - u[1] * w[0])) <= COLLINEAR * float(np.hypot(*(u + w))) and float(u @ w) > 0.0
    )
