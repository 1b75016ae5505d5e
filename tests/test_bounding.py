"""The lower bound as a stage, and which plan is executed once it is there."""

from __future__ import annotations

import json
import math
import shutil
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from judged import scenario, scenario_bytes
from result_folder import CHANGES, NO_STOPS, outcome
from test_architecture import IMPORTS

from systems import SimulationError
from verify import bounding, choosing, evidence, pipeline
from verify.__main__ import main
from verify.aim import GATE, aimed_gap
from verify.bounding import run_lower_bound
from verify.choosing import drive_as_planned, optimum_to_execute
from verify.judge import SAME_TIME, judge
from verify.judge.certificate import read_certificate
from verify.pipeline import Outcome, run_scenario
from vnav_drake.plan import Path as Way
from vnav_drake.plan import Plan, Trajectory
from vnav_drake.problem import NoPathError, PlanningError
from vnav_drake.scenario import ScenarioError

# Round a point in a wide room with safe ends: friction (mu g = 5.9 m/s^2), tip-over (16 m/s^2) and steering
# (1.3 /m) are far from what the variational optimum needs, a_b = a_max = 1 m/s^2 and bends of some metres.
WIDE: dict[str, Any] = {
    "name": "wide_turn",
    "world": CHANGES["world"],
    "robot": {"radius": 0.4},
    "start": {"position": [2.0, 3.0]},
    "goal": {"position": [10.0, 3.0]},
    "plan": {"effort": "quick"},
    "simulation": NO_STOPS,
}
pytestmark = pytest.mark.usefixtures("unreported")


@cache
def wide() -> Outcome:
    """Of a real run; its folder must not be changed."""
    return run_scenario(scenario(**WIDE), Path(mkdtemp(prefix="vnav-wide-")))


def told(_text: str) -> None:
    pass


# --- the stage ---


@pytest.mark.parametrize(
    ("given", "expected"),
    [({}, 0.03), ({GATE: 0.001}, 0.001), ({GATE: 0.5}, 0.03), ({"refinement_gap": 0.001}, 0.03)],
)
def test_the_gap_aimed_at_is_the_gate_or_a_smaller_limit_given_by_hand(given, expected):
    assert aimed_gap(scenario(), given) == expected
    assert aimed_gap(scenario(gates={GATE: 0.0}), given) == 0.0


def plan_of(name: str, time: float) -> Plan:
    return Plan(method=name, model="variational", trajectory=SimpleNamespace(travel_time=time))  # type: ignore[arg-type]


def test_the_least_time_of_the_variational_optima_is_what_the_gap_refers_to(monkeypatch):
    asked: dict[str, Any] = {}
    monkeypatch.setattr(bounding, "lower_bound", lambda _problem, **how: asked.update(how))
    plans = {"voronoi_route": 1.0, "speed_graph": 5.0, "collocation": 4.0, "refined": 3.0}
    many = {name: plan_of(name, time) for name, time in plans.items()}
    run_lower_bound(scenario(plan={"effort": "quick"}), many, {GATE: 0.02}, told)
    assert asked["upper"] == 4.0
    assert asked["gap"] == pytest.approx(0.02, rel=1e-5)
    assert asked["gap"] < 0.02  # the checker rounds down
    assert asked["effort"] == "quick"
    run_lower_bound(scenario(), {"voronoi_route": many["voronoi_route"]}, {}, told)
    assert asked["upper"] is None


@pytest.mark.parametrize(("ahead", "holds"), [(1.0, True), (0.999, False)])
def test_fields_that_do_not_hold_their_base_get_no_bound(monkeypatch, ahead, holds):
    # At 1 m/s and a_b = 1 m/s^2 the base reaches 0.5 m of stopping and 0.5 m of robot ahead, and 0.7 m with
    # 0.2 m of its side to either side; the field as much and no more, or 0.2 mm narrower.
    wide = 0.5 + 0.2 * ahead
    polygon = [[-0.5, -wide], [1.0, -wide], [1.0, wide], [-0.5, wide]]
    base = {"type": "protective_field", "form": "rectangle", "side": 0.2}
    zone = {"type": "field_set", "base": base, "fields": [{"max_speed": 1.0, "polygon": polygon}]}
    monkeypatch.setattr(bounding, "lower_bound", lambda _problem, **_how: None)
    asked = scenario(braking={"zone": zone})
    if holds:
        run_lower_bound(asked, {}, {}, told)
        return
    with pytest.raises(
        PlanningError, match=r"^not run: braking.zone.fields\[0\] does not hold the base zone"
    ):
        run_lower_bound(asked, {}, {}, told)


@pytest.mark.parametrize(
    ("plan", "named", "given", "effort"),
    [
        ({}, {}, {}, "full"),
        ({"through": ["O1/boundary"]}, {}, {}, "quick"),
        ({"through": ["O1/boundary"]}, {GATE: 0.03}, {}, "full"),
        ({"through": ["O1/boundary"]}, {}, {GATE: 0.03}, "full"),
    ],
)
def test_ways_asked_for_by_name_cost_no_effort_unless_their_gap_is_asked_for(
    monkeypatch, plan, named, given, effort
):
    asked: dict[str, Any] = {}
    monkeypatch.setattr(bounding, "lower_bound", lambda _problem, **how: asked.update(how))
    run_lower_bound(scenario(plan=plan, gates=named), {}, given, told)
    assert asked["effort"] == effort


@pytest.mark.parametrize(
    ("fault", "plans", "kind", "words"),
    [
        (NoPathError("parted"), {}, NoPathError, "parted"),
        (
            NoPathError("parted"),
            {"refined": plan_of("refined", 1.0)},
            PlanningError,
            "finds no way where there",
        ),
        (MemoryError(), {}, PlanningError, "MemoryError"),
        (RuntimeError("Clarabel\nlong"), {}, PlanningError, "RuntimeError: Clarabel$"),
        (PlanningError("none was found"), {}, PlanningError, "none was found"),
    ],
)
def test_what_keeps_a_bound_from_being_found_is_a_stage_that_cannot_finish(
    monkeypatch, fault, plans, kind, words
):
    def fail(*_: object, **__: object) -> None:
        raise fault

    monkeypatch.setattr(bounding, "lower_bound", fail)
    with pytest.raises(PlanningError, match=words) as caught:
        run_lower_bound(scenario(), plans, {}, told)
    assert type(caught.value) is kind


def test_a_gap_of_the_command_line_is_reached(tmp_path):
    # The first mesh leaves about 1 %: what is asked for here takes more rounds.
    asked = replace(scenario(**WIDE), name="tighter")
    found = run_scenario(asked, tmp_path, overrides={GATE: 0.002})
    assert len(found.result["lower_bound"]["rounds"]) > len(wide().result["lower_bound"]["rounds"])
    assert 0.0 <= found.judgement.gaps["certified"] <= 0.002
    assert found.exit_code == 0


def test_progress_names_triangles_and_the_gap_so_far():
    said: list[str] = []
    plans = {"speed_graph": plan_of("speed_graph", 4.6)}
    run_lower_bound(scenario(**WIDE), plans, {}, said.append)
    assert said
    assert all("triangles" in text and "gap" in text for text in said)


def write(folder: Path, **changes: Any) -> Path:
    file = folder / "wide.yaml"
    file.write_bytes(scenario_bytes(**{**WIDE, **changes}))
    return file


def without_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object, **__: object) -> None:
        raise PlanningError("the solver gave up")

    monkeypatch.setattr(bounding, "lower_bound", fail)


def test_no_bound_means_a_gate_that_is_not_evaluated_and_nothing_else(tmp_path, capsys, monkeypatch):
    without_bound(monkeypatch)
    junit = tmp_path / "j.xml"
    assert main([str(write(tmp_path)), "--out", str(tmp_path / "out"), "--junit", str(junit)]) == 0
    text = capsys.readouterr().out
    assert text.startswith("wide_turn: refined")
    assert "missing lower_bound: the solver gave up" in text
    result = json.loads((tmp_path / "out/wide_turn/result.json").read_text())
    assert result["missing"] == [{"stage": "lower_bound", "reason": "the solver gave up"}]
    assert "lower_bound" not in result
    assert not (tmp_path / "out/wide_turn" / evidence.CERTIFICATE).exists()
    cases = {case.get("name"): case for case in ElementTree.parse(junit).iter("testcase")}
    assert cases[GATE].find("skipped") is not None
    assert ElementTree.parse(junit).getroot().get("errors") == "0"
    assert main(["check", str(tmp_path / "out/wide_turn")]) == 0


def test_no_bound_where_its_gate_is_named_exits_3(tmp_path, capsys, monkeypatch):
    without_bound(monkeypatch)
    assert main([str(write(tmp_path, gates={GATE: 0.03})), "--out", str(tmp_path / "out")]) == 3
    assert f"gate {GATE}: not evaluated" in capsys.readouterr().out


def test_a_way_that_only_the_bound_finds_blocked_is_no_bad_input(tmp_path, monkeypatch):
    def fail(*_: object, **__: object) -> None:
        raise NoPathError("blocked triangles part them")

    monkeypatch.setattr(bounding, "lower_bound", fail)
    found = run_scenario(scenario(**WIDE), tmp_path)
    assert found.exit_code == 0
    assert [(item.stage, item.only_for) for item in found.missing] == [("lower_bound", GATE)]


def test_a_goal_out_of_reach_is_bad_input_as_before(tmp_path):
    wall = {"obstacles": [{"vertices": [[6, 0], [6.5, 0], [6.5, 7.5], [6, 7.5]]}]}
    with pytest.raises(ScenarioError, match=r"goal\.position"):
        run_scenario(scenario(**{**WIDE, "world": {**WIDE["world"], **wall}}), tmp_path)


# --- a whole run ---


def test_the_bound_is_below_every_variational_time_and_within_its_gate():
    result = wide().result
    lower = result["lower_bound"]["travel_time"]
    times = [plan["travel_time"] for plan in result["plans"].values() if plan["model"] == "variational"]
    assert len(times) == 2
    assert lower <= min(times)
    assert result["gaps"]["certified"] == pytest.approx(min(times) / lower - 1.0, rel=1e-12)
    assert result["gaps"]["certified"] <= 0.03
    # and above what is plain: no path is shorter than 8 m, none faster than V at 3.6 m, all the room there is
    assert lower >= 8.0 / math.sqrt(2.0 * 3.6)


def test_the_result_says_what_is_proved_and_how_it_was_found():
    block = wide().result["lower_bound"]
    assert {
        "holds", "travel_time", "triangles", "dropped", "exact", "statement", "worst_slack", "method",
        "stopped", "rounds", "compute_time",
    } <= set(block)  # fmt: skip
    assert block["stopped"] == "gap"
    for step in block["rounds"]:
        assert set(step) == {"triangles", "lower_bound", "status", "seconds"}
    assert max(step["lower_bound"] for step in block["rounds"]) == pytest.approx(
        block["travel_time"], rel=1e-9
    )
    assert evidence.CERTIFICATE in wide().result["files"]
    assert read_certificate(wide().report.parent) is not None


def test_where_nothing_is_left_to_refine_the_optimum_is_executed_and_certified(capsys):
    folder = wide().report.parent
    assert wide().exit_code == 0
    assert (wide().judgement.verdict, wide().judgement.executed) == ("certified", "speed_graph")
    executed = (folder / evidence.EXECUTED).read_bytes()
    assert executed == (folder / "trajectories/speed_graph.csv").read_bytes()
    assert executed != (folder / "trajectories/refined.csv").read_bytes()
    plan = wide().result["plans"]["speed_graph"]
    assert plan["feasible"]
    # the vehicle drove that one: within millimetres of it, where the simulated travel time is its own
    assert wide().result["simulation"]["max_tracking_error"] <= 0.02
    assert wide().result["simulation"]["travel_time"] == pytest.approx(plan["travel_time"], abs=0.05)
    assert judge(folder).as_result() == wide().judgement.as_result()
    for arguments in ([], ["--exact"]):
        assert main(["check", str(folder), *arguments]) == 0
        text = capsys.readouterr().out
        assert text.startswith("wide_turn: certified")
        assert "lower bound proved: " in text
    assert "in rational arithmetic" in text


def test_the_line_of_a_run_tells_verdict_times_and_gap(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(pipeline, "run_scenario", lambda *_, **__: wide())
    (tmp_path / "out").mkdir()
    assert main([str(write(tmp_path)), "--out", str(tmp_path / "out")]) == 0
    (line,) = capsys.readouterr().out.splitlines()
    result = wide().result
    assert line.startswith(f"wide_turn: certified  {result['executed']} ")
    assert f"certified gap {100.0 * result['gaps']['certified']:.3f} %" in line
    shown = float(line.partition("lower bound ")[2].partition(" s")[0])
    assert 0.0 <= result["lower_bound"]["travel_time"] - shown <= 1e-3  # rounded down


def test_ends_at_rest_leave_something_to_refine():
    # The optimum has the safe speed at its ends, so it fails the checks start and goal.
    found = outcome()
    assert (found.judgement.verdict, found.judgement.executed) == ("refined", "refined")
    assert found.exit_code == 0
    gaps, cost = found.judgement.gaps, found.judgement.end_cost
    assert cost > 0.0
    lower, refined = (found.result[a][b]["travel_time"] if b else found.result[a]["travel_time"]
                      for a, b in (("lower_bound", ""), ("plans", "refined")))  # fmt: skip
    assert gaps["certified_full"] == pytest.approx(refined / (lower + cost) - 1.0, rel=1e-12)
    assert gaps["certified_full"] >= 0.0  # what is proven of the full robot, it cannot beat


def test_a_gap_beyond_its_gate_leaves_the_refined_plan_to_execute(tmp_path, monkeypatch):
    # A coarse certificate: one round, whatever the gap.
    real = bounding.lower_bound
    monkeypatch.setattr(
        bounding, "lower_bound", lambda problem, **how: real(problem, **(how | {"budget": 1}))
    )
    found = run_scenario(scenario(**WIDE), tmp_path, overrides={GATE: 1e-5})
    assert (found.judgement.verdict, found.judgement.executed) == ("refined", "refined")
    assert [gate.name for gate in found.judgement.failing_gates] == [GATE]
    assert found.exit_code == 1


def test_a_certificate_that_proves_too_much_is_refused_and_the_refined_plan_runs(
    tmp_path, monkeypatch, capsys
):
    real = bounding.lower_bound

    def steeper(problem: Any, **how: Any) -> Any:
        found = real(problem, **how)
        certificate = found.certificate
        higher = {name: getattr(certificate, name) * 1.01 for name in ("u_vertex", "u_edge")}
        return replace(found, certificate=replace(certificate, **higher))

    monkeypatch.setattr(bounding, "lower_bound", steeper)
    assert main([str(write(tmp_path)), "--out", str(tmp_path / "out")]) == 1
    text = capsys.readouterr().out
    assert text.startswith("wide_turn: refined")
    assert "check certificate (lower_bound): " in text
    assert "steeper" in text
    result = json.loads((tmp_path / "out/wide_turn/result.json").read_text())
    assert result["executed"] == "refined"
    assert result["lower_bound"]["holds"] is False
    assert "certified" not in result["gaps"]
    assert main(["check", str(tmp_path / "out/wide_turn")]) == 1
    assert "lower bound refused: " in capsys.readouterr().out


@pytest.mark.parametrize("edit", ["u scaled", "truncated", "removed", "start moved"])
def test_an_edited_certificate_or_question_is_refused(tmp_path, capsys, edit):
    folder = tmp_path / "out/wide_turn"
    folder.parent.mkdir()
    shutil.copytree(wide().report.parent, folder)
    file = folder / evidence.CERTIFICATE
    if edit == "u scaled":
        arrays = dict(np.load(file))
        arrays |= {name: arrays[name] * (1.0 + 1e-6) for name in ("u_vertex", "u_edge")}
        np.savez_compressed(file, **arrays)
    elif edit == "truncated":
        file.write_bytes(file.read_bytes()[:-1000])
    elif edit == "removed":
        file.unlink()
    else:
        asked = folder / evidence.SCENARIO
        moved = {**WIDE, "start": {"position": [2.001, 3.0]}}
        asked.write_bytes(scenario_bytes(**moved))
    result = json.loads((folder / evidence.RESULT).read_text())
    result["files"] = evidence.manifest(folder)  # as a forger would
    (folder / evidence.RESULT).write_text(json.dumps(result))
    assert main(["check", str(folder)]) == 1
    text = capsys.readouterr().out
    assert "refused" in text
    words = {
        "u scaled": "certificate",
        "truncated": evidence.CERTIFICATE,
        "removed": "lower_bound",
        "start moved": "start",
    }
    assert words[edit] in text


# --- which plan is executed ---


def straight(scale: float = 1.0, method: str = "speed_graph") -> Plan:
    """Along the centre line of the hall at a constant share of sqrt 3 m/s."""
    x = np.linspace(5.0, 35.0, 301)
    nil, speed = np.zeros(len(x)), math.sqrt(3.0) * (1.0 - 1e-6) / scale
    motion = Trajectory((x - 5.0) / speed, x, nil + 2.0, nil, nil + speed, nil, nil, nil + 1.5)
    model = "full" if method == "refined" else "variational"
    return Plan(method=method, model=model, trajectory=motion, path=Way.polyline([[5.0, 2.0], [35.0, 2.0]]))


def test_the_optimum_is_executed_where_it_keeps_every_limit_and_refining_gains_nothing():
    plans = {"speed_graph": straight(), "refined": straight(1.0 - 0.5 * SAME_TIME, "refined")}
    assert optimum_to_execute(scenario(), plans) is plans["speed_graph"]
    assert optimum_to_execute(scenario(), {"collocation": straight(method="collocation")}) is not None
    assert optimum_to_execute(scenario(), {"refined": straight(method="refined")}) is None
    faster = {**plans, "refined": straight(1.0 - 3.0 * SAME_TIME, "refined")}
    assert optimum_to_execute(scenario(), faster) is None


@pytest.mark.parametrize(
    "changes",
    [{"start": {"speed": "rest"}}, {"goal": {"heading": 1.0}}, {"robot": {"max_speed": 1.0}}],
    ids=["rest", "heading", "speed"],
)
def test_an_optimum_that_breaks_a_limit_of_the_full_robot_is_not_executed(changes):
    assert optimum_to_execute(scenario(**changes), {"speed_graph": straight()}) is None


def test_an_optimum_with_a_kink_is_not_executed():
    plan = straight()
    motion, half = plan.trajectory, 150
    heading = motion.heading.copy()
    heading[half:] += 1e-4  # far above rounding, which no wheel can turn in no time
    bent = replace(
        motion,
        heading=heading,
        y=motion.y + np.where(motion.x > motion.x[half], 1e-4 * (motion.x - motion.x[half]), 0.0),
    )
    assert optimum_to_execute(scenario(), {"speed_graph": replace(plan, trajectory=bent)}) is None


def test_a_vehicle_that_strays_or_a_simulation_that_ends_early_leaves_the_refined_plan(monkeypatch):
    def fail(*_: object, **__: object) -> None:
        raise SimulationError("diverged")

    monkeypatch.setattr(choosing, "simulate", fail)
    assert drive_as_planned(scenario(), straight(), "single_track") is None
    monkeypatch.setattr(choosing, "simulate", lambda *_, **__: SimpleNamespace())
    monkeypatch.setattr(choosing, "follows", lambda *_: False)
    assert drive_as_planned(scenario(), straight(), "single_track") is None


def test_a_run_that_strays_falls_back_to_the_refined_plan(tmp_path, monkeypatch):
    monkeypatch.setattr(pipeline, "drive_as_planned", lambda *_: None)
    found = run_scenario(scenario(**WIDE), tmp_path)
    assert (found.judgement.verdict, found.judgement.executed) == ("refined", "refined")
    assert found.exit_code == 0
    assert found.judgement.gaps["certified"] <= 0.03


def test_the_stage_knows_nothing_of_the_judge():
    own = {
        name
        for key in ("verify.bounding", "verify.aim")
        for name in IMPORTS[key]
        if name.startswith("verify")
    }
    assert {".".join(name.split(".")[:2]) for name in own} == {"verify.aim"}
