"""Run scenario files one after the other; one that fails does not stop the others."""

from __future__ import annotations

import argparse
import logging
import sys
import traceback
import webbrowser
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from shapely.errors import ShapelyError

from verify import evidence
from verify.atomic import OutputError, locked, replace_file, usable_folder
from verify.evidence import EvidenceError
from verify.exit_codes import BAD_INPUT, OK, UNFINISHED
from verify.junit import Suite, write_junit
from verify.progress import Progress
from verify.summary import details, failures, headline
from vnav_drake.scenario import Scenario, ScenarioError, load_scenario
from vnav_drake.zones.errors import PluginError

# What a fault of ours, or memory running out, is raised as. Interruptions pass.
DEFECTS = (
    ArithmeticError,
    AssertionError,
    AttributeError,
    ImportError,
    LookupError,
    MemoryError,
    NameError,
    RuntimeError,
    ShapelyError,
    TypeError,
    ValueError,
)


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
        for scenario in scenarios:
            code, suite = _run_one(scenario, options, progress)
            worst = max(worst, code)
            suites.append(suite)
    if options.junit is not None:
        replace_file(options.junit.absolute(), lambda aside: write_junit(aside, suites))
    return worst


def _load(files: list[Path]) -> tuple[list[Scenario], list[Suite]]:
    """Scenarios that can run, and a suite for each file that cannot."""
    scenarios: list[Scenario] = []
    suites: list[Suite] = []
    for file in files:
        try:
            scenario = _loaded(file)
            twin = next((other for other in scenarios if other.name == scenario.name), None)
            if twin is not None:
                raise scenario.error("name", f"is also the name of {twin.source}; expected one file a name")
        except PluginError as error:
            print(f"{file}: {error}", file=sys.stderr)
            suites.append(Suite(name=str(file), error=str(error)))
        except ScenarioError as error:
            print(error, file=sys.stderr)
            suites.append(Suite(name=str(file), error=str(error)))
        else:
            scenarios.append(scenario)
    return scenarios, suites


def _loaded(file: Path) -> Scenario:
    from vnav_drake.zones.plugins import Watched

    with Watched():
        return load_scenario(file)


def _run_one(scenario: Scenario, options: argparse.Namespace, progress: Progress) -> tuple[int, Suite]:
    name = scenario.name
    try:
        from systems.parallel import processors
        from verify.pipeline import run_scenario  # loads Drake: not for bad input
        from vnav_drake.zones.plugins import Watched

        # Drake tells of each solve that did not succeed; the stages try again, and say what counts.
        logging.getLogger("drake").setLevel(logging.WARNING)
        with Watched():
            outcome = run_scenario(
                scenario, options.out, overrides=dict(options.gate), say=progress.say, workers=processors()
            )
        _write_index(options.out)
    except (ScenarioError, OutputError) as error:
        with progress.paused():
            print(error, file=sys.stderr)
        return BAD_INPUT, Suite(name=name, error=str(error))
    except EvidenceError as error:  # what was written, too large for one
        text = f"{name}: cannot be judged: {error}"
        with progress.paused():
            print(f"verify: {text}; an earlier result is as it was", file=sys.stderr)
        return UNFINISHED, Suite(name=name, error=text)
    except PluginError as error:
        text = f"{name}: could not finish: {error}"
        with progress.paused():
            if options.verbose:
                traceback.print_exc()
            print(f"verify: {text}; an earlier result is as it was", file=sys.stderr)
        return UNFINISHED, Suite(name=name, error=text)
    except DEFECTS as error:
        words = str(error).partition("\n")[0]
        text = f"{name}: could not finish, a fault of ours: {type(error).__name__}{words and ': '}{words}"
        with progress.paused():
            if options.verbose:
                traceback.print_exc()
            print(f"verify: {text}; an earlier result is as it was", file=sys.stderr)
        return UNFINISHED, Suite(name=name, error=text)
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        text = f"{name}: {where}{error.strerror or error}; an earlier result is as it was"
        with progress.paused():
            print(f"verify: {text}", file=sys.stderr)
        return UNFINISHED, Suite(name=name, error=text)
    judgement = outcome.judgement
    missing = tuple(f"{item.stage}: {item.reason}" for item in outcome.missing)
    lines = [f"missing {entry}" for entry in missing]
    lines += details(judgement) if options.verbose else failures(judgement)
    with progress.paused():
        if outcome.exit_code != OK or not options.quiet:
            print(f"{headline(judgement)}  {outcome.report}", flush=True)
            for line in lines:
                print(f"  {line}", flush=True)
    if options.open:
        webbrowser.open(outcome.report.absolute().as_uri())
    unfinished = tuple(f"{item.stage}: {item.reason}" for item in outcome.unfinished)
    return outcome.exit_code, Suite(name=name, judgement=judgement, missing=unfinished)


def _write_index(out: Path) -> None:
    """All results in `out` side by side, those of earlier runs too."""
    from verify.report import write_index

    with locked(out):
        write_index(out / "index.html", _results(out))


def _results(out: Path) -> list[tuple[str, Mapping[str, Any]]]:
    found: list[tuple[str, Mapping[str, Any]]] = []
    for folder in sorted(out.iterdir()):
        if folder.is_dir() and not folder.name.startswith("."):
            try:
                found.append((folder.name, evidence.read_result(folder)))
            except EvidenceError:
                continue  # not a result of ours
    return found
