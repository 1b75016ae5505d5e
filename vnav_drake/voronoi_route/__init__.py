"""The first planner: the fastest route along the Voronoi arcs, with exact times.

Start and goal are joined to the diagram by retraction (straight away from their nearest feature);
the straight way between them, where it is free, competes with the routes.
"""

from __future__ import annotations

import itertools
import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vnav_drake.plan import Path, Plan
from vnav_drake.problem import PlanningError, Problem
from vnav_drake.speed_profile import fastest_profile
from vnav_drake.voronoi import VoronoiDiagram, build_diagram, travel_time
from vnav_drake.voronoi.legs import NEAR, straight_leg
from vnav_drake.voronoi.network import Network, build_network, no_path
from vnav_drake.voronoi.paths import route_path
from vnav_drake.voronoi_route.ends import end_cost_bound, time_with_ends
from vnav_drake.voronoi_route.search import Route, fastest_route, routes

__all__ = ["k_best_routes", "plan_voronoi_route"]

Array = NDArray[np.float64]

MOST_ROUTES = 400  # looked at for ends that are not safe; the bound on the ends' cost stops far earlier


@dataclass(frozen=True)
class _Choice:
    route: Route
    exact_time: float  # [s], with the ends' speeds
    tried: int  # routes


def plan_voronoi_route(problem: Problem, diagram: VoronoiDiagram | None = None) -> Plan:
    """The fastest route along Voronoi arcs, end speeds as the problem asks.

    Parameters
    ----------
    diagram : of the problem's world, to save building it.

    Returns
    -------
    Plan of the variational model; `details` holds `exact_time` [s] (independent of the rows), `compute_time`
    [s], `arcs` and `nodes` of the diagram where the robot fits, `routes_tried`, `direct` (whether the
    straight way won) and `notes` of the diagram.

    Raises
    ------
    NoPathError : the robot does not fit through; the message names the widest way.
    """
    begin = time.perf_counter()
    if np.hypot(*(problem.goal.point - problem.start.point)) <= NEAR:
        raise PlanningError("start and goal are the same point: there is no way to plan")
    if diagram is None:
        diagram = build_diagram(problem.world, problem.robot.radius)
    level = problem.robot.radius + problem.braking.margin
    network = build_network(problem, diagram, level)
    along, direct = _along_arcs(problem, network), _straight(problem, diagram, level)
    choices = [choice for choice in (along, direct) if choice is not None]
    if not choices:
        raise no_path(problem, diagram, network, level)
    best = min(choices, key=lambda choice: choice.exact_time)
    path = _path(problem, best.route)
    trajectory = fastest_profile(problem, path, model="variational", ends="problem")
    part = diagram.restricted(level)
    return Plan(
        method="voronoi_route",
        model="variational",
        trajectory=trajectory,
        path=path,
        details={
            "exact_time": best.exact_time,
            "compute_time": time.perf_counter() - begin,
            "arcs": len(part.arcs),
            "nodes": len(part.nodes),
            "routes_tried": sum(choice.tried for choice in choices),
            "direct": best is direct,
            "notes": diagram.notes,
        },
    )


def k_best_routes(problem: Problem, diagram: VoronoiDiagram | None, k: int) -> list[Path]:
    """The k fastest distinct simple routes along Voronoi arcs at the safe speed, fastest first.

    Fewer when there are fewer. The straight way is not among them.

    Raises
    ------
    NoPathError : there is no route at all.
    """
    if diagram is None:
        diagram = build_diagram(problem.world, problem.robot.radius)
    level = problem.robot.radius + problem.braking.margin
    network = build_network(problem, diagram, level)
    found = list(itertools.islice(routes(network), k))
    if not found and fastest_route(network) is None:
        raise no_path(problem, diagram, network, level)
    return [_path(problem, route) for route in found]


def _along_arcs(problem: Problem, network: Network) -> _Choice | None:
    """The fastest route with the ends' speeds; None when there is no route."""
    if problem.start.fixed_speed is None and problem.goal.fixed_speed is None:
        route = fastest_route(network)
        return None if route is None else _Choice(route, route.time, 1)
    best: tuple[float, Route] | None = None
    tried = 0
    separation = float(np.hypot(*(problem.goal.point - problem.start.point)))
    bound = end_cost_bound(problem, separation)
    for route in itertools.islice(routes(network), MOST_ROUTES):
        if best is not None and route.time + bound >= best[0]:
            break
        tried += 1
        exact = time_with_ends(problem, route.curves)
        if best is None or exact < best[0]:
            best = exact, route
    return None if best is None else _Choice(best[1], best[0], tried)


def _straight(problem: Problem, diagram: VoronoiDiagram, level: float) -> _Choice | None:
    """The straight way, where it is free and takes a finite time."""
    leg = straight_leg(diagram, problem.start.point, problem.goal.point, level)
    if leg is None:
        return None
    safe = float(travel_time(leg, problem.braking, problem.robot.radius).sum())
    if not np.isfinite(safe):
        return None
    return _Choice(Route(leg, safe), time_with_ends(problem, leg), 1)


def _path(problem: Problem, route: Route) -> Path:
    return route_path(route.curves, problem.start.point, problem.goal.point)
