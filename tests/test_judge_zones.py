"""Braking zones as the judge sees them: their reach, their distance to obstacles, over a whole motion."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from judged import arcs_motion, setting

from verify.judge.checks import check_motion
from verify.judge.zones import GaugeZone, ZoneError, least_arc_room, least_separation, separation
from verify.judge.zones.asked import least_ahead
from verify.judge.zones.fields import given_fields
from verify.judge.zones.sampled import sampled_faults
from verify.judge.zones.shapes import Box, Disc, Ellipse, Hull, Measured, Shape, Straight
from verify.judge.zones.zone import FieldSet, ForeignZone
from vnav_drake.scenario import ScenarioError
from vnav_drake.zones import plugins
from vnav_drake.zones.convex_zone import ConvexZone
from vnav_drake.zones.convex_zone import GaugeZone as PlannersGaugeZone

POLYGON = ((-0.2, -0.3), (0.4, -0.5), (1.0, -0.1), (1.0, 0.2), (0.1, 0.6))
SHAPES: dict[str, Shape] = {
    "disc": Disc(1.0),
    "ellipse": Ellipse(0.0, 1.0, 0.3),
    "wide ellipse": Ellipse(0.0, 1.1, 1.4),
    "one-sided ellipse": Ellipse(0.35, 0.65, 0.4),
    "half ellipse": Ellipse(0.5, 0.5, 0.3),
    "straight": Straight(),
    "polygon": Hull(POLYGON),
}
BODIES: dict[str, Shape] = {"disc": Disc(0.4), "box": Box(0.4, 0.55), "point": Disc(0.0)}


def gauge(shape: Shape, body: Shape = BODIES["point"], *, reaction_time: float = 0.0) -> GaugeZone:
    return GaugeZone(shape, body, 1.0, reaction_time)


def corners(shape: Shape) -> np.ndarray:
    """Points of a shape's boundary, from its definition and not from its support function."""
    t = np.linspace(-math.pi, math.pi, 20_001)
    if isinstance(shape, Disc):
        return shape.radius * np.column_stack([np.cos(t), np.sin(t)])
    if isinstance(shape, Ellipse):
        return np.column_stack([shape.centre + shape.long * np.cos(t), shape.wide * np.sin(t)])
    if isinstance(shape, Straight):
        return np.array([[0.0, 0.0], [1.0, 0.0]])
    if isinstance(shape, Box):
        return np.array([[x, y] for x in (-shape.long, shape.long) for y in (-shape.wide, shape.wide)])
    return np.array(POLYGON)


@pytest.mark.parametrize("name", SHAPES)
def test_support_extent_and_inscribed_disc_are_those_of_the_points(name):
    # By definition h(n) = max n.p, the extent is max |p|; 20,001 points miss either by 1e-8 at most
    # ((pi / 20,000)^2 / 2 times the radius of curvature). The inscribed disc has the least h.
    shape, points = SHAPES[name], corners(SHAPES[name])
    angle = np.linspace(-math.pi, math.pi, 721)
    normal = np.column_stack([np.cos(angle), np.sin(angle)])
    assert shape.support(angle) == pytest.approx((points @ normal.T).max(axis=0), abs=5e-8)
    assert shape.extent == pytest.approx(np.hypot(*points.T).max(), abs=5e-8)
    assert shape.inscribed <= shape.support(angle).min() + 1e-12
    # |h'| <= extent, and the nearest of the angles is 0.25 degrees away at most
    assert shape.inscribed >= shape.support(angle).min() - math.radians(0.25) * shape.extent


coordinate = st.floats(-6.0, 6.0)


@settings(max_examples=40, deadline=None)
@given(
    name=st.sampled_from(sorted(SHAPES)),
    body=st.sampled_from(sorted(BODIES)),
    speed=st.floats(0.0, 3.0),
    ends=st.tuples(*[coordinate] * 4),
)
def test_separation_is_shapelys_distance_from_the_zone_as_a_polygon(name, body, speed, ends):
    # The zone as a polygon of points on its boundary is inside of it, by 1e-8 of its size at most; where
    # it is further than that from an obstacle, both distances are the same to that.
    zone = gauge(SHAPES[name], BODIES[body], reaction_time=0.2)
    far = 0.2 * speed + 0.5 * speed**2
    stretched = shapely.MultiPoint(far * corners(SHAPES[name])).convex_hull
    if isinstance(BODIES[body], Disc):
        outline = stretched.buffer(BODIES[body].radius, quad_segs=1000) if body == "disc" else stretched
    else:
        outline = shapely.MultiPoint(
            (shapely.get_coordinates(stretched)[:, None] + corners(BODIES[body])[None]).reshape(-1, 2)
        ).convex_hull
    found, angle = separation(zone, np.array([ends]), np.zeros(1), np.array([speed]))
    truth = outline.distance(shapely.LineString(np.reshape(ends, (2, 2))))
    if truth > 1e-6:
        assert found[0] == pytest.approx(truth, abs=1e-6)
    else:
        assert found[0] <= 1e-6
    # any direction gives a lower bound, so that which is told must give what is told
    normal = np.array([math.cos(angle[0]), math.sin(angle[0])])
    reach = zone.support(angle[:1], np.array([speed]))[0]
    assert (np.reshape(ends, (2, 2)) @ normal).min() - reach == pytest.approx(found[0], abs=1e-12)


def touching(zone: GaugeZone, ends: tuple[float, ...]) -> float:
    """The stopping distance [m] at which a zone touches a feature, by bisection."""
    low, high = 0.0, 20.0
    for _ in range(100):
        middle = 0.5 * (low + high)
        gap = separation(zone, np.array([ends]), np.zeros(1), np.array([math.sqrt(2.0 * middle)]))[0]
        low, high = (middle, high) if gap[0] > 0.0 else (low, middle)
    return low


def test_the_zone_touches_walls_and_vertices_where_closed_forms_say():
    # A wall along y = -W: it is in the way when rho + D h(phi) = W, with h(90 deg) = beta beside the robot.
    # Axial speed sqrt(2 a (W - rho) / beta): 1.0954451150, 1.5491933385 and 2 m/s for W = 1, rho = 0.4.
    for beta, speed in ((1.0, 1.0954451150), (0.5, 1.5491933385), (0.3, 2.0)):
        zone = gauge(Ellipse(0.0, 1.0, beta), Disc(0.4))
        assert math.sqrt(2.0 * touching(zone, (-99.0, -1.0, 99.0, -1.0))) == pytest.approx(speed, abs=1e-9)
    # At 45 degrees to it, h^2 = (1 + beta^2) / 2, so v^2 = 2 * 0.6 / sqrt(0.545): 1.2749451390 m/s.
    tilted = (-99.0, 99.0 - math.sqrt(2.0), 99.0, -99.0 - math.sqrt(2.0))
    zone = gauge(Ellipse(0.0, 1.0, 0.3), Disc(0.4))
    speed = math.sqrt(1.2 / math.sqrt(0.545))
    assert math.sqrt(2.0 * touching(zone, tilted)) == pytest.approx(speed, abs=1e-9)
    # A point robot with an ellipse: D = sqrt(x^2 + y^2 / beta^2). A capsule: D = x - sqrt(r^2 - y^2).
    assert touching(gauge(Ellipse(0.0, 1.0, 0.5)), (3.0, 1.0, 3.0, 1.0)) == pytest.approx(math.sqrt(13.0))
    capsule = gauge(Straight(), Disc(0.4))
    assert touching(capsule, (3.0, 0.3, 3.0, 0.3)) == pytest.approx(3.0 - math.sqrt(0.07), abs=1e-9)
    assert touching(capsule, (3.0, 0.5, 3.0, 0.5)) == pytest.approx(20.0, abs=1e-9)  # beside it: never


@pytest.mark.parametrize(("beta", "distance"), [(0.5, 3.0723399263), (0.3, 3.5385235371)])
def test_a_vertex_before_a_disc_robot_with_an_ellipse(beta, distance):
    # The ellipse point (D cos t, beta D sin t) nearest to (3, 1) is 0.4 away: two equations for D and t
    # (distance, and the difference normal to the ellipse), solved here by bisection in t.
    def equations(t: float) -> tuple[float, float]:
        # along the normal (beta cos t, sin t) at t: (3, 1) = (D cos t, beta D sin t) + 0.4 n
        n = np.array([beta * math.cos(t), math.sin(t)]) / math.hypot(beta * math.cos(t), math.sin(t))
        x, y = np.array([3.0, 1.0]) - 0.4 * n
        return x / math.cos(t), y / (beta * math.sin(t))

    low, high = 1e-3, 1.5
    for _ in range(100):
        middle = 0.5 * (low + high)
        ahead, aside = equations(middle)
        low, high = (middle, high) if ahead < aside else (low, middle)
    assert equations(low)[0] == pytest.approx(distance, abs=1e-9)
    zone = gauge(Ellipse(0.0, 1.0, beta), Disc(0.4))
    assert touching(zone, (3.0, 1.0, 3.0, 1.0)) == pytest.approx(distance, abs=1e-9)


# Features of a hall of 40 x 4 m with a pillar, a circle and a wall's end in it.
TABLE = np.array(
    [
        *([0.0, 0.0, 40.0, 0.0, 0.0], [40.0, 0.0, 40.0, 4.0, 0.0]),
        *([40.0, 4.0, 0.0, 4.0, 0.0], [0.0, 4.0, 0.0, 0.0, 0.0]),
        *([12.0, 3.5, 12.0, 3.5, 0.0], [20.0, 0.2, 20.0, 0.2, 0.1], [25.0, 4.0, 25.0, 3.3, 0.0]),
    ]
)


@st.composite
def motions(draw):
    bends = draw(st.lists(st.floats(-0.4, 0.4), min_size=3, max_size=8))
    speeds = draw(st.lists(st.floats(0.1, 2.0), min_size=len(bends) + 1, max_size=len(bends) + 1))
    lengths = draw(st.lists(st.floats(0.3, 2.0), min_size=len(bends), max_size=len(bends)))
    heading = draw(st.floats(-0.3, 0.3))
    return arcs_motion((5.0, 2.0), heading, list(zip(lengths, bends, strict=True)), speeds)


@settings(max_examples=25, deadline=None)
@given(motion=motions(), name=st.sampled_from(sorted(SHAPES)), body=st.sampled_from(sorted(BODIES)))
def test_the_proven_separation_is_below_that_of_every_instant_and_as_good_as_attained(motion, name, body):
    zone = gauge(SHAPES[name], BODIES[body], reaction_time=0.3)
    least = least_separation(motion, TABLE, zone)
    assert least.proven <= least.attained
    tolerance = 1e-7 if least.attained > 0.0 else 1e-7 - 2e-3 * least.attained
    assert least.attained - least.proven <= tolerance
    row = np.repeat(np.arange(len(motion.step)), 41)
    along = np.tile(np.linspace(0.0, 1.0, 41), len(motion.step)) * motion.step[row]
    place = motion.position(row, along)
    heading = motion.heading[row] + motion.curvature[row] * along
    cos, sin = np.cos(heading), np.sin(heading)
    for feature in TABLE:
        x, y = (feature[[0, 2]] - place[:, :1]).T, (feature[[1, 3]] - place[:, 1:]).T
        ends = np.stack([cos * x[0] + sin * y[0], cos * y[0] - sin * x[0]], axis=1)
        ends = np.hstack([ends, np.stack([cos * x[1] + sin * y[1], cos * y[1] - sin * x[1]], axis=1)])
        gap, _ = separation(zone, ends, np.full(len(row), feature[4]), motion.speed(row, along))
        assert gap.min() >= least.proven - 1e-12


def test_the_disc_is_uniform_braking():
    # rho + D(v) away from everything: the same as the distance less the braking distance.
    within = setting(braking={"reaction_time": 0.2, "margin": 0.1})
    arcs = [(6.0, 0.02), (8.0, -0.025), (10.0, 0.01)]
    motion = arcs_motion((5.0, 2.0), 0.0, arcs, [0.5, 1.1, 0.9, 1.3], within)
    check = next(c for c in check_motion(motion, "refined", "full", within) if c.name == "braking_distance")
    assert check.worst > 0.0
    zone = gauge(Disc(1.0), Disc(0.6), reaction_time=0.2)
    found = least_separation(motion, within.features.table, zone)
    assert found.proven == pytest.approx(check.worst, abs=2e-8)


def test_an_arc_that_grazes_a_point_between_its_rows_is_caught():
    # Half a circle of radius 2 m around (20, 0) from (22, 0) to (18, 0), at rest at neither end; a
    # point robot with a capsule looks D = 0.5 ahead along its tangent. The tip is sqrt(4 + 0.25) m
    # from the centre. A point at that distance, above the circle's top, is touched half way only; at both
    # rows it is metres away.
    motion = arcs_motion((22.0, 0.0), 0.5 * math.pi, [(2.0 * math.pi, 0.5)], [1.0, 1.0])
    reach = math.hypot(2.0, 0.5)
    for beyond in (1e-4, -1e-4):
        point = np.array([[20.0, reach + beyond, 20.0, reach + beyond, 0.0]])
        least = least_separation(motion, point, gauge(Straight()))
        # the segment from the circle to its tip sweeps a ring; the point is outside of it by `beyond`
        if beyond > 0.0:
            assert least.proven == pytest.approx(beyond, abs=1e-7)
        else:
            assert least.proven < 0.0
        at = math.atan2(0.5, 2.0)  # the tip is ahead by this angle, so the robot is before the top
        assert least.t == pytest.approx(2.0 * (0.5 * math.pi - at), abs=0.05)


def test_a_kink_counts_with_the_poses_before_and_after_it_only():
    # A point robot with a capsule at 1 m/s (D = 0.5) turns by 90 degrees at (5, 2) without moving. A point
    # at 45 degrees, 0.4 m away, is in neither direction's zone: sin 45 * 0.4 away from both.
    first = arcs_motion((4.0, 2.0), 0.0, [(1.0, 0.0)], [1.0, 1.0])
    second = arcs_motion((5.0, 2.0), 0.5 * math.pi, [(1.0, 0.0)], [1.0, 1.0])
    names = ("t", "x", "y", "heading", "v", "a", "curvature", "clearance")
    columns = [np.concatenate([getattr(first, n), getattr(second, n)]) for n in names]
    columns[0][2:] += 1.0
    motion = type(first)(*columns)
    aside = 0.4 * math.sqrt(0.5)
    point = np.array([[5.0 + aside, 2.0 + aside, 5.0 + aside, 2.0 + aside, 0.0]])
    assert least_separation(motion, point, gauge(Straight())).proven == pytest.approx(aside, abs=1e-7)
    # and the last pose counts, also where only a turn leads there
    ending = type(first)(*[column[:3] for column in columns])
    above = np.array([[5.0, 2.3, 5.0, 2.3, 0.0]])
    assert least_separation(ending, above, gauge(Straight())).proven <= 1e-9
    assert least_separation(first, above, gauge(Straight())).proven == pytest.approx(0.3, abs=1e-7)


def test_fields_switch_with_the_speed_and_a_zone_of_unknown_growth_is_bounded_by_its_row():
    # Two rows towards a wall at x = 40: from 1 to 2 m/s in 1.5 m, then on at 2 m/s.
    motion = arcs_motion((5.0, 2.0), 0.0, [(1.5, 0.0), (30.0, 0.0)], [1.0, 2.0, 2.0])
    wall = np.array([[40.0, 0.0, 40.0, 4.0, 0.0]])
    fields = FieldSet(np.array([1.5, 2.5]), (Box(1.0, 0.5), Box(3.2, 0.5)))
    # the larger field at the end of the way: 40 - 36.5 - 3.2
    assert least_separation(motion, wall, fields).proven == pytest.approx(0.3, abs=1e-7)
    assert fields.case(np.array([0.0, 1.5, 1.5 + 1e-9, 2.5, 9.0])).tolist() == [0, 0, 1, 1, 1]
    # the first field up to 1.5 m/s, which is reached after (1.5^2 - 1) / 2 = 0.625 m, then the second:
    # a point 3.3 m ahead of there is 0.1 m from the second field at the switch, and nearer later
    point = np.array([[8.925, 2.0, 8.925, 2.0, 0.0]])
    start = arcs_motion((5.0, 2.0), 0.0, [(0.625, 0.0)], [1.0, 1.5])
    assert least_separation(start, point, fields).proven == pytest.approx(2.3, abs=1e-7)
    foreign = ForeignZone(lambda angle, speed: 0.1 + 0.0 * angle + speed, np.empty(0))
    found = least_separation(motion, wall, foreign)
    assert found.attained == pytest.approx(40.0 - 36.5 - 2.1, abs=1e-7)
    assert found.attained - 1e-4 <= found.proven <= found.attained


def test_the_room_of_held_arcs_is_that_of_their_ends():
    # Full braking from v = 1 on curvature kappa: the arc of length D = 1/2 ends at
    # (sin x, 1 - cos x) / kappa with x = kappa D. A capsule with 0.1 m beside: the room left is
    # 0.1 - (1 - cos x) / kappa, and none but that sideways.
    for kappa in (0.4, -0.7, 1.2):
        motion = arcs_motion((5.0, 2.0), 0.0, [(0.5, kappa)], [0.8, 1.0])
        within = setting(robot={"radius": 0.4})
        found = least_arc_room(motion, gauge(Straight(), Disc(0.5)), within.limits)
        aside = (1.0 - math.cos(0.5 * kappa)) / abs(kappa)
        assert found is not None
        assert found.proven == pytest.approx(0.1 - aside, abs=3e-8)
        assert found.proven <= found.attained
    # In a disc every arc stays: its end is never further than its length.
    sharp = arcs_motion((5.0, 2.0), 0.0, [(0.5, 3.0)], [1.0, 1.0])
    room = least_arc_room(sharp, gauge(Disc(1.0), Disc(0.4)), within.limits)
    assert room is not None
    assert room.proven == pytest.approx(0.0, abs=2e-8)


@pytest.mark.parametrize("rows", [1, 3])
def test_the_room_of_held_arcs_is_the_least_of_all_speeds_of_a_row(rows):
    # A capsule with 0.05 m beside the robot, up to 1.9 m/s; beyond it, the disc of uniform braking, in which
    # every arc stays. So 1.9 m/s is the worst, within the row from 0.2 to 2 m/s: with D = 1.9^2 / 2 and
    # kappa = 0.4 the arc ends (1 - cos(kappa D)) / kappa aside.
    def reach(angle, speed):
        far = 0.5 * np.square(speed)
        return 0.45 + far * np.where(speed > 1.9, 1.0, np.maximum(np.cos(angle), 0.0))

    zone = ForeignZone(reach, np.array([-0.5 * math.pi, 0.5 * math.pi]))
    speeds = np.sqrt(np.linspace(0.04, 4.0, rows + 1))
    motion = arcs_motion((5.0, 2.0), 0.0, [(1.98 / rows, 0.4)] * rows, list(speeds))
    found = least_arc_room(motion, zone, setting(robot={"radius": 0.4}).limits)
    assert found is not None
    room = 0.05 - (1.0 - math.cos(0.4 * 0.5 * 1.9**2)) / 0.4
    assert room - 1e-6 <= found.proven <= room + 1e-9
    assert found.attained == pytest.approx(room, abs=1e-6)


def test_zones_of_plugins_are_looked_at_at_the_speeds_that_are_driven():
    def growing(angle, speed):
        return 0.5 + speed + 0.0 * angle

    def shrinking(angle, speed):  # from 1.5 m/s on
        return 0.5 + np.minimum(speed, 3.0 - speed) + 0.0 * angle

    def dented(angle, speed):  # 1 + v + e + e cos 4a: h + h'' is 1 + v + e - 15 e at least, here -1.3
        return 1.0 + 0.3 * (speed > 1.5) * (1.0 + np.cos(4.0 * angle)) + speed

    for reach, words in ((growing, ()), (shrinking, ("shrinks",)), (dented, ("not convex",))):
        zone = ForeignZone(reach, np.empty(0))
        assert sampled_faults(zone, np.linspace(0.0, 1.4, 30)) == ()
        faults = sampled_faults(zone, np.linspace(0.0, 1.9, 30))
        assert all(any(word in fault for fault in faults) for word in words)
        assert bool(faults) is bool(words)


def test_an_ellipse_that_reaches_ahead_as_derived_holds_every_arc_up_to_the_turn_and_no_shorter_one_does():
    # mu g = 1.2 a_b leaves sqrt(0.44) a_b for turning, so |kappa| D <= sqrt(0.44) / 2: A = 1.04 for
    # beta = 0.5 and 1.17 for 0.3, to the digits given.
    turn = 0.5 * math.sqrt(0.44)
    for beta, ahead in ((0.5, 1.04), (0.3, 1.17)):
        found = least_ahead(beta, turn)
        assert found == pytest.approx(ahead, abs=0.005)
        x = np.linspace(1e-3, turn, 5001)
        inside = (np.sin(x) / (x * found)) ** 2 + ((1.0 - np.cos(x)) / (x * beta)) ** 2
        assert inside.max() == pytest.approx(1.0, abs=1e-7)
    assert least_ahead(1.0, turn) == 1.0
    # wider than beta: (1 - cos x) / x reaches 0.3 at x = 0.62
    assert math.isinf(least_ahead(0.3, 0.63))


REFUSED = {
    "clockwise and not convex": [[0, 0], [1, 0], [0.5, 0.1], [0.5, 1]],
    "without the straight stop": [[-1, -1], [0.9, -1], [0.9, 1], [-1, 1]],
    "without the centre": [[0.5, -1], [2, -1], [2, 1], [0.5, 1]],
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_polygon_that_is_no_zone_is_refused(name):
    with pytest.raises((ZoneError, ScenarioError), match="vertices"):
        setting(braking={"zone": {"type": "polygon", "vertices": REFUSED[name]}})


def test_fields_that_are_not_nested_or_lack_the_straight_stop_are_refused():
    limits = setting().limits  # radius 0.5, a_b = 1: from 1 m/s a stop takes 0.5 m
    good = [[-0.6, -0.6], [1.1, -0.6], [1.1, 0.6], [-0.6, 0.6]]
    longer = [[-0.6, -0.6], [3.0, -0.6], [3.0, 0.6], [-0.6, 0.6]]
    fields = given_fields(
        [{"max_speed": 1.0, "polygon": good}, {"max_speed": 2.0, "polygon": longer}], limits
    )
    assert fields.extent(np.array([0.5, 1.5])) == pytest.approx([math.hypot(1.1, 0.6), math.hypot(3.0, 0.6)])
    short = [[-0.6, -0.6], [0.9, -0.6], [0.9, 0.6], [-0.6, 0.6]]
    narrow = [[-0.55, -0.55], [3.0, -0.55], [3.0, 0.55], [-0.55, 0.55]]
    for bad in (
        [{"max_speed": 1.0, "polygon": short}],
        [{"max_speed": 1.0, "polygon": good}, {"max_speed": 2.0, "polygon": narrow}],
        [{"max_speed": 1.0, "polygon": good}, {"max_speed": 0.5, "polygon": longer}],
    ):
        with pytest.raises(ZoneError):
            given_fields(bad, limits)


def test_a_function_that_is_no_support_function_is_refused():
    Measured(lambda a: 1.0 + 0.1 * np.cos(2.0 * a))  # h + h'' = 1 - 0.3 cos 2a > 0
    for function, words in (
        (lambda a: 1.0 + 0.5 * np.cos(2.0 * a), "convex"),  # 1 - 1.5 cos 2a < 0 ahead
        (np.cos, "centre"),
        (lambda a: np.where(a > 3.0, np.nan, 1.0), "finite"),
    ):
        with pytest.raises(ValueError, match=words):
            Measured(function)


def test_zones_that_are_discs_are_uniform_braking():
    for zone in ("uniform", {"type": "ellipse", "lateral_ratio": 1.0}):
        assert setting(braking={"zone": zone}).zone is None
    asked = setting(braking={"zone": {"type": "field_set", "count": 2}}).zone
    assert asked is not None
    assert asked.isotropic
    within = setting(braking={"zone": {"type": "ellipse", "lateral_ratio": 0.5}})
    assert within.zone is not None
    assert within.zone.within_disc(within.limits)
    for zone in ({"type": "ellipse", "ahead": 1.1}, {"type": "protective_field", "form": "rectangle"}):
        other = setting(braking={"zone": zone})
        assert other.zone is not None
        assert not other.zone.within_disc(other.limits)


@dataclass(frozen=True, kw_only=True)
class Oval(PlannersGaugeZone):
    """An ellipse half as wide as it is long, as a plugin would bring it."""

    type_name: ClassVar[str] = "oval"

    def shape(self, angle):
        h = np.hypot(np.cos(angle), 0.5 * np.sin(angle))
        return h, -0.75 * np.sin(angle) * np.cos(angle) / h


@dataclass(frozen=True, kw_only=True)
class Rounded(Oval):
    """The same, with a body and a reach ahead that are off by roundings."""

    type_name: ClassVar[str] = "rounded"

    def shape(self, angle):
        h, slope = super().shape(angle)
        return h * (1.0 - 1e-15), slope

    def body(self, angle):
        r = self.radius + self.law.margin
        return np.hypot(r * np.cos(angle), r * np.sin(angle)) * (1.0 - 1e-15), np.zeros_like(angle)


@dataclass(frozen=True, kw_only=True)
class Balloon(ConvexZone):
    """A disc that grows with the speed by a law of its own."""

    type_name: ClassVar[str] = "balloon"

    def support(self, angle, speed):
        h = self.radius + self.law.margin + speed + speed**2 + 0.0 * angle
        return h, 0.0 * h, 1.0 + 2.0 * speed + 0.0 * angle


def test_a_plugin_s_zone_is_judged_by_its_own_functions(monkeypatch):
    monkeypatch.setattr(plugins, "_registered", {"oval": Oval, "rounded": Rounded, "balloon": Balloon})
    motion = arcs_motion((5.0, 2.0), 0.0, [(1.0, 0.02)] * 3, [0.5, 1.0, 1.0, 0.8])
    checks = {}
    for zone in ("oval", {"type": "ellipse", "lateral_ratio": 0.5}, "rounded", "balloon"):
        within = setting(braking={"zone": zone}, robot={"radius": 0.4})
        found = {c.name: c for c in check_motion(motion, "refined", "full", within)}["braking_distance"]
        checks[str(zone)] = found
        assert within.zone is not None
        assert within.zone.plugin is ("functions of the plugin" in found.message)
    oval, ellipse, rounded, balloon = checks.values()
    assert oval.worst == pytest.approx(ellipse.worst, abs=2e-8)
    assert rounded.worst == pytest.approx(ellipse.worst, abs=2e-8)
    # at 1 m/s the balloon has 2.4 m, and the wall is 2 m less the way aside away
    aside = (1.0 - math.cos(0.04)) / 0.02
    assert balloon.worst == pytest.approx(2.0 - aside - 2.4, abs=2e-3)


def test_a_plugin_that_nobody_loaded_is_refused():
    with pytest.raises((ZoneError, ScenarioError), match="unknown"):
        setting(braking={"zone": "nowhere"})
