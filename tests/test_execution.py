"""What the vehicle executes is chosen by signs of its own run, and held back where it cannot follow."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from judged import scenario
from test_architecture import IMPORTS

from verify import execution
from verify.execution import SHARES, execute, follows, held_back
from vnav_drake.plan import Path, Plan, Trajectory
from vnav_drake.robot import Robot


def straight(length: float = 20.0, speed: float = 1.0) -> Trajectory:
    """Even speed along the x axis, a row every 10 mm."""
    x = np.linspace(0.0, length, round(100 * length) + 1)
    nil = np.zeros(len(x))
    return Trajectory(x / speed, x, nil, nil, nil + speed, nil, nil, nil)


def run_along(
    trajectory: Trajectory, *, beside: float = 0.0, late: float = 0.0, **details: bool
) -> SimpleNamespace:
    """The recorded run of a vehicle that keeps these errors throughout."""
    told = {"arrived": True, "slid": False, "wheel_lift": False, "fell": False, **details}
    x = np.maximum(trajectory.x - late * trajectory.v, 0.0)
    return SimpleNamespace(t=trajectory.t, x=x, y=trajectory.y + beside, details=told)


def test_a_vehicle_near_its_path_and_nearly_on_time_follows():
    # 20 s: 0.008 of that is 0.16 s, more than the 0.08 s granted to short motions.
    for good in ({}, {"beside": 0.029}, {"beside": -0.029}, {"late": 0.14}):
        assert follows(run_along(straight(), **good), straight()), good
    short = straight(2.0)
    assert follows(run_along(short, late=0.06), short)
    assert not follows(run_along(short, late=0.11), short)


@pytest.mark.parametrize(
    "bad",
    [
        {"beside": 0.031}, {"beside": -0.031}, {"late": 0.18}, {"arrived": False}, {"wheel_lift": True},
        {"pitch_lift": True},
    ],
)  # fmt: skip
def test_a_vehicle_that_strays_lags_lifts_or_never_arrives_does_not_follow(bad):
    assert not follows(run_along(straight(), **bad), straight())


def test_stages_do_not_ask_the_judge():
    asked = {name for name in IMPORTS["verify.execution"] if name.startswith("verify.")}
    assert not {name for name in asked if name.startswith("verify.judge")}


def test_a_share_of_every_limit_is_held_back_but_the_brakes_are_as_they_are():
    robot = Robot(radius=0.4)
    careful = held_back(robot, 0.8)
    assert careful.friction_acceleration == pytest.approx(0.8 * robot.friction_acceleration)
    assert careful.tip_acceleration == pytest.approx(0.8 * robot.tip_acceleration)  # g w / (2 h), h / 0.8
    assert careful.max_steering == pytest.approx(0.8 * robot.max_steering)
    assert careful.max_acceleration == pytest.approx(0.8 * robot.max_acceleration)
    assert careful.max_braking == robot.max_braking


@pytest.fixture
def astray(monkeypatch) -> tuple[Plan, list[float]]:
    """A plan whose every run strays, and the friction with which it was planned again."""
    frictions: list[float] = []
    path = Path.polyline([[5.0, 2.0], [35.0, 2.0]])
    plan = Plan(method="refined", model="full", trajectory=straight(), path=path, details={"seeds": []})

    def plan_again(problem: Any, *_: object, **__: object) -> Plan:
        assert problem.lateral_limit > 0.0
        frictions.append(problem.robot.friction)
        return plan

    monkeypatch.setattr(execution, "plan_full", plan_again)
    monkeypatch.setattr(execution, "simulate", lambda _, motion, **__: run_along(motion, beside=1.0))
    return plan, frictions


def test_where_no_share_helps_the_first_run_stands(astray):
    plan, frictions = astray
    assert execute(scenario(), plan, "single_track").plan is plan
    assert frictions == pytest.approx([share * 0.6 for share in SHARES])


def test_shares_that_leave_nothing_to_turn_with_are_not_planned_with(astray):
    # mu g = 1.0791 m/s^2: times 0.975: 1.052, times 0.95: 1.025, times 0.9: 0.971 < a_b = 1: none is left.
    plan, frictions = astray
    asked = scenario(robot={"friction": 0.11}, braking={"friction_reserve": True})
    assert execute(asked, plan, "single_track").plan is plan
    assert frictions == pytest.approx([0.975 * 0.11, 0.95 * 0.11])


def test_the_share_that_helps_is_told(astray, monkeypatch):
    plan, _ = astray
    runs = iter([1.0, 1.0, 0.0])
    monkeypatch.setattr(execution, "simulate", lambda _, motion, **__: run_along(motion, beside=next(runs)))
    asked = scenario(plan={"effort": "quick"})
    found = execute(asked, replace(plan, details={"seeds": ["one"]}), "single_track")
    assert found.plan.details["limit_share"] == SHARES[1]
    assert found.plan.details["full_limit_time"] == pytest.approx(20.0)
    assert found.plan.details["seeds"] == ["one"]


def test_a_start_from_rest_with_rows_far_apart_is_not_late():
    # From rest at 1 m/s^2 with a row every 0.5 s: the first 0.35 s are nearest to the first row, but on time.
    t = np.arange(0.0, 4.5, 0.5)
    nil, one = np.zeros(len(t)), np.ones(len(t))
    plan = Trajectory(t, 0.5 * t * t, nil, nil, t, one, nil, nil)
    often = np.linspace(0.0, 4.0, 401)
    nil, one = np.zeros(len(often)), np.ones(len(often))
    assert follows(run_along(Trajectory(often, 0.5 * often**2, nil, nil, often, one, nil, nil)), plan)
