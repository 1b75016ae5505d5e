"""The braking zone: its shape at some speeds, and where it was along the motion."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.patches import Circle, Polygon
from numpy.typing import NDArray

from verify.report.curves import halo
from verify.report.figures_map import draw_ends, draw_world, map_height, window_around, window_height
from verify.report.palette import CASING, HOLDING, INK, LIMIT, MUTED, method
from verify.report.series import thinned_path
from verify.report.speed_scale import speed_colours
from verify.report.svg import WIDE, Picture, arrange, both_widths, new_axes, to_svg
from verify.report.zone_along import KEYS, LIMITS, ZoneAlong, arc_points, gauge_of, held_arc_length, placed
from vnav_drake.plan import Trajectory
from vnav_drake.problem import Problem
from vnav_drake.zones.convex_zone import ConvexZone
from vnav_drake.zones.field_set import FieldSet
from vnav_drake.zones.held_arc import greatest_turn

Array = NDArray[np.float64]
Frame = Mapping[str, Sequence[float]]  # pixel = offset + factor * value, for x and y; see `frame_of`

SHARES = (0.25, 0.5, 0.75, 1.0)  # of the top speed: the zones drawn one in the other
MOMENTS = 16  # instants whose zone stands on the map
LABEL_SIDE = np.array([0.8, -0.6])  # where outlines are labelled: ahead to the right
DASHED, DOTTED = (0, (5, 2)), (0, (1.4, 1.8))


@dataclass(frozen=True, kw_only=True)
class ShapeData:
    """A zone at rising speeds, and what a stop from the highest one needs."""

    problem: Problem
    zone: ConvexZone
    top: float  # [m/s]

    @property
    def speeds(self) -> list[float]:
        """[m/s], rising."""
        if isinstance(self.zone, FieldSet):
            return [float(v) for v in self.zone.max_speeds]
        return [share * self.top for share in SHARES]

    @property
    def sharpest(self) -> float:
        """Greatest curvature [1/m] allowed at the top speed."""
        robot, v = self.problem.robot, self.top
        bend = min(self.problem.lateral_limit / (v * v), robot.max_curvature)
        shape = gauge_of(self.zone)
        if self.problem.friction_reserve and shape is not None:
            far = float(shape.law.distance(v)) - shape.law.margin
            bend = min(bend, greatest_turn(shape, far) / far) if far > 0.0 else bend
        return bend


def draw_shape(data: ShapeData) -> Picture:
    """The zone at some speeds in the robot's frame, with the straight stop and the stop in a bend."""
    v, bend = data.speeds[-1], data.sharpest
    held = held_arc_length(data.problem, v, bend)
    steps = ", ".join(f"{speed:.2f}" for speed in data.speeds)
    sized = data.problem.robot.radius > 0.0
    ends = "end where the dashed discs are" if sized else "end where the lines end"
    described = {
        "key": "zone-shape",
        "title": "The braking zone at some speeds",
        "description": f"Outlines of the zone around the robot at {steps} m/s, one in the other, the robot "
        f"driving to the right. A straight stop from {v:.2f} m/s and one with the steering held at the "
        f"greatest curvature allowed there, {bend:.3g} 1/m, {held:.2f} m long, {ends}.",
    }
    shown = "Dashed discs: the robot where" if sized else "The lines end where"
    braking = (
        "with the friction in reserve it brakes as hard as on the straight"
        if data.problem.friction_reserve
        else "without friction in reserve turning takes from braking"
    )
    caption = (
        f"The robot drives to the right. Filled: what must be free at {steps} m/s. {shown} a straight stop "
        f"from {v:.2f} m/s ends, and where a stop with the steering held ends, at the greatest curvature "
        f"that is allowed at this speed ({bend:.3g} 1/m): {braking}. Dotted: the disc of uniform braking at "
        "the same speed."
    )
    return both_widths(partial(_shape, data), described, caption=caption)


def _shape(data: ShapeData, described: dict[str, str], width: float) -> Markup:
    problem, zone, v = data.problem, data.zone, data.speeds[-1]
    outlines = [zone.outline(speed, 240) for speed in data.speeds]
    disc = problem.robot.radius + float(problem.braking.distance(v))
    ends = [arc_points(held_arc_length(problem, v, k), k) for k in (-data.sharpest, 0.0, data.sharpest)]
    shown = np.concatenate([*outlines, *ends])
    low, high = shown.min(axis=0), shown.max(axis=0)
    pad = 0.06 * float((high - low).max())
    low, high = low - pad, high + pad
    tall = (width - 60.0) * float((high[1] - low[1]) / (high[0] - low[0]))
    figure, axes = new_axes(width, float(np.clip(tall, 0.22 * width, 0.62 * width)) + 50.0, x="ahead [m]",
                            y="to the left [m]")  # fmt: skip
    axes.set_aspect("equal")
    axes.grid(False)
    shades = speed_colours(np.array(data.speeds), max(data.top, v))
    for outline, shade in zip(reversed(outlines), reversed(shades.tolist()), strict=True):
        axes.add_patch(Polygon(outline, closed=True, fc=(*shade, 0.42), ec="none"))
        axes.add_patch(Polygon(outline, closed=True, fill=False, ec=INK.light, lw=0.9))
    axes.add_patch(Circle((0, 0), disc, fill=False, ec=method("uniform").light, ls=DOTTED, lw=1.5))
    for arc in ends:
        axes.plot(*arc.T, color=LIMIT.light, lw=1.8)
        axes.add_patch(Circle(tuple(arc[-1]), problem.robot.radius, fill=False, ec=LIMIT.light, ls=DASHED))
    axes.add_patch(Circle((0, 0), problem.robot.radius, fc=CASING.light, ec=INK.light))
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    named = list(zip(outlines, data.speeds, strict=True))
    for outline, speed in named if width == WIDE else named[-1:]:
        words = f"{speed:.2f}" + (" m/s" if width == WIDE else "")
        place = outline[np.argmax(outline @ LABEL_SIDE)]
        text = axes.annotate(words, tuple(place), (-3, 3), textcoords="offset points", ha="right", fontsize=9)
        halo(text)
    return to_svg(figure, **described)


@dataclass(frozen=True, kw_only=True)
class ZoneMapData:
    """The zone along the motion, on the map."""

    problem: Problem
    along: ZoneAlong
    uniform: Trajectory | None  # the same robot with uniform braking, to compare with
    subject: str  # what the motion is called


def draw_zone_map(data: ZoneMapData) -> tuple[Picture, dict[str, Frame]]:
    """Zones at even steps of time on the map, in the colour of what holds the motion; where axes lie."""
    along = data.along
    held = ", ".join(LIMITS[KEYS[k]] for k in np.unique(along.limit))
    described = {
        "key": "zone-map",
        "title": "The braking zone along the motion",
        "description": f"The {data.subject} on the map with the outline of its braking zone at "
        f"{len(along.moments(MOMENTS))} instants, coloured by what holds its speed there: {held}.",
    }
    return framed(partial(_map, data), described)


def _map(data: ZoneMapData, described: dict[str, str], width: float) -> tuple[Markup, Frame]:
    world, along, wide = data.problem.world, data.along, width == WIDE
    figure, axes = new_axes(width, map_height(world, width, bar=False), x="x [m]", y="y [m]")
    draw_world(axes, world, names=False)
    if data.uniform is not None:
        look, motion = method("uniform"), data.uniform
        way = thinned_path(motion.x, motion.y, world.diameter)
        axes.plot(*way, color=look.light, lw=1.4 if wide else 1.0, ls=look.dash, dash_capstyle="butt")
    moments = along.moments(MOMENTS if wide else MOMENTS // 2 + 1)
    colours = [HOLDING[KEYS[k]].light for k in along.limit[moments]]
    outlines = [along.outline(int(i)) for i in moments]
    fill = [(*_rgb(colour), 0.16) for colour in colours]
    axes.add_collection(PolyCollection(outlines, facecolors=fill, edgecolors="none", zorder=1.5))
    axes.add_collection(
        PolyCollection(outlines, facecolors="none", edgecolors=colours, linewidths=1.1, zorder=1.6)
    )
    draw_holding(axes, along, 3.6 if wide else 2.6)
    draw_ends(axes, data.problem, data.uniform, filled=False)
    arrange(figure)
    return to_svg(figure, **described), frame_of(axes)


def draw_holding(axes: Axes, along: ZoneAlong, width: float) -> None:
    """The path coloured by what holds the motion."""
    points = np.column_stack([along.x, along.y])
    axes.plot(*points.T, color=CASING.light, lw=width + 1.4, zorder=2.9)
    for first, last in runs(along.limit):
        some = points[first : min(last + 2, len(points))]
        colour = HOLDING[KEYS[along.limit[first]]].light
        axes.plot(*some.T, color=colour, lw=width, zorder=3, solid_capstyle="butt")


def runs(values: NDArray[np.int64]) -> list[tuple[int, int]]:
    """First and last index of each stretch of equal values."""
    change = np.flatnonzero(np.diff(values)) + 1
    first = np.concatenate([[0], change])
    last = np.concatenate([change - 1, [len(values) - 1]])
    return [(int(a), int(b)) for a, b in zip(first, last, strict=True)]


def framed(
    draw: Callable[[dict[str, str], float], tuple[Markup, Frame]], described: dict[str, str]
) -> tuple[Picture, dict[str, Frame]]:
    """A picture for wide and for small screens, and where the axes of both lie, by key."""
    frames: dict[str, Frame] = {}

    def kept(told: dict[str, str], width: float) -> Markup:
        svg, frames[told["key"]] = draw(told, width)
        return svg

    return both_widths(kept, described), frames


def frame_of(axes: Axes) -> Frame:
    """How numbers become pixels of the picture, once everything is in its place: for the page's viewer."""
    box = axes.figure.figure.bbox
    origin, unit = axes.transData.transform([[0.0, 0.0], [1.0, 1.0]])
    area = axes.get_window_extent()
    return {
        "x": [float(origin[0]), float(unit[0] - origin[0])],
        "y": [float(box.height - origin[1]), float(origin[1] - unit[1])],
        "top": [float(box.height - area.y1), float(box.height - area.y0)],
        "side": [float(area.x0), float(area.x1)],
    }


@dataclass(frozen=True, kw_only=True)
class HeldStop:
    """A stop with steering held that the audit of the promise tells of."""

    t: float  # [s]
    x: float  # [m]
    y: float  # [m]
    heading: float  # [rad]
    v: float  # [m/s]
    curvature: float  # [1/m]
    depth: float  # [m], into an obstacle; zero or less where it only leaves the zone


def draw_promise(problem: Problem, along: ZoneAlong, stops: Sequence[HeldStop]) -> Picture:
    """Where stops with the steering held leave the zone or collide: arcs, the robot at their ends."""
    hits, sized = sum(stop.depth > 0.0 for stop in stops), problem.robot.radius > 0.0
    described = {
        "key": "zone-promise",
        "title": "Stops with steering held that break the promise",
        "description": f"{len(stops)} stops with the steering held as arcs on the map, {hits} of them end "
        f"in an obstacle{'; each with the disc of the robot at its end' if sized else ''}.",
    }
    return both_widths(partial(_promise, problem, along, stops), described)


def _promise(
    problem: Problem, along: ZoneAlong, stops: Sequence[HeldStop], described: dict[str, str], width: float
) -> Markup:
    world = problem.world
    lines = [
        placed(
            arc_points(held_arc_length(problem, stop.v, stop.curvature), stop.curvature),
            (stop.x, stop.y),
            stop.heading,
        )
        for stop in stops
    ]
    window = window_around(world, *np.concatenate(lines).T)
    height = map_height(world, width, bar=False) if window is None else window_height(window, width)
    figure, axes = new_axes(width, height, x="x [m]", y="y [m]")
    draw_world(axes, world, names=False, scale=window is None)
    if window is not None:
        axes.set_xlim(window[0], window[2])
        axes.set_ylim(window[1], window[3])
    axes.plot(*thinned_path(along.x, along.y, world.diameter), color=CASING.light, lw=1.3)
    for stop, arc in zip(stops, lines, strict=True):
        colour = LIMIT.light if stop.depth > 0.0 else MUTED.light
        axes.add_patch(Circle(tuple(arc[-1]), problem.robot.radius, fill=False, ec=colour, lw=1.0, zorder=4))
    colours = [LIMIT.light if stop.depth > 0.0 else MUTED.light for stop in stops]
    axes.add_collection(LineCollection(lines, colors=colours, linewidths=1.6, zorder=4))
    worst = max(stops, key=lambda stop: stop.depth)
    claimed = placed(along.zone.outline(worst.v, 240), (worst.x, worst.y), worst.heading)
    axes.add_patch(Polygon(claimed, closed=True, fill=False, ec=INK.light, ls=DASHED, lw=1.2, zorder=5))
    return to_svg(figure, **described)


def _rgb(colour: str) -> tuple[float, float, float]:
    red, green, blue = (int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5))
    return red, green, blue
