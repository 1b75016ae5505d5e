"""Voronoi arcs with start and goal attached, as a weighted graph."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import breadth_first_order, connected_components, dijkstra, minimum_spanning_tree

from vnav_drake.problem import End, NoPathError, PlanningError, Problem
from vnav_drake.voronoi.curves import Curves
from vnav_drake.voronoi.diagram import VoronoiDiagram
from vnav_drake.voronoi.legs import NEAR, retraction
from vnav_drake.voronoi.times import travel_time

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


@dataclass(frozen=True)
class Network:
    """Pieces of Voronoi arcs and the legs of the ends; no two pieces join the same two vertices."""

    curves: Curves  # (m,)
    ends: Indices  # (m, 2), vertices
    time: Array  # (m,) [s]
    vertex_count: int
    start: int
    goal: int


def build_network(problem: Problem, diagram: VoronoiDiagram, level: float, timed: bool = True) -> Network:
    """Attach start and goal to the arcs at distance >= `level` [m] by retraction, and cut the arcs there.

    Raises
    ------
    NoPathError : start or goal is nearer than `level` to an obstacle or off the floor.
    """
    part = diagram.restricted(level)
    arcs, ends = part.curves.take(part.arcs), part.ends[part.arcs]
    count = len(part.nodes)
    legs: list[Curves] = []
    leg_ends: list[tuple[int, int]] = []
    cuts: list[tuple[int, float, int]] = []  # arc, parameter, vertex
    terminals = []
    for name, end in (("start", problem.start), ("goal", problem.goal)):
        demand_room(problem, name, end, level)
        leg, place = retraction(problem.world, end.point)
        arc, u, vertex = _attach(part, arcs, ends, place)
        if vertex is None:
            known = [v for i, w, v in cuts if i == arc and abs(w - u) <= NEAR]
            vertex = known[0] if known else count
            if not known:
                cuts.append((arc, u, vertex))
                count += 1
        if len(leg):
            legs.append(leg)
            leg_ends.append((count, vertex))
            vertex, count = count, count + 1
        terminals.append(vertex)
    for arc in _parallel(ends):
        cuts.append((int(arc), float(arcs.middle[arc]), count))
        count += 1
    arcs, ends = _cut(arcs, ends, cuts)
    curves = Curves.join([arcs, *legs])
    ends = np.concatenate([ends, np.array(leg_ends, dtype=np.int64).reshape(-1, 2)])
    time = travel_time(curves, problem.braking, problem.robot.radius) if timed else np.zeros(len(curves))
    return Network(curves, ends, time, count, terminals[0], terminals[1])


def demand_room(problem: Problem, name: str, end: End, level: float) -> None:
    """Raises NoPathError where the end called `name` is not free or has less than `level` [m] around it."""
    distance = float(problem.world.distance(end.point))
    if distance < level or distance <= 0.0:
        x, y = end.position
        needs = (
            f"the robot needs {level:.6g} m (radius and braking margin)" if level > 0.0 else "it must be free"
        )
        raise NoPathError(f"{name} ({x:.6g}, {y:.6g}) is {distance:.6g} m from the nearest obstacle; {needs}")


def _attach(part: VoronoiDiagram, arcs: Curves, ends: Indices, place: Array) -> tuple[int, float, int | None]:
    """Arc, parameter on it, and node when it is one, of a point on the diagram."""
    gap = np.hypot(*(part.nodes - place).T)
    node = int(np.argmin(gap)) if len(gap) else -1
    if len(gap) and gap[node] <= NEAR:
        return -1, 0.0, node
    nearest = np.inf
    if len(arcs):
        low, high = arcs.span.min(axis=1), arcs.span.max(axis=1)
        u = np.clip(np.einsum("ij,ij->i", place - arcs.origin, arcs.axis), low, high)
        miss = np.hypot(*(arcs.points(u) - place).T)
        arc = int(np.argmin(miss))
        nearest = float(miss[arc])
    tolerance = 1e-6 * part.world.diameter
    if min(nearest, float(gap.min(initial=np.inf))) > tolerance:
        raise PlanningError(f"no Voronoi arc passes through ({place[0]:.9g}, {place[1]:.9g})")
    if len(gap) and gap[node] <= nearest:
        return -1, 0.0, node
    if min(abs(u[arc] - arcs.span[arc])) <= NEAR:
        return -1, 0.0, int(ends[arc, int(np.argmin(abs(u[arc] - arcs.span[arc])))])
    return arc, float(u[arc]), None


def _parallel(ends: Indices) -> Indices:
    """All arcs but one of those that join the same two nodes."""
    _, first = np.unique(np.sort(ends, axis=1), axis=0, return_index=True)
    return np.setdiff1d(np.arange(len(ends)), first)


def _cut(arcs: Curves, ends: Indices, cuts: list[tuple[int, float, int]]) -> tuple[Curves, Indices]:
    """Arcs cut at the given parameters, each cut a vertex of its own."""
    cut_arcs = sorted({arc for arc, _, _ in cuts})
    whole = np.setdiff1d(np.arange(len(arcs)), cut_arcs)
    parts, part_ends = [arcs.take(whole)], [ends[whole]]
    for arc in cut_arcs:
        here = sorted((u, vertex) for i, u, vertex in cuts if i == arc)
        if arcs.span[arc, 0] > arcs.span[arc, 1]:
            here.reverse()
        u = np.array([arcs.span[arc, 0], *(w for w, _ in here), arcs.span[arc, 1]])
        vertex = np.array([ends[arc, 0], *(v for _, v in here), ends[arc, 1]])
        parts.append(arcs.take(np.full(len(u) - 1, arc)).cut(np.column_stack([u[:-1], u[1:]])))
        part_ends.append(np.column_stack([vertex[:-1], vertex[1:]]))
    return Curves.join(parts), np.concatenate(part_ends)


def no_path(problem: Problem, diagram: VoronoiDiagram, network: Network, level: float) -> NoPathError:
    """Why there is no way: the parts that start and goal lie in, and the widest way between them."""
    finite = np.isfinite(network.time)
    _, label = connected_components(
        _matrix(network.ends[finite], np.ones(int(finite.sum())), network.vertex_count)
    )
    (x0, y0), (x1, y1) = problem.start.position, problem.goal.position
    parts = np.unique(label[np.unique(np.append(network.ends[finite], [network.start, network.goal]))])
    rank = {int(p): i + 1 for i, p in enumerate(parts)}
    one, other = rank[int(label[network.start])], rank[int(label[network.goal])]
    where = (
        f"start ({x0:.6g}, {y0:.6g}) lies in part {one} and goal ({x1:.6g}, {y1:.6g}) in part {other}"
        f" of the {len(parts)} separate parts where the robot fits"
    )
    bottleneck = widest_way(problem, diagram)
    if bottleneck is None:
        return NoPathError(f"no path: walls separate start and goal; {where}")
    width, (x, y) = bottleneck
    need = f"the robot needs {2.0 * level:.6g} m"
    if problem.braking.margin > 0.0:
        need += f" ({2.0 * problem.robot.radius:.6g} m for its body, the rest for the braking margin)"
    if width <= level:
        tight = f"the widest way is {2.0 * width:.6g} m wide at ({x:.6g}, {y:.6g}), {need}"
    else:
        tight = f"the widest way is {2.0 * width:.6g} m wide at ({x:.6g}, {y:.6g})"
    return NoPathError(f"no path: {tight}; {where}")


def widest_way(problem: Problem, diagram: VoronoiDiagram) -> tuple[float, Array] | None:
    """Greatest half-width [m] of a way from start to goal, and where it is that narrow.

    From a maximum spanning tree of the complete diagram; None if walls separate the ends.
    """
    network = build_network(problem, diagram, 0.0, timed=False)
    width = network.curves.least_distance
    # The tree is of least weight; a weight of zero would mean no edge.
    weight = 1.0 + (width.max() - width)
    tree = minimum_spanning_tree(_matrix(network.ends, weight, network.vertex_count))
    _, before = breadth_first_order(tree, network.start, directed=False)
    if network.start == network.goal:
        return None
    if before[network.goal] < 0:
        return None
    index = {frozenset(pair): i for i, pair in enumerate(network.ends.tolist())}
    vertex, narrowest = network.goal, -1
    while vertex != network.start:
        piece = index[frozenset((vertex, int(before[vertex])))]
        if narrowest < 0 or width[piece] < width[narrowest]:
            narrowest = piece
        vertex = int(before[vertex])
    curve = network.curves.take([narrowest])
    return float(width[narrowest]), curve.points(curve.least_distance_at)[0]


def _matrix(ends: Indices, weight: Array, count: int) -> csr_array:
    """Symmetric adjacency matrix."""
    rows, columns = np.concatenate([ends, ends[:, ::-1]]).T
    return csr_array(coo_array((np.tile(weight, 2), (rows, columns)), shape=(count, count)))


def shortest_route(problem: Problem, diagram: VoronoiDiagram) -> Curves:
    """The shortest way along Voronoi arcs from start to goal, whatever time it takes.

    Parameters
    ----------
    diagram : of the problem's world; arcs where the robot cannot move at all are left out.

    Returns
    -------
    Curves end to end in the direction of travel, the legs from start and to goal included (by retraction);
    none where start and goal are one point.

    Raises
    ------
    NoPathError : start or goal has no room, or no way joins them; the message says where it is too narrow.
    """
    level = problem.robot.radius + problem.braking.margin
    network = build_network(problem, diagram, level)
    passable = np.flatnonzero(np.isfinite(network.time))
    ends, curves = network.ends[passable], network.curves.take(passable)
    matrix = _matrix(ends, curves.length, network.vertex_count)
    length, before = dijkstra(matrix, indices=network.start, return_predecessors=True)
    if not np.isfinite(length[network.goal]):
        raise no_path(problem, diagram, network, level)
    vertices = [network.goal]
    while vertices[-1] != network.start:
        vertices.append(int(before[vertices[-1]]))
    steps = list(pairwise(vertices[::-1]))
    piece = {frozenset(pair): i for i, pair in enumerate(ends.tolist())}
    used = np.array([piece[frozenset(step)] for step in steps], dtype=np.int64)
    backwards = ends[used, 0] != np.array([a for a, _ in steps], dtype=np.int64)
    return curves.take(used).reversed(backwards)
