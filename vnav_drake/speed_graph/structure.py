"""What a path in its homotopy class is made of: joins on the borders of cells, legs and rides between them.

A join is of one kind:

* END: start or goal; fixed;
* CROSS: the path crosses a border from cell to cell;
* ATTACH, LEAVE: it reaches a Voronoi arc tangentially and follows it, or leaves it;
* NODE: it passes a Voronoi node; fixed, until the path is found to have a kink there.

Between joins it runs through a cell (a leg, optimal near that cell's feature) or along a border (a ride).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from vnav_drake.voronoi import VoronoiDiagram

Array = NDArray[np.float64]

NODE_TOLERANCE = 1e-9  # [m]: a stop this near to the end of its border is at the node


class Kind(Enum):
    """What happens at a join."""

    END = "end"
    CROSS = "cross"
    ATTACH = "attach"
    LEAVE = "leave"
    NODE = "node"


@dataclass(frozen=True)
class Join:
    """One place where a path changes from one piece to the next."""

    kind: Kind
    border: int = -1  # row of the diagram's curves; -1 for a node or an end off the borders
    u: float = 0.0  # parameter on that border
    node: int = -1  # row of the diagram's nodes, for NODE and for an END at one
    place: tuple[float, float] | None = None  # [m], for END only


@dataclass(frozen=True)
class Piece:
    """What lies between two joins: a leg through `cell`, or a ride along `border`; the other is -1."""

    cell: int = -1
    border: int = -1
    sweep: float = 0.0  # signed angle of a leg around a vertex, or way along a wall: tells which way round

    @property
    def is_ride(self) -> bool:
        """Whether it follows a border."""
        return self.border >= 0


@dataclass(frozen=True)
class Structure:
    """Joins 0 ... m and the pieces between them, from start to goal."""

    joins: tuple[Join, ...]
    pieces: tuple[Piece, ...]

    def __post_init__(self) -> None:
        if len(self.joins) != len(self.pieces) + 1:
            raise ValueError("a structure needs one join more than pieces")

    def spliced(self, first: int, last: int, joins: Sequence[Join], pieces: Sequence[Piece]) -> Structure:
        """Joins strictly between `first` and `last` and the pieces between these two replaced."""
        return Structure(
            self.joins[: first + 1] + tuple(joins) + self.joins[last:],
            self.pieces[:first] + tuple(pieces) + self.pieces[last:],
        )

    def with_join(self, i: int, join: Join) -> Structure:
        """Join i replaced."""
        return Structure((*self.joins[:i], join, *self.joins[i + 1 :]), self.pieces)

    def with_piece(self, i: int, piece: Piece) -> Structure:
        """Piece i replaced."""
        return Structure(self.joins, (*self.pieces[:i], piece, *self.pieces[i + 1 :]))

    def moved(self, parameters: Array, sweeps: Array) -> Structure:
        """The same joins at other parameters (m + 1,), and sweeps (m,) of the legs."""
        joins = tuple(
            replace(j, u=float(u)) if j.border >= 0 and j.kind is not Kind.END else j
            for j, u in zip(self.joins, parameters, strict=True)
        )
        pieces = tuple(
            p if p.is_ride else replace(p, sweep=float(s)) for p, s in zip(self.pieces, sweeps, strict=True)
        )
        return Structure(joins, pieces)

    @property
    def signature(self) -> tuple[tuple[str | int, ...], ...]:
        """What two structures share that differ in positions only."""
        return tuple((j.kind.value, j.border, j.node) for j in self.joins) + tuple(
            (p.cell, p.border) for p in self.pieces
        )


def place_of(diagram: VoronoiDiagram, join: Join) -> Array:
    """Position (2,) [m] of a join."""
    if join.place is not None:
        return np.array(join.place)
    if join.node >= 0:
        return diagram.nodes[join.node]
    return diagram.curves.take([join.border]).points(np.array([join.u]))[0]


def parameter_on(diagram: VoronoiDiagram, join: Join, border: int) -> float:
    """Where a join lies on a border that it is on, or that ends at its node."""
    if join.border == border:
        return join.u
    end = int(np.flatnonzero(diagram.ends[border] == join.node)[0])
    return float(diagram.curves.span[border, end])


def places_of(diagram: VoronoiDiagram, joins: Sequence[Join]) -> Array:
    """Positions (m, 2) [m] of joins."""
    out = np.empty((len(joins), 2))
    on_border = [i for i, j in enumerate(joins) if j.place is None and j.node < 0]
    for i, join in enumerate(joins):
        if join.place is not None:
            out[i] = join.place
        elif join.node >= 0:
            out[i] = diagram.nodes[join.node]
    if on_border:
        borders = diagram.curves.take([joins[i].border for i in on_border])
        out[on_border] = borders.points(np.array([joins[i].u for i in on_border]))
    return out


def from_stops(
    diagram: VoronoiDiagram,
    start: Join,
    goal: Join,
    border: Sequence[int],
    u: Sequence[float],
    cell: Sequence[int],
    along: Sequence[int],
    sweep: Sequence[float],
) -> Structure:
    """The structure of a path through stops on borders.

    Parameters
    ----------
    border, u : (m,) of the stops between start and goal.
    cell, along : (m + 1,) of the pieces: the cell of a leg or -1, and the border followed or -1.
    sweep : (m + 1,) of the legs, see `Piece`.
    """
    count = len(border)
    joins: list[Join] = [start]
    pieces: list[Piece] = []
    for k in range(count + 1):
        if cell[k] >= 0:
            piece = Piece(cell=int(cell[k]), sweep=float(sweep[k]))
        else:
            piece = Piece(border=int(along[k]))
        pieces.append(piece)
        if k == count:
            joins.append(goal)
            break
        span = diagram.curves.span[border[k]]
        end = int(np.argmin(np.abs(span - u[k])))
        at_node = abs(span[end] - u[k]) <= NODE_TOLERANCE
        node = int(diagram.ends[border[k], end]) if at_node else -1
        rides = (cell[k] < 0, cell[k + 1] < 0)
        place = float(u[k])
        if node >= 0:
            joins.append(Join(Kind.NODE, node=node))
        elif rides == (True, True):
            pieces.pop()  # a stop on the way along one border
        elif rides == (False, True):
            joins.append(Join(Kind.ATTACH, int(border[k]), place))
        elif rides == (True, False):
            joins.append(Join(Kind.LEAVE, int(border[k]), place))
        elif cell[k] != cell[k + 1]:
            joins.append(Join(Kind.CROSS, int(border[k]), place))
        else:
            pair = [Join(Kind.ATTACH, int(border[k]), place), Join(Kind.LEAVE, int(border[k]), place)]
            joins += pair
            pieces.append(Piece(border=int(border[k])))
    return _directed(diagram, Structure(tuple(joins), tuple(pieces)))


def _directed(diagram: VoronoiDiagram, s: Structure) -> Structure:
    """Rides told in which direction they run; one of no length runs like the chord around it."""
    place = places_of(diagram, s.joins)
    for i, piece in enumerate(s.pieces):
        if not piece.is_ride:
            continue
        span = diagram.curves.span[piece.border]
        ends = [parameter_on(diagram, join, piece.border) for join in s.joins[i : i + 2]]
        gain = ends[1] - ends[0]
        if gain == 0.0:
            curve = diagram.curves.take([piece.border])
            tangent = curve.tangents(np.array([ends[0]]))[0]
            chord = place[min(i + 2, len(place) - 1)] - place[max(i - 1, 0)]
            gain = float(chord @ tangent) * math.copysign(1.0, span[1] - span[0])
        s = s.with_piece(i, replace(piece, sweep=math.copysign(1.0, gain)))
    return s
