"""The sampled speed graph: samples on all borders, joined by exact optimal arcs.

Every edge is an optimal arc of one proximity cell that stays in it, or a piece of a border. So every path
through the graph is a path of the robot and its time is exact: the graph is never faster than the truth.
Paths that follow a Voronoi arc for a while (saturation, Manor 2015, Sec. 3.5) come out by themselves.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from vnav_drake.homotopy import Gates, build_gates
from vnav_drake.problem import NoClassError, NoPathError, Problem
from vnav_drake.speed_graph.cells import Strips, build_strips
from vnav_drake.speed_graph.crossings import Crossings, gate_crossings
from vnav_drake.speed_graph.legs import valid_legs
from vnav_drake.speed_graph.members import Members, Pairs, candidate_pairs, strip_members
from vnav_drake.speed_graph.route import Route
from vnav_drake.speed_graph.sampling import Samples, arc_pieces, place_samples
from vnav_drake.speed_graph.search import Edges, SearchResult, search_classes
from vnav_drake.voronoi import VoronoiDiagram, travel_time

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

SPACING = 0.4  # [s] between samples: ranks classes as well as finer ones do in rooms of 10 m and more
SMALL = 0.075  # in smaller ones: of the time that braking over the whole diagonal takes


@dataclass(frozen=True)
class SampledGraph:
    """Nodes, edges, and what they are."""

    problem: Problem
    diagram: VoronoiDiagram  # restricted to the distance at which V = 0
    gates: Gates
    strips: Strips
    samples: Samples
    edges: Edges
    strip: Indices  # (e,) strip of each leg; -1 along a border
    curve: Indices  # (e,) border along which the edge runs; -1 for legs
    theta: Array  # (e, 2) strip coordinate of a leg at tail and head, growing; zero along a border
    parameter: Array  # (e, 2) [m] u at tail and head along a border; zero for legs

    @property
    def start(self) -> int:
        """Its node."""
        return self.samples.start

    @property
    def goal(self) -> int:
        """Its node."""
        return self.samples.goal

    @property
    def node_count(self) -> int:
        """Number of nodes, start and goal included."""
        return len(self.samples.point)

    def route(self, time: float, word: tuple[int, ...], edge: Indices, forward: NDArray[np.bool_]) -> Route:
        """The route that follows edges (k,), forward or against their direction."""
        edge, forward = np.asarray(edge, dtype=np.int64), np.asarray(forward, dtype=bool)
        entered = np.where(forward, self.edges.tail[edge], self.edges.head[edge])
        left = np.where(forward, self.edges.head[edge], self.edges.tail[edge])
        curve, strip = self.curve[edge], self.strip[edge]
        goes_on = np.zeros(len(edge), dtype=bool)
        goes_on[1:] = (curve[1:] >= 0) & (curve[1:] == curve[:-1]) & (forward[1:] == forward[:-1])
        begins = np.flatnonzero(~goes_on)
        node = np.append(entered[begins], left[-1:]) if len(edge) else np.array([self.start])
        curve, strip, onward = curve[begins], strip[begins], forward[begins]
        border, parameter = self.samples.curve[node], self.samples.parameter[node]
        lone = (strip >= 0) & self.strips.isolated[strip]
        return Route(
            time,
            word,
            self.samples.point[node],
            border,
            parameter,
            np.where(strip >= 0, self.strips.cell[strip], -1),
            curve,
            np.where(lone, np.where(onward, 1, -1), 0),
        )

    @cached_property
    def kinds(self) -> dict[str, int]:
        """Numbers of nodes and edges by kind."""
        names = ("Voronoi nodes", "samples on Voronoi arcs", "samples on other borders", "ends in cells")
        count = np.bincount(self.samples.kind, minlength=len(names))
        out = {name: int(n) for name, n in zip(names, count, strict=True)}
        at_point = self.strips.at_point[self.strip] & (self.strip >= 0)
        out["legs around points"] = int(at_point.sum())
        out["legs along walls"] = int((self.strip >= 0).sum()) - out["legs around points"]
        out["pieces of borders"] = int((self.curve >= 0).sum())
        return out


def default_spacing(problem: Problem) -> float:
    """Time [s] between samples that ranks classes well."""
    return min(SPACING, SMALL * math.sqrt(2.0 * problem.world.diameter / problem.braking.max_braking))


def build_sampled(
    problem: Problem, diagram: VoronoiDiagram, gates: Gates | None = None, spacing: float | None = None
) -> SampledGraph:
    """The sampled speed graph of a problem.

    Parameters
    ----------
    diagram : of the problem's world, for any radius.
    gates : of the diagram restricted to `radius + margin`; built when None.
    spacing : greatest time [s] between neighbouring samples of a border; `default_spacing` when None.

    Raises
    ------
    ValueError : the spacing is not positive.
    NoPathError : start or goal has no room for the robot.
    """
    spacing = default_spacing(problem) if spacing is None else spacing
    if not 0.0 < spacing < np.inf:
        raise ValueError(f"spacing = {spacing!r}: must be positive and finite [s]")
    law, radius = problem.braking, problem.robot.radius
    level = radius + law.margin
    part = diagram.restricted(level)
    gates = build_gates(part, level) if gates is None else gates
    strips = build_strips(part)
    samples = place_samples(problem, strips, spacing)
    members = strip_members(strips, samples, law)
    clearance = np.maximum(samples.clearance[members.node], law.margin)
    pairs = candidate_pairs(strips, members, law.speed(clearance) >= law.max_speed)
    pairs, leg_time = valid_legs(law, radius, strips, members, pairs, clearance)
    first, pieces = arc_pieces(samples, part)
    piece_time = travel_time(pieces, law, radius)
    finite = np.isfinite(piece_time)
    first, piece_time = first[finite], piece_time[finite]
    crossed = gate_crossings(strips, gates, samples)
    return _assemble(problem, gates, strips, samples, members, pairs, leg_time, first, piece_time, crossed)


def _assemble(
    problem: Problem,
    gates: Gates,
    strips: Strips,
    samples: Samples,
    members: Members,
    pairs: Pairs,
    leg_time: Array,
    first: Indices,
    piece_time: Array,
    crossed: Crossings,
) -> SampledGraph:
    leg_begin, leg_end = crossed.of_legs(members, pairs)
    arc_begin, arc_end = crossed.of_pieces(first)
    count = len(first)
    edges = Edges(
        np.concatenate([members.node[pairs.first], samples.station_node[first]]),
        np.concatenate([members.node[pairs.second], samples.station_node[first + 1]]),
        np.concatenate([leg_time, piece_time]),
        np.concatenate([leg_begin, arc_begin]),
        np.concatenate([leg_end, arc_end]),
        crossed.letters,
    )
    theta = members.theta[pairs.first]
    along = np.column_stack([samples.station_parameter[first], samples.station_parameter[first + 1]])
    return SampledGraph(
        problem,
        strips.diagram,
        gates,
        strips,
        samples,
        edges,
        np.concatenate([members.strip[pairs.first], np.full(count, -1)]),
        np.concatenate([np.full(len(pairs), -1), samples.station_curve[first]]),
        np.concatenate([np.column_stack([theta, theta + pairs.span]), np.zeros((count, 2))]),
        np.concatenate([np.zeros((len(pairs), 2)), along]),
    )


def k_best_classes(graph: SampledGraph, k: int, through: Sequence[str] = ()) -> list[Route]:
    """The fastest route of each of the k fastest homotopy classes, fastest first; see `search`.

    Parameters
    ----------
    through : tokens of gates that the class must cross in this order.

    Raises
    ------
    ValueError : k is not positive, or a token names no gate.
    NoPathError : start and goal are not joined.
    NoClassError : no class crosses the demanded gates in this order.
    """
    result = search_sampled(graph, k, through)
    return [graph.route(p.time, p.word, p.edge, p.forward) for p in result.paths]


def search_sampled(graph: SampledGraph, k: int, through: Sequence[str] = ()) -> SearchResult:
    """As `k_best_classes`, but the edges used and the number of labels."""
    numbers = gate_numbers(graph.gates, through)
    result = search_classes(graph.edges, graph.node_count, graph.start, graph.goal, k, numbers)
    demand_paths(graph.problem, result, through)
    return result


def gate_numbers(gates: Gates, through: Sequence[str]) -> list[frozenset[int]]:
    """Gates (1-based) that each token stands for. Raises ValueError for a token that names none."""
    if isinstance(through, str):
        raise ValueError(f"through = {through!r}: must be a sequence of tokens, not one string")
    return [gates.numbers_of(token) for token in through]


def demand_paths(problem: Problem, result: SearchResult, through: Sequence[str]) -> None:
    """Raise NoPathError or NoClassError where a search found nothing."""
    if result.paths:
        return
    (x0, y0), (x1, y1) = problem.start.position, problem.goal.position
    if through:
        raise NoClassError(f"no homotopy class crosses {', '.join(through)} in this order")
    raise NoPathError(
        f"no path: start ({x0:.6g}, {y0:.6g}) and goal ({x1:.6g}, {y1:.6g}) lie in separate parts"
        " of where the robot can move"
    )
