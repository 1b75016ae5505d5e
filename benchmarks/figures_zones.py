"""The figures of docs/braking_zones.md: `python -m benchmarks.figures_zones [DIRECTORY]`.

Drawn from the zones, routes and speed profiles that the package computes now.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon
from numpy.typing import NDArray

from benchmarks.figures import BLUE, GREEN, INK, ORANGE, RED, ROOT, SKY, STYLE, draw_room
from vnav_drake.braking import UniformBraking
from vnav_drake.plan import Trajectory
from vnav_drake.problem import Problem
from vnav_drake.scenario import load_scenario
from vnav_drake.speed_graph import speed_graph
from vnav_drake.speed_profile import fastest_profile
from vnav_drake.zones.convex_zone import GaugeZone
from vnav_drake.zones.held_arc import least_ahead
from vnav_drake.zones.shapes import DiscZone, EllipseZone, PolygonZone, ProtectiveField

Array = NDArray[np.float64]

LAW = UniformBraking(max_braking=1.0)
RADIUS = 0.4  # [m]
SPEEDS = (0.8, 1.4, 2.0)  # [m/s]
SHADES = ("#08519c", "#4292c6", "#9ecae1")
BETAS = (0.7, 0.5, 0.3)
GRIP = 1.2  # mu g over a_b in the figures with a reserve
MOMENTS = 15


def zones() -> dict[str, GaugeZone]:
    """One zone of each built-in shape."""
    kept = {"law": LAW, "radius": RADIUS}
    half = ((1.0, 0.12), (0.6, 0.38), (0.0, 0.42), (-0.2, 0.2))
    egg = (*half, *((x, -y) for x, y in reversed(half)))
    return {
        "uniform: a disc": DiscZone(**kept),
        "ellipse, lateral_ratio 0.5": EllipseZone(**kept, lateral_ratio=0.5),
        "protective_field, capsule": ProtectiveField(**kept),
        "polygon": PolygonZone(**kept, vertices=egg),
    }


def shapes() -> Figure:
    """Zones at some speeds, with the straight stop from the greatest."""
    figure = Figure(figsize=(7.2, 5.4), layout="constrained")
    panels = figure.subplots(2, 2, sharex=True, sharey=True).ravel()
    for axes, (name, zone) in zip(panels, zones().items(), strict=True):
        for speed, shade in zip(reversed(SPEEDS), reversed(SHADES), strict=True):
            axes.add_patch(Polygon(zone.outline(speed, 240), fc=shade, ec=INK, lw=0.7, alpha=0.75))
        far = float(LAW.distance(SPEEDS[-1]))
        axes.plot([0.0, far], [0.0, 0.0], color=RED, lw=1.6)
        axes.add_patch(Circle((far, 0.0), RADIUS, fill=False, ec=RED, ls="--"))
        axes.add_patch(Circle((0.0, 0.0), RADIUS, fc="white", ec=INK))
        axes.set_title(name)
        axes.set_aspect("equal")
    panels[0].set(xlim=(-2.6, 2.7), ylim=(-2.6, 2.6))
    for axes in (panels[2], panels[3]):
        axes.set_xlabel("ahead [m]")
    for axes in (panels[0], panels[2]):
        axes.set_ylabel("to the left [m]")
    return figure


def held() -> Figure:
    """Stops with the steering held, in units of the stopping distance: without reserve and with it."""
    figure = Figure(figsize=(7.2, 3.1), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    ahead = least_ahead(0.5, reserved_turn(GRIP))
    for axes, title in (
        (left, "μg = a_b, no reserve: brakes get what turning leaves"),
        (right, f"μg = {GRIP} a_b, reserve kept: full braking"),
    ):
        axes.add_patch(Circle((0, 0), 1.0, fill=False, ec=INK, lw=1.0))
        for long, dash in ((1.0, "-"), (ahead, "--")):
            angle = np.linspace(-math.pi, math.pi, 361)
            axes.plot(long * np.cos(angle), 0.5 * np.sin(angle), color=BLUE, lw=1.2, ls=dash)
        axes.set(aspect="equal", xlabel="ahead / D", xlim=(-0.25, 1.6), ylim=(-1.1, 1.1))
        axes.set_title(title, fontsize=8.5)
    for share in np.linspace(0.0, 1.0, 11):
        for side in (-1.0, 1.0):
            _arc(left, shared_stop(float(share)), side, RED if share > 0.0 else INK)
    for turn in np.linspace(0.0, reserved_turn(GRIP), 6):
        for side in (-1.0, 1.0):
            _arc(right, (float(turn), 1.0), side, GREEN)
    left.set_ylabel("to the left / D")
    left.annotate("λ = 1", (1.3, 0.68), color=RED)
    return figure


def reserved_turn(grip: float) -> float:
    """Greatest x = |kappa| D with the reserve, mu g = `grip` a_b: sqrt(grip^2 - 1) / 2."""
    return 0.5 * math.sqrt(grip * grip - 1.0)


def shared_stop(share: float) -> tuple[float, float]:
    """Turn [rad] and length, in D, of a stop with steering held at lambda = `share`, mu g = a_b.

    Derived in docs/braking_zones.md: length asin(lambda)/(2 kappa) with kappa v^2 = lambda a_b and D =
    v^2/(2 a_b), so kappa D = lambda/2 and length/D = asin(lambda)/lambda, turn asin(lambda)/2.
    """
    angle = math.asin(share)
    return 0.5 * angle, angle / share if share > 0.0 else 1.0


def _arc(axes: Axes, stop: tuple[float, float], side: float, colour: str) -> None:
    turn, length = stop
    along = np.linspace(0.0, 1.0, 40)
    half = 0.5 * turn * along
    chord = length * along * np.sinc(half / math.pi)
    axes.plot(chord * np.cos(half), side * chord * np.sin(half), color=colour, lw=0.9)
    axes.plot(
        chord[-1] * math.cos(half[-1]), side * chord[-1] * math.sin(half[-1]), "o", ms=2.6, color=colour
    )


def demand(angle: Array, beta: float, share: float) -> Array:
    """Deceleration over a_b that the zone's limit demands beside a wall; same shape as `angle`.

    `angle` [rad]: heading from the wall's normal; `share`: lambda = kappa v^2/a_b, turning towards the wall
    (positive: away from the normal). Derived in docs/braking_zones.md.
    """
    cos, sin = np.cos(angle), np.sin(angle)
    h = np.hypot(cos, beta * sin)
    return np.asarray(cos / h + 0.5 * share * (1.0 - beta**2) * sin * cos / h**2)


def demands() -> Figure:
    """What turning near a wall demands of the brakes."""
    figure = Figure(figsize=(7.2, 2.8), layout="constrained")
    axes = figure.subplots()
    angle = np.linspace(0.0, 0.5 * math.pi, 721)
    for beta, colour in zip((1.0, *BETAS, 0.1), (INK, SKY, BLUE, ORANGE, RED), strict=True):
        value = demand(angle, beta, 1.0)
        axes.plot(np.degrees(angle), value, color=colour)
        top = int(np.argmax(value))
        words = f"β = {beta:g}: {value[top]:.2f}" if beta < 1.0 else "disc: 1"
        place = (float(np.degrees(angle[top])), float(value[top]))
        below = (4, -11) if beta == BETAS[0] else (4, 3)
        axes.annotate(words, place, below, textcoords="offset points", color=colour)
    axes.axhline(1.0, color=INK, ls="--", lw=0.8)
    axes.set(
        xlabel="heading from the wall's normal [degrees]", ylabel="demanded deceleration / a_b",
        xlim=(0, 90), ylim=(0, 3.5),
    )  # fmt: skip
    return figure


def corner(problem: Problem) -> tuple[Trajectory, Trajectory]:
    """One path driven with the zone and with uniform braking: the route of the isotropic relaxation."""
    path = speed_graph(problem.isotropic()[0], classes=1, with_published=False).classes[0].path
    plain = fastest_profile(replace(problem, zone=None), path, model="variational")
    return fastest_profile(problem, path, model="variational"), plain


def route() -> Figure:
    """The zone along a route, and the speeds with the zone and with uniform braking."""
    base = load_scenario(ROOT / "scenarios" / "warehouse.yaml").problem
    zone = EllipseZone(law=base.braking, radius=base.robot.radius, lateral_ratio=0.5)
    problem = replace(base, zone=zone)
    motion, uniform = corner(problem)
    figure = Figure(figsize=(7.2, 3.8), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1.1, 1.0))
    draw_room(left, problem)
    for t in np.linspace(motion.t[0], motion.t[-1], MOMENTS):
        x, y, heading, v, _, _ = (float(value) for value in motion.at(t))
        cos, sin = math.cos(heading), math.sin(heading)
        outline = zone.outline(v) @ np.array([[cos, sin], [-sin, cos]]) + np.array([x, y])
        left.add_patch(Polygon(outline, fc=BLUE, ec=BLUE, alpha=0.22, lw=0.8, zorder=3))
        left.add_patch(Circle((x, y), RADIUS + v * v / 2.0, fill=False, ec=ORANGE, lw=0.4, zorder=2))
    left.plot(motion.x, motion.y, color=BLUE, lw=1.6, zorder=4)
    left.set_ylabel("y [m]")
    left.set(xlim=(-0.5, 32.5), ylim=(-0.5, 31.5))
    for run, colour, name in ((motion, BLUE, "ellipse 0.5"), (uniform, ORANGE, "uniform")):
        right.plot(run.arc_length, run.v, color=colour)
        middle = len(run.v) // 2
        place = (float(run.arc_length[middle]), float(run.v[middle]))
        words = f"{name}: {run.travel_time:.2f} s"
        right.annotate(words, place, (0, 6), textcoords="offset points", color=colour, ha="center")
    right.set(xlabel="path length [m]", ylabel="speed [m/s]", ylim=(0.0, 3.2))
    return figure


FIGURES = {"shapes": shapes, "held": held, "demand": demands, "route": route}


def main(arguments: Sequence[str] | None = None) -> int:
    """Draw all figures into a directory, docs/images if none is named."""
    wanted = list(sys.argv[1:] if arguments is None else arguments)
    folder = Path(wanted[0]) if wanted else ROOT / "docs" / "images"
    folder.mkdir(parents=True, exist_ok=True)
    with mpl.rc_context(STYLE):
        for name, draw in FIGURES.items():
            path = folder / f"braking_zones_{name}.svg"
            draw().savefig(path, facecolor="white", dpi=130, metadata={"Date": None})
            print(f"{path}: {path.stat().st_size // 1024} kB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
