"""The certificate: a mesh, a function on it and why its gradient is small enough; and its file."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

FORMAT = 1
ZONE_FORMAT = 2


@dataclass(frozen=True, kw_only=True, eq=False)
class Certificate:
    """Arrays from which anyone can prove that no motion takes less than `travel_time`.

    u is quadratic on each kept triangle: sum of c_i lambda_i^2 and of 2 c_ij lambda_i lambda_j, with one
    value per vertex and per edge. At each corner |grad u| is at most the triangle's minorant, a
    combination of tangents of 1/V (see `minorant`). docs/certificate.md has the proof.
    """

    vertices: Indices  # (n, 2) on the lattice: metres are origin + unit * vertices, without rounding
    origin: Array  # (2,) [m]
    unit: float  # [m], a power of two
    box: Indices  # (4,) x0, y0, x1, y1 on the lattice; kept and dropped triangles tile it
    triangles: Indices  # (t, 3) kept, anticlockwise
    side: Indices  # (t,): 0 whole, f + 1 only the part left of wall f, -(f + 1) right of it (see `sheets`)
    dropped: Indices  # (s, 3) anticlockwise
    blocked_by: Indices  # (s,): f >= 0 near feature f, -1 outside the boundary, -2 - k in obstacle k
    edges: Indices  # (e, 2) of the kept triangles, smaller index first, sorted
    u_vertex: Array  # (n,) [s]
    u_edge: Array  # (e,) [s]
    feature: Indices  # (t, 2), -1 for the constant 1/v_max
    speed: Array  # (t, 2) [m/s], where the tangent touches 1/V
    weight: Array  # (t, 2), at least 0, at most 1 together
    start_triangle: int  # row of `triangles`
    goal_triangle: int
    features: Array  # (f, 5) [m]: ends of a segment, radius
    start: Array  # (2,) [m]
    goal: Array  # (2,) [m]
    law: Array  # (5,): radius [m], max_braking [m/s^2], reaction_time [s], margin [m], max_speed [m/s]
    travel_time: float  # [s], the bound
    contact: Array | None = None  # (t, 3), with a zone: barycentric, where tangents touch for every heading
    zone: str | None = None  # type and parameters of the zone as JSON; None: uniform braking
    lengths: int | None = None  # with a zone: 1 where u measures lengths [m], 0 where it measures times

    def save(self, file: Path) -> None:
        """Write the arrays and their digest as a compressed .npz file."""
        arrays = self.arrays()
        with file.open("wb") as stream:
            np.savez_compressed(stream, allow_pickle=False, **arrays, digest=digest(arrays))

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """All arrays in the types of the file."""
        version = FORMAT if self.zone is None else ZONE_FORMAT
        found: dict[str, NDArray[np.generic]] = {"format": np.array(version, dtype=np.int64)}
        if self.zone is not None:
            found["zone"] = np.frombuffer(self.zone.encode(), dtype=np.uint8)
        for field in fields(self):
            if field.name == "zone" or getattr(self, field.name) is None:
                continue
            value = np.asarray(getattr(self, field.name))
            narrow = field.name in _NARROW
            kind = np.float64 if value.dtype.kind == "f" else np.int32 if narrow else np.int64
            found[field.name] = np.array(value, dtype=kind, order="C")
        return found


_NARROW = frozenset({"triangles", "side", "dropped", "blocked_by", "edges", "feature"})


def digest(arrays: dict[str, NDArray[np.generic]]) -> NDArray[np.uint8]:
    """SHA-256 (32,) over names, types, shapes and bytes of all arrays, in the order of their names."""
    total = hashlib.sha256()
    for name in sorted(arrays):
        array = arrays[name]
        little = array.astype(array.dtype.newbyteorder("<"), order="C")
        for part in (name, little.dtype.str, repr(little.shape)):
            total.update(part.encode() + b"\0")
        total.update(little.tobytes())
    return np.frombuffer(total.digest(), dtype=np.uint8)
