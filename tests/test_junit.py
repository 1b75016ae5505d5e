"""The JUnit file: what CI servers read of it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import pytest
from metric_case import BROKEN, HELD, NAMED_NOT_RUN, NOT_RUN, judgement, run, suite

from verify.baseline import compare, entry
from verify.baseline_file import Baseline
from verify.judge import Check
from verify.junit import Suite, write_junit

# What the schemas of Jenkins (junit-10.xsd) and the format that GitLab documents know.
KNOWN = {
    "testsuites": {"name", "time", "tests", "failures", "errors"},
    "testsuite": {"name", "tests", "failures", "errors", "skipped", "time", "file"},
    "properties": set(),
    "property": {"name", "value"},
    "testcase": {"name", "classname", "time", "file"},
    "failure": {"message"},
    "error": {"message", "type"},
    "skipped": {"message"},
    "system-out": set(),
}


def written(folder: Path, *suites: Suite) -> ElementTree.Element:
    file = folder / "j.xml"
    write_junit(file, suites)
    return ElementTree.parse(file).getroot()


def status(root: ElementTree.Element) -> dict[str, str]:
    """Tag of the first child by case; `system-out` marks a pass."""
    return {case.get("name", ""): case[0].tag for case in root.iter("testcase")}


def test_gates_hold_break_are_skipped_or_missed(tmp_path: Path):
    root = written(tmp_path, suite(HELD, BROKEN, NOT_RUN, NAMED_NOT_RUN))
    assert status(root) == {
        "analytic_gap": "system-out",
        "refinement_gap": "failure",
        "certified_gap": "skipped",
        "emergency_stops": "failure",  # somebody named it, so it must be evaluated
        "verdict": "system-out",
    }
    (own,) = root
    counts = {key: own.get(key) for key in ("tests", "failures", "errors", "skipped")}
    assert counts == {"tests": "5", "failures": "2", "errors": "0", "skipped": "1"}


def test_counts_and_times_of_suites_add_up(tmp_path: Path):
    broken = Suite(name="bad.yaml", file="bad.yaml", error="line 1: no")
    root = written(tmp_path, suite(BROKEN), suite(HELD, missing=("refined: out of iterations",)), broken)
    for count in ("tests", "failures", "errors"):
        assert int(root.get(count, "")) == sum(int(own.get(count, "")) for own in root)
    for own in root:
        cases = own.findall("testcase")
        assert float(own.get("time", "")) == sum(float(case.get("time", "")) for case in cases)
        assert int(own.get("tests", "")) == len(cases)
        tags = [case[0].tag for case in cases]
        assert int(own.get("failures", "")) == tags.count("failure")
        assert int(own.get("errors", "")) == tags.count("error")
    # 1.5 + 2.25 + 8 s of tests/metric_case.py, twice; what was not run took none.
    assert [own.get("time") for own in root] == ["11.750", "11.750", "0.000"]
    assert root.get("time") == "23.500"


def test_measured_values_are_properties_of_the_suite(tmp_path: Path):
    root = written(tmp_path, suite(HELD))
    found = {item.get("name"): item.get("value") for item in root.iter("property")}
    assert {metric.name: repr(metric.value) for metric in run().metrics}.items() <= found.items()
    assert found["verdict"] == "refined"
    assert found["effort"] == "full"
    assert found["report"] == "reports/yard/report.html"
    assert found["vnav_drake"] == "0.1.0"


def test_only_elements_and_attributes_that_the_readers_know(tmp_path: Path):
    base = Baseline(schema=1, tolerances={}, scenarios={"yard": entry(run())})
    root = written(
        tmp_path,
        suite(HELD, BROKEN, NOT_RUN, NAMED_NOT_RUN, comparison=compare(base, run())),
        suite(HELD, missing=("refined: out of iterations",)),
        Suite(name="bad.yaml", error="line 1: no"),
    )
    for element in root.iter():
        assert element.attrib.keys() <= KNOWN[element.tag]
    for own in root:
        tags = [child.tag for child in own]
        assert tags.count("properties") <= 1
        assert "properties" not in tags[1:]  # the schema has them first
        assert all(case.get("classname") == own.get("name") for case in own.iter("testcase"))
        names = [case.get("name") for case in own.iter("testcase")]
        assert len(names) == len(set(names))
    # The judged ones know their file; the reader links it.
    assert {case.get("file") for case in root[0].iter("testcase")} == {"scenarios/yard.yaml"}


def test_a_case_a_kind_of_baseline_figure(tmp_path: Path):
    base = Baseline(schema=1, tolerances={}, scenarios={"yard": entry(run())})
    slower = tuple(replace(m, value=2.0 * m.value) if m.kind == "travel_time" else m for m in run().metrics)
    found = compare(base, run(metrics=slower))
    root = written(tmp_path, suite(HELD, comparison=found))
    told = status(root)
    assert told["baseline_travel_times"] == "failure"
    assert told["baseline_gaps"] == told["baseline_margins"] == told["baseline_run"] == "system-out"
    failure = next(root.iter("failure"))
    # Every figure that moved: 20, 25 and 25.5 s became twice that; 0.1 % more were allowed, of the
    # simulation 0.02 s too: 25.5455 s, told with five digits.
    assert failure.get("message", "").splitlines() == [
        "baseline travel_time.speed_graph: worse: 40 s, was 20 s, allowed 20.02 s",
        "baseline travel_time.refined: worse: 50 s, was 25 s, allowed 25.025 s",
        "baseline travel_time.simulation: worse: 51 s, was 25.5 s, allowed 25.546 s",
    ]


def test_a_scenario_that_is_not_in_the_baseline_fails_there(tmp_path: Path):
    empty = Baseline(schema=1, tolerances={}, scenarios={})
    root = written(tmp_path, suite(HELD, comparison=compare(empty, run())))
    assert status(root) == {"analytic_gap": "system-out", "verdict": "system-out", "baseline_run": "failure"}


@pytest.mark.parametrize("how", ["verdict", "check"])
def test_a_failed_verdict_or_check_is_a_failure(tmp_path: Path, how: str):
    check = Check(name="clearance", trajectory="refined", status="failed", message="too near", promised=True)
    changes = {"verdict": "failed", "reasons": ("no",)} if how == "verdict" else {"checks": (check,)}
    root = written(tmp_path, suite(judgement=judgement(HELD, **changes)))
    assert status(root)["verdict"] == "failure"


def test_nothing_run_at_all_is_an_error_with_the_reason(tmp_path: Path):
    root = written(
        tmp_path, Suite(name="bad.yaml", file="bad.yaml", error="bad.yaml, line 3: robot.radius = -1")
    )
    (case,) = root.iter("testcase")
    assert case[0].tag == "error"
    assert case[0].get("type") == "not_finished"
    assert case[0].get("message") == "bad.yaml, line 3: robot.radius = -1"


def test_bad_input_is_told_from_what_could_not_finish(tmp_path: Path):
    root = written(
        tmp_path,
        Suite(name="bad.yaml", error="bad.yaml, line 3: no", bad_input=True),
        suite(HELD, missing=("refined: out of iterations",)),
    )
    assert [error.get("type") for error in root.iter("error")] == ["bad_input", "not_finished"]
    assert [own.get("errors") for own in root] == ["1", "1"]
