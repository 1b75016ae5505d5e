"""The lower bound with braking zones that depend on the heading: its parts, and exact times."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq, minimize_scalar

from vnav_drake import End, PlanningError, Problem, Robot, UniformBraking, World
from vnav_drake.lower_bound import lower_bound
from vnav_drake.lower_bound.features import Features
from vnav_drake.lower_bound.headings import ZoneLaw, zone_law
from vnav_drake.lower_bound.inscribed import BESIDE, ellipses
from vnav_drake.lower_bound.lengths import drive_time
from vnav_drake.lower_bound.shape import Ellipse, Polygon, shape_of
from vnav_drake.zones.convex_zone import GaugeZone
from vnav_drake.zones.shapes import EllipseZone, PolygonZone, ProtectiveField

LAW = UniformBraking(max_braking=1.0)
HALL = ((-20.0, 0.0), (30.0, 0.0), (30.0, 40.0), (-20.0, 40.0))
START, GOAL = (0.0, 1.0), (6.0, 2.0)
KITE = ((1.0, 0.0), (0.2, 0.6), (-0.5, 0.0), (0.2, -0.6))


def beside_a_wall(zone: GaugeZone | None, **changes) -> Problem:
    """A point robot beside the wall y = 0; the other walls are too far away to matter."""
    given = {
        "world": World.build(HALL, []),
        "robot": Robot(radius=0.0),
        "braking": LAW,
        "zone": zone,
        "start": End(position=START),
        "goal": End(position=GOAL),
    }
    return Problem(**(given | changes))


def ellipse(beta: float, **more) -> EllipseZone:
    return EllipseZone(law=LAW, radius=0.0, lateral_ratio=beta, **more)


def wall_time(beta: float, a: float = 1.0) -> float:
    """Least time [s] from START to GOAL beside the wall y = 0 with an ellipse, by quadrature.

    At height y and the angle al to the wall the zone reaches h(al) D towards it with h^2 = w = sin^2 al +
    beta^2 cos^2 al, so V = sqrt(2 a y) w^(-1/4). Nothing depends on x: by Clairaut's relation
    g(al) = cos al (beta^2 w^(-3/4) + w^(1/4)) / 2 = k sqrt(2 a y) along the path. From dy = g g' dal /
    (a k^2) follow dx = dy cos al / sin al and dT = dy w^(1/4) k / (g sin al); g' / sin al is smooth. k is
    such that x fits.
    """

    def w(al: float) -> float:
        return math.sin(al) ** 2 + (beta * math.cos(al)) ** 2

    def g(al: float) -> float:
        return 0.5 * math.cos(al) * (beta**2 * w(al) ** -0.75 + w(al) ** 0.25)

    def bent(al: float) -> float:  # g' / sin al
        own = beta**2 * w(al) ** -0.75 + w(al) ** 0.25
        rest = 0.25 * w(al) ** -0.75 - 0.75 * beta**2 * w(al) ** -1.75
        return -0.5 * own + math.cos(al) ** 2 * (1.0 - beta**2) * rest

    def ends(k: float) -> tuple[float, float]:
        up, down = (
            brentq(lambda al, y=y: g(al) - k * math.sqrt(2.0 * a * y), 0.0, 0.5 * math.pi)
            for y in (START[1], GOAL[1])
        )
        return up, -down  # the path rises, and falls to the goal

    def way(k: float) -> float:
        up, down = ends(k)
        return quad(lambda al: g(al) * bent(al) * math.cos(al) / (a * k * k), up, down, epsabs=1e-11)[0]

    highest = math.sqrt(beta / (2.0 * a * GOAL[1])) * (
        1.0 - 1e-9
    )  # g(0) = sqrt(beta): no higher than the goal
    k = brentq(lambda k: way(k) - (GOAL[0] - START[0]), 0.3 * highest, highest, xtol=1e-14)
    up, down = ends(k)
    return quad(lambda al: bent(al) * w(al) ** 0.25 / (a * k), up, down, epsabs=1e-12)[0]


@pytest.mark.parametrize("beta", [0.8, 0.5])
def test_bound_comes_close_to_the_exact_time_beside_a_wall_and_stays_below(beta):
    exact = wall_time(beta)
    found = lower_bound(beside_a_wall(ellipse(beta)), upper=exact, gap=1e-3)
    assert exact / 1.001 <= found.travel_time <= exact
    assert found.stopped == "gap"


def test_ellipse_of_ratio_one_is_bound_as_uniform_braking():
    # The cycloid of Manor 2015, eq. (3.9), through both ends: in `wall_time` beta = 1 gives g = cos al.
    exact = wall_time(1.0)
    found = lower_bound(beside_a_wall(ellipse(1.0)), upper=exact, gap=2e-3)
    assert exact / 1.002 <= found.travel_time <= exact


@dataclass(frozen=True, kw_only=True)
class Egg(GaugeZone):
    """Known by its support function only: a disc around (0.3, 0) and the point (1, 0)."""

    type_name: ClassVar[str] = "egg"

    def shape(self, angle):
        disc, point = 0.3 * np.cos(angle) + 0.4, np.cos(angle)
        far = point > disc
        return np.where(far, point, disc), np.where(far, -1.0, -0.3) * np.sin(angle)


@pytest.mark.parametrize(
    "zone",
    [
        ellipse(0.6, behind=0.4),
        PolygonZone(law=LAW, radius=0.0, vertices=KITE),
        Egg(law=LAW, radius=0.0),
    ],
    ids=["one-sided", "polygon", "own"],
)
def test_other_zones_are_bound_between_a_larger_and_a_smaller_disc(zone):
    # Nothing is slower with the inner disc and nothing faster with the outer one: D scales, so T with sqrt.
    uniform = wall_time(1.0)
    low, high = (uniform * math.sqrt(1.0 / law.max_braking) for law in (zone.inner_law(), zone.outer_law()))
    found = lower_bound(beside_a_wall(zone), budget=6000)
    assert 0.98 * low <= found.travel_time <= high


def least_room(zone: ZoneLaw, points: np.ndarray, reach: float, heading: float) -> float:
    """Stopping distance [m] at which a zone first touches one of many points: by search over the disc."""
    cos, sin = math.cos(heading), math.sin(heading)

    def gauge(angle: float, p: np.ndarray) -> float:
        x, y = p - reach * np.array([math.cos(angle), math.sin(angle)])
        # of an ellipse around 0
        return math.hypot((cos * x + sin * y) / zone.shape.long, (cos * y - sin * x) / zone.shape.wide)

    best = math.inf
    for p in points:
        base = math.atan2(p[1], p[0])
        found = minimize_scalar(
            gauge, bounds=(base - 1.6, base + 1.6), args=(p,), method="bounded", options={"xatol": 1e-12}
        )
        best = min(best, found.fun)
    return best


@pytest.mark.parametrize("heading", [0.0, 0.7, -2.0, 3.0])
def test_stopping_distances_to_points_and_walls_are_those_of_a_search_over_the_contact(heading):
    zone = ZoneLaw(Ellipse(1.0, 0.4, 0.0), 0.3, zone_law(beside_a_wall(ellipse(0.4))).law, 1.0)
    table = np.array([[2.0, 1.0, 2.0, 1.0, 0.1], [2.0, -1.0, 1.5, 2.0, 0.0]])
    found = zone.rooms(table, np.zeros((2, 2)), np.full((2, 1), heading))[:, 0]
    along = np.linspace(0.0, 1.0, 2001)[:, None]
    wall = table[1, :2] + along * (table[1, 2:4] - table[1, :2])
    assert found[0] == pytest.approx(least_room(zone, table[:1, :2], 0.4, heading), rel=1e-6)
    # points 1.5 mm apart, and the distance is flat where it is least
    assert found[1] == pytest.approx(least_room(zone, wall[::20], 0.3, heading), rel=1e-3)
    assert found[1] <= least_room(zone, wall[::100], 0.3, heading) * (1.0 + 1e-6)


def test_gauges_are_the_largest_quotient_over_all_directions():
    # gamma(z) = max over n of n.z / h(n), here at 7200 directions: low by at most 1e-6 of it.
    angle = np.linspace(-math.pi, math.pi, 7200, endpoint=False)
    n = np.stack([np.cos(angle), np.sin(angle)])
    z = np.random.default_rng(1).normal(size=(50, 2))
    for shape in (Ellipse(0.9, 0.5, 0.2), Polygon(np.array(KITE)), shape_of(Egg(law=LAW, radius=0.0))):
        dense = (z @ n / shape.support(angle)[0]).max(axis=1)
        found = shape.gauge(z[:, 0], z[:, 1])
        assert np.all(found >= dense * (1.0 - 1e-12))
        assert found == pytest.approx(dense, rel=2e-3)


def test_stopping_distance_is_convex_along_lines_for_each_heading():
    zone = zone_law(beside_a_wall(ellipse(0.5), robot=Robot(radius=0.2)))
    table = Features.of(World.build(HALL, [])).table
    rng = np.random.default_rng(2)
    one, two = rng.uniform((-15, 2), (25, 38), size=(2, 300, 2))
    which, heading = rng.integers(len(table), size=300), rng.uniform(-3, 3, size=(300, 1))
    first, middle, last = (zone.rooms(table[which], p, heading)[:, 0] for p in (one, 0.5 * (one + two), two))
    assert np.all(middle <= 0.5 * (first + last) + 1e-9)


def test_ellipses_of_gradients_keep_every_limit():
    # m(theta) = 1/V of an ellipse zone at a wall, for walls in 40 directions; both slots the same.
    heading = np.linspace(-3.0, 3.0, 40)
    w = np.square(np.sin(heading[:, None] + BESIDE)) + 0.25 * np.square(np.cos(heading[:, None] + BESIDE))
    minorant = np.repeat(np.power(w, 0.25)[:, None], 2, axis=1)
    found = ellipses(minorant, heading)
    fine = np.linspace(-math.pi, math.pi, 2000)
    t = np.stack([np.cos(fine), np.sin(fine)])
    shape = np.linalg.inv(found.inverse)
    reach = found.centre[:, 0] @ t + found.size[:, :1] * np.hypot(*np.einsum("nij,ik->jnk", shape, t))
    limit = np.power(np.square(np.sin(fine)) + 0.25 * np.square(np.cos(fine)), 0.25)
    assert np.all(reach <= limit * (1.0 + 5e-3))  # far from the touch headings are 0.25 rad apart
    at = np.power(np.square(np.sin(heading)) + 0.25 * np.square(np.cos(heading)), 0.25)
    t0 = np.stack([np.cos(heading), np.sin(heading)], axis=1)
    touch = np.einsum("ni,ni->n", found.centre[:, 0], t0)
    touch += found.size[:, 0] * np.linalg.norm(np.einsum("nij,ni->nj", shape, t0), axis=1)
    assert touch == pytest.approx(at, rel=1e-6)  # it touches in the flow's direction


def field(**changes) -> Problem:
    zone = ProtectiveField(law=LAW, radius=0.3)
    return beside_a_wall(zone, robot=Robot(radius=0.3), **changes)


def test_protective_field_is_bound_by_the_length_of_the_way_and_the_drive():
    # Nothing stands between: L = |S - G|; from rest to rest with a_max = a_b = 1 the way takes 2 sqrt(L).
    rest = {"start": End(position=START, speed="rest"), "goal": End(position=GOAL, speed="rest")}
    exact = 2.0 * math.sqrt(math.dist(START, GOAL))
    found = lower_bound(field(**rest), budget=20_000)
    assert exact * (1.0 - 1e-3) <= found.travel_time <= exact
    assert found.certificate.travel_time <= math.dist(START, GOAL)


def test_protective_field_with_free_ends_needs_a_greatest_speed():
    with pytest.raises(PlanningError, match="no lower bound"):
        lower_bound(field())
    capped = replace(LAW, max_speed=2.0)
    assert drive_time(field(braking=capped), 6.0) == pytest.approx(3.0, rel=1e-12)  # 6 m at 2 m/s


def test_zone_that_reaches_nowhere_behind_limits_no_speed_for_some_headings():
    assert zone_law(beside_a_wall(ellipse(0.5, behind=0.0))) is None
