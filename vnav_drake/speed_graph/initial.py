"""From a path through the graph to the structure that the class optimum starts from."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vnav_drake.problem import Problem
from vnav_drake.speed_graph.cap import CutDiagram
from vnav_drake.speed_graph.chart import Chart
from vnav_drake.speed_graph.route import Route
from vnav_drake.speed_graph.structure import NODE_TOLERANCE, Join, Kind, Structure, from_stops
from vnav_drake.voronoi import VoronoiDiagram

Array = NDArray[np.float64]

RADIAL = 1e-6  # [rad]


def structure_of(problem: Problem, cut: CutDiagram, chart: Chart, route: Route) -> Structure:
    """The structure of a route in the diagram restricted to the robot's level, which `cut` was made from."""
    diagram = cut.diagram
    stops = [
        (-1 if b < 0 else cut.piece(b, u), u)
        for b, u in zip(route.border.tolist(), route.parameter.tolist(), strict=True)
    ]
    border: list[int] = []  # of the stops between start and goal
    u: list[float] = []
    steps: list[_Step] = []  # one more
    for i in range(route.stops - 1):
        if i > 0:
            border.append(stops[i][0])
            u.append(stops[i][1])
        cell, along = int(route.cell[i]), int(route.along[i])
        if cell >= 0:
            steps.append(_Step(cell, -1, _sweep(chart, cell, int(route.turn[i]), *route.point[i : i + 2])))
            continue
        ends = [_on_border(cut, route, k, along) for k in (i, i + 1)]
        for k, (row, mark) in enumerate(cut.pieces_between(along, *ends)):
            if k > 0:
                border.append(row)
                u.append(mark)
            steps.append(_ride(cut, row))
    for i in range(len(border) - 1, -1, -1):
        if border[i] < 0:  # a way round a point through start or goal: the legs around it are one
            steps[i : i + 2] = [replace(steps[i], sweep=steps[i].sweep + steps[i + 1].sweep)]
            del border[i], u[i]
    return from_stops(
        diagram,
        _end(diagram, problem.start.point, *stops[0]),
        _end(diagram, problem.goal.point, *stops[-1]),
        border,
        u,
        [step.cell for step in steps],
        [step.along for step in steps],
        [step.sweep for step in steps],
    )


@dataclass(frozen=True)
class _Step:
    """A leg through `cell`, or a ride along border `along`; the other is -1."""

    cell: int
    along: int
    sweep: float


def _ride(cut: CutDiagram, row: int) -> _Step:
    """Along a piece of an arc; at the greatest speed straight through the cell that an arc bends round."""
    if cut.rideable[row]:
        return _Step(-1, row, 0.0)
    return _Step(int(cut.diagram.cells[row].max()), -1, 0.0)  # cells of vertices come last


def _on_border(cut: CutDiagram, route: Route, i: int, border: int) -> float:
    """Parameter of stop i on a border of the diagram before it was cut: its own, or the end at its node."""
    if int(route.border[i]) == border:
        return float(route.parameter[i])
    rows = slice(cut.row[border], cut.row[border + 1])
    curves = cut.diagram.curves.take(np.arange(rows.start, rows.stop))
    ends = curves.ends.reshape(-1, 2)
    nearest = int(np.argmin(np.hypot(*(ends - route.point[i]).T)))
    return float(curves.span.reshape(-1)[nearest])


def _end(diagram: VoronoiDiagram, point: Array, border: int, u: float) -> Join:
    """Start or goal, with the border or node that it lies on."""
    x, y = float(point[0]), float(point[1])
    if border < 0:
        return Join(Kind.END, place=(x, y))
    span = diagram.curves.span[border]
    end = int(np.argmin(np.abs(span - u)))
    if abs(float(span[end]) - u) <= NODE_TOLERANCE:
        return Join(Kind.END, node=int(diagram.ends[border, end]), place=(x, y))
    return Join(Kind.END, border=border, u=u, place=(x, y))


def _sweep(chart: Chart, cell: int, turn: int, start: Array, end: Array) -> float:
    """Signed angle [rad] of a leg around an isolated point; zero elsewhere."""
    if turn == 0 or cell < 0:
        return 0.0
    vertex = chart.world.vertices[cell - 2 * len(chart.world.edges)]
    a, b = start - vertex, end - vertex
    angle = math.atan2(a[0] * b[1] - a[1] * b[0], float(a @ b))
    # a radial leg sweeps nothing, up to rounding
    return turn * ((turn * angle + RADIAL) % (2.0 * math.pi) - RADIAL)
