"""The warehouse of Manor 2015, Sec. 3.7: both printed times, and why one of them cannot be."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from benchmarks.figures import BLUE, INK, ORANGE, draw_room
from benchmarks.reproduction.page import ROOT, Data, Row, table
from vnav_drake.homotopy import Gates, class_of
from vnav_drake.problem import PlanningError, Problem
from vnav_drake.scenario import load_scenario
from vnav_drake.speed_graph import ClassOptimum, speed_graph
from vnav_drake.speed_profile import fastest_profile
from vnav_drake.vc_method import realise, vc_method
from vnav_drake.voronoi import Curves, VoronoiDiagram, build_diagram, shortest_route
from vnav_drake.voronoi.network import build_network
from vnav_drake.voronoi.paths import route_path
from vnav_drake.voronoi_route.search import routes

SCENARIO = ROOT / "scenarios" / "warehouse.yaml"
# Sec. 3.7
PRINTED_BEST, PRINTED_SHORTEST = 31.2, 42.9  # [s]
PRINTED_HEIGHT = 30.0  # [m]
ROWS, RACK, GAP, CORRIDOR = 4, 5.0, 1.0, 4.0  # number, [m], [m], [m]
SHORTEST_GATES = (("O4", "O6"), ("O3", "O4"), ("O1", "O3"))
CLASSES = 12  # until the printed class is among them
ROUTES = 40  # along Voronoi arcs, among which that of the printed class is looked for
ALIKE = 0.01  # [m]: routes whose lengths differ by less
SAMPLES = 241  # of a speed profile


def problem() -> Problem:
    """Ours, 31 m high."""
    return load_scenario(SCENARIO).problem


def passage(world: Problem, one: str, other: str) -> Data:
    """The gap between two racks: width, length, greatest clearance [m], greatest speed [m/s], least time [s].

    Between two parallel sides a width w apart no place is farther than w / 2 from both, so the clearance is
    at most w / 2 - radius, and every way through is at least as long as the sides face each other.

    Raises
    ------
    ValueError : the racks do not face each other, or the robot does not fit between them.
    """
    boxes = {o.name: np.array(o.vertices) for o in world.world.obstacles}
    low = np.maximum(boxes[one].min(axis=0), boxes[other].min(axis=0))
    high = np.minimum(boxes[one].max(axis=0), boxes[other].max(axis=0))
    across = int(np.argmax(low - high))
    width, length = float((low - high)[across]), float((high - low)[1 - across])
    clearance = 0.5 * width - world.robot.radius
    if length <= 0.0 or clearance <= 0.0:
        raise ValueError(f"{one} and {other}: {width:g} m apart along {length:g} m is no gap for this robot")
    speed = float(world.braking.speed(clearance))
    return {
        "between": f"{one} and {other}",
        "width": width,
        "length": length,
        "clearance": clearance,
        "speed": speed,
        "least_time": length / speed,
    }


def voronoi_routes(asked: Problem, diagram: VoronoiDiagram, gates: Gates) -> list[tuple[str, Curves]]:
    """Class and curves of the first ROUTES along Voronoi arcs, fastest first."""
    network = build_network(asked, diagram, asked.robot.radius)
    found = []
    for route in itertools.islice(routes(network), ROUTES):
        path = route_path(route.curves, asked.start.point, asked.goal.point)
        found.append((class_of(gates, path), route.curves))
    return found


def measure() -> Data:
    """Both classes, all others up to the slower of them, and the vc-method in both."""
    asked = problem()
    diagram = build_diagram(asked.world, asked.robot.radius)
    result = speed_graph(asked, diagram, classes=CLASSES, with_published=False)
    tokens = tuple(f"{a}/{b}" for a, b in SHORTEST_GATES)
    best = result.classes[0]
    short = speed_graph(asked, diagram, classes=1, through=tokens, with_published=False).classes[0]
    vc = vc_method(asked, diagram)
    along = voronoi_routes(asked, diagram, result.gates)
    gap_motion = realise(asked, next(curves for name, curves in along if name == short.name))
    lengths: list[Data] = [{"name": name, "length": float(curves.length.sum())} for name, curves in along]
    lengths.sort(key=lambda row: row["length"])
    if not np.isclose(lengths[0]["length"], shortest_route(asked, diagram).length.sum(), rtol=1e-12):
        raise PlanningError(f"the shortest route is not among the {ROUTES} fastest ones")
    return {
        "printed": {
            "best": PRINTED_BEST,
            "shortest": PRINTED_SHORTEST,
            "height": PRINTED_HEIGHT,
            "rows": ROWS,
            "rack": RACK,
            "gap": GAP,
            "corridor": CORRIDOR,
            "place": "Sec. 3.7, Fig. 3.12",
        },
        "max_braking": asked.robot.max_braking,
        "radius": asked.robot.radius,
        "best": _optimum(asked, best),
        "shortest": _optimum(asked, short),
        "gaps": [passage(asked, a, b) for a, b in SHORTEST_GATES],
        "classes": [
            {"name": c.name, "time": c.travel_time, "length": c.length, "certified": c.certified}
            for c in result.classes
        ],
        "order_certain": result.certain,
        "voronoi_lengths": [row for row in lengths if row["length"] < lengths[0]["length"] + ALIKE],
        "vc_method": {
            "time": vc.realisation.trajectory.travel_time,
            "length": vc.realisation.path.length,
            "same_class": class_of(result.gates, vc.realisation.path) == best.name,
            "published_cost_time": vc.other.travel_time,
            "same_route": vc.same_route,
            "shortfalls": list(vc.realisation.shortfalls),
        },
        "vc_method_in_gaps": {
            "time": gap_motion.trajectory.travel_time,
            "length": gap_motion.path.length,
            "arc_time": gap_motion.arc_time,
            "shortfalls": list(gap_motion.shortfalls),
        },
    }


def _optimum(asked: Problem, found: ClassOptimum) -> Data:
    motion = fastest_profile(asked, found.path, model="variational")
    t = np.linspace(0.0, motion.travel_time, SAMPLES)
    path = found.path
    x, y, _, _ = path.at(np.linspace(0.0, path.length, SAMPLES))
    return {
        "name": found.name,
        "time": found.travel_time,
        "bound": found.optimality_bound,
        "certified": found.certified,
        "length": found.length,
        "profile": {"t": np.round(t, 6).tolist(), "speed": np.round(motion.at(t)[3], 6).tolist()},
        "points": np.round(np.column_stack([x, y]), 4).tolist(),
    }


def least_time(data: Data) -> float:
    """[s], that any path of the printed class spends in its gaps."""
    return math.fsum(gap["least_time"] for gap in data["gaps"])


def summary(data: Data) -> list[Row]:
    """Both times and the height."""
    printed = data["printed"]
    return [
        Row(
            what="warehouse, fastest class",
            place=printed["place"],
            printed=f"{printed['best']} s",
            ours=f"{data['best']['time']:.4f} s",
            note="start and target are given in words only",
        ),
        Row(
            what="warehouse, class through the gaps",
            place=printed["place"],
            printed=f"{printed['shortest']} s",
            ours=f"{data['shortest']['time']:.2f} s",
            note=f"contradiction: no path of it takes less than {least_time(data):.1f} s",
        ),
        Row(
            what="warehouse, height of the hall",
            place="Sec. 3.7",
            printed=f"{printed['height']:g} m",
            ours=f"{_height(data):g} m",
            note="contradiction: the printed parts add up to ours",
        ),
    ]


def _height(data: Data) -> float:
    p = data["printed"]
    return float(p["rows"] * p["rack"] + (p["rows"] - 1) * p["gap"] + 2.0 * p["corridor"])


def section(data: Data) -> str:
    """What the page says."""
    best, short, printed = data["best"], data["shortest"], data["printed"]
    vc, slow = data["vc_method"], data["vc_method_in_gaps"]
    faster = [c for c in data["classes"] if c["time"] < printed["shortest"]]
    slower = [c for c in data["classes"] if c["time"] >= printed["shortest"]]
    ratio, printed_ratio = short["time"] / best["time"], printed["shortest"] / printed["best"]
    rows = [
        (
            "fastest class, optimum",
            f"{printed['best']} s",
            f"{best['time']:.4f} s",
            "the outer corridors, as in the thesis; the printed time belongs to other ends or another map",
        ),
        (
            "class through the gaps, optimum",
            f"{printed['shortest']} s",
            f"{short['time']:.4f} s",
            f"printed below what is possible, {least_time(data):.1f} s",
        ),
        (
            "ratio of the two",
            f"{printed_ratio:.2f}",
            f"{ratio:.2f}",
            "does not depend on a_b: all times scale as 1 / √a_b",
        ),
        (
            "fastest class, vc-method",
            "",
            f"{vc['time']:.4f} s",
            f"full robot, corners rounded: {_percent(vc['time'], best['time'])} above the optimum,"
            + (" same class" if vc["same_class"] else " another class"),
        ),
        (
            "class through the gaps, vc-method's motion",
            "",
            f"{slow['time']:.4f} s",
            f"{_percent(slow['time'], short['time'])} above the optimum of that class",
        ),
    ]
    return "\n".join(
        [
            "## Warehouse: the long way is the fast one, and the short one slower than printed",
            "",
            "Manor 2015, Sec. 3.7: eight racks, a robot of 0.8 m with a_b = 1 m/s²; the shortest class runs"
            " between O4 and O6, O3 and O4, O1 and O3. Racks, gaps and corridors are given in words, start"
            " and target only"
            ' as "at the delivery counter" and "at the lower corner of the storage rack O1":'
            " `scenarios/warehouse.yaml` is a **reconstruction** in these two points.",
            "",
            "![Both paths](images/reproduction_warehouse.svg)",
            "",
            table(("", "printed", "ours", "what it means"), rows),
            *_contradictions(data, faster, slower),
            "",
            "In the thesis the axis of Fig. 3.12 (speed over time) is labelled up to 70 s. Ours needs that"
            " much; a motion of 42.9 s would not.",
            "",
            _on_vc(vc),
        ]
    )


def _contradictions(data: Data, faster: list[Any], slower: list[Any]) -> list[str]:
    printed, gaps = data["printed"], data["gaps"]
    speeds = [gap["speed"] for gap in gaps]
    metres = math.fsum(gap["length"] for gap in gaps)
    rows, rack, gap, corridor = (printed[k] for k in ("rows", "rack", "gap", "corridor"))
    total = _height(data)
    spare = printed["height"] - rows * rack - 2.0 * corridor
    low = (printed["height"] - (rows - 1) * gap - 2.0 * corridor) / rows
    shorter = metres - (rack - low)
    below = ", ".join(f"{c['time']:.2f} s" for c in faster)
    certified = "all" if all(c["certified"] for c in data["classes"]) else "not all"
    certain = "is" if data["order_certain"] else "is not"
    alike = data["voronoi_lengths"]
    exact = "√0.2 = " if all(math.isclose(v, math.sqrt(0.2)) for v in speeds) else ""
    return [
        f"**Contradiction 1: the height.** {rows} racks of {rack:g} m, {rows - 1} gaps of {gap:g} m and 2"
        f" corridors of {corridor:g} m make {rows} · {rack:g} + {rows - 1} · {gap:g} + 2 · {corridor:g} ="
        f" {total:g} m; printed {printed['height']:g} m. Ours has {total:g} m.",
        "",
        f"**Contradiction 2: {printed['shortest']} s.** *No path of the printed class takes less than"
        f" {least_time(data):.1f} s.* Proof. Such a path runs through three gaps:",
        "",
        table(
            ("gap between", "width", "length", "clearance at most", "speed at most", "time at least"),
            [
                (
                    g["between"],
                    f"{g['width']:g} m",
                    f"{g['length']:g} m",
                    f"{g['clearance']:.2g} m",
                    f"{g['speed']:.4f} m/s",
                    f"{g['least_time']:.2f} s",
                )
                for g in gaps
            ],
        ),
        "Between parallel sides a width w apart no place is farther than w/2 from both, so the clearance of"
        f" a disc of radius {data['radius']:g} m is at most w/2 - {data['radius']:g} m there, and v² / (2"
        f" a_b) ≤ d allows {exact}{max(speeds):.4f} m/s at most. The gaps are {metres:g} m long together and"
        f" do not overlap, and a path through a gap is no shorter than the gap. So it takes {metres:g} /"
        f" {max(speeds):.4f} = {least_time(data):.2f} s in the gaps alone. ∎",
        "",
        f"A hall of {printed['height']:g} m does not help: with gaps of {spare / (rows - 1):.2f} m a robot"
        f" of {2.0 * data['radius']:g} m does not fit, narrower corridors leave the gaps as they are, and"
        f" racks of {low:g} m leave {shorter:g} m of them, {shorter / max(speeds):.1f} s.",
        "",
        f"Nor is {printed['shortest']} s the time of another class: of all homotopy classes of our map"
        f" {len(faster)} have an optimum below it ({below}), and the next one takes {slower[0]['time']:.2f}"
        f" s. The optima are {certified} certified; their order {certain} certain unless the graph"
        " overestimates a class far more than any that was refined.",
        "",
        'And "the geometrically shortest path" is no clear choice: along the Voronoi diagram of our map'
        f" {len(alike)} classes differ by less than"
        f" {math.ceil(1000.0 * (alike[-1]['length'] - alike[0]['length']))} mm ({alike[0]['length']:.3f} to"
        f" {alike[-1]['length']:.3f} m), the printed one among them.",
    ]


def _on_vc(vc: Data) -> str:
    text = (
        f"The vc-method's motion ({vc['time']:.2f} s, {vc['length']:.2f} m) follows the Voronoi arcs with"
        " a_max = a_b = 1 m/s², its corners rounded."
    )
    if not vc["same_route"]:
        text += (
            " With the edge cost as published it would take another route, of"
            f" {vc['published_cost_time']:.2f} s along the arcs."
        )
    return text + (" It cannot meet: " + "; ".join(vc["shortfalls"]) + "." if vc["shortfalls"] else "")


def _percent(time: float, optimum: float) -> str:
    return f"{100.0 * (time / optimum - 1.0):.1f} %"


def figures(data: Data) -> dict[str, Figure]:
    """Both paths on the map, and their speed over time as in Fig. 3.12."""
    figure = Figure(figsize=(7.4, 3.6), layout="constrained")
    plan, speed = figure.subplots(1, 2, width_ratios=(1.0, 1.15))
    asked = problem()
    draw_room(plan, asked)
    plan.set_ylabel("y [m]")
    for obstacle in asked.world.obstacles:
        x, y = np.mean(np.array(obstacle.vertices), axis=0)
        plan.text(x, y, obstacle.name, ha="center", va="center", color=INK, fontsize=8)
    for key, colour, place in (("best", BLUE, 0.5), ("shortest", ORANGE, 0.45)):
        found = data[key]
        plan.plot(*np.array(found["points"]).T, color=colour, lw=1.8, zorder=4)
        t, v = np.array(found["profile"]["t"]), np.array(found["profile"]["speed"])
        speed.plot(t, v, color=colour)
        k = int(place * SAMPLES)
        speed.annotate(
            f"{found['time']:.1f} s",
            (t[-1], v[-1]),
            (2, 4),
            textcoords="offset points",
            color=colour,
            ha="center",
        )
        name = "outer corridors" if key == "best" else "through the gaps"
        at = (t[k], v.max() if key == "best" else 0.5)
        speed.annotate(name, at, (0, 6), textcoords="offset points", color=colour, ha="center")
    for key, height, colour in (("best", 2.85, BLUE), ("shortest", 2.65, ORANGE)):
        printed = data["printed"][key]
        speed.axvline(printed, color=colour, lw=0.8, ls=":")
        speed.text(printed, height, f" printed {printed} s", color=colour, fontsize=8)
    least = least_time(data)
    speed.axvline(least, color=INK, lw=0.8, ls="--")
    speed.text(least, 2.3, f" least possible {least:.1f} s", color=INK, fontsize=8)
    speed.set(xlabel="time [s]", ylabel="speed [m/s]", xlim=(0, 80), ylim=(0, 3))
    return {"warehouse": figure}
