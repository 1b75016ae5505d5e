"""Emergency stops: they begin on the run, a restored state goes on as the run did, and what braking takes."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from pydrake.systems.framework import Context
from systems_motions import circle, corridors, mirrored, straight

from systems import simulate
from systems.diagram import TrackingDiagram, tracking_diagram
from systems.simulation import started
from systems.stops import ROWS, StopRecords, emergency_stops, stop_instants
from vnav_drake.robot import Robot

ROBOT = Robot(radius=0.4)
SLIPPERY = replace(ROBOT, friction=1.0 / 9.81)  # mu g = a_b = 1 m/s^2
MODELS = ("four_wheel", "single_track")


def rows(stops: StopRecords, i: int) -> dict[str, np.ndarray]:
    table = stops.rows[stops.first[i] : stops.first[i + 1]]
    return dict(zip(ROWS, table.T, strict=True))


def way(row: dict[str, np.ndarray]) -> float:
    """Length [m] of the way driven."""
    return float(np.hypot(np.diff(row["x"]), np.diff(row["y"])).sum())


def everything(context: Context) -> np.ndarray:
    """All numbers of the state."""
    discrete = context.get_discrete_state()
    groups = [discrete.get_vector(i).CopyToVector() for i in range(discrete.num_groups())]
    return np.concatenate([*groups, context.get_continuous_state_vector().CopyToVector()])


@pytest.fixture(scope="module")
def motion():
    return corridors(start=1.5, end=1.5, cruise=1.5, straights=(0.8, 0.8))


@pytest.fixture(scope="module")
def stops(motion):
    return {model: emergency_stops(ROBOT, motion, count=5, model=model) for model in MODELS}


@pytest.mark.parametrize(
    ("duration", "count", "period"), [(12.3, 200, 0.01), (0.45, 7, 0.005), (30.0, 1, 0.01), (5.0, 0, 0.01)]
)
def test_instants_are_ticks_in_the_middle_of_equal_parts(duration, count, period):
    found = stop_instants(duration, count, period)
    assert len(found) == count
    np.testing.assert_allclose(found / period, np.round(found / period), atol=1e-9)
    middles = (np.arange(count) + 0.5) * duration / max(count, 1)
    assert np.all((found <= middles + 1e-9) & (found > middles - period))


def test_short_runs_have_as_many_instants_as_ticks():
    # 0.3 s are 30 ticks of 10 ms
    np.testing.assert_allclose(stop_instants(0.3, 200, 0.01), 0.01 * np.arange(30), atol=1e-12)


@pytest.mark.parametrize("model", MODELS)
def test_stops_begin_on_the_recorded_run_bit_by_bit(model, motion, stops):
    run, found = simulate(ROBOT, motion, model=model), stops[model]
    compared = 0
    for i, instant in enumerate(found.instant):
        k = int(np.argmin(np.abs(run.t - instant)))
        if abs(run.t[k] - instant) > 1e-9:  # the single track's ticks are 5 ms apart, the run's rows 10 ms
            continue
        row = rows(found, i)
        for name in ("x", "y", "v"):
            assert row[name][0] == run.columns[name][k], (name, instant)
        assert math.remainder(row["heading"][0] - run.heading[k], 2.0 * math.pi) == pytest.approx(
            0, abs=1e-12
        )
        compared += 1
    assert compared >= 4


@pytest.mark.parametrize("model", MODELS)
def test_restored_state_without_a_stop_goes_on_as_the_run_bit_by_bit(model, motion):
    loop = tracking_diagram(ROBOT, motion, model=model)
    first, second = started(loop, loop.start), started(loop, loop.start)
    second.AdvanceTo(0.37)  # its own past must not matter
    first.AdvanceTo(0.8)
    second.get_mutable_context().SetTimeStateAndParametersFrom(first.get_context())
    second.Initialize()
    for time in (0.81, 1.0, 1.6):
        first.AdvanceTo(time)
        second.AdvanceTo(time)
        assert np.array_equal(everything(first.get_context()), everything(second.get_context())), time


@pytest.mark.parametrize("model", MODELS)
def test_records_are_complete(model, stops):
    found = stops[model]
    assert found.model == model
    assert len(found.instant) == len(found.straightened) == len(found.first) - 1 == 10
    assert found.straightened.tolist() == [False, True] * 5
    assert np.all(np.diff(found.instant[::2]) > 0.0)
    assert np.array_equal(found.instant[::2], found.instant[1::2])
    assert found.first[0] == 0
    assert found.first[-1] == len(found.rows)
    assert np.isfinite(found.rows).all()
    for i in range(10):
        row = rows(found, i)
        assert row["t"][0] == pytest.approx(0.0, abs=1e-12)
        assert 0.0 < np.diff(row["t"]).min() <= np.diff(row["t"]).max() <= 0.02 + 1e-9
        assert abs(row["v"][-1]) < 1e-2


@pytest.mark.parametrize("model", MODELS)
def test_file_gives_back_every_bit(model, stops, tmp_path):
    found, file = stops[model], tmp_path / "stops.npz"
    found.save(file)
    with np.load(file, allow_pickle=False) as read:
        assert set(read.files) == {"schema", "model", "instant", "straightened", "first", *ROWS}
        assert int(read["schema"]) == 1
        assert str(read["model"]) == model
        for name in ("instant", "straightened", "first"):
            assert read[name].dtype == getattr(found, name).dtype
            assert np.array_equal(read[name], getattr(found, name)), name
        for name, column in zip(ROWS, found.rows.T, strict=True):
            assert np.array_equal(read[name], column), name


@pytest.mark.parametrize("model", MODELS)
def test_straight_stop_takes_v_squared_over_twice_a_b_and_reaction_v_t_r_more(model):
    motion = straight(3.0, start=1.5, end=1.5, cruise=1.5)
    late = 0.3
    now = emergency_stops(ROBOT, motion, count=1, model=model)
    then = emergency_stops(ROBOT, motion, count=1, model=model, reaction_time=late)
    for i in range(2):
        assert way(rows(now, i)) == pytest.approx(1.5**2 / 2.0, rel=0.02)
        assert way(rows(then, i)) - way(rows(now, i)) == pytest.approx(1.5 * late, rel=0.01)
        # until then it drives on as if nothing were
        before = rows(then, i)["t"] < late - 1e-9
        np.testing.assert_allclose(rows(then, i)["v"][before], 1.5, rtol=5e-3)


@pytest.mark.parametrize("share", [0.3, 0.6, 0.9])
def test_held_wheels_share_friction_between_turn_and_brakes(share):
    # mu g = a_b: with all friction v' = -sqrt((mu g)^2 - (kappa v^2)^2), so that the way to rest is
    # asin(lambda) / (2 kappa), lambda = kappa v^2 / (mu g) (Derived: along the way u = v^2 has the slope
    # -2 sqrt((mu g)^2 - kappa^2 u^2)).
    # That is the longest way on which all friction is used. A wheel that slides outwards leaves the arc, and
    # shortens the way, down to v^2 / (2 mu g): nothing brakes harder. 20 ms near standing add a little.
    radius = 2.0
    speed = math.sqrt(share * radius)
    found = emergency_stops(SLIPPERY, circle(radius, speed, turns=0.5), count=1)
    held = rows(found, 0)
    ideal = 0.5 * radius * math.asin(share)
    assert speed**2 / 2.0 * 0.99 <= way(held) <= 1.03 * ideal
    # it stays near the arc, turned by way / radius less what tyres creep outwards, and so ends beyond the
    # braking distance of a straight stop
    turned = held["heading"][-1] - held["heading"][0]
    assert 0.8 * way(held) / radius < turned < 1.02 * way(held) / radius
    assert way(held) > speed**2 / 2.0 + 0.5 * (ideal - speed**2 / 2.0)


def test_beyond_the_friction_of_the_turn_brakes_still_get_their_least():
    # near all of the friction the turn leaves nothing: 0.3 of it brakes all the same, so that the way is at
    # most v^2 / (2 * 0.3 a_b) and as a rule far less
    radius, share = 2.0, 0.97
    speed = math.sqrt(share * radius)
    found = emergency_stops(SLIPPERY, circle(radius, speed, turns=0.5), count=1)
    assert way(rows(found, 0)) <= speed**2 / (2.0 * 0.3)
    assert abs(rows(found, 0)["v"][-1]) < 1e-2


def test_straightened_wheels_leave_the_arc_along_its_tangent(motion, stops):
    found = stops["four_wheel"]
    turned = []
    for i in range(0, 10, 2):
        held, straightened = rows(found, i), rows(found, i + 1)
        turned.append(
            (
                abs(held["heading"][-1] - held["heading"][0]),
                abs(straightened["heading"][-1] - straightened["heading"][0]),
            )
        )
    bends = [pair for pair in turned if pair[0] > 0.2]
    assert bends
    assert all(straightened < 0.7 * held for held, straightened in bends)


def test_slow_steering_straightens_late():
    # 0.1 rad/s leave the wheels nearly where they were for the second that the stop takes
    motion = circle(1.5, 1.0, turns=0.5)
    slow = emergency_stops(replace(ROBOT, max_steering_rate=0.1), motion, count=1)
    fast = emergency_stops(ROBOT, motion, count=1)
    turned = [abs(rows(s, 1)["heading"][-1] - rows(s, 1)["heading"][0]) for s in (slow, fast)]
    assert turned[0] > 3.0 * turned[1]


@pytest.mark.parametrize("model", MODELS)
def test_mirrored_motion_has_mirrored_stops(model, motion, stops):
    # the contact solver sweeps the wheels in one order: it ends within its tolerance, see the runs
    other, found = emergency_stops(ROBOT, mirrored(motion), count=5, model=model), stops[model]
    assert np.array_equal(other.instant, found.instant)
    for i in range(10):
        left, right = rows(found, i), rows(other, i)
        assert left["x"][-1] == pytest.approx(right["x"][-1], abs=1e-3)
        assert left["y"][-1] == pytest.approx(-right["y"][-1], abs=1e-3)


def test_no_instants_give_an_empty_record(motion, tmp_path):
    found = emergency_stops(ROBOT, motion, count=0)
    assert found.rows.shape == (0, len(ROWS))
    assert found.first.tolist() == [0]
    found.save(tmp_path / "stops.npz")


def test_a_robot_that_has_fallen_is_not_asked_to_stop():
    tall = replace(ROBOT, com_height=0.5, friction=1.5)
    motion = circle(2.0, math.sqrt(2.0 * tall.tip_acceleration * 2.0), turns=2.0)
    run = simulate(tall, motion)
    found = emergency_stops(tall, motion, count=8)
    assert run.details["ended"] == "fallen"
    assert 0 < len(found.instant) < 16
    assert found.instant.max() <= run.t[-1]


def test_motion_that_is_none_is_refused(motion):
    with pytest.raises(ValueError, match="column x"):
        emergency_stops(ROBOT, replace(motion, x=np.append(motion.x[:-1], math.nan)), count=1)
    with pytest.raises(ValueError, match="point robot"):
        emergency_stops(Robot(radius=0.0), motion, count=1)


def test_ask_for_a_stop_only_changes_the_request(motion):
    loop: TrackingDiagram = tracking_diagram(ROBOT, motion, model="four_wheel")
    simulator = started(loop, loop.start)
    before = everything(simulator.get_context())
    loop.ask_to_stop(simulator.get_mutable_context(), 1.0, straightened=True)
    assert np.array_equal(everything(simulator.get_context()), before)
