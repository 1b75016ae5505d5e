"""The gallery, its exact travel times, the JSON Schema, and what a scenario hands on."""

import hashlib
import math
import pickle
import re
from pathlib import Path

import jsonschema
import numpy as np
import pytest
import shapely
import yaml
from scipy.integrate import quad
from scipy.optimize import brentq

from vnav_drake.problem import NoPathError
from vnav_drake.scenario import (
    DwaSettings,
    ScenarioError,
    SimulationSettings,
    load_scenario,
    parse_scenario,
    scenario_schema,
)
from vnav_drake.scenario_file import read_document

ROOT = Path(__file__).parents[1]
GALLERY = sorted((ROOT / "scenarios").glob("*.yaml"))
NAMES = [
    "city_blocks",
    "corridor",
    "corridor_ellipse",
    "corridor_field",
    "create_three_rectangles",
    "four_point_room",
    "obstacle_cluster_1",
    "obstacle_cluster_2",
    "office_floor",
    "single_point",
    "single_wall",
    "turning_field",
    "two_room_office",
    "warehouse",
    "warehouse_field",
    "warehouse_gaps",
    "warehouse_rest",
    "warehouse_slippery",
    "warehouse_tall",
]


def gallery(name):
    return load_scenario(ROOT / "scenarios" / f"{name}.yaml")


def test_gallery_is_complete():
    assert [path.stem for path in GALLERY] == NAMES


@pytest.mark.parametrize("path", GALLERY, ids=lambda path: path.stem)
def test_gallery_file_loads_and_says_what_it_shows(path):
    scenario = load_scenario(path)
    assert scenario.name == path.stem
    assert scenario.source == path
    assert scenario.data == path.read_bytes()
    assert scenario.sha256 == hashlib.sha256(scenario.data).hexdigest()
    header = scenario.data.decode().split("schema:")[0]
    assert re.search(r"^# (Exact|Trusted): ", header, re.MULTILINE)
    assert scenario.description
    ends = [scenario.problem.start.position, scenario.problem.goal.position]
    assert np.all(scenario.problem.clearance(ends) > 0.0)


@pytest.mark.parametrize("path", GALLERY, ids=lambda path: path.stem)
def test_gallery_file_fits_the_schema(path):
    jsonschema.validate(yaml.safe_load(path.read_text()), scenario_schema(), jsonschema.Draft202012Validator)


# --- exact travel times ---


def travel_time(problem, curve, speed):
    """Integral of |curve'(u)| / V over u in [0, 1]; `speed(u)` is |curve'(u)|."""
    return quad(lambda u: speed(u) / float(problem.safe_speed(curve(u))), 0.0, 1.0, epsabs=1e-11)[0]


def test_single_wall_takes_the_time_of_its_cycloid():
    problem = gallery("single_wall").problem
    (x_start, y_start), (x_goal, y_goal) = problem.start.position, problem.goal.position

    # Manor 2015, eq. (3.9), the goal beyond the top of the arch.
    def angles(c):
        return 2.0 * math.asin(c * math.sqrt(y_start)), 2.0 * math.pi - 2.0 * math.asin(c * math.sqrt(y_goal))

    def excess(c):
        start, goal = angles(c)
        return ((goal - math.sin(goal)) - (start - math.sin(start))) / (2.0 * c * c) - (x_goal - x_start)

    c = brentq(excess, 0.1, 1.0 / math.sqrt(y_goal), xtol=1e-15)
    start, goal = angles(c)
    exact = (goal - start) / (c * math.sqrt(2.0 * problem.braking.max_braking))
    assert exact == pytest.approx(3.1956696, abs=5e-8)

    def curve(u):
        xi = start + u * (goal - start)
        x = x_start + ((xi - np.sin(xi)) - (start - math.sin(start))) / (2.0 * c * c)
        return np.stack([x, (1.0 - np.cos(xi)) / (2.0 * c * c)], axis=-1)

    def speed(u):  # |d(x, y)/d xi| = sin(xi / 2) / c^2
        return (goal - start) * math.sin((start + u * (goal - start)) / 2.0) / (c * c)

    assert curve(1.0) == pytest.approx(problem.goal.position, abs=1e-12)
    path = curve(np.linspace(0.0, 1.0, 4001))
    np.testing.assert_allclose(problem.clearance(path), path[:, 1], rtol=1e-12)  # the wall y = 0 is nearest
    assert travel_time(problem, curve, speed) == pytest.approx(exact, rel=1e-9)
    # The radius of curvature of a cycloid is 2 sin(xi / 2) / c^2: the wheels can be steered along it.
    assert c * c / (2.0 * min(math.sin(start / 2.0), math.sin(goal / 2.0))) < problem.robot.max_curvature


def test_single_point_takes_the_length_of_its_segment_in_the_root_plane():
    problem = gallery("single_point").problem
    start, goal = (np.sqrt(complex(*end.position)) for end in (problem.start, problem.goal))
    # Manor 2015, eq. (3.12): with w = sqrt(z) the metric |dz| / sqrt(2 a |z|) is sqrt(2 / a) |dw|.
    exact = math.sqrt(2.0 / problem.braking.max_braking) * abs(goal - start)
    assert exact == pytest.approx(2.5323013, abs=5e-8)

    def curve(u):
        z = (start + u * (goal - start)) ** 2
        return np.stack([z.real, z.imag], axis=-1)

    def speed(u):  # |dz/du| = 2 |w| |dw/du|
        return 2.0 * abs(start + u * (goal - start)) * abs(goal - start)

    path = curve(np.linspace(0.0, 1.0, 4001))
    np.testing.assert_allclose(problem.clearance(path), np.hypot(*path.T), rtol=1e-12)  # the point is nearest
    assert travel_time(problem, curve, speed) == pytest.approx(exact, rel=1e-9)


def test_corridor_runs_at_its_greatest_speed_all_along():
    problem = gallery("corridor").problem
    line = np.linspace(problem.start.position, problem.goal.position, 1001)
    # Half-width 2 m less the radius 0.5 m is the greatest clearance there is: V = sqrt(2 * 1 * 1.5).
    everywhere = np.random.default_rng(1).uniform([0.0, 0.0], [40.0, 4.0], (2000, 2))
    assert np.max(problem.safe_speed(everywhere)) <= math.sqrt(3.0) * (1.0 + 1e-12)
    np.testing.assert_allclose(problem.safe_speed(line), math.sqrt(3.0), rtol=1e-12)
    assert math.dist(line[0], line[-1]) / math.sqrt(3.0) == pytest.approx(17.320508, abs=5e-7)


# --- what the gallery's robots and worlds are meant to be ---


def test_warehouse_has_its_racks_where_the_rows_say():
    scenario = gallery("warehouse")
    # Rows from the top, left rack first; 10 m wide, 5 m tall.
    corners = [(x, y) for y in (22.0, 16.0, 10.0, 4.0) for x in (4.0, 15.0)]
    for i, (x, y) in enumerate(corners):
        rack = scenario.spec.world.obstacles[i]
        assert rack.name == f"O{i + 1}"
        assert set(rack.vertices) == {(x, y), (x + 10.0, y), (x + 10.0, y + 5.0), (x, y + 5.0)}
    worlds = {gallery(name).spec.world for name in NAMES if name.startswith("warehouse")}
    assert len(worlds) == 1


def test_slippery_floor_leaves_exactly_the_friction_for_braking():
    robot = gallery("warehouse_slippery").problem.robot
    assert robot.friction_acceleration == pytest.approx(robot.max_braking, rel=1e-15)


def test_tall_robot_tips_over_before_it_slides():
    robot = gallery("warehouse_tall").problem.robot
    # g w / (2 h) = 9.81 * 0.5 / 1.9 (Manor 2015, eq. (A.3)) against mu g = 5.886 and a_b = 3.
    assert robot.tip_acceleration == pytest.approx(2.5815789, abs=5e-8)
    assert robot.tip_acceleration < robot.max_braking < robot.friction_acceleration


def test_bound_from_rest_to_rest_follows_from_the_clearances():
    problem = gallery("warehouse_rest").problem
    ends = problem.clearance([problem.start.position, problem.goal.position])
    np.testing.assert_allclose(
        ends, [1.5, 1.6], rtol=1e-12
    )  # 1.9 m to the bottom, 2 m to the left wall or O1, less 0.4 m
    # Lost at one end: integral of 1 - t / sqrt(2 d - t^2) from 0 to sqrt(d), a = 1 m/s^2.
    lost = sum(quad(lambda t, d=d: 1.0 - t / math.sqrt(2.0 * d - t * t), 0.0, math.sqrt(d))[0] for d in ends)
    assert lost == pytest.approx((2.0 - math.sqrt(2.0)) * (math.sqrt(1.5) + math.sqrt(1.6)), rel=1e-9)
    assert 25.44124 + lost == pytest.approx(26.8996, abs=1e-4)


# --- what a scenario hands on ---

SMALL = """\
schema: 1
name: small
world:
  boundary: [[0, 0], [10, 0], [10, 10], [0, 10]]
robot: {radius: 0.5, mass: 40, wheelbase: 0.5, track: 0.4, com_height: 0.12, friction: 0.6,
        max_braking: 1e0, max_acceleration: 2., max_steering: .5}
start: {position: [2, 2], speed: 1.0, heading: 0.5}
goal: {position: [8, 8], speed: rest}
"""


def small(old="", new=""):
    assert old in SMALL
    return parse_scenario(SMALL.replace(old, new, 1).encode() if old else SMALL.encode(), "small.yaml")


def test_left_out_keys_take_the_documented_defaults():
    scenario = small()
    problem = scenario.problem
    assert (problem.robot.max_speed, problem.robot.max_steering_rate) == (math.inf, math.inf)
    assert (problem.braking.reaction_time, problem.braking.margin) == (0.0, 0.0)
    assert problem.friction_reserve is False
    assert scenario.plan.homotopy_classes == 6
    assert scenario.plan.effort == "full"
    assert scenario.plan.methods == ("speed_graph",)
    assert (scenario.plan.graph, scenario.plan.through) == ("sampled", ())
    assert scenario.plan.edge_cost == "realised"
    assert scenario.plan.dwa == DwaSettings(weights=(1.0, 1.0, 1.0), window=1.0, step=None)
    assert scenario.simulation == SimulationSettings(model="four_wheel", stops=200, studies=True)
    assert scenario.named_gates == frozenset()
    assert scenario.gates == {
        "analytic_gap": 0.01,
        "refinement_gap": 0.05,
        "certified_gap": 0.03,
        "constraint_violation": 1e-6,
        "braking_margin": 0.0,
        "emergency_stops": 0.0,
    }


def test_every_spelling_of_a_number_is_a_number():
    scenario = small("radius: 0.5", "radius: 5.e-1")
    robot = scenario.problem.robot
    assert (robot.radius, robot.max_braking, robot.max_acceleration, robot.max_steering) == (
        0.5,
        1.0,
        2.0,
        0.5,
    )


def test_braking_reaches_the_problem():
    scenario = small(
        "start:",
        "braking: {zone: {type: uniform}, reaction_time: 0.1, margin: 0.2, friction_reserve: true}\nstart:",
    )
    assert scenario.problem.friction_reserve is True
    # d = 1.5: V = -a t_r + sqrt((a t_r)^2 + 2 a (d - m)) with a = 1, t_r = 0.1, m = 0.2.
    assert scenario.problem.safe_speed([2.0, 2.0]) == pytest.approx(-0.1 + math.sqrt(0.01 + 2.6), rel=1e-14)


def test_ends_and_named_gates_reach_the_scenario():
    scenario = small("start:", "gates: {braking_margin: 0.01, emergency_stops: 2}\nstart:")
    start, goal = scenario.problem.start, scenario.problem.goal
    assert (start.position, start.speed, start.heading) == ((2.0, 2.0), 1.0, 0.5)
    assert (goal.fixed_speed, goal.heading) == (0.0, None)
    assert scenario.named_gates == {"braking_margin", "emergency_stops"}
    assert (scenario.gates["braking_margin"], scenario.gates["emergency_stops"]) == (0.01, 2.0)


@pytest.mark.parametrize(
    ("keys", "model", "stops", "studies"),
    [
        ("simulation: {}", "four_wheel", 200, True),
        ("simulation: {model: null, stops: null, studies: null}", "four_wheel", 200, True),
        ("simulation: {model: both, stops: 0, studies: false}", "both", 0, False),
        ("simulation: {model: single_track, stops: 2000}", "single_track", 2000, True),
        ("plan: {effort: quick}", "four_wheel", 20, False),
        ("plan: {effort: quick}\nsimulation: {stops: 7, studies: true}", "four_wheel", 7, True),
    ],
)
def test_what_the_simulation_leaves_out_follows_from_the_effort(keys, model, stops, studies):
    asked = small("start:", f"{keys}\nstart:").simulation
    assert asked == SimulationSettings(model=model, stops=stops, studies=studies)


def test_a_point_robot_has_no_room_for_four_wheels():
    assert small("radius: 0.5", "radius: 0").simulation.model == "single_track"
    text = SMALL.replace("radius: 0.5", "radius: 0")
    for model in ("four_wheel", "both"):
        asked = text.replace("start:", f"simulation: {{model: {model}}}\nstart:")
        with pytest.raises(ScenarioError, match=f"simulation.model = '{model}': .* expected single_track"):
            parse_scenario(asked.encode(), "small.yaml")


@pytest.mark.parametrize(
    ("wheels", "limit"),
    [
        ("wheelbase: 0.4, track: 0.6", 10.0),  # 25 * 0.4, as 0.6^2 / 0.4 is more
        ("wheelbase: 0.6, track: 0.2", 1.66666),  # 25 * 0.2^2 / 0.6 = 5 / 3, rounded down
    ],
)
def test_a_robot_too_tall_for_its_wheels_is_told_the_height_at_which_it_stands(wheels, limit):
    text = SMALL.replace("wheelbase: 0.5, track: 0.4", wheels).replace("max_braking: 1e0", "max_braking: 0.1")
    text = text.replace("max_acceleration: 2.", "max_acceleration: 0.1").replace("speed: 1.0", "speed: 0.1")
    tall = text.replace("com_height: 0.12", f"com_height: {limit * 1.0001}")
    with pytest.raises(ScenarioError, match=rf"robot.com_height = .*= {limit:g} \[m\], or simulation.model"):
        parse_scenario(tall.encode(), "small.yaml")
    assert parse_scenario(text.replace("com_height: 0.12", f"com_height: {limit}").encode(), "small.yaml")
    asked = tall.replace("start:", "simulation: {model: single_track}\nstart:")
    assert parse_scenario(asked.encode(), "small.yaml").simulation.model == "single_track"


def test_stops_that_take_hours_are_refused_with_the_number_that_does_not():
    # Half the hall less the radius leaves 4.5 m: V = sqrt(2 * 1e-4 * 4.5) = 0.03 m/s, 300 s to a stop.
    slow = SMALL.replace("max_braking: 1e0", "max_braking: 1e-4").replace("speed: 1.0", "speed: safe")
    with pytest.raises(
        ScenarioError, match=r"^small.yaml:\d+: simulation.stops: .* expected at most 50 instants$"
    ):
        parse_scenario(slow.encode(), "small.yaml")
    assert parse_scenario(slow.replace("start:", "simulation: {stops: 50}\nstart:").encode(), "small.yaml")


def test_a_way_that_takes_hours_is_refused():
    # 6 sqrt(2) m, at 5e-4 m/s 16,971 s.
    slow = SMALL.replace("max_steering", "max_speed: 5e-4, max_steering").replace("speed: 1.0", "speed: rest")
    with pytest.raises(ScenarioError, match=r"goal.position = .* at least 1.697e\+04 s .* at most 10000 s"):
        parse_scenario(slow.encode(), "small.yaml")


# 9.81 * 0.5 / (2 * 0.7) = 3.50357142... m/s^2 of the height lie below 9.81 * 0.6 of the floor; brakes may
# reach 0.9 of that, 3.15321428...
@pytest.mark.parametrize(
    ("robot", "brakes", "drive"),
    [("com_height: 0.7, friction: 0.6", 3.15321, 3.50357), ("com_height: 0.7, friction: 0.3", 2.943, 2.943)],
)
def test_an_impossible_vehicle_is_told_the_number_that_is_possible(robot, brakes, drive):
    """The smaller of what friction and height allow, rounded down so that it can be written as told."""
    text = SMALL.replace("com_height: 0.12, friction: 0.6", robot)
    for braking, acceleration, limit in ((9.0, 1.0, brakes), (1.0, 9.0, drive)):
        asked = text.replace("max_braking: 1e0", f"max_braking: {braking}")
        asked = asked.replace("max_acceleration: 2.", f"max_acceleration: {acceleration}")
        with pytest.raises(ScenarioError) as caught:
            parse_scenario(asked.encode(), "small.yaml")
        told = {re.search(r"at most ([0-9.]+) \[m/s\^2\]", fault).group(1) for fault in caught.value.faults}
        assert [float(number) for number in told] == [limit]
        assert parse_scenario(asked.replace("9.0", told.pop()).encode(), "small.yaml").name == "small"


def test_error_places_a_later_finding_at_its_key():
    try:
        raise NoPathError("no path of clearance 0.5 m from here")
    except NoPathError as found:
        error = small().error("start.position", str(found))
    assert isinstance(error, ScenarioError)
    assert str(error) == "small.yaml:7: start.position = [2, 2]: no path of clearance 0.5 m from here"


def test_scenario_survives_pickling():
    scenario = pickle.loads(pickle.dumps(small()))
    assert scenario.problem.safe_speed([2.0, 2.0]) == small().problem.safe_speed([2.0, 2.0])
    error = pickle.loads(pickle.dumps(ScenarioError("a:1: x", "a:2: y")))
    assert str(error) == "a:1: x\na:2: y"


# --- circles ---


def with_circle(center, radius, boundary="[[0, 0], [10, 0], [10, 10], [0, 10]]"):
    obstacle = f"boundary: {boundary}\n  obstacles: [{{circle: {{center: {center}, radius: {radius}}}}}]"
    return small("boundary: [[0, 0], [10, 0], [10, 10], [0, 10]]", obstacle)


@pytest.mark.parametrize(
    ("center", "radius"),
    [([5, 3], 1.0), ([5, 1], 1.0), ([9, 1], 1.0), ([5, 0.25], 0.25), ([9.3, 5], 0.7)],
    ids=["free", "touches a wall", "touches two walls", "small at a wall", "touches the right wall"],
)
def test_polygon_around_a_circle_is_never_inside_it(center, radius):
    world = with_circle(center, radius).problem.world
    angle = np.linspace(0.0, 2.0 * np.pi, 2001)
    rim = np.array(center) + radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    # Signed distance is negative inside the polygon; 1e-8 m allows for the grid of 1e-9 m at the wall.
    assert np.max(world.distance(rim)) < 1e-8
    wide = np.array(center) + 1.0006 * radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    inside = shapely.contains_xy(world.boundary.buffer(-1e-6), wide)
    assert np.min(world.distance(wide[inside])) > 0.0  # at most 0.054 % wider (96 sides)


@pytest.mark.parametrize("center", [[5.0, 3.0], [5.0, 1.0]], ids=["free", "cut at a wall"])
def test_a_circle_keeps_its_own_numbers_beside_the_polygon(center):
    # What is planned with may be cut; the disc asked for is exactly the one in the file.
    assert with_circle(center, 1.0).problem.world.obstacles[0].circle == (*center, 1.0)


def test_only_circles_stand_for_a_disc():
    corners = "boundary: [[0, 0], [10, 0], [10, 10], [0, 10]]"
    world = small(corners, f"{corners}\n  obstacles: [{{vertices: [[4, 4], [5, 4], [5, 5]]}}]").problem.world
    assert world.obstacles[0].circle is None


def test_circle_at_a_thin_slit_stays_on_its_side():
    # A slit of 1e-4 m, x = 5, y from 4 up: the polygon around the circle reaches through it by 5e-4 * 1 m.
    slit = "[[0, 0], [10, 0], [10, 10], [5.0001, 10], [5.0001, 4], [5, 4], [5, 10], [0, 10]]"
    world = with_circle([4, 7], 1.0, slit).problem.world
    assert len(world.obstacles) == 1
    assert max(x for x, _ in world.obstacles[0].vertices) <= 5.0 + 1e-12


def test_circle_beyond_the_boundary_is_refused():
    with pytest.raises(ScenarioError, match=r"small.yaml:5: world.obstacles\[0\].circle = .*0.01 m beyond"):
        with_circle([5, 0.99], 1.0)


# --- schema and documentation ---


def test_schema_is_itself_valid_and_names_units():
    schema = scenario_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    assert schema["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    assert schema["$defs"]["RobotSpec"]["properties"]["max_braking"]["unit"] == "m/s^2"
    for name, section in schema["$defs"].items():
        assert section["additionalProperties"] is (name == "OtherSpec")  # whose parameters a plugin knows
        for key, rule in section["properties"].items():
            assert "title" in rule or "$ref" in rule or "anyOf" in rule, key
            assert rule.get("description"), key


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("schema: 1", "schema: 2"),
        ("name: small", "name: ../small"),
        ("name: small", "name: index"),
        ("radius: 0.5", "radius: -1"),
        ("radius: 0.5", "radius: wide"),
        ("radius: 0.5", "radios: 0.5"),
        ("max_steering: .5", "max_steering: 1.6"),
        ("speed: rest", "speed: stop"),
        ("[2, 2]", "[2]"),
        ("[2, 2]", "[2, 1.0e6]"),
        ("start:", "braking: {zone: 7}\nstart:"),
        ("start:", "braking: {zone: polygon}\nstart:"),
        ("start:", "braking: {zone: {type: ellipse, ahead: 0.5}}\nstart:"),
        ("start:", "plan: {homotopy_classes: 0}\nstart:"),
    ],
)
def test_schema_and_loader_refuse_the_same(old, new):
    data = read_document(SMALL.replace(old, new, 1).encode(), "small.yaml").data
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(data, scenario_schema(), jsonschema.Draft202012Validator)
    with pytest.raises(ScenarioError):
        small(old, new)


def test_a_way_through_gates_is_kept_in_its_order():
    plan = small(
        "start:", "plan: {methods: [speed_graph], through: [O4/O6, O3/O4], graph: published}\nstart:"
    ).plan
    assert plan.through == ("O4/O6", "O3/O4")
    assert plan.graph == "published"


def test_the_methods_of_chapter_two_have_settings():
    text = "plan: {methods: [vc_method, dwa], edge_cost: published, dwa: {weights: [2, 0, 0.5], step: 0.25}}"
    plan = small("start:", f"{text}\nstart:").plan
    assert plan.edge_cost == "published"
    assert plan.dwa == DwaSettings(weights=(2.0, 0.0, 0.5), window=1.0, step=0.25)


def test_reference_page_explains_every_key():
    page = (ROOT / "docs" / "scenario.md").read_text()
    schema = scenario_schema()
    for section in (schema, *schema["$defs"].values()):
        for key in section["properties"]:
            assert f"`{key}`" in page, key
