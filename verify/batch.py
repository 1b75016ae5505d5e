"""Run scenario files; one that fails does not stop the others."""

from __future__ import annotations

import argparse
import contextlib
import sys
import webbrowser
from collections.abc import Sequence
from pathlib import Path

from verify.atomic import usable_folder
from verify.attempt import Attempt, load
from verify.baseline import compare, run_of
from verify.baseline_file import Baseline, BaselineError
from verify.exit_codes import BAD_INPUT, FAILED, OK, UNFINISHED
from verify.outputs import baseline_lines, prepare, write_outputs
from verify.progress import Progress
from verify.side_by_side import attempts
from verify.suite import Suite
from verify.summary import details, failures, headline
from vnav_drake.scenario import Scenario, ScenarioError
from vnav_drake.zones.errors import PluginError


def run_files(options: argparse.Namespace) -> int:
    """Run all scenarios of a command line; returns the worst exit code.

    Raises
    ------
    OutputError : a folder for output cannot be used.
    BaselineError : the baseline cannot be used.
    """
    scenarios, suites = _load(options.scenarios)
    worst = BAD_INPUT if suites else OK
    try:
        baseline = prepare(options)
    except BaselineError as error:
        _tell_unusable(options, suites, str(error))
        raise
    if scenarios:
        usable_folder(options.out)
    by_name = {scenario.name: scenario for scenario in scenarios}
    with Progress(quiet=options.quiet) as progress:
        runs = attempts(
            scenarios,
            options.out,
            dict(options.gate),
            progress.say,
            jobs=options.jobs,
            plugins=options.plugin,
            figures=options.figures,
        )
        with contextlib.closing(runs):
            for done in runs:
                suite = _suite(done, by_name[done.name], None if options.update_baseline else baseline)
                code = done.exit_code
                if suite.comparison is not None and not suite.comparison.passed:
                    code = max(code, FAILED)
                with progress.paused():
                    _tell(suite, done, code, baseline_lines(suite, baseline, options), options)
                if options.open and done.outcome is not None:
                    webbrowser.open(done.outcome.report.absolute().as_uri())
                worst = max(worst, code)
                suites.append(suite)
    written = write_outputs(options, suites, baseline)
    for fault in written.faults:
        print(f"verify: {fault}", file=sys.stderr)
    for line in written.lines:
        print(line, flush=True)
    return max(worst, written.exit_code)


def _load(files: list[Path]) -> tuple[list[Scenario], list[Suite]]:
    """Scenarios that can run, and a suite for each file that cannot."""
    scenarios: list[Scenario] = []
    suites: list[Suite] = []
    for file in files:
        try:
            scenario = load(file, scenarios)
        except PluginError as error:
            print(f"{file}: {error}", file=sys.stderr)
            suites.append(Suite(name=str(file), file=str(file), error=str(error), bad_input=True))
        except ScenarioError as error:
            print(error, file=sys.stderr)
            suites.append(Suite(name=str(file), file=str(file), error=str(error), bad_input=True))
        else:
            scenarios.append(scenario)
    return scenarios, suites


def _tell_unusable(options: argparse.Namespace, suites: Sequence[Suite], error: str) -> None:
    """Write what a CI server reads although nothing runs: the baseline as bad input."""
    name = str(options.baseline)
    about = Suite(name=name, file=name, error=error, bad_input=True)
    only = argparse.Namespace(junit=options.junit, trend=None, baseline=None, update_baseline=False)
    for fault in write_outputs(only, [*suites, about], None).faults:
        print(f"verify: {fault}", file=sys.stderr)


def _suite(done: Attempt, scenario: Scenario, baseline: Baseline | None) -> Suite:
    """What became of a scenario, beside the baseline if that is to be compared."""
    outcome, file = done.outcome, str(scenario.source or "")
    if outcome is None:
        return Suite(name=done.name, file=file, error=done.error, bad_input=done.exit_code == BAD_INPUT)
    run = run_of(scenario, outcome.result)
    return Suite(
        name=done.name,
        file=file,
        judgement=outcome.judgement,
        missing=done.unfinished,
        report=str(outcome.report),
        run=run,
        comparison=None if baseline is None else compare(baseline, run),
        version=str(outcome.result["versions"]["vnav_drake"]),
    )


def _tell(suite: Suite, done: Attempt, code: int, beside: Sequence[str], options: argparse.Namespace) -> None:
    """The scenario's line and what failed, also `beside` the baseline; on standard error why it has none."""
    outcome = done.outcome
    if outcome is None:
        if options.verbose:
            print(done.trace, end="", file=sys.stderr)
        print(_complaint(done), file=sys.stderr)
        return
    if code == OK and options.quiet and not beside:
        return
    print(f"{headline(outcome.judgement, suite.comparison)}  {outcome.report}", flush=True)
    lines = [f"missing {item.stage}: {item.reason}" for item in outcome.missing]
    lines += details(outcome.judgement) if options.verbose else failures(outcome.judgement)
    for line in (*lines, *beside):
        print(f"  {line}", flush=True)


def _complaint(done: Attempt) -> str:
    kept = "an earlier result is as it was"
    if done.exit_code != UNFINISHED:
        return done.error
    return f"verify: {done.error}" + ("" if done.error.endswith(kept) else f"; {kept}")
