"""The figure of docs/field_sets.md: `python -m benchmarks.figures_fields [DIRECTORY]`.

The scenario `warehouse_field` with a stronger drive, planned with its base zone.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from benchmarks.collocation import CORNER
from benchmarks.figures import BLUE, INK, ORANGE, ROOT, STYLE
from vnav_drake.collocation import plan_full
from vnav_drake.field_fitting import FieldRun, drive_fields, fit_fields, steady_limits
from vnav_drake.plan import Path as Way
from vnav_drake.plan import Trajectory
from vnav_drake.problem import Problem
from vnav_drake.scenario import load_scenario

COUNT = 4
DRIVE = 1.0  # [m/s^2], twice the scenario's, so that it is the fields that hold the robot back
SAMPLES = 600  # of a curve
SHADES = ("#08306b", "#2171b5", "#6baed6", "#c6dbef")  # from the least field to the largest


def planned(problem: Problem) -> Trajectory:
    """The motion with the base zone."""
    return plan_full(problem, Way.polyline(CORNER), effort="quick").trajectory


def picture(problem: Problem, plan: Trajectory, run: FieldRun) -> Figure:
    """The fields, and the speed that they allow along the way."""
    figure = Figure(figsize=(7.6, 2.9), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1.0, 1.9))
    fields = run.field_set
    cases = list(enumerate(zip(fields.max_speeds, SHADES, strict=False)))
    for case, (speed, shade) in reversed(cases):
        corners = fields.polygon(case)
        left.fill(*corners.T, color=shade, lw=0.8, ec="white")
        ahead, lower = corners[:, 0].max(), -0.9 - 0.8 * case
        left.plot([ahead, ahead], [0.0, lower], color=shade, lw=0.8)
        left.text(ahead, lower, f"{speed:.2f} m/s", ha="right", va="top", fontsize=8, color=INK)
    left.add_patch(Circle((0.0, 0.0), problem.robot.radius, fill=False, ec=ORANGE, lw=1.6))
    left.set(aspect="equal", xlabel="x, ahead [m]", ylabel="y [m]", title="Fields")
    rows, allowed = steady_limits(problem, plan)
    s = np.concatenate([[0.0], np.cumsum(rows.piece_length)])
    top = min(problem.braking.max_speed, 1.1 * float(plan.v.max()))
    for motion, colour, style in ((plan, INK, "--"), (run.trajectory, BLUE, "-")):
        even = np.linspace(0.0, motion.length, SAMPLES)
        v = np.interp(even, motion.arc_length, motion.v)
        right.plot(even, v, color=colour, lw=1.4, ls=style)
    for speed in fields.max_speeds:
        right.axhline(speed, color="#bbbbbb", lw=0.6, zorder=0)
    blocked = np.minimum(allowed, top)
    even = np.linspace(0.0, s[-1], SAMPLES)
    least = np.interp(even, 0.5 * (s[1:] + s[:-1]), blocked)
    right.fill_between(even, least, 1.08 * top, color="#eeeeee", lw=0)
    right.set(xlabel="way [m]", ylabel="speed [m/s]", xlim=(0.0, s[-1]), ylim=(0.0, 1.08 * top))
    cost = run.trajectory.travel_time / plan.travel_time - 1.0
    right.set_title(
        f"With {len(fields.max_speeds)} fields (blue), without (dashed): {100.0 * cost:.1f} % longer"
    )
    return figure


def main(directory: str | None = None) -> None:
    """Write the figure."""
    out = Path(directory) if directory else ROOT / "docs" / "images"
    problem = load_scenario(ROOT / "scenarios" / "warehouse_field.yaml").problem
    problem = replace(problem, robot=replace(problem.robot, max_acceleration=DRIVE))
    plan = planned(problem)
    run = drive_fields(problem, plan, fit_fields(problem, plan, COUNT))
    with mpl.rc_context(STYLE):
        picture(problem, plan, run).savefig(out / "field_sets.svg", metadata={"Date": None})


if __name__ == "__main__":
    main(*sys.argv[1:2])
