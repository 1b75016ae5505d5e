"""The simulated vehicle in the report: emergency stops, wheels, limits, other vehicles, how it is wired."""

from __future__ import annotations

import copy
import math
import re
import shutil
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from report_case import warehouse, write_folder
from report_stops import STUDIES, add_stops, stop_rows
from test_report import HOSTILE, Page, without_scripts

from verify.report import ReportExtras, story, write_index, write_report
from verify.report.answer import answer
from verify.report.answer_details import details
from verify.report.evidence import SimulatedRun, read_evidence
from verify.report.figures_limits import draw_limits
from verify.report.figures_run import draw_run, panels
from verify.report.figures_stops import StopsData, draw_stop_figures, draw_stops_map
from verify.report.html import render
from verify.report.simulation import graphviz_source, simulation_sections
from verify.report.stops import StopPaths, read_stop_paths
from verify.report.story_limits import (
    case_rows,
    margin,
    margin_sentences,
    robustness_sentence,
    shown_columns,
    why_no_margin,
)
from verify.report.story_missing import by_section
from verify.report.story_stops import WORST_CHORD, leaving, sharing, stop_story, stops_sentence
from vnav_drake.problem import Problem

INSTANTS = 12


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any], str]:
    """The case of `report_case` with wheels and stops, and its page."""
    folder = tmp_path_factory.mktemp("stops") / "warehouse"
    scenario = warehouse()
    result = write_folder(folder, scenario)
    add_stops(folder, scenario.problem, result, INSTANTS)
    (folder / "replay.html").write_text("<!DOCTYPE html>")
    write_report(
        folder / "report.html", scenario=scenario, result=result, folder=folder, extras=ReportExtras()
    )
    return folder, result, (folder / "report.html").read_text(encoding="utf-8")


def section(folder: Path, result: dict[str, Any], **changed: Any) -> str:
    """The section on the simulation alone, with nothing else to draw."""
    scenario = warehouse()
    scenario = replace(scenario, simulation=replace(scenario.simulation, **changed))
    told = simulation_sections(scenario, result, read_evidence(folder), "refined")
    return render("simulation.html", marks=story.MARKS, undone=by_section(result), **told)


def said(text: str) -> str:
    return Page(text).text.replace("\u00a0", " ").replace("\u202f", " ")


@pytest.fixture
def bare(case, tmp_path: Path) -> Path:
    """A folder with the stops alone: no other pictures to draw."""
    shutil.copy(case[0] / "stops.npz", tmp_path)
    return tmp_path


def stops_of(problem: Problem, *stops: tuple[tuple[float, float, float, float], float, bool]) -> StopPaths:
    """Stops of a point: start (x, y, heading, v), curvature, whether straightened."""
    rows = [stop_rows(problem, start, curvature) for start, curvature, _ in stops]
    table = np.concatenate(rows)
    return StopPaths(
        model="four_wheel",
        instant=np.arange(len(stops), dtype=float),
        straightened=np.array([straight for *_, straight in stops]),
        first=np.concatenate([[0], np.cumsum([len(r) for r in rows])]),
        t=table[:, 0],
        x=table[:, 1],
        y=table[:, 2],
        v=table[:, 4],
    )


def slippery(share: float = 1.0) -> Problem:
    """The warehouse with friction of `share` times what full braking takes."""
    problem = warehouse().problem
    return replace(problem, robot=replace(problem.robot, friction=share / 9.81))


# the whole page


def test_the_page_with_stops_is_well_formed(case):
    page = Page(case[2])
    ids = [attributes["id"] for _, attributes in page.elements if "id" in attributes]
    assert len(ids) == len(set(ids))
    wanted = [a["href"][1:] for _, a in page.elements if a.get("href", "").startswith("#")]
    wanted += re.findall(r"url\(#([^)]+)\)", without_scripts(case[2]))
    assert set(wanted) <= set(ids)
    links = {a["href"] for _, a in page.elements if not a.get("href", "#").startswith("#")}
    assert links == {"replay.html"}
    for key in (
        "run-channels",
        "stops-map",
        "stops-distance",
        "stops-displacement",
        "stops-clearance",
        "limits",
    ):
        assert f'id="figure-{key}"' in case[2]


def test_the_answer_and_the_key_figures_tell_of_stops_and_margin(case):
    least = case[1]["simulation"]["emergency_stops"]["min_clearance"]
    words = said(case[2])
    lead = said(re.search(r"<summary>Compared.*?(?=</details>)", case[2], flags=re.DOTALL)[0])
    first = said(re.search(r'<p class="lead">.*?</p>', case[2], flags=re.DOTALL)[0])
    assert "and none of 24 emergency stops on the way failed." in first
    assert f"24 emergency stops on the way: none collides (least clearance {least:.2f} m)." in lead
    assert (
        "The vehicle holds the whole motion up to 2.31 times its speed, then it slides "
        "(drive and brakes as strong as that takes)." in lead
    )
    assert "Bad emergency stops 0 of 24" in words
    assert "Grip in hand 2.31 × the speed, until it slides, with drive and brakes to match; not a" in words
    assert "braking zone and emergency stops are examined at the planned speed only" in words


def test_without_a_replay_the_page_says_so(case, bare):
    assert "No replay: there is no simulated run." in said(section(bare, case[1]))
    (bare / "stops.npz").unlink()
    (bare / "simulation.csv").write_text("t,x,y,heading,v\n0,0,0,0,0\n1,1,0,0,1\n")
    assert "No replay: replay.html is not beside this report." in said(section(bare, {}))
    missing = {"missing": [{"stage": "replay", "reason": "no port is free"}]}
    assert "No replay: no port is free." in said(section(bare, missing))


# what stops are measured by


def test_way_displacement_and_claim_of_a_stop_are_those_of_its_circle():
    # mu g = 5.9 m/s^2 lets a_b = 1 act in full: 2 m long from 2 m/s, on a radius of 1 m a chord of 2 sin 1.
    problem = replace(warehouse().problem, robot=replace(warehouse().problem.robot, friction=0.9))
    stops = stops_of(problem, ((5.0, 2.0, 0.0, 2.0), 0.0, True), ((5.0, 2.0, 0.0, 2.0), 1.0, False))
    assert stops.claimed(problem.braking) == pytest.approx([2.0, 2.0])
    # it stands at 1 cm/s or less, (1 cm/s)^2 / 2 before the end; rows every 20 ms cut 2e-4 of a circle
    assert stops.driven == pytest.approx([2.0, 2.0], rel=3e-4)
    assert stops.displacement == pytest.approx([2.0, 2.0 * math.sin(1.0)], rel=3e-4)


def test_a_reaction_time_adds_its_way_to_the_claim_and_to_the_stop():
    problem = warehouse().problem
    problem = replace(problem, braking=replace(problem.braking, reaction_time=0.5))
    stops = stops_of(problem, ((5.0, 2.0, 0.0, 2.0), 0.0, True))
    assert stops.claimed(problem.braking) == pytest.approx([3.0])  # 2 * 0.5 + 2^2 / 2
    assert stops.driven == pytest.approx([3.0], rel=1e-3)


def test_the_least_clearance_is_at_the_row_nearest_to_the_wall():
    # Towards the wall y = 0 from y = 3 at 2 m/s: stands 2 m further, 1 m from the wall, disc of 0.4 m.
    problem = warehouse().problem
    stops = stops_of(
        problem, ((28.5, 3.0, -math.pi / 2, 2.0), 0.0, True), ((28.5, 3.0, math.pi / 2, 1.0), 0.0, True)
    )
    least, row = stops.nearest(problem)
    assert least == pytest.approx([0.6, 2.6], abs=1e-3)  # the second one drives away: nearest where it begins
    assert row.tolist() == [stops.first[1] - 1, stops.first[1]]


@pytest.mark.parametrize("turn", [0.3, 0.7, 0.95])
def test_a_stop_with_the_steering_held_shares_friction_between_turning_and_braking(turn):
    # mu g = a_b = 1: an arc of asin(lambda)/(2 kappa), its chord 4 sin(asin(lambda)/4)/lambda times v^2/2.
    problem, curvature = slippery(), 0.5
    stops = stops_of(problem, ((5.0, 2.0, 0.0, math.sqrt(turn / curvature)), curvature, False))
    assert stops.driven == pytest.approx([math.asin(turn) / (2.0 * curvature)], rel=2e-3)
    ratio = stops.displacement / stops.claimed(problem.braking)
    assert ratio == pytest.approx([4.0 * math.sin(math.asin(turn) / 4.0) / turn], rel=2e-3)
    assert ratio[0] > 1.0


def test_at_the_limit_the_chord_is_half_as_long_again():
    # asin(1) = pi/2: 4 sin(pi/8) = 2 sqrt(2 - sqrt 2).
    assert pytest.approx(2.0 * math.sqrt(2.0 - math.sqrt(2.0)), rel=1e-15) == WORST_CHORD


# what is said of them


def turning_run(lateral: float) -> SimulatedRun:
    t = np.linspace(0.0, 3.0, 50)
    return SimulatedRun(t, t, t, t, t, channels={"lateral_acceleration": lateral + 0.0 * t})


def left(problem: Problem, stops: StopPaths, **figures: Any) -> dict[str, Any]:
    """A result in which two of four stops leave their disc."""
    kinds = {"held": {"left_zone": 2, "worst_distance_ratio": 1.2}, "straightened": {"left_zone": 0}}
    found = {
        "tried": 4, "instants": 2, "collisions": 0, "falls": 0, "not_stopped": 0, "left_zone": 2, "slid": 0,
        "lifted": 0, "min_clearance": 0.5, "bad": 0, "worst_displacement_ratio": 1.2345, **kinds, **figures,
    }  # fmt: skip
    return {"simulation": {"emergency_stops": found}}


def test_stops_that_leave_their_disc_are_told_as_a_finding_about_the_source():
    problem = slippery()
    stops = stops_of(problem, ((5.0, 2.0, 0.0, 1.2), 0.6, False), ((5.0, 2.0, 0.0, 1.2), 0.0, True))
    told = stop_story(left(problem, stops), problem, stops, turning_run(0.6 * 1.2**2), asked=True)
    words = " ".join(told.finding).replace("\u00a0", " ")
    assert "2 of 4 stops leave the disc" in words
    # of the stop that leaves: 4 sin(asin(0.864)/4)/0.864 = 1.194, whatever ratio other stops may have
    assert "1.194 times its radius away: 2 with steering held, none with the wheels straight." in words
    # lambda = 0.6 * 1.2^2 / 1 = 0.864, which leaves sqrt(1 - 0.864^2) = 0.503 m/s^2
    assert "In 1 of them the steering was held in a bend" in words
    assert "here up to 0.864, only μg√(1 − λ²) = 0.503 m/s² are left" in words
    assert "Manor 2015, Definition 9" in words
    assert "forbid to turn at all" in words  # a_b takes all of mu g: a reserve alone is no cure
    grip = slippery(1.2)
    told = stop_story(left(grip, stops), grip, stops, turning_run(0.864), asked=True)
    assert "braking.friction_reserve keeps" in told.finding[-1]
    assert told.finding[-1].endswith("it cures this.")


def test_where_friction_suffices_the_source_is_not_to_blame():
    problem = slippery(3.0)  # sqrt(9 - 0.864^2) = 2.87 m/s^2 are left, a_b = 1
    # a vehicle that brakes at 0.9 m/s^2 instead: 1/0.9 = 1.111 times as far
    slow = replace(problem, braking=replace(problem.braking, max_braking=0.9))
    stops = stops_of(slow, ((5.0, 2.0, 0.0, 1.2), 0.0, False))
    assert leaving(problem, stops).tolist() == [True]
    shared, turn = sharing(problem, stops, turning_run(0.864))
    assert not shared.any()
    assert turn == 0.0
    told = stop_story(left(problem, stops), problem, stops, turning_run(0.864), asked=True)
    assert told.finding[1].startswith("They end up to 1.111 times as far away as claimed")
    assert not any("source" in words for words in told.finding)


def test_with_the_reserve_leaving_the_disc_is_a_failure():
    problem = replace(slippery(1.5), friction_reserve=True)
    stops = stops_of(slippery(), ((5.0, 2.0, 0.0, 1.2), 0.6, False))
    told = stop_story(left(problem, stops, bad=2), problem, stops, None, asked=True)
    assert told.finding[-1] == "As braking.friction_reserve is asked for, each of them counts as failed."
    assert "2 count against the gate" in told.sentences[0]


def test_stops_that_stay_in_their_disc_find_nothing(case):
    found = case[1]["simulation"]["emergency_stops"]
    assert found["left_zone"] == 0  # mu g = 5.9 m/s^2 is enough for a_b = 1 in every bend
    told = stop_story(case[1], warehouse().problem, read_stop_paths(case[0])[0], None, asked=True)
    assert told.finding == []
    assert "24 stops (12 instants, steering held and wheels straightened): none collides" in told.sentences[0]


@pytest.mark.parametrize(
    ("counts", "words"),
    [
        ({"collisions": 0, "bad": 0}, "none collides"),
        ({"collisions": 1, "bad": 1}, "1 collides"),
        ({"collisions": 2, "falls": 1, "bad": 3}, "2 collide, 1 falls over"),
        ({"not_stopped": 3, "bad": 5}, "3 do not come to rest, 5 count against the gate in all"),
        ({}, "no count of collisions was recorded"),
    ],
)
def test_stops_that_end_badly_are_counted_by_cause(counts, words):
    told = stops_sentence({"simulation": {"emergency_stops": {"tried": 400, **counts}}})
    assert told == f"400 emergency stops on the way: {words}."


def failed(**more: Any) -> dict[str, Any]:
    told = {
        "stop": 3,
        "instant": 1.5,
        "straightened": True,
        "cause": "collision",
        "x": 4.0,
        "y": -2.0,
        "t": 0.7,
    }
    return {**told, **more}


def test_failed_stops_are_drawn_strong_and_stand_in_a_table(case, bare):
    result = copy.deepcopy(case[1])
    result["simulation"]["emergency_stops"] |= {
        "bad": 4, "collisions": 3, "falls": 1,
        "failed": [failed(depth=0.123), failed(stop=0, straightened=False, cause="fall"), failed(stop=9999)],
    }  # fmt: skip
    text = section(bare, result)
    words = said(text)
    assert "3 collide, 1 falls over" in words
    assert "1.500 s straightened ✗ failed collision (4.00, −2.00) m 0.700 s 0.123 m deep" in words
    assert "1 more failed and are not listed." in words
    drawn = re.search(r'<figure class="picture" id="figure-stops-map">.*?</figure>', text, flags=re.DOTALL)[0]
    wide = drawn[: drawn.index('class="for-narrow"')]
    # two of the three are stops of this file: each a strong line, and a cross from one definition
    assert len(re.findall(r'stroke="var\(--limit\)" stroke-width="2.6"', wide)) == 2
    assert "2 failed ones are drawn strong" in wide


def test_the_line_of_a_ratio_stands_at_one_and_small_claims_are_left_out():
    problem = warehouse().problem
    stops = stops_of(problem, ((5.0, 2.0, 0.0, 2.0), 0.0, False), ((5.0, 2.0, 0.0, 0.2), 0.0, True))
    data = StopsData(problem=problem, stops=stops, run=None, executed=None)
    distance, away, clearance = draw_stop_figures(data)
    assert "Steering held: 1.000 to 1.000. Stops that claim less than 0.05 m" in distance.caption  # 0.02 m
    assert "wheels straightened" in clearance.caption
    assert "var(--limit)" in away.svg


# evidence that is not as it should be


@pytest.mark.parametrize("content", [None, b"", b"PK\x03\x04", b"not an archive"])
def test_stops_that_cannot_be_read_are_a_reason_in_place_of_the_picture(case, tmp_path, content):
    if content is not None:
        (tmp_path / "stops.npz").write_bytes(content)
    words = said(section(tmp_path, case[1]))
    assert "No picture of the stops: stops.npz" in words
    assert "24 stops" in words  # what the judge found is told all the same


def test_pickles_are_not_loaded(case, bare):
    with np.load(bare / "stops.npz") as file:
        arrays = dict(file)
    np.savez(bare / "stops.npz", **{**arrays, "model": np.array([{"a": 1}], dtype=object)})
    found, reason = read_stop_paths(bare)
    assert found is None
    assert reason


def test_where_no_stops_were_judged_the_reason_is_told(case, tmp_path):
    result = copy.deepcopy(case[1])
    del result["simulation"]["emergency_stops"]
    gate = {"name": "emergency_stops", "passed": None, "reason": "not evaluated: no stops were recorded"}
    result["gates"] = [gate]
    assert "No emergency stops: no stops were recorded." in said(section(tmp_path, result))
    assert "the scenario asks for none" in said(section(tmp_path, result, stops=0))
    assert "asks for no studies" in said(section(tmp_path, {"simulation": 3}, studies=False))


@pytest.mark.parametrize("spoilt", ["nan", "soon"])
def test_a_spoilt_column_leaves_the_motion_to_draw(case, tmp_path, spoilt):
    lines = (case[0] / "simulation.csv").read_text().splitlines()
    column = lines[0].split(",").index("tilt")
    cells = lines[5].split(",")
    cells[column] = spoilt
    (tmp_path / "simulation.csv").write_text("\n".join([*lines[:5], ",".join(cells), *lines[6:]]))
    run = read_evidence(tmp_path).simulation
    assert len(run.t) == len(lines) - 1
    assert "tilt" not in run.channels
    whole = read_evidence(case[0]).simulation
    assert whole.channels["tilt"].shape == whole.t.shape


def test_a_wheel_without_a_column_leaves_the_panel_out():
    t = np.linspace(0.0, 1.0, 9)
    one = {"load_front_left": 90.0 + t, "steering": 0.1 * t}
    run = SimulatedRun(t, t, t, t, t, channels=one)
    assert [panel.title for panel in panels(run, 0.6)] == ["Steering"]
    assert draw_run(SimulatedRun(t, t, t, t, t), 0.6) is None
    assert draw_run(run, 0.6).description == "Over 1.00 s: steering up to 0.100 rad."


def test_each_panel_has_its_wheels(case):
    run = read_evidence(case[0]).simulation
    assert [panel.title for panel in panels(run, 0.6)] == [
        "Wheel loads", "Slip over the floor", "Torque", "Steering",
    ]  # fmt: skip
    loads = panels(run, 0.6)[0]
    assert [name for name, *_ in loads.curves] == ["front left", "front right", "rear left", "rear right"]
    assert loads.level == (0.0, "lifted")
    # at rest each wheel carries 40 kg * 9.81 / 4 = 98.1 N
    assert np.mean([values for _, values, *_ in loads.curves]) == pytest.approx(98.1, rel=1e-3)


# limits and other vehicles


def limits(**more: Any) -> dict[str, Any]:
    return {"simulation": {"margin": {**STUDIES["margin"], **more}}}


def test_the_margin_stands_beside_the_analytic_limit():
    words = " ".join(margin_sentences(limits()))
    assert "up to 2.31 times its speed, then it slides (drive and brakes as strong as that takes)." in words
    assert "the friction circle would end it at 2.43 times" in words
    assert (
        "At 2.55 times the speed, which takes 1.10 times what that limit allows, the run is flagged" in words
    )
    kind = " ".join(margin_sentences(limits(over={"factor": 2.55, "demand": 1.1, "flagged": False})))
    assert "nothing was noticed: the simulation is too kind there." in kind
    most = margin_sentences(limits(factor=4.0, ended_by="nothing up to 4"))[0]
    assert (
        most == "The vehicle still holds the whole motion at 4.00 times its speed, the most that was tried."
    )
    assert "at none of the speeds" in margin_sentences(limits(factor=0.0))[0]
    below = margin_sentences(limits(factor=0.9, ended_by="is late"))[0]
    assert below == "The vehicle holds the whole motion only at 0.900 times its speed, then it is late."


@pytest.mark.parametrize(
    ("result", "asked", "words"),
    [
        ({"simulation": {"fell": True}}, True, "the vehicle does not follow the motion as it is planned"),
        ({"simulation": {"fell": True}}, False, "the scenario asks for no studies"),
        ({"simulation": {"a": 1}, "missing": [{"stage": "studies"}]}, True, "the studies could not finish"),
        ({}, True, "there is no simulated run"),
    ],
)
def test_without_a_margin_the_reason_is_told(result, asked, words):
    assert words in why_no_margin(result, asked=asked)


def test_runs_that_held_are_dots_and_those_that_did_not_are_crosses():
    picture = draw_limits(margin(limits()))
    # four of six runs held; over the limit is a seventh, which did not
    assert "4 runs held, up to factor 2.31; 3 did not, from factor 2.34 on" in picture.description
    crosses = re.findall(r'<use href="#([^"]+)"[^>]* fill="var\(--limit\)"/>', picture.svg)
    assert len(crosses) == 3
    assert re.search(rf'<path id="{crosses[0]}"[^>]* stroke="var\(--paper\)"', picture.svg)  # their rim


def test_other_vehicles_have_a_verdict_in_words():
    rows = case_rows({"simulation": STUDIES})
    assert [row.status for row in rows] == ["passed", "passed", "failed"]
    assert rows[2].verdict == "does not hold: it lifts a wheel"
    assert (rows[0].error, rows[0].least_load, rows[0].slid) == ("4.00\u00a0mm", "81\u00a0%", "no")
    assert robustness_sentence(rows).startswith("The controller copes with 2 of 3 cases")
    assert "all 2 cases" in robustness_sentence(rows[:2])
    assert [key for key, _ in shown_columns(rows)] == ["error", "travel_time", "least_load", "slid"]
    assert shown_columns(case_rows({"simulation": {"robustness": [{"case": "a", "max_lateness": 0.1}]}})) == [
        ("lateness", "Greatest delay")
    ]


@pytest.mark.parametrize(
    "told",
    [
        {"emergency_stops": {"tried": "many", "failed": 3}, "margin": {"runs": 3}, "robustness": {"a": 1}},
        {"emergency_stops": {"tried": 4, "failed": [None, {}, {"stop": 1e300, "x": "a"}], "left_zone": 1,
                             "held": 3}, "margin": {"factor": 1e300, "runs": [{}, {"factor": -1}, None],
                                                    "analytic": -3.0}, "robustness": [None, {}, {"case": 3}]},
        {"emergency_stops": {"tried": 2, "bad": -1}, "margin": {"runs": [{"factor": 1e9, "holds": "yes"}],
                                                                "over": {"factor": "x"}, "ended_by": 3}},
    ],
)  # fmt: skip
def test_a_simulation_of_another_shape_still_gives_a_section(bare, told):
    words = said(section(bare, {"simulation": {**told, "single_track": [1]}}))
    assert "Emergency stops" in words
    assert "nan" not in words.split()
    assert all(answer({"simulation": told}))


def test_words_from_the_simulation_are_never_markup(bare):
    told = {
        "emergency_stops": {"tried": 24, "bad": 1, "failed": [failed(stop=2, cause=HOSTILE)]},
        "margin": {"factor": 2.0, "ended_by": HOSTILE, "analytic": 3.0, "analytic_by": HOSTILE,
                   "runs": [{"factor": 2.5, "holds": False, "cause": HOSTILE}],
                   "over": {"factor": 3.3, "demand": 1.1, "flagged": True, "cause": HOSTILE}},
        "robustness": [{"case": HOSTILE, "holds": False, "cause": HOSTILE}],
    }  # fmt: skip
    text = section(bare, {"simulation": told, "missing": [{"stage": "replay", "reason": HOSTILE}]})
    page = Page(text)
    assert not {tag for tag, _ in page.elements} & {"script", "img", "b"}
    assert page.text.count("<script>alert(1)</script>") >= 5
    assert not re.search("[\u0000-\u0008\u000b-\u001f\u202a-\u202e\u2066-\u2069]", text)


# what else the page tells


def test_a_motion_that_was_slowed_down_says_what_that_cost():
    plan = {"travel_time": 25.5, "limit_share": 0.96, "full_limit_time": 25.0}
    words = " ".join(details({"plans": {"refined": plan}}, rest_ends=False)).replace("\u00a0", " ")
    assert "At the very limits (25.000 s) the simulated vehicle could not follow" in words
    assert "with 96 % of grip, tip-over, steering and drive limits, which takes 2.00 % longer." in words


def test_the_index_tells_the_bad_stops(case, tmp_path):
    write_index(tmp_path / "index.html", [("a", case[1]), ("b", {"verdict": "refined"})])
    words = said((tmp_path / "index.html").read_text())
    assert "Bad stops" in words
    assert "0 of 24" in words


def test_the_map_draws_every_stop_once_in_its_kind():
    problem = warehouse().problem
    stops = stops_of(
        problem, ((5.0, 2.0, 0.0, 1.0), 0.0, False), ((5.0, 2.0, 0.0, 1.0), 0.0, True),
        ((9.0, 2.0, 0.0, 1.0), 0.0, False),
    )  # fmt: skip
    picture = draw_stops_map(StopsData(problem=problem, stops=stops, run=None, executed=None))
    (held,) = re.findall(r'<path d="([^"]*)"[^>]*stroke="var\(--simulation\)"', picture.svg)
    (straight,) = re.findall(r'<path d="([^"]*)"[^>]*stroke="var\(--straightened\)"', picture.svg)
    assert (held.lower().count("m"), straight.lower().count("m")) == (2, 1)


def test_the_source_of_a_diagram_does_not_depend_on_what_was_built_before():
    from pydrake.systems.framework import DiagramBuilder
    from pydrake.systems.primitives import Adder

    def source() -> str:
        builder = DiagramBuilder()
        parts = [builder.AddNamedSystem(f"s{k}", Adder(1, 1)) for k in range(6)]
        for one, other in pairwise(parts):
            builder.Connect(one.get_output_port(), other.get_input_port())
        return builder.Build().GetGraphvizString(max_depth=1)

    first, second = source(), source()
    assert first != second
    assert graphviz_source(first) == graphviz_source(second)
    assert graphviz_source(first).count(" -> ") == 5
    assert "name=s5" in graphviz_source(first)  # names are left alone
