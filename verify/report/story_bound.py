"""The lower bound's part of `result.json` as sentences and table rows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from verify.report.bound import listed
from verify.report.figures_bound import Closing
from verify.report.numbers import (
    bracket,
    count,
    duration,
    number_in,
    percent,
    seconds_proven,
    significant,
)
from verify.report.palette import method
from verify.report.story import (
    FAILED,
    Result,
    check_rows,
    entries,
    executed_plan,
    gap_figure,
    gate_limit,
    mapping,
    optima,
    words,
)
from verify.report.wording import STOPPED

FINE = 6  # decimals [s] of the bound that a round proved


@dataclass(frozen=True, kw_only=True)
class BoundStory:
    """What the page says about the lower bound."""

    sentences: tuple[str, ...]
    checked: tuple[str, ...]  # how it was checked, and how to do it again
    statement: str  # the proof in one paragraph, as the checker put it
    rounds: tuple[tuple[str, ...], ...]  # triangles, bound, gap, time since the beginning, solver's status
    missing: str  # why there is no bound, empty when there is one


def bound_story(result: Result) -> BoundStory:
    """All sentences about the lower bound, or why there is none."""
    proven = number_in(result, "lower_bound", "travel_time")
    if proven is None or proven <= 0.0:
        return BoundStory(sentences=(), checked=(), statement="", rounds=(), missing=_missing(result))
    return BoundStory(
        sentences=(bracket_sentence(result), *filter(None, [full_sentence(result), _stopped(result)])),
        checked=_checked(result),
        statement=words(mapping(result, "lower_bound").get("statement")),
        rounds=_rounds(result),
        missing="",
    )


def upper(result: Result) -> tuple[float | None, str]:
    """Least time [s] of a feasible plan of the variational model, and whose it is.

    From the certified gap, so that page and verdict speak of the same plan.
    """
    proven, gap = number_in(result, "lower_bound", "travel_time"), number_in(result, "gaps", "certified")
    if proven is None or gap is None:
        return None, ""
    plans, best = mapping(result, "plans"), proven * (1.0 + gap)
    times = {name: number_in(plans, name, "travel_time") for name in plans if isinstance(name, str)}
    near = {name: abs(time - best) for name, time in times.items() if time is not None}
    found = min(near, key=lambda name: (near[name], name not in optima(result)), default="")
    return (times[found], found) if found and near[found] <= 1e-9 * best else (best, "")


def bracket_sentence(result: Result) -> str:
    """What is proven about every way, and how near the best one found is; empty without a bound."""
    proven, gap = number_in(result, "lower_bound", "travel_time"), number_in(result, "gaps", "certified")
    if proven is None or proven <= 0.0:
        return ""
    best, name = upper(result)
    if best is None or gap is None:
        return f"No path of any homotopy class can take less than {seconds_proven(proven)}."
    low, high = bracket(proven, best)
    whose = f" ({_named(name)})" if name else ""
    return (
        f"No path of any homotopy class can take less than {low}; the best found{whose} takes {high}: "
        f"gap {gap_figure(result, 'certified')}."
    )


def full_bound(result: Result) -> float | None:
    """What no motion of the full robot can beat [s]; None without a bound."""
    proven = number_in(result, "lower_bound", "travel_time")
    return None if proven is None or proven <= 0.0 else proven + (number_in(result, "end_cost") or 0.0)


def least_time(result: Result, plan: str) -> float | None:
    """What plan `plan` is held against [s]: with the ends asked for where its model has them; None without.

    The safe speed at both ends is let to plans of the variational model, whatever the scenario asks for.
    """
    proven, full = number_in(result, "lower_bound", "travel_time"), full_bound(result)
    if proven is None or full is None:
        return None
    model = words(mapping(mapping(result, "plans"), plan).get("model"))
    return full if plan == "refined" or model == "full" else proven


def full_sentence(result: Result) -> str:
    """The same for the full robot, with the extra time E of its ends; empty without a gap."""
    gap, least, name = number_in(result, "gaps", "certified_full"), full_bound(result), executed_plan(result)
    cost, refined = number_in(result, "end_cost"), number_in(result, "plans", "refined", "travel_time")
    time = number_in(result, "plans", name, "travel_time")
    if gap is None or least is None or refined is None or time is None:
        return ""
    low, high = bracket(least, time)
    if cost is not None and cost > 0.0:
        beginning = (
            f"Any motion with the ends asked for takes longer by at least E = {seconds_proven(cost)}, as it "
            f"may not have the safe speed there: the full robot cannot take less than {low}"
        )
    else:
        beginning = (
            "The full robot obeys further limits, which cost time or nothing: it cannot take less than "
            f"{low} either"
        )
    if name == "refined":
        return f"{beginning}; its motion takes {high}: gap {percent(gap)}."
    return (
        f"{beginning}; the motion to execute, that of the {_named(name)}, takes {high}. The gap of the full "
        f"robot, {percent(gap)}, is that of the refined motion, which takes {bracket(least, refined)[1]}."
    )


def _named(plan: str) -> str:
    """A plan's name within a sentence."""
    return method(plan).label.lower().replace("voronoi", "Voronoi")


def _stopped(result: Result) -> str:
    return STOPPED.get(words(mapping(result, "lower_bound").get("stopped")), "")


def _checked(result: Result) -> tuple[str, ...]:
    bound = mapping(result, "lower_bound")
    exact, slack = bound.get("exact") is True, number_in(bound, "worst_slack")
    how = (
        "in rational arithmetic, without rounding"
        if exact
        else "in floating-point arithmetic, with every rounding error counted against it"
    )
    kept, dropped = (count(number_in(bound, key)) for key in ("triangles", "dropped"))
    return (
        f"The certificate was checked without the solver, {how}: {kept} triangles in which the potential "
        f"is nowhere steeper than the speed limit allows, and {dropped} in which the robot cannot move, tile "
        "the floor"
        + (f"; the least relative slack is {significant(slack, 2)}." if slack is not None else "."),
    )


def _rounds(result: Result) -> tuple[tuple[str, ...], ...]:
    best, _ = upper(result)
    rows = []
    for item in entries(mapping(result, "lower_bound"), "rounds"):
        low = number_in(item, "lower_bound")
        rows.append(
            (
                count(number_in(item, "triangles")),
                seconds_proven(low, FINE),
                percent(best / low - 1.0 if best is not None and low else None),
                duration(number_in(item, "seconds")),
                words(item.get("status")),
            )
        )
    return tuple(rows)


def closing(result: Result) -> Closing | None:
    """The rounds as curves; None when none were recorded or nothing was proven."""
    bound = mapping(result, "lower_bound")
    rows = [
        [number_in(item, key) for key in ("triangles", "seconds", "lower_bound")]
        for item in entries(bound, "rounds")
    ]
    told = np.array([row for row in rows if None not in row], dtype=float).reshape(-1, 3)
    told = told[(told > 0.0).all(axis=1)]
    if (number_in(bound, "travel_time") or 0.0) <= 0.0 or not len(told):
        return None
    best, name = upper(result)
    return Closing(
        triangles=told[:, 0],
        seconds=told[:, 1],
        lower=told[:, 2],
        upper=best,
        upper_method=name,
        gap_limit=gate_limit(result, "certified_gap"),
    )


def _missing(result: Result) -> str:
    """Why nothing is proven: the certificate was refused, or its stage did not finish."""
    if number_in(result, "lower_bound", "travel_time") is not None:
        return "The certificate proves no more than zero seconds."
    refused = mapping(result, "lower_bound").get("reasons")
    if isinstance(refused, list | tuple) and refused:
        return "The certificate is refused: " + listed([words(reason) for reason in refused])
    failed = [row for row in check_rows(result) if row.name == "certificate" and row.status == FAILED]
    if failed:
        return f"The certificate is refused: {failed[0].message}"
    stages = [item for item in entries(result, "missing") if item.get("stage") == "lower_bound"]
    reason = words(stages[0].get("reason")) if stages else ""
    return f"No lower bound was computed{f': {reason}' if reason else ''}."
