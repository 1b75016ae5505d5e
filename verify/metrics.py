"""The figures of a result by which runs are compared: one name, one number, one direction each."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

Kind = Literal["travel_time", "bound", "gap", "margin", "count", "compute_time"]
Better = Literal["smaller", "greater"]

TOTAL = "compute_time.total"
UNIT_OF_KIND: Mapping[Kind, str] = {
    "travel_time": "s",
    "bound": "s",
    "gap": "",
    "margin": "m",
    "count": "",
    "compute_time": "s",
}
# By the first word of a figure's name.
_KINDS: Mapping[str, Kind] = {
    "travel_time": "travel_time",
    "lower_bound": "bound",
    "gap": "gap",
    "margin": "margin",
    "constraint_violation": "gap",
    "emergency_stops": "count",
    "tracking_error": "margin",
    "compute_time": "compute_time",
}
_GREATER = frozenset({"lower_bound", "margin"})  # first words of what is better when greater
_GAPS = ("analytic", "refinement", "certified", "certified_full")


@dataclass(frozen=True, kw_only=True)
class Metric:
    """One figure of a run."""

    name: str  # such as travel_time.refined; the same in every version
    value: float  # finite
    unit: str  # "s", "m", or "" without one
    kind: Kind
    better: Better


def kind_of(name: str) -> Kind:
    """The kind of figure that a name means; of a name that is none of ours, a bare number."""
    return _KINDS.get(name.partition(".")[0], "gap")


def metrics(result: Mapping[str, Any]) -> tuple[Metric, ...]:
    """The figures of a run, in a fixed order.

    Parameters
    ----------
    result : the content of result.json. What it does not hold, or not as a finite number, is absent: no
        figure is made up for a plan that does not reach the goal, nor for a stage that did not run.

    Returns
    -------
    Travel times [s] of the plans that reach the goal and of the simulation; the lower bound [s]; the gaps
    (the analytic one without its sign); the least braking margin, the simulated least clearances and the
    tracking error [m]; the worst constraint violation; bad emergency stops; compute times [s].
    """
    return tuple({metric.name: metric for metric in _found(result)}.values())


def _found(result: Mapping[str, Any]) -> Iterator[Metric]:
    for name, plan in _mapping(result, "plans").items():
        if isinstance(plan, Mapping) and plan.get("reached") is not False:
            yield from _metric(f"travel_time.{name}", plan.get("travel_time"))
    simulation = _mapping(result, "simulation")
    if simulation.get("arrived") is not False:
        yield from _metric("travel_time.simulation", simulation.get("travel_time"))
    bound = _mapping(result, "lower_bound").get("travel_time")
    yield from _metric("lower_bound", bound)
    for name in _GAPS:
        gap = finite_number(_mapping(result, "gaps").get(name))
        yield from _metric(f"gap.{name}", abs(gap) if name == "analytic" and gap is not None else gap)
    gates = _gate_values(result)
    stops = _mapping(simulation, "emergency_stops")
    yield from _metric("margin.braking", gates.get("braking_margin"))
    yield from _metric("margin.clearance", simulation.get("min_clearance"))
    yield from _metric("margin.stops_clearance", stops.get("min_clearance"))
    yield from _metric("constraint_violation", gates.get("constraint_violation"))
    yield from _metric("emergency_stops", gates.get("emergency_stops"))
    yield from _metric("tracking_error", simulation.get("max_tracking_error"))
    times = {stage: finite_number(value) for stage, value in _mapping(result, "compute_times").items()}
    seconds = {stage: value for stage, value in times.items() if value is not None}
    for stage, value in seconds.items():
        yield from _metric(f"compute_time.{stage}", value)
    if seconds:
        yield from _metric(TOTAL, sum(seconds.values()))


def _metric(name: str, value: object) -> Iterator[Metric]:
    """The one metric, or none where there is no such number."""
    number = finite_number(value)
    if number is not None:
        kind = kind_of(name)
        better: Better = "greater" if name.partition(".")[0] in _GREATER else "smaller"
        yield Metric(name=name, value=number, unit=UNIT_OF_KIND[kind], kind=kind, better=better)


def _gate_values(result: Mapping[str, Any]) -> dict[str, object]:
    """Measured values by gate; gates that were not evaluated are absent."""
    gates = result.get("gates")
    if not isinstance(gates, list):
        return {}
    return {
        str(gate.get("name")): gate.get("value")
        for gate in gates
        if isinstance(gate, Mapping) and gate.get("passed") is not None
    }


def _mapping(parent: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    value = parent.get(key)
    return value if isinstance(value, Mapping) else {}


def finite_number(value: object) -> float | None:
    """A finite number; None for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        number = float(value)
    except OverflowError:  # an integer that no float holds
        return None
    return number if math.isfinite(number) else None
