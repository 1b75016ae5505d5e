"""The vc-method against the variational optimum: every scenario, and 100 random worlds.

The thesis calls the vc-method "nearly optimal" (Table 4.1) without a figure. The optimum is that of the speed
graph (fastest class, certified or with its bound), which knows nothing but the braking limit; so no motion of
the robot can be faster, and the ratio is never below 1.
"""

from __future__ import annotations

import statistics
from collections import Counter
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from benchmarks.figures import BLUE, INK, ORANGE
from benchmarks.random_worlds import random_problem, with_wheels_inside
from benchmarks.reproduction.page import Data, table
from vnav_drake.homotopy import class_of
from vnav_drake.problem import NoPathError, PlanningError, Problem
from vnav_drake.scenario import load_scenario
from vnav_drake.speed_graph import speed_graph
from vnav_drake.vc_method import vc_method
from vnav_drake.voronoi import build_diagram

SCENARIOS = Path(__file__).parents[2] / "scenarios"
WORLDS = 100
FAR = 2.0  # ratio of lengths: most of the way leads to the arcs and back
CLASSES = 3  # refined to find the fastest


def compared(problem: Problem, through: tuple[str, ...] = ()) -> dict[str, Any]:
    """Times [s] of both methods for one problem.

    `ratio` is that of the realised motion, `arc_ratio` that of the arcs with corners and all; `class_ratio`
    compares the optimum of the vc-method's class, where it is among those refined, with the best one.
    `through` names gates whose optimum is told beside.
    """
    diagram = build_diagram(problem.world, problem.robot.radius)
    graph = speed_graph(problem, diagram, classes=CLASSES, with_published=False)
    found = vc_method(problem, diagram)
    best, motion = graph.classes[0], found.realisation
    name = class_of(graph.gates, motion.path)
    own = next((c.travel_time for c in graph.classes if c.name == name), None)
    out: dict[str, Any] = {
        "optimum": best.travel_time,
        "bound": best.optimality_bound,
        "certified": best.certified,
        "vc_method": motion.trajectory.travel_time,
        "arcs": found.route.travel_time,
        "ratio": motion.trajectory.travel_time / best.travel_time,
        "arc_ratio": found.route.travel_time / best.travel_time,
        "length_ratio": motion.trajectory.length / best.length,
        "same_class": name == best.name,
        "shortfalls": len(motion.shortfalls),
        "rest": "rest" in (problem.start.speed, problem.goal.speed),
    }
    if own is not None:
        out["class_ratio"] = own / best.travel_time
    if through:
        asked = speed_graph(problem, diagram, classes=1, through=through, with_published=False)
        out["through"] = {"gates": list(through), "optimum": asked.classes[0].travel_time}
    return out


def measure() -> Data:
    """All scenarios, and what is found in random worlds with seeds from 0."""
    scenarios = {}
    for file in sorted(SCENARIOS.glob("*.yaml")):
        asked = load_scenario(file)
        scenarios[asked.name] = compared(asked.problem, asked.plan.through)
    worlds: list[dict[str, Any]] = []
    refused: Counter[str] = Counter()
    for seed in range(WORLDS):
        try:
            worlds.append({"seed": seed, **compared(with_wheels_inside(random_problem(seed).problem))})
        except (NoPathError, PlanningError) as error:
            refused[type(error).__name__] += 1
    return {"scenarios": scenarios, "worlds": worlds, "drawn": WORLDS, "refused": dict(refused)}


def below_one(data: Data) -> list[str]:
    """Names of scenarios and seeds whose motion is faster than what is proven; there must be none."""
    rows = [*data["scenarios"].items(), *((f"seed {row['seed']}", row) for row in data["worlds"])]
    return [
        name
        for name, row in rows
        if min(row["vc_method"], row["arcs"]) < row["optimum"] - max(row["bound"], 1e-9 * row["optimum"])
    ]


def section(data: Data) -> str:
    """The table of scenarios, and the distribution over random worlds."""
    rows, notes = [], []
    for name, row in data["scenarios"].items():
        chosen = "fastest" if row["same_class"] else _share(row)
        rows.append(
            [
                name,
                f"{row['optimum']:.3f}",
                f"{row['arcs']:.3f}",
                f"{row['vc_method']:.3f}",
                f"{row['ratio']:.3f}",
                f"{row['length_ratio']:.3f}",
                chosen,
                str(row["shortfalls"]),
            ]
        )
        if "through" in row:
            asked = row["through"]
            notes.append(
                f"`{name}` asks another question: its plan is bound to the class through"
                f" {', '.join(asked['gates'])}, whose optimum is {asked['optimum']:.3f} s. The vc-method"
                " takes no such orders; its row is against the fastest class of the same world."
            )
    rest = [f"`{name}`" for name, row in data["scenarios"].items() if row["rest"]]
    if rest:
        notes.append(
            f"{', '.join(rest)}: from or to rest. The optimum is not, so that the ratio holds the ramps too."
        )
    far = [f"`{name}`" for name, row in data["scenarios"].items() if row["length_ratio"] > FAR]
    if far:
        notes.append(
            f"{', '.join(far)}: the method goes to the nearest Voronoi arc and back again, which is far away"
            " in a hall with nothing but one obstacle near; the optimum stays where it is."
        )
    head = ["scenario", "optimum [s]", "along the arcs [s]", "vc-method [s]", "ratio", "ratio of lengths"]
    scenarios = table([*head, "class", "shortfalls"], rows)
    worlds = data["worlds"]
    clean = [row for row in worlds if not row["shortfalls"]]
    refused = ", ".join(f"{n} {what}" for what, n in data["refused"].items()) or "none"
    spread = table(
        ["over the optimum", "worlds", "least", "median", "nine in ten below", "worst"],
        [
            _spread("vc-method", [row["ratio"] for row in worlds]),
            _spread("vc-method, nothing of the robot unmet", [row["ratio"] for row in clean]),
            _spread("along the arcs, corners and all", [row["arc_ratio"] for row in worlds]),
            _spread(
                "optimum of the class that it chose",
                [row["class_ratio"] for row in worlds if "class_ratio" in row],
            ),
        ],
    )
    wrong = sum(not row["same_class"] for row in worlds)
    missing = sum("class_ratio" not in row for row in worlds)
    below = ", ".join(below_one(data)) or "none"
    return "\n".join(
        [
            "## The vc-method against the variational optimum",
            "",
            'Table 4.1 calls the vc-method "nearly optimal" and prints no figure. Ours: the travel time of'
            " the realised motion (every limit of the robot, corners rounded) over the optimum of the speed"
            " graph, which has the braking limit alone and is the least time of any motion.",
            "",
            scenarios,
            *(f"* {note}" for note in notes),
            *([""] if notes else []),
            '"class" is whether the vc-method chose the fastest homotopy class, else what the optimum of'
            " its class loses. Shortfalls are limits that the motion says it cannot meet.",
            "",
            f"Random worlds, seeds 0 to {data['drawn'] - 1}, wheels inside the robot's disc (refused by name:"
            f" {refused}):",
            "",
            spread,
            f"Another class than the fastest was chosen in {wrong} of {len(worlds)} worlds"
            f" ({missing} times one beyond the {CLASSES} refined). Faster than the optimum: {below}.",
            "",
            "![Ratio of the vc-method to the optimum](images/reproduction_ratios.svg)",
            "",
        ]
    )


def _share(row: dict[str, Any]) -> str:
    return f"+{100.0 * (row['class_ratio'] - 1.0):.1f} %" if "class_ratio" in row else "beyond those refined"


def _spread(what: str, values: list[float]) -> list[str]:
    if len(values) < 2:
        return [what, str(len(values)), *["-"] * 4]
    ninth = statistics.quantiles(values, n=10)[8]
    figures = [min(values), statistics.median(values), ninth, max(values)]
    return [what, str(len(values)), *(f"{v:.3f}" for v in figures)]


def figures(data: Data) -> dict[str, Figure]:
    """Ratios over the random worlds in order, and those of the scenarios."""
    figure = Figure(figsize=(7.2, 3.0), layout="constrained")
    left, right = figure.subplots(1, 2)
    for key, name, colour in (("ratio", "vc-method", ORANGE), ("arc_ratio", "along the arcs", BLUE)):
        values = sorted(row[key] for row in data["worlds"])
        left.step([100.0 * (i + 1) / len(values) for i in range(len(values))], values, color=colour)
        left.annotate(
            name, (100.0, values[-1]), (-4, 2), textcoords="offset points", ha="right", color=colour
        )
    left.axhline(1.0, color=INK, lw=0.8, ls="--")
    left.annotate("optimum", (0.0, 1.0), (2, 3), textcoords="offset points", fontsize=8)
    left.set(xlabel="random worlds, sorted [%]", ylabel="time over the optimum", yscale="log")
    names = list(data["scenarios"])
    ratios = [data["scenarios"][name]["ratio"] for name in names]
    right.barh(names[::-1], [r - 1.0 for r in ratios[::-1]], left=1.0, color=ORANGE)
    right.axvline(1.0, color=INK, lw=0.8, ls="--")
    right.set_xlabel("time over the optimum")
    right.tick_params(axis="y", labelsize=7)
    return {"ratios": figure}
