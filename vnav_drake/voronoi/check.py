"""Does a Voronoi diagram hold? Tested against the world's distances and its topology."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from vnav_drake.world import World

if TYPE_CHECKING:
    from vnav_drake.voronoi.diagram import VoronoiDiagram

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

EQUIDISTANCE = 2e-8  # of the world's diameter: 40 units of the integer grid; 1e-6 m in a hall of 50 m
SAMPLES = 5  # inner points of each border


class DiagramError(Exception):
    """A Voronoi diagram contradicts the world; the message says where."""


def verify_diagram(diagram: VoronoiDiagram) -> None:
    """Check nodes, borders, cells and topology; returns nothing when all is well.

    * Every node and inner points of every border are as far from the world as the diagram says, and
      from each of their own two features.
    * Borders meet their nodes.
    * In a complete diagram the cells of neighbouring borders agree around each node, and the arcs have
      the connected components and Euler characteristics of the open free space (a bounded open set is
      homotopy equivalent to its medial axis: Lieutier 2004).

    Raises
    ------
    DiagramError : the first of these that fails, with the place.
    """
    tolerance = EQUIDISTANCE * diagram.world.diameter
    _check_nodes(diagram, tolerance)
    _check_borders(diagram, tolerance)
    if diagram.complete is None:
        _check_cells_around_nodes(diagram)
        _check_topology(diagram)


def _check_nodes(diagram: VoronoiDiagram, tolerance: float) -> None:
    at_feature = diagram.node_distance == 0.0
    measured = np.where(
        at_feature, diagram.world.nearest(diagram.nodes)[0], diagram.world.distance(diagram.nodes)
    )
    _demand(np.abs(measured - diagram.node_distance), tolerance, diagram.nodes, "a node is not equidistant")
    gap = diagram.curves.ends - diagram.nodes[diagram.ends]
    _demand(
        np.hypot(gap[..., 0], gap[..., 1]).reshape(-1),
        tolerance,
        diagram.nodes[diagram.ends].reshape(-1, 2),
        "a border does not meet its node",
    )


def _check_borders(diagram: VoronoiDiagram, tolerance: float) -> None:
    curves = diagram.curves
    part = (np.arange(SAMPLES) + 1.0) / (SAMPLES + 1.0)
    u = curves.span[:, :1] + np.diff(curves.span, axis=1) * part
    points, claimed = curves.points(u), curves.distance(u)
    measured = diagram.world.distance(points)
    # Right at a wall the sign of a distance is rounding.
    measured = np.where(np.abs(measured) < tolerance, np.abs(measured), measured)
    flat = points.reshape(-1, 2)
    _demand(np.abs(measured - claimed).reshape(-1), tolerance, flat, "a border is not where it should be")
    for side in (0, 1):
        own = _feature_distance(diagram.world, diagram.feature(diagram.cells[:, side]), points)
        _demand(np.abs(own - claimed).reshape(-1), tolerance, flat, "a border is not equidistant")


def _feature_distance(world: World, feature: Indices, points: Array) -> Array:
    """Distances (m, k) of points (m, k, 2) to one feature a row."""
    edges = len(world.edges)
    is_edge = feature < edges
    edge = world.edges[np.where(is_edge, feature, 0)]
    vertex = np.where(is_edge, 0, feature - edges)
    a = world.vertices[np.where(is_edge, edge[:, 0], vertex)][:, None]
    b = world.vertices[np.where(is_edge, edge[:, 1], vertex)][:, None]
    along = b - a
    square = np.einsum("mkj,mkj->mk", along, along)
    part = np.einsum("mkj,mkj->mk", points - a, along) / np.where(square > 0.0, square, 1.0)
    offset = points - a - np.clip(part, 0.0, 1.0)[..., None] * along
    return np.hypot(offset[..., 0], offset[..., 1])


def _check_cells_around_nodes(diagram: VoronoiDiagram) -> None:
    """Between neighbouring borders of a node lies one cell, except where a feature lies between them."""
    border, end, start = diagram._incidence
    node = np.repeat(np.arange(len(diagram.nodes)), np.diff(start))
    inner = (diagram.node_distance > 0.0) & (np.diff(start) > 1)
    following = np.arange(len(border)) + 1
    last = following == start[node + 1]
    following = np.where(last, start[node], following)
    # outgoing at end 0: the cell to the left is cells[:, 0]; at end 1 the border comes in, sides swap
    left = diagram.cells[border, end]
    right = diagram.cells[border, 1 - end]
    wrong = inner[node] & (left != right[np.minimum(following, len(border) - 1)])
    _demand(wrong.astype(float), 0.5, diagram.nodes[node], "the cells around a node do not match")


def _check_topology(diagram: VoronoiDiagram) -> None:
    faces, characteristic = free_faces(diagram.world)
    arcs = diagram.ends[diagram.primary]
    used, index = np.unique(arcs, return_inverse=True)
    pairs = index.reshape(-1, 2)
    link = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(used), len(used)))
    count, label = connected_components(link, directed=False)
    if count != len(faces):
        raise DiagramError(f"the arcs have {count} components, free space has {len(faces)}")
    found = np.bincount(label, minlength=count) - np.bincount(label[pairs[:, 0]], minlength=count)
    deepest = np.lexsort([-diagram.node_distance[used], label])
    first = deepest[np.searchsorted(label[deepest], np.arange(count))]
    place = diagram.nodes[used[first]]
    component, face = shapely.STRtree(faces).query(shapely.points(place), predicate="within")
    if not np.array_equal(np.sort(component), np.arange(count)) or len(np.unique(face)) != count:
        raise DiagramError("the arcs do not lie one component in each part of free space")
    expected = np.empty(count, dtype=np.int64)
    expected[component] = characteristic[face]
    wrong = np.flatnonzero(expected != found)
    if len(wrong):
        x, y = place[wrong[0]]
        raise DiagramError(
            f"the arcs around ({x:.6g}, {y:.6g}) have Euler characteristic {found[wrong[0]]},"
            f" free space there has {expected[wrong[0]]}"
        )


def free_faces(world: World) -> tuple[NDArray[np.object_], Indices]:
    """Connected parts of open free space (as polygons, islands cut out) and their Euler characteristics.

    A part has 1 minus the number of its islands: connected groups of walls, obstacles and points.
    """
    lines = shapely.linestrings(world.vertices[world.edges])
    faces = shapely.get_parts(shapely.polygonize(lines))
    inside = shapely.point_on_surface(faces)
    faces = faces[world.is_floor(shapely.get_coordinates(inside))]
    count = len(world.vertices)
    link = coo_array(
        (np.ones(len(world.edges)), (world.edges[:, 0], world.edges[:, 1])), shape=(count, count)
    )
    groups, label = connected_components(link, directed=False)
    # The place just to the right of a group's rightmost vertex lies in the face around the group.
    order = np.lexsort([-world.vertices[:, 1], -world.vertices[:, 0], label])
    first = order[np.searchsorted(label[order], np.arange(groups))]
    beside = world.vertices[first] + np.array([1e-9 * world.diameter, 0.0])
    _, face = shapely.STRtree(faces).query(shapely.points(beside), predicate="within")
    return faces, 1 - np.bincount(face, minlength=len(faces))


def _demand(value: Array, limit: float, places: Array, what: str) -> None:
    worst = int(np.argmax(value)) if len(value) else 0
    if len(value) and not value[worst] <= limit:
        x, y = places[worst]
        raise DiagramError(f"{what} at ({x:.9g}, {y:.9g}): {value[worst]:.3g} > {limit:.3g}")
