"""What a run promised, case by case: the one place that says which gates count as failed.

The exit code is 0 exactly when no case failed; JUnit files and `pytest --verify` show the same cases.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from verify.judge import Gate, Judgement
from verify.judge.gates import AT_LEAST, GATE_NAMES

VERDICT = "verdict"
NAMES = (*GATE_NAMES, VERDICT)  # of the cases that every judged run has
# What a gate's figures are of, where they are no bare numbers.
UNITS = {"braking_margin": "m", "emergency_stops": "stops"}

# `bad_input`: the file is to be mended, nothing ran; `error`: something that ran could not finish.
Status = Literal["passed", "failed", "skipped", "error", "bad_input"]


@dataclass(frozen=True, kw_only=True)
class Case:
    """A gate, the verdict, or a stage that could not finish."""

    name: str
    status: Status
    text: str  # value and limit, or why there is no value
    value: float | None = None
    limit: float | None = None

    @property
    def unit(self) -> str:
        """Of value and limit; empty for bare numbers."""
        return UNITS.get(self.name, "")

    @property
    def bad(self) -> bool:
        """Whether it counts against the run."""
        return self.status in ("failed", "error", "bad_input")


def cases(judgement: Judgement, unfinished: Sequence[str] = ()) -> tuple[Case, ...]:
    """Stages that could not finish (`stage: reason`), then every gate, then the verdict."""
    stages = (Case(name=entry.partition(":")[0], status="error", text=entry) for entry in unfinished)
    broken = [f"{c.name} of {c.trajectory}: {c.message}" for c in judgement.failing_checks]
    verdict = Case(
        name=VERDICT,
        status="failed" if judgement.verdict == "failed" or broken else "passed",
        text="\n".join([*judgement.reasons, *broken]) or judgement.verdict,
    )
    return (*stages, *map(_of_gate, judgement.gates), verdict)


def gate_status(passed: object, named: object) -> Literal["passed", "failed", "skipped"]:
    """Whether a gate counts against the run, from its fields in result.json, `passed` None without a value.

    A gate that somebody names must be evaluated; the others may be skipped.
    """
    if isinstance(passed, bool):
        return "passed" if passed else "failed"
    return "failed" if named is True else "skipped"


def _of_gate(gate: Gate) -> Case:
    status = gate_status(gate.passed, gate.named)
    if gate.value is None:
        return Case(name=gate.name, status=status, text=gate.reason, limit=gate.limit)
    side = "at least" if gate.name in AT_LEAST else "at most"
    return Case(
        name=gate.name,
        status=status,
        text=f"value {gate.value!r}, limit {gate.limit!r} ({side})",
        value=gate.value,
        limit=gate.limit,
    )
