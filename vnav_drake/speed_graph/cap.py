"""Where the greatest speed is reached Voronoi arcs are no longer special: they are cut there.

Beyond the clearance at which V = v_max the metric is flat on both sides of an arc, so that paths cross it
straight and never follow it. Nearer to the obstacles it is a geodesic as ever.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vnav_drake.braking import UniformBraking
from vnav_drake.voronoi import LINEAR, ROOT, Curves, VoronoiDiagram

Indices = NDArray[np.int64]
Array = NDArray[np.float64]

ROUNDING = 1e-12  # relative: cuts nearer than this to an end are the end


@dataclass(frozen=True)
class CutDiagram:
    """A diagram whose Voronoi arcs are cut where they reach the clearance of the greatest speed."""

    diagram: VoronoiDiagram
    rideable: NDArray[np.bool_]  # (m,) Voronoi arcs slower than the greatest speed
    cap: float  # [m] distance to the nearest feature at which the greatest speed is reached
    row: Indices  # (n + 1,) first piece of each border of the diagram that was cut

    def piece(self, border: int, u: float) -> int:
        """The piece of a border at parameter u."""
        low = self.diagram.curves.span[self.row[border] : self.row[border + 1]].min(axis=1)
        return int(self.row[border] + max(np.searchsorted(low, u, side="right") - 1, 0))

    def pieces_between(self, border: int, begin: float, end: float) -> list[tuple[int, float]]:
        """Pieces of a border from parameter `begin` to `end`, each with where it is entered."""
        rows = np.arange(self.row[border], self.row[border + 1])
        low, high = np.sort(self.diagram.curves.span[rows], axis=1).T
        used = (low < max(begin, end)) & (high > min(begin, end))
        if not used.any():
            return [(self.piece(border, begin), begin)]
        if begin <= end:
            return [(int(r), float(max(a, begin))) for r, a in zip(rows[used], low[used], strict=True)]
        return [
            (int(r), float(min(b, begin))) for r, b in zip(rows[used][::-1], high[used][::-1], strict=True)
        ]


def cut_at_cap(diagram: VoronoiDiagram, law: UniformBraking, radius: float) -> CutDiagram:
    """The arcs of a restricted diagram cut where V(d) = v_max; all of them rideable when there is none."""
    count = len(diagram.curves)
    if not np.isfinite(law.max_speed):
        return CutDiagram(diagram, diagram.primary, math.inf, np.arange(count + 1))
    cap = radius + float(law.distance(law.max_speed))
    curves = diagram.curves
    marks = _levels(curves, cap)
    low, high = np.sort(curves.span, axis=1).T
    room = ROUNDING * np.maximum(np.abs(low), np.abs(high)) + ROUNDING
    inside = diagram.primary[:, None] & (marks > (low + room)[:, None]) & (marks < (high - room)[:, None])
    pieces = 1 + inside.sum(axis=1)
    row = np.concatenate([[0], np.cumsum(pieces)])
    owner = np.repeat(np.arange(count), pieces)
    bounds = [
        np.concatenate([[a], np.sort(m[k]), [b]]) for a, b, m, k in zip(low, high, marks, inside, strict=True)
    ]
    span = np.concatenate([np.column_stack([b[:-1], b[1:]]) for b in bounds]) if count else np.zeros((0, 2))
    first, last = row[:-1], row[1:] - 1
    ends = np.empty((len(owner), 2), dtype=np.int64)
    new = np.flatnonzero(np.diff(owner) == 0)  # a cut between pieces `new` and `new + 1`
    ends[new, 1] = ends[new + 1, 0] = len(diagram.nodes) + np.arange(len(new))
    ends[first, 0], ends[last, 1] = diagram.ends.T
    cut = curves.take(owner).cut(span)
    distance = np.concatenate([diagram.node_distance, np.full(len(new), cap)])
    nodes = np.concatenate([diagram.nodes, cut.points(span)[new, 1]])
    rideable = diagram.primary[owner] & (cut.distance(span).max(axis=1) <= cap * (1.0 + 1e-9))
    whole = VoronoiDiagram(
        diagram.world,
        diagram.radius,
        nodes,
        distance,
        cut,
        ends,
        diagram.cells[owner],
        diagram.primary[owner],
        diagram.notes,
        diagram.complete,
    )
    return CutDiagram(whole, rideable, cap, row)


def _levels(curves: Curves, level: float) -> Array:
    """(n, 2) parameters at which the distance is `level`; NaN where it never is."""
    straight = curves.kind == LINEAR
    slope = np.where(straight & (curves.slope != 0.0), curves.slope, np.nan)
    single = (level - curves.size) / slope
    square = np.where(
        curves.kind == ROOT,
        (level - curves.size) * (level + curves.size),
        curves.size * (2.0 * level - curves.size),
    )
    both = np.sqrt(np.where(square > 0.0, square, np.nan))
    return np.where(
        straight[:, None],
        np.column_stack([single, np.full(len(curves), np.nan)]),
        np.column_stack([-both, both]),
    )
