"""What is kept of the result that a run replaces, and what is told of it."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

import pytest
from judged import scenario_bytes

from verify.atomic import ResultFolder
from verify.by_products import PREVIOUS
from verify.evidence import manifest, write_result
from verify.previous import Change, changes, keep_previous, previous_of, read_previous
from verify.report.index_changes import BETTER, MOVED, NEW, SAME, WORSE, changes_cell

RESULT: dict[str, Any] = {
    "schema": 1,
    "scenario": "room",
    "scenario_sha256": "ab" * 32,
    "verdict": "certified",
    "plans": {
        "speed_graph": {"travel_time": 25.442, "model": "variational"},
        "refined": {"travel_time": 26.0, "model": "full"},
        "dwa": {"travel_time": 50.0, "reached": False},
    },
    "lower_bound": {"travel_time": 25.0},
    "gaps": {"certified": 0.01768, "analytic": -1e-5},
    "gates": [
        {"name": "certified_gap", "value": 0.01768, "limit": 0.03, "passed": True},
        {"name": "analytic_gap", "limit": 0.01, "passed": None, "reason": "no collocation"},
    ],
    "checks": [{"name": "travel_time", "trajectory": "refined", "status": "passed"}],
    "compute_times": {"speed_graph": 3.0},
    "versions": {"vnav_drake": "0.1.0"},
}


def after(**edits: Any) -> dict[str, Any]:
    """The same result with `a__b=value` edited."""
    result = copy.deepcopy(RESULT)
    for place, value in edits.items():
        *way, last = place.split("__")
        inner = result
        for key in way:
            inner = inner[key]
        inner[last] = value
    return result


def told(**edits: Any) -> list[str]:
    cell = changes_cell(previous_of(RESULT), after(**edits))
    return [f"{words.direction}: {words.text}".replace("\u00a0", " ") for words in (*cell.told, *cell.folded)]


def kept(tmp_path: Path, result: dict[str, Any]) -> Path:
    old, new = tmp_path / "old", tmp_path / "new"
    old.mkdir()
    new.mkdir()
    write_result(old, result)
    keep_previous(old, new)
    return new


def test_the_key_figures_come_back_as_they_were(tmp_path):
    folder = kept(tmp_path, RESULT)
    before = read_previous(folder)
    assert before == previous_of(RESULT)
    assert before is not None
    assert before.gates == {"certified_gap": True, "analytic_gap": None}
    assert before.metrics["travel_time.refined"] == 26.0
    assert "travel_time.dwa" not in before.metrics  # it did not reach the goal
    assert json.loads((folder / PREVIOUS).read_text())["schema"] == 1


def test_it_is_no_evidence(tmp_path):
    assert PREVIOUS not in manifest(kept(tmp_path, RESULT))


@pytest.mark.parametrize(
    "content", [None, b"", b"{", b"[]", b'{"schema": 99}', b"\xff\xfe", b'{"schema": 1, "a": NaN}']
)
def test_nothing_is_kept_of_a_result_that_cannot_be_read(tmp_path, content):
    old, new = tmp_path / "old", tmp_path / "new"
    new.mkdir()
    if content is not None:
        old.mkdir()
        (old / "result.json").write_bytes(content)
    keep_previous(old, new)
    assert list(new.iterdir()) == []


@pytest.mark.parametrize(
    "content",
    [b"", b"{", b"[]", b"null", b'{"schema": 2}', b"\xff", b'{"schema": 1, "metrics": {"a": 1e999}}'],
)
def test_what_was_kept_and_cannot_be_read_is_as_if_it_were_not_there(tmp_path, content):
    (tmp_path / PREVIOUS).write_bytes(content)
    assert read_previous(tmp_path) is None
    assert changes_cell(read_previous(tmp_path), RESULT).rank == NEW


def test_an_integer_that_no_float_holds_is_no_figure(tmp_path):
    huge = {"schema": 1, "metrics": {"travel_time.refined": 10**400, "lower_bound": 25}}
    (tmp_path / PREVIOUS).write_text(json.dumps(huge))
    before = read_previous(tmp_path)
    assert before is not None
    assert before.metrics == {"lower_bound": 25.0}
    assert changes_cell(before, after(gaps__certified=10**400)).told


def test_words_that_are_no_unicode_are_kept(tmp_path):
    (tmp_path / "old").mkdir()
    (tmp_path / "new").mkdir()
    odd = after(verdict="\ud800", gates=[{"name": "\udfff", "passed": True}])
    (tmp_path / "old" / "result.json").write_text(json.dumps(odd))  # as an escape, which is ASCII
    keep_previous(tmp_path / "old", tmp_path / "new")
    before = read_previous(tmp_path / "new")
    assert before is not None
    assert (before.verdict, before.gates) == ("\ud800", {"\udfff": True})


def test_what_is_kept_is_of_the_result_that_is_replaced(tmp_path):
    # Both begin before either is done: the second one's predecessor is the first one's result.
    with ResultFolder(tmp_path, "room") as first, ResultFolder(tmp_path, "room") as second:
        write_result(first.work, after(verdict="refined"))
        first.publish(keep_previous)
        write_result(second.work, RESULT)
        second.publish(keep_previous)
    before = read_previous(tmp_path / "room")
    assert before is not None
    assert before.verdict == "refined"


def told_of(tmp_path: Path, *files: bytes) -> list[str]:
    """What the index tells of two runs with the same figures, but for 26 s that became 27.3 s."""
    for name, data in zip(("old", "new"), files, strict=True):
        (tmp_path / name).mkdir()
        (tmp_path / name / "scenario.yaml").write_bytes(data)
    write_result(tmp_path / "old", RESULT)
    keep_previous(tmp_path / "old", tmp_path / "new")
    now = after(scenario_sha256="cd" * 32, plans__refined__travel_time=27.3)
    cell = changes_cell(read_previous(tmp_path / "new"), now, tmp_path / "new")
    return [f"{words.direction}: {words.text}".replace("\u00a0", " ") for words in cell.told]


SLOWER = "travel time 26.000 s → 27.300 s (+5.00 %)"  # 1.3 / 26


def test_another_comment_or_limit_is_the_same_question(tmp_path):
    one, other = scenario_bytes(), b"# a comment\n" + scenario_bytes(gates={"analytic_gap": 0.5})
    assert told_of(tmp_path, one, other) == [f"worse: {SLOWER}"]


def test_another_effort_is_told_apart(tmp_path):
    found = told_of(tmp_path, scenario_bytes(), scenario_bytes(plan={"effort": "quick"}))
    assert found == ["neutral: effort full → quick", f"worse: {SLOWER}"]


def test_another_question_makes_figures_incomparable(tmp_path):
    found = told_of(tmp_path, scenario_bytes(), scenario_bytes(start={"position": [6.0, 2.0]}))
    assert found == ["neutral: scenario changed", f"neutral: {SLOWER}"]


@pytest.mark.parametrize("broken", [0, 1])
def test_a_scenario_that_cannot_be_read_counts_as_changed(tmp_path, broken):
    files = [scenario_bytes(), scenario_bytes()]
    files[broken] = b"no scenario"
    assert told_of(tmp_path, *files)[0] == "neutral: scenario changed"


def test_figures_of_a_wrong_type_are_left_out(tmp_path):
    odd = {"schema": 1, "gates": {"a": "yes"}, "metrics": {"b": "1", "c": True, "d": 2}, "versions": [1]}
    (tmp_path / PREVIOUS).write_text(json.dumps(odd))
    before = read_previous(tmp_path)
    assert before is not None
    assert (before.gates, before.metrics, before.versions) == ({"a": None}, {"d": 2.0}, {})
    assert (before.verdict, before.scenario_sha256) == ("", "")


def test_the_same_result_has_not_changed():
    assert changes(previous_of(RESULT), RESULT) == ()
    cell = changes_cell(previous_of(RESULT), RESULT)
    assert (cell.rank, cell.words) == (SAME, "nothing")


def test_rounding_is_no_change():
    # 1e-9 of a travel time is far below the 1e-6 from which a change counts; compute times never do.
    later = after(plans__refined__travel_time=26.0 * (1 + 1e-9), compute_times={"speed_graph": 99.0})
    assert changes(previous_of(RESULT), later) == ()


def test_a_longer_travel_time_is_worse_and_told_with_its_share():
    # 25.442 s to 25.900 s is 0.458 / 25.442 = 1.80 % more.
    [line] = told(plans__speed_graph__travel_time=25.9)
    assert line == "worse: Speed graph time 25.442 s → 25.900 s (+1.80 %)"


def test_the_executed_plan_is_told_before_the_others():
    lines = told(plans__refined__travel_time=25.0, plans__speed_graph__travel_time=26.0, verdict="refined")
    # certified to refined is neither better nor worse; the vehicle now drives the full robot's motion
    assert lines[0] == "neutral: verdict certified → refined"
    assert lines[1:] == [
        "better: travel time 26.000 s → 25.000 s (−3.85 %)",  # 1 / 26
        "worse: Speed graph time 25.442 s → 26.000 s (+2.19 %)",  # 0.558 / 25.442
    ]


@pytest.mark.parametrize(
    ("now", "line"),
    [
        ({"verdict": "failed"}, "worse: verdict certified → failed"),
        ({"lower_bound__travel_time": 25.1}, "better: lower bound 25.000 s → 25.100 s (+0.400 %)"),
        ({"gaps__certified": 0.0277}, "worse: certified gap 1.77 % → 2.77 %"),
        (
            {"gates": [{"name": "certified_gap", "passed": False}, RESULT["gates"][1]]},
            "worse: gate certified gap holds → fails",
        ),
        (
            {"gates": [RESULT["gates"][0], {"name": "analytic_gap", "passed": True}]},
            "better: gate analytic gap not evaluated → holds",
        ),
        ({"gates": RESULT["gates"][1:]}, "worse: gate certified gap holds → not evaluated"),
    ],
)
def test_each_kind_of_change_has_its_words(now, line):
    assert told(**now) == [line]


def test_the_sign_of_the_analytic_gap_does_not_count():
    assert changes(previous_of(RESULT), after(gaps__analytic=1e-5)) == ()


def test_a_plan_that_no_longer_reaches_the_goal_has_no_time_any_more():
    found = changes(previous_of(RESULT), after(plans__refined={"reached": False}))
    assert (
        Change(kind="metric", name="travel_time.refined", direction="neutral", before=26.0, after=None)
        in found
    )


def test_under_another_question_nothing_is_better_or_worse():
    cell = changes_cell(previous_of(RESULT), after(scenario_sha256="cd" * 32, lower_bound__travel_time=26.0))
    assert cell.rank == MOVED
    assert cell.told[0].text == "scenario changed"
    assert {words.direction for words in cell.told} == {"neutral"}


def test_what_got_worse_comes_first_when_sorted():
    edits = ({"lower_bound__travel_time": 24.0}, {"verdict": "refined"}, {"lower_bound__travel_time": 25.1})
    ranks = [changes_cell(previous_of(RESULT), after(**edit)).rank for edit in edits]
    assert ranks == [WORSE, MOVED, BETTER]
    assert ranks == sorted(ranks)
