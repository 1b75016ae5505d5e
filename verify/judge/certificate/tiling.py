"""Do the triangles tile the box, without gap or overlap, side by side? Decided in integers.

Let every triangle be anticlockwise with positive area and lie in the box, let every directed side occur
once, and let its reverse occur too unless it lies on one side of the box. Count how many open triangles
cover a point off all sides. The count is the same everywhere in the open box: on a path that meets sides
only between their ends (the box without the finitely many vertices is connected), each side crossed is
left by the one triangle on its left and entered is the one triangle on the left of its reverse, and
sides on the box's rim are never crossed. So the triangles cover the box M times for one number M: they are a
2-chain whose boundary is M times that of the box. Their areas then sum to M times the box's, and where
the sum is the box's area M = 1.

With M = 1 the neighbour across each side has the same two vertices, and around each point the triangles
follow each other side by side, so that a function given by one value for each vertex and side is
continuous: no vertex hangs on a neighbour's side. Where a place has several vertices, with values of their
own, u may jump: `continuity` looks at that.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.judge.certificate.file import CertificateFile
from verify.judge.certificate.sheets import Sheets
from verify.judge.certificate.wording import listed, place_of, side_of
from verify.judge.features import Features

Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]

SAFE_SPAN = 2**31 - 1  # of lattice coordinates: doubled areas fit into 64 bits


@dataclass(frozen=True, eq=False)
class Tiling:
    """What was found; `side_edges` only where `edges` are those of the kept triangles."""

    faults: tuple[str, ...]
    twice_area: NDArray[
        Any
    ]  # (t,) of the kept triangles, lattice units squared: 64 bits or Python's integers
    side_edges: Indices | None  # (t, 3), row in `edges` of the side from corner i to i + 1


def check_tiling(file: CertificateFile, features: Features, sheets: Sheets) -> Tiling:
    """Check that kept and dropped triangles tile a box around the boundary, and the list of edges.

    Vertices at one place count as one there, and the two copies of a triangle that a wall cuts as one.
    """
    triangles = np.concatenate([file.triangles, file.dropped]).astype(np.int64)
    once = np.append(sheets.counted(len(file.triangles)), np.ones(len(file.dropped), dtype=bool))
    edge_faults, side_edges = _edges(file)
    twice_area = _twice_areas(file, triangles)
    faults = [
        *_box_faults(file, features),
        *_outside(file, triangles),
        *_areas(file, triangles, twice_area, once),
        *_sides(file, sheets.at(triangles if once.all() else triangles[once])),
        *edge_faults,
    ]
    return Tiling(tuple(faults), twice_area[: len(file.triangles)], side_edges)


def _box_faults(file: CertificateFile, features: Features) -> list[str]:
    low, high = file.metres(file.box.reshape(2, 2))
    out = ((features.boundary < low) | (features.boundary > high)).any(axis=1)
    if not out.any():
        return []
    x, y = features.boundary[int(np.argmax(out))]
    return [f"the box does not contain world.boundary[{int(np.argmax(out))}] = ({x:.9g}, {y:.9g}) m"]


def _outside(file: CertificateFile, triangles: Indices) -> list[str]:
    corner = file.vertices[triangles]
    out = ((corner < file.box[:2]) | (corner > file.box[2:])).any(axis=(1, 2))
    return listed("outside the box:", triangles[out], lambda t: place_of(file, t))


def _twice_areas(file: CertificateFile, triangles: Indices) -> NDArray[Any]:
    """Twice the signed areas (t,), in 64 bits where they fit, else in Python's integers."""
    span = int(file.vertices.max()) - int(file.vertices.min())
    corner = file.vertices[triangles]
    u, w = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    if span > SAFE_SPAN:
        u, w = u.astype(object), w.astype(object)
    return np.asarray(u[:, 0] * w[:, 1] - u[:, 1] * w[:, 0])


def _areas(file: CertificateFile, triangles: Indices, twice: NDArray[Any], once: Mask) -> list[str]:
    """Orientation of all triangles, and the sum of the areas of those that count."""
    turned = triangles[np.asarray(twice <= 0, dtype=bool)]
    faults = listed("not anticlockwise with positive area:", turned, lambda t: place_of(file, t))
    x0, y0, x1, y1 = (int(k) for k in file.box)
    excess = sum(twice[once].tolist()) - 2 * (x1 - x0) * (y1 - y0)
    if excess:
        square = 0.5 * excess * float(file.unit) ** 2
        what = "more than" if excess > 0 else "less than"
        faults.append(f"the areas of all triangles sum to {abs(square):.6g} m^2 {what} the box")
    return faults


def _sides(file: CertificateFile, triangles: Indices) -> list[str]:
    """Every directed side once, and its reverse unless it lies on a side of the box."""
    count = len(file.vertices)
    start, end = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    # The undirected side times two, plus its direction: a side and its reverse follow each other.
    key = np.sort((np.minimum(start, end) * count + np.maximum(start, end)) * 2 + (start > end))
    twice = key[1:][key[1:] == key[:-1]]
    shared = key[1:] // 2 == key[:-1] // 2
    alone = key[~(np.append(shared, False) | np.append(False, shared))]
    first, last = np.divmod(alone // 2, count)
    a, b = file.vertices[first], file.vertices[last]
    on_rim = np.concatenate([(a == k) & (b == k) for k in (file.box[:2], file.box[2:])], axis=1).any(axis=1)

    def tell(k: int) -> str:
        ends = divmod(int(k) // 2, count)
        return side_of(file, *(reversed(ends) if k % 2 else ends))

    return [
        *listed("two triangles lie on the same side of", twice, tell),
        *listed("no other triangle has, as a whole side,", alone[~on_rim], tell),
    ]


def _edges(file: CertificateFile) -> tuple[list[str], Indices | None]:
    """`edges` against the sides of the kept triangles, each once, i < j, sorted."""
    count = len(file.vertices)
    kept = file.triangles.astype(np.int64)
    ends = np.sort(np.stack([kept, np.roll(kept, -1, axis=1)], axis=2), axis=2)
    sides = ends[..., 0] * count + ends[..., 1]
    given = file.edges[:, 0].astype(np.int64) * count + file.edges[:, 1]
    if len(given) and (given[1:] > given[:-1]).all():
        rows = np.minimum(np.searchsorted(given, sides), len(given) - 1)
        if (given[rows] == sides).all() and np.bincount(rows.ravel(), minlength=len(given)).all():
            return [], rows
    wanted = np.unique(sides)
    values, often = np.unique(given, return_counts=True)

    def tell(key: int) -> str:
        return side_of(file, key // count, key % count)

    faults = [
        *listed("edges: missing is", np.setdiff1d(wanted, given), tell),
        *listed(
            "edges: not a side of a kept triangle, or not in order, is", np.setdiff1d(given, wanted), tell
        ),
        *listed("edges: more than once there is", values[often > 1], tell),
    ]
    return faults or ["edges: not sorted"], None
