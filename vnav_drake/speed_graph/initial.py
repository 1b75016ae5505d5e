"""From a path through the graph to the structure that the class optimum starts from."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from vnav_drake.problem import Problem
from vnav_drake.speed_graph.chart import Chart
from vnav_drake.speed_graph.route import Route
from vnav_drake.speed_graph.structure import NODE_TOLERANCE, Join, Kind, Structure, from_stops
from vnav_drake.voronoi import VoronoiDiagram

Array = NDArray[np.float64]


def structure_of(problem: Problem, diagram: VoronoiDiagram, chart: Chart, route: Route) -> Structure:
    """The structure of a route in the diagram restricted to the robot's level."""
    start = _end(diagram, problem.start.point, int(route.border[0]), float(route.parameter[0]))
    goal = _end(diagram, problem.goal.point, int(route.border[-1]), float(route.parameter[-1]))
    cell, along = [int(c) for c in route.cell], [int(a) for a in route.along]
    sweep = [_sweep(chart, c, int(t), *route.point[i : i + 2]) for i, (c, t) in enumerate(zip(cell, route.turn, strict=True))]
    border, u = route.border[1:-1].tolist(), route.parameter[1:-1].tolist()
    for i in range(len(border) - 1, -1, -1):
        if border[i] < 0:  # a way round a point through start or goal: the legs around it are one
            sweep[i] += sweep[i + 1]
            for row in (cell, along, sweep):
                del row[i + 1]
            del border[i], u[i]
    return from_stops(diagram, start, goal, border, u, cell, along, sweep)


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
    return turn * ((turn * angle) % (2.0 * math.pi))
