"""Signed distance to convex pieces of everything that blocks the way.

Optimisation needs a signed distance (an unsigned one lets a path tunnel through an obstacle) and one
smooth constraint per convex piece (no minimum over obstacles). Walls and points have no inside: a path
that tunnels through one is found when it is retimed, and solved again with knots kept near the guess.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import shapely
from numpy.typing import NDArray

from vnav_drake.world import World

Array = NDArray[np.float64]

CONVEXITY_TOLERANCE = 1e-9  # share of the area that a merged piece may differ from its hull


@dataclass(frozen=True)
class ConvexPieces:
    """Convex polygons, wall segments and points, padded to one array.

    Together they cover everything within reach that is not floor: obstacles, and around the
    boundary a frame of one world diameter.
    """

    corners: Array  # (p, k, 2) [m], counter-clockwise, the last corner repeated as padding
    solid: NDArray[np.bool_]  # (p,), False for walls and points, which have no inside

    @classmethod
    @lru_cache(maxsize=4)
    def of(cls, world: World) -> ConvexPieces:
        """Decompose the obstacles and the outside of the boundary; once a world, as it never changes."""
        frame = world.boundary.convex_hull.difference(world.boundary)
        polygons = [*world.blocked, *shapely.get_parts(frame)]
        rings = [ring for polygon in polygons if polygon.area > 0.0 for ring in convex_parts(polygon)]
        rings += _frame(world)
        thin = [*world.walls, *world.vertices[world.isolated][:, None, :]]
        most = max(len(ring) for ring in [*rings, *thin])
        corners = np.stack([_padded(ring, most) for ring in [*rings, *thin]])
        return cls(corners, np.arange(len(corners)) < len(rings))

    @cached_property
    def _edges(self) -> tuple[Array, Array, Array]:
        """Edge vectors (p, k, 2), their squared lengths (p, k), outward unit normals (p, k, 2)."""
        along = np.roll(self.corners, -1, axis=1) - self.corners
        square = np.einsum("pkj,pkj->pk", along, along)
        length = np.sqrt(np.where(square > 0.0, square, 1.0))
        normal = np.stack([along[..., 1], -along[..., 0]], axis=-1) / length[..., None]
        return along, square, normal

    @cached_property
    def bounds(self) -> Array:
        """(p, 4) x_min, y_min, x_max, y_max [m]"""
        return np.concatenate([self.corners.min(axis=1), self.corners.max(axis=1)], axis=1)

    def signed_distance(self, piece: NDArray[np.int64], points: Array) -> tuple[Array, Array]:
        """Signed distance [m] from points (n, 2) [m] to pieces (n,), and its gradient.

        Returns
        -------
        (n,) [m], negative inside solid pieces, and (n, 2), a unit vector where the distance is smooth.
        """
        along, square, normal = (part[piece] for part in self._edges)
        corner = self.corners[piece]
        offset = points[:, None, :] - corner
        part = np.einsum("nkj,nkj->nk", offset, along) / np.where(square > 0.0, square, 1.0)
        away = offset - np.clip(part, 0.0, 1.0)[..., None] * along
        gaps = np.einsum("nkj,nkj->nk", away, away)
        rows = np.arange(len(points))
        near = np.argmin(gaps, axis=1)
        gap = np.sqrt(gaps[rows, near])
        height = np.where(square > 0.0, np.einsum("nkj,nkj->nk", offset, normal), -np.inf)
        top = np.argmax(height, axis=1)
        inside = self.solid[piece] & (height[rows, top] <= 0.0)
        outward = away[rows, near] / np.where(gap > 0.0, gap, 1.0)[:, None]
        value = np.where(inside, height[rows, top], gap)
        return value, np.where(inside[:, None], normal[rows, top], outward)

    def near(self, points: Array, reach: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Pairs (point index, piece index) whose distance is at most `reach` (n,) [m]."""
        low, high = self.bounds[:, :2], self.bounds[:, 2:]
        outside = np.maximum(low[None] - points[:, None], points[:, None] - high[None])
        box_gap = np.linalg.norm(np.maximum(outside, 0.0), axis=-1)
        i, j = np.nonzero(box_gap <= reach[:, None])
        gap, _ = self.signed_distance(j, points[i])
        keep = gap <= reach[i]
        return i[keep], j[keep]


def convex_parts(polygon: shapely.Polygon) -> list[Array]:
    """Corners (k, 2) of convex polygons that tile `polygon`, holes and all, counter-clockwise.

    Hertel and Mehlhorn 1983: triangulate, then drop each diagonal whose removal leaves a convex piece;
    at most four times as many pieces as the fewest possible.
    """
    if _is_convex(polygon):
        return [_ring(polygon)]
    triangles = list(shapely.get_parts(shapely.constrained_delaunay_triangles(polygon)))
    owner: dict[tuple[tuple[float, float], ...], list[int]] = {}
    for i, triangle in enumerate(triangles):
        ring = triangle.exterior.coords
        for a, b in itertools.pairwise(ring):
            owner.setdefault(tuple(sorted((a, b))), []).append(i)
    parent = list(range(len(triangles)))

    def root(i: int) -> int:
        while parent[i] != i:
            i = parent[i]
        return i

    for pair in owner.values():
        one, other = root(pair[0]), root(pair[-1])
        if one == other:
            continue
        merged = triangles[one].union(triangles[other])
        if isinstance(merged, shapely.Polygon) and _is_convex(merged):
            parent[other], triangles[one] = one, merged
    return [_ring(triangles[i]) for i in range(len(triangles)) if parent[i] == i]


def _is_convex(polygon: shapely.Polygon) -> bool:
    spare = polygon.convex_hull.area - polygon.area
    return spare <= CONVEXITY_TOLERANCE * polygon.area


def _ring(polygon: shapely.Polygon) -> Array:
    return shapely.get_coordinates(shapely.geometry.polygon.orient(polygon.convex_hull))[:-1]


def _frame(world: World) -> list[Array]:
    """One wide rectangle outside each edge of the boundary's convex hull."""
    ring = _ring(world.boundary)
    rectangles = []
    for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        along = (b - a) / np.hypot(*(b - a))
        out = world.diameter * np.array([along[1], -along[0]])
        reach = world.diameter * along
        rectangles.append(np.array([a - reach, a - reach + out, b + reach + out, b + reach]))
    return rectangles


def _padded(ring: Sequence[Array] | Array, size: int) -> Array:
    corners = np.asarray(ring, dtype=float)
    return np.concatenate([corners, np.repeat(corners[-1:], size - len(corners), axis=0)])
