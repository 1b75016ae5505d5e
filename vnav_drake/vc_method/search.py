"""From the start's cell to the goal's: the search on the adjacency graph (Manor 2015, Sec. 2.5)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import dijkstra

from vnav_drake.problem import End, PlanningError, Problem
from vnav_drake.vc_method.adjacency import AdjacencyGraph
from vnav_drake.vc_method.cells import CellDecomposition
from vnav_drake.vc_method.profile import arc_minimum_time
from vnav_drake.voronoi import Curves
from vnav_drake.voronoi.legs import NEAR, retraction
from vnav_drake.voronoi.network import build_network, demand_room, no_path

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


@dataclass(frozen=True)
class Spot:
    """A place on a slope."""

    slope: int
    parameter: float  # [m]


@dataclass(frozen=True)
class CellRoute:
    """A chain of cells and the arcs that lead through them, start and goal attached by retraction."""

    cells: tuple[int, ...]  # vertices of the graph in order, Type B steps included
    saddles: tuple[int, ...]  # rows of the critical points, in the order they are passed
    edges: tuple[int, ...]  # Type A edges, one a saddle
    curves: Curves  # (m,) in the direction of travel, from start to goal
    borders: Indices  # (m,) rows of `diagram.curves`, -1 for the legs from start and to goal
    cost: float  # [s], that the search added up
    travel_time: float  # [s], least along `curves` under V(d), a_max, a_b and the ends' speeds


@dataclass(frozen=True)
class _Attached:
    leg: Curves  # from the end to the arcs
    spot: Spot
    stack: int
    cell: int
    speed: float  # [m/s], greatest at the end; infinite when safe


def search(graph: AdjacencyGraph, problem: Problem) -> CellRoute:
    """The chain of cells of least cost from the start to the goal.

    With realised costs the ways from start and goal to the first and last saddle are timed as they are,
    with the ends' speeds; with published ones the formula counts from the maximum of their stack, as the
    thesis does. Inside a stack the arcs form a tree, and a route takes the way in it between its two
    saddles: up to the maximum and down again where the maximum is on the way, never back and forth.

    Raises
    ------
    NoPathError : start or goal has no room, or no way joins them; the message says where it is too narrow.
    """
    decomposition = graph.decomposition
    level = decomposition.diagram.radius
    ends = []
    for name, end in (("start", problem.start), ("goal", problem.goal)):
        demand_room(problem, name, end, level)
        ends.append(_attach(decomposition, problem, end))
    start, goal = ends
    best = _within_or_across(graph, problem, start, goal)
    through = _through_maxima(graph, problem, start, goal)
    if through is not None and (best is None or through[0] < best[0]):
        best = through
    if best is None:
        network = build_network(problem, decomposition.diagram.uncut, level)
        raise no_path(problem, decomposition.diagram.uncut, network, level)
    cost, passed = best
    curves, borders = _chain(decomposition, graph, start, goal, passed)
    time = float(_time(problem, [curves], [start.speed], [goal.speed])[0])
    return CellRoute(
        _cells(graph, start, goal, passed),
        tuple(int(graph.saddle[edge]) for edge, _ in passed),
        tuple(edge for edge, _ in passed),
        curves,
        borders,
        cost,
        time,
    )


Passage = tuple[int, int]  # a Type A edge, and 0 when it is followed forwards, 1 backwards
Choice = tuple[float, list[Passage]]  # [s], and the saddles on the way


def _attach(decomposition: CellDecomposition, problem: Problem, end: End) -> _Attached:
    """Where an end joins the arcs, and the cell that it lies in.

    The way straight from the nearest obstacle never crosses a vertical partition, which runs along such
    ways itself, so that the end lies in the stack of the place where it joins.
    """
    leg, place = retraction(problem.world, end.point)
    slopes = decomposition.slopes
    curves = slopes.curves
    if len(curves) == 0:
        raise PlanningError("the world has no Voronoi arcs with room for the robot")
    low, high = curves.span.min(axis=1), curves.span.max(axis=1)
    u = np.clip(np.einsum("ij,ij->i", place - curves.origin, curves.axis), low, high)
    miss = np.hypot(*(curves.points(u) - place).T)
    slope = int(np.argmin(miss))
    if not miss[slope] <= 1e-6 * problem.world.diameter:
        raise PlanningError(f"no Voronoi arc passes through ({place[0]:.9g}, {place[1]:.9g})")
    stack = int(decomposition.slope_stack[slope])
    fixed = end.fixed_speed
    speed = float(problem.safe_speed(end.point)) if fixed is None else fixed
    return _Attached(
        leg,
        Spot(slope, float(u[slope])),
        stack,
        decomposition.cell_at(stack, speed),
        np.inf if fixed is None else fixed,
    )


def _sides_around(graph: AdjacencyGraph, stack: int) -> list[Passage]:
    """All ways out of a stack through its saddles; both ways where it meets itself."""
    stacks = graph.decomposition.side_stack[graph.type_a_sides]
    edge, end = np.nonzero(stacks == stack)
    return [(int(e), int(k)) for e, k in zip(edge, end, strict=True)]


def _target(graph: AdjacencyGraph, passage: Passage) -> int:
    """The stack that a passage leads into."""
    edge, way = passage
    return int(graph.decomposition.side_stack[graph.type_a_sides[edge, 1 - way]])


def _within_or_across(
    graph: AdjacencyGraph, problem: Problem, start: _Attached, goal: _Attached
) -> Choice | None:
    """The best way that passes no maximum between two saddles: inside one stack, or through one saddle."""
    options: list[list[Passage]] = [[]] if start.stack == goal.stack else []
    options += [[p] for p in _sides_around(graph, start.stack) if _target(graph, p) == goal.stack]
    if not options:
        return None
    if graph.cost == "published":
        cost = np.array([sum(float(graph.weight[p]) for p in option) for option in options])
    else:
        chains = [_chain(graph.decomposition, graph, start, goal, option)[0] for option in options]
        cost = _time(problem, chains, [start.speed] * len(chains), [goal.speed] * len(chains))
    best = int(np.argmin(cost))
    return (float(cost[best]), options[best]) if np.isfinite(cost[best]) else None


def _through_maxima(
    graph: AdjacencyGraph, problem: Problem, start: _Attached, goal: _Attached
) -> Choice | None:
    """The best way through two saddles or more, from maximum to maximum between the first and the last."""
    d = graph.decomposition
    out = _sides_around(graph, start.stack)
    back = [(edge, 1 - way) for edge, way in _sides_around(graph, goal.stack)]
    if not out or not back:
        return None
    first, last = _end_costs(graph, problem, start, goal, out, back)
    count = len(graph.speed)
    source, sink = count, count + 1
    # Every way in ends at the cell that it enters; from there the free Type B edges lead on.
    arrive = [int(d.side_cell[graph.type_a_sides[edge, 1 - way]]) for edge, way in out]
    leave = [int(d.side_cell[graph.type_a_sides[edge, way]]) for edge, way in back]
    rows = np.concatenate(
        [graph.type_a[:, 0], graph.type_a[:, 1], *graph.type_b.T, np.full(len(out), source), leave]
    )
    columns = np.concatenate(
        [graph.type_a[:, 1], graph.type_a[:, 0], *graph.type_b.T[::-1], arrive, np.full(len(back), sink)]
    )
    weight = np.concatenate([*graph.weight.T, np.zeros(2 * len(graph.type_b)), first, last])
    edges = len(graph.type_a)
    name = np.concatenate(
        [
            np.arange(2 * edges),
            np.full(2 * len(graph.type_b), -1),
            [edge + edges * way for edge, way in out + back],
        ]
    ).astype(np.int64)
    matrix, place, chosen = _least(rows, columns, weight, count + 2)
    cost, before = dijkstra(matrix, indices=source, return_predecessors=True)
    if not np.isfinite(cost[sink]):
        return None
    passed: list[Passage] = []
    vertex = sink
    while vertex != source:
        previous = int(before[vertex])
        used = int(name[chosen[np.searchsorted(place, previous * (count + 2) + vertex)]])
        if used >= 0:
            passed.append((used % edges, used // edges))
        vertex = previous
    return float(cost[sink]), passed[::-1]


def _least(rows: Indices, columns: Indices, weight: Array, count: int) -> tuple[csr_array, Indices, Indices]:
    """The matrix of the least of parallel edges, zeros kept; places `row * count + column`, and edges."""
    order = np.lexsort([weight, columns, rows])
    order = order[np.isfinite(weight[order]) & (rows[order] != columns[order])]
    place = rows[order] * count + columns[order]
    first = np.diff(place, prepend=-1) != 0
    order, place = order[first], place[first]
    matrix = coo_array((weight[order], (rows[order], columns[order])), shape=(count, count)).tocsr()
    return matrix, place, order


def _end_costs(
    graph: AdjacencyGraph,
    problem: Problem,
    start: _Attached,
    goal: _Attached,
    out: list[Passage],
    back: list[Passage],
) -> tuple[Array, Array]:
    """Costs [s] from the start through each first saddle to the maximum behind it, and to the goal alike."""
    if graph.cost == "published":
        first, last = (np.array([graph.weight[p] for p in passages]) for passages in (out, back))
        return first, last
    d = graph.decomposition
    leaving, arriving = [], []
    for edge, way in out:
        near, far = (int(d.side_corner[graph.type_a_sides[edge, w]]) for w in (way, 1 - way))
        leaving.append(
            _joined(d, [start.leg], [_tree_path(d, start.spot, _at(d, near)), _rise(d, far)], [])[0]
        )
    for edge, way in back:
        near, far = (int(d.side_corner[graph.type_a_sides[edge, w]]) for w in (way, 1 - way))
        fall = [(s, v, u) for s, u, v in _rise(d, near)[::-1]]
        arriving.append(_joined(d, [], [fall, _tree_path(d, _at(d, far), goal.spot)], [goal.leg])[0])
    free = [np.inf]
    return (
        _time(problem, leaving, [start.speed] * len(leaving), free * len(leaving)),
        _time(problem, arriving, free * len(arriving), [goal.speed] * len(arriving)),
    )


Step = tuple[int, float, float]  # a slope, and the parameters [m] between which it is followed


def _at(d: CellDecomposition, corner: int) -> Spot:
    """A corner as a place on the slope towards its maximum."""
    slope = int(d.parent_slope[corner])
    return Spot(slope, float(d.slopes.curves.span[slope, int(d.slope_corners[slope, 0] != corner)]))


def _upper_corner(d: CellDecomposition, slope: int) -> tuple[int, int]:
    """The corner of a slope towards the maximum, and which end it is."""
    low, high = d.slope_corners[slope].tolist()
    return (high, 1) if d.parent[low] == high and d.parent_slope[low] == slope else (low, 0)


def _climb(d: CellDecomposition, spot: Spot) -> list[Step]:
    """From a place up to its maximum."""
    corner, end = _upper_corner(d, spot.slope)
    span = d.slopes.curves.span
    steps = [(spot.slope, spot.parameter, float(span[spot.slope, end]))]
    while d.parent[corner] >= 0:
        slope = int(d.parent_slope[corner])
        corner, end = _upper_corner(d, slope)
        steps.append((slope, float(span[slope, 1 - end]), float(span[slope, end])))
    return steps


def _rise(d: CellDecomposition, corner: int) -> list[Step]:
    return _climb(d, _at(d, corner))


def _tree_path(d: CellDecomposition, one: Spot, other: Spot) -> list[Step]:
    """The way between two places of a stack."""
    up, down = _climb(d, one), _climb(d, other)
    place = {slope: i for i, (slope, _, _) in enumerate(up)}
    j = next((k for k, (slope, _, _) in enumerate(down) if slope in place), None)
    if j is None:
        return up + [(s, v, u) for s, u, v in down[::-1]]
    slope, i = down[j][0], place[down[j][0]]
    fall = [(s, v, u) for s, u, v in down[:j][::-1]]
    between = [(slope, up[i][1], down[j][1])]
    return [*up[:i], *([] if between[0][1] == between[0][2] else between), *fall]


def _chain(
    d: CellDecomposition, graph: AdjacencyGraph, start: _Attached, goal: _Attached, passed: list[Passage]
) -> tuple[Curves, Indices]:
    """All arcs from start to goal through the saddles of some passages, and their borders."""
    ways, spot = [], start.spot
    for edge, way in passed:
        near, far = (int(d.side_corner[graph.type_a_sides[edge, w]]) for w in (way, 1 - way))
        ways.append(_tree_path(d, spot, _at(d, near)))
        spot = _at(d, far)
    ways.append(_tree_path(d, spot, goal.spot))
    return _joined(d, [start.leg], ways, [goal.leg])


def _joined(
    d: CellDecomposition, before: list[Curves], ways: list[list[Step]], after: list[Curves]
) -> tuple[Curves, Indices]:
    """Legs and steps end to end; steps that go on along the same arc become one."""
    steps: list[tuple[int, float, float]] = []  # border, from, to
    slopes: list[int] = []
    for slope, a, b in (step for way in ways for step in way):
        if abs(b - a) == 0.0:
            continue
        border = int(d.slopes.border[slope])
        if steps and steps[-1][0] == border and steps[-1][2] == a and (steps[-1][1] < a) == (a < b):
            steps[-1] = (border, steps[-1][1], b)
        else:
            steps.append((border, a, b))
            slopes.append(slope)
    arcs = d.slopes.curves.take(np.array(slopes, dtype=np.int64))
    arcs = arcs.cut(np.array([(a, b) for _, a, b in steps]).reshape(-1, 2))
    turned = [leg.reversed(np.ones(len(leg), dtype=bool)) for leg in after]
    if before and turned and not steps:
        before, turned = [_without_spur(before[0], turned[0])], []
    parts = [*before, arcs, *turned]
    borders = np.array([border for border, _, _ in steps], dtype=np.int64)
    legs = [np.full(sum(len(leg) for leg in part), -1) for part in (before, turned)]
    return Curves.join(parts), np.concatenate([legs[0], borders, legs[1]])


def _without_spur(out: Curves, back: Curves) -> Curves:
    """Two straight legs that meet at the arcs; where one leads back along the other only what differs."""
    if len(out) != 1 or len(back) != 1:
        return Curves.join([out, back])
    reach = float(min(out.length[0], back.length[0]))
    aside = np.hypot(*(out.points(out.span[:, 1] - reach) - back.points(back.span[:, 0] - reach))[0])
    if aside > NEAR:
        return Curves.join([out, back])
    if out.length[0] > back.length[0]:
        return out.cut(out.span - [[0.0, reach]])
    return back.cut(back.span - [[reach, 0.0]])


def _time(problem: Problem, chains: list[Curves], start: list[float], end: list[float]) -> Array:
    """Least times (k,) [s] along chains with greatest end speeds [m/s]; 0 for a chain without curves."""
    time = np.zeros(len(chains))
    rows = [i for i, chain in enumerate(chains) if len(chain)]
    if rows:
        number = np.repeat(np.arange(len(rows)), [len(chains[i]) for i in rows])
        time[rows] = arc_minimum_time(
            Curves.join([chains[i] for i in rows]),
            number,
            problem.braking,
            problem.robot,
            start_speed=np.array(start)[rows],
            end_speed=np.array(end)[rows],
        )
    return time


def _cells(
    graph: AdjacencyGraph, start: _Attached, goal: _Attached, passed: list[Passage]
) -> tuple[int, ...]:
    """All cells on the way: along Type B edges inside a stack, along Type A edges from one to the next."""
    cells = [start.cell]
    for edge, way in passed:
        near, far = int(graph.type_a[edge, way]), int(graph.type_a[edge, 1 - way])
        cells += _stairs(cells[-1], near)
        cells.append(far)
    return (*cells, *_stairs(cells[-1], goal.cell))


def _stairs(a: int, b: int) -> list[int]:
    """Cells of one stack after a, up or down to b."""
    return list(range(a + 1, b + 1)) if b >= a else list(range(a - 1, b - 1, -1))
