"""How far the lower bound is refined: the gate whose limit says so, and whether anybody asks for it."""

from __future__ import annotations

from collections.abc import Mapping

from vnav_drake.scenario import Scenario

GATE = "certified_gap"  # what the bound serves; without a bound this gate is not evaluated, and nothing else


def limit_in_force(scenario: Scenario, overrides: Mapping[str, float]) -> float:
    """The gate's limit: that of the command line, else the scenario's."""
    return overrides.get(GATE, scenario.gates[GATE])


def aimed_gap(scenario: Scenario, overrides: Mapping[str, float]) -> float:
    """The gap to reach: the scenario's limit, or that of the command line where it is smaller."""
    limit = scenario.gates[GATE]
    return min(limit, overrides.get(GATE, limit))


def is_pursued(scenario: Scenario, overrides: Mapping[str, float]) -> bool:
    """Whether effort is spent to reach that gap.

    Ways asked for by name need not hold the fastest: no gap to close, unless the gate is named too.
    """
    return not scenario.plan.through or GATE in {*scenario.named_gates, *overrides}
