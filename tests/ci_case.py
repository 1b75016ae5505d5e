"""A finished run in closed form for tests of what CI shows: nothing is planned or simulated."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from tempfile import mkdtemp
from types import SimpleNamespace
from typing import Any

import stops_case as case

from verify import evidence
from verify.attempt import Attempt
from verify.exit_codes import FAILED, OK
from verify.judge import judge
from vnav_drake.scenario import Scenario


def finished(scenario: Scenario, out: Path, overrides: Mapping[str, float], *_: object) -> Attempt:
    """In place of `attempt`: the evidence of `stops_case`, judged. One named `bad` has a stop that falls."""
    arrays = case.stop_arrays()
    if scenario.name == "bad":
        arrays = case.edited(arrays, "tilt", 0, lambda tilt: tilt + 1.0)  # [rad]
    folder = case.write_case(Path(mkdtemp(dir=out, prefix=".")) / scenario.name, arrays, name=scenario.name)
    judgement = judge(folder, overrides)
    report = out / scenario.name / evidence.REPORT
    outcome: Any = SimpleNamespace(
        judgement=judgement, report=report, unfinished=(), missing=(), result=judgement.as_result()
    )
    (out / "runs.log").open("a").write(f"{scenario.name}\n")
    return Attempt(name=scenario.name, exit_code=OK if judgement.passed else FAILED, outcome=outcome)


def runs(out: Path) -> list[str]:
    """Names of the scenarios that ran, in order."""
    return (out / "runs.log").read_text().split() if (out / "runs.log").exists() else []


def baseline(file: Path, scenario: Scenario, times: Mapping[str, float]) -> None:
    """A stored run of the scenario with other travel times."""
    from verify.baseline import entry, run_of

    out = file.parent / "stored"
    out.mkdir(exist_ok=True)
    made = finished(scenario, out, {})
    assert made.outcome is not None
    stored = entry(run_of(scenario, made.outcome.result)).model_dump(mode="json")
    stored["metrics"] |= times
    file.write_text(json.dumps({"schema": 1, "scenarios": {scenario.name: stored}}))
