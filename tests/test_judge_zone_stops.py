"""Stops and braking zones: out of the zone claimed or not, the promise along a motion, fields as evidence."""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from judged import arcs_motion, setting
from stops_case import (
    edited,
    figures,
    record,
    refusal,
    run_columns,
    stop_arrays,
    write_case,
    write_claims,
)

from verify import evidence
from verify.judge import compare, judge
from verify.judge.bound import judge_bound
from verify.judge.certificate import Proof
from verify.judge.checks import check_motion
from verify.judge.ends import end_cost, straight_time
from verify.judge.gates import Times, gaps
from verify.judge.tracking import record_from_columns
from verify.judge.zones import GaugeZone, outside
from verify.judge.zones.asked import least_ahead
from verify.judge.zones.fields_file import read_fields
from verify.judge.zones.held import arc_point, held_way
from verify.judge.zones.promise import audit
from verify.judge.zones.shapes import Disc, Ellipse, Straight
from verify.recheck import recheck

CAPSULE = {"zone": {"type": "protective_field"}, "margin": 0.02, "friction_reserve": True}
ELLIPSE = {"zone": {"type": "ellipse", "lateral_ratio": 0.5}, "friction_reserve": True}
FIRM = 1.0 / 9.81  # mu with which mu g = 1 m/s^2, as much as a_b


def aside(by: float) -> Callable[[np.ndarray], np.ndarray]:
    """Rows that leave y = 2 m evenly in time, by so much in the end."""
    return lambda y: y + by * np.linspace(0.0, 1.0, len(y))


def test_straight_stops_stay_in_every_zone_and_end_where_it_ends():
    # From 1 m/s with a_b = 1: D = 0.5 m ahead, the end of the capsule, which has the margin around it.
    found = figures(stop_arrays(), braking=CAPSULE)
    assert (found["bad"], found["left_zone"]) == (0, 0)
    assert found["worst_excess"] == pytest.approx(-0.02, abs=1e-7)
    # The ellipse reaches further ahead than the stop.
    found = figures(stop_arrays(), braking=ELLIPSE)
    assert found["bad"] == 0
    assert found["worst_excess"] < 0.0


def test_a_stop_that_ends_beside_a_capsule_has_left_it_by_what_the_margin_lacks():
    # 0.1 m aside at the end of the way, where the capsule has 0.02 m: 0.08 m out, to either side.
    for by in (0.1, -0.1):
        arrays = edited(stop_arrays(), "y", 6, aside(by))
        found = figures(arrays, braking=CAPSULE)
        assert (found["bad"], found["left_zone"], found["held"]["left_zone"]) == (1, 1, 1)
        assert found["worst_excess"] == pytest.approx(0.08, abs=1e-6)
        assert found["failed"][0]["beyond"] == pytest.approx(0.08, abs=1e-6)
        assert found["failed"][0]["cause"] == "left the zone"
    # a step of the simulation and settling are allowed: 3 mm at 1 m/s
    for by, left in ((0.0229, 0), (0.0231, 1)):
        assert figures(edited(stop_arrays(), "y", 6, aside(by)), braking=CAPSULE)["left_zone"] == left
    # without the reserve it is told and not bad
    told = figures(edited(stop_arrays(), "y", 6, aside(0.1)), braking={**CAPSULE, "friction_reserve": False})
    assert (told["bad"], told["left_zone"]) == (0, 1)


def drifting(angle: float) -> dict[str, np.ndarray]:
    """The run with its body turned by so much from its course."""
    columns = run_columns()
    v = columns["v"]
    return {
        **columns,
        "heading": np.full(len(v), angle),
        "longitudinal_velocity": v * math.cos(angle),
        "lateral_velocity": -v * math.sin(angle),
    }


def test_the_zone_lies_along_the_course_and_not_along_the_body():
    # The body stands 0.3 rad to the left of its way; the stop goes on along the way.
    arrays = stop_arrays()
    arrays = {**arrays, "heading": np.full_like(arrays["heading"], 0.3)}
    found = figures(arrays, run=record_from_columns(drifting(0.3)), braking=CAPSULE)
    assert found["left_zone"] == 0
    assert found["worst_excess"] == pytest.approx(-0.02, abs=1e-7)


def test_a_run_that_does_not_say_which_way_it_moved_is_no_evidence():
    silent = replace(record(), drift=None)
    assert "which way it moved" in refusal(stop_arrays(), silent, braking=CAPSULE)
    # velocities that point 0.1 rad off the way from row to row
    columns = run_columns()
    columns["lateral_velocity"] = np.full(len(columns["t"]), math.tan(0.1))
    assert "0.100 rad off the course" in refusal(stop_arrays(), record_from_columns(columns), braking=CAPSULE)
    # where the zone is a disc nobody asks
    assert figures(stop_arrays(), run=silent, braking={"friction_reserve": True})["bad"] == 0


@pytest.mark.parametrize(("share", "ratio"), [(1.0, 1.531), (0.5, 1.044)])
def test_a_held_stop_at_the_limit_of_friction_leaves_even_the_uniform_disc(share, ratio):
    # mu g = a_b = 1, v = 1, kappa = lambda: an arc of length asin(lambda) / (2 kappa), so that its chord is
    # (2 / kappa) sin(asin(lambda) / 4): 1.531 D at lambda = 1 and 1.044 D at 0.5, with D = 1/2.
    limits = setting(robot={"friction": FIRM}).limits
    speed, curvature = np.ones(1), np.array([share])
    way = held_way(speed, curvature, limits)
    assert way[0] == pytest.approx(math.asin(share) / (2.0 * share), rel=1e-12)
    end = arc_point(way, curvature)
    chord = 2.0 / share * math.sin(math.asin(share) / 4.0)
    assert math.hypot(*end[0]) == pytest.approx(chord, rel=1e-12)
    assert chord / 0.5 == pytest.approx(ratio, abs=1e-3)
    disc = GaugeZone(Disc(1.0), Disc(0.5), 1.0, 0.0)
    assert outside(disc, 0.5, end, speed)[0] == pytest.approx(chord - 0.5, abs=1e-9)


def test_the_way_of_a_held_stop_is_the_integral_of_what_brakes_and_floor_leave():
    limits = setting(robot={"friction": 0.3}, braking={"reaction_time": 0.2}).limits
    for speed, curvature in ((2.0, 0.6), (1.2, -1.9), (3.0, 0.0), (1.0, 0.1)):
        u = np.linspace(0.0, speed**2, 200_001)
        slow = np.minimum(1.0, np.sqrt(np.maximum((0.3 * 9.81) ** 2 - (curvature * u) ** 2, 0.0)))
        wanted = 0.2 * speed + np.trapezoid(0.5 / slow, u)
        found = held_way(np.array([speed]), np.array([curvature]), limits)
        assert found[0] == pytest.approx(wanted, rel=1e-5)


def circle(speed: float, curvature: float) -> Any:
    return arcs_motion((20.0, 2.0), 0.0, [(1.0, curvature)], [speed, speed])


def test_the_audit_finds_every_stop_that_leaves_and_what_it_hits():
    # Half way round a circle of 1 m with mu g = a_b: every stop ends 0.26537 m out of the disc.
    bare = setting(robot={"friction": FIRM, "radius": 0.1, "wheelbase": 0.1, "track": 0.1})
    disc = GaugeZone(Disc(1.0), Disc(0.1), 1.0, 0.0)
    found = audit(circle(1.0, 1.0), disc, bare.surroundings, bare.limits)
    chord = 2.0 * math.sin(math.pi / 8.0)
    assert (found["held_leaves"], found["held_collides"]) == (found["poses"], 0)
    assert found["worst_excess"] == pytest.approx(chord - 0.5, abs=1e-8)
    assert found["worst_depth"] < 0.0
    assert len(found["failed"]) == 20
    # A point where the first stops end: the disc of 0.1 m reaches it 0.1 m deep, to the rows' 2 cm
    end = np.array([20.0, 2.0]) + arc_point(np.array(math.pi / 4.0), np.array(1.0))
    world = {"obstacles": [{"vertices": [end.tolist()]}]}
    hit = setting(robot={"friction": FIRM, "radius": 0.1, "wheelbase": 0.1, "track": 0.1}, world=world)
    found = audit(circle(1.0, 1.0), disc, hit.surroundings, hit.limits)
    assert 0 < found["held_collides"] <= found["poses"]
    assert found["worst_depth"] == pytest.approx(0.1, abs=2e-3)
    assert all(stop["depth"] > 0.0 for stop in found["failed"])


def test_with_the_reserve_an_ellipse_that_reaches_ahead_keeps_every_held_stop():
    # mu g = 1.2 a_b leaves sqrt(0.44) for turning; at that limit the arc is D long and turns by
    # sqrt(0.44) / 2. The centred ellipse with the least A for this holds it; with A = 1 it does not.
    kept = setting(robot={"friction": 1.2 / 9.81})
    sharp = circle(1.0, math.sqrt(0.44))
    for beta in (0.5, 0.3):
        ahead = least_ahead(beta, 0.5 * math.sqrt(0.44))
        zones = [GaugeZone(Ellipse(0.0, a, beta), Disc(0.5), 1.0, 0.0) for a in (ahead, 1.0)]
        found = [audit(sharp, zone, kept.surroundings, kept.limits) for zone in zones]
        assert found[0]["held_leaves"] == 0
        assert found[0]["worst_excess"] == pytest.approx(0.0, abs=1e-6)
        assert found[1]["held_leaves"] == found[1]["poses"]


def test_held_arcs_are_checked_with_the_reserve_only_and_promised_by_the_full_model():
    motion = arcs_motion((5.0, 2.0), 0.0, [(0.5, 0.0)], [1.0, 1.0])
    for braking, names in (
        ({**ELLIPSE, "friction_reserve": False}, set()),
        ({"friction_reserve": True}, set()),
        (ELLIPSE, {"braking_arc"}),
    ):
        for plan, model in (("refined", "full"), ("collocation", "variational"), ("vc_method", "full")):
            found = {c.name: c for c in check_motion(motion, plan, model, setting(braking=braking))}
            assert {"braking_arc", "uniform_distance"} & set(found) == names
            if names:
                assert found["braking_arc"].promised is (plan == "refined")
    # straight ahead the arc ends at (D, 0), in an ellipse with the semi-axes A D and D / 2: as far inside as
    # the nearest point of the ellipse, by its definition
    t = np.linspace(0.0, math.pi, 200_001)
    nearest = np.hypot(0.5 * 1.25 * np.cos(t) - 0.5, 0.25 * np.sin(t)).min()
    check = {c.name: c for c in check_motion(motion, "refined", "full", setting(braking=ELLIPSE))}
    assert check["braking_arc"].worst == pytest.approx(nearest, abs=1e-7)


def test_a_plan_for_uniform_braking_promises_its_disc_and_what_lies_within():
    motion = arcs_motion((5.0, 2.0), 0.0, [(0.5, 0.0)], [1.0, 1.0])
    rectangle = {"zone": {"type": "protective_field", "form": "rectangle"}}
    longer = {"zone": {"type": "ellipse", "ahead": 1.2}}
    for braking, within in ((CAPSULE, True), (rectangle, False), (longer, False)):
        found = {c.name: c for c in check_motion(motion, "uniform", "full", setting(braking=braking))}
        assert found["uniform_distance"].promised
        assert found["braking_distance"].promised is within
        # 1.5 m to either side less D = 0.5 and the margin
        margin = braking.get("margin", 0.0)
        assert found["uniform_distance"].worst == pytest.approx(1.0 - margin, abs=1e-7)
    assert {c.name: c for c in check_motion(motion, "uniform", "full", setting())}[
        "braking_distance"
    ].promised


def test_gaps_with_a_zone_that_is_not_a_disc():
    times = Times(speed_graph=11.0, refined=10.5, best_variational=10.0, lower_bound=9.0, isotropic=False)
    assert gaps(times) == {"certified_full": pytest.approx(10.5 / 9.0 - 1.0)}
    found = gaps(replace(times, collocation=10.0))
    assert found["refinement"] == pytest.approx(0.05)
    assert found["certified"] == pytest.approx(10.0 / 9.0 - 1.0)
    assert "analytic" not in found


def test_ends_at_rest_cost_what_a_disc_around_the_zone_proves():
    # E for the uniform law a, from `ends._cost`: s1 = a c / (a + A), t = sqrt(2 s1 / A), and the chord.
    # Of a zone within the disc of 1.25 D that law is a = 1 / 1.25. Clearance 1.5 m, 30 m apart, A = 1.
    asked = setting(start={"speed": "rest"}, goal={"speed": "rest"})
    where = (asked.limits, asked.surroundings, asked.start, asked.goal)

    def cost(a: float) -> float:
        cut = a * 1.5 / (a + 1.0)
        return math.sqrt(2.0 * cut) - math.sqrt(2.0 / a) * (math.sqrt(1.5) - math.sqrt(1.5 - cut))

    for shape, law in ((Disc(1.0), 1.0), (Ellipse(0.0, 1.25, 0.5), 0.8), (Straight(), 1.0)):
        zone = GaugeZone(shape, Disc(0.5), 1.0, 0.0)
        assert end_cost(*where, zone) == pytest.approx(2.0 * cost(law), rel=1e-9)
    # A safe start may have any speed that a disc inside allows: beside a capsule any at all. From the speed
    # sqrt(2 * 30) the 30 m take sqrt(60) s of braking to rest.
    free = (asked.limits, asked.surroundings, setting().start, asked.goal)
    assert straight_time(*free, zone) == pytest.approx(math.sqrt(60.0), rel=1e-12)


# A field set on the way at 1 m/s: the box of 0.5 m around the robot, as far ahead as D = 0.5 or 2 m.
BASE = {"type": "protective_field", "form": "rectangle", "side": 0.0}


def box(ahead: float) -> list[list[float]]:
    return [[-0.5, -0.5], [0.5 + ahead, -0.5], [0.5 + ahead, 0.5], [-0.5, 0.5]]


def fields_json() -> dict[str, Any]:
    # In the hall of `write_case` the end wall is 65 m from where the run ends, the front of the field 1 m.
    return {
        "schema": 1,
        "base": BASE,
        "cases": [
            {"case": 1, "max_speed": 1.0, "polygon": box(0.5)},
            {"case": 2, "max_speed": 2.0, "polygon": box(2.0)},
        ],
        "switches": [{"s": 0.0, "t": 0.0, "x": 5.0, "y": 2.0, "case": 1}],
        "least_separation": [64.0, None],
        "scanner_range": math.hypot(2.5, 0.5),
    }


def folder_with_fields(folder: Path, told: dict[str, Any] | None, dwell: float = 0.0) -> Path:
    zone = {"type": "field_set", "count": 2, "base": BASE, "dwell": dwell}
    write_case(folder, stop_arrays(), braking={"zone": zone})
    if told is not None:
        (folder / evidence.FIELDS).write_text(json.dumps(told))
    return folder


def test_fields_that_hold_what_they_claim_are_evidence(tmp_path):
    folder = folder_with_fields(tmp_path / "a", fields_json())
    found = judge(folder)
    check = next(check for check in found.checks if check.name == "fields")
    assert check.status == "passed", check.message
    assert found.zone is not None
    assert found.zone["fields"]["switches"] == 0
    assert found.zone["fields"]["least_separation"] == [pytest.approx(64.0, abs=1e-6), None]
    distance = next(c for c in found.checks if c.name == "braking_distance" and c.trajectory == "refined")
    assert distance.worst == pytest.approx(64.0, abs=1e-6)
    write_claims(folder)
    assert recheck(folder).reasons == ()


CHANGED: dict[str, tuple[Callable[[dict[str, Any]], Any], str]] = {
    "narrower": (lambda d: d["cases"][0]["polygon"][1].__setitem__(0, 0.9), "lacks 0.09"),
    "wider": (lambda d: d["cases"][1].__setitem__("polygon", box(2.5)), "beyond the field"),
    "slower": (lambda d: d["cases"][0].__setitem__("max_speed", 0.9), "beyond the field"),
    "other base": (lambda d: d.__setitem__("base", {"type": "uniform"}), "base"),
    "moved switch": (lambda d: d["switches"][0].__setitem__("x", 5.1), "switches[0]"),
    "further away": (lambda d: d["least_separation"].__setitem__(0, 64.1), "least_separation[0]"),
    "shorter range": (lambda d: d.__setitem__("scanner_range", 2.0), "scanner_range"),
    "unwatched": (lambda d: d["least_separation"].__setitem__(1, 60.0), "least_separation[1]"),
}


@pytest.mark.parametrize("name", CHANGED)
def test_fields_that_were_changed_fail_the_check(tmp_path, name):
    change, words = CHANGED[name]
    told = fields_json()
    change(told)
    found = judge(folder_with_fields(tmp_path / "a", told))
    check = next(check for check in found.checks if check.name == "fields")
    assert check.blocks
    assert words in check.message
    assert found.verdict == "failed"


def test_with_a_dwell_a_larger_field_may_be_watched_and_a_lesser_one_may_not(tmp_path):
    def message(told: dict[str, Any], dwell: float = 0.5) -> str:
        found = judge(folder_with_fields(tmp_path / "a", told, dwell))
        shutil.rmtree(tmp_path / "a")
        check = next(check for check in found.checks if check.name == "fields")
        assert check.status == ("passed" if check.message.startswith("fields: ") else "failed")
        return check.message

    # The larger reaches 2.5 m ahead, 1.5 m more than the lesser, which has 64 m.
    larger = fields_json() | {"least_separation": [None, 62.5]}
    larger["switches"][0]["case"] = 2
    assert message(larger) == "fields: 2, switched 0 times"
    assert "switches[0] is not where the speed calls for it" in message(larger, 0.0)
    wrong = fields_json()
    wrong["switches"][0]["x"] = 5.1
    assert "at no row" in message(wrong)
    wrong["switches"][0].update(x=5.0, case=3)
    assert "a case that is none" in message(wrong)
    wrong["switches"] = []
    assert "where the motion begins" in message(wrong)
    # 1 m/s is above 0.5 m/s: the second field is called for
    slower = fields_json()
    slower["cases"][0].update(max_speed=0.5, polygon=box(0.125))
    slower["cases"][1].update(max_speed=1.0, polygon=box(0.5))
    slower |= {"scanner_range": math.hypot(1.0, 0.5), "least_separation": [None, 64.0]}
    assert "a lesser field than the speed calls for is watched at t = 0.0" in message(slower)


def test_a_field_set_without_its_file_is_not_driven_under_fields(tmp_path):
    found = judge(folder_with_fields(tmp_path / "a", None))
    check = next(check for check in found.checks if check.name == "fields")
    assert check.status == "not_evaluated"
    assert found.verdict == "failed"


MALFORMED: tuple[dict[str, Any], ...] = (
    {"schema": 2},
    {"cases": 3},
    {"cases": []},
    {"cases": [{"case": 1, "max_speed": 1.0, "polygon": [1, 2, 3]}], "least_separation": [1.0]},
    {"cases": [{"case": 1, "max_speed": 1.0, "polygon": [[0, 0], [1]]}], "least_separation": [1.0]},
    {"cases": [{"case": 1, "max_speed": 1.0, "polygon": []}], "least_separation": [1.0]},
    {"cases": [{"case": 2, "max_speed": 1.0, "polygon": box(0.5)}], "least_separation": [1.0]},
    {"cases": [{"case": 1, "max_speed": -1.0, "polygon": box(0.5)}], "least_separation": [1.0]},
    {"cases": [{"case": 1, "max_speed": 1.0, "polygon": box(1e13)}], "least_separation": [1.0]},
    {"least_separation": [64.0]},
    {"switches": [{"s": 0.0}]},
    {"scanner_range": 10**400},
)


@pytest.mark.parametrize("change", MALFORMED)
def test_a_malformed_file_of_fields_is_refused(tmp_path, change):
    text = json.dumps({**fields_json(), **change})
    (tmp_path / evidence.FIELDS).write_text(text)
    with pytest.raises(evidence.EvidenceError, match=r"fields\.json"):
        read_fields(tmp_path)


@pytest.mark.parametrize("text", ["{", "[]", "3", '{"schema": 1, "scanner_range": NaN}'])
def test_what_is_no_file_of_fields_is_refused(tmp_path, text):
    (tmp_path / evidence.FIELDS).write_text(text)
    with pytest.raises(evidence.EvidenceError, match=r"fields\.json"):
        read_fields(tmp_path)


def test_a_bound_by_length_and_drive_is_held_against_motions_with_the_ends_asked_for():
    # From rest to rest over 30 m with 1 m/s^2 either way: sqrt(4 * 30) s, and no motion is faster.
    asked = setting(
        start={"speed": "rest"}, goal={"speed": "rest"}, braking={"zone": {"type": "protective_field"}}
    )
    peak = math.sqrt(30.0)
    motion = arcs_motion((5.0, 2.0), 0.0, [(15.0, 0.0), (15.0, 0.0)], [0.0, peak, 0.0], asked)
    assert motion.travel_time == pytest.approx(2.0 * peak)
    free = arcs_motion((5.0, 2.0), 0.0, [(30.0, 0.0)], [5.0, 5.0], asked)
    motions = {"collocation": free, "refined": motion}
    checks = [c for n, m in motions.items() for c in check_motion(m, n, evidence.MODEL_OF_PLAN[n], asked)]
    checks = [replace(c, status="passed", worst=0.0) if c.name == "braking_distance" else c for c in checks]
    for time, beaten in ((2.0 * peak, False), (2.0 * peak + 0.01, True)):
        proof = Proof(
            **{"holds": True, "travel_time": time, "reasons": (), "triangles": 1, "dropped": 0, "worst": 0.0},
            **{"at": (0.0, 0.0), "exact": False, "driven": True, "slack": np.zeros(1), "statement": ""},
        )
        found = judge_bound(proof, motions, 0.0, checks, asked)
        assert bool(found.beaten) is beaten  # the faster one of the variational model is another question
        assert found.as_result()["driven"]


def test_claims_about_the_zone_are_compared_with_what_the_judge_finds(tmp_path):
    folder = write_case(tmp_path / "a", stop_arrays(), braking=ELLIPSE)
    found = judge(folder)
    claimed = json.dumps({"schema": evidence.SCHEMA, **found.as_result()})
    assert compare(json.loads(claimed), found) == ()
    changes: tuple[Callable[[dict[str, Any]], Any], ...] = (
        lambda r: r["zone"].__setitem__("statement", "A disc."),
        lambda r: r["zone"].__setitem__("friction_reserve", False),
        lambda r: r["zone"]["parameters"].__setitem__("lateral_ratio", 0.6),
        lambda r: r["zone"]["promise"].__setitem__("worst_excess", -1.0),
        lambda r: r["zone"]["promise"].__setitem__("poses", 10_000),
        lambda r: r["zone"]["promise"].__setitem__("certainly", True),
        lambda r: r["zone"].__setitem__("fields", {"count": 4}),
        lambda r: r.pop("zone"),
    )
    for change in changes:
        result = json.loads(claimed)
        change(result)
        assert any(reason.startswith("zone") for reason in compare(result, found))
    plain = judge(write_case(tmp_path / "b", stop_arrays()))
    result = {**json.loads(json.dumps(plain.as_result())), "zone": {"type": "ellipse"}}
    assert compare(result, plain) == ("zone: claimed, but there is no evidence for it",)
    # the file of fields is part of the manifest
    fields = folder_with_fields(tmp_path / "c", fields_json())
    write_claims(fields)
    (fields / evidence.FIELDS).write_text(json.dumps({**fields_json(), "note": 1}))
    assert any("fields.json: changed" in reason for reason in recheck(fields).reasons)
