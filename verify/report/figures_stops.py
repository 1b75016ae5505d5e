"""The emergency stops: where they end, how far they go, how near they come."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from verify.report.curves import Curve, halo, label_points
from verify.report.evidence import SimulatedRun
from verify.report.figures_map import draw_ends, draw_world, map_height, window_around, window_height
from verify.report.numbers import significant, with_unit
from verify.report.palette import CASING, INK, LIMIT, PAPER, STRAIGHTENED, method
from verify.report.series import thinned_path
from verify.report.stops import LEAST_CLAIM, StopPaths
from verify.report.story_stops import FailedStop
from verify.report.svg import PANEL, WIDE, Picture, arrange, both_widths, drawing_style, new_axes, to_svg
from vnav_drake.plan import Trajectory
from vnav_drake.problem import Problem

Array = NDArray[np.float64]

MOST_NAMED = 6  # groups of failed stops with a label: more are noise, the table has them all
LABEL_ROOM = (110.0, 22.0)  # [px] across and along: nearer than that, two labels touch
DASHED = (0, (3.5, 1.8))  # wheels straightened


@dataclass(frozen=True, kw_only=True)
class StopsData:
    """The stops, the run they belong to, and those that failed."""

    problem: Problem
    stops: StopPaths
    run: SimulatedRun | None
    executed: Trajectory | None
    failed: Sequence[FailedStop] = ()

    @cached_property
    def nearest(self) -> tuple[Array, NDArray[np.int64]]:
        """(n,) [m] least clearance of each stop, and the row it is in."""
        return self.stops.nearest(self.problem)


def draw_stops_map(data: StopsData) -> Picture:
    """Every stop as a line from its instant; those that failed drawn strong, with their cause."""
    bad = [stop for stop in data.failed if 0 <= stop.index < len(data.stops)]
    least, _ = data.nearest
    described = {
        "key": "stops-map",
        "title": "Emergency stops on the map",
        "description": f"{len(data.stops)} stops drawn from their instants along the driven path; the least "
        f"clearance is {with_unit(float(least.min()), 'm')}, where the ring is. "
        + (f"{len(bad)} failed ones are drawn strong." if bad else "None failed."),
    }
    return both_widths(partial(_map, data, bad), described)


def _map(data: StopsData, bad: Sequence[FailedStop], described: dict[str, str], width: float) -> Markup:
    world, wide = data.problem.world, width == WIDE
    window = window_around(world, data.stops.x, data.stops.y)
    height = map_height(world, width, bar=False) if window is None else window_height(window, width)
    figure, axes = new_axes(width, height, x="x [m]", y="y [m]")
    draw_world(axes, world, names=wide and window is None, scale=window is None)
    if window is not None:
        axes.set_xlim(window[0], window[2])
        axes.set_ylim(window[1], window[3])
    size, held = world.diameter, method("simulation")
    lines = [np.column_stack(thinned_path(x, y, size)) for x, y in data.stops.paths()]
    for kind, colour, dash in ((False, held.light, "solid"), (True, STRAIGHTENED.light, DASHED)):
        some = [
            line for line, straight in zip(lines, data.stops.straightened, strict=True) if straight == kind
        ]
        if some:
            broken = np.concatenate([part for line in some for part in (line, [[np.nan, np.nan]])])
            axes.plot(*broken.T, color=colour, lw=1.1 if wide else 0.8, ls=dash, dash_capstyle="butt")
    if data.run is not None:
        axes.plot(*thinned_path(data.run.x, data.run.y, size), color=CASING.light, lw=1.0)
    for stop in bad:
        dash = DASHED if data.stops.straightened[stop.index] else "solid"
        axes.plot(*lines[stop.index].T, color=LIMIT.light, lw=2.6 if wide else 2.0, ls=dash, zorder=4)
    draw_ends(axes, data.problem, data.executed, filled=False)
    _nearest(axes, data)
    places = [np.array(stop.place or lines[stop.index][-1], dtype=float) for stop in bad]
    for place in places:
        axes.plot(*place, "X", ms=9, mfc=LIMIT.light, mec=PAPER.light, mew=1.0, zorder=6)
    if wide and bad:
        arrange(figure)
        pixels = axes.transData.transform(places)
        named = [
            (stop.cause_word if len(group) == 1 else f"{len(group)} × {stop.cause_word}", places[group[0]])
            for group in neighbours(pixels, [stop.cause for stop in bad])[:MOST_NAMED]
            for stop in (bad[group[0]],)
        ]
        driven = [Curve(x=line[:, 0], y=line[:, 1]) for line in lines]
        label_points(axes, named, 7.0, driven, LIMIT.light)
    return to_svg(figure, **described)


def neighbours(places: Array, causes: Sequence[str]) -> list[list[int]]:
    """Places (n, 2) [px] of the same cause that hang together, largest group first, in each its middle first.

    Two hang together when their labels would touch; so do chains of such.
    """
    near = np.all(np.abs(places[:, None] - places) < LABEL_ROOM, axis=2)
    same = np.array(causes)[:, None] == np.array(causes)
    count, group = connected_components(near & same, directed=False)
    groups = [np.flatnonzero(group == k) for k in range(count)]
    groups.sort(key=len, reverse=True)
    return [
        own[np.argsort(np.hypot(*(places[own] - places[own].mean(axis=0)).T), kind="stable")].tolist()
        for own in groups
    ]


def _nearest(axes: Axes, data: StopsData) -> None:
    """A ring where a stop comes nearest, with the clearance there."""
    least, row = data.nearest
    i = int(np.argmin(least))
    place = np.array([data.stops.x[row[i]], data.stops.y[row[i]]])
    axes.plot(*place, "o", mfc="none", mec=INK.light, ms=11, mew=1.5, zorder=5)
    driven = [] if data.run is None else [Curve(x=data.run.x, y=data.run.y)]
    label_points(axes, [(with_unit(float(least[i]), "m"), place)], 7.0, driven)


def draw_stop_figures(data: StopsData) -> Sequence[Picture]:
    """Way driven and displacement over the braking distance claimed, and least clearance, by instant.

    The first two only where any stop claims enough to form a ratio.
    """
    stops, problem = data.stops, data.problem
    claimed = stops.claimed(problem.braking)
    moving = claimed >= LEAST_CLAIM
    share = np.where(moving, 1.0, np.nan) / np.where(moving, claimed, 1.0)
    law = "v t_r + v²/(2 a_b)" if problem.braking.reaction_time > 0.0 else "v²/(2 a_b)"
    least, _ = data.nearest
    note = f" Stops that claim less than {LEAST_CLAIM:g} m are left out." if not moving.all() else ""
    with drawing_style():
        ways = [
            _dots(
                data, "stops-distance", "Way driven until it stands", stops.driven * share,
                f"way driven over {law}", (1.0, "braking distance"), note,
            ),
            _dots(
                data, "stops-displacement", "Farthest from where it began", stops.displacement * share,
                f"distance over {law}",
                (1.0, "rim of the braking disc" if problem.zone is None else "stopping distance"), note,
            ),
        ] if moving.any() else []  # fmt: skip
        return [
            *ways,
            _dots(
                data, "stops-clearance", "Least clearance of each stop", least, "clearance [m]",
                (0.0, "touches"), "", unit="m",
            ),
        ]  # fmt: skip


def _dots(
    data: StopsData, key: str, title: str, value: Array, axis: str, limit: tuple[float, str], note: str,
    unit: str = "",
) -> Picture:  # fmt: skip
    stops, held = data.stops, method("simulation")
    figure, axes = new_axes(PANEL, 250, x="instant of the stop [s]", y=axis)
    shown = np.isfinite(value)
    for kind, marker, fill, edge in (
        (False, "o", held.light, held.light),
        (True, "D", "none", STRAIGHTENED.light),
    ):
        some = shown & (stops.straightened == kind)
        t, y, size = stops.instant[some], value[some], 3.4 if kind else 3.8
        axes.plot(t, y, marker, ms=size, mfc=fill, mec=edge, mew=0.9, ls="none")
    bad = [stop.index for stop in data.failed if 0 <= stop.index < len(stops) and shown[stop.index]]
    axes.plot(stops.instant[bad], value[bad], "X", ms=8, mfc=LIMIT.light, mec=PAPER.light, mew=0.8, ls="none")
    axes.axhline(limit[0], color=LIMIT.light, lw=1.4, ls="--")
    known = np.append(value[shown], limit[0])
    low, high = float(known.min()), float(known.max())
    reach = max(high - low, 0.05)
    axes.set_ylim(low - 0.16 * reach, high + 0.16 * reach)
    axes.set_xlim(0.0, max(float(stops.instant[-1]) * 1.02, 1e-3))
    late = shown & (stops.instant > 0.6 * float(stops.instant[-1]))
    apart = 0.02 * reach
    above = np.count_nonzero(value[late] > limit[0] + apart) < np.count_nonzero(
        value[late] < limit[0] - apart
    )
    text = axes.annotate(
        limit[1], (1.0, limit[0]), (-4, 4 if above else -5), xycoords=("axes fraction", "data"),
        textcoords="offset points", color=LIMIT.light, ha="right", va="bottom" if above else "top",
        fontsize=10,
    )  # fmt: skip
    halo(text)
    spoken = _spread(stops, value, unit) + note
    svg = to_svg(figure, key=key, title=title, description=spoken)
    return Picture(key=key, title=title, description=spoken, svg=svg, heading=title, caption=spoken)


def _spread(stops: StopPaths, value: Array, unit: str) -> str:
    """From least to greatest, for both kinds of stops."""
    parts = []
    for kind, name in ((False, "Steering held"), (True, "wheels straightened")):
        some = value[(stops.straightened == kind) & np.isfinite(value)]
        if len(some):
            low, high = float(some.min()), float(some.max())
            words = (
                f"{with_unit(low, unit)} to {with_unit(high, unit)}"
                if unit
                else f"{significant(low, 4)} to {significant(high, 4)}"
            )
            parts.append(f"{name}: {words}")
    return "; ".join(parts) + "." if parts else "No stop to show."
