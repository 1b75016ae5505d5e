"""From `result.json` to sentences and table rows: every figure of the verdict comes from the result."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from verify.cases import gate_status
from verify.report.evidence import Evidence
from verify.report.numbers import (
    DASH,
    count,
    duration,
    exact,
    exact_percent,
    number_in,
    percent_beside,
    seconds,
    significant,
    with_unit,
    with_unit_beside,
)
from verify.report.palette import METHODS
from verify.report.text import label
from verify.report.wording import CHECKS, GATES, VERDICTS, GateWords

Result = Mapping[str, Any]

PASSED, FAILED, NOT_EVALUATED = "passed", "failed", "not evaluated"
NOT_PROMISED = "not promised"  # failed, but by a plan whose model does not know this limit
CERTIFIED, NOT_CERTIFIED = "certified", "not certified"  # of the optimum of a homotopy class
MARKS = {
    PASSED: "✓", FAILED: "✗", NOT_EVALUATED: "–", NOT_PROMISED: "○", CERTIFIED: "✓", NOT_CERTIFIED: "○",
}  # fmt: skip
LONGEST_UNIT = 10  # characters
OPTIMA = ("speed_graph", "collocation")  # plans of the variational optimum, the analytic one first
_ORDER = {FAILED: 0, NOT_EVALUATED: 1, NOT_PROMISED: 2, PASSED: 3}


@dataclass(frozen=True, kw_only=True)
class GateRow:
    """One gate as the page shows it."""

    name: str
    title: str
    meaning: str
    value: str
    limit: str
    status: str
    evaluated: bool  # False: without a value, and failed if somebody named it
    reason: str


@dataclass(frozen=True, kw_only=True)
class CheckRow:
    """One check as the page shows it."""

    name: str
    title: str
    trajectory: str
    status: str
    worst: str
    where: str
    message: str


@dataclass(frozen=True)
class KeyFigure:
    """A figure at the top of the page."""

    name: str
    value: str
    note: str = ""


def entries(result: Result, key: str) -> list[Mapping[str, Any]]:
    """The list at `key`, without anything in it that is not a mapping."""
    found = result.get(key)
    return [item for item in found if isinstance(item, Mapping)] if isinstance(found, list | tuple) else []


def mapping(result: Result, key: str) -> Mapping[str, Any]:
    """The mapping at `key`, empty when absent."""
    found = result.get(key)
    return found if isinstance(found, Mapping) else {}


def words(value: Any) -> str:
    """A text field, empty when absent."""
    return value if isinstance(value, str) else "" if value is None else str(value)


def verdict(result: Result) -> str:
    """certified, refined or failed; `unknown` for anything else."""
    found = result.get("verdict")
    return found if isinstance(found, str) and found in VERDICTS else "unknown"


def reasons(result: Result) -> list[str]:
    """Why the verdict is no better, as the judge put it."""
    found = result.get("reasons")
    return [words(reason) for reason in found] if isinstance(found, list | tuple) else []


def gate_rows(result: Result) -> list[GateRow]:
    """Gates: failing first, of these those without a value before others, then those not evaluated."""
    statuses, rows = {"passed": PASSED, "failed": FAILED, "skipped": NOT_EVALUATED}, []
    for gate in entries(result, "gates"):
        name = words(gate.get("name"))
        look = GATES.get(name) or GateWords(name.replace("_", " ").capitalize(), "", "1")
        passed = gate.get("passed")
        limit = number_in(gate, "limit")
        sign = "≥" if look.at_least else "≤"
        rows.append(
            GateRow(
                name=name,
                title=look.title,
                meaning=look.meaning,
                value=_gate_figure(number_in(gate, "value"), limit, look.unit),
                limit=DASH if limit is None else f"{sign}\u00a0{_limit_figure(limit, look.unit)}",
                status=statuses[gate_status(passed, gate.get("named"))],
                evaluated=isinstance(passed, bool),
                reason=words(gate.get("reason")).removeprefix("not evaluated: "),
            )
        )
    return sorted(rows, key=lambda row: (_ORDER[row.status], row.evaluated))


def _limit_figure(value: float, unit: str) -> str:
    if unit == "%":
        return exact_percent(value)
    return exact(value) if unit in ("1", "") else f"{exact(value)}\u00a0{unit}"


def _gate_figure(value: float | None, limit: float | None, unit: str) -> str:
    """A gate's value, with the digits that show on which side of its limit it is."""
    if unit == "%":
        return percent_beside(value, limit)
    if value is not None and unit == "stops" and value == round(value):
        return count(value)
    if value is None or limit is None:
        return significant(value, 2) if unit == "1" else with_unit(value, unit)
    return with_unit_beside(value, limit, unit)


def gap_figure(result: Result, key: str) -> str:
    """A gap in percent, with the digits that show on which side of its gate's limit it is."""
    return percent_beside(number_in(result, "gaps", key), gate_limit(result, f"{key}_gap"))


def gate_limit(result: Result, name: str) -> float | None:
    """The limit of a gate, None where there is none."""
    limits = (number_in(gate, "limit") for gate in entries(result, "gates") if gate.get("name") == name)
    return next(limits, None)


def strayed(result: Result) -> bool:
    """Whether the simulated vehicle did not follow the motion."""
    return any(row.name == "tracking" and row.status == FAILED for row in check_rows(result))


def check_rows(result: Result) -> list[CheckRow]:
    """Checks: failing first, then not evaluated, then those that a plan's model does not promise to pass."""
    rows = [_check_row(check, words(check.get("status"))) for check in entries(result, "checks")]
    for plan in mapping(result, "plans").values():
        if isinstance(plan, Mapping):
            rows += [_check_row(check, NOT_PROMISED) for check in entries(plan, "unpromised")]
    return sorted(rows, key=lambda row: _ORDER[row.status])


def _check_row(check: Mapping[str, Any], status: str) -> CheckRow:
    name = words(check.get("name"))
    return CheckRow(
        name=name,
        title=CHECKS.get(name, name.replace("_", " ")),
        trajectory=words(check.get("trajectory")),
        status=status if status in (PASSED, FAILED, NOT_PROMISED) else NOT_EVALUATED,
        worst=with_unit(number_in(check, "worst"), label(words(check.get("unit")), LONGEST_UNIT)),
        where=_where(check.get("at")),
        message=re.sub(r" \(not promised by [^()]{1,60}\)$", "", words(check.get("message"))),
    )


def _where(at: Any) -> str:
    t, x, y = (number_in(at, key) for key in "txy")
    parts = [] if t is None else [f"{t:.3f}\u00a0s"]
    if x is not None and y is not None:
        parts.append(f"({x:.2f}, {y:.2f})\u00a0m".replace("-", "−"))
    return " at ".join(parts) or DASH


def executed_plan(result: Result) -> str:
    """The plan whose motion is executed, "" if there is none."""
    plans = mapping(result, "plans")
    best = (words(result.get("executed")), "refined", "collocation", "speed_graph", "voronoi_route")
    return next(
        (n for n in best if number_in(plans, n, "travel_time") is not None and not is_stuck(result, n)), ""
    )


def is_executed(result: Result) -> bool:
    """Whether `executed_plan` is to be executed; else it only stands in, as nothing passed its checks."""
    plan = executed_plan(result)
    return bool(plan) and (words(result.get("executed")) == plan or verdict(result) != "failed")


def is_stuck(result: Result, name: str) -> bool:
    """Whether a plan never reached the goal: then it has no travel time."""
    return mapping(mapping(result, "plans"), name).get("reached") is False


def optima(result: Result) -> tuple[str, ...]:
    """Plans of the variational optimum: with a zone that depends on the heading the collocation alone.

    The speed graph then solves the isotropic relaxation, and its path is driven with the true zone.
    """
    return OPTIMA if mapping(result, "zone").get("isotropic") is not False else ("collocation",)


def reference_plan(result: Result) -> str:
    """What times are compared with: the variational optimum, else uniform braking, else the lower bound."""
    times = travel_times(result)
    return next((name for name in (*optima(result), "uniform", "lower_bound") if name in times), "")


def travel_times(result: Result) -> dict[str, float]:
    """Travel time [s] of everything that has one, in the order of tables."""
    plans = mapping(result, "plans")
    found = {name: number_in(plans, name, "travel_time") for name in plans if isinstance(name, str)}
    found["lower_bound"] = number_in(result, "lower_bound", "travel_time")
    if not unfinished(result):
        found["simulation"] = number_in(result, "simulation", "travel_time")
    order = {name: i for i, name in enumerate(METHODS)}
    names = sorted(found, key=lambda name: (order.get(name, len(order) - 1.5), name))
    return {name: time for name in names if (time := found[name]) is not None and not is_stuck(result, name)}


def unfinished(result: Result, *keys: str) -> str:
    """What became of a simulated run that did not get there, in a word; "" where it arrived.

    `keys`: where in the block of the simulation the run is, nothing for the run itself.
    """
    told = mapping(result, "simulation")
    for key in keys:
        told = mapping(told, key)
    if told.get("fell") is True or told.get("ended") == "fallen":
        return "fell"
    ended = told.get("ended")
    driven = number_in(told, "max_lateral_error") is not None
    untimed = driven and number_in(told, "travel_time") is None  # the judge times only what gets there
    if told.get("arrived") is False or (isinstance(ended, str) and ended != "arrived") or untimed:
        return "did not arrive"
    return ""


def zone_word(result: Result) -> str:
    """What a stop has to stay within: the braking disc, or the zone where that depends on the heading."""
    return "braking zone" if mapping(result, "zone").get("isotropic") is False else "braking disc"


def stops_notes(result: Result, *, zone: bool = True, wheels: bool = True) -> list[str]:
    """How many emergency stops left their braking zone, slid or lifted a wheel; nothing where none did.

    `zone`, `wheels`: which of these are asked for.
    """
    found = mapping(mapping(result, "simulation"), "emergency_stops")
    told = (
        (zone, "left_zone", f"end{{}} outside the {zone_word(result)} that {{}} claim{{}}"),
        (wheels, "slid", "slide{}"),
        (wheels, "lifted", "lift{} a wheel"),
    )
    notes = []
    for asked, key, text in told:
        number = number_in(found, key) if asked else None
        if number:
            one = number == 1.0
            notes.append(
                f"{count(number)} {text.format('s', 'it', 's') if one else text.format('', 'they', '')}"
            )
    return notes


def stops_figure(result: Result) -> str:
    """Bad emergency stops of those that were tried, "" where none were judged."""
    bad, tried = (number_in(result, "simulation", "emergency_stops", key) for key in ("bad", "tried"))
    return "" if bad is None or not tried else f"{count(bad)} of {count(tried)}"


def headline(result: Result) -> str:
    """Verdict in a few words, with what fails."""
    title = VERDICTS[verdict(result)][0] if verdict(result) in VERDICTS else "No verdict"
    rows = gate_rows(result)
    failing = sum(row.status == FAILED for row in rows)
    if failing:
        joint = ":" if verdict(result) == "failed" else ", but"
        return f"{title}{joint} {failing} gate{'s' * (failing > 1)} fail{'s' * (failing == 1)}"
    evaluated = sum(row.evaluated for row in rows)
    if _all_hold(result, rows):
        gates = "the one evaluated gate holds" if evaluated == 1 else f"all {evaluated} evaluated gates hold"
        left = number_in(result, "simulation", "emergency_stops", "left_zone")
        tried = number_in(result, "simulation", "emergency_stops", "tried")
        stops = (
            f", but {count(left)} of {count(tried)} stops leave{'s' * (left == 1.0)} their "
            f"{zone_word(result)}"
            if left
            else ""
        )
        return f"{title}: {gates}{stops}"
    return title


def standing(result: Result) -> str:
    """good, bad or open: the colour of the banner (its words say the same)."""
    if verdict(result) == "failed" or any(row.status == FAILED for row in gate_rows(result)):
        return "bad"
    return "good" if verdict(result) in VERDICTS else "open"


def gate_summary(result: Result) -> str:
    """What the headline leaves out: which gates were not evaluated, and how many hold where some do not."""
    rows = gate_rows(result)
    if not any(row.evaluated or row.status == FAILED for row in rows):
        return "No gate was evaluated."
    passed = sum(row.status == PASSED for row in rows)
    waiting = [row.title.lower() for row in rows if row.status == NOT_EVALUATED]
    told = "" if _all_hold(result, rows) else f"{passed} of {len(rows)} gates hold."
    left = f"Not evaluated: {', '.join(waiting)}." if waiting else ""
    return " ".join(filter(None, (told, left)))


def _all_hold(result: Result, rows: Sequence[GateRow]) -> bool:
    """Whether the headline tells that every gate holds that was evaluated."""
    failing = any(row.status == FAILED for row in rows)
    evaluated = any(row.evaluated for row in rows)
    return evaluated and not failing and verdict(result) in ("certified", "refined")


def not_evaluated(result: Result, evidence: Evidence) -> list[tuple[str, str]]:
    """Everything that is missing, with its reason: (what, why)."""
    rows = [
        (f"Stage {words(item.get('stage'))}", words(item.get("reason")))
        for item in entries(result, "missing")
    ]
    rows += [(f"Gate {row.title.lower()}", row.reason) for row in gate_rows(result) if not row.evaluated]
    rows += [
        (f"Check {row.title.lower()}" + (f" ({row.trajectory})" if row.trajectory else ""), row.message)
        for row in check_rows(result)
        if row.status == NOT_EVALUATED
    ]
    made = [
        name for name in METHODS if name in mapping(result, "plans") or name in ("collocation", "refined")
    ]
    files = (
        "trajectory.csv",
        *(f"trajectories/{name}.csv" for name in made),
        "simulation.csv",
        "scenario.yaml",
    )
    if mapping(mapping(result, "simulation"), "emergency_stops"):
        files = (*files, "stops.npz")
    rows += [(f"Picture of {file}", evidence.reasons[file]) for file in files if file in evidence.reasons]
    return [(what, why or "no reason was recorded") for what, why in rows]


def history_rows(rounds: Sequence[Mapping[str, Any]]) -> list[tuple[str, ...]]:
    """Mesh-refinement rounds as text: round, intervals, iterations, time, violation, solver time."""
    return [
        (
            count(number_in(item, "round")),
            count(number_in(item, "intervals")),
            count(number_in(item, "iterations")),
            seconds(number_in(item, "travel_time")),
            significant(number_in(item, "worst_violation"), 2),
            duration(number_in(item, "solver_time")),
        )
        for item in rounds
    ]
