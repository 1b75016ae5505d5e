"""From a mesh to the cone program, and from its solution to a certificate."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from vnav_drake.lower_bound.certificate import Certificate
from vnav_drake.lower_bound.cover import Cover, barycentric
from vnav_drake.lower_bound.headings import named
from vnav_drake.lower_bound.mesh import edges_of
from vnav_drake.lower_bound.minorant import Choice
from vnav_drake.lower_bound.program import Elements, Functional, Solution
from vnav_drake.lower_bound.sheets import Sheets, sheets
from vnav_drake.lower_bound.steepness import Directions
from vnav_drake.problem import NoPathError, Problem

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

SAFETY = 1e-9  # the gradient stays this share below its bound, so that other roundings agree
ALL_HEADINGS = 1e-6  # the same with a zone: whoever proves it for all headings needs room between them
ROUNDING = 1e-12  # relative, of a difference of two values of u


@dataclass(frozen=True, eq=False)
class Assembly:
    """What the program needs to know of a mesh."""

    cover: Cover
    sheets: Sheets
    choice: Choice  # of minorants, for all copies
    copies: Indices  # (t,), copies of kept triangles that are connected to the start
    elements: Elements  # those triangles
    ends: tuple[int, int]  # copies that contain start and goal
    start: Functional
    goal: Functional
    directions: Directions | None = None  # with a zone: what bounds 1/V for every heading

    @property
    def rows(self) -> Indices:
        """(t,), mesh triangles of the elements"""
        return self.sheets.rows[self.copies]


def assemble(cover: Cover) -> Assembly:
    """The kept triangles connected to the start, their control values, and u at start and goal.

    Raises
    ------
    NoPathError : the goal is not connected to the start.
    """
    parts = sheets(cover)
    choice = cover.choice(parts.rows)
    points = (cover.ground.start, cover.ground.goal)
    first, last = (parts.at(cover.locate(point), cover, point) for point in points)
    count = len(parts.place)
    pairs = parts.corner[:, [0, 1, 0, 2]].reshape(-1, 2)
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    label = connected_components(graph, directed=False)[1][parts.corner[:, 0]]
    if label[first] != label[last]:
        raise NoPathError("start and goal are not connected for this robot: blocked triangles part them")
    copies = np.flatnonzero(label == label[first])
    rows, triangles = parts.rows[copies], parts.corner[copies]
    used, vertex = np.unique(triangles, return_inverse=True)
    vertex = vertex.reshape(-1, 3)
    edge, of_edge = edges_of(triangles)
    control = np.empty((len(rows), 3, 3), dtype=np.int64)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        control[:, i, i] = vertex[:, i]
        control[:, j, k] = control[:, k, j] = len(used) + of_edge[:, i]
    elements = Elements(cover.corners(rows), control, choice.of(copies), len(used) + len(edge))
    directions, zone = None, cover.ground.zone
    if zone is not None:
        directions = Directions.of(
            zone,
            cover.ground.features,
            elements.corners,
            elements.choice,
            cover.flow[rows],
            cover.heading[rows],
        )
        elements = replace(elements, allowed=directions.allowed(known=bool(cover.time.any())))
    start, goal = (
        _functional(elements, int(np.searchsorted(copies, copy)), point)
        for copy, point in zip((first, last), points, strict=True)
    )
    return Assembly(cover, parts, choice, copies, elements, (first, last), start, goal, directions)


def _functional(elements: Elements, row: int, point: Array) -> Functional:
    """u at a point (2,) [m] in triangle `row`."""
    share = barycentric(elements.corners[row : row + 1], point)[0]
    return Functional(point, elements.control[row].ravel(), np.outer(share, share).ravel())


def certified(problem: Problem, assembly: Assembly, solution: Solution) -> Certificate:
    """u on the whole mesh: zero on parts that no motion from the start reaches."""
    cover, parts, elements = assembly.cover, assembly.sheets, assembly.elements
    mesh, values = cover.mesh, _proven(assembly, solution)
    edge, of_edge = edges_of(parts.corner)
    u_vertex, u_edge = np.zeros(len(parts.place)), np.zeros(len(edge))
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        u_vertex[parts.corner[assembly.copies, i]] = values[elements.control[:, i, i]]
        u_edge[of_edge[assembly.copies, i]] = values[elements.control[:, j, k]]
    share = np.ones(len(parts.rows))
    share[assembly.copies] = solution.weight
    size = float(np.abs(values).max(initial=0.0))
    choice, law = assembly.choice, problem.braking
    blocked = np.setdiff1d(np.arange(len(mesh.triangles)), parts.rows)
    zone, law_of_zone = problem.zone, cover.ground.zone
    least = choice.speed if law_of_zone is None else np.full_like(choice.speed, law_of_zone.law.slowest)
    return Certificate(
        vertices=mesh.vertices[parts.place],
        origin=mesh.lattice.origin,
        unit=mesh.lattice.unit,
        box=np.array(mesh.lattice.box, dtype=np.int64),
        triangles=parts.corner,
        side=parts.side,
        dropped=mesh.triangles[blocked],
        blocked_by=cover.reason[blocked],
        edges=edge,
        u_vertex=u_vertex,
        u_edge=u_edge,
        feature=choice.feature,
        speed=least,
        weight=np.stack([share, 1.0 - share], axis=1),
        start_triangle=assembly.ends[0],
        goal_triangle=assembly.ends[1],
        features=cover.ground.features.table,
        start=cover.ground.start,
        goal=cover.ground.goal,
        law=np.array([problem.robot.radius, law.max_braking, law.reaction_time, law.margin, law.max_speed]),
        travel_time=max(0.0, assembly.goal(values) - assembly.start(values) - ROUNDING * size),
        contact=None if zone is None else cover.flow[parts.rows],  # of no use where u measures lengths
        zone=None if zone is None else named(zone),
        lengths=None if zone is None else int(cover.ground.lengths),
    )


def _proven(assembly: Assembly, solution: Solution) -> Array:
    """The control values scaled down until every corner keeps its bound, whatever the solver said."""
    elements = assembly.elements
    if assembly.directions is not None:
        ratio = assembly.directions.worst(elements.gradient(solution.values), solution.weight)
        if not 0.0 < ratio < np.inf:
            return np.zeros_like(solution.values)
        return np.asarray(solution.values / (ratio * (1.0 + ALL_HEADINGS)))
    bound = elements.bounds(solution.weight)
    values = solution.values
    for _ in range(5):  # scaling rounds anew, which shows where triangles are tiny
        slope = elements.gradient(values)
        ratio = float((np.hypot(slope[..., 0], slope[..., 1]) / bound).max()) * (1.0 + SAFETY)
        if ratio <= 1.0:
            return values
        values = values / (ratio * (1.0 + 1e-12))
    return np.zeros_like(values)
