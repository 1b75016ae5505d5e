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
    """The kept triangles of a certificate that holds, and a potential that is quadratic on each of them."""

    points: Array  # (n, 2) [m]
    lattice: Indices  # (n, 2), the same points as integers
    triangles: Indices  # (t, 3), anticlockwise
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

    def potential(self, points: Array) -> Array:
        """u [s] at points (k, 2) [m]; NaN outside the kept triangles."""
        found = np.full(len(points), np.nan)
        which, triangle = self._tree.query(shapely.points(points), predicate="intersects")
        a, b, c = np.moveaxis(self.corners[triangle], 1, 0)
        total = _cross(b - a, c - a)
        p = points[which]
        shares = np.stack([_cross(b - p, c - p), _cross(c - p, a - p), _cross(a - p, b - p)], axis=1)
        found[which] = bernstein(self.controls[triangle], shares / total[:, None])
        return found

    def pieces(self) -> tuple[Array, Indices, Array]:
        """Every triangle cut into equal small ones: points (k, 2) [m], triangles (p, 3), u (k,) [s].

        A quadratic with second derivative D is off by at most D h^2 / (8 n^2) when it is drawn as linear
        on the small triangles of n cuts a side.
        """
        cuts = int(np.clip(np.sqrt(MOST_PIECES / max(len(self.triangles), 1)), 2, 16))
        i, j = np.array([(i, j) for i in range(cuts + 1) for j in range(cuts + 1 - i)]).T
        weights = np.stack([cuts - i - j, i, j], axis=1)  # (w, 3), whole numbers
        at = np.einsum("wc,tcd->twd", weights, self.lattice[self.triangles]).reshape(-1, 2)
        _, first, row = np.unique(at[:, 0] + 1j * at[:, 1], return_index=True, return_inverse=True)
        number = {(int(a), int(b)): k for k, (a, b) in enumerate(zip(i, j, strict=True))}
        up = [(number[a, b], number[a + 1, b], number[a, b + 1]) for a, b in number if a + b < cuts]
        down = [
            (number[a + 1, b], number[a + 1, b + 1], number[a, b + 1]) for a, b in number if a + b < cuts - 1
        ]
        small = np.array(up + down)  # (cuts^2, 3)
        offset = len(weights) * np.arange(len(self.triangles))
        triangles = row[(offset[:, None, None] + small).reshape(-1, 3)]
        points = np.einsum("wc,tcd->twd", weights / cuts, self.corners).reshape(-1, 2)[first]
        values = bernstein(self.controls[:, None], (weights / cuts)[None]).ravel()[first]
        return points, triangles, values


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
