"""The judge for use from Python: check one plan without a result folder."""

from __future__ import annotations

from verify.judge.checks import Setting, check_motion
from verify.judge.finding import Check
from verify.judge.motion import COLUMNS, Motion
from vnav_drake.plan import Plan
from vnav_drake.scenario import Scenario


def check(scenario: Scenario, plan: Plan) -> tuple[Check, ...]:
    """Every rule of the scenario, judged in continuous time along the plan's trajectory.

    Nothing but the trajectory's rows and the scenario's numbers is used. A rule that the plan's model
    does not promise has `promised` False.
    """
    motion = Motion(*(getattr(plan.trajectory, name) for name in COLUMNS))
    return check_motion(motion, plan.method, plan.model, Setting.from_spec(scenario.spec))
