"""A small result, as result.json holds it, whose figures are easy to tell apart."""

from __future__ import annotations

from copy import deepcopy
from typing import Any

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
