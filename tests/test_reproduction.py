"""The page of printed figures is the one that its data make, and the quick figures are computed again."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
import shapely
from scipy.optimize import brentq

from benchmarks.reproduction import fire, page, room, two_rooms, warehouse, warehouse_map
from benchmarks.reproduction.__main__ import main
from vnav_drake.braking import UniformBraking
from vnav_drake.problem import End, Problem
from vnav_drake.robot import Robot
from vnav_drake.scenario import load_scenario
from vnav_drake.speed_graph import speed_graph
from vnav_drake.vc_method import realise
from vnav_drake.voronoi import build_diagram
from vnav_drake.world import Obstacle, World

KEPT = page.read()
PAGE = page.PAGE.read_text(encoding="utf-8")


def kept(topic):
    return KEPT["topics"][topic]


# The page


def test_the_page_is_what_its_data_make():
    assert page.render(KEPT) == PAGE


def test_every_topic_has_been_measured_and_no_other():
    assert list(KEPT["topics"]) == list(page.topics()) == list(KEPT["seconds"])


def test_every_picture_on_the_page_is_there():
    shown = re.findall(r"!\[[^\]]+\]\(([^)]+)\)", PAGE)
    assert shown
    assert [name for name in shown if not (page.PAGE.parent / name).is_file()] == []


def test_every_table_has_as_many_cells_in_each_row_as_in_its_head():
    for block in re.findall(r"(?:^\|.*\n)+", PAGE, re.MULTILINE):
        assert len({line.count("|") for line in block.splitlines()}) == 1


def test_a_row_of_another_length_is_refused():
    with pytest.raises(ValueError, match="columns"):
        page.table(("a", "b"), [("1", "2", "3")])


def test_the_command_measures_one_topic_and_keeps_the_others(tmp_path, monkeypatch):
    for name in ("PAGE", "DATA"):
        monkeypatch.setattr(page, name, tmp_path / name)
    monkeypatch.setattr(page, "IMAGES", tmp_path)
    stale = {part: dict(values) for part, values in KEPT.items()}
    stale["topics"]["room"] = stale["topics"]["room"] | {"graphs": {}}
    page.write(stale)
    assert main(["--only", "room"]) == 0
    again = page.read()
    assert set(again["topics"]["room"]["graphs"]) == {"published", "sampled"}
    assert {k: v for k, v in again["topics"].items() if k != "room"} == {
        k: v for k, v in KEPT["topics"].items() if k != "room"
    }
    assert (tmp_path / "PAGE").read_text(encoding="utf-8") == page.render(again)
    assert (tmp_path / "reproduction_room.svg").is_file()


def test_the_command_knows_its_topics(capsys):
    with pytest.raises(SystemExit):
        main(["--only", "attic"])
    assert "warehouse" in capsys.readouterr().err


# The warehouse


@pytest.fixture(scope="module")
def left():
    return warehouse.reading("left")


@pytest.fixture(scope="module")
def right():
    return warehouse.reading("right")


@pytest.mark.parametrize("name", ["left", "right"])
def test_warehouse_is_measured_again(name, request):
    now, was = request.getfixturevalue(name), kept("warehouse")["readings"][name]
    for key in ("best", "shortest"):
        assert now[key]["name"] == was[key]["name"]
        assert now[key]["time"] == pytest.approx(was[key]["time"], rel=1e-9)
    for key in ("vc_method", "vc_method_in_gaps"):
        assert now[key]["time"] == pytest.approx(was[key]["time"], rel=1e-6)
    assert now["shortest_way"]["name"] == was["shortest_way"]["name"]
    assert [c["name"] for c in now["classes"]] == [c["name"] for c in was["classes"]]


@pytest.mark.parametrize(("name", "metres"), [("left", 25.0), ("right", 15.0)])
def test_the_class_through_the_gaps_takes_longer_than_its_gaps_allow(name, metres, request):
    # 10 m + 5 m (+ 10 m) of gaps 1 m wide (Manor 2015, Sec. 3.7): clearance 0.1 m, V = sqrt(2 * 1 * 0.1).
    found, bound = request.getfixturevalue(name), metres / math.sqrt(0.2)
    assert warehouse.least_time(found) == pytest.approx(bound, rel=1e-12)
    assert bound < found["shortest"]["time"] < found["vc_method_in_gaps"]["time"]
    # On the left the printed time is below it, on the right above.
    assert (bound > warehouse.PRINTED_SHORTEST) == (name == "left")


def test_the_vc_method_is_not_faster_than_the_optimum(left):
    # [25.44124, 25.44170] s holds the optimum (scenarios/warehouse.yaml).
    assert 25.44124 <= left["best"]["time"] <= 25.44170 < left["vc_method"]["time"]


def test_no_class_takes_the_printed_time_with_the_target_at_the_left(left):
    # The second class and the third lie on both sides of it; every optimum is certified.
    times = [c["time"] for c in left["classes"]]
    assert times == sorted(times)
    assert all(c["certified"] for c in left["classes"])
    assert times[1] < warehouse.PRINTED_SHORTEST < times[2]


def test_the_printed_times_fit_a_target_at_the_right(right):
    # 31.2 s, 42.9 s and their ratio (Manor 2015, Sec. 3.7), with the start of the scenario.
    assert right["best"]["time"] == pytest.approx(31.2, rel=0.025)
    assert right["shortest"]["time"] == pytest.approx(42.9, rel=0.025)
    assert right["shortest"]["time"] / right["best"]["time"] == pytest.approx(42.9 / 31.2, rel=0.005)


def test_the_fitted_start_gives_the_first_printed_time():
    fitted = kept("warehouse")["fitted"]
    asked = warehouse_map.problem("right", tuple(fitted["start"]))
    best = speed_graph(asked, classes=1, with_published=False).classes[0]
    assert best.travel_time == pytest.approx(31.2, abs=1e-3)
    assert fitted["shortest"] == pytest.approx(42.9, rel=0.01)


def test_the_printed_class_is_the_shortest_on_the_right_only(left, right):
    assert right["shortest_way"]["name"] == right["shortest"]["name"]
    assert left["shortest_way"]["name"] != left["shortest"]["name"]


def test_the_shortest_way_round_one_rack_by_hand():
    # A box of 2 m, radius 0.4 m, ends 3 m beside its middle: tangents from (-3, 0) and (3, 0) to the circles
    # around the upper corners (-1, 1) and (1, 1), an arc on each, and 2 m along the top.
    box = Obstacle(((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)), "O1")
    world = World.build([(-5, -5), (5, -5), (5, 5), (-5, 5)], [box])
    asked = Problem(
        world=world,
        robot=Robot(radius=0.4),
        braking=UniformBraking(max_braking=1.0),
        start=End(position=(-3.0, 0.0)),
        goal=End(position=(3.0, 0.0)),
    )
    far = math.hypot(2.0, 1.0)  # to the corner
    tangent = math.sqrt(far * far - 0.16)
    rise = math.atan2(1.0, 2.0) + math.asin(0.4 / far)  # of the tangent, which is the arc's angle too
    expected = 2.0 * (tangent + 0.4 * rise) + 2.0
    way = warehouse_map.shortest_way(asked)
    found = np.hypot(*np.diff(way, axis=0).T).sum()
    # The polygon around the circle has 32 sides: its corners lie 0.4 (1 / cos(pi / 32) - 1) = 1.9 mm outside,
    # and a way along it is longer by no more than twice that a corner.
    assert expected <= found <= expected + 2.0 * 2.0 * 0.4 * (1.0 / math.cos(math.pi / 32) - 1.0)
    assert asked.clearance(way).min() >= 0.0


def test_clearance_in_the_gaps_is_what_the_proof_says():
    # Independent of racks and boxes: sample the three gaps and ask the world.
    asked = warehouse_map.problem()
    for x, y in (((15, 25), (15, 16)), ((14, 15), (16, 21)), ((4, 14), (21, 22))):
        grid = np.stack(np.meshgrid(np.linspace(*x, 101), np.linspace(*y, 101)), axis=-1)
        assert asked.clearance(grid).max() == pytest.approx(0.1, abs=1e-12)


def test_racks_that_do_not_face_each_other_are_no_gap():
    with pytest.raises(ValueError, match="no gap"):
        warehouse_map.passage(warehouse_map.problem(), "O1", "O4")


def test_there_are_two_readings():
    with pytest.raises(ValueError, match="must be 'left' or 'right'"):
        warehouse_map.problem("upper")


# The four-point room


def test_iterations_end_where_changes_stay_small():
    # Changes 0.3, 0, 1e-3, 1e-6, 1e-9: the third is the last of 1e-5 s or more.
    assert room.iterations([8.0, 7.7, 7.7, 7.699, 7.698999, 7.698998999]) == 3
    assert room.iterations([7.6]) == 0


def test_room_is_measured_again():
    now, was = room.measure(), kept("room")
    for kind, graph in was["graphs"].items():
        again = now["graphs"][kind]
        assert again["nodes"] == graph["nodes"]
        for one, other in zip(again["classes"], graph["classes"], strict=True):
            assert one["name"] == other["name"]
            assert one["graph_time"] == pytest.approx(other["graph_time"], rel=1e-9)
            assert one["optimum"] == pytest.approx(other["optimum"], rel=1e-9)
            assert one["iterations"] == other["iterations"]
    best = [now["graphs"][kind]["classes"][0] for kind in ("published", "sampled")]
    # Two graphs, one optimum, and neither graph's path is below it.
    assert best[0]["optimum"] == pytest.approx(best[1]["optimum"], rel=1e-10)
    assert all(b["graph_time"] > b["optimum"] for b in best)
    # [7.31757, 7.31761] s holds it (scenarios/four_point_room.yaml).
    assert 7.31757 <= best[0]["optimum"] <= 7.31761


# The two-room office


def test_file_and_function_are_one_office():
    scenario = load_scenario(page.ROOT / "scenarios" / "two_room_office.yaml")
    of_file, made = scenario.problem, two_rooms.two_room_office(two_rooms.PROFILES_AT)
    assert (of_file.robot, of_file.braking) == (made.robot, made.braking)
    assert (of_file.start, of_file.goal) == (made.start, made.goal)
    assert of_file.friction_reserve == made.friction_reserve
    assert of_file.world.boundary.equals(made.world.boundary)
    assert [o.name for o in of_file.world.obstacles] == [o.name for o in made.world.obstacles]
    for one, other in zip(of_file.world.obstacles, made.world.obstacles, strict=True):
        assert np.allclose(one.vertices, other.vertices, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("delta", [1.0, 2.5, 4.5])
def test_passages_are_as_wide_as_the_text_says(delta):
    # W_l = 1.5 * 0.2 m, W_u = delta W_l (Manor 2015, Sec. 2.7.1); clearance in the middle W / 2 - 0.1 m.
    problem = two_rooms.two_room_office(delta)
    x, upper = 2.1, 0.3 * delta
    found = problem.clearance([(x, 0.15), (x, 3.0 - 0.5 * upper)])
    assert found == pytest.approx([0.05, 0.5 * upper - 0.1], abs=1e-9)


@pytest.mark.parametrize("delta", [0.9, 9.0, math.nan])
def test_a_delta_without_passage_or_table_is_refused(delta):
    with pytest.raises(ValueError, match="must be at least 1 and below 9"):
        two_rooms.two_room_office(delta)


@pytest.mark.parametrize("delta", [1.0, 3.4])
def test_one_delta_is_measured_again(delta):
    was = next(row for row in kept("two_rooms")["curve"] if row["delta"] == delta)
    now = two_rooms.at(delta)
    for key in ("lower", "upper", "vc_method", "shortest"):
        assert now[key]["time"] == pytest.approx(was[key]["time"], rel=1e-6)
    for key in ("vc_method", "shortest"):
        assert now[key]["passage"] == was[key]["passage"]
    assert was["vc_method"]["passage"] == ("lower" if delta < two_rooms.PRINTED_CROSSING else "upper")


def test_the_vc_method_takes_the_faster_passage():
    data = kept("two_rooms")
    assert len(data["curve"]) == 36  # from 1 to 4.5 by tenths
    for row in data["curve"]:
        least = min(row["lower"]["time"], row["upper"]["time"])
        assert row["vc_method"]["time"] == pytest.approx(least, rel=1e-9)
        assert row["vc_method"]["passage"] == ("upper" if row["delta"] > data["crossing"] else "lower")
        assert row["shortest"]["passage"] == "lower"


def least_time(problem, points, count=8001):
    """[s] from rest to rest along a polyline, by a forward and a backward pass at equal steps.

    Clearance from the obstacles' shapes through Shapely; none of the planner's code. v^2 <= 2 a_b d, and its
    slope is at most 2 a either way.
    """
    room_ = problem.world.boundary.difference(
        shapely.union_all([shapely.Polygon(o.vertices) for o in problem.world.obstacles])
    )
    line = shapely.LineString(points)
    place = np.linspace(0.0, line.length, count)
    distance = shapely.distance(shapely.line_interpolate_point(line, place), room_.boundary)
    a = problem.robot.max_braking
    assert a == problem.robot.max_acceleration
    square = 2.0 * a * (distance - problem.robot.radius)
    square[[0, -1]] = 0.0
    ramp = 2.0 * a * place
    square = np.minimum.accumulate(square - ramp) + ramp
    square = np.minimum.accumulate((square + ramp)[::-1])[::-1] - ramp
    v = np.sqrt(np.maximum(square, 0.0))
    return float((2.0 * np.diff(place) / (v[1:] + v[:-1])).sum())


def along_arcs(problem, curves):
    """Points of a route, corners and all."""
    part = np.linspace(0.0, 1.0, 201)
    points = curves.points(curves.span[:, :1] + np.diff(curves.span, axis=1) * part).reshape(-1, 2)
    return points[np.concatenate([[True], np.any(np.diff(points, axis=0) != 0.0, axis=1)])]


def rounded(problem, curves):
    """Points of the path with rounded corners. At 0.3 m/s no radius above 0.1 m is too tight to be driven."""
    path = realise(problem, curves).path
    assert 0.3**2 * np.abs(path.curvature).max() < problem.lateral_limit
    x, y, _, _ = path.at(np.linspace(0.0, path.length, 6001))
    return np.column_stack([x, y])


@pytest.mark.parametrize(("points_of", "key"), [(rounded, "crossing"), (along_arcs, "switch")])
def test_crossing_by_an_own_profile_along_both_ways(points_of, key):
    # Both times by `least_time`, their equality by Brent's method: three digits beside the bisection.
    def later(delta):
        problem = two_rooms.two_room_office(delta)
        routes = two_rooms.both_passages(problem, build_diagram(problem.world, two_rooms.RADIUS))
        lower, upper = (least_time(problem, points_of(problem, curves)) for curves in routes)
        return upper - lower

    found = brentq(later, 2.9, 3.1, xtol=1e-4)
    assert found == pytest.approx(kept("two_rooms")[key], abs=5e-4)


def test_bisection_finds_the_place_and_refuses_where_there_is_none():
    assert two_rooms.bisect(lambda x: x * x >= 2.0, 1.0, 2.0) == pytest.approx(math.sqrt(2.0), abs=1e-6)
    with pytest.raises(ValueError, match="nothing changes"):
        two_rooms.bisect(lambda x: x > 5.0, 1.0, 2.0)


# The fire extinguishers


def test_cruising_speed_by_hand():
    # 50 m in 60 s: at 0.1 m/s^2 50 + 10 s at 1 m/s; at 1 m/s^2 v^2 - 60 v + 50 = 0.
    assert fire.cruising_speed(50.0, 60.0, 0.1) == pytest.approx(1.0, rel=1e-12)
    assert fire.cruising_speed(50.0, 60.0, 1.0) == pytest.approx(30.0 - math.sqrt(850.0), rel=1e-12)
    # Triangular profile: 2 sqrt(L / a) = 20 s is the least.
    with pytest.raises(ValueError, match="50 m take 20 s at least"):
        fire.cruising_speed(50.0, 19.9, 0.5)


def test_fire_is_measured_again():
    now, was = fire.measure(), kept("fire")
    assert now["mean_speed"] == pytest.approx(5.0 / 6.0, rel=1e-12)
    for name, case in now["cases"].items():
        # `fastest_profile` gives away 4e-6 of the clearance (2e-6 of the speed), and 1e-6 of the speed.
        assert fire.TIME <= case["planned"] <= fire.TIME * (1.0 + 3e-6)
        assert case["width"] == pytest.approx(2.0 * (case["clearance"] + fire.RADIUS), rel=1e-12)
        assert case["warehouse"]["time"] == pytest.approx(was["cases"][name]["warehouse"]["time"], rel=1e-6)
    # v = 1 m/s at a_b = 0.1 m/s^2 needs 5 m.
    assert now["cases"]["Create, Sec. 2.8"]["clearance"] == pytest.approx(5.0, rel=1e-9)
