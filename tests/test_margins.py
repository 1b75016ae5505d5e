"""How much is left of a motion: the search for the factor, the analytic limit, real runs beside it."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from systems_motions import circle, drive, s_curve, straight
from test_following import LOOP, run

from systems import margins
from systems.following import Following
from systems.margins import (
    FIRST,
    LEAST_FACTOR,
    MOST_FACTOR,
    OVER,
    RESOLUTION,
    Disturbed,
    Margin,
    Studies,
    Trial,
    analytic_demand,
    disturbances,
    find_margin,
    over_the_limit,
    scaled,
    study,
)
from verify import driving
from vnav_drake.plan import Path
from vnav_drake.robot import GRAVITY, Robot

ROBOT = Robot(radius=0.4, mass=40.0, wheelbase=0.5, track=0.4, com_height=0.12, friction=0.6, max_braking=1.0)
# Trials: two at first; from 0.5 to 4 five strides (times 1.1, 1.2, 1.4, 1.8, 2.6: 0.55, 0.66, 0.92, 1.66, 4);
# the last is halved to less than 1 % of 1.66 in eight, 2.34 / 2^8 < 0.0166. Downwards as many.
AT_MOST = 15


class Stub:
    """A vehicle that holds up to `limit` times its speed and then slides; it tips from twice that on."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, limit: float) -> None:
        self.limit, self.factors = limit, []
        monkeypatch.setattr(margins, "_trial", self.trial)

    def trial(self, _robot, _motion, factor: float, demand: float, _model: str) -> Trial:
        self.factors.append(factor)
        cause = "" if factor <= self.limit else "slides" if factor <= 2.0 * self.limit else "falls"
        return Trial(factor=factor, demand=demand * factor**2, cause=cause)


def turning(analytic: float):
    """A circle of 2 m at whose `analytic`-fold speed the friction circle is reached."""
    return circle(2.0, math.sqrt(2.0 * ROBOT.friction_acceleration) / analytic, turns=0.2)


@pytest.mark.parametrize("analytic", [0.3, 0.9, 1.3, 2.6, 3.9, 7.0])
@pytest.mark.parametrize("limit", [0.3, 0.5, 0.7, 1.0, 1.7, 2.4, 3.9, 5.0, math.inf])
def test_the_factor_found_is_the_greatest_that_holds(monkeypatch, limit, analytic):
    stub = Stub(monkeypatch, limit)
    found = find_margin(ROBOT, turning(analytic))
    assert found.analytic == pytest.approx(analytic, rel=1e-9)
    over = math.sqrt(OVER) * analytic
    if limit >= MOST_FACTOR:
        assert (found.factor, found.ended_by) == (MOST_FACTOR, "")
    elif limit < LEAST_FACTOR and not over <= limit:
        assert found.factor == 0.0
    else:
        assert limit * (1.0 - RESOLUTION) <= found.factor <= limit
    assert len(stub.factors) <= AT_MOST
    assert len(set(stub.factors)) == len(stub.factors)
    every = [*found.trials, *([] if found.over is None else [found.over])]
    assert sorted(trial.factor for trial in every) == sorted(stub.factors)
    assert [trial.factor for trial in found.trials] == sorted(trial.factor for trial in found.trials)
    failed = [trial for trial in every if trial.cause]
    assert all(trial.factor > found.factor for trial in failed)
    if failed:
        assert found.ended_by == min(failed, key=lambda trial: trial.factor).cause
    assert (found.over is None) == (over > MOST_FACTOR)
    if found.over is not None:
        assert found.over.factor == pytest.approx(over)
        assert found.over.demand == pytest.approx(OVER)


def test_a_vehicle_that_never_holds_ends_the_search(monkeypatch):
    stub = Stub(monkeypatch, 0.0)
    for motion in (turning(2.6), straight(2.0, start=1.0, end=1.0, cruise=1.0)):
        found = find_margin(ROBOT, motion)
        assert (found.factor, found.ended_by) == (0.0, "falls")
        assert min(stub.factors) == LEAST_FACTOR
    assert len(stub.factors) <= 2 * AT_MOST


def test_a_straight_at_even_speed_has_no_analytic_limit(monkeypatch):
    stub = Stub(monkeypatch, 1.7)
    motion = straight(2.0, start=1.0, end=1.0, cruise=1.0)
    assert analytic_demand(ROBOT, motion)[0] == 0.0
    found = find_margin(ROBOT, motion)
    assert math.isinf(found.analytic)
    assert found.over is None
    assert stub.factors[0] == MOST_FACTOR
    assert 1.7 * (1.0 - RESOLUTION) <= found.factor <= 1.7


def test_the_first_trials_are_about_the_analytic_limit(monkeypatch):
    stub = Stub(monkeypatch, 2.6)
    find_margin(ROBOT, turning(2.6))
    assert stub.factors[:2] == pytest.approx([math.sqrt(OVER) * 2.6, FIRST * 2.6])
    # from 0.95 to sqrt(1.1) of the limit 10 %: four halvings to less than 1 %
    assert len(stub.factors) == 6


# the analytic limit


def test_the_demand_of_a_circle_is_its_lateral_acceleration_over_friction():
    demand, by = analytic_demand(ROBOT, circle(2.0, 1.2, turns=0.3))
    assert by == "friction circle"
    assert demand == pytest.approx(1.2**2 / 2.0 / (0.6 * GRAVITY), rel=1e-9)


def test_a_tall_vehicle_tips_before_it_slides():
    # g w / (2 h) = 9.81 * 0.4 / 1.6 < 0.6 * 9.81 (Manor 2015, eq. A.3 and A.2)
    tall = replace(ROBOT, com_height=0.8)
    demand, by = analytic_demand(tall, circle(2.0, 1.2, turns=0.3))
    assert by == "tip-over"
    assert demand == pytest.approx(1.2**2 / 2.0 / (GRAVITY * 0.4 / 1.6), rel=1e-9)


def test_acceleration_counts_for_the_friction_circle_and_not_for_tipping():
    # from rest at 1 m/s^2 all along: 1 / (mu g)
    speeding = straight(2.0, start=0.0, end=2.0, cruise=2.0)
    assert analytic_demand(ROBOT, speeding) == (pytest.approx(1.0 / (0.6 * GRAVITY)), "friction circle")


def test_a_peak_shorter_than_a_fifth_of_a_second_does_not_count():
    # 0.1 m at 1 m/s on a curve of 1/m, then 0.3 m on one of 0.5/m: the sharper one is over after 0.1 s
    path = Path.from_arcs((0.0, 0.0), 0.0, [0.0, 1.0, 0.5, 0.0], [1.0, 0.1, 0.3, 1.0])
    demand, _ = analytic_demand(ROBOT, drive(path, start=1.0, end=1.0, cruise=1.0))
    assert demand == pytest.approx(0.5 / (0.6 * GRAVITY), rel=1e-9)


def test_a_motion_of_a_single_sample_has_its_greatest_demand():
    # 1 ms: less than the sampling
    motion = circle(2.0, 1.0, turns=1e-3 / (4.0 * math.pi))
    assert motion.travel_time == pytest.approx(1e-3)
    assert analytic_demand(ROBOT, motion)[0] == pytest.approx(0.5 / (0.6 * GRAVITY), rel=1e-9)


def test_scaled_motions_take_the_same_path_in_less_time():
    motion = s_curve(start=0.5, end=0.5, cruise=1.0)
    fast = scaled(motion, 1.7)
    assert fast.travel_time == pytest.approx(motion.travel_time / 1.7)
    times = np.linspace(0.0, motion.travel_time, 50)
    before, after = motion.at(times), fast.at(times / 1.7)
    for place, same in zip(before[:3], after[:3], strict=True):  # x, y, heading
        assert same == pytest.approx(place, abs=1e-9)
    assert after[3] == pytest.approx(1.7 * before[3])  # v
    assert fast.a == pytest.approx(motion.a * 1.7**2)
    assert fast.length == pytest.approx(motion.length)


def test_disturbed_vehicles_differ_in_what_their_case_says():
    found = {case.case: case for case in disturbances(ROBOT)}
    assert len(found) == 10
    assert found["friction -10 %"].actual == replace(ROBOT, friction=0.9 * ROBOT.friction)
    assert found["mass +10 %"].actual == replace(ROBOT, mass=1.1 * ROBOT.mass)
    assert found["start 3 cm to the right"].offset == (0.0, -0.03, 0.0)
    assert found["start turned 2 degrees to the left"].offset == (0.0, 0.0, math.radians(2.0))


# what the pipeline makes of it


@pytest.mark.parametrize(
    ("facts", "studied"), [({}, True), ({"fell": True}, False), ({"arrived": False}, False)]
)
def test_a_motion_that_is_not_followed_is_not_studied(monkeypatch, facts, studied):
    monkeypatch.setattr(margins, "study", lambda *_, **__: "studies")
    settings = SimpleNamespace(studies=True, model="four_wheel")
    stages = SimpleNamespace(
        scenario=SimpleNamespace(simulation=settings, problem=SimpleNamespace(robot=ROBOT)),
        done=SimpleNamespace(run=run(LOOP, **facts)),
        workers=1,
        told=lambda _name: None,
        run=lambda _name, work: work(),
    )
    found = driving.study(stages, SimpleNamespace(trajectory=LOOP))
    assert found == ("studies" if studied else None)


def test_loads_and_slides_of_other_vehicles_are_told_where_they_are_known():
    margin = Margin(factor=1.0, ended_by="", analytic=math.inf, analytic_by="", trials=(), over=None)
    followed = Following(cause="", sideways=0.01, lateness=0.02)
    cases = [
        Disturbed(case="wheels", found=followed, travel_time=3.0, least_load=0.8, slid=False),
        Disturbed(case="axles", found=followed, travel_time=None, least_load=None, slid=True),
    ]
    told = driving.about_studies(Studies(margin=margin, robustness=tuple(cases)))["robustness"]
    common = {"holds": True, "cause": "", "max_lateral_error": 0.01, "max_lateness": 0.02}
    assert told == [
        {"case": "wheels", "travel_time": 3.0, "least_load": 0.8, "slid": False, **common},
        {"case": "axles", "slid": True, **common},
    ]


# real runs


@pytest.mark.parametrize("model", ["four_wheel", "single_track"])
def test_over_the_limit_is_flagged_and_well_below_it_the_vehicle_holds(model):
    # a quarter of a circle of 2 m between straights; at 1 m/s sideways 0.5 of mu g = 5.886 m/s^2
    path = Path.from_arcs((0.0, 0.0), 0.0, [0.0, 0.25, 0.5, 0.25, 0.0], [2.0, 0.6, 4.0, 0.6, 1.0])
    motion = drive(path, start=1.0, end=1.0, cruise=1.0)
    over = over_the_limit(ROBOT, motion, model=model)
    assert over.factor == pytest.approx(math.sqrt(OVER * 2.0 * 0.6 * GRAVITY))
    assert over.cause == "slides"
    demand, _ = analytic_demand(ROBOT, motion)
    assert margins._trial(ROBOT, motion, math.sqrt(0.7 / demand), demand, model).cause == ""


def test_studies_do_not_depend_on_the_number_of_workers():
    # 1.9 m/s on 1 m takes 0.61 of the friction: not far from the limit
    motion = circle(1.0, 1.9, turns=0.15)
    one, two = (study(ROBOT, motion, model="single_track", workers=count) for count in (1, 2))
    assert one == two
    assert [case.case for case in one.robustness] == [case.case for case in disturbances(ROBOT)]
    assert one.margin.factor > 0.0
