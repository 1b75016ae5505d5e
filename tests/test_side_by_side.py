"""Scenarios in processes of their own: what happens to the others when one is killed or all are ended."""

import contextlib
import os
import signal
import subprocess
import sys
import time

import pytest
from gallery_runs import question

from verify import side_by_side
from verify.attempt import Attempt
from verify.exit_codes import OK, UNFINISHED
from vnav_drake.scenario import parse_scenario

NAMES = ("single_wall", "single_point")


def test_a_scenario_whose_process_is_killed_says_so_and_the_others_run(tmp_path, monkeypatch):
    # Processes are given the module by name, so the one that ends itself is among the tasks.
    monkeypatch.setattr(side_by_side, "_attempt", _killed_or_not)
    scenarios = [parse_scenario(question(name).encode(), name) for name in NAMES]
    found = list(side_by_side.attempts(scenarios, tmp_path, {}, lambda _text: None, jobs=2))
    assert [(one.name, one.exit_code) for one in found] == [(NAMES[0], UNFINISHED), (NAMES[1], OK)]
    assert "killed" in found[0].error
    assert "--jobs 1" in found[0].error


def _killed_or_not(name: str, *_: object) -> Attempt:
    return os._exit(9) if name == NAMES[0] else Attempt(name=name, exit_code=OK)


def test_a_signal_ends_all_of_them_and_leaves_nothing_behind(tmp_path):
    for name in NAMES:
        (tmp_path / f"{name}.yaml").write_text(question(name))
    out = tmp_path / "out"
    files = [str(tmp_path / f"{name}.yaml") for name in NAMES]
    command = [sys.executable, "-m", "verify", *files, "--out", str(out), "--jobs", "2"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, start_new_session=True) as running:
        try:
            # Both are under way when their hidden folders are there.
            deadline = time.monotonic() + 120.0
            while running.poll() is None and len(list(out.glob(".*"))) < len(NAMES):
                assert time.monotonic() < deadline
                with contextlib.suppress(subprocess.TimeoutExpired):
                    running.wait(0.05)
            running.send_signal(signal.SIGTERM)
            _, said = running.communicate(timeout=120)
        finally:
            if running.poll() is None:
                os.killpg(running.pid, signal.SIGKILL)
    assert running.returncode == 130
    assert "interrupted" in said
    assert not list(out.iterdir())


@pytest.mark.parametrize("text", ["0", "-1", "two", "1.5"])
def test_a_number_of_jobs_is_at_least_one(text, capsys):
    from verify.cli import run

    with pytest.raises(SystemExit, match="2"):
        run(["scenario.yaml", "--jobs", text])
    assert "expected a whole number, at least 1" in capsys.readouterr().err
