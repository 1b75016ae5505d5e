"""Maps: the world to scale, the ways through it, the speed as colour."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import matplotlib
import numpy as np
import shapely
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.colors import Normalize
from matplotlib.patches import Circle
from matplotlib.path import Path as Outline
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from verify.report.curves import Curve, halo, label_points
from verify.report.evidence import SimulatedRun
from verify.report.palette import ARC, CASING, FLOOR, INK, MUTED, PAPER, RACK, RACK_EDGE, SPEED_MAP, method
from verify.report.series import thinned_path
from verify.report.svg import WIDE, Picture, arrange, drawing_style, new_axes, to_svg
from verify.report.text import label
from vnav_drake.plan import Trajectory
from vnav_drake.problem import Problem
from vnav_drake.world import World

Array = NDArray[np.float64]
Box = tuple[float, float, float, float]  # x0, y0, x1, y1 [m]

GROUND = 0.5  # drawing order of the floor: what covers it, below the obstacles, lies between this and 1
MOST_NAMES = 60  # more names than that are noise on a map
COLOURED_PIECES = 320  # pieces of one colour each along the executed path
LOWEST_UPRIGHT_BAR = 330.0  # [px] height of a map beside which its colour bar can stand
AROUND = 0.7  # of the extent of the path, on each side of it, that the isochrones are drawn on
CROPPED = 0.25  # of the world's area: a larger part is not worth a cut
BAR_STEPS = 64  # shades of the colour bar


@dataclass(frozen=True, kw_only=True)
class MapData:
    """What the map shows, bottom to top."""

    problem: Problem
    arcs: Sequence[Array]  # Voronoi arcs, (n, 2) [m] each
    others: Sequence[tuple[str, Trajectory]]  # (method, motion) drawn as lines
    executed: Trajectory | None  # drawn with its speed as colour
    # (method, place [m], what became of it) of runs that gave up
    stuck: Sequence[tuple[str, tuple[float, float], str]] = ()
    subject: str = "executed motion"  # what `executed` is called: where nothing is executed, a stand-in
    strayed: SimulatedRun | None = None  # where the simulated vehicle drove, when it did not follow


def draw_map(data: MapData) -> Picture:
    """World, Voronoi arcs, paths of the methods and the executed path coloured by speed."""
    x0, y0, x1, y1 = data.problem.world.bounds
    lines = ", ".join(method(name).label for name, _ in data.others)
    described = {
        "key": "map",
        "title": "Map of the world and the paths",
        "description": f"A floor of {x1 - x0:g} by {y1 - y0:g} metres with "
        f"{len(data.problem.world.obstacles)} obstacles, the robot's disc at start and goal, "
        + (f"the paths of {lines}, " if lines else "")
        + (
            f"and the path of the {data.subject} coloured by speed."
            if data.executed is not None
            else "and no executed path."
        )
        + "".join(
            f" {method(name).label} {'got stuck' if word == 'stuck' else word} where the crossed ring is."
            for name, _, word in data.stuck
        )
        + (" The simulated vehicle left it: its track is drawn on top." if data.strayed is not None else ""),
    }
    with drawing_style():
        return Picture(**described, svg=_draw(data, described), narrow=None)


def _draw(data: MapData, described: dict[str, str]) -> Markup:
    world, width = data.problem.world, WIDE
    height = map_height(world, width, bar=True)
    low = height < LOWEST_UPRIGHT_BAR  # the colour bar lies below the map
    figure, axes = new_axes(width, height + (60 if low else 0), x="x [m]", y="y [m]")
    draw_world(axes, world, names=True)
    size = world.diameter
    axes.add_collection(
        LineCollection(
            [np.column_stack(thinned_path(arc[:, 0], arc[:, 1], size)) for arc in data.arcs if len(arc) > 1],
            colors=ARC.light,
            linewidths=0.7,
        )
    )
    below = [item for item in data.others if item[0] != "collocation"]
    above = [item for item in data.others if item[0] == "collocation"]
    for name, motion in below:
        _line(axes, name, motion, size, 2.0)
    if data.executed is not None:
        colours = draw_speed(axes, data.executed, width=4.2)
        bar = figure.colorbar(
            colours,
            ax=axes,
            orientation="horizontal" if low else "vertical",
            shrink=0.6,
            aspect=28,
            pad=0.02,
        )
        bar.set_label(f"speed of the {data.subject} [m/s]")
        bar.outline.set_visible(False)
        if bar.solids is not None:
            bar.solids.set_edgecolor("face")
            bar.solids.set_rasterized(False)
    for name, motion in above:
        _line(axes, name, motion, size, 1.3)
    if data.strayed is not None:
        look = method("simulation")
        track = thinned_path(data.strayed.x, data.strayed.y, size)
        axes.plot(*track, color=look.light, lw=1.8, ls=look.dash, dash_capstyle="butt")
    for name, place, word in data.stuck:
        _stuck(axes, name, place, word)
    draw_ends(axes, data.problem, data.executed)
    return to_svg(figure, **described)


def _stuck(axes: Axes, name: str, place: tuple[float, float], word: str) -> None:
    look = method(name)
    axes.plot(*place, "o", ms=13, mfc=PAPER.light, mec=look.text, mew=2.0, zorder=6)
    axes.plot(*place, "X", ms=8, mfc=look.light, mec=INK.light, mew=0.8, zorder=6)
    text = axes.annotate(
        word, place, (0, -10), textcoords="offset points", ha="center", va="top", weight="bold", zorder=6,
        color=look.text,
    )  # fmt: skip
    halo(text)


def _line(axes: Axes, name: str, motion: Trajectory, size: float, width: float) -> None:
    look = method(name)
    axes.plot(
        *thinned_path(motion.x, motion.y, size),
        color=look.light,
        lw=width,
        ls=look.dash,
        dash_capstyle="butt",
    )


def map_height(world: World, width: float, *, bar: bool) -> float:
    """Height [px] at which a map `width` px wide has little empty ground around it."""
    x0, y0, x1, y1 = world.bounds
    room = width - 56.0 - (86.0 if bar else 0.0)
    return (
        float(
            np.clip(
                room * (1.1 * (y1 - y0) + 0.03 * (x1 - x0)) / (1.05 * (x1 - x0)), 0.16 * width, 1.1 * width
            )
        )
        + 48.0
    )


def window_around(world: World, x: Array, y: Array) -> Box | None:
    """The part of the world around points (n,) [m], where that is much less than all of it."""
    points = np.column_stack([x, y])
    pad = AROUND * float(np.ptp(points, axis=0).max())
    low = np.maximum(points.min(axis=0) - pad, world.bounds[:2])
    high = np.minimum(points.max(axis=0) + pad, world.bounds[2:])
    if np.prod(high - low) > CROPPED * shapely.box(*world.bounds).area or not np.all(high > low):
        return None
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def window_height(window: Box, width: float) -> float:
    """Height [px] of a picture `width` px wide that shows this part of the world alone."""
    x0, y0, x1, y1 = window
    return float(np.clip((width - 56.0) * (y1 - y0) / (x1 - x0), 0.16 * width, 1.1 * width)) + 48.0


def draw_world(axes: Axes, world: World, *, names: bool, scale: bool = True) -> None:
    """Floor, obstacles with their names, and a scale bar above unless `scale` is off; equal scales."""
    x0, y0, x1, y1 = world.bounds
    axes.set_aspect("equal")
    axes.grid(False)
    for side in axes.spines.values():
        side.set_visible(False)
    axes.tick_params(length=3)
    axes.add_collection(
        PathCollection(
            [outline(world.boundary)],
            facecolors=FLOOR.light,
            edgecolors=INK.light,
            linewidths=1.4,
            zorder=GROUND,
        )
    )
    axes.add_collection(
        PathCollection(
            [outline(p) for p in world.blocked],
            facecolors=RACK.light,
            edgecolors=RACK_EDGE.light,
            linewidths=0.8,
        )
    )
    axes.add_collection(LineCollection(list(world.walls), colors=INK.light, linewidths=2.0))
    if len(world.isolated):
        axes.plot(*world.vertices[world.isolated].T, "o", color=INK.light, ms=3.5)
    pad = 0.025 * max(x1 - x0, y1 - y0)
    foot = max(0.075 * (y1 - y0), 0.03 * (x1 - x0))
    axes.set_xlim(x0 - pad, x1 + pad)
    axes.set_ylim(y0 - pad, y1 + foot + pad)
    if scale:
        _scale_bar(axes, (x0, y1 + 0.6 * foot), x1 - x0)
    if names and len(world.obstacles) <= MOST_NAMES:
        _names(axes, world)


def outline(polygon: shapely.Polygon) -> Outline:
    """A polygon with its holes as one outline to fill."""
    rings = [polygon.exterior, *polygon.interiors]
    return Outline.make_compound_path(
        *(Outline(np.asarray(ring.coords)[:, :2], closed=True) for ring in rings)
    )


def _scale_bar(axes: Axes, at: tuple[float, float], width: float) -> None:
    power = 10.0 ** math.floor(math.log10(width / 4.0))
    length = max(step * power for step in (1.0, 2.0, 5.0) if step * power <= width / 4.0)
    axes.plot([at[0], at[0] + length], [at[1], at[1]], color=INK.light, lw=2.5, solid_capstyle="butt")
    axes.annotate(
        f"{length:g} m", (at[0] + length, at[1]), (5, 0), textcoords="offset points", va="center", fontsize=10
    )


def _names(axes: Axes, world: World) -> None:
    arrange(axes.figure.figure, final=False)
    for obstacle in world.obstacles:
        name = label(obstacle.name)
        if not name:
            continue
        corners = np.array(obstacle.vertices)
        if len(corners) >= 3:
            point = (
                shapely.Polygon(corners).representative_point()
                if len(corners) > 4
                else shapely.MultiPoint(corners).centroid
            )
            text = axes.text(point.x, point.y, name, ha="center", va="center", fontsize=10, color=MUTED.light)
            box = axes.transData.transform(corners)
            if text.get_window_extent().width > np.ptp(box[:, 0]) - 4.0:
                text.remove()
        else:
            halo(
                axes.annotate(
                    name,
                    corners.mean(axis=0),
                    (5, 5),
                    textcoords="offset points",
                    fontsize=9,
                    color=MUTED.light,
                )
            )


def draw_speed(axes: Axes, motion: Trajectory, *, width: float) -> ScalarMappable:
    """The path in pieces coloured by speed, with a thin rim that lifts every colour off every ground."""
    s = motion.arc_length
    at = np.linspace(0.0, s[-1], COLOURED_PIECES + 1)
    points = np.column_stack([np.interp(at, s, motion.x), np.interp(at, s, motion.y)])
    middle = np.sqrt(
        np.interp(0.5 * (at[1:] + at[:-1]), s, np.square(motion.v))
    )  # v^2 is linear within a row
    colours = ScalarMappable(
        Normalize(0.0, float(motion.v.max()) or 1.0), matplotlib.colormaps[SPEED_MAP].resampled(BAR_STEPS)
    )
    axes.plot(*points.T, color=CASING.light, lw=width + 1.6)
    axes.add_collection(
        LineCollection(
            list(np.stack([points[:-1], points[1:]], axis=1)),
            colors=colours.to_rgba(middle),
            linewidths=width,
            capstyle="round",
            zorder=2,
        )
    )
    return colours


def draw_ends(axes: Axes, problem: Problem, motion: Trajectory | None, *, filled: bool = True) -> None:
    """The robot's disc at start and goal, to scale, with its direction of motion where known.

    Call it when the limits of the axes are final. Without `filled` what lies below the discs stays in sight.
    """
    radius = problem.robot.radius
    rims = [] if filled else [withStroke(linewidth=3.4, foreground=PAPER.light)]
    for name, end, row in (("start", problem.start, 0), ("goal", problem.goal, -1)):
        x, y = end.position
        face = PAPER.light if filled else "none"
        axes.add_patch(
            Circle((x, y), radius, facecolor=face, edgecolor=INK.light, lw=1.4, zorder=4, path_effects=rims)
        )
        axes.plot(
            x, y, "o" if name == "start" else "X", color=INK.light, ms=4 if name == "start" else 6, zorder=5
        )
        if motion is not None and radius > 0.0:
            heading = motion.heading[row]
            axes.plot(
                [x, x + radius * math.cos(heading)],
                [y, y + radius * math.sin(heading)],
                color=INK.light,
                lw=1.4,
                zorder=5,
            )
    pixels = np.ptp(axes.transData.transform([[0.0, 0.0], [radius, 0.0]])[:, 0])
    ends = [("start", problem.start.point), ("goal", problem.goal.point)]
    label_points(
        axes, ends, math.sqrt(0.5) * pixels + 3.0, [] if motion is None else [Curve(x=motion.x, y=motion.y)]
    )
