"""What a command line writes beside the result folders: JUnit, trends, the step's summary, the baseline."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from verify.atomic import OutputError, replace_file, usable_folder
from verify.baseline import compare, entry
from verify.baseline_file import Baseline, read_baseline, update_baseline
from verify.junit import write_junit
from verify.step_summary import write_step_summary
from verify.suite import Suite
from verify.trend import write_trend


def prepare(options: argparse.Namespace) -> Baseline | None:
    """Make sure, before anything runs, that all can be written; gives the stored baseline, if any.

    Raises
    ------
    OutputError : a folder cannot be used.
    BaselineError : the baseline is missing where it is to be compared with, or is no baseline.
    """
    for file in (options.junit, options.baseline if options.update_baseline else None):
        if file is not None and not file.absolute().parent.is_dir():
            raise OutputError(f"{file}: its folder does not exist")
    if options.junit is not None and options.junit.is_dir():
        raise OutputError(f"{options.junit}: is a folder, expected a file")
    if options.trend is not None:
        usable_folder(options.trend)
    if options.baseline is None or (options.update_baseline and not options.baseline.exists()):
        return None
    return read_baseline(options.baseline)


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


def write_outputs(
    options: argparse.Namespace, suites: Sequence[Suite], baseline: Baseline | None
) -> list[str]:
    """Write all that was asked for; gives lines to print.

    Raises
    ------
    BaselineError : the baseline has become unusable meanwhile.
    OSError : something cannot be written. Only the step's summary may fail without that.
    """
    write_step_summary(suites)
    if options.junit is not None:
        replace_file(options.junit.absolute(), lambda aside: write_junit(aside, suites))
    if options.trend is not None:
        write_trend(options.trend, suites)
    if options.baseline is None:
        return []
    if options.update_baseline:
        return _updated(options, suites)
    return _not_run(options, suites, baseline)


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
