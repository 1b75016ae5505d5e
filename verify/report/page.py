"""The report of one scenario: one self-contained HTML file."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from verify.report import story
from verify.report.bound import read_bound
from verify.report.drawings import SpeedGraphDrawing, VcDrawing
from verify.report.evidence import read_evidence
from verify.report.explorer import explorer_scripts, explorer_sections
from verify.report.glance_sections import glance_sections
from verify.report.html import render, write_whole
from verify.report.inputs import robot_rows
from verify.report.method_sections import bound_sections, class_sections, vc_sections
from verify.report.motion_sections import motion_sections, subject
from verify.report.numbers import duration
from verify.report.simulation import Wired, simulation_sections, wiring
from verify.report.story_bound import bound_story
from verify.report.story_missing import by_section, reasons
from verify.report.story_seeds import seed_story
from verify.report.story_stuck import lost_run, stuck_runs
from verify.report.story_vc import vc_story
from verify.report.story_zone import relaxation_sentence
from verify.report.wording import GLOSSARY
from verify.report.zone_sections import VIEWER as ZONE_VIEWER
from verify.report.zone_sections import motion_zone, zone_of, zone_sections

if TYPE_CHECKING:
    from verify.by_products import FigureFormat
    from vnav_drake.scenario import Scenario
    from vnav_drake.voronoi import VoronoiDiagram

VIEWER = "space_viewer.js"
PICKER = "classes.js"


@dataclass(frozen=True, kw_only=True)
class ReportExtras:
    """What the result folder does not hold; for pictures only, never for figures of the verdict."""

    diagram: VoronoiDiagram | None = None
    voronoi_polylines: Sequence[np.ndarray] = ()  # (n, 2) [m] each, used when there is no diagram
    # per plan: rounds of mesh refinement with the keys
    # round, intervals, iterations, travel_time [s], worst_violation, solver_time [s]
    history: Mapping[str, Sequence[Mapping[str, Any]]] = field(default_factory=dict)
    timings: Mapping[str, float] = field(default_factory=dict)  # stage -> [s]
    speed_graph: SpeedGraphDrawing = field(default_factory=SpeedGraphDrawing)
    vc_method: VcDrawing | None = None
    diagram_of_systems: Wired | None = None  # what was simulated, for the appendix


def write_report(
    file: Path,
    *,
    scenario: Scenario,
    result: Mapping[str, Any],
    folder: Path,
    extras: ReportExtras,
    figures: FigureFormat | None = None,
) -> None:
    """Write the report of one scenario to `file`, whole or not at all.

    Parameters
    ----------
    file : where to write; its folder must exist.
    scenario : the question.
    result : the content of result.json; every figure of the verdict comes from here.
    folder : the result folder with the trajectories; what is missing there is named in the page.
    extras : what only pictures need.
    figures : also write every picture into `folder/figures`, for papers.

    Raises
    ------
    OSError : a file cannot be written.
    """
    evidence, problem = read_evidence(folder), scenario.problem
    plan = evidence.executed_plan or "refined"
    lost = lost_run(result, evidence.simulation)
    stuck = (*stuck_runs(result), *([] if lost is None else [lost]))
    rest = problem.start.speed != "safe" or problem.goal.speed != "safe"
    along = motion_zone(problem, result, evidence)
    unproven = bound_story(result).missing
    certificate = (None, unproven) if unproven else read_bound(folder)
    linked = explorer_sections(
        problem, result, evidence, extras, along, certificate, reasons(scenario, result)
    )
    classes = class_sections(problem, result, extras.speed_graph)
    scripts = [
        *([PICKER] if classes["classes"] else []),
        *explorer_scripts(linked),
        *([] if extras.vc_method is None else [VIEWER]),
        *([] if along is None else [ZONE_VIEWER]),
    ]
    values: dict[str, Any] = dict(
        name=scenario.name,
        description=scenario.description,
        undone=by_section(result),
        **glance_sections(scenario, result, evidence, stuck, lost),
        **linked,
        **classes,
        has_vc=extras.vc_method is not None
        or bool(story.mapping(story.mapping(result, "plans"), "vc_method")),
        vc=vc_story(result, rest_ends=rest),
        **vc_sections(problem, extras.vc_method),
        **bound_sections(problem, result, evidence, certificate),
        **zone_sections(problem, result, evidence, along, plan=plan, subject=subject(result, evidence)),
        zone_has_uniform="uniform" in evidence.plans,
        relaxation=relaxation_sentence(result),
        **motion_sections(problem, result, evidence, extras, along, stuck),
        seeds=seed_story(result),
        **simulation_sections(scenario, result, evidence, plan, zone_of(problem, evidence)),
        **wiring(extras.diagram_of_systems),
        not_evaluated=story.not_evaluated(result, evidence),
        scenario_text=evidence.scenario_text,
        scenario_reason=evidence.reason("scenario.yaml"),
        scenario_sha256=story.words(result.get("scenario_sha256")),
        robot=robot_rows(problem),
        versions=sorted((str(k), story.words(v)) for k, v in story.mapping(result, "versions").items()),
        timings=[(stage, duration(time)) for stage, time in extras.timings.items()],
        total=duration(math.fsum(extras.timings.values())),
        files=sorted((str(k), story.words(v)) for k, v in story.mapping(result, "files").items()),
        glossary=GLOSSARY,
    )
    write_whole(file, render("report.html", scripts=scripts, **values))
    if figures is not None:
        from verify.report.paper import write_figures  # its libraries are for those who ask

        write_figures(folder, values.values(), figures, name=scenario.name)
