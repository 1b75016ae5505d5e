"""Optimal arcs under a greatest speed: crossings, rides, dips, and what joins them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from vnav_drake.arcs import leg_points, solve_legs
from vnav_drake.braking import UniformBraking

A, CAP = 1.3, 0.8  # [m/s^2], [m/s]
LAWS = [
    UniformBraking(max_braking=A, max_speed=CAP),
    UniformBraking(max_braking=A, max_speed=CAP, reaction_time=0.3, margin=0.1),
]
CLEARANCES = [float(law.distance(CAP)) for law in LAWS]
BOTH = pytest.mark.parametrize(("law", "c"), list(zip(LAWS, CLEARANCES, strict=True)))


def below(law: UniformBraking, c: float, share: float) -> float:
    return law.margin + share * (c - law.margin)


@BOTH
def test_a_long_way_at_a_wall_rides_along_the_clearance_of_the_greatest_speed(law: UniformBraking, c: float):
    # Tangentially up from V1 = Vc sin(alpha): with b = pi/2 - alpha and dd = (V + a t_r) / a dV, the
    # span is Vc/a [Vc (b + sin(alpha) cos(alpha)) / 2 + a t_r cos(alpha)] and the time
    # [Vc b - a t_r log tan(alpha/2)] / a.
    d1, lag = below(law, c, 0.3), A * law.reaction_time
    sine = float(law.speed(d1)) / CAP
    cosine, rest = math.sqrt(1.0 - sine**2), math.acos(sine)
    climb = CAP / A * (CAP * 0.5 * (rest + sine * cosine) + lag * cosine)
    taken = (CAP * rest - lag * math.log(sine / (1.0 + cosine))) / A
    leg = solve_legs(law, 0.0, False, [d1, d1], [d1, c], 7.0, hessian=True)
    assert leg.time == pytest.approx(
        [2.0 * taken + (7.0 - 2.0 * climb) / CAP, taken + (7.0 - climb) / CAP], rel=1e-12
    )
    assert leg.invariant == pytest.approx(1.0 / CAP, rel=1e-12)
    assert leg.outward == pytest.approx(np.array([[cosine, -cosine], [cosine, 0.0]]), rel=1e-12)
    _, d = leg_points(law, 0.0, False, d1, d1, 7.0, np.linspace(0.0, 1.0, 101))
    assert d.max() == pytest.approx(c, rel=1e-12)


@BOTH
def test_beyond_the_cap_legs_are_straight(law: UniformBraking, c: float):
    wall = solve_legs(law, 0.4, False, c + 1.0, c + 4.0, 4.0)
    assert wall.time[0] == pytest.approx(5.0 / CAP, rel=1e-12)
    assert wall.outward[0] == pytest.approx([0.6, 0.6], rel=1e-12)
    r1, r2 = c + 1.4, c + 3.4
    point = solve_legs(law, 0.4, True, c + 1.0, c + 3.0, 1.0)
    expected = math.sqrt(r1**2 + r2**2 - 2.0 * r1 * r2 * math.cos(1.0))
    assert point.time[0] == pytest.approx(expected / CAP, rel=1e-12)


@BOTH
def test_around_a_point_tangents_and_a_circle_where_that_is_fastest(law: UniformBraking, c: float):
    # With V(c) below sqrt(2 a L), r / V falls towards c: two tangents and an arc of the circle c.
    radius = 1.0
    assert math.sqrt(2.0 * A * (radius + law.margin)) > CAP
    edge, r = c + radius, 3.0
    leg = solve_legs(law, radius, True, r - radius, r - radius, 5.0)
    expected = 2.0 * math.sqrt(r**2 - edge**2) + edge * (5.0 - 2.0 * math.acos(edge / r))
    assert leg.time[0] == pytest.approx(expected / CAP, rel=1e-12)
    assert leg.invariant[0] == pytest.approx(edge / CAP, rel=1e-12)
    assert leg.outward[0, 1] == pytest.approx(math.sqrt(1.0 - (edge / r) ** 2), rel=1e-12)


@BOTH
def test_around_a_small_point_legs_dip_below_the_cap(law: UniformBraking, c: float):
    # r / V grows towards c: the way round is faster within. Clairaut: r sin(beta) / V stays the same.
    radius = 0.02
    assert math.sqrt(2.0 * A * (radius + law.margin)) < CAP
    leg = solve_legs(law, radius, True, c + 1.0, c + 0.5, 3.0)
    _, d = leg_points(law, radius, True, c + 1.0, c + 0.5, 3.0, np.linspace(0.0, 1.0, 201))
    assert law.margin < d.min() < 0.98 * c
    sine = np.sqrt(1.0 - leg.outward[0] ** 2)
    assert (radius + np.array([c + 1.0, c + 0.5])) * sine / CAP == pytest.approx(leg.invariant[0], rel=1e-12)
    edge = c + radius
    around = sum(
        math.sqrt((edge + x) ** 2 - edge**2) - edge * math.acos(edge / (edge + x)) for x in (1.0, 0.5)
    )
    assert leg.time[0] < (around + 3.0 * edge) / CAP  # two tangents and the circle


def test_a_cap_never_reached_changes_nothing():
    law, free = UniformBraking(max_braking=A, max_speed=50.0), UniformBraking(max_braking=A)
    for at_point, radius in ((False, 0.4), (True, 0.4), (True, 0.0)):
        one, other = (solve_legs(each, radius, at_point, 0.3, 2.0, 2.5, hessian=True) for each in (law, free))
        assert one.time == pytest.approx(other.time, rel=1e-15)
        assert one.hessian == pytest.approx(other.hessian, rel=1e-15)


CASES = {  # clearances as shares of c, span, radius: what the leg does
    "arc": (0.3, 0.5, 0.1, 0.4),
    "ride at both ends": (0.3, 0.5, 5.0, 1.0),
    "crossing": (0.3, 2.5, 0.5, 0.4),
    "crossing with a dip": (0.7, 2.5, 1.5, 0.02),
    "line": (1.5, 2.5, 0.2, 0.4),
    "ride or dip from afar": (1.5, 2.5, 2.9, 1.0),
    "dip from afar": (1.5, 2.5, 2.9, 0.02),
    "ride from below to afar": (0.4, 2.0, 4.5, 1.0),
}


@pytest.mark.parametrize("case", CASES.values(), ids=CASES.keys())
@pytest.mark.parametrize("at_point", [False, True])
@BOTH
def test_derivatives_of_every_kind_of_leg(
    law: UniformBraking, c: float, at_point: bool, case: tuple[float, float, float, float]
):
    # Central differences of order 6 in time and gradient; the cases lie well inside their kinds.
    share1, share2, span, radius = case
    place = np.array([below(law, c, share1), below(law, c, share2), span])
    for x in (place, place[[1, 0, 2]]):
        exact = solve_legs(law, radius, at_point, *x, hessian=True)
        assert exact.hessian is not None
        for j in range(3):
            h = 1e-3 * (x[j] - law.margin if j < 2 else 0.3)
            time, slope = 0.0, np.zeros(3)
            for shift, w in ((1, 3 / 4), (2, -3 / 20), (3, 1 / 60)):
                for sign in (1, -1):
                    moved = x.copy()
                    moved[j] += sign * shift * h
                    leg = solve_legs(law, radius, at_point, *moved)
                    time += sign * w / h * leg.time[0]
                    v = law.speed(moved[:2])
                    parts = [-leg.outward[0, 0] / v[0], leg.outward[0, 1] / v[1], leg.invariant[0]]
                    slope += sign * w / h * np.array(parts)
            v = law.speed(x[:2])
            parts = [-exact.outward[0, 0] / v[0], exact.outward[0, 1] / v[1], exact.invariant[0]]
            assert time == pytest.approx(parts[j], rel=1e-8, abs=1e-8)
            size = np.abs(exact.hessian).max()
            assert slope == pytest.approx(exact.hessian[0, j], rel=1e-8, abs=1e-8 * max(size, 1.0))


@pytest.mark.parametrize("radius", [0.02, 1.0])
@BOTH
def test_times_and_invariants_are_continuous_where_kinds_of_legs_meet(
    law: UniformBraking, c: float, radius: float
):
    # Between neighbouring spans T grows at a rate between both invariants, up to the bend of k over a step.
    span = np.linspace(0.0, 6.0, 6001)
    for at_point in (False, True):
        for d1, d2 in ((0.3, 0.6), (0.3, 1.0), (0.3, 2.0), (1.0, 1.0), (1.0, 2.0), (2.0, 2.5)):
            leg = solve_legs(law, radius, at_point, below(law, c, d1), below(law, c, d2), span)
            drawn = np.diff(leg.time) / np.diff(span)
            bound = np.stack([leg.invariant[1:], leg.invariant[:-1]])
            room = 1e-3 * leg.invariant.max()
            assert (drawn <= bound.max(axis=0) + room).all()
            assert (drawn >= bound.min(axis=0) - room).all()
