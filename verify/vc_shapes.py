"""Shapes of the free position-velocity space, exact but for their sampling.

Derived: a point with one nearest obstacle point (its foot) lies on the straight way from that foot to a
Voronoi arc, and clearance grows along the way as its length does. So the ways from all points of the
arcs to their feet cover the free space once, and give its roof V(d), its slices and its walls.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from vnav_drake.braking import UniformBraking
from vnav_drake.vc_method import CellDecomposition
from vnav_drake.vc_method.cells import feet_of
from vnav_drake.voronoi import Curves, VoronoiDiagram

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

MOST_PIECES = 16  # that one arc is cut into
SLICE_POINTS = 7  # along each arc of a slice
_BISECTIONS = 50  # halve an interval of parameters to rounding


@dataclass(frozen=True)
class Ways:
    """Ways from points of Voronoi arcs to their two feet, n of them."""

    point: Array  # (n, 2) [m]
    reach: Array  # (n,) [m], distance to the feet
    feet: Array  # (n, 2, 2) [m]

    def at(self, distance: Array) -> Array:
        """Places (n, 2, 2) [m] at distances (n,) [m] from the feet, for both feet."""
        part = np.divide(distance, self.reach, out=np.ones_like(distance), where=self.reach > 0.0)
        return self.feet + part[:, None, None] * (self.point[:, None] - self.feet)


def ways(diagram: VoronoiDiagram, curves: Curves, border: Indices, u: Array) -> Ways:
    """The ways from the places u (n,) [m] of curves (n,) that belong to `border` (n,)."""
    point = curves.points(u)
    feet = feet_of(diagram.world, diagram.feature(diagram.cells[border]), point)
    return Ways(point, curves.distance(u), feet)


def roof(
    decomposition: CellDecomposition,
    slopes: Indices,
    braking: UniformBraking,
    radius: float,
    *,
    spacing: float,
    rows: int,
) -> Array:
    """Patches (n, 4, 3) [m, m, m/s] of the roof along some slopes.

    Parameters
    ----------
    spacing : length of a patch along its arc [m], about.
    rows : of patches between an obstacle and an arc, of equal heights where V is a root.
    """
    d = decomposition.slopes
    pieces = np.clip(np.ceil(d.curves.length[slopes] / spacing), 1, MOST_PIECES).astype(np.int64)
    pieces[d.level[slopes]] = 1
    row = np.repeat(slopes, pieces)
    part = np.arange(len(row)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    share = np.stack([part, part + 1], axis=1) / np.repeat(pieces, pieces)[:, None]
    curves = d.curves.take(row)
    u = curves.span[:, :1] + share * np.diff(curves.span, axis=1)
    edges = []
    for k in (0, 1):
        found = ways(decomposition.diagram, curves, d.border[row], u[:, k])
        room = np.maximum(found.reach - radius - braking.margin, 0.0)
        grid = []
        for j in range(rows + 1):
            clearance = braking.margin + room * (j / rows) ** 2
            speed = np.broadcast_to(braking.speed(clearance)[:, None, None], (len(row), 2, 1))
            grid.append(np.concatenate([found.at(radius + clearance), speed], axis=-1))
        edges.append(np.stack(grid))  # (rows + 1, n, 2 feet, 3)
    one, other = edges
    patches = np.stack([one[:-1], one[1:], other[1:], other[:-1]], axis=-2)
    return np.asarray(patches.reshape(-1, 4, 3))


def ridge(curves: Curves, row: int, braking: UniformBraking, radius: float, points: int) -> Array:
    """One arc on the roof, (points, 3) [m, m, m/s]."""
    one = curves.take([row])
    low, high = one.span[0].tolist()
    u = np.linspace(low, high, points)[None]
    speed = braking.speed(one.distance(u)[0] - radius)
    return np.column_stack([one.points(u)[0], speed])


def wall(point: Array, feet: Array, braking: UniformBraking, radius: float) -> Array:
    """Outline (k, 3) of the vertical partition through a saddle (2,) with its feet (2, 2), all [m]."""
    sides = []
    for foot in feet:
        reach = float(np.hypot(*(point - foot)))
        clearance = braking.margin + max(reach - radius - braking.margin, 0.0) * np.linspace(0, 1, 9) ** 2
        part = (radius + clearance) / reach if reach > 0.0 else np.ones(9)
        sides.append(np.column_stack([foot + part[:, None] * (point - foot), braking.speed(clearance)]))
    return np.concatenate([sides[0], sides[1][-2::-1]])


def bottom(point: Array, feet: Array, level: float) -> Array:
    """Ends (2, 2) [m] of a vertical partition's bottom edge, at distance `level` [m] from its feet."""
    reach = np.hypot(*(point - feet).T)
    part = np.where(reach > 0.0, level / np.where(reach > 0.0, reach, 1.0), 1.0)
    return np.asarray(feet + np.minimum(part, 1.0)[:, None] * (point - feet))


def slice_of(decomposition: CellDecomposition, stack: int, distance: float) -> shapely.Geometry:
    """Floor plan of what of a stack lies at least `distance` [m] from all features."""
    d = decomposition.slopes
    rows = np.flatnonzero(decomposition.slope_stack == stack)
    high = d.curves.distance(d.curves.span)[rows, 1]
    rows = rows[high > distance + d.rounding]
    if len(rows) == 0:
        return shapely.Polygon()
    curves = d.curves.take(rows)
    begin, end = _reaching(curves, distance), curves.span[:, 1]
    u = begin[:, None] + np.linspace(0.0, 1.0, SLICE_POINTS) * (end - begin)[:, None]
    n = len(rows)
    flat = np.repeat(np.arange(n), SLICE_POINTS)
    found = ways(decomposition.diagram, curves.take(flat), d.border[rows][flat], u.reshape(-1))
    edge = found.at(np.minimum(np.full(n * SLICE_POINTS, distance), found.reach))
    edge = edge.reshape(n, SLICE_POINTS, 2, 2)
    middle = found.point.reshape(n, SLICE_POINTS, 2)
    rings = np.concatenate([edge[:, :, 0], middle[:, -1:], edge[:, ::-1, 1], middle[:, :1]], axis=1)
    shapes = shapely.make_valid(shapely.polygons(rings))
    grid = 1e-7 * decomposition.diagram.world.diameter
    return shapely.union_all(shapes[shapely.area(shapes) > 0.0], grid_size=grid)


def _reaching(curves: Curves, distance: float) -> Array:
    """(n,) parameter from which on rising curves are at least `distance` [m] away."""
    below, above = curves.span.T
    inside = curves.distance(below) >= distance
    for _round in range(_BISECTIONS):
        middle = 0.5 * (below + above)
        far = curves.distance(middle) >= distance
        below, above = np.where(far, below, middle), np.where(far, middle, above)
    return np.where(inside, curves.span[:, 0], above)
