"""Files for trend charts, in the custom format of github-action-benchmark."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from metric_case import run, suite

from verify.metrics import metrics
from verify.suite import Suite
from verify.trend import FILES, write_trend


def charts(folder: Path, *suites: Suite) -> dict[str, list[dict[str, Any]]]:
    write_trend(folder, suites)
    return {better: json.loads((folder / name).read_text()) for better, name in FILES.items()}


def test_each_figure_stands_in_the_file_of_its_direction(tmp_path: Path):
    found = charts(tmp_path, suite())
    names = {better: {entry["name"] for entry in entries} for better, entries in found.items()}
    assert names["greater"] == {
        f"yard: {name}"
        for name in ("lower_bound", "margin.braking", "margin.clearance", "margin.stops_clearance")
    }
    assert "yard: travel_time.refined" in names["smaller"]
    assert "yard: gap.certified" in names["smaller"]
    assert not names["smaller"] & names["greater"]


def test_entries_have_what_the_format_asks_for(tmp_path: Path):
    for entries in charts(tmp_path, suite()).values():
        for entry in entries:
            assert set(entry) == {"name", "unit", "value", "extra"}
            assert entry["unit"]  # an axis without one is labelled "undefined"
            assert math.isfinite(entry["value"])
            assert entry["extra"] == "vnav-drake 0.1.0, verdict refined, effort full"


def test_values_are_as_measured(tmp_path: Path):
    found = {entry["name"]: entry for entries in charts(tmp_path, suite()).values() for entry in entries}
    expected = {f"yard: {metric.name}": metric.value for metric in run().metrics}
    assert {name: entry["value"] for name, entry in found.items()}.items() <= expected.items()


def test_of_compute_times_only_the_sum_is_charted(tmp_path: Path):
    names = [
        entry["name"] for entry in charts(tmp_path, suite())["smaller"] if "compute_time" in entry["name"]
    ]
    assert names == ["yard: compute_time.total"]


def test_names_differ_between_scenarios(tmp_path: Path):
    found = charts(tmp_path, suite(), suite(name="field", run=run(scenario="field")))["smaller"]
    assert len({entry["name"] for entry in found}) == len(found)
    assert {entry["name"].partition(":")[0] for entry in found} == {"yard", "field"}


def test_runs_that_failed_or_did_not_finish_are_not_charted(tmp_path: Path):
    failed = suite(run=run(verdict="failed", metrics=metrics({"plans": {"refined": {"travel_time": 1.0}}})))
    assert charts(tmp_path, failed, Suite(name="bad", error="no")) == {"smaller": [], "greater": []}


def test_files_are_replaced_whole(tmp_path: Path):
    charts(tmp_path, suite())
    charts(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(FILES.values())
    assert (tmp_path / FILES["smaller"]).read_text() == "[]\n"
