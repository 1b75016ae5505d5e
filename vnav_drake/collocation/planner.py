"""The two plans of direct collocation: the variational model, and the full robot."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Literal

from vnav_drake.collocation.dubins import dubins_seeds
from vnav_drake.collocation.mesh import Mesh
from vnav_drake.collocation.refine import Budget, Refined, budget_of, refine
from vnav_drake.collocation.seed import Seed, first_mesh
from vnav_drake.collocation.units import unit_braking
from vnav_drake.plan import Model, Path, Plan
from vnav_drake.problem import PlanningError, Problem
from vnav_drake.speed_profile import fastest_profile

SAME_TIME = 1e-4  # a later seed must gain this share to be preferred: coarse meshes tell no finer

Effort = Literal["quick", "full"]
Progress = Callable[[str], None]
NameClass = Callable[[Path], str]  # names the homotopy class of a path


def plan_variational(
    problem: Problem,
    seeds: Path | Sequence[Seed],
    *,
    effort: Effort = "full",
    progress: Progress | None = None,
    class_of: NameClass | None = None,
) -> Plan:
    """The fastest path under the braking distance and the greatest speed alone, near the best seed.

    Certifies the analytic methods, which solve the same model. End speeds are safe, as in
    Manor 2015, ch. 3. The result is a local optimum; near the optimum of its homotopy class it
    is the global one of that class, as the class has a single optimum.

    Parameters
    ----------
    seeds : paths from start to goal, best guess first. Each is tried with one solve of a coarse mesh; the
        fastest is refined. `details["seeds"]` has a row for each: method, class (where the seed has one),
        travel time [s], iterations, compute time [s]; no travel time when nothing safe came of it. A lone
        seed needs no trial: its row is of the whole refinement. `details["refined_seed"]` is the row that was
        refined, `refine_time` [s] how long that took. `details["fault"]` is there when the solver failed
        in a later round; what earlier rounds found then stands.
    class_of : names what came of each seed, as `ended_in`; that need not be the seed's class, as between two
        knots a path can slip past a point.

    Raises
    ------
    PlanningError : no safe geometry was found from any seed.
    """
    return _plan(problem, seeds, "collocation", "variational", effort, progress, class_of)


def plan_full(
    problem: Problem,
    seeds: Path | Sequence[Seed],
    *,
    effort: Effort = "full",
    progress: Progress | None = None,
    class_of: NameClass | None = None,
) -> Plan:
    """The fastest motion within every limit of the robot, end speeds and headings included.

    Parameters and details as for `plan_variational`, whose path is the best first seed. Where an end has a
    heading, Dubins paths between the ends that are clear of obstacles are tried too.

    Raises
    ------
    PlanningError : no motion was found from any seed that satisfies every limit.
    """
    return _plan(problem, seeds, "refined", "full", effort, progress, class_of)


def _plan(
    problem: Problem,
    seeds: Path | Sequence[Seed],
    method: str,
    model: Model,
    effort: Effort,
    progress: Progress | None,
    class_of: NameClass | None,
) -> Plan:
    begun = time.perf_counter()
    tries = [Seed(seeds)] if isinstance(seeds, Path) else list(seeds)
    if model == "full":
        tries += dubins_seeds(problem)
    budget = budget_of(problem, effort)
    scaled, unit = unit_braking(problem)
    guess, chosen, rows = _first_guess(scaled, tries, model, budget, unit, class_of)
    report = None if progress is None else _in_seconds(progress, unit)
    scouted = time.perf_counter()
    result = _refined(scaled, guess, tries[chosen], model, budget, report)
    trajectory = fastest_profile(problem, result.path, model=model)
    work = {
        "iterations": sum(entry.iterations for entry in result.rounds),
        "compute_time": time.perf_counter() - begun,
    }
    if not rows:
        ended = _ended(result.path, class_of)
        rows = [_row(tries[0]) | ended | {"travel_time": trajectory.travel_time} | work]
    details: dict[str, object] = {
        "solver": "SNOPT",
        "transcription": "arcs",
        "intervals": result.mesh.intervals,
        **work,
        "history": [entry.in_seconds(unit) for entry in result.rounds],
        "seeds": rows,
        "refined_seed": chosen,
        "refine_time": time.perf_counter() - scouted,
    }
    if result.fault:
        details["fault"] = result.fault
    return Plan(method=method, model=model, trajectory=trajectory, path=result.path, details=details)


def _refined(
    problem: Problem,
    guess: Mesh,
    seed: Seed,
    model: Model,
    budget: Budget,
    report: Callable[[int, float], None] | None,
) -> Refined:
    """The refinement of a guess, and once more where a zone that depends on the heading is cut between knots.

    A mesh that fails is a bad guess for a finer one, so that begins with the seed again.
    """
    try:
        return refine(problem, guess, model, budget, report)
    except PlanningError:
        if problem.zone is None:
            raise
    finer = replace(budget, intervals=2 * budget.intervals, most_intervals=2 * budget.most_intervals)
    mesh = first_mesh(problem, seed.path, finer.intervals, as_mesh=seed.as_mesh, far=seed.far)
    return refine(problem, mesh, model, finer, report)


def _first_guess(
    problem: Problem,
    seeds: Sequence[Seed],
    model: Model,
    budget: Budget,
    unit: float,
    class_of: NameClass | None,
) -> tuple[Mesh, int, list[dict[str, object]]]:
    """The mesh of the seed that leads to the shortest time, its number, and a row for each seed.

    A lone seed needs no trial and has no row here.
    """
    best: Mesh | None = None
    chosen, least = 0, math.inf
    rows: list[dict[str, object]] = []
    for seed in seeds if len(seeds) > 1 else ():
        begun = time.perf_counter()
        row = _row(seed)
        if seed.travel_time is not None and seed.travel_time > least * unit * (1.0 + SAME_TIME):
            rows.append(row | {"message": "not tried: slower already in the variational model"})
            continue
        try:
            mesh = first_mesh(problem, seed.path, budget.intervals, as_mesh=seed.as_mesh, far=seed.far)
            result = refine(problem, mesh, model, budget.scout)
        except PlanningError as error:
            row["message"] = str(error)
        else:
            travel_time = result.trajectory.travel_time
            row |= _ended(result.path, class_of)
            row["travel_time"] = travel_time * unit
            row["iterations"] = sum(entry.iterations for entry in result.rounds)
            if travel_time < least * (1.0 - SAME_TIME):
                best, chosen, least = result.mesh, len(rows), travel_time
        rows.append(row | {"compute_time": time.perf_counter() - begun})
    if best is None:
        first = seeds[0]
        best = first_mesh(problem, first.path, budget.intervals, as_mesh=first.as_mesh, far=first.far)
    return best, chosen, rows


def _row(seed: Seed) -> dict[str, object]:
    """Where a seed is from, for its row."""
    named = {"class": seed.homotopy_class} if seed.homotopy_class else {}
    return {"method": seed.method, **named}


def _ended(path: Path, class_of: NameClass | None) -> dict[str, object]:
    """What the class of a path is called, where anyone can tell."""
    return {} if class_of is None else {"ended_in": class_of(path)}


def _in_seconds(progress: Progress, unit: float) -> Callable[[int, float], None]:
    return lambda intervals, time: progress(f"{intervals} intervals, {time * unit:.4f} s")
