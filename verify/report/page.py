"""The report of one scenario: one self-contained HTML file."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from markupsafe import Markup

from verify.report import story
from verify.report.answer import answer, others
from verify.report.bound import BoundMesh, read_bound
from verify.report.drawings import SpeedGraphDrawing, VcDrawing
from verify.report.evidence import Evidence, read_evidence
from verify.report.explorer import explorer_scripts, explorer_sections
from verify.report.figures_bound import draw_closing
from verify.report.figures_cells import draw_cells
from verify.report.figures_classes import draw_class_map, draw_class_speeds, draw_newton
from verify.report.figures_graph import draw_graphs
from verify.report.figures_map import MapData, draw_map
from verify.report.figures_margins import MarginsData, draw_margins
from verify.report.figures_mesh import MeshData, draw_mesh
from verify.report.figures_motion import FrictionData, SpeedData, draw_friction, draw_speed_curve
from verify.report.figures_potential import Way, draw_potential, draw_slack
from verify.report.figures_space import draw_space
from verify.report.figures_time import BracketData, BracketRow, draw_bracket
from verify.report.figures_unfolded import draw_unfolded
from verify.report.html import render, write_whole
from verify.report.inputs import robot_rows
from verify.report.key_figures import key_figures
from verify.report.numbers import duration, number_in, significant
from verify.report.palette import METHODS, method
from verify.report.section import Section
from verify.report.series import margins, mesh_of
from verify.report.simulation import Wired, simulation_sections, wiring
from verify.report.space_data import space_data
from verify.report.story_bound import BoundStory, bound_story, closing, full_bound, upper
from verify.report.story_classes import analytic_row, class_rows, graph_words
from verify.report.story_seeds import seed_story
from verify.report.story_stuck import StuckRun, lost_run, stuck_runs
from verify.report.story_times import breaks, goes_astray, time_rows, window_sentence
from verify.report.story_vc import vc_story
from verify.report.story_zone import relaxation_sentence
from verify.report.svg import Picture
from verify.report.wording import GLOSSARY, VERDICTS
from verify.report.zone_along import ZoneAlong
from verify.report.zone_sections import VIEWER as ZONE_VIEWER
from verify.report.zone_sections import motion_zone, zone_of, zone_sections
from vnav_drake.plan import Trajectory
from vnav_drake.problem import Problem

if TYPE_CHECKING:
    from vnav_drake.scenario import Scenario
    from vnav_drake.voronoi import VoronoiDiagram

VIEWER = "space_viewer.js"
ARC_SPACING_SHARE = 1.0 / 400.0  # of the world's diameter: about two pixels on a map


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
    file: Path, *, scenario: Scenario, result: Mapping[str, Any], folder: Path, extras: ReportExtras
) -> None:
    """Write the report of one scenario to `file`, whole or not at all.

    Parameters
    ----------
    file : where to write; its folder must exist.
    scenario : the question.
    result : the content of result.json; every figure of the verdict comes from here.
    folder : the result folder with the trajectories; what is missing there is named in the page.
    extras : what only pictures need.

    Raises
    ------
    OSError : the file cannot be written.
    """
    evidence, problem = read_evidence(folder), scenario.problem
    plan = evidence.executed_plan or "refined"
    classes, lost = class_rows(result), lost_run(result, evidence.simulation)
    stuck = [*stuck_runs(result), *([] if lost is None else [lost])]
    rest = problem.start.speed != "safe" or problem.goal.speed != "safe"
    along = motion_zone(problem, result, evidence)
    unproven = bound_story(result).missing
    certificate = (None, unproven) if unproven else read_bound(folder)
    linked = explorer_sections(problem, result, evidence, extras, along, certificate)
    text = render(
        "report.html",
        scripts=[
            *explorer_scripts(linked),
            *([] if extras.vc_method is None else [VIEWER]),
            *([] if along is None else [ZONE_VIEWER]),
        ],
        name=scenario.name,
        description=scenario.description,
        verdict=story.verdict(result),
        verdict_meaning=VERDICTS.get(story.verdict(result), ("", ""))[1],
        headline=story.headline(result),
        verdict_reasons=story.reasons(result),
        standing=story.standing(result),
        answer=answer(
            result, rest_ends=rest, through=scenario.plan.through, lost="" if lost is None else lost.sentence
        ),
        others=others(result, rest_ends=rest),
        gate_summary=story.gate_summary(result),
        gates=story.gate_rows(result),
        checks=story.check_rows(result),
        failing=[row for row in story.gate_rows(result) if row.status == story.FAILED],
        failing_checks=[row for row in story.check_rows(result) if row.status == story.FAILED],
        marks=story.MARKS,
        key_figures=key_figures(result, evidence),
        times=[*time_rows(result), *(run.row for run in stuck)],
        reference=method(story.reference_plan(result)).label if story.reference_plan(result) else "",
        bracket=_bracket(result),
        full_bound=number_in(result, "plans", "refined", "travel_time") is not None,
        analytic=analytic_row(result),
        looks=METHODS,
        has_classes=bool(classes or extras.speed_graph.classes or extras.speed_graph.graphs),
        classes=classes,
        graph_words=graph_words(result),
        through=scenario.plan.through,
        **_class_sections(problem, extras.speed_graph),
        has_vc=extras.vc_method is not None
        or bool(story.mapping(story.mapping(result, "plans"), "vc_method")),
        vc=vc_story(result, rest_ends=rest),
        **_vc_sections(problem, extras.vc_method),
        seeds=seed_story(result),
        stuck=[run.sentence for run in stuck],
        window=window_sentence(result),
        executed=story.is_executed(result),
        hollow=any(breaks(result, name) for name in story.travel_times(result)),
        subject=_subject(result, evidence),
        **_bound_sections(problem, result, evidence, certificate),
        **linked,
        map=_map(problem, result, evidence, extras, stuck),
        map_lines=[method(name) for name, _ in _map_lines(evidence)]
        + ([method("simulation")] if story.strayed(result) and evidence.simulation is not None else []),
        **zone_sections(problem, result, evidence, along, plan=plan, subject=_subject(result, evidence)),
        zone_has_uniform="uniform" in evidence.plans,
        relaxation=relaxation_sentence(result),
        has_arcs=extras.diagram is not None or bool(extras.voronoi_polylines),
        speed=_with_motion(
            evidence,
            lambda motion: [
                draw_speed_curve(
                    SpeedData(
                        problem=problem,
                        motion=motion,
                        plan=plan,
                        over=over,
                        variational=_variational(result, evidence),
                        subject=_subject(result, evidence),
                        along=along,
                    )
                )
                for over in ("path", "time")
            ],
        ),
        friction=_with_motion(
            evidence,
            lambda _motion: draw_friction(
                FrictionData(problem=problem, motions=_compared(result, evidence, plan))
            ),
        ),
        tip_acceleration=significant(problem.robot.tip_acceleration),
        margins=_with_motion(
            evidence, lambda motion: draw_margins(_margins(problem, result, evidence, plan, motion, along))
        ),
        compared=[method(name) for name, _ in _compared(result, evidence, plan)],
        mesh=_mesh(problem, result, evidence, extras),
        rounds=[
            (method(name), story.history_rows(rounds)) for name, rounds in extras.history.items() if rounds
        ],
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
    write_whole(file, text)


def _bracket(result: Mapping[str, Any]) -> Section:
    times = story.travel_times(result)
    if not times:
        return Section(pictures=(), missing="No stage produced a travel time.")
    data = BracketData(
        rows=[_bracket_row(result, name, time) for name, time in times.items()],
        reference=story.reference_plan(result),
        executed=story.executed_plan(result) if story.is_executed(result) else "",
        upper=upper(result)[0],
        full_bound=full_bound(result) if "refined" in times else None,
    )
    return Section(pictures=[draw_bracket(data)])


def _bracket_row(result: Mapping[str, Any], name: str, time: float) -> BracketRow:
    return BracketRow(
        method=name, travel_time=time, breaks=breaks(result, name), astray=goes_astray(result, name)
    )


def _subject(result: Mapping[str, Any], evidence: Evidence) -> str:
    """What the motion drawn is called: where nothing is executed, it stands in and bears its own name."""
    if story.is_executed(result) or not evidence.executed_plan:
        return "executed motion"
    return method(evidence.executed_plan).label.lower().replace("voronoi", "Voronoi")


def _map_lines(evidence: Evidence) -> list[tuple[str, Trajectory]]:
    return [(name, motion) for name, motion in evidence.plans.items() if name != evidence.executed_plan]


def _map(
    problem: Problem,
    result: Mapping[str, Any],
    evidence: Evidence,
    extras: ReportExtras,
    stuck: Sequence[StuckRun],
) -> Section:
    if extras.diagram is not None:
        arcs = list(extras.diagram.polylines(problem.world.diameter * ARC_SPACING_SHARE))
    else:
        arcs = list(extras.voronoi_polylines)
    picture = draw_map(
        MapData(
            problem=problem,
            arcs=arcs,
            others=_map_lines(evidence),
            executed=evidence.executed,
            subject=_subject(result, evidence),
            stuck=[(run.method, run.place, run.word) for run in stuck if run.place is not None],
            strayed=evidence.simulation if story.strayed(result) else None,
        )
    )
    reason = (
        ""
        if evidence.executed is not None
        else f"No executed path to draw: {evidence.reason('trajectory.csv')}."
    )
    return Section(pictures=[picture], missing=reason)


def _with_motion(evidence: Evidence, draw: Callable[[Trajectory], Sequence[Picture]]) -> Section:
    if evidence.executed is None:
        return Section(pictures=(), missing=f"No motion to draw: {evidence.reason('trajectory.csv')}.")
    return Section(pictures=draw(evidence.executed))


def _variational(result: Mapping[str, Any], evidence: Evidence) -> tuple[str, Trajectory] | None:
    """The variational optimum that is not executed itself: of the speed graph, else of the collocation."""
    name = next((name for name in story.optima(result) if name in evidence.plans), "")
    return (name, evidence.plans[name]) if name not in ("", evidence.executed_plan) else None


def _compared(result: Mapping[str, Any], evidence: Evidence, plan: str) -> list[tuple[str, Trajectory]]:
    """The variational optimum and the executed motion, as far as there are any."""
    other, executed = _variational(result, evidence), evidence.executed
    found = [] if other is None else [other]
    return found if executed is None else [*found, (plan, executed)]


def _margins(
    problem: Problem,
    result: Mapping[str, Any],
    evidence: Evidence,
    plan: str,
    motion: Trajectory,
    along: ZoneAlong | None,
) -> MarginsData:
    other = _variational(result, evidence)
    own, compared = margins(motion, problem), () if other is None else margins(other[1], problem)
    if along is not None:  # the disc is not what braking is measured by
        own = (*filter(None, [along.margin()]), *(m for m in own if m.key != "braking"))
        compared = tuple(m for m in compared if m.key != "braking")
    return MarginsData(
        executed=own,
        plan=plan,
        other="" if other is None else other[0],
        variational={margin.key: margin for margin in compared},
    )


def _class_sections(problem: Problem, drawing: SpeedGraphDrawing) -> dict[str, Section]:
    speeds = draw_class_speeds(problem, drawing.classes)
    return {
        "class_map": Section(
            pictures=[draw_class_map(problem, drawing.classes)] if drawing.classes else (),
            missing="" if drawing.classes else "The paths of the classes were not at hand.",
        ),
        "class_speeds": Section(pictures=[] if speeds is None else [speeds]),
        "newton": Section(pictures=draw_newton(drawing.classes)),
        "graphs": Section(pictures=draw_graphs(problem, drawing.graphs)),
    }


def _vc_sections(problem: Problem, drawing: VcDrawing | None) -> dict[str, Section | Markup]:
    if drawing is None:
        nothing = Section(pictures=())
        return {
            "vc_space": Section(pictures=(), missing="The cells of the vc-method were not at hand."),
            "vc_unfolded": nothing,
            "vc_cells": nothing,
            "vc_space_data": Markup(),
        }
    return {
        "vc_space": Section(pictures=[draw_space(problem, drawing)]),
        "vc_unfolded": Section(pictures=[draw_unfolded(drawing)]),
        "vc_cells": Section(pictures=[draw_cells(problem, drawing)]),
        "vc_space_data": space_data(problem, drawing),
    }


def _bound_sections(
    problem: Problem,
    result: Mapping[str, Any],
    evidence: Evidence,
    certificate: tuple[BoundMesh | None, str],
) -> dict[str, BoundStory | Section]:
    told, curves = bound_story(result), closing(result)
    mesh, reason = (None, "") if told.missing else certificate
    drawn: Sequence[Picture] = ()
    if mesh is not None:
        drawn = _bound_maps(problem, mesh, result, evidence)
    return {
        "bound": told,
        "bound_potential": Section(
            pictures=drawn[:1], missing=told.missing or (reason and f"No picture of it: {reason}.")
        ),
        "bound_slack": Section(pictures=drawn[1:]),
        "bound_closing": Section(
            pictures=[] if curves is None else [draw_closing(curves)],
            missing="" if curves or told.missing else "No rounds of refinement were recorded.",
        ),
    }


def _bound_maps(
    problem: Problem, mesh: BoundMesh, result: Mapping[str, Any], evidence: Evidence
) -> Sequence[Picture]:
    """The certificate's pictures, the way on top being the one that the bound is compared with."""
    names = [name for name in (upper(result)[1], *story.optima(result)) if name in evidence.plans]
    way = None
    if names:
        time, proven = (story.travel_times(result).get(name) for name in (names[0], "lower_bound"))
        gap = time / proven - 1.0 if time is not None and proven else None
        way = Way(method=names[0], motion=evidence.plans[names[0]], gap=gap)
    return [draw_potential(problem, mesh, way), *draw_slack(problem, mesh, way)]


def _mesh(problem: Problem, result: Mapping[str, Any], evidence: Evidence, extras: ReportExtras) -> Section:
    limits = [gate for gate in story.entries(result, "gates") if gate.get("name") == "constraint_violation"]
    collocated = {name: evidence.plans[name] for name in ("collocation", "refined") if name in evidence.plans}
    data = MeshData(
        world=problem.world,
        meshes={name: mesh_of(motion) for name, motion in collocated.items()},
        history=extras.history,
        violation_limit=number_in(limits[0], "limit") if limits else None,
    )
    pictures = draw_mesh(data)
    reason = evidence.reason("trajectories/collocation.csv", "trajectories/refined.csv")
    return Section(pictures=pictures, missing=f"Not drawn: {reason}." if reason else "")
