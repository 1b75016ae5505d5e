"""The whole way with real parts, what remains when a stage cannot finish, and runs that are cut off."""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from judged import scenario, scenario_bytes
from result_folder import CHANGES, NO_STOPS, contents, copy_to, outcome

from systems import SimulationError
from verify import evidence, execution, pipeline, planning, seeding
from verify.by_products import THUMBNAIL
from verify.judge import judge
from verify.pipeline import plain, run_scenario
from verify.recheck import recheck
from vnav_drake.problem import PlanningError
from vnav_drake.scenario import ScenarioError
from vnav_drake.voronoi_route import plan_voronoi_route

WAREHOUSE = Path(__file__).parents[1] / "scenarios/warehouse.yaml"


def test_a_run_leaves_the_evidence_the_result_and_the_report():
    folder = outcome().report.parent
    assert outcome().exit_code == 0
    assert set(contents(folder)) == {
        "scenario.yaml", "trajectory.csv", "simulation.csv", "stops.npz", "certificate.npz", "result.json",
        "report.html", "replay.html", "thumbnail.svg",
        "trajectories/speed_graph.csv", "trajectories/voronoi_route.csv", "trajectories/collocation.csv",
        "trajectories/refined.csv",
    }  # fmt: skip
    assert (folder / "scenario.yaml").read_bytes() == scenario_bytes(**CHANGES)
    assert (folder / "trajectory.csv").read_bytes() == (folder / "trajectories/refined.csv").read_bytes()
    assert json.loads((folder / "result.json").read_text()) == outcome().result


def test_the_result_has_the_fields_that_users_rely_on():
    result = outcome().result
    assert result["schema"] == 1
    assert result["scenario"] == "around_a_point"
    assert result["verdict"] == "refined"
    assert set(result["plans"]) == {"speed_graph", "voronoi_route", "collocation", "refined"}
    for plan in result["plans"].values():
        assert {"travel_time", "length", "class", "compute_time", "feasible", "violations"} <= set(plan)
    for name in ("collocation", "refined"):
        assert {"model", "solver", "intervals", "iterations"} <= set(result["plans"][name])
    assert [gate["name"] for gate in result["gates"]] == [
        "analytic_gap", "refinement_gap", "certified_gap", "constraint_violation", "braking_margin",
        "emergency_stops",
    ]  # fmt: skip
    assert {check["name"] for check in result["checks"] if check["trajectory"] == "refined"} == {
        "boundary", "start", "goal", "clearance", "braking_distance", "friction_circle", "tip_over",
        "steering", "drive", "speed", "travel_time",
    }  # fmt: skip
    assert {"model", "travel_time", "max_tracking_error", "min_clearance"} <= set(result["simulation"])
    assert {"vnav_drake", "drake", "numpy", "scipy", "shapely", "python"} <= set(result["versions"])
    assert {"travel_time", "method", "triangles", "compute_time"} <= set(result["lower_bound"])
    assert set(result["gaps"]) == {"analytic", "refinement", "certified", "certified_full"}


def test_rest_ends_are_no_faster_than_the_variational_optimum_plus_their_cost():
    # E is proven: the refinement gap against the optimum cannot be negative.
    assert outcome().judgement.end_cost > 0.0
    assert outcome().result["gaps"]["refinement"] > 0.0


def test_the_verdict_is_a_pure_function_of_the_folder(tmp_path):
    folder = copy_to(tmp_path)
    (folder / "result.json").unlink()
    (folder / "report.html").unlink()
    again = judge(folder)
    assert again.as_result() == outcome().judgement.as_result()


def run_with(monkeypatch: pytest.MonkeyPatch, out: Path, **broken: Exception) -> pipeline.Outcome:
    """A real run in which the named stages raise instead of finishing."""
    for name, error in broken.items():
        module = execution if name == "simulate" else planning

        def fail(*_: object, error: Exception = error, **__: object) -> None:
            raise error

        monkeypatch.setattr(module, name, fail)
    return run_scenario(scenario(**{**CHANGES, "simulation": NO_STOPS}), out)


def test_without_collocation_the_rest_is_judged_and_reported(tmp_path, monkeypatch):
    error = PlanningError("no geometry was found")
    result = run_with(monkeypatch, tmp_path, plan_variational=error, plan_full=error)
    assert result.exit_code == 3
    assert [(m.stage, m.reason) for m in result.missing] == [
        ("collocation", "no geometry was found"),
        ("refined", "no geometry was found"),
        ("simulation", "not run: it needs a refined trajectory"),
    ]
    assert result.judgement.verdict == "failed"
    assert set(result.result["plans"]) == {"speed_graph", "voronoi_route"}
    assert "simulation" not in result.result
    assert not (result.report.parent / "trajectory.csv").exists()
    assert "no geometry was found" in result.report.read_text()
    assert recheck(result.report.parent).reasons == ()


@pytest.mark.usefixtures("unreported")
def test_without_simulation_nothing_passes_unseen(tmp_path, monkeypatch):
    error = SimulationError("diverged at t = 1 s")
    result = run_with(monkeypatch, tmp_path, simulate=error)
    assert result.exit_code == 3
    assert result.judgement.verdict == "failed"
    assert result.judgement.reasons == ("tracking: no simulation was recorded",)
    tracking = next(check for check in result.judgement.checks if check.name == "tracking")
    assert tracking.status == "not_evaluated"


@pytest.mark.usefixtures("unreported")
def test_without_a_variational_plan_the_full_one_starts_from_the_analytic_ones(tmp_path, monkeypatch):
    result = run_with(monkeypatch, tmp_path, plan_variational=PlanningError("none"))
    assert result.exit_code == 3
    assert {"speed_graph", "voronoi_route", "refined"} <= set(result.result["plans"])
    gates = {gate.name: gate.passed for gate in result.judgement.gates}
    assert gates["analytic_gap"] is None
    assert gates["refinement_gap"] is True  # against the speed graph


def test_a_plan_without_a_path_is_a_stage_that_cannot_finish():
    with pytest.raises(PlanningError, match="gave no path"):
        seeding.path_of(replace(plan_voronoi_route(scenario(**CHANGES).problem), path=None))


def test_no_path_is_bad_input_and_touches_nothing(tmp_path):
    blocked = scenario(
        name="blocked", world={"obstacles": [{"vertices": [[20, 0], [21, 0], [21, 3.5], [20, 3.5]]}]}
    )
    with pytest.raises(ScenarioError, match=r"goal\.position"):
        run_scenario(blocked, tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_values_of_details_become_plain_json():
    found = plain(
        {"a": np.float64(1.5), "b": float("nan"), "c": [np.int64(2), np.inf], "d": object(), "e": True}
    )
    assert found == {"a": 1.5, "c": [2], "e": True}
    assert json.dumps(found, allow_nan=False)


def command(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "verify", *arguments]


def undrawn(*arguments: str) -> list[str]:
    """The command without report and replay."""
    code = (
        "import sys\nfrom verify import __main__, pipeline\n"
        "pipeline.write_report = lambda file, **_: file.write_text('not drawn')\n"
        "pipeline.show_replay = lambda *_: None\n"
        "sys.exit(__main__.main(sys.argv[1:]))"
    )
    return [sys.executable, "-c", code, *arguments]


def environment() -> dict[str, str]:
    return {**os.environ, "OMP_NUM_THREADS": "1"}


@pytest.mark.parametrize(
    ("number", "into"),  # [s] after the run has begun: while planning, while optimising
    [(signal.SIGTERM, 0.0), (signal.SIGINT, 0.7)],
)
def test_an_interrupted_run_leaves_the_earlier_result(tmp_path, number, into):
    earlier = copy_to(tmp_path)
    earlier.rename(tmp_path / "warehouse")
    before = contents(tmp_path)
    run = subprocess.Popen(
        command(str(WAREHOUSE), "--out", str(tmp_path)),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment(),
    )
    while not list(tmp_path.glob(".warehouse.*")):
        assert run.poll() is None
    if into:
        with pytest.raises(subprocess.TimeoutExpired):
            run.wait(timeout=into)
    run.send_signal(number)
    out, err = run.communicate(timeout=60)
    assert run.returncode == 130
    assert out == ""
    assert "interrupted" in err
    assert "Traceback" not in err
    assert contents(tmp_path) == before
    assert [path.name for path in tmp_path.iterdir()] == ["warehouse"]


def test_two_runs_at_once_leave_one_whole_result_and_write_nothing_but_their_line_to_a_pipe(tmp_path):
    file = tmp_path / "around.yaml"
    file.write_bytes(scenario_bytes(**{**CHANGES, "simulation": NO_STOPS}))
    out = tmp_path / "out"
    runs = [
        subprocess.Popen(
            one(str(file), "--out", str(out)),
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=environment(),
        )
        for one in (command, undrawn)
    ]
    for run in runs:
        said, complained = run.communicate(timeout=120)
        assert (run.returncode, complained) == (0, "")
        assert len(said.splitlines()) == 1
    assert recheck(out / "around_a_point").reasons == ()
    assert sorted(path.name for path in out.iterdir()) == ["around_a_point", "index.html"]


@pytest.mark.parametrize("fits", [False, True], ids=["no trajectory fits", "some do"])
def test_a_full_disk_leaves_the_earlier_result(tmp_path, fits):
    earlier = copy_to(tmp_path)
    sizes = [file.stat().st_size for file in (earlier / "trajectories").iterdir()]
    limit = max(sizes) - 1 if fits else min(sizes) // 2
    assert fits == (min(sizes) < limit)
    file = tmp_path / "around.yaml"
    file.write_bytes(scenario_bytes(**{**CHANGES, "simulation": NO_STOPS}))
    before = contents(tmp_path)
    run = subprocess.run(
        command(str(file), "--out", str(tmp_path)),
        capture_output=True,
        text=True,
        env=environment(),
        check=False,
        timeout=120,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)),
    )
    assert run.returncode == 3
    assert "an earlier result is as it was" in run.stderr
    assert "Traceback" not in run.stderr
    assert contents(tmp_path) == before
    assert {path.name for path in tmp_path.iterdir()} == {"around.yaml", "around_a_point"}


def test_the_manifest_covers_all_evidence():
    folder = outcome().report.parent
    assert set(outcome().result["files"]) == set(contents(folder)) - {evidence.RESULT, THUMBNAIL}
