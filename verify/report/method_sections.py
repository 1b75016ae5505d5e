"""What the methods tell of themselves: homotopy classes, cells of the vc-method, the proven bound."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from markupsafe import Markup

from verify.report import story
from verify.report.bound import BoundMesh
from verify.report.drawings import SpeedGraphDrawing, VcDrawing
from verify.report.evidence import Evidence
from verify.report.figures_bound import draw_closing
from verify.report.figures_cells import draw_cells
from verify.report.figures_classes import MOST_CLASSES, draw_class_map, draw_class_speeds, draw_newton
from verify.report.figures_graph import draw_graphs
from verify.report.figures_potential import Way, draw_potential, draw_slack
from verify.report.figures_space import draw_space
from verify.report.figures_unfolded import draw_unfolded
from verify.report.palette import rank_tone, rank_variable
from verify.report.section import Section
from verify.report.space_data import space_data
from verify.report.story_bound import BoundStory, bound_story, closing, upper
from verify.report.story_classes import class_rows, graph_words
from verify.report.svg import Picture
from verify.report.thumbnail import ThumbnailPath, draw_floor, thumbnail
from vnav_drake.problem import Problem

FLOOR = "class-floor"  # key of the floor below the small maps of the classes


def class_sections(problem: Problem, result: Mapping[str, Any], drawing: SpeedGraphDrawing) -> dict[str, Any]:
    """What the template's section of homotopy classes asks for."""
    rows, speeds = class_rows(result), draw_class_speeds(problem, drawing.classes)
    maps = {
        str(item.rank): thumbnail(
            problem,
            [
                ThumbnailPath(
                    points=np.asarray(item.points),
                    tone=rank_tone(item.rank),
                    variable=rank_variable(item.rank),
                )
            ],
            words=f"Way of class {item.rank}",
            floor=FLOOR,
        )
        for item in drawing.classes
    }
    unmoved = "The motions of the classes were not at hand."
    return {
        "classes": rows,
        "has_classes": bool(rows or drawing.classes or drawing.graphs),
        "class_thumbnails": maps,
        "class_floor": draw_floor(problem, FLOOR) if maps else Markup(),
        "most_classes": MOST_CLASSES,
        "graph_words": graph_words(result),
        "class_map": Section(
            pictures=[draw_class_map(problem, drawing.classes)] if drawing.classes else (),
            missing="" if drawing.classes else "The paths of the classes were not at hand.",
        ),
        "class_speeds": Section(
            pictures=[] if speeds is None else [speeds], missing=unmoved if speeds is None else ""
        ),
        "newton": _or_missing(draw_newton(drawing.classes), "Newton's iterations were not recorded."),
        "graphs": _or_missing(draw_graphs(problem, drawing.graphs), "The graphs were not at hand."),
    }


def _or_missing(pictures: Sequence[Picture], missing: str) -> Section:
    return Section(pictures=pictures, missing="" if pictures else missing)


def vc_sections(problem: Problem, drawing: VcDrawing | None) -> dict[str, Section | Markup]:
    """What the template's section of the vc-method asks for: pictures, and data of the one that turns."""
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


def bound_sections(
    problem: Problem,
    result: Mapping[str, Any],
    evidence: Evidence,
    certificate: tuple[BoundMesh | None, str],
) -> dict[str, BoundStory | Section]:
    """What the template's section of the lower bound asks for; `certificate`: its mesh, else why not."""
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
