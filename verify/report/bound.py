"""The certificate of the lower bound as it is drawn: its triangles, their slack and the potential on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import shapely
from numpy.typing import NDArray

from verify import evidence
from verify.evidence import EvidenceError
from verify.judge.certificate import CERTIFICATE, check_certificate, read_certificate
from verify.judge.question import read_question

if TYPE_CHECKING:
    from verify.judge.certificate import CertificateFile

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

MOST_REASONS = 8  # why a certificate is refused: more than that nobody reads
MOST_PIECES = 120_000  # small triangles on which the potential is drawn as linear


@dataclass(frozen=True, kw_only=True, eq=False)
class BoundMesh:
    """The kept triangles of a certificate that holds, and a potential that is quadratic on each of them.

    A triangle that a wall cuts through may stand twice, once for its part on each side.
    """

    points: Array  # (n, 2) [m]
    lattice: Indices  # (n, 2), the same points as integers
    triangles: Indices  # (t, 3), anticlockwise
    edges: Indices  # (t, 3), sides 01 12 20 as rows of the certificate's edges
    side: Indices  # (t,) 0: whole; f + 1, -(f + 1): only the part left, right of the line of wall f
    walls: Array  # (f, 4) [m], ends a and b of each feature
    controls: Array  # (t, 6) [s]: Bernstein values at corners 0 1 2, of sides 01 12 20
    slack: Array  # (t,) least of (m - |grad u|) / m at the corners of each triangle
    dropped: int  # triangles in which the robot cannot move

    @classmethod
    def of(cls, file: CertificateFile, slack: Array) -> BoundMesh:
        """From a certificate and the slack (t,) found by its checker."""
        triangles = np.asarray(file.triangles, dtype=np.int64)
        key = file.edges[:, 0] * np.int64(len(file.vertices)) + file.edges[:, 1]
        sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]], axis=2)
        row = np.searchsorted(key, sides[..., 0] * np.int64(len(file.vertices)) + sides[..., 1])
        return cls(
            points=file.points,
            lattice=np.asarray(file.vertices, dtype=np.int64),
            triangles=triangles,
            edges=row,
            side=np.asarray(file.side, dtype=np.int64),
            walls=file.features[:, :4],
            controls=np.concatenate([file.u_vertex[triangles], file.u_edge[row]], axis=1),
            slack=slack,
            dropped=len(file.dropped),
        )

    @cached_property
    def corners(self) -> Array:
        """(t, 3, 2) [m]"""
        return np.asarray(self.points[self.triangles])

    @cached_property
    def size(self) -> Array:
        """Longest side [m] of each triangle; (t,)."""
        sides = self.corners - np.roll(self.corners, 1, axis=1)
        return np.asarray(np.hypot(sides[..., 0], sides[..., 1]).max(axis=1))

    @cached_property
    def _tree(self) -> shapely.STRtree:
        return shapely.STRtree(polygons(self.corners))

    @cached_property
    def place(self) -> Indices:
        """The first vertex (n,) at the lattice point of each."""
        _, first, row = np.unique(self.lattice, axis=0, return_index=True, return_inverse=True)
        return np.asarray(first[row.reshape(-1)])

    def height(self, points: Array, rows: Indices) -> Array:
        """Distance [m] of points (k, 2) into the parts that triangles `rows` (k,) stand for; (k,).

        From the line of the wall that cuts the triangle, negative on the other side; infinite where the
        triangle is whole.
        """
        side = self.side[rows]
        a, b = np.split(self.walls[np.abs(side) - (side != 0)], 2, axis=1)
        away = _cross(b - a, points - a) / np.maximum(np.hypot(*(b - a).T), np.finfo(float).tiny)
        return np.where(side == 0, np.inf, np.sign(side) * away)

    @cached_property
    def parts(self) -> NDArray[np.object_]:
        """What each triangle stands for, as Shapely polygons (t,)."""
        found = polygons(self.corners)
        cut = np.flatnonzero(self.side)
        a, b = np.split(self.walls[np.abs(self.side[cut]) - 1], 2, axis=1)
        along = (b - a) / np.hypot(*(b - a).T)[:, None] * (4.0 * np.ptp(self.points, axis=0).max())
        left = np.sign(self.side[cut])[:, None] * np.column_stack([-along[:, 1], along[:, 0]])
        half = np.stack([a - along, a + along, a + along + left, a - along + left], axis=1)
        found[cut] = shapely.intersection(found[cut], shapely.polygons(half))
        return found

    def potential(self, points: Array) -> Array:
        """u [s] at points (k, 2) [m], of the copy on the point's side; NaN outside the kept triangles."""
        found = np.full(len(points), np.nan)
        which, triangle = self._tree.query(shapely.points(points), predicate="intersects")
        its = self.height(np.asarray(points)[which], triangle) > 0.0
        which, triangle = which[its], triangle[its]
        a, b, c = np.moveaxis(self.corners[triangle], 1, 0)
        total = _cross(b - a, c - a)
        p = points[which]
        shares = np.stack([_cross(b - p, c - p), _cross(c - p, a - p), _cross(a - p, b - p)], axis=1)
        found[which] = bernstein(self.controls[triangle], shares / total[:, None])
        return found

    def pieces(self) -> tuple[Array, Indices, Array]:
        """Every triangle cut into equal small ones: points (k, 2) [m], triangles (p, 3), u (k,) [s].

        A quadratic with second derivative D is off by at most D h^2 / (8 n^2) when it is drawn as linear
        on the small triangles of n cuts a side. Small triangles whose centre is in the part of the other
        copy are left out. Two of them share a point only where they share its value.
        """
        cuts = int(np.clip(np.sqrt(MOST_PIECES / max(len(self.triangles), 1)), 2, 16))
        i, j = np.array([(i, j) for i in range(cuts + 1) for j in range(cuts + 1 - i)]).T
        weights = np.stack([cuts - i - j, i, j], axis=1)  # (w, 3), whole numbers
        number = {(int(a), int(b)): k for k, (a, b) in enumerate(zip(i, j, strict=True))}
        up = [(number[a, b], number[a + 1, b], number[a, b + 1]) for a, b in number if a + b < cuts]
        down = [
            (number[a + 1, b], number[a + 1, b + 1], number[a, b + 1]) for a, b in number if a + b < cuts - 1
        ]
        small = np.array(up + down)  # (cuts^2, 3)
        _, first, row = np.unique(self._named(weights), return_index=True, return_inverse=True)
        offset = len(weights) * np.arange(len(self.triangles))
        corners = (offset[:, None, None] + small).reshape(-1, 3)
        points = np.einsum("wc,tcd->twd", weights / cuts, self.corners).reshape(-1, 2)
        values = bernstein(self.controls[:, None], (weights / cuts)[None]).ravel()
        whose = np.repeat(np.arange(len(self.triangles)), len(small))
        height = self.height(points[corners].mean(axis=1), whose)
        # A centre on the wall itself belongs to one of both copies.
        shown = (height > 0.0) | ((height == 0.0) & (self.side[whose] > 0))
        return points[first], row.reshape(-1)[corners[shown]], values[first]

    def _named(self, weights: Indices) -> Indices:
        """Numbers (t w,) of the points at `weights` (w, 3) in every triangle, the same where u is one number.

        At a corner that of the vertex; on a side that of the edge and the weight of its greater vertex.
        """
        count, (vertices, edges) = len(weights), (len(self.points), int(self.edges.max()) + 1)
        inside = vertices + edges + np.arange(len(self.triangles))
        named = inside[:, None] * count + np.arange(count)  # (t, w)
        for k in range(3):
            near, far = self.triangles[:, k], self.triangles[:, (k + 1) % 3]
            on = np.flatnonzero(weights[:, (k + 2) % 3] == 0)
            share = np.where((near > far)[:, None], weights[on, k], weights[on, (k + 1) % 3])
            named[:, on] = (vertices + self.edges[:, k, None]) * count + share
        for k in range(3):
            corner = int(np.argmax(weights[:, k]))
            named[:, corner] = self.triangles[:, k] * count
        return named.ravel()


def read_bound(folder: Path) -> tuple[BoundMesh | None, str]:
    """The certificate of a result folder where it is there and holds, else why there is nothing to draw."""
    try:
        file = read_certificate(folder)
        if file is None:
            return None, f"{CERTIFICATE} was not written"
        proof = check_certificate(file, read_question(evidence.read_bytes(folder, evidence.SCENARIO)))
    except EvidenceError as error:
        return None, listed(error.reasons)
    if not proof.holds:
        return None, "the certificate is refused: " + listed(proof.reasons)
    return BoundMesh.of(file, np.asarray(proof.slack, dtype=float)), ""


def listed(reasons: Sequence[str]) -> str:
    """Reasons in one line, the first few of them."""
    more = len(reasons) - MOST_REASONS
    return "; ".join([*reasons[:MOST_REASONS], *([f"and {more} more"] if more > 0 else [])])


def bernstein(controls: Array, shares: Array) -> Array:
    """The quadratic with Bernstein values `controls` (..., 6) at barycentric coordinates `shares` (..., 3).

    sum_i c_i l_i^2 + 2 sum_{i<j} c_ij l_i l_j, values in the order 0 1 2 01 12 20; returns (...).
    """
    squares = np.concatenate([shares**2, 2.0 * shares * np.roll(shares, -1, axis=-1)], axis=-1)
    return np.asarray((controls * squares).sum(axis=-1))


def polygons(corners: Array) -> NDArray[np.object_]:
    """Shapely polygons of triangles (t, 3, 2)."""
    return np.asarray(shapely.polygons(shapely.linearrings(corners[:, [0, 1, 2, 0]])), dtype=object)


def long_sides(lattice: Indices, sides: Indices) -> Indices:
    """Sides (e, 2) that continue each other on one line, joined: pairs of vertices (k, 2).

    Halving triangles leaves long straight lines, so this is what makes a drawn mesh small.
    """
    if not len(sides):
        return sides
    step = lattice[sides[:, 1]] - lattice[sides[:, 0]]
    direction = step // np.gcd(np.abs(step[:, 0]), np.abs(step[:, 1]))[:, None]
    back = (direction[:, 0] < 0) | ((direction[:, 0] == 0) & (direction[:, 1] < 0))
    direction[back] *= -1
    ends = np.where(back[:, None], sides[:, ::-1], sides)
    tail, head = lattice[ends[:, 0]], lattice[ends[:, 1]]
    line = direction[:, 0] * tail[:, 1] - direction[:, 1] * tail[:, 0]
    begin, stop = ((direction * at).sum(axis=1) for at in (tail, head))
    order = np.lexsort([begin, line, direction[:, 1], direction[:, 0]])
    key = np.column_stack([direction, line])[order]
    fresh = np.ones(len(order), dtype=bool)
    fresh[1:] = (key[1:] != key[:-1]).any(axis=1) | (begin[order][1:] != stop[order][:-1])
    first = np.flatnonzero(fresh)
    last = np.append(first[1:], len(order)) - 1
    return np.column_stack([ends[order][first, 0], ends[order][last, 1]])


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
