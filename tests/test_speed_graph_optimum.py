"""Class optima: exact cases, optimality conditions from sample points alone, invariances, two starts."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

from tests.speed_graph_worlds import (
    Case,
    clearance_of,
    moved_problem,
    safe_speed_of,
    swapped,
    time_along,
    voronoi_start,
)
from tests.test_speed_graph_graphs import problem_in
from vnav_drake.braking import UniformBraking
from vnav_drake.collocation import Seed, plan_variational
from vnav_drake.problem import Problem
from vnav_drake.scenario import load_scenario
from vnav_drake.speed_graph import SpeedGraphResult, speed_graph
from vnav_drake.speed_graph.optimum import POINT, Optimum
from vnav_drake.speed_graph.sampled import default_spacing, k_best_classes
from vnav_drake.voronoi_route import plan_voronoi_route
from vnav_drake.world import Obstacle, World

SCENARIOS = Path(__file__).resolve().parents[1] / "scenarios"
GALLERY = ["single_wall", "single_point", "corridor", "four_point_room", "warehouse", "warehouse_gaps"]
LAWS = [
    {"reaction_time": 0.3},
    {"margin": 0.05},
    {"reaction_time": 0.2, "margin": 0.1},
    {"max_speed": 1.2},
    {"max_speed": 1.5, "reaction_time": 0.2, "margin": 0.02},
]


@cache
def problem_of(name: str) -> Problem:
    return load_scenario(SCENARIOS / f"{name}.yaml").problem


@cache
def classes_of(name: str) -> SpeedGraphResult:
    scenario = load_scenario(SCENARIOS / f"{name}.yaml")
    count = min(scenario.plan.homotopy_classes, 4)
    return speed_graph(scenario.problem, classes=count, through=scenario.plan.through, with_published=False)


@cache
def case_of(name: str) -> Case:
    return Case.of(problem_of(name))


def best_time(problem: Problem) -> float:
    (best,) = speed_graph(problem, classes=1, with_published=False).classes
    assert best.certified
    return best.travel_time


def optima(case: Case, count: int) -> list[Optimum]:
    """The optima of the best classes that have one: none attains the infimum of winding round a point."""
    found = [case.optimum(route) for route in k_best_classes(case.graph, count)]
    assert all(f.failed in ((), (POINT,)) for f in found)
    return [f for f in found if not f.failed]


# -- exact values


def test_along_a_wall_it_is_a_cycloid():
    # Manor 2015, eq. (3.9): x = x0 + (xi - sin xi) / (2 c^2), y = (1 - cos xi) / (2 c^2),
    # T = (xi_T - xi_S) / (c sqrt(2 a)). Through (0, 1) and (6, 2) beyond the top: sin(xi_S / 2) = c and
    # sin(xi_T / 2) = c sqrt 2 with xi_T > pi. What is left is one equation for c.
    def span(c: float) -> tuple[float, float]:
        return 2.0 * math.asin(c), 2.0 * math.pi - 2.0 * math.asin(c * math.sqrt(2.0))

    def miss(c: float) -> float:
        one, other = span(c)
        return ((other - math.sin(other)) - (one - math.sin(one))) / (2.0 * c * c) - 6.0

    c = brentq(miss, 0.3, 0.7, xtol=1e-15)
    time = (span(c)[1] - span(c)[0]) / (c * math.sqrt(2.0))
    assert time == pytest.approx(3.1956696464, abs=1e-10)  # as in the scenario's file
    best = classes_of("single_wall").classes[0]
    assert best.travel_time == pytest.approx(time, rel=1e-11)
    assert best.points[:, 1].max() == pytest.approx(1.0 / c**2, abs=2e-3)  # its top, between two samples


def test_around_a_point_it_is_a_segment_in_the_plane_of_square_roots_on_either_side():
    # Manor 2015, eq. (3.12): w = sqrt(z) makes the metric flat; the way round the other side ends at -w.
    start, goal = np.sqrt(2.0 - 0.5j), np.sqrt(-1.5 + 1.0j)
    near, far = classes_of("single_point").classes[:2]
    assert near.travel_time == pytest.approx(math.sqrt(2.0) * abs(goal - start), rel=1e-12)
    assert far.travel_time == pytest.approx(math.sqrt(2.0) * abs(goal + start), rel=1e-12)


def test_a_corridor_is_run_at_the_limit_along_its_middle():
    # half-width 2 m, radius 0.5 m: V = sqrt(2 * 1.5) m/s over 30 m
    best = classes_of("corridor").classes[0]
    assert best.travel_time == pytest.approx(30.0 / math.sqrt(3.0), rel=1e-13)
    assert best.length == pytest.approx(30.0, rel=1e-13)
    (ride,) = best.stuck
    assert np.abs(ride[:, 1] - 2.0).max() < 1e-12


@pytest.mark.parametrize(
    ("name", "time", "digits"), [("warehouse", 25.4416876, 1e-8), ("four_point_room", 7.317606429439, 1e-12)]
)
def test_optima_agree_with_an_independent_study(name, time, digits):
    # Both are from an earlier study with other code (zoomed sampling, then Newton on crossings), to its last
    # digit. That paths of these times exist is shown below by quadrature.
    assert classes_of(name).classes[0].travel_time == pytest.approx(time, rel=digits)


# -- the paths themselves


@pytest.mark.parametrize("name", GALLERY)
def test_travel_times_are_those_of_the_paths(name):
    problem, result = problem_of(name), classes_of(name)
    for c in result.classes:
        # an interpolation of the optimum that is a path in free space, so never faster
        time = time_along(problem, c.path)
        assert c.travel_time * (1.0 - 1e-12) <= time <= c.travel_time * (1.0 + 1e-8)
        assert clearance_of(problem, c.points).min() > 0.0
        assert np.abs(c.path.kinks).max(initial=0.0) < 1e-6
        assert tuple(c.points[0]) == problem.start.position
        assert tuple(c.points[-1]) == problem.goal.position
        assert result.gates.word(c.points) == c.word


@pytest.mark.parametrize("name", GALLERY)
def test_every_class_of_the_gallery_is_certified(name):
    for c in classes_of(name).classes:
        assert c.certified
        assert c.optimality_bound <= 1e-7 * c.travel_time
        assert c.travel_time <= c.graph_time * (1.0 + 1e-12)


@pytest.mark.parametrize("name", GALLERY[:-1])
def test_accelerations_in_cells_have_the_length_of_the_deceleration(name):
    # Ray equation of the index 1 / V with V = sqrt(2 a d): tangential part a (t . grad d) = a dd/ds, normal
    # part V^2 kappa, together of length a. Curvature from a series through sample points, d by Shapely.
    case = case_of(name)
    a, z, step = case.problem.braking.max_braking, np.linspace(-0.97, 0.97, 15), 1e-4
    for found in optima(case, 3):
        for leg in case.legs(found):
            if np.hypot(*(leg.points[-1] - leg.points[0])) < 1e-3:
                continue
            first, second = leg.at(z, 1), leg.at(z, 2)
            rate = np.hypot(*first.T)
            curvature = (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / rate**3
            d = [clearance_of(case.problem, leg.at(z + h)) for h in (-step, 0.0, step)]
            tangential = a * (d[2] - d[0]) / (2.0 * step * rate)
            normal = 2.0 * a * d[1] * curvature
            assert np.hypot(tangential, normal) == pytest.approx(a, rel=1e-6)


@pytest.mark.parametrize("name", GALLERY[:-1])
def test_headings_agree_where_pieces_join(name):
    # headings from sample points alone: legs by series, rides (straight or parabolas) by quadratics in u
    case = case_of(name)
    for found in optima(case, 3):
        pieces = [p for p in case.pieces(found) if p.length > 1e-6]
        assert len(pieces) >= 1
        for one, other in pairwise(pieces):
            kink = math.remainder(other.headings()[0] - one.headings()[1], 2.0 * math.pi)
            assert abs(kink) < 1e-6


# -- one optimum a class, wherever the search begins


@pytest.mark.parametrize("name", [*GALLERY[:-1], "lagging"])
def test_other_starts_lead_to_the_same_optimum(name):
    if name == "lagging":
        problem = replace(
            problem_of("four_point_room"),
            braking=UniformBraking(max_braking=1.0, reaction_time=0.3, margin=0.05),
        )
        case = Case.of(problem)
    else:
        case = case_of(name)
    known = {route.word: case.optimum(route) for route in k_best_classes(case.graph, 4)}
    time = {word: found.time for word, found in known.items() if not found.failed}
    other = Case.of(case.problem, 1.9 * default_spacing(case.problem), like=case)
    starts = [(other, route) for route in k_best_classes(other.graph, 4)] + [(case, voronoi_start(case))]
    agreed = 0
    for begun, route in starts:
        if route.word in time:
            found = begun.optimum(route)
            assert not found.failed
            assert found.time == pytest.approx(time[route.word], rel=1e-9)
            agreed += 1
    assert agreed >= 2


# -- invariances


@pytest.mark.parametrize("name", ["four_point_room", "warehouse", "single_wall"])
def test_turned_shifted_and_mirrored_worlds_have_the_same_optimum(name):
    problem = problem_of(name)
    time = best_time(problem)
    for angle, shift, mirror in (
        (0.7, (3.0, -8.0), False),
        (-2.1, (100.0, 50.0), True),
        (0.5 * math.pi, (0.0, 0.0), True),
    ):
        assert best_time(moved_problem(problem, angle, shift, mirror)) == pytest.approx(time, rel=1e-9)


@pytest.mark.parametrize("name", ["four_point_room", "warehouse", "single_wall"])
def test_four_times_the_braking_halves_the_time_along_the_same_path(name):
    # V = sqrt(2 a d) for every d alike
    problem = problem_of(name)
    fast = replace(problem, braking=replace(problem.braking, max_braking=4.0 * problem.braking.max_braking))
    one = classes_of(name).classes[0]
    (other,) = speed_graph(fast, classes=1, with_published=False).classes
    assert other.travel_time == pytest.approx(0.5 * one.travel_time, rel=1e-12)
    assert other.length == pytest.approx(one.length, rel=1e-9)


@pytest.mark.parametrize("name", ["four_point_room", "warehouse", "single_point"])
def test_the_way_back_is_the_same_way(name):
    one = classes_of(name).classes[0]
    (other,) = speed_graph(swapped(problem_of(name)), classes=1, with_published=False).classes
    assert other.certified
    assert other.travel_time == pytest.approx(one.travel_time, rel=1e-12)
    assert other.length == pytest.approx(one.length, rel=1e-9)
    # near enough that only the samples differ: each point of one lies on the other polyline up to its sagitta
    gap = np.hypot(*(one.points[:, None] - other.points[None]).transpose(2, 0, 1)).min(axis=1)
    spacing = np.hypot(*np.diff(other.points, axis=0).T).max()
    assert gap.max() <= spacing
    middle = [c.path.at(np.linspace(0.0, c.path.length, 200))[:2] for c in (one, other)]
    assert np.abs(np.array(middle[0]) - np.array(middle[1])[:, ::-1]).max() < 1e-5


# -- other laws


@pytest.mark.parametrize("law", LAWS, ids=str)
def test_other_braking_laws_are_as_exact(law):
    problem = replace(problem_of("four_point_room"), braking=UniformBraking(max_braking=1.0, **law))
    uniform = {c.word: c.travel_time for c in classes_of("four_point_room").classes}
    for c in speed_graph(problem, classes=3, with_published=False).classes:
        assert c.certified
        assert c.optimality_bound <= 1e-7 * c.travel_time
        assert c.travel_time >= uniform.get(c.word, 0.0)  # V is smaller everywhere
        if "max_speed" not in law:
            time = time_along(problem, c.path)
            assert c.travel_time * (1.0 - 1e-12) <= time <= c.travel_time * (1.0 + 1e-8)


@pytest.mark.parametrize("law", LAWS, ids=str)
def test_times_under_other_laws_are_those_of_the_paths(law):
    # by polylines, as with a greatest speed the curvature of a leg may jump
    case = Case.of(replace(problem_of("four_point_room"), braking=UniformBraking(max_braking=1.0, **law)))
    for found in optima(case, 2):
        assert case.time_by_polylines(found) == pytest.approx(found.time, rel=1e-8)


def test_the_greatest_speed_makes_the_open_floor_flat():
    # v_max = 1 m/s is reached 0.5 m from walls: the straight way through a large empty room takes its length.
    world = World.build([(0, 0), (20, 0), (20, 15), (0, 15)])
    problem = problem_in(world, (2.0, 3.0), (17.0, 11.0), 0.3, max_speed=1.0)
    assert best_time(problem) == pytest.approx(17.0, rel=1e-12)


def test_the_greatest_speed_lets_it_cross_voronoi_arcs_straight():
    # v_max = 0.5 m/s is reached 0.125 m from obstacles: straight past a point, 12 m at 0.5 m/s. The nearest
    # feature changes twice on the way: the wall y = 0, the point, the wall again.
    world = World.build([(0, 0), (20, 0), (20, 20), (0, 20)], [Obstacle(((10.0, 4.0),))])
    assert best_time(problem_in(world, (4.0, 6.0), (16.0, 6.0), max_speed=0.5)) == pytest.approx(
        24.0, rel=1e-12
    )


def test_a_lag_near_a_wall_obeys_snells_law():
    # sin(angle to the wall's normal) / V(y) is the same all along (Clairaut); from sample points alone
    world = World.build([(-20, 0), (30, 0), (30, 40), (-20, 40)])
    case = Case.of(problem_in(world, (0.0, 1.0), (6.0, 2.0), 0.2, reaction_time=0.5, margin=0.1))
    (leg,) = case.legs(case.optimum(k_best_classes(case.graph, 1)[0]))
    z = np.linspace(-1.0, 1.0, 21)
    slope = leg.at(z, 1)
    speed = safe_speed_of(case.problem, leg.at(z)[:, 1] - 0.2)
    ratio = slope[:, 0] / np.hypot(*slope.T) / speed
    assert np.ptp(ratio) < 1e-7 * ratio.mean()


# -- against collocation of the same model


@pytest.mark.parametrize("name", ["single_point", "four_point_room"])
def test_no_collocation_beats_the_optimum(name):
    problem, best = problem_of(name), classes_of(name).classes[0]
    seeds = [best.path] if name == "four_point_room" else [best.path, plan_voronoi_route(problem).path]
    for path in seeds:
        plan = plan_variational(problem, [Seed(path)], effort="quick")
        # its rows are a safe motion themselves, so not even the discretisation lets it win
        assert plan.travel_time >= best.travel_time * (1.0 - 1e-12)
        assert time_along(problem, plan.path) >= best.travel_time * (1.0 - 1e-9)
