"""Changes of structure: what a path does next when Newton's method has settled short of the optimum.

Every rule follows from one fact: in the metric ds / V(d) free space is locally CAT(0), Voronoi arcs are
geodesics of it, and two geodesics meet in one connected piece. So an optimal path meets an arc once: it
crosses it, or follows it for a while (saturation, Manor 2015, Sec. 3.5).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from vnav_drake.speed_graph.newton import Settled
from vnav_drake.speed_graph.release import SMOOTH, NodeRules
from vnav_drake.speed_graph.state import MOVING, State
from vnav_drake.speed_graph.structure import Join, Kind, Piece, Structure

UPRIGHT = 1e-3  # cosines below this do not tell which way a path runs along a border


@dataclass(frozen=True)
class Surgeon(NodeRules):
    """All rules; each returns the structure that follows, of the same signature if nothing changes."""

    def tidied_state(self, state: State) -> Structure:
        """The structure of a state without joins that do nothing where they lie now."""
        return self.tidied(state.structure)

    def closed(self, settled: Settled) -> Structure:
        """Rides that would run backwards taken out."""
        s = settled.state.structure
        for i in reversed(settled.closing):
            s = self.without_ride(s, i) or s
        return s

    def ended(self, settled: Settled) -> Structure:
        """Joins at the end of their border, and pushed beyond it, become nodes."""
        s = settled.state.structure
        for i, way in enumerate(settled.met):
            if s.joins[i].kind in MOVING and way != 0.0:
                border = s.joins[i].border
                span = self.diagram.curves.span[border]
                end = int(np.argmin(span) if way < 0.0 else np.argmax(span))
                s = s.with_join(i, Join(Kind.NODE, node=int(self.diagram.ends[border, end])))
        return s

    def grazing(self, state: State) -> Structure:
        """Crossings whose legs do not lie on their side of the border become rides of no length."""
        s = state.structure
        heading_in, heading_out = self.headings(state)
        place = state.place
        for i in range(len(s.joins) - 2, 0, -1):
            join = s.joins[i]
            if join.kind is not Kind.CROSS or not self.rideable[join.border]:
                continue
            to_left = s.pieces[i].cell == self.diagram.cells[join.border, 0]
            side = 1.0 if to_left else -1.0
            a, b = heading_in[i] - state.tangent[i], heading_out[i] - state.tangent[i]
            if min(side * math.sin(a), side * math.sin(b)) >= -SMOOTH:
                continue
            forward = math.cos(a) + math.cos(b)
            if abs(forward) < UPRIGHT:
                chord = place[i + 1] - place[i - 1]
                forward = float(chord @ [math.cos(state.tangent[i]), math.sin(state.tangent[i])])
            s = self.with_ride(s, i, forward)
        return s

    def with_ride(self, s: Structure, i: int, forward: float) -> Structure:
        """A crossing as a ride of no length; `forward` > 0 in the direction of its border."""
        join = s.joins[i]
        span = self.diagram.curves.span[join.border]
        ride = Piece(border=join.border, sweep=math.copysign(1.0, forward * (span[1] - span[0])))
        pair = [replace(join, kind=Kind.ATTACH), replace(join, kind=Kind.LEAVE)]
        return s.spliced(i - 1, i + 1, pair, [s.pieces[i - 1], ride, s.pieces[i]])

    def touched(self, s: Structure, i: int, border: int, u: float, forward: float, swept: float) -> Structure:
        """Leg i, having `swept` part of its way, touches a border of its cell at u: a ride of no length."""
        span = self.diagram.curves.span[border]
        ride = Piece(border=border, sweep=math.copysign(1.0, forward * (span[1] - span[0])))
        pair = [Join(Kind.ATTACH, border, u), Join(Kind.LEAVE, border, u)]
        before, after = (
            replace(s.pieces[i], sweep=swept),
            replace(s.pieces[i], sweep=s.pieces[i].sweep - swept),
        )
        return s.spliced(i, i + 1, pair, [before, ride, after])
