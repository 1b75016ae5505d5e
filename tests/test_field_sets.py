"""Fields switched by speed: what they watch, which speeds lose the least time, what they cost a motion."""

import csv
import itertools
import json
import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from verify.field_stage import asks_for_fields, run_fields, write_fields
from verify.judge.checks import Setting
from verify.judge.motion import COLUMNS, Motion
from verify.judge.zones.fields_file import judge_fields, read_fields
from vnav_drake.braking import UniformBraking
from vnav_drake.convex import ConvexPieces
from vnav_drake.field_fitting import best_speeds, drive_fields, fit_fields, path_along, with_fields
from vnav_drake.plan import Path, Plan
from vnav_drake.problem import End, PlanningError, Problem
from vnav_drake.robot import Robot
from vnav_drake.scenario import parse_scenario
from vnav_drake.speed_profile import SPEED_REDUCTION, fastest_profile
from vnav_drake.world import Obstacle, World
from vnav_drake.zones.convex_zone import ConvexZone
from vnav_drake.zones.field_set import TANGENTS, FieldSet, polygon_around
from vnav_drake.zones.shapes import DiscZone, EllipseZone, ProtectiveField
from vnav_drake.zones.touch import into_body, separation

LAW = UniformBraking(max_braking=1.0, margin=0.1)
RADIUS = 0.4
SPEEDS = (0.5, 1.0, 2.0)
CAPSULE = ProtectiveField(law=LAW, radius=RADIUS)
BASES = [
    DiscZone(law=LAW, radius=RADIUS),
    EllipseZone(law=LAW, radius=RADIUS, lateral_ratio=0.5, behind=0.1),
    CAPSULE,
    ProtectiveField(law=LAW, radius=RADIUS, form="rectangle", side=0.05),
]


def fields(base: ConvexZone, speeds: tuple[float, ...] = SPEEDS, *, polygons: bool = False) -> FieldSet:
    """Fields of a base's shape, or polygons around those."""
    like = FieldSet(law=base.law, radius=base.radius, base=base, max_speeds=speeds)
    if not polygons:
        return like
    corners = tuple(tuple(map(tuple, like.polygon(case).tolist())) for case in range(len(speeds)))
    return replace(like, polygons=corners)


def slalom(zone: ConvexZone | None = None, max_speed: float = math.inf) -> tuple[Problem, Path]:
    """A corridor, 4 m wide, with a block on either side, and a way around both in bends of 6 m."""
    blocks = [
        Obstacle(((9.0, 0.0), (10.0, 0.0), (10.0, 1.6), (9.0, 1.6))),
        Obstacle(((17.0, 2.4), (18.0, 2.4), (18.0, 4.0), (17.0, 4.0))),
    ]
    law = replace(LAW, max_speed=max_speed)
    side = [1.0, -1.0]
    bend = np.array([0.0, *side, 0.0, *side[::-1], *side[::-1], 0.0, *side, 0.0]) / 6.0
    length = np.where(bend == 0.0, 2.0, 6.0 * 0.25)  # each swerve shifts by 12 (1 - cos 0.25) = 0.373 m
    path = Path.from_arcs((3.5, 2.0), 0.0, bend, length)
    problem = Problem(
        world=World.build([[0, 0], [30, 0], [30, 4], [0, 4]], blocks),
        robot=Robot(radius=RADIUS, max_speed=max_speed),
        braking=law,
        zone=None if zone is None else zone.with_law(law),
        start=End(position=(3.5, 2.0), speed="rest"),
        goal=End(position=(float(path.x[-1]), float(path.y[-1])), speed="rest"),
    )
    return problem, path


@pytest.mark.parametrize("base", BASES, ids=lambda base: f"{base.type_name}")
def test_the_zone_at_a_speed_is_the_least_field_that_may_be_driven_as_fast(base):
    zone = fields(base)
    angle = np.linspace(-4.0, 4.0, 101)[:, None]
    speed = np.array([0.0, 0.2, 0.5, 0.5000001, 1.0, 1.5, 2.0])
    watched = np.array([0.5, 0.5, 0.5, 1.0, 1.0, 2.0, 2.0])
    h, slope, by_speed = zone.support(angle, speed)
    expected, expected_slope, _ = base.support(angle, watched)
    assert np.array_equal(h, expected)
    assert np.array_equal(slope, expected_slope)
    assert not by_speed.any()
    assert zone.law.max_speed == 2.0
    assert zone.steps.tolist() == [0.5, 1.0]


def test_polygons_have_the_support_of_their_corners():
    zone = fields(CAPSULE, polygons=True)
    rng = np.random.default_rng(3)
    angle, speed = rng.uniform(-7.0, 7.0, 400), rng.uniform(0.0, 2.0, 400)
    h, slope, _ = zone.support(angle, speed)
    for case in range(3):
        here = zone.case(speed) == case
        along = np.stack([np.cos(angle[here]), np.sin(angle[here])])
        assert h[here] == pytest.approx((zone.polygon(case) @ along).max(axis=0), abs=1e-12)
    step = 1e-6  # no corner changes within it here, so the difference is exact to step^2 h / 6
    ahead, behind = zone.support(angle + step, speed)[0], zone.support(angle - step, speed)[0]
    assert slope == pytest.approx((ahead - behind) / (2.0 * step), abs=1e-8)


@pytest.mark.parametrize("base", BASES, ids=lambda base: f"{base.type_name}")
def test_a_polygon_around_a_zone_holds_it_and_little_more(base):
    ring = polygon_around(base, 2.0)
    angle = np.linspace(-math.pi, math.pi, 5001)
    along = np.stack([np.cos(angle), np.sin(angle)])
    h, _, _ = base.support(angle, np.full(len(angle), 2.0))
    more = (ring @ along).max(axis=0) - h
    # Between two tangents a boundary of radius of curvature r bulges by r (1 / cos(pi / n) - 1) at most;
    # r is 2.5 m for the disc. The ellipse has semi-axes of 1.1 and 1 m, so 1.1^2 / 1 + 0.5 = 1.71 m, the
    # others less.
    assert more.min() >= -1e-12
    assert more.max() <= 2.5 * 1.01 * (1.0 / math.cos(math.pi / TANGENTS) - 1.0)


def test_fields_of_polygons_say_whether_they_hold_the_base():
    assert fields(CAPSULE).holds_base
    assert fields(CAPSULE, polygons=True).holds_base
    wide = replace(fields(CAPSULE, polygons=True), base=BASES[0])  # the disc of the same stopping distance
    assert not wide.holds_base
    assert wide.inner_law() is None
    assert fields(BASES[0]).inner_law() == replace(LAW, max_speed=2.0)


@pytest.mark.parametrize(
    ("speeds", "polygons", "said"),
    [
        ((), None, "at least one"),
        ((0.5, 0.5), None, r"fields\[1\].max_speed"),
        ((0.5, math.inf), None, r"fields\[1\].max_speed"),
        ((0.0,), None, "positive"),
        ((0.5,), (((-1, -1), (1, -1)),), "three or more"),
        ((0.5,), (((-1, -1), (3, -1), (0, 0), (3, 1), (-1, 1)),), "convex"),
        ((0.5,), (((-1, -1), (1, 1), (1, -1), (-1, 1)),), "simple"),
        # D(0.5) = 0.125 m and 0.5 m of disc and margin: 0.625 m ahead are needed
        ((0.5,), (((-1, -1), (0.6, -1), (0.6, 1), (-1, 1)),), "lacks 0.025 m"),
        ((0.5,), (((-1, -0.4), (2, -0.4), (2, 0.4), (-1, 0.4)),), "lacks 0.1 m"),
        # the first reaches to x = 2, the second to 1.5 only
        (
            (0.5, 1.0),
            (((-1, -1), (2, -1), (2, 1), (-1, 1)), ((-1, -1), (1.5, -1), (1.5, 1), (-1, 1))),
            "field before",
        ),
        ((0.5, 1.0), (((-1, -1), (2, -1), (2, 1), (-1, 1)),), "2 speeds and 1 polygons"),
    ],
)
def test_fields_that_cannot_be_are_refused(speeds, polygons, said):
    with pytest.raises(ValueError, match=said):
        FieldSet(law=LAW, radius=RADIUS, base=CAPSULE, max_speeds=speeds, polygons=polygons)


def test_a_field_set_is_no_base():
    with pytest.raises(ValueError, match="field set itself"):
        FieldSet(law=LAW, radius=RADIUS, base=fields(CAPSULE), max_speeds=(1.0,))


def test_one_field_of_a_disc_is_uniform_braking_to_its_speed():
    # Where the disc of D(v) is free all along, uniform braking with the greatest speed v never needs less.
    problem, path = slalom()
    open_speed = (1.0 - 1e-4) * float(fastest_profile(problem, path, model="variational").v.min())
    uniform = replace(problem, braking=replace(LAW, max_speed=open_speed))
    exact = fastest_profile(uniform, path, model="full")
    disc = DiscZone(law=LAW, radius=RADIUS)
    stepped = with_fields(problem, fields(disc, (open_speed,)))
    for found in (
        fastest_profile(stepped, path, model="full"),
        drive_fields(problem, exact, fields(disc, (open_speed,))).trajectory,
    ):
        assert found.travel_time == pytest.approx(exact.travel_time, rel=1e-9)
        assert np.interp(exact.arc_length, found.arc_length, found.v) == pytest.approx(exact.v, abs=1e-9)


def test_case_speeds_lose_the_least_time():
    # Stretches of 1, 2 and 3 m that allow 1, 2 and 4 m/s. Two fields: (1, 2) loses 3 (1/2 - 1/4) = 0.75 s,
    # (1, 4) loses 2 (1 - 1/2) = 1 s; with three nothing is lost, and a fourth is no use.
    allowed, length = np.array([2.0, 1.0, 4.0]), np.array([2.0, 1.0, 3.0])
    assert best_speeds(allowed, allowed, length, 1).tolist() == [1.0]
    assert best_speeds(allowed, allowed, length, 2).tolist() == [1.0, 2.0]
    assert best_speeds(allowed, allowed, length, 3).tolist() == [1.0, 2.0, 4.0]
    assert best_speeds(allowed, allowed, length, 4).tolist() == [1.0, 2.0, 4.0]


def lost(cases: tuple[float, ...], allowed: np.ndarray, planned: np.ndarray, length: np.ndarray) -> float:
    """Time lost with these case speeds [s]; infinite where not even the least may be driven."""
    speeds = np.array(cases)
    field = np.searchsorted(speeds, allowed, side="right") - 1
    if field.min() < 0:
        return math.inf
    return float(np.sum(length * np.maximum(1.0 / speeds[field] - 1.0 / planned, 0.0)))


@given(st.integers(0, 10_000), st.integers(1, 4))
@settings(max_examples=40, deadline=None)
def test_no_other_choice_of_speeds_loses_less(seed, count):
    rng = np.random.default_rng(seed)
    allowed = rng.uniform(0.5, 3.0, 7)
    planned, length = allowed * rng.uniform(0.2, 1.0, 7), rng.uniform(0.1, 2.0, 7)
    found = tuple(best_speeds(allowed, planned, length, count).tolist())
    others = itertools.combinations(sorted(allowed.tolist()), min(count, 7))
    least = min(lost(cases, allowed, planned, length) for cases in others)
    assert len(found) <= count
    assert lost(found, allowed, planned, length) <= least + 1e-12


def test_two_fields_towards_a_wall_have_the_speed_that_calculus_gives():
    # A capsule towards a wall, free length x from 10 to 2 m: V = sqrt(2 x). Fields of 2 m/s (the least V) and
    # c take T(c) = (20 - c^2)/(2 c) + (c^2 - 4)/4, least where c^3 - c^2 - 20 = 0.
    x = np.linspace(10.0, 2.0, 8001)
    allowed = np.sqrt(2.0 * x[1:])
    length = np.full(8000, 1e-3)
    least, c = best_speeds(allowed, allowed, length, 2)
    exact = max(np.roots([1.0, -1.0, 0.0, -20.0]), key=lambda root: root.real).real
    time = [(20.0 - v * v) / (2.0 * v) + (v * v - 4.0) / 4.0 for v in (c, exact)]
    assert least == 2.0
    assert c == pytest.approx(exact, rel=5e-3)  # 400 candidates over the route
    assert time[0] == pytest.approx(time[1], rel=1e-5)


@pytest.mark.parametrize("base", [None, BASES[1], CAPSULE], ids=["uniform", "ellipse", "capsule"])
def test_a_motion_under_fields_keeps_them_free_and_is_as_fast_as_they_allow(base):
    problem, path = slalom(base, max_speed=4.0)
    plan = fastest_profile(problem, path, model="full")
    chosen = fit_fields(problem, plan, 3)
    run = drive_fields(problem, plan, chosen)
    motion = run.trajectory
    assert len(chosen.max_speeds) == 3
    assert plan.travel_time < motion.travel_time
    # with fields as its zone the profile tries each; here they are known from the base zone's own limits
    slower = replace(chosen, max_speeds=tuple((1.0 - 1e-4) * speed for speed in chosen.max_speeds))
    known = drive_fields(problem, plan, slower).trajectory.travel_time
    tried = fastest_profile(with_fields(problem, slower), path_along(plan), model="full").travel_time
    assert tried * (1.0 - 1e-3) <= known <= tried * (1.0 + 1e-9)  # its bounds between the rows are looser
    assert np.all(np.asarray(chosen.max_speeds)[run.case[:-1]] >= np.maximum(motion.v[:-1], motion.v[1:]))
    pieces = ConvexPieces.of(problem.world).corners
    row, piece = np.divmod(np.arange(len(motion.v) * len(pieces)), len(pieces))
    corners = into_body(pieces[piece], motion.x[row], motion.y[row], motion.heading[row])
    watched = np.asarray(chosen.max_speeds)[run.case]
    assert separation(chosen, corners, watched[row]).gap.min() >= -1e-9


def test_more_fields_lose_less_and_a_dwell_switches_less():
    problem, path = slalom(CAPSULE, max_speed=4.0)
    plan = fastest_profile(problem, path, model="full")
    few, many = (drive_fields(problem, plan, fit_fields(problem, plan, count)) for count in (3, 12))
    assert plan.travel_time < many.trajectory.travel_time < few.trajectory.travel_time
    dwell = 0.8  # [s]
    calm = drive_fields(problem, plan, many.field_set, dwell=dwell)
    assert len(calm.switches) < len(many.switches)
    assert many.trajectory.travel_time <= calm.trajectory.travel_time
    stays = np.diff(calm.trajectory.t[calm.switches])
    assert np.all(stays >= dwell - 1e-9)
    assert np.all(np.asarray(many.field_set.max_speeds)[calm.case] >= calm.trajectory.v)


def test_fields_of_polygons_are_driven_as_they_are():
    problem, path = slalom(CAPSULE, max_speed=4.0)
    plan = fastest_profile(problem, path, model="full")
    fitted = fit_fields(problem, plan, 3)
    slower = tuple(speed * (1.0 - 1e-3) for speed in fitted.max_speeds)  # room for what polygons reach beyond
    around = fields(fitted.base, slower, polygons=True)
    run = drive_fields(problem, plan, around)
    exact = drive_fields(problem, plan, fields(fitted.base, slower))
    assert run.trajectory.travel_time == pytest.approx(exact.trajectory.travel_time, rel=1e-3)
    assert np.all(run.trajectory.v <= slower[-1] * (1.0 - 0.9 * SPEED_REDUCTION))


def test_a_least_field_that_is_not_free_is_told_with_its_place():
    problem, path = slalom(CAPSULE)
    plan = fastest_profile(problem, path, model="full")
    with pytest.raises(PlanningError, match=r"the least field, of 4 m/s, is not free at \("):
        drive_fields(problem, plan, fields(CAPSULE, (4.0,)))
    with pytest.raises(ValueError, match="count = 0"):
        fit_fields(problem, plan, 0)


SCENARIO = """
schema: 1
name: towards_a_wall
world: {boundary: [[0, 0], [20, 0], [20, 4], [0, 4]]}
robot: {radius: 0.4, mass: 40.0, wheelbase: 0.5, track: 0.4, com_height: 0.12, friction: 0.6,
  max_braking: 1.0, max_acceleration: 1.0, max_steering: 0.6}
braking: {margin: 0.1, zone: %s}
start: {position: [1.0, 2.0], speed: rest}
goal: {position: [19.0, 2.0], speed: rest}
"""


def staged(zone: str):
    """The stage of a straight run towards a wall."""
    scenario = parse_scenario((SCENARIO % zone).encode(), "towards_a_wall.yaml")
    assert asks_for_fields(scenario)
    trajectory = fastest_profile(scenario.problem, Path.polyline([[1.0, 2.0], [19.0, 2.0]]), model="full")
    return run_fields(scenario, Plan(method="refined", model="full", trajectory=trajectory))


def test_the_files_say_what_is_watched_where_and_what_a_scanner_must_see(tmp_path):
    stage = staged("{type: field_set, count: 3, base: {type: protective_field}}")
    write_fields(tmp_path, stage)
    told = json.loads((tmp_path / "fields.json").read_text())
    speeds = [case["max_speed"] for case in told["cases"]]
    assert told["schema"] == 1
    assert told["base"]["type"] == "protective_field"
    assert [case["case"] for case in told["cases"]] == [1, 2, 3]
    assert speeds == sorted(speeds) == list(stage.field_set.max_speeds)
    for case in told["cases"]:
        stop = shapely.LineString([(0.0, 0.0), (0.5 * case["max_speed"] ** 2, 0.0)])
        assert shapely.Polygon(case["polygon"]).buffer(1e-9).contains(stop.buffer(0.5))
    # D + r + m ahead, within what 180 tangents add to half a circle of 0.5 m
    assert told["scanner_range"] == pytest.approx(0.5 * speeds[-1] ** 2 + 0.5, abs=1e-4)
    # beside the walls nothing comes nearer than 2 - 0.5 m; ahead each field ends at the wall at last
    assert all(-1e-9 <= least <= 1.5 + 1e-9 for least in told["least_separation"])
    motion = stage.plan.trajectory
    switched = np.interp([entry["t"] for entry in told["switches"]], motion.t, motion.arc_length)
    assert [entry["s"] for entry in told["switches"]] == pytest.approx(switched.tolist())
    assert told["switches"][0]["case"] == 1  # from rest
    assert len(told["switches"]) == stage.about["switches"] + 1
    assert sum(case["watched_for"] for case in told["cases"]) == pytest.approx(motion.travel_time)
    lines = (tmp_path / "fields.csv").read_text().splitlines()
    assert lines[0].startswith("# Inputs to a safety case")
    rows = list(csv.DictReader(lines[1:]))
    assert [row["case"] for row in rows] == ["1", "2", "3"]
    assert float(rows[2]["braking_distance"]) == pytest.approx(0.5 * speeds[2] ** 2, abs=1e-4)
    assert "compliant" not in "".join(lines).lower()


def test_the_stage_tells_the_cost_of_its_fields():
    stage = staged("{type: field_set, count: 2, base: {type: protective_field}}")
    assert stage.about["count"] == 2
    assert stage.about["cost"] == pytest.approx(stage.plan.travel_time / stage.about["base_time"] - 1.0)
    assert stage.about["cost"] > 0.0
    assert stage.problem.zone is stage.field_set
    assert stage.problem.braking.max_speed == stage.field_set.max_speeds[-1]


DWELLING = "{type: field_set, count: 6, dwell: 0.8, base: {type: protective_field}}"


def test_a_dwell_of_the_scenario_keeps_each_field_that_long(tmp_path):
    stage = staged(DWELLING)
    write_fields(tmp_path, stage)
    told = json.loads((tmp_path / "fields.json").read_text())
    assert (told["chosen_by"], told["dwell"]) == ("place", 0.8)
    stays = np.diff([switch["t"] for switch in told["switches"]][1:])
    assert len(stays) > 0
    assert np.all(stays >= 0.8 - 1e-9)
    # and the judge, who recomputes what is watched and how far it is free, agrees
    within = Setting.from_spec(parse_scenario((SCENARIO % DWELLING).encode(), "towards_a_wall.yaml").spec)
    assert within.zone is not None
    motion = Motion(*(getattr(stage.plan.trajectory, name) for name in COLUMNS))
    check, figures = judge_fields(read_fields(tmp_path), within.zone, motion, within.features.table)
    assert check.status == "passed", check.message
    assert figures is not None
    assert figures["switches"] == len(told["switches"]) - 1


def test_fields_of_a_scenario_are_those_that_are_driven():
    square = "[[-0.5, -0.5], [{0}, -0.5], [{0}, 0.5], [-0.5, 0.5]]"
    # D(1) = 0.5 and D(2) = 2 m, and 0.5 m of disc and margin ahead
    given_fields = ", ".join(
        f"{{max_speed: {v}, polygon: {square.format(0.5 * v * v + 0.5)}}}" for v in (1.0, 2.0)
    )
    stage = staged(f"{{type: field_set, base: {{type: protective_field}}, fields: [{given_fields}]}}")
    motion = stage.plan.trajectory
    # The second reaches 2.5 m ahead and touches the wall at x = 20 from x = 17.5 on, so it is left before
    # that, at 1 m/s. The first reaches 1 m ahead and would touch the wall from x = 19 on, the goal.
    late = motion.x > 17.5 + 1e-9
    assert motion.v.max() == pytest.approx(2.0, rel=1e-5)
    assert motion.v[late].max() == pytest.approx(1.0, rel=1e-5)
    assert not stage.about["fitted"]
