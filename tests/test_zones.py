"""Zones, where they touch obstacles, and how fast is safe: exact cases, and against Shapely."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.optimize import fsolve

from vnav_drake.braking import UniformBraking
from vnav_drake.world import Obstacle, World
from vnav_drake.zones.convex_zone import GaugeZone
from vnav_drake.zones.held_arc import TurnLimit, arc_excess, greatest_turn, least_ahead
from vnav_drake.zones.shapes import DiscZone, EllipseZone, PolygonZone, ProtectiveField
from vnav_drake.zones.speed import least_gap, safe_speed
from vnav_drake.zones.touch import separation, stopping_room

Array = NDArray[np.float64]

LAW = UniformBraking(max_braking=1.0)
SLOW = UniformBraking(max_braking=1.3, reaction_time=0.2, margin=0.05)
TRIANGLE = Obstacle(((4.0, 3.0), (5.0, 3.0), (4.5, 4.0)))
KITE = ((-0.1, -0.2), (1.0, -0.3), (1.1, 0.0), (1.0, 0.3), (-0.1, 0.2))
ZONES: list[GaugeZone] = [
    DiscZone(law=SLOW, radius=0.4),
    EllipseZone(law=SLOW, radius=0.4, lateral_ratio=0.5),
    EllipseZone(law=SLOW, radius=0.0, lateral_ratio=0.3, ahead=1.2, behind=0.1),
    ProtectiveField(law=SLOW, radius=0.4),
    ProtectiveField(law=SLOW, radius=0.4, form="rectangle", side=0.1),
    PolygonZone(law=SLOW, radius=0.3, vertices=KITE),
]


def room(zone: GaugeZone, corners: list[list[float]]) -> float:
    return float(stopping_room(zone, np.array([corners]))[0][0])


def corridor(half_width: float) -> World:
    return World.build(
        [(-40.0, -half_width), (40.0, -half_width), (40.0, half_width), (-40.0, half_width)], []
    )


@pytest.mark.parametrize("ratio", [1.0, 0.5, 0.3])
def test_speed_along_a_corridor(ratio: float) -> None:
    """Walls touch the ellipse at its side: beta D = W - rho, so v = sqrt(2 a (W - rho) / beta)."""
    zone = EllipseZone(law=LAW, radius=0.4, lateral_ratio=ratio)
    speed = safe_speed(zone, corridor(1.0), np.array([[0.0, 0.0, 0.0]]))[0]
    assert speed == pytest.approx(math.sqrt(2.0 * 0.6 / ratio), abs=1e-9)


def test_speed_across_a_corridor() -> None:
    """At 45 degrees h_E = sqrt((1 + beta^2) / 2), so D = (W - rho) / h_E: 1.2749451390 m/s for beta 0.3."""
    zone = EllipseZone(law=LAW, radius=0.4, lateral_ratio=0.3)
    speed = safe_speed(zone, corridor(1.0), np.array([[0.0, 0.0, 0.25 * math.pi]]))[0]
    assert speed == pytest.approx(math.sqrt(2.0 * 0.6 / math.sqrt(0.5 * 1.09)), abs=1e-9)


def gauge_of_point(x: float, y: float, ratio: float, radius: float) -> float:
    """D whose ellipse, semi-axes (D, beta D), is `radius` away from (x, y), by root finding.

    The foot point (D cos t, beta D sin t) has (x, y) on its normal (beta cos t, sin t), at that distance.
    """

    def miss(unknown: Array) -> list[float]:
        far, t = unknown
        normal = np.array([ratio * math.cos(t), math.sin(t)])
        normal *= radius / float(np.hypot(*normal))
        return [far * math.cos(t) + normal[0] - x, ratio * far * math.sin(t) + normal[1] - y]

    found = fsolve(miss, [math.hypot(x, y / ratio) - radius, math.atan2(y / ratio, x)], xtol=1e-13)
    assert np.abs(miss(found)).max() < 1e-12
    return float(found[0])


@pytest.mark.parametrize("ratio", [0.5, 0.3])
def test_room_in_front_of_a_vertex(ratio: float) -> None:
    zone = EllipseZone(law=LAW, radius=0.4, lateral_ratio=ratio)
    assert room(zone, [[3.0, 1.0]]) == pytest.approx(gauge_of_point(3.0, 1.0, ratio, 0.4), abs=1e-9)


def test_room_of_a_point_robot_in_front_of_a_vertex() -> None:
    """Radius zero: sqrt(x^2 + y^2 / beta^2)."""
    zone = EllipseZone(law=LAW, radius=0.0, lateral_ratio=0.3)
    assert room(zone, [[3.0, 1.0]]) == pytest.approx(math.hypot(3.0, 1.0 / 0.3), rel=1e-12)


def test_room_of_a_capsule() -> None:
    """A vertex at (x, y) ahead is reached at x - sqrt(r^2 - y^2); one beside it or behind it never."""
    zone = ProtectiveField(law=LAW, radius=0.4)
    assert room(zone, [[3.0, 0.3]]) == pytest.approx(3.0 - math.sqrt(0.4**2 - 0.3**2), abs=1e-9)
    assert room(zone, [[3.0, 0.41]]) == math.inf
    assert room(zone, [[-0.6, 0.0]]) == math.inf
    assert room(zone, [[0.2, 0.0]]) == 0.0  # in the body


def test_an_ellipse_with_ratio_one_is_uniform_braking() -> None:
    rng = np.random.default_rng(3)
    world = World.build([(0, 0), (9, 0), (9, 7), (0, 7)], [TRIANGLE])
    poses = np.column_stack([rng.uniform(0.6, 3.5, 50), rng.uniform(0.6, 6.4, 50), rng.uniform(-4, 4, 50)])
    zone = EllipseZone(law=SLOW, radius=0.4, lateral_ratio=1.0)
    uniform = SLOW.speed(world.distance(poses[:, :2]) - 0.4)
    assert safe_speed(zone, world, poses) == pytest.approx(uniform, abs=1e-9)


def hull(seed: int, far: float) -> tuple[shapely.Geometry, Array]:
    """A convex polygon around a place `far` from the robot, and its corners, padded to six."""
    rng = np.random.default_rng(seed)
    angle = rng.uniform(-math.pi, math.pi)
    centre = far * np.array([math.cos(angle), math.sin(angle)])
    points = centre + rng.uniform(-1.0, 1.0, (6, 2)) * rng.uniform(0.05, 1.0)
    polygon = shapely.geometry.polygon.orient(shapely.MultiPoint(points).convex_hull)
    ring = shapely.get_coordinates(polygon)[:-1]
    return polygon, np.concatenate([ring, np.repeat(ring[-1:], 6 - len(ring), axis=0)])


@pytest.mark.parametrize("zone", ZONES, ids=lambda zone: f"{zone.type_name}-{zone.radius}")
@given(seed=st.integers(0, 10**6), far=st.floats(0.2, 7.0), speed=st.floats(0.0, 2.5))
@settings(max_examples=25, deadline=None)
def test_separation_is_shapelys(zone: GaugeZone, seed: int, far: float, speed: float) -> None:
    """The outline lies on the zone's boundary; with m points a circle of radius R is R (pi/m)^2/2 away."""
    obstacle, corners = hull(seed, far)
    found = separation(zone, corners[None], np.array([speed]))
    outline = shapely.Polygon(zone.outline(speed, 4000))
    apart = shapely.distance(outline, obstacle)
    if apart > 0.0:
        # between points of the outline an ellipse's tip bulges by at most a share of its length
        assert found.gap[0] == pytest.approx(apart, abs=2e-5)
        assert found.gap[0] <= apart + 1e-9  # the outline is inside the zone
    else:
        assert found.gap[0] <= 1e-9


@pytest.mark.parametrize("zone", ZONES, ids=lambda zone: f"{zone.type_name}-{zone.radius}")
@given(seed=st.integers(0, 10**6), far=st.floats(1.5, 7.0))
@settings(max_examples=15, deadline=None)
def test_room_touches(zone: GaugeZone, seed: int, far: float) -> None:
    """At the greatest stopping distance the gap is zero, and a longer zone reaches in."""
    _, corners = hull(seed, far)
    found, _ = stopping_room(zone, corners[None])
    if not 0.0 < found[0] < math.inf:
        return
    speed = zone.law.speed(found + zone.law.margin)
    assert separation(zone, corners[None], speed).gap[0] == pytest.approx(0.0, abs=1e-10)
    assert separation(zone, corners[None], 1.01 * speed).gap[0] < 0.0


@pytest.mark.parametrize("zone", ZONES, ids=lambda zone: f"{zone.type_name}-{zone.radius}")
def test_slopes_of_the_support_function(zone: GaugeZone) -> None:
    """Against central differences, away from kinks."""
    angle = np.linspace(-3.0, 3.1, 41) + 0.0123
    apart = np.abs(np.remainder(angle[:, None] - zone.kinks + math.pi, 2.0 * math.pi) - math.pi)
    angle = angle[np.all(apart > 1e-3, axis=1)]
    step, speed = 1e-6, np.full(len(angle), 1.4)
    _, by_angle, by_speed = zone.support(angle, speed)
    sides = [zone.support(angle + sign * step, speed)[0] for sign in (1.0, -1.0)]
    speeds = [zone.support(angle, speed + sign * step)[0] for sign in (1.0, -1.0)]
    assert by_angle == pytest.approx((sides[0] - sides[1]) / (2.0 * step), abs=1e-7)
    assert by_speed == pytest.approx((speeds[0] - speeds[1]) / (2.0 * step), abs=1e-7)
    assert np.all(by_speed >= 0.0)


@pytest.mark.parametrize("zone", ZONES, ids=lambda zone: f"{zone.type_name}-{zone.radius}")
def test_discs_in_and_around_a_zone(zone: GaugeZone) -> None:
    angle = np.linspace(-math.pi, math.pi, 5000)
    for speed in (0.0, 0.7, 2.0):
        reach = zone.support(angle, np.full(len(angle), speed))[0]
        inner, outer = zone.inner_law(), zone.outer_law()
        assert outer is not None
        assert float(outer.distance(speed)) + zone.radius >= reach.max() - 1e-12
        if inner is not None:
            assert float(inner.distance(speed)) + zone.radius <= reach.min() + 1e-12


def test_a_protective_field_has_no_disc_in_it() -> None:
    assert ProtectiveField(law=LAW, radius=0.4).inner_law() is None


def test_least_gap_of_all_obstacles() -> None:
    """In the middle of a corridor of half-width 1, an ellipse of half-width 0.4 + 0.5 * 0.5 at v = 1."""
    zone = EllipseZone(law=LAW, radius=0.4, lateral_ratio=0.5)
    gap = least_gap(zone, corridor(1.0), np.array([[0.0, 0.0, 0.0]]), np.array([1.0]))
    assert gap[0] == pytest.approx(1.0 - 0.4 - 0.25, abs=1e-12)


class TestHeldArcs:
    def test_an_ellipse_must_be_longer_than_the_stop(self) -> None:
        """Friction 1.2 a_b leaves kappa D <= sqrt(0.44)/2; the ends of the arcs lie on the ellipse then."""
        turn = 0.5 * math.sqrt(1.2**2 - 1.0)
        for ratio in (0.5, 0.3):
            ahead = least_ahead(ratio, turn)
            x = np.linspace(1e-6, turn, 2000)
            out = np.hypot(np.sin(x) / x / ahead, (1.0 - np.cos(x)) / x / ratio)
            assert out.max() == pytest.approx(1.0, abs=1e-6)

    def test_wide_ellipses_hold_all_arcs(self) -> None:
        """(sin x / x)^2 + ((1 - cos x)/(beta x))^2 <= 1 near 0 asks for beta^2 >= 3/4."""
        assert least_ahead(math.sqrt(0.75), 0.5) == pytest.approx(1.0, abs=1e-6)
        assert greatest_turn(EllipseZone(law=LAW, radius=0.4, lateral_ratio=0.86), 1.0) == 0.0
        assert TurnLimit.of(DiscZone(law=LAW, radius=0.4)) is None

    def test_a_capsule_turns_within_its_margin(self) -> None:
        """The arc ends D (1 - cos x)/x beside the line: that is the margin at the greatest x."""
        zone = ProtectiveField(law=UniformBraking(max_braking=1.0, margin=0.1), radius=0.4)
        for far in (0.5, 1.0, 4.0):
            x = greatest_turn(zone, far)
            assert far * (1.0 - math.cos(x)) / x == pytest.approx(0.1, abs=1e-6)

    def test_a_reachable_stopping_distance_is_the_inverse(self) -> None:
        zone = ProtectiveField(law=UniformBraking(max_braking=1.0, margin=0.1), radius=0.4)
        limit = TurnLimit.of(zone)
        assert limit is not None
        curvature = np.array([0.0, 0.01, -0.2, 1.0])
        far = limit.stopping_distance(curvature)
        assert far[0] == math.inf
        assert np.abs(curvature[1:]) * far[1:] == pytest.approx(limit.greatest(far[1:])[0], rel=1e-9)

    def test_excess_and_its_slope(self) -> None:
        """Of a capsule: (1 - cos x)/x, by hand and by differences."""
        zone = ProtectiveField(law=LAW, radius=0.4)
        x = np.array([1e-5, 0.2, 0.9])
        excess, slope = arc_excess(zone, x)
        assert excess == pytest.approx((1.0 - np.cos(x)) / x, abs=1e-9)
        step = 1e-6
        around = [arc_excess(zone, x + sign * step)[0] for sign in (1.0, -1.0)]
        assert slope == pytest.approx((around[0] - around[1]) / (2.0 * step), abs=1e-7)

    def test_a_lopsided_zone_turns_as_its_narrow_side_allows(self) -> None:
        """E reaches 0.02 to the right and 0.6 to the left, where wider turns would stay inside."""
        lopsided = ((-0.2, -0.02), (1.05, -0.02), (1.05, 0.6), (-0.2, 0.6))
        mirrored = tuple((x, -y) for x, y in lopsided)
        turns = [
            greatest_turn(PolygonZone(law=LAW, radius=0.3, vertices=vertices), 1.0)
            for vertices in (lopsided, mirrored)
        ]
        assert turns[0] == pytest.approx(turns[1], rel=1e-9)
        assert (1.0 - math.cos(turns[0])) / turns[0] == pytest.approx(0.02, abs=4e-4)  # of the table


def test_a_wall_a_mile_ahead_is_at_a_finite_distance() -> None:
    zone = EllipseZone(law=LAW, radius=0.4, lateral_ratio=0.5)
    assert room(zone, [[1600.0, -9.0], [1600.0, 9.0]]) == pytest.approx(1599.6, rel=1e-12)


@settings(max_examples=60, deadline=None)
@given(
    wide=st.floats(0.01, 3.0), ahead=st.floats(1.0, 1.5), share=st.one_of(st.none(), st.floats(0.001, 1.0))
)
def test_disc_in_an_ellipse_is_the_greatest_to_rounding(wide, ahead, share):
    # Its radius is the least of h. Around the best of 20,001 angles 2,001 finer ones are within 3e-7 of the
    # least's place, so by h'' <= 1e4 (from B^2 and 1/B^3) within 1e-9 of its value.
    zone = EllipseZone(
        law=LAW,
        radius=0.4,
        lateral_ratio=wide,
        ahead=ahead,
        behind=None if share is None else share * ahead,
    )
    angle = np.linspace(-math.pi, math.pi, 20_001)
    for width in (2.0 * math.pi / 20_000, None):
        h = zone.shape(angle)[0]
        if width is not None:
            best = angle[np.argmin(h)]
            angle = np.linspace(best - width, best + width, 2_001)
    assert zone.inscribed <= h.min() * (1.0 + 1e-12)
    assert zone.inscribed == pytest.approx(h.min(), abs=1e-9)


def test_disc_in_a_polygon_touches_its_nearest_edge():
    # Edges: x = -0.004, x = 1, and from (-0.004, 0.3) to (1, 0.2) with its mirror image, which are further.
    zone = PolygonZone(law=LAW, radius=0.4, vertices=((-0.004, -0.3), (1.0, -0.2), (1.0, 0.2), (-0.004, 0.3)))
    assert zone.inscribed == pytest.approx(0.004, rel=1e-11)
    assert zone.inscribed <= 0.004
    assert zone.inner_law() is not None
