"""The parts of the lower bound: mesh, tangents, blocked triangles, cone program, refinement."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from vnav_drake import End, NoPathError, Obstacle, PlanningError, Problem, Robot, UniformBraking, World
from vnav_drake.lower_bound import bound as bound_module
from vnav_drake.lower_bound import lower_bound as bound
from vnav_drake.lower_bound.assembly import assemble
from vnav_drake.lower_bound.blocked import FREE, Solids, blocked_by
from vnav_drake.lower_bound.certificate import digest
from vnav_drake.lower_bound.cover import Cover, Ground, barycentric
from vnav_drake.lower_bound.features import Features
from vnav_drake.lower_bound.mesh import Mesh, edges_of
from vnav_drake.lower_bound.minorant import CAP, Law, choose
from vnav_drake.lower_bound.program import Solution
from vnav_drake.lower_bound.refinement import first_cover, losses, worst
from vnav_drake.speed_graph import speed_graph

ROOM = ((0.0, 0.0), (8.0, 0.0), (8.0, 6.0), (0.0, 6.0))
BOX = ((3.0, 2.0), (5.0, 2.0), (5.0, 4.5), (3.0, 4.5))


def problem(*obstacles, radius=0.3, start=(1.0, 3.0), goal=(7.0, 3.2), boundary=ROOM, **law) -> Problem:
    law = {"max_braking": 1.0} | law
    return Problem(
        world=World.build(boundary, [Obstacle(tuple(o)) for o in obstacles]),
        robot=Robot(radius=radius),
        braking=UniformBraking(**law),
        start=End(position=start),
        goal=End(position=goal),
    )


# --- mesh ---


def double_areas(mesh: Mesh) -> np.ndarray:
    a, b, c = np.moveaxis(mesh.vertices[mesh.triangles], 1, 0)
    return (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]


@settings(max_examples=25, deadline=None)
@given(st.lists(st.integers(0, 10**9), min_size=1, max_size=12), st.floats(0.2, 40.0), st.floats(-1e3, 1e3))
def test_refined_meshes_tile_the_box_without_hanging_vertices(seeds, width, x):
    mesh = Mesh.around((x, -2.0, x + width, 3.5))
    box = mesh.lattice.box
    for seed in seeds:
        marked = np.zeros(len(mesh.triangles), dtype=bool)
        marked[np.random.default_rng(seed).integers(len(mesh.triangles), size=3)] = True
        mesh = mesh.refined(marked)
    area = double_areas(mesh)
    assert area.min() > 0  # anticlockwise
    assert int(area.sum()) == 2 * (box[2] - box[0]) * (box[3] - box[1])
    _, of_edge = edges_of(mesh.triangles)
    used = np.bincount(of_edge.ravel())
    edge, _ = edges_of(mesh.triangles)
    once = mesh.vertices[edge[used == 1]]
    on_side = np.zeros(len(once), dtype=bool)
    for axis, value in ((0, box[0]), (0, box[2]), (1, box[1]), (1, box[3])):
        on_side |= (once[:, :, axis] == value).all(axis=1)
    assert used.max() <= 2
    assert on_side.all()


def test_refining_halves_what_is_marked_and_keeps_the_rest_of_the_order():
    mesh = Mesh.around((0.0, 0.0, 8.0, 6.0))
    marked = np.zeros(len(mesh.triangles), dtype=bool)
    marked[5] = True
    finer = mesh.refined(marked)
    children = np.flatnonzero(finer.parent == 5)
    # One triangle is halved; closure may halve again, but its halves together are what it was.
    assert len(children) >= 2
    assert double_areas(finer)[children].sum() == double_areas(mesh)[5]
    assert (np.diff(finer.parent) >= 0).all()


def test_lattice_points_are_exact_in_metres():
    mesh = Mesh.around((0.1, -7.3, 11.7, 0.2))
    mesh = mesh.refined(np.ones(len(mesh.triangles), dtype=bool))
    # origin + unit k has no rounding: going back gives the integers.
    back = (mesh.points - mesh.lattice.origin) / mesh.lattice.unit
    assert np.array_equal(back, mesh.vertices)
    assert math.frexp(mesh.lattice.unit)[0] == 0.5  # a power of two


# --- tangents ---

LAWS = st.builds(
    UniformBraking,
    max_braking=st.floats(0.1, 5.0),
    reaction_time=st.one_of(st.just(0.0), st.floats(0.01, 1.0)),
    margin=st.floats(0.0, 0.3),
    max_speed=st.one_of(st.just(math.inf), st.floats(0.3, 3.0)),
)


@settings(max_examples=60, deadline=None)
@given(LAWS, st.integers(0, 10**9))
def test_every_choice_is_below_the_slowness(braking, seed):
    """Against 1/V of the braking module at the true distance, at random places of random triangles."""
    rng = np.random.default_rng(seed)
    radius = float(rng.uniform(0.0, 0.5))
    table = [[0.0, 0.0, 6.0, 0.0, 0.0], [3.0, 2.5, 3.0, 2.5, 0.3], [0.0, 4.0, 6.0, 5.0, 0.0]]
    features = Features(np.array(table), np.zeros(3, dtype=bool))
    corners = rng.uniform(0.0, 5.0, (40, 1, 2)) + rng.uniform(-0.6, 0.6, (40, 3, 2))
    which = np.broadcast_to(np.arange(3)[None, :, None], (40, 3, 3))
    distance = features.distance(corners[:, None], which)
    law = Law.within(braking, radius + braking.margin, 8.0)
    flow = rng.dirichlet(np.ones(3), 40)
    choice = choose(law, distance, which[:, :, 0], flow)
    share = rng.dirichlet(np.ones(3), 50)
    spots = np.einsum("sk,tkd->tsd", share, corners)
    true = np.min([features.distance(spots, np.full((40, 50), f)) for f in range(3)], axis=0)
    with np.errstate(divide="ignore"):
        slowness = 1.0 / braking.speed(true - radius)
    for k in range(2):
        rows = choice.ridge if k else np.ones(40, dtype=bool)
        below = np.einsum("sk,tk->ts", share, choice.corner[:, k])
        assert (below[rows] <= slowness[rows] * (1.0 + 1e-12)).all()
    blocked = distance.max(axis=2).min(axis=1) <= law.level
    assert (choice.corner[~blocked, 0] > 0.0).all()


def test_the_tangent_touches_the_slowness_where_the_flow_is():
    # Near one straight wall the interpolant is the distance itself: equality at the point of contact.
    law = Law(UniformBraking(max_braking=2.0, reaction_time=0.4, margin=0.1), 0.4)
    distance = np.array([[[1.0, 1.3, 1.2]]])
    flow = np.array([[0.2, 0.5, 0.3]])
    choice = choose(law, distance, np.array([[0]]), flow)
    here = float(distance[0, 0] @ flow[0])
    # V t_r + V^2 / (2 a) = l - level, with the numbers above
    v = -0.8 + math.sqrt(0.64 + 4.0 * (here - 0.4))
    assert float(choice.corner[0, 0] @ flow[0]) == pytest.approx(1.0 / v, rel=1e-12)


def test_at_the_speed_limit_the_constant_is_chosen():
    law = Law(UniformBraking(max_braking=1.0, max_speed=0.5), 0.3)
    choice = choose(law, np.array([[[3.0, 3.3, 3.2]]]), np.array([[4]]), np.full((1, 3), 1.0 / 3.0))
    assert choice.feature[0, 0] == CAP
    assert choice.corner[0, 0] == pytest.approx([2.0, 2.0, 2.0])  # 1 / 0.5 m/s


# --- blocked triangles ---


def test_blocked_triangles_hold_no_free_place():
    question = problem(BOX, [(6.5, 1.0)], [(1.0, 5.0), (2.5, 5.2)], radius=0.35)
    cover = first_cover(Ground.of(question), question.world.bounds)
    for _ in range(3):
        cover = cover.divided(np.ones(len(cover.reason), dtype=bool))
    blocked = np.flatnonzero(cover.reason != FREE)
    assert {-1, -2} & set(cover.reason[blocked].tolist()) == {-2}  # the room's sides lie on the box's
    share = np.random.default_rng(1).dirichlet(np.ones(3), 20)
    spots = np.einsum("sk,tkd->tsd", share, cover.corners(blocked))
    assert (question.clearance(spots) <= 1e-9).all()
    # and all that is deep within the box is found
    deep = shapely.Polygon(BOX).buffer(-0.3)
    middles = cover.corners(cover.kept).mean(axis=1)
    assert not shapely.contains_xy(deep, middles[:, 0], middles[:, 1]).any()


def test_triangles_that_touch_an_obstacle_from_outside_are_free():
    world = World.build(ROOM, [Obstacle(BOX)])
    corners = np.array([[[5.0, 2.0], [6.0, 3.0], [5.0, 3.0]], [[4.0, 2.0], [5.0, 2.0], [5.0, 3.0]]])
    assert Solids(world).reasons(corners).tolist() == [FREE, -2]


def test_an_end_is_never_blocked():
    # The start touches the wall: its clearance is zero, and so is that of what surrounds it nearby.
    question = problem(start=(0.3, 3.0))
    cover = Cover.begin(Ground.of(question), Mesh.around(question.world.bounds))
    for _ in range(12):
        marked = barycentric(cover.mesh.points[cover.mesh.triangles], question.start.point).min(axis=1) >= 0.0
        cover = cover.divided(marked)
    corners = cover.corners(np.array([cover.locate(question.start.point)]))[0]
    assert shapely.Polygon(corners).covers(shapely.Point(0.3, 3.0))


def test_near_a_feature_means_all_corners_within_the_level():
    features = Features(np.array([[0.0, 0.0, 8.0, 0.0, 0.0]]), np.array([False]))
    solids = Solids(World.build(ROOM))
    corners = np.array([[[1.0, 0.1], [2.0, 0.1], [1.5, 0.29]], [[1.0, 0.1], [2.0, 0.1], [1.5, 0.31]]])
    distance = corners[:, None, :, 1]
    assert blocked_by(features, solids, 0.3, corners, distance, np.zeros((2, 1), dtype=int)).tolist() == [
        0,
        FREE,
    ]


# --- the program and the loop ---


def test_bounds_close_in_on_the_corridor():
    # 6 m along the middle of a corridor 2 m wide, radius 0.5: V = sqrt(2 * 0.5) = 1 m/s all along.
    question = problem(
        boundary=((0, 0), (8, 0), (8, 2), (0, 2)), radius=0.5, start=(1.0, 1.0), goal=(7.0, 1.0)
    )
    found = bound(question, upper=6.0, gap=1e-3)
    assert found.stopped == "gap"
    assert 6.0 / 1.001 <= found.travel_time <= 6.0
    assert max(r.lower_bound for r in found.rounds) == found.travel_time


def test_the_certificate_keeps_its_inequalities_by_a_safe_share():
    found = bound(problem(BOX), budget=5000)
    c = found.certificate
    points = c.origin + c.unit * c.vertices
    x = points[c.triangles]
    index = {tuple(pair): k for k, pair in enumerate(c.edges.tolist())}
    for t in np.random.default_rng(0).integers(len(x), size=200):
        lam = np.linalg.inv(np.column_stack([x[t], np.ones(3)]))[:2].T  # grad lambda_j
        i, j, k = c.triangles[t].tolist()
        value = np.diag(c.u_vertex[[i, j, k]])
        for (p, a), (q, b) in (((0, i), (1, j)), ((1, j), (2, k)), ((2, k), (0, i))):
            value[p, q] = value[q, p] = c.u_edge[index[min(a, b), max(a, b)]]
        slope = np.hypot(*(2.0 * value @ lam).T)
        limit = np.zeros(3)
        for f, w, share in zip(c.feature[t], c.speed[t], c.weight[t], strict=True):
            if share > 0.0 and f >= 0:
                segment = shapely.LineString([c.features[f, :2], c.features[f, 2:4]])
                away = np.array([segment.distance(shapely.Point(p)) for p in x[t]]) - c.features[f, 4]
                # Tangent of 1/sqrt(2 (l - rho)) at speed w, a_b = 1, rho = 0.3.
                limit += share * (1.0 / w - (away - 0.3 - 0.5 * w * w) / w**3)
        assert (slope <= limit * (1.0 - 1e-10)).all()


def test_runs_repeat_exactly():
    one, other = (bound(problem(BOX), budget=6000).certificate.arrays() for _ in range(2))
    assert np.array_equal(digest(one), digest(other))


def test_the_budget_counts_triangles():
    small, large = (bound(problem(BOX), budget=b) for b in (1, 9000))
    assert len(small.rounds) == 1
    assert small.stopped == "budget"
    assert len(large.rounds) > 1
    assert sum(r.triangles for r in large.rounds) <= 9000
    assert all(a.triangles < b.triangles for a, b in pairwise(large.rounds))


def test_the_emergency_stop_is_told():
    assert bound(problem(BOX), time_limit=0.0).stopped == "time"


def test_multipliers_are_the_time_of_the_optimal_flow():
    """They add up to the bound, and lie where the two ways round the box are."""
    question = problem(BOX)
    cover = first_cover(Ground.of(question), question.world.bounds)
    assembly = assemble(cover)
    solution = bound_module._solution(assembly, 1e-4)
    assert solution.time.sum() == pytest.approx(1.0)
    busy = assembly.elements.corners[solution.time.sum(axis=1) > 1e-3].mean(axis=1)
    assert question.clearance(busy).min() > 0.0
    # Without the box in the way the straight line would be best: no time is spent inside it.
    assert not shapely.contains_xy(shapely.Polygon(BOX), busy[:, 0], busy[:, 1]).any()
    lost = losses(bound_module._with_flow(assembly, solution))
    assert 0.0 < lost.sum() < 1.0
    assert worst(bound_module._with_flow(assembly, solution)).sum() < len(lost)


def test_whatever_the_solver_says_the_certificate_holds(monkeypatch):
    """Values too large everywhere and wrong somewhere are scaled down until every bound is kept."""
    true = bound_module.solve

    def wild(elements, start, goal, setting):
        found = true(elements, start, goal, setting)
        noise = np.random.default_rng(0).normal(scale=1e-3, size=len(found.values))
        return replace(found, values=3.0 * found.values + noise)

    honest = bound(problem(BOX), budget=1).travel_time
    monkeypatch.setattr(bound_module, "solve", wild)
    assert 0.0 < bound(problem(BOX), budget=1).travel_time < honest


def test_a_solver_that_gives_nothing_is_a_planning_error(monkeypatch):
    def nothing(elements, start, goal, setting):
        none = np.zeros((len(elements.corners), 3))
        return Solution(np.zeros(elements.count), np.ones(len(none)), none, none, "NumericalError")

    monkeypatch.setattr(bound_module, "solve", nothing)
    with pytest.raises(PlanningError, match="NumericalError"):
        bound(problem(BOX), budget=5000)


def test_a_later_failure_keeps_the_best_certificate(monkeypatch):
    true, calls = bound_module.solve, []

    def tiring(elements, start, goal, setting):
        calls.append(len(elements.corners))
        found = true(elements, start, goal, setting)
        if calls[0] == len(elements.corners):
            return found
        return replace(found, values=np.zeros_like(found.values), status="InsufficientProgress")

    best = bound(problem(BOX), budget=1).travel_time
    monkeypatch.setattr(bound_module, "solve", tiring)
    found = bound(problem(BOX), budget=100_000)
    assert found.travel_time == best
    assert found.stopped == "precision"
    assert len(found.rounds) == 4  # three in a row without a better bound


@pytest.mark.parametrize("error", [RuntimeError, MemoryError])
def test_an_error_in_a_later_round_keeps_what_was_proven(monkeypatch, error):
    true, calls = bound_module.solve, []

    def breaking(elements, start, goal, setting):
        calls.append(setting)
        if len(calls) > 1:
            raise error
        return true(elements, start, goal, setting)

    monkeypatch.setattr(bound_module, "solve", breaking)
    found = bound(problem(BOX), budget=9000)
    assert found.stopped == "fault"
    assert len(found.rounds) == 1
    assert found.travel_time == found.rounds[0].lower_bound > 0.0
    with pytest.raises(error):
        bound(problem(BOX), budget=9000)  # nothing proven yet


def test_where_no_flow_is_known_the_mesh_is_refined_everywhere(monkeypatch):
    true, calls = bound_module.solve, []

    def late(elements, start, goal, setting):
        calls.append(len(elements.corners))
        found = true(elements, start, goal, setting)
        nothing = np.zeros_like(found.time)
        if calls[0] == len(elements.corners):
            return replace(
                found, values=0.0 * found.values, time=nothing, push=nothing, status="NumericalError"
            )
        return found

    monkeypatch.setattr(bound_module, "solve", late)
    found = bound(problem(BOX), budget=8000)
    assert found.rounds[0].lower_bound == 0.0
    assert found.rounds[1].triangles > found.rounds[0].triangles
    assert found.travel_time > 0.0


def test_parts_that_are_not_connected_are_no_path():
    wall = ((3.5, 0.0), (4.5, 0.0), (4.5, 6.0), (3.5, 6.0))
    with pytest.raises(NoPathError):
        bound(problem(wall))


# --- walls without thickness ---


@pytest.mark.parametrize("x", [5.0, 4.97, 5.3])  # along mesh lines, and not
def test_u_jumps_across_a_wall_that_a_point_robot_goes_round(x):
    wall = [(x, 0.0), (x + 0.01 * (x != 5.0), 7.0)]
    boundary = ((0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0))
    question = problem(wall, boundary=boundary, radius=0.0, start=(4.0, 3.0), goal=(6.0, 3.0))
    through = math.sqrt(2.0) * (math.sqrt(x - 4.0) + math.sqrt(6.0 - x))  # [s], what a continuous u can prove
    found = bound(question, budget=12_000)
    assert found.travel_time > 1.5 * through
    best = speed_graph(question, classes=1).classes[0].travel_time
    assert best / 1.01 <= found.travel_time <= best
    side = found.certificate.side
    if x == 5.0:  # cut at edges only
        assert not side.any()
    else:
        assert sorted(set(side[side != 0].tolist())) == [-5, 5]  # wall 4, after the four sides
        assert (side > 0).sum() == (side < 0).sum() > 0


def test_a_wall_from_side_to_side_parts_the_room():
    with pytest.raises(NoPathError):
        bound(problem([(4.1, 0.0), (4.3, 6.0)], radius=0.0))


def test_crossing_walls_are_gone_round():
    walls = [[(2.0, 1.5), (5.0, 5.0)], [(5.0, 1.0), (2.0, 4.6)]]
    question = problem(*walls, radius=0.0, start=(3.6, 4.7), goal=(3.4, 1.4))
    best = speed_graph(question, classes=1).classes[0].travel_time
    found = bound(question, upper=best, gap=0.01)
    assert found.stopped == "gap"
    assert found.travel_time <= best


def test_with_an_end_on_a_wall_nothing_is_cut():
    # On which side a motion sets out is not said, so u is continuous and the bound holds for both.
    question = problem([(4.0, 1.0), (4.0, 5.0)], radius=0.0, start=(4.0, 3.0), goal=(7.0, 3.0))
    certificate = bound(question, budget=4000).certificate
    assert not certificate.side.any()
    assert len(np.unique(certificate.vertices, axis=0)) == len(certificate.vertices)


def test_a_small_robot_among_walls_does_not_need_triangles_as_small_as_itself():
    # Oblique walls across the room, each with a gap at one end, and a robot of 2 cm: the way is a zigzag.
    # Without sheets the walls are open until triangles along them are 2 cm wide.
    walls = [[(2.0, 0.0), (2.3, 5.0)], [(4.3, 6.0), (4.0, 1.0)], [(6.0, 0.0), (6.3, 5.0)]]
    question = problem(*walls, radius=0.02, start=(1.0, 0.7), goal=(7.0, 0.8))
    best = speed_graph(question, classes=1).classes[0].travel_time
    found = bound(question, upper=best, gap=0.03)
    assert found.stopped == "gap"
    assert found.travel_time <= best
    assert found.certificate.side.any()


def test_a_robot_with_a_margin_has_no_sheets():
    asked = problem([(4.0, 0.0), (4.0, 4.0)], radius=0.1, margin=0.1)
    certificate = bound(asked, budget=4000).certificate
    assert len(np.unique(certificate.vertices, axis=0)) == len(certificate.vertices)
