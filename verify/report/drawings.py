"""What the planners tell beyond the result folder, in the form in which it is drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from vnav_drake.plan import Trajectory

Array = NDArray[np.float64]

MOST_LINES = 2000  # of a graph that are drawn: more are one blue area, and half a megabyte


@dataclass(frozen=True, kw_only=True)
class GraphDrawing:
    """A speed graph, its edges as polylines of equally many points each; edges may share lines."""

    kind: str  # sampled, published
    nodes: Array  # (n, 2) [m]
    lines: Array  # (k, p, 2) [m]
    shown: int  # edges that the lines draw
    total: int  # edges of the graph


@dataclass(frozen=True, kw_only=True)
class ClassDrawing:
    """The optimal path of one homotopy class."""

    rank: int  # from 1
    name: str
    points: Array  # (n, 2) [m], along the path
    motion: Trajectory | None  # its fastest motion in the variational model
    iteration_times: Sequence[float] = ()  # [s], travel time after each Newton iteration
    residuals: Sequence[float] = ()  # of the optimality conditions after each Newton iteration


@dataclass(frozen=True, kw_only=True)
class SpeedGraphDrawing:
    """The graphs and the classes, best class first."""

    graphs: Sequence[GraphDrawing] = ()
    classes: Sequence[ClassDrawing] = ()


@dataclass(frozen=True, kw_only=True)
class CellGraphDrawing:
    """The adjacency graph of the cells: places [m] and speeds [m/s], and what of it the route uses."""

    nodes: Array  # (c, 3)
    on_route: NDArray[np.bool_]  # (c,)
    type_a: Sequence[Array]  # (k, 3) each, along the arcs, heights between those of the ends
    type_a_on_route: Sequence[bool]
    type_b: Array  # (b, 2, 3)
    type_b_on_route: Sequence[bool]


@dataclass(frozen=True, kw_only=True)
class SpaceDrawing:
    """Free position-velocity space with its cells and their graph: places [m] and speeds [m/s]."""

    roof: Array  # (n, 4, 3), patches of v = V(d(q)): above them are the vc-obstacles
    ridges: Sequence[Array]  # (k, 3) each, Voronoi arcs on the roof
    vertical: Sequence[Array]  # (k, 3) each, outlines of vertical partitions
    horizontal: Sequence[tuple[float, shapely.Geometry]]  # speed, floor plan of a horizontal partition
    feet: Array  # (s, 2, 2), ends of the bottom edges of the vertical partitions
    saddles: Array  # (s, 3)
    maxima: Array  # (m, 3)
    graph: CellGraphDrawing
    stacks: int  # drawn
    total: int  # of the world


@dataclass(frozen=True, kw_only=True)
class UnfoldedStack:
    """A stack where the route passes it."""

    begin: float  # [m], arc length at which the route enters it
    end: float  # [m]
    tops: Sequence[float]  # [m/s], of its cells, rising
    used: Sequence[bool]  # which of its cells are in the chain
    ground: shapely.Geometry  # its floor plan


@dataclass(frozen=True, kw_only=True)
class UnfoldedDrawing:
    """The route unfolded along its arcs (Manor 2015, Fig. 2.10): arc lengths [m] and speeds [m/s]."""

    s: Array  # (n,)
    roof: Array  # (n,), V(d(s))
    pieces: Sequence[tuple[str, Array, Array]]  # boundary, accelerate or brake; arc lengths, speeds
    stacks: Sequence[UnfoldedStack]
    saddles: Array  # (k, 2), arc length and speed of the vertical partitions
    nodes: Array  # (j,), arc lengths of the Voronoi nodes passed
    chain: Array  # (c, 2), the vertices of the chain of cells
    driven: Array  # (m, 2), the motion on the smooth path, its places taken to the arcs
    corners: Array  # (r, 4), arc length and speed in the middle, radius taken and wanted [m]


@dataclass(frozen=True, kw_only=True)
class VcDrawing:
    """The vc-method: its space, the route unfolded, and the routes that both costs choose."""

    space: SpaceDrawing
    unfolded: UnfoldedDrawing
    arcs: Sequence[Array]  # (n, 2) each, all Voronoi arcs
    route: Array  # (n, 2), along the arcs
    other: Array | None  # (n, 2), of the other cost, where it chooses another way
    cost: str  # that chose the route: realised, published
    other_cost: str


def share(count: int, most: int) -> NDArray[np.int64]:
    """At most `most` of the numbers 0 .. count - 1, evenly spread and always the same."""
    if count <= most:
        return np.arange(count)
    return np.linspace(0, count - 1, most).round().astype(np.int64)
