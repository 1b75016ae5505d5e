"""Sample points on the borders of proximity cells, evenly spaced in travel time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vnav_drake.braking import UniformBraking
from vnav_drake.problem import End, NoPathError, Problem
from vnav_drake.speed_graph.cells import Strips
from vnav_drake.voronoi import Curves, VoronoiDiagram

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

NODE, ARC, BORDER, END = 0, 1, 2, 3  # kinds: Voronoi node, on a Voronoi arc, on another border, start or goal
NEAR = 1e-9  # of the world's diameter: points this near are one; far above rounding, far below any gap
_GRID = 24  # cells of the table from which places at given times are read
_AROUND = 0.5 ** np.arange(1, 6)  # of the spacing: samples on the arc right above an end
_MOST = 400  # samples of one border at most: with a reaction time the way to V = 0 takes for ever


@dataclass(frozen=True)
class Samples:
    """Graph nodes and the borders they lie on.

    Stations are the nodes along each border in order of u, its ends included: a Voronoi node is a
    station of every border that meets there.
    """

    point: Array  # (n, 2) [m]
    clearance: Array  # (n,) [m]
    kind: Indices  # (n,) NODE, ARC, BORDER or END (start or goal inside a cell)
    curve: Indices  # (n,) a border through the node; -1 inside a cell
    parameter: Array  # (n,) [m] u on it; 0 inside a cell
    station_curve: Indices  # (s,) increasing
    station_parameter: Array  # (s,) [m] increasing on each border
    station_node: Indices  # (s,)
    free_strip: Indices  # (f,) strips that hold an end which lies on no border
    free_theta: Array  # (f,)
    free_node: Indices  # (f,)
    start: int
    goal: int


@dataclass(frozen=True)
class _Place:
    """Where a point lies: at a node, on a border, or inside cells."""

    node: int  # -1 if at none
    curve: int  # -1 if on none
    parameter: float  # [m]
    strip: Indices  # that hold it
    theta: Array


def place_samples(problem: Problem, strips: Strips, spacing: float) -> Samples:
    """Samples at most about `spacing` [s] apart on all borders, start and goal among them.

    The least clearance of every Voronoi arc is a sample. Start and goal are nodes of their own unless
    they lie on a Voronoi node.

    Raises
    ------
    NoPathError : start or goal has no room for the robot.
    """
    diagram = strips.diagram
    places = [_locate(problem, strips, name, getattr(problem, name)) for name in ("start", "goal")]
    saddle = np.flatnonzero(diagram.primary & diagram.curves.has_interior_minimum)
    on_border = [p for p in places if p.node < 0 and p.curve >= 0]
    above = [_above(problem, strips, p, spacing) for p in places if p.node < 0 and p.curve < 0]
    cut_curve = np.concatenate([saddle, np.array([p.curve for p in on_border], int), *(c for c, _ in above)])
    cut_at = np.concatenate(
        [np.zeros(len(saddle)), np.array([p.parameter for p in on_border]), *(u for _, u in above)]
    )
    curve, low, high = _pieces(diagram.curves, cut_curve, cut_at)
    inner_curve, inner_at = _evenly(
        diagram.curves.take(curve), np.column_stack([low, high]), problem, curve, spacing
    )
    begins = low > diagram.curves.span[curve, 0]  # a piece that begins at a cut
    new_curve = np.concatenate([curve[begins], inner_curve])
    new_at = np.concatenate([low[begins], inner_at])
    order = np.lexsort([new_at, new_curve])
    new_curve, new_at = new_curve[order], new_at[order]

    count = len(diagram.nodes)
    new_id = count + np.arange(len(new_curve))
    total = count + len(new_curve)
    ids: list[int] = []
    free: list[tuple[_Place, int]] = []
    for place in places:
        if ids and problem.start.position == problem.goal.position:
            ids.append(ids[0])
        elif place.node >= 0:
            ids.append(place.node)
        elif place.curve >= 0:
            here = np.flatnonzero(new_curve == place.curve)
            ids.append(int(new_id[here[np.argmin(np.abs(new_at[here] - place.parameter))]]))
        else:
            free.append((place, total))
            ids.append(total)
            total += 1
    point = np.concatenate(
        [
            diagram.nodes,
            diagram.curves.take(new_curve).points(new_at),
            np.array(
                [
                    getattr(problem, n).position
                    for n, i in zip(("start", "goal"), ids, strict=True)
                    if i >= count + len(new_curve)
                ]
            ).reshape(-1, 2),
        ]
    )
    distance = np.concatenate(
        [
            diagram.node_distance,
            diagram.curves.take(new_curve).distance(new_at),
            diagram.world.distance(point[count + len(new_curve) :]),
        ]
    )
    kind = np.concatenate(
        [
            np.full(count, NODE),
            np.where(diagram.primary[new_curve], ARC, BORDER),
            np.full(total - count - len(new_curve), END),
        ]
    )
    ends = diagram.ends.reshape(-1)
    end_curve, end_at = np.arange(len(ends)) // 2, diagram.curves.span.reshape(-1)
    own_curve, own_at = np.full(total, -1), np.zeros(total)
    rank = np.argsort(diagram.primary[end_curve], kind="stable")  # a Voronoi arc is preferred
    own_curve[ends[rank]], own_at[ends[rank]] = end_curve[rank], end_at[rank]
    own_curve[new_id], own_at[new_id] = new_curve, new_at
    station_curve = np.concatenate([end_curve, new_curve])
    station_at = np.concatenate([end_at, new_at])
    station_node = np.concatenate([ends, new_id])
    order = np.lexsort([station_at, station_curve])
    return Samples(
        point,
        distance - problem.robot.radius,
        kind,
        own_curve,
        own_at,
        station_curve[order],
        station_at[order],
        station_node[order],
        np.concatenate([np.zeros(0, dtype=np.int64), *(p.strip for p, _ in free)]),
        np.concatenate([np.zeros(0), *(p.theta for p, _ in free)]),
        np.concatenate([np.zeros(0, dtype=np.int64), *(np.full(len(p.strip), i) for p, i in free)]),
        ids[0],
        ids[1],
    )


def _locate(problem: Problem, strips: Strips, name: str, end: End) -> _Place:
    diagram, point = strips.diagram, end.point
    level = problem.robot.radius + problem.braking.margin
    near = NEAR * diagram.world.diameter
    distance = float(problem.world.distance(point))
    if distance < level or distance <= 0.0:
        x, y = end.position
        raise NoPathError(
            f"{name} ({x:.6g}, {y:.6g}) is {distance:.6g} m from the nearest obstacle; the robot needs"
            f" {level:.6g} m (radius and braking margin)"
        )
    none = np.zeros(0, dtype=np.int64)
    if len(diagram.nodes):
        gap = np.hypot(*(diagram.nodes - point).T)
        if gap.min() <= near:
            return _Place(int(np.argmin(gap)), -1, 0.0, none, np.zeros(0))
    curves = diagram.curves
    u = np.clip(np.einsum("ij,ij->i", point - curves.origin, curves.axis), *curves.span.T)
    miss = np.hypot(*(curves.points(u) - point).T)
    if len(miss) and miss.min() <= near:
        curve = int(np.argmin(miss))
        return _Place(-1, curve, float(u[curve]), none, np.zeros(0))
    theta, reach = strips.coordinates(point)
    slack = np.where(strips.at_point, near / max(distance, near), near)
    holds = (
        (np.abs(reach - distance) <= near) & (theta >= strips.low - slack) & (theta <= strips.high + slack)
    )
    strip = np.flatnonzero(holds)
    strip = strip[strips.height(strip, theta[strip]) >= distance - near]
    if len(strip) == 0:
        x, y = end.position
        raise NoPathError(
            f"{name} ({x:.6g}, {y:.6g}): no Voronoi arc where the robot fits bounds its proximity cell"
        )
    return _Place(-1, -1, 0.0, strip, np.clip(theta[strip], strips.low[strip], strips.high[strip]))


def _above(problem: Problem, strips: Strips, place: _Place, spacing: float) -> tuple[Indices, Array]:
    """Borders and parameters right above an end inside a cell, and closer and closer around there.

    From a place just below the ridge only very short legs stay below it; straight up always one does.
    """
    side = strips.ridge[strips.row_at(place.strip, place.theta)]
    curve = np.repeat(side // 2, 2 * len(_AROUND) + 1)
    curves = strips.diagram.curves.take(curve)
    middle = np.repeat(strips.parameter(side, place.theta), 2 * len(_AROUND) + 1)
    time = spacing * np.tile(np.concatenate([-_AROUND, [0.0], _AROUND]), len(side))
    speed = problem.braking.speed(curves.distance(middle) - problem.robot.radius)
    step = curves.arc_length(middle) + speed * time
    return curve, np.where(time == 0.0, middle, curves.at_arc_length(step))


def _pieces(curves: Curves, cut_curve: Indices, cut_at: Array) -> tuple[Indices, Array, Array]:
    """Borders cut at inner parameters: border, u at start and end of each piece, in order."""
    count = len(curves)
    low, high = curves.span.T
    keep = (cut_at > low[cut_curve]) & (cut_at < high[cut_curve])
    curve = np.concatenate([np.arange(count), cut_curve[keep]])
    begin = np.concatenate([low, cut_at[keep]])
    order = np.lexsort([begin, curve])
    curve, begin = curve[order], begin[order]
    apart = np.append(True, (np.diff(curve) != 0) | (np.diff(begin) > 0.0)) if count else np.zeros(0, bool)
    curve, begin = curve[apart], begin[apart]
    last = np.append(np.diff(curve) != 0, True) if count else np.zeros(0, bool)
    return curve, begin, np.where(last, high[curve], np.roll(begin, -1))


def _evenly(
    pieces: Curves, span: Array, problem: Problem, curve: Indices, spacing: float
) -> tuple[Indices, Array]:
    """Border and parameter of places that divide the travel time of pieces evenly, about `spacing` [s]."""
    # Finer towards the ends, where V may vanish like the square root of the distance.
    share = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, _GRID + 1))
    u = span[:, :1] + np.diff(span, axis=1) * share
    step = np.diff(pieces.arc_length(u), axis=1)
    time = step / _speed(problem.braking, pieces.distance(0.5 * (u[:, 1:] + u[:, :-1])), problem.robot.radius)
    clock = np.concatenate([np.zeros((len(u), 1)), np.cumsum(time, axis=1)], axis=1)
    total = clock[:, -1]
    parts = np.clip(np.ceil(total / spacing - 1e-9), 1, _MOST).astype(np.int64)
    row = np.repeat(np.arange(len(u)), parts - 1)
    rank = np.arange(len(row)) - np.repeat(np.cumsum(parts - 1) - (parts - 1), parts - 1) + 1
    # one table for all pieces: whole numbers count pieces, fractions the share of their time
    relative = clock / np.where(total > 0.0, total, 1.0)[:, None]
    table = (2.0 * np.arange(len(u))[:, None] + relative).reshape(-1)
    place = np.interp(2.0 * row + rank / parts[row], table, u.reshape(-1))
    inside = (place > span[row, 0]) & (place < span[row, 1])
    return curve[row[inside]], place[inside]


def _speed(braking: UniformBraking, distance: Array, radius: float) -> Array:
    return np.maximum(braking.speed(distance - radius), np.finfo(float).tiny ** 0.25)


def arc_pieces(samples: Samples, diagram: VoronoiDiagram) -> tuple[Indices, Curves]:
    """Pieces of borders between neighbouring stations: row of the first station of each, and its curve."""
    first = np.flatnonzero(np.diff(samples.station_curve) == 0)
    span = np.column_stack([samples.station_parameter[first], samples.station_parameter[first + 1]])
    return first, diagram.curves.take(samples.station_curve[first]).cut(span)
