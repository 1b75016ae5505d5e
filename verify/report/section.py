"""Pictures under one heading."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from verify.report.svg import Picture


@dataclass(frozen=True, kw_only=True)
class Section:
    """Pictures under one heading, or why there are none."""

    pictures: Sequence[Picture]
    missing: str = ""
