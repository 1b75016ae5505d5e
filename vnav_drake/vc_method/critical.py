"""Critical points of the height v on the free position-velocity space F^v (Manor 2015, Sec. 2.4.1).

F^v = {(q, v): v <= V(d(q))}. The thesis finds Type I points (saddles) where two vc-obstacles first touch and
Type II points (maxima) where three do. Here both come from how clearance rises along the Voronoi arcs,
which also covers plateaus and symmetric worlds: connected stretches of equal clearance count as one,
and with k slopes rising out of it such a stretch is a maximum for k = 0, regular for k = 1, and a saddle of
multiplicity k - 1 for k >= 2. The open sets {d > l} shrink to the arcs in them (Lieutier 2004), each slope
is counted once at its low end, so the sum of 1 - k over a component is its Euler characteristic.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vnav_drake.braking import UniformBraking
from vnav_drake.problem import PlanningError
from vnav_drake.vc_method.slopes import Slopes, cut_into_slopes
from vnav_drake.voronoi import LINEAR, PARABOLA, ROOT, Curves, VoronoiDiagram

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]

SADDLE, MAXIMUM = 1, 2


@dataclass(frozen=True)
class CriticalPoints:
    """All critical points, n rows: saddles (Type I) first, then maxima (Type II).

    A saddle names a border whose two feet it lies between, also where it is at a node. Of a plateau one
    point stands for all: halfway along its longest arc (saddle), or its node of greatest clearance.
    """

    kind: Indices  # (n,) SADDLE (Type I) or MAXIMUM (Type II)
    point: Array  # (n, 2) [m]
    clearance: Array  # (n,) [m]
    speed: Array  # (n,) [m/s], V(clearance)
    multiplicity: Indices  # (n,) rising directions less one for saddles, one for maxima
    node: Indices  # (n,) row of `diagram.nodes`, -1 between nodes
    border: Indices  # (n,) row of `diagram.curves`, -1 for maxima
    parameter: Array  # (n,) [m] on that border, 0 for maxima
    extent: Array  # (n, 2, 2) [m], ends of a plateau, or the point twice
    vertex: Indices  # (n,) vertex of `cut_into_slopes(diagram)`

    def __len__(self) -> int:
        return len(self.kind)

    @property
    def saddles(self) -> Indices:
        """Rows of Type I points."""
        return np.flatnonzero(self.kind == SADDLE)

    @property
    def maxima(self) -> Indices:
        """Rows of Type II points."""
        return np.flatnonzero(self.kind == MAXIMUM)

    @property
    def index(self) -> Indices:
        """(n,) what each adds to the Euler characteristic: 1 for a maximum, minus the multiplicity else."""
        return np.where(self.kind == MAXIMUM, 1, -self.multiplicity)


def critical_points(diagram: VoronoiDiagram, braking: UniformBraking) -> CriticalPoints:
    """Type I and Type II points of the free position-velocity space.

    Parameters
    ----------
    diagram : where the robot may be at all, `full.restricted(robot.radius + braking.margin)`, of a diagram
        `full = build_diagram(world, robot.radius)`.
    braking : gives the speeds; a greatest speed caps them, and changes no point.

    Raises
    ------
    PlanningError : clearance is constant all around a ring, to rounding, which no polygon does.

    Notes
    -----
    In generic worlds these are the thesis's: a saddle lies between its two feet, a maximum inside the hull
    of its feet. Saddles of multiplicity two do not occur (see `slopes`): no three arcs rise from a point.
    `diagram.radius` includes the margin; clearance is measured from the robot's disc, without it.
    """
    slopes = cut_into_slopes(diagram)
    plateau, count = slopes.plateau, len(slopes.points)
    vertices = np.bincount(plateau[slopes.used], minlength=count)
    level = np.bincount(plateau[slopes.low[slopes.level]], minlength=count)
    _demand_no_ring(slopes, vertices, level)
    rising = np.bincount(plateau, weights=slopes.rising, minlength=count).astype(np.int64)
    saddle = _lowest_of_saddles(slopes, diagram, (vertices > 0) & (rising > 1))
    top = _highest_of_maxima(slopes, (vertices > 0) & (rising == 0))
    vertex = np.concatenate([saddle, top])
    is_saddle = np.arange(len(vertex)) < len(saddle)
    border, parameter = _supporting_border(slopes, saddle)
    clearance = slopes.distance[vertex] - (diagram.radius - braking.margin)
    return CriticalPoints(
        np.where(is_saddle, SADDLE, MAXIMUM),
        slopes.points[vertex],
        clearance,
        braking.speed(clearance),
        np.where(is_saddle, rising[plateau[vertex]] - 1, 1),
        np.where(vertex < slopes.node_count, vertex, -1),
        np.concatenate([border, np.full(len(top), -1)]),
        np.concatenate([parameter, np.zeros(len(top))]),
        _extent(slopes, vertex),
        vertex,
    )


def _demand_no_ring(slopes: Slopes, vertices: Indices, level: Indices) -> None:
    ring = np.flatnonzero((vertices > 0) & (level >= vertices))
    if len(ring):
        x, y = slopes.points[np.flatnonzero(slopes.plateau == ring[0])[0]]
        raise PlanningError(
            f"clearance is constant along a closed line through ({x:.6g}, {y:.6g}):"
            " its critical points are not isolated"
        )


def passage_core(slopes: Slopes) -> Mask:
    """(v,) vertices on the way between rising slopes along a plateau: its blind ends are left out."""
    alive = slopes.used.copy()
    a, b = slopes.low[slopes.level], slopes.high[slopes.level]
    while True:
        both = (alive[a] & alive[b]).astype(float)
        ways = slopes.rising + np.bincount(a, both, len(alive)) + np.bincount(b, both, len(alive))
        blind = alive & (ways < 2)
        if not blind.any():
            return alive
        alive &= ~blind


def _lowest_of_saddles(slopes: Slopes, diagram: VoronoiDiagram, saddle: Mask) -> Indices:
    """The vertex that stands for each saddle: of least clearance, best halfway along a level arc."""
    v = np.flatnonzero(saddle[slopes.plateau] & passage_core(slopes))
    group = slopes.plateau[v]
    above = slopes.distance[v] - _per_group(np.minimum, group, slopes.distance[v], np.inf)
    border = np.maximum(slopes.cut_border[v], 0)
    arcs = diagram.curves.take(border)
    length = np.where(arcs.kind == LINEAR, arcs.length, 0.0)
    preference = np.where(slopes.cut_border[v] >= 0, length, -1.0)
    order = np.lexsort([v, -preference, above > slopes.rounding, group])
    return v[order][np.flatnonzero(np.diff(group[order], prepend=-1))]


def _highest_of_maxima(slopes: Slopes, maximum: Mask) -> Indices:
    """The node that stands for each maximum: of greatest clearance, to rounding the first."""
    v = np.flatnonzero(maximum[slopes.plateau] & slopes.used)
    v = v[v < slopes.node_count]
    group = slopes.plateau[v]
    below = _per_group(np.maximum, group, slopes.distance[v], -np.inf) - slopes.distance[v]
    order = np.lexsort([v, below > slopes.rounding, group])
    return v[order][np.flatnonzero(np.diff(group[order], prepend=-1))]


def _per_group(reduce: np.ufunc, group: Indices, value: Array, empty: float) -> Array:
    """(n,) the least or greatest value of each element's group."""
    best = np.full(int(group.max(initial=-1)) + 1, empty)
    reduce.at(best, group, value)
    return best[group]


def _supporting_border(slopes: Slopes, saddle: Indices) -> tuple[Indices, Array]:
    """The border that a saddle lies on and where; at a node the flattest of those that rise from it."""
    border, parameter = slopes.cut_border[saddle], slopes.cut_parameter[saddle]
    at_node = np.flatnonzero(border < 0)
    if len(at_node) == 0:
        return border, parameter
    half_vertex = np.concatenate([slopes.low, slopes.high[slopes.level]])
    half_slope = np.concatenate([np.arange(len(slopes.low)), np.flatnonzero(slopes.level)])
    at_high = np.arange(len(half_vertex)) >= len(slopes.low)
    here = np.flatnonzero(np.isin(half_vertex, saddle[at_node]))
    curves = slopes.curves.take(half_slope[here])
    u = np.where(at_high[here], curves.span[:, 1], curves.span[:, 0])
    order = np.lexsort([half_slope[here], steepness(curves, u), half_vertex[here]])
    first = order[np.searchsorted(half_vertex[here][order], saddle[at_node])]
    border, parameter = border.copy(), parameter.copy()
    border[at_node] = slopes.border[half_slope[here][first]]
    parameter[at_node] = u[first]
    return border, parameter


def steepness(curves: Curves, u: Array) -> Array:
    """(n,) |dd / ds| of curves at parameters u (n,).

    Derived: |slope|, |u| / r, and (u / p) / sqrt(1 + (u / p)^2) for the three kinds of curves.
    """
    p = np.where(curves.kind == PARABOLA, curves.size, 1.0)
    root = np.abs(u) / np.where(curves.kind == ROOT, curves.distance(u), 1.0)
    bow = np.abs(u / p) / np.hypot(1.0, u / p)
    return np.where(curves.kind == LINEAR, np.abs(curves.slope), np.where(curves.kind == ROOT, root, bow))


def _extent(slopes: Slopes, vertex: Indices) -> Array:
    """(n, 2, 2) [m] the two vertices of each plateau that are farthest apart (plateaus are straight)."""
    number = np.full(len(slopes.points), -1)
    number[slopes.plateau[vertex]] = np.arange(len(vertex))
    member = np.flatnonzero((number[slopes.plateau] >= 0) & slopes.used)
    group = number[slopes.plateau[member]]
    ends = [slopes.points[vertex]]
    for _end in (0, 1):
        away = np.hypot(*(slopes.points[member] - ends[-1][group]).T)
        order = np.lexsort([-away, group])
        farthest = member[order][np.searchsorted(group[order], np.arange(len(vertex)))]
        ends.append(slopes.points[farthest])
    return np.stack(ends[1:], axis=1)
