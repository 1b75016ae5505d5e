"""The gallery beside the committed baseline: no travel time, gap or margin has become worse."""

import pytest
from gallery_runs import NAMES, ROOT, verified

from verify.baseline import compare, run_of
from verify.baseline_file import read_baseline
from verify.cli import run
from verify.evidence import read_result
from vnav_drake.scenario import load_scenario

BASELINE = ROOT / "reports" / "baseline.json"


@pytest.fixture(scope="module")
def baseline():
    return read_baseline(BASELINE)


def test_it_holds_every_scenario_and_no_other(baseline):
    assert sorted(baseline.scenarios) == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_it_is_of_the_effort_that_the_file_asks_for(baseline, name):
    assert baseline.scenarios[name].effort == load_scenario(ROOT / "scenarios" / f"{name}.yaml").plan.effort


@pytest.mark.parametrize("name", NAMES)
def test_nothing_has_become_worse(baseline, name, tmp_path_factory):
    # Run with fewer emergency stops, so the file's question stands for what was asked: of the stops this
    # sees a sample, of everything else what the command sees.
    asked = load_scenario(ROOT / "scenarios" / f"{name}.yaml")
    found = compare(baseline, run_of(asked, read_result(verified(name, tmp_path_factory))))
    assert not found.failures, "\n".join(found.failures)


def test_as_written_by_the_command(tmp_path, capsys):
    file = str(ROOT / "scenarios" / "single_wall.yaml")
    assert run([file, "--out", str(tmp_path), "--baseline", str(BASELINE)]) == 0, capsys.readouterr().out
