"""Malformed scenario files: each is refused with its file, line, key, value and what was expected."""

from dataclasses import dataclass
from pathlib import Path

import pytest

from vnav_drake.scenario import ScenarioError, load_scenario, parse_scenario
from vnav_drake.scenario_file import MAX_FAULTS

VALID = (Path(__file__).parent / "scenario_example.yaml").read_text()


@dataclass(frozen=True)
class Bad:
    """VALID with `old` replaced by `new`; the message names `key`, the line of `at`, and says `says`."""

    old: str
    new: str
    key: str
    says: str
    at: str = ""  # text that marks the line; the first line of `new` when empty


def simulation(entry, key, says):
    """A fault in a section `simulation` of this one entry."""
    return Bad("effort: full", f"effort: full\nsimulation:\n  {entry}", f"simulation.{key}", says, entry)


O1 = "[[4, 12], [14, 12], [14, 17], [4, 17]]"
HALL = "[[0, 0], [20, 0], [20, 20], [0, 20]]"
MALFORMED = [
    # keys
    Bad(
        "  radius: 0.4\n  mass",
        "  raduis: 0.4\n  mass",
        "robot.raduis = 0.4",
        "did you mean radius",
        "raduis",
    ),
    Bad("goal:\n", "goall:\n", "goall = ", "did you mean goal"),
    Bad("schema: 1", "schema: 1\nsweep: {}", "sweep = {}", "unknown key", "sweep"),
    Bad("  mass: 40.0\n", "", "robot.mass", "missing; expected a number [kg]", "robot:"),
    Bad("schema: 1\n", "", "schema", "missing; expected 1", "name: example"),
    Bad("  position: [2.0, 18.0]\n", "", "goal.position", "missing; expected a pair", "goal:"),
    Bad("  mass: 40.0", "  mass: 40.0\n  mass: 41.0", "robot.mass", "appears twice", "41.0"),
    Bad("{name: O1,", "{name: O1, name: O2,", "world.obstacles[0].name", "appears twice"),
    Bad(
        "    - {vertices: [[10, 9]]}", "    - {name: none}", "world.obstacles[1]", "either vertices or circle"
    ),
    Bad(
        "[[10, 9]]}",
        "[[10, 9]], circle: {center: [3, 3], radius: 1}}",
        "world.obstacles[1]",
        "exactly one",
        "[[10, 9]],",
    ),
    Bad("    - {vertices: [[10, 9]]}", "    - 7", "world.obstacles[1] = 7", "must be a mapping"),
    # types
    Bad("schema: 1", "schema: 2", "schema = 2", "must be 1"),
    Bad("schema: 1", "schema: true", "schema = True", "must be 1"),
    Bad("mass: 40.0", "mass: heavy", "robot.mass = 'heavy'", "must be a number [kg]"),
    Bad("mass: 40.0", "mass: '40.0'", "robot.mass = '40.0'", "without quotes"),
    Bad("mass: 40.0", "mass: true", "robot.mass = True", "must be a number"),
    Bad("mass: 40.0", "mass: [40.0]", "robot.mass = [40.0]", "must be a number"),
    Bad("mass: 40.0", "mass:", "robot.mass = None", "must be a number"),
    Bad("mass: 40.0", "mass: 1_000", "robot.mass = '1_000'", "write it plain"),
    Bad("mass: 40.0", "mass: 010", "robot.mass = '010'", "write it plain"),
    Bad("mass: 40.0", "mass: 1:30", "robot.mass = '1:30'", "write it plain"),
    Bad(
        "friction_reserve: false", "friction_reserve: no", "braking.friction_reserve = 'no'", "true or false"
    ),
    Bad("homotopy_classes: 6", "homotopy_classes: 6.5", "plan.homotopy_classes = 6.5", "whole number"),
    Bad("methods: [vc_method, speed_graph, dwa]", "methods: dwa", "plan.methods = 'dwa'", "must be a list"),
    Bad("name: example", "name: 7", "name = 7", "put it in quotes"),
    Bad(
        "goal:\n  position: [2.0, 18.0]\n  speed: rest\n  heading: 0.0",
        "goal: [2, 18]",
        "goal = [2, 18]",
        "mapping",
    ),
    # numbers
    Bad("mass: 40.0", "mass: .nan", "robot.mass = nan", "must be finite"),
    Bad("mass: 40.0", "mass: 1e999", "robot.mass = inf", "must be finite"),
    Bad("position: [18.0, 2.0]", "position: [18.0, -.inf]", "start.position[1] = -inf", "must be finite"),
    Bad("heading: 0.0", "heading: .nan", "goal.heading = nan", "must be finite"),
    Bad("[[10, 9]]", "[[10, 1.0e6]]", "world.obstacles[1].vertices[0][1] = 1000000.0", "within +-100000"),
    Bad("[[10, 9]]", "[[10]]", "world.obstacles[1].vertices[0] = [10]", "pair [x, y]"),
    Bad("[[10, 9]]", "[[10, 9, 8]]", "world.obstacles[1].vertices[0] = [10, 9, 8]", "pair [x, y]"),
    Bad("[[10, 9]]", "[]", "world.obstacles[1].vertices = []", "at least 1 entry"),
    Bad("        radius: 0.4", "        radius: -0.4", "world.obstacles[3].circle.radius = -0.4", "positive"),
    # the robot
    Bad("  radius: 0.4\n  mass", "  radius: -1\n  mass", "robot.radius = -1", "at least 0 [m]", "radius: -1"),
    Bad("mass: 40.0", "mass: 0", "robot.mass = 0", "positive"),
    Bad("wheelbase: 0.5", "wheelbase: -0.5", "robot.wheelbase = -0.5", "positive"),
    Bad("com_height: 0.12", "com_height: -0.1", "robot.com_height = -0.1", "at least 0 [m]"),
    Bad("max_braking: 1.0", "max_braking: 0", "robot.max_braking = 0", "positive"),
    Bad("max_acceleration: 1.0", "max_acceleration: -1", "robot.max_acceleration = -1", "positive"),
    Bad("max_speed: null", "max_speed: 0.0", "robot.max_speed = 0.0", "positive"),
    Bad(
        "max_steering: 0.6", "max_steering: 1.5707963267948966", "robot.max_steering = 1.57", "less than pi/2"
    ),
    Bad("max_steering: 0.6", "max_steering: 0", "robot.max_steering = 0", "positive"),
    Bad("friction: 0.6", "friction: 0.1", "robot.friction = 0.1", "mu g = 0.981 m/s^2 cannot carry"),
    Bad(
        "wheelbase: 0.5",
        "wheelbase: 0.7",
        "robot.radius = 0.4",
        "do not fit in the disc",
        "  radius: 0.4\n  mass",
    ),
    Bad("friction: 0.6", "friction: 0.1", "robot.friction = 0.1", "or max_braking at most 0.981 [m/s^2]"),
    Bad(
        "com_height: 0.12",
        "com_height: 3",
        "robot.max_braking = 1.0",
        "at most 0.73575 [m/s^2]",
        "max_braking",
    ),
    # braking, plan, simulation, gates
    Bad("reaction_time: 0.0", "reaction_time: -0.1", "braking.reaction_time = -0.1", "at least 0 [s]"),
    Bad("margin: 0.0", "margin: -1", "braking.margin = -1", "at least 0 [m]"),
    Bad("zone: uniform", "zone: disc", "braking.zone = 'disc'", "known: uniform"),
    Bad("zone: uniform", "zone: {type: disc}", "braking.zone = {'type': 'disc'}", "known: uniform"),
    Bad("zone: uniform", "zone: {type: uniform, r: 1}", "braking.zone.r = 1", "it takes none"),
    Bad(
        "friction_reserve: false",
        "friction_reserve: true",
        "braking.friction_reserve = True",
        "none is left to turn",
    ),
    Bad(
        "[vc_method, speed_graph, dwa]", "[rrt]", "plan.methods[0] = 'rrt'", "one of voronoi_route, vc_method"
    ),
    Bad("[vc_method, speed_graph, dwa]", "[dwa, dwa]", "plan.methods = ['dwa', 'dwa']", "twice"),
    Bad("[vc_method, speed_graph, dwa]", "[]", "plan.methods = []", "at least 1 entry"),
    Bad("homotopy_classes: 6", "homotopy_classes: 0", "plan.homotopy_classes = 0", "at least 1"),
    Bad("homotopy_classes: 6", "homotopy_classes: 51", "plan.homotopy_classes = 51", "at most 50"),
    Bad("effort: full", "graph: dense", "plan.graph = 'dense'", "one of sampled, published"),
    Bad("effort: full", "edge_cost: exact", "plan.edge_cost = 'exact'", "one of realised, published"),
    Bad("effort: full", "dwa: {weights: [1, 1]}", "plan.dwa.weights = [1, 1]", "a list of 3 numbers"),
    Bad("effort: full", "dwa: {weights: 1}", "plan.dwa.weights = 1", "a list of 3 numbers"),
    Bad("effort: full", "dwa: {weights: [0, 0, 0]}", "plan.dwa.weights = [0, 0, 0]", "one weight above zero"),
    Bad("effort: full", "dwa: {weights: [1, -1, 1]}", "plan.dwa.weights[1] = -1", "at least 0"),
    Bad("effort: full", "dwa: {window: 0}", "plan.dwa.window = 0", "at least 0.02 [s]"),
    Bad("effort: full", "dwa: {window: 0.5, step: 1}", "plan.dwa.step = 1", "at most plan.dwa.window, 0.5 s"),
    Bad("effort: full", "dwa: {horizon: 1}", "plan.dwa.horizon = 1", "unknown"),
    Bad("effort: full", "through: O1/O2", "plan.through = 'O1/O2'", "must be a list"),
    Bad("effort: full", "through: [7]", "plan.through[0] = 7", "put it in quotes"),
    Bad("effort: full", "through: ['']", "plan.through[0] = ''", "at least 1 character"),
    Bad(
        "[vc_method, speed_graph, dwa]",
        "[vc_method]\n  through: [O1/O2]",
        "plan.through = ['O1/O2']",
        "needs speed_graph among plan.methods",
        "through: [O1/O2]",
    ),
    Bad("effort: full", "effort: most", "plan.effort = 'most'", "one of quick, full"),
    Bad(
        "effort: full",
        "effort: full\nsimulation: four_wheel",
        "simulation = 'four_wheel'",
        "mapping",
        "simulation",
    ),
    simulation("model: bicycle", "model = 'bicycle'", "one of single_track, four_wheel, both"),
    simulation("stops: -1", "stops = -1", "at least 0"),
    simulation("stops: 2001", "stops = 2001", "at most 2000"),
    simulation("stops: 2.5", "stops = 2.5", "whole number"),
    simulation("stops: true", "stops = True", "whole number"),
    simulation("stops: many", "stops = 'many'", "whole number"),
    simulation("studies: 1", "studies = 1", "true or false"),
    simulation("study: true", "study = True", "did you mean studies"),
    Bad("analytic_gap: 0.01", "analytic_gap: -0.01", "gates.analytic_gap = -0.01", "at least 0"),
    Bad("analytic_gap: 0.01", "anal_gap: 0.01", "gates.anal_gap = 0.01", "did you mean analytic_gap"),
    # the world
    Bad(HALL, "[[0, 0], [20, 0]]", "world.boundary = ", "at least 3 entries"),
    Bad(HALL, "[[0, 0], [20, 20], [20, 0], [0, 20]]", "world.boundary = ", "Self-intersection at [10 10]"),
    Bad(HALL, "[[0, 0], [20, 0], [20, 20], [0, 20], [0, 0]]", "world.boundary = ", "closes by itself"),
    Bad(
        HALL,
        "[[0, 0], [20, 0], [20, 0], [20, 20], [0, 20]]",
        "world.boundary = ",
        "vertices 1 and 2 are the same",
    ),
    Bad(HALL, "[[0, 0], [10, 0], [20, 0]]", "world.boundary = ", "encloses no area"),
    Bad(HALL, "[[0, 0], [20, 0], [20, 1.0e-7]]", "world.boundary = ", "are the same point"),
    Bad(HALL, "[[0, 0], [20, 0], [19, 1.0e-7]]", "world.boundary = ", "closer to itself"),
    Bad(O1, "[[4, 12], [14, 17], [14, 12], [4, 17]]", "world.obstacles[0].vertices", "crosses"),
    Bad(O1, "[[4, 12], [14, 12], [14, 17], [4, 12]]", "world.obstacles[0].vertices", "closes by itself"),
    Bad(
        O1,
        "[[4, 12], [24, 12], [14, 17]]",
        "world.obstacles[0].vertices",
        "('O1'): lies outside the boundary",
    ),
    Bad("[[10, 9]]", "[[10, -9]]", "world.obstacles[1].vertices = [[10, -9]]", "outside the boundary"),
    Bad("[18, 5]]", "[16, 5]]", "world.obstacles[2].vertices", "both ends of the wall"),
    Bad("center: [5, 5]", "center: [0.3, 5]", "world.obstacles[3].circle", "0.1 m beyond", "circle:"),
    Bad("center: [5, 5]", "center: [-3, 5]", "world.obstacles[3].circle", "centre lies outside", "circle:"),
    Bad(
        O1,
        "[[0, 0], [20, 0], [20, 20], [0, 20]]",
        "world.obstacles = ",
        "cover the whole floor",
        "obstacles:",
    ),
    # the ends
    Bad(
        "position: [18.0, 2.0]", "position: [5, 13]", "start.position = [5, 13]", "in or on obstacle 0 ('O1')"
    ),
    Bad(
        "position: [18.0, 2.0]",
        "position: [17, 5]",
        "start.position = [17, 5]",
        "in or on obstacle 2 ('wall')",
    ),
    Bad("position: [18.0, 2.0]", "position: [10, 9]", "start.position = [10, 9]", "in or on obstacle 1"),
    Bad(
        "position: [18.0, 2.0]", "position: [28, 2]", "start.position = [28, 2]", "outside or on the boundary"
    ),
    Bad(
        "position: [2.0, 18.0]",
        "position: [0.3, 18]",
        "goal.position = [0.3, 18]",
        "clearance -0.1 m to the boundary",
    ),
    Bad("margin: 0.0", "margin: 1.6", "start.position = [18.0, 2.0]", "braking margin 1.6 m", "[18.0, 2.0]"),
    Bad(
        "position: [2.0, 18.0]",
        "position: [18.0, 2.0]",
        "goal.position",
        "is the start's position",
        "goal:+1",
    ),
    Bad("speed: safe", "speed: fast", "start.speed = 'fast'", "safe, rest, or a speed"),
    Bad("speed: safe", "speed: -1.0", "start.speed = -1.0", "safe, rest, or a speed"),
    # g l/(2 h) = 9.81 * 0.5 / (2 * h) m/s^2 with h = 3: 0.8175
    Bad("com_height: 0.12", "com_height: 3.0", "robot.max_braking = 1.0", "0.8175", "max_braking: 1.0"),
    # 0.9 * 9.81 * 0.5 / (2 * 2.4) = 0.9196875, while the axle itself lifts at 1.02
    Bad(
        "com_height: 0.12",
        "com_height: 2.4",
        "robot.max_braking = 1.0",
        "most 0.919687 [m/s^2]",
        "max_braking:",
    ),
    # clearance 2 - 0.4 = 1.6 m: V = sqrt(2 * 1 * 1.6) = 1.78885438 m/s, less 1e-5 of it
    Bad("speed: safe", "speed: 1.7889", "start.speed = 1.7889", "at most 1.78883649"),
    Bad("max_speed: null", "max_speed: 0.5", "goal.speed = 0.6", "above robot.max_speed = 0.5", "speed: 0.6"),
    # text
    Bad("name: example", "name: ../../etc", "name = '../../etc'", "characters a-z"),
    Bad("name: example", "name: <b>x</b>", "name = '<b>x</b>'", "characters a-z"),
    Bad("name: example", "name: index", "name = 'index'", "reserved"),
    Bad("name: example", "name: ''", "name = ''", "characters a-z"),
    Bad("name: example", "name: " + "x" * 65, "name = 'xxx", "at most 64 characters"),
    Bad("name: example", 'name: "a\\nb"', "name = 'a\\nb'", "characters a-z"),
    Bad("{name: O1", '{name: "a\\u202eb"', "world.obstacles[0].name = 'a\\u202eb'", "control character"),
    Bad("{name: O1", '{name: "a\\nb"', "world.obstacles[0].name = 'a\\nb'", "single line"),
    Bad("description: one", 'description: "\\e[31m" #', "description = '\\x1b[31m'", "control character"),
    # YAML itself
    Bad("mass: 40.0", "mass: &m 40.0", "robot.mass = 40.0", "anchor"),
    Bad("mass: 40.0", "mass: *m", "robot.mass", "alias"),
    Bad("mass: 40.0", "mass: !!float 40.0", "robot.mass = 40.0", "tag"),
    Bad("mass: 40.0", "mass: !!python/object/apply:os.system [ls]", "robot.mass = ['ls']", "tag"),
    Bad("mass: 40.0", "mass: 40.0: 3", "", "not valid YAML"),
    Bad("mass: 40.0", "? [a, b]\n  : 3", "", "where a key was expected"),
    Bad("gates:", "---\ngates:", "", "second document", "---"),
    Bad("[[10, 9]]}", "[[10, 9]}", "", "not valid YAML"),
    Bad("mass: 40.0", "\tmass: 40.0", "", "not valid YAML"),
]
# 9.81 * 0.1 is the smaller limit of the slippery floor, 9.81 * 0.5 / (2 * 3) that of the tall robot.
# Changes that a case needs besides its own.
ALSO = {
    "friction_reserve: true": ("friction: 0.6", "friction: 0.10193679918450561"),  # 1 / 9.81
    "max_speed: 0.5": ("speed: rest", "speed: 0.6"),
}


def malformed(bad):
    assert VALID.count(bad.old) == 1, bad.old
    text = VALID.replace(bad.old, bad.new)
    old, new = ALSO.get(bad.new, ("", ""))
    assert not old or text.count(old) == 1
    return text.replace(old, new) if old else text


def line_of(text, bad):
    mark, _, plus = (bad.at or bad.new.split("\n", maxsplit=1)[0]).partition("+1")
    assert text.count(mark) == 1, mark
    return 1 + text[: text.index(mark)].count("\n") + (bad.at.endswith("+1") and plus == "")


def test_the_valid_example_is_valid():
    assert parse_scenario(VALID.encode(), "example.yaml").name == "example"


@pytest.mark.parametrize("bad", MALFORMED, ids=lambda bad: f"{bad.key or bad.new!r}: {bad.says}"[:60])
def test_malformed_file_is_refused_with_file_line_key_and_rule(bad, tmp_path):
    text = malformed(bad)
    path = tmp_path / "bad.yaml"
    path.write_text(text)
    with pytest.raises(ScenarioError) as caught:
        load_scenario(path)
    start = f"{path}:{line_of(text, bad)}: {bad.key}"
    lines = str(caught.value).splitlines()
    assert any(line.startswith(start) and bad.says in line for line in lines), (
        f"{start} ... {bad.says}\n{lines}"
    )
    assert all(line.startswith(f"{path}:") for line in lines)


def test_there_are_enough_malformed_files():
    assert len({(bad.old, bad.new) for bad in MALFORMED}) >= 40


def test_all_faults_of_form_are_reported_in_the_order_of_the_file():
    text = VALID.replace("schema: 1", "schema: 3").replace("mass: 40.0", "mass: -1\n  mass: 2")
    text = text.replace("speed: rest", "sped: rest").replace("[[10, 9]]", "[[10, x], [y, .inf]]")
    with pytest.raises(ScenarioError) as caught:
        parse_scenario(text.encode(), "f.yaml")
    lines = [int(fault.split(":")[1]) for fault in caught.value.faults]
    assert len(lines) == 7
    assert lines == sorted(lines)


def test_all_faults_of_meaning_are_reported_together():
    text = VALID.replace("friction: 0.6", "friction: 0.1").replace("[18.0, 2.0]", "[18.0, 0.2]")
    text = text.replace("wheelbase: 0.5", "wheelbase: 0.9").replace("[2.0, 18.0]", "[30, 18]")
    with pytest.raises(ScenarioError) as caught:
        parse_scenario(text.encode(), "f.yaml")
    keys = [fault.split(": ")[1].split(" = ")[0] for fault in caught.value.faults]
    assert keys == ["robot.radius", "robot.friction", "start.position", "goal.position"]


def test_only_so_many_faults_are_spelled_out():
    obstacles = "\n".join("    - {vertices: [[x, 1]]}" for _ in range(500))
    with pytest.raises(ScenarioError) as caught:
        parse_scenario(VALID.replace("    - {vertices: [[10, 9]]}", obstacles).encode(), "f.yaml")
    assert len(caught.value.faults) == MAX_FAULTS + 1
    assert caught.value.faults[-1] == f"f.yaml: and {500 - MAX_FAULTS} faults more"


def test_values_and_file_names_never_reach_the_terminal_raw():
    text = VALID.replace("effort: full", 'effort: "\\e[2J\\u2028\\u202e"').replace(
        "gates:", '"\\e[1m": 1\ngates:'
    )
    with pytest.raises(ScenarioError) as caught:
        parse_scenario(text.encode(), "a\x1b[2J\n.yaml")
    assert all(line.isprintable() for line in caught.value.faults)
    assert len(caught.value.faults) == 2


def test_long_values_are_cut():
    with pytest.raises(ScenarioError) as caught:
        parse_scenario(VALID.replace("effort: full", "effort: " + "x" * 10_000).encode(), "f.yaml")
    assert len(str(caught.value)) < 300
