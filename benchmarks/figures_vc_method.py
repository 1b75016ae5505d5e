"""The figures of docs/vc_method.md, and its tables: `python -m benchmarks.figures_vc_method [DIRECTORY]`.

Pictures are drawn from what the method computes now; tables are written from docs/data/vc_study.json and
docs/data/vc_speed.json, see `benchmarks.vc_study` and `benchmarks.vc_method`.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray

from benchmarks import vc_method as speed
from benchmarks import vc_study as study
from benchmarks.figures import BLUE, GREEN, INK, ORANGE, RED, ROOT, SKY, STYLE, draw_room
from vnav_drake.problem import Problem
from vnav_drake.scenario import load_scenario
from vnav_drake.vc_method import CellDecomposition, VcResult, vc_method
from vnav_drake.vc_method.profile import ACCELERATE, BOUNDARY, BRAKE, arc_profile
from vnav_drake.voronoi import Curves

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

PAGE = ROOT / "docs" / "vc_method.md"
SPEED = ROOT / "docs" / "data" / "vc_speed.json"
MARKS = "<!-- {}: written by benchmarks.figures_vc_method -->\n", "<!-- end of {} -->\n"
MODES = {BOUNDARY: (BLUE, "on V(d)"), ACCELERATE: (GREEN, "at a_max"), BRAKE: (RED, "at a_b")}
SAMPLES = 41  # of a curve


def critical(result: VcResult, problem: Problem) -> Figure:
    """Voronoi arcs by their speed, with the critical points of both types."""
    figure = Figure(figsize=(4.6, 3.9), layout="constrained")
    axes = figure.subplots()
    draw_room(axes, problem)
    diagram, points = result.decomposition.diagram, result.critical
    curves = diagram.curves.take(diagram.arcs)
    part = np.linspace(0.0, 1.0, SAMPLES)
    u = curves.span[:, :1] + np.diff(curves.span, axis=1) * part
    place = curves.points(u)
    v = problem.braking.speed(curves.distance(u) - problem.robot.radius)
    pieces = np.stack([place[:, :-1], place[:, 1:]], axis=2).reshape(-1, 2, 2)
    lines = LineCollection(list(pieces), cmap="viridis", linewidths=1.8, zorder=2)
    lines.set_array(0.5 * (v[:, :-1] + v[:, 1:]).reshape(-1))
    axes.add_collection(lines)
    figure.colorbar(lines, ax=axes, label="V [m/s]", shrink=0.8)
    for rows, marker, colour in ((points.saddles, "X", RED), (points.maxima, "^", ORANGE)):
        axes.plot(*points.point[rows].T, marker, ms=7, color=colour, mec="white", mew=0.6, zorder=7)
    axes.set_title("Type I (saddles, ×) and Type II (maxima, ▲)")
    axes.set_ylabel("y [m]")
    return figure


def _ways(decomposition: CellDecomposition, stack: int) -> list[tuple[int, Curves]]:
    """From the maximum of a stack down to each of its saddles: row of the saddle, and the curves there."""
    out = []
    for side in np.flatnonzero(decomposition.side_stack == stack):
        corners = decomposition.ascent(int(decomposition.side_corner[side]))[::-1]
        slopes = decomposition.parent_slope[corners[1:]]
        back = decomposition.slope_corners[slopes, 1] == corners[:-1]
        curves = decomposition.slopes.curves.take(slopes).reversed(back)
        out.append((int(decomposition.side_saddle[side]), curves))
    return out


def cells(result: VcResult, problem: Problem) -> Figure:
    """Two stacks unfolded along the ways to their saddles: one of four cells, and the one with the most."""
    decomposition = result.decomposition
    counts = decomposition.cell_count
    four = int(np.flatnonzero(counts == 4)[0])
    other = int(np.flatnonzero(counts != 4)[np.argmax(counts[counts != 4])])
    figure = Figure(figsize=(7.2, 3.0), layout="constrained")
    bottom = 0.9 * decomposition.cell_top[decomposition.first_cell[[four, other]]].min()
    for axes, stack in zip(figure.subplots(1, 2, sharey=True), (four, other), strict=True):
        for k, (row, curves) in enumerate(_ways(decomposition, stack)):
            s, v = _heights(curves, problem)
            colour = (BLUE, GREEN, SKY, ORANGE, INK)[k % 5]
            axes.plot(s, v, color=colour)
            axes.plot([s[-1]] * 2, [0.5 * v[-1], v[-1]], color=colour, lw=1.0, ls="--")
            axes.plot(s[-1], result.critical.speed[row], "X", color=RED, ms=6, mec="white", mew=0.6)
        x = axes.get_xlim()
        for height in decomposition.cell_top[decomposition.cell_stack == stack]:
            axes.axhline(height, color=INK, lw=0.6, ls=":")
        axes.plot(0.0, result.critical.speed[decomposition.maximum[stack]], "^", color=ORANGE, ms=7)
        axes.set(xlim=(0.0, x[1]), ylim=(bottom, None), xlabel="way from the maximum [m]")
        axes.set_title(f"a stack of {counts[stack]} cells; the lowest goes down to v = 0", fontsize=9)
    figure.axes[0].set_ylabel("v [m/s]")
    return figure


def _heights(curves: Curves, problem: Problem) -> tuple[Array, Array]:
    """Arc length [m] along curves end to end, and V [m/s] there."""
    ends = curves.arc_length(curves.span)
    at = ends[:, :1] + np.diff(ends, axis=1) * np.linspace(0.0, 1.0, SAMPLES)
    begin = np.concatenate([[0.0], np.cumsum(curves.length)])[:-1]
    s = begin[:, None] + np.abs(at - ends[:, :1])
    v = problem.braking.speed(curves.distance(curves.at_arc_length(at)) - problem.robot.radius)
    return s.reshape(-1), v.reshape(-1)


def graph(result: VcResult, problem: Problem) -> Figure:
    """The adjacency graph in position-velocity space, with the chain of cells that was chosen."""
    figure = Figure(figsize=(6.0, 4.4), layout="constrained")
    axes: Any = figure.add_subplot(projection="3d")
    drawn, found = result.graph, result.decomposition
    top = np.column_stack([drawn.position, drawn.speed])
    for obstacle in problem.world.obstacles:
        ring = np.array([*obstacle.vertices, obstacle.vertices[0]])
        axes.plot(*ring.T, 0.0, color=INK, lw=1.0, marker="." if len(ring) == 2 else None)
    ring = np.array(problem.world.boundary.exterior.coords)
    axes.plot(*ring.T, 0.0, color=INK, lw=1.0)
    for a, b in drawn.type_b:
        axes.plot(*top[[a, b]].T, color=SKY, lw=1.0)
    for (a, b), saddle in zip(drawn.type_a, drawn.saddle, strict=True):
        middle = np.append(found.critical.point[saddle], found.critical.speed[saddle])
        axes.plot(*np.stack([top[a], middle, top[b]]).T, color=BLUE, lw=0.9)
    axes.plot(*top.T, ".", color=INK, ms=4)
    chain, steps = list(result.route.cells), []
    passed = iter(result.route.saddles)
    for k, cell in enumerate(chain):
        if k and found.cell_stack[cell] != found.cell_stack[chain[k - 1]]:
            saddle = next(passed)
            steps.append(np.append(found.critical.point[saddle], found.critical.speed[saddle]))
        steps.append(top[cell])
    if steps:
        axes.plot(*np.array(steps).T, color=ORANGE, lw=2.5)
    axes.set(xlabel="x [m]", ylabel="y [m]", zlabel="v [m/s]")
    axes.view_init(elev=38.0, azim=-65.0)
    return figure


def profile(result: VcResult, problem: Problem) -> Figure:
    """The route on the map with its rounded corners, and the speed along it."""
    figure = Figure(figsize=(7.2, 3.2), layout="constrained")
    place, along = figure.subplots(1, 2, width_ratios=(1.0, 1.5))
    draw_room(place, problem)
    curves, motion = result.route.curves, result.realisation.trajectory
    part = np.linspace(0.0, 1.0, SAMPLES)
    points = curves.points(curves.span[:, :1] + np.diff(curves.span, axis=1) * part)
    place.plot(*points.reshape(-1, 2).T, color=SKY, lw=3.0, zorder=3)
    place.plot(motion.x, motion.y, color=ORANGE, lw=1.4, zorder=4)
    place.plot(*result.realisation.point.T, ".", color=INK, ms=5, zorder=5)
    place.set_ylabel("y [m]")
    s, v = _heights(curves, problem)
    along.plot(s, v, color=SKY, lw=3.0)
    rows = arc_profile(
        curves,
        np.zeros(len(curves), dtype=np.int64),
        problem.braking,
        problem.robot,
        start_speed=_fixed(problem.start.fixed_speed),
        end_speed=_fixed(problem.goal.fixed_speed),
    )
    for k in range(len(rows.begin)):
        if rows.mode[k] == BOUNDARY:
            x, y = _heights(rows.curves.take([k]), problem)
            x = x + rows.begin[k]
        else:
            x = np.linspace(rows.begin[k], rows.end[k], SAMPLES)
            y = np.sqrt(np.linspace(*rows.square[k], SAMPLES))
        along.plot(x, y, color=MODES[int(rows.mode[k])][0], lw=1.2)
    along.plot(motion.arc_length, motion.v, color=ORANGE, lw=1.2)
    along.set(xlabel="way [m]", ylabel="speed [m/s]", ylim=(0.0, None))
    names = [("V(d) of the arcs", SKY), *((name, colour) for colour, name in MODES.values())]
    for k, (name, colour) in enumerate([*names, ("motion, corners rounded", ORANGE)]):
        along.text(0.25, 0.15 + 0.08 * k, name, color=colour, transform=along.transAxes, fontsize=8)
    return figure


def _fixed(speed: float | None) -> float:
    return np.inf if speed is None else speed


def growth(data: dict[str, Any]) -> Figure:
    """Time of the stages against the number of vertices."""
    figure = Figure(figsize=(4.6, 3.0), layout="constrained")
    axes: Axes = figure.subplots()
    size = [row["vertices"] for row in data["sizes"]]
    stages = (speed.DIAGRAM, *speed.STAGES)
    last = {stage: data["sizes"][-1]["times"][stage] for stage in stages}
    label = np.log(sorted(last.values()))
    for k in range(1, len(label)):  # apart from each other
        label[k] = max(label[k], label[k - 1] + 0.55)
    place = dict(zip(sorted(last, key=lambda stage: last[stage]), np.exp(label), strict=True))
    for stage, colour, marker in zip(stages, (INK, SKY, BLUE, GREEN, ORANGE), "sov^D", strict=True):
        axes.loglog(size, [row["times"][stage] for row in data["sizes"]], marker=marker, ms=4, color=colour)
        axes.text(1.15 * size[-1], place[stage], stage, color=colour, va="center")
    axes.set(xlabel="vertices", ylabel="time [s]", xlim=(size[0] * 0.8, size[-1] * 6.0))
    return figure


def with_tables(page: str, shares: dict[str, Any], times: dict[str, Any]) -> str:
    """The page with both tables written anew. Raises ValueError where its marks are missing."""
    load = f"load {times['load']:.1f} on {times['cores']} cores"
    head = f"Processor time in s, medians of {times['rounds']} ({load}):"
    measured = f"{head}\n\n{speed.table(times)}\n{speed.verdict(times)}.\n"
    for name, text in (("study", study.text(shares) + "\n"), ("speed", measured)):
        begin, end = (mark.format(name) for mark in MARKS)
        if page.count(begin) != 1 or page.count(end) != 1:
            raise ValueError(f"{PAGE.name} needs one line each {begin.strip()!r} and {end.strip()!r}")
        before, after = page.partition(begin)[0], page.partition(end)[2]
        page = f"{before}{begin}\n{text}\n{end}{after}"
    return page


def main(arguments: Sequence[str] | None = None) -> int:
    """Draw all figures into a directory, docs/images if none is named, and write the tables."""
    wanted = list(sys.argv[1:] if arguments is None else arguments)
    folder = Path(wanted[0]) if wanted else ROOT / "docs" / "images"
    folder.mkdir(parents=True, exist_ok=True)
    room, hall = (
        load_scenario(ROOT / "scenarios" / f"{n}.yaml").problem for n in ("four_point_room", "warehouse_rest")
    )
    small, large = vc_method(room), vc_method(hall)
    times = json.loads(SPEED.read_text(encoding="utf-8"))
    figures: dict[str, Callable[[], Figure]] = {
        "critical": lambda: critical(small, room),
        "cells": lambda: cells(small, room),
        "graph": lambda: graph(small, room),
        "profile": lambda: profile(large, hall),
        "growth": lambda: growth(times),
    }
    with mpl.rc_context(STYLE):
        for name, draw in figures.items():
            path = folder / f"vc_method_{name}.svg"
            draw().savefig(path, facecolor="white", dpi=130, metadata={"Date": None})
            print(f"{path}: {path.stat().st_size // 1024} kB")
    page, shares = PAGE.read_text(encoding="utf-8"), json.loads(study.DATA.read_text(encoding="utf-8"))
    PAGE.write_text(with_tables(page, shares, times), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
