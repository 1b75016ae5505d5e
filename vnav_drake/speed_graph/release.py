"""Kinks at Voronoi nodes: on which side a path that bends at a node is shorter, and what it crosses there."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vnav_drake.speed_graph.nodes import TURN, Around, around
from vnav_drake.speed_graph.state import EDGE, State, stretch_of
from vnav_drake.speed_graph.structure import Join, Kind, Piece, Structure
from vnav_drake.speed_graph.tidy import Tidier

Array = NDArray[np.float64]

SMOOTH = 1e-9  # [rad]: smaller kinks are none
ASIDE = 1e-7  # [rad]: a leg that leaves its cell by less at a node does not
CHAIN = 1e-6  # [rad]: two arcs that meet with a smaller kink are one curve


@dataclass(frozen=True)
class NodeRules(Tidier):
    """Rules for nodes; a path has no kink there when it is optimal, since V is continuous."""

    def headings(self, state: State) -> tuple[Array, Array]:
        """Headings (m + 1,) [rad] with which the path comes to each join and leaves it."""
        s = state.structure
        heading_in, heading_out = np.full(len(s.joins), np.nan), np.full(len(s.joins), np.nan)
        heading_out[state.leg], heading_in[state.leg + 1] = state.flight.heading.T
        for i, piece in enumerate(s.pieces):
            if piece.is_ride:
                curve = self.diagram.curves.take([piece.border])
                u = np.array([[self._u(s.joins[k], piece.border) for k in (i, i + 1)]])
                span = curve.span[0]
                t = curve.tangents(u)[0] * math.copysign(1.0, piece.sweep * (span[1] - span[0]))
                heading_out[i], heading_in[i + 1] = np.arctan2(t[:, 1], t[:, 0])
        return heading_in, heading_out

    def kept_in_sectors(self, state: State) -> Structure:
        """Legs that leave their cell as they meet a node get the border that they hit in between."""
        s = state.structure
        heading_in, heading_out = self.headings(state)
        for i in range(len(s.joins) - 1, -1, -1):
            if s.joins[i].node >= 0:
                view = around(self.diagram, s.joins[i].node)
                s = self._aside(state, s, i, view, heading_in[i], heading_out[i]) or s
        return s

    def released(self, state: State) -> Structure:
        """Nodes with a kink passed on the side where the path is shorter."""
        s = state.structure
        heading_in, heading_out = self.headings(state)
        for i in range(len(s.joins) - 1, -1, -1):
            if s.joins[i].kind is Kind.NODE:
                view = around(self.diagram, s.joins[i].node)
                s = self._release(state, s, i, view, heading_in[i], heading_out[i])
        return s

    def _aside(
        self, state: State, s: Structure, i: int, view: Around, heading_in: float, heading_out: float
    ) -> Structure | None:
        """Where a leg leaves its own cell as it meets the node, the border that it hits is put in between."""
        if i > 0 and not s.pieces[i - 1].is_ride:
            back = heading_in + math.pi
            sector = view.sector_of(s.pieces[i - 1].cell, back)
            side = self._hit(view, sector, back)
            if sector is not None and side is not None:
                join, pieces = self._put_between(state, i - 1, s.pieces[i - 1], view, sector, side)
                return s.spliced(i - 1, i, [join], pieces)
        if i < len(s.pieces) and not s.pieces[i].is_ride:
            sector = view.sector_of(s.pieces[i].cell, heading_out)
            side = self._hit(view, sector, heading_out)
            if sector is not None and side is not None:
                join, pieces = self._put_between(state, i, s.pieces[i], view, sector, side)
                if join.kind is Kind.ATTACH:
                    join = replace(join, kind=Kind.LEAVE)
                    pieces = [replace(pieces[1], sweep=-pieces[1].sweep), pieces[0]]
                else:
                    pieces = pieces[::-1]
                return s.spliced(i, i + 1, [join], pieces)
        return None

    def _hit(self, view: Around, sector: int | None, angle: float) -> int | None:
        """The border that a leg hits as it meets a node, because it leaves its sector there.

        None where it stays, and where it may leave: at the greatest speed all cells are alike.
        """
        if sector is None or view.outside(sector, angle) <= ASIDE:
            return None
        side = view.nearest_side(sector, angle)
        return None if self._is_flat(view.node) and not self.rideable[view.border[side]] else side

    def _is_flat(self, node: int) -> bool:
        return bool(self.diagram.node_distance[node] >= self.cap * (1.0 - 1e-9))

    def _through_flat(
        self, s: Structure, i: int, view: Around, back: float, ahead: float
    ) -> Structure | None:
        """Two legs at a node at the greatest speed, not both in their sectors: one leg, or two that cross."""
        before, after = s.pieces[i - 1], s.pieces[i]
        if before.is_ride or after.is_ride:
            return None
        sectors = [view.sector_of(p.cell, angle) for p, angle in ((before, back), (after, ahead))]
        if all(
            k is not None and view.outside(k, a) <= ASIDE for k, a in zip(sectors, (back, ahead), strict=True)
        ):
            return None
        if before.cell == after.cell:
            return s.spliced(i - 1, i + 1, [], [replace(before, sweep=before.sweep + after.sweep)])
        for j, border in enumerate(view.border):
            if {view.cell[j - 1], view.cell[j]} == {before.cell, after.cell}:
                u, _ = self._near(border, view.end[j], 1e-3 * float(self.diagram.node_distance[view.node]))
                return s.with_join(i, Join(Kind.CROSS, border, u))
        return None

    def _put_between(
        self, state: State, i: int, leg: Piece, view: Around, sector: int, side: int
    ) -> tuple[Join, list[Piece]]:
        """A join on border `side` of the node, and the two pieces of a leg that comes in to the node."""
        border, end = view.border[side], view.end[side]
        length = float(np.hypot(*(state.place[i + 1] - state.place[i])))
        u, toward = self._near(border, end, 0.3 * length)
        if self.rideable[border]:
            return Join(Kind.ATTACH, border, u), [leg, Piece(border=border, sweep=toward)]
        across = view.cell[side] if side != sector else view.cell[(side - 1) % len(view)]
        return Join(Kind.CROSS, border, u), [leg, Piece(cell=across)]

    def _near(self, border: int, end: int, distance: float) -> tuple[float, float]:
        """Parameter about `distance` [m] from an end of a border, at most halfway; u's sign towards it."""
        curve = self.diagram.curves.take([border])
        here, there = curve.span[0, end], curve.span[0, 1 - end]
        stretch = float(stretch_of(curve, curve.span[:, end])[0])
        step = max(min(distance / stretch, 0.5 * abs(there - here)), 2.0 * EDGE)
        sign = math.copysign(1.0, there - here)
        return float(here + sign * step), -sign

    def _release(
        self, state: State, s: Structure, i: int, view: Around, heading_in: float, heading_out: float
    ) -> Structure:
        before, after = s.pieces[i - 1], s.pieces[i]
        back = (heading_in + math.pi) % TURN
        width = (heading_out - back) % TURN
        if abs(width - math.pi) <= SMOOTH:
            return s
        if self._is_flat(view.node):
            flat = self._through_flat(s, i, view, back, heading_out)
            if flat is not None:
                return flat
        counter = width < math.pi
        crossed, sectors = _way_round(view, before, after, back, heading_out, counter)
        opening = width if counter else TURN - width
        lengths = [float(np.hypot(*(state.place[k + 1] - state.place[k]))) for k in (i - 1, i)]
        reach = 0.4 * min([x for x in lengths if x > 0.0] or [0.1])
        # a leg bends by about its length over the distance to the feature: by a small kink it leaves
        # a ride for a short way only
        nearest = float(self.diagram.node_distance[view.node])
        bend = min(0.5, abs(width - math.pi)) if before.is_ride or after.is_ride else 0.5
        reach = min(reach, max(bend, 1e-6) * nearest)
        angles = [(view.angle[j] - back) % TURN for j in crossed]
        angles = angles if counter else [TURN - angle for angle in angles]
        depth = [max(math.cos(0.5 * opening) / max(math.cos(a - 0.5 * opening), 0.05), 1e-6) for a in angles]
        # all at one scale, so that the chord stays a chord where a border is short
        room = [0.5 * float(self.diagram.curves.take([view.border[j]]).length[0]) for j in crossed]
        reach = min([reach, *(r / d for r, d in zip(room, depth, strict=True))])
        joins: list[Join] = []
        pieces: list[Piece] = []
        if before.is_ride:
            u, _ = self._near(before.border, _end_at(view, before.border), reach)
            joins.append(Join(Kind.LEAVE, before.border, u))
            pieces.append(before)
        if len(crossed) == 2 and self._is_chain(view, crossed):
            # two arcs that are one curve: a geodesic is not crossed twice, so the path follows it
            (one, other), node = crossed, s.joins[i]
            u0, toward = self._near(view.border[one], view.end[one], reach)
            u1, back_toward = self._near(view.border[other], view.end[other], reach)
            joins += [Join(Kind.ATTACH, view.border[one], u0), node, Join(Kind.LEAVE, view.border[other], u1)]
            pieces += [
                Piece(cell=sectors[0]),
                Piece(border=view.border[one], sweep=toward),
                Piece(border=view.border[other], sweep=-back_toward),
                Piece(cell=sectors[2]),
            ]
        else:
            for k, j in enumerate(crossed):
                u, _ = self._near(view.border[j], view.end[j], reach * depth[k])
                joins.append(Join(Kind.CROSS, view.border[j], u))
                pieces.append(Piece(cell=sectors[k]))
            pieces.append(Piece(cell=sectors[-1]))
        if after.is_ride:
            u, _ = self._near(after.border, _end_at(view, after.border), reach)
            joins.append(Join(Kind.ATTACH, after.border, u))
            pieces.append(after)
        # what remains of the legs before and after goes round an isolated point as they did
        for k, old in ((0, before), (-1, after)):
            if not old.is_ride:
                pieces[k] = replace(pieces[k], sweep=pieces[k].sweep + old.sweep)
        return s.spliced(i - 1, i + 1, joins, pieces)

    def _is_chain(self, view: Around, crossed: list[int]) -> bool:
        one, other = crossed
        rides = self.rideable[view.border[one]] and self.rideable[view.border[other]]
        turn = (view.angle[one] - view.angle[other]) % TURN
        return bool(rides) and abs(turn - math.pi) <= CHAIN


def _way_round(
    view: Around, before: Piece, after: Piece, back: float, ahead: float, counter: bool
) -> tuple[list[int], list[int]]:
    """Borders crossed on one side of a node from piece to piece, and the cells before, between and after."""
    count = len(view)
    position = []  # of both pieces, in half steps: border j at 2 j, sector j at 2 j + 1
    for piece, angle in ((before, back), (after, ahead)):
        if piece.is_ride:
            position.append(2 * view.border.index(piece.border))
        else:
            sector = view.sector_of(piece.cell, angle)
            position.append(2 * (0 if sector is None else sector) + 1)
    step = 1 if counter else -1
    crossed, sectors = [], []
    here, last = position
    if here == last:  # one sector: none crossed if `ahead` follows `back` in this direction, else all
        start = view.angle[here // 2]
        gain = (ahead - start) % TURN - (back - start) % TURN
        if gain * step >= 0.0:
            return [], [view.cell[here // 2]]
    if here % 2 == 1:
        sectors.append(view.cell[here // 2])
    while True:
        here = (here + step) % (2 * count)
        if here == last:
            if here % 2 == 1:
                sectors.append(view.cell[here // 2])
            break
        if here % 2 == 1:
            sectors.append(view.cell[here // 2])
        else:
            crossed.append(here // 2)
    return crossed, sectors


def _end_at(view: Around, border: int) -> int:
    return view.end[view.border.index(border)]
