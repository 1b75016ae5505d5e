"""A small result, as result.json holds it, whose figures are easy to tell apart; and runs made of it."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import replace
from typing import Any

from verify.baseline import Run
from verify.baseline_file import Aim
from verify.judge import Gate, Judgement
from verify.metrics import metrics
from verify.suite import Suite

_RESULT: dict[str, Any] = {
    "schema": 1,
    "scenario": "yard",
    "scenario_sha256": "0" * 64,
    "verdict": "refined",
    "plans": {
        "speed_graph": {"travel_time": 20.0},
        "dwa": {"reached": False, "stopped_after": 55.0},
        "refined": {"travel_time": 25.0},
    },
    "lower_bound": {"travel_time": 19.5},
    "gaps": {"analytic": -0.002, "refinement": 0.03, "certified": 0.025},
    "simulation": {
        "arrived": True,
        "travel_time": 25.5,
        "min_clearance": 0.25,
        "max_tracking_error": 0.015625,
        "emergency_stops": {"tried": 4, "min_clearance": 0.125},
    },
    "gates": [
        {"name": "analytic_gap", "value": 0.002, "limit": 0.01, "passed": True},
        {"name": "constraint_violation", "value": 1e-12, "limit": 1e-6, "passed": True},
        {"name": "braking_margin", "value": 0.0625, "limit": 0.0, "passed": True},
        {"name": "emergency_stops", "value": 0.0, "limit": 0.0, "passed": True},
    ],
    "compute_times": {"speed_graph": 1.5, "refined": 2.25, "emergency_stops": 8.0},
    "versions": {"vnav_drake": "0.1.0"},
}


def result() -> dict[str, Any]:
    """A copy of its own for each caller."""
    return deepcopy(_RESULT)


def judgement(*gates: Gate, **changes: Any) -> Judgement:
    """A judgement with these gates; the one that executes `refined` unless told otherwise."""
    facts: dict[str, Any] = {
        "scenario": "yard",
        "scenario_sha256": "0" * 64,
        "verdict": "refined",
        "reasons": (),
        "executed": "refined",
        "plans": {},
        "gaps": {},
        "end_cost": 0.0,
        "simulation": None,
        "gates": gates,
        "checks": (),
    }
    return Judgement(**(facts | changes))


HELD = Gate(name="analytic_gap", limit=0.01, value=0.002)
BROKEN = Gate(name="refinement_gap", limit=0.05, value=0.0625)
NOT_RUN = Gate(name="certified_gap", limit=0.03, reason="not evaluated: no bound")
NAMED_NOT_RUN = Gate(name="emergency_stops", limit=0.0, reason="not evaluated: no stops", named=True)


def run(**changes: Any) -> Run:
    """What a baseline compares of `result()`."""
    plain = Run(
        scenario="yard",
        question="a" * 64,
        effort="full",
        verdict="refined",
        certified_gap=Aim(limit=0.03, aimed=0.03),
        metrics=metrics(result()),
    )
    return replace(plain, **changes)


def suite(*gates: Gate, **changes: Any) -> Suite:
    """A suite of one judged run."""
    facts: dict[str, Any] = {
        "name": "yard",
        "file": "scenarios/yard.yaml",
        "report": "reports/yard/report.html",
        "judgement": judgement(*(gates or (HELD,))),
        "run": run(),
        "version": "0.1.0",
    }
    return Suite(**(facts | changes))
