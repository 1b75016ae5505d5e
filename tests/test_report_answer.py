"""The answer is three sentences whatever the result; what a stage could not do stands in its section."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from report_case import corner_path, motion, warehouse
from test_report import Page, without_scripts

import verify
from verify.report import ReportExtras, write_report
from verify.report.answer import answer
from verify.report.story_missing import SECTIONS, by_section

REFINED = {"travel_time": 25.0, "length": 40.0, "model": "full"}
DRIVEN = {"model": "four_wheel", "travel_time": 25.1, "max_tracking_error": 0.01}
STOPS = {"emergency_stops": {"tried": 400, "bad": 0, "collisions": 0}}


def result(**changes: Any) -> dict[str, Any]:
    """A refined motion of 25 s, proven bound 20 s, ends that cost 4 s more."""
    told = {"verdict": "refined", "executed": "refined", "plans": {"refined": REFINED},
            "lower_bound": {"travel_time": 20.0}, "end_cost": 4.0, "simulation": DRIVEN | STOPS}  # fmt: skip
    return told | changes


def said(told: dict[str, Any], **more: Any) -> tuple[str, ...]:
    return tuple(sentence.replace("\u00a0", " ") for sentence in answer(told, **more))


STUCK = {"dwa": {"reached": False, "stopped_after": 3.0}}
STATES: dict[str, dict[str, Any]] = {
    "refined": result(),
    "nothing": {},
    "failed": result(verdict="failed", executed=None),
    "stuck": result(plans=STUCK, executed="dwa"),
    "no bound": result(lower_bound={}),
    "no simulation": result(simulation={}),
    "fallen": result(simulation={"fell": True}),
    "certified": result(verdict="certified", executed="speed_graph",
                        plans={"speed_graph": {"travel_time": 20.01, "model": "variational"}}),
    "zone": result(zone={"isotropic": False}, plans={"refined": REFINED, "uniform": {"travel_time": 27.5}}),
    "bad stops": result(simulation=DRIVEN | {"emergency_stops": {"tried": 400, "bad": 3}}),
    "another shape": result(plans=[3], lower_bound=4, simulation="no", verdict=["x"], zone=1),
}  # fmt: skip


@pytest.mark.parametrize("state", STATES)
def test_in_every_state_the_answer_is_three_short_sentences(state):
    sentences = said(STATES[state])
    assert len(sentences) == 3
    for sentence in sentences:
        assert re.fullmatch(r"[A-Z][^.]*(?:\d\.\d[^.]*)*\.", sentence), sentence  # one full stop, at the end
        assert len(sentence) <= 180
        assert "nan" not in sentence.lower()
        assert "None" not in sentence


def test_how_fast():
    assert said(result())[0] == "The robot gets there in 25.000 s on a path of 40.00 m."
    assert said(STATES["zone"])[0].endswith("40.00 m, 2.500 s sooner than with uniform braking.")  # 27.5 - 25
    first, second, _ = said(result(), through=["A/B"])
    assert first.endswith("40.00 m through A/B, as asked.")
    # the bound is over all ways: what the gate costs is in the difference
    assert second.startswith("No motion with these ends, by whatever way, can take less than 24.000 s, which")
    assert second.endswith("this one, through the gate asked for, takes 4.17 % more.")
    assert said(STATES["failed"])[0].startswith("No trajectory passed all checks; the full-robot ")
    assert said(STATES["stuck"])[0] == "There is no motion to execute: no stage produced a trajectory."


def test_how_we_know_that_nothing_is_faster():
    # 20 s and 4 s for the ends: 24 s, and 25 / 24 - 1 = 4.17 %
    told = (
        "No motion with these ends can take less than 24.000 s, which is proven; this one takes 4.17 % more."
    )
    assert said(result())[1] == told
    # a plan of the variational model has safe ends: 20.01 / 20 - 1 = 0.05 %
    assert said(STATES["certified"])[1].endswith("20.000 s, which is proven; this one takes 0.050 % more.")
    # faster than what is proven, so it breaks a limit and is not compared
    broken = result(plans={"refined": {**REFINED, "travel_time": 23.0}})
    assert said(broken)[1] == "That no motion with these ends can take less than 24.000 s is proven."
    assert said(STATES["no bound"])[1] == "Nothing proves that no motion is faster: there is no lower bound."
    refused = result(lower_bound={"reasons": ["a triangle is too steep"]})
    assert said(refused)[1] == "Nothing proves that no motion is faster: the certificate is refused."


def test_whether_a_vehicle_does_it():
    told = "In simulation a four-wheeled vehicle drove it in 25.100 s within 10.0 mm of the plan"
    assert said(result())[2] == f"{told}, and none of 400 emergency stops on the way failed."
    assert said(STATES["bad stops"])[2] == f"{told}; 3 of 400 emergency stops on the way failed."
    assert said(result(simulation=DRIVEN))[2] == f"{told}; emergency stops were not judged."
    assert said(STATES["no simulation"])[2].startswith("Whether a vehicle can drive it is open")
    assert said(STATES["fallen"], lost="It fell after 2 s.")[2] == "It fell after 2 s."
    strayed = result(checks=[{"name": "tracking", "status": "failed"}])
    assert ", but did not follow the plan" in said(strayed)[2]


# what a stage could not do


def stages() -> set[str]:
    """Every stage that the pipeline runs or skips, by name, read from its source."""
    found = set()
    for file in Path(verify.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)):
                continue
            owner = node.func.value
            if isinstance(owner, ast.Name) and owner.id == "stages" and node.func.attr in ("run", "skip"):
                found |= {arg.value for arg in node.args[:1] if isinstance(arg, ast.Constant)}
    return found


PLACES = {
    "voronoi": "map", "speed_graph": "classes", "vc_method": "vc-method", "voronoi_route": "times",
    "seeds": "seeds", "seed_comparison": "seeds", "uniform": "times", "collocation": "mesh",
    "refined": "mesh", "fields": "times", "dwa": "times", "lower_bound": "bound",
    "simulation": "simulation", "single_track": "simulation", "emergency_stops": "stops",
    "studies": "limits", "replay": "simulation",
}  # fmt: skip


def test_every_stage_of_the_pipeline_has_a_place_in_the_page():
    assert len(stages()) > 12
    assert stages() <= set(PLACES)


def sections(text: str) -> dict[str, str]:
    """What is read under each heading with an id, up to the next such heading."""
    parts = re.split(r'<h[23][^>]*\bid="([a-z-]+)"', without_scripts(text))
    return {name: re.sub(r"<[^>]+>", " ", rest) for name, rest in zip(parts[1::2], parts[2::2], strict=True)}


@cache
def page_without(folder: Path, stage: str) -> str:
    told: dict[str, Any] = {"missing": [{"stage": stage, "reason": f"the {stage} gave up"}]}
    if stage == "replay":
        motion(warehouse(), corner_path(), share=1.0, ends=None, step=5.0).to_csv(folder / "trajectory.csv")
        (folder / "simulation.csv").write_text("t,x,y,heading,v\n0,28.5,1.9,3.14,0\n1,28,1.9,3.14,0\n")
    file = folder / "report.html"
    write_report(file, scenario=warehouse(), result=told, folder=folder, extras=ReportExtras())
    text = file.read_text(encoding="utf-8")
    Page(text)  # well formed
    return text


@pytest.mark.parametrize("stage", PLACES)
def test_what_a_stage_could_not_do_is_told_where_its_picture_would_be(tmp_path, stage):
    found = sections(page_without(tmp_path, stage))
    assert f"the {stage} gave up" in found[PLACES[stage]]
    assert "Not shown." in found[PLACES[stage]]
    assert f"the {stage} gave up" in found["not-evaluated"]


def test_without_anything_every_section_says_what_is_not_there(tmp_path):
    found = sections(page_without(tmp_path, "none of ours"))
    for name in ("answer", "explore-title", "bound", "map", "speed", "acceleration", "margins", "mesh",
                 "simulation", "stops", "limits", "gates", "checks"):  # fmt: skip
        assert "Not shown." in found[name], name
    assert "the none of ours gave up" in found["times"]


def test_zones_tell_in_their_own_section_what_was_not_planned():
    told = {"missing": [{"stage": "fields", "reason": "no field fits"}, {"stage": "uniform"}]}
    found = by_section(told)
    assert found["zone"] == [
        "The field set could not finish: no field fits.",
        "The motion with uniform braking could not finish: no reason was recorded.",
    ]
    assert set(found) == SECTIONS


def test_a_stage_that_was_not_run_is_not_said_to_have_failed():
    told = {"missing": [{"stage": "refined", "reason": "not run: it needs a seed"}]}
    assert by_section(told)["mesh"] == ["The collocation of the full robot was not run: it needs a seed."]
