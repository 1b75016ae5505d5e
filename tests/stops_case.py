"""A run on a straight line and its emergency stops in closed form: evidence without any simulation.

The vehicle of `judged.BASE` drives along the centre line of the hall, y = 2 m, from x = 5 m to 35 m at 1 m/s:
30 s. Its brakes act a reaction time t_r after the instant and give a_b = 1 m/s^2. So a stop covers
v t_r + v^2 / (2 a_b) = 0.5 m without a reaction time, in 1 s; the clearance is 2 - 0.5 = 1.5 m all along.
"""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from judged import arcs_motion, scenario_bytes, setting

from verify import evidence
from verify.judge import judge
from verify.judge.motion import COLUMNS, Motion
from verify.judge.question import Question, read_question
from verify.judge.stops import Stops, judge_stops, stops_check
from verify.judge.stops_file import StopsFile
from verify.judge.tracking import LOAD_COLUMNS, Record, record_from_columns

Arrays = dict[str, np.ndarray]
ROWS = ("t", "x", "y", "heading", "v", "tilt", "least_load", "slip")

INSTANTS = 20
SPEED, LENGTH = 1.0, 30.0  # [m/s], [m]
ENDS: dict[str, Any] = {"start": {"speed": SPEED}, "goal": {"speed": SPEED}}


def changes(**more: Any) -> dict[str, Any]:
    """The scenario's difference from `judged.BASE`; `more` is merged over it."""
    return {**ENDS, "simulation": {"stops": INSTANTS}, **more}


def plan(**scenario: Any) -> Motion:
    return arcs_motion((5.0, 2.0), 0.0, [(LENGTH, 0.0)], [SPEED, SPEED], setting(**scenario))


def run_columns() -> Arrays:
    """Of simulation.csv: the plan driven without error on four loaded wheels, a row every 10 ms."""
    t = np.arange(3001) * 0.01
    still = np.zeros(len(t))
    return {
        "t": t,
        "x": 5.0 + SPEED * t,
        "y": np.full(len(t), 2.0),
        "heading": still,
        "v": np.full(len(t), SPEED),
        "longitudinal_velocity": np.full(len(t), SPEED),
        "lateral_velocity": still,
        "steering": still,
        "lateral_acceleration": still,
        **{name: np.full(len(t), 40.0 * 9.81 / 4.0) for name in LOAD_COLUMNS},
        "tilt": still,
        "mode": still,
    }


def stop_arrays(
    instants: int = INSTANTS, *, braking: float = 1.0, reaction_time: float = 0.0, model: str = "four_wheel"
) -> Arrays:
    """Of stops.npz, in closed form: two equal stops at each of the instants, evenly from 0 to 30 s."""
    instant = np.repeat(np.linspace(0.0, LENGTH / SPEED, instants), 2)
    duration = reaction_time + SPEED / braking
    t = np.append(np.arange(0.0, duration - 1e-9, 0.02), duration)
    late = np.maximum(t - reaction_time, 0.0)
    x = SPEED * t - 0.5 * braking * late**2
    count, rows = len(instant), len(t)
    return {
        "schema": np.array(1),
        "model": np.array(model),
        "instant": instant,
        "straightened": np.tile([False, True], instants),
        "first": np.arange(count + 1) * rows,
        "t": np.tile(t, count),
        "x": (5.0 + SPEED * instant[:, None] + x).ravel(),
        "y": np.full(count * rows, 2.0),
        "heading": np.zeros(count * rows),
        "v": np.tile(SPEED - braking * late, count),
        "tilt": np.zeros(count * rows),
        "least_load": np.full(count * rows, 0.8),
        "slip": np.zeros(count * rows),
    }


def no_stops() -> Arrays:
    """Of stops.npz without any."""
    return first_stops(stop_arrays(), 0)


def first_stops(arrays: Arrays, kept: int) -> Arrays:
    """The first stops only."""
    rows = {key: arrays[key][: arrays["first"][kept]] for key in ROWS}
    head = {key: arrays[key][:kept] for key in ("instant", "straightened")}
    return {**arrays, **rows, **head, "first": arrays["first"][: kept + 1]}


def rows_of(arrays: Arrays, stop: int) -> slice:
    return slice(int(arrays["first"][stop]), int(arrays["first"][stop + 1]))


def edited(arrays: Arrays, key: str, stop: int, change: Callable[[np.ndarray], np.ndarray]) -> Arrays:
    """The arrays with the rows `key` of one stop changed."""
    column = arrays[key].copy()
    column[rows_of(arrays, stop)] = change(column[rows_of(arrays, stop)])
    return {**arrays, key: column}


def cut(arrays: Arrays, keep: np.ndarray) -> Arrays:
    """The arrays with those rows (m,) bool only; every stop keeps some."""
    owner = np.repeat(np.arange(len(arrays["instant"])), np.diff(arrays["first"]))
    counts = np.bincount(owner[keep], minlength=len(arrays["instant"]))
    first = np.concatenate([[0], np.cumsum(counts)])
    return {**arrays, **{key: arrays[key][keep] for key in ROWS}, "first": first}


def packed(arrays: Arrays) -> bytes:
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)
    return stream.getvalue()


def write_run(folder: Path, columns: Arrays, name: str = evidence.SIMULATION) -> None:
    rows = np.column_stack(list(columns.values()))
    np.savetxt(folder / name, rows, fmt="%.17g", delimiter=",", header=",".join(columns), comments="")


def write_case(folder: Path, arrays: Arrays | None, run: Arrays | None = None, **more: Any) -> Path:
    """A result folder's evidence in a wide hall; without `arrays` no stops.npz. result.json is not written.

    Where nothing is near, what lies between rows is proven with few samples.
    """
    (folder / evidence.TRAJECTORIES).mkdir(parents=True)
    wide = {"world": {"boundary": [[-60, -98], [100, -98], [100, 102], [-60, 102]]}}
    scenario = changes(**{**wide, **more})
    (folder / evidence.SCENARIO).write_bytes(scenario_bytes(**scenario))
    motion = plan(**scenario)
    rows = np.column_stack([getattr(motion, name) for name in COLUMNS])
    for name in (f"{evidence.TRAJECTORIES}/refined.csv", evidence.EXECUTED):
        header = ",".join(COLUMNS)
        np.savetxt(folder / name, rows, fmt="%.17g", delimiter=",", header=header, comments="")
    write_run(folder, run_columns() if run is None else run)
    if arrays is not None:
        (folder / evidence.STOPS).write_bytes(packed(arrays))
    return folder


def write_claims(folder: Path, change: Callable[[dict[str, Any]], None] = lambda _result: None) -> None:
    """A result.json that says what the judge finds, then changed, with a manifest that fits."""
    (folder / evidence.REPORT).write_text("<html></html>")
    result = {"schema": evidence.SCHEMA, **json.loads(json.dumps(judge(folder).as_result()))}
    change(result)
    result["files"] = evidence.manifest(folder)
    (folder / evidence.RESULT).write_text(json.dumps(result))


@cache
def question(text: str = "{}") -> Question:
    return read_question(scenario_bytes(**changes(**json.loads(text))))


@cache
def record() -> Record:
    return record_from_columns(run_columns())


def judged(arrays: Arrays, run: Record | None = None, **changes: Any) -> Stops:
    asked = question(json.dumps(changes))
    columns = {key: value for key, value in arrays.items() if key not in ("schema", "model")}
    file = StopsFile(model=str(arrays["model"]), **columns)
    setting = asked.setting
    planned = LENGTH / SPEED
    where = (setting.surroundings, asked.drive, setting.limits, setting.zone_of("refined"))
    return judge_stops(file, run or record(), planned, *where)


def figures(arrays: Arrays, run: Record | None = None, **changes: Any) -> dict[str, Any]:
    found = judged(arrays, run, **changes)
    assert found.refused == ()
    assert found.figures is not None
    return found.figures


def refusal(arrays: Arrays, run: Record | None = None, **changes: Any) -> str:
    found = judged(arrays, run, **changes)
    assert (found.figures, found.bad) == (None, None)
    check = stops_check(question(json.dumps(changes)).drive, found, 1e9)  # no limit makes up for evidence
    assert check.status == "failed"
    assert check.message == "no evidence: " + "; ".join(found.refused)
    return check.message
