"""Topology of the Voronoi diagram of points and segments, from Boost.Polygon (pyvoronoi).

Boost computes on integers; its vertices are good to about the grid and serve only to start the
exact computation from the unrounded features.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyvoronoi
from numpy.typing import NDArray

from vnav_drake.problem import PlanningError
from vnav_drake.world import World

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

HALF_GRID = 2.0**30  # the world spans +- this many units: room for perturbations within 32 bits
_SEGMENT_START = 1  # Boost's source category of a cell; 2 is a segment's end, 0 a single point


@dataclass(frozen=True)
class Topology:
    """Finite edges of the diagram; a site is an edge of the world or `len(world.edges)` + a vertex."""

    vertices: Array  # (k, 2) [m], approximate
    ends: Indices  # (m, 2), rows of `vertices`
    sites: Indices  # (m, 2), left and right of each edge from its first end to its second
    unit: float  # [m], of the integer grid


def boost_topology(world: World, perturbation: int = 0, seed: int = 0) -> Topology:
    """Voronoi edges of all features of the world, obstacles' insides included.

    Parameters
    ----------
    perturbation : greatest random shift of each vertex, in units of the integer grid.

    Raises
    ------
    PlanningError : two vertices fall on the same grid point.
    """
    x0, y0, x1, y1 = world.bounds
    centre = np.array([0.5 * (x0 + x1), 0.5 * (y0 + y1)])
    unit = max(x1 - x0, y1 - y0) / 2.0 / HALF_GRID
    grid = np.rint((world.vertices - centre) / unit).astype(np.int64)
    if perturbation:
        rng = np.random.default_rng(seed)
        grid += rng.integers(-perturbation, perturbation + 1, grid.shape)
    if len(np.unique(grid, axis=0)) < len(grid):
        raise PlanningError(
            f"Voronoi diagram: two vertices of the world are within {2 * unit:.1e} m of each other"
        )
    builder = pyvoronoi.Pyvoronoi(1)
    for point in grid[world.isolated].tolist():
        builder.AddPoint(point)
    for segment in grid[world.edges].tolist():
        builder.AddSegment(segment)
    builder.Construct()
    vertices = np.array([(v.X, v.Y) for v in builder.GetVertices()], dtype=float).reshape(-1, 2)
    site_of_cell = _sites(world, builder)
    table = np.array([(e.start, e.end, e.cell, e.twin) for e in builder.GetEdges()], dtype=np.int64)
    table = table.reshape(-1, 4)
    once = np.arange(len(table)) < table[:, 3]
    finite = (table[:, 0] >= 0) & (table[:, 1] >= 0)
    left = site_of_cell[table[:, 2]]
    keep = once & finite
    sites = np.column_stack([left[keep], left[table[keep, 3]]])
    return Topology(centre + unit * vertices, table[keep, :2], sites, unit)


def _sites(world: World, builder: pyvoronoi.Pyvoronoi) -> Indices:
    """Site of every Boost cell."""
    cells = np.array(
        [(c.site, c.source_category, c.contains_segment) for c in builder.GetCells()], dtype=np.int64
    ).reshape(-1, 3)
    index, category, is_segment = cells.T
    points = len(world.isolated)
    segment = np.clip(index - points, 0, len(world.edges) - 1)
    end = world.edges[segment, np.where(category == _SEGMENT_START, 0, 1)]
    vertex = np.where(index < points, _get(world.isolated, index), end)
    return np.where(is_segment == 1, segment, len(world.edges) + vertex)


def _get(values: Indices, index: Indices) -> Indices:
    if len(values) == 0:
        return np.zeros_like(index)
    return values[np.clip(index, 0, len(values) - 1)]
