"""The braking zone in words: what it is, what it gains, whether it keeps its promise, its fields."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.report.figures_zone import HeldStop
from verify.report.numbers import DASH, count, number_in, percent, seconds, significant, with_unit
from verify.report.palette import method
from verify.report.story import Result, entries, executed_plan, is_executed, mapping, words
from verify.report.story_promise import promise_broken, promise_sentences
from verify.report.text import label, plain
from verify.report.zone_along import LIMITS, ZoneAlong
from verify.report.zone_gain import Gain, Stretch
from vnav_drake.problem import Problem
from vnav_drake.zones.convex_zone import ConvexZone
from vnav_drake.zones.field_set import FieldSet
from vnav_drake.zones.shapes import EllipseZone, PolygonZone, ProtectiveField

Array = NDArray[np.float64]

ANALYTIC = ("voronoi_route", "vc_method", "speed_graph")
SAFETY = "Fields are inputs to a safety case; nothing here makes a vehicle compliant with anything."


@dataclass(frozen=True, kw_only=True)
class ZoneStory:
    """What the page says about the zone."""

    about: Sequence[str]  # what it is
    relaxation: Sequence[str]  # on what the analytic plans run
    gained: Sequence[str]  # against uniform braking
    promise: Sequence[str]
    broken: bool  # whether stops leave the zone or collide
    fields: Sequence[str]
    stretches: Sequence[tuple[str, ...]]  # from to, held by, its share, time, gained
    cases: Sequence[tuple[str, ...]]  # case, top speed, ahead, across, least separation, share of the way


def told(result: Result) -> Mapping[str, Any]:
    """The block of the zone, empty where the zone is a disc."""
    return mapping(result, "zone")


def shape_words(zone: ConvexZone) -> str:
    """What is free around the robot, in one sentence."""
    law = zone.law
    reach = f"the stopping distance D = {'v t_r + ' if law.reaction_time > 0.0 else ''}v²/(2 a_b)"
    margin = f" and the margin of {law.margin:g}\u00a0m" if law.margin > 0.0 else ""
    if isinstance(zone, EllipseZone):
        behind = zone.ahead if zone.behind is None else zone.behind
        return (
            f"An ellipse along the heading around the robot's disc{margin}: {zone.ahead:.4g} D ahead, "
            f"{behind:.4g} D behind and {zone.lateral_ratio:.4g} D to either side, with {reach}."
        )
    if isinstance(zone, ProtectiveField):
        form = "disc" if zone.form == "capsule" else "square"
        side = f", {zone.side:g}\u00a0m wider on either side" if zone.side > 0.0 else ""
        return f"The field of a safety scanner: the robot's {form}{margin}{side}, as far ahead as {reach}."
    if isinstance(zone, PolygonZone):
        many = len(zone.vertices)
        return f"A convex polygon of {many} corners, in shares of {reach}, around the disc{margin}."
    if isinstance(zone, FieldSet):
        many = len(zone.max_speeds)
        if many == 1:
            return f"One field for all speeds up to {zone.max_speeds[0]:.2f}\u00a0m/s."
        return f"{many} fields, switched by speed: at each speed the least one that is meant for it."
    name = label(zone.type_name) or "unnamed"
    return f"A zone of its own type, “{name}”, told by its support function; it grows with {reach}."


def zone_story(
    result: Result, problem: Problem, along: ZoneAlong | None, found: Gain | None, parts: Sequence[Stretch],
    fields: Mapping[str, Any],
) -> ZoneStory:  # fmt: skip
    """All the words; `fields`: the content of fields.json, empty without one."""
    zone = problem.zone
    about = [] if zone is None else [shape_words(zone)]
    shown = along.zone if along is not None else zone
    if isinstance(shown, FieldSet) and not isinstance(zone, FieldSet):
        about.append(shape_words(shown))
    about += plugin_sentences(result)
    reserve = problem.robot.reserved_lateral_acceleration()
    about.append(
        "Friction is kept in reserve: lateral acceleration stays within "
        f"√((μg)² − a_b²) = {with_unit(reserve, 'm/s²')}, so that full braking is left in every bend, and "
        "the arc of "
        "a stop with the steering held stays in the zone."
        if problem.friction_reserve
        else "No friction is kept in reserve (braking.friction_reserve: false): in a bend less than a_b may "
        "be left to brake with."
    )
    return ZoneStory(
        about=about,
        relaxation=_relaxation(result),
        gained=_gained(result, found),
        promise=promise_sentences(result, problem),
        broken=promise_broken(result),
        fields=_fields(result, fields),
        stretches=[_stretch(part) for part in parts],
        cases=_cases(fields, along),
    )


def plugin_sentences(result: Result) -> list[str]:
    """Which plugin brings the zone; empty where it is built in."""
    from_ = mapping(told(result), "plugin")
    module, package, source = (label(words(from_.get(key))) for key in ("module", "distribution", "sha256"))
    if not module:
        return []
    version = label(words(from_.get("version")))
    inside = f" of the package {package}{version and ' '}{version}" if package else ""
    hashed = f", its source has the SHA-256 {source[:16]}…" if source else ""
    return [f"It comes from the plugin {module}{inside}{hashed}; its own functions are taken at their word."]


def uniform_time(result: Result) -> float | None:
    """Travel time [s] of the same robot with uniform braking."""
    return number_in(result, "plans", "uniform", "travel_time")


def relaxation_sentence(result: Result) -> str:
    """On what the analytic methods ran; "" where the zone is a disc."""
    return " ".join(_relaxation(result)[:1])


def _relaxation(result: Result) -> list[str]:
    plans = mapping(result, "plans")
    ran = [name for name in ANALYTIC if name in plans]
    kind = words(told(result).get("relaxation"))
    if not ran or kind not in ("inner", "outer"):
        return []
    names = " and ".join(filter(None, (", ".join(method(n).label for n in ran[:-1]), method(ran[-1]).label)))
    many = len(ran) > 1
    knows = f"{names} know{'' if many else 's'} uniform braking only and ran "
    if kind == "outer":
        return [f"{knows}with a disc that holds the zone: safe, and slower than the zone would allow."]
    sentence = (
        f"{knows}on the isotropic relaxation, the disc inside the zone: faster than the zone allows. "
        f"The {'paths' if many else 'path'} found {'were' if many else 'was'} then driven with the true zone."
    )
    times = [
        f"{method(name).label}: {seconds(relaxed)} with the disc, "
        f"{seconds(number_in(plans, name, 'travel_time'))} driven"
        for name in ran
        if (relaxed := number_in(plans, name, "relaxation", "travel_time")) is not None
    ]
    return [sentence, *([f"{'; '.join(times)}."] if times else [])]


def _gained(result: Result, found: Gain | None) -> list[str]:
    uniform, plan = uniform_time(result), executed_plan(result)
    time = number_in(result, "plans", plan, "travel_time")
    if uniform is None or time is None:
        return ["There is no plan with uniform braking to compare with."]
    subject = "the executed motion" if is_executed(result) else method(plan).label.lower()
    gained = uniform - time
    share = percent(abs(gained) / uniform) if uniform > 0.0 else DASH
    sentences = [
        f"With uniform braking, the same limits and the same ends the robot takes {seconds(uniform)}; "
        f"{subject} "
        f"takes {seconds(time)}: {seconds(abs(gained))} ({share}) {'gained' if gained >= 0.0 else 'lost'}."
    ]
    if found is not None and not found.same_way:
        sentences.append(
            "The two drive different ways, so they are compared at equal shares of their path lengths."
        )
    return sentences


def held_stops(result: Result, along: ZoneAlong) -> list[HeldStop]:
    """The stops that the audit lists, with the speed of the motion there."""
    found = []
    for item in entries(mapping(told(result), "promise"), "failed"):
        values = [number_in(item, key) for key in ("t", "x", "y", "heading", "kappa")]
        if any(value is None for value in values):
            continue
        t, x, y, heading, bend = (value or 0.0 for value in values)
        own = number_in(item, "v")
        v = float(np.interp(t, along.t, along.v)) if own is None else own
        depth = number_in(item, "depth") or 0.0
        found.append(HeldStop(t=t, x=x, y=y, heading=heading, v=v, curvature=bend, depth=depth))
    return found


def _stretch(part: Stretch) -> tuple[str, ...]:
    return (
        f"{part.first:.1f} to {part.last:.1f}\u00a0m",
        LIMITS[part.key],
        f"{100.0 * part.share:.0f}\u00a0%",
        seconds(part.time),
        DASH if part.saved is None else seconds(part.saved),
    )


def _fields(result: Result, fields: Mapping[str, Any]) -> list[str]:
    told_of = mapping(told(result), "fields")
    if not told_of and not fields:
        return []
    cost = number_in(told_of, "cost")
    switches = sum((number_in(item, "s") or 0.0) > 0.0 for item in entries(fields, "switches"))
    number = number_in(told_of, "count") or float(len(entries(fields, "cases")))
    sentences = [
        "One field stands for the zone at all speeds."
        if number == 1.0
        else f"{count(number)} fields stand for the zone, switched {_times(switches)} on the way."
    ]
    asked = number_in(told(result), "parameters", "count")
    if asked is not None and number < asked:
        sentences.append(f"{count(number)} of {count(asked)} asked for: more would gain nothing.")
    if cost is not None:
        sentences.append(
            f"They cost {percent(cost)} of travel time against the zone that grows smoothly with the speed."
        )
    reach = number_in(fields, "scanner_range")
    if reach is not None:
        sentences.append(f"The scanner must see {with_unit(reach, 'm')} far from the robot's centre.")
    return [*sentences, SAFETY]


def _times(number: int) -> str:
    return "once" if number == 1 else f"{count(number)} times" if number else "never"


def _cases(fields: Mapping[str, Any], along: ZoneAlong | None) -> list[tuple[str, ...]]:
    """Rows of the table of fields."""
    rows: list[tuple[str, ...]] = []
    least = fields.get("least_separation")
    gaps = list(least) if isinstance(least, list | tuple) else []
    speeds = [number_in(item, "max_speed") for item in entries(fields, "cases")]
    for i, item in enumerate(entries(fields, "cases")):
        corners = corners_of(item)
        ahead = with_unit(float(corners[:, 0].max()), "m") if len(corners) else DASH
        wide = with_unit(float(np.ptp(corners[:, 1])), "m") if len(corners) else DASH
        gap = number_in({"gap": gaps[i]}, "gap") if i < len(gaps) else None
        share = DASH
        if along is not None and all(v is not None for v in speeds):
            case = np.searchsorted(np.array(speeds, dtype=float), along.v - 1e-9)
            step = np.diff(along.s, prepend=0.0)
            share = f"{100.0 * float(step[case == i].sum() / along.s[-1]):.1f}\u00a0%"
        rows.append(
            (plain(words(item.get("case"))) or str(i + 1), f"{significant(speeds[i])}\u00a0m/s", ahead, wide,
             with_unit(gap, "m"), share)
        )  # fmt: skip
    return rows


def corners_of(item: Mapping[str, Any]) -> Array:
    """Corners (m, 2) [m] of a field of fields.json; none where the file does not hold such."""
    try:
        corners = np.asarray(item.get("polygon"), dtype=float)
    except (TypeError, ValueError):
        return np.empty((0, 2))
    whole = corners.ndim == 2 and corners.shape[1] == 2 and bool(np.isfinite(corners).all())
    return corners if whole else np.empty((0, 2))
