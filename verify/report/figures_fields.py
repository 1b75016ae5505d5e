"""Fields switched by speed: their outlines, and which is watched where."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from verify.report.curves import label_points
from verify.report.figures_map import draw_ends, draw_world, map_height
from verify.report.numbers import number_in
from verify.report.palette import CASING, INK, rank_tone
from verify.report.series import thinned_path
from verify.report.story import entries
from verify.report.svg import WIDE, Picture, arrange, both_widths, new_axes, to_svg
from verify.report.zone_along import ZoneAlong
from vnav_drake.problem import Problem

Array = NDArray[np.float64]

MOST_NAMED = 40  # switches with a number at them: more are noise


def draw_fields(problem: Problem, along: ZoneAlong, fields: Mapping[str, Any]) -> Sequence[Picture]:
    """The switches on the map: the path in the shade of the field that is watched, numbers where it "
    "changes."""
    changes = [item for item in entries(fields, "switches") if number_in(item, "s") != 0.0]  # but the start
    rows = [[number_in(item, key) for key in ("case", "x", "y")] for item in changes]
    switches = [(int(row[0] or 0), row[1] or 0.0, row[2] or 0.0) for row in rows if None not in row]
    speeds = np.array([number_in(item, "max_speed") or 0.0 for item in entries(fields, "cases")])
    if not len(speeds):
        return []
    described = {
        "key": "zone-fields",
        "title": "Fields watched along the motion",
        "description": f"The path in the shade of the one of {len(speeds)} fields that is watched, darker "
        "for "
        f"faster ones; {len(switches)} dots where the field is switched, with the number of the new one.",
    }
    caption = "Shade: the field that is watched. A dot where it is switched, with the number of the new one."
    return [both_widths(partial(_switches, problem, along, speeds, switches), described, caption=caption)]


def _switches(
    problem: Problem, along: ZoneAlong, speeds: Array, switches: Sequence[tuple[int, float, float]],
    described: dict[str, str], width: float,
) -> Markup:  # fmt: skip
    world, wide = problem.world, width == WIDE
    figure, axes = new_axes(width, map_height(world, width, bar=False), x="x [m]", y="y [m]")
    draw_world(axes, world, names=False)
    points = np.column_stack([along.x, along.y])
    axes.plot(*thinned_path(along.x, along.y, world.diameter), color=CASING.light, lw=5.4 if wide else 4.2)
    case = np.minimum(np.searchsorted(speeds, along.v - 1e-9), len(speeds) - 1)
    for first, last in _pieces(case):
        rank = len(speeds) - int(case[first])
        some = points[first : last + 2]
        axes.plot(
            *some.T, color=rank_tone(rank).light, lw=4.0 if wide else 3.0, solid_capstyle="butt", zorder=3
        )
    draw_ends(axes, problem, None, filled=False)
    places = np.array([place for _, *place in switches]).reshape(-1, 2)
    axes.plot(*places.T, "o", ms=5, mfc=INK.light, mec=CASING.light, zorder=5)
    if wide and len(switches) <= MOST_NAMED:
        arrange(figure)
        label_points(axes, [(str(number), np.array(place)) for number, *place in switches], 5.0, [])
    return to_svg(figure, **described)


def _pieces(case: NDArray[np.int64]) -> list[tuple[int, int]]:
    change = np.flatnonzero(np.diff(case)) + 1
    return list(zip([0, *change.tolist()], [*(change - 1).tolist(), len(case) - 1], strict=True))
