"""What the page shows of the simulated run: tracking, wheels, emergency stops, limits, how it is wired."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Protocol

from verify.report import story
from verify.report.diagram_drawing import draw_diagram
from verify.report.diagram_layout import Diagram
from verify.report.evidence import REPLAY, SINGLE_TRACK, STOPS, Evidence
from verify.report.figures_limits import draw_limits
from verify.report.figures_run import draw_run
from verify.report.figures_stops import StopsData, draw_stop_figures, draw_stops_map
from verify.report.figures_tracking import TrackingData, draw_tracking
from verify.report.numbers import number_in, seconds, with_unit
from verify.report.section import Section
from verify.report.stops_zone import ClaimedZones, claimed_zones, draw_stop_in_zone
from verify.report.story_limits import (
    case_rows,
    margin,
    margin_sentences,
    robustness_sentence,
    shown_columns,
    why_no_margin,
)
from verify.report.story_stops import StopStory, stop_story
from verify.report.text import plain
from vnav_drake.zones.convex_zone import ConvexZone

if TYPE_CHECKING:
    from vnav_drake.scenario import Scenario

Result = Mapping[str, Any]

AT_PLAN = (
    "None of these is a safe speed: braking zone and emergency stops are examined at the planned speed only, "
    "and anything faster may break the promise to stop in time."
)


class Wired(Diagram, Protocol):
    """A Drake diagram that also tells its Graphviz source."""

    def GetGraphvizString(self, max_depth: int | None = None) -> str: ...  # noqa: N802


def simulation_sections(
    scenario: Scenario, result: Result, evidence: Evidence, plan: str, zone: ConvexZone | None = None
) -> dict[str, Any]:
    """What the template's section on the simulation asks for; `zone`: what stops claim, None for a disc."""
    claims = _claims(scenario, evidence, zone)
    told = stop_story(
        result,
        scenario.problem,
        evidence.stops,
        evidence.simulation,
        asked=scenario.simulation.stops > 0,
        claims=claims,
    )
    cases = case_rows(result)
    return {
        "tracking": _tracking(scenario, evidence, plan),
        "run_pictures": _run(scenario, evidence),
        "wheels_drawn": evidence.simulation is not None and bool(evidence.simulation.of_wheels("load")),
        "stops": told,
        **_stops(scenario, evidence, told),
        "stops_zone": _stop_zone(scenario, evidence, told, claims),
        "limits": _limits(scenario, result),
        "limits_told": [*margin_sentences(result), *([] if margin(result) is None else [AT_PLAN])],
        "cases": cases,
        "case_columns": shown_columns(cases),
        "cases_told": robustness_sentence(cases),
        "models": _models(result),
        "replay": REPLAY if evidence.has_replay else "",
        "replay_missing": "" if evidence.has_replay else _no_replay(result, evidence),
    }


def _claims(scenario: Scenario, evidence: Evidence, zone: ConvexZone | None) -> ClaimedZones | None:
    if zone is None or evidence.stops is None or evidence.simulation is None:
        return None
    return claimed_zones(scenario.problem, zone, evidence.stops, evidence.simulation)


def _stop_zone(
    scenario: Scenario, evidence: Evidence, told: StopStory, claims: ClaimedZones | None
) -> Section:
    if claims is None or evidence.stops is None or told.missing:
        return Section(pictures=())
    return Section(pictures=draw_stop_in_zone(scenario.problem, evidence.stops, claims))


def _tracking(scenario: Scenario, evidence: Evidence, plan: str) -> Section:
    if evidence.executed is None or evidence.simulation is None:
        reason = evidence.reason("trajectory.csv", "simulation.csv")
        return Section(pictures=(), missing=f"No simulated run to draw: {reason}.")
    data = TrackingData(
        world=scenario.problem.world, plan=evidence.executed, method=plan, run=evidence.simulation
    )
    return Section(pictures=draw_tracking(data))


def _run(scenario: Scenario, evidence: Evidence) -> Section:
    if evidence.simulation is None:
        return Section(pictures=())
    picture = draw_run(evidence.simulation, scenario.problem.robot.max_steering)
    if picture is None:
        return Section(pictures=(), missing="What the wheels did was not recorded.")
    return Section(pictures=[picture])


def _stops(scenario: Scenario, evidence: Evidence, told: StopStory) -> dict[str, Section]:
    none = Section(pictures=())
    if told.missing:
        return {"stops_map": none, "stops_figures": none}
    if evidence.stops is None:
        missing = Section(pictures=(), missing=f"No picture of the stops: {evidence.reason(STOPS)}.")
        return {"stops_map": missing, "stops_figures": none}
    data = StopsData(
        problem=scenario.problem,
        stops=evidence.stops,
        run=evidence.simulation,
        executed=evidence.executed,
        failed=told.failed,
    )
    return {
        "stops_map": Section(pictures=[draw_stops_map(data)]),
        "stops_figures": Section(pictures=draw_stop_figures(data)),
    }


def _limits(scenario: Scenario, result: Result) -> Section:
    found = margin(result)
    if found is not None:
        return Section(pictures=[draw_limits(found)])
    why = why_no_margin(result, asked=scenario.simulation.studies)
    return Section(pictures=(), missing=f"The limits were not looked for{why}.")


def _models(result: Result) -> list[str]:
    """What the quick model made of it, where both models were asked for."""
    figures = story.mapping(story.mapping(result, "simulation"), "single_track")
    if not figures:
        return []
    time, error = (number_in(figures, key) for key in ("travel_time", "max_lateral_error"))
    lost = story.unfinished(result, "single_track")
    parts = [lost] if lost else [] if time is None else [f"took {seconds(time)}"]
    parts += [] if error is None else [f"stayed within {with_unit(error, 'm')} of the path"]
    return [f"The single-track pre-screen {' and '.join(parts)} ({SINGLE_TRACK})."] if parts else []


def _no_replay(result: Result, evidence: Evidence) -> str:
    if evidence.simulation is None:
        return "No replay: there is no simulated run."
    for item in story.entries(result, "missing"):
        if item.get("stage") == "replay":
            return f"No replay: {plain(story.words(item.get('reason'))) or 'no reason was recorded'}."
    return f"No replay: {REPLAY} is not beside this report."


def wiring(diagram: Wired | None) -> dict[str, Any]:
    """The block diagram of what was simulated, and its Graphviz source."""
    if diagram is None:
        return {"wired": Section(pictures=(), missing="The diagram was not at hand."), "graphviz": ""}
    source = graphviz_source(diagram.GetGraphvizString(max_depth=1))
    return {"wired": Section(pictures=[draw_diagram(diagram)]), "graphviz": source}


def graphviz_source(text: str) -> str:
    """The source with systems numbered from 1 and wires sorted, so that the same diagram gives the same text.

    Drake counts systems as long as the process lives, and lists wires by their place in memory.
    """
    known: dict[str, int] = {}

    def number(match: re.Match[str]) -> str:
        return f"{match[1]}{known.setdefault(match[2], len(known) + 1)}"

    ids = r"((?:^|-> )s|^digraph _|^subgraph cluster)(\d+)(?!\w*=)"
    lines = re.sub(ids, number, text, flags=re.MULTILINE).split("\n")
    wires = sorted(line for line in lines if " -> " in line)
    return "\n".join(wires.pop(0) if " -> " in line else line for line in lines)
