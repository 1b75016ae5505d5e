"""Robots at the ends of what a scenario may hold: each drives on four wheels, or is refused with its rule."""

import math

import numpy as np
import pytest
import yaml
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from judged import BASE

from systems import simulate
from vnav_drake.plan import Trajectory
from vnav_drake.robot import Robot
from vnav_drake.scenario import Scenario, ScenarioError, parse_scenario


def asked(**robot: float) -> Scenario:
    """A scenario with this robot in a hall that is large enough for it."""
    body = {**BASE["robot"], **robot}
    reach = max(0.5, 0.51 * math.hypot(body["wheelbase"], body["track"]))
    body["radius"] = robot.get("radius", reach)
    width = 10.0 * reach
    hall = [[0, 0], [4 * width, 0], [4 * width, width], [0, width]]
    ends = {
        name: {"position": [x * width, 0.5 * width], "speed": "rest"}
        for name, x in (("start", 1), ("goal", 3))
    }
    question = {
        **BASE,
        "robot": body,
        "world": {"boundary": hall},
        **ends,
        "simulation": {"model": "four_wheel", "stops": 1},
    }
    return parse_scenario(yaml.safe_dump(question).encode(), "robot.yaml")


def to_and_fro(robot: Robot) -> Trajectory:
    """Straight ahead at half of what drive, brakes and friction allow, and to rest again as fast.

    Times scale with the root of lengths: a large robot rocks slowly.
    """
    seconds = 0.2 * math.sqrt(max(robot.wheelbase, robot.track, 0.5) / 0.5)
    push = 0.5 * min(robot.max_acceleration, robot.max_braking, robot.friction_acceleration)
    speed = min(push * seconds, 0.5 * robot.max_speed)
    push = speed / seconds
    t = np.array([0.0, seconds, 2.0 * seconds])
    x = 0.5 * push * seconds**2 * np.array([0.0, 1.0, 2.0])
    nil = np.zeros(3)
    return Trajectory(
        t, x, nil, nil, np.array([0.0, speed, 0.0]), push * np.array([1.0, -1.0, -1.0]), nil, nil
    )


def drives(scenario: Scenario) -> None:
    """The run of the scenario's robot ends, on its wheels and straight ahead, with numbers throughout."""
    motion = to_and_fro(scenario.problem.robot)
    run = simulate(scenario.problem.robot, motion, model=scenario.simulation.model)
    assert all(np.isfinite(column).all() for column in run.columns.values())
    assert not run.details["fell"]
    # straight ahead, as nothing turns it, within what wheels at rest may creep: 1 mm/s for 3 s
    assert np.abs(run.y).max() <= 3e-3 + 0.01 * motion.length


@pytest.mark.parametrize(
    "robot",
    [
        {"wheelbase": 1e-3, "track": 1e-3, "com_height": 1e-4, "max_speed": 0.1},
        {"wheelbase": 100.0, "track": 100.0, "com_height": 10.0},
        {"track": 0.05},  # its wheels, 0.16 m wide in the model, would overlap
        {"wheelbase": 0.05, "com_height": 0.01},
        {"mass": 1e-3},
        {"mass": 1e6},
        {"com_height": 0.0},  # below the wheels' centres
        {"com_height": 2.0, "max_braking": 0.5, "max_acceleration": 0.5},
        {"friction": 100.0},
        {"friction": 0.001, "max_braking": 0.009, "max_acceleration": 0.009},
        {"friction": 100.0, "max_braking": 18.0, "max_acceleration": 20.0},
        {"max_steering": 1e-6, "max_steering_rate": 1e-6},
    ],
    ids=str,
)  # fmt: skip
def test_a_robot_at_the_end_of_a_range_drives_on_four_wheels(robot):
    drives(asked(**robot))


@pytest.mark.parametrize(
    ("robot", "rule"),
    [
        (
            {"com_height": 1000.0, "max_braking": 1e-3, "max_acceleration": 1e-3},
            r"com_height = 1000.0: too tall",
        ),
        ({"com_height": 1.0, "track": 0.1}, r"com_height = 1.0: too tall .* 0.5 \[m\]"),  # 25 * 0.1^2 / 0.5
        ({"friction": 1e-6}, r"max_braking at most 9.81e-06 \[m/s\^2\]"),
        ({"max_speed": 1e-5}, r"goal.position = .* expected at most 10000 s"),
        ({"radius": 0.0, "wheelbase": 1e-3, "track": 1e-3}, "no room for four wheels; expected single_track"),
    ],
)
def test_a_robot_that_four_wheels_cannot_be_is_refused(robot, rule):
    with pytest.raises(ScenarioError, match=rule):
        asked(**robot)


def powers(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(math.log10(low), math.log10(high)).map(lambda power: 10.0**power)


@settings(max_examples=12, phases=[Phase.generate])  # shrinking would be slow
@given(
    sizes=st.tuples(powers(1e-2, 10.0), powers(0.2, 5.0), powers(1e-3, 3.0)),
    mass=powers(1e-3, 1e6),
    friction=powers(1e-2, 2.0),
    shares=st.tuples(st.floats(0.1, 1.0), st.floats(0.1, 1.0)),
)
def test_every_robot_that_is_not_refused_drives(sizes, mass, friction, shares):
    wheelbase, narrow, high = sizes  # track and height are shares of the wheelbase
    # as hard as friction and height allow, but for rounding: Manor 2015, eq. (A.2), and moments about an axle
    limit = 9.81 * min(friction, 0.5 / high) * (1.0 - 1e-12)
    strength = (limit, 9.81 * min(friction, 0.9 * 0.5 / high) * (1.0 - 1e-12))
    push, brake = (min(max(share * most, 1e-6), 1e3) for share, most in zip(shares, strength, strict=True))
    track = min(max(narrow * wheelbase, 1e-3), 1e3)
    height = min(high * wheelbase, 24.0 * track * track / wheelbase, 1e3)
    robot = {"wheelbase": wheelbase, "track": track, "com_height": height, "mass": mass, "friction": friction}
    drives(asked(**robot, max_braking=brake, max_acceleration=push))
