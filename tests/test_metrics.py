"""The figures by which runs are compared."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from metric_case import result

from verify.metrics import metrics


def values(found: dict[str, Any]) -> dict[str, float]:
    return {metric.name: metric.value for metric in metrics(found)}


def test_every_figure_of_a_result_has_its_name():
    # Each number is the one in tests/metric_case.py; the total is 1.5 + 2.25 + 8, the analytic gap loses
    # its sign.
    assert values(result()) == {
        "travel_time.speed_graph": 20.0,
        "travel_time.refined": 25.0,
        "travel_time.simulation": 25.5,
        "lower_bound": 19.5,
        "gap.analytic": 0.002,
        "gap.refinement": 0.03,
        "gap.certified": 0.025,
        "margin.braking": 0.0625,
        "margin.clearance": 0.25,
        "margin.stops_clearance": 0.125,
        "constraint_violation": 1e-12,
        "emergency_stops": 0.0,
        "tracking_error": 0.015625,
        "compute_time.speed_graph": 1.5,
        "compute_time.refined": 2.25,
        "compute_time.emergency_stops": 8.0,
        "compute_time.total": 11.75,
    }


def test_direction_and_unit_of_each_kind():
    # More is better of what is proven below and of distances to obstacles; less of everything else.
    greater = {m.name for m in metrics(result()) if m.better == "greater"}
    assert greater == {"lower_bound", "margin.braking", "margin.clearance", "margin.stops_clearance"}
    kinds = {unit: {m.kind for m in metrics(result()) if m.unit == unit} for unit in ("s", "m", "")}
    assert kinds == {"s": {"travel_time", "bound", "compute_time"}, "m": {"margin"}, "": {"gap", "count"}}


def test_a_plan_that_gets_stuck_has_no_travel_time():
    found = result()
    found["plans"]["dwa"]["travel_time"] = 55.0  # not ours to say: `reached` is False
    assert "travel_time.dwa" not in values(found)


def test_a_gate_that_was_not_evaluated_gives_no_figure():
    found = result()
    found["gates"][2] = {"name": "braking_margin", "limit": 0.0, "passed": None, "reason": "not evaluated"}
    assert "margin.braking" not in values(found)


def test_a_run_that_does_not_arrive_has_no_simulated_travel_time():
    found = result()
    found["simulation"]["arrived"] = False
    assert "travel_time.simulation" not in values(found)


@pytest.mark.parametrize("bad", [None, "25.4", True, float("nan"), float("inf"), 10**400, [25.4], {}])
def test_what_is_no_finite_number_is_absent(bad: object):
    found = result()
    found["plans"]["refined"]["travel_time"] = bad
    assert "travel_time.refined" not in values(found)
    assert "travel_time.speed_graph" in values(found)


JSON = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=6,
)


@given(st.sampled_from(sorted(result())), JSON)
def test_no_part_of_a_result_can_break_the_reading(key: str, anything: Any):
    found = result()
    found[key] = anything
    names = [metric.name for metric in metrics(found)]
    assert len(names) == len(set(names))
