"""Scenarios in processes of their own: what happens to the others when one is killed or all are ended."""

import os
import signal
import subprocess
import sys
import time

import pytest
from gallery_runs import question

from systems import parallel
from verify.exit_codes import UNFINISHED
from verify.side_by_side import attempts
from vnav_drake.scenario import parse_scenario

NAMES = ("single_wall", "single_point")


def test_when_a_process_is_killed_each_scenario_that_is_not_done_says_so(tmp_path, monkeypatch):
    def killed(*_: object):
        raise parallel.WorkerError("a worker process was killed")
        yield

    monkeypatch.setattr(parallel, "as_finished", killed)
    scenarios = [parse_scenario(question(name).encode(), name) for name in NAMES]
    found = list(attempts(scenarios, tmp_path, {}, lambda _text: None, jobs=2))
    assert [(one.name, one.exit_code) for one in found] == [(name, UNFINISHED) for name in NAMES]
    assert all("killed" in one.error and "--jobs 1" in one.error for one in found)


def test_a_signal_ends_all_of_them_and_leaves_nothing_behind(tmp_path):
    for name in NAMES:
        (tmp_path / f"{name}.yaml").write_text(question(name))
    out = tmp_path / "out"
    files = [str(tmp_path / f"{name}.yaml") for name in NAMES]
    command = [sys.executable, "-m", "verify", *files, "--out", str(out), "--jobs", "2"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, start_new_session=True) as running:
        try:
            while running.poll() is None and len(list(out.glob(".*"))) < len(NAMES):
                time.sleep(0.05)  # both are under way when their hidden folders are there
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
