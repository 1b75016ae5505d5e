"""Exact Voronoi nodes: merged topology, and positions equidistant from the unrounded features."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from vnav_drake.voronoi.boost import Topology
from vnav_drake.world import World

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

MERGE = 4.0  # grid units: nodes this near, joined by an edge, are one (a symmetric world split by rounding)
SNAP = 16.0  # grid units: a node this near to a vertex of the world is that vertex
STRAIGHT = 1e-9  # sine of the turn below which two edges at a vertex are one straight wall
_ROUNDS = 8  # of Newton's method; it starts within about the grid, so it converges in three


@dataclass(frozen=True)
class Borders:
    """Borders between proximity cells as a graph with exact nodes."""

    nodes: Array  # (k, 2) [m]
    rough: Array  # (k, 2) [m], as Boost placed them
    distance: Array  # (k,) [m], to the nearest feature
    ends: Indices  # (m, 2)
    sites: Indices  # (m, 2), left and right
    secondary: NDArray[np.bool_]  # (m,) between a vertex and its own edge, or within a straight wall


def exact_borders(world: World, topology: Topology, slack: int = 0) -> Borders:
    """Merge nodes that coincide and recompute all of them.

    `slack` widens the merging by as many grid units (for a perturbed topology).
    """
    merge, snap = (MERGE + 4 * slack) * topology.unit, (SNAP + 4 * slack) * topology.unit
    nodes, ends, sites = topology.vertices, topology.ends, topology.sites
    rough, distance = nodes, np.zeros(len(nodes))
    for _round in range(4):
        nodes, distance = _equidistant(world, nodes, ends, sites, snap)
        length = np.hypot(*(nodes[ends[:, 0]] - nodes[ends[:, 1]]).T)
        short = length <= merge
        if not short.any():
            break
        nodes, rough, ends, sites = _merged(world, nodes, rough, ends, sites, short, snap)
    ends, sites = _without_empty_cells(ends, sites, is_secondary(world, sites))
    return _split_at_wall_ends(
        world, Borders(nodes, rough, distance, ends, sites, is_secondary(world, sites)), merge
    )


def is_secondary(world: World, sites: Indices) -> NDArray[np.bool_]:
    """(m,) whether the two sites are a vertex and its own edge, or edges of one straight wall."""
    edge_count = len(world.edges)
    one, other = np.sort(sites, axis=1).T
    mixed = (one < edge_count) & (other >= edge_count)
    edge = world.edges[np.where(mixed, one, 0)]
    own = mixed & ((edge[:, 0] == other - edge_count) | (edge[:, 1] == other - edge_count))
    walls = other < edge_count
    return own | (walls & _continues(world, np.where(walls, one, 0), np.where(walls, other, 0)))


def _continues(world: World, one: Indices, other: Indices) -> NDArray[np.bool_]:
    """Whether two edges share a vertex and go straight on there."""
    straight = np.zeros(len(one), dtype=bool)
    for i in (0, 1):
        for j in (0, 1):
            shared = (world.edges[one, i] == world.edges[other, j]) & (one != other)
            middle = world.vertices[world.edges[one, i]]
            a = world.vertices[world.edges[one, 1 - i]] - middle
            b = world.vertices[world.edges[other, 1 - j]] - middle
            sine = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
            size = np.hypot(*a.T) * np.hypot(*b.T)
            straight |= shared & (sine <= STRAIGHT * size) & (np.einsum("ij,ij->i", a, b) < 0.0)
    return straight


def _equidistant(
    world: World, nodes: Array, ends: Indices, sites: Indices, snap: float
) -> tuple[Array, Array]:
    """Newton's method (Gauss-Newton where more than three sites meet) for all nodes together.

    Unknowns x, y, r; equations: the distance to each site is r, and on a border between a vertex and
    its own wall the foot on the wall is that vertex (there both distances have the same gradient).
    """
    edge_count = len(world.edges)
    count = len(nodes)
    gap, nearest = cKDTree(world.vertices).query(nodes)
    at_vertex = gap <= snap
    pair = np.unique(
        np.column_stack([np.repeat(ends.reshape(-1), 2), np.repeat(sites, 2, axis=0).reshape(-1)]), axis=0
    )
    node, site = pair[~at_vertex[pair[:, 0]]].T
    is_edge = site < edge_count
    edge = world.edges[np.where(is_edge, site, 0)]
    anchor = np.where(
        is_edge[:, None], world.vertices[edge[:, 0]], world.vertices[np.where(is_edge, 0, site - edge_count)]
    )
    along = world.vertices[edge[:, 1]] - world.vertices[edge[:, 0]]
    normal = np.column_stack([-along[:, 1], along[:, 0]]) / np.hypot(*along.T)[:, None]

    feet = _own_pairs(world, ends, sites)
    foot_node, foot_vertex, foot_edge = feet[~at_vertex[feet[:, 0]]].T
    direction = world.vertices[world.edges[foot_edge, 1]] - world.vertices[world.edges[foot_edge, 0]]
    direction = direction / np.hypot(*direction.T)[:, None]

    x = np.where(at_vertex[:, None], world.vertices[nearest], nodes)
    r = np.zeros(count)
    offset = x[node] - anchor
    start = np.where(is_edge, np.abs(np.einsum("ij,ij->i", offset, normal)), np.hypot(*offset.T))
    many = np.maximum(np.bincount(node, minlength=count), 1)
    r = np.bincount(node, weights=start, minlength=count) / many
    for _round in range(_ROUNDS):
        offset = x[node] - anchor
        signed = np.einsum("ij,ij->i", offset, normal)
        reach = np.where(is_edge, np.abs(signed), np.hypot(*offset.T))
        toward = np.where(
            is_edge[:, None],
            np.where(signed < 0.0, -1.0, 1.0)[:, None] * normal,
            offset / np.maximum(reach, 1e-300)[:, None],
        )
        rows = np.concatenate(
            [
                np.column_stack([toward, -np.ones(len(node))]),
                np.column_stack([direction, np.zeros(len(foot_node))]),
            ]
        )
        slip = np.einsum("ij,ij->i", x[foot_node] - world.vertices[foot_vertex], direction)
        miss = np.concatenate([reach - r[node], slip])
        owner = np.concatenate([node, foot_node])
        step = _solve(rows, miss, owner, count)
        x = x - step[:, :2]
        r = r - step[:, 2]
    r[at_vertex] = 0.0
    return x, r


def _solve(rows: Array, miss: Array, owner: Indices, count: int) -> Array:
    """Least-squares steps (count, 3) of all nodes from their normal equations."""
    outer = rows[:, :, None] * rows[:, None, :]
    matrix = np.zeros((count, 3, 3))
    for i in range(3):
        for j in range(3):
            matrix[:, i, j] = np.bincount(owner, weights=outer[:, i, j], minlength=count)
    right = np.column_stack(
        [np.bincount(owner, weights=rows[:, i] * miss, minlength=count) for i in range(3)]
    )
    matrix += 1e-14 * np.eye(3)
    return np.asarray(np.linalg.solve(matrix, right[:, :, None])[:, :, 0], dtype=np.float64)


def _own_pairs(world: World, ends: Indices, sites: Indices) -> Indices:
    """(n, 3) rows (node, vertex of the world, edge) of secondary borders."""
    edge_count = len(world.edges)
    own = is_secondary(world, sites)
    one, other = np.sort(sites[own], axis=1).T
    wall, next_wall = world.edges[one], world.edges[np.minimum(other, edge_count - 1)]
    shared = np.where((wall[:, :1] == next_wall).any(axis=1), wall[:, 0], wall[:, 1])
    row = np.column_stack([np.where(other >= edge_count, other - edge_count, shared), one])
    return np.concatenate([np.column_stack([ends[own, k], row]) for k in (0, 1)])


def _merged(
    world: World,
    nodes: Array,
    rough: Array,
    ends: Indices,
    sites: Indices,
    short: NDArray[np.bool_],
    snap: float,
) -> tuple[Array, Array, Indices, Indices]:
    """Nodes joined by short borders become one: positions (twice), ends and sites of what remains."""
    count = len(nodes)
    link = coo_array((np.ones(int(short.sum())), (ends[short, 0], ends[short, 1])), shape=(count, count))
    groups, label = connected_components(link, directed=False)
    size = np.bincount(label, minlength=groups)
    middle, rough = (
        np.column_stack([np.bincount(label, weights=x[:, k], minlength=groups) / size for k in (0, 1)])
        for x in (nodes, rough)
    )
    gap, nearest = cKDTree(world.vertices).query(middle)
    middle = np.where((gap <= snap)[:, None], world.vertices[nearest], middle)
    ends = label[ends]
    keep = ends[:, 0] != ends[:, 1]
    return middle, rough, ends[keep], sites[keep]


def _without_empty_cells(
    ends: Indices, sites: Indices, secondary: NDArray[np.bool_]
) -> tuple[Indices, Indices]:
    """Two secondary borders between the same nodes enclose an empty cell: they become one.

    This is the cell of a vertex within a straight wall, where another wall meets it.
    """
    order = np.sort(ends, axis=1)
    flip = order[:, 0] != ends[:, 0]
    facing = np.where(flip[:, None], sites[:, ::-1], sites)
    groups: dict[tuple[int, int], list[int]] = {}
    _, inverse, counts = np.unique(order[secondary], axis=0, return_inverse=True, return_counts=True)
    for row in np.flatnonzero(secondary)[counts[inverse] > 1].tolist():
        groups.setdefault((int(order[row, 0]), int(order[row, 1])), []).append(row)
    keep = np.ones(len(ends), dtype=bool)
    order, facing = order.copy(), facing.copy()
    for rows in groups.values():
        for i in rows:
            for j in rows:
                if i != j and keep[i] and keep[j] and facing[i, 1] == facing[j, 0]:
                    facing[i, 1] = facing[j, 1]
                    keep[j] = False
    keep &= facing[:, 0] != facing[:, 1]
    return order[keep], facing[keep]


def _split_at_wall_ends(world: World, borders: Borders, merge: float) -> Borders:
    """Cut borders that run through the vertex they belong to, from one side of a free wall to the other."""
    nodes, ends, sites, secondary = borders.nodes, borders.ends, borders.sites, borders.secondary
    vertex = sites.max(axis=1) - len(world.edges)
    point = world.vertices[np.maximum(vertex, 0)]
    a, b = nodes[ends[:, 0]] - point, nodes[ends[:, 1]] - point
    through = secondary & (vertex >= 0) & (np.einsum("ij,ij->i", a, b) < 0.0)
    through &= (np.hypot(*a.T) > merge) & (np.hypot(*b.T) > merge)
    rows = np.flatnonzero(through)
    middle = len(nodes) + np.arange(len(rows))
    second = np.column_stack([middle, ends[rows, 1]])
    ends = ends.copy()
    ends[rows, 1] = middle
    return Borders(
        np.concatenate([nodes, point[rows]]),
        np.concatenate([borders.rough, point[rows]]),
        np.concatenate([borders.distance, np.zeros(len(rows))]),
        np.concatenate([ends, second]),
        np.concatenate([sites, sites[rows]]),
        np.concatenate([secondary, secondary[rows]]),
    )
