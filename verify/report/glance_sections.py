"""The page at a glance: the answer, what fails, the bracket on a time axis, key figures; times in tables."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from verify.report import story
from verify.report.answer import answer
from verify.report.answer_details import details, others
from verify.report.evidence import Evidence
from verify.report.figures_time import BracketData, BracketRow, draw_bracket
from verify.report.key_figures import key_figures
from verify.report.numbers import number_in
from verify.report.palette import METHODS, method
from verify.report.section import Section
from verify.report.story_bound import full_bound, upper
from verify.report.story_classes import analytic_row
from verify.report.story_stuck import StuckRun
from verify.report.story_times import breaks, goes_astray, time_rows, window_sentence
from verify.report.wording import VERDICTS
from vnav_drake.scenario import Scenario


def glance_sections(
    scenario: Scenario,
    result: Mapping[str, Any],
    evidence: Evidence,
    stuck: tuple[StuckRun, ...],
    lost: StuckRun | None,
) -> dict[str, Any]:
    """What the answer, the key figures and the travel times of the template ask for.

    `stuck`: all runs that gave up; `lost`: the simulated one where it did.
    """
    rest = any(end.speed != "safe" for end in (scenario.problem.start, scenario.problem.goal))
    gates, checks = story.gate_rows(result), story.check_rows(result)
    verdict, reference = story.verdict(result), story.reference_plan(result)
    return {
        "verdict": verdict,
        "verdict_meaning": VERDICTS.get(verdict, ("", ""))[1],
        "headline": story.headline(result),
        "verdict_reasons": story.reasons(result),
        "standing": story.standing(result),
        "answer": answer(result, through=scenario.plan.through, lost="" if lost is None else lost.sentence),
        "details": [*details(result, rest_ends=rest), *others(result, rest_ends=rest)],
        "gate_summary": story.gate_summary(result),
        "gates": gates,
        "checks": checks,
        "failing": [row for row in gates if row.status == story.FAILED],
        "failing_checks": [row for row in checks if row.status == story.FAILED],
        "marks": story.MARKS,
        "key_figures": key_figures(result, evidence),
        "bracket": _bracket(result),
        "times": [*time_rows(result), *(run.row for run in stuck)],
        "reference": method(reference).label if reference else "",
        "full_bound": number_in(result, "plans", "refined", "travel_time") is not None,
        "analytic": analytic_row(result),
        "looks": METHODS,
        "stuck": [run.sentence for run in stuck],
        "window": window_sentence(result),
        "executed": story.is_executed(result),
        "hollow": any(breaks(result, name) for name in story.travel_times(result)),
        "through": scenario.plan.through,
    }


def _bracket(result: Mapping[str, Any]) -> Section:
    times = story.travel_times(result)
    if not times:
        return Section(pictures=(), missing="No stage produced a travel time.")
    data = BracketData(
        rows=[_bracket_row(result, name, time) for name, time in times.items()],
        reference=story.reference_plan(result),
        executed=story.executed_plan(result) if story.is_executed(result) else "",
        upper=upper(result)[0],
        full_bound=full_bound(result) if "refined" in times else None,
    )
    return Section(pictures=[draw_bracket(data)])


def _bracket_row(result: Mapping[str, Any], name: str, time: float) -> BracketRow:
    return BracketRow(
        method=name, travel_time=time, breaks=breaks(result, name), astray=goes_astray(result, name)
    )
