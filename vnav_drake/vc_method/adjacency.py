"""The adjacency graph of the cells (Manor 2015, Sec. 2.5)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from vnav_drake.braking import UniformBraking
from vnav_drake.robot import Robot
from vnav_drake.vc_method.cells import CellDecomposition
from vnav_drake.vc_method.profile import arc_minimum_time
from vnav_drake.voronoi import Curves

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

Cost = Literal["published", "realised"]


@dataclass(frozen=True)
class AdjacencyGraph:
    """G^v: one vertex a cell, at its maximum's place and its middle height.

    A Type A edge joins the two cells that meet at a saddle, each the one with its top there. The cells below
    share the vertical partition too, but edges between them would cost the same, and the Type B edges that
    lead down to them are free: with one edge a saddle the size is O(n), whatever a stack looks like.
    """

    decomposition: CellDecomposition
    cost: Cost
    position: Array  # (c, 2) [m]
    speed: Array  # (c,) [m/s]
    type_a: Indices  # (e, 2) cells
    type_a_sides: Indices  # (e, 2) rows of the decomposition's sides
    saddle: Indices  # (e,) row of the critical points
    weight: Array  # (e, 2) [s], of Type A edges forwards and backwards
    type_b: Indices  # (f, 2) cells, the lower one first; they cost nothing

    @property
    def size(self) -> tuple[int, int]:
        """Vertices and edges."""
        return len(self.speed), len(self.type_a) + len(self.type_b)

    def chain(self, edge: int) -> tuple[Curves, Indices]:
        """The arcs that a Type A edge follows forwards, from maximum to maximum, and their borders."""
        curves, _, slope = edge_chains(self.decomposition, self.type_a_sides[[edge]])
        return curves, self.decomposition.slopes.border[slope]


def build_adjacency(
    decomposition: CellDecomposition,
    braking: UniformBraking,
    robot: Robot,
    cost: Cost = "realised",
) -> AdjacencyGraph:
    """The graph of all cells with its weights.

    Parameters
    ----------
    cost : `published`, (v_i - v_ij) / a_b + (v_j - v_ij) / a_max of Sec. 2.5 with the speeds at both maxima
        and at the saddle between them; or `realised`, the least time along the arcs from maximum to maximum
        under V(d), a_max and a_b. The former knows nothing of the length of an arc: a long corridor of
        constant width costs zero.

    Raises
    ------
    ValueError : no such cost.
    """
    if cost not in ("published", "realised"):
        raise ValueError(f"cost = {cost!r}: must be 'published' or 'realised'")
    critical = decomposition.critical
    sides = _edges(decomposition.side_saddle)
    saddle = decomposition.side_saddle[sides[:, 0]]
    if cost == "published":
        top = critical.speed[decomposition.maximum[decomposition.side_stack[sides]]]
        weight = published_cost(top, critical.speed[saddle], braking, robot)
    else:
        weight = np.column_stack(
            [_realised(decomposition, way, braking, robot) for way in (sides, sides[:, ::-1])]
        )
    cell = np.arange(len(decomposition.cell_stack))
    upper = cell[1:][np.diff(decomposition.cell_stack) == 0]
    return AdjacencyGraph(
        decomposition,
        cost,
        critical.point[decomposition.maximum[decomposition.cell_stack]],
        0.5 * (decomposition.cell_bottom + decomposition.cell_top),
        decomposition.side_cell[sides],
        sides,
        saddle,
        weight,
        np.column_stack([upper - 1, upper]),
    )


def published_cost(top: Array, saddle: Array, braking: UniformBraking, robot: Robot) -> Array:
    """Type A edge cost of Manor 2015, Sec. 2.5, (e, 2) [s] forwards and backwards.

    Parameters
    ----------
    top : (e, 2) [m/s], speeds at the maxima at both ends.
    saddle : (e,) [m/s], speed at the saddle between them.
    """
    drop = top - saddle[:, None]
    return drop / braking.max_braking + drop[:, ::-1] / robot.max_acceleration


def edge_chains(decomposition: CellDecomposition, sides: Indices) -> tuple[Curves, Indices, Indices]:
    """The arcs between the maxima on both sides (e, 2) of saddles.

    Returns
    -------
    curves (m,) in the direction of travel, their chains (m,), 0 to e - 1, and their slopes (m,).
    """
    number, step, slope, rising = [], [], [], []
    for end, sign in ((0, -1), (1, 1)):
        corner, edge = decomposition.side_corner[sides[:, end]], np.arange(len(sides))
        count = 0
        while True:
            above = decomposition.parent[corner] >= 0
            corner, edge, count = corner[above], edge[above], count + 1
            if len(corner) == 0:
                break
            way = decomposition.parent_slope[corner]
            number.append(edge)
            step.append(np.full(len(edge), sign * count))
            slope.append(way)
            rising.append((decomposition.slope_corners[way, 0] == corner) == (sign > 0))
            corner = decomposition.parent[corner]
    if not number:
        none = np.zeros(0, dtype=np.int64)
        return decomposition.slopes.curves.take(none), none, none
    numbers, ways = np.concatenate(number), np.concatenate(slope)
    order = np.lexsort([np.concatenate(step), numbers])
    ways = ways[order]
    backwards = ~np.concatenate(rising)[order]
    return decomposition.slopes.curves.take(ways).reversed(backwards), numbers[order], ways


def _realised(
    decomposition: CellDecomposition, sides: Indices, braking: UniformBraking, robot: Robot
) -> Array:
    curves, number, _ = edge_chains(decomposition, sides)
    return arc_minimum_time(curves, number, braking, robot)


def _edges(saddle: Indices) -> Indices:
    """All pairs (e, 2) of rows with the same saddle; rows of a saddle follow each other."""
    pairs, offset = [], 1
    row = np.arange(len(saddle))
    while (saddle[offset:] == saddle[: len(saddle) - offset]).any():
        same = row[: len(saddle) - offset][saddle[offset:] == saddle[: len(saddle) - offset]]
        pairs.append(np.column_stack([same, same + offset]))
        offset += 1
    return np.concatenate(pairs) if pairs else np.zeros((0, 2), dtype=np.int64)
