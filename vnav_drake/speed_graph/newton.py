"""Newton's method on the joins of a structure: where a path of given structure has no kinks.

Residuals, one a join that can move, with u the unit tangent of its border (Manor 2015, Sec. 3.6):

* CROSS: the kink, the angle from t_out to t_in. It vanishes with dT = (t_in - t_out) . u, but not where the
  path is reflected at the border, which is also stationary;
* ATTACH, LEAVE: the angle between the leg and the ride. Its zero is an inflection of T, so T itself is not
  what is minimised; and a leg that comes from ahead has an angle beyond a right one, where u x t would
  lead to a path that turns on the spot.

The Jacobian is exact and tridiagonal, and rides cut it into independent blocks.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vnav_drake.speed_graph.chart import Chart, Flight, fly, turns
from vnav_drake.speed_graph.structure import Join, Kind, Structure, places_of
from vnav_drake.voronoi import PARABOLA, Curves, VoronoiDiagram, travel_time

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]

RESIDUAL = 1e-12  # below which there is nothing to gain in double precision
FINE = 1e-10  # the residual of a certified path
ITERATIONS = 40
PATIENCE = 10  # rounds until a short leg near a node counts as none
CORNER = 0.1  # short: a part of the distance from the node to the nearest feature
MOVING = (Kind.CROSS, Kind.ATTACH, Kind.LEAVE)
REACH = 0.7  # longest step, as a part of the distance to the nearest feature
BACKTRACKS = 5
FLAT = 1e-6  # [rad/m]: a smaller derivative is no guide to the length of a step
NEAR = 0.02  # [rad]: with smaller residuals Newton's step is trusted
SHORTEST = 1e-9  # [m]: legs shorter than this have met
OVERLAP = 1e-10  # [m]: a shorter ride has no length
EDGE = 1e-9  # [m]: a join this near to the end of its border is at the node


@dataclass(frozen=True)
class State:
    """A structure with all that Newton's method knows of it."""

    structure: Structure
    place: Array  # (m + 1, 2) [m]
    leg: Indices  # pieces that are legs
    flight: Flight
    tangent: Array  # (m + 1,) [rad], heading of the border at each join on one
    residual: Array  # (m + 1,) 0 at joins that cannot move
    jacobian: Array  # (m + 1, m + 1) by the parameters of the joins
    diagonal: Array  # (m + 1,) of the Jacobian, with the signs that it must have
    bound: Array  # (m + 1,) -1, +1 at the first or last end of its border and pushed outwards, else 0
    ride_time: float  # [s]
    closing: tuple[int, ...] = ()  # rides of no length that Newton's method would turn round

    @property
    def time(self) -> float:
        """Travel time [s]."""
        return float(self.flight.time.sum()) + self.ride_time

    @property
    def error(self) -> float:
        """Largest residual of the joins that are free to move."""
        return float(np.abs(np.where(self.bound == 0.0, self.residual, 0.0)).max(initial=0.0))


@dataclass(frozen=True)
class Iteration:
    """One step of Newton's method."""

    time: float  # [s]
    residual: float


class Solver:
    """Newton's method for one world, robot and braking law."""

    def __init__(self, diagram: VoronoiDiagram, chart: Chart) -> None:
        self.diagram, self.chart = diagram, chart
        self._ends = diagram.curves.span

    def state(self, structure: Structure) -> State:
        """Residuals and times of a structure."""
        joins, pieces = structure.joins, structure.pieces
        place = places_of(self.diagram, joins)
        leg = np.array([i for i, p in enumerate(pieces) if not p.is_ride], dtype=np.int64)
        cell = np.array([pieces[i].cell for i in leg], dtype=np.int64)
        sweep = np.array([pieces[i].sweep for i in leg])
        both = np.stack([place[leg], place[leg + 1]], axis=1)
        flight = fly(self.chart, cell, both, sweep, hessian=True)
        border = np.array([j.border for j in joins])
        u = np.array([j.u for j in joins])
        tangent = np.zeros(len(joins))
        on = np.flatnonzero(border >= 0)
        if len(on):
            curves = self.diagram.curves.take(border[on])
            t = curves.tangents(u[on])
            tangent[on] = np.arctan2(t[:, 1], t[:, 0])
        heading_in, heading_out = np.full(len(joins), np.nan), np.full(len(joins), np.nan)
        heading_out[leg], heading_in[leg + 1] = flight.heading.T
        kind = np.array([j.kind.value for j in joins])
        residual = np.zeros(len(joins))
        cross, attach, leave = (kind == k.value for k in (Kind.CROSS, Kind.ATTACH, Kind.LEAVE))
        residual[cross] = _wrapped(heading_in - heading_out)[cross]
        onward = self._onward(structure, tangent)
        residual[attach] = _wrapped(heading_in - onward)[attach]
        residual[leave] = _wrapped(heading_out - onward)[leave]
        jacobian = self._jacobian(joins, leg, flight)
        diagonal = self._diagonal(structure, jacobian)
        bound = self._pushed(joins, residual, diagonal)
        return State(structure, place, leg, flight, tangent, residual, jacobian, diagonal, bound, self._rides(structure))

    def _onward(self, structure: Structure, tangent: Array) -> Array:
        """Heading [rad] of the ride at joins that begin or end one, in the direction of travel."""
        out = tangent.copy()
        for i, join in enumerate(structure.joins):
            if join.kind in (Kind.ATTACH, Kind.LEAVE):
                ride = structure.pieces[i if join.kind is Kind.ATTACH else i - 1]
                span = self._ends[join.border]
                if ride.sweep * (span[1] - span[0]) < 0.0:
                    out[i] += np.pi
        return out

    def _rides(self, structure: Structure) -> float:
        """Time [s] along borders."""
        rows, spans = [], []
        for i, piece in enumerate(structure.pieces):
            if piece.is_ride:
                span = [self.parameter(structure.joins[k], piece.border) for k in (i, i + 1)]
                if span[0] != span[1]:
                    rows.append(piece.border)
                    spans.append(span)
        if not rows:
            return 0.0
        curves = self.diagram.curves.take(rows).cut(np.array(spans))
        return float(travel_time(curves, self.chart.law, self.chart.radius).sum())

    def parameter(self, join: Join, border: int) -> float:
        """Where a join lies on a border that it is on."""
        if join.border == border:
            return float(join.u)
        end = int(np.flatnonzero(self.diagram.ends[border] == join.node)[0])
        return float(self._ends[border, end])

    def solve(self, structure: Structure, history: list[Iteration]) -> State:
        """Joins moved until the residuals vanish, or joins meet the ends of their borders."""
        state = self.state(structure)
        trust = REACH
        for rounds in range(ITERATIONS):
            history.append(Iteration(state.time, state.error))
            if state.error <= RESIDUAL:
                break
            step = self._step(state)
            step, closing = self._closing(state, step)
            if closing:
                return replace(state, closing=closing)
            size = np.abs(step) / self._scale(state)
            cut = min(1.0, trust / max(float(size.max(initial=0.0)), 1e-300))
            for _try in range(BACKTRACKS):
                structure = self._moved(state, self._meeting(state, cut * step))
                met = self._met(structure, rounds)
                if met.any():
                    return replace(state, structure=structure, bound=met)
                trial = self.state(structure)
                if trial.error < max(1.2 * state.error, FINE) or state.error > 0.5:
                    break
                cut *= 0.35
            better = trial.error < state.error
            trust = min(REACH, 2.0 * trust) if better else max(0.5 * trust, 0.05)
            if state.error < FINE and not better:
                break
            state = trial
        return state

    def _gaps(self, state: State, step: Array) -> list[tuple[int, float, float]]:
        """Rides with a loose join: piece, length in its border's parameter, and what a step adds to it."""
        joins, out = state.structure.joins, []
        for i, piece in enumerate(state.structure.pieces):
            if piece.is_ride and (joins[i].kind is Kind.ATTACH or joins[i + 1].kind is Kind.LEAVE):
                u0, u1 = (self.parameter(joins[k], piece.border) for k in (i, i + 1))
                out.append((i, piece.sweep * (u1 - u0), piece.sweep * float(step[i + 1] - step[i])))
        return out

    def _closing(self, state: State, step: Array) -> tuple[Array, tuple[int, ...]]:
        """The step, and rides of no length that would turn round.

        While other joins are still on their way Newton's step may say so by mistake: both joins of
        the ride, each on its own, must say so too, else they follow their own steps.
        """
        alone = np.where(state.bound == 0.0, _alone(state), 0.0)
        out, closing = step.copy(), []
        own = {i: gain for i, _, gain in self._gaps(state, alone)}
        for i, gap, gain in self._gaps(state, step):
            if gap <= OVERLAP and gain < 0.0:
                if own[i] < 0.0:
                    closing.append(i)
                else:
                    out[[i, i + 1]] = alone[[i, i + 1]]
        return out, tuple(closing)

    def _meeting(self, state: State, step: Array) -> Array:
        """The step cut at rides that it would turn round, so that their ends meet."""
        out = step.copy()
        for i, gap, gain in self._gaps(state, step):
            if gap + gain < 0.0:
                out[[i, i + 1]] *= gap / -gain
        return out

    def _scale(self, state: State) -> Array:
        """Distance [m] to the nearest feature at each join, in its border's parameter."""
        joins = state.structure.joins
        out = np.ones(len(joins))
        on = [i for i, j in enumerate(joins) if j.border >= 0]
        if on:
            curves = self.diagram.curves.take([joins[i].border for i in on])
            u = np.array([joins[i].u for i in on])
            out[on] = np.maximum(curves.distance(u), 1e-6) / _stretch(curves, u)
        return out

    def _met(self, structure: Structure, rounds: int) -> Array:
        """(m + 1,) -1 or +1 for joins of a leg that has shrunk to nothing: they have met at a node.

        After `PATIENCE` rounds a short leg near a node is enough: around a corner all sizes look alike,
        and Newton's method may circle it. What is best there is then read off the kink at the node.
        """
        joins = structure.joins
        place = places_of(self.diagram, joins)
        length = np.hypot(*np.diff(place, axis=0).T)
        out = np.zeros(len(joins))
        for i, piece in enumerate(structure.pieces):
            if piece.is_ride or length[i] > CORNER * self.diagram.world.diameter:
                continue
            one, other = joins[i], joins[i + 1]
            if one.kind not in MOVING or other.kind not in MOVING:
                continue
            shared = np.intersect1d(self.diagram.ends[one.border], self.diagram.ends[other.border])
            if len(shared) == 0:
                continue
            node = int(shared[0])
            near = CORNER * self.diagram.node_distance[node] if rounds > PATIENCE else SHORTEST
            if np.hypot(*(place[[i, i + 1]] - self.diagram.nodes[node]).T).max() <= near:
                for k in (i, i + 1):
                    span = self._ends[joins[k].border]
                    there = span[int(np.flatnonzero(self.diagram.ends[joins[k].border] == node)[0])]
                    out[k] = 1.0 if there == span.max() else -1.0
        return out

    def _moved(self, state: State, step: Array) -> Structure:
        joins = state.structure.joins
        border = np.array([j.border for j in joins])
        u = np.array([j.u for j in joins]) + step
        low, high = np.sort(self._ends[np.maximum(border, 0)], axis=1).T
        u = np.where(border >= 0, np.clip(u, low, high), u)
        sweeps = np.zeros(len(state.structure.pieces))
        sweeps[state.leg] = state.flight.sweep
        return state.structure.moved(u, sweeps)

    def _diagonal(self, structure: Structure, jacobian: Array) -> Array:
        """(m + 1,) derivative of each residual by its own join, with the sign that it must have.

        A leg on the wrong side of its ride wants a longer ride, one on the right side a shorter one. The
        raw leg may say otherwise where it passes another border on its way.
        """
        out = jacobian.diagonal().copy()
        for i, join in enumerate(structure.joins):
            if join.kind in (Kind.ATTACH, Kind.LEAVE):
                ride = structure.pieces[i if join.kind is Kind.ATTACH else i - 1]
                leg = structure.pieces[i - 1 if join.kind is Kind.ATTACH else i]
                span = self._ends[join.border]
                left = self.diagram.cells[join.border, 0 if ride.sweep * (span[1] - span[0]) > 0.0 else 1]
                out[i] = math.copysign(max(abs(out[i]), FLAT), ride.sweep * (1.0 if leg.cell == left else -1.0))
        return out

    def _pushed(self, joins: Sequence[Join], residual: Array, diagonal: Array) -> Array:
        """(m + 1,) -1 or +1 where a join at the low or high end of its border is pushed beyond it."""
        out = np.zeros(len(joins))
        on = np.array([i for i, j in enumerate(joins) if j.kind in MOVING], dtype=np.int64)
        if len(on) == 0:
            return out
        u = np.array([joins[i].u for i in on])
        low, high = np.sort(self._ends[[joins[i].border for i in on]], axis=1).T
        way = -residual[on] * diagonal[on]
        out[on] = np.where((u <= low + EDGE) & (way < 0.0), -1.0, np.where((u >= high - EDGE) & (way > 0.0), 1.0, 0.0))
        return out

    def _step(self, state: State) -> Array:
        """Newton's step (m + 1,) in the borders' parameters; zero for joins that cannot move."""
        joins = state.structure.joins
        rows = np.array([i for i, j in enumerate(joins) if j.kind in MOVING and state.bound[i] == 0.0], dtype=np.int64)
        step = np.zeros(len(joins))
        matrix, right = state.jacobian[np.ix_(rows, rows)], -state.residual[rows]
        try:
            newton = np.linalg.solve(matrix, right)
        except np.linalg.LinAlgError:
            newton = np.linalg.lstsq(matrix, right, rcond=1e-12)[0]
        # Near a corner of two arcs all sizes look alike and the matrix is nearly singular, and legs that pass
        # other borders turn the wrong way; each join alone knows its direction.
        alone = _alone(state)[rows]
        large = np.abs(right) > max(NEAR, 0.5 * state.error)
        astray = state.jacobian.diagonal()[rows] * state.diagonal[rows] < 0.0
        if ((newton * alone < 0.0) & (large | (astray & (np.abs(right) > FINE)))).any():
            newton = alone
        step[rows] = newton
        return step

    def _jacobian(self, joins: Sequence[Join], leg: Indices, flight: Flight) -> Array:
        """(m + 1, m + 1) derivatives of residuals by the borders' parameters."""
        count = len(joins)
        velocity, bend = np.zeros((count, 2)), np.zeros(count)
        on = np.array([i for i, j in enumerate(joins) if j.border >= 0 and j.kind is not Kind.END], dtype=np.int64)
        curves = self.diagram.curves.take(np.array([joins[i].border for i in on], dtype=np.int64))
        u = np.array([joins[i].u for i in on])
        stretch = _stretch(curves, u)
        sign = np.where(curves.span[:, 1] >= curves.span[:, 0], 1.0, -1.0)
        velocity[on] = curves.tangents(u) * (stretch * sign)[:, None]
        bend[on] = curves.curvature(u) * stretch * sign
        motion = np.stack([velocity[leg], velocity[leg + 1]], axis=1)
        turn = turns(self.chart, flight, motion)
        d_out, d_in = np.zeros((count, count)), np.zeros((count, count))
        d_out[leg, leg], d_out[leg, leg + 1] = turn[:, 0, 0], turn[:, 0, 1]
        d_in[leg + 1, leg], d_in[leg + 1, leg + 1] = turn[:, 1, 0], turn[:, 1, 1]
        d_out[np.arange(count), np.arange(count)] -= bend
        d_in[np.arange(count), np.arange(count)] -= bend
        rows = {
            Kind.CROSS: lambda i: d_in[i] - d_out[i],
            Kind.ATTACH: lambda i: d_in[i],
            Kind.LEAVE: lambda i: d_out[i],
        }
        out = np.zeros((count, count))
        for i, join in enumerate(joins):
            if join.kind in rows:
                out[i] = rows[join.kind](i)
        return out


def _stretch(curves: Curves, u: Array) -> Array:
    """Arc length per parameter."""
    size = np.where(curves.kind == PARABOLA, curves.size, 1.0)
    return np.where(curves.kind == PARABOLA, np.hypot(1.0, u / size), 1.0)


def _alone(state: State) -> Array:
    """(m + 1,) the step that each join would take if the others stood still."""
    diagonal = state.diagonal
    step: Array = -state.residual / np.where(diagonal != 0.0, diagonal, 1.0)
    return step


def _wrapped(angle: Array) -> Array:
    """The angle in [-pi, pi)."""
    out: Array = np.mod(angle + np.pi, 2.0 * np.pi) - np.pi
    return out
