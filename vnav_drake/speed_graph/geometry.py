"""A structure as a curve: sample points, and the path of circular arcs through them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from vnav_drake.biarcs import biarcs
from vnav_drake.plan import Path
from vnav_drake.speed_graph.chart import along
from vnav_drake.speed_graph.state import Evaluator, State

Array = NDArray[np.float64]

LEG_SAMPLES = 41  # of each leg
CAPPED_SAMPLES = 161
RIDE_SAMPLES = 21  # of each stretch on a Voronoi arc
SHORT = 1e-9  # [m]: pieces shorter than this are left out


Pieces = list[tuple[Array, Array]]


def sampled_pieces(solver: Evaluator, state: State) -> Pieces:
    """Points (k, 2) [m] and unit tangents (k, 2) along each piece, in the direction of travel."""
    structure = state.structure
    # curvature jumps where a leg reaches the greatest speed, which a spline must be fine enough to follow
    count = LEG_SAMPLES if np.isinf(solver.chart.law.max_speed) else CAPPED_SAMPLES
    part = 0.5 - 0.5 * np.cos(np.pi * np.linspace(0.0, 1.0, count))
    cell = np.array([structure.pieces[i].cell for i in state.leg], dtype=np.int64)
    points, _ = along(solver.chart, cell, state.flight, part)
    row = {int(i): k for k, i in enumerate(state.leg)}
    out = []
    for i, piece in enumerate(structure.pieces):
        if piece.is_ride:
            u0, u1 = (solver.parameter(structure.joins[k], piece.border) for k in (i, i + 1))
            curve = solver.diagram.curves.take([piece.border]).cut(np.array([[u0, u1]]))
            u = np.linspace(u0, u1, RIDE_SAMPLES)[None]
            out.append((curve.points(u)[0], curve.tangents(u)[0]))
        else:
            leg = points[row[i]].copy()
            leg[0], leg[-1] = state.place[i], state.place[i + 1]
            out.append((leg, _tangents(part, leg, state.flight.heading[row[i]])))
    return out


def _tangents(part: Array, points: Array, heading: Array) -> Array:
    """Unit tangents (k, 2) of a smooth leg through points; exact at both ends."""
    angle = np.arccos(1.0 - 2.0 * part)
    slope = CubicSpline(angle, points)(angle, 1)
    size = np.hypot(slope[:, 0], slope[:, 1])
    tangent = slope / np.where(size > 0.0, size, 1.0)[:, None]
    tangent[0] = math.cos(heading[0]), math.sin(heading[0])
    tangent[-1] = math.cos(heading[1]), math.sin(heading[1])
    return tangent


def polyline(pieces: Pieces) -> Array:
    """Points (n, 2) [m] along the whole path, from its sampled pieces."""
    return np.concatenate([pieces[0][0], *(points[1:] for points, _ in pieces[1:])])


def arc_path(state: State, pieces: Pieces) -> Path:
    """The path as circular arcs through its sampled pieces, without kinks up to rounding."""
    corner: list[Array] = []
    heading: list[Array] = []
    bend: list[Array] = []
    length: list[Array] = []
    last = state.place[-1]
    for points, tangents in pieces:
        if np.hypot(*np.diff(points, axis=0).T).sum() <= SHORT:
            continue
        keep = np.concatenate([[True], np.hypot(*np.diff(points, axis=0).T) > SHORT])
        arcs = biarcs(points[keep], tangents[keep])
        for values, part in zip((corner, heading, bend, length), arcs, strict=True):
            values.append(part)
    headings, bends, sizes = np.concatenate(heading), np.concatenate(bend), np.concatenate(length)
    points = np.concatenate([*corner, last[None]])
    jump = headings[1:] - (headings + bends * sizes)[:-1]
    turns = np.concatenate([[0.0], np.cumsum(np.rint(jump / (2.0 * np.pi)))])
    return Path(points[:, 0], points[:, 1], headings - 2.0 * np.pi * turns, bends, sizes)
