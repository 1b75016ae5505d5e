"""How much the vehicle has in hand, in words: the robustness margin and the cases with other parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from verify.report.numbers import DASH, number_in, seconds, significant, with_unit
from verify.report.story import FAILED, PASSED, Result, entries, mapping, words
from verify.report.text import label, plain

NOTHING = "nothing"  # begins the reason where no factor tried ended it
CAUSE_LENGTH = 32  # characters of a cause in a picture


@dataclass(frozen=True, kw_only=True)
class Trial:
    """One run at a scaled speed."""

    factor: float
    holds: bool
    cause: str


@dataclass(frozen=True, kw_only=True)
class Margin:
    """How far the whole speed profile can be scaled."""

    factor: float | None  # greatest that holds
    ended_by: str
    analytic: float | None  # by the limits of a rigid point alone
    analytic_by: str
    trials: Sequence[Trial]
    over: Trial | None  # the run beyond the analytic limit; `holds` says that nothing was noticed
    over_demand: float | None


@dataclass(frozen=True, kw_only=True)
class CaseRow:
    """One run with another vehicle or start than the controller believes."""

    case: str
    status: str
    verdict: str
    error: str
    lateness: str
    travel_time: str
    least_load: str
    slid: str


def margin(result: Result) -> Margin | None:
    """The study of the limits, None when there is none."""
    told = mapping(mapping(result, "simulation"), "margin")
    trials = [trial for item in entries(told, "runs") if (trial := _trial(item)) is not None]
    factor, analytic = number_in(told, "factor"), number_in(told, "analytic")
    if factor is None and not trials:
        return None
    over = mapping(told, "over")
    reached = number_in(over, "factor")
    return Margin(
        factor=factor,
        ended_by=plain(words(told.get("ended_by"))),
        analytic=analytic,
        analytic_by=plain(words(told.get("analytic_by"))) or "analytic",
        trials=trials,
        over=None
        if reached is None or reached <= 0.0
        else Trial(
            factor=reached, holds=over.get("flagged") is not True, cause=plain(words(over.get("cause")))
        ),
        over_demand=number_in(over, "demand"),
    )


def _trial(item: Mapping[str, Any]) -> Trial | None:
    factor = number_in(item, "factor")
    if factor is None or factor <= 0.0:
        return None
    return Trial(factor=factor, holds=item.get("holds") is True, cause=plain(words(item.get("cause"))))


def margin_sentence(result: Result) -> str:
    """The margin in one sentence, "" when there is none."""
    found = margin(result)
    if found is None or found.factor is None:
        return ""
    if found.factor <= 0.0:
        return "The vehicle holds the whole motion at none of the speeds that were tried."
    times = f"{significant(found.factor)} times"
    if found.ended_by.startswith(NOTHING):
        return f"The vehicle still holds the whole motion at {times} its speed, the most that was tried."
    end = f", then it {found.ended_by}" if found.ended_by else ""
    end += " (drive and brakes as strong as that takes)" if found.factor > 1.0 else ""
    only = "The vehicle holds the whole motion only at" if found.factor < 1.0 else (
        "The vehicle holds the whole motion up to"
    )  # fmt: skip
    return f"{only} {times} its speed{end}."


def why_no_margin(result: Result, *, asked: bool) -> str:
    """Why there is none, to be said after a statement; `asked`: whether the scenario asks for studies."""
    if not asked:
        return ": the scenario asks for no studies (simulation.studies)"
    if any(item.get("stage") == "studies" for item in entries(result, "missing")):
        return ": the studies could not finish"
    if not mapping(result, "simulation"):
        return ": there is no simulated run"
    return ": the vehicle does not follow the motion as it is planned, so there is no more to ask for"


def margin_sentences(result: Result) -> list[str]:
    """The same with what it is to be compared with."""
    found = margin(result)
    if found is None:
        return []
    sentences = [margin_sentence(result)] if found.factor is not None else []
    if found.analytic is not None:
        sentences.append(
            f"For a rigid body without tyres the {found.analytic_by} would end it at "
            f"{significant(found.analytic)} times (analytic limit)."
        )
    if found.over is not None:
        more = "more than" if found.over_demand is None else f"{significant(found.over_demand)} times what"
        at = f"At {significant(found.over.factor)} times the speed, which takes {more} that limit allows,"
        if found.over.holds:
            sentences.append(f"{at} nothing was noticed: the simulation is too kind there.")
        else:
            cause = f": it {found.over.cause}" if found.over.cause else ""
            sentences.append(f"{at} the run is flagged, as it must be{cause}.")
    return sentences


def shown_columns(rows: Sequence[CaseRow]) -> list[tuple[str, str]]:
    """Name and heading of the figures that any row has."""
    every = (
        ("error", "Largest lateral error"),
        ("lateness", "Greatest delay"),
        ("travel_time", "Travel time"),
        ("least_load", "Least wheel load"),
        ("slid", "Slid"),
    )
    return [(key, title) for key, title in every if any(getattr(row, key) != DASH for row in rows)]


def case_rows(result: Result) -> list[CaseRow]:
    """Runs with other friction, mass, height or start than the controller believes."""
    return [_case(item) for item in entries(mapping(result, "simulation"), "robustness")]


def robustness_sentence(rows: Sequence[CaseRow]) -> str:
    """How many cases hold."""
    if not rows:
        return ""
    held = sum(row.status == PASSED for row in rows)
    if held == len(rows):
        return f"The controller copes with all {held} cases in which vehicle or start are not as it believes."
    cases = f"{held} of {len(rows)} cases"
    return f"The controller copes with {cases} in which vehicle or start are not as it believes."


def _case(item: Mapping[str, Any]) -> CaseRow:
    holds, cause = item.get("holds") is True, plain(words(item.get("cause")))
    load, slid = number_in(item, "least_load"), item.get("slid")
    return CaseRow(
        case=plain(words(item.get("case"))) or "unnamed",
        status=PASSED if holds else FAILED,
        verdict="holds" if holds else f"does not hold{': it ' + cause if cause else ''}",
        error=with_unit(number_in(item, "max_lateral_error"), "m"),
        lateness=seconds(number_in(item, "max_lateness")),
        travel_time=seconds(number_in(item, "travel_time")),
        least_load=DASH if load is None else f"{100.0 * load:.0f}\u00a0%",
        slid="yes" if slid is True else "no" if slid is False else DASH,
    )


def short(cause: str) -> str:
    """A cause as it is drawn."""
    return label(cause, CAUSE_LENGTH)
