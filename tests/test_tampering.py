"""`verify check` on folders somebody has edited: with the manifest as it was, and made anew to fit."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from result_folder import copy_to, outcome

from verify import evidence
from verify.__main__ import main
from verify.judge import judge
from verify.recheck import recheck

REFINED = "trajectories/refined.csv"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return copy_to(tmp_path)


def rows_of(folder: Path, name: str) -> tuple[str, np.ndarray]:
    text = (folder / name).read_text()
    header, _, _ = text.partition("\n")
    return header, np.loadtxt((folder / name), delimiter=",", skiprows=1)


def write_rows(folder: Path, name: str, header: str, rows: np.ndarray) -> None:
    np.savetxt(folder / name, rows, fmt="%.17g", delimiter=",", header=header, comments="")


def edit_motion(folder: Path, change: Callable[[np.ndarray], np.ndarray]) -> None:
    """Change the refined plan, and trajectory.csv with it."""
    header, rows = rows_of(folder, REFINED)
    write_rows(folder, REFINED, header, change(rows))
    shutil.copy(folder / REFINED, folder / evidence.EXECUTED)


def edit_result(folder: Path, change: Callable[[dict[str, Any]], None]) -> None:
    file = folder / evidence.RESULT
    result = json.loads(file.read_text())
    change(result)
    file.write_text(json.dumps(result))


def regenerate(folder: Path, *, honest: bool) -> None:
    """Fit the manifest and the figures to the edited files; `honest` takes over the judge's findings too."""
    found = judge(folder).as_result()

    def change(result: dict[str, Any]) -> None:
        for name, plan in found["plans"].items():
            keys = plan if honest else ("travel_time", "length")
            result["plans"][name] |= {key: plan[key] for key in keys}
        result |= found if honest else {"gaps": found["gaps"]}
        result["files"] = evidence.manifest(folder)

    edit_result(folder, change)


def check(folder: Path, capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    code = main(["check", str(folder)])
    return code, capsys.readouterr().out


def test_the_result_as_written_is_believed_and_passed(folder, capsys):
    code, text = check(folder, capsys)
    assert code == 0
    assert text.startswith("around_a_point: refined")
    assert recheck(folder).reasons == ()


def move_point(rows: np.ndarray) -> np.ndarray:
    rows[len(rows) // 2, 2] += 0.3
    return rows


def edit_time(rows: np.ndarray) -> np.ndarray:
    rows[len(rows) // 2 :, 0] -= 0.05  # the rest of the motion 50 ms earlier
    return rows


def raise_speed(rows: np.ndarray) -> np.ndarray:
    rows[len(rows) // 2, 4] += 0.05
    return rows


def run_faster(rows: np.ndarray) -> np.ndarray:
    """The same path in 90 % of the time, with every column consistent."""
    rows[:, 0] *= 0.9
    rows[:, 4] /= 0.9
    rows[:, 5] /= 0.81
    return rows


def remove_row(rows: np.ndarray) -> np.ndarray:
    """A row where curvature and acceleration both change, so that the motion changes with it."""
    changes = np.abs(np.diff(rows[:-1, 5])) + np.abs(np.diff(rows[:-1, 6]))
    return np.delete(rows, int(np.argmax(changes)) + 1, axis=0)


def teleport(rows: np.ndarray) -> np.ndarray:
    """The middle third of the motion left out, the clock closed up."""
    first, last = len(rows) // 3, 2 * len(rows) // 3
    rows[last:, 0] -= rows[last, 0] - rows[first, 0]
    return np.concatenate([rows[: first + 1], rows[last:]])


def stop_short(rows: np.ndarray) -> np.ndarray:
    return rows[: len(rows) // 2]


EDITS = {
    "point moved": (move_point, "travel_time"),
    "time edited": (edit_time, "travel_time"),
    "speed raised": (raise_speed, "travel_time"),
    "run faster": (run_faster, "braking_distance"),
    "row removed": (remove_row, "travel_time"),
    "teleported": (teleport, "travel_time"),
    "stopped short": (stop_short, "goal"),
}


@pytest.mark.parametrize("edit", EDITS)
def test_an_edited_motion_is_refused_by_its_hash(folder, capsys, edit):
    edit_motion(folder, EDITS[edit][0])
    code, text = check(folder, capsys)
    assert code == 1
    assert "refused" in text
    assert f"{REFINED}: changed since it was written" in text


@pytest.mark.parametrize("edit", EDITS)
def test_an_edited_motion_with_a_fitting_manifest_is_refused_by_physics(folder, capsys, edit):
    change, broken = EDITS[edit]
    edit_motion(folder, change)
    regenerate(folder, honest=False)
    code, text = check(folder, capsys)
    assert code == 1
    assert "refused" in text
    assert "changed since" not in text  # the manifest fits: the physics does not
    assert f"checks[{broken} of refined]" in text


@pytest.mark.parametrize("edit", EDITS)
def test_an_edited_motion_with_everything_fitting_is_a_failed_one(folder, capsys, edit):
    change, broken = EDITS[edit]
    edit_motion(folder, change)
    regenerate(folder, honest=True)
    code, text = check(folder, capsys)
    assert code == 1
    assert text.startswith("around_a_point: failed")
    assert f"check {broken} (refined)" in text


def set_at(*path: Any, to: Any) -> Callable[[dict[str, Any]], None]:
    def change(result: dict[str, Any]) -> None:
        inner: Any = result
        for key in path[:-1]:
            inner = inner[key]
        inner[path[-1]] = to(inner[path[-1]]) if callable(to) else to

    return change


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (set_at("plans", "refined", "travel_time", to=lambda t: t * (1 - 1e-6)), "plans.refined.travel_time"),
        (set_at("plans", "collocation", "length", to=1.0), "plans.collocation.length"),
        (set_at("gaps", "refinement", to=0.0), "gaps.refinement"),
        (set_at("gaps", "certified", to=0.0), "gaps.certified"),
        (set_at("gates", 3, "value", to=lambda v: v + 1e-7), "gates[constraint_violation].value"),
        (set_at("gates", 2, "passed", to=False), "gates[certified_gap].passed"),
        (set_at("lower_bound", "travel_time", to=lambda t: t * (1 + 1e-6)), "lower_bound.travel_time"),
        (set_at("lower_bound", to={}), "lower_bound.travel_time"),
        (set_at("gates", to=lambda g: g[:-1]), "gates"),
        (set_at("verdict", to="certified"), "verdict"),
        (set_at("checks", 0, "status", to="failed"), "checks[boundary of voronoi_route].status"),
        (set_at("scenario_sha256", to="0" * 64), "scenario_sha256"),
        (set_at("simulation", "max_tracking_error", to=0.0), "simulation.max_tracking_error"),
        (set_at("files", to={}), "not listed in result.json"),
        (set_at("files", to=None), "no manifest"),
        (set_at("plans", to="none"), "plans"),
        (set_at("gate_overrides", to={"refinement_gap": "x"}), "gate_overrides.refinement_gap"),
        (set_at("gate_overrides", to={"refinement_gap": 0.9}), "gates[refinement_gap].limit"),
        (set_at("schema", to=2), "not a result of schema 1"),
    ],
)
def test_every_edit_of_the_result_is_refused(folder, capsys, change, reason):
    edit_result(folder, change)
    code, text = check(folder, capsys)
    assert code == 1
    assert "refused" in text
    assert reason in text


def widen(folder: Path, **limits: float) -> None:
    """Gate limits as if the result had been made with `--gate`, and everything in the file to fit."""
    found = judge(folder, limits).as_result()

    def change(result: dict[str, Any]) -> None:
        result |= {key: found[key] for key in ("verdict", "reasons", "gates")}
        result["gate_overrides"] = limits

    edit_result(folder, change)


def tighten_scenario(folder: Path, limit: float) -> None:
    """The scenario asks for a refinement gap that the result does not keep."""
    file = folder / evidence.SCENARIO
    file.write_text(file.read_text().replace("refinement_gap: 0.5", f"refinement_gap: {limit}"))
    regenerate(folder, honest=True)


def test_a_wide_limit_in_the_result_excuses_nothing(folder, capsys):
    tighten_scenario(folder, 1e-4)
    assert check(folder, capsys)[0] == 1
    widen(folder, refinement_gap=1e300)
    code, text = check(folder, capsys)
    assert code == 1
    assert "refused" not in text  # it says what it is
    assert "the result was made with other gate limits: refinement_gap 1e+300 instead of 0.0001" in text
    assert "gate refinement_gap: fails" in text


def test_a_limit_given_for_the_check_itself_counts_and_is_said(folder, capsys):
    tighten_scenario(folder, 1e-4)
    code = main(["check", str(folder), "--gate", "refinement_gap=0.5"])
    text = capsys.readouterr().out
    assert code == 0
    assert (
        "(gates overridden on the command line: refinement_gap 0.5 instead of 0.0001)" in text.splitlines()[0]
    )
    assert main(["check", str(folder), "--gate", "refinement_gap=0.5", "--quiet"]) == 0
    assert capsys.readouterr().out == ""
    assert main(["check", str(folder), "--gate", "braking_margin=0.5"]) == 1  # another gate is no excuse


def test_a_stricter_limit_with_which_the_result_was_made_still_counts(folder, capsys):
    widen(folder, refinement_gap=1e-4)
    code, text = check(folder, capsys)
    assert code == 1
    assert text.count("gate refinement_gap: fails") == 1
    assert main(["check", str(folder), "--gate", "refinement_gap=0.5"]) == 0


@pytest.mark.parametrize("limit", [-1e9, -0.001, True, None, 10**400, "0.5", [0.5]])
def test_limits_that_no_command_line_takes_are_refused(folder, capsys, limit):
    edit_result(folder, set_at("gate_overrides", to={"braking_margin": limit}))
    code, text = check(folder, capsys)
    assert code == 1
    assert "gate_overrides.braking_margin = " in text
    assert "at least 0" in text


def test_numbers_beyond_all_floats_are_refused(folder, capsys):
    edit_result(folder, set_at("gaps", "refinement", to=10**400))
    code, text = check(folder, capsys)
    assert code == 1
    assert "gaps.refinement" in text


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("friction: 0.6", "friction: 0.1", "more than friction allows"),
        ("wheelbase: 0.5", "wheelbase: 0.9", "the wheels stand outside the disc"),
        ("com_height: 0.12", "com_height: 9.0", "lifts an axle"),
        ("radius: 0.4", "radius: -1.0", "robot.radius = -1.0"),
        ("schema: 1", "schema: 2", "schema = 2"),
    ],
)
def test_a_scenario_that_makes_the_checks_meaningless_is_refused(folder, capsys, old, new, reason):
    file = folder / evidence.SCENARIO
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))
    edit_result(folder, lambda result: result.update(files=evidence.manifest(folder)))
    code, printed = check(folder, capsys)
    assert code == 1
    assert "refused" in printed
    assert reason in printed


def test_an_edited_scenario_is_refused(folder, capsys):
    file = folder / evidence.SCENARIO
    file.write_text(file.read_text().replace("max_braking: 1.0", "max_braking: 2.0"))
    code, text = check(folder, capsys)
    assert code == 1
    assert "scenario.yaml: changed since it was written" in text
    assert "scenario_sha256" in text


@pytest.mark.parametrize(
    "name",
    [
        "scenario.yaml",
        "trajectory.csv",
        REFINED,
        "trajectories/collocation.csv",
        "simulation.csv",
        "stops.npz",
        "certificate.npz",
        "report.html",
    ],
)
def test_a_missing_file_is_refused(folder, capsys, name):
    (folder / name).unlink()
    code, text = check(folder, capsys)
    assert code == 1
    assert f"{name}: missing" in text


@pytest.mark.parametrize("name", ["trajectory.csv", REFINED, "simulation.csv"])
def test_a_truncated_file_is_refused(folder, capsys, name):
    data = (folder / name).read_bytes()
    (folder / name).write_bytes(data[: len(data) // 2])
    code, text = check(folder, capsys)
    assert code == 1
    assert f"{name}: changed since" in text
    assert f"{name}: truncated" in text or f"{name}: differs from every plan" in text


@pytest.mark.parametrize("name", [evidence.CERTIFICATE, evidence.STOPS])
def test_a_truncated_archive_is_refused(folder, capsys, name):
    data = (folder / name).read_bytes()
    (folder / name).write_bytes(data[: len(data) // 2])
    code, text = check(folder, capsys)
    assert code == 1
    assert f"{name}: changed since" in text
    assert text.count(f"{name}: ") == 2  # and what is wrong with it


def edit_stops(folder: Path, change: Callable[[dict[str, np.ndarray]], None]) -> None:
    with np.load(folder / evidence.STOPS) as archive:
        arrays = dict(archive)
    change(arrays)
    np.savez_compressed(folder / evidence.STOPS, **arrays)


def delete_last_stop(arrays: dict[str, np.ndarray]) -> None:
    kept = arrays["first"][-2]
    arrays |= {key: arrays[key][:-1] for key in ("instant", "straightened", "first")}
    arrays |= {key: arrays[key][:kept] for key in arrays if len(np.atleast_1d(arrays[key])) > kept}


def move_row(arrays: dict[str, np.ndarray]) -> None:
    """A row in the middle of the stop that drives longest, 0.2 m aside."""
    longest = int(np.argmax(np.diff(arrays["first"])))
    arrays["y"][arrays["first"][longest : longest + 2].sum() // 2] += 0.2


def lower_first_speed(arrays: dict[str, np.ndarray]) -> None:
    fastest = arrays["first"][:-1][np.argmax(arrays["v"][arrays["first"][:-1]])]
    arrays["v"][fastest] *= 0.8


def crowd(arrays: dict[str, np.ndarray]) -> None:
    arrays["instant"] *= 0.5


def rename_model(arrays: dict[str, np.ndarray]) -> None:
    arrays["model"] = np.array("single_track" if arrays["model"] == "four_wheel" else "four_wheel")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (delete_last_stop, "stops, where 2 at each of"),
        (move_row, "a jump that its speed does not explain"),
        (lower_first_speed, "off the run's speed"),
        (crowd, "no stop from"),
        (rename_model, "was to be stopped"),
    ],
)
def test_edited_stops_are_no_evidence(folder, capsys, change, words):
    edit_stops(folder, change)
    code, text = check(folder, capsys)
    assert code == 1
    assert "stops.npz: changed since it was written" in text
    assert "checks[emergency_stops of simulation].status: is 'passed', recomputed 'failed'" in text
    regenerate(folder, honest=True)
    edit_result(folder, lambda result: result["simulation"].pop("emergency_stops", None))
    code, text = check(folder, capsys)
    assert code == 1
    assert text.startswith("around_a_point: failed")
    assert words in text


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "the columns are"),
        (b"t,x\n1,2\n", "the columns are"),
        (b"\xff\xfe", "not a text file"),
        (b"t,x,y,heading,v,a,curvature,clearance\n", "truncated"),
        (b"t,x,y,heading,v,a,curvature,clearance\n\n\n", "no rows"),
        (b"t,x,y,heading,v,a,curvature,clearance\n1,2,3\n", "values a row"),
        (b"t,x,y,heading,v,a,curvature,clearance\n0,0,0,0,0,0,0,0\n0,0,0,0,0,0,0,nan\n", "not finite"),
        (b"t,x,y,heading,v,a,curvature,clearance\n0,0,0,0,0,0,0,0\n0,0,0,0,0,0,0,1e999\n", "not finite"),
        (b"t,x,y,heading,v,a,curvature,clearance\n0,0,0,0,0,0,0,0\n0,0,0,0,0,0,0,1e300\n", "absurd"),
        (b"t,x,y,heading,v,a,curvature,clearance\n0,0,0,0,0,0,0,0\n0,0,0,0,0,0,0\n", "malformed"),
        (b"t,x,y,heading,v,a,curvature,clearance\n0,0,0,0,0,0,0,<b>\n0,0,0,0,0,0,0,0\n", "malformed"),
        (b"t,x,y,heading,v,a,curvature,clearance\n0,0,0,0,0,0,0,0\n", "fewer than two rows"),
    ],
)
def test_malformed_tables_are_refused_without_a_trace(folder, capsys, content, reason):
    (folder / REFINED).write_bytes(content)
    code, text = check(folder, capsys)
    assert code == 1
    assert f"{REFINED}: " in text
    assert reason in text


@pytest.mark.parametrize(
    "content", [b"", b"{", b"[]", b"\xff", b'{"schema": 1}', b'{"schema": 1, "a": NaN}', b"[" * 100_000]
)
def test_a_malformed_result_is_refused(folder, capsys, content):
    (folder / evidence.RESULT).write_bytes(content)
    code, text = check(folder, capsys)
    assert code == 1
    assert "result.json: " in text


def test_infinite_numbers_in_the_result_are_refused(folder, capsys):
    file = folder / evidence.RESULT
    file.write_text(file.read_text().replace('"end_cost": ', '"end_cost": 1e999, "was": '))
    code, text = check(folder, capsys)
    assert code == 1
    assert "not a finite number" in text


def test_an_executed_trajectory_that_is_no_plan_is_refused(folder, capsys):
    header, rows = rows_of(folder, evidence.EXECUTED)
    write_rows(folder, evidence.EXECUTED, header, move_point(rows))
    edit_result(folder, lambda result: result.update(files=evidence.manifest(folder)))
    code, text = check(folder, capsys)
    assert code == 1
    assert "trajectory.csv: differs from every plan" in text


def test_executing_another_plan_than_the_refined_one_is_refused(folder, capsys):
    shutil.copy(folder / "trajectories/collocation.csv", folder / evidence.EXECUTED)
    edit_result(folder, lambda result: result.update(files=evidence.manifest(folder)))
    code, text = check(folder, capsys)
    assert code == 1
    assert "executed: is 'refined', recomputed 'collocation'" in text


def test_an_unlisted_trajectory_is_refused(folder, capsys):
    shutil.copy(folder / REFINED, folder / "trajectories/better.csv")
    code, text = check(folder, capsys)
    assert code == 1
    assert "trajectories/better.csv: not listed in result.json" in text
    assert "trajectories/better.csv: not a plan known here" in text


def test_a_link_out_of_the_folder_is_no_evidence(folder, capsys):
    outside = folder.parent / "elsewhere.csv"
    shutil.move(folder / REFINED, outside)
    (folder / REFINED).symlink_to(outside)
    code, text = check(folder, capsys)
    assert code == 1
    assert f"{REFINED}: missing" in text


def test_other_files_in_the_folder_are_nobody_s_business(folder, capsys):
    (folder / "notes.txt").write_text("mine")
    assert check(folder, capsys)[0] == 0


@pytest.mark.parametrize("place", ["nowhere", "empty", "file"])
def test_what_is_no_result_folder_is_bad_input(tmp_path, capsys, place):
    (tmp_path / "empty").mkdir()
    (tmp_path / "file").write_text("x")
    assert main(["check", str(tmp_path / place)]) == 2
    assert "not a result folder" in capsys.readouterr().err


def test_the_fixture_folder_is_untouched():
    assert recheck(outcome().report.parent).reasons == ()
