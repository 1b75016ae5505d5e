"""The certificate of the lower bound on the map: where it is tight, and the potential it consists of."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import shapely
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PathCollection
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.path import Path as Outline
from matplotlib.tri import Triangulation
from numpy.typing import NDArray

from verify.report.bound import BoundMesh, long_sides
from verify.report.curves import halo
from verify.report.figures_map import (
    GROUND,
    Box,
    draw_ends,
    draw_world,
    map_height,
    outline,
    window_around,
    window_height,
)
from verify.report.numbers import count, percent, power_of_ten, seconds_proven, significant
from verify.report.palette import BANDS, INK, MUTED, PAPER, RACK_EDGE, SLACKS, method
from verify.report.series import thinned_path
from verify.report.svg import PANEL, WIDE, Picture, both_widths, drawing_style, new_axes, to_svg
from vnav_drake.plan import Trajectory
from vnav_drake.problem import Problem
from vnav_drake.world import World

Array = NDArray[np.float64]

SLACK_STEPS = (0.3, 0.1, 1e-2, 1e-4)  # between the tones of SLACKS, from loose to tight
LEAST_SIDE = 1.5  # [px]: shorter sides of triangles only blacken a picture
WIDEST_ZOOM = 0.08  # of the world's diameter, from an end to the rim of the picture around it
NUMBER_ROOM = 0.04  # of the picture's diagonal: least distance of an isochrone's number from both ends
NUMBERS_APART = 0.045  # of the picture's diagonal: least distance between two numbers
MOST_BANDS = len(BANDS) - 2  # one tone for what lies before the start, one for what lies after the goal
PATH_SAMPLES = 1500  # along the path, where the potential is looked up
NEAR = 0.01  # gap, ratio: up to this the best path known is told to be like the fastest one
FINE = 5  # isochrones without a number to one with a number


@dataclass(frozen=True, kw_only=True)
class Way:
    """The best path known, drawn on top."""

    method: str
    motion: Trajectory
    gap: float | None = None  # ratio, how far its time is above the bound

    @property
    def near(self) -> bool:
        """Whether it is so near to the bound that what it does is what the fastest way does."""
        return self.gap is not None and self.gap <= NEAR


def draw_slack(problem: Problem, mesh: BoundMesh, way: Way | None) -> Sequence[Picture]:
    """The mesh coloured by relative slack, whole and around the end with the finer triangles."""
    least, tight = float(mesh.slack.min()), int(np.sum(mesh.slack <= SLACK_STEPS[-1]))
    end, half = _zoom(problem, mesh)
    near = (problem.start if end == "start" else problem.goal).point
    spoken = (
        f"{count(len(mesh.triangles))} triangles with sides from {significant(float(mesh.size.min()), 2)} to "
        f"{significant(float(mesh.size.max()), 2)} m; the least relative slack is {significant(least, 2)}, "
        f"and {count(tight)} triangles have at most {power_of_ten(-4)}."
    )
    meaning = (
        " In a strongly coloured triangle the potential is as steep as the speed limit allows: there the "
        "bound is won. "
        + (
            "Pale ones have room to spare, the fastest ways do not pass there."
            if way is not None and way.near
            else "Pale ones have room to spare: no fast way passes there, or finer triangles prove more."
        )
    )
    drawn = [
        ("bound-slack", "Slack of the certificate, triangle by triangle", spoken + meaning, None),
        ("bound-zoom", f"The same around the {end}",
         f"Triangles grow with the distance from the {end}, where the potential has its tip: the picture is "
         f"{significant(2.0 * half, 2)} m wide.", (near, half)),
    ]  # fmt: skip
    pictures = []
    with drawing_style():
        for key, title, caption, window in drawn:
            described = {"key": key, "title": title, "description": spoken if window is None else caption}
            svg = _slack(problem, mesh, way, described, window)
            pictures.append(Picture(**described, svg=svg, narrow=None, heading=title, caption=caption))
    return pictures


def _zoom(problem: Problem, mesh: BoundMesh) -> tuple[str, float]:
    """The end with the finer triangles around it, and half the width [m] of a picture that shows them.

    Triangles grow like the distance from an end: midway, in powers of ten, between them and the world as
    many of them are in sight as fit.
    """
    centres = mesh.corners.mean(axis=1)
    sizes = {}
    for name, end in (("start", problem.start), ("goal", problem.goal)):
        away = np.hypot(*(centres - end.point).T)
        sizes[name] = float(mesh.size[np.argsort(away)[:6]].max())
    finer = min(sizes, key=lambda name: sizes[name])
    size, world = sizes[finer], problem.world.diameter
    return finer, min(2.0 * math.sqrt(size * world), WIDEST_ZOOM * world)


def _slack(
    problem: Problem,
    mesh: BoundMesh,
    way: Way | None,
    described: dict[str, str],
    window: tuple[Array, float] | None,
) -> Markup:
    world = problem.world
    height = map_height(world, PANEL, bar=False) if window is None else PANEL - 20.0
    figure, axes = new_axes(PANEL, height + 62.0, x="x [m]", y="y [m]")
    draw_world(axes, world, names=False, scale=window is None)
    shown = np.ones(len(mesh.triangles), dtype=bool)
    x, y = problem.start.point
    if window is not None:
        (x, y), half = window
        low, high = mesh.corners.min(axis=1), mesh.corners.max(axis=1)
        shown = ((high > window[0] - half) & (low < window[0] + half)).all(axis=1)
        axes.set_xlim(x - half, x + half)
        axes.set_ylim(y - half, y + half)
        axes.locator_params(nbins=4)
        for axis in (axes.xaxis, axes.yaxis):
            axis.get_major_formatter().set_useOffset(False)  # type: ignore[attr-defined]
    span = float(np.ptp(axes.get_xlim()))
    pixel = span / (PANEL - 60.0)  # [m]
    _fill_slack(axes, mesh, shown, 0.2 * pixel, world)
    sides = mesh.place[mesh.triangles][shown & (mesh.size > LEAST_SIDE * pixel)][:, [[0, 1], [1, 2], [2, 0]]]
    lines = long_sides(mesh.lattice, np.unique(np.sort(sides.reshape(-1, 2), axis=1), axis=0))
    path = _one_path(mesh.points[lines])
    thin = PathCollection([path], facecolors="none", edgecolors=RACK_EDGE.light, linewidths=0.35,
                          zorder=GROUND + 0.2)  # fmt: skip
    _add_on_floor(axes, thin, world)
    if way is not None:
        line = thinned_path(way.motion.x, way.motion.y, span)
        axes.plot(*line, color=method(way.method).light, lw=1.3)
    _slack_bar(figure, axes)
    if window is None:
        draw_ends(axes, problem, way.motion if way else None, filled=False)
    else:
        axes.plot(x, y, "o", color=INK.light, ms=4)
    return to_svg(figure, **described)


def _fill_slack(axes: Axes, mesh: BoundMesh, shown: NDArray[np.bool_], blur: float, world: World) -> None:
    """Each tone covers all triangles at least as tight, so that no seam shows between two tones."""
    least = (math.inf, *SLACK_STEPS)
    for tone, most in zip(SLACKS, least, strict=True):
        chosen = shown & (mesh.slack <= most)
        if chosen.any():
            united = shapely.coverage_union_all(mesh.parts[chosen & (mesh.side == 0)])
            halves = mesh.parts[chosen & (mesh.side != 0)]
            if len(halves):
                united = shapely.union_all([united, *halves])
            united = shapely.simplify(united, blur)
            parts = [outline(part) for part in shapely.get_parts(united) if not part.is_empty]
            area = PathCollection([Outline.make_compound_path(*parts)], facecolors=tone.light,
                                  linewidths=0.0, zorder=GROUND + 0.1)  # fmt: skip
            _add_on_floor(axes, area, world)


def _slack_bar(figure: Figure, axes: Axes) -> None:
    edges = np.arange(len(SLACKS) + 1.0)
    tones = ScalarMappable(BoundaryNorm(edges, len(SLACKS)), ListedColormap([t.light for t in SLACKS]))
    bar = figure.colorbar(tones, ax=axes, orientation="horizontal", shrink=0.92, aspect=26, pad=0.02)
    bar.set_ticks(list(edges[1:-1]), labels=[f"{s:g}" for s in SLACK_STEPS])
    bar.set_label("relative slack: loose to tight")
    bar.outline.set_edgecolor(MUTED.light)
    bar.outline.set_linewidth(0.6)
    if bar.solids is not None:
        bar.solids.set_edgecolor("face")
        bar.solids.set_rasterized(False)


def draw_potential(problem: Problem, mesh: BoundMesh, way: Way | None) -> Picture:
    """The potential u as filled contours, isochrones numbered where the best path crosses them."""
    ends = mesh.potential(np.array([problem.start.point, problem.goal.point]))
    total = float(ends[1] - ends[0])
    step = isochrone_step(total)
    window = None if way is None else window_around(problem.world, way.motion.x, way.motion.y)
    drawn = _contours(mesh, float(ends[0]), total, way, window or problem.world.bounds)
    spoken = (
        f"The potential rises by {seconds_proven(total)} from start to goal; one band is {step:g} s. "
        + (f"The path of the {method(way.method).label.lower()} crosses the isochrones." if way else "")
    )
    described = {"key": "bound-potential", "title": "The potential of the certificate", "description": spoken}
    caption = (
        "Lines of equal potential u − u(start), in seconds. No motion crosses from one line to the next "
        "faster than the numbers say, whatever way it takes; so the time from start to goal is at least "
        f"their difference. {_crossing(way)}Blank: dropped triangles, where the robot cannot move."
        + (" The part of the world around the path." if window else "")
    )
    return both_widths(
        partial(_potential, problem, drawn, way, window),
        described,
        heading="Isochrones of the certificate",
        caption=caption,
    )


def _crossing(way: Way | None) -> str:
    """How the best path known crosses the isochrones."""
    if way is None or way.gap is None:
        return ""
    if way.near:
        return (
            f"The best path takes {percent(way.gap)} longer than that: it crosses them nearly at right "
            "angles. Far from it u may lie below the least time from the start, as no fast way passes there. "
        )
    return (
        f"The best path known takes {percent(way.gap)} longer than that: it is not the fastest, or this "
        "u does not rise as fast as it could. "
    )


def isochrone_step(total: float) -> float:
    """Seconds between numbered isochrones: 1, 2 or 5 times a power of ten, at most `MOST_BANDS` bands."""
    power = 10.0 ** math.floor(math.log10(total / MOST_BANDS)) if total > 0.0 else 1.0
    return next(s * power for s in (1.0, 2.0, 5.0, 10.0) if total <= MOST_BANDS * s * power)


def _potential(
    problem: Problem, drawn: _Potential, way: Way | None, window: Box | None, described: dict[str, str],
    width: float,
) -> Markup:  # fmt: skip
    world, wide = problem.world, width == WIDE
    x0, y0, x1, y1 = window or world.bounds
    height = map_height(world, width, bar=False) if window is None else window_height(window, width)
    figure, axes = new_axes(width, height, x="x [m]", y="y [m]")
    draw_world(axes, world, names=False, scale=window is None)
    if window is not None:
        axes.set_xlim(x0, x1)
        axes.set_ylim(y0, y1)
    tones = np.linspace(0, len(BANDS) - 1, len(drawn.bands)).round().astype(int)
    for path, tone in zip(drawn.bands, tones, strict=True):
        colour = BANDS[tone].light
        area = PathCollection([path], facecolors=colour, edgecolors=colour, linewidths=0.5,
                              zorder=GROUND + 0.1)  # fmt: skip
        _add_on_floor(axes, area, world)
    for lines, thickness in ((drawn.fine if wide else [], 0.3), (drawn.numbered, 0.9 if wide else 0.6)):
        drawn_lines = PathCollection(lines, facecolors="none", edgecolors=INK.light, linewidths=thickness,
                                     zorder=GROUND + 0.2)  # fmt: skip
        _add_on_floor(axes, drawn_lines, world)
    _draw_way(axes, way, world, 2.6 if wide else 2.0)
    draw_ends(axes, problem, way.motion if way else None, filled=False)
    for value, at, aside in drawn.numbers if wide else drawn.numbers[::2]:
        text = axes.annotate(
            f"{value:g}", (at[0], at[1]), (13.0 * aside[0], 13.0 * aside[1]), textcoords="offset points",
            ha="center", va="center", fontsize=10 if wide else 9, weight="bold", color=INK.light, zorder=4,
        )  # fmt: skip
        halo(text)
    return to_svg(figure, **described)


@dataclass(frozen=True, kw_only=True)
class _Potential:
    """The potential as outlines."""

    bands: Sequence[Outline]  # before the start, between numbered isochrones, after the goal
    numbered: Sequence[Outline]
    fine: Sequence[Outline]
    numbers: Sequence[tuple[float, Array, Array]]  # [s], where [m], unit vector beside the path


def _contours(mesh: BoundMesh, begin: float, total: float, way: Way | None, shown: Box) -> _Potential:
    step = isochrone_step(total)
    size = math.dist(shown[:2], shown[2:])  # [m]
    blur = size / 5000.0
    levels = step * np.arange(1, math.ceil(total / step - 1e-9))
    fine = step / FINE * np.arange(1, math.ceil(FINE * total / step - 1e-9))
    points, triangles, u = mesh.pieces()
    axes, net = Figure().add_subplot(), Triangulation(points[:, 0], points[:, 1], triangles)
    edges = np.array([0.0, *levels, total])
    bands = axes.tricontourf(net, u - begin, levels=edges, extend="both").get_paths()
    found = [
        axes.tricontour(net, u - begin, levels=values).get_paths() if len(values) else []
        for values in (edges, fine)
    ]
    return _Potential(
        bands=[_thinned(path, blur) for path in bands],
        numbered=[_thinned(path, blur) for path in found[0]],
        fine=[_thinned(path, blur) for path in found[1]],
        numbers=_numbers(mesh, begin, levels.tolist(), way, size) if way else [],
    )


def _numbers(
    mesh: BoundMesh, begin: float, levels: Sequence[float], way: Way, size: float
) -> Sequence[tuple[float, Array, Array]]:
    """Where the path first crosses isochrones, and a direction across it; as many as a picture can hold.

    `size` [m] is the diagonal of the picture.
    """
    s = way.motion.arc_length
    at = np.linspace(0.0, s[-1], PATH_SAMPLES)
    path = np.column_stack([np.interp(at, s, way.motion.x), np.interp(at, s, way.motion.y)])
    reached = np.fmax.accumulate(mesh.potential(path) - begin)
    numbers: list[tuple[float, Array, Array]] = []
    for level in levels:
        k = int(np.argmax(reached >= level))
        others = [at for _, at, _ in numbers[-1:]]
        free = min(math.dist(path[k], end) for end in path[[0, -1]]) > NUMBER_ROOM * size
        free &= all(math.dist(path[k], other) > NUMBERS_APART * size for other in others)
        if reached[k] >= level and free:
            along = path[min(k + 1, len(path) - 1)] - path[max(k - 1, 0)]
            numbers.append((level, path[k], np.array([along[1], -along[0]]) / np.hypot(*along)))
    return numbers


def _thinned(path: Outline, blur: float) -> Outline:
    """The path with every piece of it simplified by at most `blur`; pieces smaller than that vanish."""
    vertices = np.asarray(path.vertices)
    if path.codes is None or not len(vertices):
        return path
    cuts = np.flatnonzero(path.codes == Outline.MOVETO)[1:]
    pieces = np.split(vertices, cuts)
    closed = [Outline.CLOSEPOLY in codes for codes in np.split(path.codes, cuts)]
    kept = []
    for piece, ring in zip(pieces, closed, strict=True):
        line = np.concatenate([piece[:-1], piece[:1]]) if ring else piece
        if len(line) < 2 or np.ptp(line, axis=0).max() < blur:
            continue
        simple = shapely.get_coordinates(shapely.simplify(shapely.LineString(line), blur))
        kept.append(Outline(simple, closed=ring))
    return Outline.make_compound_path(*kept) if kept else Outline(np.empty((0, 2)))


def _one_path(lines: Array) -> Outline:
    """Straight lines (k, 2, 2) as one outline."""
    codes = np.tile([Outline.MOVETO, Outline.LINETO], len(lines)).astype(np.uint8)
    return Outline(lines.reshape(-1, 2), codes)


def _add_on_floor(axes: Axes, area: PathCollection, world: World) -> None:
    """Draw it within the boundary and the axes only: the triangles cover a box around them."""
    (x0, x1), (y0, y1) = axes.get_xlim(), axes.get_ylim()
    seen = shapely.get_parts(shapely.intersection(world.boundary, shapely.box(x0, y0, x1, y1)))
    rings = [outline(part) for part in seen if isinstance(part, shapely.Polygon)]
    axes.add_collection(area, autolim=False)
    area.set_clip_path(Outline.make_compound_path(*rings), axes.transData)


def _draw_way(axes: Axes, way: Way | None, world: World, width: float) -> None:
    if way is None:
        return
    line = thinned_path(way.motion.x, way.motion.y, world.diameter)
    axes.plot(*line, color=PAPER.light, lw=width + 2.0)
    axes.plot(*line, color=method(way.method).light, lw=width)
