"""Position-velocity space as numbers for the page's viewer, which turns it.

Places are whole numbers from 0 to UNIT along the world's longer side, speeds from 0 to UNIT at the highest
point of the roof. There is no text from files in them.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from typing import Any

import matplotlib
import numpy as np
import shapely
from markupsafe import Markup
from matplotlib.colors import to_hex
from numpy.typing import NDArray

from verify.report.drawings import VcDrawing
from verify.report.figures_space import (
    CELL_ALPHA,
    HEIGHT,
    ROOF_ALPHA,
    SHADES,
    profile_on_map,
    shades_of,
    speed_axis,
    standing_view,
    top_speed,
)
from verify.report.palette import SPEED_MAP, method
from vnav_drake.problem import Problem

Array = NDArray[np.float64]

UNIT = 10_000
ENDS = ("start", "goal")
SPEED = "m/s"


def space_data(problem: Problem, drawing: VcDrawing) -> Markup:
    """What the viewer draws, as the text of a JSON data block."""
    space, world = drawing.space, problem.world
    x0, y0, x1, y1 = world.bounds
    side, top = max(x1 - x0, y1 - y0), top_speed(drawing)
    scale = np.array([UNIT / side, UNIT / side, UNIT / top])
    origin = np.array([x0, y0, 0.0])

    def numbers(points: Array) -> list[int]:
        return [int(k) for k in np.round((points - origin) * scale).ravel()]

    def ground(lines: Iterable[Array], speed: float = 0.0) -> list[list[int]]:
        return [numbers(np.column_stack([line, np.full(len(line), speed)])) for line in lines]

    def shapes(lines: Iterable[Array]) -> list[list[int]]:
        return [numbers(line) for line in lines]

    view, look = standing_view(problem, drawing), method("vc_method")
    place = profile_on_map(drawing)
    ends = np.stack([place[[0, -1]] * [1.0, 1.0, 0.0], place[[0, -1]]], axis=1)
    graph = space.graph
    ticks = speed_axis(problem, drawing, view)
    data: dict[str, Any] = {
        "unit": UNIT,
        "size": [(x1 - x0) / side * UNIT, (y1 - y0) / side * UNIT],
        "rise": HEIGHT,
        "azimuth": view.azimuth,
        "elevation": view.elevation,
        "faces": [
            _faces("plan", "--floor", 1.0, ground(_rings([world.boundary]))),
            _faces("plan", "--rack", 1.0, ground(_rings(world.blocked))),
            *_roof(drawing, shapes),
            _faces("cells", "--limit", CELL_ALPHA, shapes(space.vertical)),
            _faces(
                "cells", "--muted", CELL_ALPHA,
                [ring for speed, plan in space.horizontal for ring in ground(_rings([plan]), speed)],
            ),
        ],
        "lines": [
            _lines("plan", "--ink", 1.2, ground(_rings([world.boundary])), closed=True),
            _lines("plan", "--ink", 1.0, shapes([np.concatenate([tick for _, tick in ticks])])),
            _lines("plan", "--ink", 1.6, ground(np.asarray(world.walls, dtype=float).reshape(-1, 2, 2))),
            _lines("roof", "--arc", 0.9, shapes(space.ridges)),
            *(
                _lines("graph", look.variable + "-text" if on else "--ink", 2.8 if on else 1.0,
                       shapes(_picked(lines, flags, on)), dash=dash)
                for lines, flags, dash in (
                    (graph.type_a, graph.type_a_on_route, []),
                    (list(graph.type_b), graph.type_b_on_route, [2, 2]),
                )
                for on in (False, True)
            ),
            _lines("route", "--casing", 4.6, shapes([place])),
            _lines("route", look.variable, 3.0, shapes([place])),
            _lines("route", "--ink", 1.2, shapes(ends)),
        ],
        "points": [
            _points("plan", "dot", "--ink", 2.5, ground([world.vertices[world.isolated]])),
            _points("graph", "dot", "--ink", 2.2, shapes([graph.nodes[~graph.on_route]])),
            _points("graph", "dot", look.variable + "-text", 3.6, shapes([graph.nodes[graph.on_route]])),
            _points("cells", "cross", "--limit", 5.5, shapes([space.saddles])),
            _points("cells", "triangle", "--paper", 5.5, shapes([space.maxima])),
            _points("route", "ring", "--paper", 4.0, shapes([ends[:, 0]])),
        ],
        "labels": [
            *(_label(text, numbers(end[:1]), 0, 14) for text, end in zip(ENDS, ends, strict=True)),
            *(_label(text.removesuffix(f" {SPEED}"), numbers(tick), -10, 0) for text, tick in ticks),
            _label(SPEED, numbers(ticks[-1][1]), 0, -14),
        ],
    }  # fmt: skip
    return Markup(json.dumps(data, separators=(",", ":")))


def _rings(shapes: Sequence[shapely.Geometry]) -> list[Array]:
    """Outlines (n, 2) of all polygons, without their holes."""
    parts = [part for shape in shapes for part in shapely.get_parts(shape)]
    return [
        np.asarray(part.exterior.coords)[:, :2]
        for part in parts
        if isinstance(part, shapely.Polygon) and not part.is_empty
    ]


def _picked(lines: Sequence[Array], flags: Sequence[bool], on: bool) -> list[Array]:
    return [line for line, flag in zip(lines, flags, strict=True) if flag == on]


def _roof(drawing: VcDrawing, shapes: Any) -> list[dict[str, Any]]:
    """The roof's patches, those of one shade together."""
    shade = matplotlib.colormaps[SPEED_MAP].resampled(SHADES)
    level = shades_of(drawing)
    return [
        _faces("roof", to_hex(shade(int(k))), ROOF_ALPHA, shapes(drawing.space.roof[level == k]))
        for k in np.unique(level)
    ]


def _faces(layer: str, colour: str, alpha: float, shapes: list[list[int]]) -> dict[str, Any]:
    return {"layer": layer, "colour": colour, "alpha": alpha, "shapes": shapes}


def _lines(
    layer: str,
    colour: str,
    width: float,
    shapes: list[list[int]],
    *,
    dash: Sequence[int] = (),
    closed: bool = False,
) -> dict[str, Any]:
    ways = [shape + shape[:3] for shape in shapes] if closed else shapes
    return {"layer": layer, "colour": colour, "width": width, "dash": list(dash), "shapes": ways}


def _label(text: str, at: list[int], across: int, down: int) -> dict[str, Any]:
    return {"text": text, "at": at, "across": across, "down": down}


def _points(layer: str, mark: str, fill: str, size: float, shapes: list[list[int]]) -> dict[str, Any]:
    return {"layer": layer, "mark": mark, "fill": fill, "size": size, "points": shapes[0]}
