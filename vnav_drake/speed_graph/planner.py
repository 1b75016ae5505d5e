"""The speed graph of a problem, its best classes, and the plan that follows from them."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from vnav_drake.homotopy import Gates, build_gates
from vnav_drake.plan import Plan
from vnav_drake.problem import PlanningError, Problem
from vnav_drake.speed_graph.chart import Chart
from vnav_drake.speed_graph.classes import ClassOptimum, Say, rank_classes
from vnav_drake.speed_graph.optimum import ClassSolver
from vnav_drake.speed_graph.published import PublishedGraph, build_published, k_best_published
from vnav_drake.speed_graph.sampled import SampledGraph, build_sampled, k_best_classes
from vnav_drake.speed_profile import fastest_profile
from vnav_drake.voronoi import VoronoiDiagram, build_diagram

NEAR = 1e-9  # [m]: start and goal this near are one point


@dataclass(frozen=True)
class SpeedGraphResult:
    """The graphs of a problem and its best homotopy classes, fastest first."""

    gates: Gates
    sampled: SampledGraph
    published: PublishedGraph | None  # built when it is what ranks the classes, or asked for
    ranked_by: Literal["sampled", "published"]
    classes: tuple[ClassOptimum, ...]
    refined: int  # routes that were refined to find them
    certain: bool  # whether their order and number are, see `Ranking`
    compute_time: float  # [s]
    notes: tuple[str, ...]


def speed_graph(
    problem: Problem,
    diagram: VoronoiDiagram | None = None,
    *,
    classes: int = 6,
    graph: Literal["sampled", "published"] = "sampled",
    through: Sequence[str] = (),
    with_published: bool = True,
    progress: Say | None = None,
) -> SpeedGraphResult:
    """The `classes` fastest homotopy classes, each with its fastest path (Manor 2015, ch. 3).

    Parameters
    ----------
    diagram : of the problem's world, to save building it.
    graph : which graph the classes are searched in.
    through : tokens of gates that all classes must cross in this order, such as "O4/O6".
    with_published : whether the published graph is built although another one ranks the classes.

    Raises
    ------
    NoPathError : the robot does not fit through, or has no room at start or goal.
    NoClassError : no class crosses the gates of `through`.
    PlanningError : the ends are one point, or the braking law is not isotropic.
    ValueError : `classes` is no positive whole number, `graph` is unknown, or a token names no gate.
    """
    begin = time.perf_counter()
    say: Say = progress or (lambda _text: None)
    if not isinstance(classes, int) or classes < 1:
        raise ValueError(f"classes = {classes!r}: must be a whole number of at least 1")
    if graph not in ("sampled", "published"):
        raise ValueError(f"graph = {graph!r}: must be 'sampled' or 'published'")
    if not problem.braking.isotropic:
        raise PlanningError("the speed graph needs a braking law that is the same in every direction")
    if np.hypot(*(problem.goal.point - problem.start.point)) <= NEAR:
        raise PlanningError("start and goal are the same point: there is no way to plan")
    radius = problem.robot.radius
    if diagram is None:
        diagram = build_diagram(problem.world, radius)
    say("graph")
    level = radius + problem.braking.margin
    gates = build_gates(diagram.restricted(level), level)
    sampled = build_sampled(problem, diagram, gates)
    published = build_published(sampled) if with_published or graph == "published" else None
    solver = ClassSolver(sampled.diagram, Chart(problem.world, problem.braking, radius))
    ranked_by_published = published if graph == "published" else None
    ranking = rank_classes(
        problem,
        solver,
        gates,
        lambda k: (
            k_best_classes(sampled, k, through)
            if ranked_by_published is None
            else k_best_published(ranked_by_published, k, through)
        ),
        classes,
        say,
    )
    return SpeedGraphResult(
        gates,
        sampled,
        published,
        graph,
        ranking.classes,
        ranking.refined,
        ranking.certain,
        time.perf_counter() - begin,
        (*diagram.notes, *ranking.notes),
    )


def as_plan(problem: Problem, result: SpeedGraphResult) -> Plan:
    """The fastest class as a plan of the variational model, both ends at the safe speed."""
    best = result.classes[0]
    graph = result.sampled if result.ranked_by == "sampled" else result.published
    counted = {} if graph is None else {"nodes": graph.node_count, "edges": len(graph.edges)}
    return Plan(
        method="speed_graph",
        model="variational",
        trajectory=fastest_profile(problem, best.path, model="variational"),
        path=best.path,
        details={
            "exact_time": best.travel_time,
            "optimality_bound": best.optimality_bound,
            "class": best.name,
            "certified": best.certified,
            "compute_time": result.compute_time,
            "graph": {"kind": result.ranked_by, **counted},
            "classes": [_row(c) for c in result.classes],
            "routes_refined": result.refined,
            "order_certain": result.certain,
            "notes": result.notes,
        },
    )


def plan_speed_graph(
    problem: Problem,
    diagram: VoronoiDiagram | None = None,
    *,
    classes: int = 6,
    graph: Literal["sampled", "published"] = "sampled",
    through: Sequence[str] = (),
    progress: Say | None = None,
) -> Plan:
    """The safe time-optimal path of the fastest homotopy class; parameters and errors as in `speed_graph`.

    `details` holds `exact_time` [s] (independent of the rows), `optimality_bound` [s], `class`, `certified`,
    `graph` (kind, nodes, edges), `classes` (a row each, fastest first), `compute_time` [s] and `notes`.
    """
    result = speed_graph(
        problem,
        diagram,
        classes=classes,
        graph=graph,
        through=through,
        with_published=False,
        progress=progress,
    )
    return as_plan(problem, result)


def _row(c: ClassOptimum) -> dict[str, object]:
    """A class as in result.json."""
    row: dict[str, object] = {
        "rank": c.rank,
        "class": c.name,
        "graph_time": c.graph_time,
        "travel_time": c.travel_time,
        "length": c.length,
        "optimality_bound": c.optimality_bound,
        "certified": c.certified,
        "iterations": len(c.history),
    }
    return row if c.certified else row | {"failed": list(c.failed)}
