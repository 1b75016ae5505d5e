"""A run beside the stored one: what is worse beyond its tolerance, what is better, what is gone."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from verify import evidence
from verify.aim import aimed_gap, is_pursued, limit_in_force
from verify.baseline_file import DIGITS, Aim, Baseline, Entry, remedy, spread
from verify.cases import Case
from verify.held_to import HeldTo, remark
from verify.judge import gate_overrides
from verify.metrics import UNIT_OF_KIND, Kind, Metric, kind_of, metrics
from verify.question import question_of
from vnav_drake.scenario import Scenario, ScenarioError, load_scenario
from vnav_drake.zones.errors import PluginError

# Which figures a case of the baseline is about.
CASES: Mapping[str, tuple[Kind, ...]] = {
    "baseline_travel_times": ("travel_time",),
    "baseline_gaps": ("bound", "gap"),
    "baseline_margins": ("margin", "count"),
    "baseline_compute_times": ("compute_time",),
}
ABOUT_RUN = "baseline_run"
_RANK = {"failed": 0, "refined": 1, "certified": 2}

Movement = Literal["worse", "better", "same", "missing", "new", "not_compared"]


@dataclass(frozen=True, kw_only=True)
class Run:
    """What is compared of a run."""

    scenario: str
    question: str  # as from `question_of`
    effort: Literal["quick", "full"]
    verdict: str
    certified_gap: Aim
    file: str = "FILE"  # the scenario's, as it was given
    metrics: tuple[Metric, ...]


@dataclass(frozen=True, kw_only=True)
class Figure:
    """One figure beside the stored one."""

    name: str
    kind: Kind
    unit: str
    movement: Movement
    value: float | None = None  # of this run
    was: float | None = None  # stored
    allowed: float | None = None  # the worst value that passes

    @property
    def bad(self) -> bool:
        """Whether the baseline does not hold; that a stage no longer runs, and takes no time, is no fault."""
        return self.movement == "worse" or (self.movement == "missing" and self.kind != "compute_time")

    @property
    def line(self) -> str:
        """In words, as for standard output."""
        digits = self._digits()
        unit = f" {self.unit}" if self.unit else ""
        value, was, allowed = (
            "none" if number is None else f"{number:.{digits}g}{unit}"
            for number in (self.value, self.was, self.allowed)
        )
        words = {
            "worse": f"worse: {value}, was {was}, allowed {allowed}",
            "better": f"better: {value}, was {was}",
            "same": f"{value}, was {was}",
            "missing": f"{'missing' if self.bad else 'gone'}: none, was {was}",
            "new": f"new: {value}, not in the baseline",
            "not_compared": f"not compared: {value}, was {was}",
        }
        return f"baseline {self.name}: {words[self.movement]}"

    def _digits(self) -> int:
        """Significant digits that show a difference where there is one."""
        numbers = [n for n in (self.value, self.was, self.allowed) if n is not None]
        differ = len(set(numbers))
        return next((n for n in range(5, 17) if len({f"{x:.{n}g}" for x in numbers}) == differ), 17)


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """One run beside the baseline."""

    scenario: str
    faults: tuple[str, ...] = ()  # of the run as a whole
    notes: tuple[str, ...] = ()
    figures: tuple[Figure, ...] = ()

    @property
    def passed(self) -> bool:
        """Nothing is worse, nothing is gone, and the same was asked."""
        return not self.faults and not any(figure.bad for figure in self.figures)

    @property
    def headline(self) -> str:
        """For the line of the run: that the baseline fails, and how much of it; empty where it holds."""
        count = sum(figure.bad for figure in self.figures)
        if self.passed:
            return ""
        return "baseline fails" + (f" ({count} figure{'s' if count > 1 else ''})" if count else "")

    @property
    def failures(self) -> list[str]:
        """One line for each thing that does not hold."""
        return [*_about_run(self.faults), *(figure.line for figure in self.figures if figure.bad)]

    @property
    def remarks(self) -> list[str]:
        """One line for each thing that is better, new or gone without being missed, or was not compared."""
        told = ("better", "new", "missing")
        found = (f.line for f in self.figures if f.movement in told and not f.bad)
        return [*_about_run(self.notes), *found]

    @property
    def cases(self) -> tuple[Case, ...]:
        """One for the run as a whole, then one a kind of figure; without figures there is only the first."""
        whole = Case(
            name=ABOUT_RUN,
            status="failed" if self.faults else "passed",
            text="\n".join((*self.faults, *self.notes)) or "the same question and verdict",
        )
        if not self.figures:
            return (whole,)
        return (whole, *(_case(name, kinds, self.figures) for name, kinds in CASES.items()))


def _about_run(texts: Iterable[str]) -> Iterator[str]:
    return (f"baseline: {text}" for text in texts)


def _case(name: str, kinds: Sequence[Kind], figures: Sequence[Figure]) -> Case:
    own = [figure for figure in figures if figure.kind in kinds]
    compared = [figure for figure in own if figure.movement != "not_compared"]
    bad = [figure.line for figure in own if figure.bad]
    if bad:
        return Case(name=name, status="failed", text="\n".join(bad))
    if not any(figure.movement in ("better", "same") for figure in compared):
        return Case(name=name, status="skipped", text="no figure of these was compared")
    moved = [figure.line for figure in compared if figure.movement != "same"]
    count = sum(figure.movement in ("better", "same") for figure in compared)
    words = f"{count} figure{'s' if count > 1 else ''} within tolerance"
    return Case(name=name, status="passed", text="\n".join((words, *moved)))


def run_of(scenario: Scenario, result: Mapping[str, Any]) -> Run:
    """What is compared of a run of `scenario` with the content of its result.json.

    Raises
    ------
    EvidenceError : the limits with which it was made are malformed.
    """
    overrides = gate_overrides(result)
    aimed = aimed_gap(scenario, overrides) if is_pursued(scenario, overrides) else None
    return Run(
        scenario=scenario.name,
        question=question_of(scenario.spec),
        effort=scenario.plan.effort,
        verdict=str(result.get("verdict")),
        certified_gap=Aim(limit=limit_in_force(scenario, overrides), aimed=aimed),
        file=str(scenario.source or "FILE"),
        metrics=metrics(result),
    )


def entry(run: Run) -> Entry:
    """What a baseline keeps of a run whose verdict is not `failed`."""
    return Entry.model_validate(
        {
            "question": run.question,
            "effort": run.effort,
            "verdict": run.verdict,
            "certified_gap": run.certified_gap,
            "metrics": {metric.name: stored_number(metric.value) for metric in run.metrics},
        }
    )


def stored_number(value: float) -> float:
    """As a baseline keeps it, rounded to ten significant digits."""
    return float(f"{value:.{DIGITS}g}")


def compare(baseline: Baseline, run: Run) -> Comparison:
    """The run beside the stored one of the same scenario.

    A figure fails when it is worse than the stored one by more than its tolerance, and, but for compute
    times, when the stored run has it and this one has not. Without a stored run, or when something else
    was asked then, nothing can be compared and that fails. With another effort than the stored run's,
    compute times are not compared and tolerances for that hold. With another limit of `certified_gap`
    the lower bound, the certified gaps and the verdict are held to the looser one: both runs keep that.
    """
    stored = baseline.scenarios.get(run.scenario)
    if stored is None:
        text = f"{run.scenario} is not in the baseline; {_remedy(baseline, run)}"
        return Comparison(scenario=run.scenario, faults=(text,))
    if stored.question != run.question:
        text = f"{run.scenario}: the stored run answers another question: the scenario was changed; "
        return Comparison(scenario=run.scenario, faults=(text + _remedy(baseline, run),))
    same_effort = stored.effort == run.effort
    values = {metric.name: stored_number(metric.value) for metric in run.metrics}
    held = HeldTo.by(stored.certified_gap, run.certified_gap, values)
    faults, notes = _verdicts(stored, run, held, same_effort=same_effort)
    if not same_effort:
        notes.append(
            f"this run's effort is {run.effort}, the stored one's {stored.effort}: compute times are not "
            "compared, and tolerances are wider"
        )
    other_limit = remark(stored.certified_gap, run.certified_gap)
    if other_limit is not None:
        notes.append(other_limit)
    return Comparison(
        scenario=run.scenario,
        faults=tuple(faults),
        notes=tuple(notes),
        figures=tuple(_figures(baseline, stored, run, held, same_effort=same_effort)),
    )


def compare_folder(baseline: Baseline, folder: Path) -> Comparison:
    """The result in a finished folder beside the stored run; what it states is taken for true.

    Raises
    ------
    EvidenceError : result.json is missing or malformed.
    """
    result = evidence.read_result(folder)
    try:
        scenario = load_scenario(folder / evidence.SCENARIO)
    except (ScenarioError, PluginError) as error:
        return Comparison(scenario=str(result.get("scenario")), faults=(f"what was asked: {error}",))
    # The file that was run is not known, and its copy is evidence.
    return compare(baseline, replace(run_of(scenario, result), file="FILE"))


def _remedy(baseline: Baseline, run: Run) -> str:
    return f"{remedy(baseline.file, run.file)} stores a run"


def _verdicts(stored: Entry, run: Run, held: HeldTo, *, same_effort: bool) -> tuple[list[str], list[str]]:
    """What is wrong with the verdict, and what is only worth telling."""
    now, was = _RANK.get(run.verdict, 0), _RANK[stored.verdict]
    text = f"the verdict is {run.verdict}, was {stored.verdict}"
    if now < was and (now == 0 or (same_effort and not _by_limit(stored, run, held))):
        return [text], []
    return [], [text] if now != was else []


def _by_limit(stored: Entry, run: Run, held: HeldTo) -> bool:
    """Whether the verdict is only another because this run's limit is tighter."""
    return run.certified_gap.limit < stored.certified_gap.limit and held.is_certified


def _figures(
    baseline: Baseline, stored: Entry, run: Run, held: HeldTo, *, same_effort: bool
) -> Iterator[Figure]:
    now = {metric.name: metric for metric in run.metrics}
    for metric in run.metrics:
        yield _figure(baseline, metric, stored.metrics.get(metric.name), held, same_effort=same_effort)
    for name, was in stored.metrics.items():
        if name not in now:
            kind = kind_of(name)
            gone: Movement = "missing" if same_effort or kind != "compute_time" else "not_compared"
            yield Figure(name=name, kind=kind, unit=UNIT_OF_KIND[kind], movement=gone, was=was)


def _figure(
    baseline: Baseline, metric: Metric, was: float | None, held: HeldTo, *, same_effort: bool
) -> Figure:
    value = stored_number(metric.value)
    if was is None:
        movement: Movement = "new"
        allowed = None
    elif (metric.kind == "compute_time" and not same_effort) or not held.compares(metric.name):
        movement, allowed = "not_compared", None
    else:
        distance = spread(baseline.tolerances, metric, same_effort=same_effort).around(was)
        sign = 1.0 if metric.better == "smaller" else -1.0
        allowed = was + sign * distance
        at_limit = held.worst(metric.name)
        if at_limit is not None:
            allowed = sign * max(sign * allowed, sign * stored_number(at_limit))
        if sign * (value - allowed) > 0.0:
            movement = "worse"
        else:
            movement = "better" if sign * (value - (was - sign * distance)) < 0.0 else "same"
    return Figure(
        name=metric.name,
        kind=metric.kind,
        unit=metric.unit,
        movement=movement,
        value=value,
        was=was,
        allowed=allowed,
    )
