"""The vc-method ready to draw: its space with cells and graph, and its route."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from verify.report.drawings import CellGraphDrawing, SpaceDrawing, VcDrawing
from verify.vc_shapes import bottom, ridge, roof, slice_of, wall
from verify.vc_unfolding import sampled, unfolded
from vnav_drake.problem import Problem
from vnav_drake.vc_method.planner import COSTS, VcResult

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

MOST_SLOPES = 600  # whose stacks are drawn: more are a thicket
PIECES_ACROSS = 45  # of the roof along the world's diameter, at the finest
MOST_PATCHES = 2400  # of the roof
COARSER = 1.3  # by which pieces of the roof grow until there are few enough
SIMPLER = 2e-4  # of the world's diameter, by which outlines may be off
ARC_POINTS = 12  # that one arc is drawn with
CHAIN_POINTS = 24  # that an edge of the graph is drawn with


def vc_drawing(problem: Problem, result: VcResult) -> VcDrawing:
    """All that the report draws of the vc-method.

    Of worlds with more than MOST_SLOPES slopes the stacks nearest to the route are drawn, and the drawing
    says how many there are.
    """
    route = sampled(result.route.curves).points
    diagram = result.decomposition.diagram
    return VcDrawing(
        space=_space(problem, result, route),
        unfolded=unfolded(problem, result),
        arcs=diagram.polylines(problem.world.diameter / 400.0),
        route=route,
        other=None if result.same_route else sampled(result.other.curves).points,
        cost=result.cost,
        other_cost=COSTS[1 - COSTS.index(result.cost)],
    )


def _space(problem: Problem, result: VcResult, route: Array) -> SpaceDrawing:
    decomposition, critical, braking = result.decomposition, result.critical, problem.braking
    radius = problem.robot.radius
    picked = _shown(result, route)
    shown = np.zeros(len(decomposition.maximum), dtype=bool)
    shown[picked] = True
    slopes = np.flatnonzero(shown[decomposition.slope_stack])
    walls = [
        p
        for p in decomposition.vertical_partitions
        if shown[decomposition.side_stack[decomposition.side_saddle == p.saddle]].any()
    ]
    saddles = np.array([p.saddle for p in walls], dtype=np.int64)
    level = decomposition.diagram.radius
    feet = [bottom(p.point, p.feet, level) for p in walls]
    tops = decomposition.maximum[picked]
    cells = np.flatnonzero(shown[decomposition.cell_stack])
    return SpaceDrawing(
        roof=_roof(problem, result, slopes),
        ridges=[
            ridge(decomposition.slopes.curves, row, braking, radius, ARC_POINTS) for row in slopes.tolist()
        ],
        vertical=[wall(p.point, p.feet, braking, radius) for p in walls],
        horizontal=_horizontal(problem, result, cells),
        feet=np.array(feet).reshape(-1, 2, 2),
        saddles=np.column_stack([critical.point[saddles], critical.speed[saddles]]),
        maxima=np.column_stack([critical.point[tops], critical.speed[tops]]),
        stacks=len(picked),
        total=len(decomposition.maximum),
        graph=_graph(result, shown, cells),
    )


def _shown(result: VcResult, route: Array) -> Indices:
    """The stacks nearest to the route, those that it passes first."""
    decomposition = result.decomposition
    away = cKDTree(route).query(result.critical.point[decomposition.maximum])[0]
    away[decomposition.cell_stack[list(result.route.cells)]] = -1.0
    order = np.argsort(away, kind="stable")
    slopes = np.bincount(decomposition.slope_stack, minlength=len(order))[order]
    return np.sort(order[: max(1, int(np.searchsorted(np.cumsum(slopes), MOST_SLOPES, side="right")))])


def _roof(problem: Problem, result: VcResult, slopes: Indices) -> Array:
    spacing = problem.world.diameter / PIECES_ACROSS
    rows = 3 if 6 * len(slopes) <= MOST_PATCHES // 2 else 2
    radius = problem.robot.radius
    while True:
        patches = roof(result.decomposition, slopes, problem.braking, radius, spacing=spacing, rows=rows)
        if len(patches) <= MOST_PATCHES or spacing > problem.world.diameter:
            return patches
        spacing *= COARSER


def _horizontal(problem: Problem, result: VcResult, cells: Indices) -> list[tuple[float, shapely.Geometry]]:
    """Speed and floor plan of the partitions between cells; at a maximum it is a point, and left out."""
    d, out = result.decomposition, []
    for cell in cells.tolist():
        stack, top = int(d.cell_stack[cell]), float(d.cell_top[cell])
        if cell + 1 < d.first_cell[stack + 1]:
            plan = slice_of(d, stack, problem.robot.radius + float(problem.braking.distance(top)))
            if not plan.is_empty:
                out.append((top, shapely.simplify(plan, problem.world.diameter * SIMPLER)))
    return out


def _graph(result: VcResult, shown: NDArray[np.bool_], cells: Indices) -> CellGraphDrawing:
    """Vertices and edges of the adjacency graph between shown stacks, and which are of the route."""
    graph, d, route = result.graph, result.decomposition, result.route
    used = np.zeros(len(graph.speed), dtype=bool)
    used[list(route.cells)] = True
    point = np.column_stack([graph.position, graph.speed])
    edges = np.flatnonzero(shown[d.cell_stack[graph.type_a]].all(axis=1))
    lower = np.flatnonzero(shown[d.cell_stack[graph.type_b[:, 0]]])
    steps = {tuple(sorted(pair)) for pair in zip(route.cells[:-1], route.cells[1:], strict=True)}
    chains = []
    for edge in edges.tolist():
        line = sampled(graph.chain(edge)[0], CHAIN_POINTS)
        low, high = graph.speed[graph.type_a[edge]]
        chains.append(np.column_stack([line.points, low + (high - low) * line.s / line.s[-1]]))
    return CellGraphDrawing(
        nodes=point[cells],
        on_route=used[cells],
        type_a=chains,
        type_a_on_route=[edge in route.edges for edge in edges.tolist()],
        type_b=point[graph.type_b[lower]],
        type_b_on_route=[tuple(pair) in steps for pair in graph.type_b[lower].tolist()],
    )
