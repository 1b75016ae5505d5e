"""Time of the vc-method against the number of vertices (Manor 2015, Table 4.1: O(n log n)).

Fields of hexagons of about 100 to 10,000 vertices, crossed from corner to corner. The Voronoi diagram is what
every method along arcs needs first and is timed apart; it is the peer of the rest. The peer of the search is
SciPy's Dijkstra on the bare graph, from one cell to all. Times are those of the processor (nothing here runs
on two cores), so that other work on the machine does not count.

`python -m benchmarks.vc_method [FILE.json]` writes what it prints.
"""

from __future__ import annotations

import json
import os
import statistics
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import dijkstra

from benchmarks.large_maps import field_of_hexagons
from vnav_drake.problem import Problem
from vnav_drake.vc_method import AdjacencyGraph, build_adjacency, critical_points, decompose, search
from vnav_drake.vc_method.realise import realise
from vnav_drake.voronoi import build_diagram

HEXAGONS = (16, 50, 166, 500, 1666)  # about 100, 300, 1,000, 3,000 and 10,000 vertices
ROUNDS = 5
DIAGRAM, PLAIN = "Voronoi diagram", "bare Dijkstra"
STAGES = ("decompose", "graph", "search", "realise")
AIM = 15.0  # [s] for 10,000 vertices, diagram and all
EXPONENT = 1.2  # of n, at most


def stages(problem: Problem) -> dict[str, float]:
    """Processor time [s] of each stage, and of the peers."""
    clock, last = {}, time.process_time()

    def lap(stage: str) -> None:
        nonlocal last
        now = time.process_time()
        clock[stage], last = now - last, now

    full = build_diagram(problem.world, problem.robot.radius)
    lap(DIAGRAM)
    diagram = full.restricted(problem.robot.radius + problem.braking.margin)
    decomposition = decompose(critical_points(diagram, problem.braking), diagram)
    lap("decompose")
    graph = build_adjacency(decomposition, problem.braking, problem.robot)
    lap("graph")
    route = search(graph, problem)
    lap("search")
    realise(problem, route.curves)
    lap("realise")
    matrix = bare(graph)
    last = time.process_time()
    dijkstra(matrix, indices=route.cells[0])
    lap(PLAIN)
    return clock


def bare(graph: AdjacencyGraph) -> csr_array:
    """The graph as a matrix, free steps within a stack as steps of next to nothing."""
    count = graph.size[0]
    ends = np.concatenate([graph.type_a, graph.type_a[:, ::-1], graph.type_b, graph.type_b[:, ::-1]])
    weight = np.concatenate([*graph.weight.T, np.full(2 * len(graph.type_b), 1e-12)])
    return coo_array((weight, tuple(ends.T)), shape=(count, count)).tocsr()


def measure() -> dict[str, Any]:
    """Medians [s] for all sizes and the exponents that fit them."""
    rows: list[dict[str, Any]] = []
    for count in HEXAGONS:
        problem = field_of_hexagons(hexagons=count)
        runs = [stages(problem) for _ in range(ROUNDS)]
        times = {stage: statistics.median(run[stage] for run in runs) for stage in runs[0]}
        method = statistics.median(sum(run[stage] for stage in STAGES) for run in runs)
        whole = statistics.median(sum(run[stage] for stage in (DIAGRAM, *STAGES)) for run in runs)
        rows.append(
            {
                "vertices": len(problem.world.vertices),
                "times": times,
                "method": method,
                "whole": whole,
                "over_diagram": method / times[DIAGRAM],
                "search_over_dijkstra": times["search"] / times[PLAIN],
            }
        )
    size = np.log([row["vertices"] for row in rows])

    def exponent(times: Sequence[float]) -> float:
        return float(np.polyfit(size, np.log(times), 1)[0])

    fitted = {stage: exponent([row["times"][stage] for row in rows]) for stage in (DIAGRAM, *STAGES)}
    fitted |= {key: exponent([row[key] for row in rows]) for key in ("method", "whole")}
    load = os.getloadavg()[0]
    return {"rounds": ROUNDS, "cores": os.cpu_count(), "load": load, "sizes": rows, "exponents": fitted}


def table(data: dict[str, Any]) -> str:
    """Markdown: the medians, the ratios to the peers, and the exponents."""
    head = ["vertices", DIAGRAM, *STAGES, "vc-method", "over the diagram", "search over bare Dijkstra"]
    lines = ["| " + " | ".join(head) + " |", "| --- " * len(head) + "|"]
    for row in data["sizes"]:
        times = [row["times"][stage] for stage in (DIAGRAM, *STAGES)]
        cells = [f"{row['vertices']:,}", *(f"{t:.3g}" for t in [*times, row["method"]])]
        cells += [f"{row['over_diagram']:.2g}", f"{row['search_over_dijkstra']:.2g}"]
        lines.append("| " + " | ".join(cells) + " |")
    fitted = [data["exponents"][key] for key in (DIAGRAM, *STAGES, "method")]
    lines.append("| exponent of n | " + " | ".join(f"{e:.2f}" for e in fitted) + " | | |")
    return "\n".join(lines) + "\n"


def verdict(data: dict[str, Any]) -> str:
    """Whether growth and the time of the largest world are what is wanted."""
    exponent, last = data["exponents"]["whole"], data["sizes"][-1]
    return (
        f"diagram and all: exponent {exponent:.2f}, wanted at most {EXPONENT}:"
        f" {'met' if exponent <= EXPONENT else 'missed'};"
        f" {last['vertices']:,} vertices in {last['whole']:.1f} s, wanted within {AIM:.0f} s:"
        f" {'met' if last['whole'] <= AIM else 'missed'}"
    )


def main(file: Path | None = None) -> None:
    """Print the table; write the data to a file if one is named."""
    data = measure()
    print(
        f"fields of hexagons, median processor time [s] of {ROUNDS},"
        f" load {data['load']:.1f} on {data['cores']} cores"
    )
    print(table(data) + verdict(data))
    if file is not None:
        file.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else None)
