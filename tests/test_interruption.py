"""Signals at every moment of a run: nothing half-made remains, and no handler of ours."""

from __future__ import annotations

import contextlib
import fcntl
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from types import FrameType
from typing import Any

import pytest
from judged import scenario

from verify import atomic, interruption, pipeline, planning
from verify.atomic import ResultFolder, deferred_signals
from verify.interruption import Interruption

ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
WATCHED = {contextlib.__file__, atomic.__file__, interruption.__file__}  # and run_scenario itself


@pytest.fixture(autouse=True)
def handlers():
    """Every signal that ends a run raises, as under the command; and is as before when the test is over."""
    before = {number: signal.getsignal(number) for number in ENDING}
    for number in ENDING:
        signal.signal(number, signal.default_int_handler)
    yield
    assert all(signal.getsignal(number) is signal.default_int_handler for number in ENDING)
    for number, handler in before.items():
        signal.signal(number, handler)


def watched(frame: FrameType) -> bool:
    code = frame.f_code
    return code.co_filename in WATCHED or code is pipeline.run_scenario.__code__


class Strike:
    """Raises a signal at the n-th moment of the watched code at which Python runs handlers.

    These are where a function begins or goes on, and after a call of compiled code.
    """

    def __init__(self, number: int, moment: int) -> None:
        self.number = number
        self.moment = moment
        self.seen = 0

    def __call__(self, frame: FrameType, event: str, _argument: Any) -> None:
        if event in ("call", "c_return") and watched(frame):
            self.seen += 1
            if self.seen == self.moment:
                signal.raise_signal(self.number)

    def during(self, work: Callable[[], object]) -> bool:
        """Whether the work was interrupted."""
        sys.setprofile(self)
        try:
            work()
        except KeyboardInterrupt:
            return True
        finally:
            sys.setprofile(None)
        return False


@pytest.mark.parametrize("publishes", [False, True])
def test_a_signal_at_any_moment_leaves_no_hidden_folder(tmp_path, monkeypatch, publishes):
    # Stages, judge and report are left out: they run inside the block, under the same handlers.
    def fill(folder: ResultFolder, *_: object) -> None:
        (folder.work / "result.json").write_text('{"schema": 1, "scenario_sha256": "0"}')
        if publishes:
            folder.publish()

    monkeypatch.setattr(pipeline, "_fill", fill)
    asked = scenario(name="a")
    moments, interrupted = 1, 0
    while True:
        strike = Strike(ENDING[moments % 3], moments)
        interrupted += strike.during(lambda: pipeline.run_scenario(asked, tmp_path))
        left = {path.name for path in tmp_path.iterdir()}
        assert left <= {"a"}, f"after a signal at moment {moments}"
        assert all(signal.getsignal(number) is signal.default_int_handler for number in ENDING), moments
        if strike.seen < moments:
            break
        moments += 1
    assert interrupted == moments - 1 > 50  # every signal was heeded, and there were many moments


def test_a_signal_that_waited_while_the_folder_was_made_leaves_none(tmp_path, monkeypatch):
    make = tempfile.mkdtemp

    def struck(**where: Any) -> str:
        name = make(**where)
        signal.raise_signal(signal.SIGTERM)
        return name

    monkeypatch.setattr(tempfile, "mkdtemp", struck)
    with pytest.raises(KeyboardInterrupt), ResultFolder(tmp_path, "a"):
        pytest.fail("the block must not be entered")
    assert list(tmp_path.iterdir()) == []


def test_waiting_for_the_lock_can_be_interrupted(tmp_path, monkeypatch):
    # flock is interrupted by the signal, and goes on waiting unless its handler raises.
    waited_on = []

    def wait(_handle: int, _how: int) -> None:
        signal.raise_signal(signal.SIGINT)
        waited_on.append("the signal was put off until the lock is free")

    with monkeypatch.context() as patched:
        patched.setattr(fcntl, "flock", wait)
        with pytest.raises(KeyboardInterrupt), ResultFolder(tmp_path, "a"):
            pass
    with ResultFolder(tmp_path, "a") as folder, monkeypatch.context() as patched:
        patched.setattr(fcntl, "flock", wait)
        with pytest.raises(KeyboardInterrupt):
            folder.publish()
    assert waited_on == []
    assert list(tmp_path.iterdir()) == []


def test_tidying_up_is_not_cut_short_by_further_signals(tmp_path):
    def leave() -> None:
        with Interruption():
            try:
                signal.raise_signal(signal.SIGINT)
            finally:
                signal.raise_signal(signal.SIGINT)
                signal.raise_signal(signal.SIGTERM)
                (tmp_path / "tidied").touch()

    with pytest.raises(KeyboardInterrupt):
        leave()
    assert (tmp_path / "tidied").exists()


def test_an_interrupt_that_is_turned_into_another_error_still_counts():
    def swallow() -> None:
        with Interruption():
            try:
                signal.raise_signal(signal.SIGINT)
            except KeyboardInterrupt as error:
                raise RuntimeError("as Drake has it") from error

    with pytest.raises(KeyboardInterrupt):
        swallow()


def test_an_interrupt_that_a_stage_swallows_ends_the_run_with_that_stage(tmp_path, monkeypatch):
    def swallow(*_: object) -> None:
        with contextlib.suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(planning, "build_diagram", swallow)
    with pytest.raises(KeyboardInterrupt):
        pipeline.run_scenario(scenario(name="a"), tmp_path)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("number", ENDING)
def test_what_the_process_was_started_to_ignore_stays_ignored(number):
    signal.signal(number, signal.SIG_IGN)
    try:
        with Interruption(), deferred_signals():
            signal.raise_signal(number)
        assert signal.getsignal(number) is signal.SIG_IGN
    finally:
        signal.signal(number, signal.default_int_handler)


def test_a_hang_up_ends_the_command_like_ctrl_c():
    code = (
        "import signal, verify.cli, verify.__main__ as m\n"
        "verify.cli.run = lambda _: signal.raise_signal(signal.SIGHUP)\n"
        "raise SystemExit(m.main([]))"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert run.returncode == 130
    assert "interrupted" in run.stderr
