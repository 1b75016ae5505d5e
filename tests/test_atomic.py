"""Folders and files appear whole or not at all."""

from __future__ import annotations

import json
import os
import signal
from pathlib import Path

import pytest
from result_folder import contents

from verify.atomic import OutputError, ResultFolder, deferred_signals, replace_file, usable_folder

RESULT = json.dumps({"schema": 1, "scenario": "a", "scenario_sha256": "0", "files": {"old.csv": "1"}})


def fill(folder: Path, text: str) -> None:
    (folder / "result.json").write_text(RESULT)
    (folder / "report.html").write_text(text)


def publish(out: Path, text: str) -> None:
    with ResultFolder(out, "a") as folder:
        fill(folder.work, text)
        folder.publish()


def test_a_published_folder_replaces_the_earlier_one_and_leaves_nothing_else(tmp_path):
    publish(tmp_path, "first")
    publish(tmp_path, "second")
    assert [path.name for path in tmp_path.iterdir()] == ["a"]
    assert (tmp_path / "a/report.html").read_text() == "second"
    assert (tmp_path / "a").stat().st_mode & 0o777 == 0o777 & ~_umask()


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def test_an_error_leaves_the_earlier_folder_and_nothing_else(tmp_path):
    publish(tmp_path, "first")
    before = contents(tmp_path)

    def fail() -> None:
        with ResultFolder(tmp_path, "a") as folder:
            fill(folder.work, "half")
            assert folder.work.stat().st_mode & 0o777 == 0o700
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fail()
    assert contents(tmp_path) == before
    assert [path.name for path in tmp_path.iterdir()] == ["a"]


def test_a_failing_swap_puts_the_earlier_folder_back(tmp_path, monkeypatch):
    publish(tmp_path, "first")
    before = contents(tmp_path)
    rename, calls = Path.rename, []

    def failing(self: Path, target: Path) -> Path:
        calls.append(self)
        if len(calls) == 2:  # the earlier folder is set aside, the new one not yet in
            raise OSError(5, "Input/output error")
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", failing)
    with pytest.raises(OSError, match="Input/output"):
        publish(tmp_path, "second")
    assert contents(tmp_path) == before


def test_a_run_killed_within_its_swap_is_put_right_by_the_next(tmp_path):
    publish(tmp_path, "first")
    (tmp_path / "a").rename(tmp_path / ".a.x1y2.old")  # set aside, and killed
    (tmp_path / ".a.x1y2").mkdir()
    with ResultFolder(tmp_path, "a"):
        assert (tmp_path / "a/report.html").read_text() == "first"
        assert not (tmp_path / ".a.x1y2").exists()
    assert [path.name for path in tmp_path.iterdir()] == ["a"]


def test_a_living_run_s_folder_is_left_alone(tmp_path):
    with ResultFolder(tmp_path, "a") as one:
        fill(one.work, "one")
        with ResultFolder(tmp_path, "a") as other:
            assert one.work.is_dir()
            fill(other.work, "other")
            other.publish()
        one.publish()
    assert (tmp_path / "a/report.html").read_text() == "one"
    assert [path.name for path in tmp_path.iterdir()] == ["a"]


def test_a_name_that_begins_like_another_is_not_mistaken_for_it(tmp_path):
    with ResultFolder(tmp_path, "a-b") as longer, ResultFolder(tmp_path, "a"):
        assert longer.work.is_dir()


def test_files_that_are_not_ours_come_along(tmp_path):
    publish(tmp_path, "first")
    old = tmp_path / "a"
    (old / "notes.txt").write_text("mine")
    (old / "old.csv").write_text("listed in the manifest")
    (old / "sub/deep").mkdir(parents=True)
    (old / "sub/deep/photo.png").write_bytes(b"png")
    (old / "link").symlink_to("/nonexistent")
    (old / "trajectories").mkdir()
    (old / "trajectories/refined.csv").write_text("ours, from before")
    (old / "trajectories/mine.csv").write_text("not ours")
    publish(tmp_path, "second")
    assert (old / "report.html").read_text() == "second"
    assert (old / "notes.txt").read_text() == "mine"
    assert (old / "sub/deep/photo.png").read_bytes() == b"png"
    assert os.readlink(old / "link") == "/nonexistent"
    assert not (old / "old.csv").exists()
    assert not (old / "trajectories").exists()
    assert (old / "unlisted_trajectories/mine.csv").read_text() == "not ours"


@pytest.mark.parametrize("kind", ["folder", "file", "link", "other schema"])
def test_what_we_did_not_write_is_never_replaced(tmp_path, kind):
    target = tmp_path / "a"
    if kind == "file":
        target.write_text("x")
    elif kind == "link":
        target.symlink_to(tmp_path)
    else:
        target.mkdir()
        (target / "result.json").write_text('{"schema": 7}' if kind == "other schema" else "thesis data")
    before = contents(tmp_path)
    with pytest.raises(OutputError, match="a:"):
        publish(tmp_path, "new")
    assert contents(tmp_path) == before


def test_an_empty_folder_may_be_filled(tmp_path):
    (tmp_path / "a").mkdir()
    publish(tmp_path, "new")
    assert (tmp_path / "a/report.html").read_text() == "new"


def test_signals_wait_for_the_end_of_the_swap():
    steps = []

    def interrupted() -> None:
        with deferred_signals():
            signal.raise_signal(signal.SIGINT)
            steps.append("after the signal")

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert steps == ["after the signal"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_file_is_replaced_whole(tmp_path):
    file = tmp_path / "index.html"
    replace_file(file, lambda aside: aside.write_text("one"))

    def fail(aside: Path) -> None:
        aside.write_text("ha")
        raise OSError(28, "No space left on device")

    with pytest.raises(OSError, match="No space"):
        replace_file(file, fail)
    assert file.read_text() == "one"
    assert [path.name for path in tmp_path.iterdir()] == ["index.html"]


def test_an_output_place_that_is_a_file_is_unusable(tmp_path):
    (tmp_path / "file").write_text("x")
    with pytest.raises(OutputError, match="file"):
        usable_folder(tmp_path / "file")
    with pytest.raises(OutputError, match="below"):
        usable_folder(tmp_path / "file" / "below")
    assert usable_folder(tmp_path / "new/deep").is_dir()
