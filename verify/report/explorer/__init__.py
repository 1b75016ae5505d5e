"""Linked interactive views of one result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from verify.report.bound import BoundMesh
from verify.report.evidence import Evidence
from verify.report.zone_along import ZoneAlong
from vnav_drake.problem import Problem

if TYPE_CHECKING:
    from verify.report.page import ReportExtras


def explorer_sections(
    problem: Problem,
    result: Mapping[str, Any],
    evidence: Evidence,
    extras: ReportExtras,
    along: ZoneAlong | None,
    certificate: tuple[BoundMesh | None, str],
) -> dict[str, Any]:
    """What the template's section of linked views asks for."""
    return {"explorer": None, "explorer_missing": ""}


def explorer_scripts(sections: Mapping[str, Any]) -> Sequence[str]:
    """Names of the scripts that `sections` need, in their order."""
    return ()
