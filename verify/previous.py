"""What changed since the last run: the key figures of the result that a run replaces, beside the new one.

They are no evidence. Nothing here stops a run: of a result that cannot be read nothing is kept.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from verify import evidence
from verify.by_products import PREVIOUS
from verify.evidence import EvidenceError
from verify.metrics import Metric, finite_number, metrics
from verify.question import Asked, asked_in
from vnav_drake.scenario_file import ScenarioError

SCHEMA = 1  # of previous.json
ROUNDING = 1e-6  # relative: far above the rounding of sums, far below what anybody would act on
_COMPARED = ("travel_time", "bound", "gap")  # kinds whose changes are told

Direction = Literal["better", "worse", "neutral"]


@dataclass(frozen=True, kw_only=True)
class Previous:
    """Key figures of the result that the present one replaced."""

    scenario_sha256: str
    question: str = ""  # as from `question_of`; empty: not known
    effort: str = ""
    verdict: str
    gates: Mapping[str, bool | None] = field(default_factory=dict)  # name -> passed; None: not evaluated
    metrics: Mapping[str, float] = field(default_factory=dict)  # as `metrics` names them
    versions: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Change:
    """One thing that is not as it was."""

    kind: Literal["scenario", "effort", "verdict", "gate", "metric"]
    name: str  # of the gate or metric; empty of the others
    direction: Direction
    before: str | float | bool | None  # of a gate: passed; of a metric: its value; None: there was none
    after: str | float | bool | None


def previous_of(result: Mapping[str, Any], asked: Asked | None = None) -> Previous:
    """The key figures of a result, and what it was `asked`, as the next run of the scenario keeps them."""
    gates = result.get("gates")
    named = [g for g in gates if isinstance(g, Mapping)] if isinstance(gates, list) else []
    versions = result.get("versions")
    return Previous(
        scenario_sha256=_word(result.get("scenario_sha256")),
        question="" if asked is None else asked.question,
        effort="" if asked is None else asked.effort,
        verdict=_word(result.get("verdict")),
        gates={_word(gate.get("name")): _passed(gate.get("passed")) for gate in named if gate.get("name")},
        metrics={metric.name: metric.value for metric in metrics(result)},
        versions=_texts(versions),
    )


def keep_previous(old: Path, new: Path) -> None:
    """Write the key figures of the result in folder `old`, if it holds one, into folder `new`.

    Raises
    ------
    OSError : the file cannot be written.
    """
    with contextlib.suppress(EvidenceError):
        kept = previous_of(evidence.read_result(old), _asked_in(old))
        content = {"schema": SCHEMA, **vars(kept)}
        # ASCII only: a word from a file may hold a lone surrogate, for which UTF-8 has no bytes
        text = json.dumps(content, indent=1, sort_keys=True, allow_nan=False)
        (new / PREVIOUS).write_text(text + "\n", encoding="utf-8", newline="\n")


def read_previous(folder: Path) -> Previous | None:
    """What `keep_previous` wrote into a result folder; None where there is nothing that can be read."""
    try:
        kept = evidence.read_json(folder, PREVIOUS)
    except EvidenceError:
        return None
    if not isinstance(kept, dict) or kept.get("schema") != SCHEMA:
        return None
    gates, figures = kept.get("gates"), kept.get("metrics")
    return Previous(
        scenario_sha256=_word(kept.get("scenario_sha256")),
        question=_word(kept.get("question")),
        effort=_word(kept.get("effort")),
        verdict=_word(kept.get("verdict")),
        gates={name: _passed(value) for name, value in gates.items()} if isinstance(gates, dict) else {},
        metrics=_numbers(figures),
        versions=_texts(kept.get("versions")),
    )


def changes(before: Previous, result: Mapping[str, Any], folder: Path | None = None) -> tuple[Change, ...]:
    """What moved: scenario, effort, verdict, gates, then travel times, lower bound and gaps beyond rounding.

    `folder` is the result's. A scenario whose file there is another one, but asks the same, has not changed.
    """
    return tuple(_changes(before, result, folder))


def _changes(before: Previous, result: Mapping[str, Any], folder: Path | None) -> Iterator[Change]:
    now = previous_of(result)
    if now.scenario_sha256 != before.scenario_sha256:
        asked = None if folder is None else _asked_in(folder)
        if asked is None or asked.question != before.question:
            yield Change(kind="scenario", name="", direction="neutral", before=None, after=None)
        if asked is not None and before.effort and asked.effort != before.effort:
            yield Change(
                kind="effort", name="", direction="neutral", before=before.effort, after=asked.effort
            )
    if now.verdict != before.verdict:
        failed = (before.verdict == "failed", now.verdict == "failed")
        direction: Direction = "neutral" if failed[0] == failed[1] else "better" if failed[0] else "worse"
        yield Change(kind="verdict", name="", direction=direction, before=before.verdict, after=now.verdict)
    for name in dict.fromkeys([*before.gates, *now.gates]):
        was, passed = before.gates.get(name), now.gates.get(name)
        if was is not passed:
            better: Direction = "better" if passed else "worse" if passed is False or was else "neutral"
            yield Change(kind="gate", name=name, direction=better, before=was, after=passed)
    for metric in metrics(result):
        if metric.kind in _COMPARED:
            yield from _moved(metric, before.metrics.get(metric.name))
    for name in before.metrics:
        if name not in now.metrics and name.startswith("travel_time."):
            yield Change(
                kind="metric", name=name, direction="neutral", before=before.metrics[name], after=None
            )


def _moved(metric: Metric, was: float | None) -> Iterator[Change]:
    if was is None:
        yield Change(kind="metric", name=metric.name, direction="neutral", before=None, after=metric.value)
        return
    # a gap is one ratio of times less one: its rounding is that of the ratio
    scale = 1.0 if metric.kind == "gap" else max(abs(was), abs(metric.value))
    if abs(metric.value - was) > ROUNDING * scale:
        smaller = metric.value < was
        better = smaller == (metric.better == "smaller")
        yield Change(
            kind="metric",
            name=metric.name,
            direction="better" if better else "worse",
            before=was,
            after=metric.value,
        )


def _asked_in(folder: Path) -> Asked | None:
    """What the scenario of a result folder asks; None where that cannot be read."""
    try:
        return asked_in(evidence.read_bytes(folder, evidence.SCENARIO))
    except (EvidenceError, ScenarioError):
        return None


def _word(value: object) -> str:
    return value if isinstance(value, str) else ""


def _passed(value: object) -> bool | None:
    return value if isinstance(value, bool) else None


def _texts(values: object) -> dict[str, str]:
    return {k: v for k, v in values.items() if isinstance(v, str)} if isinstance(values, dict) else {}


def _numbers(values: object) -> dict[str, float]:
    if not isinstance(values, dict):
        return {}
    read = {name: finite_number(value) for name, value in values.items()}
    return {name: number for name, number in read.items() if number is not None}
