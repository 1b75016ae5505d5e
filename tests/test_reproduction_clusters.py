"""Table 2.1 of Manor 2015: the maps are those of the text, and what the page says of them is measured."""

from __future__ import annotations

import copy
import math

import numpy as np
import pytest
import shapely

from benchmarks.reproduction import clusters, page
from verify.library import check
from vnav_drake.braking import UniformBraking
from vnav_drake.dwa import plan_dwa
from vnav_drake.dwa.window import Arcs, choices
from vnav_drake.plan import Path, Trajectory
from vnav_drake.problem import End, Problem
from vnav_drake.robot import Robot
from vnav_drake.scenario import load_scenario
from vnav_drake.vc_method import plan_vc_method
from vnav_drake.world import World

RULES = ("start", "goal", "clearance", "braking_distance", "friction_circle", "steering", "drive")
NAMES = list(clusters.PRINTED)
KEPT = page.read()["topics"]["clusters"]


@pytest.fixture(scope="module", params=NAMES)
def case(request):
    return load_scenario(page.ROOT / "scenarios" / f"{request.param}.yaml")


@pytest.fixture(scope="module")
def dwa(case):
    return plan_dwa(case.problem)


@pytest.fixture(scope="module")
def vc(case):
    return plan_vc_method(case.problem)


def ways(problem):
    """Obstacles that the straight way of the disc meets."""
    line = shapely.LineString([problem.start.position, problem.goal.position])
    near = [line.distance(shapely.Polygon(o.vertices)) for o in problem.world.obstacles]
    return [d for d in near if d <= problem.robot.radius]


# The maps


def test_the_robot_is_that_of_the_experiments(case):
    # Manor 2015, Sec. 2.8: 100 mm/s^2 both ways, smallest turning radius 300 mm. Ends at rest.
    robot = case.problem.robot
    assert robot.max_braking == robot.max_acceleration == 0.1
    assert 1.0 / robot.max_curvature == pytest.approx(0.3, abs=1e-6)
    assert case.problem.start.speed == case.problem.goal.speed == "rest"


def test_the_cluster_has_one_room_one_start_and_two_targets():
    one, two = (clusters.problem_of(name) for name in NAMES[:2])
    assert one.world.obstacles == two.world.obstacles
    assert one.world.bounds == two.world.bounds
    assert one.start == two.start
    assert one.goal != two.goal


def test_targets_lie_where_the_text_says():
    # Sec. 2.7.2: (i) start and target on opposite sides of the cluster, (ii) the target in the upper left
    # corner, (iii) in opposite corners.
    for name, left, above in (
        ("obstacle_cluster_1", True, False),
        ("obstacle_cluster_2", True, True),
        ("city_blocks", False, True),
    ):
        problem = clusters.problem_of(name)
        corners = np.concatenate([o.vertices for o in problem.world.obstacles if o.name != "O1"])
        x, y = problem.goal.position
        assert x < corners[:, 0].min() if left else x > corners[:, 0].max()
        assert y > corners[:, 1].max() if above else y < corners[:, 1].min()
        x0, y0 = problem.start.position
        if name != "obstacle_cluster_2":
            assert (x0 < corners[:, 0].min()) != left
            assert (y0 < corners[:, 1].min()) == above


def test_the_straight_way_is_free(case):
    # As the page says; in (ii) so does the text, "directly visible from the start".
    assert ways(case.problem) == []


def test_the_narrow_passage_alone_takes_longer_than_the_way_round():
    # Between O1 and O2, x from 1.25 m to 2.2 m, the passage is 0.35 m wide and the robot 0.34 m: clearance is
    # at most 0.005 m there, so 0.95 m take at least 0.95 / sqrt(2 * 0.1 * 0.005) = 30.04 s by any method.
    bound = 0.95 / math.sqrt(2.0 * 0.1 * 0.005)
    problem = clusters.problem_of("obstacle_cluster_2")
    shapes = {o.name: np.array(o.vertices) for o in problem.world.obstacles}
    assert shapes["O1"][:, 1].min() - shapes["O2"][:, 1].max() == pytest.approx(0.35)
    row = KEPT["examples"]["obstacle_cluster_2"]
    assert row["vc_method"]["time"] < bound < row["dwa"]["time"]


# What is measured


def test_figures_are_those_of_table_2_1():
    # Manor 2015, Table 2.1: vc-method time, DWA time, vc-method length, DWA length.
    printed = [(24, 39, 4.85, 4.37), (31, 52, 6.25, 2.63), (24, 46, 5.04, 4.38)]
    for name, row in zip(NAMES, printed, strict=True):
        told = KEPT["examples"][name]["printed"]
        got = [told[key][what] for what in ("time", "length") for key in ("vc_method", "dwa")]
        assert got == list(row)


def test_what_the_page_keeps_is_measured_again(case, dwa, vc):
    kept = KEPT["examples"][case.spec.name]
    for name, plan in (("dwa", dwa.plan), ("vc_method", vc)):
        assert plan.travel_time == pytest.approx(kept[name]["time"], rel=1e-6)
        assert plan.length == pytest.approx(kept[name]["length"], rel=1e-6)
    assert dwa.reached == kept["dwa"]["reached"]
    assert kept["settings"][0] == {key: kept["dwa"][key] for key in ("reached", "time", "length")}


def test_dwa_is_slower_on_a_shorter_way(case, dwa, vc):
    assert dwa.reached
    assert dwa.travel_time > vc.travel_time
    assert dwa.length < vc.length
    straight = math.dist(case.problem.start.position, case.problem.goal.position)
    assert dwa.length >= straight - 1e-9


def test_both_motions_keep_every_limit(case, dwa, vc):
    for plan in (dwa.plan, vc):
        found = {c.name: c for c in check(case, plan)}
        for rule in RULES:
            assert found[rule].status == "passed", found[rule].message


def test_all_settings_were_tried_on_all_maps():
    count = len(clusters.SETTINGS) + 1
    assert len(KEPT["settings"]) == count
    for row in (*KEPT["examples"].values(), *KEPT["others"].values()):
        assert len(row["settings"]) == count
        assert all(found["reached"] or found["stuck"] for found in row["settings"])


# What is said


def test_the_verdict_follows_the_data():
    assert "DWA is slower in all three" in clusters.section(KEPT)
    changed = copy.deepcopy(KEPT)
    changed["examples"]["city_blocks"]["dwa"]["time"] = 1.0
    text = clusters.section(changed)
    assert "DWA is slower in all three" not in text
    assert "not slower in (iii), against what is printed" in text


def test_a_run_that_got_stuck_is_said_to_be():
    changed = copy.deepcopy(KEPT)
    changed["examples"]["city_blocks"]["dwa"].update(reached=False, stuck="no_progress")
    text = clusters.section(changed)
    assert "not slower in (iii)" in text
    assert "stuck (no progress)" in text
    assert "stuck (no progress)" in clusters.summary(changed)[2].ours
    # A run that did not arrive has no time to compare with: 24 / 46 = 0.52 is printed, ours is none.
    (row,) = [line for line in text.splitlines() if line.startswith("| (iii)")]
    assert row.endswith("| 0.52 / none |")


def test_maps_on_which_nothing_arrives_are_counted():
    changed = copy.deepcopy(KEPT)
    for row in changed["others"].values():
        row["settings"] = [{"reached": False, "stuck": "no_way", "time": 9.0, "length": 1.0}] * len(
            row["settings"]
        )
    count = 2 * (len(clusters.SETTINGS) + 1)
    assert f"On the two others none of {count} runs reach the target." in clusters.section(changed)


def test_speeds_are_drawn_over_length():
    # From rest with 1 m/s^2 over 2 m on the x axis: v = sqrt(2 x), sqrt(2) m/s in the middle, 2 at the end.
    path = Path.polyline([(0.0, 0.0), (2.0, 0.0)])
    zero, end = np.zeros(2), np.array([0.0, 2.0])
    motion = Trajectory(end, path.x, path.y, zero, end, np.ones(2), zero, np.array([0.5, 0.25]))
    drawn = clusters._drawn(motion)
    middle = clusters.SAMPLES // 2
    assert drawn["speed"][middle] == pytest.approx(math.sqrt(2.0), abs=1e-4)
    assert drawn["speed"][-1] == pytest.approx(2.0, abs=1e-4)
    assert drawn["path"][middle] == pytest.approx([1.0, 0.0], abs=1e-4)
    assert drawn["least_clearance"] == 0.25


def test_least_clearance_is_that_of_the_whole_motion():
    # A hall 40 m x 10 m, radius 0.3 m, at (20, 5): along the axis clearance is 4.7 m all along. To the left,
    # at 1 m/s for 1 s and 0.5 m to stop, the disc ends 3.2 m from the wall. Over the 8 m that 4 m/s need.
    world = World.build([(0, 0), (40, 0), (40, 10), (0, 10)])
    end = End(position=(1.0, 1.0))
    problem = Problem(
        world=world, robot=Robot(radius=0.3), braking=UniformBraking(max_braking=1.0), start=end, goal=end
    )
    arcs = Arcs(np.array([20.0, 5.0]), np.array([0.0, 0.5 * math.pi]), np.zeros(2))
    options = choices(problem, arcs, 1.0, np.array([1.0]), 1.0)
    objective = clusters.LeastClearance(
        weights=clusters.UNIT, goal=np.array([39.0, 5.0]), top_speed=4.0, look=20.0
    )
    assert objective.freedom(problem, options)[0] == pytest.approx([4.7 / 8.0, 3.2 / 8.0])
