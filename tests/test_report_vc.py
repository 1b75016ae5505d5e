"""The report's section on the vc-method, what its first lines say of it, and runs that got stuck."""

from __future__ import annotations

import base64
import hashlib
import json
import os
import re
import shutil
import subprocess
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from report_case import vc_case, write_vc_folder
from test_report import HOSTILE, Page
from test_report_seeds import ONE

from verify.report import ReportExtras, write_index, write_report
from verify.report.answer_details import details, others
from verify.report.space_data import UNIT, space_data
from verify.report.story import check_rows, executed_plan, travel_times
from verify.report.story_stuck import stuck_runs
from verify.report.story_vc import cost_sentence, vc_story
from vnav_drake.plan import Path as Way

SECTION = 1_500_000  # [bytes], by which the section may add to a page


def write(folder: Path, result: dict[str, Any], *, drawn: bool = True) -> str:
    scenario, _, drawing = vc_case()
    extras = ReportExtras(vc_method=drawing if drawn else None)
    write_report(folder / "report.html", scenario=scenario, result=result, folder=folder, extras=extras)
    return (folder / "report.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any], str]:
    """Folder, result and page, without pictures of the executed motion: those take most of the time."""
    folder = tmp_path_factory.mktemp("vc") / "three_obstacles"
    result = write_vc_folder(folder)
    (folder / "trajectory.csv").unlink()
    (folder / "trajectories" / "refined.csv").unlink()
    return folder, result, write(folder, result)


@pytest.fixture(scope="module")
def undrawn(case: tuple[Path, dict[str, Any], str], tmp_path_factory: pytest.TempPathFactory) -> str:
    """The same page where the vc-method's drawing was not at hand."""
    folder = tmp_path_factory.mktemp("undrawn") / "three_obstacles"
    shutil.copytree(case[0], folder)
    return write(folder, case[1], drawn=False)


def said(text: str) -> str:
    return Page(text).text.replace("\u00a0", " ")


def test_the_section_is_there_and_well_formed(case):
    _, _, text = case
    page = Page(text)
    ids = [attributes["id"] for _, attributes in page.elements if "id" in attributes]
    assert len(ids) == len(set(ids))
    assert {"vc-method", "figure-vc-space", "figure-vc-unfolded", "figure-vc-cells"} <= set(ids)
    assert "#vc-method" in {a.get("href") for a in page.all("a")}
    for svg in re.findall(r"<svg.*?</svg>", text, flags=re.DOTALL):
        ET.fromstring(svg)


def test_without_the_method_there_is_no_section_and_no_script(case, tmp_path):
    _, result, drawn = case
    text = write(tmp_path, {**result, "plans": {"refined": result["plans"]["refined"]}}, drawn=False)
    assert Page(text).all("script") == []
    assert "script-src" not in text
    assert 'id="vc-method"' not in text
    assert len(drawn.encode()) - len(text.encode()) < SECTION


def test_without_its_drawing_the_section_says_so(undrawn):
    assert "The cells of the vc-method were not at hand." in said(undrawn)
    assert Page(undrawn).all("script") == []


def test_the_only_script_that_may_run_is_the_viewer(case):
    text = case[2]
    page = Page(text)
    policy = next(a["content"] for a in page.all("meta") if a.get("http-equiv") == "Content-Security-Policy")
    rules = {rule.split()[0]: rule.split()[1:] for rule in policy.split(";")}
    scripts = re.findall(r"<script([^>]*)>(.*?)</script>", text, flags=re.DOTALL)
    run = [body for attributes, body in scripts if not attributes]
    assert [attributes for attributes, _ in scripts if attributes] == [
        ' type="application/json" id="vc-space-data"'
    ]
    assert len(run) == 1
    digest = base64.b64encode(hashlib.sha256(run[0].encode()).digest()).decode()
    assert rules["default-src"] == ["'none'"]
    assert rules["script-src"] == [f"'sha256-{digest}'"]
    assert not any(name.startswith("on") for _, attributes in page.elements for name in attributes)
    assert "http" not in run[0]
    assert "innerHTML" not in run[0]
    assert "eval" not in run[0]


def numbers_of(shapes: Any) -> list[Any]:
    return [number for shape in shapes for number in shape]


def test_the_viewer_gets_numbers_of_its_own_scale_and_no_text_from_files():
    scenario, _, drawing = vc_case()
    text = str(space_data(scenario.problem, drawing))
    data = json.loads(text)
    assert "<" not in text  # an obstacle is called </script><b>C</b>
    assert [label["text"] for label in data["labels"]] == ["start", "goal", "0", "1", "2", "m/s"]
    assert data["size"] == [UNIT, pytest.approx(11 / 16 * UNIT)]  # a floor of 16 x 11 m
    numbers = [n for group in data["faces"] + data["lines"] for n in numbers_of(group["shapes"])]
    numbers += [n for group in data["points"] for n in group["points"]]
    assert all(isinstance(n, int) and -1 <= n <= UNIT + 1 for n in numbers)
    roof = [shape for group in data["faces"] if group["layer"] == "roof" for shape in group["shapes"]]
    assert len(roof) == len(drawing.space.roof)


def test_every_colour_that_the_viewer_asks_for_is_one_of_the_page(case):
    scenario, _, drawing = vc_case()
    data = json.loads(str(space_data(scenario.problem, drawing)))
    names = {g["colour"] for g in data["faces"] + data["lines"]} | {g["fill"] for g in data["points"]}
    named = {name for name in names if name.startswith("--")}
    assert named
    assert all(f"{name}:" in case[2] for name in named)
    assert all(re.fullmatch("#[0-9a-f]{6}", name) for name in names - named)


@pytest.mark.skipif(
    shutil.which("chromium") is None and not os.environ.get("CI"),
    reason="no Chromium on this system; continuous integration must have one",
)
def test_a_browser_runs_the_viewer_under_the_pages_policy(case, tmp_path):
    command = [
        "chromium", "--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking",
        f"--user-data-dir={tmp_path}", "--dump-dom", f"file://{case[0] / 'report.html'}",
    ]  # fmt: skip
    shown = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True).stdout
    assert re.search(r'<figure class="picture live" id="figure-vc-space">', shown)
    viewer = re.search(r'<div class="viewer" id="vc-space-viewer"[^>]*>', shown)
    assert "hidden" not in viewer[0]


def test_counts_and_times_are_those_of_the_result(case):
    _, result, text = case
    _, found, _ = vc_case()
    plan, words = result["plans"]["vc_method"], said(text)
    stacks, cells = len(found.decomposition.maximum), len(found.decomposition.cell_top)
    assert f"falls into {stacks} stacks with {cells} cells" in words
    share = 100.0 * float(np.mean(np.diff(found.decomposition.first_cell) == 4))
    assert f"Stacks of four cells {share:.0f} % the source expects nearly all" in words
    assert f"the fastest profile takes {plan['arc_time']:.3f} s" in words
    assert f"{len(plan['corners'])} corners rounded the motion takes {plan['travel_time']:.3f} s" in words


def plan_with(other: dict[str, Any], cost: str = "realised") -> dict[str, Any]:
    return {
        "cost": cost,
        "route": {"arc_time": 20.0, "arc_length": 30.0},
        "other_route": other,
        "class": "A|B",
    }


def test_a_disagreement_of_the_costs_is_told_with_time_and_place():
    other = {"same": False, "arc_time": 25.0, "arc_length": 28.0, "class": "C|D"}
    words = cost_sentence(plan_with(other)).replace("\u00a0", " ")
    # 25 s against 20 s: 5 s or 25 % more
    assert "the published one chooses another route, 28.00 m long instead of 30.00 m" in words
    assert "takes 25.000 s along its arcs against 20.000 s, 5.000 s or 25.0 % more." in words
    assert words.endswith("It passes “C|D” instead of “A|B”.")
    less = cost_sentence(plan_with({**other, "arc_time": 18.0}, "published")).replace("\u00a0", " ")
    assert "the realised one chooses" in less
    assert "2.000 s or 10.0 % less." in less


def test_an_agreement_of_the_costs_is_told():
    assert cost_sentence(plan_with({"same": True})).startswith("Both costs of edges choose this route")


@pytest.mark.parametrize(
    "plan",
    [{}, {"cost": 3}, plan_with({}), plan_with({"same": "no"}), plan_with({"same": False, "arc_time": "x"})],
)
def test_nothing_is_said_of_costs_that_are_not_told(plan):
    assert cost_sentence(plan) == ""


def test_a_corner_that_is_tighter_than_wanted_is_marked():
    corner = {"x": 1.0, "y": -2.0, "turn": np.pi / 2, "radius": 0.3, "wanted_radius": 0.5, "speed": 0.7}
    story = vc_story(
        {"plans": {"vc_method": {"corners": [corner, {**corner, "radius": 0.5}, {}]}}}, rest_ends=False
    )
    assert [row.radius for row in story.corners] == ["0.300\u00a0m, smaller", "0.500\u00a0m", "–"]
    assert story.corners[0].turn == "90.0°"
    assert story.corners[0].place == "(1.00, −2.00)\u00a0m"


@pytest.mark.parametrize(
    "broken",
    [
        None,
        [],
        {"graph": 3, "route": [], "corners": {"a": 1}, "shortfalls": "none"},
        {"graph": {"stacks": "many", "cells": float("nan")}, "corners": [3, {"x": "east"}], "cost": HOSTILE},
        {"cost": "realised", "other_route": {"same": False, "arc_time": 2.0, "class": HOSTILE},
         "class": HOSTILE, "route": {"arc_time": 1.0}, "travel_time": "soon", "arc_time": float("inf")},
    ],
)  # fmt: skip
def test_a_plan_of_another_shape_still_gives_a_page(case, tmp_path, broken):
    plans = {"vc_method": broken, "collocation": {"comparison": 3}}
    page = Page(write(tmp_path, {**case[1], "plans": plans}, drawn=False))
    assert not {tag for tag, _ in page.elements} & {"img", "b"}
    assert "nan" not in page.text.lower().split()


def stuck_plan(**changes: Any) -> dict[str, Any]:
    stuck = {"reason": "standing", "time": 12.25, "place": [6.0, 5.5], "message": "moved 0.01 m in 10 s"}
    return {"reached": False, "model": "full", "length": 7.5, "goal_distance": 9.3, "stuck": stuck | changes}


def test_a_run_that_got_stuck_has_no_time_and_is_never_executed(case, tmp_path):
    result = json.loads(json.dumps(case[1]))
    # even where a time and the executed plan claim otherwise
    result["plans"]["dwa"] = {**stuck_plan(), "travel_time": 12.25}
    result["executed"] = "dwa"
    assert "dwa" not in travel_times(result)
    assert executed_plan(result) == "refined"
    text = write(tmp_path, result, drawn=False)
    words = said(text)
    assert (
        "Dynamic window got stuck and did not reach the goal, after 12.250 s, at (6.00, 5.50) m, "
        "9.30 m from the goal: it stands (moved 0.01 m in 10 s)." in words
    )
    row = re.search(r"<bdi>Dynamic window</bdi>.*?</tr>", text, flags=re.DOTALL)[0]
    assert "stuck" in row
    assert "12.25" not in row
    assert "got stuck where the crossed ring is" in text


def test_the_index_has_no_time_of_a_run_that_got_stuck(tmp_path):
    result = {"plans": {"dwa": {**stuck_plan(), "travel_time": 12.25}}, "executed": "dwa"}
    write_index(tmp_path / "index.html", [("one", result)])
    assert "12.25" not in (tmp_path / "index.html").read_text()


@pytest.mark.parametrize("place", ["here", [1.0], [None, "x"], {"x": 1}, [float("nan"), 1.0]])
def test_a_stuck_run_without_a_place_is_told_without_one(place):
    (run,) = stuck_runs({"plans": {"dwa": stuck_plan(place=place), "refined": {"travel_time": 3.0}, "x": 7}})
    assert run.place is None
    assert "after 12.250\u00a0s, 9.30\u00a0m from the goal" in run.sentence


def test_a_run_that_arrived_stands_in_the_table_and_on_the_map(case, undrawn, tmp_path):
    (tmp_path / "trajectories").mkdir()
    vc_case()[1].realisation.trajectory.to_csv(tmp_path / "trajectories" / "dwa.csv")
    plans = {
        **case[1]["plans"],
        "dwa": {"reached": True, "travel_time": 31.5, "length": 18.0, "model": "full"},
    }
    text = write(tmp_path, {**case[1], "plans": plans}, drawn=False)
    words = said(text)
    keys = [re.findall(r'<p class="keys">(.*?)</p>', page, flags=re.DOTALL)[0] for page in (text, undrawn)]
    assert ["Dynamic window" in key for key in keys] == [True, False]
    assert "Dynamic window baseline full 31.500 s" in words
    assert "stuck" not in words.split("Glossary")[0]


def cells(text: str, caption: str) -> list[list[str]]:
    """Text of a table's rows, its head first."""
    table = next(t for t in re.findall(r"<table.*?</table>", text, flags=re.DOTALL) if caption in t)
    rows = re.findall(r"<tr.*?</tr>", table, flags=re.DOTALL)
    return [
        [said(cell).strip() for cell in re.findall(r"<t[hd].*?</t[hd]>", row, flags=re.DOTALL)]
        for row in rows
    ]


def test_seeds_shortfalls_and_stuck_runs_stand_in_the_page_with_hostile_words_as_text(case, tmp_path):
    result = json.loads(json.dumps(case[1]))
    hostile = {"method": HOSTILE, "class": HOSTILE, "ended_in": HOSTILE + "2", "message": HOSTILE}
    first = {**ONE, "ended_in": "B|C"}
    result["plans"]["collocation"] |= {"comparison": [ONE, hostile, 3], "seeds": [first, hostile]}
    result["plans"]["vc_method"]["shortfalls"] = ["steering: radius 0.1 m at (1, 2) m", HOSTILE]
    result["plans"]["dwa"] = stuck_plan(reason=HOSTILE, message=HOSTILE)
    text = write(tmp_path, result, drawn=False)
    page = Page(text)
    assert not {tag for tag, _ in page.elements} & {"img", "b"}
    assert "seeds" in {a.get("id") for _, a in page.elements}
    assert "First tries of all seeds" in page.text
    assert "What this motion cannot meet, and where: steering: radius 0.1 m at (1, 2) m" in said(text)
    assert "Dynamic window got stuck" in page.text
    tried, compared = cells(text, "One coarse solve"), cells(text, "each refined to the end")
    assert tried[0][:4] == ["Seed", "Seed's class", "Ended in", "Travel time"]
    assert tried[1][1:4] == ["A", "B|C", "20.000 s"]
    assert compared[0][:3] == ["Seed", "Ended in", "Travel time"]
    assert compared[1][1:3] == ["A", "20.000 s"]
    assert {len(row) for row in tried} == {10}
    assert {len(row) for row in compared} == {9}


def baselines(**plans: Any) -> str:
    plans = {"speed_graph": {"travel_time": 20.0}, "refined": {"travel_time": 21.0}} | plans
    result = {"plans": plans}
    told = [*details(result, rest_ends=False), *others(result, rest_ends=False)]
    return " ".join(told).replace("\u00a0", " ")


def test_the_answer_tells_the_vc_method_and_the_dynamic_window_in_a_sentence_each():
    # 23 s against 20 s: 15 % above
    words = baselines(vc_method={"travel_time": 23.0}, dwa={"travel_time": 31.5, "reached": True})
    assert "The vc-method takes 23.000 s, 15.0 % above the variational optimum." in words
    assert "The dynamic window takes 31.500 s." in words
    stuck = baselines(dwa={**stuck_plan(), "travel_time": 12.25})
    assert "The dynamic window got stuck and did not reach the goal." in stuck
    assert "12.25" not in stuck


def test_the_answer_says_nothing_of_methods_that_were_not_run():
    words = baselines()
    assert "vc-method" not in words
    assert "dynamic window" not in words


def test_the_answer_says_what_the_vc_methods_motion_breaks():
    words = baselines(vc_method={"travel_time": 23.0, "unpromised": [unpromised("the vc-method")]})
    assert "23.000 s, 15.0 % above the variational optimum, but breaks the steering limit." in words


def unpromised(by: str) -> dict[str, Any]:
    message = f"turns tighter than the wheels allow (not promised by {by})"
    return {"name": "steering", "trajectory": "vc_method", "status": "failed", "message": message}


@pytest.mark.parametrize("by", ["the variational model", "the vc-method", "the dynamic window approach"])
def test_messages_do_not_repeat_what_their_status_says(by):
    (row,) = check_rows({"plans": {"vc_method": {"unpromised": [unpromised(by)]}}})
    assert row.status == "not promised"
    assert row.message == "turns tighter than the wheels allow"


def test_no_seeds_no_section(case):
    assert 'id="seeds"' not in case[2]


def test_the_same_inputs_give_the_same_bytes(case):
    folder, result, text = case
    assert write(folder, json.loads(json.dumps(result))) == text


def test_the_path_drawn_is_the_motion_of_the_result():
    _, found, drawing = vc_case()
    assert isinstance(found.realisation.path, Way)
    np.testing.assert_allclose(drawing.route[0], [1.5, 1.5], atol=1e-9)
    np.testing.assert_allclose(drawing.route[-1], [14.5, 9.2], atol=1e-9)
