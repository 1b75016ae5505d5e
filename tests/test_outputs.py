"""The command line with a baseline, trends and a step's summary: one run, told in many ways."""

from __future__ import annotations

import errno
import json
from collections.abc import Iterator
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from judged import scenario_bytes

from verify import batch, outputs, pipeline, recheck
from verify.__main__ import main
from verify.attempt import Attempt, attempt
from verify.exit_codes import UNFINISHED
from verify.metrics import metrics
from vnav_drake.scenario import load_scenario

NAME = "yard"


@dataclass(frozen=True)
class Done:
    file: Path
    attempt: Attempt


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Done]:
    """One quick run of a straight corridor, without report."""
    folder = tmp_path_factory.mktemp("outputs")
    (folder / "out").mkdir()
    file = folder / "yard.yaml"
    file.write_bytes(scenario_bytes(name=NAME, plan={"effort": "quick"}, simulation={"stops": 0}))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pipeline, "write_report", lambda report, **_: report.write_text("not drawn"))
        patch.setattr(pipeline, "show_replay", lambda *_: None)
        yield Done(file, attempt(load_scenario(file), folder / "out", {}, lambda _: None, 1))


@pytest.fixture
def verify(done: Done, monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    """`verify FILE ...`, where the run is at hand; `of` changes what it gave."""

    def command(*arguments: str, of: Attempt = done.attempt, files: tuple[Path, ...] = (done.file,)) -> int:
        monkeypatch.setattr(batch, "attempts", lambda scenarios, *_, **__: (of for _ in scenarios))
        return main([*map(str, files), "--out", str(tmp_path / "out"), *arguments])

    return command


def slower(of: Attempt, factor: float) -> Attempt:
    """The same with another travel time of the refined plan."""
    result: dict[str, Any] = deepcopy(dict(of.outcome.result))
    result["plans"]["refined"]["travel_time"] *= factor
    return replace(of, outcome=replace(of.outcome, result=result))


@pytest.fixture
def stored(verify, tmp_path: Path) -> Path:
    file = tmp_path / "baseline.json"
    assert verify("--baseline", str(file), "--update-baseline") == 0
    return file


def test_a_run_passes_beside_its_own_baseline(verify, stored: Path, capsys):
    capsys.readouterr()
    assert verify("--baseline", str(stored)) == 0
    assert len(capsys.readouterr().out.splitlines()) == 1


def test_what_is_worse_exits_1_and_is_told_everywhere(verify, done, stored, tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(tmp_path / "summary.md"))
    junit = tmp_path / "j.xml"
    capsys.readouterr()
    # Ten times the tolerance of 0.1 %.
    code = verify("--baseline", str(stored), "--junit", str(junit), "--quiet", of=slower(done.attempt, 1.01))
    assert code == 1
    lines = capsys.readouterr().out.splitlines()
    assert "  baseline fails (1 figure)  " in lines[0]
    assert lines[1].startswith(
        "  baseline travel_time.refined: worse: 17.494 s, was 17.321 s, allowed 17.338 s"
    )
    failed = [
        case.get("name")
        for case in ElementTree.parse(junit).iter("testcase")
        if case.find("failure") is not None
    ]
    assert failed == ["baseline_travel_times"]
    assert r"**baseline\_travel\_times**" in (tmp_path / "summary.md").read_text()


def test_what_is_better_is_told_and_passes(verify, done, stored, capsys):
    capsys.readouterr()
    assert verify("--baseline", str(stored), of=slower(done.attempt, 0.99)) == 0
    assert ": better: " in capsys.readouterr().out
    assert verify("--baseline", str(stored), "--quiet", of=slower(done.attempt, 0.99)) == 0
    assert capsys.readouterr().out == ""


def test_an_update_tells_what_it_changes_and_stores_it(verify, done, stored, capsys):
    capsys.readouterr()
    worse = slower(done.attempt, 1.01)
    assert verify("--baseline", str(stored), "--update-baseline", of=worse) == 0
    said = capsys.readouterr().out
    assert "baseline travel_time.refined: worse: 17.494 s, was 17.321 s" in said
    assert f"baseline {stored}: stored {NAME}" in said
    assert verify("--baseline", str(stored), of=worse) == 0
    capsys.readouterr()
    assert verify("--baseline", str(stored), "--update-baseline", "--quiet") == 0
    assert ": better: " not in capsys.readouterr().out


def test_stored_are_all_figures_of_the_run(done, stored):
    figures = json.loads(stored.read_text())["scenarios"][NAME]["metrics"]
    assert set(figures) == {metric.name for metric in metrics(done.attempt.outcome.result)}
    # 30 m at the speed V = sqrt(2 a_b (2 - 0.5) m) of the centre line, with a_b = 1 m/s^2: sqrt(300) s, of
    # which the executed profile may be slower by 1e-5.
    assert figures["travel_time.refined"] == pytest.approx(300.0**0.5, rel=1e-5)


@pytest.mark.parametrize("how", ["unfinished", "nothing", "verdict", "gate"])
def test_a_run_that_did_not_pass_is_never_stored(verify, done, stored, capsys, how):
    outcome, before = done.attempt.outcome, stored.read_bytes()
    if how == "unfinished":
        missing = pipeline.Missing(stage="refined", reason="out of iterations")
        of = replace(done.attempt, exit_code=3, outcome=replace(outcome, missing=(missing,)))
    elif how == "nothing":
        of = Attempt(name=NAME, exit_code=UNFINISHED, error="yard: out of memory")
    elif how == "verdict":
        judged = replace(outcome.judgement, verdict="failed", reasons=("no",))
        of = replace(done.attempt, exit_code=1, outcome=replace(outcome, judgement=judged))
    else:
        gates = tuple(replace(gate, limit=-1.0) for gate in outcome.judgement.gates)
        judged = replace(outcome.judgement, gates=gates)
        of = replace(done.attempt, exit_code=1, outcome=replace(outcome, judgement=judged))
    assert verify("--baseline", str(stored), "--update-baseline", of=of) == of.exit_code
    assert f"not stored, as it did not pass: {NAME}" in capsys.readouterr().out
    assert stored.read_bytes() == before


def test_a_scenario_nobody_stored_and_a_changed_one_fail_with_the_remedy(
    verify, done, stored, tmp_path, capsys
):
    content = json.loads(stored.read_text())
    changed = tmp_path / "changed.yaml"
    changed.write_bytes(scenario_bytes(name=NAME, plan={"effort": "quick"}, simulation={"stops": 1}))
    assert verify("--baseline", str(stored), files=(changed,)) == 1
    assert "answers another question" in capsys.readouterr().out
    content["scenarios"] = {"other": content["scenarios"][NAME]}
    stored.write_text(json.dumps(content))
    assert verify("--baseline", str(stored)) == 1
    said = capsys.readouterr().out
    assert f"--baseline {stored} --update-baseline stores a run" in said
    assert f"baseline {stored}: not run: other" in said


def test_a_bad_baseline_is_an_error_in_junit(verify, tmp_path):
    (tmp_path / "bad.json").write_text("{}")
    junit = tmp_path / "j.xml"
    assert verify("--baseline", str(tmp_path / "bad.json"), "--junit", str(junit)) == 2
    (case,) = ElementTree.parse(junit).iter("testcase")
    (error,) = case.iter("error")
    assert error.get("type") == "bad_input"
    assert error.get("message") == f"{tmp_path / 'bad.json'}: schema is missing; expected 1"


def test_a_bad_baseline_exits_2_before_anything_runs(verify, tmp_path, capsys):
    def never() -> Attempt:
        raise AssertionError

    (tmp_path / "trend" / "smaller-is-better.json").mkdir(parents=True)
    bad = tmp_path / "bad.json"
    bad.write_text('{"schema": 1, "tolerances": {"gap": {"absolute": -1}}}')
    for arguments, words in (
        (["--baseline", str(bad)], "tolerances.gap.absolute = -1"),
        (["--baseline", str(bad), "--update-baseline"], "tolerances.gap.absolute = -1"),
        (["--baseline", str(tmp_path / "absent.json")], "--update-baseline writes it"),
        (["--baseline", str(tmp_path / "no/b.json"), "--update-baseline"], "its folder does not exist"),
        (["--junit", str(tmp_path)], "is a folder"),
        (["--junit", "/proc/j.xml"], "/proc/j.xml: no file can be made in its folder"),
        (["--baseline", "/proc/b.json", "--update-baseline"], "/proc/b.json: no file can be made"),
        (["--trend", str(tmp_path / "trend")], "smaller-is-better.json: is a folder"),
        (["--trend", str(bad / "charts")], "cannot be used for output"),
    ):
        assert verify(*arguments, of=never) == 2
        assert words in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_an_update_without_a_file_is_a_usage_error(verify, capsys):
    with pytest.raises(SystemExit) as ended:
        verify("--update-baseline")
    assert ended.value.code == 2
    assert "--update-baseline needs --baseline FILE" in capsys.readouterr().err


def test_a_summary_that_cannot_be_written_changes_no_exit_code(verify, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(tmp_path / "absent/summary.md"))
    assert verify() == 0
    assert "the summary cannot be written" in capsys.readouterr().err


def test_bad_input_stands_in_the_summary_too(verify, done, tmp_path, monkeypatch):
    summary = tmp_path / "summary.md"
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(summary))
    bad = tmp_path / "bad.yaml"
    bad.write_text("schema: 1\n")
    assert verify(files=(done.file, bad)) == 2
    assert "### verify: 1 of 2 scenarios passed" in summary.read_text()
    assert "bad.yaml" in summary.read_text()
    assert "**bad input**" in summary.read_text()


def test_what_cannot_be_written_keeps_nothing_else_from_it(
    verify, done, stored, tmp_path, capsys, monkeypatch
):
    """The disk is full for the JUnit file, and somebody breaks the baseline during the run."""

    def full(*_: object) -> None:
        stored.write_text("{")
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(outputs, "write_junit", full)
    junit, charts = tmp_path / "j.xml", tmp_path / "charts"
    update = ("--baseline", str(stored), "--update-baseline")
    capsys.readouterr()
    assert verify("--junit", str(junit), "--trend", str(charts), *update) == UNFINISHED
    told = capsys.readouterr().err.splitlines()
    assert told[0] == f"verify: {junit}: cannot be written: No space left on device"
    assert told[1].startswith(f"verify: {stored}: not the JSON")
    assert len(list(charts.iterdir())) == 2
    assert stored.read_text() == "{"
    assert not junit.exists()


def test_trends_of_a_run(verify, tmp_path):
    assert verify("--trend", str(tmp_path / "new" / "charts")) == 0
    (bound,) = [
        entry
        for entry in json.loads((tmp_path / "new/charts/bigger-is-better.json").read_text())
        if entry["name"] == f"{NAME}: lower_bound"
    ]
    assert 0.0 < bound["value"] <= 300.0**0.5  # a lower bound of sqrt(300) s, see above


def test_a_finished_folder_beside_a_baseline(done, stored, capsys, monkeypatch):
    monkeypatch.setattr(recheck, "examine", cache(recheck.examine))  # the same evidence each time
    folder = str(done.file.parent / "out" / NAME)
    assert main(["check", folder, "--baseline", str(stored)]) == 0
    content = json.loads(stored.read_text())
    content["scenarios"][NAME]["metrics"]["travel_time.refined"] /= 1.01
    stored.write_text(json.dumps(content))
    capsys.readouterr()
    assert main(["check", folder, "--baseline", str(stored), "--quiet"]) == 1
    assert "baseline travel_time.refined: worse: 17.321 s, was 17.149 s" in capsys.readouterr().out
    stored.write_text("{}")
    assert main(["check", folder, "--baseline", str(stored)]) == 2
    assert "schema is missing" in capsys.readouterr().err
