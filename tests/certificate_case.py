"""Certificates made by hand: any mesh, any function, scaled until it is one; with formulas of their own."""

from __future__ import annotations

import hashlib
import io
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from judged import scenario_bytes

from verify.judge.certificate import CERTIFICATE, CertificateFile, Proof, check_certificate, read_certificate
from verify.judge.question import Question, read_question

Arrays = dict[str, np.ndarray]

UNIT = 2.0**-10  # [m]
TERMS = 2  # a triangle, of its minorant
BELOW = 1.0 - 1e-12  # how close to the limit u is scaled: above the rounding of this module and the checker


def question(**changes: Any) -> Question:
    """The hall of `judged`, changed."""
    return read_question(scenario_bytes(**changes))


def grid(xs: Any, ys: Any) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 2) and anticlockwise triangles (t, 3): all cells between grid lines, cut in two."""
    xs, ys = np.asarray(xs), np.asarray(ys)
    x, y = np.meshgrid(xs, ys, indexing="ij")
    first = (np.arange(len(xs) - 1)[:, None] * len(ys) + np.arange(len(ys) - 1)).ravel()
    a, b, c, d = first, first + len(ys), first + len(ys) + 1, first + 1
    even = (np.arange(len(first)) % 2 == 0)[:, None]
    lower = np.where(even, np.stack([a, b, c], 1), np.stack([a, b, d], 1))
    upper = np.where(even, np.stack([a, c, d], 1), np.stack([b, c, d], 1))
    return np.stack([x.ravel(), y.ravel()], 1), np.concatenate([lower, upper])


def distances(points: np.ndarray, table: np.ndarray) -> np.ndarray:
    """Distance [m] of points (n, 2) to features (f, 5), by Shapely; (n, f)."""
    lines = shapely.linestrings(np.stack([table[:, :2], table[:, 2:4]], 1))
    return shapely.distance(shapely.points(points)[:, None], lines) - table[:, 4]


def make(
    asked: Question,
    vertices: np.ndarray,
    triangles: np.ndarray,
    potential: Callable[[np.ndarray], np.ndarray],
    *,
    scale: bool = True,
    unit: float = UNIT,
) -> Arrays:
    """A certificate on a mesh with vertices [m] at multiples of `unit`; u interpolates `potential` on it.

    Triangles that are blocked are dropped; the others get the tangents of their best two features. With
    `scale`, u is multiplied by the greatest factor at which it is a certificate, times `BELOW`.
    """
    limits, table = asked.setting.limits, asked.features.table
    lattice = np.round(vertices / unit).astype(np.int64)
    points = lattice * unit
    blocked = _blocked(asked, points, triangles)
    kept = triangles[np.isnan(blocked)]
    dropped = ~np.isnan(blocked)
    ends = np.sort(np.stack([kept, np.roll(kept, -1, 1)], 2).reshape(-1, 2), 1)
    edges = np.unique(ends, axis=0)
    value, middle = potential(points), potential(points[edges].mean(axis=1))
    feature, speed, weight = _terms(asked, points[kept])
    arrays: Arrays = {
        "format": np.array(1),
        "vertices": lattice,
        "origin": np.zeros(2),
        "unit": np.array(unit),
        "box": np.concatenate([lattice.min(0), lattice.max(0)]),
        "triangles": kept.astype(np.int32),
        "side": np.zeros(len(kept), dtype=np.int32),
        "dropped": triangles[dropped].astype(np.int32),
        "blocked_by": blocked[dropped].astype(np.int32),
        "edges": edges.astype(np.int32),
        "u_vertex": value,
        "u_edge": 2.0 * middle - value[edges].mean(axis=1),
        "feature": feature,
        "speed": speed,
        "weight": weight,
        "start_triangle": np.array(_around(points[kept], asked.setting.start.position)),
        "goal_triangle": np.array(_around(points[kept], asked.setting.goal.position)),
        "features": table.copy(),
        "start": np.array(asked.setting.start.position, dtype=float),
        "goal": np.array(asked.setting.goal.position, dtype=float),
        "law": np.array(
            [limits.radius, limits.braking, limits.reaction_time, limits.margin, limits.speed], dtype=float
        ),
        "travel_time": np.array(0.0),
    }
    if scale:
        rescale(arrays)
    return sealed(arrays)


def rescale(arrays: Arrays) -> None:
    """Scale u to the limit, and claim what it then proves."""
    slope, least = corner_values(arrays)
    moving = slope > 0.0
    factor = BELOW * float((least[moving] / slope[moving]).min())
    assert factor > 0.0
    arrays["u_vertex"] = arrays["u_vertex"] * factor
    arrays["u_edge"] = arrays["u_edge"] * factor
    rise = at(arrays, "goal") - at(arrays, "start")
    arrays["travel_time"] = np.array(rise - (1.0 - BELOW) * np.abs(arrays["u_vertex"]).max())


def at(arrays: Arrays, end: str) -> float:
    """u [s] at an end, by the definition in barycentric coordinates."""
    triangle = arrays["triangles"][int(arrays[f"{end}_triangle"])]
    corner = arrays["vertices"][triangle] * arrays["unit"] + arrays["origin"]
    lam = np.linalg.solve(np.vstack([corner.T, np.ones(3)]), np.append(arrays[end], 1.0))
    control = np.array([[_control(arrays, i, j) for j in triangle] for i in triangle])
    return float(lam @ control @ lam)


def _control(arrays: Arrays, i: int, j: int) -> float:
    if i == j:
        return float(arrays["u_vertex"][i])
    return float(arrays["u_edge"][(arrays["edges"] == sorted((i, j))).all(axis=1)][0])


def gradient(arrays: Arrays) -> np.ndarray:
    """grad u [s/m] at the three corners of each kept triangle (t, 3, 2): 2 sum_j c_ij grad lambda_j."""
    corner = (arrays["vertices"] * arrays["unit"] + arrays["origin"])[arrays["triangles"]]
    inverse = np.linalg.inv(np.concatenate([corner, np.ones((len(corner), 3, 1))], axis=2))
    slopes = inverse[:, :2, :].transpose(0, 2, 1)  # lambda_j = slopes_j . (x, y) + constant
    count = len(arrays["vertices"])
    control = np.full((len(corner), 3, 3), np.nan)
    key = arrays["edges"][:, 0].astype(np.int64) * count + arrays["edges"][:, 1]
    for i in range(3):
        for j in range(3):
            a, b = arrays["triangles"][:, i].astype(np.int64), arrays["triangles"][:, j].astype(np.int64)
            if i == j:
                control[:, i, i] = arrays["u_vertex"][a]
            else:
                row = np.searchsorted(key, np.minimum(a, b) * count + np.maximum(a, b))
                control[:, i, j] = arrays["u_edge"][row]
    return 2.0 * np.einsum("tij,tjc->tic", control, slopes)


def corner_values(arrays: Arrays) -> tuple[np.ndarray, np.ndarray]:
    """|grad u| and the minorant [s/m] at the corners (t, 3), by the formulas of the theorem."""
    radius, braking, delay, margin, fastest = arrays["law"]
    corner = (arrays["vertices"] * arrays["unit"] + arrays["origin"])[arrays["triangles"]]
    total = np.zeros(corner.shape[:2])
    for slot in range(arrays["feature"].shape[1]):
        w, weight = arrays["speed"][:, slot, None], arrays["weight"][:, slot, None]
        rows = arrays["features"][arrays["feature"][:, slot]]
        gap = np.stack([_distance(corner[:, i], rows) for i in range(3)], 1)
        level = radius + margin + w * delay + w * w / (2.0 * braking)
        tangent = 1.0 / w - braking / (w * w * (w + braking * delay)) * (gap - level)
        steady = arrays["feature"][:, slot, None] < 0
        total += np.where(weight > 0.0, weight * np.where(steady, 1.0 / fastest, tangent), 0.0)
    return np.linalg.norm(gradient(arrays), axis=2), total


def _distance(points: np.ndarray, rows: np.ndarray) -> np.ndarray:
    lines = shapely.linestrings(np.stack([rows[:, :2], rows[:, 2:4]], 1))
    return shapely.distance(shapely.points(points), lines) - rows[:, 4]


def _blocked(asked: Question, points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """`blocked_by` of each triangle, NaN where it is not blocked."""
    limits, features = asked.setting.limits, asked.features
    found = np.full(len(triangles), np.nan)
    shapes = shapely.polygons(points[triangles])
    hall = shapely.Polygon(features.boundary)
    near = (distances(points, features.table) <= limits.radius + limits.margin)[triangles].all(axis=1)
    hit = near.any(axis=1)
    found[hit] = np.argmax(near[hit], axis=1)
    found[~shapely.relate_pattern(shapes, hall, "T********")] = -1
    for index, vertices in features.polygons.items():
        found[shapely.covers(shapely.Polygon(vertices), shapes)] = -2 - index
    return found


def _terms(asked: Question, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Tangents of the two features nearest to each triangle; all weight on the better, or half each."""
    limits, table = asked.setting.limits, asked.features.table
    gap = np.stack([distances(corners[:, i], table) for i in range(3)], 1)  # (t, 3, f)
    nearest = np.argsort(gap.mean(axis=1), axis=1)[:, :TERMS]
    gap = np.take_along_axis(gap, nearest[:, None, :], axis=2) - limits.radius - limits.margin
    touch = np.maximum(
        np.maximum(gap.mean(axis=1), 0.5 * gap.max(axis=1)), 1e-3
    )  # the tangent stays positive
    lag = limits.braking * limits.reaction_time
    speed = np.sqrt(lag * lag + 2.0 * limits.braking * touch) - lag
    slope = limits.braking / (speed * speed * (speed + lag))
    tangent = 1.0 / speed[:, None, :] - slope[:, None, :] * (gap - touch[:, None, :])
    least = np.concatenate([tangent.min(axis=1), tangent.mean(axis=2).min(axis=1)[:, None]], axis=1)
    weight = np.array([[1.0, 0.0], [0.0, 1.0], [0.5, 0.5]])[np.argmax(least, axis=1)]
    return nearest.astype(np.int32), speed, weight


def _around(corners: np.ndarray, position: Any) -> int:
    inside = shapely.intersects(shapely.polygons(corners), shapely.Point(position))
    return int(np.argmax(inside))


def digest(arrays: Mapping[str, np.ndarray]) -> np.ndarray:
    """As the format says: each key, type, shape and bytes, keys sorted."""
    sums = hashlib.sha256()
    for key in sorted(set(arrays) - {"digest"}):
        array = arrays[key]
        for part in (key, array.dtype.str, repr(array.shape)):
            sums.update(part.encode() + b"\0")
        sums.update(array.tobytes(order="C"))
    return np.frombuffer(sums.digest(), dtype=np.uint8)


def sealed(arrays: Arrays) -> Arrays:
    """With the digest of its numbers."""
    return {**arrays, "digest": digest(arrays)}


def packed(arrays: Mapping[str, np.ndarray]) -> bytes:
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)
    return stream.getvalue()


def read(arrays: Mapping[str, np.ndarray], folder: Path) -> CertificateFile:
    """As read back from a file in `folder`."""
    (folder / CERTIFICATE).write_bytes(packed(arrays))
    file = read_certificate(folder)
    assert file is not None
    return file


def proof(arrays: Mapping[str, np.ndarray], asked: Question, folder: Path, *, exact: bool = False) -> Proof:
    return check_certificate(read(arrays, folder), asked, exact=exact)
