"""Optimal arcs near one feature: closed forms, Clairaut's integrals, derivatives, joints, limits."""

from __future__ import annotations

import math

import numpy as np
import pytest
from arc_integrals import clairaut
from hypothesis import given, settings
from hypothesis import strategies as st

from vnav_drake.arcs import Legs, along_curves, leg_points, solve_legs
from vnav_drake.braking import UniformBraking
from vnav_drake.voronoi import PARABOLA, Curves

A = 1.3  # [m/s^2]
PROMPT = UniformBraking(max_braking=A)
LAWS = [
    PROMPT,
    UniformBraking(max_braking=A, margin=0.2),
    UniformBraking(max_braking=A, reaction_time=0.3),
    UniformBraking(max_braking=A, reaction_time=0.05, margin=0.1),
]
KINDS = [(False, 0.4), (True, 0.4), (True, 0.02), (True, 0.0)]


def random_legs(law: UniformBraking, count: int, seed: int, widest: float = 5.0) -> np.ndarray:
    """Rows d1, d2, span: room 0.02 to 5 m, many spans small."""
    rng = np.random.default_rng(seed)
    room = np.exp(rng.uniform(math.log(0.02), math.log(5.0), (2, count)))
    return np.array([*(law.margin + room), 0.05 + widest * rng.uniform(0.0, 1.0, count) ** 2])


def gradient(law: UniformBraking, legs: Legs, d1: np.ndarray, d2: np.ndarray) -> np.ndarray:
    out = legs.outward
    return np.stack([-out[:, 0] / law.speed(d1), out[:, 1] / law.speed(d2), legs.invariant], axis=-1)


def differences(
    law: UniformBraking, radius: float, at: bool, legs: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Gradient (n, 3) and Hessian (n, 3, 3) by central differences of order 8, steps 1e-3 of the size."""
    weight = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}
    first, second = np.zeros((legs.shape[1], 3)), np.zeros((legs.shape[1], 3, 3))
    for j in range(3):
        step = 1e-3 * (legs[j] - law.margin if j < 2 else np.minimum(legs[j], 1.0))
        for shift, w in weight.items():
            for sign in (1, -1):
                moved = legs.copy()
                moved[j] += sign * shift * step
                at_moved = solve_legs(law, radius, at, *moved)
                first[:, j] += sign * w * at_moved.time / step
                second[:, j] += sign * w * gradient(law, at_moved, *moved[:2]) / step[:, None]
    return first, second


@given(st.floats(0.1, 50.0), st.floats(0.1, 3.1), st.floats(3.2, 6.2))
def test_arcs_near_a_wall_are_cycloids(size: float, begin: float, end: float):
    # x = R (xi - sin xi), y = R (1 - cos xi) with xi in (0, 2 pi): T = (xi2 - xi1) sqrt(R / a), which is
    # Manor 2015, eq. (3.9) with 1 / c^2 = 2 R; the tangent's angle from the normal is xi / 2.
    xi = np.array([begin, end])
    x, y = size * (xi - np.sin(xi)), size * (1.0 - np.cos(xi))
    leg = solve_legs(PROMPT, 0.0, False, y[0], y[1], x[1] - x[0])
    assert leg.time[0] == pytest.approx((end - begin) * math.sqrt(size / A), rel=1e-11)
    assert leg.outward[0] == pytest.approx(np.cos(0.5 * xi), abs=1e-9)
    assert leg.invariant[0] == pytest.approx(0.5 / math.sqrt(A * size), rel=1e-10)


def test_from_wall_to_wall_takes_a_full_cycloid():
    # One arch of width 2 pi R takes 2 pi sqrt(R / a) = sqrt(2 pi L / a); it leaves and comes back upright.
    leg = solve_legs(PROMPT, 0.0, False, 0.0, 0.0, 3.0)
    assert leg.time[0] == pytest.approx(math.sqrt(2.0 * math.pi * 3.0 / A), rel=1e-12)
    assert leg.outward[0] == pytest.approx([1.0, -1.0], abs=1e-9)


@given(st.floats(0.01, 9.0), st.floats(0.01, 9.0), st.floats(0.0, 6.28))
def test_arcs_near_a_point_are_straight_under_the_square_root(r1: float, r2: float, turn: float):
    # T = sqrt(2/a) |sqrt(z2) - sqrt(z1)|; derivatives by complex step of the squared form.
    def time(a: complex, b: complex, s: complex) -> complex:
        return np.sqrt(2.0 / A * (a + b - 2.0 * np.sqrt(a * b) * np.cos(0.5 * s)))

    leg = solve_legs(PROMPT, 0.0, True, r1, r2, turn)
    expected = math.sqrt(2.0 / A) * abs(math.sqrt(r2) * np.exp(0.5j * turn) - math.sqrt(r1))
    assert leg.time[0] == pytest.approx(expected, rel=1e-11, abs=1e-14)
    if expected > 1e-3:
        slope = gradient(PROMPT, leg, np.array([r1]), np.array([r2]))[0]
        h = 1e-40j
        by_step = [time(r1 + h, r2, turn), time(r1, r2 + h, turn), time(r1, r2, turn + h)]
        assert slope == pytest.approx([t.imag / 1e-40 for t in by_step], rel=1e-8, abs=1e-8)


def test_beyond_a_full_turn_a_point_robot_goes_through_the_point():
    leg = solve_legs(PROMPT, 0.0, True, [1.0, 1.0], [4.0, 4.0], [2.0 * math.pi, 7.0])
    assert leg.time == pytest.approx(3.0 * math.sqrt(2.0 / A), rel=1e-12)
    assert leg.invariant == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize(("at_point", "radius"), KINDS)
@pytest.mark.parametrize("law", LAWS)
def test_arcs_agree_with_the_quadrature_of_clairauts_integrals(
    law: UniformBraking, at_point: bool, radius: float
):
    legs = random_legs(law, 25, 3)
    found = solve_legs(law, radius, at_point, *legs)
    for (d1, d2, span), time, k, outward in zip(
        legs.T, found.time, found.invariant, found.outward, strict=True
    ):
        swept, taken = clairaut(law, radius, at_point, d1, d2, k, tuple(outward))
        assert swept == pytest.approx(span, rel=2e-8)
        # T(span) = T(swept) + k (span - swept) up to the square of the difference
        assert time == pytest.approx(taken + k * (span - swept), rel=1e-10)


@pytest.mark.parametrize(("at_point", "radius"), KINDS)
@pytest.mark.parametrize("law", LAWS)
def test_gradient_and_hessian_agree_with_differences(law: UniformBraking, at_point: bool, radius: float):
    legs = random_legs(law, 100, 4)
    exact = solve_legs(law, radius, at_point, *legs, hessian=True)
    first, second = differences(law, radius, at_point, legs)
    slope = gradient(law, exact, *legs[:2])
    assert exact.hessian is not None
    assert np.abs(first - slope).max(axis=1) == pytest.approx(0.0, abs=1e-8 * np.abs(slope).max())
    error = np.abs(second - exact.hessian).max(axis=(1, 2)) / np.abs(exact.hessian).max(axis=(1, 2))
    assert error == pytest.approx(0.0, abs=1e-8)
    assert exact.hessian == pytest.approx(np.swapaxes(exact.hessian, 1, 2), rel=1e-12)


@pytest.mark.parametrize("cap", [math.inf, 0.5, 0.9, 1.4])
@pytest.mark.parametrize(("at_point", "radius"), KINDS)
@pytest.mark.parametrize(("lag", "margin"), [(0.0, 0.0), (0.3, 0.1)])
def test_a_leg_is_its_two_halves(lag: float, margin: float, at_point: bool, radius: float, cap: float):
    # Any point of an arc splits it into two arcs of the same invariant, with one tangent and one total time.
    law = UniformBraking(max_braking=A, reaction_time=lag, margin=margin, max_speed=cap)
    d1, d2, span = random_legs(law, 150, 5)
    whole = solve_legs(law, radius, at_point, d1, d2, span)
    offset, d = leg_points(law, radius, at_point, d1, d2, span, np.array([0.0, 0.37, 1.0]))
    assert offset[:, 0] == pytest.approx(0.0)
    assert offset[:, 2] == pytest.approx(span)
    assert d[:, 0] == pytest.approx(d1, rel=1e-12)
    assert d[:, 2] == pytest.approx(d2, rel=1e-12)
    first = solve_legs(law, radius, at_point, d1, d[:, 1], offset[:, 1])
    last = solve_legs(law, radius, at_point, d[:, 1], d2, span - offset[:, 1])
    assert first.time + last.time == pytest.approx(whole.time, rel=1e-10)
    through = (d[:, 1] > 1e-9) & (span < 2.0 * math.pi)  # not through the point itself
    assert first.outward[through, 1] == pytest.approx(last.outward[through, 0], abs=2e-5)
    assert first.invariant[through] == pytest.approx(whole.invariant[through], rel=1e-6, abs=1e-7)


@pytest.mark.parametrize("cap", [math.inf, 0.5, 0.9, 1.4])
@pytest.mark.parametrize(("at_point", "radius"), KINDS)
@pytest.mark.parametrize("lag", [0.0, 0.3])
def test_no_way_over_a_third_point_is_faster(lag: float, at_point: bool, radius: float, cap: float):
    law = UniformBraking(max_braking=A, reaction_time=lag, max_speed=cap)
    d1, d2, span = random_legs(law, 300, 6)
    rng = np.random.default_rng(7)
    d3, part = random_legs(law, 300, 8)[0], span * rng.uniform(-0.2, 1.2, 300)
    direct = solve_legs(law, radius, at_point, d1, d2, span)
    there = solve_legs(law, radius, at_point, d1, d3, np.abs(part))
    back = solve_legs(law, radius, at_point, d3, d2, np.abs(span - part))
    assert (there.time + back.time >= direct.time * (1.0 - 1e-12)).all()


@settings(max_examples=40)
@given(
    st.sampled_from([*LAWS, UniformBraking(max_braking=A, max_speed=0.8)]),
    st.sampled_from(KINDS),
    st.integers(0, 10**6),
)
def test_backwards_takes_as_long_and_braking_scales_time(
    law: UniformBraking, kind: tuple[bool, float], seed: int
):
    at_point, radius = kind
    d1, d2, span = random_legs(law, 10, seed)
    forth = solve_legs(law, radius, at_point, d1, d2, span, hessian=True)
    back = solve_legs(law, radius, at_point, d2, d1, span)
    assert back.time == pytest.approx(forth.time, rel=1e-12)
    assert back.outward[:, ::-1] == pytest.approx(-forth.outward, abs=1e-7)
    # four times the braking, half the reaction time, twice the greatest speed: half the time
    quick = UniformBraking(
        max_braking=4.0 * A,
        reaction_time=0.5 * law.reaction_time,
        margin=law.margin,
        max_speed=2.0 * law.max_speed,
    )
    assert 2.0 * solve_legs(quick, radius, at_point, d1, d2, span).time == pytest.approx(
        forth.time, rel=1e-12
    )


@pytest.mark.parametrize(("at_point", "radius"), KINDS)
@pytest.mark.parametrize("law", LAWS)
def test_radial_legs_are_exact(law: UniformBraking, at_point: bool, radius: float):
    # The integral of dd / V with dd = (V / a + t_r) dV is (V2 - V1) / a + t_r log(V2 / V1).
    d1, d2 = law.margin + 0.3, law.margin + 2.0
    v1, v2 = float(law.speed(d1)), float(law.speed(d2))
    leg = solve_legs(law, radius, at_point, [d1, d2], [d2, d1], 0.0)
    expected = (v2 - v1) / A + law.reaction_time * math.log(v2 / v1)
    assert leg.time == pytest.approx(expected, rel=1e-12)
    assert leg.outward == pytest.approx(np.array([[1.0, 1.0], [-1.0, -1.0]]))
    assert leg.invariant == pytest.approx(0.0)


@pytest.mark.parametrize("lag", [0.0, 0.4])
def test_the_critical_circle_is_itself_an_arc(lag: float):
    # r / V is least where V = sqrt(2 a L), L = radius + margin: that circle is optimal however long the way.
    law = UniformBraking(max_braking=A, reaction_time=lag, margin=0.1)
    v = math.sqrt(2.0 * A * 0.5)
    d = float(law.distance(v))
    leg = solve_legs(law, 0.4, True, d, d, [1.0, 6.0], hessian=True)
    assert leg.time == pytest.approx(np.array([1.0, 6.0]) * (0.4 + d) / v, rel=1e-12)
    assert leg.outward == pytest.approx(0.0, abs=1e-9)
    offset, clearance = leg_points(law, 0.4, True, d, d, 6.0, np.linspace(0.0, 1.0, 7))
    assert offset[0] == pytest.approx(np.arange(7.0))
    assert clearance[0] == pytest.approx(d)


@pytest.mark.parametrize(("at_point", "radius"), KINDS)
def test_ends_at_rest_take_finite_time_only_without_reaction_time(at_point: bool, radius: float):
    late = UniformBraking(max_braking=A, reaction_time=0.1, margin=0.1)
    assert np.isinf(solve_legs(late, radius, at_point, [0.1, 0.1, 2.0], [2.0, 0.1, 0.1], 0.5).time).all()
    prompt = UniformBraking(max_braking=A, margin=0.1)
    leg = solve_legs(prompt, radius, at_point, [0.1, 2.0], [2.0, 0.1], 0.5)
    near = solve_legs(prompt, radius, at_point, 0.1 + 1e-12, 2.0, 0.5)
    # from clearance e on, at most sqrt(2 e / a) is saved
    assert leg.time == pytest.approx(near.time[0], abs=1.01 * math.sqrt(2e-12 / A))
    assert leg.outward[0, 0] == pytest.approx(1.0)
    assert leg.outward[1, 1] == pytest.approx(-1.0)


def test_neighbouring_laws_have_neighbouring_times():
    d1, d2, span = random_legs(PROMPT, 50, 9)
    point = solve_legs(PROMPT, 0.0, True, d1, d2, span)
    # with d kept, a radius of 1e-9 m lengthens the way by less than 1e-9 m a radian and leaves V as it is
    assert solve_legs(PROMPT, 1e-9, True, d1, d2, span).time == pytest.approx(point.time, rel=1e-5)
    wall = solve_legs(PROMPT, 0.0, False, d1, d2, span)
    far = solve_legs(
        PROMPT, 1e6, True, d1, d2, span / 1e6
    )  # a disc of 1000 km: its side is as good as a wall
    assert far.time == pytest.approx(wall.time, rel=1e-5)
    quick = UniformBraking(max_braking=A, reaction_time=1e-9)
    for at_point, radius in KINDS:
        exact = solve_legs(PROMPT, radius, at_point, d1, d2, span).time
        assert solve_legs(quick, radius, at_point, d1, d2, span).time == pytest.approx(exact, rel=1e-6)


def test_mixed_features_are_told_apart():
    at_point = np.array([True, False, True])
    mixed = solve_legs(PROMPT, 0.4, at_point, 1.0, 2.0, 1.5, hessian=True)
    for i, at in enumerate(at_point):
        alone = solve_legs(PROMPT, 0.4, at, 1.0, 2.0, 1.5, hessian=True)
        assert mixed.time[i] == alone.time[0]
        assert mixed.hessian is not None
        assert alone.hessian is not None
        assert (mixed.hessian[i] == alone.hessian[0]).all()


@pytest.mark.parametrize(
    ("d1", "d2", "span", "what"),
    [
        (0.05, 1.0, 1.0, "d1"),
        (1.0, math.nan, 1.0, "d2"),
        (1.0, 1.0, -0.1, "span"),
        (1.0, 1.0, math.inf, "span"),
    ],
)
def test_impossible_legs_are_refused(d1: float, d2: float, span: float, what: str):
    law = UniformBraking(max_braking=A, margin=0.1)
    with pytest.raises(ValueError, match=f"leg 1: {what} = "):
        solve_legs(law, 0.0, False, [1.0, d1], [1.0, d2], [1.0, span])


def test_time_along_a_parabola_has_the_derivative_of_its_ends():
    # dT/du = (ds/du) / V at the end and its negative at the start, by central differences of the time.
    law = UniformBraking(max_braking=A, reaction_time=0.2)

    def curve(u0: float, u1: float) -> Curves:
        axis, normal = np.array([[1.0, 0.0]]), np.array([[0.0, 1.0]])
        spot = np.zeros((1, 2))
        return Curves(
            np.array([PARABOLA]), spot, axis, normal, np.array([1.5]), np.zeros(1), np.array([[u0, u1]])
        )

    for u0, u1 in ((-0.4, 1.1), (1.1, -0.4)):
        leg = along_curves(law, 0.3, curve(u0, u1))
        h = 1e-4
        by_start = (
            along_curves(law, 0.3, curve(u0 + h, u1)).time - along_curves(law, 0.3, curve(u0 - h, u1)).time
        )
        by_end = (
            along_curves(law, 0.3, curve(u0, u1 + h)).time - along_curves(law, 0.3, curve(u0, u1 - h)).time
        )
        assert leg.slope[0] == pytest.approx([by_start[0] / (2 * h), by_end[0] / (2 * h)], rel=1e-6)
        # the tangent of r = (p^2 + u^2) / (2 p) rises by u / p
        sign = 1.0 if u1 > u0 else -1.0
        slope = np.array([u0, u1]) / 1.5
        assert leg.tangent[0] == pytest.approx(
            sign * np.column_stack([np.ones(2), slope]) / np.hypot(1.0, slope)[:, None]
        )
