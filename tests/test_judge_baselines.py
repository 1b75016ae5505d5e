"""Plans that promise less than all: the vc-method, and a dynamic window run that got stuck."""

import json
import math

import numpy as np
import pytest
from judged import arcs_motion, setting
from result_folder import CHANGES, copy_to

from verify.judge import judge
from verify.judge.checks import check_motion, reaches
from verify.judge.compare import compare
from verify.judge.gates import Gate
from verify.judge.motion import COLUMNS, Motion
from verify.judge.verdict import _nothing_to_refine, _optimum, _sound

V = math.sqrt(3.0) * 0.9  # [m/s]: below sqrt(2 a_b d) with d = 1.5 m


def write(folder, name: str, motion: Motion) -> None:
    rows = np.column_stack([getattr(motion, column) for column in COLUMNS])
    np.savetxt(
        folder / "trajectories" / f"{name}.csv",
        rows,
        fmt="%.17g",
        delimiter=",",
        header=",".join(COLUMNS),
        comments="",
    )


def by_name(motion: Motion, plan: str, **changes):
    found = check_motion(motion, plan, "full", setting(**changes))
    return {check.name: check for check in found}


@pytest.fixture
def stuck_folder(tmp_path):
    """A sound result, and beside it a run that drives 1 m from the start and rests there: 2 s at 1 m/s^2."""
    folder = copy_to(tmp_path)
    motion = arcs_motion((2.0, 3.0), 0.0, [(0.5, 0.0), (0.5, 0.0)], [0.0, 1.0, 0.0], setting(**CHANGES))
    write(folder, "dwa", motion)
    return folder


def test_a_stuck_run_has_no_travel_time_and_takes_part_in_nothing(stuck_folder, tmp_path):
    alone = judge(copy_to(tmp_path / "other"))
    found = judge(stuck_folder)
    plan = found.plans["dwa"]
    assert plan["reached"] is False
    assert "travel_time" not in plan
    assert plan["stopped_after"] == pytest.approx(2.0, rel=1e-12)
    assert plan["feasible"] is False
    assert [entry["name"] for entry in plan["unpromised"]] == ["goal"]
    assert (found.verdict, found.passed) == (alone.verdict, alone.passed)
    assert found.gaps == alone.gaps
    # 2 s are less than any way to the goal takes, yet they contradict no bound
    assert found.bound is not None
    assert found.bound.travel_time == alone.bound.travel_time > 2.0


def test_a_travel_time_claimed_for_a_stuck_run_is_refused(stuck_folder):
    result = json.loads((stuck_folder / "result.json").read_text())
    found = judge(stuck_folder)
    result["plans"]["dwa"] = {**found.plans["dwa"], "travel_time": 2.0}
    said = compare(result, found)
    assert any(text.startswith("plans.dwa.travel_time: claimed") for text in said)


def test_a_run_that_arrives_has_a_travel_time(tmp_path):
    folder = copy_to(tmp_path)
    refined = folder / "trajectories" / "refined.csv"
    (folder / "trajectories" / "dwa.csv").write_bytes(refined.read_bytes())
    found = judge(folder)
    assert found.plans["dwa"]["reached"] is True
    assert found.plans["dwa"]["travel_time"] == found.plans["refined"]["travel_time"]
    assert found.executed in ("refined", "speed_graph")  # never a baseline, though the file is the same


def test_the_vc_method_promises_dynamics_but_not_the_wheels_or_the_motion_at_the_ends():
    # A circle of 0.1 m at 0.5 m/s takes 2.5 m/s^2 of the 5.886 of friction; the wheels turn at 1.29 1/m.
    motion = arcs_motion(
        (5.0, 2.0), 0.0, [(10.0, 0.0), (0.01, 10.0), (0.01, -10.0)], [V, 0.5, 0.5, 0.5], setting()
    )
    checks = by_name(motion, "vc_method", start={"position": [5.0, 2.0], "speed": "rest"})
    assert checks["steering"].status == "failed"
    assert not checks["steering"].promised
    assert "not promised by the vc-method" in checks["steering"].message
    assert checks["friction_circle"].promised
    assert checks["drive"].promised
    assert checks["tip_over"].promised
    assert checks["goal"].blocks  # it must arrive
    all_of_start = [
        c
        for c in check_motion(motion, "vc_method", "full", setting(start={"speed": "rest"}))
        if c.name == "start"
    ]
    assert [(c.status, c.promised) for c in all_of_start] == [("passed", True), ("failed", False)]


def test_the_dynamic_window_promises_the_wheels_too():
    motion = arcs_motion((5.0, 2.0), 0.0, [(1.0, 0.0), (0.01, 10.0)], [V, 0.5, 0.5], setting())
    checks = by_name(motion, "dwa")
    assert checks["steering"].blocks
    assert checks["goal"].status == "failed"
    assert not checks["goal"].promised
    assert checks["start"].promised


# What docs/architecture.md says of `plans`: braking, drive and friction by both, the wheels by one alone, and
# the goal by the other alone.
DYNAMICS = {"boundary", "clearance", "braking_distance", "speed", "friction_circle", "tip_over", "drive"}
PROMISED = {
    "vc_method": DYNAMICS | {"start", "goal", "travel_time"},
    "dwa": DYNAMICS | {"start", "steering", "travel_time"},
}


@pytest.mark.parametrize("plan", PROMISED)
def test_each_baseline_promises_this_and_no_more(plan):
    motion = arcs_motion((5.0, 2.0), 0.0, [(30.0, 0.0)], [V, V], setting())
    promised = {check.name for check in check_motion(motion, plan, "full", setting()) if check.promised}
    assert promised == PROMISED[plan]


@pytest.mark.parametrize("plan", PROMISED)
def test_a_baseline_that_collides_is_held_back(plan):
    # Straight through a pillar on the centre line, which no speed above zero allows.
    pillar = {"world": {"obstacles": [{"vertices": [[20.0, 2.0]]}]}}
    motion = arcs_motion((5.0, 2.0), 0.0, [(30.0, 0.0)], [V, V], setting(**pillar))
    checks = by_name(motion, plan, **pillar)
    assert {name for name, check in checks.items() if check.blocks} == {"clearance", "braking_distance"}
    assert _sound({plan: motion}, tuple(checks.values()), setting(**pillar)) == {}


@pytest.mark.parametrize("plan", PROMISED)
def test_a_baseline_that_leaves_the_hall_is_held_back(plan):
    # Half a turn to the left of radius 3 m from the centre line reaches y = 8; the hall ends at 4.
    motion = arcs_motion((5.0, 2.0), 0.0, [(3.0 * math.pi, 1.0 / 3.0)], [0.5, 0.5], setting())
    checks = by_name(motion, plan)
    assert checks["boundary"].blocks
    assert checks["clearance"].blocks


def test_a_run_that_ends_on_its_way_is_not_sound_though_it_keeps_its_promises():
    whole = arcs_motion((5.0, 2.0), 0.0, [(30.0, 0.0)], [V, V], setting())
    short = arcs_motion((5.0, 2.0), 0.0, [(1.0, 0.0)], [1.0, 0.0], setting())
    motions = {"speed_graph": whole, "dwa": short, "refined": whole}
    model = {"speed_graph": "variational", "dwa": "full", "refined": "full"}
    checks = [c for n, m in motions.items() for c in check_motion(m, n, model[n], setting())]
    assert not any(check.blocks for check in checks)
    sound = _sound(motions, checks, setting())
    assert set(sound) == {"speed_graph", "refined"}
    # faster than the optimum (2 s against 30 / V), it must not hold back `certified`
    times = {name: motion.travel_time for name, motion in motions.items()}
    gate = Gate(name="certified_gap", value=0.0, limit=0.03)
    assert times["dwa"] < times["speed_graph"]
    assert _nothing_to_refine(times, _optimum(times), sound, times["speed_graph"], [gate])
    assert not _nothing_to_refine(times, _optimum(times), motions, times["speed_graph"], [gate])


def test_a_motion_reaches_its_ends_whatever_its_speed():
    whole = arcs_motion((5.0, 2.0), 0.0, [(30.0, 0.0)], [V, V], setting())
    assert reaches(whole, setting(goal={"position": [35.0, 2.0], "speed": "rest"}))
    assert not reaches(whole, setting(goal={"position": [35.0, 2.001]}))
