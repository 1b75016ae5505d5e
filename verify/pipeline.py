"""One scenario from the question to the report: run the stages, write the evidence, have it judged."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from verify import evidence
from verify.atomic import ResultFolder
from verify.bounding import about
from verify.by_products import THUMBNAIL, FigureFormat
from verify.choosing import drive_as_planned, optimum_to_execute
from verify.driving import (
    about_studies,
    drive_prescreen,
    main_model,
    show_replay,
    stop_everywhere,
    study,
    wiring,
)
from verify.execution import execute, plan_again
from verify.exit_codes import FAILED, OK, UNFINISHED
from verify.field_stage import FieldPlanner, write_fields
from verify.interruption import Interruption
from verify.judge import Judgement, judge
from verify.planning import plan_everything
from verify.previous import keep_previous
from verify.report import ReportExtras, SpeedGraphDrawing, executed_thumbnail, write_report
from verify.stages import Missing, Progress, Say, Stages
from verify.vc_drawing import vc_drawing
from verify.versions import versions
from vnav_drake.homotopy import class_of, word_of
from vnav_drake.scenario import Scenario

# Facts about a plan that the judge states, so the method's own word for them is not needed.
_JUDGED = frozenset({"reached", "travel_time", "length", "model", "feasible", "violations", "unpromised"})


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What one run of a scenario gave."""

    judgement: Judgement
    result: Mapping[str, Any]
    report: FilePath
    missing: tuple[Missing, ...]

    @property
    def unfinished(self) -> tuple[Missing, ...]:
        """What is missing, but for stages that only serve a gate: there the gate decides."""
        return tuple(item for item in self.missing if not item.only_for)

    @property
    def exit_code(self) -> int:
        """0: all passed, 1: something failed, 3: a stage could not finish or a named gate has no stage."""
        if self.unfinished or self.judgement.unfinished_gates:
            return UNFINISHED
        return OK if self.judgement.passed else FAILED


def run_scenario(
    scenario: Scenario,
    out: FilePath,
    *,
    overrides: Mapping[str, float] | None = None,
    say: Say = lambda _text: None,
    workers: int = 1,
    figures: FigureFormat | None = None,
) -> Outcome:
    """Plan, simulate, judge and report one scenario into `out/<name>/`, whole or not at all.

    Parameters
    ----------
    overrides : limits of gates that take precedence over the scenario's.
    say : is told what is being done.
    workers : processes that may share the simulations; with more than one, the main part of a script must be
        guarded, as `multiprocessing` asks. Results do not depend on it.
    figures : also write the report's pictures as files for papers.

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
                    stages = Stages(
                        scenario=scenario,
                        say=lambda text: _heeding(interruption, say, text),
                        interruption=interruption,
                        workers=workers,
                    )
                    return _fill(folder, stages, overrides or {}, figures)
            finally:  # once more, where a signal struck before the folder's own tidying up had begun
                folder.discard()
    finally:
        interruption.restore()


def _heeding(interruption: Interruption, say: Say, text: str) -> None:
    interruption.check()
    say(text)


def _fill(
    folder: ResultFolder, stages: Stages, overrides: Mapping[str, float], figures: FigureFormat | None
) -> Outcome:
    scenario = stages.scenario
    done = stages.done
    plan_everything(stages, overrides)
    judgement = _executed_optimum(stages, folder.work, overrides)
    if judgement is None:
        _execute_refined(stages)
        judgement = _judged(stages, folder.work, overrides)
    show_replay(stages, folder.work)
    result = _result(judgement, done, overrides, scenario.plan.through)
    result["files"] = evidence.manifest(folder.work)  # which the report tells; its own sum comes after it
    stages.say(f"{scenario.name}: writing the report")
    write_report(
        folder.work / evidence.REPORT,
        scenario=scenario,
        result=result,
        folder=folder.work,
        extras=_extras(scenario, done),
        figures=figures,
    )
    _write_thumbnail(folder.work, scenario, done)
    result["files"] = evidence.manifest(folder.work)
    evidence.write_result(folder.work, result)
    folder.publish(keep_previous)
    return Outcome(
        judgement=judgement,
        result=result,
        report=folder.final / evidence.REPORT,
        missing=tuple(done.missing),
    )


def _executed_optimum(stages: Stages, folder: FilePath, overrides: Mapping[str, float]) -> Judgement | None:
    """The judgement with the variational optimum executed, where that is certified; else None.

    Nothing is left to refine then. Whether it is so, the judge says.
    """
    scenario, done = stages.scenario, stages.done
    if done.bound is None:
        return None
    optimum = optimum_to_execute(scenario, done.plans)
    if optimum is None:
        return None
    model = main_model(scenario)
    run = stages.run("simulation", lambda: drive_as_planned(scenario, optimum, model))
    if run is None:
        return None
    done.executed, done.run = optimum.method, run
    done.prescreen = drive_prescreen(stages, optimum)
    judgement = _judged(stages, folder, overrides)
    if judgement.lacks_only_stops:  # they take long, so whatever else may stand against it is asked first
        done.stops = stop_everywhere(stages, optimum)
        judgement = _judged(stages, folder, overrides)
    if judgement.verdict == "certified" and judgement.passed:
        done.studies = study(stages, optimum)
        return judgement
    done.executed, done.run, done.prescreen, done.stops = None, None, None, None
    return None


def _execute_refined(stages: Stages) -> None:
    """Drive the refined plan, held back where the vehicle cannot follow it."""
    scenario, done = stages.scenario, stages.done
    refined = done.plans.get("refined")
    if refined is None:
        stages.skip("simulation", "a refined trajectory")
        return
    done.executed = refined.method
    told = stages.told("simulation")
    model = main_model(scenario)
    fields = None if done.fields is None else FieldPlanner(scenario, done.fields)
    again = plan_again if fields is None else fields.again
    execution = stages.run("simulation", lambda: execute(scenario, refined, model, told, again))
    if execution is not None:
        if fields is not None:
            done.fields = fields.of(execution.plan)
        done.keep(execution.plan)
        done.run = execution.run
        done.prescreen = drive_prescreen(stages, execution.plan)
        done.stops = stop_everywhere(stages, execution.plan)
        done.studies = study(stages, execution.plan)


def _judged(stages: Stages, folder: FilePath, overrides: Mapping[str, float]) -> Judgement:
    """The judgement of what there is so far."""
    stages.say(f"{stages.scenario.name}: judging")
    _write_evidence(folder, stages.scenario, stages.done)
    begun = time.perf_counter()
    judgement = judge(folder, overrides)
    seconds = stages.done.seconds
    seconds["judge"] = seconds.get("judge", 0.0) + time.perf_counter() - begun
    return judgement


def _write_thumbnail(folder: FilePath, scenario: Scenario, done: Progress) -> None:
    """The executed path, or the world alone."""
    plan = None if done.executed is None else done.plans[done.executed]
    text = executed_thumbnail(scenario.problem, None if plan is None else (plan.method, plan.trajectory))
    (folder / THUMBNAIL).write_text(text, encoding="utf-8", newline="\n")


def _write_evidence(folder: FilePath, scenario: Scenario, done: Progress) -> None:
    (folder / evidence.SCENARIO).write_bytes(scenario.data)
    (folder / evidence.TRAJECTORIES).mkdir(exist_ok=True)
    for name, plan in done.plans.items():
        plan.trajectory.to_csv(folder / evidence.TRAJECTORIES / f"{name}.csv")
    driven = (evidence.EXECUTED, evidence.SIMULATION, evidence.SIMULATION_SINGLE_TRACK, evidence.STOPS)
    for name in driven:  # of an earlier choice
        (folder / name).unlink(missing_ok=True)
    if done.executed is not None:
        copy = (folder / evidence.TRAJECTORIES / f"{done.executed}.csv").read_bytes()
        (folder / evidence.EXECUTED).write_bytes(copy)
    if done.run is not None:
        done.run.to_csv(folder / evidence.SIMULATION)
    if done.prescreen is not None:
        done.prescreen.to_csv(folder / evidence.SIMULATION_SINGLE_TRACK)
    if done.stops is not None:
        done.stops.save(folder / evidence.STOPS)
    if done.fields is not None:
        write_fields(folder, done.fields)
    if done.bound is not None:
        done.bound.certificate.save(folder / evidence.CERTIFICATE)


def _result(
    judgement: Judgement, done: Progress, overrides: Mapping[str, float], through: Sequence[str]
) -> dict[str, Any]:
    """result.json without the manifest: what the judge found, and what is known of how it was made."""
    result: dict[str, Any] = {"schema": evidence.SCHEMA, **judgement.as_result()}
    for name, plan in done.plans.items():
        facts = {key: value for key, value in plain(plan.details).items() if key not in _JUDGED}
        if done.gates is not None and plan.details.get("reached", True):
            facts["class"] = class_of(done.gates, plan.trajectory)
            if through:
                facts["passes_through"] = done.gates.matches(word_of(done.gates, plan.trajectory), through)
        result["plans"][name] |= facts | {"compute_time": done.seconds[name]}
    if done.comparison and "collocation" in result["plans"]:
        result["plans"]["collocation"]["comparison"] = plain(done.comparison)
    if done.run is not None and "simulation" in result:
        figures = result["simulation"]
        driven = plain(done.run.details)
        result["simulation"] = (
            driven | figures | {"model": done.run.model, "compute_time": done.seconds["simulation"]}
        )
        if done.studies is not None:
            result["simulation"] |= plain(about_studies(done.studies))
    if done.bound is not None and "lower_bound" in result:
        how = plain(about(done.bound)) | {"compute_time": done.seconds["lower_bound"]}
        result["lower_bound"] = how | result["lower_bound"]
    if done.fields is not None and "zone" in result:
        result["zone"]["fields"] = plain(done.fields.about) | result["zone"].get("fields", {})
    result["gate_overrides"] = dict(overrides)
    result["missing"] = [{"stage": item.stage, "reason": item.reason} for item in done.missing]
    result["compute_times"] = dict(done.seconds)
    result["versions"] = versions()
    return result


def _extras(scenario: Scenario, done: Progress) -> ReportExtras:
    history = {
        name: plan.details["history"] for name, plan in done.plans.items() if "history" in plan.details
    }
    return ReportExtras(
        diagram=done.diagram,
        history=history,
        timings=dict(done.seconds),
        speed_graph=SpeedGraphDrawing() if done.analytic is None else done.analytic.drawing,
        vc_method=None if done.vc is None else vc_drawing(scenario.problem, done.vc.result),
        diagram_of_systems=wiring(scenario, done),
    )


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
