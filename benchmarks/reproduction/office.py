"""The office floor of Manor 2015, Sec. 3.7: its six best homotopy classes, Table 3.1 and Fig. 3.13."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from benchmarks.figures import BLUE, draw_room
from benchmarks.reproduction.page import ROOT, Data, Row, table
from vnav_drake.homotopy import class_of
from vnav_drake.plan import Path
from vnav_drake.problem import Problem
from vnav_drake.scenario import load_scenario
from vnav_drake.speed_graph import ClassOptimum, speed_graph
from vnav_drake.speed_graph.published import PublishedGraph
from vnav_drake.vc_method import vc_method
from vnav_drake.voronoi import build_diagram, shortest_route
from vnav_drake.voronoi.paths import route_path

SCENARIO = ROOT / "scenarios" / "office_floor.yaml"
PRINTED = (27.9, 33.8, 43.6, 47.7, 54.3, 57.4)  # [s], Table 3.1
PRINTED_SIZE = (30.0, 40.0)  # [m]
PRINTED_OBSTACLES, PRINTED_VERTICES = 25, 60
PRINTED_NODES, PRINTED_EDGES = 94, 422
PRINTED_SHORTEST = 2  # the rank of the class of the geometrically shortest path
SAMPLES = 121  # of a path that is drawn


def problem() -> Problem:
    """Ours."""
    return load_scenario(SCENARIO).problem


def measure() -> Data:
    """The six best classes by the sampled graph, and how the published one ranks them."""
    asked = problem()
    diagram = build_diagram(asked.world, asked.robot.radius)
    count = len(PRINTED)
    result = speed_graph(asked, diagram, classes=count)
    by_published = speed_graph(asked, diagram, classes=count, graph="published")
    if result.published is None:
        raise ValueError("the published graph was not built")
    gates = result.gates
    short = shortest_route(asked, diagram)
    short_class = class_of(gates, route_path(short, asked.start.point, asked.goal.point))
    motion = vc_method(asked, diagram)
    low, high = asked.world.vertices.min(axis=0), asked.world.vertices.max(axis=0)
    return {
        "printed": {
            "times": list(PRINTED),
            "size": list(PRINTED_SIZE),
            "obstacles": PRINTED_OBSTACLES,
            "vertices": PRINTED_VERTICES,
            "nodes": PRINTED_NODES,
            "edges": PRINTED_EDGES,
            "shortest": PRINTED_SHORTEST,
            "place": "Sec. 3.7, Table 3.1",
        },
        "size": sorted((high - low).tolist()),
        "obstacles": len(asked.world.obstacles),
        "vertices": sum(len(o.vertices) for o in asked.world.obstacles),
        "diameter": 2.0 * asked.robot.radius,
        "max_braking": asked.robot.max_braking,
        "arcs": len(diagram.arcs),
        "published": {"nodes": result.published.node_count, "edges": len(result.published.edges)},
        "largest_cell": largest_cell(result.published),
        "sampled": {"nodes": result.sampled.node_count, "edges": len(result.sampled.edges)},
        "classes": [_class(c) for c in result.classes],
        "order_certain": result.certain,
        "by_published": [
            {"name": c.name, "graph_time": c.graph_time, "time": c.travel_time} for c in by_published.classes
        ],
        "shortest": {"name": short_class, "length": float(short.length.sum())},
        "vc_method": {
            "name": class_of(gates, motion.realisation.path),
            "time": motion.realisation.trajectory.travel_time,
            "length": motion.realisation.path.length,
            "same_by_published_cost": motion.same_route,
            "shortfalls": list(motion.realisation.shortfalls),
        },
    }


def largest_cell(graph: PublishedGraph) -> int:
    """How many nodes have edges in the same obstacle's Voronoi cell, at most."""
    rows = np.concatenate([graph.obstacle, graph.obstacle])
    pairs = np.unique(np.column_stack([rows, np.concatenate([graph.edges.tail, graph.edges.head])]), axis=0)
    return int(np.bincount(pairs[:, 0]).max())


def _class(found: ClassOptimum) -> Data:
    return {
        "name": found.name,
        "graph_time": found.graph_time,
        "time": found.travel_time,
        "bound": found.optimality_bound,
        "certified": found.certified,
        "length": found.length,
        "points": _points(found.path),
    }


def _points(path: Path) -> list[list[float]]:
    x, y, _, _ = path.at(np.linspace(0.0, path.length, SAMPLES))
    return [[float(a), float(b)] for a, b in np.round(np.column_stack([x, y]), 3)]


def rank(data: Data, name: str) -> int | None:
    """Of a class among ours, from 1; None where it is not among them."""
    names = [c["name"] for c in data["classes"]]
    return names.index(name) + 1 if name in names else None


def ranked_alike(data: Data) -> bool:
    """Whether the published graph puts our classes in the order of their optima, by its own times."""
    order = sorted(data["by_published"], key=lambda c: c["graph_time"])
    return [c["name"] for c in order] == [c["name"] for c in data["classes"]]


def summary(data: Data) -> list[Row]:
    """The six times, and the size of the graph."""
    printed = data["printed"]
    return [
        Row(
            what="office floor, six best classes",
            place=printed["place"],
            printed=", ".join(f"{t}" for t in printed["times"]) + " s",
            ours=", ".join(f"{c['time']:.1f}" for c in data["classes"]) + " s",
            note="reconstruction, laid out so that they come near",
        ),
        Row(
            what="office floor, nodes and edges of the speed graph",
            place="Sec. 3.7",
            printed=f"{printed['nodes']}, {printed['edges']}",
            ours=f"{data['published']['nodes']}, {data['published']['edges']}",
            note="the sparse graph is not reproduced: see below",
        ),
    ]


def section(data: Data) -> str:
    """What the page says."""
    printed, classes = data["printed"], data["classes"]
    rows = [
        (
            str(i),
            c["name"],
            f"{t} s",
            f"{c['time']:.3f} s",
            f"{100.0 * (c['time'] / t - 1.0):+.1f} %",
            f"{c['length']:.2f} m",
            f"{100.0 * (c['graph_time'] / c['time'] - 1.0):+.2f} %",
            f"yes, within {c['bound']:.0e} s" if c["certified"] else "no",
        )
        for i, (t, c) in enumerate(zip(printed["times"], classes, strict=True), start=1)
    ]
    published, sampled = data["published"], data["sampled"]
    all_certified = all(c["certified"] for c in classes)
    shortest = rank(data, data["shortest"]["name"])
    by_length = min(range(len(classes)), key=lambda i: classes[i]["length"]) + 1
    facts = [
        (
            "obstacles, vertices",
            f"{printed['obstacles']}, {printed['vertices']}",
            f"{data['obstacles']}, {data['vertices']}",
            "the boundary's four are not counted: the text speaks of internal obstacles",
        ),
        (
            "nodes of the speed graph",
            f"{printed['nodes']}",
            f"{published['nodes']}",
            f"one a Voronoi arc, at its narrowest place; ours has {data['arcs']} arcs, and where two are"
            " narrowest at a common end one node serves both; start and target are counted",
        ),
        (
            "edges of the speed graph",
            f"{printed['edges']}",
            f"{published['edges']}",
            "the sparse graph is not reproduced: we join every two nodes on the border of a common cell"
            " (Definition 15), and of our walls most touch the boundary, whose cell has"
            f" {data['largest_cell']} nodes on its border",
        ),
        (
            "nodes and edges of the sampled graph",
            "",
            f"{sampled['nodes']}, {sampled['edges']}",
            "what our planner searches",
        ),
        (
            "class of the geometrically shortest path",
            f"rank {printed['shortest']}",
            f"rank {shortest}" if shortest else "not among the six",
            f"{data['shortest']['length']:.2f} m along the Voronoi arcs;"
            f" of the six optima the shortest is that of rank {by_length}",
        ),
        (
            "order of the six classes by the speed graph's own times",
            "right",
            "right" if ranked_alike(data) else "another one",
            "; ".join(f"{c['graph_time']:.2f}" for c in data["by_published"]) + " s",
        ),
    ]
    vc = data["vc_method"]
    vc_rank = rank(data, vc["name"])
    certified = "All six optima are certified" if all_certified else "Not all six optima are certified"
    certain = "" if data["order_certain"] else "not "
    return "\n".join(
        [
            "## Office floor: six homotopy classes",
            "",
            f"Manor 2015, Sec. 3.7: a floor of {printed['size'][0]:g} x {printed['size'][1]:g} m with"
            f" {printed['obstacles']} inner obstacles, walls and furniture, a robot of"
            f" {data['diameter']:g} m diameter and a_b = {data['max_braking']:g} m/s²; from the lower left"
            " corner of the conference room to the lower chair of the neighbouring office. Coordinates are in"
            " Fig. 3.13 only, which cannot be read: `scenarios/office_floor.yaml` is a **reconstruction**,"
            " its doors, partitions and shelves placed so that the six times come near those printed.",
            "",
            "![The six best paths](images/reproduction_office.svg)",
            "",
            table(
                ("", "class", "printed", "ours", "difference", "length", "graph's path", "certified"),
                rows,
            ),
            f"{certified}, and their order is {certain}certain unless the graph overestimates a class far"
            " more than any that was refined. As they were fitted, the times confirm no printed number. "
            + (
                "What the floor shows is what the thesis says of its own: the fastest class is not that of"
                " the shortest path."
                if shortest != 1
                else "Unlike that of the thesis, the fastest class is that of the shortest path."
            ),
            "",
            table(("", "printed", "ours", "what it means"), facts),
            f"The vc-method's motion takes {vc['time']:.2f} s over {vc['length']:.2f} m in"
            + (f" class {vc_rank}" if vc_rank else f" another class ({vc['name']})")
            + f", {100.0 * (vc['time'] / classes[0]['time'] - 1.0):.1f} % above the best optimum;"
            + (
                " with the published edge cost it takes the same route."
                if vc["same_by_published_cost"]
                else " with the published edge cost it would take another route."
            )
            + (" It cannot meet: " + "; ".join(vc["shortfalls"]) + "." if vc["shortfalls"] else ""),
        ]
    )


def figures(data: Data) -> dict[str, Figure]:
    """The six best paths, in the manner of Fig. 3.13(b), each on a map of its own."""
    figure = Figure(figsize=(7.4, 4.2), layout="constrained")
    maps = figure.subplots(2, 3, sharex=True, sharey=True).flat
    for i, (axes, c) in enumerate(zip(maps, data["classes"], strict=True), start=1):
        draw_room(axes, problem())
        for text in list(axes.texts):
            text.remove()
        axes.plot(*np.array(c["points"]).T, color=BLUE, lw=1.5, zorder=4)
        axes.set_title(f"{i}: {c['time']:.2f} s, {c['length']:.1f} m", fontsize=9)
        axes.set_xlabel("x [m]" if i > 3 else "")
        axes.set_ylabel("y [m]" if i % 3 == 1 else "")
    return {"office": figure}
