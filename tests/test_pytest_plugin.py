"""`pytest --verify`: scenario files as tests. The runs here are closed forms."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import ci_case
import pytest
from judged import scenario_bytes
from stops_case import changes

import verify.pytest_session
from verify.cases import NAMES
from verify.judge.gates import GATE_NAMES
from verify.pytest_items import is_scenario
from verify.pytest_record import Record, recorded_once
from vnav_drake.scenario import parse_scenario

pytest_plugins = "pytester"

# In the closed form only a refined trajectory exists: what compares plans has nothing to compare.
EVALUATED = ("constraint_violation", "braking_margin", "emergency_stops", "verdict")
TESTS = str(Path(__file__).parent)


@pytest.fixture
def place(pytester, monkeypatch):
    """A folder with two scenarios and a YAML file that is none."""
    monkeypatch.setattr(verify.pytest_session, "attempt", ci_case.finished)
    monkeypatch.delenv("PYTEST_ADDOPTS", raising=False)
    monkeypatch.delenv("CI", raising=False)  # where it is set, pytest folds nothing
    pytester.makeini("[pytest]\n")  # not that of a folder above
    folder = pytester.path / "scenarios"
    folder.mkdir()
    for name in ("good", "bad"):
        (folder / f"{name}.yaml").write_bytes(scenario_bytes(**changes(name=name)))
    (folder / "other.yml").write_text("schemas: [1]\nnested: {schema: 1}\n")
    return pytester


def verified(place, *arguments, **options):
    return place.runpytest_inprocess("--verify", "-p", "no:cacheprovider", *arguments, **options)


def test_without_the_option_it_loads_nothing_and_collects_nothing(tmp_path):
    (tmp_path / "s.yaml").write_bytes(scenario_bytes())
    code = (
        "import sys, pytest; code = pytest.main(['-q', '-p', 'no:cacheprovider', '.']); "
        "heavy = {'numpy', 'yaml', 'pydantic', 'shapely', 'pydrake', 'verify.judge'}; "
        "print(code, heavy & {*sys.modules}, 'verify.pytest_plugin' in sys.modules)"
    )
    environment = {
        **os.environ,
        "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1",
        "PYTEST_PLUGINS": "verify.pytest_plugin",
    }
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.splitlines()[-1] == "5 set() True"  # 5: no tests were collected


def test_the_package_brings_the_plugin_under_its_name():
    from importlib.metadata import entry_points

    (entry,) = entry_points(group="pytest11", name="vnav-verify")
    assert entry.value == "verify.pytest_plugin"


def test_each_gate_and_the_verdict_is_an_item_of_each_scenario(place):
    result = verified(place, "--collect-only", "-q", "scenarios")
    expected = [f"scenarios/{s}.yaml::{name}" for s in ("bad", "good") for name in (*GATE_NAMES, "verdict")]
    assert [line for line in result.outlines if "::" in line] == expected
    assert result.ret == 0
    assert not (place.path / "reports").exists()  # nothing ran


def test_a_scenario_runs_once_and_what_was_not_evaluated_is_skipped_with_its_reason(place):
    result = verified(place, "scenarios/good.yaml", "-rs")
    result.assert_outcomes(passed=len(EVALUATED), skipped=3)
    assert result.ret == 0
    assert ci_case.runs(place.path / "reports") == ["good"]
    result.stdout.fnmatch_lines(
        [
            "*= verify =*",
            "good: refined  refined 30.000 s *  reports/good/report.html",
            "SKIPPED * scenarios/good.yaml:1: not evaluated: no lower bound was computed",
        ]
    )


def test_a_failure_tells_value_limit_unit_and_report_and_no_trace(place):
    # At the goal, x = 35 m, the wall at x = 100 m is nearest: 65 m less the radius, 0.5 m, and the way to
    # stop from 1 m/s at 1 m/s^2, 0.5 m, leave 64 m.
    result = verified(
        place, "scenarios", "--verify-gate", "braking_margin=70", "-k", "braking_margin or stops"
    )
    result.assert_outcomes(failed=3, passed=1)
    text = result.stdout.str()
    assert "\nemergency_stops: measured 1 stops, limit 0 stops\nreport: reports/bad/report.html\n" in text
    assert "FAILED scenarios/bad.yaml::emergency_stops - Failed: emergency_stops: meas" in text
    assert "braking_margin: measured 64 m, limit 70 m" in text
    assert text.count("report: reports/good/report.html") == 1
    assert "Traceback" not in text
    assert "pytest_items" not in text
    assert "(gates overridden on the command line: braking_margin 70 instead of 0)" in text


def test_a_named_gate_that_is_not_evaluated_fails(place):
    result = verified(place, "scenarios/good.yaml", "--verify-gate", "certified_gap=0.1")
    result.assert_outcomes(passed=len(EVALUATED), skipped=2, failed=1)
    result.stdout.fnmatch_lines(["certified_gap: not evaluated: no lower bound was computed"])


def test_options_that_choose_and_stop(place):
    assert verified(place, "-k", "bad and verdict").parseoutcomes() == {"failed": 1, "deselected": 13}
    assert verified(place, "-m", "not verify").parseoutcomes() == {"deselected": 14}
    assert verified(place, "scenarios/bad.yaml", "-x").parseoutcomes() == {
        "passed": 2,
        "skipped": 3,
        "failed": 1,
    }
    assert verified(place, "scenarios/good.yaml::verdict").parseoutcomes() == {"passed": 1}


def test_last_failed_runs_what_failed(place):
    for _ in range(2):
        result = place.runpytest_inprocess("--verify", "--lf", "scenarios")
    assert result.parseoutcomes()["failed"] == 2
    assert "passed" not in result.parseoutcomes()


def test_properties_reach_the_junit_file_of_pytest(place):
    verified(place, "scenarios/bad.yaml", "--junitxml=j.xml")
    cases = {case.get("name"): case for case in ElementTree.parse(place.path / "j.xml").iter("testcase")}
    told = {p.get("name"): p.get("value") for p in cases["emergency_stops"].iter("property")}
    assert told == {"value": "1.0", "limit": "0.0", "unit": "stops"}


def test_bad_input_is_an_error_of_collection_in_the_words_of_the_command(place):
    good = scenario_bytes(**changes(name="good")).decode()
    texts = {
        "twin": good,
        "radius": good.replace("radius: 0.5", "radius: -1"),
        "typo": good.replace("world:", "world: ["),
    }
    for name, text in texts.items():
        (place.path / f"scenarios/z_{name}.yaml").write_text(text)
    result = verified(place, "scenarios")
    assert result.ret == pytest.ExitCode.INTERRUPTED
    assert result.parseoutcomes()["errors"] == 3
    text = result.stdout.str()
    lines = good.splitlines()
    radius, name = lines.index("  radius: 0.5") + 1, lines.index("name: good") + 1
    assert f"\nscenarios/z_radius.yaml:{radius}: robot.radius = -1: must be at least 0" in text
    assert f"\nscenarios/z_twin.yaml:{name}: name = 'good': is also the name of scenarios/good.yaml" in text
    assert "ERROR scenarios/z_typo.yaml" in text
    assert "Traceback" not in text
    assert ci_case.runs(place.path / "reports") == []


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--verify-gate", "speed=1"], "'speed=1': expected NAME=LIMIT with one of analytic_gap"),
        (["--verify-plugin", "no_such_module"], "plugin no_such_module"),
        (["--verify-baseline", "absent.json"], "absent.json"),
        (["--verify-out", "scenarios/good.yaml"], "cannot be used for output"),
    ],
)
def test_bad_options_are_usage_errors(place, arguments, words):
    result = verified(place, *arguments)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines([f"*--verify: *{words}*"])


def test_results_and_yaml_of_others_are_left_alone(tmp_path):
    answers = {
        "schema: 1\nname: x\n": True,
        "# words\n---\n{name: x, 'schema': 1}\n": True,
        "schema: 1\nworld: [\n": True,  # a typing error must not take a scenario out of the tests
        "a: {schema: 1}\nb: [schema, 2]\nc: schema\n": False,
        "[schema, 1]\n": False,
        "schema\n": False,
        "": False,
        "a: [\n": False,
    }
    for text, expected in answers.items():
        (tmp_path / "a.yaml").write_text(text)
        assert is_scenario(tmp_path / "a.yaml") is expected, text
    for encoding in ("utf-8-sig", "utf-16", "utf-16-be"):  # which `verify` refuses, or reads
        (tmp_path / "a.yaml").write_text("schema: 1\nname: x\n", encoding=encoding)
        assert is_scenario(tmp_path / "a.yaml"), encoding
    assert is_scenario(tmp_path / "gone.yaml")  # `verify` says why it cannot be read
    (tmp_path / "scenario.yaml").write_bytes(scenario_bytes())
    assert is_scenario(tmp_path / "scenario.yaml")
    (tmp_path / "result.json").write_text("{}")  # a result folder holds the question it answers
    assert not is_scenario(tmp_path / "scenario.yaml")


def test_with_a_baseline_there_is_one_item_more(place):
    scenario = parse_scenario((place.path / "scenarios/good.yaml").read_bytes(), "good.yaml")
    for slower, outcome in ((0.0, "passed"), (-1.0, "failed")):
        file = place.path / f"{outcome}.json"
        ci_case.baseline(file, scenario, {"travel_time.refined": 30.0 + slower})
        result = verified(place, "scenarios/good.yaml", "--verify-baseline", str(file), "-k", "baseline")
        result.assert_outcomes(**{outcome: 1}, deselected=7)
    result.stdout.fnmatch_lines(["*baseline travel_time.refined: worse: 30* s, was 29 s, allowed 29.0* s"])


def test_ctrl_c_ends_the_session_and_leaves_no_record(place, monkeypatch):
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(verify.pytest_session, "attempt", interrupted)
    result = verified(place, "scenarios/good.yaml", no_reraise_ctrlc=True)
    assert result.ret == pytest.ExitCode.INTERRUPTED
    assert not list((place.path / "reports").iterdir())


def test_whoever_comes_second_waits_and_reads(tmp_path):
    from threading import Thread

    told = []
    second = Thread(target=lambda: told.append(recorded_once(tmp_path, "s", lambda: Record(name="again"))))

    def run() -> Record:
        second.start()  # while this one holds the lock
        return Record(name="s", headline="once")

    assert recorded_once(tmp_path, "s", run).headline == "once"
    second.join()
    assert told == [Record(name="s", headline="once")]


def test_a_run_that_was_cut_short_is_not_tried_again(tmp_path):
    def die() -> Record:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        recorded_once(tmp_path, "s", die)
    assert "cut short" in recorded_once(tmp_path, "s", die).error


def test_workers_of_xdist_share_one_run(place, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([TESTS, os.environ.get("PYTHONPATH", "")]))
    place.makeconftest(
        "import ci_case, verify.pytest_session\nverify.pytest_session.attempt = ci_case.finished\n"
    )
    result = place.runpytest_subprocess(
        "--verify", "-n2", "--dist", "load", "-v", "-p", "no:cacheprovider", "scenarios", "--junitxml=j.xml"
    )
    result.assert_outcomes(passed=2 * len(EVALUATED) - 2, skipped=6, failed=2)
    assert sorted(ci_case.runs(place.path / "reports")) == ["bad", "good"]
    result.stdout.fnmatch_lines(["bad: failed *", "good: refined *"])
    # `--dist loadfile`, as docs/ci.md advises, gives all that has one name before `::` to one worker: that is
    # one scenario, so no worker waits for a run of another one.
    ids = re.findall(r"^\[gw\d\] .* (\S+)::\S+ *$", result.stdout.str(), re.MULTILINE)
    assert {scope: ids.count(scope) for scope in ids} == {
        f"scenarios/{n}.yaml": len(NAMES) for n in ("good", "bad")
    }
