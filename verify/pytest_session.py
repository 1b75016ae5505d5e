"""Scenario runs of one pytest session: options, what is shared between worker processes, the summary."""

from __future__ import annotations

import os
import shutil
import tempfile
from argparse import ArgumentTypeError
from collections.abc import Generator, Mapping
from pathlib import Path
from typing import Any

import pytest

from verify.atomic import OutputError, usable_folder
from verify.attempt import attempt, load
from verify.baseline import Comparison, compare, run_of
from verify.baseline_file import Baseline, BaselineError, read_baseline
from verify.cli import gate_limit
from verify.pytest_items import CaseItem, ScenarioFile, is_scenario, plain_skip
from verify.pytest_record import Record, recorded_once, records
from verify.suite import Suite
from verify.summary import headline
from vnav_drake.scenario import Scenario
from vnav_drake.zones.errors import PluginError
from vnav_drake.zones.plugins import load_plugin

_SHARED = "vnav_verify_shared"  # in what xdist tells its workers
_SUFFIXES = (".yaml", ".yml")


def start(config: pytest.Config) -> None:
    """Register the session's runs.

    Raises
    ------
    UsageError : an option has a value that cannot be used.
    """
    config.addinivalue_line("markers", "verify: a gate of a scenario file")
    told = getattr(config, "workerinput", None)
    try:
        for module in config.getoption("--verify-plugin"):
            load_plugin(module)
        overrides = dict(map(gate_limit, config.getoption("--verify-gate")))
        here = config.invocation_params.dir
        out = here / config.getoption("--verify-out")
        stored = config.getoption("--verify-baseline")
        baseline = None if stored is None else read_baseline(_shown(here / stored))
        if told is None and not config.getoption("--collect-only"):
            usable_folder(out)
    except (PluginError, ArgumentTypeError, BaselineError, OutputError) as error:
        raise pytest.UsageError(f"--verify: {error}") from error
    if told is None:
        shared = tempfile.mkdtemp(prefix="vnav-verify-")
        config.add_cleanup(lambda: shutil.rmtree(shared, ignore_errors=True))
    else:
        shared = told[_SHARED]
    config.pluginmanager.register(Session(Path(shared), out, overrides, baseline), "vnav-verify-session")


class Session:
    """Collects scenario files, and runs each scenario at most once."""

    def __init__(
        self, shared: Path, out: Path, overrides: Mapping[str, float], baseline: Baseline | None
    ) -> None:
        self._shared, self._out, self._overrides, self._baseline = shared, out, overrides, baseline
        self._loaded: dict[Path, Scenario] = {}

    @property
    def has_baseline(self) -> bool:
        """Whether results are compared with stored ones."""
        return self._baseline is not None

    def load(self, file: Path) -> Scenario:
        """The scenario of a file that is collected; two of one name are bad input, as for `verify`."""
        others = (scenario for path, scenario in self._loaded.items() if path != file)
        self._loaded[file] = load(_shown(file), others)
        return self._loaded[file]

    def record(self, scenario: Scenario) -> Record:
        """What the scenario's run showed; runs it if no process of this session has."""
        return recorded_once(self._shared, scenario.name, lambda: self._run(scenario))

    def _run(self, scenario: Scenario) -> Record:
        # Workers of xdist share the processors already.
        workers = 1 if "PYTEST_XDIST_WORKER" in os.environ else None
        done = attempt(scenario, self._out, self._overrides, lambda _text: None, workers)
        outcome = done.outcome
        if outcome is None:
            return Record(name=done.name, error=done.error, trace=done.trace)
        suite = Suite(
            name=done.name,
            judgement=outcome.judgement,
            missing=done.unfinished,
            comparison=self._compared(scenario, outcome.result),
        )
        return Record(
            name=done.name,
            headline=headline(outcome.judgement, suite.comparison),
            report=str(_shown(outcome.report)),
            cases=suite.cases,
        )

    def _compared(self, scenario: Scenario, result: Mapping[str, Any]) -> Comparison | None:
        baseline = self._baseline
        return None if baseline is None else compare(baseline, run_of(scenario, result))

    def pytest_collect_file(self, file_path: Path, parent: pytest.Collector) -> pytest.Collector | None:
        """A scenario file's collector; other files are none of ours."""
        if file_path.suffix in _SUFFIXES and is_scenario(file_path):
            return ScenarioFile.of(parent, file_path, self)
        return None

    @pytest.hookimpl(optionalhook=True)
    def pytest_configure_node(self, node: Any) -> None:
        """Tell a worker of xdist where runs are recorded."""
        node.workerinput[_SHARED] = str(self._shared)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(
        self, item: pytest.Item
    ) -> Generator[None, pytest.TestReport, pytest.TestReport]:
        """Skips name the scenario file."""
        report = yield
        if isinstance(item, CaseItem):
            plain_skip(report, item)
        return report

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """A line for each scenario that ran."""
        told = records(self._shared)
        if told:
            terminalreporter.section("verify")
        for record in told:
            terminalreporter.line(record.error or f"{record.headline}  {record.report}")


def _shown(path: Path) -> Path:
    """Relative to the working directory where it lies below that."""
    here = Path.cwd()
    return path.relative_to(here) if path.is_relative_to(here) else path
