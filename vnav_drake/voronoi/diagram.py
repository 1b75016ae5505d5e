"""The Voronoi diagram of a world where a robot fits: arcs, nodes and proximity cells."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vnav_drake.problem import PlanningError
from vnav_drake.voronoi import curves as shapes
from vnav_drake.voronoi.boost import boost_topology
from vnav_drake.voronoi.cells import cell_of, foot_coordinate
from vnav_drake.voronoi.check import EQUIDISTANCE, DiagramError, verify_diagram
from vnav_drake.voronoi.curves import LINEAR, Curves
from vnav_drake.voronoi.nodes import Borders, exact_borders
from vnav_drake.voronoi.times import level_parameter
from vnav_drake.world import World

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]

ATTEMPTS = 3  # the input as it is, then two perturbed ones


@dataclass(frozen=True)
class VoronoiDiagram:
    """Borders between proximity cells within the floor, cut to distance >= `radius`.

    A border with `primary` set is a Voronoi arc: its two nearest points are different. The others
    separate the cells of a vertex and its own edge. Cells are numbered `2 e + s` for side s of edge e
    (0: left of it, from its first vertex to its second; 1: right) and `2 len(world.edges) + v` for vertex v.
    """

    world: World
    radius: float  # [m], of the robot
    nodes: Array  # (k, 2) [m]; also the points where a border was cut
    node_distance: Array  # (k,) [m], to the nearest feature: clearance + radius
    curves: Curves  # (m,) from its first node to its second
    ends: Indices  # (m, 2), rows of `nodes`
    cells: Indices  # (m, 2), left and right
    primary: Mask  # (m,)
    notes: tuple[str, ...] = ()
    complete: VoronoiDiagram | None = None  # with radius zero; None if this one is

    @property
    def uncut(self) -> VoronoiDiagram:
        """The diagram of a point robot, from which this one was cut."""
        return self if self.complete is None else self.complete

    @cached_property
    def arcs(self) -> Indices:
        """Indices of the Voronoi arcs among the borders."""
        return np.flatnonzero(self.primary)

    def clearance(self, u: ArrayLike) -> Array:
        """Clearance [m] along the borders at parameters u, (m,) or (m, k)."""
        return self.curves.distance(u) - self.radius

    def feature(self, cells: ArrayLike) -> Indices:
        """Features of cells: edges of the world first, then `len(world.edges)` + vertex."""
        cell = np.asarray(cells, dtype=np.int64)
        edges = len(self.world.edges)
        return np.where(cell < 2 * edges, cell // 2, cell - edges)

    def cell_of(self, points: ArrayLike) -> Indices:
        """Proximity cells that contain points (..., 2) [m]; shape (...). On a border, one of its cells."""
        return cell_of(self.world, points)

    @cached_property
    def _incidence(self) -> tuple[Indices, Indices, Indices]:
        """Half-borders (border, end) in counter-clockwise order around each node, and row offsets."""
        count = len(self.curves)
        border = np.tile(np.arange(count), 2)
        end = np.repeat([0, 1], count)
        out = self.curves.tangents(self.curves.span)
        direction = np.concatenate([out[:, 0], -out[:, 1]])
        angle = np.arctan2(direction[:, 1], direction[:, 0])
        node = self.ends.T.reshape(-1)
        order = np.lexsort([angle, node])
        start = np.searchsorted(node[order], np.arange(len(self.nodes) + 1))
        return border[order], end[order], start

    def incident(self, node: int) -> tuple[Indices, Indices]:
        """Borders at a node counter-clockwise, and which of their ends (0 or 1) is there."""
        border, end, start = self._incidence
        part = slice(start[node], start[node + 1])
        return border[part], end[part]

    @cached_property
    def _by_cell(self) -> tuple[Indices, Indices]:
        cell = self.cells.reshape(-1)
        order = np.argsort(cell, kind="stable")
        count = 2 * len(self.world.edges) + len(self.world.vertices)
        return order, np.searchsorted(cell[order], np.arange(count + 1))

    def cell_borders(self, cell: int) -> tuple[Indices, Mask]:
        """Borders of a cell in order of the feature's coordinate, and which run against that order.

        The coordinate is that of `foot_coordinate`. Secondary borders come first and last; around an
        isolated point the order is cyclic.
        """
        order, start = self._by_cell
        border = order[start[cell] : start[cell + 1]] // 2
        theta = self.foot_coordinate(cell, self.curves.take(border))
        secondary = ~self.primary[border]
        middle = theta.mean(axis=1)
        rank = np.lexsort([secondary * np.where(middle > middle.mean(), 1, -1), middle])
        return border[rank], (theta[:, 1] < theta[:, 0])[rank]

    def foot_coordinate(self, cell: int, curves: Curves) -> Array:
        """(n, 2) foot coordinates of curves' ends in a cell: [m] along an edge, [rad] at a vertex."""
        return foot_coordinate(self.world, cell, curves)

    def restricted(self, radius: float) -> VoronoiDiagram:
        """The part with distance >= `radius` [m] to every feature.

        Borders are split at their least clearance where the robot does not fit, and each side is cut in
        closed form; the cuts become nodes.
        """
        return _restrict(self.uncut, radius)

    def polylines(self, spacing: float) -> list[Array]:
        """Points (n, 2) [m] along each Voronoi arc, at most about `spacing` [m] apart."""
        lines = []
        for i in self.arcs:
            curve = self.curves.take([i])
            if curve.kind[0] == shapes.PARABOLA:
                pieces = max(2, int(np.ceil(curve.length[0] / spacing)))
                s = curve.arc_length(curve.span)[0]
                u = curve.at_arc_length(np.linspace(s[0], s[1], pieces + 1)[None])
            else:
                u = curve.span
            lines.append(curve.points(u)[0])
        return lines


def build_diagram(world: World, radius: float = 0.0) -> VoronoiDiagram:
    """The generalised Voronoi diagram of all features of the world, where a disc of `radius` [m] fits.

    The topology comes from Boost.Polygon on integers, the geometry from the unrounded features. The
    result is verified; when that fails the integers are perturbed by a few units and a note is left.

    Raises
    ------
    PlanningError : no verified diagram was found, or vertices of the world nearly coincide.
    """
    notes: list[str] = []
    for attempt in range(ATTEMPTS):
        slack = 0 if attempt == 0 else 2 ** (attempt + 1)
        try:
            topology = boost_topology(world, slack, seed=attempt)
            if not np.isfinite(topology.vertices).all():
                raise DiagramError("Boost gave a node without a place")
            complete = _complete(world, exact_borders(world, topology, slack), tuple(notes))
            verify_diagram(complete)
        except (DiagramError, np.linalg.LinAlgError) as error:
            notes.append(f"Voronoi diagram, attempt {attempt + 1}: {error}; coordinates perturbed")
            continue
        return complete if radius == 0.0 else complete.restricted(radius)
    raise PlanningError("no valid Voronoi diagram of this world was found; " + "; ".join(notes))


def _complete(world: World, borders: Borders, notes: tuple[str, ...]) -> VoronoiDiagram:
    curves = _geometry(world, borders)
    # Borders that end at a vertex of the world do not meet there: a wall may lie between them.
    touching = borders.distance[borders.ends] == 0.0
    ends = borders.ends.copy()
    ends[touching] = len(borders.nodes) + np.arange(int(touching.sum()))
    nodes = np.concatenate([borders.nodes, borders.nodes[borders.ends[touching]]])
    distance = np.concatenate([borders.distance, np.zeros(int(touching.sum()))])
    # Inside an obstacle, walls that are straight up to rounding can send a border to the other side.
    chord = borders.rough[borders.ends]
    gap = curves.ends - chord
    sound = np.hypot(gap[..., 0], gap[..., 1]).max(axis=1) <= EQUIDISTANCE * world.diameter
    middle = np.where(sound[:, None], curves.points(curves.middle), chord.mean(axis=1))
    on_floor = world.is_floor(middle)
    cells = _cells(world, borders.sites[on_floor], middle[on_floor])
    used, index = np.unique(ends[on_floor], return_inverse=True)
    primary = ~borders.secondary[on_floor]
    return VoronoiDiagram(
        world,
        0.0,
        nodes[used],
        distance[used],
        curves.take(on_floor),
        index.reshape(-1, 2),
        cells,
        primary,
        notes,
    )


def _geometry(world: World, borders: Borders) -> Curves:
    """Exact curves of all borders from their features and nodes."""
    edges = len(world.edges)
    one, other = np.sort(borders.sites, axis=1).T
    start, end = (borders.nodes[borders.ends[:, k]] for k in (0, 1))
    r = borders.distance[borders.ends]
    two_points = one >= edges
    parabola = (one < edges) & (other >= edges) & ~borders.secondary
    straight = ~two_points & ~parabola
    curve = shapes.linear(start[straight], end[straight], r[straight, 0], r[straight, 1])
    p, q = world.vertices[one[two_points] - edges], world.vertices[other[two_points] - edges]
    bisector = shapes.between_points(start[two_points], end[two_points], p, q)
    wall = world.vertices[world.edges[one[parabola]]]
    along = wall[:, 1] - wall[:, 0]
    focus = world.vertices[other[parabola] - edges]
    bow = shapes.point_and_wall(
        start[parabola], end[parabola], focus, wall[:, 0], along / np.hypot(*along.T)[:, None]
    )
    joined = Curves.join([curve, bisector, bow])
    order = np.concatenate([np.flatnonzero(straight), np.flatnonzero(two_points), np.flatnonzero(parabola)])
    return joined.take(np.argsort(order))


def _cells(world: World, sites: Indices, points: Array) -> Indices:
    """Cells (m, 2) from sites (m, 2): the side of an edge is that of `points` (m, 2)."""
    edges = len(world.edges)
    is_edge = sites < edges
    edge = world.edges[np.where(is_edge, sites, 0)]
    a, along = world.vertices[edge[..., 0]], world.vertices[edge[..., 1]] - world.vertices[edge[..., 0]]
    offset = points[:, None] - a
    right = along[..., 0] * offset[..., 1] - along[..., 1] * offset[..., 0] < 0.0
    return np.where(is_edge, 2 * sites + right, sites + edges)


def _restrict(whole: VoronoiDiagram, radius: float) -> VoronoiDiagram:
    if radius == 0.0:
        return whole
    curves = whole.curves
    fits = whole.node_distance >= radius
    reach = level_parameter(curves, radius)
    low, high = curves.span.T  # increasing in a complete diagram
    is_linear = curves.kind == LINEAR
    slope = np.where(is_linear & (curves.slope != 0.0), curves.slope, 1.0)
    with np.errstate(over="ignore"):
        cross = np.clip((radius - curves.size) / slope, low, high)
    before = ~is_linear & (reach > 0.0)  # a curve that dips below the radius: a part on either side
    first_end = np.where(before, np.minimum(high, -reach), high)
    first_end = np.where(is_linear & (curves.slope < 0.0) & ~fits[whole.ends[:, 1]], cross, first_end)
    first_start = np.where(is_linear & (curves.slope > 0.0) & ~fits[whole.ends[:, 0]], cross, low)
    nowhere = is_linear & ~fits[whole.ends].any(axis=1)
    one = np.flatnonzero((first_end > first_start) & ~nowhere)
    second_start = np.maximum(low, reach)
    two = np.flatnonzero(before & (high > second_start))
    index = np.concatenate([one, two])
    span = np.concatenate(
        [np.column_stack([first_start, first_end])[one], np.column_stack([second_start, high])[two]]
    )
    cut = span != curves.span[index]
    piece = _rooted(curves.take(index).cut(span), cut, radius)
    ends = whole.ends[index].copy()
    ends[cut] = len(whole.nodes) + np.arange(int(cut.sum()))
    nodes = np.concatenate([whole.nodes, piece.ends[cut]])
    distance = np.concatenate([whole.node_distance, np.full(int(cut.sum()), radius)])
    keep = np.zeros(len(nodes), dtype=bool)
    keep[: len(whole.nodes)] = fits
    keep[ends.reshape(-1)] = True
    rank = np.cumsum(keep) - 1
    return VoronoiDiagram(
        whole.world,
        radius,
        nodes[keep],
        distance[keep],
        piece,
        rank[ends],
        whole.cells[index],
        whole.primary[index],
        whole.notes,
        whole,
    )


def _rooted(curves: Curves, cut: Mask, radius: float) -> Curves:
    """Linear curves that were cut begin anew at the cut, so that their distance there is `radius` exactly."""
    size, origin, span = curves.size.copy(), curves.origin.copy(), curves.span.copy()
    for end in (0, 1):
        rows = cut[:, end] & (curves.kind == LINEAR)
        shift = curves.span[rows, end]
        origin[rows] += shift[:, None] * curves.axis[rows]
        size[rows] = radius
        span[rows] = curves.span[rows] - shift[:, None]
    return Curves(curves.kind, origin, curves.axis, curves.normal, size, curves.slope, span)
