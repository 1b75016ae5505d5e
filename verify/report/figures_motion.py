"""Speed along the way and acceleration in the friction circle."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Rectangle
from numpy.typing import NDArray

from verify.report.curves import Curve, halo, label_curves
from verify.report.palette import INK, LIMIT, MUTED, Dash, method
from verify.report.series import in_steps, row_ends, thinned
from verify.report.svg import PANEL, WIDE, Picture, drawing_style, new_axes, to_svg
from verify.report.zone_along import ZoneAlong
from vnav_drake.plan import Trajectory
from vnav_drake.problem import Problem

Array = NDArray[np.float64]

LIMIT_DASH: Dash = (0, (5, 2))
BEND_DASH: Dash = (0, (1.2, 1.6))


@dataclass(frozen=True, kw_only=True)
class SpeedData:
    """The executed speed and what limits it."""

    problem: Problem
    motion: Trajectory
    plan: str  # method of `motion`
    variational: tuple[str, Trajectory] | None  # method and motion, when it is not the executed one
    over: Literal["path", "time"]
    subject: str = "executed motion"  # what `motion` is called: where nothing is executed, a stand-in
    along: ZoneAlong | None = None  # the zone along `motion` where it is no disc


def draw_speed_curve(data: SpeedData) -> Picture:
    """Speed over path length or over time against the braking limit V(d) and the other limits."""
    over = "path length" if data.over == "path" else "time"
    described = {
        "key": f"speed-{data.over}",
        "title": f"Speed over {over}",
        "description": f"Speed of the {data.subject} over {over}, "
        f"from {data.motion.v[0]:.2f} m/s at the start to {data.motion.v[-1]:.2f} m/s at the goal, "
        f"greatest {data.motion.v.max():.2f} m/s, below the dashed braking limit "
        f"{'V(d)' if data.along is None else 'of the zone at each pose'} along the same path.",
    }
    with drawing_style():
        return Picture(**described, svg=_speed(data, described), narrow=None)


def _speed(data: SpeedData, described: dict[str, str]) -> Markup:
    problem, rows, look = data.problem, row_ends(data.motion), method(data.plan)
    x, unit = (rows.s, "path length [m]") if data.over == "path" else (rows.t, "time [s]")
    figure, axes = new_axes(WIDE, 300, x=unit, y="speed [m/s]")
    t, s, v, clearance = in_steps(data.motion, 4)
    fine, limit = (s if data.over == "path" else t), problem.braking.speed(clearance)
    if data.along is not None:
        limit = np.interp(s, data.along.s, data.along.fastest)
    by = "V(d)" if data.along is None else "by zone"
    top = 1.18 * max(float(v.max()), float(limit.max()) if data.along is None else 0.0)
    curves = []

    def draw(x: Array, y: Array, text: str, colour: str, words: str, dash: Dash, line: float) -> None:
        over = 3 if colour == LIMIT.light else 2  # dashes of a limit stay visible on the motion that meets it
        axes.plot(*thinned(x, y), color=colour, ls=dash, lw=line, dash_capstyle="butt", zorder=over)
        curves.append(Curve(x=x, y=y, text=text, colour=words))

    draw(fine, limit, f"braking limit {by}", LIMIT.light, LIMIT.light, LIMIT_DASH, 1.4)
    bend = _bend_limit(problem, rows.curvature)
    near = bend < top
    if np.any(near):
        dots = _distinct(np.column_stack([x[near] / x[-1], bend[near] / top]), 1.0 / 400.0) * [x[-1], top]
        axes.plot(dots[:, 0], dots[:, 1], "o", color=MUTED.light, ms=2.0, mew=0, zorder=4)
        words = f"{_bend_name(problem)} √(limit/|κ|)"
        curves.append(Curve(x=dots[:, 0], y=dots[:, 1], text=words, colour=MUTED.light))
    if problem.robot.max_speed < top:
        cap = np.full(len(x), problem.robot.max_speed)
        draw(x, cap, "v_max", LIMIT.light, LIMIT.light, LIMIT_DASH, 1.0)
    if data.over == "time" and data.variational is not None:
        name, motion = data.variational
        other = method(name)
        draw(
            motion.t,
            motion.v,
            "variational optimum",
            other.light,
            other.text,
            other.dash,
            1.3,
        )
    draw(fine, v, data.subject.removesuffix(" motion"), look.light, look.text, "solid", 2.2)
    axes.set_xlim(0.0, max(float(c.x[-1]) for c in curves))
    axes.set_ylim(0.0, top)
    axes.locator_params(axis="y", nbins=5)
    label_curves(axes, curves)
    return to_svg(figure, **described)


def _bend_limit(problem: Problem, curvature: Array) -> Array:
    """Greatest speed [m/s] in a bend by sliding, tip-over and friction reserve; infinite on straights."""
    bend = np.abs(curvature)
    square = np.divide(problem.lateral_limit, bend, out=np.full_like(bend, math.inf), where=bend > 0.0)
    return np.sqrt(square)


def _bend_name(problem: Problem) -> str:
    robot = problem.robot
    if problem.friction_reserve and problem.lateral_limit < min(
        robot.friction_acceleration, robot.tip_acceleration
    ):
        return "friction reserve in bends"
    return "tip-over in bends" if robot.tip_acceleration < robot.friction_acceleration else "sliding in bends"


@dataclass(frozen=True, kw_only=True)
class FrictionData:
    """Accelerations of the motions, and the limits of the robot."""

    problem: Problem
    motions: Sequence[tuple[str, Trajectory]]  # (method, motion), the executed one last


def draw_friction(data: FrictionData) -> Sequence[Picture]:
    """Acceleration in the friction circle; a second, closer view where the motion stays far inside."""
    robot = data.problem.robot
    used = max(
        float(np.max(np.hypot(rows.a, rows.lateral))) for rows in (row_ends(m) for _, m in data.motions)
    )
    share = used / robot.friction_acceleration
    near = 1.3 * max(used, robot.max_braking, robot.max_acceleration) / robot.friction_acceleration
    spoken = f"The motions use at most {100.0 * share:.0f} % of the friction."
    pictures = []
    with drawing_style():
        views = [("friction", "The whole friction circle", max(1.15, 1.06 * share))]
        if near < 0.7:
            views.append(("friction-near", "The part that is used", near))
        for key, title, reach in views:
            svg = _circle(data, key, title, spoken, reach, near if key == "friction" and near < 0.7 else None)
            pictures.append(Picture(key=key, title=title, description=spoken, svg=svg, heading=title))
    return pictures


def _circle(
    data: FrictionData, key: str, title: str, spoken: str, reach: float, inset: float | None
) -> Markup:
    robot, mu_g = data.problem.robot, data.problem.robot.friction_acceleration
    figure, axes = new_axes(
        PANEL, PANEL, x="across the path  v²κ / μg   (left turns positive)", y="along the path  a / μg"
    )
    axes.set_aspect("equal")
    axes.set_xlim(-reach, reach)
    axes.set_ylim(-reach, reach)
    axes.axhline(0, color=MUTED.light, lw=0.6)
    axes.axvline(0, color=MUTED.light, lw=0.6)
    for i, (name, motion) in enumerate(data.motions):
        rows, look, last = row_ends(motion), method(name), i == len(data.motions) - 1
        points = np.column_stack([rows.lateral, rows.a]) / mu_g
        kept = _distinct(points, reach / 200.0)
        if last:
            axes.plot(kept[:, 0], kept[:, 1], "o", color=look.light, ms=2.2, mew=0, zorder=3)
        else:
            axes.plot(kept[:, 0], kept[:, 1], "o", mfc="none", mec=look.light, ms=4.2, mew=0.7, zorder=2)
    axes.add_patch(Circle((0, 0), 1.0, fill=False, ec=LIMIT.light, ls=LIMIT_DASH, lw=1.4))
    _note(axes, 0.0, 1.0, f"friction μg = {mu_g:.2f} m/s²", reach)
    if inset is None:
        axes.add_patch(
            Circle((0, 0), robot.max_braking / mu_g, fill=False, ec=MUTED.light, ls=BEND_DASH, lw=1.0)
        )
        for value, text in ((robot.max_acceleration, "drive a_max"), (-robot.max_braking, "brakes −a_b")):
            axes.axhline(value / mu_g, color=LIMIT.light, lw=1.2, ls=LIMIT_DASH)
            _note(
                axes,
                -0.97 * reach,
                value / mu_g,
                f"{text} = {value:.2f} m/s²".replace("-", "−"),
                reach,
                left=True,
            )
    else:
        axes.add_patch(Rectangle((-inset, -inset), 2 * inset, 2 * inset, fill=False, ec=INK.light, lw=0.9))
        axes.text(
            0,
            -inset - 0.03,
            "shown closer beside or below",
            ha="center",
            va="top",
            fontsize=9,
            color=MUTED.light,
        )
    sides = [(robot.tip_acceleration, "tip-over")]
    if data.problem.friction_reserve:
        sides.append((robot.reserved_lateral_acceleration(), "friction reserve"))
    for value, text in sides:
        if value / mu_g < reach:
            for sign in (-1, 1):
                axes.axvline(sign * value / mu_g, color=LIMIT.light, lw=1.2, ls=LIMIT_DASH)
            words = axes.text(
                value / mu_g - 0.02 * reach,
                -0.96 * reach,
                f"{text} {value:.2f} m/s²",
                rotation=90,
                fontsize=9,
                color=LIMIT.light,
                ha="right",
                va="bottom",
            )
            halo(words)
    return to_svg(figure, key=key, title=title, description=spoken)


def _note(axes: Axes, x: float, y: float, text: str, reach: float, *, left: bool = False) -> None:
    if abs(y) < 0.97 * reach:
        note = axes.annotate(
            text,
            (x, y),
            (0, 3),
            textcoords="offset points",
            ha="left" if left else "center",
            va="bottom",
            fontsize=9.5,
            color=LIMIT.light,
        )
        halo(note)


def _distinct(points: Array, step: float) -> Array:
    """One of the points for each grid cell of side `step`: the same dots at a fraction of the size."""
    cell = np.round(points / step).astype(np.int64)
    return points[np.sort(np.unique(cell, axis=0, return_index=True)[1])]
