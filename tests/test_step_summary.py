"""The summary of a step in GitHub Actions."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from metric_case import BROKEN, HELD, NAMED_NOT_RUN, judgement, run, suite

from verify.baseline import compare, entry
from verify.baseline_file import Baseline
from verify.metrics import metrics
from verify.step_summary import VARIABLE, step_summary, write_step_summary
from verify.suite import Suite


def cells(line: str) -> list[str]:
    """The cells of a row of a table, as GitHub splits it: at bars that are not escaped."""
    return [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]


def rows(text: str) -> list[list[str]]:
    """The rows of the first table, without its head."""
    lines = text.partition("<details>")[0].splitlines()
    return [cells(line) for line in lines if line.startswith("| ")][2:]


def test_a_row_tells_verdict_time_gap_and_report():
    # Executed is `refined`: 25 s; certified gap 0.025 (tests/metric_case.py).
    (row,) = rows(step_summary([suite(HELD)]))
    assert row == [
        "yard",
        "passed",
        "refined",
        "25.000\u00a0s (refined)",
        "2.500\u00a0%",
        "\u2013",
        "reports/yard/report.html",
    ]


def test_what_failed_stands_in_the_row_with_value_and_limit():
    (row,) = rows(step_summary([suite(HELD, BROKEN, NAMED_NOT_RUN)]))
    assert row[1] == "**failed**"
    assert row[5] == (
        r"**refinement\_gap**: 0.0625, limit 0.05<br>**emergency\_stops**: not evaluated: no stops"
    )


def test_a_baseline_that_does_not_hold_stands_in_the_row():
    base = Baseline(schema=1, tolerances={}, scenarios={"yard": entry(run())})
    gone = run(metrics=tuple(m for m in run().metrics if m.name != "lower_bound"))
    (row,) = rows(step_summary([suite(HELD, comparison=compare(base, gone))]))
    assert row[1] == "**failed**"
    assert row[5] == r"**baseline\_gaps**: baseline lower\_bound: missing: none, was 19.5 s"


def test_what_could_not_run_is_not_passed():
    text = step_summary(
        [
            suite(HELD),
            Suite(name="bad.yaml", error="bad.yaml, line 3: no", bad_input=True),
            suite(HELD, missing=("refined: out of iterations",)),
            suite(judgement=judgement(HELD, verdict="failed", executed=None)),
            Suite(name="yard", error="yard: out of memory"),
            Suite(name="nothing"),  # no case at all: nobody judged it
        ]
    )
    assert text.startswith("### verify: 1 of 6 scenarios passed\n")
    results = [row[1] for row in rows(text)]
    stopped = "**not finished**"
    assert results == ["passed", "**bad input**", stopped, "**failed**", stopped, "**failed**"]


def test_without_a_gap_to_the_variational_model_that_of_the_full_robot_is_told():
    of_zone = run(metrics=metrics({"gaps": {"certified_full": 0.125}}))
    (row,) = rows(step_summary([suite(HELD, run=of_zone)]))
    assert row[4] == "12.500\u00a0% (full robot)"
    assert row[3] == "\u2013"  # no time, so none is told


def test_every_case_and_figure_is_folded_below():
    text = step_summary([suite(HELD, BROKEN)])
    folded = text.partition("<details>")[2]
    assert "<summary>yard: 3 cases</summary>\n\n|" in folded  # a table needs the empty line
    assert folded.rstrip().endswith("</details>")
    for metric in run().metrics:
        assert metric.name.replace("_", r"\_") in folded


def test_details_are_left_out_where_they_do_not_fit():
    suites = [suite(HELD)] * 3
    whole = step_summary(suites)
    assert step_summary(suites, room=len(whole.encode())) == whole
    short = step_summary(suites, room=len(whole.encode()) - 1)
    assert "<details>" not in short
    assert "Details are left out" in short
    assert rows(short) == rows(whole)


@given(st.integers(min_value=400, max_value=8000))
def test_a_table_that_does_not_fit_loses_rows_that_passed_first(room: int):
    suites = [suite(HELD, name=f"good{n}") for n in range(20)]
    suites[5::5] = [suite(BROKEN, name=f"bad{n}") for n in range(3)]
    text = step_summary(suites, room=room)
    assert len(text.encode()) <= room
    assert text.startswith("### verify: 17 of 20 scenarios passed\n")
    names = [row[0] for row in rows(text)]
    if "missing" in text:
        told = re.search(r"\n\n(\d+) scenarios? (?:is|are) missing in this table, (\d+) of which", text)
        assert told is not None
        kept = sum(name.startswith("bad") for name in names)
        assert [int(number) for number in told.groups()] == [20 - len(names), 3 - kept]
        assert all(name.startswith("bad") for name in names[:3])
    else:
        assert names == [suite.name for suite in suites]  # in their order


def test_a_full_page_gets_the_heading_and_what_is_missing():
    text = step_summary([suite(BROKEN)], room=-1)
    assert rows(text) == []
    assert "1 scenario is missing in this table, 1 of which did not pass." in text


@given(st.text(max_size=40))
def test_no_text_breaks_the_table_or_becomes_markup(text: str):
    page = step_summary([Suite(name=text, error=text or "no")])
    (row,) = rows(page)
    assert len(row) == 7
    assert not re.search(r"<(?!br>|/?details>|/?summary>)", page)
    assert not re.search(r"(?<!\\)[`\[\]$~]", page.partition("<details>")[0].replace("| :--", ""))


def test_the_summary_is_appended_to_what_is_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    file = tmp_path / "summary.md"
    file.write_text("of another command, no newline")
    monkeypatch.setenv(VARIABLE, str(file))
    write_step_summary([suite(HELD)])
    write_step_summary([suite(HELD)])
    text = file.read_text()
    assert text.startswith("of another command, no newline\n### verify")
    assert text.count("\n### verify: 1 of 1 scenarios passed\n") == 2


def test_nothing_is_written_without_the_variable(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv(VARIABLE, raising=False)
    write_step_summary([suite(HELD)])
    monkeypatch.setenv(VARIABLE, "")
    write_step_summary([suite(HELD)])
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_cannot_be_written_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys):
    monkeypatch.setenv(VARIABLE, str(tmp_path / "absent" / "summary.md"))
    write_step_summary([suite(HELD)])
    assert "the summary cannot be written: No such file or directory" in capsys.readouterr().err
