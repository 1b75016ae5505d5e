"""The four-point room of Manor 2015, Sec. 3.6.1: from the graph's path to the optimum by Newton's method."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from matplotlib.figure import Figure

from benchmarks.figures import BLUE, GREEN, INK
from benchmarks.reproduction.page import ROOT, Data, Row, table
from vnav_drake.scenario import load_scenario
from vnav_drake.speed_graph import ClassOptimum, speed_graph

SCENARIO = ROOT / "scenarios" / "four_point_room.yaml"
PRINTED_GRAPH, PRINTED_OPTIMUM = 7.8, 7.6  # [s]
PRINTED_ITERATIONS = 5
SETTLED = 1e-5  # [s], below which later changes lie in the thesis
CLASSES = 6


def iterations(times: Sequence[float]) -> int:
    """After how many iterations every further change of the travel time [s] is below SETTLED.

    `times` holds that of the first path and of the path after each iteration.
    """
    large = np.flatnonzero(np.abs(np.diff(times)) >= SETTLED)
    return int(large[-1]) + 1 if len(large) else 0


def measure() -> Data:
    """The best classes from both graphs, with the travel time after every iteration."""
    asked = load_scenario(SCENARIO).problem
    graphs = {}
    kinds: tuple[Literal["published", "sampled"], ...] = ("published", "sampled")
    for kind in kinds:
        result = speed_graph(asked, classes=CLASSES, graph=kind)
        graph = result.sampled if result.published is None or kind == "sampled" else result.published
        graphs[kind] = {
            "nodes": graph.node_count,
            "classes": [_class(c) for c in result.classes],
        }
    return {
        "printed": {
            "graph": PRINTED_GRAPH,
            "optimum": PRINTED_OPTIMUM,
            "iterations": PRINTED_ITERATIONS,
            "settled": SETTLED,
            "place": "Sec. 3.6.1, Fig. 3.10",
        },
        "radius": asked.robot.radius,
        "graphs": graphs,
    }


def _class(found: ClassOptimum) -> Data:
    times = [step.time for step in found.history]
    return {
        "name": found.name,
        "graph_time": found.graph_time,
        "optimum": found.travel_time,
        "bound": found.optimality_bound,
        "certified": found.certified,
        "times": times,
        "kinks": [step.residual for step in found.history],
        "iterations": iterations(times),
    }


def summary(data: Data) -> list[Row]:
    """Graph, optimum, iterations."""
    best, printed = data["graphs"]["published"]["classes"][0], data["printed"]
    return [
        Row(
            what="four-point room, path of the speed graph",
            place=printed["place"],
            printed=f"{printed['graph']} s",
            ours=f"{best['graph_time']:.4f} s",
            note="reconstruction",
        ),
        Row(
            what="four-point room, optimum",
            place=printed["place"],
            printed=f"{printed['optimum']} s",
            ours=f"{best['optimum']:.5f} s",
            note="reconstruction",
        ),
        Row(
            what="four-point room, Newton iterations until changes stay below 1e-5 s",
            place=printed["place"],
            printed=f"{printed['iterations']}",
            ours=f"{best['iterations']}",
            note=_beside(best["iterations"], printed["iterations"]),
        ),
    ]


def _beside(ours: int, printed: int) -> str:
    """A count in words, beside the printed one."""
    if ours == printed:
        return "agrees"
    count = abs(ours - printed)
    number = "one" if count == 1 else str(count)
    return f"{number} {'fewer' if ours < printed else 'more'} than printed, on a reconstruction"


def section(data: Data) -> str:
    """What the page says."""
    printed = data["printed"]
    published, sampled = (data["graphs"][kind] for kind in ("published", "sampled"))
    best, fine = published["classes"][0], sampled["classes"][0]
    loss = 100.0 * (best["graph_time"] / best["optimum"] - 1.0)
    printed_loss = 100.0 * (printed["graph"] / printed["optimum"] - 1.0)
    rows = [
        (
            "path of the speed graph",
            f"{printed['graph']} s",
            f"{best['graph_time']:.4f} s",
            f"{loss:.1f} % above the optimum, printed {printed_loss:.1f} %",
        ),
        (
            "the same, graph sampled along the arcs",
            "",
            f"{fine['graph_time']:.4f} s",
            "our planner's own graph",
        ),
        (
            "optimum of the class",
            f"{printed['optimum']} s",
            f"{best['optimum']:.6f} s",
            f"at most {best['bound']:.0e} s above the least" if best["certified"] else "not certified",
        ),
        (
            "iterations until changes stay below 1e-5 s",
            f"{printed['iterations']}",
            f"{best['iterations']} ({fine['iterations']} from the sampled graph)",
            "those that change which arcs are crossed counted in",
        ),
    ]
    steps = max(len(best["times"]), len(fine["times"]))
    listed = [(str(i), *_step(best, i), *_step(fine, i)) for i in range(steps)]
    others = [
        (
            str(rank),
            c["name"],
            f"{c['graph_time']:.4f}",
            f"{c['optimum']:.4f}",
            f"{100.0 * (c['graph_time'] / c['optimum'] - 1.0):.2f} %",
            str(c["iterations"]),
            "yes" if c["certified"] else "no",
        )
        for rank, c in enumerate(published["classes"], start=1)
    ]
    return "\n".join(
        [
            "## Four-point room: Newton's method",
            "",
            "Manor 2015, Sec. 3.6.1: a room of 10 x 10 m with four points and a_b = 1 m/s². The places of"
            f" points, start, target and the robot's size are lost; ours (radius {data['radius']:g} m) is a"
            " **reconstruction**, so that its times are not those printed. What can be compared is how"
            " little the graph's path loses and how fast Newton's method converges.",
            "",
            table(("", "printed", "ours", "what it means"), rows),
            "Travel time after each iteration, from the path of either graph to the same optimum:",
            "",
            table(
                (
                    "iteration",
                    "published graph [s]",
                    "change [s]",
                    "largest kink [rad]",
                    "sampled graph [s]",
                    "change [s]",
                    "largest kink [rad]",
                ),
                listed,
            ),
            "An iteration without change of time changes the structure of the path: which arcs it crosses,"
            " or follows"
            ' for a stretch ("saturation", Sec. 3.5).',
            "",
            "![Convergence](images/reproduction_room.svg)",
            "",
            "The best classes, from the published graph:",
            "",
            table(
                ("", "class", "graph [s]", "optimum [s]", "graph's loss", "iterations", "certified"),
                others,
            ),
        ]
    )


def _step(found: Data, i: int) -> tuple[str, str, str]:
    times = found["times"]
    if i >= len(times):
        return "", "", ""
    change = "" if i == 0 else f"{times[i] - times[i - 1]:.1e}"
    return f"{times[i]:.7f}", change, f"{found['kinks'][i]:.1e}"


def figures(data: Data) -> dict[str, Figure]:
    """Distance to the optimum after each iteration."""
    figure = Figure(figsize=(5.2, 2.8), layout="constrained")
    axes = figure.subplots()
    for kind, colour, marker in (("published", GREEN, "o"), ("sampled", BLUE, "s")):
        best = data["graphs"][kind]["classes"][0]
        off = np.abs(np.array(best["times"]) - best["optimum"])
        axes.semilogy(np.arange(len(off)), np.maximum(off, 1e-15), marker=marker, ms=4, color=colour)
        axes.annotate(f"{kind} graph", (2.0, off[2]), (8, 4), textcoords="offset points", color=colour)
    axes.axhline(SETTLED, color=INK, lw=0.7, ls="--")
    axes.annotate("1e-5 s", (0.0, SETTLED), (2, 3), textcoords="offset points", fontsize=8)
    count = data["printed"]["iterations"]
    axes.axvline(count, color=INK, lw=0.7, ls=":")
    axes.annotate(f"printed: {count}", (count, 1e-3), (3, 0), textcoords="offset points", fontsize=8)
    axes.set(xlabel="iteration", ylabel="time above the optimum [s]")
    return {"room": figure}
