"""Voronoi arcs, nodes and proximity cells of a world, with exact distances and travel times."""

from vnav_drake.voronoi.cells import cell_of, foot_coordinate
from vnav_drake.voronoi.check import DiagramError, verify_diagram
from vnav_drake.voronoi.curves import LINEAR, PARABOLA, ROOT, Curves
from vnav_drake.voronoi.diagram import VoronoiDiagram, build_diagram
from vnav_drake.voronoi.network import shortest_route
from vnav_drake.voronoi.times import travel_time

__all__ = [
    "LINEAR",
    "PARABOLA",
    "ROOT",
    "Curves",
    "DiagramError",
    "VoronoiDiagram",
    "build_diagram",
    "cell_of",
    "foot_coordinate",
    "shortest_route",
    "travel_time",
    "verify_diagram",
]
