"""Patterns in a structure that are never optimal, taken out without looking at the path.

See `surgery` for why an optimal path meets an arc once.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from vnav_drake.speed_graph.newton import OVERLAP
from vnav_drake.speed_graph.structure import Join, Kind, Piece, Structure, parameter_on, place_of
from vnav_drake.voronoi import VoronoiDiagram

Array = NDArray[np.float64]

BORDER_SAMPLES = 65  # of a border, to follow the angle at which it is seen


@dataclass(frozen=True)
class Tidier:
    """Rules for one diagram."""

    diagram: VoronoiDiagram
    rideable: NDArray[np.bool_]  # (m,) borders that a path can follow
    cap: float = math.inf  # [m] distance from which on the speed is greatest

    def tidied(self, structure: Structure) -> Structure:
        """Joins that do nothing removed."""
        while True:
            for i in range(len(structure.pieces)):
                shorter = self._tidy_at(structure, i)
                if shorter is not None:
                    structure = shorter
                    break
            else:
                return structure

    def _tidy_at(self, s: Structure, i: int) -> Structure | None:
        """One pattern around piece i removed, or None."""
        one, other, piece = s.joins[i], s.joins[i + 1], s.pieces[i]
        if piece.is_ride:
            return self._tidy_ride(s, i)
        if one.node >= 0 and one.node == other.node:
            return _without_piece(s, i) if self._swept(piece, one, other) == 0.0 else None
        if one.kind is Kind.CROSS and other.kind is Kind.CROSS and one.border == other.border:
            if self._goes_round(piece, one, other, one.border):
                return None
            return s.spliced(
                i - 1,
                i + 2,
                [],
                [replace(s.pieces[i - 1], sweep=_sum(s, i - 1, i + 1, s.pieces[i - 1].cell))],
            )
        if (
            (one.border >= 0 and one.border == other.border)
            or self._touches(one, other)
            or self._touches(other, one)
        ):
            return self._along_border(s, i)
        return None

    def _goes_round(self, piece: Piece, one: Join, other: Join, border: int) -> bool:
        """Whether a leg between two joins of a border passes an isolated point on its other side.

        Both together then go round the point, and the border is no shorter way of the same class.
        """
        if not self._around_point(piece):
            return False
        curve = self.diagram.curves.take([border])
        points = curve.points(
            np.linspace(self._u(one, border), self._u(other, border), BORDER_SAMPLES)[None]
        )[0]
        offset = points - self._vertex(piece)
        angle = np.unwrap(np.arctan2(offset[:, 1], offset[:, 0]))
        return abs(float(angle[-1] - angle[0]) - self._swept(piece, one, other)) > math.pi

    def _around_point(self, piece: Piece) -> bool:
        return piece.cell - 2 * len(self.diagram.world.edges) in self._lone

    def _vertex(self, piece: Piece) -> Array:
        vertex: Array = self.diagram.world.vertices[piece.cell - 2 * len(self.diagram.world.edges)]
        return vertex

    def _swept(self, piece: Piece, one: Join, other: Join) -> float:
        """Angle [rad] that a leg sweeps around an isolated point; zero in other cells."""
        if not self._around_point(piece):
            return 0.0
        a, b = (place_of(self.diagram, join) - self._vertex(piece) for join in (one, other))
        angle = math.atan2(a[0] * b[1] - a[1] * b[0], float(a @ b))
        return angle + 2.0 * math.pi * round((piece.sweep - angle) / (2.0 * math.pi))

    @cached_property
    def _lone(self) -> frozenset[int]:
        return frozenset(self.diagram.world.isolated.tolist())

    def _touches(self, node: Join, other: Join) -> bool:
        """Whether a node is an end of the border of another join."""
        return node.node >= 0 and other.border >= 0 and node.node in self.diagram.ends[other.border]

    def _along_border(self, s: Structure, i: int) -> Structure | None:
        """A leg between two joins of one border: the border itself is shorter."""
        one, other = s.joins[i], s.joins[i + 1]
        border = other.border if (one.node >= 0 and one.kind is Kind.NODE) or one.border < 0 else one.border
        if one.border == other.border:
            border = one.border
        if self._goes_round(s.pieces[i], one, other, border):
            return None
        if not self.rideable[border]:
            # along a border between cells of one obstacle: the leg on its other side is as good
            if other.kind is Kind.CROSS and other.border == border:
                return s.spliced(
                    i, i + 2, [], [replace(s.pieces[i + 1], sweep=_sum(s, i, i + 1, s.pieces[i + 1].cell))]
                )
            if one.kind is Kind.CROSS and one.border == border:
                return s.spliced(
                    i - 1,
                    i + 1,
                    [],
                    [replace(s.pieces[i - 1], sweep=_sum(s, i - 1, i, s.pieces[i - 1].cell))],
                )
            return None
        u0, u1 = self._u(one, border), self._u(other, border)
        ride = Piece(border=border, sweep=math.copysign(1.0, u1 - u0))
        joins: list[Join] = []
        pieces: list[Piece] = []
        first, last = i, i + 1
        # the near side
        if one.kind is Kind.LEAVE:
            first, ride = i - 1, replace(ride, sweep=s.pieces[i - 1].sweep)
        elif one.kind is Kind.CROSS:
            first = i - 1
            pieces.append(s.pieces[i - 1])
            joins.append(replace(one, kind=Kind.ATTACH))
        pieces.append(ride)
        if other.kind is Kind.ATTACH:
            last = i + 2
        elif other.kind is Kind.CROSS:
            joins.append(replace(other, kind=Kind.LEAVE))
            pieces.append(s.pieces[i + 1])
            last = i + 2
        return s.spliced(first, last, joins, pieces)

    def _u(self, join: Join, border: int) -> float:
        return parameter_on(self.diagram, join, border)

    def _tidy_ride(self, s: Structure, i: int) -> Structure | None:
        """A ride of no length between fixed joins, two rides in a row on one border, or a backward one."""
        one, other, ride = s.joins[i], s.joins[i + 1], s.pieces[i]
        if one.node >= 0 and one.node == other.node and one.border != ride.border:
            return _without_piece(s, i)
        if i + 1 < len(s.pieces) and s.pieces[i + 1].border == ride.border:
            return s.spliced(i, i + 2, [], [ride])
        gain = ride.sweep * (self._u(other, ride.border) - self._u(one, ride.border))
        fixed = one.kind is not Kind.ATTACH or other.kind is not Kind.LEAVE
        backward = gain < -OVERLAP or (fixed and gain <= OVERLAP)
        return self.without_ride(s, i) if backward else None

    def without_ride(self, s: Structure, i: int) -> Structure | None:
        """Ride i taken out: a crossing where it led from cell to cell. None when both its ends are fixed."""
        one, other = s.joins[i], s.joins[i + 1]
        loose_one, loose_other = one.kind is Kind.ATTACH, other.kind is Kind.LEAVE
        if loose_one and loose_other:
            before, after = s.pieces[i - 1], s.pieces[i + 1]
            if before.cell == after.cell:
                return s.spliced(i - 1, i + 2, [], [replace(before, sweep=before.sweep + after.sweep)])
            middle = replace(one, kind=Kind.CROSS, u=0.5 * (one.u + other.u))
            return s.spliced(i - 1, i + 2, [middle], [before, after])
        if loose_other:  # from a fixed join straight away
            return s.spliced(i, i + 2, [], [s.pieces[i + 1]])
        if loose_one:
            return s.spliced(i - 1, i + 1, [], [s.pieces[i - 1]])
        return None


def _without_piece(s: Structure, i: int) -> Structure:
    """Piece i between two joins at the same node dropped, and one of the joins with it."""
    one, other = s.joins[i], s.joins[i + 1]
    kept = one if one.kind is Kind.END else other
    return Structure((*s.joins[:i], kept, *s.joins[i + 2 :]), (*s.pieces[:i], *s.pieces[i + 1 :]))


def _sum(s: Structure, first: int, last: int, cell: int) -> float:
    """Total sweep of the legs from piece `first` to piece `last` in one cell."""
    return sum(s.pieces[k].sweep for k in range(first, last + 1) if s.pieces[k].cell == cell)
