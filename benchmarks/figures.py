"""The figures of docs/speed_graph.md: `python -m benchmarks.figures [DIRECTORY]`.

All are drawn from what the planner computes now; the one of the study from docs/data/ranking.json, from which
the page's table of the study is written too.
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
from matplotlib.patches import Polygon
from numpy.typing import NDArray

from vnav_drake.arcs import leg_points
from vnav_drake.braking import UniformBraking
from vnav_drake.problem import Problem
from vnav_drake.scenario import load_scenario
from vnav_drake.speed_graph import SpeedGraphResult, speed_graph
from vnav_drake.speed_graph.drawing import edge_points

Array = NDArray[np.float64]

ROOT = Path(__file__).parent.parent
STUDY = ROOT / "docs" / "data" / "ranking.json"
PAGE = ROOT / "docs" / "speed_graph.md"
MARKS = "<!-- study: written by benchmarks.figures -->\n", "<!-- end of study -->\n"
GRAPHS = {"sampled": "sampled graph", "published": "published graph", "voronoi": "Voronoi route"}
INK, FLOOR, SOLID = "#333333", "#ffffff", "#bdbdbd"
# Okabe and Ito 2008, "Color Universal Design"
BLUE, ORANGE, GREEN, RED, SKY, PINK = "#0072B2", "#E69F00", "#009E73", "#D55E00", "#56B4E9", "#CC79A7"
MOST_EDGES = 1500  # of a graph, drawn
STYLE: dict[Any, Any] = {
    "font.size": 9.0,
    "font.family": "DejaVu Sans",
    "svg.hashsalt": "vnav-drake",
    "svg.fonttype": "none",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": INK,
    "path.simplify_threshold": 0.5,
}


def draw_room(axes: Axes, problem: Problem) -> None:
    """Floor, obstacles and ends on a map of equal scales."""
    world = problem.world
    axes.add_patch(Polygon(np.array(world.boundary.exterior.coords), fc=FLOOR, ec=INK, lw=1.0, zorder=0))
    for obstacle in world.obstacles:
        vertices = np.array(obstacle.vertices)
        if len(vertices) == 1:
            axes.plot(*vertices.T, "o", ms=4, color=INK, zorder=5)
        elif len(vertices) == 2:
            axes.plot(*vertices.T, color=INK, lw=1.5, zorder=5)
        else:
            axes.add_patch(Polygon(vertices, fc=SOLID, ec=INK, lw=0.8, zorder=1))
    for end, name in ((problem.start, "start"), (problem.goal, "goal")):
        axes.plot(*end.position, "s" if name == "start" else "D", ms=4, color=INK, zorder=6)
        axes.annotate(name, end.position, (4, 4), textcoords="offset points", zorder=6)
    axes.set_aspect("equal")
    axes.set_xlabel("x [m]")
    axes.autoscale_view()


def arcs() -> Figure:
    """Optimal arcs near a wall and near a point."""
    figure = Figure(figsize=(7.2, 2.8), layout="constrained")
    wall, point = figure.subplots(1, 2)
    law, part = UniformBraking(max_braking=1.0), np.linspace(0.0, 1.0, 81)
    for span, low in ((1.0, 0.2), (2.5, 0.2), (4.0, 0.2), (4.0, 0.0)):
        x, d = leg_points(law, 0.0, [False], [low], [low], [span], part)
        wall.plot(x[0] + 0.5 * (4.0 - span), d[0], color=BLUE if low > 0.0 else ORANGE)
    wall.axhline(0.0, color=INK, lw=3.0)
    wall.set(title="wall: cycloids", xlabel="along the wall [m]", ylabel="clearance [m]")
    for radius, colour in ((0.0, BLUE), (0.4, ORANGE)):
        for sweep in (1.0, 2.0, 3.0):
            angle, d = leg_points(law, radius, [True], [0.6], [0.6], [sweep], part)
            angle = angle[0] - 0.5 * sweep + 0.5 * np.pi
            point.plot((d[0] + radius) * np.cos(angle), (d[0] + radius) * np.sin(angle), color=colour)
    point.plot(0.0, 0.0, "o", ms=4, color=INK)
    turn = np.linspace(0.0, 2.0 * np.pi, 91)
    point.plot(0.4 * np.cos(turn), 0.4 * np.sin(turn), "--", color=ORANGE, lw=0.8)
    point.text(0.0, -0.55, "robot radius 0.4 m", color=RED, ha="center")
    point.text(0.0, -0.75, "radius 0: parabolas", color=BLUE, ha="center")
    point.set_ylim(-0.85, 1.1)
    point.set(title="point: clearance 0.6 m at both ends", xlabel="x [m]", ylabel="y [m]", aspect="equal")
    return figure


def strips(result: SpeedGraphResult, problem: Problem) -> Figure:
    """Two proximity cells of the four-point room, on the map and as strips."""
    figure = Figure(figsize=(7.2, 3.4), layout="constrained")
    layout = figure.subplot_mosaic([["map", "wall"], ["map", "point"]], width_ratios=(1.0, 1.2))
    draw_room(layout["map"], problem)
    layout["map"].set_ylabel("y [m]")
    cells = result.sampled.strips
    radius = problem.robot.radius
    wall = int(np.flatnonzero(~cells.at_point)[np.argmax((cells.high - cells.low)[~cells.at_point])])
    lone = int(np.flatnonzero(cells.isolated)[0])
    for name, strip, colour in (("wall", wall, SKY), ("point", lone, ORANGE)):
        theta = np.linspace(cells.low[strip] + 1e-9, cells.high[strip] - 1e-9, 241)
        index = np.full(theta.shape, strip)
        ridge = cells.height(index, theta)
        rim = cells.points(index[:1], theta[None], ridge[None])[0]
        foot = cells.points(index[:1], theta[None], np.full((1, len(theta)), 0.0))[0]
        layout["map"].add_patch(Polygon(np.concatenate([rim, foot[::-1]]), fc=colour, ec="none", alpha=0.5))
        layout[name].fill_between(theta, 0.0, ridge - radius, color=colour, alpha=0.5, lw=0.0)
        layout[name].plot(theta, ridge - radius, color=INK, lw=1.2)
        layout[name].axhline(0.0, color=INK, lw=2.0)
        layout[name].set_ylabel("clearance [m]")
    layout["wall"].set(title="cell of a wall", xlabel="theta: along the wall [m]")
    layout["point"].set(title="cell of a point, all round", xlabel="theta: angle [rad]")
    return figure


def graphs(result: SpeedGraphResult, problem: Problem) -> Figure:
    """Both speed graphs of the four-point room."""
    figure = Figure(figsize=(7.2, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    graph, published = result.sampled, result.published
    if published is None:
        raise ValueError("the published graph was not built")
    count = len(graph.edges)
    picked = np.unique(np.linspace(0, count - 1, min(count, MOST_EDGES)).astype(np.int64))
    used = np.unique(np.concatenate(published.path_edge))
    for axes, edges, nodes, colour in (
        (left, picked, graph.samples.point, BLUE),
        (right, used, published.point, GREEN),
    ):
        draw_room(axes, problem)
        lines = LineCollection(list(edge_points(graph, edges, 8)), colors=colour, linewidths=0.3, zorder=2)
        lines.set_rasterized(True)
        axes.add_collection(lines)
        axes.plot(*nodes.T, ".", ms=2.5, color=RED, zorder=3)
    left.set_ylabel("y [m]")
    left.set_title(f"sampled: {graph.node_count} nodes, {count} edges\n({len(picked)} of them drawn)")
    right.set_title(f"published: {published.node_count} nodes, {len(published.edges)} edges\n(as they run)")
    return figure


def classes(result: SpeedGraphResult, problem: Problem) -> Figure:
    """The six best classes of the warehouse, their stretches on Voronoi arcs marked."""
    figure = Figure(figsize=(7.2, 4.8), layout="constrained")
    for axes, c in zip(figure.subplots(2, 3, sharex=True, sharey=True).flat, result.classes, strict=False):
        draw_room(axes, problem)
        for text in list(axes.texts):
            text.remove()
        axes.plot(*c.points.T, color=BLUE, lw=1.5, zorder=4)
        for stretch in c.stuck:
            axes.plot(*stretch.T, color=ORANGE, lw=3.0, zorder=3)
        axes.set_title(f"{c.rank}: {c.travel_time:.3f} s, {c.length:.1f} m", fontsize=9)
        axes.set_xlabel("")
    return figure


def newton(results: Sequence[tuple[str, SpeedGraphResult]]) -> Figure:
    """Newton's method from the graph's route to the optimum of the first class."""
    figure = Figure(figsize=(7.2, 2.6), layout="constrained")
    gap, residual = figure.subplots(1, 2)
    for (name, result), colour, marker in zip(results, (BLUE, ORANGE), "os", strict=True):
        best = result.classes[0]
        step = np.arange(1, len(best.history) + 1)
        off = np.array([abs(h.time - best.travel_time) for h in best.history])
        gap.semilogy(step, np.maximum(off, 1e-15), marker=marker, ms=3, color=colour, label=name)
        residual.semilogy(
            step,
            np.maximum([h.residual for h in best.history], 1e-16),
            marker=marker,
            ms=3,
            color=colour,
            label=name,
        )
    gap.set(xlabel="iteration", ylabel="|T - T*| [s]")
    gap.axhline(1e-5, color=INK, lw=0.7, ls="--")
    gap.annotate("1e-5 s, as in the source", (1.0, 1e-5), (2, 3), textcoords="offset points", fontsize=8)
    residual.set(xlabel="iteration", ylabel="largest kink [rad]")
    residual.legend(frameon=False)
    return figure


def ranking() -> Figure:
    """The study: share of worlds whose fastest class is among the first k of a graph."""
    study = json.loads(STUDY.read_text(encoding="utf-8"))
    figure = Figure(figsize=(7.2, 2.9), layout="constrained")
    share, regret = figure.subplots(1, 2)
    for (graph, name), colour, marker in zip(GRAPHS.items(), (BLUE, GREEN, ORANGE), "os^", strict=True):
        row = study["graphs"][graph]
        k = [int(n) for n in row["best_within"]]
        share.plot(
            k, [100.0 * s for s in row["best_within"].values()], marker=marker, ms=4, color=colour, label=name
        )
        wrong = np.array(row["regret"]["sorted_when_wrong"])
        if len(wrong):
            worlds = np.arange(1, len(wrong) + 1)
            regret.loglog(worlds, 100.0 * wrong, marker=marker, ms=3, color=colour, label=name)
    share.set(xlabel="classes taken from the graph, k", ylabel="fastest class is among them [%]")
    share.legend(frameon=False, loc="lower right")
    regret.set(xlabel="worlds in which it is not the first", ylabel="first class slower by [%]")
    return figure


def study_text(study: dict[str, Any]) -> str:
    """What the page says of the study, from its aggregates."""
    low, middle, high = study["vertices"]
    kinds = ", ".join(f"{n} {family}" for family, n in study["families"].items())
    failed = ", ".join(f"`{name}` {n}" for name, n in study["failed_of_three_best"].items()) or "none"
    refused = ", ".join(f"{n} {name}" for name, n in study["refused"].items()) or "none"
    lines = [
        f"{study['worlds']} worlds ({kinds}; {low} to {high} vertices, median {middle});"
        f" refused by name: {refused}; crashed or hung: {study['crashed_or_hung']}."
        f" {study['classes_refined']} classes refined, {_percent(study['certified_of_all'])} certified;"
        f" of the three best of each world {_percent(study['certified_of_three_best'])}"
        f" (conditions that failed: {failed});"
        f" largest relative bound of a certified one {study['largest_bound_of_certified']:.0e}.",
        "",
        "| ranked by | first class is the fastest | among first 2 | first 3 | three fastest among first 3"
        " | first 6 | first is slower by, when wrong: median, largest |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for graph, name in GRAPHS.items():
        row = study["graphs"][graph]
        best, three, regret = row["best_within"], row["three_best_within"], row["regret"]
        shares = [best["1"], best["2"], best["3"], three["3"], three["6"]]
        cells = " | ".join(_percent(share) for share in shares)
        lines.append(
            f"| {name} | {cells} | {_percent(regret['median_when_wrong'])}, {_percent(regret['max'])} |"
        )
    return "\n".join(lines) + "\n"


def _percent(share: float) -> str:
    return f"{100.0 * share:.1f} %"


def with_study(page: str, study: dict[str, Any]) -> str:
    """The page with what it says of the study written anew. Raises ValueError where its marks are missing."""
    begin, end = MARKS
    if page.count(begin) != 1 or page.count(end) != 1:
        raise ValueError(f"{PAGE.name} needs one line each {begin.strip()!r} and {end.strip()!r}")
    before, after = page.partition(begin)[0], page.partition(end)[2]
    return f"{before}{begin}\n{study_text(study)}\n{end}{after}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Draw all figures into a directory, docs/images if none is named."""
    wanted = list(sys.argv[1:] if arguments is None else arguments)
    folder = Path(wanted[0]) if wanted else ROOT / "docs" / "images"
    folder.mkdir(parents=True, exist_ok=True)
    room, hall = (
        load_scenario(ROOT / "scenarios" / f"{n}.yaml").problem for n in ("four_point_room", "warehouse")
    )
    small, large = speed_graph(room), speed_graph(hall)
    figures: dict[str, Callable[[], Figure]] = {
        "arcs": arcs,
        "strips": lambda: strips(small, room),
        "graphs": lambda: graphs(small, room),
        "classes": lambda: classes(large, hall),
        "newton": lambda: newton((("four-point room", small), ("warehouse", large))),
        "ranking": ranking,
    }
    with mpl.rc_context(STYLE):
        for name, draw in figures.items():
            path = folder / f"speed_graph_{name}.svg"
            draw().savefig(path, facecolor="white", dpi=130, metadata={"Date": None})
            print(f"{path}: {path.stat().st_size // 1024} kB")
    page, study = PAGE.read_text(encoding="utf-8"), json.loads(STUDY.read_text(encoding="utf-8"))
    PAGE.write_text(with_study(page, study), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
