"""Linked interactive views of one result."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

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
) -> dict[str, Any]:
    """What the template's section of linked views asks for."""
    return {"explorer": None, "explorer_missing": ""}
