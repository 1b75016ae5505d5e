"""The simulated run against the plan."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

from verify.report.curves import Curve, label_curves
from verify.report.evidence import SimulatedRun
from verify.report.figures_map import draw_world, map_height
from verify.report.numbers import significant, with_unit
from verify.report.palette import INK, MUTED, method
from verify.report.series import Tracking, thinned, thinned_path, tracking
from verify.report.svg import PANEL, Picture, drawing_style, new_axes, to_svg
from vnav_drake.plan import Trajectory
from vnav_drake.world import World


@dataclass(frozen=True, kw_only=True)
class TrackingData:
    """A plan and the run that followed it."""

    world: World
    plan: Trajectory
    method: str
    run: SimulatedRun


def draw_tracking(data: TrackingData) -> Sequence[Picture]:
    """Lateral error over time, the path with that error exaggerated, speed error, position along the plan."""
    errors = tracking(data.plan, data.run)
    with drawing_style():
        return [
            _overlay(data, errors),
            _error(
                "track-lateral", "Lateral error over time", errors.t, errors.lateral, "left of the plan", "mm"
            ),
            _speeds(data),
            _error(
                "track-speed",
                "Speed error over time",
                errors.t,
                errors.speed_error,
                "faster than planned",
                "mm/s",
            ),
            _error(
                "track-along", "Lead or lag along the plan", errors.t, errors.along, "ahead of the plan", "mm"
            ),
        ]


def _error(key: str, title: str, t: np.ndarray, value: np.ndarray, side: str, unit: str) -> Picture:
    look, scaled = method("simulation"), 1000.0 * value
    worst = int(np.argmax(np.abs(scaled)))
    largest = abs(float(value[worst]))
    size = f"{significant(1000.0 * largest)}\u00a0mm/s" if unit == "mm/s" else with_unit(largest, "m")
    spoken = f"Largest {size} at {t[worst]:.2f} s; positive is {side}."
    figure, axes = new_axes(PANEL, 220, x="time [s]", y=f"error [{unit}]")
    axes.axhline(0.0, color=MUTED.light, lw=1.0)
    axes.plot(*thinned(t, scaled, 220), color=look.light, lw=1.5)
    axes.plot(t[worst], scaled[worst], "o", mfc="none", mec=INK.light, ms=9, mew=1.5, clip_on=False)
    axes.set_xlim(0.0, t[-1])
    reach = max(1.25 * float(np.max(np.abs(scaled))), 0.01)  # a hundredth of a millimetre is nothing
    axes.set_ylim(-reach, reach)
    svg = to_svg(figure, key=key, title=title, description=spoken)
    return Picture(key=key, title=title, description=spoken, svg=svg, heading=title, caption=spoken)


def _speeds(data: TrackingData) -> Picture:
    key, title = "track-speeds", "Speed, planned and simulated"
    spoken = (
        f"The plan ends after {data.plan.t[-1]:.3f} s, the record of the run after {data.run.t[-1]:.3f} s."
    )
    figure, axes = new_axes(PANEL, 220, x="time [s]", y="speed [m/s]")
    look, planned = method("simulation"), method(data.method)
    axes.plot(*thinned(data.plan.t, data.plan.v, 220), color=planned.light, lw=2.6)
    axes.plot(
        *thinned(data.run.t, data.run.v, 220), color=look.light, lw=1.3, ls=look.dash, dash_capstyle="butt"
    )
    axes.set_xlim(0.0, max(data.plan.t[-1], data.run.t[-1]))
    axes.set_ylim(0.0, 1.25 * max(float(data.plan.v.max()), float(data.run.v.max())))
    curves = [
        Curve(x=data.plan.t, y=data.plan.v, text="plan", colour=planned.text),
        Curve(x=data.run.t, y=data.run.v, text="simulated", colour=look.text),
    ]
    label_curves(axes, curves)
    svg = to_svg(figure, key=key, title=title, description=spoken)
    return Picture(key=key, title=title, description=spoken, svg=svg, heading=title, caption=spoken)


def _overlay(data: TrackingData, errors: Tracking) -> Picture:
    key, title = "track-map", "Path, lateral error exaggerated"
    worst = float(np.max(np.abs(errors.lateral)))
    factor = _round_down(0.03 * data.world.diameter / worst) if worst > 0.0 else 1.0
    factor = max(factor, 1.0)
    figure, axes = new_axes(PANEL, map_height(data.world, PANEL, bar=False), x="x [m]", y="y [m]")
    draw_world(axes, data.world, names=False)
    size, look, planned = data.world.diameter, method("simulation"), method(data.method)
    plan_line = thinned_path(data.plan.x, data.plan.y, size)
    offset = factor * errors.lateral
    run_line = thinned_path(
        errors.plan_x - offset * np.sin(errors.plan_heading),
        errors.plan_y + offset * np.cos(errors.plan_heading),
        size,
    )
    axes.plot(*plan_line, color=planned.light, lw=1.6)
    axes.plot(*run_line, color=look.light, lw=1.3, ls=look.dash, dash_capstyle="butt")
    _label(axes, [(plan_line, "plan", planned.text), (run_line, "simulated", look.text)])
    spoken = f"The run drawn beside the plan with its lateral error {factor:g} times as large as it was."
    svg = to_svg(figure, key=key, title=title, description=spoken)
    return Picture(key=key, title=title, description=spoken, svg=svg, heading=title, caption=spoken)


def _label(axes: Axes, lines: Sequence[tuple[tuple[np.ndarray, np.ndarray], str, str]]) -> None:
    label_curves(
        axes, [Curve(x=line[0], y=line[1], text=text, colour=colour) for line, text, colour in lines]
    )


def _round_down(value: float) -> float:
    power = 10.0 ** math.floor(math.log10(value))
    return power * max(step for step in (1.0, 2.0, 5.0) if step * power <= value * (1.0 + 1e-12))
