"""Three trajectories of a Create: the layout keeps to the text, the motions to the limits."""

import math

import numpy as np
import pytest
import shapely

from benchmarks.reproduction import create
from vnav_drake.plan import Path
from vnav_drake.problem import PlanningError
from vnav_drake.vc_method import realise


@pytest.fixture(scope="module")
def data():
    return create.measure()


@pytest.fixture(scope="module")
def known():
    return create.ways(create.problem())


@pytest.fixture(scope="module")
def motions(known):
    asked = create.problem()
    return asked, [realise(asked, create.through(known, gate)[1]) for gate in create.GATES]


def test_what_the_text_states_holds():
    # Manor 2015, Sec. 2.8: -100 and 100 mm/s^2, r_min = 300 mm, three rectangles in a fourth.
    asked = create.problem()
    assert (asked.robot.max_braking, asked.robot.max_acceleration) == (0.1, 0.1)
    assert 1.0 / asked.robot.max_curvature == pytest.approx(0.3, abs=1e-5)
    boxes = [shapely.Polygon(o.vertices) for o in asked.world.obstacles]
    assert len(boxes) == 3
    for shape in [*boxes, asked.world.boundary]:
        assert shape.equals(shapely.box(*shape.bounds))


def test_lengths_and_durations_come_near_those_printed(data):
    # Table 2.2; to the digits printed, half a unit of the last one (lengths to 0.1 m, durations to 1 s).
    for (length, time, speed), ours in zip(create.PRINTED, data["trajectories"], strict=True):
        assert ours["length"] == pytest.approx(length, abs=0.05)
        assert ours["time"] == pytest.approx(time, abs=0.5)
        assert ours["speed"] == pytest.approx(speed, abs=0.006)


def test_the_longest_trajectory_is_the_fastest_and_the_vc_method_takes_it(data):
    one, two, three = data["trajectories"]
    assert one["length"] < two["length"] < three["length"]
    assert one["time"] > two["time"] > three["time"]
    assert data["chosen"] == three["name"]
    assert data["chosen_time"] == pytest.approx(three["time"], rel=1e-9)
    assert data["shortest"] == one["name"]
    assert all(other["time"] > three["time"] for other in data["others"])


def test_no_trajectory_is_faster_than_its_gap_allows(data):
    # The gaps are 1.95 m long and 0.375 m and 0.46 m wide, so that the robot of radius 0.17 m has at most
    # 0.0175 m and 0.06 m of clearance in them, and v <= sqrt(2 * 0.1 d) (Manor 2015, Sec. 2.2).
    for ours, width in zip(data["trajectories"], (0.375, 0.46), strict=False):
        assert ours["time"] > 1.95 / math.sqrt(0.2 * (0.5 * width - 0.17))
        assert ours["least_clearance"] == pytest.approx(0.5 * width - 0.17, abs=1e-9)


def test_every_motion_starts_and_ends_at_rest_and_keeps_all_limits(motions):
    asked, driven = motions
    for found in driven:
        motion = found.trajectory
        assert found.shortfalls == ()
        assert motion.v[[0, -1]] == pytest.approx([0.0, 0.0], abs=1e-9)
        assert np.abs(motion.a).max() <= 0.1 * (1.0 + 1e-9)
        assert np.abs(motion.curvature).max() <= asked.robot.max_curvature * (1.0 + 1e-9)
        distance = shapely.distance(
            shapely.MultiPolygon([shapely.Polygon(o.vertices) for o in asked.world.obstacles]),
            shapely.points(motion.x, motion.y),
        )
        rim = shapely.distance(asked.world.boundary.exterior, shapely.points(motion.x, motion.y))
        clearance = np.minimum(distance, rim) - 0.17
        assert np.all(np.square(motion.v) <= 0.2 * clearance + 1e-9)


def test_between_two_stops_the_printed_length_and_duration_need_the_printed_speed_axis(data):
    # v with L / v + v / a = T: 6.7 / v + 10 v = 26, so v = (26 - sqrt(26^2 - 4 * 67)) / 20.
    least = (26.0 - math.sqrt(26.0**2 - 268.0)) / 20.0
    assert data["least_peak"] == pytest.approx(least, rel=1e-12)
    assert least < create.AXIS
    assert data["trajectories"][2]["greatest_speed"] < 1.02 * create.AXIS


def test_a_narrower_gap_takes_longer(data):
    # In the gap alone: 1.95 m at sqrt(0.2 d), d = 0.015, 0.0175 and 0.02 m, are 35.60, 32.96 and 30.83 s.
    narrower, wider = data["moved"]["narrower"], data["moved"]["wider"]
    ours = data["trajectories"][0]["time"]
    assert wider < ours < narrower
    assert narrower - ours == pytest.approx(35.60 - 32.96, abs=0.5)
    assert ours - wider == pytest.approx(32.96 - 30.83, abs=0.5)


def test_moving_a_side_moves_that_side_only():
    asked = create.problem()
    moved = create.with_first_gap(asked, 0.1).world
    assert shapely.Polygon(moved.obstacles[1].vertices).equals(shapely.box(2.575, 1.14, 3.15, 3.09))
    for i in (0, 2):
        assert moved.obstacles[i].vertices == asked.world.obstacles[i].vertices
    assert moved.boundary.equals(asked.world.boundary)


def test_a_gate_that_nothing_passes_is_an_error(known):
    with pytest.raises(PlanningError, match="no route along the Voronoi arcs passes O9/O1"):
        create.through(known, "O9/O1")


def test_drawn_points_lie_on_the_path(data, motions):
    path: Path = motions[1][0].path
    points = np.array(data["trajectories"][0]["points"])
    line = shapely.LineString(np.column_stack(path.at(np.linspace(0.0, path.length, 20_001))[:2]))
    assert shapely.distance(line, shapely.points(points)).max() < 2e-4  # rounded to 1e-4 m, chords of 2e-4 m


def test_the_section_shows_every_printed_number(data):
    text = create.section(data)
    for length, time, speed in create.PRINTED:
        assert f"| {length} m |" in text
        assert f"| {time:g} s |" in text
        assert f"| {speed} m/s |" in text
    assert "reconstruction" in text
