"""What the collocation started from, and what came of each seed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from verify.report.numbers import DASH, count, duration, fine_percent, number_in, percent, seconds
from verify.report.palette import Method, method
from verify.report.story import Result, entries, mapping, words

COLD_START = "cold_start"
SAME = "the same"


@dataclass(frozen=True, kw_only=True)
class SeedRow:
    """One seed as the page shows it."""

    look: Method
    seed_class: str  # homotopy class of the seed
    ended_in: str  # homotopy class of what came of it, "the same" where that is the seed's
    travel_time: str
    above: str  # the best row
    iterations: str
    rounds: str
    intervals: str
    compute_time: str
    message: str


@dataclass(frozen=True, kw_only=True)
class SeedStory:
    """Seeds compared to the end, the first tries, and what that says."""

    sentences: tuple[str, ...]
    compared: tuple[SeedRow, ...]
    tried: tuple[SeedRow, ...]


def seed_story(result: Result) -> SeedStory:
    """The seeds of the variational collocation, as far as the result tells."""
    plan = mapping(mapping(result, "plans"), "collocation")
    compared, tried = entries(plan, "comparison"), entries(plan, "seeds")
    return SeedStory(
        sentences=tuple(filter(None, [*_agreement(compared), _cold(compared or tried)])),
        compared=_rows(compared, ended="class"),
        tried=_rows(tried, begun="class", ended="ended_in") if len(tried) > 1 else (),
    )


def _rows(found: Sequence[Mapping[str, Any]], *, ended: str, begun: str = "") -> tuple[SeedRow, ...]:
    """`begun`, `ended`: the keys of the seed's class, if told, and of the class of what came of it."""
    classes = [(words(row.get(begun)), words(row.get(ended))) for row in found]
    times = [number_in(row, "travel_time") for row in found]
    best = min((time for time in times if time is not None), default=None)
    return tuple(
        SeedRow(
            look=method(words(row.get("method"))),
            seed_class=first or DASH,
            ended_in=SAME if first and first == last else last or DASH,
            travel_time=seconds(time),
            above=DASH
            if time is None or not best
            else "best"
            if time == best
            else percent(time / best - 1.0, signed=True),
            iterations=count(number_in(row, "iterations")),
            rounds=count(number_in(row, "rounds")),
            intervals=count(number_in(row, "intervals")),
            compute_time=duration(number_in(row, "compute_time")),
            message=words(row.get("message")),
        )
        for row, time, (first, last) in zip(found, times, classes, strict=True)
    )


def _agreement(compared: Sequence[Mapping[str, Any]]) -> list[str]:
    """Whether seeds that ended in one class reached one time, and within what.

    Of a row without a class nothing is known, so that it agrees with none.
    """
    groups: dict[str, list[tuple[str, float]]] = {}
    for row in compared:
        time, name = number_in(row, "travel_time"), words(row.get("class"))
        if name and time is not None and time > 0.0:
            groups.setdefault(name, []).append((words(row.get("method")), time))
    shared = {name: rows for name, rows in groups.items() if len(rows) > 1}
    if not shared and len(groups) > 1:
        names = _listed([method(rows[0][0]).label for rows in groups.values()])
        return [
            f"{names} each ended in a homotopy class of its own, so their times say nothing about each other."
        ]
    if not shared:
        return []
    out = []
    for rows in shared.values():
        low, high = min(time for _, time in rows), max(time for _, time in rows)
        names = _listed([method(key).label for key, _ in rows])
        apart = "to the last digit" if high == low else f"within {fine_percent(high / low - 1.0).lstrip('+')}"
        out.append(f"{names} lead to the same class and agree {apart}.")
    alone = [method(rows[0][0]).label for rows in groups.values() if len(rows) == 1]
    if alone:
        out.append(
            f"{_listed(alone)} ended in {'another class' if len(alone) == 1 else 'classes of their own'}."
        )
    return out


def _cold(rows: Sequence[Mapping[str, Any]]) -> str:
    cold = next((row for row in rows if words(row.get("method")) == COLD_START), None)
    if cold is None:
        return ""
    time = number_in(cold, "travel_time")
    if time is None:
        return "The cold start, the straight line from start to goal, led to nothing safe."
    others = [number_in(row, "travel_time") for row in rows if row is not cold]
    best = min((other for other in others if other is not None), default=None)
    text = f"The cold start, the straight line from start to goal, led to {seconds(time)}"
    if best is None or best <= 0.0:
        return text + "."
    ratio = time / best - 1.0
    relation = "more" if ratio >= 0.0 else "less"
    return f"{text}, {percent(abs(ratio))} {relation} than the best of the others."


def _listed(names: Sequence[str]) -> str:
    return " and ".join(filter(None, [", ".join(names[:-1]), *names[-1:]]))
