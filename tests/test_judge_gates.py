"""Extra time of ends, gaps, gates and the comparison with a claimed result."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from judged import setting

from verify.judge.compare import _same_text, compare
from verify.judge.ends import end_cost, straight_time
from verify.judge.finding import Check, Place
from verify.judge.gates import GATE_NAMES, Gate, Times, gaps, gates
from verify.judge.verdict import Judgement, _optimum, _verdict

LIMITS = {
    "analytic_gap": 0.01,
    "refinement_gap": 0.05,
    "certified_gap": 0.03,
    "constraint_violation": 1e-6,
    "braking_margin": 0.0,
    "emergency_stops": 0.0,
}


def cost(**changes: object) -> float:
    where = setting(**changes)
    return end_cost(where.limits, where.surroundings, where.start, where.goal)


def test_safe_ends_cost_nothing():
    assert cost() == 0.0


def test_rest_at_both_ends_costs_the_closed_form():
    # c = 1.5 m, a_b = 1, a_max = 0.5: start sqrt(2c/a_b)(sqrt(1 + a_b/a_max) - 1), goal with a_b for a_max.
    root = math.sqrt(3.0)
    start, goal = root * (math.sqrt(3.0) - 1.0), root * (math.sqrt(2.0) - 1.0)
    robot = {"max_acceleration": 0.5}
    assert cost(robot=robot, start={"speed": "rest"}) == pytest.approx(start, rel=1e-12)
    assert cost(robot=robot, goal={"speed": "rest"}) == pytest.approx(goal, rel=1e-12)
    both = cost(robot=robot, start={"speed": "rest"}, goal={"speed": "rest"})
    assert both == pytest.approx(start + goal, rel=1e-12)


def test_the_warehouse_rest_to_rest_costs_1458_ms():
    # Start clearance 1.5 m (wall y = 0, 1.9 m off), goal clearance 1.6 m (wall x = 0 and rack, 2.0 m off),
    # a_max = a_b = 1: (sqrt 2 - 1)(sqrt 3 + sqrt 3.2).
    world = {"boundary": [[0, 0], [32, 0], [32, 31], [0, 31]],
             "obstacles": [{"vertices": [[4, 22], [14, 22], [14, 27], [4, 27]]}]}  # fmt: skip
    found = cost(
        world=world,
        robot={"radius": 0.4},
        start={"position": [28.5, 1.9], "speed": "rest"},
        goal={"position": [2.0, 22.0], "speed": "rest"},
    )
    assert found == pytest.approx((math.sqrt(2.0) - 1.0) * (math.sqrt(3.0) + math.sqrt(3.2)), rel=1e-12)


def test_a_numeric_end_speed_lies_between_rest_and_safe():
    rest, slow, fast = (cost(start={"speed": speed}) for speed in ("rest", 0.5, 1.7))
    assert rest > slow > fast > 0.0
    assert cost(start={"speed": 0.0}) == pytest.approx(rest, rel=1e-12)
    # almost the safe speed, sqrt(3): the difference is of second order in what is missing
    assert cost(start={"speed": math.sqrt(3.0) * (1.0 - 2e-5)}) == pytest.approx(0.0, abs=1e-8)


def test_the_numeric_law_agrees_with_the_closed_form():
    # A reaction time of a nanosecond takes the numeric branch.
    plain = cost(start={"speed": 0.5})
    lagging = cost(start={"speed": 0.5}, braking={"reaction_time": 1e-9})
    assert lagging == pytest.approx(plain, rel=1e-6)


def test_ends_close_together_share_what_room_there_is():
    # On the centre line of the hall c = 2 - 0.5 m: cuts of c/2 = 0.75 m each; 1.0 m apart they are
    # shortened to 0.5 m each: E = 2 (sqrt(2 * 0.5) - sqrt 2 (sqrt 1.5 - sqrt 1.0)).
    near = {
        "start": {"position": [10.0, 2.0], "speed": "rest"},
        "goal": {"position": [11.0, 2.0], "speed": "rest"},
    }
    expected = 2.0 * (1.0 - math.sqrt(2.0) * (math.sqrt(1.5) - 1.0))
    assert cost(**near) == pytest.approx(expected, rel=1e-12)


def test_the_straight_way_from_rest_to_rest_is_bang_bang():
    # 2 m at 1 m/s^2 both ways take 2 sqrt 2 s; at most 1 m/s: two ramps of 1 s and 0.5 m, 1 m of cruise.
    ends = {"start": {"speed": "rest"}, "goal": {"position": [7.0, 2.0], "speed": "rest"}}
    for limits, expected in (({}, 2.0 * math.sqrt(2.0)), ({"max_speed": 1.0}, 3.0)):
        where = setting(**ends, robot=limits)
        found = straight_time(where.limits, where.surroundings, where.start, where.goal)
        assert found == pytest.approx(expected, rel=1e-12)


@given(
    c=st.floats(0.05, 1.9),
    accelerate=st.floats(0.05, 4.0),
    brake=st.floats(0.05, 4.0),
    part=st.floats(0.0, 0.99),
    share=st.floats(0.0, 1.0),
)
def test_no_other_cut_gives_more(c, accelerate, brake, part, share):
    # E maximises t(s) - integral of dl / sqrt(2 a_b (c - l)); evaluate the difference at any other s < c.
    speed = part * math.sqrt(2.0 * brake * c)
    where = setting(
        robot={"radius": 2.0 - c, "max_braking": brake, "max_acceleration": accelerate, "wheelbase": 0.01,
               "track": 0.01, "com_height": 0.0},
        start={"position": [5.0, 2.0], "speed": speed},
    )  # fmt: skip
    found = end_cost(where.limits, where.surroundings, where.start, where.goal)
    s = share * c
    reach = (math.sqrt(speed**2 + 2.0 * accelerate * s) - speed) / accelerate
    chord = math.sqrt(2.0 / brake) * (math.sqrt(c) - math.sqrt(c - s))
    assert found >= reach - chord - 1e-9 * (1.0 + reach)


def test_gaps_as_the_contract_defines_them():
    times = Times(
        speed_graph=10.0, collocation=10.1, refined=11.0, best_variational=10.0, lower_bound=9.9, end_cost=0.5
    )
    assert gaps(times) == pytest.approx(
        {
            "analytic": 10.0 / 10.1 - 1.0,
            "refinement": 11.0 / 10.5 - 1.0,
            "certified": 10.0 / 9.9 - 1.0,
            "certified_full": 11.0 / 10.4 - 1.0,
        }
    )


def test_what_is_missing_makes_no_gap():
    assert gaps(Times(refined=11.0)) == {}
    assert set(gaps(Times(collocation=10.0, refined=11.0))) == {"refinement"}


def check(name: str, worst: float, violation: float = 0.0, **rest: object) -> Check:
    values = {"trajectory": "refined", "status": "passed", "unit": "m", "at": Place(t=0, x=0, y=0)}
    return Check(name=name, worst=worst, violation=violation, message="m", **(values | rest))  # type: ignore[arg-type]


def test_gates_hold_at_their_limit_and_fail_beyond():
    checks = [check("braking_distance", 0.0), check("drive", -1e-6, 1e-6)]
    found = gates(LIMITS, (), {}, {"analytic": -0.01, "refinement": 0.06}, checks, "refined")
    verdicts = {gate.name: gate.passed for gate in found}
    assert verdicts == {
        "analytic_gap": True,  # the absolute value
        "refinement_gap": False,
        "certified_gap": None,
        "constraint_violation": True,
        "braking_margin": True,
        "emergency_stops": None,
    }
    lower = gates(LIMITS, (), {}, {}, [check("braking_distance", -1e-12)], "refined")
    assert next(gate for gate in lower if gate.name == "braking_margin").passed is False


def test_a_gate_without_a_stage_is_never_passed_and_gives_its_reason():
    for gate in gates(LIMITS, {"certified_gap"}, {}, {}, [], None):
        assert gate.passed is None
        entry = gate.as_result()
        assert "value" not in entry
        assert entry["passed"] is None
        assert entry["reason"].startswith("not evaluated")
        assert gate.named == (gate.name == "certified_gap")


def test_unpromised_violations_of_other_plans_do_not_count():
    checks = [
        check("clearance", 1.0),
        check("steering", -1.0, 1.0, trajectory="collocation", promised=False, status="failed"),
    ]
    found = {gate.name: gate.value for gate in gates(LIMITS, (), {}, {}, checks, "refined")}
    assert found["constraint_violation"] == 0.0
    own = gates(LIMITS, (), {}, {}, checks, "collocation")
    assert {gate.name: gate.value for gate in own}["constraint_violation"] == 1.0


def test_overrides_replace_limits_and_are_marked():
    found = gates(LIMITS, (), {"refinement_gap": 0.1}, {"refinement": 0.06}, [], None)
    gate = next(gate for gate in found if gate.name == "refinement_gap")
    assert gate.passed
    assert gate.as_result()["overridden"] is True
    assert [g.name for g in found] == list(GATE_NAMES)


def judgement() -> Judgement:
    failing = check("steering", -0.1, 0.1, status="failed")
    return Judgement(
        scenario="hall",
        scenario_sha256="1" * 64,
        verdict="failed",
        reasons=("steering: 0.1 too much",),
        executed="refined",
        plans={"refined": {"travel_time": 20.0, "feasible": False, "violations": {"steering": 0.1}}},
        gaps={"refinement": 0.01},
        end_cost=0.0,
        simulation={"travel_time": 20.1},
        gates=(Gate(name="refinement_gap", limit=0.05, value=0.01), Gate(name="certified_gap", limit=0.03)),
        checks=(failing, check("clearance", 0.25)),
    )


TRACKED = check("tracking", 0.1, trajectory="simulation")
STOPS = check("emergency_stops", 0.0, trajectory="simulation")
SINGLE = check("tracking", 0.1, trajectory="single_track")


@pytest.mark.parametrize(
    ("executed", "plans", "checks", "certified", "verdict"),
    [
        ("refined", ("collocation", "refined"), [], False, "refined"),
        ("refined", ("collocation", "refined"), [("refined", "drive", "failed")], False, "failed"),
        ("refined", ("collocation", "refined"), [("collocation", "drive", "failed")], False, "refined"),
        ("collocation", ("collocation",), [], True, "certified"),
        ("collocation", ("collocation",), [], False, "failed"),
        ("collocation", ("collocation",), [("collocation", "start", "failed")], True, "failed"),
        ("collocation", ("collocation", "speed_graph"), [], True, "failed"),
        ("speed_graph", ("collocation", "speed_graph"), [], True, "certified"),
        ("voronoi_route", ("voronoi_route",), [], True, "failed"),
        (None, ("voronoi_route",), [], True, "failed"),
    ],
)
def test_the_verdict_rule(executed, plans, checks, certified, verdict):
    # An unpromised violation of the executed plan counts: it must satisfy every limit, ends included.
    entries = [check(n, -1.0, 1.0, trajectory=t, status=s, promised=False) for t, n, s in checks]
    found, reasons = _verdict(
        _optimum(dict.fromkeys(plans, 1.0)), executed, [*entries, TRACKED, STOPS], certified
    )
    assert found == verdict
    assert bool(reasons) == (verdict == "failed")


@pytest.mark.parametrize("silent", [TRACKED, STOPS, SINGLE])
def test_no_verdict_without_a_check_that_is_asked_for(silent):
    # The run, its emergency stops and, where it is asked for, the pre-screen.
    others = [other for other in (TRACKED, STOPS, SINGLE) if other is not silent]
    for status in ("not_evaluated", "failed"):
        found = [replace(silent, status=status), *others]
        assert _verdict("collocation", "refined", found, False)[0] == "failed"
    unwanted = replace(silent, status="not_evaluated", wanted=False)
    assert _verdict("collocation", "refined", [unwanted, *others], False)[0] == "refined"


@pytest.mark.parametrize(("bad", "passed"), [(None, None), (0, True), (2, True), (3, False)])
def test_the_gate_of_emergency_stops_counts_those_that_end_badly(bad, passed):
    limits = {**LIMITS, "emergency_stops": 2.0}
    found = gates(limits, (), {}, {}, [], None, bad_stops=bad, no_stops="nobody stopped")
    gate = next(gate for gate in found if gate.name == "emergency_stops")
    assert (gate.passed, gate.value) == (passed, bad)
    assert ("nobody stopped" in gate.as_result().get("reason", "")) == (bad is None)


def test_a_true_claim_agrees_also_after_rounding_noise():
    claim = json.loads(json.dumps(judgement().as_result()))
    claim["plans"]["refined"]["travel_time"] *= 1.0 + 1e-12
    claim["plans"]["refined"]["compute_time"] = 3.0
    assert compare(claim, judgement()) == ()


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("verdict", "refined"),
        ("scenario", "other"),
        ("scenario_sha256", "1" * 63 + "2"),
        ("executed", "collocation"),
        ("plans.refined.travel_time", 19.9999),
        ("plans.refined.feasible", True),
        ("plans.refined.feasible", 0),
        ("plans.refined.violations", {}),
        ("plans.refined.violations", {"steering": 0.1, "drive": 1.0}),
        ("plans.speed_graph", {"travel_time": 1.0}),
        ("plans", []),
        ("gaps.refinement", 0.0),
        ("gaps.certified", 0.0),
        ("gates.0.limit", 0.06),
        ("gates.0.passed", False),
        ("gates.1.passed", True),
        ("gates.1.value", 0.0),
        ("gates", []),
        ("checks.0.status", "passed"),
        ("checks.0.worst", 0.1),
        ("checks.0.message", "all is well"),
        ("checks.0.at.t", 1.0),
        ("checks.1.violation", None),
        ("simulation.travel_time", "20.1"),
        ("simulation.travel_time", True),
        ("reasons.0", "steering: 0.2 too much"),
        ("lower_bound", {"travel_time": 19.0}),
    ],
)
def test_every_edited_claim_is_named(path: str, value: object):
    claim = json.loads(json.dumps(judgement().as_result()))
    *parents, key = path.split(".")
    inner = claim
    for parent in parents:
        inner = inner[int(parent)] if isinstance(inner, list) else inner[parent]
    if isinstance(inner, list):
        inner[int(key)] = value
    else:
        inner[key] = value
    found = compare(claim, judgement())
    assert found
    last = "" if key.isdigit() else key
    assert any(last in reason for reason in found)


def test_a_claim_that_lacks_a_figure_is_refused():
    claim = json.loads(json.dumps(judgement().as_result()))
    for key in list(claim):
        lacking = {name: value for name, value in claim.items() if name != key}
        assert any(reason.startswith(key) for reason in compare(lacking, judgement()))


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        ("at least 7.829013 s", "at least 7.829014 s", True),  # one unit of the last digit: rounding
        ("at least 7.829013 s", "at least 7.834000 s", False),  # within 0.1 %, but no rounding
        ("slack 1.2e-08 at (1, 2) m", "slack 1.4e-08 at (1, 2) m", True),  # noise
        ("1657 triangles", "1658 triangles", False),
        ("0.1 too much", "0.2 too much", False),
        ("takes 3 s", "took 3 s", False),
    ],
)
def test_sentences_agree_up_to_rounding_of_their_numbers(one, other, same):
    assert _same_text(one, other) is same
