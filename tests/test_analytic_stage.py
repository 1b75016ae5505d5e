"""The speed graph within a run: what its classes seed, what replaces it when it fails, ways through gates."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from judged import scenario

from verify import planning
from verify.analytic import full_profile
from verify.pipeline import run_scenario
from verify.seeding import route_seeds
from vnav_drake.homotopy import Gates, build_gates
from vnav_drake.plan import Path, Plan
from vnav_drake.problem import PlanningError, Problem
from vnav_drake.scenario import ScenarioError
from vnav_drake.speed_profile import fastest_profile
from vnav_drake.voronoi import VoronoiDiagram, build_diagram
from vnav_drake.voronoi_route import plan_voronoi_route

# A pillar above the middle of a room: the way below it is wider than the one above.
ROOM = {
    "name": "pillar",
    "world": {
        "boundary": [[0, 0], [12, 0], [12, 8], [0, 8]],
        "obstacles": [{"name": "P", "vertices": [[6.0, 4.6]]}],
    },
    "robot": {"radius": 0.4},
    "start": {"position": [3.0, 4.0]},
    "goal": {"position": [9.0, 4.0]},
}


def room(**plan: object):
    return scenario(**ROOM, plan={"effort": "quick", **plan})


@cache
def at_hand() -> tuple[Problem, VoronoiDiagram, Gates, Plan]:
    problem = room().problem
    diagram = build_diagram(problem.world, problem.robot.radius)
    return problem, diagram, build_gates(diagram, 0.4), plan_voronoi_route(problem, diagram)


def test_a_speed_graph_that_fails_is_missed_and_the_routes_seed_instead(tmp_path, monkeypatch):
    def fail(*_: object, **__: object) -> None:
        raise PlanningError("a leg could not be solved")

    monkeypatch.setattr(planning, "run_speed_graph", fail)
    outcome = run_scenario(room(methods=["speed_graph"]), tmp_path)
    assert outcome.exit_code == 3
    assert [(m.stage, m.reason) for m in outcome.missing] == [("speed_graph", "a leg could not be solved")]
    assert set(outcome.result["plans"]) == {"voronoi_route", "collocation", "refined"}
    seeds = outcome.result["plans"]["collocation"]["seeds"]
    assert {row["method"] for row in seeds} == {"voronoi_route"}
    assert outcome.judgement.verdict != "failed"
    assert "a leg could not be solved" in outcome.report.read_text()


def test_routes_seed_when_nothing_that_is_asked_for_does(tmp_path):
    outcome = run_scenario(room(methods=["dwa"]), tmp_path)
    assert set(outcome.result["plans"]) == {"voronoi_route", "dwa", "collocation", "refined"}


def test_every_plan_and_every_seed_has_the_name_of_its_class(tmp_path):
    plans = run_scenario(room(methods=["voronoi_route"]), tmp_path).result["plans"]
    # Straight on is below the pillar, without a turn round it: the gate is above or below, one name for each.
    names = {plan["class"] for plan in plans.values()}
    assert len(names) == 1
    seeds = plans["collocation"]["seeds"]
    assert len({row["class"] for row in seeds}) == len(seeds) >= 2
    assert plans["refined"]["seeds"][0]["method"] == "collocation"
    assert plans["refined"]["seeds"][0]["class"] in names


def test_a_gate_that_does_not_exist_is_bad_input_at_its_place(tmp_path):
    with pytest.raises(ScenarioError, match=r"plan\.through\[1\] = 'P/bondary'.*P/boundary"):
        run_scenario(room(methods=["speed_graph"], through=["P/boundary", "P/bondary"]), tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_routes_that_do_not_pass_the_gates_asked_for_are_no_seeds():
    problem, diagram, gates, route = at_hand()
    every = route_seeds(problem, diagram, gates, route, 6, ())
    passing = [seed for seed in every if "P/boundary" in seed.homotopy_class]
    assert 0 < len(passing) < len(every)
    through = route_seeds(problem, diagram, gates, route, 6, ("P/boundary",))
    assert [seed.homotopy_class for seed in through] == [seed.homotopy_class for seed in passing]


def test_no_route_through_the_gates_is_a_reason():
    problem, diagram, gates, route = at_hand()
    with pytest.raises(PlanningError, match="passes P/boundary, P/boundary, P/boundary in this order"):
        route_seeds(problem, diagram, gates, route, 2, ("P/boundary",) * 3)


def bow(radius: float) -> Path:
    """From start to goal, 6 m apart, below the pillar on one arc."""
    half = np.arcsin(3.0 / radius)
    return Path.from_arcs((3.0, 4.0), -half, [1.0 / radius], [2.0 * half * radius])


def test_the_full_robot_on_a_path_takes_what_the_full_profile_takes():
    problem = at_hand()[0]
    found = full_profile(problem, bow(8.0))
    assert found.travel_time == fastest_profile(problem, bow(8.0), model="full").travel_time
    assert found.row() == {"full_profile_time": found.travel_time}
    # more limits can only slow it down
    assert found.travel_time >= fastest_profile(problem, bow(8.0), model="variational").travel_time


def test_a_path_that_the_full_robot_cannot_follow_says_why():
    problem = at_hand()[0]
    kinked = Path.polyline([(3, 4), (6, 2), (9, 4)])
    assert "kink" in full_profile(problem, kinked).reason
    stiff = replace(problem, robot=replace(problem.robot, max_steering=0.01))
    # an arc of 8 m bends with 0.125 1/m; r_kin = 0.5 sqrt(1/4 + 1/tan^2 0.01) = 50.0 m (Manor 2015, eq. A.1)
    assert full_profile(stiff, bow(8.0)).reason == "bends with 0.125 1/m, the steering allows 0.02 1/m"
    ahead = replace(problem, goal=replace(problem.goal, heading=0.0))
    assert full_profile(ahead, bow(8.0)).reason == "has not the heading asked for at the goal"
    turned = replace(problem, start=replace(problem.start, heading=2.0 * np.pi - np.arcsin(3.0 / 8.0)))
    assert full_profile(turned, bow(8.0)).travel_time is not None  # the same heading, a full turn on
    fast = replace(problem, goal=replace(problem.goal, speed=1.5))
    assert "goal at 1.5 m/s" in full_profile(replace(fast, start=replace(fast.start, speed="rest")),
                                             Path.polyline([(8.5, 4), (9, 4)])).reason  # fmt: skip


def test_steering_that_turns_too_fast_is_a_reason():
    problem = at_hand()[0]
    # 1/8 to 1/8.2 1/m is a step of about 0.5 m x 0.003 1/m = 1.5e-3 rad within some 1.5 s of either arc
    slow = replace(problem, robot=replace(problem.robot, max_steering_rate=5e-4))
    half = np.arcsin(3.0 / 8.0)
    weave = Path.from_arcs((3.0, 4.0), -half, [1 / 8.0, 1 / 8.2], [8.0 * half, 8.0 * half])
    assert "the steering would turn at" in full_profile(slow, weave).reason
    assert full_profile(problem, weave).travel_time is not None


def test_the_vc_method_knows_no_gates_so_its_way_is_named_and_seeds_nothing(tmp_path):
    # Asked for is the way above the pillar; the vc-method takes the wider one below it.
    asked = room(methods=["speed_graph", "vc_method"], through=["P/boundary"])
    plans = run_scenario(asked, tmp_path).result["plans"]
    assert plans["vc_method"]["class"] != plans["speed_graph"]["class"]
    assert plans["vc_method"]["passes_through"] is False
    assert plans["speed_graph"]["passes_through"] is True
    assert {row["method"] for row in plans["collocation"]["seeds"]} == {"speed_graph"}
