"""What a stage that cannot finish means for the run: bad input, or something missing."""

from __future__ import annotations

from pathlib import Path

import pytest

from verify.interruption import Interruption
from verify.stages import Stages
from vnav_drake.problem import NoClassError, NoPathError, PlanningError
from vnav_drake.scenario import ScenarioError, load_scenario

SCENARIO = Path(__file__).resolve().parents[1] / "scenarios" / "warehouse_gaps.yaml"


def _stages() -> Stages:
    return Stages(scenario=load_scenario(SCENARIO), say=lambda _text: None, interruption=Interruption())


def _raising(error: Exception):
    def work():
        raise error

    return work


@pytest.mark.parametrize(
    ("error", "key"), [(NoPathError("no path"), "goal.position"), (NoClassError("no class"), "plan.through")]
)
def test_what_the_user_asked_for_in_vain_is_bad_input_at_its_key(error, key):
    with pytest.raises(ScenarioError, match=key):
        _stages().run("speed_graph", _raising(error))


def test_a_method_without_an_answer_is_noted_and_the_run_goes_on():
    stages = _stages()
    assert stages.run("speed_graph", _raising(PlanningError("gave up"))) is None
    assert [(item.stage, item.reason) for item in stages.done.missing] == [("speed_graph", "gave up")]
