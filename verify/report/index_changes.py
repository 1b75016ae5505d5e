"""What changed since the last run, in words."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from verify.metrics import finite_number
from verify.previous import Change, Previous, changes
from verify.report import story
from verify.report.numbers import DASH, percent, percent_or_times, seconds, seconds_proven
from verify.report.palette import method
from verify.report.text import plain
from verify.report.wording import GATES, VERDICTS

ALL_SHOWN = 3  # more changes than these are folded
_GAPS = {
    "gap.analytic": "analytic gap",
    "gap.refinement": "refinement gap",
    "gap.certified": "certified gap",
    "gap.certified_full": "certified gap of the full robot",
}
# of what changed, from what to look at first to what can wait; also how the column sorts
WORSE, MOVED, BETTER, SAME, NEW = range(5)


@dataclass(frozen=True, kw_only=True)
class ChangeWords:
    """One thing that is not as it was: better, worse or neutral, and what."""

    direction: str
    text: str


@dataclass(frozen=True, kw_only=True)
class ChangesCell:
    """All that changed in one scenario."""

    rank: int  # WORSE .. NEW
    told: Sequence[ChangeWords] = ()
    folded: Sequence[ChangeWords] = ()
    words: str = ""  # where nothing changed, or nothing is known of an earlier run


def changes_cell(
    before: Previous | None, result: Mapping[str, Any], folder: Path | None = None
) -> ChangesCell:
    """What is not as in the run before, the executed motion's travel time before those of others.

    `folder` is the result's: it tells whether another scenario file asks another question.
    """
    if before is None:
        return ChangesCell(rank=NEW, words="new: no earlier run")
    executed = f"travel_time.{story.executed_plan(result)}"
    found = sorted(
        changes(before, result, folder),
        key=lambda change: change.kind == "metric" and change.name != executed,
    )
    pairs = [(change, _in_words(change, executed)) for change in found]
    other = any(change.kind == "scenario" for change in found)  # another question: neither better nor worse
    told = [
        ChangeWords(direction="neutral" if other else change.direction, text=text)
        for change, text in pairs
        if text
    ]
    if not told:
        return ChangesCell(rank=SAME, words="nothing")
    directions = {words.direction for words in told}
    rank = WORSE if "worse" in directions else BETTER if directions == {"better"} else MOVED
    return ChangesCell(rank=rank, told=told[:ALL_SHOWN], folded=told[ALL_SHOWN:])


def _in_words(change: Change, executed: str) -> str:
    """Empty where both figures read the same."""
    if change.kind == "scenario":
        return "scenario changed"
    if change.kind == "effort":
        return f"effort {plain(str(change.before))} → {plain(str(change.after))}"
    if change.kind == "verdict":
        return f"verdict {_verdict(change.before)} → {_verdict(change.after)}"
    if change.kind == "gate":
        title = (
            GATES[change.name].title.lower() if change.name in GATES else plain(change.name.replace("_", " "))
        )
        return f"gate {title} {_gate(change.before)} → {_gate(change.after)}"
    return _figure(change, executed)


def _verdict(word: object) -> str:
    return VERDICTS[word][0].lower() if isinstance(word, str) and word in VERDICTS else "none"


def _gate(passed: object) -> str:
    return "not evaluated" if passed is None else "holds" if passed else "fails"


def _figure(change: Change, executed: str) -> str:
    kind, _, plan = change.name.partition(".")
    gap = kind == "gap"
    name, form = _GAPS.get(change.name, plain(change.name)), _gap if gap else seconds
    if kind == "lower_bound":
        name, form = "lower bound", seconds_proven
    elif kind == "travel_time":
        name = "travel time" if change.name == executed else f"{method(plan).label} time"
    before, after = finite_number(change.before), finite_number(change.after)
    texts = _written(before, form), _written(after, form)
    if texts[0] == texts[1]:
        return ""
    share = ""
    if not gap and before and after is not None:
        share = f" ({percent_or_times(after / before - 1.0)})"
    return f"{name} {texts[0]} → {texts[1]}{share}"


def _written(value: float | None, form: Callable[[float], str]) -> str:
    return DASH if value is None else form(value)


def _gap(ratio: float) -> str:
    return percent(ratio)
