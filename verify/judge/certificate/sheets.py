"""What stands at the same place: copies of vertices, and triangles that a wall cuts into two sheets.

A robot is slow beside a wall and stops at it, but a wall without thickness takes little or no way, so that a
continuous u could hardly tell one side from the other. Where a wall cuts a triangle through, the
certificate may hold it twice, once for the part on each side, with control values of its own. Places
are lattice points: vertices there may be several, each with its own value.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verify.judge.certificate.file import CertificateFile
from verify.judge.certificate.wording import listed, place_of

Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]

SPREAD = 6_364_136_223_846_793_005  # odd; points are told apart by x SPREAD + y modulo 2^64, mostly


@dataclass(frozen=True, eq=False)
class Sheets:
    """Which vertices share a place, and which triangles do."""

    place: Indices | None  # (n,), the first vertex at the same lattice point; None where all differ
    pairs: Indices  # (k, 2), rows of the kept triangles that are the left and the right copy of one
    faults: tuple[str, ...]  # triangles at one place that are no such pair
    used: bool  # whether anything stands twice or is said to

    @classmethod
    def of(cls, file: CertificateFile) -> Sheets:
        """Found by lattice coordinates."""
        place = _places(file.vertices)
        if place is None and not file.side.any():
            return cls(None, np.empty((0, 2), dtype=np.int64), (), used=False)
        triangles = file.triangles.astype(np.int64)
        pairs, faults = _pairs(file, triangles if place is None else place[triangles])
        return cls(place, pairs, tuple(faults), used=True)

    def at(self, vertices: Indices) -> Indices:
        """The first vertices at the places of these; same shape."""
        return vertices if self.place is None else self.place[vertices]

    def counted(self, triangles: int) -> Mask:
        """(t,), without the right copy of each pair."""
        once = np.ones(triangles, dtype=bool)
        once[self.pairs[:, 1]] = False
        return once


def _places(vertices: Indices) -> Indices | None:
    """The first vertex (n,) at the lattice point of each; None where all points differ."""
    key = np.sort(vertices[:, 0] * SPREAD + vertices[:, 1])  # modulo 2^64; equal points have equal keys
    if not (key[1:] == key[:-1]).any():
        return None
    order = np.lexsort((vertices[:, 1], vertices[:, 0]))  # stable: the first of equal ones comes first
    begins = np.append(True, (np.diff(vertices[order], axis=0) != 0).any(axis=1))
    if begins.all():
        return None
    place = np.empty(len(vertices), dtype=np.int64)
    place[order] = order[begins][np.cumsum(begins) - 1]
    return place


def _pairs(file: CertificateFile, corners: Indices) -> tuple[Indices, list[str]]:
    """The pairs (k, 2) of rows, left copy first, and what stands at one place without being a pair.

    Parameters
    ----------
    corners : (t, 3), places of the corners of the kept triangles.
    """
    side = file.side.astype(np.int64)
    turn = (np.argmin(corners, axis=1)[:, None] + np.arange(3)) % 3
    ring = np.take_along_axis(corners, turn, axis=1)
    order = np.lexsort((-side, *ring.T))
    begins = np.flatnonzero(np.append(True, (np.diff(ring[order], axis=0) != 0).any(axis=1)))
    often = np.diff(np.append(begins, len(order)))
    alone, two = order[begins[often == 1]], begins[often == 2]
    pair = np.stack([order[two], order[two + 1]], axis=1) if len(two) else np.empty((0, 2), dtype=np.int64)
    proper = (side[pair[:, 0]] > 0) & (side[pair[:, 0]] == -side[pair[:, 1]])
    strange = np.concatenate([pair[~proper, 0], order[begins[often > 2]]])

    def tell(row: int) -> str:
        return place_of(file, file.triangles[row].astype(np.int64))

    return pair[proper], [
        *listed("without a copy for the other side of its wall:", alone[side[alone] != 0], tell),
        *listed("more than once, and not once for each side of one wall:", strange, tell),
    ]
