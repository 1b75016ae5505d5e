"""Seeds and their rows, and what a fault of the solver leaves of a refinement."""

from __future__ import annotations

import numpy as np
import pytest

from vnav_drake.braking import UniformBraking
from vnav_drake.collocation import Seed, plan_full, plan_variational, refine
from vnav_drake.collocation import program as program_module
from vnav_drake.collocation.refine import BUDGETS
from vnav_drake.collocation.seed import first_mesh
from vnav_drake.plan import Path
from vnav_drake.problem import End, PlanningError, Problem
from vnav_drake.robot import Robot
from vnav_drake.world import Obstacle, World

UPPER = Path.polyline([(3, 4), (6, 6.5), (9, 4)])
LOWER = Path.polyline([(3, 4), (6, 2), (9, 4)])


def pillar_room() -> Problem:
    """A point obstacle above the middle of a 12 x 8 m room: the lower way is wider."""
    world = World.build([(0, 0), (12, 0), (12, 8), (0, 8)], [Obstacle(((6.0, 4.6),), "P")])
    return Problem(
        world=world,
        robot=Robot(radius=0.4),
        braking=UniformBraking(max_braking=1.0),
        start=End(position=(3.0, 4.0)),
        goal=End(position=(9.0, 4.0)),
    )


def failing_from(monkeypatch: pytest.MonkeyPatch, call: int) -> None:
    """The solver gives up from its `call`-th call on."""
    calls = []

    def solve(*arguments, **options):
        calls.append(1)
        if len(calls) >= call:
            raise PlanningError("SNOPT could not go on: singular basis")
        return program_module.solve(*arguments, **options)

    monkeypatch.setattr("vnav_drake.collocation.refine.solve", solve)


def test_a_fault_in_a_late_round_keeps_what_earlier_rounds_found(monkeypatch):
    problem = pillar_room()
    guess = first_mesh(problem, LOWER, BUDGETS["quick"].intervals)
    whole = refine.refine(problem, guess, "variational", BUDGETS["quick"])
    assert len(whole.rounds) >= 2
    assert whole.fault == ""
    failing_from(monkeypatch, 2)
    cut = refine.refine(problem, guess, "variational", BUDGETS["quick"])
    assert cut.rounds[0].travel_time == whole.rounds[0].travel_time
    assert len(cut.rounds) == 1
    assert cut.trajectory.travel_time == cut.rounds[0].travel_time
    assert cut.fault == "round 2: SNOPT could not go on: singular basis"


def test_a_plan_says_that_its_refinement_was_cut_short(monkeypatch):
    failing_from(monkeypatch, 2)
    plan = plan_variational(pillar_room(), LOWER, effort="quick")
    assert plan.details["fault"].endswith("singular basis")
    assert len(plan.details["history"]) == 1


def test_a_fault_in_the_first_round_leaves_nothing(monkeypatch):
    failing_from(monkeypatch, 1)
    with pytest.raises(PlanningError, match=r"no safe geometry.*round 1: SNOPT could not go on"):
        plan_variational(pillar_room(), LOWER, effort="quick")


def test_each_seed_has_a_row_with_its_class():
    seeds = [Seed(UPPER, "speed_graph", homotopy_class="P/boundary"), Seed(LOWER, "voronoi_route")]
    rows = plan_variational(pillar_room(), seeds, effort="quick").details["seeds"]
    assert [row["method"] for row in rows] == ["speed_graph", "voronoi_route"]
    assert rows[0]["class"] == "P/boundary"
    assert "class" not in rows[1]
    # gaps of 4.6 m below the pillar and 3.4 m above it: half of each less 0.4 m is the best clearance there
    assert rows[1]["travel_time"] < rows[0]["travel_time"]


def test_a_lone_seed_has_the_row_of_the_whole_refinement():
    plan = plan_full(pillar_room(), [Seed(LOWER, "speed_graph", homotopy_class="direct")], effort="quick")
    (row,) = plan.details["seeds"]
    assert row["class"] == "direct"
    assert row["travel_time"] == plan.travel_time
    assert row["iterations"] == plan.details["iterations"]


def test_a_smooth_seed_of_many_arcs_gives_knots_on_itself():
    # A quarter circle of radius 3 m in 900 arcs is smooth: the mesh keeps its headings, with no short cut.
    n = 900
    bend = Path.from_arcs((3.0, 1.5), 0.0, np.full(n, 1 / 3.0), np.full(n, 1.5 * np.pi / n))
    mesh = first_mesh(pillar_room(), bend, 60)
    assert mesh.intervals == 60
    coarse = Path.from_arcs((3.0, 1.5), 0.0, np.full(90, 1 / 3.0), np.full(90, 1.5 * np.pi / 90))
    assert first_mesh(pillar_room(), coarse, 60).intervals == 90
    assert first_mesh(pillar_room(), coarse, 60, as_mesh=False).intervals == 60
    turned = np.concatenate([[0.0], np.cumsum(mesh.shares)]) * 0.5 * np.pi
    np.testing.assert_allclose(mesh.theta, turned, atol=1e-6)
    np.testing.assert_allclose(np.hypot(mesh.x - 3.0, mesh.y - 4.5), 3.0, atol=1e-6)
