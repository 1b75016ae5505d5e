"""The fastest path of a homotopy class, and what proves that it is.

Newton's method finds a path without kinks for a given structure; where that path leaves its cells, rides
backwards or bends at a Voronoi node, the structure is changed and Newton's method runs again. In a locally
CAT(0) space a path without kinks that stays in its cells is the one geodesic of its class, so whatever
led there does not matter: what is found is checked at the end.

How far a path is from that geodesic (`Optimum.bound`). Derived: valid legs are geodesics, so the time T is
f(x) = d(S, x_1) + ... + d(x_n, G) for the joins x_i, with d the distance in the universal cover, which is
CAT(0). There f is convex, and f(y) is the least time T* for all y in order on the geodesic from S to G: so if
y_i = S where the time T_i to join i is at most T / 2, else y_i = G. By the first variation f changes
from x towards y at least by -sum d(x_i, y_i) (w_i . (b_i + o_i)), with w_i, b_i, o_i the unit tangents at x_i
towards y_i, back and onward; tangent planes are flat, as V is continuous across Voronoi arcs and nodes. At a
kink gamma_i |b_i + o_i| = 2 sin(gamma_i / 2), and d(x_i, y_i) <= min(T_i, T - T_i), so by convexity

    T - T* <= sum 2 sin(gamma_i / 2) min(T_i, T - T_i).
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vnav_drake.speed_graph.cap import cut_at_cap
from vnav_drake.speed_graph.chart import Chart, along
from vnav_drake.speed_graph.newton import FINE, Iteration, Settled, Solver
from vnav_drake.speed_graph.state import State
from vnav_drake.speed_graph.structure import Structure
from vnav_drake.speed_graph.surgery import Surgeon
from vnav_drake.voronoi import VoronoiDiagram

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

ROUNDS = 120  # changes of structure before giving up
RETURNS = 4  # times that one structure may come back
SAMPLES = 20  # of a leg, where it is asked whether it stays in its cell
FINE_SAMPLES = 60
ROUNDING = 1e-11  # relative, of the times of legs and rides: at most a tenth of what tests allow them
BEYOND = 1e-7  # [m]: a leg that leaves its cell by less stays in it
FULL_TURN = 2.0 * np.pi * (1.0 - 1e-9)  # [rad]
KINK = 1e-7  # [rad]: largest kink of a certified path

# The four conditions of a certified optimum.
RESIDUAL, RIDGE, CLASS, NODE = "residual", "ridge", "class", "node"
# A class that winds round a point obstacle has no fastest path for a point robot: the infimum touches it.
POINT = "point"


@dataclass(frozen=True)
class Optimum:
    """The path found and how far it is from the least travel time of its class."""

    state: State
    time: float  # [s]
    bound: float  # [s]: time - bound <= least time of the class, when nothing failed
    failed: tuple[str, ...]
    kink: float  # [rad], largest at any join
    history: tuple[Iteration, ...]
    rounds: int

    @property
    def unsafe(self) -> bool:
        """Whether a leg leaves its cell at a sample, so that `time` is that of no path."""
        return RIDGE in self.failed


class ClassSolver:
    """Finds the fastest path of a class from any path of that class."""

    def __init__(self, diagram: VoronoiDiagram, chart: Chart) -> None:
        self.chart = chart
        self.cut = cut_at_cap(diagram, chart.law, chart.radius)
        self.diagram = self.cut.diagram
        self.solver = Solver(self.diagram, chart)
        self.surgeon = Surgeon(self.diagram, self.cut.rideable, self.cut.cap)

    def optimum(self, structure: Structure) -> Optimum:
        """The fastest path that can be reached from a structure by shortening it."""
        begun, history = structure, list[Iteration]()
        seen: Counter[object] = Counter()
        state, settled = None, False
        rounds = 0
        while rounds < ROUNDS:
            rounds += 1
            structure = self.surgeon.tidied(structure)
            if self._winds(structure):
                return replace(self.as_it_is(begun), failed=(POINT,), history=tuple(history))
            seen[structure.signature] += 1
            if seen[structure.signature] > RETURNS:
                break
            now = self.solver.solve(structure, history)
            state = now.state
            changed = self._changed(now)
            if changed is None:
                settled = True
                break
            structure = changed
        if state is None:
            raise ValueError("no structure to start from")
        return self._judged(state, settled, tuple(history), rounds)

    def _winds(self, structure: Structure) -> bool:
        """Whether a leg goes right round a point without extent."""
        if self.chart.radius + self.chart.law.margin > 0.0:
            return False
        first = 2 * len(self.chart.world.edges)
        return any(
            p.cell >= first and self.chart.lone[p.cell - first] and abs(p.sweep) >= FULL_TURN
            for p in structure.pieces
        )

    def as_it_is(self, structure: Structure) -> Optimum:
        """A structure judged as a path, without moving anything."""
        return self._judged(self.solver.state(structure), False, (), 0)

    def _changed(self, now: Settled) -> Structure | None:
        """The next structure, or None when this one is that of the optimum."""
        surgeon, state, old = self.surgeon, now.state, now.state.structure
        for event in (surgeon.closed, surgeon.ended):
            new = event(now)
            if new.signature != old.signature:
                return new
        rules = (
            surgeon.tidied_state,
            surgeon.kept_in_sectors,
            self._kept_in_cells,
            surgeon.grazing,
            surgeon.released,
        )
        for rule in rules:
            new = rule(state)
            if new.signature != old.signature:
                return new
        return None

    def _excess(self, state: State, samples: int) -> tuple[Array, Array]:
        """How far [m] legs are beyond the ridge of their cells at samples (n, k), and their clearance [m]."""
        points, own = self._sampled(state, samples)
        true = self.chart.world.nearest(points)[0] - self.chart.radius
        law = self.chart.law
        if np.isfinite(law.max_speed):  # beyond its clearance all are alike
            cap = float(law.distance(law.max_speed))
            return np.minimum(own, cap) - np.minimum(true, cap), own
        return own - true, own

    def _sampled(self, state: State, samples: int) -> tuple[Array, Array]:
        """Positions (n, k, 2) [m] on legs, denser at their ends; clearance (n, k) [m] to their features."""
        part = 0.5 - 0.5 * np.cos(np.pi * (np.arange(samples) + 0.5) / samples)
        cell = np.array([state.structure.pieces[i].cell for i in state.leg], dtype=np.int64)
        return along(self.chart, cell, state.flight, part)

    def _kept_in_cells(self, state: State) -> Structure:
        """Legs that go beyond the ridge of their cell touch it where they are farthest beyond."""
        excess, points = self._excess(state, SAMPLES)[0], self._sampled(state, SAMPLES)[0]
        structure = state.structure
        for row in np.flatnonzero(excess.max(axis=1) > BEYOND)[::-1]:
            i, k = int(state.leg[row]), int(np.argmax(excess[row]))
            found = self._ridge_at(structure.pieces[i].cell, points[row, k])
            if found is None:
                continue
            border, u = found
            step = points[row, min(k + 1, points.shape[1] - 1)] - points[row, max(k - 1, 0)]
            tangent = self.diagram.curves.take([border]).tangents(np.array([u]))[0]
            structure = self.surgeon.touched(
                structure,
                i,
                border,
                u,
                float(step @ tangent),
                self._swept(structure.pieces[i].cell, points[row, : k + 1], state.place[i]),
            )
        return structure

    def _swept(self, cell: int, points: Array, start: Array) -> float:
        """Angle [rad] swept around the vertex of a cell from `start` along points (k, 2); zero near walls."""
        vertex = cell - 2 * len(self.chart.world.edges)
        if vertex < 0:
            return 0.0
        offset = np.concatenate([start[None], points]) - self.chart.world.vertices[vertex]
        angle = np.unwrap(np.arctan2(offset[:, 1], offset[:, 0]))
        return float(angle[-1] - angle[0])

    def _ridge_at(self, cell: int, point: Array) -> tuple[int, float] | None:
        """The Voronoi arc of a cell nearest to a point, and the parameter there."""
        border, _ = self.diagram.cell_borders(cell)
        border = border[self.surgeon.rideable[border]]
        if len(border) == 0:
            return None
        curves = self.diagram.curves.take(border)
        low, high = np.sort(curves.span, axis=1).T
        u = np.clip(np.einsum("ij,ij->i", point - curves.origin, curves.axis), low, high)
        best = int(np.argmin(np.hypot(*(curves.points(u) - point).T)))
        return int(border[best]), float(u[best])

    def piece_times(self, state: State) -> Array:
        """(m,) [s] of each piece."""
        times = self.solver.ride_times(state.structure)
        times[state.leg] = state.flight.time
        return times

    def _judged(self, state: State, settled: bool, history: tuple[Iteration, ...], rounds: int) -> Optimum:
        """The four conditions, and the bound; a number that is not finite meets none of them."""
        times = self.piece_times(state)
        heading_in, heading_out = self.surgeon.headings(state)
        kink = np.abs((((heading_out - heading_in)[1:-1] + np.pi) % (2.0 * np.pi)) - np.pi)
        total = float(times.sum())
        at = np.cumsum(times)[:-1]
        excess, own = self._excess(state, FINE_SAMPLES)
        # where a leg is beyond the ridge by e, its speed was too high by the factor 1 + e / (2 d) at most
        slower = float((np.maximum(excess, 0.0) / (2.0 * np.maximum(own, BEYOND))).max(initial=0.0))
        bound = float((2.0 * np.sin(0.5 * kink) * np.minimum(at, total - at)).sum())
        at_node = np.array([j.node >= 0 for j in state.structure.joins[1:-1]], dtype=bool)
        failed = []
        if not (state.error <= FINE and kink[~at_node].max(initial=0.0) <= KINK):
            failed.append(RESIDUAL)
        if not excess.max(initial=0.0) <= BEYOND:
            failed.append(RIDGE)
        if not kink[at_node].max(initial=0.0) <= KINK:
            failed.append(NODE)
        if not (settled and np.isfinite(total)) and not failed:
            failed.append(RESIDUAL)
        bound += total * (slower + ROUNDING)
        return Optimum(state, total, bound, tuple(failed), float(kink.max(initial=0.0)), history, rounds)
