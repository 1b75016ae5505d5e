"""Bokeh's models of the linked views: what they look like; a script of ours fills and moves them.

Colours are those of a light ground; the script turns each into its variable of the palette.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

import matplotlib
import numpy as np
import shapely
from bokeh.core.properties import value
from bokeh.models import ColumnDataSource, LinearColorMapper, Range1d
from bokeh.models.annotations import ColorBar
from bokeh.plotting import figure
from matplotlib.colors import to_hex
from numpy.typing import NDArray

from verify.report.figures_map import BAR_STEPS, MOST_NAMES
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
    RULE,
    SPEED_MAP,
    STRAIGHTENED,
    Dash,
    method,
    rank_tone,
)
from verify.report.text import label
from vnav_drake.problem import Problem
from vnav_drake.world import Obstacle, World

Array = NDArray[np.float64]

FONT = "system-ui, sans-serif"
MAP_PIXELS = 560.0  # about the width of the map on a wide page: where names are judged to meet
LETTER = (7.0, 14.0)  # [px] of the letters there, with the room between them
LETTERS: dict[str, Any] = {"text_font": value(FONT), "text_font_size": "12px"}
WORDS: dict[str, Any] = {
    "text_font": FONT,
    "text_font_size": "12px",
}  # of annotations, where a font is no column
GROUND: dict[str, Any] = {"background_fill_color": PAPER.light, "background_fill_alpha": 0.7}  # below words
OVER: Final = "overlay"  # painted alone when the cursor moves


def new_plot(name: str, x: str, y: str, **more: Any) -> figure:
    """An empty plot that fills its place, without toolbar: the page has controls of its own."""
    plot = figure(
        name=name, sizing_mode="stretch_both", toolbar_location=None, x_axis_label=x, y_axis_label=y,
        tools=more.pop("tools", "pan,wheel_zoom"), active_drag=None, active_scroll=None, active_inspect=None,
        active_tap=None, background_fill_color=PAPER.light, border_fill_color=None,
        outline_line_color=None, min_border=2, **more,
    )  # fmt: skip
    plot.grid.grid_line_color = RULE.light
    for axis in plot.axis:
        axis.update(
            axis_line_color=RULE.light, major_tick_line_color=RULE.light, minor_tick_line_color=None,
            major_label_text_color=MUTED.light, major_label_text_font=FONT,
            major_label_text_font_size="11px", axis_label_text_color=INK.light,
            axis_label_text_font=FONT, axis_label_text_font_size="12px",
            axis_label_text_font_style="normal", axis_label_standoff=4,
        )  # fmt: skip
    return plot


def empty(name: str, *columns: str) -> ColumnDataSource:
    """Columns for the script to fill."""
    return ColumnDataSource(data={column: [] for column in columns}, name=f"{name}-columns")


def dashes(dash: Dash, width: float) -> list[int] | str:
    """A pattern in widths of the line as one in pixels."""
    return "solid" if isinstance(dash, str) else [max(1, round(part * width)) for part in dash[1]]


def map_plot(
    problem: Problem, motions: Mapping[str, ColumnDataSource], executed: str, ranks: Sequence[int], top: float
) -> figure:
    """The world with all that can be laid over it; of `motions` `executed` is coloured."""
    plot = new_plot(
        "map", "x [m]", "y [m]", x_range=Range1d(start=0.0, end=1.0), y_range=Range1d(start=0.0, end=1.0)
    )
    plot.grid.grid_line_color = None
    _world(plot, problem)
    for key, colour, width in (
        ("mesh", RACK_EDGE.light, 0.6),
        ("arcs", ARC.light, 1.0),
        ("graph", method("speed_graph").text, 0.6),
    ):
        _lines(plot, key, colour, width)
    _lines(plot, "stops-held", method("simulation").light, 1.0)
    _lines(plot, "stops-straightened", STRAIGHTENED.light, 1.0, (0, (4, 2)))
    for key, source in motions.items():
        if key.startswith("plan-") and key != executed:
            look = method(key.removeprefix("plan-"))
            plot.line(
                "x", "y", source=source, name=key, line_color=look.light, line_width=2, visible=False,
                line_dash=dashes(look.dash, 2), line_cap="butt",
            )  # fmt: skip
    for rank in reversed(ranks):
        plot.line(
            "x", "y", source=motions[f"class-{rank}"], name=f"class-{rank}", visible=False,
            line_color=rank_tone(rank).light, line_width=2.0 + 1.6 * (rank - 1),
        )  # fmt: skip
    mapper = _speeds(plot, motions[executed], executed, top)
    _lines(plot, "stops-bad", LIMIT.light, 2.6)
    plot.scatter(
        "x", "y", source=empty("bad-places", "x", "y"), name="stops-bad-places", marker="x", size=11,
        fill_color=None, line_color=LIMIT.light, line_width=3, visible=False,
    )  # fmt: skip
    _ends(plot, problem)
    _cursor(plot, problem)
    bar = ColorBar(
        color_mapper=mapper, orientation="horizontal", height=7, title="speed [m/s]", padding=3,
        background_fill_color=None, bar_line_color=None, major_tick_line_color=None, title_standoff=2,
        title_text_font=FONT, title_text_font_size="12px", title_text_font_style="normal",
        title_text_color=INK.light, major_label_text_color=MUTED.light, label_standoff=3,
        major_label_text_font=FONT, major_label_text_font_size="11px",
    )  # fmt: skip
    plot.add_layout(bar, "above")
    _scale_bar(plot, problem.world)
    return plot


def _world(plot: figure, problem: Problem) -> None:
    world = problem.world
    plot.multi_polygons(
        xs=[[_ring(world.boundary, 0)]], ys=[[_ring(world.boundary, 1)]],
        fill_color=FLOOR.light, line_color=INK.light, line_width=1.5,
    )  # fmt: skip
    plot.multi_polygons(
        xs=[[_ring(polygon, 0)] for polygon in world.blocked],
        ys=[[_ring(polygon, 1)] for polygon in world.blocked],
        fill_color=RACK.light, line_color=RACK_EDGE.light, line_width=1,
    )  # fmt: skip
    if len(world.walls):
        (x0, y0), (x1, y1) = np.moveaxis(np.asarray(world.walls), 0, -1)
        plot.segment(x0=x0, y0=y0, x1=x1, y1=y1, line_color=INK.light, line_width=2.5)
    if len(world.isolated):
        x, y = world.vertices[world.isolated].T
        plot.scatter(x=x, y=y, size=6, marker="circle", fill_color=INK.light, line_color=None)
    # a wall's name stands beside it
    named = [o for o in world.obstacles if label(o.name)]
    named = clear_names(named, problem) if len(named) <= MOST_NAMES else []
    if named:
        middles = np.array([_middle(np.array(o.vertices)) for o in named])
        plot.text(
            x=middles[:, 0], y=middles[:, 1], text=[label(o.name) for o in named], name="names",
            x_offset=[0 if len(o.vertices) > 2 else 5 for o in named], **LETTERS,
            y_offset=[0 if len(o.vertices) > 2 else -9 for o in named],
            text_align=["center" if len(o.vertices) > 2 else "left" for o in named],
            text_baseline="middle", text_color=MUTED.light,
        )  # fmt: skip


def clear_names(named: Sequence[Obstacle], problem: Problem) -> list[Obstacle]:
    """Those whose names stand clear of "start" and "goal" and of each other; of two that meet the larger."""
    x0, _, x1, _ = problem.world.bounds
    pixel = (x1 - x0) / MAP_PIXELS  # [m]
    ends = ((problem.start.point, "start"), (problem.goal.point, "goal"))
    taken = [
        shapely.box(x, y, x + pixel * (9 + LETTER[0] * len(word)), y + pixel * (7 + LETTER[1]))
        for (x, y), word in ends
    ]
    kept = []
    for obstacle in sorted(named, key=lambda o: -float(np.ptp(np.array(o.vertices), axis=0).max())):
        (x, y), wide = _middle(np.array(obstacle.vertices)), pixel * LETTER[0] * len(label(obstacle.name))
        x, y = (x - 0.5 * wide, y) if len(obstacle.vertices) > 2 else (x + 5 * pixel, y + 9 * pixel)
        half = 0.5 * pixel * LETTER[1]
        place = shapely.box(x, y - half, x + wide, y + half)
        if not shapely.intersects(place, taken).any():
            taken.append(place)
            kept.append(obstacle)
    return kept


def _scale_bar(plot: figure, world: World) -> None:
    """A round length above the world, in its own scale: it grows when one comes closer."""
    x0, y0, x1, y1 = world.bounds
    power = 10.0 ** math.floor(math.log10((x1 - x0) / 4.0))
    length = max(step * power for step in (1.0, 2.0, 5.0) if step * power <= (x1 - x0) / 4.0)
    y = y1 + 0.03 * max(x1 - x0, y1 - y0)
    plot.segment(x0=x0, y0=y, x1=x0 + length, y1=y, line_color=INK.light, line_width=2.5)
    plot.text(
        x=[x0 + length], y=[y], text=[f"{length:g} m"], x_offset=6, text_baseline="middle",
        text_color=INK.light, **LETTERS,
    )  # fmt: skip


def _ring(polygon: shapely.Polygon, axis: int) -> list[list[float]]:
    """Coordinates of the outer ring and of the holes, without the last point, which repeats the first."""
    rings = [polygon.exterior, *polygon.interiors]
    return [np.asarray(ring.coords)[:-1, axis].tolist() for ring in rings]


def _middle(corners: Array) -> Array:
    if len(corners) <= 4:
        return np.asarray(corners.mean(axis=0))
    return np.asarray(shapely.get_coordinates(shapely.Polygon(corners).representative_point())[0])


def _lines(plot: figure, key: str, colour: str, width: float, dash: Dash = "solid") -> None:
    plot.multi_line(
        "xs", "ys", source=empty(f"lines-{key}", "xs", "ys"), name=key, line_color=colour, line_width=width,
        line_dash=dashes(dash, 1), line_alpha=0.6 if key == "mesh" else 1.0, visible=False,
    )  # fmt: skip


def _speeds(plot: figure, source: ColumnDataSource, key: str, top: float) -> LinearColorMapper:
    """The path in pieces coloured by speed, with a thin rim that lifts every colour off every ground."""
    steps = matplotlib.colormaps[SPEED_MAP].resampled(BAR_STEPS)
    palette = [to_hex(steps(k)) for k in range(BAR_STEPS)]
    mapper = LinearColorMapper(palette=palette, low=0.0, high=top)
    plot.line(
        "x", "y", source=source, name=key, line_color=CASING.light, line_width=6.4, line_cap="round",
        line_join="round",
    )  # fmt: skip
    plot.segment(
        "x0", "y0", "x1", "y1", source=empty("pieces", "x0", "y0", "x1", "y1", "v"), name="pieces",
        line_color={"field": "v", "transform": mapper}, line_width=4.4, line_cap="round",
    )  # fmt: skip
    return mapper


def _ends(plot: figure, problem: Problem) -> None:
    points = np.array([problem.start.point, problem.goal.point])
    if problem.robot.radius > 0.0:
        plot.circle(
            x=points[:, 0], y=points[:, 1], radius=problem.robot.radius, fill_color=None,
            line_color=INK.light, line_width=1.4,
        )  # fmt: skip
    plot.scatter(
        x=points[:, 0], y=points[:, 1], marker=["circle", "x"], size=[6, 9], fill_color=INK.light,
        line_color=INK.light, line_width=2,
    )  # fmt: skip
    words = plot.text(
        x=points[:, 0], y=points[:, 1], text=["start", "goal"], x_offset=9, y_offset=-7,
        text_color=INK.light, text_font_style="bold", **LETTERS,
    )  # fmt: skip
    words.glyph.update(**GROUND)


def _cursor(plot: figure, problem: Problem) -> None:
    """The robot at the instant: its disc, heading, what it needs to stop in, and what is nearest."""
    radius = problem.robot.radius
    plot.patch(
        "x", "y", source=empty("disc", "x", "y"), name="disc", fill_color=LIMIT.light, fill_alpha=0.14,
        line_color=LIMIT.light, line_width=1.8, line_dash=[6, 3], level=OVER,
    )  # fmt: skip
    plot.segment(
        "x0", "y0", "x1", "y1", source=empty("nearest", "x0", "y0", "x1", "y1"), name="nearest",
        line_color=LIMIT.light, line_width=1.2, level=OVER,
    )  # fmt: skip
    plot.scatter(
        "x", "y", source=empty("beside", "x", "y", "colour"), name="beside", size=11, marker="circle",
        fill_color="colour", line_color=PAPER.light, line_width=1.5, level=OVER,
    )  # fmt: skip
    robot = empty("robot", "x", "y", "x1", "y1")
    if radius > 0.0:
        plot.circle(
            "x", "y", radius=radius, source=robot, fill_color=PAPER.light, fill_alpha=0.85,
            line_color=INK.light, line_width=2, level=OVER,
        )  # fmt: skip
    plot.scatter(
        "x", "y", source=robot, size=7 if radius > 0.0 else 11, marker="circle", fill_color=INK.light,
        line_color=PAPER.light, level=OVER,
    )  # fmt: skip
    plot.segment("x", "y", "x1", "y1", source=robot, line_color=INK.light, line_width=2.4, level=OVER)


def heading_length(problem: Problem) -> float:
    """[m] of the stroke that points along the motion: the disc's radius, of a point a little of the world."""
    return problem.robot.radius or 0.02 * problem.world.diameter
