"""The vc-method as a stage: its plan, its seed, and routes to compare it with."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vnav_drake.collocation import Seed
from vnav_drake.homotopy import Gates, class_of, word_of
from vnav_drake.plan import Plan
from vnav_drake.problem import Problem
from vnav_drake.scenario import PlanSettings
from vnav_drake.vc_method import VcResult, arc_minimum_time, as_plan, vc_method
from vnav_drake.voronoi import Curves, VoronoiDiagram, shortest_route
from vnav_drake.voronoi.paths import route_path


@dataclass(frozen=True, kw_only=True)
class VcStage:
    """What the vc-method gave."""

    plan: Plan
    seed: Seed | None  # none where its way is not among those asked for
    result: VcResult


def run_vc_method(problem: Problem, diagram: VoronoiDiagram, gates: Gates, settings: PlanSettings) -> VcStage:
    """Plan with the vc-method; its motion is a seed where it passes the gates asked for.

    Raises
    ------
    PlanningError : the method gave no answer.
    NoPathError : there is no path for this robot.
    """
    result = vc_method(problem, diagram, cost=settings.edge_cost)
    plan, path = as_plan(result), result.realisation.path
    other = {**plan.details["other_route"], "class": _class(problem, gates, result.other.curves)}
    shortest = _shortest(problem, diagram, gates)
    details = {**plan.details, "other_route": other, "shortest_route": shortest}
    fits = gates.matches(word_of(gates, path), settings.through)
    seed = Seed(path, plan.method, homotopy_class=class_of(gates, path), far=True)
    return VcStage(plan=replace(plan, details=details), seed=seed if fits else None, result=result)


def _shortest(problem: Problem, diagram: VoronoiDiagram, gates: Gates) -> dict[str, Any]:
    """The shortest route along Voronoi arcs (Manor 2015, Sec. 2.7.1), as fast as it can be driven."""
    curves = shortest_route(problem, diagram)
    free = np.inf
    start, goal = (
        free if end.fixed_speed is None else end.fixed_speed for end in (problem.start, problem.goal)
    )
    row = np.zeros(len(curves), dtype=np.int64)
    time = arc_minimum_time(curves, row, problem.braking, problem.robot, start_speed=start, end_speed=goal)
    return {
        "arc_time": float(time[0]),
        "arc_length": float(curves.length.sum()),
        "class": _class(problem, gates, curves),
    }


def _class(problem: Problem, gates: Gates, curves: Curves) -> str:
    return class_of(gates, route_path(curves, problem.start.point, problem.goal.point))
