"""Scenario files that name a braking zone: what they become, and what is refused."""

from __future__ import annotations

import json
import math
import pickle
from dataclasses import dataclass
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from verify.__main__ import main
from verify.judge.limits import Limits
from vnav_drake.scenario import Scenario, ScenarioError, parse_scenario, scenario_schema
from vnav_drake.scenario_file import read_document
from vnav_drake.scenario_zone import BUILT_IN
from vnav_drake.zones import catalogue
from vnav_drake.zones.catalogue import build_zone, field_set
from vnav_drake.zones.errors import ZoneError
from vnav_drake.zones.field_set import FieldSet
from vnav_drake.zones.shapes import DiscZone, EllipseZone, PolygonZone, ProtectiveField

EXAMPLE = (Path(__file__).parent / "scenario_example.yaml").read_text()
LINE = 1 + EXAMPLE[: EXAMPLE.index("  zone: uniform")].count("\n")
SQUARE = "[[-2, -2], [6, -2], [6, 2], [-2, 2]]"  # holds the stop from 3 m/s, 4.5 m, and a radius of 0.4 m
SMALL = "[[-1, -1], [2, -1], [2, 1], [-1, 1]]"  # and this from 1 m/s, 0.5 m


def scenario(zone: str, *changes: tuple[str, str]) -> Scenario:
    """The example with another zone; without friction to spare (mu g = 5.886, a_b = 1) unless changed."""
    text = EXAMPLE.replace("zone: uniform", f"zone: {zone}")
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return parse_scenario(text.encode(), "zone.yaml")


def needed_ahead(ratio: float) -> float:
    """How far ahead an ellipse must reach to hold the arcs of stops at mu g = 1.2 a_b.

    That leaves a lateral acceleration of sqrt(0.44) a_b. At |kappa| v^2 = sqrt(0.44) a_b the stop turns by
    x = |kappa| v^2 / (2 a_b) and ends at ((sin x)/x, (1 - cos x)/x) D, which must be in the ellipse.
    """
    x = np.linspace(0.0, 0.5 * math.sqrt(0.44), 100_001)[1:]
    side = (1.0 - np.cos(x)) / (x * ratio)
    return math.sqrt(float(np.max((np.sin(x) / x) ** 2 / (1.0 - side**2))))


# --- what a zone becomes ---


def test_parameters_reach_the_zone():
    ellipse = scenario("{type: ellipse, lateral_ratio: 0.3, ahead: 1.2, behind: 0.2}").problem.zone
    assert isinstance(ellipse, EllipseZone)
    assert (ellipse.lateral_ratio, ellipse.ahead, ellipse.behind, ellipse.radius) == (0.3, 1.2, 0.2, 0.4)
    field = scenario("{type: protective_field, form: rectangle, side: 0.1}").problem.zone
    assert isinstance(field, ProtectiveField)
    assert (field.form, field.side) == ("rectangle", 0.1)
    polygon = scenario("{type: polygon, vertices: [[0, -1], [2, 0], [0, 1]]}").problem.zone
    assert isinstance(polygon, PolygonZone)
    assert polygon.vertices == ((0.0, -1.0), (2.0, 0.0), (0.0, 1.0))


def test_the_zone_brakes_by_the_law_of_the_problem():
    problem = scenario(
        "ellipse", ("reaction_time: 0.0", "reaction_time: 0.2"), ("margin: 0.0", "margin: 0.1")
    ).problem
    assert problem.zone is not None
    assert problem.zone.law == problem.braking
    assert (problem.braking.reaction_time, problem.braking.margin) == (0.2, 0.1)


@pytest.mark.parametrize(
    "zone",
    [
        "uniform",
        "{type: uniform}",
        "{type: ellipse, lateral_ratio: 1}",
        "{type: ellipse, lateral_ratio: 1.0, ahead: 1.0, behind: 1}",
        "{type: field_set, base: uniform}",
        "{type: field_set, base: {type: ellipse, lateral_ratio: 1}, count: 3}",
    ],
)
def test_a_disc_is_uniform_braking(zone):
    assert scenario(zone).problem.zone is None


def test_raw_values_stay_readable_with_defaults_filled_in():
    def raw(zone):
        spec = scenario(zone).spec.braking.zone
        return spec.type, spec.parameters

    assert raw("uniform") == ("uniform", {})
    assert raw("ellipse") == ("ellipse", {"lateral_ratio": 0.5, "ahead": None, "behind": None})
    assert raw("protective_field") == ("protective_field", {"form": "capsule", "side": 0.0})
    ellipse = {"type": "ellipse", "lateral_ratio": 0.5, "ahead": None, "behind": None}
    assert raw("{type: field_set, base: ellipse}") == (
        "field_set",
        {"base": ellipse, "count": 4, "dwell": 0.0},
    )
    kind, parameters = raw(f"{{type: field_set, fields: [{{max_speed: 1, polygon: {SMALL}}}]}}")
    square = [[-1.0, -1.0], [2.0, -1.0], [2.0, 1.0], [-1.0, 1.0]]
    assert kind == "field_set"
    fields = [{"max_speed": 1.0, "polygon": square}]
    assert parameters == {"base": {"type": "uniform"}, "fields": fields, "dwell": 0.0}
    assert json.loads(json.dumps(parameters)) == parameters


def test_a_field_set_is_planned_with_its_base():
    base = scenario("{type: field_set, base: {type: protective_field, side: 0.2}}").problem.zone
    assert isinstance(base, ProtectiveField)
    assert base.side == 0.2


def test_given_fields_become_a_field_set():
    asked = scenario(
        f"{{type: field_set, fields: [{{max_speed: 1, polygon: {SMALL}}}, "
        f"{{max_speed: 3, polygon: {SQUARE}}}]}}"
    )
    fields = field_set(asked.spec.braking.zone.parameters, asked.problem.braking, asked.problem.robot.radius)
    assert isinstance(fields, FieldSet)
    assert fields.max_speeds == (1.0, 3.0)
    assert isinstance(fields.base, DiscZone)
    # Straight ahead the first square reaches 2 m, the second 6 m.
    assert fields.support(0.0, 1.0)[0] == 2.0
    assert fields.support(0.0, 1.1)[0] == 6.0
    assert field_set({"base": "uniform", "count": 4}, asked.problem.braking, 0.4) is None


@pytest.mark.parametrize("base", ["uniform", "ellipse"])
@pytest.mark.parametrize(("limit", "most"), [("null", 3.0), ("2.5", 2.5), ("4.0", 3.0)])
def test_no_plan_is_faster_than_the_last_field(base, limit, most):
    asked = scenario(
        f"{{type: field_set, base: {base}, fields: [{{max_speed: 1, polygon: {SMALL}}}, "
        f"{{max_speed: 3, polygon: {SQUARE}}}]}}",
        ("max_speed: null", f"max_speed: {limit}"),
    )
    problem = asked.problem
    assert problem.robot.max_speed == problem.braking.max_speed == most
    assert (problem.zone is None) is (base == "uniform")
    if problem.zone is not None:
        assert problem.zone.law == problem.braking
    assert Limits.from_spec(asked.spec).speed == most  # the judge's


@pytest.mark.parametrize(("ratio", "rounded"), [(0.5, 1.04), (0.3, 1.17)])
def test_ahead_follows_from_the_friction_reserve(ratio, rounded):
    needed = needed_ahead(ratio)
    assert needed == pytest.approx(rounded, abs=0.005)
    reserve = (
        ("friction: 0.6", f"friction: {1.2 / 9.81}"),
        ("friction_reserve: false", "friction_reserve: true"),
    )
    zone = scenario(f"{{type: ellipse, lateral_ratio: {ratio}}}", *reserve).problem.zone
    assert isinstance(zone, EllipseZone)
    assert zone.ahead == pytest.approx(needed, abs=1e-8)
    assert zone.behind is None


def test_much_friction_asks_for_less_turning_not_for_a_long_ellipse():
    # mu g = 5.886 a_b: an arc of 2.9 rad leaves every ellipse of lateral ratio 0.5, which is 0.5 D wide.
    zone = scenario("ellipse", ("friction_reserve: false", "friction_reserve: true")).problem.zone
    assert isinstance(zone, EllipseZone)
    assert zone.ahead == 1.25


def test_names_of_the_catalogue_and_of_the_file_format_agree():
    assert tuple(catalogue.BUILT_IN) == BUILT_IN
    assert catalogue.known_types()[: len(BUILT_IN)] == BUILT_IN


def test_a_scenario_with_a_zone_can_be_handed_to_another_process():
    zone = scenario("{type: polygon, vertices: [[0, -1], [2, 0], [0, 1]]}").problem.zone
    assert pickle.loads(pickle.dumps(zone)) == zone


# --- the schema for editors ---


@pytest.mark.parametrize(
    ("zone", "good"),
    [
        ("ellipse", True),
        ("my_own", True),
        ("polygon", False),  # needs vertices
        ("{type: ellipse, lateral_ratio: 0.3, ahead: null}", True),
        ("{type: ellipse, lateral_ratio: -1}", False),
        ("{type: ellipse, width: 1}", False),
        ("{type: my_own, width: [1, {a: 2}]}", True),
        ("{width: 1}", False),
        ("{type: protective_field, form: disc}", False),
        ("{type: field_set, base: {type: my_own}, count: 64}", True),
        ("{type: field_set, base: {type: ellipse, ahead: 0.5}}", False),
        ("{type: field_set, count: 1}", False),
        (f"{{type: field_set, fields: [{{max_speed: 1, polygon: {SQUARE}}}]}}", True),
    ],
)
def test_the_schema_describes_built_in_zones_and_allows_others(zone, good):
    data = read_document(EXAMPLE.replace("zone: uniform", f"zone: {zone}").encode(), "f").data
    assert jsonschema.Draft202012Validator(scenario_schema()).is_valid(data) is good


# --- what is refused ---


@dataclass(frozen=True)
class Bad:
    """A zone that is refused: the message starts with `key` below braking.zone and says `says`."""

    zone: str
    key: str
    says: str
    changes: tuple[tuple[str, str], ...] = ()


RESERVE = ("friction_reserve: false", "friction_reserve: true")


def given(*fields: str) -> str:
    return f"{{type: field_set, fields: [{', '.join(fields)}]}}"


BAD = [
    # form
    Bad("7", " = 7", "must be the name of a zone, or a mapping"),
    Bad("[ellipse]", " = ['ellipse']", "must be the name of a zone, or a mapping"),
    Bad("null", " = None", "must be the name of a zone"),
    Bad("{lateral_ratio: 0.5}", " = {'lateral_ratio': 0.5}", "must have the key type"),
    Bad("{type: 3}", " = {'type': 3}", "has a type that is not text; expected the name of a zone"),
    Bad("{type: ellipse, ratio: 1}", ".ratio = 1", "known: lateral_ratio, ahead, behind"),
    Bad("{type: uniform, radius: 1}", ".radius = 1", "it takes none"),
    Bad("{type: ellipse, lateral_ratio: wide}", ".lateral_ratio = 'wide'", "must be a number"),
    Bad("{type: ellipse, lateral_ratio: .nan}", ".lateral_ratio = nan", "must be finite"),
    Bad("{type: ellipse, behind: true}", ".behind = True", "must be a number"),
    Bad("{type: protective_field, form: round}", ".form = 'round'", "one of capsule, rectangle"),
    Bad("polygon", " = 'polygon'", "lacks its vertices; expected {type: polygon, vertices: "),
    Bad("{type: polygon}", ".vertices", "is missing; expected a list"),
    Bad("{type: field_set, base: polygon}", ".base = 'polygon'", "lacks its vertices"),
    Bad("{type: field_set, dwell: -0.1}", ".dwell = -0.1", "must be at least 0 [s]"),
    Bad("{type: field_set, dwell: 61}", ".dwell = 61", "must be at most 60 [s]"),
    Bad("{type: ellipse, dwell: 1}", ".dwell = 1", "known: lateral_ratio, ahead, behind"),
    Bad("{type: polygon, vertices: [[0, 0], [1, 0]]}", ".vertices = ", "at least 3 entries"),
    Bad("{type: polygon, vertices: [[0, 0], [1], [1, 1]]}", ".vertices[1] = [1]", "a pair [x, y]"),
    Bad("{type: field_set, count: 1}", ".count = 1", "at least 2"),
    Bad("{type: field_set, count: 65}", ".count = 65", "at most 64"),
    Bad("{type: field_set, count: 2.5}", ".count = 2.5", "whole number"),
    Bad("{type: field_set, count: 2, fields: []}", ".fields = []", "at least 1 entry"),
    Bad(
        f"{{type: field_set, count: 2, fields: [{{max_speed: 1, polygon: {SMALL}}}]}}",
        " = ",
        "either count or fields, not both",
    ),
    Bad("{type: field_set, base: field_set}", ".base = 'field_set'", "is a field_set itself"),
    Bad(
        "{type: field_set, base: {type: ellipse, q: 1}}",
        ".base.q = 1",
        "unknown parameter of the zone 'ellipse'",
    ),
    Bad(
        given("{polygon: [[0, 0], [1, 0], [0, 1]]}"),
        ".fields[0].max_speed",
        "is missing; expected a number [m/s]",
    ),
    # negative sizes, and what does not hold the braking path
    Bad("{type: ellipse, lateral_ratio: -0.5}", ".lateral_ratio = -0.5", "must be positive"),
    Bad("{type: ellipse, lateral_ratio: 0}", ".lateral_ratio = 0", "must be positive"),
    Bad("{type: ellipse, behind: -0.1}", ".behind = -0.1", "at least 0"),
    Bad("{type: ellipse, behind: 1.1}", ".behind = 1.1", "between 0 and ahead = 1"),
    Bad("{type: ellipse, ahead: 0.99}", ".ahead = 0.99", "does not hold a straight stop"),
    Bad(
        "{type: field_set, base: {type: ellipse, ahead: 0.9}}",
        ".base.ahead = 0.9",
        "does not hold a straight stop",
    ),
    Bad("{type: protective_field, side: -0.01}", ".side = -0.01", "never narrower than the vehicle"),
    Bad("{type: polygon, vertices: [[0, -1], [0.9, 0], [0, 1]]}", ".vertices = ", "must hold (1, 0)"),
    Bad("{type: polygon, vertices: [[0.1, -1], [2, 0], [0.1, 1]]}", ".vertices = ", "must hold (0, 0)"),
    Bad("{type: polygon, vertices: [[0, -1], [2, 0], [0, 1], [0.5, 0]]}", ".vertices = ", "must be convex"),
    Bad(
        "{type: polygon, vertices: [[0, -1], [2, 1], [2, -1], [0, 1]]}",
        ".vertices = ",
        "must be a simple polygon",
    ),
    # fields: the radius is 0.4 m, the stop from 1 m/s takes 0.5 m
    Bad(
        given("{max_speed: 1, polygon: [[-1, -0.4], [2, -0.4], [2, 0.39], [-1, 0.39]]}"),
        ".fields[0].polygon = ",
        "narrower than the vehicle: it reaches 0.39 m to the left; expected the radius and the margin, 0.4 m",
    ),
    Bad(
        given("{max_speed: 1, polygon: [[-1, -0.4], [2, -0.4], [2, 0.45], [-1, 0.45]]}"),
        ".fields[0].polygon = ",
        "0.4 m to the right; expected the radius and the margin, 0.41 m",
        (("margin: 0.0", "margin: 0.01"),),
    ),
    Bad(
        given("{max_speed: 1, polygon: [[-1, -1], [0.85, -1], [0.85, 1], [-1, 1]]}"),
        ".fields[0].polygon = ",
        "it lacks 0.05 m",
    ),
    Bad(
        given(f"{{max_speed: 1, polygon: {SQUARE}}}", f"{{max_speed: 1.2, polygon: {SMALL}}}"),
        ".fields[1].polygon = ",
        "must hold the field before",
    ),
    Bad(
        given(f"{{max_speed: 1, polygon: {SMALL}}}", f"{{max_speed: 1, polygon: {SQUARE}}}"),
        ".fields[1].max_speed = 1",
        "must be above 1, that of the field before",
    ),
    # unknown types
    Bad("disc", " = 'disc'", "known: uniform, ellipse, protective_field, polygon, field_set"),
    Bad("{type: disc, r: 1}", " = {", "loaded with --plugin MODULE"),
    Bad("{type: field_set, base: disc}", ".base = 'disc'", "unknown braking zone; known: uniform"),
    # the friction reserve: without margin arcs stay in a centred ellipse from sqrt(3)/2 on, or with A > 1
    Bad(
        "{type: ellipse, ahead: 1, lateral_ratio: 0.86}",
        ".ahead = 1",
        "turning would be forbidden",
        (RESERVE,),
    ),
    Bad(
        "{type: ellipse, ahead: 1}",
        ".ahead = 1",
        f"expected {math.ceil(1e4 * needed_ahead(0.5)) / 1e4:g}, which does, or null",
        (RESERVE, ("friction: 0.6", f"friction: {1.2 / 9.81}")),
    ),
    Bad(
        "protective_field",
        " = 'protective_field'",
        "expected braking.margin above 0 [m] or side above 0",
        (RESERVE,),
    ),
    Bad(
        "{type: polygon, vertices: [[0, -0.3], [1, 0], [0, 0.3]]}",
        " = ",
        "a zone that is wider ahead, or braking.margin",
        (RESERVE,),
    ),
]


@pytest.mark.parametrize("bad", BAD, ids=lambda bad: f"{bad.zone}: {bad.says}"[:70])
def test_a_zone_that_cannot_be_is_refused_with_line_key_and_rule(bad):
    with pytest.raises(ScenarioError) as caught:
        scenario(bad.zone, *bad.changes)
    start = f"zone.yaml:{LINE}: braking.zone{bad.key}"
    assert any(line.startswith(start) and bad.says in line for line in caught.value.faults), (
        caught.value.faults
    )


def test_a_wide_enough_ellipse_a_margin_or_a_side_let_the_robot_turn():
    for zone, change in (
        ("{type: ellipse, ahead: 1, lateral_ratio: 0.867}", ()),  # sqrt(3)/2 = 0.86603
        ("{type: ellipse, ahead: 1}", (("margin: 0.0", "margin: 0.01"),)),
        ("{type: protective_field, side: 0.01}", ()),
        ("protective_field", (("margin: 0.0", "margin: 0.01"),)),
    ):
        assert scenario(zone, RESERVE, *change).problem.zone is not None


def test_bad_input_exits_with_2(tmp_path, capsys):
    file = tmp_path / "zone.yaml"
    file.write_text(EXAMPLE.replace("zone: uniform", "zone: {type: ellipse, ahead: 0.5}"))
    assert main([str(file), "--out", str(tmp_path / "out")]) == 2
    told = capsys.readouterr().err
    assert told.startswith(f"{file}:{LINE}: braking.zone.ahead = 0.5: must be from 1 to 100")
    assert not (tmp_path / "out").exists()


def test_the_catalogue_refuses_in_its_own_words_too():
    law = scenario("uniform").problem.braking
    for name, parameters, key in (
        ("ellipse", {"ahead": 0.5}, "ahead"),
        ("ellipse", {"ratio": 0.5}, "ratio"),
        ("polygon", {}, "vertices"),
        ("polygon", {"vertices": [1, 2]}, "vertices"),
        ("field_set", {"base": {"type": "ellipse", "ahead": 0.5}}, "base.ahead"),
        ("field_set", {"base": 3}, "base"),
        ("egg", {}, ""),
    ):
        with pytest.raises(ZoneError) as caught:
            build_zone(name, parameters, law, 0.4)
        assert caught.value.key == key


# --- the ends ---

CORRIDOR = """
schema: 1
name: corridor
world: {boundary: [[0, -1], [60, -1], [60, 1], [0, 1]]}
robot: {radius: 0.4, mass: 40, wheelbase: 0.5, track: 0.4, com_height: 0.1, friction: 0.6, max_braking: 1,
  max_acceleration: 1, max_steering: 0.6}
braking: {zone: ZONE}
start: {position: [30, 0], speed: SPEED, heading: HEADING}
goal: {position: [50, 0], speed: rest}
"""


def corridor(zone: str, speed: float, heading: str) -> Scenario:
    text = CORRIDOR.replace("ZONE", zone).replace("SPEED", f"{speed:.12g}").replace("HEADING", heading)
    return parse_scenario(text.encode(), "corridor.yaml")


@pytest.mark.parametrize(
    ("ratio", "heading", "most"),
    [
        # Walls at W = 1 m, rho = 0.4 m: D h_E(90 degrees) = 0.6 m, so that v = sqrt(2 * 0.6 / beta) along it.
        (0.5, 0.0, math.sqrt(1.2 / 0.5)),
        (0.3, math.pi, 2.0),
        # At 45 degrees h_E = sqrt((1 + beta^2) / 2).
        (0.3, 0.25 * math.pi, math.sqrt(1.2 / math.sqrt(0.5 * 1.09))),
        # Whatever the heading: fastest along the corridor, where h_E is least.
        (0.3, None, 2.0),
    ],
)
def test_an_end_may_be_as_fast_as_its_zone_is_free(ratio, heading, most):
    zone, angle = f"{{type: ellipse, lateral_ratio: {ratio}}}", "null" if heading is None else f"{heading!r}"
    assert corridor(zone, most * (1.0 - 1e-8), angle).problem.start.speed == pytest.approx(most)
    with pytest.raises(ScenarioError, match=r"start.speed = .* too fast for the braking zone") as caught:
        corridor(zone, most * (1.0 + 1e-6), angle)
    told = float(str(caught.value).split("expected at most ")[1].split(" ")[0])
    assert told == pytest.approx(most, rel=1e-7)
    assert ("whatever the heading" in str(caught.value)) is (heading is None)


def test_a_field_is_limited_by_what_lies_ahead():
    # 30 m to the end wall, less the radius: v = sqrt(2 * 29.6).
    assert corridor("protective_field", math.sqrt(59.2) - 1e-6, "0").problem.start.speed == pytest.approx(
        7.694, abs=1e-3
    )
    with pytest.raises(ScenarioError, match=r"expected at most 7\.69415"):
        corridor("protective_field", 7.695, "0")


def test_fields_limit_the_speed_of_an_end():
    # Two metres wide, the corridor holds a field of half-width 0.9 m but not one of 1.1 m, if driven along.
    def fields(heading, speed):
        narrow = "[[-1, -0.9], [2, -0.9], [2, 0.9], [-1, 0.9]]"
        wide = "[[-1, -1.1], [4, -1.1], [4, 1.1], [-1, 1.1]]"
        given = f"[{{max_speed: 1, polygon: {narrow}}}, {{max_speed: 2, polygon: {wide}}}]"
        return corridor(f"{{type: field_set, base: protective_field, fields: {given}}}", speed, heading)

    assert fields("0", 1.0).problem.zone is not None
    with pytest.raises(ScenarioError, match=r"start\.speed = 1\.5: is too fast"):
        fields("0", 1.5)
    with pytest.raises(ScenarioError, match=r"start\.position = .*of a robot that stands does not fit"):
        fields("1.5707963267948966", 0.5)


def test_a_zone_that_is_wider_than_the_vehicle_needs_room_at_the_ends():
    # Half-width 0.4 + 0.7 m in a corridor of half-width 1 m; across it, 0.4 m ahead and behind, it fits.
    zone = "{type: protective_field, form: rectangle, side: 0.7}"
    with pytest.raises(
        ScenarioError, match=r"start.position = \[30, 0\]: the braking zone of a robot that stands"
    ):
        corridor(zone, 0.0, "0")
    assert corridor(zone, 0.0, "1.5707963267948966").problem.zone is not None
    assert corridor(zone, 0.0, "null").problem.zone is not None


def test_long_audits_are_judged_by_the_speed_that_the_zone_allows():
    # A thousand stops of up to t_r + v / a_b. Uniform: v = sqrt(2 * 0.6) from half the width, 2.2 s in all.
    # With a field up to sqrt(2 hypot(60, 2)) = 10.96 m/s, 11 s each: 2000 instants, two each, are 43,800 s.
    simulation = ("goal:", "simulation: {stops: 2000}\ngoal:")

    def asked(zone):
        text = CORRIDOR.replace("ZONE", zone).replace("SPEED", "rest").replace("HEADING", "0")
        return parse_scenario(text.replace(*simulation).encode(), "corridor.yaml")

    assert asked("uniform").simulation.stops == 2000
    with pytest.raises(ScenarioError, match=r"simulation\.stops = 2000: two stops at each"):
        asked("protective_field")
