"""Times that are none to compare with: another way, a limit broken, other ends, nothing executed."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from report_case import corner_path, motion, warehouse, write_folder
from test_report import Page, extras

from verify.report import write_report
from verify.report.answer import answer
from verify.report.answer_details import others
from verify.report.evidence import Evidence
from verify.report.figures_time import BracketData, BracketRow, draw_bracket
from verify.report.key_figures import key_figures
from verify.report.palette import METHODS, PAPER, variable_of_colour
from verify.report.story import is_executed
from verify.report.story_times import breaks, time_rows, window_sentence
from verify.report.story_vc import vc_story
from vnav_drake.plan import Trajectory


def result(**plans: Any) -> dict[str, Any]:
    """Variational optimum 20 s, best of the full robot 25 s."""
    known = {
        "speed_graph": {"travel_time": 20.0, "model": "variational", "feasible": False},
        "refined": {"travel_time": 25.0, "model": "full", "feasible": True},
    }
    return {"verdict": "refined", "executed": "refined", "plans": known | plans}


def beside(told: dict[str, Any], *, rest_ends: bool = False) -> str:
    return " ".join(others(told, rest_ends=rest_ends)).replace("\u00a0", " ")


def section(told: dict[str, Any], *, rest_ends: bool = False) -> str:
    return " ".join(vc_story(told, rest_ends=rest_ends).sentences).replace("\u00a0", " ")


def vc(**changes: Any) -> dict[str, Any]:
    return {"travel_time": 26.0, "arc_time": 27.0, "model": "full", "feasible": True} | changes


SLIPS = vc(feasible=False, violations={"steering": 3.0, "goal": 0.2})
ASTRAY = vc(travel_time=15.0, passes_through=False)


@pytest.mark.parametrize("rest_ends", [False, True])
def test_a_plan_by_another_way_is_compared_nowhere(rest_ends):
    told = result(vc_method=ASTRAY, voronoi_route={"travel_time": 22.0, "passes_through": False})
    words = beside(told, rest_ends=rest_ends)
    assert "The vc-method takes 15.000 s, by another way than asked for." in words
    assert "takes 22.000 s, by another way than asked for." in words
    assert "It goes by another way than asked for" in section(told, rest_ends=rest_ends)
    assert "%" not in words + section(told, rest_ends=rest_ends)
    rows = {row.look.key: row.above for row in time_rows(told)}
    assert rows["vc_method"] == rows["voronoi_route"] == "by another way than asked for"
    assert rows["refined"] == "+25.0\u00a0%"  # 25 s against 20 s


def test_a_plan_that_passes_what_was_asked_for_is_compared():
    # 26 s against 20 s: 30 % above
    told = result(vc_method=vc(passes_through=True))
    assert "30.0 % above the variational optimum." in beside(told)
    assert "That is 30.0 % above the variational optimum," in section(told)


def test_with_ends_at_rest_the_vc_method_is_held_against_the_full_robot_first():
    # 26 / 25 = 1.04 and 26 / 20 = 1.3
    told = result(vc_method=vc())
    both = "4.00 % above the full robot's best, 30.0 % above the variational optimum, which "
    assert both + "may start and end at the safe speed." in beside(told, rest_ends=True)
    assert f"That is {both}knows no limit of drive or turning and may" in section(told, rest_ends=True)
    assert "full robot's best" not in beside(told) + section(told)
    failing = result(vc_method=vc(), refined={"travel_time": 25.0, "feasible": False})
    assert "full robot's best" not in beside(failing, rest_ends=True)


def test_a_plan_of_the_full_model_that_breaks_a_limit_says_so_wherever_its_time_stands():
    told = result(vc_method=SLIPS, dwa=vc(feasible=False))
    limits = "but {}breaks the steering limit and the speed or heading asked at the goal"
    assert limits.format("") in beside(told)
    assert f"the motion 26.000 s: there is no corner to round, {limits.format('it ')}." in section(told)
    rows = {row.look.key: row.breaks for row in time_rows(told)}
    assert rows["vc_method"] == "breaks: steering, end heading or speed"
    assert rows["dwa"] == "breaks: a check"
    # the variational optimum is of another model, and the refined motion breaks nothing
    assert rows["speed_graph"] == rows["refined"] == ""


def chart(**changes: Any) -> tuple[str, str]:
    """Description and drawing; the other motion takes no part in what is tried."""
    row = BracketRow(method="vc_method", travel_time=26.0, **changes)
    rows = [BracketRow(method="speed_graph", travel_time=20.0), row]
    picture = draw_bracket(BracketData(rows=rows, reference="speed_graph", executed=""))
    return picture.description, str(picture.svg)


def test_the_chart_marks_what_breaks_a_limit_hollow_and_in_words():
    words, drawn = chart(breaks="breaks: steering")
    assert "vc-method 26.000\u00a0s, breaks: steering" in words
    paper, line = variable_of_colour()[PAPER.light], METHODS["vc_method"].variable

    def fills(svg: str) -> list[str]:
        """Of the marks whose rim has the method's colour."""
        (name,) = re.findall(rf'<path id="([^"]+)"[^>]* stroke="var\({line}\)"', svg) or [""]
        return re.findall(rf'<use href="#{name}"[^>]* fill="([^"]+)"', svg)

    assert fills(drawn) == [f"var({paper})"]
    assert fills(chart()[1]) == []


def test_the_chart_joins_no_time_of_another_way_to_the_reference():
    words, drawn = chart(astray=True)
    assert "by another way than asked for" in words
    colour = METHODS["vc_method"].variable
    bar = re.compile(rf'fill="none" stroke="var\({colour}\)" stroke-width="2.5"')
    assert bar.search(chart()[1])
    assert not bar.search(drawn)


def places(*times: float) -> tuple[list[float], str]:
    """Where the marks of further methods stand [px], and the caption; reference 20 s, bound 19.9 s."""
    rows = [
        BracketRow(method="lower_bound", travel_time=19.9),
        BracketRow(method="speed_graph", travel_time=20.0),
        *(BracketRow(method=f"m{k}", travel_time=time) for k, time in enumerate(times)),
    ]
    picture = draw_bracket(BracketData(rows=rows, reference="speed_graph", executed="speed_graph"))
    xs = re.findall(r'<use href="#[^"]+" x="([0-9.]+)" y="[0-9.]+" fill="var\(--other\)"/>', str(picture.svg))
    return [float(x) for x in xs], picture.caption


def test_a_time_far_off_does_not_squeeze_the_others():
    (alone,), nothing = places(21.0)
    (near, far), words = places(21.0, 60.0)
    # 60 s is more than 1.4 times the least time: the axis stays, and an arrow stands at its end.
    assert near == pytest.approx(alone, abs=1.0)
    assert far > near
    assert nothing == ""
    assert words == "Arrows at the right edge: times far beyond the axis."
    assert places(21.0, 24.0)[1] == ""  # 24 s is drawn to scale


def test_what_others_came_to_stands_apart_from_the_answer():
    told = result(
        vc_method=vc(), dwa={"travel_time": 40.0, "reached": True}, voronoi_route={"travel_time": 22}
    )
    first = " ".join(answer(told))
    assert not any(word in first for word in ("vc-method", "dynamic window", "Voronoi"))
    assert len(others(told, rest_ends=False)) == 3


def test_the_settings_of_a_window_that_reached_the_goal_are_told():
    told = {"reached": True, "weights": [1.0, 0.5, 2], "window": 1.5, "step": 0.25, "decisions": 36}
    assert window_sentence({"plans": {"dwa": told}}).replace("\u00a0", " ") == (
        "Dynamic window: weights 1 (heading), 0.5 (clearance), 2 (speed), window 1.5 s, step 0.25 s, "
        "36 decisions."
    )
    assert window_sentence({"plans": {"dwa": {**told, "reached": False}}}) == ""
    assert window_sentence({"plans": {"dwa": {"reached": True, "weights": ["a", 1, 2]}}}) == ""


def test_what_is_not_executed_is_not_called_executed():
    t = np.array([0.0, 1.0])
    still = Trajectory(t, t, 0 * t, 0 * t, 1 + 0 * t, 0 * t, 0 * t, 1 + 0 * t)
    evidence = Evidence(plans={"collocation": still}, executed=still, executed_plan="collocation",
                        simulation=None, scenario_text=None, reasons={})  # fmt: skip
    failed = {"verdict": "failed", "plans": {"collocation": {"travel_time": 1.0, "length": 1.0}}}
    assert not is_executed(failed)
    assert [row.executed for row in time_rows(failed)] == [False]
    assert [figure.note for figure in key_figures(failed, evidence)] == [
        "Variational collocation, not executed"
    ] * 3
    done = {**failed, "executed": "collocation"}  # executed all the same, as its gates failed afterwards
    assert [row.executed for row in time_rows(done)] == [True]
    assert key_figures(done, evidence)[2].note == "of the executed motion"


def page(folder: Path, told: dict[str, Any]) -> str:
    scenario = replace(warehouse(), description="")
    write_report(folder / "report.html", scenario=scenario, result=told, folder=folder, extras=extras())
    return (folder / "report.html").read_text(encoding="utf-8")


def test_a_page_without_an_executed_motion_names_the_one_it_shows(tmp_path):
    told = write_folder(tmp_path / "case", warehouse())
    files = ("trajectory", "simulation", "trajectories/refined", "trajectories/voronoi_route")
    for name in files:
        (tmp_path / "case" / f"{name}.csv").unlink()
    coarse = motion(warehouse(), corner_path(2.4), share=1.0, ends=None, step=2.0)  # drawn in no time
    coarse.to_csv(tmp_path / "case" / "trajectories" / "collocation.csv")
    del told["plans"]["refined"]
    told |= {"verdict": "failed"}
    told["plans"]["vc_method"] = {**SLIPS, "travel_time": 30.0}
    told["plans"]["dwa"] = {"travel_time": 40.0, "reached": True, "window": 1.0, "model": "full"}
    told["plans"]["dwa"]["passes_through"] = False
    text = page(tmp_path / "case", told)
    words = Page(text).text.replace("\u00a0", " ")
    assert "bold type" not in words
    assert "executed motion" not in text  # in descriptions of pictures neither
    assert "The broad line is the variational collocation, its colour the speed." in words
    assert "full ; breaks: steering, end heading or speed" in words
    assert "Hollow marks" in words
    chart_says = re.search(r'<desc id="bracket-desc">(.*?)</desc>', text)[1].replace("\u00a0", " ")
    assert "vc-method 30.000 s, breaks: steering, end heading or speed;" in chart_says
    assert "Dynamic window 40.000 s, by another way than asked for;" in chart_says
    assert "The variational optimum itself breaks the steering limit." in words  # and nothing repaired it
    assert "Dynamic window: window 1 s." in words
    lead, beside_it = (
        re.search(pattern, text, flags=re.DOTALL)[1]
        for pattern in (r'<p class="lead">(.*?)</p>', r"<summary>Compared(.*?)</details>")
    )
    assert "vc-method" in beside_it
    assert "vc-method" not in lead


def test_only_plans_of_the_full_model_break_limits_of_the_full_robot():
    assert breaks(result(), "speed_graph") == ""
    assert breaks(result(), "lower_bound") == ""
    assert breaks(result(vc_method=SLIPS), "vc_method").startswith("breaks: steering")
