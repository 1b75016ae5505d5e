"""The warehouse of Manor 2015, Sec. 3.7: both printed times, in both readings of where the target is."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.optimize import brentq

from benchmarks.figures import BLUE, INK, ORANGE, draw_room
from benchmarks.reproduction import warehouse_text
from benchmarks.reproduction.page import Data
from benchmarks.reproduction.warehouse_map import GAPS, along_arcs, passage, problem, shortest_way
from vnav_drake.homotopy import class_of
from vnav_drake.problem import Problem
from vnav_drake.speed_graph import ClassOptimum, speed_graph
from vnav_drake.speed_profile import fastest_profile
from vnav_drake.vc_method import realise, vc_method
from vnav_drake.voronoi import VoronoiDiagram, build_diagram

# Sec. 3.7
PRINTED_BEST, PRINTED_SHORTEST = 31.2, 42.9  # [s]
PRINTED_HEIGHT = 30.0  # [m]
ROWS, RACK, GAP, CORRIDOR = 4, 5.0, 1.0, 4.0  # number, [m], [m], [m]
PRINTED_AXIS = 70.0  # [s], where the axis of Fig. 3.12 ends
CLASSES = {"right": 6, "left": 12}  # until the printed class is among them
HEIGHTS = (1.0, 8.0)  # [m], of starts in the right corridor among which one is fitted
SAMPLES = 241  # of a speed profile


def measure() -> Data:
    """Both readings, and the start with which the first printed time comes out."""
    height = fitted_height()
    return {
        "printed": {
            "best": PRINTED_BEST,
            "shortest": PRINTED_SHORTEST,
            "axis": PRINTED_AXIS,
            "height": PRINTED_HEIGHT,
            "rows": ROWS,
            "rack": RACK,
            "gap": GAP,
            "corridor": CORRIDOR,
            "place": "Sec. 3.7, Fig. 3.12",
        },
        "max_braking": problem().robot.max_braking,
        "radius": problem().robot.radius,
        "readings": {name: reading(name) for name in CLASSES},
        "fitted": {"start": [problem().start.position[0], height], **_times(height)},
    }


def reading(name: str) -> Data:
    """All that is computed with the target at one corner of O1."""
    asked = problem(name)
    diagram = build_diagram(asked.world, asked.robot.radius)
    result = speed_graph(asked, diagram, classes=CLASSES[name], with_published=False)
    best, short = result.classes[0], _printed_class(asked, diagram, name)
    vc = vc_method(asked, diagram)
    slow = realise(asked, along_arcs(asked, diagram, result.gates, short.name))
    way = shortest_way(asked)
    return {
        "start": list(asked.start.position),
        "target": list(asked.goal.position),
        "best": _optimum(asked, best),
        "shortest": _optimum(asked, short),
        "gaps": [passage(asked, a, b) for a, b in GAPS[name]],
        "shortest_way": {
            "name": class_of(result.gates, way),
            "length": float(np.hypot(*np.diff(way, axis=0).T).sum()),
        },
        "classes": [
            {"name": c.name, "time": c.travel_time, "length": c.length, "certified": c.certified}
            for c in result.classes
        ],
        "order_certain": result.certain,
        "vc_method": {
            "time": vc.realisation.trajectory.travel_time,
            "length": vc.realisation.path.length,
            "same_class": class_of(result.gates, vc.realisation.path) == best.name,
            "published_cost_time": vc.other.travel_time,
            "same_route": vc.same_route,
            "shortfalls": list(vc.realisation.shortfalls),
        },
        "vc_method_in_gaps": {"time": slow.trajectory.travel_time, "length": slow.path.length},
    }


def _printed_class(asked: Problem, diagram: VoronoiDiagram, name: str) -> ClassOptimum:
    tokens = tuple(f"{a}/{b}" for a, b in GAPS[name])
    return speed_graph(asked, diagram, classes=1, through=tokens, with_published=False).classes[0]


def _optimum(asked: Problem, found: ClassOptimum) -> Data:
    motion = fastest_profile(asked, found.path, model="variational")
    t = np.linspace(0.0, motion.travel_time, SAMPLES)
    x, y, _, _ = found.path.at(np.linspace(0.0, found.path.length, SAMPLES))
    return {
        "name": found.name,
        "time": found.travel_time,
        "bound": found.optimality_bound,
        "certified": found.certified,
        "length": found.length,
        "profile": {"t": np.round(t, 6).tolist(), "speed": np.round(motion.at(t)[3], 6).tolist()},
        "points": np.round(np.column_stack([x, y]), 4).tolist(),
    }


def _times(height: float) -> dict[str, float]:
    """Optima [s] of both classes with the target on the right and the start at another height [m]."""
    asked = problem("right", (problem().start.position[0], height))
    diagram = build_diagram(asked.world, asked.robot.radius)
    best = speed_graph(asked, diagram, classes=1, with_published=False).classes[0]
    return {"best": best.travel_time, "shortest": _printed_class(asked, diagram, "right").travel_time}


def fitted_height() -> float:
    """Height [m] of the start in the right corridor from which the fastest class takes the printed time."""
    return float(brentq(lambda h: _times(float(h))["best"] - PRINTED_BEST, *HEIGHTS, xtol=1e-4))


least_time, summary, section = warehouse_text.least_time, warehouse_text.summary, warehouse_text.section


def figures(data: Data) -> dict[str, Figure]:
    """Both paths on the map, and their speed over time as in Fig. 3.12, for both readings."""
    figure = Figure(figsize=(7.4, 6.4), layout="constrained")
    axes = figure.subplots(2, 2, width_ratios=(1.0, 1.25))
    for (plan, speed), name in zip(axes, ("right", "left"), strict=True):
        found = data["readings"][name]
        _map(plan, problem(name), found)
        plan.set_title(f"target at the lower {name} corner of O1")
        _profiles(speed, found, data["printed"])
    return {"warehouse": figure}


def _map(axes: Axes, asked: Problem, found: Data) -> None:
    draw_room(axes, asked)
    axes.set_ylabel("y [m]")
    for obstacle in asked.world.obstacles:
        x, y = np.mean(np.array(obstacle.vertices), axis=0)
        axes.text(x, y, obstacle.name, ha="center", va="center", color=INK, fontsize=8)
    for key, colour in (("best", BLUE), ("shortest", ORANGE)):
        axes.plot(*np.array(found[key]["points"]).T, color=colour, lw=1.8, zorder=4)


def _profiles(axes: Axes, found: Data, printed: Data) -> None:
    for key, colour, height in (("best", BLUE, 2.95), ("shortest", ORANGE, 2.7)):
        t, v = (np.array(found[key]["profile"][k]) for k in ("t", "speed"))
        axes.plot(t, v, color=colour)
        axes.annotate(
            f"{found[key]['time']:.1f} s", (t[-1], v[-1]), (3, 3), textcoords="offset points", color=colour
        )
        axes.axvline(printed[key], color=colour, lw=0.8, ls=":")
        axes.text(printed[key], height, f" printed {printed[key]} s", color=colour, fontsize=8)
    least = least_time(found)
    axes.axvline(least, color=INK, lw=0.8, ls="--")
    axes.text(least, 2.45, f" gaps alone {least:.1f} s", color=INK, fontsize=8)
    axes.set(xlabel="time [s]", ylabel="speed [m/s]", xlim=(0, 80), ylim=(0, 3.2))
