"""Emergency stops against the braking zone that was claimed at their instants, to draw and to tell."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.patches import Circle, Polygon
from numpy.typing import NDArray

from verify.report.evidence import SimulatedRun
from verify.report.figures_map import draw_world, window_height
from verify.report.numbers import count, number_in, seconds, with_unit
from verify.report.palette import CASING, HOLDING, INK, LIMIT, STRAIGHTENED, method
from verify.report.stops import StopPaths
from verify.report.svg import WIDE, Picture, both_widths, new_axes, to_svg
from verify.report.zone_along import placed
from vnav_drake.problem import Problem
from vnav_drake.zones.convex_zone import ConvexZone

Array = NDArray[np.float64]

DIRECTIONS = 64  # in which a stop is compared with its zone
EVERY = 4  # rows of a stop: the next one and where it ends
AROUND = 0.35  # of the zone's size, shown around it
SLOW = 0.05  # [m/s]: slower than that the course is that of the body


@dataclass(frozen=True, kw_only=True, eq=False)
class ClaimedZones:
    """The zones that stops claim, and how far beyond them the robot's disc comes; (n,) each."""

    zone: ConvexZone
    course: Array  # [rad], of the run at the instant
    speed: Array  # [m/s]
    beyond: Array  # [m], negative inside

    @property
    def worst(self) -> int:
        """Index of the stop that goes furthest beyond, or is nearest to the rim."""
        return int(np.argmax(self.beyond))


def claimed_zones(problem: Problem, zone: ConvexZone, stops: StopPaths, run: SimulatedRun) -> ClaimedZones:
    """The zone of each stop at its instant: place, course and speed of the recorded run."""
    along, across = np.gradient(run.x, run.t), np.gradient(run.y, run.t)
    moving = np.hypot(along, across) > SLOW
    course = np.unwrap(np.where(moving, np.arctan2(across, along), run.heading))
    at, speed = np.interp(stops.instant, run.t, course), stops.speed
    row = np.arange(len(stops.x))
    last = stops.first[1:] - 1
    row = np.unique(np.concatenate([row[::EVERY], stops.begin, last]))
    owner = np.searchsorted(stops.first, row, side="right") - 1
    off_x, off_y = (values[row] - values[stops.begin][owner] for values in (stops.x, stops.y))
    cos, sin = np.cos(at[owner]), np.sin(at[owner])
    ahead, left = cos * off_x + sin * off_y, cos * off_y - sin * off_x
    most = np.full(len(row), -math.inf)
    for angle in np.concatenate([np.linspace(-math.pi, math.pi, DIRECTIONS, endpoint=False), zone.kinks]):
        reach = zone.support(np.full(len(speed), angle), speed)[0]
        np.maximum(most, ahead * math.cos(angle) + left * math.sin(angle) - reach[owner], out=most)
    beyond = np.full(len(speed), -math.inf)
    np.maximum.at(beyond, owner, most + problem.robot.radius)
    return ClaimedZones(zone=zone, course=at, speed=speed, beyond=beyond)


def zone_finding(found: Mapping[str, Any], problem: Problem, claims: ClaimedZones | None) -> list[str]:
    """How many stops leave the zone that they claim, and what that says; `found`: the judge's figures."""
    left, tried = number_in(found, "left_zone"), number_in(found, "tried") or 0.0
    if left is None:
        return []
    worst = number_in(found, "worst_excess")
    if worst is None and claims is not None:
        worst = float(claims.beyond[claims.worst])
    if left == 0.0:
        room = (
            ""
            if worst is None or worst >= 0.0
            else f"; the nearest one keeps {with_unit(-worst, 'm')} to its rim"
        )
        return [f"Every stop ends inside the zone that was claimed at its instant{room}."]
    kinds = [
        f"{count(number)} {words}"
        for key, words in (("held", "with steering held"), ("straightened", "with the wheels straightened"))
        if (number := number_in(found, key, "left_zone"))
    ]
    far = "" if worst is None or worst <= 0.0 else f", by up to {with_unit(worst, 'm')}"
    sentences = [
        f"{count(left)} of {count(tried)} stops leave the zone that was claimed at their instant{far}"
        f"{': ' if kinds else ''}{', '.join(kinds)}."
    ]
    if problem.friction_reserve:
        return [*sentences, "As braking.friction_reserve is asked for, each of them counts as failed."]
    return [
        *sentences,
        "Without the friction reserve nothing is promised about them: what they drive into, no zone has kept "
        "free.",
    ]


def draw_stop_in_zone(problem: Problem, stops: StopPaths, claims: ClaimedZones) -> Sequence[Picture]:
    """The zone claimed at the instant of the stop that goes furthest in it or beyond it."""
    i = claims.worst
    beyond, kind = (
        float(claims.beyond[i]),
        "wheels straightened" if stops.straightened[i] else "steering held",
    )
    whose = "the robot's disc" if problem.robot.radius > 0.0 else "the robot"
    where = "beyond its rim" if beyond > 0.0 else "inside its rim"
    told = (
        f"The stop that goes furthest in the zone that it claims: {seconds(float(stops.instant[i]))}, "
        f"{claims.speed[i]:.2f}\u00a0m/s, {kind}; {whose} stays {with_unit(abs(beyond), 'm')} "
        f"{where}."
    ).replace("stays", "ends" if beyond > 0.0 else "stays")
    described = {"key": "stop-zone", "title": "Worst stop in the zone it claims", "description": told}
    dashed = "; dashed: the robot every quarter of the way" if problem.robot.radius > 0.0 else ""
    caption = f"{told} Filled: the zone claimed{dashed}."
    return [both_widths(partial(_draw, problem, stops, claims), described, caption=caption)]


def _draw(
    problem: Problem, stops: StopPaths, claims: ClaimedZones, described: dict[str, str], width: float
) -> Markup:
    i = claims.worst
    rows = slice(int(stops.first[i]), int(stops.first[i + 1]))
    x, y = stops.x[rows], stops.y[rows]
    outline = placed(
        claims.zone.outline(float(claims.speed[i]), 240), (float(x[0]), float(y[0])), float(claims.course[i])
    )
    radius = problem.robot.radius
    shown = np.concatenate([outline, np.column_stack([x, y])])
    low, high = shown.min(axis=0), shown.max(axis=0)
    pad = AROUND * float((high - low).max())
    low, high = low - pad, high + pad
    height = window_height((*low, *high), 0.8 * width)
    figure, axes = new_axes(width, min(height, 0.62 * WIDE), x="x [m]", y="y [m]")
    draw_world(axes, problem.world, names=False, scale=False)
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    colour = STRAIGHTENED.light if stops.straightened[i] else method("simulation").light
    tone = HOLDING["zone"].light if claims.beyond[i] <= 0.0 else LIMIT.light
    axes.add_patch(Polygon(outline, closed=True, fc=HOLDING["zone"].light, alpha=0.18, ec="none"))
    axes.add_patch(Polygon(outline, closed=True, fill=False, ec=tone, lw=1.6))
    way = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
    for share in np.linspace(0.0, 1.0, 5):
        place = (float(np.interp(share * way[-1], way, x)), float(np.interp(share * way[-1], way, y)))
        dash = "solid" if share in (0.0, 1.0) else (0, (4, 2))
        axes.add_patch(Circle(place, radius, fill=False, ec=CASING.light, lw=1.0, ls=dash))
    axes.plot(x, y, color=colour, lw=2.2)
    axes.plot(x[0], y[0], "o", ms=5, color=INK.light)
    return to_svg(figure, **described)
