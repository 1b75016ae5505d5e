"""Maps of a thumb's size: a few hundred bytes of SVG each, the floor drawn once for all of a page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from markupsafe import Markup, escape
from numpy.typing import NDArray

from verify.report.palette import FLOOR, INK, PAPER, RACK, RACK_EDGE, Tone
from verify.report.path_data import compact, polyline
from vnav_drake.problem import Problem
from vnav_drake.world import World

Array = NDArray[np.float64]

SIDE = 240.0  # [units] of the longer side: two for each pixel that is shown
FINEST = 1.0  # [units] by which outlines may be simplified
SPECK = 4.0  # [units] least diameter of what is drawn of an obstacle
MARGIN = 6.0  # [units] around the floor
WAY, RIM, MARK = 5.0, 9.0, 7.0  # [units] width of a way, of its rim; radius of the marks at its ends
WHOLE = 0  # decimals of a unit

_TONES: Mapping[str, Tone] = {
    "--floor": FLOOR, "--rack": RACK, "--rack-edge": RACK_EDGE, "--ink": INK, "--paper": PAPER,
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class ThumbnailPath:
    """One way on a thumbnail."""

    points: Array  # (n, 2) [m], n >= 2
    tone: Tone
    variable: str  # CSS variable that stands for the tone in our pages


def draw_floor(problem: Problem, key: str) -> Markup:
    """The floor with its obstacles as a `<symbol>` of the id `key`: once in a page, before its thumbnails."""
    return Markup(
        f'<svg class="outlines" width="0" height="0" aria-hidden="true"><defs><g id="{escape(key)}">'
        f"{_floor(problem.world)}</g></defs></svg>"
    )


def thumbnail(problem: Problem, paths: Sequence[ThumbnailPath], *, words: str, floor: str = "") -> Markup:
    """A small map for our own pages, in the colours of their style sheet.

    Parameters
    ----------
    problem : world, start and goal.
    paths : the ways, the lowest first.
    words : what is seen, for those who do not see it; escaped here.
    floor : key of the page's `draw_floor`; without it the floor is part of this picture.

    Returns
    -------
    An `<svg class="thumbnail" role="img">` element, half as many pixels as units.
    """
    width, height = _size(problem.world)
    ground = f'<use href="#{escape(floor)}"/>' if floor else _floor(problem.world)
    return Markup(
        f'<svg class="thumbnail" viewBox="0 0 {width} {height}" width="{width // 2}" height="{height // 2}" '
        f'role="img" aria-label="{escape(words)}">{ground}{_ways(problem, paths)}</svg>'
    )


def thumbnail_file(problem: Problem, paths: Sequence[ThumbnailPath], *, words: str) -> str:
    """The same as the text of an SVG file of its own, with its colours for light and dark grounds."""
    width, height = _size(problem.world)
    tones = {**_TONES, **{path.variable: path.tone for path in paths}}
    light, dark = (
        ";".join(f"{name}:{getattr(tone, ground)}" for name, tone in tones.items())
        for ground in ("light", "dark")
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" '
        f'height="{height}" role="img"><title>{escape(words)}</title><style>:root{{{light}}}'
        f"@media(prefers-color-scheme:dark){{:root{{{dark}}}}}</style>"
        f"{_floor(problem.world)}{_ways(problem, paths)}</svg>\n"
    )


def _scale(world: World) -> float:
    """Units per metre."""
    x0, y0, x1, y1 = world.bounds
    return SIDE / max(x1 - x0, y1 - y0)


def _size(world: World) -> tuple[int, int]:
    x0, y0, x1, y1 = world.bounds
    scale = _scale(world)
    return tuple(int(np.ceil(scale * side + 2.0 * MARGIN)) for side in (x1 - x0, y1 - y0))  # type: ignore[return-value]


def _placed(world: World, points: Array) -> Array:
    """(n, 2) [m] to units, the second axis pointing down."""
    x0, _, _, y1 = world.bounds
    return MARGIN + _scale(world) * (points[:, :2] - [x0, y1]) * [1.0, -1.0]


def _floor(world: World) -> str:
    """Boundary, obstacles, walls and points, one element of each kind."""
    edge = 'stroke-linejoin="round"'
    parts = [
        f'<path d="{_outlines(world, [world.boundary])}" fill="var(--floor)" stroke="var(--ink)" '
        f'stroke-width="2" {edge}/>'
    ]
    if world.blocked:
        parts.append(
            f'<path d="{_outlines(world, world.blocked)}" fill="var(--rack)" stroke="var(--rack-edge)" '
            f'stroke-width="1.5" fill-rule="evenodd" {edge}/>'
        )
    thin = [_data(world, np.asarray(wall)) for wall in world.walls]
    dots = world.vertices[world.isolated]
    for data, width in ((thin, 3.0), ([_data(world, np.array([dot, dot])) for dot in dots], SPECK + 2.0)):
        if data:
            parts.append(
                f'<path d="{"".join(data)}" fill="none" stroke="var(--ink)" stroke-width="{width:g}" '
                'stroke-linecap="round"/>'
            )
    return "".join(parts)


def _outlines(world: World, polygons: Sequence[shapely.Polygon]) -> str:
    """Simplified rings of polygons; what would vanish is drawn as large as can be seen."""
    found = []
    for polygon in (_visible(polygon, _scale(world)) for polygon in polygons):
        for ring in (polygon.exterior, *polygon.interiors):
            found.append(_data(world, shapely.get_coordinates(ring)[:-1], closed=True))
    return "".join(found)


def _visible(polygon: shapely.Polygon, scale: float) -> shapely.Polygon:
    """Simplified; a speck of the least size where it is smaller than that."""
    x0, y0, x1, y1 = polygon.bounds
    if max(x1 - x0, y1 - y0) * scale < SPECK:
        return polygon.centroid.buffer(0.5 * SPECK / scale, quad_segs=2)
    return shapely.simplify(polygon, FINEST / scale)


def _data(world: World, points: Array, *, closed: bool = False) -> str:
    return compact(polyline(_placed(world, points), closed=closed), WHOLE)


def _ways(problem: Problem, paths: Sequence[ThumbnailPath]) -> str:
    """The ways with a rim against the floor, and both ends."""
    world, parts = problem.world, []
    for path in paths:
        line = shapely.simplify(shapely.LineString(path.points), FINEST / _scale(world))
        data = _data(world, shapely.get_coordinates(line))
        for colour, width in (("--paper", RIM), (path.variable, WAY)):
            parts.append(
                f'<path d="{data}" fill="none" stroke="var({colour})" stroke-width="{width:g}" '
                'stroke-linecap="round" stroke-linejoin="round"/>'
            )
    (x, y), (u, v) = np.round(_placed(world, np.array([problem.start.point, problem.goal.point]))).astype(int)
    cross = f"M{u - MARK:g} {v - MARK:g}l{2 * MARK:g} {2 * MARK:g}m0-{2 * MARK:g}l-{2 * MARK:g} {2 * MARK:g}"
    parts.append(
        f'<circle cx="{x}" cy="{y}" r="{MARK:g}" fill="var(--ink)" stroke="var(--paper)" stroke-width="2"/>'
    )
    for colour, width in (("--paper", 8.0), ("--ink", 4.0)):
        parts.append(f'<path d="{cross}" fill="none" stroke="var({colour})" stroke-width="{width:g}"/>')
    return "".join(parts)
