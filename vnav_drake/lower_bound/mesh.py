"""A triangle mesh on an integer lattice, refined by newest-vertex bisection."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]

LEVELS = 26  # halvings of a square of the first mesh that the lattice can hold: 4 m become 6e-8 m
SQUARES = 8  # of the first mesh, at least, along the longer side of the world


@dataclass(frozen=True)
class Lattice:
    """Where lattice points lie: metres are `origin + unit * k`, without rounding."""

    origin: Array  # (2,) [m], multiples of `unit`
    unit: float  # [m], a power of two
    box: tuple[int, int, int, int]  # x0, y0, x1, y1: the box that the mesh covers

    @classmethod
    def around(cls, bounds: tuple[float, float, float, float]) -> Lattice:
        """The lattice for a world of these bounds x0, y0, x1, y1 [m]."""
        x0, y0, x1, y1 = bounds
        side = 2.0 ** math.floor(math.log2(max(x1 - x0, y1 - y0) / SQUARES))
        first = np.floor(np.array([x0, y0]) / side)
        count = np.maximum(np.ceil(np.array([x1, y1]) / side - first), 1.0)
        width, height = (int(c) << LEVELS for c in count)
        return cls(first * side, math.ldexp(side, -LEVELS), (0, 0, width, height))

    def metres(self, points: Indices) -> Array:
        """Lattice points (..., 2) in metres, exactly."""
        return np.asarray(self.origin + self.unit * points)


@dataclass(frozen=True)
class Mesh:
    """Conforming triangles that tile the lattice's box, each right-angled and isosceles.

    The first corner of a triangle is its newest vertex, where the right angle is; the side between the
    other two is the one that is halved next (W. F. Mitchell, "A comparison of adaptive refinement
    techniques for elliptic problems", 1989). A mesh is never changed: refining gives a new one.
    """

    lattice: Lattice
    vertices: Indices  # (n, 2) lattice points
    triangles: Indices  # (t, 3) anticlockwise
    parent: Indices  # (t,) row of the triangle in the mesh before, -1 in the first one

    @classmethod
    def around(cls, bounds: tuple[float, float, float, float]) -> Mesh:
        """The first mesh of a world with these bounds [m]: squares, each cut along both diagonals."""
        lattice = Lattice.around(bounds)
        step = 1 << LEVELS
        columns, rows = lattice.box[2] // step, lattice.box[3] // step
        x, y = np.meshgrid(np.arange(columns + 1), np.arange(rows + 1), indexing="ij")
        corners = np.stack([x.ravel(), y.ravel()], axis=1) * step
        i, j = (k.ravel() for k in np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij"))
        middles = np.stack([i, j], axis=1) * step + step // 2
        low = i * (rows + 1) + j
        ring = np.stack([low, low + rows + 1, low + rows + 2, low + 1], axis=1)  # anticlockwise
        apex = len(corners) + np.arange(len(middles))
        sides = np.stack([ring, np.roll(ring, -1, axis=1)], axis=2)  # (squares, 4, 2)
        triangles = np.concatenate([np.repeat(apex, 4)[:, None], sides.reshape(-1, 2)], axis=1)
        vertices = np.concatenate([corners, middles]).astype(np.int64)
        return cls(lattice, vertices, triangles.astype(np.int64), np.full(len(triangles), -1))

    @cached_property
    def points(self) -> Array:
        """(n, 2) [m]"""
        return self.lattice.metres(self.vertices)

    @property
    def divisible(self) -> Mask:
        """(t,), which triangles the lattice allows to be halved, and their halves once more."""
        ends = self.vertices[self.triangles[:, 1:]]
        return np.asarray(np.abs(ends[:, 0] - ends[:, 1]).max(axis=1) >= 8)

    def refined(self, marked: Mask) -> Mesh:
        """The mesh with the marked triangles (t,) halved, and whatever else keeps it conforming."""
        edge, of_edge = edges_of(self.triangles)
        halved = np.zeros(len(edge), dtype=bool)
        halved[of_edge[marked, 0]] = True
        while True:  # whoever has a halved side halves its own longest one first
            more = halved[of_edge].any(axis=1) & ~halved[of_edge[:, 0]]
            if not more.any():
                break
            halved[of_edge[more, 0]] = True
        ends = self.vertices[edge[halved]]
        middle = np.full(len(edge), -1)
        middle[halved] = len(self.vertices) + np.arange(int(halved.sum()))
        vertices = np.concatenate([self.vertices, ends.sum(axis=1) // 2])
        triangles, parent = self.triangles, np.arange(len(self.triangles))
        side = np.where(halved[of_edge], middle[of_edge], -1)  # new vertex on each side: longest, next, last
        for _ in range(2):  # a half may be halved once more, never twice
            cut = side[:, 0] >= 0
            (apex, left, right), new = triangles[cut].T, side[cut, 0]
            none = np.full(len(new), -1)
            halves = np.stack([new, apex, left], axis=1), np.stack([new, right, apex], axis=1)
            outer = np.stack([side[cut, 2], none, none], axis=1), np.stack([side[cut, 1], none, none], axis=1)
            triangles = np.concatenate([triangles[~cut], *halves])
            side = np.concatenate([side[~cut], *outer])
            parent = np.concatenate([parent[~cut], parent[cut], parent[cut]])
        order = np.argsort(parent, kind="stable")  # children stay where their parent was
        return Mesh(self.lattice, vertices, triangles[order], parent[order])


def edges_of(triangles: Indices) -> tuple[Indices, Indices]:
    """All edges (e, 2), smaller index first, sorted; and the rows (t, 3) of those opposite each corner."""
    pairs = np.sort(triangles[:, [[1, 2], [2, 0], [0, 1]]].reshape(-1, 2), axis=1)
    key = pairs[:, 0] * (int(triangles.max()) + 1) + pairs[:, 1]
    _, first, inverse = np.unique(key, return_index=True, return_inverse=True)
    return pairs[first], inverse.reshape(-1, 3)
