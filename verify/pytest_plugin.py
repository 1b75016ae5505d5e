"""Scenario files as tests: `pytest --verify scenarios/`."""

from __future__ import annotations

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    """The plugin's options."""
    group = parser.getgroup("verify", "scenarios of wheeled robots")
    group.addoption("--verify", action="store_true", help="collect scenario files, each gate a test")
