"""A judgement in a few lines of text."""

from __future__ import annotations

import math
from collections.abc import Collection

from verify.judge import Gate, Judgement


def headline(judgement: Judgement) -> str:
    """Verdict, travel times, gap, and limits given on the command line, in one line."""
    parts = [f"{judgement.scenario}: {judgement.verdict}"]
    names = ("refined", "speed_graph", "collocation", "voronoi_route")
    times = [(name, judgement.plans[name]["travel_time"]) for name in names if name in judgement.plans]
    parts += [f"{name} {time:.3f} s" for name, time in times]
    if judgement.bound is not None and judgement.bound.travel_time is not None:
        parts.append(f"lower bound {math.floor(1e3 * judgement.bound.travel_time) / 1e3:.3f} s")
    named = (("analytic", "analytic gap"), ("refinement", "gap"), ("certified", "certified gap"))
    for name, words in named:
        if name in judgement.gaps:
            parts.append(f"{words} {round(100.0 * judgement.gaps[name], 3) + 0.0:.3f} %")
    given = limits_given(judgement)
    if given:
        parts.append(f"(gates overridden on the command line: {given})")
    return "  ".join(parts)


def limits_given(judgement: Judgement, *, but: Collection[str] = ()) -> str:
    """Limits that took precedence over the scenario's, other than those named; empty when none did."""
    return ", ".join(
        f"{gate.name} {gate.limit:.6g} instead of {gate.scenario_limit:.6g}"
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
    return f"gate {gate.name}: {word}, value {gate.value:.6g}, limit {gate.limit:.6g}{given}"


def details(judgement: Judgement) -> list[str]:
    """Every gate and every check, one line each."""
    lines = [gate_line(gate) for gate in judgement.gates]
    for check in judgement.checks:
        whose = f" ({check.trajectory})" if check.trajectory else ""
        lines.append(f"check {check.name}{whose}: {check.status.replace('_', ' ')}: {check.message}")
    return lines
