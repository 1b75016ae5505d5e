"""What the collocation starts from: paths of the analytic methods, each with the name of its class."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from vnav_drake.collocation import Seed
from vnav_drake.homotopy import Gates, class_of, word_of
from vnav_drake.plan import Path, Plan
from vnav_drake.problem import NoPathError, PlanningError, Problem
from vnav_drake.voronoi import VoronoiDiagram
from vnav_drake.voronoi_route import k_best_routes

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


def with_times(seeds: Sequence[Seed], plan: Plan, gates: Gates) -> list[Seed]:
    """The variational optimum first, then the seeds with what they led to."""
    rows = plan.details["seeds"]
    known = [replace(seed, travel_time=row.get("travel_time")) for seed, row in zip(seeds, rows, strict=True)]
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
