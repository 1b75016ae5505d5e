"""One scenario's run as the outputs for continuous integration tell it."""

from __future__ import annotations

from dataclasses import dataclass

from verify.baseline import Comparison, Run
from verify.cases import Case, cases
from verify.judge import Judgement
from verify.metrics import TOTAL

NO_RUN = "scenario"  # the case of a scenario that has no judgement


@dataclass(frozen=True, kw_only=True)
class Suite:
    """One scenario: its judgement, or why there is none."""

    name: str
    judgement: Judgement | None = None
    error: str = ""
    bad_input: bool = False  # whether `error` is of the input: what has to be mended is the file
    missing: tuple[str, ...] = ()  # stages that could not finish, with the reason
    file: str = ""  # the scenario's, as it was given
    report: str = ""
    run: Run | None = None  # the figures, where there is a judgement
    comparison: Comparison | None = None  # with the baseline, where one was given
    version: str = ""  # of vnav-drake

    @property
    def cases(self) -> tuple[Case, ...]:
        """What went wrong as a whole, then stages, gates and verdict, then the baseline."""
        found: tuple[Case, ...] = ()
        if self.error:
            found = (Case(name=NO_RUN, status="bad_input" if self.bad_input else "error", text=self.error),)
        if self.judgement is not None:
            found += cases(self.judgement, self.missing)
        return found if self.comparison is None else found + self.comparison.cases

    @property
    def passed(self) -> bool:
        """It has cases, and none of them is bad."""
        return bool(self.cases) and not any(case.bad for case in self.cases)

    @property
    def seconds(self) -> float:
        """Compute time [s] of all stages; 0 for what was not run."""
        figures = () if self.run is None else self.run.metrics
        return next((metric.value for metric in figures if metric.name == TOTAL), 0.0)
