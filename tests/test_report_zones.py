"""The report's section on the braking zone: zone, limits, gains and promise by exact cases, and the page."""

from __future__ import annotations

import json
import math
import os
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Any

import numpy as np
import pytest

from tests.report_case import warehouse
from tests.test_report import Page
from tests.zone_case import write_zone_folder, zone_scenario
from verify.replay_motion import zone_steps
from verify.replay_shapes import fan, rim
from verify.report import ReportExtras, write_report
from verify.report.answer_details import details
from verify.report.evidence import SimulatedRun, read_evidence
from verify.report.figures_gain import limit_shown
from verify.report.figures_zone import ShapeData, draw_shape, runs
from verify.report.html import script
from verify.report.key_figures import key_figures
from verify.report.stops import StopPaths
from verify.report.stops_zone import claimed_zones, zone_finding
from verify.report.story_zone import plugin_sentences, relaxation_sentence, shape_words, zone_story
from verify.report.zone_along import HIGHEST, KEYS, LIMITS, arc_points, held_arc_length, placed, zone_along
from verify.report.zone_gain import gain, stretches
from verify.report.zone_sections import motion_zone, zone_sections
from vnav_drake.plan import Trajectory
from vnav_drake.problem import Problem
from vnav_drake.zones.convex_zone import GaugeZone
from vnav_drake.zones.field_set import FieldSet
from vnav_drake.zones.shapes import EllipseZone, PolygonZone, ProtectiveField

SPEED = 1.2  # [m/s], constant, along the bottom corridor of the warehouse


def straight(speed: float = SPEED, y: float = 2.0) -> Trajectory:
    """From (26, y) to (4, y) at constant speed: the corridor between the hall's wall and a row of racks."""
    s = np.linspace(0.0, 22.0, 111)
    still = np.zeros_like(s)
    return Trajectory(s / speed, 26.0 - s, still + y, still + math.pi, still + speed, still, still, still + y)


def problem(zone: GaugeZone | None = None, *, reserve: bool = True) -> Problem:
    found = zone_scenario(reserve=reserve).problem
    return found if zone is None else replace(found, zone=zone)


def ellipse(beta: float) -> EllipseZone:
    return EllipseZone(law=warehouse().problem.braking, radius=0.4, lateral_ratio=beta)


@pytest.mark.parametrize("beta", [1.0, 0.5])
def test_in_a_corridor_speed_and_gap_are_those_of_two_walls(beta):
    # Walls at y = 0 and y = 4 m, 2 m to either side; their normals are across the heading, where h_E = beta:
    # gap = 2 - rho - beta v^2/(2 a), zero at v = sqrt(2 a (2 - rho)/beta); a = 1, rho = 0.4. At x < 13 m the
    # zone, shorter than 5 m, sees nothing else (the racks end at 14 m and 4 m; their gap is beside it).
    zone = ellipse(beta)
    along = zone_along(problem(zone), zone, straight())
    inner = (along.x > 7.0) & (along.x < 12.0)
    assert along.gap[inner] == pytest.approx(1.6 - beta * SPEED**2 / 2.0, abs=1e-9)
    fastest = min(math.sqrt(2.0 * 1.6 / beta), HIGHEST * SPEED)
    assert along.fastest[inner] == pytest.approx(fastest, rel=1e-5)


def test_what_holds_a_motion_is_told_in_order():
    zone = ellipse(0.5)
    assert tuple(LIMITS) == KEYS
    # at the corridor's speed the zone touches both walls; slower nothing holds it; faster than it may be
    # it is still the zone; at the least of zone and cap both hold it, and the zone is told
    for speed, cap, key in ((math.sqrt(6.4), math.inf, "zone"), (1.2, math.inf, "none"), (1.2, 1.2, "speed")):
        capped = zone.with_law(replace(zone.law, max_speed=cap))
        along = zone_along(problem(capped), capped, straight(speed))
        inner = (along.x > 7.0) & (along.x < 12.0)
        assert {KEYS[k] for k in along.limit[inner]} == {key}


def test_a_stop_with_the_steering_held_is_as_long_as_derived():
    # mu g = 0.6 * 9.81 = 5.886, a_b = 1: up to k v^2 = sqrt(5.886^2 - 1) it brakes at a_b: v^2/2 long
    assert held_arc_length(problem(), 2.0, 1.0) == pytest.approx(2.0, rel=1e-12)
    assert held_arc_length(problem(), 2.0, -1.0) == held_arc_length(problem(), 2.0, 1.0)
    # mu g = a_b: at lambda = k v^2/(mu g) = 1 the arc is asin(1)/(2 k) long, its chord 1.531 v^2/2
    robot = replace(problem().robot, friction=1.0 / 9.81)
    length = held_arc_length(replace(problem(), robot=robot), 1.0, 1.0)
    assert length == pytest.approx(math.pi / 4.0, rel=1e-9)
    chord = float(np.hypot(*arc_points(length, 1.0)[-1]))
    assert chord / 0.5 == pytest.approx(4.0 * math.sin(math.pi / 8.0), rel=1e-9)


def test_an_arc_turns_by_its_length_times_its_curvature():
    end = arc_points(math.pi, 0.5)[-1]  # a quarter of a circle of 2 m
    assert end == pytest.approx([2.0, 2.0], abs=1e-12)
    assert placed(end[None], (1.0, 1.0), math.pi / 2)[0] == pytest.approx([-1.0, 3.0], abs=1e-12)


def test_time_gained_is_that_of_two_constant_speeds():
    zone = ellipse(0.5)
    along = zone_along(problem(zone), zone, straight(2.0))
    found = gain(along, straight(1.0))
    assert found.same_way
    assert found.saved == pytest.approx(along.s * (1.0 - 0.5), abs=1e-6)  # s/1 - s/2
    assert found.total == pytest.approx(11.0, rel=1e-9)
    parts = stretches(along, found)
    assert math.fsum(part.saved for part in parts) == pytest.approx(found.total, rel=1e-9)
    assert math.fsum(part.time for part in parts) == pytest.approx(11.0, rel=1e-9)
    assert (parts[0].first, parts[-1].last) == (0.0, pytest.approx(22.0))


def test_other_ways_are_compared_at_equal_shares():
    zone = ellipse(0.5)
    along = zone_along(problem(zone), zone, straight(2.0))
    # the same floor 8 m further up: 0.36 of the length apart
    found = gain(along, straight(1.0, y=10.0))
    assert not found.same_way
    assert found.saved == pytest.approx(along.s * 0.5, abs=1e-6)


def test_runs_are_stretches_of_equal_values():
    assert runs(np.array([1, 1, 0, 2, 2])) == [(0, 1), (2, 2), (3, 4)]


def stop(length: float) -> StopPaths:
    """A stop of a robot that drives to the left (-x) at 2 m/s, straight on for `length`."""
    x = 10.0 - np.linspace(0.0, length, 41)
    return StopPaths(
        model="point", instant=np.array([1.0]), straightened=np.array([False]), first=np.array([0, 41]),
        t=np.linspace(0.0, 2.0, 41), x=x, y=np.full(41, 2.0), v=np.linspace(2.0, 0.0, 41),
    )  # fmt: skip


@pytest.mark.parametrize(("length", "beyond"), [(2.0, 0.0), (2.3, 0.3), (1.5, -0.5)])
def test_a_straight_stop_ends_as_far_beyond_its_zone_as_it_is_too_long(length, beyond):
    # D = v^2/(2 a) = 2 m; ahead the ellipse reaches D, and the body in both is the same disc. What is inside
    # is nearest to the rim in some direction that is no further from the heading than its rim in that one.
    t = np.linspace(0.0, 2.0, 21)
    run = SimulatedRun(
        t=t, x=12.0 - 2.0 * t, y=np.full(21, 2.0), heading=np.zeros(21) + 3.0, v=np.full(21, 2.0)
    )
    zone = ellipse(0.5)
    claims = claimed_zones(problem(zone), zone, stop(length), run)
    assert claims.course == pytest.approx([math.pi])  # of the motion, not of the body
    assert claims.beyond[0] == pytest.approx(beyond, abs=1e-9) or (
        beyond < 0.0 and beyond <= claims.beyond[0] < 0.0
    )
    told = zone_finding({"left_zone": int(beyond > 0.0), "tried": 1}, problem(zone), claims)[0]
    assert ("Every stop ends inside" in told) == (beyond <= 0.0)


@pytest.mark.parametrize(
    ("zone", "words"),
    [
        (ellipse(0.5), "1 D ahead, 1 D behind and 0.5 D to either side"),
        (
            ProtectiveField(law=warehouse().problem.braking, radius=0.4, form="rectangle", side=0.1),
            "the robot's square, 0.1 m wider on either side, as far ahead as",
        ),
        (
            PolygonZone(
                law=warehouse().problem.braking, radius=0.4, vertices=((0.0, -0.5), (1.0, 0.0), (0.0, 0.5))
            ),
            "A convex polygon of 3 corners",
        ),
    ],
)
def test_shapes_are_told_in_words(zone, words):
    assert words in shape_words(zone).replace("\u00a0", " ")


def test_the_plugin_of_a_zone_is_told_as_far_as_known():
    def sentences(**plugin: str) -> list[str]:
        return plugin_sentences({"zone": {"type": "egg", "plugin": plugin}})

    known = {"distribution": "eggs", "version": "1.2", "sha256": "0123456789abcdef" * 4}
    assert sentences(module="egg_zone", **known) == [
        "It comes from the plugin egg_zone of the package eggs 1.2, its source has the SHA-256 "
        "0123456789abcdef…; its own functions are taken at their word."
    ]
    assert sentences(module="egg_zone") == [
        "It comes from the plugin egg_zone; its own functions are taken at their word."
    ]
    assert plugin_sentences({"zone": {"type": "ellipse"}}) == plugin_sentences({}) == []


def test_analytic_plans_say_on_what_they_ran():
    plans = {"speed_graph": {}, "vc_method": {}}
    inner = relaxation_sentence({"plans": plans, "zone": {"relaxation": "inner"}})
    assert inner.startswith("vc-method and Speed graph know uniform braking only and ran on the isotropic")
    outer = relaxation_sentence({"plans": {"vc_method": {}}, "zone": {"relaxation": "outer"}})
    assert outer.startswith("vc-method knows uniform braking only and ran with a disc that holds the zone")
    assert relaxation_sentence({"plans": plans}) == ""


# the replay


def test_the_zone_of_the_replay_reaches_as_far_as_the_zone_in_every_frame():
    speed = np.concatenate([np.linspace(0.0, 2.5, 40), np.linspace(2.5, 0.0, 25)])
    zone = ellipse(0.5)
    steps = zone_steps(zone, speed)
    assert np.sum([step.shown for step in steps], axis=0).tolist() == [1] * len(speed)
    for angle, axis in ((0.0, 0), (math.pi / 2, 1)):
        reach = zone.support(np.full(len(speed), angle), speed)[0]
        drawn = sum(step.shown * step.outline[:, axis].max() * step.stretch[:, axis] for step in steps)
        assert drawn == pytest.approx(reach, rel=1e-12)


def test_fields_of_the_replay_are_drawn_as_they_are():
    zone = ellipse(0.5)
    fields = FieldSet(law=zone.law, radius=zone.radius, base=zone, max_speeds=(1.0, 2.0))
    slow, fast = zone_steps(fields, [0.0, 1.0, 1.01, 2.0])
    assert slow.shown.tolist() == [True, True, False, False]
    assert fast.shown.tolist() == [False, False, True, True]
    assert fast.outline[:, 0].max() == pytest.approx(0.4 + 2.0, rel=1e-9)  # rho + v^2/(2 a)
    assert np.all(slow.stretch[slow.shown] == 1.0)


def test_outlines_of_the_replay_have_the_area_of_their_polygons():
    square = np.array([[1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0]])
    for triangles, area in ((fan(square, 0.1), 4.0), (rim(square, 0.5, 0.1), 3.0)):
        sides = triangles[:, 1:] - triangles[:, :1]
        assert np.cross(sides[:, 0], sides[:, 1])[:, 2].sum() / 2.0 == pytest.approx(area, rel=1e-12)


# the page


def written(folder: FilePath, result: dict[str, Any], *, reserve: bool = True) -> str:
    file = folder / "report.html"
    write_report(
        file, scenario=zone_scenario(reserve=reserve), result=result, folder=folder, extras=ReportExtras()
    )
    return file.read_text(encoding="utf-8")


def said(text: str) -> str:
    return Page(text).text.replace("\u00a0", " ").replace("\u202f", " ")


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> tuple[FilePath, dict[str, Any], str]:
    folder = tmp_path_factory.mktemp("zone") / "warehouse"
    result = write_zone_folder(folder)
    return folder, result, written(folder, result)


@pytest.fixture(scope="module")
def risky(tmp_path_factory: pytest.TempPathFactory) -> str:
    folder = tmp_path_factory.mktemp("risky") / "warehouse"
    result = write_zone_folder(folder, reserve=False, uniform=False)
    cases = [
        {"case": k + 1, "max_speed": v, "polygon": [[-1, -1], [v, 0], [-1, 1]]}
        for k, v in ((0, 1.3), (1, 4.0))
    ]
    fields = {
        "schema": 1, "cases": cases, "scanner_range": 4.5, "least_separation": [0.25, 0.0],
        "switches": [{"s": 1.0, "t": 1.3, "x": 27.0, "y": 1.9, "case": 2}],
    }  # fmt: skip
    (folder / "fields.json").write_text(json.dumps(fields), encoding="utf-8")
    result["zone"]["fields"] = {"count": 2, "cost": 0.021}
    return written(folder, result, reserve=False)


def test_the_section_is_there_with_unique_ids_and_its_script(case):
    page = Page(case[2])
    sections = [a["id"] for tag, a in page.elements if tag == "h2"]
    assert sections[2:4] == ["explore-title", "zone"]
    ids = [a["id"] for _, a in page.elements if "id" in a]
    assert len(ids) == len(set(ids))
    assert {"zone-viewer", "zone-data", "zone-map-title", "zone-gain-narrow-title"} <= set(ids)
    assert script("zone_viewer.js") in case[2]


def test_a_disc_has_no_such_section(tmp_path):
    problem = warehouse().problem
    evidence = read_evidence(tmp_path)
    assert motion_zone(problem, {}, evidence) is None
    sections = zone_sections(problem, {}, evidence, None, plan="refined", subject="executed motion")
    assert sections["zone"] is None
    assert not any(sections[key].pictures for key in ("zone_map", "zone_gain", "zone_promise"))


def test_the_answer_and_the_tiles_tell_what_the_zone_gains(case):
    folder, result, text = case
    slow, fast = (result["plans"][name]["travel_time"] for name in ("uniform", "refined"))
    words = " ".join(details(result, rest_ends=True)).replace("\u00a0", " ")
    assert (
        f"With uniform braking it would take {slow:.3f} s: the braking zone gains {slow - fast:.3f} s."
        in words
    )
    tiles = {figure.name: figure.value for figure in key_figures(result, read_evidence(folder))}
    assert tiles["With uniform braking"] == f"{slow:.3f}\u00a0s"
    assert tiles["Gained by the zone"] == f"{slow - fast:.3f}\u00a0s"
    assert "Voronoi route: 17.990 s with the disc" in said(text)


def test_a_promise_that_is_kept_and_one_that_is_not(case, risky):
    assert "no such stop leaves the zone claimed, and none touches anything" in said(case[2])
    assert "zone-promise-title" not in case[2]
    words = said(risky)
    assert "96 leave the zone claimed by up to 1.20 m, 18 run into an obstacle, up to 0.210 m deep" in words
    assert "this zone promises less than it seems to" in words
    assert "From 18 of 800 poses" in words
    assert "zone-promise-title" in risky


def test_fewer_fields_than_asked_for_are_told():
    fields = {"count": 1, "cost": 0.0}
    for asked, told in ((3, True), (1, False)):
        result = {"zone": {"fields": fields, "parameters": {"count": asked}}}
        words = " ".join(zone_story(result, problem(), None, None, (), {}).fields)
        assert ("1 of 3 asked for: more would gain nothing." in words) is told


def test_captions_tell_only_of_what_is_drawn(case):
    zone = ellipse(0.5)
    slow = zone_along(problem(zone), zone, straight(0.2))  # far below what the corridor allows
    assert not limit_shown(slow)
    assert limit_shown(zone_along(problem(zone), zone, straight(2.2)))
    assert "Dashed: the greatest speed" in said(case[2])
    base = problem(zone)
    point = replace(base, robot=replace(base.robot, radius=0.0))
    for setting, discs in ((base, True), (point, False)):
        caption = draw_shape(ShapeData(problem=setting, zone=zone, top=1.0)).caption
        assert ("Dashed discs" in caption) is discs


def test_without_uniform_braking_the_page_says_so(risky):
    words = said(risky)
    assert "There is no plan with uniform braking to compare with." in words
    assert "trajectories/uniform.csv was not written" in words


def test_fields_are_listed_and_are_inputs_to_a_safety_case(risky):
    words = said(risky)
    assert "2 fields stand for the zone, switched once on the way." in words
    assert "They cost 2.10 % of travel time" in words
    assert "inputs to a safety case" in words
    assert re.search(r"\b1 1\.30 m/s 1\.30 m 2\.00 m 0\.250 m", words)
    assert "zone-fields-title" in risky


def test_numbers_of_the_viewer_land_on_the_picture(case):
    data = json.loads(re.search(r'id="zone-data">(.*?)</script>', case[2], re.DOTALL)[1])
    steps = len(data["s"])
    assert {len(data[key]) for key in ("t", "v", "x", "y", "gap", "held", "outlines")} == {steps}
    for key, frame in data["maps"].items():
        box = re.search(rf'<svg viewBox="0 0 ([\d.]+) ([\d.]+)"[^>]*aria-labelledby="{key}-title', case[2])
        wide, high = map(float, box.groups())
        # equal scales, and y upwards: the hall's corners lie in the picture
        assert frame["x"][1] == pytest.approx(-frame["y"][1], rel=1e-6)
        for x, y in ((0.0, 0.0), (32.0, 31.0)):
            assert 0.0 < frame["x"][0] + frame["x"][1] * x < wide
            assert 0.0 < frame["y"][0] + frame["y"][1] * y < high
    for frame in data["curves"].values():
        assert frame["x"][0] + frame["x"][1] * data["s"][-1] == pytest.approx(frame["side"][1], abs=0.5)


@pytest.mark.skipif(
    shutil.which("chromium") is None and not os.environ.get("CI"),
    reason="no Chromium on this system; continuous integration must have one",
)
def test_a_browser_draws_the_zone_under_the_pages_policy(case, tmp_path):
    command = [
        "chromium", "--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking",
        "--enable-logging=stderr", f"--user-data-dir={tmp_path}", "--dump-dom",
        f"file://{case[0] / 'report.html'}",
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    assert "CONSOLE" not in done.stderr  # no error, nothing refused by the policy
    viewer = re.search(r'<div class="viewer" id="zone-viewer"[^>]*>', done.stdout)
    assert "hidden" not in viewer[0]
    assert re.search(r'<polygon [^>]*points="[\d. ,-]{400,}"', done.stdout)
    assert re.search(r"<output[^>]*>[\d.]+ s, [\d.]+ m, [\d.]+ m/s: ", done.stdout)
