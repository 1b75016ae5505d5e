"""Straight legs with exact distances, and the way from a point to its nearest Voronoi arc."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vnav_drake.problem import PlanningError
from vnav_drake.voronoi.curves import PARABOLA, Curves, empty, linear, near_point
from vnav_drake.voronoi.diagram import VoronoiDiagram
from vnav_drake.world import World

Array = NDArray[np.float64]

NEAR = 1e-9  # [m]: points this near are one
PARALLEL = 1e-12  # 1 - cosine below which a ray runs along a wall's normal


def retraction(world: World, point: Array) -> tuple[Curves, Array]:
    """The leg straight away from the nearest feature to the border of its cell.

    Returns the leg (no curve when the point is on the border already) and the point reached. Clearance
    grows at rate 1 along it, so it is free wherever the point is.

    Raises
    ------
    PlanningError : the ray meets no border, which rounding alone can cause.
    """
    distance, foot, _ = world.nearest(point)
    direction = (point - foot) / distance
    reach = max(_ray_length(world, foot, direction, float(distance)), float(distance))
    end = foot + reach * direction
    if not abs(float(world.nearest(end)[0]) - reach) <= 1e-6 * world.diameter:
        raise PlanningError(
            f"the way from ({point[0]:.9g}, {point[1]:.9g}) to the Voronoi diagram was not found"
        )
    if reach - distance <= NEAR:
        return empty(), end
    return linear(point[None], end[None], np.array([distance]), np.array([reach])), end


def _ray_length(world: World, foot: Array, direction: Array, least: float) -> float:
    """Length of the ray from a foot point at which another feature is as near, at least `least`."""
    offset = world.vertices - foot
    toward = offset @ direction
    with np.errstate(divide="ignore", invalid="ignore"):
        to_points = np.einsum("ij,ij->i", offset, offset) / (2.0 * toward)
        start, end = world.vertices[world.edges[:, 0]], world.vertices[world.edges[:, 1]]
        along = end - start
        size = np.hypot(along[:, 0], along[:, 1])
        normal = np.column_stack([-along[:, 1], along[:, 0]]) / size[:, None]
        gap = np.einsum("ij,ij->i", foot - start, normal)
        rate = normal @ direction
        to_walls = np.concatenate([gap / (1.0 - rate), -gap / (1.0 + rate)])
        flat = np.concatenate([1.0 - rate, 1.0 + rate]) < PARALLEL
        place = foot + to_walls[:, None] * direction
        part = (
            np.einsum("ij,ij->i", place - np.tile(start, (2, 1)), np.tile(along, (2, 1)))
            / np.tile(size, 2) ** 2
        )
        beside = ~((part >= 0.0) & (part <= 1.0))
    lengths = np.concatenate([to_points[toward > 0.0], to_walls[~flat & ~beside]])
    # Features that touch at the foot give lengths of zero up to rounding.
    lengths = lengths[np.isfinite(lengths) & (lengths >= least - NEAR)]
    return float(lengths.min(initial=np.inf))


def straight_leg(diagram: VoronoiDiagram, start: Array, end: Array, level: float) -> Curves | None:
    """The straight way between two points, cut where the nearest feature changes.

    None when it comes nearer than `level` [m] to a feature. Exact: each piece has one nearest feature.
    """
    step = end - start
    length = float(np.hypot(*step))
    if length <= NEAR:
        return empty()
    if _crosses_wall(diagram.world, start, end):
        return None
    direction = step / length
    crossing = _crossings(diagram.uncut.curves, start, direction, length)
    crossing = np.concatenate([[0.0], crossing, [length]])
    crossing = crossing[np.append(np.diff(crossing) > NEAR, True)]
    crossing[0] = 0.0
    points = start + crossing[:, None] * direction
    points[-1] = end
    pieces = _near_features(diagram, points)
    return pieces if pieces.least_distance.min() >= level else None


def _crosses_wall(world: World, start: Array, end: Array) -> bool:
    """Whether the segment meets an edge of the world."""
    a, b = world.vertices[world.edges[:, 0]], world.vertices[world.edges[:, 1]]

    def side(p: Array, q: Array, r: Array) -> Array:
        one, other = q - p, r - p
        return np.sign(one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0])

    apart = (side(start, end, a) * side(start, end, b) > 0.0) | (side(a, b, start) * side(a, b, end) > 0.0)
    return not bool(apart.all())


def _crossings(curves: Curves, start: Array, direction: Array, length: float) -> Array:
    """Sorted distances [m] from `start` in `direction` at which the line meets the curves."""
    offset = start - curves.origin
    u0, du = np.einsum("ij,ij->i", offset, curves.axis), curves.axis @ direction
    w0, dw = np.einsum("ij,ij->i", offset, curves.normal), curves.normal @ direction
    p = curves.size
    is_parabola = curves.kind == PARABOLA
    with np.errstate(divide="ignore", invalid="ignore"):
        line = -w0 / dw
        # (u0 + t du)^2 + p^2 = 2 p (w0 + t dw)
        a, b, c = du * du, u0 * du - p * dw, u0 * u0 + p * p - 2.0 * p * w0
        root = np.sqrt(b * b - a * c)
        q = -(b + np.where(b < 0.0, -root, root))
        meets = np.column_stack([np.where(is_parabola, q / a, line), np.where(is_parabola, c / q, line)])
        u = u0[:, None] + meets * du[:, None]
    low, high = curves.span.min(axis=1)[:, None] - NEAR, curves.span.max(axis=1)[:, None] + NEAR
    inside = (meets > 0.0) & (meets < length) & (u >= low) & (u <= high)
    return np.unique(meets[inside])


def _near_features(diagram: VoronoiDiagram, points: Array) -> Curves:
    """Straight pieces between consecutive points, each in one cell."""
    world, edges = diagram.world, len(diagram.world.edges)
    start, end = points[:-1], points[1:]
    cell = diagram.cell_of(0.5 * (start + end))
    by_wall = cell < 2 * edges
    wall = world.vertices[world.edges[np.where(by_wall, cell // 2, 0)]]
    along = wall[:, 1] - wall[:, 0]
    normal = np.column_stack([-along[:, 1], along[:, 0]]) / np.hypot(*along.T)[:, None]
    normal = np.where((cell % 2 == 1)[:, None], -normal, normal)
    height = [np.einsum("ij,ij->i", q - wall[:, 0], normal) for q in (start, end)]
    lines = linear(start[by_wall], end[by_wall], height[0][by_wall], height[1][by_wall])
    rays = near_point(start[~by_wall], end[~by_wall], world.vertices[cell[~by_wall] - 2 * edges])
    order = np.concatenate([np.flatnonzero(by_wall), np.flatnonzero(~by_wall)])
    return Curves.join([lines, rays]).take(np.argsort(order))
