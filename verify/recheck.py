"""Judge a finished result folder, and refuse it where it claims what its evidence does not show."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

from verify import evidence
from verify.evidence import EvidenceError
from verify.exit_codes import BAD_INPUT, FAILED, OK
from verify.judge import Judgement, compare, compare_files, decide, exactly, examine, gate_overrides
from verify.judge.zones.plugin import differences as other_plugin
from verify.summary import failures, headline, limits_given

if TYPE_CHECKING:
    from verify.baseline import Comparison
    from verify.baseline_file import Baseline

NONE: Mapping[str, float] = MappingProxyType({})


@dataclass(frozen=True, kw_only=True)
class Recheck:
    """What a second look at a result folder gave."""

    reasons: tuple[str, ...]  # not to believe it; empty: the result says what its evidence shows
    judgement: Judgement | None = None  # under the scenario's limits, and those given for this check
    # Under the limits with which the result was made, as far as none were given for this check.
    as_made: Judgement | None = None

    @property
    def passed(self) -> bool:
        """Believed, and passed under both sets of limits: a wide limit in result.json excuses nothing."""
        return not self.reasons and all(
            judgement is not None and judgement.passed for judgement in (self.judgement, self.as_made)
        )


def recheck(folder: Path, overrides: Mapping[str, float] = NONE, *, exact: bool = False) -> Recheck:
    """Every reason not to believe the result in `folder`, and the judgement where one is possible.

    `overrides` are limits of gates given for this check, which take precedence over the scenario's and
    over those with which the result was made. With `exact` the judgements rest on the certificate as
    checked in rational arithmetic; what the result claims is compared with the usual check.
    """
    try:
        result = evidence.read_result(folder)
        made = gate_overrides(result)
    except EvidenceError as error:
        return Recheck(reasons=error.reasons)
    reasons = other_plugin(result) + compare_files(folder, result)
    try:
        findings = examine(folder)
    except EvidenceError as error:
        return Recheck(reasons=reasons + error.reasons)
    reasons += compare(result, decide(findings, made))
    if exact:
        findings = exactly(findings)
    return Recheck(
        reasons=reasons,
        judgement=decide(findings, overrides),
        as_made=decide(findings, {**made, **overrides}),
    )


def check_folder(
    folder: Path,
    *,
    overrides: Mapping[str, float] = NONE,
    quiet: bool = False,
    exact: bool = False,
    baseline: Baseline | None = None,
) -> int:
    """Print the judgement, or why the result is refused; returns the exit code.

    With `exact` the certificate is checked in rational arithmetic. What it proves is printed, or each
    reason to refuse it. A result that is believed is also held against the `baseline`, where one is given;
    its compute times are as it states them.

    0: judged, and all passed; 1: refused or failed; 2: not a result folder.
    """
    if not folder.is_dir() or not (folder / evidence.RESULT).is_file():
        print(f"verify: {folder}: not a result folder (it has no {evidence.RESULT})", file=sys.stderr)
        return BAD_INPUT
    found = recheck(folder, overrides, exact=exact)
    if found.reasons or found.judgement is None or found.as_made is None:
        print(f"{folder}: refused")
        for reason in dict.fromkeys(found.reasons):
            print(f"  {reason}")
        return FAILED
    beside = None if baseline is None else _beside(baseline, folder)
    passed = found.passed and (beside is None or beside.passed)
    if passed and quiet:
        return OK
    print(f"{headline(found.judgement, beside)}  {folder}")
    made = limits_given(found.as_made, but=overrides)
    lines = [f"the result was made with other gate limits: {made}"] if made else []
    lines += failures(found.judgement)
    lines += [line for line in failures(found.as_made) if line.partition(":")[0] not in _names(lines)]
    if beside is not None:
        lines += beside.failures + ([] if quiet else beside.remarks)
    for line in [*lines, *_about_bound(found.judgement, exact)]:
        print(f"  {line}")
    return OK if passed else FAILED


def _beside(baseline: Baseline, folder: Path) -> Comparison:
    """The result beside the stored run; the only step that reads the scenario as planners do."""
    from verify.baseline import compare_folder

    return compare_folder(baseline, folder)


def _about_bound(judgement: Judgement, exact: bool) -> list[str]:
    """What the certificate proves, or each reason to refuse it."""
    bound = judgement.bound
    if bound is None:
        return [f"lower bound: there is no {evidence.CERTIFICATE}"] if exact else []
    if bound.travel_time is None:
        return [f"lower bound refused: {reason}" for reason in bound.told]
    return [f"lower bound proved: {bound.proof.statement}"]


def _names(lines: list[str]) -> set[str]:
    return {line.partition(":")[0] for line in lines}
