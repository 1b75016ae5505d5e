"""How well each graph ranks homotopy classes: a study on random worlds.

    python -m benchmarks.ranking --worlds 1000 --out reports/ranking.jsonl

One row of JSON a world, appended as worlds are done; a run that was stopped goes on where it was. The truth
of a world is the least travel time among all classes refined there: the best twelve of the sampled graph,
five of the published one, and that of the fastest route along Voronoi arcs. `--summary FILE` writes the
aggregates.
"""

from __future__ import annotations

import argparse
import json
import signal
import sys
import time
from collections.abc import Iterable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np

from benchmarks.random_worlds import FAMILIES, random_problem
from vnav_drake.homotopy import build_gates, word_of
from vnav_drake.problem import PlanningError, Problem
from vnav_drake.speed_graph.chart import Chart
from vnav_drake.speed_graph.classes import ClassOptimum, refine
from vnav_drake.speed_graph.optimum import POINT, ClassSolver
from vnav_drake.speed_graph.published import build_published, k_best_published
from vnav_drake.speed_graph.sampled import build_sampled, k_best_classes
from vnav_drake.voronoi import build_diagram
from vnav_drake.voronoi_route import k_best_routes, plan_voronoi_route

GRAPHS = ("sampled", "published", "voronoi")
REFINED = 12  # classes of the sampled graph
ALSO = 5  # of the published one
ROUTES = 40  # along Voronoi arcs, from which distinct classes are taken
PATIENCE = 300  # [s] for one world, then it counts as hung
SAME = 1e-9  # relative: times this near are equal
DEPTHS = (1, 2, 3, 4, 5, 6, 8, 10)

Word = tuple[int, ...]


def study(seed: int) -> dict[str, Any]:
    """The row of one world: for each graph the travel times of its classes' optima, in its order."""
    signal.signal(signal.SIGALRM, _too_long)
    signal.alarm(PATIENCE)
    begin = time.perf_counter()
    drawn = random_problem(seed)
    problem = drawn.problem
    row: dict[str, Any] = {
        "seed": seed,
        "family": drawn.family,
        "side": drawn.side,
        "radius": problem.robot.radius,
        "vertices": len(problem.world.vertices),
    }
    try:
        row |= ranked(problem)
    except PlanningError as refusal:
        row |= {"refused": type(refusal).__name__, "message": str(refusal)}
    signal.alarm(0)
    return row | {"seconds": round(time.perf_counter() - begin, 3)}


def ranked(problem: Problem) -> dict[str, Any]:
    """What each graph says of a problem, against the refined classes. Raises PlanningError."""
    radius = problem.robot.radius
    level = radius + problem.braking.margin
    diagram = build_diagram(problem.world, radius)
    gates = build_gates(diagram.restricted(level), level)
    sampled = build_sampled(problem, diagram, gates)
    published = build_published(sampled)
    solver = ClassSolver(sampled.diagram, Chart(problem.world, problem.braking, radius))
    found: dict[Word, ClassOptimum] = {}

    routes = k_best_classes(sampled, REFINED)
    others = k_best_published(published, REFINED)
    for route in [*routes, *others[:ALSO]]:
        if route.word not in found:
            found[route.word] = refine(problem, solver, gates, route)
    # the straight way is not among the routes, but may be the plan
    along = [word_of(gates, plan_voronoi_route(problem, diagram).trajectory)]
    along += [word_of(gates, path) for path in k_best_routes(problem, diagram, ROUTES)]
    order: dict[str, list[Word]] = {
        "sampled": [r.word for r in routes],
        "published": [r.word for r in others],
        "voronoi": list(dict.fromkeys(along))[:REFINED],
    }
    if order["voronoi"][0] not in found:
        for route in k_best_classes(sampled, ROUTES):
            if route.word == order["voronoi"][0]:
                found[route.word] = refine(problem, solver, gates, route)
    attained = {word: c for word, c in found.items() if POINT not in c.failed}
    if not attained:
        raise PlanningError("every class winds round a point obstacle")
    best = sorted(attained.values(), key=lambda c: c.travel_time)
    return {
        "best": [c.travel_time for c in best[:3]],
        "certified": [c.certified for c in best[:3]],
        "failed": [list(c.failed) for c in best[:3]],
        "bound": [c.optimality_bound / c.travel_time for c in best[:3]],
        "all_certified": all(c.certified for c in attained.values()),
        "refined": len(attained),
        "uncertified": sum(not c.certified for c in attained.values()),
        # None: that class was not refined, so it is slower than all graphs' best ones
        "order": {
            graph: [
                attained[w].travel_time if w in attained else None
                for w in words
                if w not in found or w in attained
            ]
            for graph, words in order.items()
        },
        "excess": [r.time / attained[r.word].travel_time - 1.0 for r in routes if r.word in attained],
    }


def _too_long(_signal: int, _frame: FrameType | None) -> None:
    raise TimeoutError(f"a world took more than {PATIENCE} s")


def run(seeds: Sequence[int], out: Path, jobs: int) -> None:
    """Rows of the seeds that `out` does not hold yet, appended to it."""
    done = {row["seed"] for row in rows_of(out)}
    open_seeds = [s for s in seeds if s not in done]
    out.parent.mkdir(parents=True, exist_ok=True)
    _drop_cut_row(out)
    begin = time.monotonic()
    with out.open("a", encoding="utf-8") as file, ProcessPoolExecutor(jobs) as pool:
        waiting: dict[Future[dict[str, Any]], int] = {}
        count = 0
        while open_seeds or waiting:
            while open_seeds and len(waiting) < 2 * jobs:
                seed = open_seeds.pop(0)
                waiting[pool.submit(study, seed)] = seed
            for future in wait(waiting, return_when=FIRST_COMPLETED).done:
                seed = waiting.pop(future)
                error = future.exception()
                row = (
                    future.result()
                    if error is None
                    else {"seed": seed, "crash": f"{type(error).__name__}: {error}"}
                )
                file.write(json.dumps(row) + "\n")
                file.flush()
                count += 1
                _say(len(done) + count, len(done) + count + len(open_seeds) + len(waiting), begin, count)


def _say(done: int, of: int, begin: float, count: int) -> None:
    if sys.stderr.isatty() or done % 50 == 0 or done == of:
        left = (time.monotonic() - begin) / count * (of - done)
        end = "" if sys.stderr.isatty() and done < of else "\n"
        print(f"\r{done} of {of} worlds, {left / 60.0:.0f} min left ", end=end, file=sys.stderr, flush=True)


def _drop_cut_row(out: Path) -> None:
    """Remove a last row that was not written to its end."""
    if out.exists():
        text = out.read_bytes()
        if not text.endswith(b"\n"):
            out.write_bytes(text[: text.rfind(b"\n") + 1])


def rows_of(out: Path) -> list[dict[str, Any]]:
    """Rows written so far, by seed; a last row that is not whole is left out."""
    if not out.exists():
        return []
    lines = out.read_text(encoding="utf-8").splitlines(keepends=True)
    rows = [json.loads(line) for line in lines if line.endswith("\n")]
    return sorted(rows, key=lambda row: row["seed"])


def summary(rows: Iterable[dict[str, Any]]) -> dict[str, Any]:
    """Aggregates of a study; shares are of worlds with a path."""
    every = list(rows)
    rows = [r for r in every if "best" in r]
    if not rows:
        raise ValueError("no world with a path: nothing to say")
    three = np.array([c for r in rows for c in r["certified"]])
    settled = np.array([all(r["certified"]) for r in rows])
    first = np.array([r["certified"][0] for r in rows])
    excess = np.array([e for r in rows for e in r["excess"]])
    refused: dict[str, int] = {}
    for row in every:
        if "refused" in row:
            refused[row["refused"]] = refused.get(row["refused"], 0) + 1
    reasons: dict[str, int] = {}
    for row in rows:
        for reason in (name for names in row["failed"] for name in names):
            reasons[reason] = reasons.get(reason, 0) + 1
    return {
        "worlds": len(every),
        "with_path": len(rows),
        "refused": refused,
        "crashed_or_hung": sum("crash" in r for r in every),
        "families": {family: sum(r["family"] == family for r in rows) for family in FAMILIES},
        "vertices": [int(n) for n in np.percentile([r["vertices"] for r in rows], (0, 50, 100))],
        "classes_refined": sum(r["refined"] for r in rows),
        "certified_of_all": 1.0 - sum(r["uncertified"] for r in rows) / sum(r["refined"] for r in rows),
        "certified_of_three_best": float(three.mean()),
        "certified_best": float(first.mean()),
        "worlds_with_three_certified": int(settled.sum()),
        "failed_of_three_best": reasons,
        "largest_bound_of_certified": max(
            (b for r in rows for b, c in zip(r["bound"], r["certified"], strict=True) if c), default=0.0
        ),
        "graph_excess": {
            "median": float(np.median(excess)),
            "p99": float(np.percentile(excess, 99)),
            "max": float(excess.max()),
        },
        "median_seconds": float(np.median([r["seconds"] for r in rows])),
        "graphs": {graph: _of_graph(rows, graph) for graph in GRAPHS},
    }


def _of_graph(rows: list[dict[str, Any]], graph: str) -> dict[str, Any]:
    """How often the best class is among the first k of a graph, and how far off the first is otherwise."""
    place = np.array([_place(r["order"][graph], r["best"][0]) for r in rows], dtype=float)
    known = [
        (r["order"][graph][0], r["best"][0])
        for r in rows
        if r["order"][graph] and r["order"][graph][0] is not None
    ]
    regret = np.array([t / best - 1.0 for t, best in known])
    wrong = regret[regret > SAME]
    three = np.array([max(_place(r["order"][graph], t) for t in r["best"]) for r in rows], dtype=float)
    return {
        "best_within": {str(k): float((place <= k).mean()) for k in DEPTHS},
        "three_best_within": {str(k): float((three <= k).mean()) for k in DEPTHS if k >= 3},
        "never_within": int((place > DEPTHS[-1]).sum()),
        "first_wrong": int((place > 1).sum()),
        "regret": {
            "known": len(known),
            "median_when_wrong": float(np.median(wrong)) if len(wrong) else 0.0,
            "p90_when_wrong": float(np.percentile(wrong, 90)) if len(wrong) else 0.0,
            "max": float(regret.max(initial=0.0)),
            "sorted_when_wrong": [float(f"{w:.3g}") for w in np.sort(wrong)[::-1][:200]],
        },
    }


def _place(order: list[float | None], time: float) -> float:
    """Place (from 1) of the class with this optimum in a graph's order; infinite when it is not there."""
    at = [i for i, t in enumerate(order, start=1) if t is not None and abs(t - time) <= SAME * time]
    return float(at[0]) if at else float("inf")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run or continue the study; 0 when every world is done."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.ranking", description=__doc__.split("\n")[0])
    parser.add_argument("--worlds", type=int, default=1000, help="seeds 0 to WORLDS - 1")
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument(
        "--out", type=Path, default=Path("reports/ranking.jsonl"), help="a row of JSON a world"
    )
    parser.add_argument("--summary", type=Path, help="write the aggregates here, besides printing them")
    options = parser.parse_args(arguments)
    if options.worlds < 1 or options.jobs < 1:
        parser.error("--worlds and --jobs must be at least 1")
    seeds = range(options.first, options.first + options.worlds)
    run(seeds, options.out, options.jobs)
    result = json.dumps(summary(r for r in rows_of(options.out) if r["seed"] in seeds), indent=1)
    print(result)
    if options.summary is not None:
        options.summary.parent.mkdir(parents=True, exist_ok=True)
        options.summary.write_text(result + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
