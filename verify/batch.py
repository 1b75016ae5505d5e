"""Run scenario files; one that fails does not stop the others."""

from __future__ import annotations

import argparse
import contextlib
import sys
import webbrowser
from pathlib import Path

from verify.atomic import OutputError, replace_file, usable_folder
from verify.attempt import Attempt, load
from verify.exit_codes import BAD_INPUT, OK, UNFINISHED
from verify.junit import Suite, write_junit
from verify.progress import Progress
from verify.side_by_side import attempts
from verify.summary import details, failures, headline
from vnav_drake.scenario import Scenario, ScenarioError
from vnav_drake.zones.errors import PluginError


def run_files(options: argparse.Namespace) -> int:
    """Run all scenarios of a command line; returns the worst exit code.

    Raises
    ------
    OutputError : the output folder or the JUnit file's folder cannot be used.
    """
    scenarios, suites = _load(options.scenarios)
    worst = BAD_INPUT if suites else OK
    if options.junit is not None and not options.junit.absolute().parent.is_dir():
        raise OutputError(f"{options.junit}: its folder does not exist")
    if scenarios:
        usable_folder(options.out)
    with Progress(quiet=options.quiet) as progress:
        runs = attempts(
            scenarios,
            options.out,
            dict(options.gate),
            progress.say,
            jobs=options.jobs,
            plugins=options.plugin,
        )
        with contextlib.closing(runs):
            for done in runs:
                with progress.paused():
                    _tell(done, options)
                if options.open and done.outcome is not None:
                    webbrowser.open(done.outcome.report.absolute().as_uri())
                worst = max(worst, done.exit_code)
                suites.append(_suite(done))
    if options.junit is not None:
        replace_file(options.junit.absolute(), lambda aside: write_junit(aside, suites))
    return worst


def _load(files: list[Path]) -> tuple[list[Scenario], list[Suite]]:
    """Scenarios that can run, and a suite for each file that cannot."""
    scenarios: list[Scenario] = []
    suites: list[Suite] = []
    for file in files:
        try:
            scenario = load(file, scenarios)
        except PluginError as error:
            print(f"{file}: {error}", file=sys.stderr)
            suites.append(Suite(name=str(file), error=str(error)))
        except ScenarioError as error:
            print(error, file=sys.stderr)
            suites.append(Suite(name=str(file), error=str(error)))
        else:
            scenarios.append(scenario)
    return scenarios, suites


def _suite(done: Attempt) -> Suite:
    if done.outcome is None:
        return Suite(name=done.name, error=done.error)
    return Suite(name=done.name, judgement=done.outcome.judgement, missing=done.unfinished)


def _tell(done: Attempt, options: argparse.Namespace) -> None:
    """The scenario's line and what failed; on standard error why it has none."""
    outcome = done.outcome
    if outcome is None:
        if options.verbose:
            print(done.trace, end="", file=sys.stderr)
        print(_complaint(done), file=sys.stderr)
        return
    if done.exit_code == OK and options.quiet:
        return
    print(f"{headline(outcome.judgement)}  {outcome.report}", flush=True)
    lines = [f"missing {item.stage}: {item.reason}" for item in outcome.missing]
    lines += details(outcome.judgement) if options.verbose else failures(outcome.judgement)
    for line in lines:
        print(f"  {line}", flush=True)


def _complaint(done: Attempt) -> str:
    kept = "an earlier result is as it was"
    if done.exit_code != UNFINISHED:
        return done.error
    return f"verify: {done.error}" + ("" if done.error.endswith(kept) else f"; {kept}")
