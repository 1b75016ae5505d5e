"""fields.json as evidence: are these the fields that were asked for, watched where the motion needs them?"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify import evidence
from verify.evidence import EvidenceError
from verify.judge.finding import VIOLATION_TOLERANCE, Check, Place
from verify.judge.motion import Motion
from verify.judge.zones.asked import AskedZone
from verify.judge.zones.errors import ZoneError
from verify.judge.zones.fields import convex, fitted_fields
from verify.judge.zones.held import outside
from verify.judge.zones.separation import least_separation
from verify.judge.zones.shapes import Hull
from verify.judge.zones.zone import SAME_SPEED, FieldSet

Array = NDArray[np.float64]

NAME = "fields"
SCHEMA = 1
MOST = 64  # fields
SAME = 1e-9  # relative, and [any unit]: numbers that were written and read again
# Polygons stand for fields with round sides: by their tangents, so a little more than the field.
ROUNDER = 1e-3  # of the field's extent, and [m] ...
SEPARATION = 1e-3  # [m], by which a separation at the rows may be more than that between them


@dataclass(frozen=True, eq=False)
class FieldsFile:
    """The fields as a result folder tells them."""

    base: Mapping[str, Any]
    speeds: Array  # (c,) [m/s], rising
    polygons: tuple[Array, ...]  # (c,) of (k, 2) [m]
    switches: Array  # (n, 5): s [m], t [s], x, y [m], case from 1; the first is where the motion begins
    least_separation: tuple[float | None, ...]  # (c,) [m], None of a field that is never watched
    scanner_range: float  # [m]


def read_fields(folder: Path) -> FieldsFile | None:
    """Read fields.json of a result folder; None when there is none.

    Raises
    ------
    EvidenceError : not JSON, of another schema, something missing, a number where none can be.
    """
    if not (folder / evidence.FIELDS).exists():
        return None
    data = evidence.read_json(folder, evidence.FIELDS)
    try:
        if data["schema"] != SCHEMA:
            raise EvidenceError(f"{evidence.FIELDS}: not of schema {SCHEMA}")
        cases = data["cases"]
        if not 1 <= len(cases) <= MOST or [case["case"] for case in cases] != [*range(1, len(cases) + 1)]:
            raise EvidenceError(f"{evidence.FIELDS}: cases: expected 1 to {MOST}, numbered from 1")
        speeds = np.array([float(case["max_speed"]) for case in cases])
        polygons = tuple(np.array(case["polygon"], dtype=float) for case in cases)
        switches = np.array(
            [[float(row[key]) for key in ("s", "t", "x", "y", "case")] for row in data["switches"]]
        ).reshape(-1, 5)
        least = tuple(None if value is None else float(value) for value in data["least_separation"])
        file = FieldsFile(data["base"], speeds, polygons, switches, least, float(data["scanner_range"]))
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise EvidenceError(f"{evidence.FIELDS}: malformed: {type(error).__name__}: {error}") from error
    wrong = []
    if (speeds <= 0.0).any() or (np.diff(speeds) <= 0.0).any():
        wrong.append("cases: the greatest speeds must be positive and rise")
    if len(file.least_separation) != len(speeds):
        wrong.append(f"least_separation: expected {len(speeds)} numbers")
    numbers = np.concatenate([speeds, switches.ravel(), *(polygon.ravel() for polygon in polygons)])
    if (np.abs(numbers) > evidence.MAX_NUMBER).any():
        wrong.append("holds a number that is absurd")
    for index, polygon in enumerate(polygons):
        try:
            convex(polygon, f"cases[{index}].polygon", ((0.0, 0.0),))
        except (ZoneError, ValueError) as error:
            wrong.append(str(error))
    if wrong:
        raise EvidenceError(*(f"{evidence.FIELDS}: {text}" for text in wrong))
    return file


def fields_of(asked: AskedZone, file: FieldsFile | None) -> FieldSet | None:
    """The zone switched by speed: the scenario's own fields, or the base zone at the speeds of the file."""
    if asked.count is None:
        return asked.fields
    return None if file is None else fitted_fields(asked.zone, file.speeds)


def judge_fields(
    file: FieldsFile | None, asked: AskedZone, motion: Motion, features: Array
) -> tuple[Check, dict[str, Any] | None]:
    """The check `fields` of the motion that is driven under a field set, and the block `zone.fields`.

    The fields must be those that were asked for, each polygon must hold the zone at its greatest speed and
    not much more, no speed may be above the last, and the switches must be where the speed calls for them.
    With a dwell larger fields may be watched, which must be free too, and each for as long as asked for.
    """
    fields = fields_of(asked, file)
    if file is None or fields is None:
        return Check(name=NAME, trajectory="", status="not_evaluated", message="no fields were written"), None
    wrong = [*_not_asked_for(file, asked), *_wrong_polygons(file, fields)]
    fastest = int(np.argmax(motion.v))
    if motion.v[fastest] > fields.speeds[-1] * (1.0 + VIOLATION_TOLERANCE):
        wrong.append(f"{motion.v[fastest]:.6f} m/s is faster than the last field allows")
    case = fields.case(np.append(np.maximum(motion.v[:-1], motion.v[1:]), motion.v[-1]))
    dwell = float(asked.parameters["dwell"])
    if dwell > 0.0:
        case, faults = _watched(file, motion, case, dwell)
        wrong += faults
    else:
        wrong += _wrong_switches(file, motion, case)
    nearest = _least_by_case(motion, case, features, fields)
    for index, (told, found) in enumerate(zip(file.least_separation, nearest, strict=True)):
        if (told is None) != (found is None) or (told is not None and told > (found or 0.0) + SEPARATION):
            wrong.append(f"least_separation[{index}] = {told}, found {found}")
        if dwell > 0.0 and found is not None and found < -VIOLATION_TOLERANCE:
            wrong.append(f"field {index + 1} is watched where it is not free, by {-found:.6f} m")
    furthest = max(float(np.hypot(*polygon.T).max()) for polygon in file.polygons)
    if abs(file.scanner_range - furthest) > SAME * furthest:
        wrong.append(f"scanner_range = {file.scanner_range:.6f} m, the fields reach {furthest:.6f} m")
    changes = int((np.diff(case) != 0).sum())
    figures = {
        "count": len(fields.speeds),
        "max_speeds": fields.speeds.tolist(),
        "switches": changes,
        "scanner_range": furthest,
        "least_separation": nearest,
    }
    text = f"fields: {len(fields.speeds)}, switched {changes} times"
    at = Place(t=float(motion.t[fastest]), x=float(motion.x[fastest]), y=float(motion.y[fastest]))
    return Check(
        name=NAME,
        trajectory="",
        status="failed" if wrong else "passed",
        message="; ".join(wrong[:5]) or text,
        at=at,
    ), figures


def _not_asked_for(file: FieldsFile, asked: AskedZone) -> list[str]:
    """Differences between the file and the scenario."""
    wrong = []
    if file.base != asked.parameters["base"]:
        wrong.append("base: not the scenario's")
    if asked.count is not None:
        if len(file.speeds) > asked.count:
            wrong.append(f"{len(file.speeds)} fields, where at most {asked.count} were asked for")
    elif asked.fields is not None and not _same(file.speeds, asked.fields.speeds):
        wrong.append("the greatest speeds are not the scenario's")
    return wrong


def _wrong_polygons(file: FieldsFile, fields: FieldSet) -> list[str]:
    """Polygons that do not hold the field they stand for, or much more.

    A convex polygon is what lies within its edges, so it holds a set that reaches no further than them in the
    directions of their normals.
    """
    wrong = []
    for index, (polygon, speed) in enumerate(zip(file.polygons, file.speeds.tolist(), strict=True)):
        if index >= len(fields.speeds):
            break
        hull, at = Hull(polygon), np.asarray(speed)
        lacks = float((fields.support(hull.kinks, at) - hull.support(hull.kinks)).max())
        more = float(outside(fields, 0.0, polygon, np.full(len(polygon), speed)).max())
        extent = float(fields.extent(at))
        if lacks > VIOLATION_TOLERANCE:
            wrong.append(f"cases[{index}].polygon lacks {lacks:.6f} m of the field")
        if more > ROUNDER * (1.0 + extent):
            wrong.append(f"cases[{index}].polygon reaches {more:.6f} m beyond the field")
    return wrong


def _wrong_switches(file: FieldsFile, motion: Motion, case: NDArray[np.int64]) -> list[str]:
    """Switches that are not where the speed passes from one case to another."""
    row = np.concatenate([[0], np.flatnonzero(np.diff(case)) + 1])
    if len(file.switches) != len(row):
        return [f"{len(file.switches)} switches, where the speed calls for {len(row)}"]
    s = np.concatenate([[0.0], np.cumsum(motion.step)])
    wanted = np.column_stack([s[row], motion.t[row], motion.x[row], motion.y[row], case[row] + 1.0])
    off = np.abs(file.switches - wanted).max(axis=1) > VIOLATION_TOLERANCE
    return [f"switches[{index}] is not where the speed calls for it" for index in np.flatnonzero(off)[:1]]


def _watched(
    file: FieldsFile, motion: Motion, needed: NDArray[np.int64], dwell: float
) -> tuple[NDArray[np.int64], list[str]]:
    """Which field is watched from each row on by the switches of the file, and what is wrong with them.

    None may be less than the speed calls for, and all but the first and the last stay for `dwell` [s].
    """
    told = file.switches
    s = np.concatenate([[0.0], np.cumsum(motion.step)])
    rows = np.column_stack([s, motion.t, motion.x, motion.y])
    at = np.array([int(np.abs(motion.t - t).argmin()) for t in told[:, 1]], dtype=np.int64)
    if len(at) == 0 or at[0] != 0 or (np.diff(at) <= 0).any():
        return needed, ["switches: expected the first where the motion begins, and others in their order"]
    off = np.abs(told[:, :4] - rows[at]).max(axis=1) > VIOLATION_TOLERANCE
    if off.any():
        return needed, [f"switches[{int(np.flatnonzero(off)[0])}] is at no row of the motion"]
    if not np.isin(told[:, 4], np.arange(1, len(file.speeds) + 1)).all() or (np.diff(told[:, 4]) == 0).any():
        return needed, ["switches: a case that is none, or the same twice"]
    case = np.repeat(told[:, 4].astype(np.int64) - 1, np.diff(at, append=len(rows)))
    wrong = []
    less = np.flatnonzero(case < needed)
    if less.size:
        wrong.append(f"a lesser field than the speed calls for is watched at t = {motion.t[less[0]]:.6f} s")
    stay = np.diff(told[1:, 1])
    if (stay < dwell - VIOLATION_TOLERANCE).any():
        wrong.append(f"a field is watched for {stay.min():.6f} s, less than the dwell of {dwell:g} s")
    return case, wrong


def _least_by_case(
    motion: Motion, case: NDArray[np.int64], features: Array, fields: FieldSet
) -> list[float | None]:
    """Proven least separation [m] of each field where it is watched, None where it never is."""
    found: list[float | None] = []
    for index in range(len(fields.speeds)):
        rows = np.flatnonzero(case[:-1] == index)
        one = FieldSet(fields.speeds[[index]], (fields.fields[index],))
        found.append(least_separation(motion, features, one, rows).proven if rows.size else None)
    return found


def _same(one: Array, other: Array) -> bool:
    return one.shape == other.shape and bool(np.allclose(one, other, rtol=SAME_SPEED, atol=0.0))
