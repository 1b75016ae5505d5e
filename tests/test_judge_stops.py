"""Emergency stops re-judged: each way to end badly, each reason to refuse them, figures in closed form."""

from __future__ import annotations

import itertools
import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import shapely
import stops_case as case
from hypothesis import given
from hypothesis import settings as effort
from hypothesis import strategies as st
from judged import scenario_bytes
from stops_case import figures, judged, question, record, refusal

from verify.judge.geometry import Surroundings
from verify.judge.question import read_question
from verify.judge.stops import judge_stops, stops_check, why_no_stops
from verify.judge.stops_file import StopsFile
from verify.judge.tracking import RECORD_COLUMNS, Record, record_from_columns
from verify.judge.wheels import lasting

COUNT = 2 * case.INSTANTS


# ---- figures


def test_stops_in_closed_form():
    # 1.5 m from both walls all along; every stop covers v^2 / (2 a_b) = 0.5 m exactly.
    found = figures(case.stop_arrays())
    assert (found["tried"], found["instants"], found["bad"]) == (COUNT, case.INSTANTS, 0)
    zero = ("collisions", "falls", "not_stopped", "left_zone", "slid", "lifted", "bad")
    for part in (found, found["held"], found["straightened"]):
        assert [part[key] for key in zero] == [0] * len(zero)
        assert part["min_clearance"] == pytest.approx(1.5, abs=1e-12)
        assert part["worst_distance_ratio"] == pytest.approx(1.0, abs=1e-12)
        assert part["worst_displacement_ratio"] == pytest.approx(1.0, abs=1e-12)
    assert found["held"]["tried"] == found["straightened"]["tried"] == case.INSTANTS
    assert found["failed"] == []


def test_a_reaction_time_is_part_of_the_distance_claimed():
    # 0.3 s at 1 m/s and 0.5 m of braking: 0.8 m, claimed and driven. Without the claim it is 0.8 of 0.5 m.
    arrays = case.stop_arrays(reaction_time=0.3)
    assert figures(arrays, braking={"reaction_time": 0.3})["worst_distance_ratio"] == pytest.approx(1.0)
    assert figures(arrays)["worst_distance_ratio"] == pytest.approx(1.6)


def test_the_margin_is_no_part_of_the_distance_claimed():
    arrays = case.stop_arrays(braking=0.9)  # 1 / 1.8 m instead of 0.5 m
    for margin in (0.0, 0.2):
        found = figures(arrays, braking={"margin": margin})
        assert found["worst_displacement_ratio"] == pytest.approx(1.0 / 0.9)
        assert found["left_zone"] == COUNT


def test_way_and_displacement_are_two_things():
    # Half round a circle of radius 1 / pi m, 1 m of way, to a place 2 / pi m off; 0.5 m/s^2 claims 1 m.
    arrays = case.stop_arrays(braking=0.5)
    begin = np.repeat(arrays["x"][arrays["first"][:-1]], np.diff(arrays["first"]))
    turn = np.pi * (arrays["x"] - begin)
    half = {**arrays, "x": begin + np.sin(turn) / np.pi, "y": 2.0 + (1.0 - np.cos(turn)) / np.pi}
    found = figures(half, robot={"max_braking": 0.5})
    # chords of an angle of pi * 20 ms * 1 m/s at most fall short by its square over 24: 0.02 %
    assert found["worst_distance_ratio"] == pytest.approx(1.0, abs=2e-4)
    assert found["worst_displacement_ratio"] == pytest.approx(2.0 / np.pi, abs=1e-12)
    # they end 2 / pi m nearer to the wall y = 4 m
    assert found["min_clearance"] == pytest.approx(1.5 - 2.0 / np.pi, abs=1e-12)


def test_from_rest_there_is_no_ratio():
    arrays = case.stop_arrays()
    still = {**arrays, "v": np.zeros_like(arrays["v"]), "y": np.full_like(arrays["y"], 2.0)}
    still["x"] = np.repeat(arrays["x"][arrays["first"][:-1]], np.diff(arrays["first"]))
    run = replace(record(), v=np.zeros_like(record().v))
    found = judged(still, run)
    assert found.refused == ()
    assert found.figures is not None
    assert (found.figures["bad"], found.figures["left_zone"]) == (0, 0)
    assert "worst_distance_ratio" not in found.figures


# ---- stops that end badly


def pillar(x: float, y: float) -> dict[str, Any]:
    return {"world": {"obstacles": [{"vertices": [[x, y]]}]}}


def test_a_collision_is_told_with_its_depth_and_place():
    # A point 0.4 m beside the line at x = 35.25 m: 0.1 m into the disc of the two stops from x = 35 m, which
    # reach 35.5 m; those from 30 / 19 m before end at 33.92 m.
    found = figures(case.stop_arrays(), **pillar(35.25, 2.4))
    assert (found["bad"], found["collisions"], found["min_clearance"]) == (
        2,
        2,
        pytest.approx(-0.1, abs=1e-9),
    )
    one, other = found["failed"]
    assert [one["stop"], other["stop"]] == [COUNT - 2, COUNT - 1]
    assert (one["cause"], one["straightened"], other["straightened"]) == ("collision", False, True)
    assert one["depth"] == pytest.approx(0.1, abs=1e-9)
    # Rows are 20 ms and so less than 20 mm apart; 1 - v is the time since the brakes act.
    assert one["x"] == pytest.approx(35.25, abs=0.01)
    assert one["instant"] == pytest.approx(30.0)
    assert one["t"] == pytest.approx(1.0 - math.sqrt(0.5), abs=0.02)


def test_a_wall_between_two_rows_is_hit():
    # A wall across the line, thinner than anything, at 35.3 m.
    wall = {"world": {"obstacles": [{"vertices": [[35.3, 0.0], [35.3, 4.0]]}]}}
    found = figures(case.stop_arrays(), **wall)
    assert found["collisions"] == 2
    assert found["min_clearance"] == pytest.approx(-0.5, abs=1e-9)


def test_a_point_robot_that_touches_a_wall_collides():
    point = {"radius": 0.0, "wheelbase": 0.1, "track": 0.1}
    wall = {"vertices": [[0.0, 2.0], [4.0, 2.0]]}
    beside = {"vertices": [[0.0, 1.9], [40.0, 1.9]]}
    arrays = case.stop_arrays(model="single_track")
    assert figures(arrays, robot=point, world={"obstacles": [wall, beside]})["collisions"] == 0
    touching = {"vertices": [[36.0, 2.0], [35.5, 2.0]]}  # where the last stops end
    assert figures(arrays, robot=point, world={"obstacles": [touching]})["collisions"] == 2


def tilted(arrays: case.Arrays, stop: int, degrees: float) -> case.Arrays:
    return case.edited(arrays, "tilt", stop, lambda a: np.linspace(0.0, math.radians(degrees), len(a)))


def test_a_tilt_of_more_than_thirty_degrees_is_a_fall():
    assert figures(tilted(case.stop_arrays(), 7, 29.9))["falls"] == 0
    found = figures(tilted(case.stop_arrays(), 7, 60.0))
    assert (found["falls"], found["straightened"]["falls"], found["bad"]) == (1, 1, 1)
    # 51 rows over 1 s: half of the tilt is passed after half of the rows
    assert found["failed"][0]["cause"] == "fall"
    assert found["failed"][0]["t"] == pytest.approx(0.5, abs=0.021)


def test_a_stop_that_ends_moving_did_not_stop():
    arrays = case.stop_arrays()
    keep = np.ones(len(arrays["t"]), dtype=bool)
    keep[case.rows_of(arrays, 4).stop - 2 : case.rows_of(arrays, 4).stop] = (
        False  # its last row: 0.96 s, 0.04 m/s
    )
    found = figures(case.cut(arrays, keep))
    assert (found["not_stopped"], found["held"]["not_stopped"], found["bad"]) == (1, 1, 1)
    told = found["failed"][0]
    assert (told["cause"], told["speed"]) == ("did not stop", pytest.approx(0.04))
    assert told["x"] == pytest.approx(5.0 + 2 * 30.0 / 19 + 0.96 - 0.5 * 0.96**2)


@pytest.mark.parametrize("reserve", [False, True])
def test_leaving_the_zone_counts_only_where_friction_is_reserved(reserve):
    # At 0.9 m/s^2 it takes 1 / 1.8 m: 0.0556 m further than claimed. It is found where 0.5 m and what a
    # simulation's steps add, 3 mm, are passed: by v = sqrt(1 - 1.8 * 0.503), at most a row of 20 ms later.
    arrays = case.stop_arrays(braking=0.9)
    found = figures(arrays, braking={"friction_reserve": reserve})
    assert found["left_zone"] == COUNT
    assert found["bad"] == (COUNT if reserve else 0)
    assert found["friction_reserve"] is reserve
    if reserve:
        told = found["failed"][0]
        assert told["cause"] == "left the zone"
        assert told["beyond"] == pytest.approx(1.0 / 1.8 - 0.5)
        passed = (1.0 - math.sqrt(1.0 - 1.8 * 0.503)) / 0.9
        assert passed <= told["t"] <= passed + 0.02 + 1e-9


@pytest.mark.parametrize(("beyond", "left"), [(0.0029, 0), (0.0031, COUNT)])
def test_the_zone_is_left_beyond_a_step_and_a_millimetre(beyond, left):
    # 1 mm, and 2 ms at 1 m/s: 3 mm. Braking at 1 / (1 + 2 beyond) the way is 0.5 m + beyond.
    arrays = case.stop_arrays(braking=1.0 / (1.0 + 2.0 * beyond))
    assert figures(arrays, braking={"friction_reserve": True})["left_zone"] == left


def test_wheels_that_slide_or_lift_for_long_are_told_and_excuse_nothing():
    # 4 rows of 20 ms span 60 ms, 3 rows 40 ms; 50 ms count.
    def some(rows: int, value: float):
        return lambda a: np.where((np.arange(len(a)) >= 10) & (np.arange(len(a)) < 10 + rows), value, a)

    arrays = case.edited(case.stop_arrays(), "least_load", 3, some(4, 0.0))
    arrays = case.edited(arrays, "least_load", 5, some(3, 0.0))
    arrays = case.edited(arrays, "slip", 6, some(4, 0.3))
    arrays = case.edited(arrays, "slip", 8, some(3, 0.3))
    arrays = case.edited(arrays, "slip", 10, lambda a: a + 0.04)  # creep
    found = figures(arrays)
    assert (found["lifted"], found["straightened"]["lifted"], found["held"]["lifted"]) == (1, 1, 0)
    assert (found["slid"], found["held"]["slid"], found["straightened"]["slid"]) == (1, 1, 0)
    assert found["bad"] == 0


def test_the_gravest_cause_is_told():
    arrays = tilted(case.stop_arrays(braking=0.9), COUNT - 1, 60.0)
    found = figures(arrays, **pillar(35.25, 2.4), braking={"friction_reserve": True})
    assert found["collisions"] == 2
    assert [told["cause"] for told in found["failed"]][-2:] == ["collision", "collision"]
    assert found["bad"] == COUNT


def test_at_most_fifty_are_listed_one_by_one():
    found = figures(
        case.stop_arrays(40, braking=0.9), braking={"friction_reserve": True}, simulation={"stops": 40}
    )
    assert (found["bad"], len(found["failed"])) == (80, 50)


@pytest.mark.parametrize(("limit", "status"), [(0.0, "failed"), (1.0, "failed"), (2.0, "passed")])
def test_the_check_takes_the_limit_of_its_gate(limit, status):
    drive = question().drive
    found = judged(case.stop_arrays(), **pillar(35.25, 2.4))
    check = stops_check(drive, found, limit)
    assert (check.status, check.worst, check.violation) == (status, limit - 2.0, max(0.0, 2.0 - limit))
    assert check.message == f"2 of {COUNT} stops collide"
    assert check.at is not None
    assert check.at.t == pytest.approx(30.0 + 1.0 - math.sqrt(0.5), abs=0.02)


def test_without_stops_nothing_is_evaluated():
    check = stops_check(question().drive, None, 0.0)
    assert (check.status, check.wanted) == ("not_evaluated", True)
    none = question(json.dumps({"simulation": {"stops": 0}})).drive
    check = stops_check(none, None, 0.0)
    assert (check.status, check.wanted) == ("not_evaluated", False)
    assert "asks for no" in why_no_stops(none, None)


# ---- what was asked for


@pytest.mark.parametrize(
    ("changes", "model", "stops"),
    [
        ({}, "four_wheel", 200),
        ({"plan": {"effort": "quick"}}, "four_wheel", 20),
        ({"plan": {"effort": "quick"}, "simulation": {"stops": 7}}, "four_wheel", 7),
        ({"simulation": {"model": "both", "stops": 0}}, "both", 0),
        ({"robot": {"radius": 0.0, "wheelbase": 0.1, "track": 0.1}}, "single_track", 200),
    ],
)
def test_defaults_are_filled_in(changes, model, stops):
    drive = read_question(scenario_bytes(**changes)).drive
    assert (drive.model, drive.stops) == (model, stops)
    assert drive.vehicle == ("single_track" if model == "single_track" else "four_wheel")
    assert drive.prescreen == (model == "both")


# ---- no evidence


def moved(arrays: case.Arrays, stop: int, by: float) -> case.Arrays:
    """One row in the middle of a stop moved sideways."""
    return case.edited(arrays, "y", stop, lambda y: y + np.where(np.arange(len(y)) == 25, by, 0.0))


def thinned(arrays: case.Arrays, stop: int) -> case.Arrays:
    """A stop with every tenth row, and its last."""
    rows, keep = case.rows_of(arrays, stop), np.ones(len(arrays["t"]), dtype=bool)
    keep[rows] = np.arange(rows.stop - rows.start) % 10 == 0
    keep[rows.stop - 1] = True
    return case.cut(arrays, keep)


def fewer(arrays: case.Arrays, stops: int) -> case.Arrays:
    """Without the last stops."""
    return case.first_stops(arrays, len(arrays["instant"]) - stops)


def frozen(v: np.ndarray) -> np.ndarray:
    """Standing from half of the stop on."""
    return np.where(np.arange(len(v)) < len(v) // 2, v, 0.0)


REFUSED = {
    "another model": (lambda a: {**a, "model": np.array("single_track")}, "of the model 'single_track'"),
    "a stop left out": (lambda a: fewer(a, 1), f"{COUNT - 1} stops, where 2 at each of 20 instants"),
    "an instant left out": (lambda a: fewer(a, 2), f"{COUNT - 2} stops"),
    "all held": (
        lambda a: {**a, "straightened": a["straightened"] & False},
        "not one stop with the steering",
    ),
    "held twice": (
        lambda a: {**a, "straightened": ~a["straightened"]},
        "not one stop with the steering held",
    ),
    "pairs apart": (
        lambda a: {**a, "instant": a["instant"] + np.tile([0.0, 1e-3], case.INSTANTS)},
        "not one stop with the steering held",
    ),
    "crowded": (lambda a: {**a, "instant": 0.5 * a["instant"]}, "no stop from 15.000 to 30.000 s"),
    "out of order": (lambda a: {**a, "instant": a["instant"][::-1].copy()}, "do not increase within the run"),
    "twice the same instant": (
        lambda a: {**a, "instant": np.repeat(np.append(0.0, a["instant"][:-2:2]), 2)},
        "do not increase within the run",
    ),
    "after the run": (lambda a: {**a, "instant": a["instant"] + 0.1}, "do not increase within the run"),
    "beside the run": (
        lambda a: case.edited(a, "y", 3, lambda y: y + 0.002),
        "stop 3 (at 1.579 s, wheels straightened) begins 0.0020 m from where the run was",
    ),
    "turned": (
        lambda a: case.edited(a, "heading", 3, lambda h: h + 0.011),
        "0.0110 rad off the run's heading",
    ),
    "faster at first": (
        lambda a: case.edited(a, "v", 2, lambda v: v + 0.02 * (v == 1.0)),
        "stop 2 (at 1.579 s, steering held) begins 0.0200 m/s off the run's speed",
    ),
    "slower at first": (
        lambda a: case.edited(a, "v", 2, lambda v: v - 0.02 * (v == 1.0)),
        "off the run's speed",
    ),
    "a jump": (lambda a: moved(a, 5, 0.05), "a jump that its speed does not explain, 0.480 s after"),
    "standing still at once": (
        lambda a: case.edited(a, "v", 5, frozen),
        "stop 5 (at 3.158 s, wheels straightened) has a change of speed that neither brakes nor floor",
    ),
    "farther than its speeds": (
        lambda a: case.edited(a, "x", 5, lambda x: x[0] + 1.25 * (x - x[0])),
        "drives 0.625 m at speeds that make 0.500 m",
    ),
    "shorter than its speeds": (
        lambda a: case.edited(a, "x", 5, lambda x: x[0] + 0.7 * (x - x[0])),
        "drives 0.350 m at speeds that make 0.500 m",
    ),
    "rows far apart": (lambda a: thinned(a, 5), "rows more than 0.1 s apart"),
    "a clock that stands": (
        lambda a: case.edited(a, "t", 5, lambda t: np.minimum(t, 0.9)),
        "do not increase",
    ),
    "late rows": (lambda a: case.edited(a, "t", 5, lambda t: t + 0.01), "does not begin at its instant"),
}


@pytest.mark.parametrize("edit", REFUSED)
def test_what_is_no_evidence_is_refused(edit):
    change, words = REFUSED[edit]
    assert words in refusal(change(case.stop_arrays()))


def test_stops_of_another_run_are_refused():
    # The same way at 1.2 m/s: at every later instant elsewhere, and faster.
    run = record()
    other = replace(run, x=5.0 + 1.2 * run.t, v=np.full_like(run.v, 1.2))
    words = refusal(case.stop_arrays(), other)
    assert "m from where the run was" in words
    assert "0.2000 m/s off the run's speed" in words


def test_more_stops_than_asked_for_are_refused_too():
    assert "80 stops, where 2 at each of 20" in refusal(case.stop_arrays(40))


def test_a_wheel_that_comes_down_jolts_once():
    # 0.1 m/s less in one row and more in the next: of a vehicle on its wheels no evidence, of one that
    # pitches within 0.16 m/s. 0.2 m/s less are too much, however many rows say that a wheel was in the air.
    def dip(by: float):
        return lambda v: v - by * (np.arange(len(v)) == 25)

    def air(a: np.ndarray) -> np.ndarray:
        return np.where(np.arange(len(a)) < 20, 0.0, a)

    words = "a change of speed that neither brakes nor floor give"
    arrays = case.edited(case.stop_arrays(), "v", 5, dip(0.1))
    assert words in refusal(arrays)
    assert figures(case.edited(arrays, "least_load", 5, air))["lifted"] == 1
    arrays = case.edited(case.stop_arrays(), "v", 5, dip(0.2))
    assert words in refusal(case.edited(arrays, "least_load", 5, lambda a: 0.0 * a))


def waiting(run: Record, late: float) -> Record:
    """The run with a row that much later, standing at its end."""
    columns = {name: getattr(run, name) for name in ("x", "y", "heading", "v", "steering")}
    last = {name: np.append(column, column[-1]) for name, column in columns.items()}
    return replace(run, t=np.append(run.t, run.t[-1] + late), lateral_acceleration=None, **last)


def test_what_a_run_takes_longer_than_planned_need_not_be_covered():
    # Instants in the middle of 20 equal parts of 30 s: the last is 0.75 s before the planned end, at which it
    # drives at x = 34.25 m; 3 s may be left out of the 30 s, however long the run waits at its end.
    arrays = case.stop_arrays()
    instant = np.repeat((np.arange(20) + 0.5) * 1.5, 2)
    x = arrays["x"] + np.repeat(instant - arrays["instant"], np.diff(arrays["first"]))
    found = judged({**arrays, "instant": instant, "x": x}, waiting(record(), 5.0))
    assert found.refused == ()


@pytest.mark.parametrize(("instants", "fits"), [(8, False), (10, True), (20, True)])
def test_a_short_run_has_room_for_few_instants(instants, fits):
    # 0.1 s are ten times 10 ms.
    asked = question()
    run = Record(*(getattr(record(), name)[:11] for name in RECORD_COLUMNS), steering=np.zeros(11))
    arrays = case.stop_arrays(instants)
    instant = np.repeat(np.linspace(0.0, 0.1, instants), 2)
    x = arrays["x"] + np.repeat(instant - arrays["instant"], np.diff(arrays["first"]))
    file = {key: value for key, value in arrays.items() if key not in ("schema", "model")}
    stops = StopsFile(model="four_wheel", **{**file, "instant": instant, "x": x})
    found = judge_stops(stops, run, 0.1, asked.setting.surroundings, asked.drive, asked.setting.limits)
    assert (found.refused == ()) is fits
    if found.figures is not None:
        assert found.figures["instants"] == instants


def test_no_stop_claims_a_longer_zone_than_the_run_s_speed_gives():
    # The first rows say 0.009 m/s more, which is within what a record may be off: the claim stays v = 1.
    arrays = case.stop_arrays(braking=0.9)
    v = arrays["v"].copy()
    v[arrays["first"][:-1]] += 0.009
    assert figures({**arrays, "v": v})["worst_distance_ratio"] == pytest.approx(1.0 / 0.9, abs=1e-12)


def test_headings_are_compared_round_the_circle():
    arrays = case.stop_arrays()
    turned = {**arrays, "heading": arrays["heading"] + 2.0 * np.pi}
    assert figures(turned)["bad"] == 0
    run = replace(record(), heading=record().heading - np.pi)
    assert "3.1416 rad off the run's heading" in refusal(arrays, run)


def test_instants_between_rows_of_a_curved_run_fit_it():
    # A circle of radius 2 m at 1 m/s, recorded every 40 ms: the chord lies 0.5 * 0.04^2 / 8 = 0.1 mm off
    # it, and the heading turns 0.02 rad from row to row. Straight stops along the tangent.
    t = np.arange(751) * 0.04
    columns = {name: np.zeros(len(t)) for name in (*RECORD_COLUMNS, "steering")}
    columns |= {
        "t": t,
        "x": 20 + 2 * np.sin(t / 2),
        "y": 2 - 2 * np.cos(t / 2),
        "heading": t / 2,
        "v": 1 + 0 * t,
    }
    arrays = case.stop_arrays()
    along = arrays["x"] - np.repeat(arrays["x"][arrays["first"][:-1]], np.diff(arrays["first"]))
    angle = np.repeat(arrays["instant"], np.diff(arrays["first"])) / 2
    arrays |= {"x": 20 + 2 * np.sin(angle) + along * np.cos(angle), "heading": angle}
    arrays |= {"y": 2 - 2 * np.cos(angle) + along * np.sin(angle)}
    hall = {"world": {"boundary": [[0, -20], [40, -20], [40, 20], [0, 20]]}}
    found = judged(arrays, record_from_columns(columns), **hall)
    assert found.refused == ()


# ---- clearance and stretches


SHAPES = st.sampled_from([1, 2, 4])
PLACE = st.tuples(st.floats(1.0, 19.0), st.floats(1.0, 19.0))


@st.composite
def halls(draw: st.DrawFn) -> tuple[list[list[list[float]]], list[list[float]]]:
    """Obstacles in a hall of 20 x 20 m: points, walls and rectangles, and circles."""
    outlines = []
    for _ in range(draw(st.integers(0, 4))):
        x, y = draw(PLACE)
        w, h = draw(st.floats(0.2, 5.0)), draw(st.floats(0.2, 5.0))
        corners = (
            [[x, y], [x + w, y + h]]
            if draw(st.booleans())
            else [[x, y], [x + w, y], [x + w, y + h], [x, y + h]]
        )
        outlines.append(corners[: draw(SHAPES)] if len(corners) == 2 else corners)
    circles = [[*draw(PLACE), draw(st.floats(0.1, 2.0))] for _ in range(draw(st.integers(0, 2)))]
    return outlines, circles


@effort(max_examples=60)
@given(hall=halls(), seed=st.integers(0, 2**32 - 1), size=st.floats(0.0, 8.0))
def test_the_least_clearance_is_shapely_s_distance_of_the_line(hall, seed, size):
    outlines, circles = hall
    random = np.random.default_rng(seed)
    lengths = random.integers(2, 9, 5)
    points = np.repeat(random.uniform(2.0, 18.0, (5, 2)), lengths, axis=0)
    points = np.clip(points + size * random.uniform(-1.0, 1.0, points.shape), 0.1, 19.9)
    first = np.concatenate([[0], np.cumsum(lengths)])
    square = [[0, 0], [20, 0], [20, 20], [0, 20]]
    found, at_points = Surroundings(square, [np.array(o) for o in outlines], circles).along(points, first)
    kinds = {1: shapely.Point, 2: shapely.LineString}
    solids = [kinds.get(len(o), shapely.Polygon)(o if len(o) > 1 else o[0]) for o in outlines]
    for i, (begin, end) in enumerate(itertools.pairwise(first)):
        line = shapely.LineString(points[begin:end])
        expected = min(
            shapely.Polygon(square).exterior.distance(line),
            *(solid.distance(line) for solid in solids),
            *(shapely.Point(x, y).distance(line) - r for x, y, r in circles),
            np.inf,
        )
        if expected > 0.0:
            assert found[i] == pytest.approx(expected, abs=1e-9)
        else:  # Shapely knows no depth: it is that of the deepest point, where one is inside
            assert found[i] <= 1e-9
            assert found[i] <= at_points[begin:end].min() + 1e-9


def test_a_stop_inside_an_obstacle_is_as_deep_as_its_deepest_row():
    solid = np.array([[4.0, 4.0], [10.0, 4.0], [10.0, 10.0], [4.0, 10.0]])
    around = Surroundings([[0, 0], [20, 0], [20, 20], [0, 20]], [solid], [])
    found, _ = around.along([[2.0, 7.0], [5.5, 7.0], [5.0, 5.0], [5.0, 6.0]], [0, 2, 4])
    assert found == pytest.approx([-1.5, -1.0], abs=1e-12)


def test_stretches_end_with_their_stop():
    t = np.array([0.0, 0.02, 0.04, 0.06, 0.0, 0.02, 0.04, 0.06])
    first = np.array([0, 4, 8])
    flag = np.array([0, 0, 1, 1, 1, 1, 0, 1], dtype=bool)
    assert not lasting(flag, t, first, 0.05).any()
    np.testing.assert_array_equal(lasting(flag, t, first, 0.02), [0, 0, 1, 1, 1, 1, 0, 0])
    np.testing.assert_array_equal(lasting(flag, t, first, 0.0), flag)
    full = np.ones(8, dtype=bool)
    assert lasting(full, t, first, 0.06).all()
    assert not lasting(full, t, first, 0.07).any()
