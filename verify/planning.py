"""What a scenario is planned with: the methods asked for, in turn, each with what came before."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

from verify.aim import GATE
from verify.analytic import run_speed_graph
from verify.bounding import run_lower_bound
from verify.field_stage import asks_for_fields, run_fields
from verify.seeding import cold_start, compare_seeds, route_seeds, with_times
from verify.stages import Stages
from verify.vc import run_vc_method
from verify.zoning import (
    contained,
    plan_uniform,
    stand_in,
    with_zone,
    zone_seeds,
)
from vnav_drake.collocation import Seed, plan_full, plan_variational
from vnav_drake.dwa import plan_dwa
from vnav_drake.homotopy import Gates, build_gates, class_of
from vnav_drake.plan import Plan
from vnav_drake.problem import PlanningError
from vnav_drake.scenario import Scenario
from vnav_drake.voronoi import VoronoiDiagram, build_diagram
from vnav_drake.voronoi_route import plan_voronoi_route

SEEDING = ("speed_graph", "vc_method", "voronoi_route")  # methods that seed the collocation, in their order


def plan_everything(stages: Stages, overrides: Mapping[str, float]) -> None:
    """Each stage from what came before; what cannot finish is noted, and what does not need it goes on."""
    scenario, done = stages.scenario, stages.done
    problem = scenario.problem
    diagram = done.diagram = stages.run("voronoi", lambda: build_diagram(problem.world, problem.robot.radius))
    if diagram is None:
        for name in SEEDING:
            if name in scenario.plan.methods:
                stages.skip(name, "the Voronoi diagram")
        seeds: list[Seed] = []
    else:
        gates = done.gates = build_gates(diagram, problem.robot.radius + problem.braking.margin)
        _require_known(scenario, gates)
        seeds = _seeds(stages, diagram, gates)
        _optimise(stages, seeds, gates)
    if not seeds:
        stages.skip("collocation", "a seed")
        stages.skip("refined", "a seed")
    elif asks_for_fields(scenario) and "refined" in done.plans:
        base = done.plans["refined"]
        done.fields = stages.run("fields", lambda: run_fields(scenario, base))
        if done.fields is not None:
            done.keep(done.fields.plan)
    if "dwa" in scenario.plan.methods:
        done.keep(stages.run("dwa", lambda: _dwa(scenario)))
    told = stages.told("lower bound")
    done.bound = stages.run(
        "lower_bound", lambda: run_lower_bound(scenario, done.plans, overrides, told), only_for=GATE
    )


def _seeds(stages: Stages, diagram: VoronoiDiagram, gates: Gates) -> list[Seed]:
    """A seed for each class of the speed graph, the vc-method's way, and each route along Voronoi arcs.

    As far as asked for; where none gives one, the routes step in: something must seed the rest. Where the
    zone depends on the heading these methods solve a stand-in with uniform braking, and their paths are
    driven with the zone.
    """
    done, settings = stages.done, stages.scenario.plan
    problem, kind = stand_in(stages.scenario.problem)
    seeds: list[Seed] = []
    if "speed_graph" in settings.methods:
        told = stages.told("speed graph")
        asked = stages.scenario.problem
        found = stages.run(
            "speed_graph", lambda: run_speed_graph(problem, diagram, gates, settings, told, driven=asked)
        )
        if found is not None:
            done.analytic = found
            _keep(stages, found.plan, kind)
            seeds += found.seeds
    if "vc_method" in settings.methods:
        vc = done.vc = stages.run("vc_method", lambda: run_vc_method(problem, diagram, gates, settings))
        if vc is not None:
            _keep(stages, vc.plan, kind)
            seeds += [] if vc.seed is None else [vc.seed]
    if "voronoi_route" in settings.methods or not seeds:
        route = stages.run("voronoi_route", lambda: plan_voronoi_route(problem, diagram))
        if route is not None:
            _keep(stages, route, kind)
            most, through = settings.homotopy_classes, settings.through
            seeds += (
                stages.run("seeds", lambda: route_seeds(problem, diagram, gates, route, most, through)) or []
            )
    return seeds


def _keep(stages: Stages, plan: Plan, kind: str) -> None:
    """Keep an analytic plan as it drives with the zone; its path is a seed even where it cannot."""
    try:
        stages.done.keep(with_zone(stages.scenario.problem, plan, kind))
    except PlanningError as error:
        stages.say(f"{stages.scenario.name}: {plan.method} has no motion with the braking zone: {error}")


def _optimise(stages: Stages, seeds: Sequence[Seed], gates: Gates) -> None:
    """The collocation of both models, where there are seeds; seeds of several methods are compared.

    The comparison has a cold start too, where any way will do. A zone that depends on the heading is compared
    with uniform braking, which gives a seed more; without a disc in it, it has no variational model.
    """
    if not seeds:
        return
    scenario, done = stages.scenario, stages.done
    problem, effort = scenario.problem, scenario.plan.effort
    named = partial(class_of, gates)
    compared = effort == "full" and len({seed.method for seed in seeds}) > 1
    uniform: Plan | None = None
    if problem.zone is not None:
        uniform = done.keep(
            stages.run("uniform", lambda: plan_uniform(problem, seeds, effort, stages.told("uniform")))
        )
    elif compared and not scenario.plan.through:
        seeds = [*seeds, cold_start(problem)]
    best: Plan | None = None
    if problem.has_variational_optimum:
        told = stages.told("collocation")
        best = done.keep(
            stages.run(
                "collocation",
                lambda: plan_variational(problem, seeds, effort=effort, progress=told, class_of=named),
            )
        )
    if best is not None and compared and problem.zone is None:
        found, told = best, stages.told("seeds compared")
        rows = stages.run(
            "seed_comparison", lambda: compare_seeds(problem, seeds, found, gates, effort, told)
        )
        done.comparison = rows or []

    def refine() -> Plan:
        starts = seeds if best is None else with_times(seeds, best, gates)
        if problem.zone is not None:
            starts = zone_seeds(starts, uniform, named)
        return plan_full(problem, starts, effort=effort, progress=stages.told("refined"), class_of=named)

    done.keep(stages.run("refined", refine))


def _dwa(scenario: Scenario) -> Plan:
    """The run of the dynamic window approach, whether or not it reaches the goal."""
    settings = scenario.plan.dwa
    return plan_dwa(
        contained(scenario.problem), weights=settings.weights, window=settings.window, step=settings.step
    ).plan


def _require_known(scenario: Scenario, gates: Gates) -> None:
    for i, token in enumerate(scenario.plan.through):
        try:
            gates.matches((), (token,))
        except ValueError as error:
            raise scenario.error(f"plan.through[{i}]", str(error)) from error
