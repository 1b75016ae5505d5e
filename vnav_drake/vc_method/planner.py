"""The vc-method from problem to plan: cells, the search among them, and the motion that follows."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from vnav_drake.plan import Plan
from vnav_drake.problem import PlanningError, Problem
from vnav_drake.vc_method.adjacency import AdjacencyGraph, Cost, build_adjacency
from vnav_drake.vc_method.cells import CellDecomposition, decompose
from vnav_drake.vc_method.critical import CriticalPoints, critical_points
from vnav_drake.vc_method.realise import Realisation, realise
from vnav_drake.vc_method.search import CellRoute, search
from vnav_drake.voronoi import VoronoiDiagram, build_diagram
from vnav_drake.voronoi.legs import NEAR

COSTS: tuple[Cost, Cost] = ("realised", "published")


@dataclass(frozen=True, kw_only=True)
class VcResult:
    """Everything that the vc-method found on the way to its motion."""

    cost: Cost  # that chose the route
    critical: CriticalPoints
    decomposition: CellDecomposition
    graph: AdjacencyGraph  # with these costs
    route: CellRoute
    other: CellRoute  # that the other cost chooses
    realisation: Realisation  # of `route`
    compute_time: float  # [s]

    @property
    def same_route(self) -> bool:
        """Whether both costs choose the same way: the same saddles in the same order."""
        return self.route.saddles == self.other.saddles


def vc_method(
    problem: Problem, diagram: VoronoiDiagram | None = None, *, cost: Cost = "realised"
) -> VcResult:
    """The vc-method of Manor 2015, Ch. 2, from critical points to a motion.

    Parameters
    ----------
    diagram : of the problem's world, to save building it.
    cost : of Type A edges; the route that the other one chooses is found too.

    Raises
    ------
    NoPathError : the robot does not fit through, or has no room at start or goal.
    PlanningError : start and goal are one point, or no smooth motion follows the route.
    ValueError : `cost` is unknown.
    """
    begin = time.perf_counter()
    if cost not in COSTS:
        raise ValueError(f"cost = {cost!r}: must be 'realised' or 'published'")
    if not problem.braking.isotropic:
        raise PlanningError("the vc-method needs a braking law that is the same in every direction")
    if np.hypot(*(problem.goal.point - problem.start.point)) <= NEAR:
        raise PlanningError("start and goal are the same point: there is no way to plan")
    if diagram is None:
        diagram = build_diagram(problem.world, problem.robot.radius)
    part = diagram.restricted(problem.robot.radius + problem.braking.margin)
    critical = critical_points(part, problem.braking)
    decomposition = decompose(critical, part)
    graph, another = (
        build_adjacency(decomposition, problem.braking, problem.robot, c) for c in (cost, _another(cost))
    )
    route = search(graph, problem)
    return VcResult(
        cost=cost,
        critical=critical,
        decomposition=decomposition,
        graph=graph,
        route=route,
        other=search(another, problem),
        realisation=realise(problem, route.curves),
        compute_time=time.perf_counter() - begin,
    )


def as_plan(result: VcResult) -> Plan:
    """The realised motion as a plan of the full model; `details` are what `result.json` tells of it.

    What of the robot it cannot meet, and where, is in `details["shortfalls"]`.
    """
    found = result.realisation
    return Plan(
        method="vc_method",
        model="full",
        trajectory=found.trajectory,
        path=found.path,
        details={
            "cost": result.cost,
            "graph": _counts(result),
            "route": _route(result.route),
            "other_route": {"cost": _another(result.cost), "same": result.same_route, **_route(result.other)},
            "arc_time": found.arc_time,
            "corners": _corners(found),
            "consistent": found.consistent,
            "shortfalls": list(found.shortfalls),
        },
    )


def plan_vc_method(
    problem: Problem, diagram: VoronoiDiagram | None = None, *, cost: Cost = "realised"
) -> Plan:
    """The vc-method's motion; parameters and errors as for `vc_method`."""
    return as_plan(vc_method(problem, diagram, cost=cost))


def _another(cost: Cost) -> Cost:
    """The other one."""
    return COSTS[1 - COSTS.index(cost)]


def _counts(result: VcResult) -> dict[str, Any]:
    """Sizes of what was searched."""
    nodes, edges = result.graph.size
    d = result.decomposition
    return {
        "saddles": len(result.critical.saddles),
        "maxima": len(result.critical.maxima),
        "stacks": len(d.maximum),
        "cells": len(d.cell_stack),
        "share_of_four": d.share_of_four,
        "nodes": nodes,
        "edges": edges,
    }


def _route(route: CellRoute) -> dict[str, Any]:
    """What a route is, along the arcs with corners and all: cost that the search added up [s], time [s]."""
    return {
        "cells": len(route.cells),
        "saddles": len(route.saddles),
        "search_cost": route.cost,
        "arc_time": route.travel_time,
        "arc_length": float(route.curves.length.sum()),
    }


def _corners(found: Realisation) -> list[dict[str, float]]:
    """One row a corner that is rounded, in order of travel."""
    rows = zip(found.point, found.turn, found.radius, found.wanted, found.speed, strict=True)
    return [
        {
            "x": float(point[0]),
            "y": float(point[1]),
            "turn": float(turn),
            "radius": float(radius),
            "wanted_radius": float(wanted),
            "speed": float(speed),
        }
        for point, turn, radius, wanted, speed in rows
    ]
