"""The map of the warehouse of Manor 2015, Sec. 3.7: ends, gaps, and the shortest way through it.

The target is "at the lower corner of the storage rack O1". A rack has two: in scenarios/warehouse.yaml it is
the left one, in the other reading the right one.
"""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from benchmarks.reproduction.page import ROOT, Data
from vnav_drake.homotopy import Gates, class_of
from vnav_drake.problem import End, PlanningError, Problem
from vnav_drake.scenario import load_scenario
from vnav_drake.voronoi import Curves, VoronoiDiagram
from vnav_drake.voronoi.network import build_network
from vnav_drake.voronoi.paths import route_path
from vnav_drake.voronoi_route.search import routes

Array = NDArray[np.float64]

SCENARIO = ROOT / "scenarios" / "warehouse.yaml"
RIGHT_TARGET = (14.5, 21.5)  # [m], where the gaps meet, 0.7 m from the corner (14, 22)
# Gaps passed from end to end in the class that the thesis calls geometrically shortest: "between O4 and O6,
# then between O3 and O4, and finally reaches pT while passing between O1 and O3".
GAPS = {
    "right": (("O4", "O6"), ("O3", "O4")),
    "left": (("O4", "O6"), ("O3", "O4"), ("O1", "O3")),
}
ROUTES = 40  # along Voronoi arcs, among which a class is looked for
QUARTER = 8  # sides of a quarter circle around a corner


def problem(reading: str = "left", start: tuple[float, float] | None = None) -> Problem:
    """The warehouse with the target at the lower `left` or `right` corner of O1, 31 m high.

    Raises
    ------
    ValueError : no such reading.
    """
    if reading not in GAPS:
        raise ValueError(f"reading = {reading!r}: must be 'left' or 'right'")
    asked = load_scenario(SCENARIO).problem
    if reading == "right":
        asked = dataclasses.replace(asked, goal=End(position=RIGHT_TARGET))
    return asked if start is None else dataclasses.replace(asked, start=End(position=start))


def passage(asked: Problem, one: str, other: str) -> Data:
    """The gap between two racks: width, length, greatest clearance [m], greatest speed [m/s], least time [s].

    Between two parallel sides a width w apart no place is farther than w / 2 from both, so the clearance is
    at most w / 2 - radius, and every way through is at least as long as the sides face each other.

    Raises
    ------
    ValueError : the racks do not face each other, or the robot does not fit between them.
    """
    boxes = {o.name: np.array(o.vertices) for o in asked.world.obstacles}
    low = np.maximum(boxes[one].min(axis=0), boxes[other].min(axis=0))
    high = np.minimum(boxes[one].max(axis=0), boxes[other].max(axis=0))
    across = int(np.argmax(low - high))
    width, length = float((low - high)[across]), float((high - low)[1 - across])
    clearance = 0.5 * width - asked.robot.radius
    if length <= 0.0 or clearance <= 0.0:
        raise ValueError(f"{one} and {other}: {width:g} m apart along {length:g} m is no gap for this robot")
    speed = float(asked.braking.speed(clearance))
    return {
        "between": f"{one} and {other}",
        "width": width,
        "length": length,
        "clearance": clearance,
        "speed": speed,
        "least_time": length / speed,
    }


def along_arcs(asked: Problem, diagram: VoronoiDiagram, gates: Gates, name: str) -> Curves:
    """The fastest route along Voronoi arcs in a class.

    Raises
    ------
    PlanningError : it is not among the first ROUTES.
    """
    for route in itertools.islice(routes(build_network(asked, diagram, asked.robot.radius)), ROUTES):
        path = route_path(route.curves, asked.start.point, asked.goal.point)
        if class_of(gates, path) == name:
            return route.curves
    raise PlanningError(f"no route of the class {name} among the first {ROUTES}")


def shortest_way(asked: Problem) -> Array:
    """Corners (n, 2) [m] of the shortest way of the disc from start to goal, by a visibility graph.

    Racks are grown by the radius, their corners rounded by polygons of 4 QUARTER sides around the circle, so
    that the way is free, and too long by less than 0.2 % of the radius a corner.
    """
    reach = asked.robot.radius / math.cos(0.25 * math.pi / QUARTER)
    grown = shapely.union_all(
        [shapely.Polygon(o.vertices).buffer(reach, quad_segs=QUARTER) for o in asked.world.obstacles]
    )
    rings = [np.array(part.exterior.coords)[:-1] for part in shapely.get_parts(grown)]
    points = np.concatenate([[asked.start.point, asked.goal.point], *rings])
    inside = grown.buffer(-1e-6)
    shapely.prepare(inside)
    one, other = np.triu_indices(len(points), k=1)
    lines = shapely.linestrings(np.stack([points[one], points[other]], axis=1))
    free = ~shapely.intersects(inside, lines)
    weight = shapely.length(lines[free])
    rows, columns = one[free], other[free]
    matrix = coo_array((weight, (rows, columns)), shape=(len(points), len(points))).tocsr()
    _, before = dijkstra(matrix, directed=False, indices=0, return_predecessors=True)
    way = [1]
    while way[-1] != 0:
        if before[way[-1]] < 0:
            raise PlanningError("the racks, grown by the radius, separate start and goal")
        way.append(int(before[way[-1]]))
    return points[way[::-1]]
