"""Whether the braking zone keeps its promise, in words: stops reckoned by kinematics, stops simulated."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from verify.report.numbers import count, number_in, with_unit
from verify.report.story import FAILED, Result, check_rows, executed_plan, mapping
from vnav_drake.problem import Problem
from vnav_drake.zones.convex_zone import ConvexZone
from vnav_drake.zones.field_set import FieldSet
from vnav_drake.zones.shapes import ProtectiveField

RISK = (
    "So this zone promises less than it seems to: the sensor sees it free, the robot turns, brakes, and ends "
    "where nobody looked."
)
KINDS = (("held", "with the steering held"), ("straightened", "with the wheels straightened"))


def promise_broken(result: Result) -> bool:
    """Whether stops leave the zone or collide, reckoned or simulated."""
    audit = _audit(result)
    reckoned = number_in(audit, "held_leaves") or number_in(audit, "held_collides")
    return bool(reckoned or number_in(_simulated(result), "left_zone"))


def promise_sentences(result: Result, problem: Problem) -> list[str]:
    """What both kinds of stops say, what the reckoning assumes, and why they part where that is known."""
    audit, found = _audit(result), _simulated(result)
    leaves, hits = number_in(audit, "held_leaves"), number_in(audit, "held_collides")
    if number_in(audit, "poses") is None or leaves is None or hits is None:
        return ["The promise was not examined.", *_told(found, problem)]
    sentences = [_reckoned(audit, problem), _straight(problem), *_told(found, problem)]
    left, broken = number_in(found, "left_zone"), bool(leaves or hits)
    if broken and problem.friction_reserve:
        return [*sentences, "That should not be: friction is kept in reserve so that none does."]
    if broken:
        cure = "braking.friction_reserve: true keeps full braking in every bend and the arc in the zone"
        none = problem.robot.reserved_lateral_acceleration() <= 0.1 * problem.braking.max_braking
        return [
            *sentences,
            RISK,
            f"{cure}{'; here a lower a_b must leave friction for it' if none else ''}.",
        ]
    if left and problem.friction_reserve and _arcs_hold(result):
        sentences += _cause(problem)
    return sentences


def _audit(result: Result) -> Mapping[str, Any]:
    return mapping(mapping(result, "zone"), "promise")


def _simulated(result: Result) -> Mapping[str, Any]:
    return mapping(mapping(result, "simulation"), "emergency_stops")


def _arcs_hold(result: Result) -> bool:
    """Whether the held arcs of the executed plan were checked, and none is known to leave the zone."""
    mine = (executed_plan(result), "")
    rows = [row for row in check_rows(result) if row.name == "braking_arc" and row.trajectory in mine]
    return bool(rows) and all(row.status != FAILED for row in rows)


def _reckoned(audit: Mapping[str, Any], problem: Problem) -> str:
    """The audit's counts and its premises."""
    leaves, hits = (number_in(audit, key) or 0.0 for key in ("held_leaves", "held_collides"))
    delay = problem.braking.reaction_time
    late = f"{delay:g}\u00a0s at constant speed until the brakes act, then " if delay > 0.0 else ""
    beginning = (
        f"At {count(number_in(audit, 'poses'))} poses along the way the judge reckons a stop with the "
        f"steering held, by kinematics alone: {late}turning and braking share the friction, all of μg, on "
        "the planned curvature and on half of it"
    )
    if not leaves and not hits:
        return f"{beginning}: no such stop leaves the zone claimed, and none touches anything."
    depth, excess = number_in(audit, "worst_depth"), number_in(audit, "worst_excess")
    far = "" if excess is None or excess <= 0.0 else f" by up to {with_unit(excess, 'm')}"
    deep = "" if depth is None or depth <= 0.0 else f", up to {with_unit(depth, 'm')} deep"
    return (
        f"{beginning}: {_some(leaves, 'leave', 'leaves')} the zone claimed{far}, "
        f"{_some(hits, 'run', 'runs')} into an obstacle{deep}."
    )


def _straight(problem: Problem) -> str:
    """What the shape promises, with its premise. The excess: docs/braking_zones.md."""
    by_shape = "Straight stops stay in the zone by its shape"
    if problem.braking.reaction_time <= 0.0:
        return f"{by_shape}."
    return (
        f"{by_shape}, if no speed is gained in the reaction time t_r: where the plan accelerates by a, a "
        "stop is longer than claimed by a t_r (t_r/2 + (2v + a t_r)/(2 a_b))."
    )


def _told(found: Mapping[str, Any], problem: Problem) -> list[str]:
    """What the simulated stops do."""
    left, tried = number_in(found, "left_zone"), number_in(found, "tried")
    if left is None or not tried:
        return ["No simulated stops say whether a vehicle does the same."]
    if not left:
        return [f"Of {count(tried)} simulated stops none leaves the zone claimed."]
    worst = number_in(found, "worst_excess")
    far = "" if worst is None or worst <= 0.0 else f" by up to {with_unit(worst, 'm')}"
    kinds = [
        f"{count(number)} {words}" for key, words in KINDS if (number := number_in(found, key, "left_zone"))
    ]
    parts = f" ({', '.join(kinds)})" if kinds else ""
    who = "it" if left == 1.0 else "each"
    bad = f"; as braking.friction_reserve is asked for, {who} counts as failed"
    return [
        f"Of {count(tried)} simulated stops {_some(left, 'leave', 'leaves')} the zone claimed{far}{parts}"
        f"{bad if problem.friction_reserve else ''}."
    ]


def _cause(problem: Problem) -> list[str]:
    """Why a vehicle leaves a zone that the planned arcs stay in."""
    free = math.isinf(problem.robot.max_steering_rate)
    causes = ["the speed gained before the brakes act"] if problem.braking.reaction_time > 0.0 else []
    causes.append(
        "wheels that lag where the planned curvature jumps, as no steering rate limits it"
        if free
        else "how far the vehicle is from its plan"
    )
    cures = [f"a braking.margin above {problem.braking.margin:g}\u00a0m"]
    cures += ["a wider side of the field"] if isinstance(_shape(problem.zone), ProtectiveField) else []
    cures += ["a robot.max_steering_rate"] if free else []
    cures += ["a lower robot.max_acceleration"] if problem.braking.reaction_time > 0.0 else []
    cure = " or ".join(filter(None, (", ".join(cures[:-1]), cures[-1])))
    return [
        "The planned arcs do stay in the zone (check “Held arcs stay in the zone”); the reckoning leaves out "
        f"{' and '.join(causes)}, and what the zone keeps around the robot is too little for that.",
        f"{cure[0].upper()}{cure[1:]} helps.",
    ]


def _shape(zone: ConvexZone | None) -> ConvexZone | None:
    return zone.base if isinstance(zone, FieldSet) else zone


def _some(number: float, several: str, one: str) -> str:
    return f"{'none' if number == 0.0 else count(number)} {one if number in (0.0, 1.0) else several}"
