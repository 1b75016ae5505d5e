"""The same scenario gives the same result again, compute times aside."""

import json
import subprocess
import sys

import pytest
import yaml
from gallery_runs import question, verified

from verify.evidence import read_result
from verify.reproducible import COMPUTE_TIMES, reproducible

NAMES = ("single_wall", "corridor")  # of a point robot, of four wheels


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
def again(tmp_path_factory):
    """Both once more, at once in processes of their own, with one between them that cannot be planned."""
    place = tmp_path_factory.mktemp("again")
    for name in NAMES:
        (place / f"{name}.yaml").write_text(question(name))
    shut = yaml.safe_load(question(NAMES[0])) | {"name": "shut"}
    shut["world"]["obstacles"] = [{"vertices": [[3, 0], [3, 40]]}]  # from one wall to the other
    (place / "shut.yaml").write_text(yaml.safe_dump(shut))
    files = [str(place / f"{name}.yaml") for name in (NAMES[0], "shut", NAMES[1])]
    command = [sys.executable, "-m", "verify", *files, "--out", str(place / "out"), "--jobs", "2"]
    return subprocess.run(command, capture_output=True, text=True, check=False), place / "out"


@pytest.fixture(params=NAMES)
def twice(request, again, tmp_path_factory):
    return verified(request.param, tmp_path_factory), again[1] / request.param


def test_side_by_side_the_worst_exit_code_wins_and_lines_come_in_the_order_of_the_files(again):
    done, out = again
    assert done.returncode == 2  # there is no path in one of them, the others ran
    assert [line.partition(":")[0] for line in done.stdout.splitlines()] == list(NAMES)
    assert "shut.yaml" in done.stderr
    assert "no path" in done.stderr
    assert sorted(path.name for path in out.iterdir()) == sorted(["index.html", *NAMES])


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
