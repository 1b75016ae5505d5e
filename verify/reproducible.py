"""What two runs of one scenario with the same versions share: everything but how long it took.

Budgets are counted work and no draw is random, so the same file gives the same figures again, on however many
processors. Times of computing differ, and with them the report, which shows them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from verify.evidence import REPORT

# Keys of result.json, at any depth, that tell how long something took.
COMPUTE_TIMES = frozenset(
    {"compute_time", "compute_times", "refine_time", "solver_time", "seconds", "real_time_factor"}
)


def reproducible(result: Mapping[str, Any]) -> dict[str, Any]:
    """The content of a result.json without times of computing and without the report's checksum."""
    shared: dict[str, Any] = _without_times(result)
    if isinstance(shared.get("files"), dict):
        shared["files"].pop(REPORT, None)
    return shared


def _without_times(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _without_times(item) for key, item in value.items() if key not in COMPUTE_TIMES}
    if isinstance(value, list):
        return [_without_times(item) for item in value]
    return value
