"""certificate.npz as a file: read strictly, as it may come from anybody.

Every number is within a range in which the checks cannot overflow. What the numbers mean is checked
elsewhere.
"""

from __future__ import annotations

import hashlib
import math
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.evidence import EvidenceError
from verify.judge.archive import Layout, first_fault, read_archive, shape_faults

Array = NDArray[np.float64]

CERTIFICATE = "certificate.npz"
FORMAT = 1
ZONE_FORMAT = 2  # with a zone that depends on the heading: three arrays more
MOST_LATTICE = 2**40  # of lattice coordinates: differences and their sums are exact in doubles
MOST_ORIGIN = 2**50  # of origin / unit: lattice points in metres are exact in doubles
UNIT_POWERS = (-60, 20)  # least and greatest power of two of the unit [m]
MOST_TRIANGLES = 2_000_000  # kept and dropped together
MOST_SLOTS = 16  # terms of a minorant
MOST_POTENTIAL = 1e9  # [s], of control values: thirty years

_LAYOUT: Layout = {
    "format": ("<i8", ()),
    "vertices": ("<i8", ("n", 2)),
    "origin": ("<f8", (2,)),
    "unit": ("<f8", ()),
    "box": ("<i8", (4,)),
    "triangles": ("<i4", ("t", 3)),
    "side": ("<i4", ("t",)),
    "dropped": ("<i4", ("s", 3)),
    "blocked_by": ("<i4", ("s",)),
    "edges": ("<i4", ("e", 2)),
    "u_vertex": ("<f8", ("n",)),
    "u_edge": ("<f8", ("e",)),
    "feature": ("<i4", ("t", "K")),
    "speed": ("<f8", ("t", "K")),
    "weight": ("<f8", ("t", "K")),
    "start_triangle": ("<i8", ()),
    "goal_triangle": ("<i8", ()),
    "features": ("<f8", ("f", 5)),
    "start": ("<f8", (2,)),
    "goal": ("<f8", (2,)),
    "law": ("<f8", (5,)),
    "travel_time": ("<f8", ()),
    "digest": ("|u1", (32,)),
}
_ZONE_LAYOUT: Layout = {
    **_LAYOUT,
    "contact": ("<f8", ("t", 3)),
    "zone": ("|u1", ("z",)),
    "lengths": ("<i8", ()),
}
MOST_ZONE = 2**20  # bytes of text


@dataclass(frozen=True, eq=False)
class CertificateFile:
    """The arrays of certificate.npz, well-formed: types, shapes, index ranges, finite numbers."""

    format: NDArray[np.int64]  # (), 1
    vertices: NDArray[np.int64]  # (n, 2) lattice points; metres are origin + unit * vertices
    origin: Array  # (2,) [m]
    unit: Array  # () [m], a power of two
    box: NDArray[np.int64]  # (4,) lattice box x0, y0, x1, y1
    triangles: NDArray[np.int32]  # (t, 3) kept
    side: NDArray[np.int32]  # (t,) 0: whole; f + 1, -f - 1: the part left, right of the line of wall f
    dropped: NDArray[np.int32]  # (s, 3)
    blocked_by: NDArray[np.int32]  # (s,)
    edges: NDArray[np.int32]  # (e, 2)
    u_vertex: Array  # (n,) [s]
    u_edge: Array  # (e,) [s]
    feature: NDArray[np.int32]  # (t, K), -1: the constant 1 / v_max
    speed: Array  # (t, K) [m/s]
    weight: Array  # (t, K)
    start_triangle: NDArray[np.int64]  # ()
    goal_triangle: NDArray[np.int64]  # ()
    features: Array  # (f, 5) [m]
    start: Array  # (2,) [m]
    goal: Array  # (2,) [m]
    law: Array  # (5,): radius [m], a_b [m/s^2], t_r [s], margin [m], v_max [m/s]
    travel_time: Array  # () [s], as claimed
    digest: NDArray[np.uint8]  # (32,)
    lengths: NDArray[np.int64] | None = None  # (), with a zone: 1 where u measures lengths, 0 for times
    contact: Array | None = None  # (t, 3), at least zero: the place in each triangle where tangents touch
    zone: NDArray[np.uint8] | None = None  # (z,) text: type and parameters of the zone as JSON in UTF-8

    @cached_property
    def points(self) -> Array:
        """The vertices (n, 2) [m], without rounding."""
        return self.metres(self.vertices)

    def metres(self, lattice: NDArray[np.int64]) -> Array:
        """Lattice points (..., 2) within `MOST_LATTICE` in metres, without rounding."""
        steps = self.origin / self.unit  # an integer, by MOST_ORIGIN exact
        return np.asarray((steps + lattice) * self.unit)

    def actual_digest(self) -> bytes:
        """SHA-256 over all other arrays: per key in sorted order the key, dtype, shape and bytes."""
        sums = hashlib.sha256()
        layout = _LAYOUT if self.zone is None else _ZONE_LAYOUT
        for key in sorted(layout):
            if key != "digest":
                array = np.ascontiguousarray(getattr(self, key)).reshape(getattr(self, key).shape)
                parts = (key, np.dtype(layout[key][0]).str, repr(array.shape))
                sums.update(b"".join(part.encode() + b"\0" for part in parts))
                sums.update(array.astype(layout[key][0], copy=False).tobytes())
        return sums.digest()


def read_certificate(folder: Path) -> CertificateFile | None:
    """Read certificate.npz of a result folder; None when there is none.

    Raises
    ------
    EvidenceError : truncated, not such an archive, an array missing, unknown, of another type or shape,
        a number not finite or out of range.
    """
    layout = _layout(folder)
    arrays = read_archive(folder, CERTIFICATE, layout)
    if arrays is None:
        return None
    wrong = _size_faults(arrays, layout)
    if not wrong:
        wrong = _number_faults(arrays)
    if wrong:
        raise EvidenceError(*(f"{CERTIFICATE}: {text}" for text in wrong))
    return CertificateFile(
        **{field.name: arrays[field.name] for field in fields(CertificateFile) if field.name in arrays}
    )


def _layout(folder: Path) -> Layout:
    """That of a file with a zone, where it has one; what is no archive is told when it is read."""
    try:
        with zipfile.ZipFile(folder / CERTIFICATE) as archive:
            return _ZONE_LAYOUT if "zone.npy" in archive.namelist() else _LAYOUT
    except (zipfile.BadZipFile, EOFError, OSError, NotImplementedError, RuntimeError, ValueError):
        return _LAYOUT


def _size_faults(arrays: Mapping[str, NDArray[Any]], layout: Layout) -> list[str]:
    wrong = shape_faults(arrays, layout)
    if not wrong and arrays["feature"].shape[1] > MOST_SLOTS:
        wrong.append(f"feature: more than {MOST_SLOTS} terms a triangle")
    if not wrong and len(arrays["triangles"]) + len(arrays["dropped"]) > MOST_TRIANGLES:
        wrong.append(f"more than {MOST_TRIANGLES} triangles")
    if not wrong and "zone" in arrays and len(arrays["zone"]) > MOST_ZONE:
        wrong.append(f"zone: more than {MOST_ZONE} bytes")
    if not wrong and not len(arrays["triangles"]):
        wrong.append("triangles: none")
    return wrong


def _number_faults(arrays: Mapping[str, NDArray[Any]]) -> list[str]:
    """Numbers that are not finite or out of range, with the first of them in each array."""
    wrong: list[str] = []

    def demand(key: str, good: NDArray[np.bool_], rule: str) -> None:
        wrong.extend(first_fault(key, arrays[key], good, rule))

    for key, (dtype, _) in (_ZONE_LAYOUT if "zone" in arrays else _LAYOUT).items():
        if dtype == "<f8":
            finite = np.isfinite(arrays[key])
            if key == "law":
                finite[4] |= arrays[key][4] == math.inf
            demand(key, finite, "must be finite")
    version = ZONE_FORMAT if "zone" in arrays else FORMAT
    demand("format", arrays["format"] == version, f"must be {version}")
    if "zone" in arrays:
        share = (arrays["contact"] >= 0.0) & (arrays["contact"] <= 2.0)
        demand("contact", share, "must be from 0 to 2")
        demand("lengths", (arrays["lengths"] == 0) | (arrays["lengths"] == 1), "must be 0 or 1")
    vertices, triangles, features = (len(arrays[key]) for key in ("vertices", "triangles", "features"))
    for key in ("vertices", "box"):
        small = (arrays[key] <= MOST_LATTICE) & (arrays[key] >= -MOST_LATTICE)
        demand(key, small, "is too large for a lattice coordinate")
    for key, first, count in (
        ("triangles", 0, vertices),
        ("dropped", 0, vertices),
        ("edges", 0, vertices),
        ("feature", -1, features),
        ("start_triangle", 0, triangles),
        ("goal_triangle", 0, triangles),
    ):
        inside = (arrays[key] >= first) & (arrays[key] < count)
        demand(key, inside, f"must be an index from {first} to {count - 1}")
    known = (arrays["side"] >= -features) & (arrays["side"] <= features)
    demand(
        "side",
        known,
        f"must be 0 or up to {features}, for the left, or to -{features}, for the right of a wall",
    )
    for key in ("u_vertex", "u_edge"):
        demand(key, ~(np.abs(arrays[key]) > MOST_POTENTIAL), f"must be at most {MOST_POTENTIAL:g} s")
    return wrong or _lattice_faults(arrays)


def _lattice_faults(arrays: Mapping[str, NDArray[Any]]) -> list[str]:
    unit, origin, box = float(arrays["unit"]), arrays["origin"], arrays["box"]
    fraction, power = math.frexp(unit)
    if fraction != 0.5 or not UNIT_POWERS[0] <= power - 1 <= UNIT_POWERS[1]:
        return [f"unit = {unit!r} m: must be a power of two from 2^{UNIT_POWERS[0]} to 2^{UNIT_POWERS[1]}"]
    steps = origin / unit
    if (steps != np.floor(steps)).any() or (np.abs(steps) > MOST_ORIGIN).any():
        return ["origin: must be an integer multiple of the unit, and at most 2^50 of it"]
    if not (box[0] < box[2] and box[1] < box[3]):
        return [f"box = {box.tolist()}: must have a width and a height"]
    return []
