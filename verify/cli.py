"""The command line: arguments, lines on standard output, exit codes."""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
from collections.abc import Callable, Sequence
from importlib import metadata
from pathlib import Path

from verify.by_products import FIGURE_FORMATS
from verify.exit_codes import BAD_INPUT, OK, UNFINISHED

RESERVED = ("sweep", "import")

_EPILOG = """\
other commands:
  verify check RESULT_DIR   judge a finished result again, without planning or simulating anything
  verify schema             print the JSON Schema of scenario files
A scenario file named like a command is given as ./check.

exit codes:
  0  every scenario ran and passed       2  bad input; nothing was run for that scenario
  1  a gate, check or verdict failed     3  a solver or simulation could not finish
"""


def run(arguments: Sequence[str]) -> int:
    """Carry out a command; returns the exit code. Usage errors exit with 2 from within argparse."""
    commands: dict[str, Callable[[Sequence[str]], int]] = {"check": _check, "schema": _schema}
    name = arguments[0] if arguments else ""
    try:
        if name in RESERVED:
            _complain(f"'{name}' is reserved for a later version (a file of that name is given as ./{name})")
            return BAD_INPUT
        code = commands[name](arguments[1:]) if name in commands else _verify(arguments)
        sys.stdout.flush()  # so that a reader that has gone away is noticed here
        return code
    except BrokenPipeError:
        # the reader of our output is gone: nobody is left to tell, and the exit must not write either
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return UNFINISHED
    except OSError as error:
        _complain(_system_message(error))
        return UNFINISHED


def _verify(arguments: Sequence[str]) -> int:
    options = _options(arguments)
    if not _loaded(options.plugin):
        return BAD_INPUT
    from verify.atomic import OutputError
    from verify.baseline_file import BaselineError
    from verify.batch import run_files

    try:
        return run_files(options)
    except (OutputError, BaselineError) as error:
        _complain(str(error))
        return BAD_INPUT


def _gate_names() -> tuple[str, ...]:
    from vnav_drake.scenario_spec import GatesSpec

    return tuple(GatesSpec.model_fields)


def _options(arguments: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="verify",
        description="Plan, optimise, simulate, check and report scenarios.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("scenarios", nargs="+", type=Path, metavar="scenario.yaml")
    parser.add_argument(
        "--out", type=Path, default=Path("reports"), metavar="DIR", help="where results go (default: reports)"
    )
    parser.add_argument("--open", action="store_true", help="open each report in a browser")
    _add_gate(parser, f"override a gate's limit; gates: {', '.join(_gate_names())}")
    _add_plugin(parser)
    parser.add_argument("--junit", type=Path, metavar="FILE", help="also write the gates as JUnit XML")
    parser.add_argument(
        "--trend",
        type=Path,
        metavar="DIR",
        help="also write key figures for charts (github-action-benchmark)",
    )
    parser.add_argument(
        "--baseline",
        type=Path,
        metavar="FILE",
        help="fail where figures are worse than the runs stored there",
    )
    parser.add_argument(
        "--update-baseline",
        action="store_true",
        help="store these runs in the baseline instead, if they pass",
    )
    parser.add_argument(
        "--jobs", type=_jobs, default=1, metavar="N", help="scenarios that run at once (default: 1)"
    )
    parser.add_argument(
        "--figures", choices=FIGURE_FORMATS, help="also write each picture of the report as a file for papers"
    )
    loudness = parser.add_mutually_exclusive_group()
    loudness.add_argument("--quiet", action="store_true", help="print only what failed")
    loudness.add_argument("--verbose", action="store_true", help="print every gate and check")
    parser.add_argument("--version", action="version", version=f"verify {metadata.version('vnav-drake')}")
    options = parser.parse_args(arguments)
    if options.update_baseline and options.baseline is None:
        parser.error("--update-baseline needs --baseline FILE, the file to write")
    return options


def _add_gate(parser: argparse.ArgumentParser, meaning: str) -> None:
    parser.add_argument(
        "--gate", action="append", default=[], type=gate_limit, metavar="NAME=LIMIT", help=meaning
    )


def _add_plugin(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--plugin",
        action="append",
        default=[],
        metavar="MODULE",
        help="import a module, such as my_package.zones, whose braking zones scenarios may then name",
    )


def gate_limit(text: str) -> tuple[str, float]:
    """A gate's name and limit from `NAME=LIMIT`.

    Raises
    ------
    ArgumentTypeError : no gate has this name, or the limit is no finite number >= 0.
    """
    name, equals, limit = text.partition("=")
    if not equals or name not in _gate_names():
        raise argparse.ArgumentTypeError(
            f"{text!r}: expected NAME=LIMIT with one of {', '.join(_gate_names())}"
        )
    try:
        value = float(limit)
    except ValueError:
        value = math.nan
    if not math.isfinite(value) or value < 0.0:
        raise argparse.ArgumentTypeError(f"{text!r}: the limit must be a finite number, at least 0")
    return name, value


def _jobs(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r}: expected a whole number, at least 1")
    return int(text)


def _check(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="verify check",
        description="Judge a finished result folder again: every figure is recomputed from its evidence.",
        allow_abbrev=False,
    )
    parser.add_argument("folder", type=Path, metavar="RESULT_DIR")
    _add_gate(parser, "judge with this limit, not the scenario's, nor that with which the result was made")
    _add_plugin(parser)
    parser.add_argument(
        "--exact", action="store_true", help="check the lower bound's certificate in rational arithmetic"
    )
    parser.add_argument(
        "--baseline", type=Path, metavar="FILE", help="fail where figures are worse than the run stored there"
    )
    parser.add_argument("--quiet", action="store_true", help="print only what failed")
    options = parser.parse_args(arguments)
    from verify.baseline_file import BaselineError, read_baseline
    from verify.recheck import check_folder

    if not _loaded(options.plugin):
        return BAD_INPUT
    try:
        baseline = None if options.baseline is None else read_baseline(options.baseline)
    except BaselineError as error:
        _complain(str(error))
        return BAD_INPUT
    return check_folder(
        options.folder,
        overrides=dict(options.gate),
        quiet=options.quiet,
        exact=options.exact,
        baseline=baseline,
    )


def _loaded(modules: Sequence[str]) -> bool:
    """Whether all plugins could be loaded; what was wrong is told."""
    if not modules:
        return True
    from vnav_drake.zones.errors import PluginError
    from vnav_drake.zones.plugins import load_plugin

    try:
        for module in modules:
            load_plugin(module)
    except PluginError as error:
        _complain(str(error))
        return False
    return True


def _schema(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="verify schema", description="Print the JSON Schema of scenario files.", allow_abbrev=False
    )
    parser.parse_args(arguments)
    from vnav_drake.scenario_spec import scenario_schema

    print(json.dumps(scenario_schema(), indent=2))
    return OK


def _complain(text: str) -> None:
    print(f"verify: {text}", file=sys.stderr)


def _system_message(error: OSError) -> str:
    where = f"{error.filename}: " if error.filename else ""
    return f"{where}{error.strerror or error}; earlier results are as they were"
