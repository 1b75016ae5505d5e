"""Graph nodes as members of strips, and the pairs of them that a leg may join."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vnav_drake.braking import UniformBraking
from vnav_drake.speed_graph.cells import TURN, Strips
from vnav_drake.speed_graph.sampling import Samples
from vnav_drake.voronoi import PARABOLA

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]

STILL = 1e-9  # [m] of room at V = 0: nothing goes there and away again but along the border itself


@dataclass(frozen=True)
class Members:
    """Every (strip, node) once, in order of strip and theta.

    `after` is the row of the ridge that begins at or goes on from the member as theta grows, `before`
    the one it comes from. A border of constant theta counts as the row beyond that end of the ridge.
    """

    strip: Indices  # (m,)
    node: Indices  # (m,)
    theta: Array  # (m,)
    after: Indices  # (m,)
    before: Indices  # (m,)
    outward_after: Array  # (m,) outward component of the ridge's direction as theta grows; inf: no ridge here
    outward_before: Array  # (m,) the same as theta falls
    free: Mask  # (m,) on no border

    def __len__(self) -> int:
        return len(self.strip)

    def take(self, index: Indices | Mask) -> Members:
        """The members of an index or mask array."""
        return Members(*(getattr(self, name)[index] for name in self.__dataclass_fields__))


def strip_members(strips: Strips, samples: Samples, braking: UniformBraking) -> Members:
    """All nodes in all strips whose borders they lie on, without those where V = 0 that are not ends."""
    side = np.concatenate([2 * samples.station_curve, 2 * samples.station_curve + 1])
    node, u = np.tile(samples.station_node, 2), np.tile(samples.station_parameter, 2)
    begins = np.append(True, np.diff(samples.station_curve) != 0)
    ends = np.append(begins[1:], True)
    at_low_u, at_high_u = np.tile(begins, 2), np.tile(ends, 2)
    moves = (samples.clearance[node] - braking.margin > STILL) | np.isin(node, (samples.start, samples.goal))
    known = (strips.side_strip[side] >= 0) & moves
    side, node, u = side[known], node[known], u[known]
    at_low_u, at_high_u = at_low_u[known], at_high_u[known]

    strip, order = strips.side_strip[side], strips.side_order[side]
    ridge = order == 1
    grows = strips.rate[side] > 0.0
    at_low, at_high = np.where(grows, at_low_u, at_high_u), np.where(grows, at_high_u, at_low_u)
    theta = strips.theta(side, u)
    theta = np.where(order == 0, strips.low[strip], np.where(order == 2, strips.high[strip], theta))
    theta = strips.wrapped(strip, np.clip(theta, strips.low[strip], strips.high[strip]))
    climb = np.where(ridge, strips.outward(side, u), 0.0)
    beyond = np.where(order == 0, strips.first[strip] - 1, strips.first[strip + 1])
    row = np.where(ridge, strips.side_row[side], beyond)
    # which end of a border of constant theta meets the ridge: the one of greater distance
    curve = side // 2
    slope = strips.diagram.curves.slope[curve]
    top = ~ridge & np.where(slope > 0.0, at_high_u, at_low_u)
    has_after = np.where(ridge, ~at_high, (order == 0) & ~top)
    has_before = np.where(ridge, ~at_low, (order == 2) & ~top)
    has_before |= (order == 0) & ~ridge
    has_after |= (order == 2) & ~ridge

    key = strip * len(samples.point) + node
    _, pick, inverse = np.unique(key, return_index=True, return_inverse=True)
    count = len(pick)
    after, before = np.full(count, -2), np.full(count, -2)
    outward_after, outward_before = np.full(count, np.inf), np.full(count, np.inf)
    after[inverse[has_after]] = row[has_after]
    before[inverse[has_before]] = row[has_before]
    on_after, on_before = has_after & ridge, has_before & ridge
    outward_after[inverse[on_after]] = climb[on_after]
    outward_before[inverse[on_before]] = -climb[on_before]

    over = strips.row_at(samples.free_strip, samples.free_theta)
    none = np.full(len(over), np.inf)
    strip = np.concatenate([strip[pick], samples.free_strip])
    theta = np.concatenate([theta[pick], samples.free_theta])
    # along a border of constant theta: outside first, so that legs never run backwards
    rank = np.concatenate([np.where(ridge, 1, order)[pick], np.ones(len(over), dtype=np.int64)])
    members = Members(
        strip,
        np.concatenate([node[pick], samples.free_node]),
        theta,
        np.concatenate([after, over - 1]),
        np.concatenate([before, over + 1]),
        np.concatenate([outward_after, none]),
        np.concatenate([outward_before, none]),
        np.concatenate([np.zeros(count, dtype=bool), np.ones(len(over), dtype=bool)]),
    )
    # the top of such a border belongs to the ridge
    rank[:count] = np.where(np.isfinite(outward_after) | np.isfinite(outward_before), 1, rank[:count])
    return members.take(np.lexsort([rank, theta, strip]))


@dataclass(frozen=True)
class Pairs:
    """Pairs of members of one strip, theta growing from the first to the second."""

    first: Indices  # (p,) rows of the members
    second: Indices  # (p,)
    span: Array  # (p,) growth of theta
    wraps: Mask  # (p,) past the end of a periodic strip
    between: Indices  # (p,) arcs of the ridge that lie wholly between both

    def __len__(self) -> int:
        return len(self.first)

    def take(self, index: Indices | Mask) -> Pairs:
        """The pairs of an index or mask array."""
        return Pairs(*(getattr(self, name)[index] for name in self.__dataclass_fields__))


def candidate_pairs(strips: Strips, members: Members, fast: Mask) -> Pairs:
    """All pairs of each strip but those on one border.

    Two points of one Voronoi arc are joined fastest by the arc itself, of one border of constant theta by
    that border; no other leg between them stays in its cell. The exception are two places `fast` (m,), at
    the law's greatest speed, on the arc that bends around a point: there the chord is faster.
    """
    begin = np.searchsorted(members.strip, np.arange(len(strips)))
    size = np.append(begin[1:], len(members)) - begin
    index = np.arange(len(members))
    rank = index - begin[members.strip]
    around = strips.periodic[members.strip]
    partners = np.where(around, size[members.strip] - 1, size[members.strip] - 1 - rank)
    first = np.repeat(index, partners)
    step = np.arange(len(first)) - np.repeat(np.cumsum(partners) - partners, partners) + 1
    strip = members.strip[first]
    second = begin[strip] + (rank[first] + step) % np.maximum(size[strip], 1)
    wraps = second < first
    span = members.theta[second] - members.theta[first] + np.where(wraps, TURN, 0.0)

    free = members.free[first] | members.free[second]
    same = (members.after[first] == members.before[second]) & ~free
    row = np.clip(members.after[first], 0, len(strips.ridge) - 1)
    rows = strips.first[strip + 1] - strips.first[strip]
    following = np.minimum(row + 1, len(strips.ridge) - 1)
    end = np.where(row + 1 < strips.first[strip + 1], strips.row_start[following], strips.high[strip])
    slack = 1e-9 * np.maximum(1.0, strips.high[strip] - strips.low[strip])
    same &= ~strips.periodic[strip] | (members.theta[first] + span <= end + slack)
    bow = (strips.diagram.curves.kind[strips.ridge[row] // 2] == PARABOLA) & strips.at_point[strip]
    on_ridge = (members.after[first] >= strips.first[strip]) & (
        members.after[first] < strips.first[strip + 1]
    )
    chord = same & on_ridge & bow & fast[first] & fast[second]
    between = members.before[second] - members.after[first] - 1
    cyclic = np.mod(members.before[second] - members.after[first], np.maximum(rows, 1))
    between = np.where(strips.periodic[strip], np.where(cyclic == 0, rows, cyclic) - 1, between)
    # around a point an end in a cell may see the arc above it both ways
    between = np.where(chord | (free & strips.periodic[strip]), np.maximum(between, 1), between)
    # a full turn around a point leads through the point
    keep = (~same | chord) & (span >= 0.0) & (~strips.periodic[strip] | (span < TURN - 1e-9))
    return Pairs(first[keep], second[keep], span[keep], wraps[keep], np.maximum(between[keep], 0))
