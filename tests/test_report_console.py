"""The console: bounds rounded down, figures on their side of limits, the executed plan first."""

from __future__ import annotations

import re
from decimal import Decimal
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from verify.digits import as_given, beside, rounded
from verify.judge import Gate, Judgement
from verify.summary import gate_line, headline


def judged(**changes: Any) -> Judgement:
    plans = {name: {"travel_time": 3.0} for name in ("refined", "speed_graph", "collocation")}
    base: dict[str, Any] = {
        "scenario": "room", "scenario_sha256": "", "verdict": "certified", "reasons": (),
        "executed": "refined",
        "plans": plans, "gaps": {}, "end_cost": 0.0, "simulation": None, "gates": (), "checks": (),
    }  # fmt: skip
    return Judgement(**{**base, **changes})


def test_the_headline_tells_what_a_full_robot_s_motion_breaks_and_who_got_stuck():
    plans = {
        "refined": {"travel_time": 3.0, "model": "full", "violations": {}},
        "vc_method": {"travel_time": 2.0, "model": "full", "violations": {"steering": 1.0, "goal": 0.1}},
        "voronoi_route": {"travel_time": 2.5, "model": "variational", "violations": {"steering": 1.0}},
        "dwa": {"reached": False, "stopped_after": 1.0, "model": "full", "violations": {"goal": 4.0}},
    }
    line = headline(judged(plans=plans))
    assert "vc_method 2.000 s (breaks goal, steering)" in line
    assert "voronoi_route 2.500 s  dwa stuck" in line  # the variational model promises no steering


@pytest.mark.parametrize(
    ("executed", "order"),
    [
        ("refined", ["refined", "speed_graph", "collocation"]),
        ("speed_graph", ["speed_graph", "refined", "collocation"]),
        ("collocation", ["collocation", "refined", "speed_graph"]),
        (None, ["refined", "speed_graph", "collocation"]),
    ],
)
def test_the_headline_names_the_executed_plan_first(executed, order):
    assert re.findall(r"(\w+) 3\.000 s", headline(judged(executed=executed))) == order


def test_the_bound_is_rounded_down():
    # The float below 3: times 1000 it rounds to 3000.
    bound = SimpleNamespace(travel_time=2.9999999999999996)
    assert "lower bound 2.999 s" in headline(judged(bound=bound))


@pytest.mark.parametrize(
    ("gap", "limit", "shown"),
    [
        (4.7e-6, 1e-7, "0.00047"),  # fails: zero would look passed
        (4.7e-6, 0.03, "0.000"),
        (0.030001, 0.03, "3.0001"),
        (0.02, 0.03, "2.000"),
    ],
)
def test_a_gap_shows_on_which_side_of_its_limit_it_is(gap, limit, shown):
    gate = Gate(name="certified_gap", limit=limit, value=gap)
    assert f"certified gap {shown} %" in headline(judged(gaps={"certified": gap}, gates=(gate,)))


def test_of_the_analytic_gap_the_size_is_limited():
    gate = Gate(name="analytic_gap", limit=1e-7, value=4.7e-6)
    assert "analytic gap -0.00047 %" in headline(judged(gaps={"analytic": -4.7e-6}, gates=(gate,)))


def test_a_gate_beyond_its_limit_by_little_does_not_print_the_limit():
    line = gate_line(Gate(name="constraint_violation", limit=1e-6, value=1.00000001e-6))
    assert line == "gate constraint_violation: fails, value 1.00000001e-06, limit 1e-06"


LIMITS = st.floats(1e-300, 1e6) | st.floats(-1e6, -1e-300) | st.just(0.0)


@example(2.0**-24, 0.0)  # 17 digits, the last a five: no rounding of it is its shortest name
@given(LIMITS, st.floats(-1e-3, 1e-3) | st.sampled_from([0.0, 2e-16, -2e-16]))
def test_what_is_printed_is_on_the_same_side_as_what_is_judged(limit, off):
    value = limit * (1.0 + off)
    shown, bound = Decimal(beside(value, limit, 2)), Decimal(as_given(limit))
    assert (shown > bound, shown < bound) == (value > limit, value < limit)


@given(st.floats(0.0, 1e9), st.integers(0, 9))
def test_rounding_down_never_rounds_up(value, decimals):
    shown = Decimal(rounded(value, decimals))
    assert shown <= Decimal(value) < shown + Decimal(1).scaleb(-decimals)
