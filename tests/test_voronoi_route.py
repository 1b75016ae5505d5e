"""The route along Voronoi arcs: exact cases, brute force, the warehouse, ends at rest, no way."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from tests.worlds import moved, moved_world, rectangle
from vnav_drake.braking import UniformBraking
from vnav_drake.problem import End, NoPathError, PlanningError, Problem
from vnav_drake.robot import Robot
from vnav_drake.voronoi import PARABOLA, build_diagram, travel_time
from vnav_drake.voronoi.legs import retraction, straight_leg
from vnav_drake.voronoi.network import build_network
from vnav_drake.voronoi.paths import DEVIATION, parabola_biarcs
from vnav_drake.voronoi_route import k_best_routes, plan_voronoi_route
from vnav_drake.voronoi_route.ends import end_cost_bound, time_with_ends
from vnav_drake.voronoi_route.search import Route, fastest_route, routes
from vnav_drake.world import Obstacle, World

Array = NDArray[np.float64]

HALL = ((0.0, 0.0), (40.0, 0.0), (40.0, 4.0), (0.0, 4.0))
SQUARE = ((0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0))
FOUR_POINTS = [Obstacle((p,)) for p in ((3.0, 3.0), (7.0, 3.5), (3.5, 7.0), (6.5, 6.5))]
MIXED = [
    rectangle(2.0, 2.0, 3.0, 1.5),
    Obstacle(((7.3, 2.1), (8.2, 4.4), (6.1, 3.7))),
    Obstacle(((3.0, 7.0), (6.0, 7.5))),
    Obstacle(((8.0, 8.3),)),
]
RACKS = [rectangle(float(x), float(y), 10.0, 5.0) for x in (4, 15) for y in (4, 10, 16, 22)]
FLOOR = ((0.0, 0.0), (32.0, 0.0), (32.0, 31.0), (0.0, 31.0))


def problem(
    world: World,
    start: tuple[float, float],
    goal: tuple[float, float],
    *,
    radius: float = 0.4,
    speed: float | str = "safe",
    max_acceleration: float = 1.0,
    **law: float,
) -> Problem:
    a = law.pop("max_braking", 1.0)
    return Problem(
        world=world,
        robot=Robot(radius=radius, max_braking=a, max_acceleration=max_acceleration),
        braking=UniformBraking(max_braking=a, **law),
        start=End(position=start, speed=speed),
        goal=End(position=goal, speed=speed),
    )


def warehouse(speed: str = "safe") -> Problem:
    return problem(World.build(FLOOR, RACKS), (28.5, 1.9), (2.0, 22.0), speed=speed)


def network_of(asked: Problem):
    diagram = build_diagram(asked.world, asked.robot.radius)
    return build_network(asked, diagram, asked.robot.radius + asked.braking.margin)


def test_corridor_at_constant_speed():
    # Centre line of a corridor of half-width 2 m: V = sqrt(2 (2 - 0.4)), L / V (30 m).
    plan = plan_voronoi_route(problem(World.build(HALL), (5.0, 2.0), (35.0, 2.0)))
    exact = 30.0 / math.sqrt(2.0 * 1.6)
    assert plan.details["exact_time"] == pytest.approx(exact, rel=1e-12)
    assert exact <= plan.travel_time <= exact * (1.0 + 1e-4)


def test_retraction_to_the_centre_line():
    # From clearance 0.1 m straight to 1.6 m: sqrt(2/a) (sqrt 1.6 - sqrt 0.1) at each end, and 30 m at
    # full speed. Straight along the wall at V = sqrt(0.2) would take far longer.
    asked = problem(World.build(HALL), (5.0, 0.5), (35.0, 0.5))
    plan = plan_voronoi_route(asked)
    ramp = math.sqrt(2.0) * (math.sqrt(1.6) - math.sqrt(0.1))
    assert plan.details["exact_time"] == pytest.approx(2.0 * ramp + 30.0 / math.sqrt(3.2), rel=1e-12)
    assert not plan.details["direct"]


def test_the_straight_way_wins_inside_one_cell():
    # 1 m along a wall at clearance 0.6 m, V = sqrt(1.2): quicker than up to the middle and back.
    plan = plan_voronoi_route(problem(World.build(HALL), (5.0, 1.0), (6.0, 1.0)))
    assert plan.details["direct"]
    assert plan.details["exact_time"] == pytest.approx(1.0 / math.sqrt(1.2), rel=1e-12)


def test_warehouse_takes_the_bottom_and_the_left_corridor():
    plan = plan_voronoi_route(warehouse())
    # 25.44124 s bounds every path from below (cone program with certificate); over the top is slower.
    assert 25.44124 <= plan.details["exact_time"] < 28.4
    assert plan.details["exact_time"] <= plan.travel_time <= plan.details["exact_time"] * (1.0 + 1e-4)
    path = plan.trajectory
    assert (path.y[path.x > 4.0] < 4.0).all()
    assert path.y.max() <= 22.0 + 1e-9
    assert (path.x[0], path.y[0], path.x[-1], path.y[-1]) == (28.5, 1.9, 2.0, 22.0)


def test_warehouse_at_rest_obeys_the_bound_of_its_ends():
    # The lower bound 25.44124 s of all paths, plus what ends at rest cost at least: sqrt(2 c) (sqrt 2 - 1)
    # each, c the clearances 1.5 and 1.6 m.
    least = 25.44124 + (math.sqrt(3.0) + math.sqrt(3.2)) * (math.sqrt(2.0) - 1.0)
    plan = plan_voronoi_route(warehouse("rest"))
    assert plan.details["exact_time"] > least
    assert plan.travel_time == pytest.approx(plan.details["exact_time"], rel=1e-4)
    assert plan.travel_time >= plan.details["exact_time"]
    assert plan.trajectory.v[0] == 0.0 == plan.trajectory.v[-1]


@pytest.mark.parametrize("speed", ["safe", "rest"])
def test_four_times_the_braking_halves_the_time(speed: str):
    world = World.build(SQUARE, MIXED)
    one, four = (
        plan_voronoi_route(
            problem(world, (1.0, 1.0), (9.0, 9.0), radius=0.2, speed=speed, max_braking=a, max_acceleration=a)
        )
        for a in (0.5, 2.0)
    )
    assert one.details["exact_time"] == pytest.approx(2.0 * four.details["exact_time"], rel=1e-10)


@settings(max_examples=15)
@given(angle=st.floats(-math.pi, math.pi), shift=st.tuples(st.floats(-300, 300), st.floats(-300, 300)))
def test_moving_the_world_keeps_the_time(angle: float, shift: tuple[float, float]):
    start, goal = (1.0, 1.2), (8.8, 9.1)
    here = fastest_route(network_of(problem(World.build(SQUARE, MIXED), start, goal, radius=0.2)))
    ends = moved([start, goal], angle, shift)
    world = moved_world(SQUARE, MIXED, angle, shift)
    there = fastest_route(network_of(problem(world, tuple(ends[0]), tuple(ends[1]), radius=0.2)))
    assert there.time == pytest.approx(here.time, rel=1e-8)


def test_mirroring_the_world_keeps_the_time():
    start, goal = (1.0, 1.2), (8.8, 9.1)

    def flipped(points) -> list[tuple[float, float]]:
        return [(10.0 - x, y) for x, y in points]

    here = fastest_route(network_of(problem(World.build(SQUARE, MIXED), start, goal, radius=0.2)))
    world = World.build(flipped(SQUARE), [Obstacle(tuple(flipped(o.vertices))) for o in MIXED])
    there = fastest_route(network_of(problem(world, *flipped([start, goal]), radius=0.2)))
    assert there.time == pytest.approx(here.time, rel=1e-9)


@pytest.mark.parametrize("obstacles", [FOUR_POINTS, MIXED])
@pytest.mark.parametrize("law", [{}, {"reaction_time": 0.2}, {"max_speed": 0.9}, {"margin": 0.05}])
def test_brute_force_on_sampled_arcs_finds_the_same_time(obstacles: list[Obstacle], law: dict[str, float]):
    # Ends on nodes, arcs as polylines of 2 mm, times by the mid-point rule from the world's distances,
    # and Dijkstra's algorithm on all of that: good to 1e-4.
    world = World.build(SQUARE, obstacles)
    diagram = build_diagram(world, 0.2)
    nodes = diagram.nodes[diagram.node_distance > 0.5]
    start, goal = (
        tuple(nodes[np.argmin(np.hypot(*(nodes - c).T))].tolist()) for c in ((1.5, 1.0), (9.0, 9.0))
    )
    asked = problem(world, start, goal, radius=0.2, **law)
    lines = diagram.restricted(0.2 + asked.braking.margin).polylines(0.002)
    fine = []
    for line in lines:
        pieces = max(1, math.ceil(float(np.hypot(*(line[1] - line[0]))) / 0.002)) if len(line) == 2 else 1
        fine.append(line if pieces == 1 else np.linspace(line[0], line[1], pieces + 1))
    points = np.concatenate(fine)
    joint = np.append(np.cumsum([len(line) for line in fine])[:-1], 0)
    step = np.setdiff1d(np.arange(1, len(points)), joint)
    middle = 0.5 * (points[step] + points[step - 1])
    size = np.hypot(*(points[step] - points[step - 1]).T)
    time = size / np.maximum(asked.safe_speed(middle), 1e-9)
    _, vertex = np.unique(np.round(points, 6), axis=0, return_inverse=True)
    ends = [int(vertex[np.argmin(np.hypot(*(points - c).T))]) for c in (start, goal)]
    graph = coo_array((time, (vertex[step - 1], vertex[step])), shape=(vertex.max() + 1,) * 2).tocsr()
    expected = dijkstra(graph, directed=False, indices=ends[0])[ends[1]]
    assert fastest_route(network_of(asked)).time == pytest.approx(expected, rel=1e-4)


def all_simple_routes(network) -> list[tuple[float, list[int], list[int]]]:
    """Depth-first search without any cleverness: time, pieces and vertices."""
    around: dict[int, list[tuple[int, int]]] = {}
    for i, (a, b) in enumerate(network.ends.tolist()):
        around.setdefault(a, []).append((b, i))
        around.setdefault(b, []).append((a, i))
    found = []
    pending = [([network.start], [])]
    while pending:
        vertices, pieces = pending.pop()
        if vertices[-1] == network.goal:
            found.append((float(network.time[pieces].sum()), pieces, vertices))
            continue
        for after, piece in around[vertices[-1]]:
            if after not in vertices:
                pending.append(([*vertices, after], [*pieces, piece]))
    return sorted(found, key=lambda r: r[0])


@pytest.mark.parametrize("speed", ["rest", 0.3])
@pytest.mark.parametrize("obstacles", [FOUR_POINTS, MIXED])
def test_ends_with_given_speeds_against_all_routes(speed: float | str, obstacles: list[Obstacle]):
    # Slow acceleration, so that the order by safe time is not the order with these ends.
    world = World.build(SQUARE, obstacles)
    asked = problem(
        world, (1.0, 1.2), (8.8, 9.0), radius=0.2, speed=speed, max_acceleration=0.3, max_braking=1.0
    )
    network = network_of(asked)
    times = []
    for _, pieces, vertices in all_simple_routes(network):
        backwards = network.ends[pieces, 0] != np.array(vertices[:-1])
        times.append(time_with_ends(asked, network.curves.take(pieces).reversed(backwards)))
    direct = straight_leg(
        build_diagram(world), np.array(asked.start.position), np.array(asked.goal.position), 0.2
    )
    assert direct is None
    plan = plan_voronoi_route(asked)
    assert plan.details["exact_time"] == pytest.approx(min(times), rel=1e-12)


def test_routes_come_in_order_and_none_is_missing():
    network = network_of(problem(World.build(SQUARE, MIXED), (1.0, 1.2), (8.8, 9.0), radius=0.2))
    expected = [time for time, _, _ in all_simple_routes(network)]
    assert len(expected) > 5
    assert [route.time for route in routes(network)] == pytest.approx(expected, rel=1e-9)


def test_a_corridor_from_rest_to_rest():
    # V constant: ramps cost V / (2 a_max) at the start and V / (2 a_b) at the goal more than at full speed.
    asked = problem(World.build(HALL), (5.0, 2.0), (35.0, 2.0), speed="rest", max_acceleration=0.7)
    v = math.sqrt(3.2)
    plan = plan_voronoi_route(asked)
    assert plan.details["exact_time"] == pytest.approx(30.0 / v + v / 1.4 + v / 2.0, rel=1e-12)
    assert plan.travel_time == pytest.approx(plan.details["exact_time"], rel=1e-4)


def test_a_corridor_too_short_for_full_speed():
    # 1 m: accelerate at 0.7, brake at 1: peak v^2 = 2 L / (1/0.7 + 1), T = v (1/0.7 + 1).
    asked = problem(World.build(HALL), (5.0, 2.0), (6.0, 2.0), speed="rest", max_acceleration=0.7)
    both = 1.0 / 0.7 + 1.0
    assert plan_voronoi_route(asked).details["exact_time"] == pytest.approx(
        math.sqrt(2.0 / both) * both, rel=1e-12
    )


@pytest.mark.parametrize("accel", [0.4, 1.0, 3.0])
@pytest.mark.parametrize("law", [{}, {"max_speed": 0.8}, {"margin": 0.05}])
def test_time_with_ends_against_a_fine_sum(accel: float, law: dict[str, float]):
    asked = problem(
        World.build(SQUARE, MIXED),
        (1.0, 1.2),
        (8.8, 9.0),
        radius=0.2,
        speed=0.2,
        max_acceleration=accel,
        **law,
    )
    route = fastest_route(network_of(asked))
    length = route.curves.length
    begin = np.concatenate([[0.0], np.cumsum(length)])
    count = 4000
    part = (np.arange(count) + 0.5) / count
    origin = route.curves.arc_length(route.curves.span)
    s = origin[:, :1] + np.diff(origin, axis=1) * part
    along = begin[:-1, None] + length[:, None] * part
    distance = route.curves.distance(route.curves.at_arc_length(s))
    square = asked.braking.speed(distance - 0.2) ** 2
    square = np.minimum(square, 0.04 + 2.0 * accel * along)
    square = np.minimum(square, 0.04 + 2.0 * (begin[-1] - along))
    expected = float((length / count * (1.0 / np.sqrt(square)).sum(axis=1)).sum())
    assert time_with_ends(asked, route.curves) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("accel", [0.4, 1.0, 3.0])
def test_the_bound_on_the_ends_holds_for_every_route(accel: float):
    world = World.build(SQUARE, FOUR_POINTS)
    asked = problem(world, (1.0, 1.2), (8.8, 9.0), radius=0.2, speed="rest", max_acceleration=accel)
    bound = end_cost_bound(asked, math.dist((1.0, 1.2), (8.8, 9.0)))
    assert bound > 0.0
    for route in routes(network_of(asked)):
        assert time_with_ends(asked, route.curves) >= route.time + bound


def test_k_best_routes_are_distinct_and_in_order():
    asked = warehouse()
    diagram = build_diagram(asked.world, 0.4)
    paths = k_best_routes(asked, diagram, 6)
    found = [route.time for _, route in zip(range(6), routes(network_of(asked)), strict=False)]
    assert len(paths) == 6
    assert (np.diff(found) > 0.0).all()
    assert len({round(p.length, 6) for p in paths}) == 6
    for path in paths:
        s = np.linspace(0.0, path.length, 2000)
        assert (asked.clearance(np.column_stack(path.at(s)[:2])) > 0.0).all()
        ends = np.cumsum(path.piece_length)
        x, y, _, _ = path.at(ends - 1e-12)
        assert np.hypot(x - path.x[1:], y - path.y[1:]).max() < 1e-9


def test_fewer_routes_than_asked_for():
    assert len(k_best_routes(problem(World.build(HALL), (5.0, 1.0), (35.0, 3.0)), None, 9)) == 1


@given(p=st.floats(0.05, 20.0), one=st.floats(-20.0, 20.0), other=st.floats(-20.0, 20.0))
def test_biarcs_stay_within_a_micrometre_of_the_parabola(p: float, one: float, other: float):
    if abs(other - one) < 1e-6:
        return
    bow = Route(_parabola(p, one, other), 0.0).curves
    starts, heading, bend, length = parabola_biarcs(bow)
    s = length[:, None] * np.linspace(0.0, 1.0, 21)
    half = 0.5 * bend[:, None] * s
    chord = s * np.sinc(half / np.pi)
    x = starts[:, :1] + chord * np.cos(heading[:, None] + half)
    y = starts[:, 1:] + chord * np.sin(heading[:, None] + half)
    # distance to focus (0, p/2) and directrix y = -p/2 in the frame of the vertex
    origin = bow.origin[0]
    gap = np.hypot(x - origin[0], y - origin[1] - p) - (y - origin[1])
    assert np.abs(gap).max() <= 2.0 * np.hypot(1.0, np.abs(x).max() / p) * DEVIATION * 1.1 + 1e-9
    assert length.sum() == pytest.approx(bow.length[0], rel=1e-6)
    ends = np.column_stack([x[:, -1], y[:, -1]])
    assert ends[:-1] == pytest.approx(starts[1:], abs=1e-9)


def _parabola(p: float, one: float, other: float):
    """With wall y = 0 and focus (0, p)."""
    world = World.build(((-90.0, 0.0), (90.0, 0.0), (90.0, 90.0), (-90.0, 90.0)), [Obstacle(((0.0, p),))])
    built = build_diagram(world)
    bows = built.curves.take((built.curves.kind == PARABOLA) & (np.abs(built.curves.origin[:, 1]) < 1e-9))
    return bows.take([0]).cut(np.array([[one, other]]))


@pytest.mark.parametrize("place", [(5.0, 2.0), (2.0, 2.0), (1.0, 1.0), (20.0, 2.0)])
def test_ends_on_arcs_and_nodes_need_no_leg(place: tuple[float, float]):
    # Middle of the ridge, a node, and an arc from a corner of the hall.
    world = World.build(HALL)
    leg, end = retraction(world, np.array(place))
    assert len(leg) == 0
    assert end == pytest.approx(np.array(place), abs=1e-12)
    plan = plan_voronoi_route(problem(world, place, (35.0, 1.5)))
    assert plan.trajectory.x[0] == place[0]


@settings(max_examples=40)
@given(x=st.floats(0.3, 9.7), y=st.floats(0.3, 9.7), u=st.floats(0.3, 9.7), v=st.floats(0.3, 9.7))
def test_legs_have_exact_distances(x: float, y: float, u: float, v: float):
    world = World.build(SQUARE, MIXED)
    diagram = build_diagram(world)
    start, end = np.array([x, y]), np.array([u, v])
    if world.distance(start) < 0.01 or world.distance(end) < 0.01 or math.dist(start, end) < 0.01:
        return
    retracted, _ = retraction(world, start)
    straight = straight_leg(diagram, start, end, 0.005)
    part = np.linspace(0.0, 1.0, 301)
    on_line = start + part[:, None] * (end - start)
    if straight is None:
        assert world.distance(on_line).min() < 0.03
    for leg in (retracted, straight):
        if leg is not None and len(leg):
            w = leg.span[:, :1] + np.diff(leg.span, axis=1) * part
            assert leg.distance(w) == pytest.approx(world.distance(leg.points(w)), abs=1e-8)


def test_the_time_of_a_straight_leg_is_exact():
    # From wall to wall across a hall 4 m wide, away from one and towards the other:
    # twice sqrt(2/a) (sqrt 1.6 - sqrt 0.1).
    world = World.build(HALL)
    leg = straight_leg(build_diagram(world), np.array([20.0, 0.5]), np.array([20.0, 3.5]), 0.4)
    assert leg is not None
    time = travel_time(leg, UniformBraking(max_braking=1.0), 0.4).sum()
    assert time == pytest.approx(2.0 * math.sqrt(2.0) * (math.sqrt(1.6) - math.sqrt(0.1)), rel=1e-12)


DOOR = [Obstacle(((20.0, 0.0), (20.0, 1.7))), Obstacle(((20.0, 2.5), (20.0, 4.0)))]  # 0.8 m wide


def test_a_door_too_narrow_is_named():
    with pytest.raises(
        NoPathError, match=r"widest way is 0\.8 m wide at \(20, 2\.1\), the robot needs 1 m.*part 1.*part 2"
    ):
        plan_voronoi_route(problem(World.build(HALL, DOOR), (5.0, 2.0), (35.0, 2.0), radius=0.5))


def test_the_widest_of_two_doors_is_named():
    # Two doors, 0.8 and 1.2 m wide: the wider one is the bottleneck.
    walls = [((20.0, 0.0), (20.0, 0.5)), ((20.0, 1.3), (20.0, 2.0)), ((20.0, 3.2), (20.0, 4.0))]
    world = World.build(HALL, [Obstacle(w) for w in walls])
    with pytest.raises(
        NoPathError, match=r"widest way is 1\.2 m wide at \(20, 2\.6\), the robot needs 1\.4 m"
    ):
        plan_voronoi_route(problem(world, (5.0, 2.0), (35.0, 2.0), radius=0.7))
    assert plan_voronoi_route(problem(world, (5.0, 2.0), (35.0, 2.0), radius=0.5)).travel_time > 0.0


def test_a_braking_margin_can_close_a_door():
    world = World.build(HALL, DOOR)
    assert plan_voronoi_route(problem(world, (5.0, 2.0), (35.0, 2.0), radius=0.3)).travel_time > 0.0
    with pytest.raises(NoPathError, match=r"robot needs 0\.9 m \(0\.6 m for its body"):
        plan_voronoi_route(problem(world, (5.0, 2.0), (35.0, 2.0), radius=0.3, margin=0.15))


def test_walls_that_separate():
    world = World.build(HALL, [Obstacle(((20.0, 0.0), (20.0, 4.0)))])
    with pytest.raises(NoPathError, match="walls separate start and goal"):
        plan_voronoi_route(problem(world, (5.0, 2.0), (35.0, 2.0)))


@pytest.mark.parametrize("place", [(5.0, 0.2), (5.0, -1.0), (20.0, 1.0)])
def test_a_start_without_room(place: tuple[float, float]):
    with pytest.raises(NoPathError, match=r"start .* needs 0\.4 m"):
        plan_voronoi_route(problem(World.build(HALL, DOOR), place, (35.0, 2.0)))


def test_start_and_goal_the_same():
    with pytest.raises(PlanningError, match="same point"):
        plan_voronoi_route(problem(World.build(HALL), (5.0, 2.0), (5.0, 2.0)))


def test_a_point_robot_cannot_slip_through_a_wall_at_a_corner():
    # With radius zero the arcs of both sides reach the foot of a wall; they must not be joined there.
    world = World.build(HALL, [Obstacle(((20.0, 0.0), (20.0, 4.0)))])
    with pytest.raises(NoPathError, match="walls separate"):
        plan_voronoi_route(problem(world, (19.0, 1.0), (21.0, 1.0), radius=0.0))
