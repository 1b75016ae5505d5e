"""The best homotopy classes: each route of the graph refined to the optimum of its class, and ranked."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vnav_drake.homotopy import Gates, word_of
from vnav_drake.plan import Path
from vnav_drake.problem import PlanningError, Problem
from vnav_drake.speed_graph.geometry import Pieces, arc_path, polyline, sampled_pieces
from vnav_drake.speed_graph.initial import structure_of
from vnav_drake.speed_graph.newton import Iteration
from vnav_drake.speed_graph.optimum import CLASS, POINT, RESIDUAL, ClassSolver, Optimum
from vnav_drake.speed_graph.route import Route

Array = NDArray[np.float64]
Search = Callable[[int], Sequence[Route]]  # the k best routes of distinct classes
Say = Callable[[str], None]

SPARE = 2  # routes refined beyond those asked for, before the order is looked at
DOUBT = 1.5  # the graph may overestimate an unseen class by this much more than any class seen
SAME = 1e-9  # relative: times that differ by less are equal
MOST = 4  # times as many routes as classes asked for are refined at most


@dataclass(frozen=True)
class ClassOptimum:
    """The fastest path of one homotopy class.

    When it is not `certified`, `failed` names the conditions that do not hold; it is then a path of the
    class all the same, and `travel_time - optimality_bound` still a lower bound, if a loose one.
    """

    rank: int  # from 1, by travel time
    name: str  # of the class, see `vnav_drake.homotopy`
    word: tuple[int, ...]
    graph_time: float  # [s], of the best route of this class in the graph
    travel_time: float  # [s], exact
    length: float  # [m]
    optimality_bound: float  # [s]
    certified: bool
    failed: tuple[str, ...]
    path: Path
    points: Array  # (n, 2) [m]
    stuck: tuple[Array, ...]  # (k, 2) [m] each: stretches on Voronoi arcs
    history: tuple[Iteration, ...]


@dataclass(frozen=True)
class Ranking:
    """The best classes, and whether another one may belong among them."""

    classes: tuple[ClassOptimum, ...]
    refined: int  # routes
    certain: (
        bool  # no class left out can be among these, if the graph overestimates it no more than `DOUBT` says
    )
    notes: tuple[str, ...]


def rank_classes(
    problem: Problem, solver: ClassSolver, gates: Gates, search: Search, count: int, say: Say
) -> Ranking:
    """The `count` fastest classes by the travel time of their optima.

    Routes are refined in the order of their graph times. That order is not the final one: refining stops
    when the next route, even if the graph overestimates it more than all seen, cannot be among the best.
    """
    wanted, routes = count + SPARE, list(search(count + SPARE))
    done: list[ClassOptimum] = []
    while True:
        for i, route in enumerate(routes[len(done) :], start=len(done)):
            say(f"class {i + 1} of {len(routes)}")
            done.append(refine(problem, solver, gates, route))
        attained = sorted((c for c in done if POINT not in c.failed), key=lambda c: c.travel_time)
        best = attained[:count]
        sure = [c for c in attained if c.certified and c.graph_time > 0.0]
        excess = max((1.0 - c.travel_time / c.graph_time for c in sure), default=1.0)
        # no class beyond the routes is faster than `known`
        known = routes[-1].time * (1.0 - DOUBT * min(max(excess, 0.0), 1.0 / DOUBT))
        exhausted = len(routes) < wanted or len(routes) >= MOST * count
        certain = _in_order(attained, count) and (
            len(routes) < wanted or (bool(best) and best[-1].travel_time <= known)
        )
        if exhausted or (certain and len(best) == count):
            break
        wanted = min(2 * wanted, MOST * count)
        routes = list(search(wanted))
    if not best:
        raise PlanningError(
            "every class winds round a point obstacle, which a point robot can touch but not pass"
        )
    notes = [] if certain else ["a class that the graph ranks lower may be among the best"]
    if len(attained) < len(done):
        notes.append(
            f"{len(done) - len(attained)} classes that wind round a point obstacle have no fastest path"
        )
    ranked = tuple(replace(c, rank=i) for i, c in enumerate(best, start=1))
    for c in ranked:
        if not c.certified:
            notes.append(f"class {c.rank} ({c.name}) is not certified: {', '.join(c.failed)}")
    return Ranking(ranked, len(done), certain, tuple(notes))


def _in_order(classes: list[ClassOptimum], count: int) -> bool:
    """Whether the first `count` classes, sorted by time, keep their order whatever the bounds leave open."""
    return all(
        classes[i].travel_time <= other.travel_time - other.optimality_bound + SAME * other.travel_time
        for j, other in enumerate(classes)
        for i in range(min(j, count))
        if not other.certified
    )


def refine(problem: Problem, solver: ClassSolver, gates: Gates, route: Route) -> ClassOptimum:
    """The optimum of a route's class; the route itself, with its bound, where none could be certified."""
    start = structure_of(problem, solver.cut, solver.chart, route)
    found = solver.optimum(start)
    pieces = sampled_pieces(solver.solver, found.state)
    path = arc_path(found.state, pieces)
    failed = found.failed
    if POINT not in failed and word_of(gates, path) != route.word:
        failed = (*failed, CLASS)
    if failed and POINT not in failed:
        as_found = solver.as_it_is(start)
        if as_found.time < found.time or failed != found.failed or found.unsafe:
            # what is worth reporting is a path of this class that stays in its cells
            found = replace(as_found, history=found.history, rounds=found.rounds)
            failed = found.failed or (RESIDUAL,)
            pieces = sampled_pieces(solver.solver, found.state)
            path = arc_path(found.state, pieces)
    return ClassOptimum(
        rank=0,
        name=gates.name(route.word),
        word=route.word,
        graph_time=route.time,
        travel_time=found.time,
        length=path.length,
        optimality_bound=found.time if found.unsafe else found.bound,
        certified=not failed,
        failed=failed,
        path=path,
        points=polyline(pieces),
        stuck=_stuck(found, pieces),
        history=found.history,
    )


def _stuck(found: Optimum, pieces: Pieces) -> tuple[Array, ...]:
    """Stretches (k, 2) [m] along Voronoi arcs, of more than rounding."""
    both = zip(found.state.structure.pieces, pieces, strict=True)
    rides = [points for piece, (points, _) in both if piece.is_ride]
    return tuple(points for points in rides if np.hypot(*(points[-1] - points[0])) > 1e-9)
