"""The collocation mesh: where the knots lie and how refinement went."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from verify.report.curves import Curve, label_curves
from verify.report.figures_map import draw_world, map_height
from verify.report.numbers import number_in, power_of_ten
from verify.report.palette import LIMIT, method
from verify.report.series import Mesh
from verify.report.svg import PANEL, Picture, drawing_style, new_axes, to_svg
from vnav_drake.world import World


@dataclass(frozen=True, kw_only=True)
class MeshData:
    """Meshes and refinement rounds by method."""

    world: World
    meshes: Mapping[str, Mesh]
    history: Mapping[str, Sequence[Mapping[str, Any]]]  # rounds, see ReportExtras
    violation_limit: float | None  # gate, normalised


def draw_mesh(data: MeshData) -> Sequence[Picture]:
    """Knots on the path, interval length along the path, violation against rounds."""
    pictures = []
    with drawing_style():
        if data.meshes:
            pictures += [_knots(data), _intervals(data)]
        rounds = {
            name: [(r, number_in(r, "worst_violation")) for r in rows]
            for name, rows in data.history.items()
            if rows
        }
        drawable = {name: [v for _, v in rows if v is not None] for name, rows in rounds.items()}
        drawable = {name: values for name, values in drawable.items() if values}
        if drawable:
            pictures.append(_convergence(drawable, data.violation_limit))
    return pictures


def _knots(data: MeshData) -> Picture:
    key, title = "mesh-map", "Knots on the path"
    name = "refined" if "refined" in data.meshes else next(iter(data.meshes))
    mesh, look = data.meshes[name], method(name)
    spoken = (
        f"Map with the {len(mesh.s)} knots of the {look.label.lower()}, joined by arcs of constant curvature."
    )
    figure, axes = new_axes(PANEL, map_height(data.world, PANEL, bar=False), x="x [m]", y="y [m]")
    draw_world(axes, data.world, names=False)
    axes.plot(mesh.x, mesh.y, color=look.light, lw=0.8)
    axes.plot(mesh.x, mesh.y, "|" if len(mesh.x) > 400 else "o", color=look.light, ms=2.6, mew=0.5)
    svg = to_svg(figure, key=key, title=title, description=spoken)
    return Picture(key=key, title=title, description=spoken, svg=svg, heading=title, caption=spoken)


def _intervals(data: MeshData) -> Picture:
    key, title = "mesh-intervals", "Interval length along the path"
    figure, axes = new_axes(PANEL, 0.58 * PANEL, x="path length [m]", y="interval length [m]")
    curves, said = [], []
    for name, mesh in data.meshes.items():
        look = method(name)
        x, y = np.repeat(mesh.s, 2)[1:-1], np.repeat(mesh.lengths, 2)
        axes.plot(
            x,
            y,
            color=look.light,
            lw=1.2,
            ls="solid" if name == "refined" else look.dash,
            dash_capstyle="butt",
        )
        curves.append(Curve(x=x, y=y, text=f"{look.label}: {len(mesh.lengths)}", colour=look.text))
        said.append(
            f"{look.label}: {len(mesh.lengths)} intervals, "
            f"{mesh.lengths.min():.3g} to {mesh.lengths.max():.3g} m"
        )
    lengths = np.concatenate([mesh.lengths for mesh in data.meshes.values()])
    axes.set_xlim(0.0, max(float(mesh.s[-1]) for mesh in data.meshes.values()))
    logarithmic(axes, float(lengths.min()), float(lengths.max()))
    label_curves(axes, curves)
    spoken = ". ".join(said) + "."
    svg = to_svg(figure, key=key, title=title, description=spoken)
    caption = "An interval is a piece of constant curvature. " + spoken
    return Picture(key=key, title=title, description=spoken, svg=svg, heading=title, caption=caption)


def _convergence(rounds: Mapping[str, Sequence[float]], limit: float | None) -> Picture:
    key, title = "mesh-rounds", "Violation between knots, round by round"
    figure, axes = new_axes(
        PANEL, 0.58 * PANEL, x="round of mesh refinement", y="worst violation, normalised"
    )
    floor = 1e-12
    curves = []
    for name, values in rounds.items():
        look = method(name)
        x = np.arange(1.0, len(values) + 1.0)
        y = np.maximum(np.array(values), floor)
        axes.plot(x, y, look.marker, ls=look.dash, color=look.light, lw=1.4, ms=6)
        curves.append(Curve(x=x, y=y, text=look.label, colour=look.text))
    shown = [max(v, floor) for values in rounds.values() for v in values] + ([limit] if limit else [])
    longest = max(len(values) for values in rounds.values())
    axes.set_xlim(0.7, longest + 0.3)
    axes.set_xticks(range(1, longest + 1, max(1, longest // 8)))
    logarithmic(axes, 0.5 * min(shown), max(shown))
    if limit:
        axes.axhline(limit, color=LIMIT.light, ls=(0, (5, 2)), lw=1.3)
        curves.append(
            Curve(
                x=np.array([0.7, longest + 0.3]),
                y=np.array([limit, limit]),
                text="limit of the gate",
                colour=LIMIT.light,
            )
        )
    label_curves(axes, curves, gaps=(9.0, 16.0))
    spoken = (
        "; ".join(
            f"{method(n).label}: " + ", ".join(f"{v:.1e}" for v in values) for n, values in rounds.items()
        )
        + "."
    )
    svg = to_svg(figure, key=key, title=title, description=spoken)
    return Picture(
        key=key,
        title=title,
        description=spoken,
        svg=svg,
        heading=title,
        caption="Greatest breach of any limit between the knots of the program's solution after each round, "
        "before the fastest safe speed is computed anew on the final path.",
    )


def logarithmic(axes: Axes, low: float, high: float) -> None:
    """A logarithmic y axis with a few powers of ten written in full."""
    axes.set_yscale("log")
    first, last = math.floor(math.log10(low)), math.ceil(math.log10(high))
    if first == last:
        first, last = first - 1, last + 1
    powers = range(first, last + 1, max(1, (last - first) // 6))
    axes.set_ylim(10.0**first, 10.0**last)
    axes.set_yticks(
        [10.0**p for p in powers], [f"{10.0**p:g}" if -3 <= p <= 3 else power_of_ten(p) for p in powers]
    )
    axes.yaxis.set_minor_formatter("")
