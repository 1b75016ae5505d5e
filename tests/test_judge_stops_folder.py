"""Emergency stops as part of a result folder: gate, check, verdict, and what is refused of an edited one."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stops_case as case

from verify import evidence
from verify.__main__ import main
from verify.evidence import EvidenceError
from verify.judge import Gate, Judgement, decide, examine, judge
from verify.judge.tracking import WHEEL_COLUMNS
from verify.recheck import recheck
from verify.report.evidence import read_evidence
from verify.summary import failures, headline

COUNT = 2 * case.INSTANTS
TILTED = np.radians(40.0)  # of a vehicle that falls


def fallen(stops: int) -> case.Arrays:
    """The first stops fall."""
    arrays = case.stop_arrays()
    for stop in range(stops):
        arrays = case.edited(arrays, "tilt", stop, lambda tilt: tilt + TILTED)
    return arrays


def gate(judgement: Judgement) -> Gate:
    return next(found for found in judgement.gates if found.name == "emergency_stops")


def status(judgement: Judgement, name: str = "emergency_stops", trajectory: str = "simulation") -> str:
    return next(c.status for c in judgement.checks if (c.name, c.trajectory) == (name, trajectory))


def test_good_stops_hold_the_gate_and_the_verdict(tmp_path):
    found = judge(case.write_case(tmp_path / "hall", case.stop_arrays()))
    assert (found.verdict, status(found), gate(found).value, gate(found).passed) == (
        "refined",
        "passed",
        0.0,
        True,
    )
    assert found.passed
    # the last stop ends at x = 35.5 m, 64.5 m from the wall x = 100 m
    assert headline(found).endswith(f"{COUNT} stops, least clearance 64.000 m")
    assert found.simulation is not None
    assert found.simulation["model"] == "four_wheel"
    assert found.simulation["emergency_stops"]["tried"] == COUNT


def test_bad_stops_fail_by_the_limit_in_force(tmp_path):
    findings = examine(case.write_case(tmp_path / "hall", fallen(3), gates={"emergency_stops": 2}))
    for overrides, holds in (
        ({}, False),
        ({"emergency_stops": 3.0}, True),
        ({"emergency_stops": 0.0}, False),
    ):
        found = decide(findings, overrides)
        assert (gate(found).value, gate(found).passed) == (3.0, holds)
        assert status(found) == ("passed" if holds else "failed")
        assert found.verdict == ("refined" if holds else "failed")
        assert found.passed is holds
    assert headline(found).count(f"3 of {COUNT} stops fall") == 1
    assert failures(found)[0].startswith("gate emergency_stops: fails, value 3, limit 0")
    assert f"check emergency_stops (simulation): 3 of {COUNT} stops fall" in failures(found)


def test_different_ends_are_counted_one_by_one(tmp_path):
    # Instant 10 is at x = 5 + 300 / 19 = 20.79 m: its two stops pass a point 0.4 m beside the line at 21.2 m.
    # One of them falls, too, and another one.
    pillar = {"vertices": [[21.2, 2.4]]}
    hall = {"world": {"boundary": [[-60, -98], [100, -98], [100, 102], [-60, 102]], "obstacles": [pillar]}}
    arrays = case.edited(case.stop_arrays(), "tilt", 21, lambda tilt: tilt + TILTED)
    arrays = case.edited(arrays, "tilt", 0, lambda tilt: tilt + TILTED)
    findings = examine(case.write_case(tmp_path / "hall", arrays, **hall))
    assert f"3 of {COUNT} stops end badly (2 collide, 2 fall)" in headline(decide(findings, {}))


def test_without_stops_there_is_no_verdict_where_they_are_asked_for(tmp_path):
    found = judge(case.write_case(tmp_path / "hall", None))
    assert found.verdict == "failed"
    assert found.reasons == ("emergency_stops: no emergency stops were recorded",)
    assert (gate(found).passed, status(found)) == (None, "not_evaluated")
    assert gate(found).reason == "not evaluated: no emergency stops were recorded"


@pytest.mark.parametrize("named", [False, True])
def test_stops_that_nobody_asks_for_hold_back_nothing(tmp_path, named):
    gates = {"emergency_stops": 0} if named else {}
    found = judge(case.write_case(tmp_path / "hall", None, simulation={"stops": 0}, gates=gates))
    assert (found.verdict, gate(found).passed, status(found)) == ("refined", None, "not_evaluated")
    assert [unmet.name for unmet in found.unfinished_gates] == (["emergency_stops"] if named else [])
    assert found.simulation is not None
    assert "emergency_stops" not in found.simulation


def test_refused_stops_are_no_evidence(tmp_path):
    arrays = {**case.stop_arrays(), "model": np.array("single_track")}
    limits = {"emergency_stops": 100}
    found = judge(case.write_case(tmp_path / "hall", arrays, gates=limits))
    assert (found.verdict, gate(found).passed, status(found)) == ("failed", None, "failed")
    assert gate(found).reason == "not evaluated: the emergency stops are no evidence"
    assert found.unfinished_gates == ()  # the stage did run: what it gave is refused
    assert not found.passed
    assert found.simulation is not None
    assert "emergency_stops" not in found.simulation


def without_wheels() -> case.Arrays:
    return {name: column for name, column in case.run_columns().items() if name not in WHEEL_COLUMNS}


def test_a_single_track_drives_where_it_is_asked_for(tmp_path):
    asked = {"model": "single_track", "stops": case.INSTANTS}
    arrays = case.stop_arrays(model="single_track")
    folder = case.write_case(tmp_path / "hall", arrays, without_wheels(), simulation=asked)
    assert judge(folder).verdict == "refined"
    case.write_run(folder, case.run_columns())
    found = judge(folder)
    assert (found.verdict, status(found, "tracking")) == ("failed", "failed")
    assert "a run of the model four_wheel, where single_track was to drive" in found.reasons[0]


def test_four_wheels_leave_loads_behind(tmp_path):
    folder = case.write_case(tmp_path / "hall", case.stop_arrays(), without_wheels())
    found = judge(folder)
    assert (found.verdict, status(found, "tracking")) == ("failed", "failed")
    assert "a run of the model single_track, where four_wheel was to drive" in found.reasons[0]
    some = {name: column for name, column in case.run_columns().items() if name != "tilt"}
    case.write_run(folder, some)
    with pytest.raises(EvidenceError, match=r"has load_front_left, .*, mode, but not tilt"):
        judge(folder)


def test_both_models_drive_and_both_are_judged(tmp_path):
    folder = case.write_case(
        tmp_path / "hall", case.stop_arrays(), simulation={"model": "both", "stops": case.INSTANTS}
    )
    found = judge(folder)
    assert found.verdict == "failed"
    assert status(found, "tracking", "single_track") == "not_evaluated"
    single = without_wheels()
    case.write_run(folder, single, evidence.SIMULATION_SINGLE_TRACK)
    found = judge(folder)
    assert (found.verdict, status(found, "tracking", "single_track")) == ("refined", "passed")
    assert found.simulation is not None
    assert found.simulation["model"] == "four_wheel"
    assert found.simulation["single_track"]["model"] == "single_track"
    aside = {**single, "y": single["y"] + 0.06}  # 0.05 m is allowed
    case.write_run(folder, aside, evidence.SIMULATION_SINGLE_TRACK)
    found = judge(folder)
    assert (found.verdict, found.passed) == ("failed", False)
    assert status(found, "tracking", "single_track") == "failed"


# ---- an edited folder


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    made = case.write_case(tmp_path / "hall", case.stop_arrays())
    case.write_claims(made)
    return made


def check(folder: Path, capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    code = main(["check", str(folder)])
    return code, capsys.readouterr().out


def test_the_folder_as_written_is_believed(folder, capsys):
    code, text = check(folder, capsys)
    assert code == 0
    assert f"{COUNT} stops, least clearance" in text.splitlines()[0]


def wall_moved_away(arrays: case.Arrays) -> case.Arrays:
    """A row moved 0.2 m aside."""
    return case.edited(arrays, "y", 8, lambda y: y + 0.2 * (np.arange(len(y)) == 30))


EDITS: dict[str, Callable[[case.Arrays], case.Arrays]] = {
    "a row moved": wall_moved_away,
    "first speed lowered": lambda a: case.edited(a, "v", 8, lambda v: np.where(v == 1.0, 0.9, v)),
    "instants crowded": lambda a: {**a, "instant": 0.5 * a["instant"]},
    "model changed": lambda a: {**a, "model": np.array("single_track")},
    "another run's": lambda a: {**a, "y": a["y"] + 0.5},
}


@pytest.mark.parametrize("edit", EDITS)
def test_edited_stops_are_refused_by_hash_and_by_physics(folder, capsys, edit):
    (folder / evidence.STOPS).write_bytes(case.packed(EDITS[edit](case.stop_arrays())))
    code, text = check(folder, capsys)
    assert code == 1
    assert "stops.npz: changed since it was written" in text
    assert "checks[emergency_stops of simulation].status: is 'passed', recomputed 'failed'" in text
    assert "simulation.emergency_stops: claimed, but there is no evidence for it" in text
    case.write_claims(folder)  # everything to fit: now it says itself that it failed
    code, text = check(folder, capsys)
    assert code == 1
    assert text.startswith("hall: failed")
    assert "check emergency_stops (simulation): no evidence: " in text


def test_missing_and_truncated_stops_are_refused(folder, capsys):
    data = (folder / evidence.STOPS).read_bytes()
    (folder / evidence.STOPS).write_bytes(data[: len(data) // 2])
    code, text = check(folder, capsys)
    assert code == 1
    assert "stops.npz: changed since" in text
    assert "stops.npz: truncated" in text
    (folder / evidence.STOPS).unlink()
    code, text = check(folder, capsys)
    assert code == 1
    assert "stops.npz: missing" in text
    assert "simulation.emergency_stops: claimed, but there is no evidence for it" in text


def put(*path: str, to: Any) -> Callable[[dict[str, Any]], None]:
    def change(result: dict[str, Any]) -> None:
        inner = result
        for key in path[:-1]:
            inner = inner[key]
        inner[path[-1]] = to

    return change


STOPS = ("simulation", "emergency_stops")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (put(*STOPS, "tried", to=COUNT + 2), "simulation.emergency_stops.tried"),
        (put(*STOPS, "min_clearance", to=70.0), "simulation.emergency_stops.min_clearance"),
        (put(*STOPS, "held", "slid", to=1), "simulation.emergency_stops.held.slid"),
        (put(*STOPS, "failed", to=[{"stop": 1}]), "simulation.emergency_stops.failed"),
        (put(*STOPS, "proven", to=True), "simulation.emergency_stops.proven: claimed, but not found"),
        (put(*STOPS, to=None), "simulation.emergency_stops: is None"),
        (put("simulation", "model", to="single_track"), "simulation.model"),
        (
            put("simulation", "single_track", to={"travel_time": 30.0}),
            "simulation.single_track: claimed, but there is no evidence for it",
        ),
    ],
)
def test_claims_about_stops_are_compared(folder, change, words):
    case.write_claims(folder, change)
    assert any(words in reason for reason in recheck(folder).reasons)


def test_what_is_taken_on_trust_is_not_compared(folder):
    case.write_claims(folder, put("simulation", "margin", to={"factor": 1.5}))
    assert recheck(folder).reasons == ()


def test_stops_that_nobody_asked_for_are_no_claim(tmp_path):
    folder = case.write_case(tmp_path / "hall", case.stop_arrays(), simulation={"stops": 0})
    case.write_claims(folder, put(*STOPS, to={"tried": COUNT}))
    assert recheck(folder).reasons == (
        "simulation.emergency_stops: claimed, but there is no evidence for it",
    )


def test_a_deleted_stop_with_everything_fitting_fails(folder, capsys):
    less = case.first_stops(case.stop_arrays(), COUNT - 1)
    (folder / evidence.STOPS).write_bytes(case.packed(less))
    case.write_claims(folder)
    code, text = check(folder, capsys)
    assert code == 1
    assert (
        f"no evidence: {COUNT - 1} stops, where 2 at each of {case.INSTANTS} instants were asked for" in text
    )


def test_no_stops_at_all_are_judged_and_fail(folder, capsys):
    (folder / evidence.STOPS).write_bytes(case.packed(case.no_stops()))
    case.write_claims(folder)
    code, text = check(folder, capsys)
    assert code == 1
    assert "check emergency_stops (simulation): no evidence: 0 stops, where 2 at each of" in text


def test_a_vehicle_that_fell_at_once_fails_for_its_fall_and_has_no_stops(tmp_path, capsys):
    run = {name: column[:51].copy() for name, column in case.run_columns().items()}
    run["mode"][-1] = 3.0
    folder = case.write_case(tmp_path / "hall", case.no_stops(), run)
    case.write_claims(folder)
    code, text = check(folder, capsys)
    assert code == 1
    assert "the vehicle fell, at t = 0.500 s" in text
    assert "no evidence: no stop at all: the vehicle fell on its run, 0.500 s after its start" in text


def test_a_report_of_no_stops_says_why(tmp_path):
    (tmp_path / evidence.STOPS).write_bytes(case.packed(case.no_stops()))
    found = read_evidence(tmp_path)
    assert found.stops is None
    assert found.reasons[evidence.STOPS] == "stops.npz holds no stop"
