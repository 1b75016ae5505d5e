"""A judgement in a few lines of text."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from decimal import Decimal
from typing import TYPE_CHECKING, Any

from verify.digits import as_given, beside, digits_beside, rounded, tells_side
from verify.judge import Gate, Judgement, stops_in_words

if TYPE_CHECKING:
    from verify.baseline import Comparison


def headline(judgement: Judgement, comparison: Comparison | None = None) -> str:
    """One line: verdict, times (of the executed plan first), gaps, emergency stops, limits given by hand.

    Where the run is compared with a baseline that fails, the line says so.
    """
    parts = [f"{judgement.scenario}: {judgement.verdict}"]
    plans = ("refined", "speed_graph", "collocation", "vc_method", "voronoi_route", "dwa")
    names = sorted(plans, key=lambda name: name != judgement.executed)
    parts += [f"{name} {_time(judgement.plans[name])}" for name in names if name in judgement.plans]
    if judgement.bound is not None and judgement.bound.travel_time is not None:
        parts.append(f"lower bound {rounded(judgement.bound.travel_time, 3)} s")
    named = (("analytic", "analytic gap"), ("refinement", "gap"), ("certified", "certified gap"))
    for name, words in named:
        if name in judgement.gaps:
            parts.append(f"{words} {_percent(judgement, name)} %")
    stops = (judgement.simulation or {}).get("emergency_stops")
    if stops is not None:
        parts.append(", ".join([stops_in_words(stops), *_stops_notes(stops)]))
    given = limits_given(judgement)
    if given:
        parts.append(f"(gates overridden on the command line: {given})")
    if comparison is not None and not comparison.passed:
        parts.append(comparison.headline)
    return "  ".join(parts)


def _stops_notes(stops: Mapping[str, Any]) -> list[str]:
    """What the emergency stops did that no gate counts, where any did."""
    told = [("slid", "slid"), ("lifted", "lifted a wheel")]
    if not stops.get("friction_reserve"):  # with the reserve it is counted as bad, and told
        told = [("left_zone", "left their braking zone"), *told]
    return [f"{stops[key]} {words}" for key, words in told if stops.get(key)]


def _time(plan: Mapping[str, Any]) -> str:
    """The travel time, where the motion reaches the goal; of a full robot's, what it breaks."""
    if "travel_time" not in plan:
        return "stuck"
    broken = sorted(plan.get("violations", ())) if plan.get("model") == "full" else []
    return f"{plan['travel_time']:.3f} s" + (f" (breaks {', '.join(broken)})" if broken else "")


def _percent(judgement: Judgement, name: str) -> str:
    """A gap with three decimals, or with as many digits as show on which side of its gate's limit it is."""
    gap = judgement.gaps[name]
    usual = f"{round(100.0 * gap, 3) + 0.0:.3f}"
    gate = next((gate for gate in judgement.gates if gate.name == f"{name}_gap"), None)
    if gate is None or gate.value is None:
        return usual
    shown = Decimal(usual) / 100  # of the analytic gap the gate takes the size
    if tells_side(abs(shown) if gate.value >= 0.0 else shown, gate.value, gate.limit):
        return usual
    return f"{100.0 * gap:.{digits_beside(gate.value, gate.limit, 2)}g}"


def limits_given(judgement: Judgement, *, but: Collection[str] = ()) -> str:
    """Limits that took precedence over the scenario's, other than those named; empty when none did."""
    return ", ".join(
        f"{gate.name} {as_given(gate.limit)} instead of {as_given(gate.scenario_limit)}"
        for gate in judgement.gates
        if gate.scenario_limit is not None and gate.name not in but
    )


def failures(judgement: Judgement) -> list[str]:
    """One line for each failing gate, failed check, and named gate that could not be evaluated."""
    lines = [gate_line(gate) for gate in (*judgement.failing_gates, *judgement.unmet_gates)]
    lines += [f"check {c.name} ({c.trajectory}): {c.message}" for c in judgement.failing_checks]
    if judgement.verdict == "failed" and not lines:
        lines += [f"verdict: {reason}" for reason in judgement.reasons]
    return lines


def gate_line(gate: Gate) -> str:
    """A gate with its value and limit."""
    given = " (limit from the command line)" if gate.overridden else ""
    if gate.value is None:
        return f"gate {gate.name}: {gate.reason}{given}"
    word = "holds" if gate.passed else "fails"
    value = beside(gate.value, gate.limit, 6)
    return f"gate {gate.name}: {word}, value {value}, limit {as_given(gate.limit)}{given}"


def details(judgement: Judgement) -> list[str]:
    """Every gate and every check, one line each."""
    lines = [gate_line(gate) for gate in judgement.gates]
    for check in judgement.checks:
        whose = f" ({check.trajectory})" if check.trajectory else ""
        lines.append(f"check {check.name}{whose}: {check.status.replace('_', ' ')}: {check.message}")
    return lines
