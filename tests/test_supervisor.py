"""The supervisor: every transition of its modes and none other, its orders, when they are given."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from systems_motions import circle, straight

from systems.diagram import tracking_diagram
from systems.simulation import mode_of, started
from systems.single_track import State
from systems.supervisor import FALLEN, NEVER, Mode, Order, SingleTrackOrders, Supervisor
from systems.tracking import AT_GOAL, Target
from vnav_drake.robot import Robot

ROBOT = Robot(radius=0.4, max_steering_rate=2.0)
PERIOD = 0.01
COMMAND = (0.05, 12.0)  # steering [rad], force [N]


def decision(
    mode: Mode = Mode.TRACK,
    *,
    speed: float = 1.0,
    tilt: float = 0.0,
    asked: float = NEVER,
    straightened: bool = False,
    ended: bool = False,
    lag: float = 0.0,
    time: float = 1.0,
    reaction_time: float = 0.0,
    rest_end: bool = True,
    steering: float = 0.3,
    yaw_rate: float = 0.4,
    robot: Robot = ROBOT,
) -> Order:
    """What the supervisor decides next, alone, with all its inputs fixed."""
    supervisor = Supervisor(robot, PERIOD, reaction_time=reaction_time, rest_end=rest_end)
    context = supervisor.CreateDefaultContext()
    context.SetTime(time)
    before = Order(mode, steering, 0.0, float(mode != Mode.TRACK), 0.0, 0.0, 0.0)
    context.get_mutable_discrete_state_vector().SetFromVector(list(before))
    target = Target(*[0.0] * len(Target._fields))._replace(ended=float(ended), lag=lag)
    fixed = {
        "state": State(0.0, 0.0, 0.0, speed, 0.0, yaw_rate, steering),
        "tilt": (tilt,),
        "target": target,
        "command": COMMAND,
        "stop": (asked, float(straightened)),
    }
    for name, values in fixed.items():
        supervisor.GetInputPort(name).FixValue(context, list(values))
    found = supervisor.EvalUniquePeriodicDiscreteUpdate(context)
    return Order(*found.get_vector().CopyToVector().tolist())


def expected(mode: Mode, *, standing: bool, tilted: bool, asked: bool, at_goal: bool) -> Mode:
    """The transitions as documented: falling before all, nothing leads back."""
    if mode == Mode.FALLEN or tilted:
        return Mode.FALLEN
    if mode == Mode.STOPPED:
        return Mode.STOPPED
    if mode == Mode.EMERGENCY_STOP:
        return Mode.STOPPED if standing else Mode.EMERGENCY_STOP
    if asked:
        return Mode.EMERGENCY_STOP
    return Mode.STOPPED if standing and at_goal else Mode.TRACK


@pytest.mark.parametrize("mode", list(Mode))
def test_modes_change_as_documented_and_not_otherwise(mode):
    for standing, tilted, asked, at_goal in itertools.product([False, True], repeat=4):
        found = decision(
            mode,
            speed=5e-4 if standing else 1.0,
            tilt=FALLEN + 0.01 if tilted else FALLEN - 0.01,
            asked=1.0 if asked else NEVER,
            ended=at_goal,
        )
        wanted = expected(mode, standing=standing, tilted=tilted, asked=asked, at_goal=at_goal)
        assert Mode(int(found.mode)) == wanted, (standing, tilted, asked, at_goal)


def test_a_vehicle_in_the_plane_never_falls():
    # the single track leaves the port of the tilt open
    loop = tracking_diagram(ROBOT, straight(1.0, start=0.5, end=0.5, cruise=0.5), model="single_track")
    simulator = started(loop, loop.start)
    simulator.AdvanceTo(0.5)
    assert mode_of(loop, simulator.get_context()) == Mode.TRACK


@pytest.mark.parametrize(
    ("time", "begun"), [(0.99, False), (1.0 - 1e-12, True), (1.0, True), (1.2, True), (1e9, True)]
)
def test_stop_begins_at_its_instant(time, begun):
    found = decision(asked=1.0, time=time)
    assert found.mode == (Mode.EMERGENCY_STOP if begun else Mode.TRACK)
    assert found.brake == float(begun)


@pytest.mark.parametrize(("time", "begun"), [(1.0, False), (1.24, False), (1.25, True)])
def test_until_the_robot_has_reacted_it_follows_its_trajectory(time, begun):
    found = decision(asked=1.0, reaction_time=0.25, time=time)
    assert found.mode == (Mode.EMERGENCY_STOP if begun else Mode.TRACK)
    assert (found.force == COMMAND[1]) is not begun


def test_a_stop_never_asked_for_never_begins():
    assert decision(asked=NEVER, time=1e12).mode == Mode.TRACK


def test_goal_at_rest_needs_an_ended_schedule_no_lag_and_a_standing_vehicle():
    slow = 5e-4
    assert decision(speed=slow, ended=True).mode == Mode.STOPPED
    assert decision(speed=slow, ended=False).mode == Mode.TRACK
    assert decision(speed=slow, ended=True, lag=2.0 * AT_GOAL).mode == Mode.TRACK
    assert decision(speed=0.01, ended=True).mode == Mode.TRACK
    assert decision(speed=slow, ended=True, rest_end=False).mode == Mode.TRACK


def test_tracking_passes_on_the_command_within_the_steering_rate():
    # 2 rad/s for 10 ms: 0.02 rad towards 0.05
    found = decision()
    assert found.force == COMMAND[1]
    assert found.brake == 0.0
    assert found.steering == pytest.approx(0.3 - 0.02, abs=1e-12)
    assert decision(steering=0.045).steering == COMMAND[0]


def test_held_wheels_stay_and_straightened_ones_turn_at_a_rate_that_throws_nobody_off():
    # at most STRAIGHTENING = 1.5 rad/s, which is less than the 2 rad/s of the steering: 0.015 rad in 10 ms
    held = decision(Mode.EMERGENCY_STOP, asked=0.5)
    assert (held.steering, held.force, held.brake) == (0.3, 0.0, 1.0)
    assert decision(Mode.EMERGENCY_STOP, asked=0.5, straightened=True).steering == pytest.approx(0.285)
    near = decision(Mode.EMERGENCY_STOP, asked=0.5, straightened=True, steering=-0.015)
    assert near.steering == 0.0
    for rate, angle in ((math.inf, 0.285), (0.5, 0.295)):
        robot = Robot(radius=0.4, max_steering_rate=rate)
        found = decision(Mode.EMERGENCY_STOP, asked=0.5, straightened=True, robot=robot)
        assert found.steering == pytest.approx(angle)


@pytest.mark.parametrize("mode", [Mode.STOPPED, Mode.FALLEN])
def test_standing_and_fallen_robots_keep_brakes_on_and_wheels_where_they_are(mode):
    found = decision(mode, asked=0.5, straightened=True)
    assert (found.mode, found.steering, found.force, found.brake) == (mode, 0.3, 0.0, 1.0)


def test_force_is_shared_for_the_acceleration_of_the_turn():
    assert decision(speed=2.0, yaw_rate=-1.5).lateral == -3.0
    assert decision(speed=2.0).speed == 2.0


def test_a_run_goes_from_tracking_through_the_stop_to_standing():
    # v / a_b = 1 s from the instant on, then it stands, and stays so
    motion = circle(2.0, 1.0)
    loop = tracking_diagram(ROBOT, motion, model="four_wheel")
    simulator = started(loop, loop.start)
    context = simulator.get_mutable_context()
    loop.ask_to_stop(context, 0.3, straightened=False)
    seen = []
    for tick in range(1, 200):
        simulator.AdvanceTo(tick * loop.period)
        seen.append(mode_of(loop, context))
    changes = [mode for mode, _ in itertools.groupby(seen)]
    assert changes == [Mode.TRACK, Mode.EMERGENCY_STOP, Mode.STOPPED]
    # the decision of t = 0.30 is what the state shows from the next tick on
    assert seen.index(Mode.EMERGENCY_STOP) * loop.period == pytest.approx(0.3, abs=1e-9)
    stopped = seen.index(Mode.STOPPED) * loop.period
    assert stopped == pytest.approx(0.3 + 1.0, abs=0.15)  # the last millimetres take longer, see BRAKE_TIME


@pytest.mark.parametrize("speed", [-0.5, 0.0, 1e-3, 1.0, 3.0])
def test_brakes_of_the_single_track_oppose_the_motion_within_its_limits(speed):
    # at most m a_b, and in a turn what it leaves of 0.98 of the friction, at least 0.3 of that
    strong = Robot(radius=0.4, friction=0.3, max_braking=2.8)
    orders = SingleTrackOrders(strong)
    context = orders.CreateDefaultContext()
    for lateral in (0.0, 2.0, 20.0):
        order = Order(Mode.EMERGENCY_STOP, 0.1, 0.0, 1.0, lateral, speed, 0.0)
        orders.GetInputPort("order").FixValue(context, list(order))
        orders.GetInputPort("state").FixValue(context, [0.0, 0.0, 0.0, speed, 0.0, 0.0, 0.1])
        steering, force = orders.GetOutputPort("command").Eval(context)
        assert steering == 0.1
        assert force * speed <= 0.0
        grip = 0.98 * 0.3 * 9.81
        left = math.sqrt(max(grip**2 - lateral**2, (0.3 * grip) ** 2))
        most = strong.mass * min(2.8, left)
        assert abs(force) <= most + 1e-12
        if abs(speed) >= 0.02 * 2.8:
            assert abs(force) == pytest.approx(most, rel=1e-12)


def test_orders_are_finite_for_every_mode():
    for mode in Mode:
        assert np.isfinite(decision(mode)).all()
