"""Scenario files as tests: `pytest --verify scenarios/`.

Every project that has this package installed loads this module with pytest, so without `--verify` it
must cost nothing: it imports pytest alone, which is there already.
"""

from __future__ import annotations

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    """The plugin's options."""
    group = parser.getgroup("verify", "scenarios of wheeled robots (vnav-drake)")
    group.addoption("--verify", action="store_true", help="collect scenario files (*.yaml): each gate a test")
    group.addoption(
        "--verify-out", default="reports", metavar="DIR", help="where results go (default: reports)"
    )
    group.addoption(
        "--verify-gate", action="append", default=[], metavar="NAME=LIMIT", help="override a gate's limit"
    )
    group.addoption(
        "--verify-baseline", metavar="FILE", help="compare each scenario with FILE: one test more, `baseline`"
    )
    group.addoption(
        "--verify-plugin",
        action="append",
        default=[],
        metavar="MODULE",
        help="import a module whose braking zones scenarios may then name",
    )


def pytest_configure(config: pytest.Config) -> None:
    """With `--verify`, load what collects and runs scenarios."""
    if config.getoption("--verify"):
        from verify.pytest_session import start

        start(config)
