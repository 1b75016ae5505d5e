"""The replay: triangles, frames and key frames by their geometry, the page as a browser shows it."""

from __future__ import annotations

import base64
import hashlib
import math
import os
import re
import shutil
import socket
import subprocess
from pathlib import Path as FilePath
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.image import imread

from verify import replay
from verify.replay import ReplayError, write_replay
from verify.replay_motion import (
    MOST_FRAMES,
    braking_reach,
    frames,
    key_rows,
    rolled,
    wheel_angles,
    wheel_places,
    wheel_radius,
)
from verify.replay_page import finished, policy
from verify.replay_scene import ELEVATION, FIELD, MARGIN, view
from verify.replay_shapes import extruded, outer_wall, plate, ribbon, ring, solids
from verify.report.palette import FLOOR, LIMIT, RACK
from vnav_drake.plan import Path, Trajectory
from vnav_drake.robot import Robot
from vnav_drake.scenario import Scenario, parse_scenario

SPEED = 1.0  # [m/s], of the motion below
WAY = (6.0, math.pi, 2.0)  # [m]: straight on, a quarter of a circle of radius 2 m to the left, straight on


def room(*, radius: float = 0.4, name: str = "room") -> Scenario:
    lines = [
        "schema: 1", f"name: {name}", "description: a box, a wall and a point", "world:",
        "  boundary: [[0, 0], [12, 0], [12, 8], [0, 8]]", "  obstacles:",
        "    - {vertices: [[3, 3], [6, 3], [6, 5], [3, 5]]}", "    - {vertices: [[11, 0], [11, 0.5]]}",
        "    - {vertices: [[2, 6.5]]}",
        f"robot: {{radius: {radius}, mass: 40, wheelbase: 0.5, track: 0.4, com_height: 0.12, friction: 0.6,",
        "  max_braking: 1.0, max_acceleration: 1.0, max_steering: 0.6}",
        "braking: {reaction_time: 0.2, margin: 0.1}",
        "start: {position: [1.5, 1.5]}", "goal: {position: [9.5, 5.5]}", "",
    ]  # fmt: skip
    return parse_scenario("\n".join(lines).encode(), "room.yaml")


def driven() -> tuple[Trajectory, dict[str, Any]]:
    """A motion at constant speed and a run that follows it exactly, marked as a stop from 2 s to 4 s."""
    path = Path.from_arcs((1.5, 1.5), 0.0, [0.0, 0.5, 0.0], WAY).subdivided(np.array([60, 40, 20]))
    still = np.zeros(121)
    t = np.concatenate([[0.0], np.cumsum(path.piece_length)]) / SPEED
    heading, curvature = np.append(path.heading, math.pi / 2), np.append(path.curvature, 0.0)
    motion = Trajectory(t, path.x, path.y, heading, still + SPEED, still, curvature, still + 1.0)
    run = {name: getattr(motion, name) for name in ("t", "x", "y", "heading", "v")}
    steering = np.arctan(0.5 * curvature)
    return motion, {**run, "steering": steering, "mode": ((t > 1.95) & (t < 4.05)).astype(float)}


def volume(triangles: np.ndarray) -> float:
    """Of the solid below upward and side faces: the divergence theorem; a floor at height 0 adds nothing."""
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)


def area(triangles: np.ndarray) -> float:
    """Positive where triangles that lie flat look upwards."""
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    assert np.allclose(normals[:, :2], 0.0)
    return float(0.5 * normals[:, 2].sum())


BENT = shapely.Polygon(
    [(0, 0), (6, 0), (6, 2), (2, 2), (2, 5), (0, 5)], [[(0.5, 0.5), (1, 0.5), (1, 1), (0.5, 1)]]
)


@pytest.mark.parametrize("shape", [BENT, BENT.reverse(), shapely.box(-1, -1, 1, 1)])
def test_extruded_floor_plans_have_the_volume_of_prisms(shape):
    # Outward faces only: with one turned inwards the sum is another.
    assert volume(extruded([shape], 1.5)) == pytest.approx(1.5 * shape.area, rel=1e-12)
    assert area(plate([shape], 0.3)) == pytest.approx(shape.area, rel=1e-12)


def test_a_ribbon_covers_its_length_times_its_width():
    # With mitred corners the inside loses at every bend what the outside wins.
    line = np.array([[0, 0], [3, 0], [3, 0], [3, 2], [5, 4]])
    band, owner = ribbon(line, 0.1, 0.01)
    assert area(band) == pytest.approx(0.2 * (3 + 2 + 2 * math.sqrt(2)), rel=1e-12)
    assert set(owner.ravel()) == {0, 1, 3, 4}  # the repeated point is passed over
    assert np.all(np.hypot(*(band[..., :2] - line[owner]).T) < 0.1 * math.sqrt(2) + 1e-12)


def test_a_ribbon_that_turns_back_stays_narrow_and_a_point_has_none():
    band, _ = ribbon([[0, 0], [1, 0], [0, 0]], 0.1, 0.0)
    assert np.abs(band[..., 1]).max() == pytest.approx(0.1)
    assert len(ribbon([[1, 1], [1, 1]], 0.1, 0.0)[0]) == 0


@pytest.mark.parametrize("inner", [0.0, 0.7])
def test_a_ring_has_the_area_between_two_polygons(inner):
    # A regular polygon of n corners has the area n/2 sin(2 pi/n) r^2.
    n, centre = 36, (2.0, -1.0)
    expected = 0.5 * n * math.sin(2 * math.pi / n) * (1.0 - inner**2)
    assert area(ring(inner, 1.0, 0.1, centre, n)) == pytest.approx(expected, rel=1e-12)


def test_everything_that_blocks_the_way_stands():
    world = room().problem.world
    standing = shapely.union_all(solids(world))
    for thing in (shapely.box(3, 3, 6, 5), shapely.LineString([(11, 0), (11, 0.5)]), shapely.Point(2, 6.5)):
        assert standing.covers(thing)
    assert world.boundary.covers(standing)
    around = shapely.union_all(outer_wall(world))
    assert around.intersection(world.boundary).area == 0.0
    assert around.distance(world.boundary) == 0.0


@given(st.floats(-0.9, 0.9), st.floats(0.2, 2.0), st.floats(0.2, 1.0))
def test_the_axes_of_all_wheels_meet_in_one_point(steering, wheelbase, track):
    # The axis of a wheel at angle d is p + s (-sin d, cos d): its distance from the centre is zero.
    robot = Robot(radius=2.0, wheelbase=wheelbase, track=track)
    tangent = math.tan(steering)
    if abs(tangent) < 1e-6:
        return
    centre = np.array([-0.5 * wheelbase, wheelbase / tangent])
    away = centre - wheel_places(robot)
    for d, (ahead, left) in zip(wheel_angles(robot, [steering])[0], away, strict=True):
        assert ahead * math.cos(d) + left * math.sin(d) == pytest.approx(0.0, abs=1e-9 * np.abs(centre).max())


def test_wheels_roll_as_far_as_they_go():
    # Straight on: v t / r. In a bend with its centre 2 m to the left of the rear axle's middle the body turns
    # by v t / hypot(2, l/2), the rear wheels go 2 -+ w/2 times that, the front wheels hypot(2 -+ w/2, l).
    robot = Robot(radius=0.4, wheelbase=0.5, track=0.4)
    t = np.array([0.0, 1.0, 3.0])
    straight = rolled(robot, t, np.full(3, 1.5), np.zeros(3))
    assert straight[-1] == pytest.approx(np.full(4, 1.5 * 3.0 / wheel_radius(robot)))
    turned = 1.5 * 3.0 / math.hypot(2.0, 0.25)
    ways = [math.hypot(1.8, 0.5), math.hypot(2.2, 0.5), 1.8, 2.2]
    bend = rolled(robot, t, np.full(3, 1.5), np.full(3, math.atan(0.5 / 2.0)))
    assert bend[-1] == pytest.approx(np.array(ways) * turned / wheel_radius(robot))


def test_the_braking_disc_is_what_the_law_says():
    # rho + v t_r + v^2 / (2 a_b) + margin = 0.4 + 1.5 * 0.2 + 1.125 + 0.1; backwards the same.
    assert braking_reach(room().problem, [1.5, -1.5, 0.0]) == pytest.approx([1.925, 1.925, 0.5])


@given(st.lists(st.floats(-100, 100), min_size=2, max_size=40), st.floats(1e-3, 10.0))
def test_straight_lines_between_key_rows_stay_close(values, tolerance):
    rows = key_rows(values, tolerance)
    assert rows[0] == 0
    assert rows[-1] == len(values) - 1
    between = np.interp(np.arange(len(values)), rows, np.array(values)[rows])
    assert np.abs(between - values).max() <= tolerance * (1 + 1e-9)


def test_a_straight_line_needs_its_ends_only():
    assert key_rows(np.column_stack([np.arange(50.0), -2.0 * np.arange(50.0)]), 1e-6).tolist() == [0, 49]


def test_frames_are_thirty_a_second_and_end_with_the_run():
    motion, run = driven()
    found = frames(room().problem, run)
    duration = motion.travel_time
    assert len(found.x) == math.ceil(30 * duration) + 1
    assert found.duration == pytest.approx(duration)
    assert (found.x[-1], found.y[-1]) == pytest.approx((9.5, 5.5))
    now = np.arange(len(found.x)) / found.rate
    # rows stand 0.1 s apart: the stop begins with row 20 and lasts to row 40, that is until row 41
    assert np.array_equal(found.alarm, (now >= run["t"][20]) & (now < run["t"][41]))


def test_long_runs_have_fewer_frames_a_second():
    _, run = driven()
    found = frames(room().problem, {**run, "t": 100.0 * run["t"]})
    assert len(found.x) == MOST_FRAMES
    assert found.duration == pytest.approx(100.0 * run["t"][-1])


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"steering": None}, "no column steering"),
        ({"x": [0.0, 1.0]}, "column x has shape"),
        ({"v": np.full(121, np.nan)}, "column v: must be finite"),
        ({"t": np.zeros(121)}, "column t: must take time"),
        ({"t": -np.arange(121.0)}, "must not run backwards"),
    ],
)
def test_bad_columns_are_named(changes, words):
    run = {k: v for k, v in {**driven()[1], **changes}.items() if v is not None}
    with pytest.raises(ValueError, match=words):
        frames(room().problem, run)


@given(st.floats(1.0, 100.0), st.floats(1.0, 100.0), st.floats(0.0, 3.0), st.floats(0.4, 3.0))
def test_the_first_view_holds_the_whole_world_and_little_else(wide, deep, tall, aspect):
    points = np.array([[x, y, z] for x in (0, wide) for y in (0, deep) for z in (0, tall)])
    eye, target = view(points, aspect)
    back = (eye - target) / np.linalg.norm(eye - target)
    assert back == pytest.approx([0.0, -math.cos(ELEVATION), math.sin(ELEVATION)])
    depth = (eye - points) @ back
    up = (points - eye) @ [0.0, math.sin(ELEVATION), math.cos(ELEVATION)] / depth / math.tan(FIELD / 2)
    across = (points - eye)[:, 0] / depth / (aspect * math.tan(FIELD / 2))
    # in the picture, and but for the margin from one edge to the other
    assert max(np.abs(up).max(), np.abs(across).max()) < 1.0
    assert max(np.ptp(up), np.ptp(across)) > 2.0 * (2.0 - MARGIN) ** 2 * 0.95


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> FilePath:
    file = tmp_path_factory.mktemp("replay") / "replay.html"
    motion, run = driven()
    stop = np.array([[7.5, 1.5], [8.5, 1.5]])
    write_replay(file, scenario=room(), trajectory=motion, run=run, title="A <b>room</b>", stops=[stop])
    return file


def test_the_page_asks_for_nothing_and_runs_only_what_its_policy_names(page):
    text = page.read_text(encoding="utf-8")
    allowed = re.search(r'http-equiv="Content-Security-Policy" content="([^"]*)"', text)[1]
    assert allowed.startswith("default-src 'none'; script-src 'sha256-")
    assert text.index("Content-Security-Policy") < text.index("<script")
    scripts = re.findall(r"<script(?: [^>]*)?>(.*?)</script>", text, re.DOTALL)
    for script in scripts:
        assert base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() in allowed
    assert not re.search(r"<(script|link|img|iframe)[^>]* (src|href)=", text)
    assert "handle_command_bytearray(new Uint8Array(buffer))" not in text
    assert len(text) < 3_000_000


def test_words_of_the_user_are_never_text_of_the_page(page):
    text = page.read_text(encoding="utf-8")
    assert "<b>room</b>" not in text
    assert "<title>A &lt;b&gt;room&lt;/b&gt;</title>" in text


def test_the_same_run_gives_the_same_bytes_and_leaves_nothing_running(page, tmp_path, caplog):
    motion, run = driven()
    stop = np.array([[7.5, 1.5], [8.5, 1.5]])
    again, tasks = tmp_path / "again.html", FilePath("/proc/self/task")
    before = len(list(tasks.iterdir())) if tasks.exists() else 0
    write_replay(again, scenario=room(), trajectory=motion, run=run, title="A <b>room</b>", stops=[stop])
    assert again.read_bytes() == page.read_bytes()
    assert (len(list(tasks.iterdir())) if tasks.exists() else 0) == before
    assert "Meshcat" not in caplog.text


def test_a_taken_port_is_told_and_the_old_page_stays(tmp_path, monkeypatch):
    motion, run = driven()
    file = tmp_path / "replay.html"
    file.write_text("old")
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        monkeypatch.setattr(replay, "PORT", taken.getsockname()[1])
        with pytest.raises(ReplayError, match="Meshcat cannot start"):
            write_replay(file, scenario=room(), trajectory=motion, run=run)
    assert file.read_text() == "old"


def test_a_point_robot_is_a_marker(tmp_path):
    motion, run = driven()
    del run["mode"]
    write_replay(tmp_path / "a.html", scenario=room(radius=0.0), trajectory=motion, run=run)
    text = (tmp_path / "a.html").read_text(encoding="utf-8")
    messages = b"".join(base64.b64decode(m) for m in re.findall(r'atob\("([^"]*)"\)', text))
    assert b"/replay/robot/marker" in messages
    assert b"wheel" not in messages
    assert b"front_left" not in messages
    assert "emergency stop" not in re.search(r'<section id="replay".*</section>', text, re.DOTALL)[0]


@pytest.mark.parametrize("stop", [np.zeros((0, 2)), np.zeros((3, 3)), np.full((2, 2), np.inf)])
def test_stops_that_are_no_paths_are_refused(stop, tmp_path):
    motion, run = driven()
    with pytest.raises(ValueError, match="a stop of shape"):
        write_replay(tmp_path / "a.html", scenario=room(), trajectory=motion, run=run, stops=[stop])


@pytest.mark.parametrize("text", ["", "<html><body><script></script></body></html>"])
def test_a_page_of_another_form_is_refused(text):
    with pytest.raises(ReplayError, match="not known"):
        finished(text, title="", panel={}, data={})


def browser(address: str, folder: FilePath) -> tuple[str, np.ndarray, list[str]]:
    """What the browser has made of a page: its elements, a picture (h, w, 3) in 0 to 255, its complaints."""
    command = [
        "chromium", "--headless", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader",
        "--enable-unsafe-swiftshader", "--disable-background-networking", "--no-first-run",
        f"--user-data-dir={folder / 'profile'}", "--enable-logging=stderr", "--virtual-time-budget=150",
        f"--screenshot={folder / 'picture.png'}", "--window-size=600,440", "--dump-dom", address,
    ]  # fmt: skip
    shown = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    picture = np.rint(255.0 * imread(folder / "picture.png")[..., :3]).astype(int)
    return shown.stdout, picture, re.findall(r"CONSOLE.*", shown.stderr)


def pixels(picture: np.ndarray, colour: str) -> int:
    """How many pixels have exactly this colour."""
    wanted = [int(colour[i : i + 2], 16) for i in (1, 3, 5)]
    return int(np.all(np.abs(picture - wanted) <= 1, axis=-1).sum())


needs_chromium = pytest.mark.skipif(
    shutil.which("chromium") is None and not os.environ.get("CI"),
    reason="no Chromium on this system; continuous integration must have one",
)


@needs_chromium
def test_a_browser_shows_the_run_without_a_complaint(page, tmp_path):
    shown, picture, complaints = browser(f"file://{page}#t=3", tmp_path)
    assert complaints == []
    # 3 s at 1 m/s straight on from (1.5, 1.5), in the stop from 2 s to 4 s
    now = re.search(r'<output id="replay-now">([^<]*)</output>', shown)[1]
    assert now == "3.0 s · 1.00 m/s · (4.50, 1.50) m · emergency stop"
    # What lies flat has its own colour. The panel takes less than half of the window, the view is filled from
    # side to side or from top to bottom, and nearly all that is seen of the world is floor: far more than a
    # tenth of the picture. The box has 6 m^2 of 96 m^2; the rim of the braking disc, of 1.2 m, is red.
    assert pixels(picture, FLOOR.light) > 0.1 * picture[..., 0].size
    assert pixels(picture, RACK.light) > 0.02 * pixels(picture, FLOOR.light)
    assert pixels(picture, LIMIT.light) > 50


@needs_chromium
def test_a_browser_complains_of_a_request(tmp_path):
    # The tests above hear of requests from the policy only: it must complain of one.
    (tmp_path / "page.html").write_text(
        f'<meta http-equiv="Content-Security-Policy" content="{policy([])}"><img src="http://127.0.0.1:9/a">'
    )
    assert "Content Security Policy" in browser(f"file://{tmp_path / 'page.html'}", tmp_path)[2][0]
