"""The scenarios of the gallery whose braking zone depends on the heading, from the file to the verdict."""

import json
import math
from typing import Any

import pytest
from gallery_facts import ZONED, read_motion
from gallery_runs import FEWEST, ROOT, verified

from verify.evidence import read_result
from vnav_drake.scenario import load_scenario

# Exact, derived in the files: 12 m at sqrt(2 a (W - rho) / beta) between the walls; 20 m from rest to rest at
# most at 2.5 m/s and 1 m/s^2. With uniform braking beta = 1.
EXACT = {"corridor_ellipse": 12.0 / math.sqrt(2.0 * 0.6 / 0.5), "corridor_field": 20.0 / 2.5 + 2.5}
UNIFORM = {"corridor_ellipse": 12.0 / math.sqrt(2.0 * 0.6)}


@pytest.fixture(scope="module", params=sorted(ZONED))
def folder(request, tmp_path_factory):
    return verified(request.param, tmp_path_factory)


@pytest.fixture
def result(folder) -> dict[str, Any]:
    return read_result(folder)


def test_it_holds_everywhere(result):
    assert result["verdict"] == ("certified" if result["scenario"] == "corridor_ellipse" else "refined")
    assert {check["status"] for check in result["checks"]} == {"passed"}
    assert not result["missing"]


def test_exact_times_are_reached_and_none_is_beaten(result):
    name, plans = result["scenario"], result["plans"]
    if name in EXACT:
        # slowed by 1e-6 and by what proves the zone free between rows
        assert EXACT[name] <= plans["refined"]["travel_time"] <= EXACT[name] * (1.0 + 1e-5)
        assert result["lower_bound"]["travel_time"] <= EXACT[name]
    if name in UNIFORM:
        assert UNIFORM[name] <= plans["uniform"]["travel_time"] <= UNIFORM[name] * (1.0 + 1e-5)
    if "lower_bound" in result:
        assert result["lower_bound"]["travel_time"] <= plans["refined"]["travel_time"]


def test_the_zone_is_faster_than_uniform_braking(result):
    assert result["plans"]["refined"]["travel_time"] < result["plans"]["uniform"]["travel_time"]


def test_stops_stay_in_the_zone_claimed(result):
    found, promise = result["simulation"]["emergency_stops"], result["zone"]["promise"]
    assert found["tried"] == 2 * FEWEST
    assert (found["bad"], found["collisions"], found["left_zone"]) == (0, 0, 0)
    assert (promise["held_leaves"], promise["held_collides"]) == (0, 0)
    assert promise["worst_excess"] <= 0.0


def test_fields_cost_little_and_are_kept(result, folder):
    if result["scenario"] != "warehouse_field":
        assert not (folder / "fields.json").exists()
        return
    told = result["zone"]["fields"]
    assert 1 < told["count"] <= 4
    assert 0.0 <= told["cost"] <= 0.04
    cases = json.loads((folder / "fields.json").read_text())["cases"]
    assert read_motion(folder / "trajectory.csv").v.max() <= cases[-1]["max_speed"]


def test_together_they_stop_a_thousand_times():
    files = [ROOT / "scenarios" / f"{name}.yaml" for name in ZONED]
    assert 2 * sum(load_scenario(file).simulation.stops for file in files) >= 1000  # two at each instant
