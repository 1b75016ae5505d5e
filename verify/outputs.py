"""What a command line writes beside the result folders: JUnit, trends, the step's summary, the baseline."""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from verify.atomic import OutputError, replace_file, usable_folder
from verify.baseline import compare, entry
from verify.baseline_file import Baseline, BaselineError, read_baseline, update_baseline
from verify.exit_codes import BAD_INPUT, OK, UNFINISHED
from verify.junit import write_junit
from verify.step_summary import write_step_summary
from verify.suite import Suite
from verify.trend import FILES, write_trend


def prepare(options: argparse.Namespace) -> Baseline | None:
    """Make sure, before anything runs, that all can be written; gives the stored baseline, if any.

    Raises
    ------
    OutputError : a folder cannot be used, or a file cannot be made.
    BaselineError : the baseline is missing where it is to be compared with, or is no baseline.
    """
    for file in (options.junit, options.baseline if options.update_baseline else None):
        if file is not None:
            _require_writable(file)
    if options.trend is not None:
        usable_folder(options.trend)
        for name in FILES.values():
            _require_writable(options.trend / name)
    if options.baseline is None or (options.update_baseline and not options.baseline.exists()):
        return None
    return read_baseline(options.baseline)


def _require_writable(file: Path) -> None:
    """Files are put in place whole, so what counts is that one can be made beside it."""
    folder = file.resolve().parent  # a link stays one
    if not folder.is_dir():
        raise OutputError(f"{file}: its folder does not exist")
    if file.is_dir():
        raise OutputError(f"{file}: is a folder, expected a file")
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise OutputError(f"{file}: no file can be made in its folder: {error.strerror}") from error


def baseline_lines(suite: Suite, baseline: Baseline | None, options: argparse.Namespace) -> list[str]:
    """Of one run beside the baseline: what does not hold; unless `quiet`, what is better or new too.

    Where the baseline is to be updated: what the update changes, if the run is to be stored.
    """
    found = suite.comparison
    if options.update_baseline:
        if (
            baseline is None
            or suite.run is None
            or suite.name not in baseline.scenarios
            or not storable(suite)
        ):
            return []
        found = compare(baseline, suite.run)
    if found is None:
        return []
    return found.failures + ([] if options.quiet else found.remarks)


def storable(suite: Suite) -> bool:
    """Whether a run may become what later ones are compared with: it finished, and nothing failed."""
    return suite.run is not None and suite.run.verdict != "failed" and suite.passed


@dataclass(frozen=True, kw_only=True)
class Written:
    """What became of the files beside the result folders."""

    lines: tuple[str, ...] = ()  # to print
    faults: tuple[str, ...] = ()  # what could not be written, and why
    exit_code: int = OK  # the worst


def write_outputs(options: argparse.Namespace, suites: Sequence[Suite], baseline: Baseline | None) -> Written:
    """Write all that was asked for; what cannot be written keeps nothing else from it.

    A step's summary that cannot be written is told on standard error, and is no fault.
    """
    write_step_summary(suites)
    lines: list[str] = []
    faults: list[str] = []
    code = OK
    for file, write in _steps(options, suites, baseline):
        try:
            lines += write()
        except BaselineError as error:  # it has become unusable meanwhile
            faults.append(str(error))
            code = max(code, BAD_INPUT)
        except OSError as error:
            faults.append(f"{file}: cannot be written: {error.strerror or error}")
            code = max(code, UNFINISHED)
    return Written(lines=tuple(lines), faults=tuple(faults), exit_code=code)


def _steps(
    options: argparse.Namespace, suites: Sequence[Suite], baseline: Baseline | None
) -> Iterator[tuple[Path, Callable[[], list[str]]]]:
    """Files that were asked for, and what writes each and gives lines to print."""
    if options.junit is not None:
        yield options.junit, lambda: _junit(options.junit, suites)
    if options.trend is not None:
        yield options.trend, lambda: _trend(options.trend, suites)
    if options.update_baseline:
        yield options.baseline, lambda: _updated(options, suites)
    elif options.baseline is not None:
        yield options.baseline, lambda: _not_run(options, suites, baseline)


def _junit(file: Path, suites: Sequence[Suite]) -> list[str]:
    replace_file(file.resolve(), lambda aside: write_junit(aside, suites))
    return []


def _trend(folder: Path, suites: Sequence[Suite]) -> list[str]:
    write_trend(folder, suites)
    return []


def _updated(options: argparse.Namespace, suites: Sequence[Suite]) -> list[str]:
    """Store the runs that may be; say which not, and unless `quiet` which."""
    stored = {suite.name: entry(suite.run) for suite in suites if suite.run is not None and storable(suite)}
    left = [suite.name for suite in suites if suite.name not in stored]
    if stored:
        update_baseline(options.baseline, stored)
    told = [f"stored {', '.join(stored)}"] if stored and not options.quiet else []
    told += [f"not stored, as it did not pass: {name}" for name in left]
    return [f"baseline {options.baseline}: {text}" for text in told]


def _not_run(options: argparse.Namespace, suites: Sequence[Suite], baseline: Baseline | None) -> list[str]:
    """Stored scenarios that were not among the files: no failure, but nobody compared them."""
    names = sorted(set(baseline.scenarios if baseline else ()).difference(suite.name for suite in suites))
    if not names or options.quiet:
        return []
    return [f"baseline {options.baseline}: not run: {', '.join(names)}"]
