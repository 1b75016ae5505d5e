"""One scenario from the question to the report: run the stages, write the evidence, have it judged."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path as FilePath
from typing import Any, TypeVar

import numpy as np

from systems import SimulationError, SimulationRun
from verify import evidence
from verify.atomic import ResultFolder
from verify.execution import execute
from verify.exit_codes import FAILED, OK, UNFINISHED
from verify.interruption import Interruption
from verify.judge import Judgement, judge
from verify.report import ReportExtras, write_report
from verify.versions import versions
from vnav_drake.collocation import Seed, plan_full, plan_variational
from vnav_drake.plan import Path, Plan
from vnav_drake.problem import NoPathError, PlanningError, Problem
from vnav_drake.scenario import Scenario
from vnav_drake.voronoi import VoronoiDiagram, build_diagram
from vnav_drake.voronoi_route import k_best_routes, plan_voronoi_route

T = TypeVar("T")
Say = Callable[[str], None]  # is told what is being done

SAME_LENGTH = 1e-6  # [m]: routes no further apart in length are one
# Facts about a plan that the judge states, so the method's own word for them is not needed.
_JUDGED = frozenset({"travel_time", "length", "model", "feasible", "violations", "unpromised"})


# Methods that a scenario may ask for and that no stage of this version carries out.
ABSENT_METHODS = ("vc_method", "speed_graph", "dwa")
ABSENT = "this version has no such stage; what is reported is found without it"


@dataclass(frozen=True, kw_only=True)
class Missing:
    """A stage that could not finish."""

    stage: str
    reason: str


@dataclass(kw_only=True)
class _Progress:
    """What the stages have given so far."""

    plans: dict[str, Plan] = field(default_factory=dict)
    diagram: VoronoiDiagram | None = None
    run: SimulationRun | None = None
    missing: list[Missing] = field(default_factory=list)
    seconds: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What one run of a scenario gave."""

    judgement: Judgement
    result: Mapping[str, Any]
    report: FilePath
    missing: tuple[Missing, ...]
    # Methods asked for that have no stage, each with `method` and `reason`; the exit code is as without them.
    not_available: tuple[Mapping[str, str], ...] = ()

    @property
    def exit_code(self) -> int:
        """0: all passed, 1: something failed, 3: a stage could not finish or a named gate has no stage."""
        if self.missing or self.judgement.unmet_gates:
            return UNFINISHED
        return OK if self.judgement.passed else FAILED


def run_scenario(
    scenario: Scenario,
    out: FilePath,
    *,
    overrides: Mapping[str, float] | None = None,
    say: Say = lambda _text: None,
) -> Outcome:
    """Plan, simulate, judge and report one scenario into `out/<name>/`, whole or not at all.

    Parameters
    ----------
    overrides : limits of gates that take precedence over the scenario's.

    Raises
    ------
    ScenarioError : there is no path for this robot.
    OutputError : the folder holds something that is not a result.
    OSError : a file could not be written; an earlier result is untouched.
    """
    folder, interruption = ResultFolder(out, scenario.name), Interruption()
    try:
        with interruption:
            try:
                with folder:
                    return _fill(folder, interruption, scenario, overrides or {}, say)
            finally:  # once more, where a signal struck before the folder's own tidying up had begun
                folder.discard()
    finally:
        interruption.restore()


def _fill(
    folder: ResultFolder,
    interruption: Interruption,
    scenario: Scenario,
    overrides: Mapping[str, float],
    say: Say,
) -> Outcome:
    def heeding(text: str) -> None:
        interruption.check()
        say(text)

    done = _run_stages(scenario, heeding, interruption)
    say(f"{scenario.name}: judging")
    _write_evidence(folder.work, scenario, done)
    begun = time.perf_counter()
    judgement = judge(folder.work, overrides)
    done.seconds["judge"] = time.perf_counter() - begun
    result = _result(judgement, done, overrides)
    result["not_available"] = [
        {"method": name, "reason": ABSENT} for name in scenario.plan.methods if name in ABSENT_METHODS
    ]
    say(f"{scenario.name}: writing the report")
    write_report(
        folder.work / evidence.REPORT,
        scenario=scenario,
        result=result,
        folder=folder.work,
        extras=_extras(done),
    )
    result["files"] = evidence.manifest(folder.work)
    evidence.write_result(folder.work, result)
    folder.publish()
    return Outcome(
        judgement=judgement,
        result=result,
        report=folder.final / evidence.REPORT,
        missing=tuple(done.missing),
        not_available=tuple(result["not_available"]),
    )


def _seeds(problem: Problem, diagram: VoronoiDiagram, route: Plan, most: int) -> list[Seed]:
    """The route, then the other fastest ones along Voronoi arcs."""
    seeds = [Seed(_path_of(route), route.method)]
    try:
        others = k_best_routes(problem, diagram, most)
    except NoPathError:  # the route found is the straight way, and the only one
        others = []
    for path in others:
        if all(abs(path.length - seed.path.length) > SAME_LENGTH for seed in seeds):
            seeds.append(Seed(path, route.method))
    return seeds[:most]


def _with_times(seeds: list[Seed], plan: Plan) -> list[Seed]:
    """The variational optimum first, then the seeds with what they led to."""
    rows = plan.details["seeds"] or [{}]
    known = [replace(seed, travel_time=row.get("travel_time")) for seed, row in zip(seeds, rows, strict=True)]
    return [Seed(_path_of(plan), plan.method), *known]


def _path_of(plan: Plan) -> Path:
    if plan.path is None:
        raise PlanningError(f"{plan.method} gave no path to start from")
    return plan.path


def _run_stages(scenario: Scenario, say: Say, interruption: Interruption) -> _Progress:
    """Each stage from what came before; what cannot finish is noted, and what does not need it goes on."""
    problem, effort = scenario.problem, scenario.plan.effort
    done = _Progress()

    def stage(name: str, work: Callable[[], T]) -> T | None:
        say(f"{scenario.name}: {name.replace('_', ' ')}")
        begun = time.perf_counter()
        try:
            return work()
        except NoPathError as error:
            raise scenario.error("goal.position", str(error)) from error
        except (PlanningError, SimulationError) as error:
            interruption.check()
            done.missing.append(Missing(stage=name, reason=str(error)))
            return None
        finally:
            done.seconds[name] = time.perf_counter() - begun
            interruption.check()  # a stage may have swallowed it

    def skip(name: str, needs: str) -> None:
        done.missing.append(Missing(stage=name, reason=f"not run: it needs {needs}"))

    def told(name: str) -> Say:
        return lambda text: say(f"{scenario.name}: {name}, {text}")

    def keep(plan: Plan | None) -> Plan | None:
        if plan is not None:
            done.plans[plan.method] = plan
        return plan

    diagram = done.diagram = stage("voronoi", lambda: build_diagram(problem.world, problem.robot.radius))
    route = None
    if diagram is None:
        skip("voronoi_route", "the Voronoi diagram")
    else:
        route = keep(stage("voronoi_route", lambda: plan_voronoi_route(problem, diagram)))
    seeds = None
    if diagram is not None and route is not None:
        most = scenario.plan.homotopy_classes
        seeds = stage("seeds", lambda: _seeds(problem, diagram, route, most))
    if seeds is None:
        skip("collocation", "a seed")
        skip("refined", "a seed")
    else:
        best = keep(
            stage(
                "collocation",
                lambda: plan_variational(problem, seeds, effort=effort, progress=told("collocation")),
            )
        )

        def refine() -> Plan:
            starts = seeds if best is None else _with_times(seeds, best)
            return plan_full(problem, starts, effort=effort, progress=told("refined"))

        keep(stage("refined", refine))
    refined = done.plans.get("refined")
    if refined is None:
        skip("simulation", "a refined trajectory")
    else:
        execution = stage("simulation", lambda: execute(scenario, refined, told("simulation")))
        if execution is not None:
            keep(execution.plan)
            done.run = execution.run
    return done


def _write_evidence(folder: FilePath, scenario: Scenario, done: _Progress) -> None:
    (folder / evidence.SCENARIO).write_bytes(scenario.data)
    (folder / evidence.TRAJECTORIES).mkdir()
    for name, plan in done.plans.items():
        plan.trajectory.to_csv(folder / evidence.TRAJECTORIES / f"{name}.csv")
    if "refined" in done.plans:
        copy = (folder / evidence.TRAJECTORIES / "refined.csv").read_bytes()
        (folder / evidence.EXECUTED).write_bytes(copy)
    if done.run is not None:
        done.run.to_csv(folder / evidence.SIMULATION)


def _result(judgement: Judgement, done: _Progress, overrides: Mapping[str, float]) -> dict[str, Any]:
    """result.json without the manifest: what the judge found, and what is known of how it was made."""
    result: dict[str, Any] = {"schema": evidence.SCHEMA, **judgement.as_result()}
    for name, plan in done.plans.items():
        facts = {key: value for key, value in plain(plan.details).items() if key not in _JUDGED}
        result["plans"][name] |= facts | {"compute_time": done.seconds[name]}
    if done.run is not None and "simulation" in result:
        figures = result["simulation"]
        about = plain(done.run.details)
        result["simulation"] = (
            about | figures | {"model": done.run.model, "compute_time": done.seconds["simulation"]}
        )
    result["gate_overrides"] = dict(overrides)
    result["missing"] = [{"stage": item.stage, "reason": item.reason} for item in done.missing]
    result["compute_times"] = dict(done.seconds)
    result["versions"] = versions()
    return result


def _extras(done: _Progress) -> ReportExtras:
    history = {
        name: plan.details["history"] for name, plan in done.plans.items() if "history" in plan.details
    }
    return ReportExtras(diagram=done.diagram, history=history, timings=dict(done.seconds))


def plain(value: Any) -> Any:
    """A value as JSON can hold it: numpy scalars as numbers; what is not finite, or no data, left out."""
    if isinstance(value, Mapping):
        pairs = ((str(key), plain(item)) for key, item in value.items())
        return {key: item for key, item in pairs if item is not None}
    if isinstance(value, list | tuple):
        return [item for item in map(plain, value) if item is not None]
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return None
