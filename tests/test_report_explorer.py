"""Numbers of the linked views: packed and unpacked, margins, layers and what is missing."""

from __future__ import annotations

import base64
import json
import re
from dataclasses import replace
from typing import Any

import matplotlib
import numpy as np
import pytest
from bokeh.models import Range1d
from bokeh.models.annotations import Label
from explorer_case import NO_CERTIFICATE, Case, make_case
from matplotlib.colors import to_hex
from report_case import warehouse

from tests.zone_case import zone_scenario
from verify.report import ReportExtras
from verify.report.explorer import NO_REASONS, explorer_scripts, explorer_sections
from verify.report.explorer.cursor import braking_law
from verify.report.explorer.curve_plots import MARGIN_TONES, friction_reach, label_places, speed_plot
from verify.report.explorer.embed import close_up
from verify.report.explorer.encode import data_block, lines, numbers
from verify.report.explorer.layers import layers
from verify.report.explorer.motions import DrawnMotion, followed, instants, least_around, margins_of
from verify.report.explorer.plots import clear_names, empty
from verify.report.figures_map import BAR_STEPS
from verify.report.html import script
from verify.report.palette import SPEED_MAP, variable_of_colour
from verify.report.series import Margin
from verify.report.stops import StopPaths
from verify.report.story_missing import reasons
from verify.report.zone_along import zone_along
from vnav_drake.plan import Path as Way
from vnav_drake.plan import Trajectory
from vnav_drake.world import Obstacle
from vnav_drake.zones.shapes import EllipseZone

LARGEST = 600_000  # [bytes] of numbers in a page


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Case:
    return make_case(tmp_path_factory.mktemp("explorer") / "warehouse")


@pytest.fixture(scope="module")
def sections(case: Case) -> dict[str, Any]:
    return case.sections()


def unpacked(text: str, kind: str) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), dtype=kind).astype(float)


def drawn(data: dict[str, Any]) -> list[np.ndarray]:
    """The lines of a layer, as the script reads them."""
    points = np.array(data["at"]) + np.array(data["step"]) * unpacked(data["xy"], "<u2").reshape(-1, 2)
    return np.split(points, unpacked(data["first"], "<u4").astype(int)[1:-1])


def flat(case: Case, **changes: Any) -> list[Any]:
    """All layers in one list, with `changes` to the evidence."""
    evidence = replace(case.evidence, **changes)
    groups = layers(case.problem, case.result, evidence, case.extras, NO_CERTIFICATE, NO_REASONS)
    return [layer for group in groups for layer in group]


def layer_of(found: list[Any], key: str) -> Any:
    return next(layer for layer in found if layer.key == key)


def test_numbers_are_kept_to_single_precision_and_what_is_not_finite_is_no_number():
    values = np.array([0.0, -1.5, np.pi, 1e-7, np.inf, np.nan])
    read = unpacked(numbers(values), "<f4")
    # a float of 24 bits is within 2^-24 of the number
    np.testing.assert_allclose(read[:4], values[:4], rtol=2.0**-24)
    assert np.isnan(read[4:]).all()


def test_lines_stay_where_they_are_and_straight_ones_need_two_points():
    angle = np.linspace(0.0, np.pi, 400)
    bow = 10.0 * np.column_stack([np.cos(angle), np.sin(angle)])
    straight = np.column_stack([np.linspace(-3.0, 7.0, 50), np.linspace(1.0, 2.0, 50)])
    first, second = drawn(lines([bow, straight[:1], straight], 50.0))
    assert len(second) == 2
    np.testing.assert_allclose(second, straight[[0, -1]], atol=20.0 / 65535)
    # on the circle up to thinning (50 m / 5000), chords of the given points and steps of 20 m / 65535
    assert np.abs(np.hypot(*first.T) - 10.0).max() < 0.01 + 10.0 * (np.pi / 399) ** 2 / 8.0 + 3.1e-4
    assert len(first) < 100
    assert lines([], 50.0)["xy"] == ""


def test_no_text_in_the_data_ends_its_element():
    names = ["</script><b>", "<!--<script>", "\u2028"]
    block = str(data_block({"names": names}))
    assert "<" not in block
    assert json.loads(block)["names"] == names
    with pytest.raises(ValueError, match="JSON"):
        data_block({"value": np.nan})


def test_the_least_margin_survives_between_instants():
    # one dip of 1 at t = 0.37 among values of 5: the instants beside it, 0 and 1, do not see it
    margin = Margin(key="clearance", name="Clearance", formula="d", unit="m",
                    t=np.array([0.0, 0.37, 0.4, 2.0]),
                    value=np.array([5.0, 1.0, 5.0, 5.0]), x=np.zeros(4), y=np.zeros(4))  # fmt: skip
    np.testing.assert_array_equal(least_around(margin, np.array([0.0, 1.0, 2.0])), [1.0, 5.0, 5.0])


def test_columns_are_those_of_the_motion_and_of_the_braking_law(case: Case):
    columns = followed(case.problem, case.motion, None).columns
    t = columns["t"]
    assert len(t) <= 1500
    x, y, _, v, *_ = case.motion.at(t)
    np.testing.assert_array_equal(np.stack([columns[k] for k in ("x", "y", "v")]), [x, y, v])
    clearance = case.problem.clearance(np.column_stack([x, y]))
    # a_b = 1 m/s^2, no reaction time, no margin: v^2 / 2 to stop, V(d) = sqrt(2 d)
    np.testing.assert_allclose(np.polynomial.Polynomial(braking_law(case.problem))(v), v * v / 2.0)
    np.testing.assert_allclose(columns["safe"], np.sqrt(2.0 * clearance))
    np.testing.assert_allclose(columns["share.braking"], 1.0 - v * v / (2.0 * clearance), atol=1e-12)
    # nearest is at a distance of clearance and radius 0.4 m
    away = np.hypot(columns["nearest_x"] - x, columns["nearest_y"] - y)
    np.testing.assert_allclose(away, clearance + 0.4, atol=1e-9)


def test_the_least_of_what_is_drawn_is_the_least_of_every_margin(case: Case):
    columns = followed(case.problem, case.motion, None).columns
    found = margins_of(case.problem, case.motion, None)
    assert {margin.key for margin in found} >= {"braking", "clearance", "friction", "steering"}
    for margin in found:
        assert columns[f"margin.{margin.key}"].min() == margin.value.min()
        assert margin.key in MARGIN_TONES


def test_kinks_are_instants():
    # a corner at x = 2 m, driven at 1 m/s: rows of one time and two headings
    corner = Way.polyline([(0.0, 0.0), (2.0, 0.0), (2.0, 1.0)])
    t = np.array([0.0, 2.0, 2.0, 3.0])
    motion = Trajectory(t, np.array([0.0, 2.0, 2.0, 2.0]), np.array([0.0, 0.0, 0.0, 1.0]),
                        np.array([0.0, 0.0, np.pi / 2, np.pi / 2]), np.ones(4), np.zeros(4), np.zeros(4),
                        np.ones(4))  # fmt: skip
    assert corner.length == motion.length == 3.0
    assert 2.0 in instants(motion, 5)


def test_in_a_zone_the_share_left_is_that_of_the_stopping_distance():
    # ellipse in a corridor, at 0.8 of the speed at which it touches: no reaction time, so the distance to
    # stop is as the square of the speed, and 1 - 0.8^2 of it is left, wherever the corridor holds it
    problem = zone_scenario(reserve=False).problem
    zone = problem.zone
    assert isinstance(zone, EllipseZone)
    t = np.linspace(0.0, 2.0, 41)

    def straight(speed: float) -> Trajectory:
        none = np.zeros(41)
        clearance = problem.clearance(np.column_stack([8.0 + speed * t, np.full(41, 2.0)]))
        return Trajectory(
            t, 8.0 + speed * t, np.full(41, 2.0), none, np.full(41, speed), none, none, clearance
        )

    # half as wide as the way to stop, in a corridor 4 m wide, radius 0.4 m: 0.5 v^2 / 2 = 2 - 0.4 m
    fastest = np.sqrt(6.4)
    motion = straight(0.8 * fastest)
    columns = followed(problem, motion, zone_along(problem, zone, motion)).columns
    assert columns["safe"][0] == pytest.approx(fastest, rel=1e-5)
    assert columns["share.braking"][0] == pytest.approx(1.0 - 0.8**2, abs=1e-4)
    # at a fifth of it the limit is beyond what was looked at: not drawn, and it has no words
    slow = straight(0.2 * fastest)
    motion_drawn = followed(problem, slow, zone_along(problem, zone, slow))
    assert np.isnan(motion_drawn.columns["safe"]).all()
    plot = speed_plot(problem, {"plan-refined": empty("own", "t", "v", "safe", "bend")}, "plan-refined", (),
                      motion_drawn, Range1d(start=0.0, end=2.0))  # fmt: skip
    assert [label.text for label in plot.select(Label)] == ["speed"]


def test_a_motion_that_is_no_plan_is_followed_under_a_name_of_its_own(case: Case):
    data = json.loads(
        replace(case, evidence=replace(case.evidence, executed_plan="")).sections()["explorer"].data
    )
    assert data["executed"] == "plan-executed"
    assert (
        set(data["motions"]["plan-executed"]) > set(data["motions"]["plan-refined"]) == {"t", "x", "y", "v"}
    )


def test_layers_say_what_is_not_there(case: Case):
    case.result["plans"]["dwa"] = {"reached": False}
    found = flat(case)
    del case.result["plans"]["dwa"]
    assert [layer.key for layer in found] == [
        "plan-voronoi_route", "plan-dwa", "plan-collocation", "plan-refined", "plan-simulation", "classes",
        "disc", "arcs", "graph", "mesh", "stops",
    ]  # fmt: skip
    missing = {layer.key: layer.missing for layer in found if layer.missing}
    assert missing == {
        "plan-dwa": "trajectories/dwa.csv was not written",
        "graph": "no drawing of it was kept",
        "mesh": "no lower bound was computed",
        "stops": "stops.npz was not written",
    }
    assert not any(layer.shown for layer in found if layer.missing)
    gone = layer_of(flat(case, simulation=None), "plan-simulation")
    assert gone.missing


def test_names_on_the_map_stand_clear_of_each_other_and_of_the_ends():
    # the world is 31 m wide, 560 px on the map: a name of four letters takes 1.6 m, the goal's 2 m
    problem = warehouse().problem
    (x, y), far = problem.goal.point, (15.0, 15.0)

    def square(name: str, at: tuple[float, float], half: float) -> Obstacle:
        corners = ((-half, -half), (half, -half), (half, half), (-half, half))
        return Obstacle(name=name, vertices=tuple((at[0] + dx, at[1] + dy) for dx, dy in corners))

    named = [square("seat", (far[0] + 0.3, far[1]), 0.2), square("desk", far, 1.0)]
    named += [square("lamp", (x + 1.0, y + 0.5), 0.1), square("rack", (far[0], far[1] + 2.0), 1.0)]
    assert {o.name for o in clear_names(named, problem)} == {"desk", "rack"}


def test_layers_say_why_their_stage_gave_nothing(case: Case):
    scenario = warehouse()
    unasked = replace(
        scenario,
        plan=replace(scenario.plan, methods=("voronoi_route",)),
        simulation=replace(scenario.simulation, stops=0),
    )
    broken = [{"stage": "speed_graph", "reason": "no path was found."}]
    for asked, result, graph, stops in (
        (unasked, {}, "speed_graph is not among plan.methods", "none are asked for (simulation.stops is 0)"),
        (scenario, {"missing": broken}, "no path was found", "stops.npz was not written"),
    ):
        why = reasons(asked, result)
        drawn = layers(case.problem, case.result, case.evidence, ReportExtras(), NO_CERTIFICATE, why)
        missing = {layer.key: layer.missing for group in drawn for layer in group}
        assert missing["graph"] == missing["classes"] == graph
        assert missing["stops"] == stops


def test_bad_stops_are_marked(case: Case):
    # two stops of three rows each, the second named by the result as one that collides
    stops = StopPaths(
        model="four_wheel", instant=np.array([1.0, 2.0]), straightened=np.array([False, True]),
        first=np.array([0, 3, 6]), t=np.array([0.0, 0.5, 1.0] * 2), v=np.array([1.0, 0.5, 0.0] * 2),
        x=np.array([20.0, 19.6, 19.5, 10.0, 9.6, 9.5]), y=np.full(6, 1.9),
    )  # fmt: skip
    simulation = case.result["simulation"]
    case.result["simulation"] = {
        **simulation,
        "emergency_stops": {
            "tried": 2, "collisions": 1, "bad": 1,
            "failed": [{"stop": 1, "instant": 2.0, "cause": "collision", "x": 9.5, "y": 1.9}],
        },
    }  # fmt: skip
    layer = layer_of(flat(case, stops=stops), "stops")
    case.result["simulation"] = simulation
    assert layer.label == "Emergency stops, 1 bad"
    assert (layer.data["straightened"], layer.data["bad"]) == ([1], [1])
    np.testing.assert_allclose(drawn(layer.data)[1], [[10.0, 1.9], [9.5, 1.9]], atol=1e-3)


def test_without_a_motion_its_place_says_why(case: Case):
    evidence = replace(
        case.evidence,
        executed=None,
        executed_plan="",
        reasons={"trajectory.csv": "trajectory.csv was not written"},
    )
    found = explorer_sections(case.problem, case.result, evidence, case.extras, None, NO_CERTIFICATE)
    assert found["explorer"] is None
    assert found["explorer_missing"] == "No motion to follow: trajectory.csv was not written."
    assert explorer_scripts(found) == ()


def test_data_is_small_and_every_motion_has_its_columns(sections: dict[str, Any]):
    assert len(sections["explorer"].data) + len(sections["explorer"].models) < LARGEST
    data = json.loads(sections["explorer"].data)
    assert data["executed"] == "plan-refined"
    assert set(data["motions"]) == {
        "plan-refined", "plan-collocation", "plan-voronoi_route", "plan-simulation", "class-1", "class-2",
    }  # fmt: skip
    own = data["motions"]["plan-refined"]
    assert {f"margin.{margin['key']}" for margin in data["margins"]} <= set(own)
    assert len({len(text) for text in own.values()}) == 1


def test_every_colour_of_the_models_has_a_variable(sections: dict[str, Any]):
    # but those of the scale of speeds, which is the same on both grounds
    steps = matplotlib.colormaps[SPEED_MAP].resampled(BAR_STEPS)
    known = set(variable_of_colour()) | {to_hex(steps(k)) for k in range(BAR_STEPS)}
    assert set(re.findall(r"#[0-9a-fA-F]{6}\b", str(sections["explorer"].models))) <= known


def test_nothing_needs_eval_and_no_script_ends_early(sections: dict[str, Any]):
    assert "CustomJS" not in str(sections["explorer"].models)
    for name in explorer_scripts(sections):
        assert "</script" not in script(name)
        assert "<!--" not in script(name)


def test_a_path_of_a_class_that_has_no_motion_is_drawn(case: Case):
    first, second = case.extras.speed_graph.classes
    graph = replace(case.extras.speed_graph, classes=[first, replace(second, motion=None)])
    found = replace(case, extras=replace(case.extras, speed_graph=graph)).sections()
    assert set(json.loads(found["explorer"].data)["motions"]["class-2"]) == {"x", "y"}


def test_words_stand_where_they_cover_nothing():
    # a level curve at 1 and another one just above it in the left half: the words go to the right half
    x = np.linspace(0.0, 10.0, 200)
    level = np.column_stack([x, np.ones(200)])
    above = np.column_stack([x, np.where(x < 5.0, 1.1, np.nan)])
    (place,) = label_places([level, above], [0], (0.0, 10.0, 0.0, 2.0))
    assert place[0] > 5.0
    assert place[1] == pytest.approx(1.0)


def test_the_friction_plot_shows_what_is_used(case: Case):
    # mu g = 5.9 m/s^2; the motion uses at most a_b = 1 in all, so 1.35 m/s^2 are shown
    reach = friction_reach(case.problem, followed(case.problem, case.motion, None))
    columns = followed(case.problem, case.motion, None).columns
    used = max(1.0, float(np.hypot(columns["a"], columns["turn"]).max()))
    assert reach == pytest.approx(1.35 * used)
    assert reach < 0.7 * 0.6 * 9.81


def test_words_keep_off_those_at_the_end_of_a_level():
    # one curve that is free everywhere; where another one's words end at its right end, these keep left
    x = np.linspace(0.0, 10.0, 200)
    curve = np.column_stack([x, np.where(x < 7.0, np.nan, 1.0)])
    frame = (0.0, 10.0, 0.0, 2.0)
    wide = np.column_stack([x, np.ones(200)])
    (place,) = label_places([wide, curve], [0], frame, [(8.7, 1.0)])
    assert place[0] <= 10.0 - 4.0 * 1.3 + 1e-9  # two half widths of 0.13 each


def test_small_motions_are_shown_close_up(case: Case):
    # the hall is 32 m by 26 m: 4 m are less than a third of it, 12 m are not; radius 0.4 m
    x0, _, x1, _ = case.problem.world.bounds

    def across(length: float) -> dict[str, DrawnMotion]:
        return {
            "plan-refined": DrawnMotion(columns={"x": np.array([10.0, 10.0 + length]), "y": np.full(2, 2.0)})
        }

    found = close_up(case.problem, across(4.0))
    # half of 4 m + 2 radii, and a radius, on each side
    assert found == pytest.approx([10.0 - 2.8, 2.0 - 2.8, 14.0 + 2.8, 2.0 + 2.8])
    assert x1 - x0 > 3.0 * 4.8
    assert close_up(case.problem, across(12.0)) is None
