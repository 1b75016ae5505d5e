"""The index of a report folder: all scenarios side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

from verify.report import story
from verify.report.html import render, write_whole
from verify.report.numbers import DASH, metres, number_in, percent_or_times, seconds, seconds_proven
from verify.report.wording import VERDICTS


@dataclass(frozen=True, kw_only=True)
class IndexRow:
    """One scenario."""

    name: str
    link: str
    headline: str
    standing: str
    travel_time: str
    length: str
    optimum: str
    above: str
    lower_bound: str
    gap: str
    simulated: str
    stops: str
    gates: str


def write_index(file: Path, results: Sequence[tuple[str, Mapping[str, Any]]]) -> None:
    """Write the index page of `results`, pairs of a scenario's folder name beside `file` and its result.

    Raises
    ------
    OSError : the file cannot be written; an older one is untouched.
    """
    rows = [_row(name, result) for name, result in results]
    counts = {kind: sum(row.standing == kind for row in rows) for kind in ("bad", "open", "good")}
    write_whole(file, render("index.html", rows=rows, counts=counts))


def _row(name: str, result: Mapping[str, Any]) -> IndexRow:
    times, plan = story.travel_times(result), story.executed_plan(result)
    time = times.get(plan)
    optimum = next((times[name] for name in story.optima(result) if name in times), None)
    gates = story.gate_rows(result)
    statuses = (story.FAILED, story.PASSED, story.NOT_EVALUATED)
    counts = {status: sum(row.status == status for row in gates) for status in statuses}
    return IndexRow(
        name=name,
        link=f"./{quote(name, safe='')}/report.html",
        headline=VERDICTS.get(story.verdict(result), ("No verdict", ""))[0],
        standing=story.standing(result),
        travel_time=seconds(time),
        length=metres(number_in(result, "plans", plan, "length")),
        optimum=seconds(optimum),
        above=percent_or_times(time / optimum - 1.0) if time is not None and optimum else "–",
        lower_bound=seconds_proven(times.get("lower_bound")),
        gap=story.gap_figure(result, "certified"),
        simulated=story.unfinished(result) or seconds(times.get("simulation")),
        stops=story.stops_figure(result) or DASH,
        gates=", ".join(f"{number} {word}" for word, number in counts.items() if number) or "none",
    )
