"""The speed graph's part of `result.json` as sentences and table rows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from verify.report.numbers import DASH, count, fine_percent, metres, number_in, percent, seconds, significant
from verify.report.palette import rank_variable
from verify.report.story import CERTIFIED, NOT_CERTIFIED, Result, entries, gate_rows, mapping, words
from verify.report.wording import CONDITIONS

FINE = 6  # decimals of a class optimum [s], which is exact far beyond


@dataclass(frozen=True, kw_only=True)
class ClassRow:
    """One homotopy class as the page shows it."""

    rank: str
    variable: str  # CSS variable of its colour
    name: str
    graph_time: str
    travel_time: str
    length: str
    bound: str
    status: str  # certified or not
    failed: str  # conditions that do not hold, in words
    collocation_time: str
    gap: str  # travel time of the class against the collocation that it seeded
    full_profile: str  # time under the full robot's limits on the same path, or why there is none


@dataclass(frozen=True, kw_only=True)
class AnalyticRow:
    """The speed graph against the collocation of the same model."""

    speed_graph: str
    exact: str  # of the path, without the slowing that makes its rows safe
    collocation: str
    gap: str
    gate: str  # limit and whether it holds
    status: str


def class_rows(result: Result) -> list[ClassRow]:
    """The classes of the speed graph, best first."""
    plan = mapping(mapping(result, "plans"), "speed_graph")
    rows = sorted(entries(plan, "classes"), key=lambda row: number_in(row, "rank") or 0.0)
    seeded = _seeded_times(result)
    return [_class_row(row, seeded.get(words(row.get("class")))) for row in rows]


def _class_row(row: Mapping[str, Any], collocation: float | None) -> ClassRow:
    rank, time = number_in(row, "rank"), number_in(row, "travel_time")
    certified = row.get("certified") is True
    failed = row.get("failed")
    names = [words(name) for name in failed] if isinstance(failed, list | tuple) else []
    full = number_in(row, "full_profile_time")
    bound = number_in(row, "optimality_bound")
    return ClassRow(
        rank=count(rank),
        variable=rank_variable(int(rank or 1)),
        name=words(row.get("class")),
        graph_time=seconds(number_in(row, "graph_time")),
        travel_time=DASH if time is None else f"{time:.{FINE}f}\u00a0s",
        length=metres(number_in(row, "length")),
        bound=DASH if bound is None else f"{significant(bound, 2)}\u00a0s",
        status=CERTIFIED if certified else NOT_CERTIFIED,
        failed="; ".join(CONDITIONS.get(name, name.replace("_", " ")) for name in names),
        collocation_time=seconds(collocation),
        gap=percent(time / collocation - 1.0, signed=True) if time and collocation else DASH,
        full_profile=seconds(full) if full is not None else words(row.get("full_profile_reason")) or DASH,
    )


def _seeded_times(result: Result) -> dict[str, float]:
    """What the variational collocation made of each class of the speed graph [s], by the class's name."""
    collocation = mapping(mapping(result, "plans"), "collocation")
    rows = [row for row in entries(collocation, "seeds") if row.get("method") == "speed_graph"]
    found = {words(row.get("class")): number_in(row, "travel_time") for row in rows}
    return {name: time for name, time in found.items() if time is not None}


def analytic_row(result: Result) -> AnalyticRow | None:
    """Both times of the variational optimum and their gap; None unless there are both."""
    plans = mapping(result, "plans")
    one, other = (number_in(plans, name, "travel_time") for name in ("speed_graph", "collocation"))
    gap, exact = number_in(result, "gaps", "analytic"), number_in(plans, "speed_graph", "exact_time")
    if one is None or other is None or gap is None:
        return None
    gate = next((row for row in gate_rows(result) if row.name == "analytic_gap"), None)
    return AnalyticRow(
        speed_graph=f"{one:.{FINE}f}\u00a0s",
        exact="" if exact is None else f"exact along the path {exact:.{FINE}f}\u00a0s",
        collocation=f"{other:.{FINE}f}\u00a0s",
        gap=fine_percent(gap),
        gate="" if gate is None else f"its size must be {gate.limit}",
        status="" if gate is None else gate.status,
    )


def graph_words(result: Result) -> str:
    """What the graph that ranked the classes is, in a sentence; empty when it is not told."""
    graph = mapping(mapping(mapping(result, "plans"), "speed_graph"), "graph")
    nodes, edges = number_in(graph, "nodes"), number_in(graph, "edges")
    if nodes is None or edges is None:
        return ""
    kind = words(graph.get("kind"))
    return f"The {kind} graph that ranked them has {count(nodes)} nodes and {count(edges)} edges."


def certificate(result: Result) -> str:
    """How far the best class may be from the optimum of its class, as a clause; empty when not told."""
    plan = mapping(mapping(result, "plans"), "speed_graph")
    bound = number_in(plan, "optimality_bound")
    if bound is None:
        return ""
    first = entries(plan, "classes")[:1]
    if first and first[0].get("certified") is not True:
        return "not certified as the optimum of its class"
    return f"within {significant(bound, 2)}\u00a0s of the optimum of its class"
