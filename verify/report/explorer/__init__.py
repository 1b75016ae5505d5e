"""Linked interactive views of one result: map, speed, margins and friction circle under one cursor."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from verify.report.bound import BoundMesh
from verify.report.evidence import REPLAY, Evidence
from verify.report.explorer.embed import Explorer, explorer
from verify.report.html import LIBRARY
from verify.report.zone_along import ZoneAlong
from vnav_drake.problem import Problem

if TYPE_CHECKING:
    from verify.report.page import ReportExtras

NO_REASONS: Mapping[str, str] = MappingProxyType({})
SCRIPTS = (LIBRARY, "explorer_data.js", "explorer_plots.js", "explorer_margins.js", "explorer.js")


def explorer_sections(
    problem: Problem,
    result: Mapping[str, Any],
    evidence: Evidence,
    extras: ReportExtras,
    along: ZoneAlong | None,
    certificate: tuple[BoundMesh | None, str],
    why: Mapping[str, str] = NO_REASONS,
) -> dict[str, Any]:
    """What the template's section of linked views asks for.

    Parameters
    ----------
    along : the braking zone along the motion drawn, where it is no disc.
    certificate : its mesh, or None and why there is none.
    why : stages that gave nothing, with their reasons.
    """
    if evidence.executed is None:
        reason = f"No motion to follow: {evidence.reason('trajectory.csv')}."
        return {"explorer": None, "explorer_missing": reason, "explorer_replay": ""}
    return {
        "explorer": explorer(problem, result, evidence, extras, along, certificate, why),
        "explorer_missing": "",
        "explorer_replay": REPLAY if evidence.has_replay else "",
    }


def explorer_scripts(sections: Mapping[str, Any]) -> Sequence[str]:
    """Names of the scripts that `sections` need, in their order."""
    return SCRIPTS if sections["explorer"] is not None else ()


__all__ = ["SCRIPTS", "Explorer", "explorer_scripts", "explorer_sections"]
