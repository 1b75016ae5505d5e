"""Layers of the map: what can be laid over it, and why some of it is not there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from verify.report.bound import BoundMesh, long_sides
from verify.report.evidence import PLANS, SIMULATION, STOPS, Evidence
from verify.report.explorer.encode import lines
from verify.report.palette import method, rank_variable
from verify.report.story import mapping, strayed
from verify.report.story_stops import stop_story
from vnav_drake.problem import Problem

if TYPE_CHECKING:
    from verify.report.page import ReportExtras

Array = NDArray[np.float64]
Result = Mapping[str, Any]

ARC_SPACING = 1.0 / 400.0  # of the world's diameter: about two pixels on a map
NOT_DRAWN = "no drawing of it was kept"
LEAST_SIDE = 1.0 / 2000.0  # of the world's diameter: smaller sides of triangles are blots


@dataclass(frozen=True, kw_only=True)
class Layer:
    """One box to tick."""

    key: str
    label: str
    variable: str  # CSS variable of its colour
    shown: bool = False  # from the start
    missing: str = ""  # why there is nothing to show
    data: Mapping[str, Any] | None = None


def layers(
    problem: Problem,
    result: Result,
    evidence: Evidence,
    extras: ReportExtras,
    certificate: tuple[BoundMesh | None, str],
    why: Mapping[str, str],
) -> tuple[list[Layer], list[Layer]]:
    """All layers in the order in which they are offered: ways, then what else there is to see.

    `why`: stages that gave nothing, with their reasons.
    """
    size = problem.world.diameter
    ways = [*_plans(result, evidence, why), _simulation(result, evidence, why), _classes(extras, why)]
    return ways, [
        Layer(
            key="disc",
            label="Braking disc" if problem.zone is None else "Braking zone",
            variable="--limit",
            shown=True,
        ),
        _arcs(extras, size, why),
        _graph(extras, size, why),
        _mesh(certificate, size),
        _stops(problem, result, evidence, size, why),
    ]


def _plans(result: Result, evidence: Evidence, why: Mapping[str, str]) -> list[Layer]:
    told = mapping(result, "plans")
    optimum = next((name for name in ("speed_graph", "collocation") if name in evidence.plans), "")
    found = []
    for name in PLANS:
        if name not in evidence.plans and name not in told:
            continue
        look, there = method(name), name in evidence.plans
        reason = why.get(name) or evidence.reason(f"trajectories/{name}.csv")
        found.append(
            Layer(
                key=f"plan-{name}",
                label=look.label + (", followed" if name == evidence.executed_plan else ""),
                variable=look.variable,
                shown=there and name in (evidence.executed_plan, optimum),
                missing="" if there else reason or "no trajectory",
            )
        )  # fmt: skip
    return found


def _simulation(result: Result, evidence: Evidence, why: Mapping[str, str]) -> Layer:
    key = "simulation"
    look, there = method(key), evidence.simulation is not None
    return Layer(
        key=f"plan-{key}",
        label=look.label,
        variable=look.variable,
        shown=there and strayed(result),
        missing="" if there else why.get(key) or evidence.reason(SIMULATION) or "nothing was simulated",
    )


def _classes(extras: ReportExtras, why: Mapping[str, str]) -> Layer:
    there = bool(extras.speed_graph.classes)
    return Layer(
        key="classes",
        label="Homotopy classes",
        variable=rank_variable(2),
        missing="" if there else why.get("speed_graph", NOT_DRAWN),
    )


def _arcs(extras: ReportExtras, size: float, why: Mapping[str, str]) -> Layer:
    if extras.diagram is not None:
        arcs: Sequence[Array] = list(extras.diagram.polylines(size * ARC_SPACING))
    else:
        arcs = extras.voronoi_polylines
    return Layer(
        key="arcs",
        label="Voronoi arcs",
        variable="--arc",
        missing="" if len(arcs) else why.get("voronoi", NOT_DRAWN),
        data=lines(arcs, size) if len(arcs) else None,
    )


def _graph(extras: ReportExtras, size: float, why: Mapping[str, str]) -> Layer:
    graph = next(iter(extras.speed_graph.graphs), None)
    label = "Edges of the speed graph"
    if graph is not None and graph.shown < graph.total:
        label += f" ({graph.shown:,} of {graph.total:,})"
    return Layer(
        key="graph",
        label=label,
        variable=method("speed_graph").variable + "-text",
        missing="" if graph is not None else why.get("speed_graph", NOT_DRAWN),
        data=None if graph is None else lines(list(graph.lines), size),
    )


def _mesh(certificate: tuple[BoundMesh | None, str], size: float) -> Layer:
    mesh, reason = certificate
    known: dict[str, Any] = {"key": "mesh", "label": "Mesh of the certificate", "variable": "--rack-edge"}
    if mesh is None:
        return Layer(**known, missing=reason or "no certificate")
    sides = mesh.place[mesh.triangles][mesh.size > LEAST_SIDE * size][:, [[0, 1], [1, 2], [2, 0]]]
    long = long_sides(mesh.lattice, np.unique(np.sort(sides.reshape(-1, 2), axis=1), axis=0))
    return Layer(**known, data=lines(list(mesh.points[long]), size))


def _stops(
    problem: Problem, result: Result, evidence: Evidence, size: float, why: Mapping[str, str]
) -> Layer:
    stops = evidence.stops
    known: dict[str, Any] = {"key": "stops", "variable": method("simulation").variable}
    if stops is None:
        reason = why.get("emergency_stops") or evidence.reason(STOPS)
        return Layer(label="Emergency stops", missing=reason or "no stops were recorded", **known)
    told = stop_story(result, problem, stops, evidence.simulation, asked=True)
    bad = sorted({stop.index for stop in told.failed if 0 <= stop.index < len(stops)})
    paths = [np.column_stack(path) for path in stops.paths()]
    kept = [k for k, path in enumerate(paths) if len(path) > 1]
    return Layer(
        label="Emergency stops" + (f", {len(bad)} bad" if bad else ", none bad"),
        **known,
        data={
            **lines(paths, size),
            "straightened": [k for k, i in enumerate(kept) if stops.straightened[i]],
            "bad": [k for k, i in enumerate(kept) if i in set(bad)],
        },
    )
