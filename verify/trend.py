"""Key figures for charts over time, in the custom format of github-action-benchmark.

That is a list of entries with `name`, `unit`, `value` and `extra`, in one file for the tool
`customSmallerIsBetter` and another for `customBiggerIsBetter`; a chart is drawn for each name. Values are as
measured: some are zero or rounding only, so alarms belong to baselines, which have tolerances for that.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from verify.atomic import replace_file
from verify.metrics import TOTAL, Better, Metric
from verify.suite import Suite

FILES: dict[Better, str] = {"smaller": "smaller-is-better.json", "greater": "bigger-is-better.json"}


def write_trend(folder: Path, suites: Sequence[Suite]) -> None:
    """Both files, each whole or not at all; compute times only in all.

    Runs with the verdict `failed` are left out: their times are of motions that break a rule, and would
    look like progress.
    """
    for better, name in FILES.items():
        entries = [entry for suite in suites for entry in _entries(suite, better)]
        text = json.dumps(entries, indent=2, allow_nan=False) + "\n"
        replace_file(folder / name, partial(Path.write_text, data=text, encoding="utf-8"))


def _entries(suite: Suite, better: Better) -> Iterator[dict[str, Any]]:
    run = suite.run
    if run is None or run.verdict == "failed":
        return
    made = f"vnav-drake {suite.version}, " if suite.version else ""
    for metric in run.metrics:
        if metric.better == better and _charted(metric):
            yield {
                "name": f"{run.scenario}: {metric.name}",
                "unit": metric.unit or "1",
                "value": metric.value,
                "extra": f"{made}verdict {run.verdict}, effort {run.effort}",
            }


def _charted(metric: Metric) -> bool:
    """Compute times of single stages would be most of the charts."""
    return metric.kind != "compute_time" or metric.name == TOTAL
