"""The figures of docs/certificate.md: `python -m benchmarks.figures_certificate [DIRECTORY]`.

Drawn from a certificate that the solver computes now and the judge accepts.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from matplotlib.tri import Triangulation
from numpy.typing import NDArray

from benchmarks.figures import BLUE, GREEN, INK, ORANGE, RED, ROOT, SOLID, STYLE
from verify.judge.certificate import CertificateFile, check_certificate, read_certificate
from verify.judge.question import read_question
from vnav_drake.lower_bound import lower_bound
from vnav_drake.problem import Problem
from vnav_drake.scenario import parse_scenario
from vnav_drake.speed_graph import speed_graph

Array = NDArray[np.float64]

SCENARIO = "four_point_room"
BUDGET = 10_000  # triangles of all programs together: coarse enough to be seen
STEP = 0.5  # [s] between isochrones
TIGHT = 0.05  # slack above which a triangle counts as loose in the picture


def minorants() -> Figure:
    """The slowness beside a wall and what lies below it: tangents and the constant of the speed limit."""
    figure = Figure(figsize=(7.2, 2.6), layout="constrained")
    axes = figure.subplots()
    level, braking, fastest = 0.3, 1.0, 2.2
    distance = np.linspace(level + 1e-3, 4.2, 500)
    slowness = 1.0 / np.sqrt(2.0 * braking * (distance - level))
    axes.plot(distance, slowness, color=INK, lw=0.8)
    axes.plot(distance, np.maximum(slowness, 1.0 / fastest), color=INK, lw=2.2)
    axes.text(0.52, 1.75, "slowness n = 1/V", color=INK)
    for w, colour in ((0.9, BLUE), (1.7, GREEN)):
        contact = level + w * w / (2.0 * braking)
        axes.plot(distance, 1.0 / w - braking / w**3 * (distance - contact), color=colour)
        axes.plot(contact, 1.0 / w, "o", ms=4, color=colour)
        axes.annotate(
            f"tangent, w = {w} m/s", (contact, 1.0 / w), (8, 6), textcoords="offset points", color=colour
        )
    axes.axhline(1.0 / fastest, color=ORANGE, ls="--")
    axes.text(3.45, 1.0 / fastest + 0.04, f"1/v_max, {fastest} m/s", color=ORANGE)
    axes.axvline(level, color=RED, ls="--", lw=1.0)
    axes.text(level + 0.02, 0.05, "ρ + m", color=RED)
    axes.set(
        xlabel="distance of the robot's centre to the wall [m]",
        ylabel="[s/m]",
        xlim=(0.0, 4.2),
        ylim=(0.0, 2.1),
    )
    return figure


def potential(found: CertificateFile, slack: Array, problem: Problem) -> Figure:
    """The mesh coloured by what is left of the inequality, and u as isochrones with the fastest path."""
    figure = Figure(figsize=(7.2, 3.9), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    points = found.origin + float(found.unit) * found.vertices
    loose = np.clip(slack / TIGHT, 0.0, 1.0)
    mesh = PolyCollection(points[found.triangles], array=loose, cmap="viridis_r", edgecolors="white", lw=0.15)
    mesh.set_rasterized(True)
    left.add_collection(mesh)
    left.set_title(f"slack: none (yellow) to {TIGHT:.0%} or more (dark)")
    where, value = _sampled(found, points)
    last = float(value.max())
    right.tricontour(where, value, levels=np.arange(0.0, last, STEP), colors=BLUE, linewidths=0.7)
    path = speed_graph(problem, classes=1, with_published=False).classes[0].path
    place = np.linspace(0.0, path.length, 400)
    x, y, _, _ = path.at(place)
    right.plot(x, y, color=RED, lw=1.8)
    right.set_title(f"u every {STEP} s, and the fastest path")
    for axes in (left, right):
        _room(axes, problem)
    left.set_ylabel("y [m]")
    return figure


def _room(axes: Axes, problem: Problem) -> None:
    """Outline, obstacles and ends on a map of equal scales."""
    outline = np.array(problem.world.boundary.exterior.coords)
    axes.add_patch(Polygon(outline, fc="none", ec=INK, lw=1.0))
    for obstacle in problem.world.obstacles:
        vertices = np.array(obstacle.vertices)
        if len(vertices) == 1:
            axes.plot(*vertices.T, "o", ms=4, color=INK)
        else:
            axes.add_patch(Polygon(vertices, closed=len(vertices) > 2, fc=SOLID, ec=INK, lw=0.8))
    for end, name in ((problem.start, "start"), (problem.goal, "goal")):
        axes.plot(*end.position, "s" if name == "start" else "D", ms=4, color=RED)
        axes.annotate(name, end.position, (4, -10), textcoords="offset points", color=RED)
    axes.set_aspect("equal")
    axes.set_xlabel("x [m]")
    low, high = outline.min(axis=0), outline.max(axis=0)
    axes.set(xlim=(low[0] - 0.1, high[0] + 0.1), ylim=(low[1] - 0.1, high[1] + 0.1))


def _sampled(found: CertificateFile, points: Array) -> tuple[Triangulation, Array]:
    """u [s], zero at the start, at the corners and middles of sides: four triangles in place of one."""
    kept, edges = found.triangles.astype(np.int64), found.edges.astype(np.int64)
    key = edges @ np.array([len(points), 1])
    sides = np.sort(kept[:, [[1, 2], [2, 0], [0, 1]]], axis=2)
    side = np.searchsorted(key, sides @ np.array([len(points), 1])) + len(points)
    (a, b, c), (bc, ca, ab) = kept.T, side.T
    parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    ends = found.u_vertex[edges]
    value = np.concatenate([found.u_vertex, 0.25 * ends.sum(axis=1) + 0.5 * found.u_edge])
    where = np.concatenate([points, points[edges].mean(axis=1)])
    triangles = np.concatenate([np.stack(part, axis=1) for part in parts])
    at_start = found.u_vertex[kept[int(found.start_triangle)]].min()
    return Triangulation(*where.T, triangles), value - at_start


def main(arguments: Sequence[str] | None = None) -> int:
    """Draw both figures into a directory, docs/images if none is named."""
    wanted = list(sys.argv[1:] if arguments is None else arguments)
    folder = Path(wanted[0]) if wanted else ROOT / "docs" / "images"
    folder.mkdir(parents=True, exist_ok=True)
    data = (ROOT / "scenarios" / f"{SCENARIO}.yaml").read_bytes()
    problem = parse_scenario(data, f"{SCENARIO}.yaml").problem
    with tempfile.TemporaryDirectory() as scratch:
        lower_bound(problem, budget=BUDGET).certificate.save(Path(scratch) / "certificate.npz")
        found = read_certificate(Path(scratch))
    if found is None:
        raise RuntimeError("the certificate that was saved is not found")
    proof = check_certificate(found, read_question(data))
    if not proof.holds:
        raise RuntimeError("; ".join(proof.reasons))
    with mpl.rc_context(STYLE):
        for name, figure in (
            ("minorant", minorants()),
            ("potential", potential(found, proof.slack, problem)),
        ):
            path = folder / f"certificate_{name}.svg"
            figure.savefig(path, facecolor="white", dpi=130, metadata={"Date": None})
            print(f"{path}: {path.stat().st_size // 1024} kB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
