"""The motion on maps and curves: still pictures of what the linked views show, and the mesh."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from verify.report import story
from verify.report.evidence import Evidence
from verify.report.figures_map import MapData, draw_map
from verify.report.figures_margins import MarginsData, draw_margins
from verify.report.figures_mesh import MeshData, draw_mesh
from verify.report.figures_motion import FrictionData, SpeedData, draw_friction, draw_speed_curve
from verify.report.numbers import number_in, significant
from verify.report.palette import method
from verify.report.section import Section
from verify.report.series import margins, mesh_of
from verify.report.story_stuck import StuckRun
from verify.report.svg import Picture
from verify.report.zone_along import ZoneAlong
from vnav_drake.plan import Trajectory
from vnav_drake.problem import Problem

if TYPE_CHECKING:
    from verify.report.page import ReportExtras

ARC_SPACING_SHARE = 1.0 / 400.0  # of the world's diameter: about two pixels on a map


def motion_sections(
    problem: Problem,
    result: Mapping[str, Any],
    evidence: Evidence,
    extras: ReportExtras,
    along: ZoneAlong | None,
    stuck: Sequence[StuckRun],
) -> dict[str, Any]:
    """What the template's still pictures and its section of the mesh ask for.

    `along`: the braking zone along the motion drawn, where it is no disc; `stuck`: runs that gave up.
    """
    plan = evidence.executed_plan or "refined"
    compared = _compared(result, evidence, plan)
    return {
        "subject": subject(result, evidence),
        "map": _map(problem, result, evidence, extras, stuck),
        "map_lines": [method(name) for name, _ in _map_lines(evidence)]
        + ([method("simulation")] if story.strayed(result) and evidence.simulation is not None else []),
        "has_arcs": extras.diagram is not None or bool(extras.voronoi_polylines),
        "speed": _with_motion(
            evidence,
            lambda motion: [
                draw_speed_curve(
                    SpeedData(
                        problem=problem,
                        motion=motion,
                        plan=plan,
                        over=over,
                        variational=_variational(result, evidence),
                        subject=subject(result, evidence),
                        along=along,
                    )
                )
                for over in ("path", "time")
            ],
        ),
        "friction": _with_motion(
            evidence, lambda _motion: draw_friction(FrictionData(problem=problem, motions=compared))
        ),
        "tip_acceleration": significant(problem.robot.tip_acceleration),
        "margins": _with_motion(
            evidence, lambda motion: draw_margins(_margins(problem, result, evidence, plan, motion, along))
        ),
        "compared": [method(name) for name, _ in compared],
        "mesh": _mesh(problem, result, evidence, extras),
        "rounds": [
            (method(name), story.history_rows(rounds)) for name, rounds in extras.history.items() if rounds
        ],
    }


def subject(result: Mapping[str, Any], evidence: Evidence) -> str:
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
            subject=subject(result, evidence),
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
