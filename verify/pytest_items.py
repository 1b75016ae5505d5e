"""A scenario file as a collector, each of its gates as a test item."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
import yaml

from verify.cases import NAMES, VERDICT, Case
from verify.digits import as_given, beside
from verify.evidence import RESULT, SCENARIO
from vnav_drake.scenario_file import MAX_BYTES, ScenarioError
from vnav_drake.zones.errors import PluginError

if TYPE_CHECKING:
    from verify.pytest_session import Session
    from vnav_drake.scenario import Scenario

BASELINE = "baseline"
_KEY = "schema"


def is_scenario(file: Path) -> bool:
    """Whether a YAML file claims to be a scenario: a mapping with the key `schema`.

    Text that is no YAML counts if a line of it begins with that key, in whatever encoding, and so does a file
    that cannot be read: no accident may take a scenario out of the tests. The scenario.yaml of a result
    folder is evidence, not a question, and does not count.
    """
    if file.name == SCENARIO and (file.parent / RESULT).is_file():
        return False
    try:
        with file.open("rb") as stream:
            text = stream.read(MAX_BYTES).decode("utf-8", errors="replace")
    except OSError:
        return True
    text = text.replace("\0", "").lstrip("\ufeff\ufffd")
    try:
        return _KEY in _top_keys(text)
    except yaml.YAMLError:
        return any(line.split(":")[0].strip(" \"'") == _KEY for line in text.splitlines() if ":" in line)


def _top_keys(text: str) -> Iterator[str]:
    """Keys of the outermost mapping; nothing is built, so nothing in a hostile file grows."""
    depth, key = 0, True
    for event in yaml.parse(text, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader)):
        if isinstance(event, yaml.CollectionEndEvent):
            depth -= 1
        elif isinstance(event, yaml.NodeEvent):
            if depth == 0 and not isinstance(event, yaml.MappingStartEvent):
                return
            if depth == 1:
                if key and isinstance(event, yaml.ScalarEvent):
                    yield event.value
                key = not key
            depth += isinstance(event, yaml.CollectionStartEvent)


class ScenarioFile(pytest.File):
    """A scenario file; bad input is an error of collection, in the words of `verify`."""

    session_of_runs: Session

    @classmethod
    def of(cls, parent: pytest.Collector, path: Path, runs: Session) -> ScenarioFile:
        """The collector of a file."""
        made: ScenarioFile = cls.from_parent(parent, path=path)
        made.session_of_runs = runs
        return made

    def collect(self) -> Iterator[pytest.Item]:
        """Six gates, the verdict, and the baseline where one is given.

        Raises
        ------
        CollectError : the file cannot be used.
        """
        runs = self.session_of_runs
        try:
            scenario = runs.load(self.path)
        except (ScenarioError, PluginError) as error:
            raise self.CollectError(str(error)) from error
        for name in (*NAMES, *([BASELINE] if runs.has_baseline else [])):
            yield CaseItem.of(self, name, scenario, runs)


class CaseItem(pytest.Item):
    """One gate, the verdict, or the comparison with the baseline."""

    scenario: Scenario
    session_of_runs: Session

    @classmethod
    def of(cls, parent: ScenarioFile, name: str, scenario: Scenario, runs: Session) -> CaseItem:
        """The item of a case."""
        made: CaseItem = cls.from_parent(parent, name=name)
        made.scenario, made.session_of_runs = scenario, runs
        made.extra_keyword_matches.add(scenario.name)
        made.add_marker(pytest.mark.verify)
        return made

    def runtest(self) -> None:
        """Run the scenario, unless that is done; fail or skip as the case says."""
        record = self.session_of_runs.record(self.scenario)
        if record.trace:
            self.add_report_section("call", "where it came from", record.trace)
        if record.error:
            pytest.fail(record.error, pytrace=False)
        own = [case for case in record.cases if self._is_about(case)]
        for case in own:
            self.user_properties += _properties(case)
        bad = [case for case in own if case.bad]
        if bad:
            pytest.fail("\n".join([*map(failure, bad), f"report: {record.report}"]), pytrace=False)
        if not own:  # nothing may pass that nobody judged
            pytest.fail(f"{self.name}: the run has no such case", pytrace=False)
        if all(case.status == "skipped" for case in own):
            pytest.skip(own[0].text)

    def _is_about(self, case: Case) -> bool:
        """Stages that could not finish are the verdict's, figures of a baseline all one item's."""
        if self.name == BASELINE:
            return case.name.startswith(BASELINE)
        return case.name == self.name or (self.name == VERDICT and case.status == "error")

    def reportinfo(self) -> tuple[Path, int, str]:
        """File, line and name."""
        return self.path, 0, f"{self.scenario.name}: {self.name}"


def failure(case: Case) -> str:
    """Measured value, limit and unit; or what else is wrong."""
    if case.value is None or case.limit is None:
        return f"{case.name}: {case.text}"
    unit = case.unit and f" {case.unit}"
    return (
        f"{case.name}: measured {beside(case.value, case.limit, 6)}{unit}, limit {as_given(case.limit)}{unit}"
    )


def _properties(case: Case) -> list[tuple[str, Any]]:
    """For pytest's own JUnit file."""
    told = {"value": case.value, "limit": case.limit, "unit": case.unit or None}
    return [(key, value) for key, value in told.items() if value is not None]


def plain_skip(report: pytest.TestReport, item: CaseItem) -> None:
    """Say of a skip that it is the scenario's, not a line of this module."""
    if report.skipped and isinstance(report.longrepr, tuple):
        report.longrepr = (str(item.path), 1, report.longrepr[2])
