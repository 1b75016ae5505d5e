"""Linked views as they stand in the page: Bokeh's models and our numbers, as two blocks of JSON."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from bokeh.document import Document
from bokeh.models import ColumnDataSource, Range1d
from markupsafe import Markup

from verify.report.bound import BoundMesh
from verify.report.drawings import ClassDrawing
from verify.report.evidence import Evidence
from verify.report.explorer.cursor import CLEAR, Followed, braking_law, followed_rows
from verify.report.explorer.curve_plots import (
    MARGIN_TONES,
    friction_plot,
    friction_reach,
    margins_plot,
    speed_plot,
)
from verify.report.explorer.encode import data_block, numbers
from verify.report.explorer.layers import Layer, layers
from verify.report.explorer.motions import (
    Array,
    DrawnMargin,
    DrawnMotion,
    compared,
    drawn_margins,
    followed,
    margins_of,
    passed,
    recorded,
)
from verify.report.explorer.plots import empty, heading_length, map_plot
from verify.report.figures_classes import MOST_CLASSES
from verify.report.palette import method, rank_variable, variable_of_colour
from verify.report.zone_along import ZoneAlong
from vnav_drake.problem import Problem

if TYPE_CHECKING:
    from verify.report.page import ReportExtras

SMALL = 1.0 / 3.0  # of the world: motions that take less of it are shown close up first
ROOM = 0.5  # of their size, on each side of them
UNKNOWN = "executed"  # what a motion is called that is none of the plans


@dataclass(frozen=True, kw_only=True)
class Explorer:
    """What explorer.html puts into the page."""

    models: Markup  # JSON of Bokeh's document
    data: Markup  # JSON of our numbers
    layers: Sequence[Sequence[Layer]]  # in two groups: ways, and what else there is to see
    margins: Sequence[tuple[str, str, str, str]]  # key, name, unit, formula; those with a share come first
    colours: Mapping[str, str]  # margin -> CSS variable
    end: float  # [s], of the motion followed
    shape: float  # height over width of the world
    instants: int  # at which the curves of the motion followed are drawn
    close_up: bool  # whether the map begins at the motions, which are small in it
    acceleration: float  # [m/s^2], how far what the cursor reads is from the motion's own at most
    clearance: float  # [m], the same
    zone: bool  # whether a zone that is no disc is drawn


def explorer(
    problem: Problem,
    result: Mapping[str, Any],
    evidence: Evidence,
    extras: ReportExtras,
    along: ZoneAlong | None,
    certificate: tuple[BoundMesh | None, str],
    why: Mapping[str, str],
) -> Explorer:
    """The views of the motion executed (or of what stands in for it) and of all that goes with it.

    Raises
    ------
    ValueError : there is no motion to follow.
    """
    motion = evidence.executed
    if motion is None:
        raise ValueError("no motion to follow")
    own = followed(problem, motion, along)
    executed = f"plan-{evidence.executed_plan or UNKNOWN}"
    motions = {executed: own, **_beside(problem, evidence, extras.speed_graph.classes)}
    read = followed_rows(problem, motion, along)
    known = drawn_margins(problem, margins_of(problem, motion, along))
    groups = layers(problem, result, evidence, extras, certificate, why)
    offered = [item for group in groups for item in group]
    ranks = [item.rank for item in extras.speed_graph.classes[:MOST_CLASSES]]
    top = max(float(own.columns["v"].max()), 1e-3)
    x0, y0, x1, y1 = problem.world.bounds
    shown = {executed, *(item.key for item in offered if item.shown)}
    near = close_up(problem, {key: item for key, item in motions.items() if key in shown})
    data = {
        "executed": executed,
        "end": own.end,
        "radius": problem.robot.radius,
        "heading": heading_length(problem),
        "box": [x0, y0, x1, y1],
        "near": near,
        "reach": friction_reach(problem, own),
        "zone": along is not None,
        "margins": [_margin(margin) for margin in known],
        "motions": {key: _packed(item.columns) for key, item in motions.items()},
        "cursor": _cursor(read),
        "braking": braking_law(problem),
        "tones": {key: _variable(key) for key in motions},
        "layers": {item.key: item.data for item in offered if item.data is not None and not item.missing},
        "ranks": ranks,
        "variables": dict(variable_of_colour()),
    }
    return Explorer(
        models=data_block(_models(problem, executed, motions, ranks, known, top)),
        data=data_block(data),
        layers=groups,
        margins=[(m.key, m.name, m.unit, m.formula) for m in known],
        colours={key: variable_of_colour()[tone.light] for key, tone in MARGIN_TONES.items()},
        end=own.end,
        shape=(y1 - y0) / (x1 - x0),
        instants=len(own.columns["t"]),
        acceleration=read.acceleration,
        clearance=CLEAR,
        close_up=near is not None,
        zone=along is not None,
    )


def _beside(problem: Problem, evidence: Evidence, classes: Sequence[ClassDrawing]) -> dict[str, DrawnMotion]:
    """All motions but the one followed, by key."""
    found = {
        f"plan-{name}": passed(plan)
        for name, plan in evidence.plans.items()
        if name != evidence.executed_plan
    }
    if evidence.simulation is not None:
        found["plan-simulation"] = recorded(evidence.simulation)
    for item in classes[:MOST_CLASSES]:
        path = DrawnMotion(columns={"x": item.points[:, 0], "y": item.points[:, 1]})
        found[f"class-{item.rank}"] = path if item.motion is None else compared(problem, item.motion)
    return found


def close_up(problem: Problem, motions: Mapping[str, DrawnMotion]) -> list[float] | None:
    """Where the map begins, x0, y0, x1, y1 [m], where the motions shown at first are small in their world."""
    points = np.concatenate([np.column_stack([m.columns["x"], m.columns["y"]]) for m in motions.values()])
    low, high = points.min(axis=0), points.max(axis=0)
    size = float(np.max(high - low)) + 2.0 * problem.robot.radius
    x0, y0, x1, y1 = problem.world.bounds
    if size >= SMALL * max(x1 - x0, y1 - y0):
        return None
    room = ROOM * size + problem.robot.radius
    return [*(low - room).tolist(), *(high + room).tolist()]


def _packed(columns: Mapping[str, Array]) -> dict[str, str]:
    return {name: numbers(values) for name, values in columns.items()}


def _cursor(read: Followed) -> dict[str, Any]:
    """What explorer_data.js reads the motion followed from."""
    found = {"rows": read.rows, "clearance": read.clearance, "gap": read.zone, "safe": read.safe}
    return {name: _packed(columns) for name, columns in found.items() if columns is not None}


def _margin(margin: DrawnMargin) -> dict[str, Any]:
    told: dict[str, Any] = {"key": margin.key, "name": margin.name, "unit": margin.unit}
    return told if margin.scale is None else {**told, "scale": margin.scale}


def _variable(key: str) -> str:
    kind, _, name = key.partition("-")
    return rank_variable(int(name)) if kind == "class" else method(name).variable


def _models(
    problem: Problem,
    executed: str,
    motions: Mapping[str, DrawnMotion],
    ranks: Sequence[int],
    margins: Sequence[DrawnMargin],
    top: float,
) -> dict[str, Any]:
    """Bokeh's document, its columns empty: the script fills those that are shown."""
    sources: dict[str, ColumnDataSource] = {
        key: empty(f"motion-{key}", *_drawn_columns(item)) for key, item in motions.items()
    }
    own = motions[executed]
    time = Range1d(start=0.0, end=own.end, bounds=(0.0, _longest(motions)), name="time")
    document = Document(title="")
    for plot in (
        map_plot(problem, sources, executed, ranks, top),
        speed_plot(problem, sources, executed, ranks, own, time),
        margins_plot(margins, time),
        friction_plot(problem, sources, executed, ranks),
    ):
        for renderer in plot.renderers:  # nothing is ever selected, muted or hovered: no looks for that
            renderer.update(selection_glyph=None, nonselection_glyph=None, muted_glyph=None)
        document.add_root(plot)
    found: dict[str, Any] = _numbered(document.to_json(deferred=False), {})
    return found


def _numbered(told: Any, known: dict[str, str]) -> Any:
    """The same document with ids that count from its own first model, not from the process's."""
    if isinstance(told, Mapping):
        return {
            key: known.setdefault(value, f"p{len(known)}") if key == "id" else _numbered(value, known)
            for key, value in told.items()
        }
    return [_numbered(item, known) for item in told] if isinstance(told, list | tuple) else told


def _drawn_columns(motion: DrawnMotion) -> list[str]:
    return [name for name in ("t", "x", "y", "v", "a", "turn", "safe", "bend") if name in motion.columns]


def _longest(motions: Mapping[str, DrawnMotion]) -> float:
    """[s]; a path of a class without a motion has no times."""
    return max(item.end for item in motions.values() if "t" in item.columns)
