"""The index of a report folder: order, figures to sort by, small maps, what changed, old folders."""

from __future__ import annotations

import base64
import json
import re
from pathlib import Path
from typing import Any

import pytest
from report_case import corner_path, motion, warehouse
from test_previous import RESULT, after
from test_report import Page

from verify.attempt import write_index_of
from verify.by_products import THUMBNAIL
from verify.evidence import write_result
from verify.previous import keep_previous
from verify.report import executed_thumbnail, write_index
from verify.report.answer import answer
from verify.report.index import LARGEST_THUMBNAIL

FAILED = after(
    verdict="failed", gates=[{"name": "certified_gap", "value": 0.05, "limit": 0.03, "passed": False}]
)


def folder_of(out: Path, name: str, result: dict[str, Any], before: dict[str, Any] | None = None) -> None:
    """A result folder, made by a run that replaced the result `before`."""
    (out / name).mkdir(parents=True)
    if before is not None:
        (out / "old").mkdir()
        write_result(out / "old", before)
        keep_previous(out / "old", out / name)
        (out / "old" / "result.json").unlink()
        (out / "old").rmdir()
    write_result(out / name, result)


def index(out: Path, **results: dict[str, Any]) -> str:
    write_index(out / "index.html", list(results.items()))
    return (out / "index.html").read_text(encoding="utf-8")


def row(text: str, name: str) -> str:
    rows = re.findall(r"<tr role=\"row\" data-standing.*?</tr>", text, re.DOTALL)
    [found] = [one for one in rows if f'data-value="{name}"' in one]
    return found


def test_failing_scenarios_come_first(tmp_path):
    refined = after(verdict="refined")
    text = index(tmp_path, a=RESULT, b={"scenario": "b"}, c=FAILED, d=RESULT, e=refined)
    assert re.findall(r'<th role="rowheader"[^>]* data-value="(.)"', text) == ["c", "b", "e", "a", "d"]
    # and the heading says that this is how they are sorted
    assert re.findall(r'aria-sort="(\w+)" data-sort="(\w+)"', text) == [("ascending", "Verdict")]


def test_every_column_has_what_it_is_sorted_by(tmp_path):
    page = Page(index(tmp_path, a=RESULT))
    heads = [attributes["data-sort"] for attributes in page.all("th") if "data-sort" in attributes]
    cells = [a for _, a in page.elements if a.get("role") in ("rowheader", "cell")]
    assert [cell["data-name"] for cell in cells] == heads
    values = {cell["data-name"]: cell.get("data-value") for cell in cells}
    # the numbers of the result at full length, not as they are shown
    assert float(values["Travel time"]) == 26.0
    assert float(values["Lower bound"]) == 25.0
    assert float(values["Gap to the bound"]) == pytest.approx(26.0 / 25.0 - 1.0)
    assert values["Simulated"] is None  # there is no such run: it has no place in an order
    assert values["Bad stops"] is None


def test_bound_and_gap_are_those_of_the_answer(tmp_path):
    # 21.058 s and 1.96 s for the ends are 23.018 s; 23.978 / 23.018 - 1 = 4.17 %
    ends = {"end_cost": 1.96, "executed": "refined", "gaps": {"certified": 0.0216, "certified_full": 0.0417}}
    result = after(lower_bound__travel_time=21.058, plans__refined__travel_time=23.978) | ends
    cells = dict(
        re.findall(r'data-name="([^"]*)"[^>]*><span class="value">([^<]*)', index(tmp_path, a=result))
    )
    assert cells["Lower bound"].split() == ["23.018", "s"]
    assert cells["Gap to the bound"].split() == ["4.17", "%"]
    assert f"can take less than {cells['Lower bound']}" in answer(result)[1]
    assert f"takes {cells['Gap to the bound']} more" in answer(result)[1]


def test_a_named_gate_without_a_value_fails(tmp_path):
    gates = [{"name": "certified_gap", "limit": 0.03, "passed": None, "named": True, "reason": "no bound"}]
    text = row(index(tmp_path, a=after(gates=gates)), "a")
    assert 'data-standing="bad"' in text
    assert "1 failed" in text


def test_what_changed_is_told_and_counted(tmp_path):
    folder_of(tmp_path, "a", after(plans__refined__travel_time=27.3), before=RESULT)
    folder_of(tmp_path, "b", RESULT, before=RESULT)
    text = index(tmp_path, a=after(plans__refined__travel_time=27.3), b=RESULT, c=RESULT)
    told = Page(row(text, "a")).text.replace("\u00a0", " ")
    assert "worse: travel time 26.000 s → 27.300 s (+5.00 %)" in told  # 1.3 / 26
    assert "nothing" in Page(row(text, "b")).text
    assert "new: no earlier run" in Page(row(text, "c")).text
    assert "Since the last run of each: 1 worse, 1 as before, 1 new." in Page(text).text


def test_many_changes_are_folded(tmp_path):
    now = after(verdict="failed", gates=[], gaps__certified=0.1, plans__refined__travel_time=30.0)
    now["lower_bound"]["travel_time"] = 20.0
    folder_of(tmp_path, "a", now, before=RESULT)
    page = Page(row(index(tmp_path, a=now), "a"))
    # verdict, gate, travel time are shown; lower bound and certified gap lie below
    assert "2 more" in page.text
    assert len(page.all("li")) == 5


def test_the_small_map_is_an_image_of_both_grounds(tmp_path):
    scenario = warehouse()
    driven = motion(scenario, corner_path(), share=0.9, ends=0.0, step=0.2)
    folder_of(tmp_path, "a", RESULT)
    drawn = executed_thumbnail(scenario.problem, ("refined", driven))
    (tmp_path / "a" / THUMBNAIL).write_text(drawn, encoding="utf-8")
    [image] = Page(index(tmp_path, a=RESULT)).all("img")
    kind, _, content = image["src"].partition(",")
    assert kind == "data:image/svg+xml;base64"
    assert base64.b64decode(content).decode() == drawn
    assert "prefers-color-scheme:dark" in drawn
    assert "Full-robot collocation" in drawn


def test_without_an_executed_path_the_map_is_the_world_alone():
    drawn = executed_thumbnail(warehouse().problem, None)
    assert "without an executed path" in drawn
    assert "var(--refined)" not in drawn


def test_a_file_that_is_no_small_map_is_left_out(tmp_path):
    for name, content in (("a", b"<html><script>1</script>"), ("b", b"<svg " + b" " * LARGEST_THUMBNAIL)):
        folder_of(tmp_path, name, RESULT)
        (tmp_path / name / THUMBNAIL).write_bytes(content)
    assert Page(index(tmp_path, a=RESULT, b=RESULT)).all("img") == []


def test_folders_of_before_are_listed_without_what_they_lack(tmp_path):
    folder_of(tmp_path, "a", RESULT)
    page = Page(index(tmp_path, a=RESULT, gone=RESULT))
    assert page.all("img") == []
    assert len(page.all("time")) == 1  # of the folder that is there
    assert [a["href"] for a in page.all("a")] == ["./a/report.html", "./gone/report.html"]


def test_names_and_words_from_files_are_text(tmp_path):
    odd = after(gates=[{"name": "<b>x</b>", "passed": True}], scenario_sha256="<i>")
    folder_of(tmp_path, "a_b", odd, before=RESULT)
    page = Page(index(tmp_path, **{"a_b": odd, "<s>": odd}))
    assert page.all("b") == page.all("i") == page.all("s") == []
    assert "<b>x</b>" in page.text


@pytest.mark.parametrize(
    "odd",
    [
        {"simulation": {"emergency_stops": {"bad": 10**400}}, "gaps": {"certified": 10**400}},
        {"gates": [{"name": "certified_gap", "value": 10**400, "limit": 10**400, "passed": True}]},
        {"gates": [{"name": "\ud800", "passed": True}], "verdict": "\ud800"},
        {"gates": 5, "plans": [1], "simulation": "x", "gaps": [], "lower_bound": 3, "versions": None},
    ],
)
def test_a_folder_of_somebody_else_costs_at_most_its_own_row(tmp_path, odd):
    folder_of(tmp_path, "a", RESULT, before=RESULT)
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "previous.json").write_text(
        json.dumps({"schema": 1, "metrics": {"travel_time.refined": 10**400}, "gates": {"\ud801": True}})
    )
    text = index(tmp_path, a=RESULT, b={**RESULT, **odd})
    assert "nothing" in Page(row(text, "a")).text


def test_an_index_that_cannot_be_written_costs_no_result(tmp_path, capsys):
    (tmp_path / "index.html").mkdir()
    write_index_of(tmp_path)
    assert f"{tmp_path / 'index.html'}: index not written: Is a directory" in capsys.readouterr().err


def test_only_our_script_may_run(tmp_path):
    text = index(tmp_path, a=RESULT)
    [policy] = re.findall(r'Content-Security-Policy" content="([^"]+)"', text)
    policy = policy.replace("&#39;", "'")
    assert re.search(r"script-src( 'sha256-[A-Za-z0-9+/=]+')+;", policy)
    assert "unsafe" not in policy
    assert "default-src 'none'" in policy
