"""Stops that no vehicle drives are refused: brakes too strong, slack by the row, wheels not straightened."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import stops_case as case
from stops_case import figures, judged, record, refusal

from verify.judge.tracking import Record, record_from_columns

COUNT = 2 * case.INSTANTS
TOO_FAST = "a change of speed that neither brakes nor floor give"


@pytest.mark.parametrize("times", [1.1, 2.0, 4.0, 8.0, 11.0])
def test_brakes_stronger_than_those_claimed_are_no_evidence(times):
    # 1.05 of a_b, 0.01 m/s and, as 5 % of an axle's load are shifted, 0.0075 m/s are allowed: at 1.1 of it
    # that is passed 0.35 s after the instant of a stop.
    assert TOO_FAST in refusal(case.stop_arrays(braking=times))


def test_brakes_within_what_contacts_add_are_evidence():
    # 1.055 a_b for 1 / 1.055 s: 0.005 / 1.055 m/s beyond 1.05 a_b, below 0.01 m/s
    assert figures(case.stop_arrays(braking=1.055))["bad"] == 0


@pytest.mark.parametrize(("height", "refused"), [(0.12, True), (1.0, False)])
def test_a_tall_body_pitches_as_it_brakes(height, refused):
    # 2 h a_b / (g l) = 0.049 at 0.12 m and 0.41 at 1 m: 0.017 and 0.071 m/s to spare; 1.1 a_b takes
    # 0.05 / 1.1 = 0.045 m/s.
    arrays, tall = case.stop_arrays(braking=1.1), {"robot": {"com_height": height, "wheelbase": 0.5}}
    if refused:
        assert TOO_FAST in refusal(arrays, **tall)
    else:
        assert judged(arrays, **tall).refused == ()


def test_slack_is_granted_once_and_not_by_the_row():
    # A stop at 2 m/s^2 whose speed keeps still for 18 ms and falls by 0.04 m/s in 2 ms, again and again.
    arrays = case.stop_arrays(braking=2.0)
    t = arrays["t"] - 0.018 * (np.arange(len(arrays["t"])) % 2)
    t[arrays["first"][:-1]] = 0.0
    assert TOO_FAST in refusal({**arrays, "t": t})


def test_rows_one_microsecond_apart_do_not_hide_what_the_brakes_do():
    # 1 m/s in 11 steps of 1 us: 11 um of way.
    count, rows = COUNT, 12
    arrays = case.stop_arrays()
    t = np.arange(rows) * 1e-6
    quick = {
        "t": np.tile(t, count),
        "v": np.tile(np.linspace(1.0, 0.0, rows), count),
        "x": np.repeat(arrays["x"][arrays["first"][:-1]], rows),
        "y": np.full(count * rows, 2.0),
        **{key: np.zeros(count * rows) for key in ("heading", "tilt", "slip")},
        "least_load": np.full(count * rows, 0.8),
        "first": np.arange(count + 1) * rows,
    }
    words = refusal({**arrays, **quick})
    assert TOO_FAST in words
    assert "rows less than 0.001 s apart, 0.000 s after its instant" in words


def test_the_last_row_may_follow_at_once():
    # A last row 10 us after the one before it, standing as that does.
    arrays = case.stop_arrays()
    ends = arrays["first"][1:]
    longer = {key: np.insert(arrays[key], ends, arrays[key][ends - 1]) for key in case.ROWS}
    longer["t"][ends + np.arange(COUNT)] += 1e-5
    assert figures({**arrays, **longer, "first": arrays["first"] + np.arange(COUNT + 1)})["bad"] == 0


@pytest.mark.parametrize(
    ("slip", "braking", "refused"),
    [(0.0, 1.5, True), (0.3, 1.5, False), (0.3, 4.0, True), (1.0, 6.0, False), (1.0, 8.0, True)],
)
def test_wheels_that_slide_take_what_the_floor_gives(slip, braking, refused):
    # mu g = 0.6 * 9.81 = 5.886 m/s^2. Sliding at 0.3 m/s of 1 m/s costs 0.3 of it, 1.77 m/s^2, beyond
    # 1.05 a_b = 1.05 m/s^2, and more as the stop slows: 1.5 m/s^2 are less, 4 m/s^2 are more.
    # Locked wheels give mu g, 1.2 times that with what a contact adds, 7.06 m/s^2.
    arrays = case.stop_arrays(braking=braking)
    arrays["slip"] = np.full_like(arrays["slip"], slip)
    if refused:
        assert TOO_FAST in refusal(arrays)
    else:
        assert figures(arrays)["slid"] == COUNT


def test_a_vehicle_that_turns_sharply_has_that_energy_to_brake_too():
    # On a circle of 0.9 m: k^2 kappa^2 = (0.25 + 0.16) / 12 / 0.81 = 0.042, so 1.08 a_b are within
    # 1.05 * 1.042. Straight on they are 0.03 * 1 / 1.08 m/s beyond 1.05 a_b.
    arrays = case.stop_arrays(braking=1.08)
    assert TOO_FAST in refusal(arrays)
    begin = np.repeat(arrays["x"][arrays["first"][:-1]], np.diff(arrays["first"]))
    angle = (arrays["x"] - begin) / 0.9
    turning = {"x": begin + 0.9 * np.sin(angle), "y": 2.0 + 0.9 * (1.0 - np.cos(angle)), "heading": angle}
    assert figures({**arrays, **turning})["tried"] == COUNT


def test_a_stop_that_gains_speed_is_no_evidence():
    def gains(v: np.ndarray) -> np.ndarray:
        return np.where(np.arange(len(v)) == 30, v + 0.1, v)

    assert TOO_FAST in refusal(case.edited(case.stop_arrays(), "v", 7, gains))


# ---- the reaction time


LATE = {"braking": {"reaction_time": 0.5}}


def test_brakes_that_act_at_once_where_a_reaction_time_is_asked_for_are_no_evidence():
    # 20 ms after the instant the run is 0.02 m/s faster; after 60 ms 0.06^2 / 2 m further on than the stop.
    words = refusal(case.stop_arrays(), **LATE)
    assert (
        "stop 0 (at 0.000 s, steering held) is, 0.020 s after its instant and before the brakes act," in words
    )
    assert "0.0200 m/s off the run's speed" in words
    assert "m from where the run was" in words


def test_until_the_brakes_act_a_stop_is_on_its_run():
    assert figures(case.stop_arrays(reaction_time=0.5), **LATE)["bad"] == 0
    aside = case.edited(
        case.stop_arrays(reaction_time=0.5), "y", 4, lambda y: y + 0.002 * (np.arange(len(y)) == 20)
    )
    assert "0.400 s after its instant and before the brakes act, 0.0020 m from where" in refusal(
        aside, **LATE
    )


def test_beyond_the_run_s_end_a_stop_waits_all_the_same():
    # The last instant is the run's end: what follows is on no record. At a_b from there on, it takes half of
    # its speed before the brakes act, as a plan might; at twice a_b and more it does not.
    arrays = case.stop_arrays(reaction_time=0.5)
    sharp = case.stop_arrays(braking=2.0)
    last = case.rows_of(sharp, COUNT - 1)
    head = case.first_stops(arrays, COUNT - 1)
    mixed = {key: np.append(head[key], sharp[key][last]) for key in case.ROWS}
    mixed["first"] = np.append(head["first"], len(mixed["t"]))
    words = refusal({**arrays, **mixed}, **LATE)
    assert f"stop {COUNT - 1} (at 30.000 s, wheels straightened) has {TOO_FAST}" in words


# ---- held and straightened


def steered(angle: float) -> Record:
    return replace(record(), steering=np.full_like(record().t, angle))


def turning(share: float, to: float = 0.2) -> case.Arrays:
    """Held stops that turn by `to` [rad], straightened ones by that `share` of it; the way is the old one.

    At 0.5 m/s^2, claimed so: 1 m of way.
    """
    arrays = case.stop_arrays(braking=0.5)
    part = np.tile(np.linspace(0.0, to, int(arrays["first"][1])), COUNT)
    straight = np.repeat(arrays["straightened"], np.diff(arrays["first"]))
    return {**arrays, "heading": np.where(straight, share * part, part)}


SLOW = {"robot": {"max_braking": 0.5}}


@pytest.mark.parametrize("share", [1.0, 0.95, -1.0])
def test_a_straightened_stop_turns_less_where_the_wheels_stood_at_an_angle(share):
    words = refusal(turning(share), steered(0.2), **SLOW)
    told = f"stop 1 (at 0.000 s, wheels straightened) turns by {0.2 * abs(share):.3f} rad"
    assert (
        f"{told}, the one with the steering held by 0.200 rad, where the wheels stood at 0.200 rad" in words
    )


def test_a_straightened_stop_may_turn_somewhat():
    assert judged(turning(0.85), steered(0.2), **SLOW).refused == ()


@pytest.mark.parametrize("case_of", ["straight", "swinging", "short", "sliding", "slow"])
def test_wheels_are_asked_for_only_where_they_tell(case_of):
    arrays, run, changes = turning(1.0), steered(0.2), SLOW
    if case_of == "straight":
        run = steered(0.04)
    elif case_of == "swinging":  # from one side to the other in less than 0.1 s
        run = replace(run, steering=0.2 * np.sign(np.sin(np.pi * (run.t + 0.001) / 0.1)))
    elif case_of == "short":  # 0.5 m at 1 m/s^2, straight both times
        arrays, changes = case.stop_arrays(), {}
    elif case_of == "sliding":
        arrays = turning(0.95)
        arrays["slip"] = np.full_like(arrays["slip"], 0.1)
    else:  # 0.2 rad take 2 s, and the way at 1 m/s in them is 2 m, of 1 m
        changes = {"robot": {"max_braking": 0.5, "max_steering_rate": 0.1}}
    assert judged(arrays, run, **changes).refused == ()


def test_not_even_sliding_stops_are_the_same_stop_twice():
    arrays = turning(1.0)
    arrays["slip"] = np.full_like(arrays["slip"], 0.1)
    assert "where the wheels stood at 0.200 rad" in refusal(arrays, steered(0.2), **SLOW)


def test_slow_steering_that_is_straight_in_time_is_asked_for():
    # 0.2 rad at 0.25 rad/s: 0.8 s, at 1 m/s 0.8 m of 1 m
    slow = {"robot": {"max_braking": 0.5, "max_steering_rate": 0.25}}
    assert "where the wheels stood" in refusal(turning(1.0), steered(0.2), **slow)


def test_a_run_that_does_not_tell_its_steering_has_no_stops_to_judge():
    columns = {name: column for name, column in case.run_columns().items() if name != "steering"}
    assert "(column steering)" in refusal(case.stop_arrays(), record_from_columns(columns))


# ---- a run that ends in a fall


def falls(at: float) -> Record:
    """The run, on which the vehicle falls at that time [s], and which ends there."""
    columns = case.run_columns()
    rows = round(at / 0.01) + 1
    cut = {name: column[:rows].copy() for name, column in columns.items()}
    cut["mode"][-1] = 3.0
    return record_from_columns(cut)


def middles(kept: int) -> case.Arrays:
    """The first stops at instants in the middle of 20 equal parts of the 30 s."""
    arrays = case.stop_arrays()
    instant = np.repeat((np.arange(case.INSTANTS) + 0.5) * 1.5, 2)
    x = arrays["x"] + np.repeat(instant - arrays["instant"], np.diff(arrays["first"]))
    return case.first_stops({**arrays, "instant": instant, "x": x}, kept)


def test_stops_up_to_a_fall_are_evidence():
    # 13.5 s are 9 of 20 parts: instants 0.75, 2.25 .. 12.75 s come before.
    found = judged(middles(18), falls(13.5))
    assert found.refused == ()
    assert found.figures is not None
    assert (found.figures["tried"], found.figures["bad"]) == (18, 0)


@pytest.mark.parametrize(("kept", "words"), [(0, "0 stops, where 2 at each of 20"), (10, "10 stops, where")])
def test_stops_are_missing_where_the_vehicle_had_not_fallen_yet(kept, words):
    # Of 9 instants before the fall one may be missing, as the clocks differ by a step.
    assert words in refusal(middles(kept), falls(13.5))


def test_no_stop_begins_after_the_fall():
    assert "within the run, 0.000 to 13.500 s" in refusal(middles(20), falls(13.5))


def test_a_vehicle_that_falls_at_once_leaves_no_stops():
    assert "no stop at all: the vehicle fell on its run, 0.500 s after its start" in refusal(
        middles(0), falls(0.5)
    )
    assert "0 stops, where 2 at each of 20 instants were asked for" in refusal(middles(0))


# ---- tolerances


@pytest.mark.parametrize(("gap", "refused"), [(2.99, False), (3.03, True)])
def test_twice_the_even_part_of_the_run_may_be_without_a_stop(gap, refused):
    # 2 * 30 s / 20 and a clock's 0.01 s: 3.01 s. Ten instants lie on either side of the gap.
    instants = np.concatenate(
        [np.linspace(0.0, 15.0 - 0.5 * gap, 10), np.linspace(15.0 + 0.5 * gap, 30.0, 10)]
    )
    arrays = case.stop_arrays()
    instant = np.repeat(instants, 2)
    x = arrays["x"] + np.repeat(instant - arrays["instant"], np.diff(arrays["first"]))
    edited = {**arrays, "instant": instant, "x": x}
    if refused:
        assert "at most 3.010 s is allowed" in refusal(edited)
    else:
        assert judged(edited).refused == ()


@pytest.mark.parametrize(("off", "refused"), [(0.0109, False), (0.0131, True), (0.05, True)])
def test_a_heading_between_two_rows_may_be_off_by_half_of_what_lies_between(off, refused):
    # The run turns by 0.5 rad/s on the spot of the record, 5 mrad from row to row: 0.01 + 0.0025 rad.
    run = replace(record(), heading=0.5 * record().t)
    arrays = case.stop_arrays()
    heading = np.repeat(0.5 * arrays["instant"] + off, np.diff(arrays["first"]))
    if refused:
        assert f"{off:.4f} rad off the run's heading" in refusal({**arrays, "heading": heading}, run)
    else:
        assert judged({**arrays, "heading": heading}, run).refused == ()
