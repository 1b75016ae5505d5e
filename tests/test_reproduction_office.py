"""The office floor: the layout keeps to the text, and the fastest class is not the shortest one."""

import math

import numpy as np
import pytest
import shapely

from benchmarks.reproduction import office, page
from vnav_drake.homotopy import class_of
from vnav_drake.speed_graph import speed_graph
from vnav_drake.vc_method import vc_method
from vnav_drake.voronoi import build_diagram, shortest_route


@pytest.fixture(scope="module")
def data():
    return page.read()["topics"]["office"]


def test_classes_graphs_and_motion_are_measured_again(data):
    # All but the optima from the published graph, which takes the most time of the topic.
    asked = office.problem()
    diagram = build_diagram(asked.world, asked.robot.radius)
    result, motion = speed_graph(asked, diagram, classes=len(office.PRINTED)), vc_method(asked, diagram)
    assert len(data["classes"]) == len(result.classes)
    for was, now in zip(data["classes"], result.classes, strict=True):
        assert was["name"] == now.name
        assert was["certified"] == now.certified
        assert was["time"] == pytest.approx(now.travel_time, rel=1e-9)
        assert was["graph_time"] == pytest.approx(now.graph_time, rel=1e-9)
        assert was["length"] == pytest.approx(now.length, rel=1e-6)
    assert data["order_certain"] == result.certain
    for name, graph in (("published", result.published), ("sampled", result.sampled)):
        assert data[name] == {"nodes": graph.node_count, "edges": len(graph.edges)}
    assert data["largest_cell"] == office.largest_cell(result.published)
    assert data["vc_method"]["time"] == pytest.approx(motion.realisation.trajectory.travel_time, rel=1e-6)
    assert data["vc_method"]["name"] == class_of(result.gates, motion.realisation.path)
    short = shortest_route(asked, diagram)
    assert data["shortest"]["length"] == pytest.approx(short.length.sum(), rel=1e-9)


def test_size_and_obstacles_kept_are_those_of_the_scenario(data):
    asked = office.problem()
    low, high = asked.world.vertices.min(axis=0), asked.world.vertices.max(axis=0)
    assert data["size"] == sorted((high - low).tolist())
    assert data["obstacles"] == len(asked.world.obstacles)
    assert data["vertices"] == sum(len(o.vertices) for o in asked.world.obstacles)
    assert data["diameter"] == 2.0 * asked.robot.radius
    assert data["max_braking"] == asked.robot.max_braking


def test_the_floor_has_the_size_and_the_obstacles_of_the_text(data):
    # Manor 2015, Sec. 3.7: 30 x 40 m, 25 internal obstacles, 60 vertices, diameter 20 cm, a_min = 1 m/s^2.
    assert data["size"] == [30.0, 40.0]
    assert (data["obstacles"], data["vertices"]) == (25, 60)
    assert data["diameter"] == pytest.approx(0.2, rel=1e-12)
    assert data["max_braking"] == 1.0


def test_the_robot_fits_between_no_chair_and_the_desk():
    asked = office.problem()
    named = {o.name: np.array(o.vertices) for o in asked.world.obstacles}
    desk = shapely.Polygon(named["desk"])
    for chair in ("chair1", "chair2"):
        assert 0.0 < shapely.distance(desk, shapely.Point(named[chair][0])) < 0.2


def test_six_classes_come_near_the_printed_ones_in_their_order(data):
    times = [c["time"] for c in data["classes"]]
    assert times == sorted(times)
    assert len({c["name"] for c in data["classes"]}) == 6
    for ours, printed in zip(times, office.PRINTED, strict=True):  # Table 3.1
        assert ours == pytest.approx(printed, rel=0.02)


def test_all_six_optima_are_certified(data):
    assert all(c["certified"] for c in data["classes"])
    assert max(c["bound"] for c in data["classes"]) < 1e-6
    assert data["order_certain"]


def test_the_second_class_is_the_shortest_and_no_faster_than_its_aisle_allows(data):
    # 6 m between two rows of cabinets 0.34 m apart: d <= 0.17 - 0.1, at least 6 / sqrt(0.14) s in there,
    # and no path of the class is shorter than the straight lines from start to aisle and on to the goal.
    lengths = [c["length"] for c in data["classes"]]
    assert int(np.argmin(lengths)) == 1
    assert data["classes"][1]["name"] == data["shortest"]["name"]
    aisle = 6.0 / math.sqrt(0.14)
    outside = math.dist((1.2, 1.2), (18.0, 9.17)) + math.dist((24.0, 8.83), (26.5, 3.2))
    fastest = math.sqrt(2.0 * clearance_at_most())
    assert data["classes"][1]["time"] > aisle + outside / fastest
    assert lengths[1] > 6.0 + outside


def clearance_at_most():
    """[m] anywhere on the floor: greatest at a Voronoi node."""
    asked = office.problem()
    return float(build_diagram(asked.world).node_distance.max()) - asked.robot.radius


def test_the_classes_go_where_the_scenario_says(data):
    # (1) corridor, (2) aisle, (3) right, (4, 5) rooms above, (6) both: which rooms a path enters.
    rooms = {
        "archive": shapely.box(29, 0, 40, 13),
        "above left": shapely.box(0, 17, 13, 30),
        "above right": shapely.box(25, 17, 40, 30),
        "corridor": shapely.box(0, 13, 40, 17),
    }
    entered = [
        {name for name, room in rooms.items() if shapely.LineString(c["points"]).intersects(room)}
        for c in data["classes"]
    ]
    assert entered == [
        {"corridor"},
        set(),
        {"corridor", "archive"},
        {"corridor", "above right"},
        {"corridor", "above left"},
        {"corridor", "above right", "archive"},
    ]


def test_the_published_graph_overestimates_and_ranks_alike(data):
    for row in data["by_published"]:
        assert row["graph_time"] > row["time"]
    assert office.ranked_alike(data)
    assert [row["time"] for row in data["by_published"]] == pytest.approx(
        [c["time"] for c in data["classes"]], rel=1e-9
    )


def test_the_vc_method_is_slower_than_the_optimum_of_its_class(data):
    vc = data["vc_method"]
    rank = office.rank(data, vc["name"])
    assert rank is not None
    assert vc["time"] > data["classes"][rank - 1]["time"]


def test_a_class_that_is_not_among_ours_has_no_rank(data):
    assert office.rank(data, "nowhere") is None


def test_a_fastest_class_that_is_the_shortest_too_is_said_to_be():
    changed = page.read()["topics"]["office"]
    assert "the fastest class is not that of the shortest path" in office.section(changed)
    changed["shortest"]["name"] = changed["classes"][0]["name"]
    assert "the fastest class is that of the shortest path" in office.section(changed)


def test_the_section_shows_every_printed_number(data):
    text = office.section(data)
    for time in office.PRINTED:
        assert f"| {time} s |" in text
    assert f"| {office.PRINTED_NODES} |" in text
    assert f"| {office.PRINTED_EDGES} |" in text
    assert "reconstruction" in text
