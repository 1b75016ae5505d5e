"""Problems for tests of class optima, and what can be said of their paths without the planner's code."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import shapely
from numpy.polynomial import chebyshev
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from tests.test_speed_graph_graphs import problem_in
from tests.worlds import distance_by_shapely, geometry, moved_world
from vnav_drake.homotopy import reduced
from vnav_drake.plan import Path
from vnav_drake.problem import End, Problem
from vnav_drake.speed_graph.chart import Chart, along
from vnav_drake.speed_graph.classes import ClassOptimum, refine
from vnav_drake.speed_graph.geometry import sampled_pieces
from vnav_drake.speed_graph.initial import structure_of
from vnav_drake.speed_graph.optimum import ClassSolver, Optimum
from vnav_drake.speed_graph.route import Route
from vnav_drake.speed_graph.sampled import SampledGraph, build_sampled
from vnav_drake.voronoi import build_diagram
from vnav_drake.world import Obstacle, World

Array = NDArray[np.float64]

# (14, 2) [m]: a comb with three bays of different depth, and a slanted floor
COMB = (
    (0.0, 0.0),
    (12.0, -1.0),
    (12.0, 10.0),
    (9.0, 10.0),
    (9.0, 4.0),
    (8.0, 4.5),
    (8.0, 9.0),
    (5.0, 9.0),
    (4.5, 3.5),
    (4.0, 3.5),
    (3.5, 10.0),
    (0.0, 10.0),
)
NODE, WEIGHT = np.polynomial.legendre.leggauss(10)
TIGHT = (1e-5, 1e-3, 1e-1)  # [m] between obstacles that nearly touch


def tight_problem(seed: int) -> Problem:
    """Obstacles that nearly touch in pairs, every other one in a room with a bite out of its side."""
    rng = np.random.default_rng([seed, 1])
    room = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]])
    if seed % 2:
        room = np.concatenate([room[:3], [[7.0, 10.0], [6.0, rng.uniform(5.0, 8.0)], [4.5, 10.0]], room[3:]])
    hall = shapely.Polygon(room).buffer(-0.02, join_style="mitre")
    shapes: list[Array] = []
    while len(shapes) < 8:
        angle = np.sort(rng.uniform(0.0, 2.0 * math.pi, rng.integers(1, 7)))
        ring = np.column_stack([np.cos(angle), np.sin(angle)]) * rng.uniform(0.2, 1.0, (len(angle), 1))
        shape = rng.uniform(0.5, 9.5, 2) + ring
        if len(shapes) % 2:
            shape = _beside(shapes[-1], shape, float(rng.choice(TIGHT)))
        solid = geometry(Obstacle(tuple(map(tuple, shape.tolist()))))
        if solid.is_valid and hall.covers(solid) and (len(shape) < 3 or solid.area > 1e-3):
            shapes.append(shape)
    world = World.build(
        room, [Obstacle(tuple(map(tuple, s.tolist())), f"O{i}") for i, s in enumerate(shapes)]
    )
    radius = float(rng.choice([0.0, 0.1, 0.3]))
    places = rng.uniform(0.0, 10.0, (400, 2))
    places = places[world.distance(places) > radius + 0.05]
    far = np.flatnonzero(np.hypot(*(places - places[0]).T) > 5.0)
    return problem_in(world, tuple(places[0].tolist()), tuple(places[far[0]].tolist()), radius)


def _beside(old: Array, new: Array, gap: float) -> Array:
    """The new shape moved towards the old one until `gap` [m] is left between their nearest points."""
    solids = [geometry(Obstacle(tuple(map(tuple, s.tolist())))) for s in (old, new)]
    (x0, y0), (x1, y1) = shapely.get_coordinates(shapely.shortest_line(*solids))
    distance = math.hypot(x1 - x0, y1 - y0)
    return new - np.array([x1 - x0, y1 - y0]) * (1.0 - gap / distance) if distance > 0.0 else new


# -- what is known of a path without the planner


def clearance_of(problem: Problem, points: Array) -> Array:
    """Clearance (n,) [m] at points (n, 2), by Shapely from the obstacles as given."""
    world = problem.world
    boundary = shapely.get_coordinates(world.boundary.exterior)[:-1]
    return distance_by_shapely(boundary, list(world.obstacles), points) - problem.robot.radius


def safe_speed_of(problem: Problem, clearance: Array) -> Array:
    """Root of v t_r + v^2 / (2 a_b) + m = d (Manor 2015, eq. (3.13), with lag and margin), at most v_max."""
    law = problem.braking
    lag, room = law.max_braking * law.reaction_time, np.maximum(clearance - law.margin, 0.0)
    return np.minimum(np.sqrt(lag**2 + 2.0 * law.max_braking * room) - lag, law.max_speed)


def time_along(problem: Problem, path: Path) -> float:
    """Integral of ds / V [s] over circular arcs, by Gauss's rule on each.

    With s = h (1 - cos(pi t)) / 2 on an arc of length h the integrand stays smooth where V = sqrt(2 a s).
    """
    ends = clearance_of(problem, np.column_stack([path.x, path.y]))
    room = np.maximum(np.minimum(ends[1:], ends[:-1]), 1e-3)  # V changes over as short a way
    path = path.subdivided(np.minimum(np.ceil(path.piece_length / room), 400).astype(np.int64))
    t = 0.5 + 0.5 * NODE
    ends = np.concatenate([[0.0], np.cumsum(path.piece_length)])
    s = ends[:-1, None] + path.piece_length[:, None] * (0.5 - 0.5 * np.cos(np.pi * t))
    x, y, _, _ = path.at(s)
    speed = safe_speed_of(problem, clearance_of(problem, np.column_stack([x.ravel(), y.ravel()])))
    rate = 0.5 * np.pi * np.sin(np.pi * t) * 0.5 * WEIGHT
    return float((path.piece_length[:, None] * rate / speed.reshape(s.shape)).sum())


def _along_polyline(problem: Problem, points: Array) -> float:
    step = np.diff(points, axis=0)
    node, weight = np.polynomial.legendre.leggauss(3)
    places = points[:-1, None] + step[:, None] * (0.5 + 0.5 * node)[:, None]
    speed = safe_speed_of(problem, clearance_of(problem, places.reshape(-1, 2))).reshape(len(step), -1)
    return float((np.hypot(*step.T) * ((1.0 / speed) @ (0.5 * weight))).sum())


@dataclass(frozen=True)
class Smooth:
    """A piece of a path as Chebyshev series, from sample points alone."""

    points: Array  # (k, 2) [m], at Chebyshev-Lobatto points of some parameter in [-1, 1]
    is_ride: bool = False  # then evenly spaced along a straight line or a parabola's tangent at its vertex

    @cached_property
    def _series(self) -> Array:
        if self.is_ride:
            return chebyshev.chebfit(np.linspace(-1.0, 1.0, len(self.points)), self.points, 2)
        nodes = -np.cos(np.pi * np.arange(len(self.points)) / (len(self.points) - 1))
        return chebyshev.chebfit(nodes, self.points, len(self.points) - 1)

    @property
    def length(self) -> float:
        """[m], of the polyline."""
        return float(np.hypot(*np.diff(self.points, axis=0).T).sum())

    def at(self, z: ArrayLike, order: int = 0) -> Array:
        """Derivatives (n, 2) of the place by z at z (n,) in [-1, 1]."""
        return chebyshev.chebval(np.asarray(z), chebyshev.chebder(self._series, order)).T

    def headings(self) -> tuple[float, float]:
        """[rad] at both ends."""
        d = self.at([-1.0, 1.0], 1)
        return float(np.arctan2(d[0, 1], d[0, 0])), float(np.arctan2(d[1, 1], d[1, 0]))


# -- the planner's solver, from any start


@dataclass(frozen=True)
class Case:
    """One problem with all that solving its classes needs."""

    problem: Problem
    graph: SampledGraph
    solver: ClassSolver

    @classmethod
    def of(cls, problem: Problem, spacing: float | None = None, like: Case | None = None) -> Case:
        """A graph with another spacing keeps the gates of the case that it is `like`."""
        diagram = build_diagram(problem.world, problem.robot.radius)
        graph = build_sampled(problem, diagram, None if like is None else like.graph.gates, spacing)
        return cls(
            problem,
            graph,
            ClassSolver(graph.diagram, Chart(problem.world, problem.braking, problem.robot.radius)),
        )

    def optimum(self, route: Route) -> Optimum:
        """What the solver makes of a route."""
        return self.solver.optimum(structure_of(self.problem, self.solver.cut, self.solver.chart, route))

    def time_by_polylines(self, found: Optimum, count: int = 1500) -> float:
        """Integral of ds / V [s] over polylines of `count` and 2 `count` sides a leg, extrapolated to none.

        Needs no smoothness but that of the path itself: the error of a polyline falls as its sides squared.
        """
        cell = np.array([found.state.structure.pieces[i].cell for i in found.state.leg], dtype=np.int64)
        time = []
        for sides in (count, 2 * count):
            points, _ = along(self.solver.chart, cell, found.state.flight, np.linspace(0.0, 1.0, sides + 1))
            time.append(sum(_along_polyline(self.problem, leg) for leg in points))
            rides = [piece for piece in self.pieces(found) if piece.is_ride and piece.length > 0.0]
            time[-1] += sum(
                _along_polyline(self.problem, ride.at(np.linspace(-1.0, 1.0, sides + 1))) for ride in rides
            )
        return float((4.0 * time[1] - time[0]) / 3.0)

    def refined(self, route: Route) -> ClassOptimum:
        """The class optimum of a route."""
        return refine(self.problem, self.solver, self.graph.gates, route)

    def pieces(self, found: Optimum) -> list[Smooth]:
        """Its pieces, from their sample points."""
        sampled = sampled_pieces(self.solver.solver, found.state)
        pieces = zip(found.state.structure.pieces, sampled, strict=True)
        return [Smooth(points, piece.is_ride) for piece, (points, _) in pieces]

    def legs(self, found: Optimum) -> list[Smooth]:
        """Its legs through cells."""
        return [piece for piece in self.pieces(found) if not piece.is_ride]


def voronoi_start(case: Case) -> Route:
    """The fastest path that keeps to Voronoi arcs but for its first and last leg.

    It has kinks at all nodes and need not even be in the best class: a poor start, with no sample in a cell.
    """
    graph, edges = case.graph, case.graph.edges
    ends = (graph.start, graph.goal)
    on_arc = (graph.curve >= 0) & graph.diagram.primary[np.maximum(graph.curve, 0)]
    keep = np.flatnonzero(on_arc | np.isin(edges.tail, ends) | np.isin(edges.head, ends))
    tail, head = edges.tail[keep], edges.head[keep]
    direct = (tail == graph.start) & (head == graph.goal) | (tail == graph.goal) & (head == graph.start)
    weight = edges.time[keep] + np.where(direct, 1e3, 0.0) + 1e-12
    order = np.lexsort([weight, np.maximum(tail, head), np.minimum(tail, head)])
    pair = np.column_stack([np.minimum(tail, head), np.maximum(tail, head)])[order]
    first = np.append(True, (np.diff(pair, axis=0) != 0).any(axis=1))
    keep, pair, weight = keep[order][first], pair[first], weight[order][first]
    count = graph.node_count
    matrix = csr_array((weight, pair.T), shape=(count, count))
    _, before = dijkstra(matrix, directed=False, indices=graph.start, return_predecessors=True)
    row = {tuple(p): int(k) for p, k in zip(pair.tolist(), keep, strict=True)}
    node, used, forward = graph.goal, list[int](), list[bool]()
    while node != graph.start:
        last = int(before[node])
        edge = row[min(last, node), max(last, node)]
        used.append(edge)
        forward.append(int(edges.tail[edge]) == last)
        node = last
    used.reverse()
    forward.reverse()
    letters = [g for e, f in zip(used, forward, strict=True) for g in edges.letters_of(e, f)]
    time = float(edges.time[used].sum())
    return graph.route(time, reduced(letters), np.array(used), np.array(forward))


# -- the same problem elsewhere


def moved_problem(problem: Problem, angle: float, shift: ArrayLike, mirror: bool = False) -> Problem:
    """The problem mirrored at the x axis if asked, turned about the origin, then shifted."""
    flip = np.array([1.0, -1.0 if mirror else 1.0])
    cosine, sine = math.cos(angle), math.sin(angle)
    turn = np.array([[cosine, sine], [-sine, cosine]])
    obstacles = [
        replace(o, vertices=tuple(map(tuple, (np.array(o.vertices) * flip).tolist())))
        for o in problem.world.obstacles
    ]
    boundary = shapely.get_coordinates(problem.world.boundary.exterior)[:-1] * flip
    start, goal = (
        End(position=tuple((np.array(e.position) * flip @ turn + np.asarray(shift)).tolist()))
        for e in (problem.start, problem.goal)
    )
    world = moved_world(boundary, obstacles, angle, shift)
    return replace(problem, world=world, start=start, goal=goal)


def swapped(problem: Problem) -> Problem:
    """From goal to start."""
    return replace(problem, start=problem.goal, goal=problem.start)
