"""Small scenarios that use one limit each, from the file to the verdict."""

import json
import math

import numpy as np
import pytest
import yaml
from result_folder import NO_STOPS

from verify.__main__ import main
from verify.cli import run

BASE = {
    "schema": 1,
    "name": "s",
    "world": {
        "boundary": [[0, 0], [20, 0], [20, 12], [0, 12]],
        "obstacles": [{"vertices": [[8, 0], [12, 0], [12, 5], [8, 5]]}],
    },
    "robot": {
        "radius": 0.4,
        "mass": 40.0,
        "wheelbase": 0.5,
        "track": 0.4,
        "com_height": 0.12,
        "friction": 0.6,
        "max_braking": 1.0,
        "max_acceleration": 1.0,
        "max_steering": 0.6,
    },
    "start": {"position": [4, 3]},
    "goal": {"position": [16, 3]},
    "plan": {"effort": "quick"},
    "simulation": NO_STOPS,
}
pytestmark = pytest.mark.usefixtures("unreported")


def verified(tmp_path, capsys, expected=0, **changes):
    document = json.loads(json.dumps(BASE))
    for section, keys in changes.items():
        if isinstance(keys, dict):
            document.setdefault(section, {}).update(keys)
        else:
            document[section] = keys
    file = tmp_path / "s.yaml"
    file.write_text(yaml.safe_dump(document))
    code = run([str(file), "--out", str(tmp_path / "out"), "--quiet"])
    assert code == expected, capsys.readouterr()
    return json.loads((tmp_path / "out/s/result.json").read_text())


def rows(tmp_path):
    text = (tmp_path / "out/s/trajectory.csv").read_text().splitlines()
    names = text[0].split(",")
    first, last = (dict(zip(names, map(float, text[i].split(",")), strict=True)) for i in (1, -1))
    return first, last


def test_end_speeds_above_one_metre_a_second(tmp_path, capsys):
    # A gate of its own: from and to these speeds the proven cost of ends is small beside the real one.
    verified(tmp_path, capsys, start={"speed": 1.5}, goal={"speed": 1.2}, gates={"refinement_gap": 0.2})
    first, last = rows(tmp_path)
    assert first["v"] == pytest.approx(1.5, abs=1e-6)
    assert last["v"] == pytest.approx(1.2, abs=1e-6)


def test_a_turn_at_full_lock(tmp_path, capsys):
    # Facing away from the goal at the start, and back at the goal: two turns with little steering.
    result = verified(
        tmp_path,
        capsys,
        robot={"max_steering": 0.48},
        start={"speed": "rest", "heading": math.pi},
        goal={"speed": "rest", "heading": math.pi},
        gates={"refinement_gap": 1.0},
    )
    first, last = rows(tmp_path)
    assert math.remainder(first["heading"] - math.pi, 2 * math.pi) == pytest.approx(0, abs=1e-6)
    assert math.remainder(last["heading"] - math.pi, 2 * math.pi) == pytest.approx(0, abs=1e-6)
    # two half turns at r = l sqrt(1/4 + 1/tan^2 omega) at least
    radius = 0.5 * math.sqrt(0.25 + 1 / math.tan(0.48) ** 2)
    assert result["plans"]["refined"]["length"] >= 12 + 0.5 * math.pi * radius


def test_a_slow_steering(tmp_path, capsys):
    result = verified(
        tmp_path,
        capsys,
        robot={"max_steering_rate": 0.15},
        start={"speed": "rest"},
        goal={"speed": "rest"},
        gates={"refinement_gap": 0.2},
    )
    assert result["plans"]["refined"]["travel_time"] > result["plans"]["collocation"]["travel_time"]
    # Front wheel: sin(beta) = kappa l/2, tan(omega) = 2 tan(beta) (Manor 2015, eq. A.1). Each step fits into
    # the shorter of the two stretches of even curvature that it joins, and some step needs nearly all of it
    # (a share of the rate may be kept for the controller).
    motion = np.genfromtxt(tmp_path / "out/s/trajectory.csv", delimiter=",", names=True)
    first = np.flatnonzero(np.append(True, np.abs(np.diff(motion["curvature"][:-1])) > 1e-12))
    times = np.diff(np.append(motion["t"][first], motion["t"][-1]))
    angle = np.arctan(2.0 * np.tan(np.arcsin(0.25 * motion["curvature"][first])))
    needed = np.abs(np.diff(angle)) / np.minimum(times[1:], times[:-1])
    assert 0.75 * 0.15 <= needed.max() <= 0.15 * (1.0 + 1e-6)


def test_the_friction_reserve_keeps_full_braking_while_turning(tmp_path, capsys):
    # mu g = 1.2: v^2 |kappa| <= sqrt(1.44 - 1).
    reserve = math.sqrt(1.2**2 - 1.0)
    verified(tmp_path, capsys, robot={"friction": 1.2 / 9.81}, braking={"friction_reserve": True})
    motion = np.genfromtxt(tmp_path / "out/s/trajectory.csv", delimiter=",", names=True)
    sideways = motion["v"] ** 2 * np.abs(motion["curvature"])
    assert 0.75 * reserve <= sideways.max() <= reserve * (1 + 1e-6)  # a share may be kept for the controller


def test_hardly_any_friction_left_to_turn_ends_without_a_trace(tmp_path, capsys):
    # mu g = 1.0016 leaves 0.06 m/s^2 across: possible or not, the answer is a verdict or a reason.
    document = json.loads(json.dumps(BASE))
    document["robot"]["friction"] = 0.1021
    document["braking"] = {"friction_reserve": True}
    file = tmp_path / "s.yaml"
    file.write_text(yaml.safe_dump(document))
    assert run([str(file), "--out", str(tmp_path / "out"), "--quiet"]) in (0, 1, 3)
    assert "Traceback" not in capsys.readouterr().err


def test_a_point_robot_goes_round_a_wall(tmp_path, capsys):
    world = {"boundary": [[0, 0], [10, 0], [10, 10], [0, 10]], "obstacles": [{"vertices": [[5, 0], [5, 8]]}]}
    result = verified(
        tmp_path,
        capsys,
        world=world,
        robot={"radius": 0.0},
        start={"position": [3, 3]},
        goal={"position": [7, 3]},
    )
    # over the wall's end at (5, 8), not through it: at least twice the way from (3, 3) to that point
    assert result["plans"]["refined"]["length"] >= 2 * math.dist((3, 3), (5, 8))
    motion = np.genfromtxt(tmp_path / "out/s/trajectory.csv", delimiter=",", names=True)
    (across,) = np.flatnonzero((motion["x"][:-1] < 5.0) & (motion["x"][1:] >= 5.0))
    assert motion["y"][across] > 8.0


@pytest.mark.parametrize("apart", [0.001, 0.05, 2.0])
def test_short_ways_from_rest_to_rest_are_bang_bang(tmp_path, capsys, apart):
    # T = 2 sqrt(s) at 1 m/s^2 both ways, and the gate knows that nothing is faster.
    result = verified(
        tmp_path,
        capsys,
        world={"boundary": [[0, 0], [20, 0], [20, 12], [0, 12]], "obstacles": []},
        start={"position": [10, 6], "speed": "rest"},
        goal={"position": [10 + apart, 6], "speed": "rest"},
        simulation={"model": "four_wheel", "stops": 3},
    )
    assert result["simulation"]["emergency_stops"]["bad"] == 0
    assert result["plans"]["refined"]["travel_time"] == pytest.approx(2 * math.sqrt(apart), rel=1e-4)
    assert result["gaps"]["refinement"] == pytest.approx(0, abs=1e-3)


def test_both_models_drive_and_each_is_judged(tmp_path, capsys):
    result = verified(tmp_path, capsys, simulation={"model": "both", "stops": 2})
    told = result["simulation"]
    assert told["model"] == "four_wheel"
    judged = {
        check["trajectory"]: check["status"] for check in result["checks"] if check["name"] == "tracking"
    }
    assert judged == {"simulation": "passed", "single_track": "passed"}
    # 3 cm is what either may stray from a motion with reserves, and they differ as vehicles do
    assert told["max_tracking_error"] != told["single_track"]["max_tracking_error"]
    assert max(told["max_tracking_error"], told["single_track"]["max_tracking_error"]) <= 0.03
    assert (tmp_path / "out/s/simulation_single_track.csv").exists()
    assert main(["check", str(tmp_path / "out/s")]) == 0


def test_several_scenarios_where_one_cannot_be_planned(tmp_path, capsys):
    # The first has no way (exit 2), the second is fine: both are answered, the worse code wins.
    blocked = json.loads(json.dumps(BASE))
    blocked["name"] = "blocked"
    blocked["world"]["obstacles"] = [{"vertices": [[8, 0], [12, 0], [12, 12], [8, 12]]}]
    for name, document in (("blocked", blocked), ("s", BASE)):
        (tmp_path / f"{name}.yaml").write_text(yaml.safe_dump(document))
    files = [str(tmp_path / f"{name}.yaml") for name in ("blocked", "s")]
    assert run([*files, "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr()
    assert "blocked.yaml" in said.err
    assert said.out.startswith("s: certified")
    assert (tmp_path / "out/s/report.html").exists()
    assert not (tmp_path / "out/blocked").exists()
