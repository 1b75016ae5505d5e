"""Proximity cells as strips: one coordinate along the feature, the clearance across it.

Every proximity cell is `{theta range, distance <= ridge(theta)}`. theta is the coordinate of
`voronoi.foot_coordinate`: [m] along a wall, [rad] around a point. Borders between the cells of a wall and
its own ends are lines of constant theta; the ridge is made of Voronoi arcs, a graph over theta. Where the
robot does not fit under the ridge a cell falls into several strips. The cell of an isolated point that
is open all around is periodic in theta.

Seen from its focus a parabola r = (p^2 + u^2) / (2 p) turns by 2 atan(u / p), a line at distance h by
atan(u / h); along a wall theta is linear in u for every border. So theta(u), its inverse and the height of
the ridge are closed forms.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vnav_drake.voronoi import LINEAR, PARABOLA, Curves, VoronoiDiagram
from vnav_drake.world import World

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]

TURN = 2.0 * np.pi
_BEYOND = 0.5 * np.pi - 1e-9  # [rad]: a line is seen under less than a quarter turn from its foot


@dataclass(frozen=True)
class Strips:
    """All strips of a restricted diagram, and its borders as their cells see them.

    A *side* `2 c + s` is border c seen from its cell `diagram.cells[c, s]`. The ridge of strip k is
    `ridge[first[k] : first[k + 1]]`, sides of Voronoi arcs in order of theta.
    """

    diagram: VoronoiDiagram
    cell: Indices  # (n,)
    at_point: Mask  # (n,) the feature is a vertex
    isolated: Mask  # (n,) a vertex without edges
    periodic: Mask  # (n,) theta runs over a full turn
    low: Array  # (n,) least theta
    high: Array  # (n,) greatest theta; low + 2 pi when periodic
    ridge: Indices  # (r,) sides
    first: Indices  # (n + 1,) rows of `ridge`
    row_start: Array  # (r,) theta where each arc of the ridge begins; it ends where the next begins
    side_strip: Indices  # (2 m,) strip of each side; -1 if none
    side_row: Indices  # (2 m,) row of each side in `ridge`; -1 for borders of constant theta
    side_order: Indices  # (2 m,) 0: border at the low end, 1: ridge, 2: border at the high end
    base: Array  # (2 m,) theta = base + rate g(u)
    rate: Array  # (2 m,)

    def __len__(self) -> int:
        return len(self.cell)

    def theta(self, side: ArrayLike, u: ArrayLike) -> Array:
        """theta of points at parameters u (k,) [m] on sides (k,); [m] along walls, [rad] around points."""
        row = np.asarray(side, dtype=np.int64)
        v = np.asarray(u, dtype=float)
        return self.base[row] + self.rate[row] * _seen(self._side_form[row], self._side_size[row], v)

    def parameter(self, side: ArrayLike, theta: ArrayLike) -> Array:
        """Inverse of `theta` for sides (k,) of Voronoi arcs: u (k,) [m], not limited to the arc."""
        row = np.asarray(side, dtype=np.int64)
        rate = np.where(self.rate[row] != 0.0, self.rate[row], 1.0)
        seen = (np.asarray(theta, dtype=float) - self.base[row]) / rate
        form, size = self._side_form[row], self._side_size[row]
        return np.where(form == 0, seen, size * np.tan(np.clip(seen, -_BEYOND, _BEYOND)))

    def outward(self, side: ArrayLike, u: ArrayLike) -> Array:
        """How fast the distance grows [m/m] along sides of arcs (k,) at u (k,) as theta grows.

        dr/ds = slope, u / hypot(h, u) or (u / p) / hypot(1, u / p) along the axis.
        """
        row = np.asarray(side, dtype=np.int64)
        curve = row // 2
        curves, v = self.diagram.curves, np.asarray(u, dtype=float)
        size = curves.size[curve]
        rise = np.divide(v, np.hypot(size, v), out=np.zeros_like(v), where=curves.kind[curve] != LINEAR)
        return np.sign(self.rate[row]) * np.where(curves.kind[curve] == LINEAR, curves.slope[curve], rise)

    def wrapped(self, strip: Indices, theta: Array) -> Array:
        """theta moved by full turns into [low, low + 2 pi) where the strip is periodic; same shape."""
        low = self.low[strip]
        turned = low + np.mod(theta - low, TURN)
        return np.where(self.periodic[strip], np.where(turned < low + TURN, turned, low), theta)

    def row_at(self, strip: Indices, theta: Array) -> Indices:
        """Row of `ridge` over theta in a strip; the nearest one beyond the strip's ends. Same shape."""
        place = self._key(strip, self.wrapped(strip, theta))
        row = np.searchsorted(self._row_key, place, side="right") - 1
        return np.clip(row, self.first[strip], self.first[strip + 1] - 1)

    def height(self, strip: Indices, theta: Array, row: Indices | None = None) -> Array:
        """Distance [m] of the ridge from the feature at theta; same shape."""
        over = self.row_at(strip, theta) if row is None else row
        side = self.ridge[over]
        if row is None:
            theta = self.wrapped(strip, theta)
        u = self.parameter(side, theta)
        curve = side // 2
        curves = self.diagram.curves
        span = curves.span[curve]
        u = np.clip(u, span[..., 0], span[..., 1])
        size, kind = curves.size[curve], curves.kind[curve]
        bow = (size * size + u * u) / (2.0 * np.where(kind == PARABOLA, size, 1.0))
        straight = np.where(kind == LINEAR, size + curves.slope[curve] * u, np.hypot(size, u))
        return np.where(kind == PARABOLA, bow, straight)

    def points(self, strip: Indices, theta: Array, distance: Array) -> Array:
        """Positions [m] of strip coordinates: `strip` (k,), the others (k,) or (k, j); shape (..., 2)."""
        shape = (-1,) + (1,) * (theta.ndim - 1)
        origin, along, across = self._frame(strip)
        at_point = self.at_point[strip].reshape(shape)
        angle = theta + self._reference[strip].reshape(shape)
        column = (slice(None),) + (None,) * (theta.ndim - 1)
        flat = theta[..., None] * along[column] + distance[..., None] * across[column]
        polar = distance[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        return origin[column] + np.where(at_point[..., None], polar, flat)

    def coordinates(self, point: Array) -> tuple[Array, Array]:
        """theta and distance of one point (2,) [m] as every strip's feature sees it: (n,), (n,).

        The distance is that from the line of a wall, negative behind it.
        """
        strip = np.arange(len(self))
        origin, along, across = self._frame(strip)
        offset = point - origin
        turned = np.arctan2(offset[:, 1], offset[:, 0]) - self._reference
        # sectors lie between 0 and 2 pi; strips of an isolated point may begin anywhere
        near = np.where(self.isolated, 0.5 * (self.low + self.high), np.pi)
        turned = near + np.mod(turned - near + np.pi, TURN) - np.pi
        theta = np.where(self.at_point, turned, np.einsum("ij,ij->i", offset, along))
        reach = np.where(
            self.at_point, np.hypot(offset[:, 0], offset[:, 1]), np.einsum("ij,ij->i", offset, across)
        )
        return self.wrapped(strip, theta), reach

    def _frame(self, strip: Indices) -> tuple[Array, Array, Array]:
        """Origin, unit vector along the feature and away from it, (k, 2) each; zero vectors at points."""
        world, edges = self.diagram.world, len(self.diagram.world.edges)
        cell = self.cell[strip]
        at_point = self.at_point[strip]
        origin = world.vertices[np.where(at_point, cell - 2 * edges, 0)]
        along = np.zeros_like(origin)
        wall = np.flatnonzero(~at_point)
        edge = world.edges[cell[wall] // 2]
        origin[wall] = world.vertices[edge[:, 0]]
        step = world.vertices[edge[:, 1]] - origin[wall]
        along[wall] = step / np.hypot(step[:, 0], step[:, 1])[:, None]
        side = np.where(cell % 2 == 0, 1.0, -1.0)
        across = np.column_stack([-along[:, 1], along[:, 0]]) * side[:, None]
        return origin, along, across

    def _key(self, strip: Indices, theta: Array) -> Array:
        """A number that orders strips first and theta within a strip second."""
        share = (theta - self.low[strip]) / self._width[strip]
        return strip + 0.5 * np.clip(share, 0.0, 1.0)

    @cached_property
    def _width(self) -> Array:
        return np.maximum(self.high - self.low, np.finfo(float).tiny)

    @cached_property
    def _row_key(self) -> Array:
        strip = np.repeat(np.arange(len(self)), np.diff(self.first))
        return self._key(strip, self.row_start)

    @cached_property
    def _reference(self) -> Array:
        """(n,) [rad] the direction of theta = 0 at points; 0 at walls."""
        edges = len(self.diagram.world.edges)
        vertex = np.where(self.at_point, self.cell - 2 * edges, 0)
        return np.where(self.at_point, reference_angles(self.diagram.world)[0][vertex], 0.0)

    @cached_property
    def _side_form(self) -> Indices:
        return _forms(self.diagram)

    @cached_property
    def _side_size(self) -> Array:
        return np.repeat(self.diagram.curves.size, 2)


def reference_angles(world: World) -> tuple[Array, Mask]:
    """(v,) [rad] direction from which theta is counted at every vertex, and which have no edges.

    The middle of the walls that meet there; -x at isolated points, as in `voronoi.foot_coordinate`.
    """
    a, b = world.vertices[world.edges[:, 0]], world.vertices[world.edges[:, 1]]
    step = (b - a) / np.hypot(*(b - a).T)[:, None]
    balance = np.zeros_like(world.vertices)
    np.add.at(balance, world.edges[:, 0], step)
    np.add.at(balance, world.edges[:, 1], -step)
    alone = np.ones(len(world.vertices), dtype=bool)
    alone[world.edges.reshape(-1)] = False
    return np.where(alone, np.pi, np.arctan2(balance[:, 1], balance[:, 0])), alone


def build_strips(diagram: VoronoiDiagram) -> Strips:
    """The strips of a restricted diagram.

    Parameters
    ----------
    diagram : `diagram.restricted(level)` with the distance [m] at which the safe speed is zero.
    """
    edges = len(diagram.world.edges)
    cell = diagram.cells.reshape(-1)
    primary = np.repeat(diagram.primary, 2)
    base, rate = _charts(diagram)
    alone = np.concatenate([np.zeros(2 * edges, dtype=bool), reference_angles(diagram.world)[1]])
    curve = np.arange(len(cell)) // 2
    curves = diagram.curves
    middle = base + rate * _seen(_forms(diagram), curves.size[curve], curves.middle[curve])

    ridge = np.flatnonzero(primary)
    ridge = ridge[np.lexsort([middle[ridge], cell[ridge]])]
    ridge, base, linked = _unrolled(diagram, ridge, base, rate, cell, alone)
    starts = np.flatnonzero(~linked)
    first = np.append(starts, len(ridge))
    strip_of_row = np.cumsum(~linked) - 1
    strip_cell = cell[ridge[starts]]
    low_end, high_end = _end_nodes(diagram, ridge, rate)
    last = first[1:] - 1
    periodic = alone[strip_cell] & (high_end[last] == low_end[starts]) & (last > starts)

    side_strip = np.full(len(cell), -1)
    side_row = np.full(len(cell), -1)
    side_order = np.ones(len(cell), dtype=np.int64)
    side_strip[ridge], side_row[ridge] = strip_of_row, np.arange(len(ridge))
    secondary = np.flatnonzero(~primary)
    top = np.argmax(curves.distance(curves.span), axis=1)
    node = diagram.ends[secondary // 2, top[secondary // 2]]
    count = len(diagram.nodes)
    want = cell[secondary] * count + node
    for order, ends in ((0, low_end[starts]), (2, high_end[last])):
        have = strip_cell * count + ends
        rank = np.argsort(have)
        at = np.clip(np.searchsorted(have[rank], want), 0, max(len(have) - 1, 0))
        found = have[rank[at]] == want if len(have) else np.zeros(len(want), dtype=bool)
        side_strip[secondary[found]] = rank[at[found]]
        side_order[secondary[found]] = order

    def ends_of(rows: Indices, low: bool) -> Array:
        side = ridge[rows]
        span = curves.span[side // 2]
        at_low = (rate[side] > 0.0) == low
        u = np.where(at_low, span[:, 0], span[:, 1])
        return base[side] + rate[side] * _seen(_forms(diagram)[side], curves.size[side // 2], u)

    row_start = ends_of(np.arange(len(ridge)), low=True)
    low = row_start[starts]
    high = np.where(periodic, low + TURN, ends_of(last, low=False))
    return Strips(
        diagram,
        strip_cell,
        strip_cell >= 2 * edges,
        alone[strip_cell],
        periodic,
        low,
        high,
        ridge,
        first,
        row_start,
        side_strip,
        side_row,
        side_order,
        base,
        rate,
    )


def _unrolled(
    diagram: VoronoiDiagram, ridge: Indices, base: Array, rate: Array, cell: Indices, alone: Mask
) -> tuple[Indices, Array, Mask]:
    """Ridge rows with strips contiguous, bases moved by full turns, and which rows go on from the one before.

    Around an isolated point that is not open all around, rows before the first break belong after the last.
    """
    linked = _linked(diagram, ridge, rate, cell)
    begins = np.flatnonzero(np.append(True, np.diff(cell[ridge]) != 0)) if len(ridge) else np.zeros(0, int)
    ends = np.append(begins[1:], len(ridge)) - 1
    low_end, high_end = _end_nodes(diagram, ridge, rate)
    closes = alone[cell[ridge[begins]]] & (high_end[ends] == low_end[begins]) & (ends > begins)
    group = np.repeat(np.arange(len(begins)), ends - begins + 1)
    breaks = ~linked
    breaks[begins] = False
    before = np.cumsum(breaks)
    inside = before - before[begins][group] == 0  # rows before the first break of their cell
    broken = before[ends] > before[begins]
    move = inside & (closes & broken)[group]
    if move.any():
        base = base.copy()
        base[ridge[move]] += TURN
        ridge = ridge[np.lexsort([np.arange(len(ridge)), move, cell[ridge]])]
        linked = _linked(diagram, ridge, rate, cell)
    return ridge, base, linked


def _linked(diagram: VoronoiDiagram, ridge: Indices, rate: Array, cell: Indices) -> Mask:
    """Which ridge rows begin at the node where the row before them ends, in the same cell."""
    low_end, high_end = _end_nodes(diagram, ridge, rate)
    linked = np.zeros(len(ridge), dtype=bool)
    linked[1:] = (cell[ridge[1:]] == cell[ridge[:-1]]) & (low_end[1:] == high_end[:-1])
    return linked


def _end_nodes(diagram: VoronoiDiagram, side: Indices, rate: Array) -> tuple[Indices, Indices]:
    """Nodes at the low and the high end in theta of sides of arcs."""
    ends, grows = diagram.ends[side // 2], rate[side] > 0.0
    return np.where(grows, ends[:, 0], ends[:, 1]), np.where(grows, ends[:, 1], ends[:, 0])


def _forms(diagram: VoronoiDiagram) -> Indices:
    """(2 m,) how theta depends on u: 0 linearly, 1 as atan(u / h), 2 as atan(u / p) (twice, by `rate`)."""
    at_point = diagram.cells.reshape(-1) >= 2 * len(diagram.world.edges)
    return np.where(at_point, np.repeat(diagram.curves.kind, 2), 0)


def _seen(form: Indices, size: Array, u: Array) -> Array:
    safe = np.where((form > 0) & (size > 0.0), size, 1.0)
    return np.where(form == 0, u, np.arctan(u / safe))


def _charts(diagram: VoronoiDiagram) -> tuple[Array, Array]:
    """base and rate of every side: theta = base + rate g(u)."""
    world, curves = diagram.world, diagram.curves
    edges = len(world.edges)
    cell = diagram.cells.reshape(-1)
    both: Curves = curves.take(np.arange(len(cell)) // 2)
    at_point = cell >= 2 * edges
    # along walls
    edge = world.edges[np.where(at_point, 0, cell // 2)] if edges else np.zeros((len(cell), 2), dtype=int)
    a = world.vertices[edge[:, 0]]
    step = world.vertices[edge[:, 1]] - a
    size = np.hypot(step[:, 0], step[:, 1])
    along = step / np.where(size > 0.0, size, 1.0)[:, None]
    wall_base = np.einsum("ij,ij->i", both.origin - a, along)
    wall_rate = np.einsum("ij,ij->i", both.axis, along)
    # around points
    reference, _ = reference_angles(world)
    vertex = np.where(at_point, cell - 2 * edges, 0)
    middle = both.middle
    offset = both.points(middle) - world.vertices[vertex]
    rise = np.where(both.kind == PARABOLA, middle / np.where(both.size > 0.0, both.size, 1.0), 0.0)
    tangent = both.axis + rise[:, None] * both.normal
    angle = np.mod(np.arctan2(offset[:, 1], offset[:, 0]) - reference[vertex], TURN)
    turn = np.sign(offset[:, 0] * tangent[:, 1] - offset[:, 1] * tangent[:, 0])
    point_rate = turn * np.where(both.kind == PARABOLA, 2.0, np.where(both.kind == LINEAR, 0.0, 1.0))
    seen = np.where(both.kind == LINEAR, 0.0, np.arctan(middle / np.where(both.size > 0.0, both.size, 1.0)))
    base = np.where(at_point, angle - point_rate * seen, wall_base)
    rate = np.where(at_point, point_rate, wall_rate)
    # borders between a wall and its own end stand on it: theta does not change along them
    radial = np.repeat(~diagram.primary, 2) & ~at_point
    base = np.where(radial, wall_base + wall_rate * middle, base)
    return base, np.where(radial, 0.0, rate)
