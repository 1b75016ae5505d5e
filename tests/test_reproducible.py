"""The same scenario gives the same result again, compute times aside."""

import json

import pytest
from gallery_runs import question, verified

from verify.evidence import read_result
from verify.pipeline import run_scenario
from verify.reproducible import COMPUTE_TIMES, reproducible
from vnav_drake.scenario import parse_scenario

NAME = "single_wall"


def differences(one, other, place=""):
    """Places at which two trees differ."""
    if isinstance(one, dict) and isinstance(other, dict):
        for key in sorted(one.keys() | other.keys()):
            yield from differences(one.get(key), other.get(key), f"{place}/{key}")
    elif isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        for number, (a, b) in enumerate(zip(one, other, strict=True)):
            yield from differences(a, b, f"{place}/{number}")
    elif one != other:
        yield f"{place}: {one!r} and {other!r}"


@pytest.fixture(scope="module")
def twice(tmp_path_factory):
    """A run by the command on all processors, and one from Python on one."""
    first = verified(NAME, tmp_path_factory)
    out = tmp_path_factory.mktemp("again")
    run_scenario(parse_scenario(question(NAME).encode(), f"{NAME}.yaml"), out, workers=1)
    return first, out / NAME


def test_two_runs_give_the_same_result_and_the_same_evidence(twice):
    first, second = map(read_result, twice)
    assert not list(differences(reproducible(first), reproducible(second)))
    assert set(first["files"]) >= {"trajectory.csv", "simulation.csv", "stops.npz", "certificate.npz"}


def test_only_numbers_that_tell_how_long_it_took_are_set_aside(twice):
    first, second = map(read_result, twice)
    aside = [*differences(first, second)]
    assert aside  # else this test says nothing
    told = [place.partition(":")[0].strip("/").split("/") for place in aside]
    assert all(COMPUTE_TIMES & set(place) or place == ["files", "report.html"] for place in told)


def test_what_is_no_time_stays():
    tree = {"plans": {"refined": {"travel_time": 2.0, "compute_time": 1.0, "seeds": [{"seconds": 3.0}]}}}
    tree["files"] = {"report.html": "a", "trajectory.csv": "b"}
    before = json.dumps(tree)
    assert reproducible(tree) == {
        "plans": {"refined": {"travel_time": 2.0, "seeds": [{}]}},
        "files": {"trajectory.csv": "b"},
    }
    assert json.dumps(tree) == before
