"""The vc-method's route along one axis: its arc length (Manor 2015, Sec. 2.6 and Fig. 2.10)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verify.report.drawings import UnfoldedDrawing, UnfoldedStack
from verify.vc_shapes import slice_of
from vnav_drake.plan import Trajectory
from vnav_drake.problem import End, Problem
from vnav_drake.vc_method.planner import VcResult
from vnav_drake.vc_method.profile import ACCELERATE, BOUNDARY, BRAKE, arc_profile
from vnav_drake.voronoi import Curves

Array = NDArray[np.float64]

LINE_POINTS = 500  # that a route is drawn with, about
PIECE_POINTS = 10  # that one piece of the profile is drawn with
DRIVEN_POINTS = 500  # that the motion is drawn with
NEAR = 0.15  # of the route's length: a place of the motion is looked for this far along the arcs
MODES = {BOUNDARY: "boundary", ACCELERATE: "accelerate", BRAKE: "brake"}


@dataclass(frozen=True)
class Line:
    """Samples along curves end to end, in order of travel."""

    points: Array  # (n, 2) [m]
    s: Array  # (n,) [m], rising from 0
    distance: Array  # (n,) [m], to the nearest feature

    def nearest(self, point: Array, begin: float, end: float) -> int:
        """The sample nearest to a point (2,) [m] between two arc lengths [m]."""
        away = np.hypot(*(self.points - point).T)
        inside = (self.s >= begin) & (self.s <= end)
        return int(np.argmin(np.where(inside | ~inside.any(), away, np.inf)))


def sampled(curves: Curves, points: int = LINE_POINTS) -> Line:
    """About `points` samples along curves end to end, both ends of each among them.

    Raises
    ------
    ValueError : the curves have no length.
    """
    lengths = curves.length
    total = float(lengths.sum())
    if not total > 0.0:
        raise ValueError("curves without length cannot be sampled")
    pieces = np.maximum(2, np.ceil(points * lengths / total)).astype(np.int64)
    row = np.repeat(np.arange(len(curves)), pieces + 1)
    part = np.arange(len(row)) - np.repeat(np.cumsum(pieces + 1) - pieces - 1, pieces + 1)
    some = curves.take(row)
    u = some.span[:, 0] + part / pieces[row] * np.diff(some.span, axis=1)[:, 0]
    begin = np.concatenate([[0.0], np.cumsum(lengths)])[:-1]
    s = begin[row] + np.abs(some.arc_length(u) - some.arc_length(some.span[:, 0]))
    kept = np.concatenate([[True], np.diff(s) > 0.0])
    return Line(some.points(u)[kept], s[kept], some.distance(u)[kept])


def unfolded(problem: Problem, result: VcResult) -> UnfoldedDrawing:
    """The route over its arc length: roof, cells, profile along the arcs, and the motion that was driven."""
    route = result.route
    line = sampled(route.curves)
    saddles = _saddles(result, line)
    stacks, chain = _stacks(problem, result, line, saddles[:, 0])
    driven, corners = _driven(result, line)
    ends = np.cumsum(route.curves.length)[:-1]
    at_node = (route.borders[:-1] >= 0) & (route.borders[1:] >= 0)
    return UnfoldedDrawing(
        s=line.s,
        roof=problem.braking.speed(line.distance - problem.robot.radius),
        pieces=_pieces(problem, route.curves),
        stacks=stacks,
        saddles=saddles,
        nodes=ends[at_node],
        chain=chain,
        driven=driven,
        corners=corners,
    )


def _saddles(result: VcResult, line: Line) -> Array:
    """(k, 2) arc length [m] and speed [m/s] of the saddles passed, in order."""
    out, after = [], 0.0
    spacing = float(np.diff(line.s).max(initial=0.0))
    for row in result.route.saddles:
        away = np.hypot(*(line.points - result.critical.point[row]).T)
        there = np.flatnonzero((line.s > after) & (away <= spacing))
        if len(there) == 0:
            there = np.flatnonzero(line.s >= after)
        stop = np.flatnonzero(np.diff(there, append=there[-1] + 2) > 1)[0] + 1  # the first visit
        best = there[:stop][int(np.argmin(away[there[:stop]]))]
        after = float(line.s[best])
        out.append((after, float(result.critical.speed[row])))
    return np.array(out).reshape(-1, 2)


def _visits(result: VcResult) -> list[list[int]]:
    """The chain of cells, cut where it passes a saddle."""
    stack = result.decomposition.cell_stack
    visits: list[list[int]] = []
    before = None
    for cell in result.route.cells:
        # A stack that meets itself at a saddle has the same cell on both sides.
        if before is None or stack[cell] != stack[before] or cell == before:
            visits.append([])
        visits[-1].append(cell)
        before = cell
    return visits


def _stacks(
    problem: Problem, result: VcResult, line: Line, saddles: Array
) -> tuple[list[UnfoldedStack], Array]:
    """Stacks between the saddles, and the vertices of the chain where the route is nearest to them."""
    d, graph = result.decomposition, result.graph
    bounds = np.concatenate([[0.0], saddles, line.s[-1:]])
    stacks, chain = [], []
    for cells, begin, end in zip(_visits(result), bounds[:-1].tolist(), bounds[1:].tolist(), strict=True):
        stack = int(d.cell_stack[cells[0]])
        first, last = int(d.first_cell[stack]), int(d.first_cell[stack + 1])
        stacks.append(
            UnfoldedStack(
                begin=begin,
                end=end,
                tops=d.cell_top[first:last].tolist(),
                used=[cell in cells for cell in range(first, last)],
                ground=slice_of(d, stack, problem.robot.radius + problem.braking.margin),
            )
        )
        middle = line.s[line.nearest(result.critical.point[d.maximum[stack]], begin, end)]
        chain += [(float(middle), float(graph.speed[cell])) for cell in cells]
    return stacks, np.array(chain)


def _pieces(problem: Problem, curves: Curves) -> list[tuple[str, Array, Array]]:
    """The profile along the arcs: how it runs, arc lengths [m] and speeds [m/s]."""
    profile = arc_profile(
        curves,
        np.zeros(len(curves), dtype=np.int64),
        problem.braking,
        problem.robot,
        start_speed=_greatest(problem.start),
        end_speed=_greatest(problem.goal),
    )
    share = np.linspace(0.0, 1.0, PIECE_POINTS)
    rows = profile.curves
    u = rows.span[:, :1] + share * np.diff(rows.span, axis=1)
    s = profile.begin[:, None] + np.abs(rows.arc_length(u) - rows.arc_length(rows.span[:, 0])[:, None])
    along = (s - profile.begin[:, None]) / np.maximum(profile.end - profile.begin, 1e-300)[:, None]
    ramp = np.sqrt(profile.square[:, :1] + np.clip(along, 0, 1) * np.diff(profile.square, axis=1))
    limit = problem.braking.speed(rows.distance(u) - problem.robot.radius)
    speed = np.where((profile.mode == BOUNDARY)[:, None], limit, ramp)
    return [(MODES[int(m)], a, v) for m, a, v in zip(profile.mode, s, speed, strict=True)]


def _greatest(end: End) -> float:
    return np.inf if end.fixed_speed is None else end.fixed_speed


def _driven(result: VcResult, line: Line) -> tuple[Array, Array]:
    """The motion (m, 2) and its corners (r, 4) over the arc length of the arcs."""
    found = result.realisation
    motion: Trajectory = found.trajectory
    s = np.linspace(0.0, motion.arc_length[-1], DRIVEN_POINTS)
    points = np.column_stack(
        [np.interp(s, motion.arc_length, motion.x), np.interp(s, motion.arc_length, motion.y)]
    )
    speed = np.sqrt(np.interp(s, motion.arc_length, np.square(motion.v)))
    guess = s * line.s[-1] / s[-1]
    away = np.hypot(points[:, None, 0] - line.points[:, 0], points[:, None, 1] - line.points[:, 1])
    far = np.abs(guess[:, None] - line.s) > NEAR * line.s[-1]
    place = line.s[np.argmin(np.where(far, np.inf, away), axis=1)]
    place = np.maximum.accumulate(place)
    corners, after = [], 0
    for point, radius, wanted in zip(found.point, found.radius, found.wanted, strict=True):
        after += int(np.argmin(np.hypot(*(points[after:] - point).T)))
        corners.append((place[after], speed[after], radius, wanted))
    return np.column_stack([place, speed]), np.array(corners).reshape(-1, 4)
