"""What the page shows of a braking zone that is not a disc: words, pictures, and numbers for the viewer."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from markupsafe import Markup

from verify.report.evidence import Evidence
from verify.report.figures_fields import draw_fields
from verify.report.figures_gain import GainData, draw_gain, limit_shown
from verify.report.figures_zone import Frame, ShapeData, ZoneMapData, draw_promise, draw_shape, draw_zone_map
from verify.report.numbers import number_in
from verify.report.section import Section
from verify.report.story import entries
from verify.report.story_zone import ZoneStory, corners_of, held_stops, zone_story
from verify.report.zone_along import KEYS, LIMITS, ZoneAlong, zone_along
from verify.report.zone_gain import gain, stretches
from vnav_drake.problem import Problem
from vnav_drake.zones.convex_zone import ConvexZone
from vnav_drake.zones.field_set import FieldSet

Result = Mapping[str, Any]

VIEWER = "zone_viewer.js"
OUTLINE = 72  # points of an outline in the viewer
NONE = Section(pictures=())


def zone_of(problem: Problem, evidence: Evidence) -> ConvexZone | None:
    """What the motion obeys: the fields that were fitted to it, else the zone asked for; None for a disc."""
    zone = problem.zone
    if zone is None or isinstance(zone, FieldSet) or not evidence.fields:
        return zone
    cases = entries(evidence.fields, "cases")
    speeds = tuple(number_in(item, "max_speed") or 0.0 for item in cases)
    own = evidence.fields.get("fitted") is False  # polygons of the scenario, not fields of the zone
    shapes = tuple(tuple((x, y) for x, y in corners_of(item).tolist()) for item in cases) if own else None
    try:
        return FieldSet(law=zone.law, radius=zone.radius, base=zone, max_speeds=speeds, polygons=shapes)
    except ValueError:  # the judge says what is wrong with them
        return zone


def motion_zone(problem: Problem, result: Result, evidence: Evidence) -> ZoneAlong | None:
    """The zone along the motion drawn; None where the zone is a disc or there is no motion."""
    zone = zone_of(problem, evidence)
    if zone is None or evidence.executed is None:
        return None
    kept = number_in(result, "plans", evidence.executed_plan, "limit_share")
    share = 1.0 if kept is None or not 0.0 < kept < 1.0 else kept
    return zone_along(problem, zone, evidence.executed, share=share)


def zone_sections(
    problem: Problem, result: Result, evidence: Evidence, along: ZoneAlong | None, *, plan: str, subject: str
) -> dict[str, Any]:
    """Everything that the template's section on the zone asks for."""
    none: dict[str, Any] = {
        "zone": None, "zone_shape": NONE, "zone_map": NONE, "zone_gain": NONE, "zone_promise": NONE,
        "zone_fields": NONE, "zone_data": Markup(), "zone_keys": [],
        "zone_limit_shown": False, "zone_of_point": problem.robot.radius <= 0.0,
    }  # fmt: skip
    if problem.zone is None:
        return none
    uniform = evidence.plans.get("uniform")
    if along is None:
        words = zone_story(result, problem, None, None, (), evidence.fields)
        missing = Section(pictures=(), missing=f"No zone to draw: {evidence.reason('trajectory.csv')}.")
        return {**none, "zone": words, "zone_map": missing}
    found = None if uniform is None else gain(along, uniform)
    zone_map, places = draw_zone_map(
        ZoneMapData(problem=problem, along=along, uniform=uniform, subject=subject)
    )
    gained, curves = draw_gain(GainData(along=along, gain=found, plan=plan, subject=subject))
    held = held_stops(result, along)
    words = zone_story(result, problem, along, found, stretches(along, found), evidence.fields)
    top = float(along.v.max())
    drawn = [draw_shape(ShapeData(problem=problem, zone=along.zone, top=top))] if top > 0.0 else []
    return {
        **none,
        "zone": words,
        "zone_limit_shown": limit_shown(along),
        "zone_shape": Section(pictures=drawn),
        "zone_map": Section(pictures=[zone_map]),
        "zone_gain": Section(pictures=[gained], missing=_no_uniform(evidence)),
        "zone_promise": Section(pictures=[draw_promise(problem, along, held)] if held else ()),
        "zone_fields": Section(
            pictures=draw_fields(problem, along, evidence.fields) if evidence.fields else ()
        ),
        "zone_data": zone_data(along, places, curves),
        "zone_keys": [(KEYS[k], LIMITS[KEYS[k]]) for k in np.unique(along.limit)],
    }


def _no_uniform(evidence: Evidence) -> str:
    return (
        ""
        if "uniform" in evidence.plans
        else f"Nothing to compare with: {evidence.reason('trajectories/uniform.csv')}."
    )


def zone_data(along: ZoneAlong, places: Mapping[str, Frame], curves: Mapping[str, Frame]) -> Markup:
    """What the viewer draws, as the text of a JSON data block: numbers, and our own words alone."""

    def numbers(values: np.ndarray, digits: int) -> list[float | None]:
        return [round(float(v), digits) if np.isfinite(v) else None for v in values]

    data = {
        "s": numbers(along.s, 3),
        "t": numbers(along.t, 3),
        "v": numbers(along.v, 3),
        "x": numbers(along.x, 3),
        "y": numbers(along.y, 3),
        "gap": numbers(along.gap, 4),
        "held": along.limit.tolist(),
        "words": list(LIMITS.values()),
        "colours": [f"var(--holding-{key})" for key in KEYS],
        "outlines": [np.round(along.outline(i, OUTLINE), 2).ravel().tolist() for i in range(len(along))],
        "maps": {key: dict(frame) for key, frame in places.items()},
        "curves": {key: dict(frame) for key, frame in curves.items()},
    }
    return Markup(json.dumps(data, separators=(",", ":"), allow_nan=False).replace("</", "<\\/"))


__all__ = ["VIEWER", "ZoneStory", "motion_zone", "zone_of", "zone_sections"]
