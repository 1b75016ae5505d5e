"""Hypothesis draws at random locally and always the same in continuous integration.

`make test ARGS=--hypothesis-profile=thorough` draws many more.
"""

import os
from pathlib import Path

import pytest
from hypothesis import settings

pytest.register_assert_rewrite("gallery_facts", "gallery_runs")

settings.register_profile("local", deadline=None, max_examples=60)
settings.register_profile("ci", deadline=None, max_examples=60, derandomize=True, print_blob=True)
settings.register_profile("thorough", deadline=None, max_examples=3000)
settings.load_profile("ci" if os.environ.get("CI") else "local")


@pytest.fixture
def unreported(monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs draw neither report nor replay: that takes most of a small run, and has tests of its own."""
    from verify import pipeline

    def write(file: Path, **_: object) -> None:
        file.write_text("not drawn")

    monkeypatch.setattr(pipeline, "write_report", write)
    monkeypatch.setattr(pipeline, "show_replay", lambda *_: None)
