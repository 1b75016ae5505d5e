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


def circle_obstacle(center: tuple[float, float], radius: float, sides: int = 96, name: str = "") -> Obstacle:
    """The regular polygon around a circle: never inside it, at most 0.054 % wider (96 sides)."""
    angle = 2.0 * math.pi * np.arange(sides) / sides
    reach = radius / math.cos(math.pi / sides)
    ring = np.column_stack([center[0] + reach * np.cos(angle), center[1] + reach * np.sin(angle)])
    return Obstacle(tuple((float(x), float(y)) for x, y in ring), name)


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

    def __init__(
        self,
        boundary: shapely.Polygon,
        obstacles: tuple[Obstacle, ...],
        blocked: tuple[shapely.Polygon, ...],
        floor: shapely.Polygon | shapely.MultiPolygon,
        walls: Sequence[shapely.LineString],
        points: Sequence[shapely.Point],
    ) -> None:
        self.boundary, self.obstacles = boundary, obstacles
        self.blocked, self.floor = blocked, floor
        shapely.prepare(self.floor)
        rings = [ring for part in shapely.get_parts(floor) for ring in (part.exterior, *part.interiors)]
        lines = _node([shapely.LineString(ring) for ring in rings] + list(shapely.get_parts(walls)))
        vertices, edges = _edges(lines)
        free_points = [p for p in points if shapely.distance(p, lines) > SNAP]
        coordinates = np.unique(np.array([(p.x, p.y) for p in free_points]).reshape(-1, 2), axis=0)
        self.isolated = len(vertices) + np.arange(len(coordinates))
        self.vertices = np.concatenate([vertices, coordinates])
        self.edges = edges
        self.walls: tuple[Array, ...] = tuple(
            np.asarray(part.coords)[i : i + 2]
            for wall in walls
            for part in shapely.get_parts(wall)
            for i in range(len(part.coords) - 1)
        )

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
        alone, united, hall_touched = _unite(solid, hall)
        if hall_touched:  # on the grid as well, or slivers would stay between the two
            hall = shapely.set_precision(hall, SNAP)
            floor = _areas(hall.difference(united, grid_size=SNAP))
        else:
            floor = hall.difference(united)
        mass = shapely.union_all([*alone, united])
        floor = floor.difference(shapely.MultiPolygon(alone))
        if floor.is_empty:
            raise WorldError("the obstacles cover the whole floor")
        walls = [shapely.LineString(s.coords).difference(mass) for s in shapes if s.geom_type == "LineString"]
        points = [s for s in shapes if s.geom_type == "Point" and not mass.contains(s)]
        blocked = tuple(p for p in shapely.get_parts(mass) if not p.is_empty)
        return cls(hall, obstacles, blocked, floor, [w for w in walls if not w.is_empty], points)

    @cached_property
    def _segments(self) -> tuple[Array, Array]:
        """Ends of all edges, isolated points last as edges of length zero: (m + k, 2) each."""
        point = self.vertices[self.isolated]
        start = np.concatenate([self.vertices[self.edges[:, 0]], point])
        end = np.concatenate([self.vertices[self.edges[:, 1]], point])
        return start, end

    @cached_property
    def edge_tree(self) -> shapely.STRtree:
        """Spatial index of all edges, isolated points last."""
        start, end = self._segments
        lines = shapely.linestrings(np.stack([start, end], axis=1))
        lines[len(self.edges) :] = shapely.points(start[len(self.edges) :])
        return shapely.STRtree(lines)

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
        start, end = self._segments
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


def _unite(
    polygons: list[shapely.Polygon], hall: shapely.Polygon
) -> tuple[list[shapely.Polygon], shapely.Geometry, bool]:
    """Polygons that touch nothing, as given; the rest united on the grid; whether the hall is touched."""
    touching = _touching([*polygons, hall.exterior])
    alone = [polygon for polygon, touches in zip(polygons, touching[:-1], strict=True) if not touches]
    together = [polygon for polygon, touches in zip(polygons, touching[:-1], strict=True) if touches]
    united = _areas(shapely.union_all(together, grid_size=SNAP)) if together else shapely.Polygon()
    return alone, united, bool(touching[-1])


def _areas(geometry: shapely.Geometry) -> shapely.Geometry:
    """Without the lines that thin slivers collapse to on the grid."""
    return shapely.union_all([p for p in shapely.get_parts(geometry) if isinstance(p, shapely.Polygon)])


def _node(lines: list[shapely.LineString]) -> shapely.MultiLineString:
    """Lines cut where they meet, common stretches once.

    Only lines that touch others move, onto the grid: an end on another line lies beside it by a
    rounding error, and would cut nothing there.
    """
    touching = _touching(lines)
    alone = [line for line, touches in zip(lines, touching, strict=True) if not touches]
    together = [line for line, touches in zip(lines, touching, strict=True) if touches]
    noded = shapely.get_parts(shapely.union_all(together, grid_size=SNAP)) if together else []
    return shapely.MultiLineString([*alone, *noded])


def _edges(lines: shapely.Geometry) -> tuple[Array, NDArray[np.int64]]:
    """Vertices (n, 2) and edges (m, 2) of noded lines, collinear pass-through vertices removed."""
    parts = shapely.get_parts(lines)
    pairs = np.concatenate(
        [np.stack([c[:-1], c[1:]], axis=1) for c in (shapely.get_coordinates(part) for part in parts)]
    )
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
    kept = np.array(sorted(i for i, around in neighbours.items() if around))
    rank = {int(i): r for r, i in enumerate(kept)}
    joined = sorted((rank[i], rank[j]) for i, around in neighbours.items() for j in around if i < j)
    return vertices[kept], np.array(joined, dtype=np.int64)


def _is_straight(vertices: Array, middle: int, one: int, other: int) -> bool:
    u, w = vertices[middle] - vertices[one], vertices[other] - vertices[middle]
    return (
        abs(float(u[0] * w[1] - u[1] * w[0])) <= COLLINEAR * float(np.hypot(*(u + w))) and float(u @ w) > 0.0
    )
