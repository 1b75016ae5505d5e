"""Judge a finished result folder, and refuse it where it claims what its evidence does not show."""

from __future__ import annotations

import sys
from pathlib import Path

from verify import evidence
from verify.evidence import EvidenceError
from verify.judge import Judgement, compare, compare_files, gate_overrides, judge
from verify.summary import failures, headline

OK, FAILED, NOT_A_RESULT = 0, 1, 2


def recheck(folder: Path) -> tuple[tuple[str, ...], Judgement | None]:
    """Every reason not to believe the result in `folder`, and the judgement where one is possible.

    Without a reason the result holds, and there is a judgement; it may still be a failed one.
    """
    try:
        result = evidence.read_result(folder)
        overrides = gate_overrides(result)
    except EvidenceError as error:
        return error.reasons, None
    reasons = compare_files(folder, result)
    try:
        judgement = judge(folder, overrides)
    except EvidenceError as error:
        return reasons + error.reasons, None
    return reasons + compare(result, judgement), judgement


def check_folder(folder: Path, *, quiet: bool = False) -> int:
    """Print the judgement, or why the result is refused; returns the exit code.

    0: judged, and all passed; 1: refused or failed; 2: not a result folder.
    """
    if not folder.is_dir() or not (folder / evidence.RESULT).is_file():
        print(f"verify: {folder}: not a result folder (it has no {evidence.RESULT})", file=sys.stderr)
        return NOT_A_RESULT
    reasons, judgement = recheck(folder)
    if reasons or judgement is None:
        print(f"{folder}: refused")
        for reason in dict.fromkeys(reasons):
            print(f"  {reason}")
        return FAILED
    failing = failures(judgement)
    if failing or not quiet:
        print(f"{headline(judgement)}  {folder}")
    for line in failing:
        print(f"  {line}")
    return OK if judgement.passed else FAILED
