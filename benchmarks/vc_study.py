"""What stacks look like, and what the published cost costs, on 200 random worlds (Manor 2015, Ch. 2).

* Sec. 2.4.2: "generically" three saddles around each maximum, so stacks of four cells. How many are?
* #maxima - #saddles is the Euler characteristic of each free part, counted by Shapely.
* Sec. 2.5: how often does the published cost choose another route than the realised one, and how much slower?
* Sec. 2.6: how many motions keep every limit of the robot, and what is it that the others cannot meet?

`python -m benchmarks.vc_study [FILE.json]` writes docs/data/vc_study.json if no other file is named: shares,
and one row a world, so that any of them can be computed again.
"""

from __future__ import annotations

import json
import statistics
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from benchmarks.random_worlds import random_problem, with_wheels_inside
from vnav_drake.problem import NoPathError, PlanningError, Problem
from vnav_drake.vc_method import VcResult, free_components, vc_method
from vnav_drake.voronoi import build_diagram

DATA = Path(__file__).parent.parent / "docs" / "data" / "vc_study.json"
WORLDS = 200


def world(seed: int) -> dict[str, Any]:
    """The row of one random world.

    Raises
    ------
    NoPathError : nothing leads from its start to its goal.
    """
    return {"seed": seed, **studied(with_wheels_inside(random_problem(seed).problem))}


def studied(problem: Problem) -> dict[str, Any]:
    """One world. Costs in s; `cells` are the numbers of cells of its stacks."""
    result = vc_method(problem, build_diagram(problem.world, problem.robot.radius))
    route, other = result.route, result.other
    return {
        "cells": result.decomposition.cell_count.tolist(),
        "saddles_around": np.bincount(
            result.decomposition.side_stack, minlength=len(result.decomposition.maximum)
        ).tolist(),
        "maxima": len(result.critical.maxima),
        "saddles": len(result.critical.saddles),
        "euler_holds": euler_holds(problem, result),
        "on_route": len(route.saddles),
        "same_route": result.same_route,
        "route_time": route.travel_time,
        "published_route_time": other.travel_time,
        "published_cost": other.cost,
        "time": result.realisation.trajectory.travel_time,
        "corners": len(result.realisation.radius),
        "smaller": int(np.sum(result.realisation.radius < result.realisation.wanted * (1.0 - 1e-3))),
        "shortfalls": [text.split(":")[0] for text in result.realisation.shortfalls],
    }


def euler_holds(problem: Problem, result: VcResult) -> bool | None:
    """Whether in each free part the indices sum up to its Euler characteristic; None if too near to tell."""
    critical = result.critical
    level = problem.robot.radius + problem.braking.margin
    try:
        parts, euler = free_components(problem.world, level)
    except PlanningError:
        return None
    # the polygons lie within the exact parts: each point counts with the nearest
    part = shapely.STRtree(parts).nearest(shapely.points(critical.point))
    total = np.bincount(part, weights=critical.index, minlength=len(parts))
    return np.array_equal(total, euler)


def measure(worlds: int = WORLDS) -> dict[str, Any]:
    """Shares and distributions over worlds with seeds from 0, and the rows they come from."""
    rows, refused = [], Counter[str]()
    for seed in range(worlds):
        try:
            rows.append(world(seed))
        except NoPathError as error:
            refused[type(error).__name__] += 1
    return {"worlds": worlds, "refused": dict(refused), **summary(rows), "rows": rows}


def summary(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """What `measure` tells of its rows, one a world with a path."""
    cells = Counter(n for row in rows for n in row["cells"])
    around = Counter(n for row in rows for n in row["saddles_around"])
    euler = Counter(str(row["euler_holds"]) for row in rows)
    differ = [row for row in rows if not row["same_route"]]
    loss = sorted(row["published_route_time"] / row["route_time"] - 1.0 for row in differ)
    short = [row for row in rows if row["shortfalls"]]
    stacks = sum(cells.values())
    return {
        "with_path": len(rows),
        "stacks": stacks,
        "cells_per_stack": {str(n): cells[n] for n in sorted(cells)},
        "saddles_per_stack": {str(n): around[n] for n in sorted(around)},
        "share_of_four": cells[4] / stacks,
        "euler": {"holds": euler["True"], "fails": euler["False"], "too_close": euler["None"]},
        "saddles_on_route": statistics.median(row["on_route"] for row in rows),
        "other_route": len(differ),
        "published_loss": {
            "median": statistics.median(loss) if loss else 0.0,
            "most": loss[-1] if loss else 0.0,
        },
        "published_over_time": statistics.median(row["published_cost"] / row["route_time"] for row in rows),
        "corners": sum(row["corners"] for row in rows),
        "corners_smaller": sum(row["smaller"] for row in rows),
        "with_shortfalls": len(short),
        "shortfalls": dict(Counter(what for row in short for what in row["shortfalls"])),
        "smoothing": statistics.median(row["time"] / row["route_time"] for row in rows),
    }


def text(study: dict[str, Any]) -> str:
    """What the page says of the study."""
    cells, stacks = study["cells_per_stack"], study["stacks"]
    refused = ", ".join(f"{n} {name}" for name, n in study["refused"].items()) or "none"
    euler, loss = study["euler"], study["published_loss"]
    unmet = ", ".join(f"{what} {n}" for what, n in study["shortfalls"].items()) or "none"
    head = ["cells of a stack", *cells]
    share = [f"{100.0 * n / stacks:.1f} %" for n in cells.values()]
    with_path = study["with_path"]
    return "\n".join(
        [
            f"{study['worlds']} random worlds (`benchmarks/random_worlds.py`, seeds 0 to"
            f" {study['worlds'] - 1}, wheels inside the disc; refused by name: {refused}), {stacks} stacks.",
            "",
            "| " + " | ".join(head) + " |",
            "| --- " * len(head) + "|",
            "| " + " | ".join(["share of the stacks", *share]) + " |",
            "",
            f"* Exactly four cells, which the source calls generic: {100.0 * study['share_of_four']:.1f} %.",
            f"* #maxima - #saddles is the Euler characteristic of every free part in {euler['holds']} worlds,"
            f" not in {euler['fails']}; in {euler['too_close']} a passage is too near to the robot's size to"
            " tell by Shapely.",
            f"* The published cost chooses other saddles in {study['other_route']} of {with_path} worlds"
            f" ({100.0 * study['other_route'] / with_path:.0f} %); that route is slower by"
            f" {100.0 * loss['median']:.1f} % (median; most {100.0 * loss['most']:.1f} %). The cost itself is"
            f" {study['published_over_time']:.2f} of the travel time (median).",
            f"* {study['corners']} corners rounded, {study['corners_smaller']} by less than r_min(v), slowed"
            f" down. {study['with_shortfalls']} of {with_path} motions have limits that they cannot meet"
            f" ({unmet}).",
            f"* The motion takes {study['smoothing']:.3f} (median) of the time along the arcs with corners.",
        ]
    )


def written(study: dict[str, Any]) -> str:
    """The file's content: a line a row."""
    shares = json.dumps({k: v for k, v in study.items() if k != "rows"}, indent=1, allow_nan=False)
    rows = ",\n".join(f"  {json.dumps(row, allow_nan=False)}" for row in study["rows"])
    return f'{shares[:-2]},\n "rows": [\n{rows}\n ]\n}}\n'


def main(file: Path = DATA) -> None:
    """Measure, print, write."""
    study = measure()
    print(text(study))
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(written(study), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else DATA)
