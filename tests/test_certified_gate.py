"""What a certificate does to checks, gaps, gates, verdict, exit codes and `verify check`."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from judged import arcs_motion, scenario_bytes, setting
from result_folder import CHANGES, copy_to, outcome

from verify import evidence
from verify.__main__ import main
from verify.judge import judge, verdict
from verify.judge.bound import JOINTS, judge_bound, tolerated_time
from verify.judge.certificate import Proof
from verify.judge.checks import check_motion
from verify.judge.gates import GATE_NAMES, Gate
from verify.judge.verdict import _chosen, _nothing_to_refine, _optimum, _sound
from verify.pipeline import Missing, Outcome

STATEMENT = "Every motion from start to goal takes at least so long."


def proof(travel_time: float, *reasons: str, exact: bool = False, **rest: Any) -> Proof:
    """What the checker of certificates says; refused where there are reasons."""
    facts = {"triangles": 12, "dropped": 3, "worst": 0.25, "at": (1.0, 2.0), "slack": np.full(12, 0.25)}
    facts |= {"statement": STATEMENT, "travel_time": travel_time, "exact": exact}
    return Proof(holds=not reasons, reasons=reasons, **{**facts, **rest})


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A result whose certificate, if any, was taken away, with a claim and a manifest to fit."""
    place = copy_to(tmp_path)
    (place / evidence.CERTIFICATE).unlink(missing_ok=True)
    claim(place)
    return place


def claim(place: Path, **changes: Any) -> None:
    """Let result.json say what the judge finds, but for the changes."""
    file = place / evidence.RESULT
    result = json.loads(file.read_text())
    result.pop("lower_bound", None)
    found = judge(place).as_result()
    for name, plan in found["plans"].items():
        result["plans"][name] |= plan
    del found["plans"]
    result |= found | {"files": evidence.manifest(place)} | changes
    file.write_text(json.dumps(result))


def certify(monkeypatch: pytest.MonkeyPatch, place: Path, *found: Any) -> None:
    """Put a certificate into the folder of which the checker says this; the second says it exactly."""
    (place / evidence.CERTIFICATE).write_bytes(b"as the checker says")
    monkeypatch.setattr(verdict, "read_certificate", lambda where: where / evidence.CERTIFICATE)
    monkeypatch.setattr(verdict, "check_certificate", lambda *_, exact=False: found[-1 if exact else 0])
    claim(place)


def least_time(place: Path) -> float:
    """[s], of the variational plans."""
    plans = judge(place).plans
    return min(plan["travel_time"] for plan in plans.values() if plan["model"] == "variational")


def test_a_certificate_closes_the_gaps_as_the_contract_defines_them(folder, monkeypatch):
    best = least_time(folder)
    certify(monkeypatch, folder, proof(0.98 * best))
    found = judge(folder)
    refined = found.plans["refined"]["travel_time"]
    assert found.gaps["certified"] == pytest.approx(1.0 / 0.98 - 1.0, rel=1e-12)
    whole = refined / (0.98 * best + found.end_cost) - 1.0
    assert found.gaps["certified_full"] == pytest.approx(whole, rel=1e-12)
    gate = next(gate for gate in found.gates if gate.name == "certified_gap")
    assert (gate.value, gate.passed) == (found.gaps["certified"], True)
    assert found.as_result()["lower_bound"] == {
        "holds": True, "travel_time": 0.98 * best, "triangles": 12, "dropped": 3, "exact": False,
        "worst_slack": 0.25, "statement": STATEMENT,
    }  # fmt: skip
    entry = next(check for check in found.as_result()["checks"] if check["name"] == "certificate")
    assert (entry["trajectory"], entry["status"], entry["worst"]) == ("lower_bound", "passed", 0.25)


def test_a_gap_beyond_its_gate_fails_and_only_there(folder, monkeypatch):
    certify(monkeypatch, folder, proof(0.9 * least_time(folder)))
    found = judge(folder)
    assert [gate.name for gate in found.failing_gates] == ["certified_gap"]
    assert not found.failing_checks
    assert found.verdict == "refined"


def test_without_a_certificate_nothing_is_said_of_a_bound(folder):
    found = judge(folder)
    assert "lower_bound" not in found.as_result()
    assert not {"certified", "certified_full"} & set(found.gaps)
    assert "certificate" not in {check.name for check in found.checks}
    gate = next(gate for gate in found.gates if gate.name == "certified_gap")
    assert gate.reason == "not evaluated: no lower bound was computed"
    assert found.passed


def test_a_refused_certificate_is_a_failed_check_and_proves_nothing(folder, monkeypatch, capsys):
    faults = [f"triangle {i}: fault {i}" for i in range(30)]
    certify(monkeypatch, folder, proof(1.0, *faults, worst=-0.5))
    found = judge(folder)
    assert found.verdict == "refined"
    assert not found.passed
    (check,) = found.failing_checks
    assert (check.name, check.trajectory, check.violation) == ("certificate", "lower_bound", 0.5)
    assert check.message == "triangle 0: fault 0; triangle 1: fault 1; triangle 2: fault 2; and 27 more"
    assert not {"certified", "certified_full"} & set(found.gaps)
    gate = next(gate for gate in found.gates if gate.name == "certified_gap")
    assert (gate.passed, gate.reason) == (None, "not evaluated: the certificate is refused")
    block = found.as_result()["lower_bound"]
    assert block["reasons"] == [*faults[:20], "and 10 more"]
    assert not {"travel_time", "statement"} & set(block)
    assert main(["check", str(folder)]) == 1
    text = capsys.readouterr().out
    assert not text.splitlines()[0].endswith(": refused")  # the result says what its evidence shows
    assert all(f"lower bound refused: {fault}\n" in text for fault in faults[:20])


def test_a_trajectory_faster_than_the_bound_is_a_contradiction(folder, monkeypatch):
    certify(monkeypatch, folder, proof(least_time(folder) * (1.0 + 1e-4)))
    found = judge(folder)
    (check,) = found.failing_checks
    assert check.name == "certificate"
    assert "a trajectory is faster than the bound proves possible: " in check.message
    assert "certified" not in found.gaps
    assert found.as_result()["lower_bound"]["holds"] is False


def test_what_the_checks_tolerate_is_no_contradiction():
    # The centre line of the hall, d = 1.5 m, V = sqrt 3. A motion at V(d + delta) breaks the braking distance
    # by delta and gains the factor V(d + delta) / V(d) <= 1 + delta / d, here sqrt(1 + delta / d).
    here, delta = setting(), 9e-7
    speed = math.sqrt(2.0 * (1.5 + delta))
    motion = arcs_motion((5.0, 2.0), 0.0, [(30.0, 0.0)], [speed, speed], within=here)
    checks = check_motion(motion, "collocation", "variational", here)
    assert not any(check.blocks for check in checks)
    true = 30.0 / math.sqrt(3.0)
    assert motion.travel_time < true * (1.0 - 2.9e-7)  # faster than any motion that keeps the law
    assert not judge_bound(proof(true), {"collocation": motion}, 0.0, checks, here).reasons
    spared = tolerated_time(motion, {check.name: check for check in checks}, here)
    # the resolution of proven margins is 1e-8 m, JOINTS metres at V(1.5 m) come on top
    highest = (delta + 2e-8) / 1.5 * motion.travel_time + 1.01 * JOINTS / math.sqrt(3.0)
    assert true - motion.travel_time <= spared <= highest
    beyond = judge_bound(proof(true + spared), {"collocation": motion}, 0.0, checks, here)
    assert beyond.travel_time is None
    assert "collocation takes" in beyond.check.message


def test_nothing_is_tolerated_where_nothing_is_used():
    # At half the speed no limit is touched: what is left are the joints, 2e-8 m at V(d) = sqrt 3 m/s.
    here = setting()
    motion = arcs_motion((5.0, 2.0), 0.0, [(30.0, 0.0)], [0.8, 0.8], within=here)
    checks = {c.name: c for c in check_motion(motion, "collocation", "variational", here)}
    assert tolerated_time(motion, checks, here) == pytest.approx(JOINTS / math.sqrt(3.0), rel=1e-6)


def test_a_trajectory_that_fails_its_checks_contradicts_nothing():
    # Twice as fast as the law allows: not a motion of the model that the bound is about.
    here = setting()
    speed = 2.0 * math.sqrt(3.0)
    motion = arcs_motion((5.0, 2.0), 0.0, [(30.0, 0.0)], [speed, speed], within=here)
    checks = check_motion(motion, "collocation", "variational", here)
    assert any(check.blocks for check in checks)
    assert _sound({"collocation": motion}, checks, here) == {}


def test_a_full_motion_faster_than_the_bound_and_its_ends_is_a_contradiction():
    # 30 m from rest to rest at 1 m/s^2, cruising at V = sqrt 3, take 30/sqrt(3) + sqrt(3) s.
    rest = {"speed": "rest"}
    here = setting(start={"position": [5.0, 2.0], **rest}, goal={"position": [35.0, 2.0], **rest})
    top = math.sqrt(3.0) * (1.0 - 1e-6)
    ramp = 0.5 * top * top
    pieces = [(ramp, 0.0), (30.0 - 2.0 * ramp, 0.0), (ramp, 0.0)]
    motion = arcs_motion((5.0, 2.0), 0.0, pieces, [0.0, top, top, 0.0], within=here)
    checks = check_motion(motion, "refined", "full", here)
    assert not any(check.blocks for check in checks if check.name not in ("steering", "drive"))
    lower, sound = 30.0 / math.sqrt(3.0), {"refined": motion}
    assert not judge_bound(proof(lower), sound, math.sqrt(3.0) - 1e-3, checks, here).reasons
    (reason,) = judge_bound(proof(lower), sound, math.sqrt(3.0) + 1e-3, checks, here).reasons
    assert "refined takes" in reason


@pytest.mark.parametrize("exact", [False, True])
def test_checking_prints_what_is_proved(folder, monkeypatch, capsys, exact):
    time = 0.98 * least_time(folder)
    exactly = proof(time, exact=True, statement="In rational arithmetic, likewise.")
    certify(monkeypatch, folder, proof(time), exactly)
    assert main(["check", str(folder), *(["--exact"] if exact else [])]) == 0
    text = capsys.readouterr().out
    assert f"lower bound {math.floor(1e3 * time) / 1e3:.3f} s  " in text.splitlines()[0]
    assert "certified gap 2.041 %" in text.splitlines()[0]  # 1/0.98 - 1
    assert f"lower bound proved: {exactly.statement if exact else STATEMENT}" in text


def test_the_exact_check_has_the_last_word(folder, monkeypatch, capsys):
    time = 0.98 * least_time(folder)
    certify(monkeypatch, folder, proof(time), proof(time, "triangle 7: fails exactly", exact=True))
    assert main(["check", str(folder)]) == 0
    capsys.readouterr()
    assert main(["check", str(folder), "--exact", "--quiet"]) == 1
    text = capsys.readouterr().out
    assert "check certificate (lower_bound): triangle 7: fails exactly" in text
    assert "lower bound refused: triangle 7: fails exactly" in text


def test_asking_for_an_exact_check_without_a_certificate_says_so(folder, capsys):
    assert main(["check", str(folder), "--exact"]) == 0
    assert "lower bound: there is no certificate.npz" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("key", "value", "reason"),
    [
        ("travel_time", 99.0, "lower_bound.travel_time"),
        ("triangles", 13, "lower_bound.triangles"),
        ("exact", True, "lower_bound.exact"),
        ("holds", False, "lower_bound.holds"),
        ("statement", "Nothing is faster than 1 s.", "lower_bound.statement"),
        ("worst_slack", 0.5, "lower_bound.worst_slack"),
        ("reasons", ["none"], "lower_bound.reasons"),
    ],
)
def test_an_edited_claim_about_the_bound_is_refused(folder, monkeypatch, capsys, key, value, reason):
    certify(monkeypatch, folder, proof(0.98 * least_time(folder)))
    file = folder / evidence.RESULT
    result = json.loads(file.read_text())
    result["lower_bound"] |= {key: value}
    file.write_text(json.dumps(result))
    assert main(["check", str(folder)]) == 1
    text = capsys.readouterr().out
    assert "refused" in text
    assert reason in text


def test_a_refused_certificate_cannot_be_claimed_to_prove_a_time(folder, monkeypatch, capsys):
    certify(monkeypatch, folder, proof(1.0, "does not hold"))
    result = json.loads((folder / evidence.RESULT).read_text())
    result["lower_bound"] |= {"travel_time": 1.0, "statement": STATEMENT}
    (folder / evidence.RESULT).write_text(json.dumps(result))
    assert main(["check", str(folder)]) == 1
    text = capsys.readouterr().out
    assert "lower_bound.travel_time: claimed, but not found" in text
    assert "lower_bound.statement: claimed, but not found" in text


def test_a_bound_claimed_without_a_certificate_is_refused(folder, capsys):
    claim(folder, lower_bound={"travel_time": 1.0})
    assert main(["check", str(folder)]) == 1
    assert "lower_bound: claimed, but there is no evidence for it" in capsys.readouterr().out


@pytest.mark.parametrize("edit", ["changed", "removed", "added"])
def test_the_manifest_covers_the_certificate(folder, monkeypatch, capsys, edit):
    file = folder / evidence.CERTIFICATE
    if edit != "added":
        certify(monkeypatch, folder, proof(0.98 * least_time(folder)))
    if edit == "removed":
        file.unlink()
        monkeypatch.undo()
    else:
        file.write_bytes(b"another")
    assert main(["check", str(folder)]) == 1
    words = {"changed": "changed since it was written", "removed": "missing", "added": "not listed"}
    assert f"certificate.npz: {words[edit]}" in capsys.readouterr().out


def ended(found: Any, *missing: Missing) -> int:
    """Exit code of a run with this judgement."""
    return Outcome(judgement=found, result={}, report=Path("r"), missing=missing).exit_code


def named(place: Path) -> None:
    """Let the scenario name the gate."""
    gates = {"refinement_gap": 0.5, "certified_gap": 0.03}
    (place / evidence.SCENARIO).write_bytes(scenario_bytes(**{**CHANGES, "gates": gates}))


def test_exit_codes_of_a_bound_that_is_missing_refused_or_too_low(folder, monkeypatch):
    best, absent = least_time(folder), Missing(stage="lower_bound", reason="none", only_for="certified_gap")
    assert ended(judge(folder)) == 0
    assert ended(judge(folder), absent) == 0  # a gate that nobody named
    assert ended(judge(folder), Missing(stage="refined", reason="none")) == 3
    certify(monkeypatch, folder, proof(1.0, "does not hold"))
    assert ended(judge(folder)) == 1
    named(folder)
    assert ended(judge(folder)) == 1  # it ran, and failed
    certify(monkeypatch, folder, proof(0.5 * best))
    assert ended(judge(folder)) == 1
    certify(monkeypatch, folder, proof(0.99 * best))
    assert ended(judge(folder)) == 0
    monkeypatch.undo()
    (folder / evidence.CERTIFICATE).unlink()
    assert ended(judge(folder), absent) == 3


def some_ways(place: Path, **gates: float) -> None:
    """Let the scenario ask for some ways only."""
    plan = {**CHANGES["plan"], "through": ["boundary/pillar <b>&"]}
    asked = scenario_bytes(**{**CHANGES, "plan": plan, "gates": {"refinement_gap": 0.5, **gates}})
    (place / evidence.SCENARIO).write_bytes(asked)


def test_a_large_gap_says_nothing_against_ways_asked_for_by_name(folder, monkeypatch):
    best = least_time(folder)
    certify(monkeypatch, folder, proof(0.5 * best))
    some_ways(folder)
    found = judge(folder)
    gate = next(gate for gate in found.gates if gate.name == "certified_gap")
    assert gate.passed is None
    assert "over all ways" in gate.reason
    assert found.gaps["certified"] == pytest.approx(1.0, rel=1e-9)  # it is told all the same
    assert ended(found) == 0
    assert judge(folder, {"certified_gap": 0.03}).failing_gates  # unless somebody asks for it
    certify(monkeypatch, folder, proof(0.98 * best))
    assert next(gate for gate in judge(folder).gates if gate.name == "certified_gap").passed
    certify(monkeypatch, folder, proof(0.5 * best))
    some_ways(folder, certified_gap=0.03)
    assert [gate.name for gate in judge(folder).failing_gates] == ["certified_gap"]
    assert ended(judge(folder)) == 1


@pytest.mark.parametrize(
    ("same", "certified", "chosen"),
    [
        ((), True, None),
        (("refined",), True, "refined"),
        (("refined", "collocation"), False, "refined"),
        (("refined", "collocation"), True, "refined"),  # the optimum is the speed graph's
        (("refined", "speed_graph"), True, "speed_graph"),
        (("refined", "speed_graph"), False, "refined"),
        (("collocation", "speed_graph", "voronoi_route"), False, "speed_graph"),
        (("voronoi_route",), True, "voronoi_route"),
    ],
)
def test_a_motion_that_is_several_plans_at_once_goes_by_its_best_name(same, certified, chosen):
    plans = ("voronoi_route", "speed_graph", "collocation", "refined")
    optimum = _optimum(dict.fromkeys(plans, 1.0))
    assert _chosen(optimum, same[0] if same else None, same, certified) == chosen


@pytest.mark.parametrize(
    ("times", "sound", "lower", "value", "certified"),
    [
        ({"speed_graph": 10.0, "collocation": 10.0}, ("speed_graph", "collocation"), 9.9, 0.0101, True),
        # the best plan is within the limit, the one that stands for the optimum is not
        ({"speed_graph": 10.3, "collocation": 10.0}, ("speed_graph", "collocation"), 9.9, 0.0101, False),
        # within the limit, but another plan is faster by more than rows may differ
        ({"speed_graph": 10.001, "refined": 10.0}, ("speed_graph", "refined"), 9.9, 0.0101, False),
        ({"speed_graph": 10.00005, "refined": 10.0}, ("speed_graph", "refined"), 9.9, 0.0101, True),
        # a plan that breaks its promises is not faster
        ({"speed_graph": 10.0, "refined": 5.0}, ("speed_graph",), 9.9, 0.0101, True),
        ({"speed_graph": 10.0}, ("speed_graph",), 9.0, 0.11, False),
        ({"speed_graph": 10.0}, ("speed_graph",), None, None, False),
        ({"refined": 10.0}, ("refined",), 9.9, 0.01, False),
    ],
)
def test_nothing_is_left_to_refine_where_the_optimum_itself_is_within_the_gate(
    times, sound, lower, value, certified
):
    gate = Gate(name="certified_gap", limit=0.03, value=value)
    assert _nothing_to_refine(times, _optimum(times), sound, lower, [gate]) is certified


def test_every_gate_is_still_told_in_its_order():
    assert [gate.name for gate in judge(outcome().report.parent).gates] == list(GATE_NAMES)
