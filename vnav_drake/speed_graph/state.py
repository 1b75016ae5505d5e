"""Kinks of a path of given structure, and how they change when its joins move.

Residuals, one a join that can move (Manor 2015, Sec. 3.6):

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
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vnav_drake.speed_graph.chart import Chart, Flight, fly, turns
from vnav_drake.speed_graph.structure import Join, Kind, Structure, parameter_on, places_of
from vnav_drake.voronoi import PARABOLA, Curves, VoronoiDiagram, travel_time

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

MOVING = (Kind.CROSS, Kind.ATTACH, Kind.LEAVE)
EDGE = 1e-9  # [m]: a join this near to the end of its border is at the node
FLAT = 1e-6  # [rad/m]: a smaller derivative is no guide to the length of a step


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

    @property
    def time(self) -> float:
        """Travel time [s]."""
        return float(self.flight.time.sum()) + self.ride_time

    @property
    def error(self) -> float:
        """Largest residual of the joins that are free to move."""
        return float(np.abs(np.where(self.bound == 0.0, self.residual, 0.0)).max(initial=0.0))


class Evaluator:
    """Times and kinks of structures in one world, for one robot and braking law."""

    def __init__(self, diagram: VoronoiDiagram, chart: Chart) -> None:
        self.diagram, self.chart = diagram, chart
        self.span = diagram.curves.span

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
        diagonal = self._diagonal(structure, residual, jacobian)
        bound = self._pushed(joins, residual, diagonal)
        return State(
            structure,
            place,
            leg,
            flight,
            tangent,
            residual,
            jacobian,
            diagonal,
            bound,
            float(self.ride_times(structure).sum()),
        )

    def _onward(self, structure: Structure, tangent: Array) -> Array:
        """Heading [rad] of the ride at joins that begin or end one, in the direction of travel."""
        out = tangent.copy()
        for i, join in enumerate(structure.joins):
            if join.kind in (Kind.ATTACH, Kind.LEAVE):
                ride = structure.pieces[i if join.kind is Kind.ATTACH else i - 1]
                span = self.span[join.border]
                if ride.sweep * (span[1] - span[0]) < 0.0:
                    out[i] += np.pi
        return out

    def ride_times(self, structure: Structure) -> Array:
        """(m,) [s] along borders, of each piece; zero for legs."""
        times = np.zeros(len(structure.pieces))
        rows, spans = [], []
        for i, piece in enumerate(structure.pieces):
            if piece.is_ride:
                span = [self.parameter(structure.joins[k], piece.border) for k in (i, i + 1)]
                if span[0] != span[1]:
                    rows.append(i)
                    spans.append(span)
        if rows:
            borders = np.array([structure.pieces[i].border for i in rows])
            curves = self.diagram.curves.take(borders).cut(np.array(spans))
            times[rows] = travel_time(curves, self.chart.law, self.chart.radius)
        return times

    def parameter(self, join: Join, border: int) -> float:
        """Where a join lies on a border that it is on."""
        return parameter_on(self.diagram, join, border)

    def _diagonal(self, structure: Structure, residual: Array, jacobian: Array) -> Array:
        """(m + 1,) derivative of each residual by its own join, with the sign that it must have.

        A leg on the wrong side of its ride wants a longer ride, one on the right side a shorter one. The
        raw leg may say otherwise where it passes another border on its way. A leg that runs back along the
        ride wants a shorter one whatever its side.
        """
        out = jacobian.diagonal().copy()
        for i, join in enumerate(structure.joins):
            if join.kind in (Kind.ATTACH, Kind.LEAVE):
                ride = structure.pieces[i if join.kind is Kind.ATTACH else i - 1]
                leg = structure.pieces[i - 1 if join.kind is Kind.ATTACH else i]
                span = self.span[join.border]
                left = self.diagram.cells[join.border, 0 if ride.sweep * (span[1] - span[0]) > 0.0 else 1]
                side = 1.0 if leg.cell == left else -1.0
                if abs(residual[i]) > 0.5 * math.pi:
                    side = math.copysign(1.0, residual[i]) * (1.0 if join.kind is Kind.LEAVE else -1.0)
                out[i] = math.copysign(max(abs(out[i]), FLAT), ride.sweep * side)
        return out

    def _pushed(self, joins: Sequence[Join], residual: Array, diagonal: Array) -> Array:
        """(m + 1,) -1 or +1 where a join at the low or high end of its border is pushed beyond it."""
        out = np.zeros(len(joins))
        on = np.array([i for i, j in enumerate(joins) if j.kind in MOVING], dtype=np.int64)
        if len(on) == 0:
            return out
        u = np.array([joins[i].u for i in on])
        low, high = np.sort(self.span[[joins[i].border for i in on]], axis=1).T
        way = -residual[on] * diagonal[on]
        out[on] = np.where(
            (u <= low + EDGE) & (way < 0.0), -1.0, np.where((u >= high - EDGE) & (way > 0.0), 1.0, 0.0)
        )
        return out

    def _jacobian(self, joins: Sequence[Join], leg: Indices, flight: Flight) -> Array:
        """(m + 1, m + 1) derivatives of residuals by the borders' parameters."""
        count = len(joins)
        velocity, bend = np.zeros((count, 2)), np.zeros(count)
        on = np.array(
            [i for i, j in enumerate(joins) if j.border >= 0 and j.kind is not Kind.END], dtype=np.int64
        )
        curves = self.diagram.curves.take(np.array([joins[i].border for i in on], dtype=np.int64))
        u = np.array([joins[i].u for i in on])
        stretch = stretch_of(curves, u)
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


def stretch_of(curves: Curves, u: Array) -> Array:
    """Arc length per parameter (n,) of curves at u (n,)."""
    size = np.where(curves.kind == PARABOLA, curves.size, 1.0)
    return np.where(curves.kind == PARABOLA, np.hypot(1.0, u / size), 1.0)


def _wrapped(angle: Array) -> Array:
    """The angle in [-pi, pi)."""
    out: Array = np.mod(angle + np.pi, 2.0 * np.pi) - np.pi
    return out
