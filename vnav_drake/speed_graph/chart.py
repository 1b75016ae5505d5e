"""Legs of a path in their cells: lengths of time, headings at their ends, and how these turn when ends move.

In a cell the robot sees one feature. `frame` gives position p in the coordinates of that feature: the
clearance d along the outward unit vector o, and theta (arc length along a wall, angle at a point) along the
sideways unit vector w, with dp = dd o + r dtheta w (r = 1 at a wall).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from vnav_drake.arcs import Legs, leg_points, solve_legs
from vnav_drake.braking import UniformBraking
from vnav_drake.speed_graph.cells import reference_angles
from vnav_drake.world import World

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Frame:
    """Positions in the coordinates of the features of their cells."""

    at_point: Mask  # (n,) the feature is a vertex
    clearance: Array  # (n,) [m]
    theta: Array  # (n,) [m] along an edge, [rad] at a vertex
    outward: Array  # (n, 2) unit vectors o
    sideways: Array  # (n, 2) unit vectors w
    reach: Array  # (n,) r: 1 at a wall, distance [m] from the vertex at a point


@dataclass(frozen=True)
class Chart:
    """A world seen by a robot of `radius` [m] with its braking law."""

    world: World
    law: UniformBraking
    radius: float

    @cached_property
    def _angles(self) -> tuple[Array, Mask]:
        return reference_angles(self.world)

    @property
    def reference(self) -> Array:
        """(n,) [rad] direction from which angles at each vertex are counted; none jumps within its sector."""
        return self._angles[0]

    @property
    def lone(self) -> Mask:
        """(n,) vertices without walls."""
        return self._angles[1]


def frame(chart: Chart, cell: Indices, position: Array) -> Frame:
    """Coordinates of positions (n, 2) [m] in cells (n,)."""
    world, radius = chart.world, chart.radius
    edges = len(world.edges)
    at_point = cell >= 2 * edges
    edge = (
        world.edges[np.where(at_point, 0, cell // 2)] if edges else np.zeros((len(cell), 2), dtype=np.int64)
    )
    a = world.vertices[edge[:, 0]]
    along = world.vertices[edge[:, 1]] - a
    size = np.hypot(along[:, 0], along[:, 1])
    along = along / np.where(size > 0.0, size, 1.0)[:, None]
    side = np.where(cell % 2 == 0, 1.0, -1.0)  # 0: the cell lies left of the edge
    normal = np.column_stack([-along[:, 1], along[:, 0]]) * side[:, None]
    vertex = np.where(at_point, cell - 2 * edges, 0)
    offset = position - np.where(at_point[:, None], world.vertices[vertex], a)
    distance = np.hypot(offset[:, 0], offset[:, 1])
    radial = offset / np.where(distance > 0.0, distance, 1.0)[:, None]
    outward = np.where(at_point[:, None], radial, normal)
    turned = np.column_stack([-radial[:, 1], radial[:, 0]])
    angle = np.mod(np.arctan2(offset[:, 1], offset[:, 0]) - chart.reference[vertex], 2.0 * np.pi)
    return Frame(
        at_point,
        np.where(at_point, distance, np.einsum("ij,ij->i", offset, normal)) - radius,
        np.where(at_point, angle, np.einsum("ij,ij->i", offset, along)),
        outward,
        np.where(at_point[:, None], turned, along),
        np.where(at_point, distance, 1.0),
    )


@dataclass(frozen=True)
class Flight:
    """Legs between two positions each, as they leave and arrive."""

    start: Frame
    end: Frame
    sweep: Array  # (n,) signed growth of theta
    legs: Legs
    heading: Array  # (n, 2) [rad], at start and end

    @property
    def time(self) -> Array:
        """(n,) [s]"""
        return self.legs.time


def fly(chart: Chart, cell: Indices, position: Array, sweep: Array, *, hessian: bool = False) -> Flight:
    """Optimal legs in cells (n,) between positions (n, 2, 2) [m].

    `sweep` (n,) tells which way round an isolated point: the angle swept is the one nearest to it.
    """
    law, radius = chart.law, chart.radius
    start, end = (frame(chart, cell, position[:, k]) for k in (0, 1))
    level = law.margin
    d1, d2 = (np.maximum(f.clearance, level) for f in (start, end))
    growth = end.theta - start.theta
    turn = 2.0 * np.pi * np.round((growth - sweep) / (2.0 * np.pi))
    lone = start.at_point & chart.lone[np.where(start.at_point, cell - 2 * len(chart.world.edges), 0)]
    growth = np.where(lone, growth - turn, growth)
    legs = solve_legs(law, radius, start.at_point, d1, d2, np.abs(growth), hessian=hessian)
    sign = np.where(growth < 0.0, -1.0, 1.0)
    heading = np.empty((len(cell), 2))
    for k, f in enumerate((start, end)):
        d = d1 if k == 0 else d2
        sine = np.clip(legs.invariant * law.speed(d) / f.reach, 0.0, 1.0)
        beta = np.arctan2(sine, np.clip(legs.outward[:, k], -1.0, 1.0))
        heading[:, k] = np.arctan2(f.outward[:, 1], f.outward[:, 0]) + _hand(f) * sign * beta
    return Flight(start, end, growth, legs, heading)


def turns(chart: Chart, flight: Flight, motion: Array) -> Array:
    """How the headings change: (n, 2, 2) [rad], [leg, at start or end, start or end moved by its `motion`].

    `motion` (n, 2, 2): small moves [m] of start and end. Derived from the second derivatives of T in
    (d1, d2, |dtheta|): T_d1 = -cos(beta1) / V1, T_d2 = cos(beta2) / V2 and T_theta = k = sin(beta) r / V
    give cos(beta) and sin(beta) at either end, hence d beta = -sin(beta) d cos(beta) + cos(beta) d sin(beta).
    """
    hessian, law = flight.legs.hessian, chart.law
    if hessian is None:
        raise ValueError("the legs were solved without second derivatives")
    # infinite at an end without speed, which is fixed
    hessian = np.where(np.isfinite(hessian), hessian, 0.0)
    sign = np.where(flight.sweep < 0.0, -1.0, 1.0)
    ends = (flight.start, flight.end)
    rise = [np.einsum("ij,ij->i", f.outward, motion[:, k]) for k, f in enumerate(ends)]
    slide = [np.einsum("ij,ij->i", f.sideways, motion[:, k]) / f.reach for k, f in enumerate(ends)]
    out = np.zeros((len(sign), 2, 2))
    k_ = flight.legs.invariant
    for mover in (0, 1):
        dx = np.zeros((len(sign), 3))
        dx[:, mover] = rise[mover]
        dx[:, 2] = sign * slide[mover] * (1.0 if mover == 1 else -1.0)
        change = np.einsum("nij,nj->ni", hessian, dx)  # of T_d1, T_d2, k
        for at, f in enumerate(ends):
            d = np.maximum(f.clearance, law.margin)
            speed, slope = law.speed(d), law.speed_slope(d)
            outward = flight.legs.outward[:, at]
            direction = 1.0 if at == 1 else -1.0
            moved = rise[mover] if mover == at else 0.0
            # outward = direction V T_d
            d_cos = (
                slope * moved * outward / np.where(speed > 0.0, speed, 1.0)
                + direction * speed * change[:, at]
            )
            shrink = np.where(f.at_point, speed / f.reach**2, 0.0)
            d_sin = change[:, 2] * speed / f.reach + k_ * (slope / f.reach - shrink) * moved
            sine = k_ * speed / f.reach
            beta = -sine * d_cos + outward * d_sin
            own = slide[mover] if mover == at else 0.0
            out[:, at, mover] = np.where(f.at_point, own, 0.0) + _hand(f) * sign * beta
    return out


def along(chart: Chart, cell: Indices, flight: Flight, part: Array) -> tuple[Array, Array]:
    """Positions (n, k, 2) [m] on legs at parts (k,) in [0, 1]; clearance (n, k) [m] to their features."""
    world, law, radius = chart.world, chart.law, chart.radius
    d1, d2 = (np.maximum(f.clearance, law.margin) for f in (flight.start, flight.end))
    theta, d = leg_points(law, radius, flight.start.at_point, d1, d2, np.abs(flight.sweep), part)
    sign = np.where(flight.sweep < 0.0, -1.0, 1.0)[:, None]
    theta = flight.start.theta[:, None] + sign * theta
    edges = len(world.edges)
    at_point = flight.start.at_point
    vertex = world.vertices[np.where(at_point, cell - 2 * edges, 0)]
    angle = theta + chart.reference[np.where(at_point, cell - 2 * edges, 0)][:, None]
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    around = vertex[:, None] + (d + radius)[..., None] * circle
    first = world.vertices[world.edges[np.where(at_point, 0, cell // 2), 0]] if edges else vertex
    beside = (
        first[:, None]
        + theta[..., None] * flight.start.sideways[:, None]
        + (d + radius)[..., None] * flight.start.outward[:, None]
    )
    return np.where(at_point[:, None, None], around, beside), d


def _hand(f: Frame) -> Array:
    """+1 where w lies left of o, -1 where it lies right."""
    cross = f.outward[:, 0] * f.sideways[:, 1] - f.outward[:, 1] * f.sideways[:, 0]
    return np.where(cross >= 0.0, 1.0, -1.0)
