"""Triangles in two sheets made by hand, in fractions; which of their corners must be one vertex."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from itertools import combinations, pairwise

import numpy as np
from certificate_case import Arrays, sealed

from verify.judge.question import Question

Point = tuple[Fraction, Fraction]
Corner = tuple[int, int]  # row of a kept triangle, number of its corner
PER_TRIANGLE = ("triangles", "side", "feature", "speed", "weight")


def walls_of(asked: Question) -> list[int]:
    """Rows of the features that are obstacles with two vertices."""
    features = asked.features
    return [
        row
        for row, (owner, numbers) in enumerate(zip(features.owner.tolist(), features.table, strict=True))
        if owner >= 0 and owner not in features.polygons and (numbers[:2] != numbers[2:4]).any()
    ]


def exact(points: np.ndarray) -> list[Point]:
    return [(Fraction(float(x)), Fraction(float(y))) for x, y in points]


def height(wall: list[Point], p: Point) -> Fraction:
    """Twice the area of the wall and p: positive on the left."""
    (ax, ay), (bx, by) = wall
    return (bx - ax) * (p[1] - ay) - (by - ay) * (p[0] - ax)


def along(p: Point, q: Point, share: Fraction) -> Point:
    return p[0] + share * (q[0] - p[0]), p[1] + share * (q[1] - p[1])


def beside(wall: list[Point], p: Point) -> bool:
    """Whether p is between the two lines across the wall's ends."""
    (ax, ay), (bx, by) = wall
    part = (bx - ax) * (p[0] - ax) + (by - ay) * (p[1] - ay)
    return 0 <= part <= (bx - ax) ** 2 + (by - ay) ** 2


def cuts(wall: list[Point], corners: list[Point]) -> bool:
    """Whether the wall's line has corners on both sides, and the wall holds both ends of its chord."""
    heights = [height(wall, corner) for corner in corners]
    if not min(heights) < 0 < max(heights):
        return False
    ends = [corner for corner, h in zip(corners, heights, strict=True) if h == 0]
    for i, j in ((0, 1), (1, 2), (2, 0)):
        if heights[i] * heights[j] < 0:
            ends.append(along(corners[i], corners[j], heights[i] / (heights[i] - heights[j])))
    return all(beside(wall, end) for end in ends)


def in_sheets(
    arrays: Arrays, asked: Question, jumps: np.random.Generator, apart: frozenset[int] = frozenset()
) -> Arrays:
    """With a second sheet wherever a wall cuts through; further copies of vertices get values of their own.

    Corners are one vertex where `meetings` wants it, and nowhere else. Copies whose sides are the two of
    `apart` are not joined with each other.
    """
    table, points = asked.features.table, arrays["vertices"] * arrays["unit"]
    walls = {row: exact(table[row].take([[0, 1], [2, 3]])) for row in walls_of(asked)}
    side = np.zeros(len(arrays["triangles"]), dtype=np.int32)
    for row, triangle in enumerate(arrays["triangles"]):
        corners = exact(points[triangle])
        side[row] = next((f + 1 for f, wall in walls.items() if cuts(wall, corners)), 0)
    twice = np.flatnonzero(side)
    found = {**arrays, **{key: np.concatenate([arrays[key], arrays[key][twice]]) for key in PER_TRIANGLE}}
    found["side"] = np.concatenate([side, -side[twice]])
    joined = {(row, corner): (row, corner) for row in range(len(found["triangles"])) for corner in range(3)}

    def chief(corner: Corner) -> Corner:
        while joined[corner] != corner:
            corner = joined[corner]
        return corner

    for one, other in meetings(found, asked):
        if apart == {found["side"][one[0]], found["side"][other[0]]}:
            continue
        joined[chief(one)] = chief(other)
    taken: dict[Corner, int] = {}
    first: set[int] = set()
    extra: list[int] = []
    triangles = found["triangles"].copy()
    for row, corner in joined:
        top, vertex = chief((row, corner)), int(found["triangles"][row, corner])
        if top not in taken:
            taken[top] = len(points) + len(extra) if vertex in first else vertex
            if vertex in first:
                extra.append(vertex)
            first.add(vertex)
        triangles[row, corner] = taken[top]
    found["triangles"] = triangles
    found["vertices"] = np.concatenate([arrays["vertices"], arrays["vertices"][extra]])
    value = arrays["u_vertex"][extra] + jumps.normal(size=len(extra))
    found["u_vertex"] = np.concatenate([arrays["u_vertex"], value])
    return with_edges(found, jumps)


def with_edges(arrays: Arrays, jumps: np.random.Generator) -> Arrays:
    """With the edges of its triangles, and values on them near the means of their ends."""
    kept = arrays["triangles"]
    edges = np.unique(np.sort(np.stack([kept, np.roll(kept, -1, 1)], 2).reshape(-1, 2), 1), axis=0)
    middle = arrays["u_vertex"][edges].mean(axis=1) + 0.1 * jumps.normal(size=len(edges))
    return sealed({**arrays, "edges": edges.astype(np.int32), "u_edge": middle})


def meetings(arrays: Arrays, asked: Question) -> Iterator[tuple[Corner, Corner]]:
    """Corners of different triangles that must be one vertex: for each side they share and each two copies.

    Unless the side is on one wall: where both copies' parts hold one of the side's ends, the crossings
    with both walls, or the middles between them. Parts begin and end there only.
    """
    points, table = arrays["vertices"] * arrays["unit"], asked.features.table
    walls = {row: exact(table[row].take([[0, 1], [2, 3]])) for row in walls_of(asked)}
    sides: dict[frozenset[tuple[int, ...]], list[Corner]] = {}
    lattice = [tuple(place) for place in arrays["vertices"].tolist()]
    for row, triangle in enumerate(arrays["triangles"].tolist()):
        for i in range(3):
            ends = frozenset((lattice[triangle[i]], lattice[triangle[(i + 1) % 3]]))
            sides.setdefault(ends, []).append((row, i))
    for corners in sides.values():
        for (one, i), (other, j) in combinations(corners, 2):
            start, end = arrays["triangles"][one, [i, (i + 1) % 3]]
            if lattice[start] == lattice[arrays["triangles"][other, j]]:
                continue  # the same way round: two copies of one triangle
            p, q = exact(points[[start, end]])
            if any(
                height(w, p) == height(w, q) == 0 and beside(w, p) and beside(w, q) for w in walls.values()
            ):
                continue
            if _meet(walls, [int(arrays["side"][row]) for row in (one, other)], p, q):
                yield (one, i), (other, (j + 1) % 3)
                yield (one, (i + 1) % 3), (other, j)


def _meet(walls: dict[int, list[Point]], sides: list[int], p: Point, q: Point) -> bool:
    shares = {Fraction(0), Fraction(1)}
    cut = [(walls[abs(side) - 1], 1 if side > 0 else -1) for side in sides if side]
    for wall, _ in cut:
        h = height(wall, p), height(wall, q)
        if h[0] * h[1] < 0:
            shares.add(h[0] / (h[0] - h[1]))
    ordered = sorted(shares)
    middles = [(a + b) / 2 for a, b in pairwise(ordered)]
    return any(
        all(sign * height(wall, along(p, q, share)) > 0 for wall, sign in cut)
        for share in (*ordered, *middles)
    )
