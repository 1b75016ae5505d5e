"""What the stages could not do, told in the sections where their pictures would be."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from verify.report.story import Result, entries, words
from verify.report.text import plain
from vnav_drake.scenario import Scenario

# Where in the page each stage's work would stand, by the section's id, and what the stage is called there.
# Those of None say it themselves, with what the judge adds: `story_bound`, `story_stops`, `simulation`.
_PLACES: Mapping[str, tuple[tuple[str, ...], str]] = MappingProxyType(
    {
        "voronoi": (("map",), "The Voronoi diagram"),
        "speed_graph": (("classes",), "The speed graph"),
        "vc_method": (("vc-method",), "The vc-method"),
        "voronoi_route": (("times",), "The route along Voronoi arcs"),
        "seeds": (("seeds",), "Further seeds"),
        "seed_comparison": (("seeds",), "The comparison of the seeds"),
        "uniform": (("zone", "times"), "The motion with uniform braking"),
        "collocation": (("times", "mesh"), "The collocation of the variational model"),
        "refined": (("times", "mesh"), "The collocation of the full robot"),
        "fields": (("zone", "times"), "The field set"),
        "dwa": (("times",), "The dynamic window"),
        "lower_bound": ((), "The lower bound"),
        "simulation": (("simulation",), "The simulation"),
        "single_track": (("simulation",), "The single-track pre-screen"),
        "emergency_stops": (("stops",), "The emergency stops"),
        "studies": (("limits",), "The studies"),
        "replay": ((), "The replay"),
    }
)
ELSEWHERE = "times"  # of a stage that has no place here
SECTIONS = frozenset(place for places, _ in _PLACES.values() for place in places)


def reasons(scenario: Scenario, result: Result) -> Mapping[str, str]:
    """Why stages gave nothing, by the stage's name: their own reasons, or that nobody asked for them."""
    found = {
        stage: f"{stage} is not among plan.methods"
        for stage in ("speed_graph", "vc_method", "voronoi_route", "dwa")
        if stage not in scenario.plan.methods
    }
    if scenario.simulation.stops == 0:
        found["emergency_stops"] = "none are asked for (simulation.stops is 0)"
    return found | {words(item.get("stage")): _reason(item) for item in entries(result, "missing")}


def _reason(item: Mapping[str, Any]) -> str:
    return plain(words(item.get("reason"))).strip().rstrip(".") or "no reason was recorded"


def by_section(result: Result) -> Mapping[str, list[str]]:
    """For every section's id the sentences about stages whose work would stand there; empty lists else."""
    found: dict[str, list[str]] = {place: [] for place in SECTIONS}
    for item in entries(result, "missing"):
        stage = words(item.get("stage"))
        named = (plain(stage).replace("_", " ") or "A stage without a name").strip()
        places, name = _PLACES.get(stage, ((ELSEWHERE,), named[:1].upper() + named[1:]))
        reason = _reason(item)
        did = "was" if reason.startswith("not run") else "could not finish:"
        for place in places:
            found[place].append(f"{name} {did} {reason}.")
    return found
