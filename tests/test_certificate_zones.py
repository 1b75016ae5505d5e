"""Certificates for zones that depend on the heading: what proves them, and what is refused."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from certificate_case import question, read, sealed
from judged import scenario

from verify.evidence import EvidenceError
from verify.judge.certificate import check_certificate
from verify.judge.certificate.drive import drive_time
from verify.judge.certificate.gauge import EllipseGauge, FacetGauge, gauge_of
from verify.judge.certificate.headings import ZoneGauge, slack
from verify.judge.certificate.minorant import Corners, Minorants
from verify.judge.certificate.zone import zone_gauge
from verify.judge.zones import shapes as sets
from vnav_drake.lower_bound import lower_bound
from vnav_drake.lower_bound.certificate import digest

ELLIPSE = {"type": "ellipse", "lateral_ratio": 0.5}
FIELD = {"type": "protective_field"}
# In the hall of `judged`, half-width 2 m, radius 0.5 m, along the middle: the walls are at right angles to
# the heading, so D = (2 - 0.5) / 0.5 = 3 m, V = sqrt(2 * 1 * 3), and 20 m take 20 / sqrt(6).
ENDS = {"start": {"position": [10.0, 2.0]}, "goal": {"position": [30.0, 2.0]}}
HALL_TIME = 20.0 / math.sqrt(6.0)


def asked(zone=ELLIPSE, **changes):
    return {"braking": {"zone": zone}} | ENDS | changes


@pytest.fixture(scope="module")
def made():
    """The arrays of a certificate for the hall with an ellipse."""
    return lower_bound(scenario(**asked()).problem, upper=HALL_TIME, gap=2e-3).certificate.arrays()


def proof(arrays, folder, *, exact=False, **changes):
    arrays = {key: value for key, value in arrays.items() if key != "digest"}
    return check_certificate(read(sealed(arrays), folder), question(**(asked() | changes)), exact=exact)


def test_certificate_holds_and_proves_nearly_the_exact_time_of_a_corridor(made, tmp_path):
    found = proof(made, tmp_path)
    assert found.holds, found.reasons
    assert HALL_TIME / 1.002 <= found.travel_time <= HALL_TIME
    assert 0.0 <= found.worst < 1e-4  # somewhere it is tight, and there it is proven
    assert "for all headings, proven between sampled ones" in found.statement
    assert not found.driven


def test_exact_check_says_that_floating_point_with_slack_is_what_there_is(made, tmp_path):
    found = proof(made, tmp_path, exact=True)
    assert found.holds
    assert not found.exact
    assert "rational arithmetic is not available" in found.statement


def test_solver_and_file_have_the_same_digest(made):
    assert np.array_equal(digest(made), sealed(made)["digest"])


@pytest.mark.parametrize("key", ["u_vertex", "u_edge"])
def test_u_scaled_up_a_little_is_refused(made, tmp_path, key):
    # Tight to 1e-6 somewhere: five times as much is too much, of all values together.
    more = 1.0 + 5e-6
    arrays = made | {"u_vertex": made["u_vertex"] * more, "u_edge": made["u_edge"] * more}
    assert any("steeper" in reason for reason in proof(arrays, tmp_path).reasons)
    # and a single value in the middle of the way, by 50 ms: sides are 1 m at most, u rises by 0.4 s a metre
    place = made["origin"] + made["unit"] * made["vertices"]
    middle = int(np.argmin(np.hypot(*(place - [20.0, 2.0]).T)))
    nudged = made[key].copy()
    nudged[middle if key == "u_vertex" else np.argmax((made["edges"] == middle).any(axis=1))] += 0.05
    assert not proof(made | {key: nudged}, tmp_path).holds


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"braking": {"zone": ELLIPSE | {"lateral_ratio": 0.6}}}, "lateral_ratio = 0.5"),
        ({"braking": {"zone": ELLIPSE | {"behind": 0.9}}}, "behind"),
        ({"braking": {"zone": "uniform"}}, "made for a braking zone"),
        ({"braking": {"zone": FIELD}}, "protective_field"),
    ],
)
def test_another_zone_than_the_certificates_is_named(made, tmp_path, changes, words):
    found = proof(made, tmp_path, **changes)
    assert not found.holds
    assert any(words in reason for reason in found.reasons)


def test_text_that_lies_about_the_zone_helps_nothing(made, tmp_path):
    # A narrower zone is faster: with ratio 0.3 the hall takes sqrt(0.6) of the time.
    told = json.dumps({"type": "ellipse", "lateral_ratio": 0.3, "ahead": 1.0, "behind": None})
    arrays = made | {"zone": np.frombuffer(told.encode(), dtype=np.uint8)}
    found = proof(arrays, tmp_path, braking={"zone": ELLIPSE | {"lateral_ratio": 0.3}})
    assert any("steeper" in reason for reason in found.reasons)


def test_place_of_the_tangents_is_only_a_choice(made, tmp_path):
    arrays = made | {"contact": np.full_like(made["contact"], 1.0 / 3.0)}
    found = proof(arrays, tmp_path)
    assert found.holds or any("steeper" in reason for reason in found.reasons)
    arrays = made | {"contact": np.zeros_like(made["contact"])}
    assert proof(arrays, tmp_path).travel_time <= HALL_TIME


def beside_a_wall(points, limits) -> Minorants:
    """What bounds 1/V on one triangle with a wall along y = 0."""
    return Minorants(
        points=points,
        triangles=np.array([[0, 1, 2]]),
        features=np.array([[-1e3, 0.0, 1e3, 0.0, 0.0]]),
        feature=np.array([[0]]),
        speed=np.array([[1e-6]]),
        weight=np.ones((1, 1)),
        limits=limits,
    )


def one_triangle(gradient: float, heading: float, speed: float = 2.0):
    """u = g.x on a triangle 1 m from a wall, with the distance 1 m at all corners to 1e-9."""
    points = np.array([[0.0, 1.0], [1e-9, 1.0], [0.0, 1.0 + 1e-9]])
    g = gradient * np.array([math.cos(heading), math.sin(heading)])
    value = points @ g
    middle = 0.5 * (value + np.roll(value, -1))
    corners = Corners(
        own=value[None],
        towards=np.stack([middle, np.roll(middle, 1)], axis=1)[None],
        sides=np.array([[[[1, 0], [0, 1]], [[-1, 1], [-1, 0]], [[0, -1], [1, -1]]]]),
        twice_area=np.array([1]),
        unit=1e-9,
    )
    limits = question(robot={"radius": 0.0, "wheelbase": 0.1, "track": 0.1}).setting.limits
    return corners, beside_a_wall(points, limits)


@pytest.mark.parametrize("heading", [-2.0, -1.1, -0.4, 0.3, 0.777, 1.3])
@pytest.mark.parametrize("beta", [0.3, 0.5])
def test_inequality_is_decided_for_all_headings(heading, beta):
    # V^2 = 2 D = 2 y / h, h^2 = sin^2 + beta^2 cos^2. Steepest where g.t sqrt(2 / h) is 1, at 1e5
    # headings it is low by 1e-9. The values of u are rounded to 1e-7 of their differences.
    zone = zone_gauge(
        question(**asked(ELLIPSE | {"lateral_ratio": beta})).setting.zone, one_triangle(1, 0)[1].limits
    )
    zone = replace(zone, reach=0.0)
    fine = np.linspace(-math.pi, math.pi, 100_001)
    h = np.hypot(np.sin(fine), beta * np.cos(fine))
    most = 1.0 / (np.cos(fine - heading) * np.sqrt(2.0 / h)).max()
    place = np.full((1, 3), 1.0 / 3.0)
    assert slack(*one_triangle(most * (1.0 - 2e-6), heading), place, zone).min() >= 0.0
    assert slack(*one_triangle(most * (1.0 + 2e-6), heading), place, zone).min() < 0.0


@pytest.mark.parametrize("heading", [-2.0, -0.4, 0.3, 1.3])
def test_headings_at_which_the_zone_has_a_kink_are_proven_too(heading):
    # V^2 = 2 y / h with h of the direction to the wall, at headings with an edge of the zone towards it and
    # 1e5 others. Where a corner is what touches, the gauge has a kink at the point that it touches: there a
    # cell shows less in proportion to its width, and that must not be taken for a loss.
    zone = {"type": "polygon", "vertices": [[-0.2, -0.4], [1.05, -0.3], [1.05, 0.3], [-0.2, 0.4]]}
    _, minorants = one_triangle(1.0, heading)
    asked_for = question(**asked(zone)).setting.zone
    gauge = replace(zone_gauge(asked_for, minorants.limits), reach=0.0)
    normal = math.atan2(1.25, 0.1)  # of the edge from (1.05, 0.3) to (-0.2, 0.4)
    edges = -0.5 * math.pi - np.array([0.0, normal, math.pi, -normal])
    fine = np.concatenate([np.linspace(-math.pi, math.pi, 100_001), edges])
    towards = -0.5 * math.pi - fine
    ring = np.asarray(zone["vertices"])
    h = (ring @ np.stack([np.cos(towards), np.sin(towards)])).max(axis=0)
    most = 1.0 / (np.cos(fine - heading) * np.sqrt(2.0 / h)).max()
    place = np.full((1, 3), 1.0 / 3.0)
    assert slack(*one_triangle(most * (1.0 - 2e-4), heading), place, gauge).min() >= 0.0
    assert slack(*one_triangle(most * (1.0 + 2e-5), heading), place, gauge).min() < 0.0


@pytest.mark.parametrize("place", [[0.0, 0.0, 1.0], [1.0 / 3.0] * 3, [0.5, 0.5, 0.0]])
def test_tangent_touches_at_the_greatest_speed_where_the_place_is_beyond(place):
    # A disc zone above a wall: D = y. With t_r = 1/2 and a_b = 1 the greatest speed 3/2 stops within 3/4 +
    # 9/8 = 15/8 m, between the corners' 1 m and 2 m. Its tangent of 1/V is 1/w + s (15/8 - y) with s = 1 /
    # (9/4 * 2) = 2/9, that is 13/12 - 2 y / 9: the highest tangent at y = 2 of those that are one for
    # y = 15/8, too. u(y) = 13 y / 12 - y^2 / 9 has that slope.
    speed, bend = 13.0 / 12.0, -2.0 / 9.0
    points = np.array([[0.0, 1.0], [1.0, 1.0], [0.0, 2.0]])
    y, following = points[:, 1], np.roll(points[:, 1], -1)

    def shown(share):
        own = share * (speed * y + 0.5 * bend * y * y)
        side = share * (0.5 * speed * (y + following) + 0.5 * bend * y * following)
        corners = Corners(
            own=own[None],
            towards=np.stack([side, np.roll(side, 1)], axis=1)[None],
            sides=np.array([[[[1, 0], [0, 1]], [[-1, 1], [-1, 0]], [[0, -1], [1, -1]]]]),
            twice_area=np.array([1]),
            unit=1.0,
        )
        robot = {"radius": 0.0, "wheelbase": 0.1, "track": 0.1, "max_braking": 1.0, "max_speed": 1.5}
        braking = {"zone": ELLIPSE, "reaction_time": 0.5}
        minorants = beside_a_wall(points, question(robot=robot, braking=braking).setting.limits)
        zone = ZoneGauge(EllipseGauge(0.0, 1.0, 1.0, 1.0), 0.0)
        return slack(corners, minorants, np.array([place]), zone).min()

    if place[2] > 0.9:
        assert shown(1.0 - 1e-5) >= 0.0
    assert shown(1.0 + 1e-5) < 0.0


def test_gauges_are_never_below_the_largest_quotient_over_all_directions():
    # gamma(z) = max over n of n.z / h(n); at 20,000 directions it is low by at most (3e-4)^2 of it.
    ellipse = sets.Ellipse(0.2, 0.9, 0.5)
    unknown = sets.Measured(ellipse.support)
    kite = sets.Hull([[1.0, 0.0], [0.2, 0.6], [-0.5, 0.0], [0.2, -0.6]])
    angle = np.linspace(-math.pi, math.pi, 20_000, endpoint=False)
    n = np.stack([np.cos(angle), np.sin(angle)])
    z = np.random.default_rng(3).normal(size=(200, 2))
    for shape, kind in ((ellipse, EllipseGauge), (unknown, FacetGauge), (kite, FacetGauge)):
        gauge = gauge_of(shape)
        assert isinstance(gauge, kind)
        dense = (z @ n / shape.support(angle)).max(axis=1)
        found = gauge(z[:, 0], z[:, 1])
        assert np.all(found >= dense)
        assert found == pytest.approx(dense, rel=1e-5 if shape is not kite else 2e-3)
    assert gauge_of(sets.Straight()) is None


def test_zone_of_a_plugin_is_proven_with_its_own_support_and_that_is_said(made, tmp_path):
    own = question(**asked())
    zone = own.setting.zone
    foreign = replace(zone, type="own", zone=replace(zone.zone, shape=sets.Measured(zone.zone.shape.support)))
    own = replace(own, setting=replace(own.setting, zone=foreign))
    told = json.loads(made["zone"].tobytes()) | {"type": "own"}
    loose = {key: made[key] * (1.0 - 1e-5) for key in ("u_vertex", "u_edge", "travel_time")}
    arrays = made | loose | {"zone": np.frombuffer(json.dumps(told).encode(), dtype=np.uint8)}
    arrays["travel_time"] = np.array(float(arrays["travel_time"]) * (1.0 - 1e-12))
    found = check_certificate(read(sealed(arrays), tmp_path), own)
    assert found.holds, found.reasons
    assert "trusted" in found.statement


def test_fields_that_do_not_hold_the_base_zone_are_refused(made, tmp_path):
    # At 2 m/s the ellipse reaches 2 m ahead and, with the body, 1.5 m to a side: the second is narrower.
    wide = [[-3, -2], [3, -2], [3, 2], [-3, 2]]
    narrow = [[-3, -1], [3, -1], [3, 1], [-3, 1]]
    law = made["law"].copy()
    law[4] = 2.0  # no faster than the field: u, made without that limit, is a bound all the more
    slower = made | {"law": law}
    for polygon, holds in ((wide, True), (narrow, False)):
        zone = {"type": "field_set", "base": ELLIPSE, "fields": [{"max_speed": 2.0, "polygon": polygon}]}
        found = proof(slower, tmp_path, braking={"zone": zone}, robot={"max_speed": 2.0})
        assert found.holds is holds, found.reasons
        assert holds or any("does not hold the base zone" in reason for reason in found.reasons)


def test_protective_field_is_proven_by_length_and_drive(tmp_path):
    # 20 m from rest to rest, a_max = a_b = 1: 2 sqrt(20) s.
    ends = {end: ENDS[end] | {"speed": "rest"} for end in ENDS}
    arrays = lower_bound(scenario(**(asked(FIELD) | ends)).problem, budget=2500).certificate.arrays()
    for exact in (False, True):
        found = proof(arrays, tmp_path, exact=exact, braking={"zone": FIELD}, **ends)
        assert found.holds, found.reasons
        assert found.driven
        assert found.exact is exact
        assert 2.0 * math.sqrt(20.0) * 0.999 <= found.travel_time <= 2.0 * math.sqrt(20.0)
        assert "what is proven is a length" in found.statement
    free = proof(arrays, tmp_path, braking={"zone": FIELD})
    assert any("no time follows" in reason for reason in free.reasons)
    other = proof(arrays, tmp_path, braking={"zone": ELLIPSE}, **ends)
    assert not other.holds
    # A length is one with any zone, if the file is about it; a time it is not.
    told = json.dumps({"type": "ellipse", "lateral_ratio": 0.5}).encode()
    renamed = arrays | {"zone": np.frombuffer(told, dtype=np.uint8)}
    other = proof(renamed, tmp_path, braking={"zone": ELLIPSE}, **ends)
    assert other.holds, other.reasons
    assert other.driven
    timed = arrays | {"lengths": np.array(0)}
    found = proof(timed, tmp_path, braking={"zone": FIELD}, **ends)
    assert any("no speed follows" in reason for reason in found.reasons)


def test_time_that_is_said_to_be_a_length_is_refused(made, tmp_path):
    found = proof(made | {"lengths": np.array(1)}, tmp_path)
    assert any("said to be a length" in reason for reason in found.reasons)
    with pytest.raises(EvidenceError, match="lengths"):
        proof(made | {"lengths": np.array(2)}, tmp_path)


@pytest.mark.parametrize(
    ("zone", "timed"),
    [
        (ELLIPSE | {"behind": 0.0}, False),
        (ELLIPSE | {"behind": 0.0005}, False),
        (ELLIPSE | {"behind": 0.001}, True),
        ({"type": "polygon", "vertices": [[-0.0005, -0.3], [1, -0.3], [1, 0.3], [-0.0005, 0.3]]}, False),
        ({"type": "polygon", "vertices": [[-0.004, -0.3], [1, -0.3], [1, 0.3], [-0.004, 0.3]]}, True),
    ],
)
def test_zones_that_reach_hardly_behind_are_proven_as_planned(zone, timed, tmp_path):
    # The greatest disc around the robot in E reaches as far as E does behind: from a thousandth on the proof
    # is one by time.
    changes = {"robot": {"max_speed": 2.0}, "braking": {"zone": zone}}
    arrays = lower_bound(scenario(**(ENDS | changes)).problem, budget=400).certificate.arrays()
    found = proof(arrays, tmp_path, **changes)
    assert found.holds, found.reasons
    assert found.driven is not timed


@pytest.mark.parametrize(
    ("ends", "top", "length", "expected"),
    [
        (("rest", "rest"), math.inf, 9.0, 6.0),  # 2 sqrt(L)
        (("rest", "rest"), 2.0, 12.0, 8.0),  # 2 s up, 2 s down over 4 m, 8 m at 2 m/s
        (("rest", "safe"), math.inf, 8.0, 4.0),  # sqrt(2 L)
        (("safe", "safe"), 2.0, 12.0, 6.0),  # L / v_max
        (("safe", "safe"), math.inf, 12.0, 0.0),  # nothing limits it
        ((3.0, "rest"), math.inf, 4.5, 3.0),  # brakes all the way
        ((3.0, "rest"), math.inf, 1.0, 3.0),  # too short to stop in: the way must be longer
    ],
)
def test_least_time_of_a_drive(ends, top, length, expected):
    setting = question().setting
    limits = replace(setting.limits, speed=top, acceleration=1.0, braking=1.0)
    start, goal = (setting.start.model_copy(update={"speed": speed}) for speed in ends)
    assert drive_time(limits, start, goal, length) == pytest.approx(expected, rel=1e-11)
    assert drive_time(limits, start, goal, length) <= expected
