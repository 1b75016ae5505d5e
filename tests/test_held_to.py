"""Runs beside stored ones that were made with another limit of `certified_gap`."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from metric_case import result, run

from verify.aim import GATE
from verify.baseline import Run, compare, entry, run_of
from verify.baseline_file import Aim, Baseline
from verify.metrics import metrics
from vnav_drake.scenario import parse_scenario

TIME = 20.0  # [s] of the variational optimum; a bound with the gap g is TIME / (1 + g)


def made(gap: float, limit: float, aimed: float | None, verdict: str = "certified", **changes: Any) -> Run:
    """A run whose bound leaves this gap."""
    found = result()
    bound = TIME / (1.0 + gap)
    found["lower_bound"]["travel_time"] = bound
    found["gaps"] |= {"certified": gap, "certified_full": 25.0 / bound - 1.0}
    found["compute_times"]["lower_bound"] = 1.0
    aim = Aim(limit=limit, aimed=aimed)
    return replace(run(), metrics=metrics(found), verdict=verdict, certified_gap=aim, **changes)


def beside(was: Run, now: Run) -> Any:
    return compare(Baseline(schema=1, scenarios={"yard": entry(was)}), now)


TIGHT = made(0.0005, 0.0, 0.0)


def test_a_bound_no_tighter_than_the_later_limit_asks_is_not_worse():
    found = beside(TIGHT, made(0.0199, 0.02, 0.02))
    assert found.failures == []
    assert found.remarks[0] == (
        "baseline: the limit of certified_gap is 0.02, was 0: lower bound, certified gaps and verdict are "
        "held to the looser, 0.02; compute times of the bound and of the whole are not compared"
    )


def test_with_the_same_limit_it_is():
    names = {line.split(":")[0] for line in beside(TIGHT, made(0.0199, 0.0, 0.0)).failures}
    # From 0.2506 to 0.275 the full one is within its tolerance of a quarter.
    assert names == {"baseline lower_bound", "baseline gap.certified"}


def test_beyond_the_looser_limit_it_is_worse_and_what_is_allowed_is_at_that_limit():
    # A limit of 0.25 allows the bound 20 s / 1.25 = 16 s, and 25 s / 16 s - 1 = 0.5625 for the full robot.
    found = beside(TIGHT, made(0.26, 0.25, 0.25))
    allowed = {figure.name: figure.allowed for figure in found.figures if figure.bad}
    expected = {"lower_bound": 16.0, "gap.certified": 0.25, "gap.certified_full": 0.5625}
    assert allowed == pytest.approx(expected, rel=1e-9)


def test_the_looser_limit_may_be_the_stored_one():
    assert not beside(made(0.019, 0.02, 0.02), made(0.0005, 0.0, 0.0)).failures
    assert beside(made(0.0005, 0.02, 0.02), made(0.03, 0.0, 0.0)).failures


@pytest.mark.parametrize(
    ("was", "now", "gap", "passed"),
    [
        (0.02, 0.001, 0.01, True),  # refined, only because the limit is tighter
        (0.02, 0.001, 0.021, False),  # beyond the stored limit, too
        (0.001, 0.02, 0.0005, False),  # a looser limit makes no verdict worse
        (0.02, 0.02, 0.01, False),
    ],
)
def test_a_verdict_may_be_worse_where_only_the_limit_is_tighter(was, now, gap, passed):
    found = beside(made(gap, was, was), made(gap, now, now, "refined"))
    assert found.passed is passed
    told = "baseline: the verdict is refined, was certified"
    assert told in (found.remarks if passed else found.failures)


def test_a_gap_that_one_run_did_not_seek_is_not_compared():
    found = beside(TIGHT, made(0.5, 0.03, None, "certified"))
    assert found.passed
    assert "0.03 (not sought), was 0: lower bound and certified gaps are not compared" in found.remarks[0]
    movements = {figure.name: figure.movement for figure in found.figures}
    skipped = {"lower_bound", "gap.certified", "gap.certified_full"}
    skipped |= {"compute_time.lower_bound", "compute_time.total"}
    assert {name for name, movement in movements.items() if movement == "not_compared"} == skipped


@pytest.mark.parametrize(
    ("plan", "gates", "overrides", "expected"),
    [
        ("", "", {}, Aim(limit=0.03, aimed=0.03)),
        ("", f"gates: {{{GATE}: 0.01}}", {}, Aim(limit=0.01, aimed=0.01)),
        ("", f"gates: {{{GATE}: 0.01}}", {GATE: 0.5}, Aim(limit=0.5, aimed=0.01)),
        ("", "", {GATE: 0.0}, Aim(limit=0.0, aimed=0.0)),
        ("plan: {through: [O1/boundary]}", "", {}, Aim(limit=0.03, aimed=None)),
        ("plan: {through: [O1/boundary]}", "", {GATE: 0.02}, Aim(limit=0.02, aimed=0.02)),
    ],
)
def test_what_is_kept_are_the_limits_in_force(plan, gates, overrides, expected):
    text = f"""\
schema: 1
name: yard
world:
  boundary: [[0, 0], [20, 0], [20, 8], [0, 8]]
  obstacles: [{{vertices: [[9, 3], [11, 3], [11, 5], [9, 5]]}}]
robot: {{radius: 0.5, mass: 40.0, wheelbase: 0.5, track: 0.4, com_height: 0.12, friction: 0.6,
  max_braking: 1.0, max_acceleration: 1.0, max_steering: 0.6}}
start: {{position: [3, 4]}}
goal: {{position: [17, 4]}}
{plan}
{gates}
"""
    scenario = parse_scenario(text.encode(), "yard.yaml")
    found = run_of(scenario, {**result(), "gate_overrides": overrides})
    assert found.certified_gap == expected
    assert entry(found).certified_gap == expected
