"""Position-velocity space seen from above: roof, cells, critical points and their graph.

A parallel projection. Faces are painted from the back to the front; lines and points lie on top, so that
nothing of the graph is hidden behind the roof that it runs under.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import matplotlib
import numpy as np
import shapely
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_hex
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline
from numpy.typing import NDArray

from verify.report.curves import halo
from verify.report.drawings import CellGraphDrawing, SpaceDrawing, VcDrawing
from verify.report.figures_map import outline
from verify.report.numbers import count
from verify.report.palette import (
    ARC,
    CASING,
    FLOOR,
    INK,
    LIMIT,
    MUTED,
    PAPER,
    RACK,
    RACK_EDGE,
    SPEED_MAP,
    method,
)
from verify.report.svg import WIDE, Picture, drawing_style, new_figure, to_svg
from vnav_drake.problem import Problem

Array = NDArray[np.float64]

HEIGHT = 0.34  # of the greatest speed in the picture, as a share of the world's longer side
SHADES = 16  # of the roof
DEPTHS = 48  # steps from the back to the front in which faces are painted
ROOF_ALPHA = 0.42
CELL_ALPHA = 0.30


@dataclass(frozen=True)
class View:
    """A parallel projection of places [m] and speeds [m/s] to the plane of the picture [m]."""

    azimuth: float  # [rad], where the onlooker stands
    elevation: float  # [rad], above the floor
    rise: float  # [m / (m/s)]

    def flat(self, points: Array) -> Array:
        """Points (..., 3) in the picture (..., 2)."""
        out, up = self._outward(points), points[..., 2] * self.rise
        across = math.cos(self.azimuth) * points[..., 1] - math.sin(self.azimuth) * points[..., 0]
        return np.stack([across, math.cos(self.elevation) * up - math.sin(self.elevation) * out], axis=-1)

    def nearness(self, points: Array) -> Array:
        """How near (...) [m] points (..., 3) are to the onlooker."""
        up = points[..., 2] * self.rise
        return np.asarray(math.cos(self.elevation) * self._outward(points) + math.sin(self.elevation) * up)

    def _outward(self, points: Array) -> Array:
        return np.asarray(math.cos(self.azimuth) * points[..., 0] + math.sin(self.azimuth) * points[..., 1])


def standing_view(problem: Problem, drawing: VcDrawing) -> View:
    """The view of the picture on paper: from the south, a little from the side."""
    x0, y0, x1, y1 = problem.world.bounds
    return View(math.radians(-68.0), math.radians(42.0), HEIGHT * max(x1 - x0, y1 - y0) / top_speed(drawing))


def top_speed(drawing: VcDrawing) -> float:
    """[m/s], at the highest point of the roof that is drawn; 1 where there is none."""
    highest = (drawing.space.roof[..., 2], drawing.unfolded.roof)
    return max(float(speed.max(initial=0.0)) for speed in highest) or 1.0


def shades_of(drawing: VcDrawing) -> NDArray[np.int64]:
    """(n,) the shade of each patch of the roof, from 0 to SHADES - 1."""
    share = drawing.space.roof[..., 2].mean(axis=1) / top_speed(drawing)
    return np.round(share * (SHADES - 1)).astype(np.int64)


def profile_on_map(drawing: VcDrawing) -> Array:
    """(n, 3) [m, m, m/s], the profile along the route's arcs where it is in the world."""
    found = drawing.unfolded
    s = np.concatenate([a for _, a, _ in found.pieces])
    v = np.concatenate([b for _, _, b in found.pieces])
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(drawing.route, axis=0).T))])
    at = s * way[-1] / s[-1]
    return np.column_stack([*(np.interp(at, way, drawing.route[:, k]) for k in (0, 1)), v])


def shown_words(space: SpaceDrawing) -> str:
    """How many stacks are drawn, as a sentence; empty when it is all of them."""
    if space.stacks >= space.total:
        return ""
    return f"Of {count(space.total)} stacks {count(space.stacks)} on or near the route are drawn."


def draw_space(problem: Problem, drawing: VcDrawing) -> Picture:
    """The space in three dimensions as it stands on paper."""
    space = drawing.space
    told = (
        f"{count(len(space.maxima))} stacks of cells, {count(len(space.graph.nodes))} cells, "
        f"{count(len(space.saddles))} saddles; {count(len(space.graph.type_a))} Type A edges and "
        f"{count(len(space.graph.type_b))} Type B edges join the cells."
    )
    described = {
        "key": "vc-space",
        "title": "Position-velocity space with its cells and their graph",
        "description": "The floor plan with the greatest safe speed V(d) as a roof above it, highest in the "
        f"middle of open floor and zero at the obstacles. Below the roof: {told} {shown_words(space)}",
    }
    with drawing_style():
        svg = _draw(problem, drawing, described)
    return Picture(
        **described,
        svg=svg,
        narrow=None,
        heading="Position-velocity space",
        caption="Speed is the height above the floor plan. The roof is the braking limit V(d): above it "
        "are the vc-obstacles, below it is free space, coloured by speed as on the map. Red walls: vertical "
        "partitions, each up to its saddle (×); grey floors: horizontal partitions; triangles: maxima. Lines "
        "with dots: the graph of cells, Type A edges solid, Type B edges dotted, those of the route broad. "
        f"The line on the roof is the profile along the route. {shown_words(space)} Compare Manor 2015, "
        "Figs. 2.3, 2.7 and 2.9.",
    )


def _draw(problem: Problem, drawing: VcDrawing, described: dict[str, str]) -> Markup:
    space = drawing.space
    view = standing_view(problem, drawing)
    low, high = _extent(problem, drawing, view)
    figure = new_figure(WIDE, WIDE * float(np.clip((high[1] - low[1]) / (high[0] - low[0]), 0.3, 1.2)))
    figure.set_layout_engine("none")
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    axes.set_aspect("equal")
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    _floor(axes, problem, view)
    _faces(axes, drawing, view)
    ridges = one_outline([view.flat(ridge) for ridge in space.ridges])
    axes.add_patch(PathPatch(ridges, fill=False, edgecolor=ARC.light, lw=0.9))
    _graph(axes, space.graph, view)
    _route(axes, drawing, view)
    _critical(axes, space, view)
    _scale(axes, problem, drawing, view)
    return to_svg(figure, **described)


def _extent(problem: Problem, drawing: VcDrawing, view: View) -> tuple[Array, Array]:
    corners = np.array(shapely.get_coordinates(problem.world.boundary))
    ground = np.column_stack([corners, np.zeros(len(corners))])
    tops = [drawing.space.roof.reshape(-1, 3), profile_on_map(drawing)]
    every = view.flat(np.concatenate([ground, *tops]))
    low, high = every.min(axis=0), every.max(axis=0)
    pad = 0.03 * (high - low).max()
    return low - [2.0 * pad, pad], high + pad


def _projected(view: View, shape: shapely.Geometry, speed: float) -> list[Outline]:
    """A floor plan at a speed, polygon by polygon."""

    def lifted(xy: Array) -> Array:
        return view.flat(np.column_stack([xy, np.full(len(xy), speed)]))

    parts = shapely.get_parts(shape)
    flat = shapely.transform(parts[shapely.area(parts) > 0.0], lifted)
    return [outline(polygon) for polygon in flat if isinstance(polygon, shapely.Polygon)]


def _floor(axes: Axes, problem: Problem, view: View) -> None:
    world = problem.world
    for shapes, face, edge, line in (
        ([world.boundary], FLOOR.light, INK.light, 1.2),
        (world.blocked, RACK.light, RACK_EDGE.light, 0.6),
    ):
        paths = [path for shape in shapes for path in _projected(view, shape, 0.0)]
        if paths:
            whole = Outline.make_compound_path(*paths)
            axes.add_patch(PathPatch(whole, facecolor=face, edgecolor=edge, lw=line))
    walls = np.asarray(world.walls, dtype=float).reshape(-1, 2, 2)
    lines = np.concatenate([walls, np.zeros((*walls.shape[:2], 1))], axis=-1)
    axes.add_collection(LineCollection(list(view.flat(lines)), colors=INK.light, linewidths=1.6))
    spots = world.vertices[world.isolated]
    axes.plot(*view.flat(np.column_stack([spots, np.zeros(len(spots))])).T, "o", color=INK.light, ms=3)


def _faces(axes: Axes, drawing: VcDrawing, view: View) -> None:
    """Roof and partitions from the back to the front; of one colour and about one depth as one element."""
    shade = matplotlib.colormaps[SPEED_MAP].resampled(SHADES)
    ways: list[tuple[float, str, float, Outline]] = []
    space, level = drawing.space, shades_of(drawing)
    near = view.nearness(space.roof).mean(axis=1)
    for patch, depth, part in zip(view.flat(space.roof), near, level, strict=True):
        ways.append(
            (depth, to_hex(shade(int(part))), ROOF_ALPHA, Outline(np.vstack([patch, patch[:1]]), closed=True))
        )
    for wall in space.vertical:
        flat = view.flat(wall)
        depth = float(view.nearness(wall).mean())
        ways.append((depth, LIMIT.light, CELL_ALPHA, Outline(np.vstack([flat, flat[:1]]), closed=True)))
    for speed, plan in space.horizontal:
        depth = float(view.nearness(np.array([*plan.centroid.coords[0], speed])))
        ways += [(depth, MUTED.light, CELL_ALPHA, path) for path in _projected(view, plan, speed)]
    low, high = min(way[0] for way in ways), max(way[0] for way in ways)
    ways.sort(key=lambda way: (round(DEPTHS * (way[0] - low) / ((high - low) or 1.0)), way[1:3]))
    for (_, colour, alpha), same in groupby(ways, key=lambda way: (0.0, *way[1:3])):
        path = Outline.make_compound_path(*(way[3] for way in same))
        axes.add_patch(
            PathPatch(path, facecolor=colour, edgecolor="none", alpha=alpha, lw=0.0, clip_on=False)
        )


def one_outline(lines: Sequence[Array]) -> Outline:
    """Lines (n, 2) as one outline: a fraction of the size of one element each."""
    kept = [line for line in lines if len(line) > 1]
    codes = [np.where(np.arange(len(line)) == 0, Outline.MOVETO, Outline.LINETO) for line in kept]
    return Outline(np.concatenate([np.zeros((0, 2)), *kept]), np.concatenate([np.zeros(0, int), *codes]))


def _graph(axes: Axes, graph: CellGraphDrawing, view: View) -> None:
    look = method("vc_method")
    for lines, flags in (
        (graph.type_a, graph.type_a_on_route),
        (list(graph.type_b), graph.type_b_on_route),
    ):
        dash = "solid" if lines is graph.type_a else (0, (1.5, 1.2))
        for on, colour, broad in ((False, INK.light, 0.9), (True, look.text, 2.6)):
            some = [view.flat(line) for line, flag in zip(lines, flags, strict=True) if flag == on]
            axes.add_patch(
                PathPatch(one_outline(some), fill=False, edgecolor=colour, lw=broad, ls=dash, capstyle="butt")
            )
    flat = view.flat(graph.nodes)
    for on, colour, size in ((False, INK.light, 2.6), (True, look.text, 4.6)):
        axes.plot(*flat[graph.on_route == on].T, "o", color=colour, ms=size, mew=0)


def _critical(axes: Axes, space: SpaceDrawing, view: View) -> None:
    for points, marker, face, size in (
        (space.saddles, "X", LIMIT.light, 6.5),
        (space.maxima, "^", PAPER.light, 7.0),
    ):
        axes.plot(*view.flat(points).T, marker, ms=size, mfc=face, mec=INK.light, mew=0.9, ls="none")


def _route(axes: Axes, drawing: VcDrawing, view: View) -> None:
    """The profile on the roof, with a rim."""
    place = profile_on_map(drawing)
    flat = view.flat(place)
    axes.plot(*flat.T, color=CASING.light, lw=4.2)
    axes.plot(*flat.T, color=method("vc_method").light, lw=2.6)
    for name, k in (("start", 0), ("goal", -1)):
        stem = view.flat(np.array([[*place[k, :2], 0.0], place[k]]))
        axes.plot(*stem.T, color=INK.light, lw=1.0)
        axes.plot(*stem[0], "o", mfc=PAPER.light, mec=INK.light, ms=5)
        halo(
            axes.annotate(
                name, (stem[0, 0], stem[0, 1]), (0, -6), textcoords="offset points", ha="center", va="top",
                weight="bold", fontsize=10, color=INK.light,
            )
        )  # fmt: skip


def speed_axis(problem: Problem, drawing: VcDrawing, view: View) -> list[tuple[str, Array]]:
    """Ticks of an axis of speeds at the leftmost corner: words and place (1, 3) [m, m, m/s]."""
    corners = np.array(shapely.get_coordinates(problem.world.boundary))
    ground = view.flat(np.column_stack([corners, np.zeros(len(corners))]))
    x, y = corners[int(np.argmin(ground[:, 0]))]
    speeds = _ticks(top_speed(drawing))
    words = [f"{speed:g}" for speed in speeds[:-1]] + [f"{speeds[-1]:g} m/s"]
    return [(text, np.array([[x, y, speed]])) for text, speed in zip(words, speeds, strict=True)]


def _scale(axes: Axes, problem: Problem, drawing: VcDrawing, view: View) -> None:
    """The axis of speeds."""
    ticks = speed_axis(problem, drawing, view)
    axes.plot(
        *view.flat(np.concatenate([place for _, place in ticks])).T, "_-", color=INK.light, lw=1.0, ms=6
    )
    for text, place in ticks:
        at = view.flat(place)[0]
        halo(
            axes.annotate(
                text, (at[0], at[1]), (-5, 0), textcoords="offset points", ha="right", va="center",
                fontsize=9, color=INK.light,
            )
        )  # fmt: skip


def _ticks(top: float) -> list[float]:
    """Zero and round speeds [m/s] up to the top, two of them at least."""
    power = 10.0 ** math.floor(math.log10(top / 2.0))
    step = max(k * power for k in (1.0, 2.0, 5.0) if k * power <= top / 2.0)
    return [k * step for k in range(int(top / step + 1e-9) + 1)]
