"""What the collocation starts from: paths of the analytic methods, each with the name of its class."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from vnav_drake.collocation import Effort, Seed, plan_variational
from vnav_drake.homotopy import Gates, class_of, word_of
from vnav_drake.plan import Path, Plan
from vnav_drake.problem import NoPathError, PlanningError, Problem
from vnav_drake.voronoi import VoronoiDiagram
from vnav_drake.voronoi_route import k_best_routes

COLD_START = "cold_start"
SAME_LENGTH = 1e-6  # [m]: routes no further apart in length are one


def route_seeds(
    problem: Problem, diagram: VoronoiDiagram, gates: Gates, route: Plan, most: int, through: Sequence[str]
) -> list[Seed]:
    """The route, then the other fastest ones along Voronoi arcs; with `through`, those that pass these gates.

    Raises
    ------
    PlanningError : none of the routes looked at passes the gates.
    """
    paths = [path_of(route)]
    try:
        others = k_best_routes(problem, diagram, most)
    except NoPathError:  # the route found is the straight way, and the only one
        others = []
    for path in others:
        if all(abs(path.length - kept.length) > SAME_LENGTH for kept in paths):
            paths.append(path)
    fitting = [path for path in paths if gates.matches(word_of(gates, path), through)][:most]
    if not fitting:
        raise PlanningError(
            f"none of the {len(paths)} fastest routes passes {', '.join(through)} in this order"
        )
    return [Seed(path, route.method, homotopy_class=class_of(gates, path)) for path in fitting]


def cold_start(problem: Problem) -> Seed:
    """The straight line from start to goal, whatever stands in the way: how one begins who knows nothing."""
    return Seed(Path.polyline(np.array([problem.start.point, problem.goal.point])), COLD_START)


def compare_seeds(
    problem: Problem,
    seeds: Sequence[Seed],
    plan: Plan,
    gates: Gates,
    effort: Effort,
    progress: Callable[[str], None],
) -> list[dict[str, Any]]:
    """The variational collocation from the first seed of each method, each refined to the end on its own.

    Parameters
    ----------
    plan : what came of all seeds. It has a row for each seed's first try; where nothing safe came of that
        there is no second, and the seed that it was refined from is not refined again.

    Returns
    -------
    A row for each: `method`, `class` of what came out, `travel_time` [s], `iterations`, `rounds`,
    `intervals`; or instead of these `message`, why nothing safe came of it; and `compute_time` [s].
    """
    tried: Sequence[Mapping[str, Any]] = plan.details["seeds"]
    first: dict[str, int] = {}
    for number, seed in enumerate(seeds):
        first.setdefault(seed.method, number)
    rows: list[dict[str, Any]] = []
    for method, number in first.items():
        found = tried[number]
        if "travel_time" not in found:
            rows.append({key: found[key] for key in ("method", "message", "compute_time")})
        elif number == plan.details["refined_seed"] and len(seeds) > 1:
            row = _outcome(plan, gates)  # its first try was the first round of this
            row |= {"iterations": row["iterations"] + found["iterations"], "rounds": row["rounds"] + 1}
            seconds = found["compute_time"] + plan.details["refine_time"]
            rows.append({"method": method, **row, "compute_time": seconds})
        else:
            progress(method.replace("_", " "))
            rows.append({"method": method, **_alone(problem, seeds[number], gates, effort)})
    return rows


def _alone(problem: Problem, seed: Seed, gates: Gates, effort: Effort) -> dict[str, Any]:
    begun = time.perf_counter()
    try:
        row = _outcome(plan_variational(problem, [seed], effort=effort), gates)
    except PlanningError as error:
        row = {"message": str(error)}
    return {**row, "compute_time": time.perf_counter() - begun}


def _outcome(plan: Plan, gates: Gates) -> dict[str, Any]:
    return {
        "class": class_of(gates, plan.trajectory),
        "travel_time": plan.travel_time,
        "iterations": plan.details["iterations"],
        "rounds": len(plan.details["history"]),
        "intervals": plan.details["intervals"],
    }


def with_times(seeds: Sequence[Seed], plan: Plan, gates: Gates) -> list[Seed]:
    """The variational optimum first, then the seeds with what they led to; the cold start has had its try."""
    rows = plan.details["seeds"]
    known = [
        replace(seed, travel_time=row.get("travel_time"))
        for seed, row in zip(seeds, rows, strict=True)
        if seed.method != COLD_START
    ]
    path = path_of(plan)
    return [Seed(path, plan.method, homotopy_class=class_of(gates, path)), *known]


def path_of(plan: Plan) -> Path:
    """The geometry that a plan was made with.

    Raises
    ------
    PlanningError : it has none.
    """
    if plan.path is None:
        raise PlanningError(f"{plan.method} gave no path to start from")
    return plan.path
