"""The experiment of Manor 2015, Sec. 2.8: three trajectories of an iRobot Create, Table 2.2 and Fig. 2.19."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
from matplotlib.figure import Figure

from benchmarks.figures import BLUE, GREEN, INK, ORANGE, draw_room
from benchmarks.reproduction.fire import cruising_speed
from benchmarks.reproduction.page import ROOT, Data, Row, table
from vnav_drake.homotopy import build_gates, class_of
from vnav_drake.plan import Path, Trajectory
from vnav_drake.problem import PlanningError, Problem
from vnav_drake.scenario import load_scenario
from vnav_drake.vc_method import Realisation, realise, vc_method
from vnav_drake.voronoi import Curves, build_diagram, shortest_route
from vnav_drake.voronoi.network import build_network
from vnav_drake.voronoi_route.search import routes
from vnav_drake.world import Obstacle, World

SCENARIO = ROOT / "scenarios" / "create_three_rectangles.yaml"
# Table 2.2: path length [m], duration [s], average speed [m/s]
PRINTED = ((3.5, 45.0, 0.08), (4.5, 32.0, 0.14), (6.7, 26.0, 0.26))
AXIS = 0.3  # [m/s], where the velocity axis of Fig. 2.19 ends
RADIUS_PRINTED = 0.3  # [m], r_min
# Of the trajectories: the gate that each crosses and no other does.
GATES = ("O1/O2", "O2/O3", "O1/boundary")
COLOURS = (ORANGE, GREEN, BLUE)
ROUTES = 12  # along Voronoi arcs, among which the trajectories are looked for
SHIFT = 0.005  # [m], by which the first gap is made narrower and wider
SAMPLES = 121  # of a drawing


def problem() -> Problem:
    """Ours."""
    return load_scenario(SCENARIO).problem


def with_first_gap(asked: Problem, wider: float) -> Problem:
    """The gap between O1 and O2 wider by so much [m], the left side of O2 moved."""
    boxes = {o.name: np.array(o.vertices) for o in asked.world.obstacles}
    left = boxes["O2"][:, 0].min()
    boxes["O2"][boxes["O2"][:, 0] == left, 0] += wider
    obstacles = [Obstacle(tuple((float(x), float(y)) for x, y in box), name) for name, box in boxes.items()]
    world = World.build(np.array(asked.world.boundary.exterior.coords)[:-1], obstacles)
    return dataclasses.replace(asked, world=world)


def ways(asked: Problem) -> list[tuple[str, Curves]]:
    """Class and curves of all simple routes along the Voronoi arcs, fastest first, at most ROUTES."""
    diagram = build_diagram(asked.world, asked.robot.radius)
    gates = build_gates(diagram.restricted(asked.robot.radius), asked.robot.radius)
    found = []
    for route in itertools.islice(routes(build_network(asked, diagram, asked.robot.radius)), ROUTES):
        found.append((class_of(gates, realise(asked, route.curves).path), route.curves))
    return found


def through(known: list[tuple[str, Curves]], gate: str) -> tuple[str, Curves]:
    """The fastest of these routes through a gate.

    Raises
    ------
    PlanningError : none goes there.
    """
    for name, curves in known:
        if gate in name.split(", "):
            return name, curves
    raise PlanningError(f"no route along the Voronoi arcs passes {gate}")


def measure() -> Data:
    """The three trajectories, what else there is, and which one the vc-method takes."""
    asked = problem()
    diagram = build_diagram(asked.world, asked.robot.radius)
    gates = build_gates(diagram.restricted(asked.robot.radius), asked.robot.radius)
    known = ways(asked)
    chosen = [through(known, gate) for gate in GATES]
    driven = [realise(asked, curves) for _, curves in chosen]
    names = [name for name, _ in chosen]
    others = [_brief(name, realise(asked, curves)) for name, curves in known if name not in names]
    choice = vc_method(asked, diagram)
    shortest = realise(asked, shortest_route(asked, diagram))
    first = asked.world.obstacles[0], asked.world.obstacles[1]
    gap = min(x for x, _ in first[1].vertices) - max(x for x, _ in first[0].vertices)
    moved = {}
    for side, wider in (("narrower", -SHIFT), ("wider", SHIFT)):
        other = with_first_gap(asked, wider)
        moved[side] = realise(other, through(ways(other), GATES[0])[1]).trajectory.travel_time
    return {
        "printed": {
            "trajectories": [{"length": s, "time": t, "speed": v} for s, t, v in PRINTED],
            "axis": AXIS,
            "radius": RADIUS_PRINTED,
            "place": "Sec. 2.8, Table 2.2",
        },
        "acceleration": asked.robot.max_acceleration,
        "braking": asked.robot.max_braking,
        "radius": 1.0 / asked.robot.max_curvature,
        "robot_radius": asked.robot.radius,
        "trajectories": [
            _told(name, curves, motion) for (name, curves), motion in zip(chosen, driven, strict=True)
        ],
        "others": others,
        "chosen": class_of(gates, choice.realisation.path),
        "chosen_time": choice.realisation.trajectory.travel_time,
        "same_by_published_cost": choice.same_route,
        "shortest": class_of(gates, shortest.path),
        "gap": round(gap, 9),
        "shift": SHIFT,
        "moved": moved,
        "least_peak": cruising_speed(PRINTED[2][0], PRINTED[2][1], asked.robot.max_acceleration),
    }


def _brief(name: str, motion: Realisation) -> Data:
    length, time = motion.path.length, motion.trajectory.travel_time
    return {"name": name, "length": length, "time": time, "speed": length / time}


def _told(name: str, curves: Curves, motion: Realisation) -> Data:
    return _brief(name, motion) | {
        "arc_length": float(curves.length.sum()),
        "arc_time": motion.arc_time,
        "greatest_speed": float(motion.trajectory.v.max()),
        "least_clearance": float(motion.trajectory.clearance.min()),
        "corners": len(motion.radius),
        "least_radius": float(motion.radius.min()),
        "shortfalls": list(motion.shortfalls),
        "profile": _profile(motion.trajectory),
        "points": _points(motion.path),
    }


def _profile(motion: Trajectory) -> Data:
    """Speed [m/s] over time [s]; v is linear in t between rows."""
    t = np.linspace(0.0, motion.travel_time, SAMPLES)
    return {"t": np.round(t, 4).tolist(), "speed": np.round(motion.at(t)[3], 6).tolist()}


def _points(path: Path) -> list[list[float]]:
    x, y, _, _ = path.at(np.linspace(0.0, path.length, SAMPLES))
    return [[float(a), float(b)] for a, b in np.round(np.column_stack([x, y]), 4)]


def summary(data: Data) -> list[Row]:
    """One row a trajectory."""
    pairs = zip(data["printed"]["trajectories"], data["trajectories"], strict=True)
    return [
        Row(
            what=f"Create, trajectory {i}" + (" (vc-method)" if i == 3 else ""),
            place=data["printed"]["place"],
            printed=f"{p['length']} m, {p['time']:g} s, {p['speed']} m/s",
            ours=f"{o['length']:.2f} m, {o['time']:.1f} s, {o['speed']:.3f} m/s",
            note="reconstruction, laid out so that it comes near",
        )
        for i, (p, o) in enumerate(pairs, start=1)
    ]


def section(data: Data) -> str:
    """What the page says."""
    printed, ours = data["printed"], data["trajectories"]
    rows = []
    for i, (p, o) in enumerate(zip(printed["trajectories"], ours, strict=True), start=1):
        rows += [
            (f"trajectory {i}, length", f"{p['length']} m", f"{o['length']:.3f} m", "fitted"),
            (f"trajectory {i}, duration", f"{p['time']:g} s", f"{o['time']:.2f} s", "fitted"),
            (
                f"trajectory {i}, average speed",
                f"{p['speed']} m/s",
                f"{o['speed']:.3f} m/s",
                f"printed length / duration is {p['length'] / p['time']:.3f}",
            ),
        ]
    last, short, third = ours[2], ours[0], printed["trajectories"][2]
    is_chosen = data["chosen"] == last["name"]
    is_shortest = data["shortest"] == short["name"]
    rows += [
        (
            "greatest speed of trajectory 3",
            f"below {printed['axis']} m/s (axis)",
            f"{last['greatest_speed']:.3f} m/s",
            f"kept near it; {third['length']} m in {third['time']:g} s between two stops needs"
            f" {data['least_peak']:.3f} m/s at least",
        ),
        (
            "the vc-method takes",
            "trajectory 3",
            "trajectory 3" if is_chosen else data["chosen"],
            "with the published edge cost " + ("too" if data["same_by_published_cost"] else "another one"),
        ),
        (
            "the shortest way along the diagram is",
            "trajectory 1",
            "trajectory 1" if is_shortest else data["shortest"],
            f"{short['length']:.2f} m, {last['length'] - short['length']:.2f} m shorter and"
            f" {short['time'] - last['time']:.1f} s slower than trajectory 3",
        ),
    ]
    corners = [
        (
            str(i),
            o["name"],
            f"{o['arc_length']:.3f} m, {o['arc_time']:.2f} s",
            f"{o['length']:.3f} m, {o['time']:.2f} s",
            f"{o['corners']} of {o['least_radius']:.2f} m" + (" or more" if o["corners"] > 1 else ""),
            f"{1000.0 * o['least_clearance']:.1f} mm",
        )
        for i, o in enumerate(ours, start=1)
    ]
    unmet = [s for o in ours for s in o["shortfalls"]]
    fourth = ", ".join(f"{o['name']}: {o['length']:.2f} m in {o['time']:.1f} s" for o in data["others"])
    moved = data["moved"]
    return "\n".join(
        [
            "## iRobot Create among three rectangles: three trajectories",
            "",
            "Manor 2015, Sec. 2.8: an iRobot Create traces three trajectories along the Voronoi diagram"
            " of three rectangles within a rectangular boundary, with"
            f" {data['acceleration']} m/s² to speed up and {data['braking']} m/s² to"
            f" brake and a least turning radius of {printed['radius']} m. The layout is in a photograph"
            " only; ours (`scenarios/create_three_rectangles.yaml`) is a"
            " **reconstruction**: eight of its measures were fitted to the three printed lengths and"
            " durations and to the end of the velocity axis, then rounded. That such a layout exists shows"
            " that Table 2.2 fits together with the limits of the text; it confirms no single number.",
            "",
            "![Map and speed over time](images/reproduction_create.svg)",
            "",
            table(("", "printed", "ours", "what it means"), rows),
            'Controlling the Create "proved to be difficult in the experiments", says the text; ours are the'
            " motions that the vc-method realises along the arcs, corners rounded, from rest to rest:",
            "",
            table(
                ("", "class", "along the arcs", "corners rounded", "corners", "least clearance"),
                corners,
            ),
            f"What the first trajectory takes hangs on millimetres: with a gap of {1000 * data['gap']:g} mm"
            f" and a robot of {2000 * data['robot_radius']:g} mm it is {short['time']:.1f} s, with a gap"
            f" {1000 * data['shift']:g} mm narrower {moved['narrower']:.1f} s, with one as much wider"
            f" {moved['wider']:.1f} s. So its printed 45 s say more about the gap than about the method.",
            "",
            f"Other simple routes of our map: {fourth}."
            if data["others"]
            else "Our map has no other simple route.",
            "",
            "What these motions cannot meet: "
            + ("; ".join(unmet) if unmet else "nothing, every limit is kept")
            + '. The text calls the table "Table 2.8"; its caption says 2.2.',
        ]
    )


def figures(data: Data) -> dict[str, Figure]:
    """The map with the three trajectories, and their speed over time as in Fig. 2.19."""
    figure = Figure(figsize=(7.4, 3.2), layout="constrained")
    plan, speed = figure.subplots(1, 2, width_ratios=(1.0, 1.1))
    draw_room(plan, problem())
    plan.set_ylabel("y [m]")
    for i, (one, colour) in enumerate(zip(data["trajectories"], COLOURS, strict=True), start=1):
        points, profile = np.array(one["points"]), one["profile"]
        plan.plot(*points.T, color=colour, lw=1.6, zorder=4)
        spot = points[len(points) // 2]
        plan.annotate(str(i), tuple(spot), (3, 0), textcoords="offset points", color=colour, weight="bold")
        speed.plot(profile["t"], 1000.0 * np.array(profile["speed"]), color=colour, lw=1.4)
        speed.annotate(
            str(i), (profile["t"][-1], 0.0), (2, 3), textcoords="offset points", color=colour, weight="bold"
        )
    axis = 1000.0 * data["printed"]["axis"]
    speed.axhline(axis, color=INK, lw=0.7, ls="--")
    speed.annotate("axis of Fig. 2.19 ends", (0.5 * speed.get_xlim()[1], axis), (0, 3),
                   textcoords="offset points", fontsize=8)  # fmt: skip
    longest = max(p["time"] for p in data["printed"]["trajectories"])
    speed.set(xlabel="time [s]", ylabel="speed [mm/s]", ylim=(0.0, None), xlim=(0.0, 1.08 * longest))
    return {"create": figure}
