"""From the files of a result folder to motions, the recorded runs and the recorded stops."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from verify import evidence
from verify.evidence import MODEL_OF_PLAN, EvidenceError
from verify.judge.finding import Check
from verify.judge.motion import COLUMNS, Motion
from verify.judge.question import Question
from verify.judge.stops import Stops, judge_stops
from verify.judge.stops_file import read_stops
from verify.judge.tracking import (
    RECORD_COLUMNS,
    WHEEL_COLUMNS,
    Record,
    judge_run,
    record_from_columns,
)
from verify.judge.zones import Zone

PRESCREEN = "single_track"  # trajectory of the check of the pre-screen, and its key among the figures


@dataclass(frozen=True, kw_only=True)
class Simulated:
    """What the recorded runs and stops show."""

    figures: Mapping[str, Any] | None  # simulation of result.json; None without a run to judge
    checks: tuple[Check, ...]  # `tracking` of each run that was asked for
    stops: Stops | None  # None where none were asked for or recorded


def read_motions(folder: Path) -> dict[str, Motion]:
    """All trajectories by plan, in the order of the plans."""
    names = [Path(file).stem for file in evidence.trajectory_files(folder)]
    unknown = [name for name in names if name not in MODEL_OF_PLAN]
    reasons = [f"{evidence.TRAJECTORIES}/{name}.csv: not a plan known here" for name in unknown]
    motions = {}
    for name in MODEL_OF_PLAN:
        if name in names:
            try:
                motions[name] = _motion(folder, f"{evidence.TRAJECTORIES}/{name}.csv")
            except EvidenceError as error:
                reasons += error.reasons
    if reasons:
        raise EvidenceError(*reasons)
    return motions


def _motion(folder: Path, file: str) -> Motion:
    columns = evidence.read_table(folder, file, COLUMNS, exact=True)
    return Motion(*(columns[name] for name in COLUMNS))


def read_executed(folder: Path, motions: Mapping[str, Motion]) -> list[str]:
    """The plans that trajectory.csv is a copy of, byte for byte; empty when there is nothing to execute."""
    if not (folder / evidence.EXECUTED).exists():
        return []
    wanted = evidence.read_bytes(folder, evidence.EXECUTED)
    same = [
        name
        for name in reversed(tuple(motions))  # the full model's before the others
        if evidence.read_bytes(folder, f"{evidence.TRAJECTORIES}/{name}.csv") == wanted
    ]
    if not same:
        raise EvidenceError(f"{evidence.EXECUTED}: differs from every plan in {evidence.TRAJECTORIES}/")
    return same


def read_simulation(
    folder: Path, motion: Motion | None, asked: Question, zone: Zone | None = None
) -> Simulated:
    """Judge the run, the pre-screen and the emergency stops, as far as they were asked for.

    `motion` is the one to execute, None without one; `zone` what it claims, None for a disc.

    Raises
    ------
    EvidenceError : a file is malformed.
    """
    drive, setting = asked.drive, asked.setting
    record, figures, check = _run(folder, evidence.SIMULATION, motion, asked, drive.vehicle, "simulation")
    checks = [check]
    if drive.prescreen:
        _, single, check = _run(folder, evidence.SIMULATION_SINGLE_TRACK, motion, asked, PRESCREEN, PRESCREEN)
        checks.append(check)
        if figures is not None and single is not None:
            figures[PRESCREEN] = single
    stops = None
    file = read_stops(folder) if drive.stops else None
    if file is not None and record is not None and motion is not None:
        where = (setting.surroundings, drive, setting.limits, zone)
        stops = judge_stops(file, record, motion.travel_time, *where)
        if figures is not None and stops.figures is not None:
            figures["emergency_stops"] = stops.figures
    return Simulated(figures=figures, checks=tuple(checks), stops=stops)


def _run(
    folder: Path, file: str, motion: Motion | None, asked: Question, vehicle: str, name: str
) -> tuple[Record | None, dict[str, Any] | None, Check]:
    """The record of one run, its figures, and its check under the trajectory `name`."""

    def nothing(message: str) -> tuple[None, None, Check]:
        check = Check(name="tracking", trajectory=name, status="not_evaluated", message=message)
        return None, None, check

    if not (folder / file).exists():
        return nothing("no simulation was recorded")
    columns = evidence.read_table(folder, file, RECORD_COLUMNS, exact=False)
    present = [column for column in WHEEL_COLUMNS if column in columns]
    if 0 < len(present) < len(WHEEL_COLUMNS):
        missing = [column for column in WHEEL_COLUMNS if column not in columns]
        raise EvidenceError(f"{file}: has {', '.join(present)}, but not {', '.join(missing)}")
    if motion is None:
        return nothing(f"there is no {evidence.EXECUTED} to compare the run with")
    record = record_from_columns(columns)
    if (record.t[1:] <= record.t[:-1]).any() or abs(record.t[0]) > 1e-9:
        raise EvidenceError(f"{file}: times must increase from zero")
    setting = asked.setting
    run = judge_run(
        record,
        motion,
        setting.goal.position,
        setting.surroundings,
        setting.limits,
        vehicle=vehicle,
        name=name,
    )
    return record, run.figures, run.check
