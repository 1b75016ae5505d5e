"""The tiles at the top of a report: what a reader looks for first."""

from __future__ import annotations

from verify.report.evidence import Evidence
from verify.report.numbers import (
    DASH,
    fine_percent,
    metres,
    number_in,
    percent,
    seconds,
    significant,
    with_unit,
)
from verify.report.palette import method
from verify.report.story import (
    KeyFigure,
    Result,
    executed_plan,
    gap_figure,
    gate_rows,
    is_executed,
    mapping,
    stops_figure,
    stops_notes,
    unfinished,
    words,
)
from verify.report.text import plain
from verify.report.wording import GAPS


def key_figures(result: Result, evidence: Evidence) -> list[KeyFigure]:
    """What a reader looks for first."""
    plan = executed_plan(result)
    facts = mapping(mapping(result, "plans"), plan)
    gates = {row.name: row for row in gate_rows(result)}
    executed = is_executed(result)
    own = method(plan).label if plan else ""
    unused = "" if executed or not plan else f"{own}, not executed"
    figures = [
        KeyFigure("Travel time", seconds(number_in(facts, "travel_time")), unused or own),
        *_gained(result, number_in(facts, "travel_time")),
        KeyFigure("Path length", metres(number_in(facts, "length")), unused),
    ]
    if evidence.executed is not None:
        drawn = method(evidence.executed_plan).label if evidence.executed_plan else "motion shown"
        whose = "of the executed motion" if executed else f"{drawn}, not executed"
        figures.append(KeyFigure("Top speed", f"{evidence.executed.v.max():.2f}\u00a0m/s", whose))
    for name, title in (
        ("braking_margin", "Least braking margin"),
        ("constraint_violation", "Worst violation"),
    ):
        if name in gates:
            row = gates[name]
            figures.append(KeyFigure(title, row.value, f"must be {row.limit}" if row.limit != DASH else ""))
    figures += [
        KeyFigure(title, fine_percent(value) if key == "analytic" else gap_figure(result, key))
        for key, title in GAPS.items()
        if (value := number_in(result, "gaps", key)) is not None
    ]
    error = number_in(result, "simulation", "max_tracking_error")
    if error is not None:
        until = {"fell": ", until it fell", "": ""}.get(unfinished(result), ", as far as it came")
        figures.append(KeyFigure("Largest tracking error", with_unit(error, "m"), f"in simulation{until}"))
    stops = stops_figure(result)
    if stops:
        least = number_in(result, "simulation", "emergency_stops", "min_clearance")
        near = [] if least is None else [f"least clearance {with_unit(least, 'm')}"]
        figures.append(KeyFigure("Bad emergency stops", stops, "; ".join([*near, *stops_notes(result)])))
    factor = number_in(result, "simulation", "margin", "factor")
    if factor is not None:
        figures.append(_grip(result, factor))
    return figures


def _gained(result: Result, time: float | None) -> list[KeyFigure]:
    """Uniform braking beside the zone, where the zone is no disc and both were planned."""
    uniform = number_in(result, "plans", "uniform", "travel_time")
    if mapping(result, "zone").get("isotropic") is not False or uniform is None or time is None:
        return []
    share = f"{percent((uniform - time) / uniform)} of the time with uniform braking" if uniform > 0.0 else ""
    return [
        KeyFigure("With uniform braking", seconds(uniform), "same limits, same ends"),
        KeyFigure("Gained by the zone", seconds(uniform - time), share),
    ]


def _grip(result: Result, factor: float) -> KeyFigure:
    """The margin of the run; a speed that could be driven safely it is not."""
    end = plain(words(mapping(mapping(result, "simulation"), "margin").get("ended_by")))
    until = (
        "the most that was tried" if end.startswith("nothing") else f"until it {end}" if end else "at most"
    )
    note = f"the speed, {until}, with drive and brakes to match; not a safe speed"
    return KeyFigure("Grip in hand", f"{significant(factor)} ×", note)
