"""Travel times along curves: closed forms, and quadrature of ds / V for every law."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from vnav_drake.braking import UniformBraking
from vnav_drake.voronoi import LINEAR, PARABOLA, ROOT, Curves, travel_time

A = 1.3  # [m/s^2]
LAW = UniformBraking(max_braking=A)


def curve(kind: int, size: float, slope: float, span: tuple[float, float]) -> Curves:
    return Curves(
        np.array([kind]),
        np.zeros((1, 2)),
        np.array([[1.0, 0.0]]),
        np.array([[0.0, 1.0]]),
        np.array([size]),
        np.array([slope]),
        np.array([span]),
    )


def by_quadrature(one: Curves, law: UniformBraking, radius: float) -> float:
    """Adaptive quadrature, cut at the least distance and where the speed limit sets in."""

    def slowness(u: float) -> float:
        stretch = math.hypot(1.0, u / one.size[0]) if one.kind[0] == PARABOLA else 1.0
        return stretch / float(law.speed(one.distance(np.array([u]))[0] - radius))

    low, high = sorted(one.span[0])
    cuts = [0.0]
    if math.isfinite(law.max_speed):
        cap, size = radius + float(law.distance(law.max_speed)), float(one.size[0])
        square = {ROOT: cap**2 - size**2, PARABOLA: size * (2.0 * cap - size)}.get(int(one.kind[0]))
        if square is None:
            cuts += [(cap - size) / one.slope[0]] if one.slope[0] else []
        elif square > 0.0:
            cuts += [-math.sqrt(square), math.sqrt(square)]
    marks = [low, *sorted(c for c in cuts if low < c < high), high]
    return sum(quad(slowness, a, b, epsabs=1e-13, epsrel=1e-12, limit=400)[0] for a, b in pairwise(marks))


laws = st.builds(
    UniformBraking,
    max_braking=st.floats(0.3, 4.0),
    reaction_time=st.sampled_from([0.0, 0.05, 0.4]),
    margin=st.sampled_from([0.0, 0.07]),
    max_speed=st.sampled_from([math.inf, 0.3, 1.1]),
)


@given(
    law=laws,
    radius=st.sampled_from([0.0, 0.4]),
    kind=st.sampled_from([LINEAR, ROOT, PARABOLA]),
    size=st.floats(0.02, 3.0),
    slope=st.floats(-1.0, 1.0) | st.sampled_from([0.0, 1e-9]),
    one=st.floats(-3.0, 3.0),
    other=st.floats(-3.0, 3.0),
)
def test_times_agree_with_quadrature(law, radius, kind, size, slope, one, other):
    # Kept clear of V = 0, where adaptive quadrature is not exact: at least 1 cm of room.
    least = radius + law.margin + 0.01
    if kind == LINEAR:
        one, other = 0.0, abs(other) + 0.01
        size = max(size, least, least - slope * other)
        tested = curve(kind, size, slope, (one, other))
    else:
        square = least**2 - size**2 if kind == ROOT else size * (2.0 * least - size)
        if square > 0.0:
            one = math.copysign(math.sqrt(square) + abs(one), one)
            other = math.copysign(math.sqrt(square) + abs(other), one)
        tested = curve(kind, size, 0.0, (one, other))
    exact = travel_time(tested, law, radius)[0]
    assert exact == pytest.approx(by_quadrature(tested, law, radius), rel=1e-9, abs=1e-12)


def test_away_from_a_wall_it_is_free_fall():
    # v = sqrt(2 a d), d from 0 to D: T = sqrt(2 D / a); the speed is zero at the start.
    tested = curve(LINEAR, 0.4, 1.0, (0.0, 2.0))
    assert travel_time(tested, LAW, 0.4)[0] == pytest.approx(math.sqrt(2.0 * 2.0 / A), rel=1e-14)


def test_along_a_corridor_the_speed_is_constant():
    tested = curve(LINEAR, 1.5, 0.0, (0.0, 7.0))
    assert travel_time(tested, LAW, 0.5)[0] == pytest.approx(7.0 / math.sqrt(2.0 * A), rel=1e-14)


@given(p=st.floats(0.05, 5.0), one=st.floats(-6.0, 6.0), other=st.floats(-6.0, 6.0))
def test_a_parabola_takes_the_time_of_the_point_formula(p: float, one: float, other: float):
    # Without a radius a parabola about a point is optimal there: T = sqrt(2/a) |sqrt z_T - sqrt z_S|
    # (square-root map; Manor 2015, eq. (3.12)). Seen from the focus the angle is 2 atan(u/p), so
    # the root has the angle atan(u/p) and the size sqrt(r) with r = (p^2 + u^2)/(2 p).
    roots = [math.sqrt((p * p + u * u) / (2.0 * p)) * np.exp(1j * math.atan(u / p)) for u in (one, other)]
    expected = math.sqrt(2.0 / A) * abs(roots[1] - roots[0])
    assert travel_time(curve(PARABOLA, p, 0.0, (one, other)), LAW, 0.0)[0] == pytest.approx(
        expected, rel=1e-11, abs=1e-14
    )


def test_a_bisector_cut_at_zero_clearance_has_a_finite_time():
    # Near the cut d is about s s0 / rho, so V vanishes like a square root. With u = s - s0 put u = x^2:
    # ds / V = 2 x dx / sqrt(2 a d), smooth, so plain quadrature is good.
    half, radius = 0.3, 0.5
    start = math.sqrt(radius**2 - half**2)

    def smooth(x: float) -> float:
        s = start + x * x
        room = (s - start) * (s + start) / (math.hypot(s, half) + radius)
        return 2.0 * x / math.sqrt(2.0 * A * room) if x > 0.0 else 0.0

    expected = quad(smooth, 0.0, math.sqrt(2.0), epsabs=1e-14, epsrel=1e-13)[0]
    tested = curve(ROOT, half, 0.0, (start, start + 2.0))
    assert travel_time(tested, LAW, radius)[0] == pytest.approx(expected, rel=1e-11)


@pytest.mark.parametrize("gap", [1e-3, 1e-6, 1e-9, 1e-12])
def test_a_narrow_saddle_takes_logarithmically_long(gap: float):
    # Between two points with h = rho + gap: V^2 = 2 a (gap + s^2 / (r + h)); for |s| <= 1e-3 << h it is
    # 2 a (gap + s^2 / (2 h)) up to a part s^2 / (4 h^2) = 1e-6, so
    # T = 2 sqrt(h / a) asinh(s / sqrt(2 h gap)).
    h, s = 0.5 + gap, 1e-3
    expected = 2.0 * math.sqrt(h / A) * math.asinh(s / math.sqrt(2.0 * h * gap))
    assert travel_time(curve(ROOT, h, 0.0, (-s, s)), LAW, 0.5)[0] == pytest.approx(expected, rel=3e-6)


def test_through_zero_speed_inside_there_is_no_finite_time():
    assert travel_time(curve(ROOT, 0.5, 0.0, (-1.0, 1.0)), LAW, 0.5)[0] == math.inf
    assert travel_time(curve(PARABOLA, 1.0, 0.0, (-1.0, 0.0)), LAW, 0.5)[0] == math.inf


def test_with_a_reaction_time_zero_clearance_is_never_reached():
    # V = d / t_r + O(d^2): the integral of dd / V diverges.
    slow = UniformBraking(max_braking=A, reaction_time=0.2)
    start = math.sqrt(0.5**2 - 0.3**2)
    assert travel_time(curve(LINEAR, 0.5, 1.0, (0.0, 1.0)), slow, 0.5)[0] == math.inf
    assert travel_time(curve(ROOT, 0.3, 0.0, (start, 2.0)), slow, 0.5)[0] == math.inf


@given(law=laws, size=st.floats(0.6, 3.0), one=st.floats(-3.0, 3.0), other=st.floats(-3.0, 3.0))
def test_times_add_up_and_do_not_depend_on_direction(law, size, one, other):
    whole = curve(PARABOLA, 2.0 * size, 0.0, (one, other))
    middle = 0.3 * one + 0.7 * other
    parts = [curve(PARABOLA, 2.0 * size, 0.0, span) for span in ((one, middle), (middle, other))]
    back = travel_time(whole.reversed(np.array([True])), law, 0.4)[0]
    total = travel_time(whole, law, 0.4)[0]
    assert back == total
    assert sum(travel_time(p, law, 0.4)[0] for p in parts) == pytest.approx(total, rel=1e-12, abs=1e-13)
