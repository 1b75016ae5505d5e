"""What the result folder holds, read for drawing: what is missing becomes a reason, never an error."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.report.numbers import number_in
from verify.report.stops import StopPaths, read_stop_paths
from vnav_drake.plan import COLUMNS, Trajectory

Array = NDArray[np.float64]

PLANS = (
    "voronoi_route",
    "vc_method",
    "speed_graph",
    "dwa",
    "collocation",
    "uniform",
    "refined",
)  # files looked for
EXECUTED = (
    "refined",
    "collocation",
    "speed_graph",
    "voronoi_route",
)  # stand-ins for trajectory.csv, best first
LONGEST_TEXT = 60_000  # characters of a scenario file that the page repeats
SIMULATION, SINGLE_TRACK = "simulation.csv", "simulation_single_track.csv"
STOPS, REPLAY, FIELDS = "stops.npz", "replay.html", "fields.json"
_MOTION = ("t", "x", "y", "heading", "v")

WHEELS = ("front_left", "front_right", "rear_left", "rear_right")
# Columns of simulation.csv that are drawn where they are there: of any vehicle, then of one with four wheels.
CHANNELS = (
    "steering", "steering_command", "lateral_acceleration", "mode", "tilt", "least_load",
    *(f"{kind}_{wheel}" for kind in ("load", "slip", "torque") for wheel in WHEELS),
)  # fmt: skip


@dataclass(frozen=True)
class SimulatedRun:
    """The recorded motion of the simulated vehicle."""

    t: Array  # (m,) [s]
    x: Array  # (m,) [m]
    y: Array  # (m,) [m]
    heading: Array  # (m,) [rad]
    v: Array  # (m,) [m/s]
    # name -> (m,): load_* [N], slip_* [m/s], torque_* [N m], steering* and tilt [rad], mode 0 to 3, ...
    channels: Mapping[str, Array] = field(default_factory=dict)

    def of_wheels(self, kind: str) -> dict[str, Array]:
        """The channel `kind` of all four wheels, wheel -> (m,); empty unless all are there."""
        found = {wheel: self.channels.get(f"{kind}_{wheel}") for wheel in WHEELS}
        whole = {wheel: values for wheel, values in found.items() if values is not None}
        return whole if len(whole) == len(WHEELS) else {}


@dataclass(frozen=True, kw_only=True)
class Evidence:
    """Everything that can be drawn, and why the rest cannot."""

    plans: Mapping[str, Trajectory]
    executed: Trajectory | None
    executed_plan: str  # which plan `executed` is, "" if unknown
    simulation: SimulatedRun | None
    scenario_text: str | None
    reasons: Mapping[str, str]  # file -> why it is not here
    single_track: SimulatedRun | None = None  # the quick model's run, where both models were asked for
    stops: StopPaths | None = None
    has_replay: bool = False
    fields: Mapping[str, Any] = field(default_factory=dict)  # fields.json, empty without one

    def reason(self, *files: str) -> str:
        """Why what is drawn from `files` is missing."""
        return "; ".join(self.reasons[file] for file in files if file in self.reasons)


def read_evidence(folder: Path) -> Evidence:
    """Read all trajectories, the simulated run and the emergency stops of a result folder."""
    reasons: dict[str, str] = {}
    plans = {}
    for name in PLANS:
        trajectory = _trajectory(folder, f"trajectories/{name}.csv", reasons)
        if trajectory is not None:
            plans[name] = trajectory
    executed = _trajectory(folder, "trajectory.csv", reasons)
    same = [name for name, plan in plans.items() if executed is not None and _same(plan, executed)]
    name = next((name for name in EXECUTED if name in same), "")
    if executed is None:
        name = next((name for name in EXECUTED if name in plans), "")
        executed = plans.get(name)
    stops, reason = read_stop_paths(folder)
    if stops is not None and not len(stops):
        stops, reason = None, f"{STOPS} holds no stop"
    if reason:
        reasons[STOPS] = reason
    return Evidence(
        plans=plans,
        executed=executed,
        executed_plan=name,
        simulation=_run(folder, SIMULATION, reasons),
        scenario_text=_scenario_text(folder, reasons),
        reasons=reasons,
        single_track=_run(folder, SINGLE_TRACK, reasons),
        stops=stops,
        has_replay=(folder / REPLAY).is_file(),
        fields=_fields(folder, reasons),
    )


def _fields(folder: Path, reasons: dict[str, str]) -> Mapping[str, Any]:
    """The table of fields; speeds that are not rising numbers make it as good as absent."""
    try:
        found = json.loads((folder / FIELDS).read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}
    except (OSError, ValueError) as error:  # not JSON, not text
        reasons[FIELDS] = f"{FIELDS} cannot be read: {error}"
        return {}
    cases = found.get("cases") if isinstance(found, Mapping) else None
    told = cases if isinstance(cases, list) else []
    speeds = [number_in(item, "max_speed") or 0.0 for item in told]
    if not speeds or speeds[0] <= 0.0 or any(b <= a for a, b in pairwise(speeds)):
        reasons[FIELDS] = f"{FIELDS} holds no fields of rising speed"
        return {}
    return found


def _run(folder: Path, file: str, reasons: dict[str, str]) -> SimulatedRun | None:
    columns = _columns(folder, file, _MOTION, reasons)
    if columns is None:
        return None
    more = _optional(folder / file, len(columns["t"]))
    return SimulatedRun(**columns, channels=more)


def _optional(file: Path, rows: int) -> dict[str, Array]:
    """Those of `CHANNELS` that `file` has, all numbers finite: a spoilt column is as good as absent."""
    with file.open(encoding="utf-8") as lines:
        header = [name.strip() for name in lines.readline().split(",")]
        names = [name for name in CHANNELS if name in header]
        if not names:
            return {}
        try:
            table = np.loadtxt(lines, delimiter=",", ndmin=2, usecols=[header.index(name) for name in names])
        except ValueError:
            return {}
    columns = zip(names, table.T.copy(), strict=True) if len(table) == rows else ()
    return {name: values for name, values in columns if np.all(np.isfinite(values))}


def _same(one: Trajectory, other: Trajectory) -> bool:
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in ("t", "x", "y", "v"))


def _trajectory(folder: Path, file: str, reasons: dict[str, str]) -> Trajectory | None:
    columns = _columns(folder, file, COLUMNS, reasons)
    return None if columns is None else Trajectory(**columns)


def _columns(
    folder: Path, file: str, names: tuple[str, ...], reasons: dict[str, str]
) -> dict[str, Array] | None:
    try:
        with (folder / file).open(encoding="utf-8") as lines:
            header = [name.strip() for name in lines.readline().split(",")]
            absent = [name for name in names if name not in header]
            if absent:
                raise ValueError(f"no column {', '.join(absent)}")
            rows = np.loadtxt(lines, delimiter=",", ndmin=2, usecols=[header.index(name) for name in names])
    except FileNotFoundError:
        reasons[file] = f"{file} was not written"
        return None
    except (OSError, ValueError) as error:  # UnicodeDecodeError is a ValueError
        reasons[file] = f"{file} cannot be read: {error}"
        return None
    if len(rows) < 2:
        reasons[file] = f"{file} has fewer than two rows"
        return None
    columns = dict(zip(names, rows.T.copy(), strict=True))
    if not np.all(np.isfinite(rows)) or np.any(np.diff(columns["t"]) < 0.0):
        reasons[file] = f"{file} holds numbers that are not finite, or times that run backwards"
        return None
    return columns


def _scenario_text(folder: Path, reasons: dict[str, str]) -> str | None:
    try:
        text = (folder / "scenario.yaml").read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        reasons["scenario.yaml"] = f"scenario.yaml cannot be read: {error.strerror}"
        return None
    if len(text) > LONGEST_TEXT:
        rest = len(text) - LONGEST_TEXT
        text = text[:LONGEST_TEXT] + f"\n… {rest:,} more characters are in scenario.yaml beside this report"
    return text
