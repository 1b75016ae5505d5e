"""Findings of the audit and the end of the run: what a page says must be as bad as what happened."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np
import pytest
from report_case import warehouse, write_folder
from test_report import Page
from test_report_console import judged

from verify.report import ReportExtras, figures_stops, story, write_index, write_report
from verify.report.answer import answer
from verify.report.curves import label_points
from verify.report.evidence import SimulatedRun
from verify.report.figures_stops import StopsData, draw_stop_figures, draw_stops_map, neighbours
from verify.report.numbers import percent_or_times
from verify.report.stops import StopPaths
from verify.report.story_stops import FailedStop, stop_story, stops_sentence
from verify.report.story_stuck import lost_run
from verify.report.story_times import compared
from verify.report.svg import new_axes
from verify.report.wording import GLOSSARY
from verify.summary import headline
from vnav_drake.problem import Problem


def said(text: str) -> str:
    return Page(text).text.replace("\u00a0", " ").replace("\u202f", " ")


# a run that fell


FELL = {"ended": "fallen", "arrived": False, "fell": True, "max_tracking_error": 0.131, "goal_distance": 7.6}


def falling(modes: bool = True) -> SimulatedRun:
    """A run along y = 2 at 1 m/s from x = 5 that falls after 3.2 s and is recorded for 0.3 s more."""
    t = np.arange(0.0, 3.501, 0.01)
    mode = np.where(t < 3.2 - 1e-9, 0.0, 3.0)
    return SimulatedRun(t, 5.0 + t, 2.0 + 0.0 * t, 0.0 * t, 1.0 + 0.0 * t, {"mode": mode} if modes else {})


def test_a_run_that_fell_is_told_with_time_and_place():
    found = lost_run({"simulation": FELL}, falling())
    assert found.sentence.replace("\u00a0", " ") == (
        "In simulation the vehicle fell after 3.20 s, at (8.20, 2.00) m, "
        "never nearer to the goal than 7.60 m."
    )
    assert found.place == pytest.approx((8.2, 2.0))
    assert (found.word, found.row.travel_time) == ("fell", "fell")
    assert lost_run({"simulation": FELL}, falling(modes=False)).place == pytest.approx(
        (8.5, 2.0)
    )  # its last row
    assert lost_run({"simulation": FELL}, None).place is None


@pytest.mark.parametrize(
    ("told", "word"),
    [
        ({"ended": "arrived", "arrived": True, "fell": False}, ""),
        ({"travel_time": 3.0}, ""),  # nothing is said against it
        ({"ended": "fallen"}, "fell"),
        ({"ended": "standing", "arrived": False}, "did not arrive"),
        ({"ended": "out_of_time"}, "did not arrive"),
        ({"ended": 3}, ""),
        ({"ended": "arrived", "max_lateral_error": 0.1, "travel_time": 3.0}, ""),
        ({"ended": "arrived", "max_lateral_error": 0.1}, "did not arrive"),  # the judge gives it no time
    ],
)
def test_what_became_of_a_run_is_one_word(told, word):
    assert story.unfinished({"simulation": told}) == word
    assert story.unfinished({"simulation": {"single_track": told}}, "single_track") == word
    assert bool(lost_run({"simulation": told}, falling())) == bool(word)


@pytest.mark.parametrize("claimed", [{}, {"travel_time": 3.25}])
def test_a_run_that_fell_has_no_travel_time(claimed):
    result = {"plans": {"refined": {"travel_time": 8.4}}, "simulation": {**FELL, **claimed}}
    assert story.travel_times(result) == {"refined": 8.4}
    words = " ".join(answer(result))
    assert "the vehicle fell." in words
    assert "stayed within" not in words
    assert "3.25" not in words


def test_the_page_of_a_run_that_fell_says_so_everywhere(tmp_path):
    folder, scenario = tmp_path / "warehouse", warehouse()
    result = write_folder(folder, scenario)
    run = falling()
    rows = np.column_stack([run.t, run.x, run.y, run.heading, run.v, run.channels["mode"]])
    names = "t,x,y,heading,v,mode"
    np.savetxt(folder / "simulation.csv", rows, delimiter=",", header=names, comments="")
    result["simulation"] = {**FELL, "travel_time": 3.25}
    file = folder / "report.html"
    write_report(file, scenario=scenario, result=result, folder=folder, extras=ReportExtras())
    text = file.read_text(encoding="utf-8")
    words = said(text)
    assert words.count("In simulation the vehicle fell after 3.20 s") == 2  # in the answer, at the times
    assert "3.250 s" not in words
    assert "Simulated run fell where the crossed ring is." in text
    assert "in simulation, until it fell" in words
    write_index(tmp_path / "index.html", [("warehouse", result)])
    listed = said((tmp_path / "index.html").read_text(encoding="utf-8"))
    assert "fell" in listed.split()
    assert "3.250" not in listed


# what the audit found, at the top


def audited(**figures: Any) -> dict[str, Any]:
    found = {"tried": 400, "bad": 0, "collisions": 0, "min_clearance": 0.98, **figures}
    return {"simulation": {"emergency_stops": found}}


@pytest.mark.parametrize(
    ("figures", "words"),
    [
        ({}, "none collides (least clearance 0.980 m)."),
        (
            {"left_zone": 122, "slid": 1, "lifted": 2},
            "none collides (least clearance 0.980 m), 122 end outside the braking disc that they claim, "
            "1 slides, 2 lift a wheel.",
        ),
        (
            {"collisions": 2, "bad": 2, "left_zone": 1},
            "2 collide (least clearance 0.980 m), 1 ends outside the braking disc that it claims.",
        ),
        (
            {"bad": 9, "left_zone": 9},
            "none collides (least clearance 0.980 m), 9 end outside the braking disc that they claim, "
            "9 count against the gate.",
        ),
    ],
)
def test_the_sentence_at_the_top_tells_what_the_audit_found(figures, words):
    told = stops_sentence(audited(**figures)).replace("\u00a0", " ")
    assert told == f"400 emergency stops on the way: {words}"


def test_the_verdict_of_a_success_tells_of_stops_that_leave_their_disc():
    gates = [{"name": "braking_margin", "value": 0.1, "limit": 0.0, "passed": True}]
    good = {"verdict": "refined", "gates": gates}
    assert story.headline({**good, **audited(left_zone=0)}) == "Refined: the one evaluated gate holds"
    assert story.headline({**good, **audited(left_zone=122)}).endswith(
        "holds, but 122 of 400 stops leave their braking disc"
    )


def test_the_console_tells_what_no_gate_counts():
    found = audited(left_zone=122, slid=3, lifted=0, friction_reserve=False)["simulation"]
    line = headline(judged(simulation=found))
    assert line.endswith("400 stops, least clearance 0.980 m, 122 left their braking zone, 3 slid")
    found["emergency_stops"] |= {"left_zone": 0, "slid": 0}
    assert headline(judged(simulation=found)).endswith("400 stops, least clearance 0.980 m")


def test_stops_that_are_no_evidence_are_refused_with_the_reason():
    result = {
        "gates": [
            {"name": "emergency_stops", "reason": "not evaluated: the emergency stops are no evidence"}
        ],
        "checks": [
            {"name": "emergency_stops", "status": "failed", "message": "no evidence: 8 stops, not 20"}
        ],
    }
    told = stop_story(result, warehouse().problem, None, None, asked=True)
    assert told.missing == "No emergency stops: the judge refused them: no evidence: 8 stops, not 20."


# stops with a reaction time


def delayed(problem: Problem, *stops: tuple[float, float], delay: float = 0.5) -> tuple[Problem, StopPaths]:
    """Straight stops (speed, acceleration until the brakes act), then braking at 1 m/s^2, in closed form."""
    problem = replace(problem, braking=replace(problem.braking, reaction_time=delay))
    rows = []
    for v, a in stops:
        later = v + a * delay
        t = np.concatenate([np.linspace(0.0, delay, 201)[:-1], np.linspace(delay, delay + later, 200)])
        t = t if delay > 0.0 else np.linspace(0.0, later, 400)
        since = np.maximum(t - delay, 0.0)
        early = np.minimum(t, delay)
        way = v * early + 0.5 * a * early**2 + later * since - 0.5 * since**2
        rows.append((t, 5.0 + way, np.where(t < delay, v + a * t, later - since)))
    t, x, v = (np.concatenate(column) for column in zip(*rows, strict=True))
    count = len(stops)
    return problem, StopPaths(
        model="four_wheel", instant=np.arange(count, dtype=float), straightened=np.ones(count, dtype=bool),
        first=400 * np.arange(count + 1), t=t, x=x, y=np.full(len(t), 2.0), v=v,
    )  # fmt: skip


def test_the_way_won_until_the_brakes_act_is_that_of_uniform_acceleration():
    # v = 1, a = 0.2, t_r = 0.5: w = 1.1; a t_r^2/2 + (w^2 - v^2)/2 = 0.025 + 0.105 m more than claimed. With
    # a = -0.2: w = 0.9, -0.025 - 0.095 m. The rows are 4 ms apart, so that chords of 1 m/s lose a few um.
    problem, stops = delayed(warehouse().problem, (1.0, 0.2), (1.0, 0.0), (1.0, -0.2))
    assert stops.claimed(problem.braking) == pytest.approx([1.0, 1.0, 1.0])
    assert stops.speed_after(0.5) == pytest.approx([1.1, 1.0, 0.9])
    assert stops.won(problem.braking) == pytest.approx([0.13, 0.0, -0.12], abs=1e-5)
    assert stops.displacement == pytest.approx([1.13, 1.0, 0.88], abs=1e-5)


def test_speed_won_before_the_brakes_act_is_told_as_a_finding_about_the_law():
    problem, stops = delayed(warehouse().problem, (1.0, 0.2), (1.0, 0.0))
    told = stop_story(audited(left_zone=1), problem, stops, None, asked=True)
    words = " ".join(told.finding).replace("\u00a0", " ")
    assert "1 of 400 stops leaves the disc" in words
    assert "at the worst 1.130 times its radius away" in words
    assert "until the brakes act, 0.5 s after the command, the vehicle goes on along its plan" in words
    assert "beyond its disc, 0.130 m, the 0.100 m/s won by then explain 100 %." in words
    assert "finding about the braking law with a reaction time" in words
    assert "itself brakes less than a_b" not in words


def test_a_weak_brake_is_not_taken_for_speed_that_was_won():
    # claimed with a_b = 1.25 from 1 m/s: 0.5 + 0.4 m; driven 0.5 + 0.5 m, and no speed is won.
    problem, stops = delayed(warehouse().problem, (1.0, 0.0))
    strong = replace(problem, braking=replace(problem.braking, max_braking=1.25))
    words = " ".join(stop_story(audited(left_zone=1), strong, stops, None, asked=True).finding)
    assert "up to 1.111 times as far away as claimed: there the vehicle itself brakes less than a_b." in words
    assert "reaction time" not in words


# pictures


def test_stops_too_short_to_compare_get_a_sentence_and_no_empty_figures():
    # 0.2 m/s and a_b = 1: 2 cm are claimed
    problem, stops = delayed(warehouse().problem, (0.2, 0.0), delay=0.0)
    told = stop_story(audited(), problem, stops, None, asked=True)
    assert any("claims less than 5\u00a0cm" in words for words in told.sentences)
    (only,) = draw_stop_figures(StopsData(problem=problem, stops=stops, run=None, executed=None))
    assert only.key == "stops-clearance"


def test_neighbours_of_one_cause_hang_together_in_chains():
    # 0, 1 and 2 are 90 px apart each, a chain; 3 is too far; 4 lies on 1 but fell
    places = np.array([[0.0, 0.0], [90.0, 0.0], [180.0, 0.0], [0.0, 60.0], [90.0, 0.0]])
    found = neighbours(places, ["left", "left", "left", "left", "fall"])
    assert [sorted(group) for group in found] == [[0, 1, 2], [3], [4]]
    assert found[0][0] == 1  # the middle one bears the label


def test_failed_stops_side_by_side_share_one_label(monkeypatch):
    problem, stops = delayed(warehouse().problem, *[(1.0, 0.0)] * 5)
    bad = [FailedStop(index=i, cause="left the zone", place=(6.0 + 0.2 * i, 2.0), row=()) for i in range(5)]
    named: list[str] = []

    def listed(_axes: Any, points: Any, *_more: Any) -> None:
        named.extend(name for name, _ in points)

    monkeypatch.setattr(figures_stops, "label_points", listed)
    draw_stops_map(StopsData(problem=problem, stops=stops, run=None, executed=None, failed=bad))
    assert [name for name in named if "zone" in name] == ["5 × left the zone"]


def test_labels_of_points_side_by_side_do_not_cover_each_other():
    _, axes = new_axes(600, 400, x="x", y="y")
    axes.set_xlim(0.0, 60.0)
    axes.set_ylim(0.0, 40.0)
    for names in (
        ["left the zone", "left the zone"],
        ["fall"],
    ):  # in two goes
        label_points(axes, [(name, np.array([30.0, 20.0])) for name in names], 7.0, [])
    boxes = [text.get_window_extent() for text in axes.texts if text.get_text()]
    assert len(boxes) == 3
    assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))


# words


def test_more_than_twice_as_much_is_a_multiple_and_no_percentage():
    # 15.492 times is 1449.2 % more
    assert compared(14.492, "above", "below") == "15.5 times"
    assert compared(1.0, "above", "below") == "100.0\u00a0% above"
    assert percent_or_times(14.492) == "15.5 times"
    assert percent_or_times(-0.5) == "−50.0\u00a0%"


def test_the_glossary_knows_no_speed_in_hand():
    words = {name: meaning for name, meaning, _ in GLOSSARY}
    assert "no safe speed" in words["Grip in hand"]
    assert "as fast as the steering allows" in words["Emergency stop"]
    assert not any("Speed in hand" in name for name in words)
