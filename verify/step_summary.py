"""A table of all scenarios in Markdown, for the summary page of a step in GitHub Actions."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

from verify.cases import Case
from verify.digits import as_given, beside
from verify.markdown import no_tags, unmarked
from verify.metrics import Metric
from verify.suite import Suite

VARIABLE = "GITHUB_STEP_SUMMARY"  # names the file, where there is one
# GitHub drops a step's whole summary beyond 1 MiB; what other commands of the step add needs room too.
MOST_BYTES = 900 * 1024
_LONGEST = 400  # characters of a cell
_WITHOUT_DETAILS = "Details are left out: they are too long for the summary of a step."
_NONE = "\u2013"


def write_step_summary(suites: Sequence[Suite]) -> None:
    """Append the table to the file that the environment names, where it names one.

    A file that cannot be written is told on standard error and changes nothing else.
    """
    name = os.environ.get(VARIABLE, "")
    if not name:
        return
    file = Path(name)
    try:
        before = file.stat().st_size if file.exists() else 0
        text = step_summary(suites, room=MOST_BYTES - before).encode("utf-8", errors="replace")
        with file.open("ab") as stream:
            stream.write(b"\n" * (before > 0) + text)  # a table begins a paragraph
    except OSError as error:
        print(f"verify: {VARIABLE}={name}: the summary cannot be written: {error.strerror}", file=sys.stderr)


def step_summary(suites: Sequence[Suite], room: int = MOST_BYTES) -> str:
    """The table, what failed, and folded details where they fit in `room` [bytes].

    Where the table alone does not fit, it loses rows, those of scenarios that passed before others.
    """
    rows = [_row(suite) for suite in suites]
    table = "\n".join((*_head(suites), *rows, ""))
    folded = "\n".join(map(_details, suites))
    whole = f"{table}\n{folded}\n" if suites else f"{table}\n"
    if len(whole.encode()) <= room:
        return whole
    short = f"{table}\n{_WITHOUT_DETAILS}\n\n"
    return short if len(short.encode()) <= room else _cut(suites, rows, room)


def _cut(suites: Sequence[Suite], rows: Sequence[str], room: int) -> str:
    """As many rows as fit, failing ones first, and how many are missing."""
    failing_first = sorted(range(len(suites)), key=lambda at: suites[at].passed)
    head = "\n".join(_head(suites))
    left = room - len(head.encode()) - len(_missing(len(suites), len(suites)).encode()) - 4  # line ends
    kept: list[int] = []
    for at in failing_first:
        left -= len(rows[at].encode()) + 1
        if left < 0:
            break
        kept.append(at)
    gone = set(range(len(suites))).difference(kept)
    bad = sum(not suites[at].passed for at in gone)
    table = "\n".join((head, *(rows[at] for at in kept)))
    return f"{table}\n\n{_missing(len(gone), bad)}\n\n"


def _missing(count: int, bad: int) -> str:
    scenarios = "1 scenario is" if count == 1 else f"{count} scenarios are"
    return f"{scenarios} missing in this table, {bad} of which did not pass. {_WITHOUT_DETAILS}"


def _head(suites: Sequence[Suite]) -> Iterable[str]:
    good = sum(suite.passed for suite in suites)
    count = f"{good} of {len(suites)} scenarios passed"
    yield f"### verify: {count}"
    yield ""
    yield "| scenario | result | verdict | executed time | gap | what failed | report |"
    yield "| :-- | :-- | :-- | --: | --: | :-- | :-- |"


def _row(suite: Suite) -> str:
    judged = suite.judgement
    executed = judged.executed if judged is not None else None
    time = _value(suite, f"travel_time.{executed}")
    cells = (
        _plain(suite.name),
        _result(suite),
        _plain(judged.verdict) if judged is not None else _NONE,
        _NONE if time is None else f"{time:.3f}\u00a0s ({_plain(executed or '')})",
        _gap(suite),
        "<br>".join(map(_failure, _bad(suite))) or _NONE,
        _plain(suite.report) if suite.report else _NONE,
    )
    return f"| {' | '.join(cells)} |"


def _gap(suite: Suite) -> str:
    """To the lower bound: of the variational model, else of the full robot, which is said."""
    for name, whose in (("gap.certified", ""), ("gap.certified_full", " (full robot)")):
        gap = _value(suite, name)
        if gap is not None:
            return f"{100.0 * gap:.3f}\u00a0%{whose}"
    return _NONE


def _result(suite: Suite) -> str:
    if suite.passed:
        return "passed"
    found = {case.status for case in suite.cases}
    if "bad_input" in found:
        return "**bad input**"
    return "**not finished**" if "error" in found else "**failed**"


def _bad(suite: Suite) -> list[Case]:
    return [case for case in suite.cases if case.bad]


def _failure(case: Case) -> str:
    return f"**{_plain(case.name)}**: {_measured(case)}"


def _measured(case: Case) -> str:
    """Value and limit of a gate, or the words of any other case."""
    if case.value is None or case.limit is None:
        return _plain(case.text)
    unit = f" {case.unit}" if case.unit else ""
    return _plain(f"{beside(case.value, case.limit, 6)}{unit}, limit {as_given(case.limit)}{unit}")


def _details(suite: Suite) -> str:
    """All cases and figures of one scenario, folded."""
    lines = [
        f"<details><summary>{no_tags(suite.name)}: {len(suite.cases)} cases</summary>",
        "",
        "| case | status | value and limit |",
        "| :-- | :-- | :-- |",
        *(f"| {_plain(c.name)} | {c.status} | {_measured(c)} |" for c in suite.cases),
        "",
    ]
    if suite.run is not None:
        lines += ["| figure | value |", "| :-- | --: |", *map(_figure, suite.run.metrics), ""]
    return "\n".join((*lines, "</details>", ""))


def _figure(metric: Metric) -> str:
    unit = f"\u00a0{metric.unit}" if metric.unit else ""
    return f"| {_plain(metric.name)} | {metric.value:.6g}{unit} |"


def _value(suite: Suite, name: str) -> float | None:
    figures = () if suite.run is None else suite.run.metrics
    return next((metric.value for metric in figures if metric.name == name), None)


def _plain(text: str) -> str:
    """Text that Markdown takes for nothing else, on one line, of bounded length."""
    short = text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}\u2026"
    lines = (line.strip() for line in short.splitlines() if line.strip())
    return "<br>".join(unmarked(line) for line in lines)
