"""The two-room office of Manor 2015, Sec. 2.7.1: from which delta on is the upper passage faster?

Fig. 2.13 cannot be read: the layout is ours, in the manner of the text. Its axes run from 0 to 300, taken as
centimetres; with a robot of 0.2 m and the limits of Sec. 2.8 (0.1 m/s^2 both ways) the greatest speed at
delta = 3.4 comes out below 30 cm/s, where the axis of Fig. 2.14 ends. The height of the target is chosen so
that both passages are equally fast near delta = 3, as the text says.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray

from benchmarks.figures import BLUE, INK, ORANGE, SKY, draw_room
from benchmarks.reproduction import two_rooms_text
from benchmarks.reproduction.page import Data
from vnav_drake.braking import UniformBraking
from vnav_drake.plan import Trajectory
from vnav_drake.problem import End, Problem
from vnav_drake.robot import Robot
from vnav_drake.vc_method import Realisation, realise, vc_method
from vnav_drake.voronoi import Curves, VoronoiDiagram, build_diagram, shortest_route
from vnav_drake.voronoi.network import build_network
from vnav_drake.voronoi_route.search import routes
from vnav_drake.world import Obstacle, World

Array = NDArray[np.float64]

SIZE = 3.0  # [m], of the square hall
RADIUS = 0.1  # [m]
ACCELERATION = 0.1  # [m/s^2], both ways (Sec. 2.8)
LOWER = 1.5 * 2.0 * RADIUS  # [m], W_l: 1.5 robot diameters
TABLE = (1.8, 2.4)  # [m], left and right side
WALL = (1.0, 1.1)  # [m], between the rooms
DOOR = (0.9, 1.5)  # [m]
START = (0.5, 0.8)  # [m]
TARGET = (2.7, 0.84)  # [m]
PRINTED_CROSSING = 3.0
PRINTED_AXIS = 0.3  # [m/s], where the axis of Fig. 2.14 ends
PROFILES_AT = 3.4  # of delta, as in Fig. 2.14
NARROWEST, WIDEST = 1.0, 4.5  # of delta
STEP = 0.1
EXACT = 1e-6  # of delta
SHIFT = 0.1  # [m], of the target, to see how far the crossing is one of the layout
SAMPLES = 241  # of a profile


def two_room_office(delta: float, target: tuple[float, float] = TARGET) -> Problem:
    """The office whose upper passage is `delta` times as wide as the lower one; from rest to rest.

    The table stands `LOWER` above the lower wall and reaches up to delta `LOWER` below the upper wall: its
    length is what varies.

    Raises
    ------
    ValueError : delta is below 1, or leaves no table.
    """
    top = round(SIZE - delta * LOWER, 9)
    if not (delta >= 1.0 and top > LOWER):
        raise ValueError(f"delta = {delta!r}: must be at least 1 and below {SIZE / LOWER - 1.0:g}")
    world = World.build(
        [(0.0, 0.0), (SIZE, 0.0), (SIZE, SIZE), (0.0, SIZE)],
        [
            _box("lower wall", WALL, (0.0, DOOR[0])),
            _box("upper wall", WALL, (DOOR[1], SIZE)),
            _box("table", TABLE, (round(LOWER, 9), top)),
        ],
    )
    robot = Robot(
        radius=RADIUS,
        mass=4.0,
        wheelbase=0.12,
        track=0.1,
        com_height=0.04,
        friction=0.6,
        max_braking=ACCELERATION,
        max_acceleration=ACCELERATION,
        max_steering=0.8,
    )
    return Problem(
        world=world,
        robot=robot,
        braking=UniformBraking(max_braking=ACCELERATION),
        start=End(position=START, speed="rest"),
        goal=End(position=target, speed="rest"),
    )


def _box(name: str, x: tuple[float, float], y: tuple[float, float]) -> Obstacle:
    return Obstacle(((x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1])), name)


def is_upper(curves: Curves) -> bool:
    """Whether a route passes the middle of the table above it."""
    part = np.linspace(0.0, 1.0, 17)
    span = curves.span
    points = curves.points(span[:, :1] + (span[:, 1:] - span[:, :1]) * part).reshape(-1, 2)
    beside = points[np.argmin(np.abs(points[:, 0] - np.mean(TABLE)))]
    return bool(beside[1] > LOWER)


def both_passages(problem: Problem, diagram: VoronoiDiagram) -> tuple[Curves, Curves]:
    """The fastest route along Voronoi arcs through the lower passage, and through the upper one."""
    found: dict[bool, Curves] = {}
    for route in routes(build_network(problem, diagram, problem.robot.radius)):
        found.setdefault(is_upper(route.curves), route.curves)
        if len(found) == 2:
            break
    return found[False], found[True]


def realised(delta: float, target: tuple[float, float] = TARGET) -> tuple[Realisation, Realisation]:
    """The vc-method's motion through the lower passage and through the upper one."""
    problem = two_room_office(delta, target)
    diagram = build_diagram(problem.world, RADIUS)
    lower, upper = both_passages(problem, diagram)
    return realise(problem, lower), realise(problem, upper)


def bisect(holds: Callable[[float], bool], low: float, high: float) -> float:
    """Where `holds` begins to hold, within EXACT.

    Raises
    ------
    ValueError : it does not change between `low` and `high`.
    """
    if holds(low) or not holds(high):
        raise ValueError(f"nothing changes from delta = {low} to {high}")
    while high - low > EXACT:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if holds(middle) else (middle, high)
    return 0.5 * (low + high)


def crossing(target: tuple[float, float] = TARGET) -> float:
    """delta at which the realised motions through both passages take equally long."""

    def upper_is_faster(delta: float) -> bool:
        lower, upper = realised(delta, target)
        return upper.trajectory.travel_time < lower.trajectory.travel_time

    return bisect(upper_is_faster, NARROWEST, WIDEST)


def chosen_upper(delta: float) -> bool:
    """Whether the vc-method takes the upper passage."""
    return is_upper(vc_method(two_room_office(delta)).route.curves)


def at(delta: float) -> Data:
    """Both passages, the vc-method's choice and the shortest route at one delta; times [s], lengths [m]."""
    problem = two_room_office(delta)
    diagram = build_diagram(problem.world, RADIUS)
    lower, upper = (realise(problem, curves) for curves in both_passages(problem, diagram))
    chosen = vc_method(problem, diagram)
    shortest = shortest_route(problem, diagram)
    return {
        "delta": delta,
        "lower": {"time": lower.trajectory.travel_time, "length": lower.path.length},
        "upper": {"time": upper.trajectory.travel_time, "length": upper.path.length},
        "vc_method": {
            "time": chosen.realisation.trajectory.travel_time,
            "passage": _passage(chosen.route.curves),
            "passage_by_published_cost": _passage(chosen.other.curves),
            "shortfalls": list(chosen.realisation.shortfalls),
        },
        "shortest": {
            "time": realise(problem, shortest).trajectory.travel_time,
            "passage": _passage(shortest),
            "arc_length": float(shortest.length.sum()),
        },
    }


def _passage(curves: Curves) -> str:
    return "upper" if is_upper(curves) else "lower"


def _profile(trajectory: Trajectory) -> dict[str, list[float]]:
    """Speed [m/s] over arc length as a part of the whole."""
    part = np.linspace(0.0, 1.0, SAMPLES)
    along = trajectory.arc_length
    square = np.interp(part * along[-1], along, np.square(trajectory.v))  # linear between rows
    return {"part": np.round(part, 6).tolist(), "speed": np.round(np.sqrt(square), 6).tolist()}


def measure() -> Data:
    """The study of Figs. 2.14 and 2.15."""
    count = round((WIDEST - NARROWEST) / STEP)
    curve = [at(round(NARROWEST + STEP * i, 9)) for i in range(count + 1)]
    lower, upper = realised(PROFILES_AT)
    higher, deeper = ((TARGET[0], round(TARGET[1] + shift, 9)) for shift in (SHIFT, -SHIFT))
    return {
        "printed": {"crossing": PRINTED_CROSSING, "axis": PRINTED_AXIS, "place": "Sec. 2.7.1, Fig. 2.15"},
        "layout": {
            "size": SIZE,
            "radius": RADIUS,
            "acceleration": ACCELERATION,
            "lower_width": round(LOWER, 9),
            "target": list(TARGET),
        },
        "crossing": crossing(),
        "switch": bisect(chosen_upper, NARROWEST, WIDEST),
        "crossing_target_higher": {"shift": SHIFT, "crossing": crossing(higher)},
        "crossing_target_lower": {"shift": -SHIFT, "crossing": crossing(deeper)},
        "curve": curve,
        "profiles": {
            "delta": PROFILES_AT,
            "lower": _profile(lower.trajectory),
            "upper": _profile(upper.trajectory),
        },
    }


summary, section = two_rooms_text.summary, two_rooms_text.section


def figures(data: Data) -> dict[str, Figure]:
    """Map, ratio and speed."""
    return {"two_rooms_map": _map(), "two_rooms_ratio": _ratio(data), "two_rooms_speed": _speed(data)}


def _map() -> Figure:
    figure = Figure(figsize=(4.2, 4.0), layout="constrained")
    axes = figure.subplots()
    problem = two_room_office(PROFILES_AT)
    diagram = build_diagram(problem.world, RADIUS)
    draw_room(axes, problem)
    arcs = diagram.restricted(RADIUS)
    lines: Any = _polylines(arcs.curves.take(arcs.arcs))
    axes.add_collection(LineCollection(lines, colors=SKY, linewidths=0.8, zorder=2))
    for curves, colour in zip(both_passages(problem, diagram), (ORANGE, BLUE), strict=True):
        path = realise(problem, curves).path
        x, y, _, _ = path.at(np.linspace(0.0, path.length, 400))
        axes.plot(x, y, color=colour, lw=1.8, zorder=4)
    middle = float(np.mean(TABLE))
    for low, high, name in ((0.0, LOWER, "$W_l$"), (SIZE - PROFILES_AT * LOWER, SIZE, "$W_u$")):
        axes.annotate(
            "",
            (middle - 0.2, low),
            (middle - 0.2, high),
            arrowprops={"arrowstyle": "<->", "color": INK, "lw": 0.8},
        )
        axes.text(middle - 0.17, low + 0.25 * (high - low), name, va="center", fontsize=8)
    axes.text(0.98 * SIZE, 0.06, "lower passage", color=ORANGE, ha="right", fontsize=8)
    axes.text(0.98 * SIZE, SIZE - 0.12, "upper passage", color=BLUE, ha="right", fontsize=8)
    axes.text(0.06, 1.6, "Voronoi\narcs", color=SKY, fontsize=8)
    axes.set_ylabel("y [m]")
    return figure


def _polylines(curves: Curves) -> list[Array]:
    span = curves.span
    points = curves.points(span[:, :1] + (span[:, 1:] - span[:, :1]) * np.linspace(0.0, 1.0, 25))
    return list(points)


def _ratio(data: Data) -> Figure:
    figure = Figure(figsize=(5.6, 3.2), layout="constrained")
    axes = figure.subplots()
    delta = np.array([row["delta"] for row in data["curve"]])
    shortest = np.array([row["shortest"]["time"] for row in data["curve"]])
    vc = np.array([row["vc_method"]["time"] for row in data["curve"]])
    for passage, colour in (("lower", ORANGE), ("upper", BLUE)):
        ratio = np.array([row[passage]["time"] for row in data["curve"]]) / shortest
        axes.plot(delta, ratio, "--", color=colour, lw=1.0)
        axes.annotate(
            f"{passage} passage",
            (delta[4], ratio[4]) if passage == "upper" else (delta[-7], ratio[-7]),
            (6, 4),
            textcoords="offset points",
            color=colour,
        )
    axes.plot(delta, vc / shortest, color=INK, lw=2.0)
    cross = data["crossing"]
    axes.axvline(cross, color=INK, lw=0.7, ls=":")
    axes.annotate(f"δ = {cross:.4f}", (cross, 1.2), (4, 0), textcoords="offset points")
    axes.annotate("vc-method", (delta[10], 1.0), (0, -12), textcoords="offset points", color=INK)
    axes.set(xlabel="δ = upper width / lower width", ylabel="t / t(l_min)")
    return figure


def _speed(data: Data) -> Figure:
    figure = Figure(figsize=(5.6, 2.8), layout="constrained")
    axes = figure.subplots()
    for passage, colour, name in (("lower", ORANGE, "l_min, lower passage"), ("upper", BLUE, "vc-method")):
        profile = data["profiles"][passage]
        axes.plot(profile["part"], 100.0 * np.array(profile["speed"]), color=colour)
        k = int((0.7 if passage == "lower" else 0.57) * SAMPLES)
        place = (profile["part"][k], 100.0 * profile["speed"][k])
        below = (0, -13) if passage == "lower" else (0, 5)
        axes.annotate(name, place, below, textcoords="offset points", color=colour, ha="center")
    axes.set(xlabel="arc length as a part of the whole", ylabel="speed [cm/s]", xlim=(0, 1), ylim=(0, 32))
    return figure
