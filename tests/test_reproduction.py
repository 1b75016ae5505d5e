"""The page of printed figures is the one that its data make, and the quick figures are computed again."""

from __future__ import annotations

import copy
import math
import re

import numpy as np
import pytest
import shapely

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


@pytest.fixture(scope="module")
def room_now():
    return room.measure()


def test_the_command_measures_one_topic_and_keeps_the_others(tmp_path, monkeypatch, room_now):
    monkeypatch.setattr(room, "measure", lambda: room_now)
    for name in ("PAGE", "DATA"):
        monkeypatch.setattr(page, name, tmp_path / name)
    monkeypatch.setattr(page, "IMAGES", tmp_path)
    stale = {part: dict(values) for part, values in KEPT.items()}
    stale["topics"]["room"] = stale["topics"]["room"] | {"graphs": {}}
    page.write(stale)
    assert main(["--only", "room"]) == 0
    again = page.read()
    assert again["topics"]["room"] == room_now
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
    return kept("warehouse")["readings"]["right"]


def test_warehouse_is_measured_again(left):
    was = kept("warehouse")["readings"]["left"]
    for key in ("best", "shortest"):
        assert left[key]["name"] == was[key]["name"]
        assert left[key]["time"] == pytest.approx(was[key]["time"], rel=1e-9)
    for key in ("vc_method", "vc_method_in_gaps"):
        assert left[key]["time"] == pytest.approx(was[key]["time"], rel=1e-6)
    assert left["shortest_way"]["name"] == was["shortest_way"]["name"]
    assert [c["name"] for c in left["classes"]] == [c["name"] for c in was["classes"]]


def test_both_times_of_the_other_reading_are_measured_again(right):
    now = warehouse._times(right["start"][1])
    for key in ("best", "shortest"):
        assert now[key] == pytest.approx(right[key]["time"], rel=1e-9)


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


def changed(topic):
    """What is kept of a topic, to be changed."""
    return copy.deepcopy(kept(topic))


def test_what_is_said_of_the_warehouse_follows_the_data():
    data = changed("warehouse")
    text = warehouse.section(data)
    assert "**The printed times fit a target at the lower right corner.**" in text
    assert "does not depend on a_b, agrees." in text
    assert "is the shortest there, and is not with the target at the left" in text
    # 25.0 s is 1 - 25 / 31.2 = 19.9 % off although below what is printed.
    data["readings"]["right"]["best"]["time"] = 25.0
    data["readings"]["right"]["shortest_way"]["name"] = "XX"
    text = warehouse.section(data)
    assert "**The printed times do not fit a target at the lower right corner.**" in text
    assert "the first comes out 19.9 % off" in text
    assert "come out within" not in text
    assert "agree" not in text
    # 43.9286 / 25 = 1.757 for 42.9 / 31.2 = 1.375
    assert "is 1.757 for 1.375" in text
    assert "is not the shortest there, nor with the target at the left" in text


def test_a_class_with_the_printed_time_is_said_to_have_it():
    data = changed("warehouse")
    left = data["readings"]["left"]
    assert "no class found has the printed time" in warehouse.section(data)
    left["classes"] = left["classes"][:2]
    left["classes"][1]["time"] = 42.8
    text = warehouse.section(data)
    assert "1 of the classes found come within 5 % of the printed time: 2 take less" in text
    assert "the next one" not in text


def test_the_proof_claims_no_more_than_its_numbers():
    data = changed("warehouse")
    assert "**42.9 s is impossible with the target at the left.**" in warehouse.section(data)
    assert "contradiction" in warehouse.summary(data)[2].note
    for gap in data["readings"]["left"]["gaps"]:
        gap["least_time"] = 14.0  # 42 s in all, less than 42.9 s
    data["printed"]["height"] = 31.0  # 4 * 5 + 3 * 1 + 2 * 4
    text = warehouse.section(data)
    assert "impossible" not in text
    assert "not ruled out by the gaps" in text
    assert "**No contradiction: the height.**" in text
    assert warehouse.summary(data)[2].note == "agrees"


# The four-point room


def test_iterations_end_where_changes_stay_small():
    # Changes 0.3, 0, 1e-3, 1e-6, 1e-9: the third is the last of 1e-5 s or more.
    assert room.iterations([8.0, 7.7, 7.7, 7.699, 7.698999, 7.698998999]) == 3
    assert room.iterations([7.6]) == 0


def test_room_is_measured_again(room_now):
    now, was = room_now, kept("room")
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


@pytest.mark.parametrize(
    ("count", "note"), [(4, "one fewer than"), (5, "agrees"), (6, "one more than"), (2, "3 fewer than")]
)
def test_iterations_are_compared_with_those_printed(count, note):
    # Manor 2015, Sec. 3.6.1: five iterations.
    data = changed("room")
    data["graphs"]["published"]["classes"][0]["iterations"] = count
    assert room.summary(data)[2].note.startswith(note)


def test_the_picture_of_the_room_shows_the_printed_count():
    data = changed("room")
    data["printed"]["iterations"] = 7
    axes = room.figures(data)["room"].axes[0]
    (label,) = [text for text in axes.texts if text.get_text().startswith("printed")]
    assert label.get_text() == "printed: 7"
    assert label.xy[0] == 7
    assert any(set(line.get_xdata()) == {7} for line in axes.lines)


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

    Clearance from the obstacles' shapes through Shapely; none of the planner's code, but the polyline is the
    caller's. v^2 <= 2 a_b d, and its slope is at most 2 a either way.
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
    # Three digits: by `least_time` the order of both ways changes within 5e-4 of what the bisection found.
    # Profile and clearance are independent of the planner; the geometry of both ways (routes along Voronoi
    # arcs, and their rounded corners) is the planner's own.
    def later(delta):
        problem = two_rooms.two_room_office(delta)
        routes = two_rooms.both_passages(problem, build_diagram(problem.world, two_rooms.RADIUS))
        lower, upper = (least_time(problem, points_of(problem, curves)) for curves in routes)
        return upper - lower

    found = kept("two_rooms")[key]
    assert later(found - 5e-4) > 0.0 > later(found + 5e-4)


def test_what_is_said_of_the_office_follows_the_data():
    data = changed("two_rooms")
    text = two_rooms.section(data)
    assert '"modest", as the text says' in text
    assert "What is confirmed is the shape: a constant ratio of 1 up to the crossing, a kink there" in text
    assert "not confirmed" not in text
    for row in data["curve"]:
        row["vc_method"]["time"] *= 0.3
    text = two_rooms.section(data)
    assert 'far more than "modest"' in text
    assert "is confirmed" not in text
    assert "What is not confirmed is the shape: a constant ratio of 1 up to the crossing" in text
    assert "a moderate gain beyond it" in text


def test_a_gain_that_is_none_is_no_gain():
    data = changed("two_rooms")
    for row in data["curve"]:
        row["vc_method"]["time"] = row["shortest"]["time"]
    text = two_rooms.section(data)
    assert "no gain at all" in text
    assert "What is not confirmed is the shape: a kink there and a moderate gain beyond it." in text


def test_the_time_of_the_shortest_route_is_that_of_the_shortest_route():
    # Not of the lower passage, which it need not take.
    data = changed("two_rooms")
    assert "| t(l_min) is the same for all delta | yes | yes |" in two_rooms.section(data)
    data["curve"][-1]["shortest"]["time"] += 2.0
    assert "| t(l_min) is the same for all delta | yes | no, within 2 s |" in two_rooms.section(data)


@pytest.mark.parametrize(("first", "told"), [(1, "1.1, the first tried above 1"), (5, "1.5"), (36, "never")])
def test_where_the_published_cost_changes_its_passage(first, told):
    data = changed("two_rooms")
    for k, row in enumerate(data["curve"]):
        row["vc_method"]["passage_by_published_cost"] = "upper" if k >= first else "lower"
    assert f"| the same with the published edge cost | 3 | {told}" in two_rooms.section(data)


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
        assert case["width"] == pytest.approx(2.0 * (case["clearance"] + 0.17), rel=1e-12)
        assert case["warehouse"]["time"] == pytest.approx(was["cases"][name]["warehouse"]["time"], rel=1e-6)
    # v = 1 m/s at a_b = 0.1 m/s^2 needs 5 m.
    assert now["cases"]["Create, Sec. 2.8"]["clearance"] == pytest.approx(5.0, rel=1e-9)


def test_what_is_said_of_the_run_follows_the_data():
    data = changed("fire")
    fast, slow = data["cases"].values()
    assert "1.05 m (1 m/s²) or 10.34 m (0.1 m/s²)" in fire.summary(data)[0].ours
    assert "With 1 m/s² (warehouse and office floor, Sec. 3.7) an ordinary corridor will do." in (
        text := fire.section(data)
    )
    assert "A **contradiction** remains" in text
    assert "supports the printed figure with 1 m/s², and does not support it with 0.1 m/s²." in text
    # Widths, accelerations and mean speeds change sides, and wheels of 1 m/s take 50 s.
    fast.update(acceleration=0.2, width=12.0, warehouse={"length": 47.0, "time": 90.0})
    slow.update(acceleration=2.0, width=1.5, warehouse={"length": 47.0, "time": 50.0})
    data["interface"] = {"speed": 1.0, "least_time": 50.0}
    assert "1.50 m (2 m/s²) or 12.00 m (0.2 m/s²)" in fire.summary(data)[0].ours
    assert "a Create can keep to it" in fire.summary(data)[0].note
    text = fire.section(data)
    assert "With 2 m/s² (Create, Sec. 2.8) an ordinary corridor will do." in text
    assert "With 0.2 m/s² (warehouse and office floor, Sec. 3.7) it takes 0.845 m/s" in text
    assert "contradiction" not in text
    assert "supports the printed figure with 2 m/s², and does not support it with 0.2 m/s²." in text
