"""The result folder as files: what is in it, read strictly, and its manifest of SHA-256 sums.

Everything here may come from somebody else's disk, so nothing is trusted: sizes are bounded, numbers
must be finite, and every fault is an `EvidenceError` that names the file.
"""

from __future__ import annotations

import hashlib
import io
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SCENARIO = "scenario.yaml"
RESULT = "result.json"
REPORT = "report.html"
TRAJECTORIES = "trajectories"
EXECUTED = "trajectory.csv"
SIMULATION = "simulation.csv"
SIMULATION_SINGLE_TRACK = "simulation_single_track.csv"  # of the pre-screen, beside the four-wheel run
STOPS = "stops.npz"
FIELDS = "fields.json"  # of a field set: the fields, where each is watched
FIELDS_TABLE = "fields.csv"  # the same for people
REPLAY = "replay.html"
CERTIFICATE = "certificate.npz"
SCHEMA = 1  # of result.json
MAX_NUMBER = 1e12  # in any SI unit: far beyond any motion, and its powers do not overflow
MAX_BYTES = 128 * 1024 * 1024  # of one file: ten times the largest we write

MODEL_OF_PLAN: Mapping[str, str] = {
    "voronoi_route": "variational",
    "vc_method": "full",
    "speed_graph": "variational",
    "dwa": "full",
    "uniform": "full",
    "collocation": "variational",
    "refined": "full",
}


class EvidenceError(Exception):
    """Evidence is missing or is not what it should be; `reasons` names each file and fault."""

    def __init__(self, *reasons: str) -> None:
        super().__init__("; ".join(reasons))
        self.reasons = reasons


def read_bytes(folder: Path, name: str) -> bytes:
    """One file of the folder; symbolic links are not followed out of it."""
    file = folder / name
    try:
        if not file.is_file() or not file.resolve().is_relative_to(folder.resolve()):
            raise EvidenceError(f"{name}: missing")
        if file.stat().st_size > MAX_BYTES:
            raise EvidenceError(f"{name}: larger than {MAX_BYTES} bytes")
        return file.read_bytes()
    except OSError as error:
        raise EvidenceError(f"{name}: cannot be read: {error.strerror}") from error


def read_table(folder: Path, name: str, required: tuple[str, ...], *, exact: bool) -> dict[str, Array]:
    """Columns (n,) of a CSV file, n >= 2, all finite and at most `MAX_NUMBER`.

    Parameters
    ----------
    required : the header's names; with `exact` these and no others in this order, otherwise others too.

    Raises
    ------
    EvidenceError : missing, truncated or malformed.
    """
    try:
        text = read_bytes(folder, name).decode("ascii")
    except UnicodeDecodeError as error:
        raise EvidenceError(f"{name}: not a text file of numbers") from error
    header, _, body = text.partition("\n")
    columns = tuple(header.strip().split(","))
    if not set(required) <= set(columns) or (exact and columns != required):
        raise EvidenceError(f"{name}: the columns are {header.strip()[:80]!r}, expected {','.join(required)}")
    if len(set(columns)) < len(columns):
        raise EvidenceError(f"{name}: two columns have the same name")
    if not body.endswith("\n"):
        raise EvidenceError(f"{name}: truncated: the last line is not complete")
    if not body.strip():
        raise EvidenceError(f"{name}: no rows")
    try:
        rows = np.loadtxt(io.StringIO(body), delimiter=",", comments=None, ndmin=2)
    except ValueError as error:
        raise EvidenceError(f"{name}: malformed: {error}") from error
    if rows.shape[1] != len(columns):
        raise EvidenceError(f"{name}: {rows.shape[1]} values a row under {len(columns)} columns")
    if len(rows) < 2:
        raise EvidenceError(f"{name}: fewer than two rows")
    bad = ~np.isfinite(rows).all(axis=1)
    if not bad.any():
        bad = (np.abs(rows) > MAX_NUMBER).any(axis=1)
    if bad.any():
        raise EvidenceError(
            f"{name}: row {int(np.argmax(bad)) + 1} holds a number that is not finite or absurd"
        )
    return dict(zip(columns, rows.T, strict=True))


def trajectory_files(folder: Path) -> list[str]:
    """Names `trajectories/*.csv` in the folder, sorted."""
    return sorted(f"{TRAJECTORIES}/{file.name}" for file in (folder / TRAJECTORIES).glob("*.csv"))


def read_result(folder: Path) -> dict[str, Any]:
    """result.json, with every number finite.

    Raises
    ------
    EvidenceError : missing, not JSON, not an object, or of another schema.
    """
    result = read_json(folder, RESULT)
    if not isinstance(result, dict) or result.get("schema") != SCHEMA or "scenario_sha256" not in result:
        raise EvidenceError(f"{RESULT}: not a result of schema {SCHEMA}")
    return result


def read_json(folder: Path, name: str) -> Any:
    """One JSON file of the folder, with every number finite.

    Raises
    ------
    EvidenceError : missing, or not JSON.
    """
    data = read_bytes(folder, name)
    try:
        return json.loads(data.decode("utf-8"), parse_constant=_refuse_constant, parse_float=_finite_float)
    except (ValueError, RecursionError) as error:  # decoding errors are ValueErrors
        raise EvidenceError(f"{name}: malformed: {error}") from error


def _refuse_constant(word: str) -> float:
    raise ValueError(f"{word} is not a finite number")


def _finite_float(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{text} is not a finite number")
    return value


def is_result_folder(folder: Path) -> bool:
    """Whether `verify` wrote this folder."""
    try:
        read_result(folder)
    except EvidenceError:
        return False
    return True


def sha256(data: bytes) -> str:
    """Hexadecimal digest."""
    return hashlib.sha256(data).hexdigest()


def manifest(folder: Path) -> dict[str, str]:
    """SHA-256 of each evidence file that can be read, and of the report, by name."""
    found = {}
    single = (SCENARIO, EXECUTED, SIMULATION, SIMULATION_SINGLE_TRACK, STOPS, FIELDS, FIELDS_TABLE)
    for name in sorted([*single, CERTIFICATE, REPORT, REPLAY, *trajectory_files(folder)]):
        try:
            found[name] = sha256(read_bytes(folder, name))
        except EvidenceError:
            continue
    return found


def write_result(folder: Path, result: Mapping[str, Any]) -> None:
    """Write result.json; a number that is not finite is a ValueError."""
    text = json.dumps(result, indent=1, allow_nan=False, ensure_ascii=False)
    (folder / RESULT).write_text(text + "\n", encoding="utf-8")
