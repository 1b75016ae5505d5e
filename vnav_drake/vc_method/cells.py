"""The cellular decomposition of the free position-velocity space (Manor 2015, Definitions 6 to 8).

Vertical partitions, one a saddle, cut F^v into stacks; horizontal partitions at the heights of the saddles
around a stack and of its maximum cut the stack into cells. Derived: cut at its saddles, the graph of slopes
falls into trees with one maximum each (the sum of 1 - k over such a tree is 1, see `critical`), and all
of a stack above a height is connected, as everything in it rises to that maximum. So a stack has exactly
one maximum and one cell between any two heights that follow each other; four with three saddles at
heights of their own, as the thesis draws it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order

from vnav_drake.problem import PlanningError
from vnav_drake.vc_method.critical import CriticalPoints, passage_core
from vnav_drake.vc_method.slopes import Slopes, cut_into_slopes
from vnav_drake.voronoi import VoronoiDiagram
from vnav_drake.world import World

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


@dataclass(frozen=True)
class VerticalPartition:
    """The plane piece through a saddle between its two feet, from v = 0 up to the saddle (Definition 6)."""

    saddle: int  # row of the critical points
    point: Array  # (2,) [m]
    feet: Array  # (2, 2) [m], nearest points of the obstacles on either side
    height: float  # [m/s], speed of the saddle


@dataclass(frozen=True)
class HorizontalPartition:
    """The slice of a stack at the height of critical points around or in it (Definition 7)."""

    stack: int
    critical: tuple[int, ...]  # rows of the critical points at this height
    height: float  # [m/s]


@dataclass(frozen=True)
class Cell:
    """The part of a stack between two heights that follow each other."""

    stack: int
    bottom: float  # [m/s]
    top: float  # [m/s]


@dataclass(frozen=True)
class Stack:
    """Cells above each other under one maximum."""

    maximum: int  # row of the critical points
    saddles: tuple[int, ...]  # rows of the critical points; twice when the stack meets itself there
    heights: tuple[float, ...]  # [m/s], tops of the cells, rising; the last is that of the maximum
    cells: tuple[Cell, ...]
    borders: tuple[int, ...]  # arcs within, rows of `diagram.curves`; those through a saddle lie in two


@dataclass(frozen=True)
class CellDecomposition:
    """Stacks (k), their cells (c) and the ways from saddles into stacks (s, two a saddle).

    Corners are vertices of the slopes, but a saddle is a corner of its own on each of its sides. In each
    stack the slopes form a tree, its root the maximum; `parent` is the next corner towards it.
    """

    critical: CriticalPoints
    diagram: VoronoiDiagram
    slopes: Slopes
    maximum: Indices  # (k,) row of the critical points
    cell_stack: Indices  # (c,) cells of a stack follow each other from the bottom to the top
    cell_bottom: Array  # (c,) [m/s]
    cell_top: Array  # (c,) [m/s]
    first_cell: Indices  # (k + 1,)
    side_saddle: Indices  # (s,) row of the critical points
    side_stack: Indices  # (s,)
    side_cell: Indices  # (s,) the cell whose top is at the saddle
    side_corner: Indices  # (s,)
    slope_stack: Indices  # (p,)
    slope_corners: Indices  # (p, 2) at the low and at the high end
    parent: Indices  # (corners,), -1 at maxima and for corners that are not used
    parent_slope: Indices  # (corners,)
    height_stack: Indices  # (s + k,) of all sides, then all maxima: stack, cell below, row of critical points
    height_cell: Indices
    height_critical: Indices

    @property
    def cell_count(self) -> Indices:
        """(k,) cells of each stack."""
        return np.diff(self.first_cell)

    @property
    def share_of_four(self) -> float:
        """Share of the stacks with exactly four cells, which the thesis calls generic; nan without stacks."""
        return float(np.mean(self.cell_count == 4)) if len(self.maximum) else float("nan")

    @cached_property
    def stacks(self) -> tuple[Stack, ...]:
        """All stacks, each with its cells."""
        count = len(self.maximum)
        saddles = _split(self.side_stack, self.side_saddle, count)
        pair = np.unique(np.column_stack([self.slope_stack, self.slopes.border]), axis=0)
        borders = _split(pair[:, 0], pair[:, 1], count)
        out = []
        for i in range(count):
            part = slice(self.first_cell[i], self.first_cell[i + 1])
            bottom, top = self.cell_bottom[part].tolist(), self.cell_top[part].tolist()
            cells = tuple(Cell(i, b, t) for b, t in zip(bottom, top, strict=True))
            out.append(Stack(int(self.maximum[i]), saddles[i], tuple(top), cells, borders[i]))
        return tuple(out)

    @cached_property
    def stack_of_node(self) -> Indices:
        """(nodes of the diagram,) the stack a node lies in; -1 for saddles and nodes without arcs."""
        out = np.full(len(self.diagram.nodes), -1)
        for corner in self.slope_corners.T:
            at_node = corner < len(out)
            out[corner[at_node]] = self.slope_stack[at_node]
        return out

    @cached_property
    def vertical_partitions(self) -> tuple[VerticalPartition, ...]:
        """One a saddle, in the order of the critical points."""
        critical = self.critical
        rows = critical.saddles
        feet = feet_of(
            self.diagram.world,
            self.diagram.feature(self.diagram.cells[critical.border[rows]]),
            critical.point[rows],
        )
        return tuple(
            VerticalPartition(int(r), critical.point[r], f, float(critical.speed[r]))
            for r, f in zip(rows, feet, strict=True)
        )

    @cached_property
    def horizontal_partitions(self) -> tuple[HorizontalPartition, ...]:
        """One above each cell."""
        points = _split(self.height_cell, self.height_critical, len(self.cell_top))
        return tuple(
            HorizontalPartition(int(s), tuple(sorted(set(p))), float(v))
            for s, p, v in zip(self.cell_stack, points, self.cell_top, strict=True)
        )

    def cell_at(self, stack: int, speed: float) -> int:
        """The cell of a stack at a speed [m/s]: the lower one on a partition, at most the top one."""
        tops = self.cell_top[self.first_cell[stack] : self.first_cell[stack + 1]]
        return int(self.first_cell[stack] + min(int(np.searchsorted(tops, speed)), len(tops) - 1))

    def ascent(self, corner: int) -> Indices:
        """Corners from one to the maximum of its stack, both included."""
        way = [corner]
        while self.parent[way[-1]] >= 0:
            way.append(int(self.parent[way[-1]]))
        return np.array(way)


def decompose(critical: CriticalPoints, diagram: VoronoiDiagram) -> CellDecomposition:
    """Stacks and cells of the free position-velocity space.

    Parameters
    ----------
    critical : `critical_points(diagram, ...)` of the same diagram.

    Raises
    ------
    PlanningError : a stack without exactly one maximum, which rounding alone can cause.
    """
    slopes = cut_into_slopes(diagram)
    corners, opening = _corners(slopes, critical)
    count = len(slopes.points) + 2 * len(slopes.border)
    maximum = critical.maxima
    root = critical.vertex[maximum]
    parent, parent_slope, stack_of = _trees(corners, count, root)
    slope_stack = stack_of[corners[:, 0]]
    if (slope_stack < 0).any() or len(corners) != int((parent >= 0).sum()):
        bad = int(np.argmin(slope_stack)) if len(slope_stack) else 0
        x, y = slopes.points[slopes.high[bad]]
        raise PlanningError(f"the arcs around ({x:.6g}, {y:.6g}) are not one stack under one maximum")
    side_corner, vertex = opening
    row = np.full(len(slopes.points), -1)
    row[critical.vertex] = np.arange(len(critical))
    order = np.argsort(row[vertex], kind="stable")
    side_corner, side_saddle = side_corner[order], row[vertex][order]
    side_stack = stack_of[side_corner]
    height_stack = np.concatenate([side_stack, np.arange(len(maximum))])
    height_critical = np.concatenate([side_saddle, maximum])
    tops, height_cell = _heights(critical, height_stack, height_critical, slopes.rounding)
    cell_stack, cell_top = tops
    first_cell = np.searchsorted(cell_stack, np.arange(len(maximum) + 1))
    lowest = np.diff(cell_stack, prepend=-1) != 0
    cell_bottom = np.where(lowest, 0.0, np.concatenate([[0.0], cell_top])[:-1])
    return CellDecomposition(
        critical,
        diagram,
        slopes,
        maximum,
        cell_stack,
        cell_bottom,
        cell_top,
        first_cell,
        side_saddle,
        side_stack,
        height_cell[: len(side_stack)],
        side_corner,
        slope_stack,
        corners,
        parent,
        parent_slope,
        height_stack,
        height_cell,
        height_critical,
    )


def _corners(slopes: Slopes, critical: CriticalPoints) -> tuple[Indices, tuple[Indices, Indices]]:
    """Corners of all slopes (p, 2), and of the sides of the saddles: their corners and vertices.

    A side is a slope that leads from the saddle to a maximum: a rising one, or a level one along the
    plateau. Whatever else ends there hangs on its first side.
    """
    count = len(slopes.points)
    ends = np.column_stack([slopes.low, slopes.high])
    core = passage_core(slopes)
    leads = np.column_stack([~slopes.level, np.zeros(len(ends), dtype=bool)])
    leads |= slopes.level[:, None] & core[ends[:, ::-1]]
    saddle = np.zeros(count, dtype=bool)
    saddle[critical.vertex[critical.saddles]] = True
    half = np.flatnonzero(saddle[ends.reshape(-1)])
    vertex, is_side = ends.reshape(-1)[half], leads.reshape(-1)[half]
    order = np.lexsort([half, ~is_side, vertex])
    half, vertex, is_side = half[order], vertex[order], is_side[order]
    first = half[np.searchsorted(vertex, vertex)]
    corners = ends.reshape(-1).copy()
    corners[half] = count + np.where(is_side, half, first)
    return corners.reshape(-1, 2), (corners[half[is_side]], vertex[is_side])


def _trees(corners: Indices, count: int, root: Indices) -> tuple[Indices, Indices, Indices]:
    """Parent corner, slope towards it and number of the root, of each corner; -1 where there is none."""
    start, ways = count, len(corners)
    one = np.concatenate([corners[:, 0], np.full(len(root), start)])
    other = np.concatenate([corners[:, 1], root])
    graph = coo_array((np.ones(len(one)), (one, other)), shape=(count + 1, count + 1))
    order, before = breadth_first_order(graph.tocsr(), start, directed=False)
    order = order[1:].astype(np.int64)
    parent = before[:-1].astype(np.int64)
    parent = np.where((parent == start) | (parent < 0), -1, parent)
    parent_slope = np.full(count, -1)
    for child, above in ((0, 1), (1, 0)):
        a, b = corners[:, child], corners[:, above]
        upward = np.flatnonzero(parent[a] == b)
        parent_slope[a[upward]] = np.arange(ways)[upward]
    owner = np.full(count, -1)
    owner[root] = np.arange(len(root))
    # pointers jump twice as far each time
    jump = np.where(parent >= 0, parent, np.arange(count))
    while not np.array_equal(jump[jump], jump):
        jump = jump[jump]
    return parent, parent_slope, owner[jump]


def _heights(
    critical: CriticalPoints, stack: Indices, row: Indices, rounding: float
) -> tuple[tuple[Indices, Array], Indices]:
    """Cells as (stack, top [m/s]) in order, and for each given critical point the cell it is the top of.

    Heights that differ by rounding, or not at all under a speed limit, are one. A saddle at speed zero
    has no cell below it: it counts with the lowest.
    """
    order = np.lexsort([critical.clearance[row], stack])
    s, d, v = stack[order], critical.clearance[row][order], critical.speed[row][order]
    new = np.diff(s, prepend=-1) != 0
    opens = new | ((np.diff(d, prepend=0.0) > rounding) & (np.diff(v, prepend=0.0) > 0.0))
    group = np.cumsum(opens) - 1
    last = np.flatnonzero(np.append(opens[1:], True))
    only = np.append(s[last][1:] != s[last][:-1], True)  # the height of the maximum
    keep = (v[last] > 0.0) | only
    cell = np.cumsum(keep) - keep  # a dropped height is followed by the cell that it counts with
    out = np.empty(len(order), dtype=np.int64)
    out[order] = cell[group]
    return (s[last][keep], v[last][keep]), out


def feet_of(world: World, feature: Indices, points: Array) -> Array:
    """Nearest points (n, k, 2) [m] of features (n, k) (edges first, then vertices) to points (n, 2) [m]."""
    edges = len(world.edges)
    is_edge = feature < edges
    vertex = np.where(is_edge, 0, feature - edges)
    edge = world.edges[np.where(is_edge, feature, 0)] if edges else np.stack([vertex, vertex], axis=-1)
    a = world.vertices[np.where(is_edge, edge[..., 0], vertex)]
    b = world.vertices[np.where(is_edge, edge[..., 1], vertex)]
    along = b - a
    square = np.einsum("nkj,nkj->nk", along, along)
    part = np.einsum("nkj,nkj->nk", points[:, None] - a, along) / np.where(square > 0.0, square, 1.0)
    return np.asarray(a + np.clip(part, 0.0, 1.0)[..., None] * along)


def _split(owner: Indices, value: Indices, count: int) -> list[tuple[int, ...]]:
    """The values of each owner 0 .. count - 1, in order."""
    order = np.argsort(owner, kind="stable")
    start = np.searchsorted(owner[order], np.arange(count + 1)).tolist()
    flat = value[order].tolist()
    return [tuple(flat[a:b]) for a, b in pairwise(start)]
