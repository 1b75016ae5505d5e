"""The Voronoi diagram: exact cases, equidistance against Shapely, invariances, clipping, failures."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from tests.worlds import ROOM, distance_by_shapely, moved, moved_world, obstacle_lists, rectangle, rooms
from vnav_drake.problem import PlanningError
from vnav_drake.voronoi import (
    PARABOLA,
    ROOT,
    DiagramError,
    VoronoiDiagram,
    build_diagram,
    diagram,
    verify_diagram,
)
from vnav_drake.world import Obstacle, World

Array = NDArray[np.float64]

HALL = ((0.0, 0.0), (10.0, 0.0), (10.0, 4.0), (0.0, 4.0))
SQUARE = ((0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0))
PLACE = 2e-7  # [m]: nodes nearer than a few units of Boost's integer grid are merged
MIXED = [
    rectangle(2.0, 2.0, 3.0, 1.5),
    Obstacle(((7.3, 2.1), (8.2, 4.4), (6.1, 3.7))),
    Obstacle(((3.0, 7.0), (6.0, 7.5))),
    Obstacle(((8.0, 8.3),)),
    Obstacle(((1.2, 8.8),)),
    Obstacle(((0.0, 5.0), (1.5, 5.2))),
]


def arc_length(built: VoronoiDiagram) -> float:
    return float(built.curves.length[built.arcs].sum())


def samples(built: VoronoiDiagram, count: int = 9) -> tuple[Array, Array]:
    """Points on all borders and the distances that the diagram claims there."""
    part = (np.arange(count) + 0.5) / count
    u = built.curves.span[:, :1] + np.diff(built.curves.span, axis=1) * part
    return built.curves.points(u).reshape(-1, 2), built.curves.distance(u).reshape(-1)


def test_rectangle_has_its_medial_axis():
    # 10 x 4 m: four diagonals from the corners to (2, 2) and (8, 2), 2 sqrt(2) m each, and the 6 m between.
    built = build_diagram(World.build(HALL))
    assert len(built.arcs) == 5
    assert arc_length(built) == pytest.approx(8.0 * math.sqrt(2.0) + 6.0, rel=1e-12)
    inner = built.nodes[built.node_distance > 0.0]
    assert inner[np.argsort(inner[:, 0])] == pytest.approx(np.array([[2.0, 2.0], [8.0, 2.0]]), abs=1e-12)
    assert built.node_distance.max() == pytest.approx(2.0, abs=1e-12)
    assert built.primary.all()


def test_square_has_one_node_where_four_arcs_meet():
    built = build_diagram(World.build(SQUARE))
    centre = int(np.argmax(built.node_distance))
    border, end = built.incident(centre)
    assert len(border) == 4
    assert len(built.nodes) == 5
    out = built.curves.take(border).tangents(built.curves.span[border])[np.arange(4), end]
    angle = np.arctan2(*(out * np.where(end == 0, 1.0, -1.0)[:, None]).T[::-1])
    assert angle == pytest.approx(np.array([-0.75, -0.25, 0.25, 0.75]) * math.pi, abs=1e-12)


def test_rotated_square_is_merged_too():
    # In rotated coordinates rounding splits the node of four arcs; merging must undo it.
    for angle in np.linspace(0.1, 1.5, 15):
        built = build_diagram(World.build(moved(SQUARE, angle, (3.7, -1.9))))
        assert len(built.arcs) == 4


def test_point_in_a_square_has_four_parabolas():
    # By symmetry the nodes lie at (5 + c, 5 + c) with 5 - c = sqrt(2) c. Each parabola has focal
    # parameter 5 and spans u = -c..c; its length is p (x sqrt(1 + x^2) + asinh x), x = c/5.
    c = 5.0 / (1.0 + math.sqrt(2.0))
    x = c / 5.0
    bow = 5.0 * (x * math.sqrt(1.0 + x * x) + math.asinh(x))
    built = build_diagram(World.build(SQUARE, [Obstacle(((5.0, 5.0),))]))
    kinds = built.curves.kind[built.arcs]
    assert (kinds == PARABOLA).sum() == 4
    assert built.curves.length[built.arcs][kinds == PARABOLA] == pytest.approx(np.full(4, bow), rel=1e-12)
    assert arc_length(built) == pytest.approx(4.0 * (bow + (5.0 - c) * math.sqrt(2.0)), rel=1e-12)
    assert built.node_distance.max() == pytest.approx(math.sqrt(2.0) * c, rel=1e-12)


def test_two_points_have_their_perpendicular_bisector():
    # d = sqrt(s^2 + 1) along x = 5 between (4, 5) and (6, 5): a saddle of clearance 1 m at (5, 5).
    built = build_diagram(World.build(SQUARE, [Obstacle(((4.0, 5.0),)), Obstacle(((6.0, 5.0),))]))
    (arc,) = np.flatnonzero(built.curves.kind == ROOT)
    curve = built.curves.take([arc])
    assert curve.has_interior_minimum[0]
    assert curve.points(curve.least_distance_at)[0] == pytest.approx(np.array([5.0, 5.0]), abs=1e-12)
    assert curve.least_distance[0] == pytest.approx(1.0, rel=1e-12)
    s = np.linspace(-1.0, 1.0, 7)[None]
    assert curve.distance(s)[0] == pytest.approx(np.hypot(s[0], 1.0), rel=1e-14)


def test_the_border_at_a_free_wall_end_is_split():
    # Boost joins both sides of the wall's end in one edge; here four borders begin at the two ends.
    built = build_diagram(World.build(SQUARE, [Obstacle(((4.0, 5.0), (6.0, 5.5)))]))
    side = np.flatnonzero(~built.primary)
    assert len(side) == 4
    assert (np.sort(built.node_distance[built.ends[side]], axis=1)[:, 0] == 0.0).all()
    assert len(np.unique(built.ends[side])) == 8
    # the two cells beside each are the end and one side of the wall, each combination once
    assert len({frozenset(pair) for pair in built.cells[side].tolist()}) == 4


def test_a_straight_wall_cut_by_another_has_no_arc_of_its_own():
    # A wall on the middle of the floor's lower side: no arc may separate the two halves of the
    # upper side of nothing, and corners at the foot of the wall have one arc each.
    world = World.build(HALL, [Obstacle(((5.0, 0.0), (5.0, 1.0)))])
    built = build_diagram(world)
    at_foot = np.hypot(*(built.nodes - [5.0, 0.0]).T) < 1e-12
    assert at_foot.sum() == 2
    # along the corner arcs the distance grows as s / sqrt(2)
    arcs = np.flatnonzero(at_foot[built.ends].any(axis=1))
    assert np.abs(built.curves.slope[arcs]) == pytest.approx(np.full(2, math.sqrt(0.5)), rel=1e-12)


@given(room=rooms, obstacles=obstacle_lists)
def test_borders_are_equidistant_by_shapely(room, obstacles: list[Obstacle]):
    world = World.build(room, obstacles)
    built = build_diagram(world)
    points, claimed = samples(built)
    measured = np.abs(distance_by_shapely(room, obstacles, points))
    assert measured == pytest.approx(claimed, abs=1e-6)
    # two different nearest points: seen from an arc the distance falls on both sides of it
    arcs = built.curves.take(built.arcs)
    middle = arcs.middle
    tangent = arcs.tangents(middle)
    normal = np.column_stack([-tangent[:, 1], tangent[:, 0]])
    step = 1e-4 * np.minimum(arcs.distance(middle), arcs.length)
    wide = step > 1e-5
    for sign in (-1.0, 1.0):
        beside = arcs.points(middle) + sign * step[:, None] * normal
        lower = np.abs(distance_by_shapely(room, obstacles, beside)) - arcs.distance(middle)
        assert (lower[wide] < 1e-7).all()


@given(room=rooms, obstacles=obstacle_lists, radius=st.floats(0.05, 2.0))
def test_cutting_keeps_exactly_where_the_robot_fits(room, obstacles: list[Obstacle], radius: float):
    whole = build_diagram(World.build(room, obstacles))
    cut = whole.restricted(radius)
    verify_diagram(cut)
    assert (cut.curves.least_distance >= radius - 1e-9).all()
    # lengths by counting samples of the whole diagram
    count = 2000
    part = (np.arange(count) + 0.5) / count
    lengths = whole.curves.arc_length(whole.curves.span)
    s = lengths[:, :1] + np.diff(lengths, axis=1) * part
    fits = whole.curves.distance(whole.curves.at_arc_length(s)) >= radius
    expected = (fits.mean(axis=1) * whole.curves.length).sum()
    slack = 2.0 * whole.curves.length.sum() / count
    assert cut.curves.length.sum() == pytest.approx(expected, abs=slack + 1e-9)


def test_a_parabola_is_cut_where_its_distance_is_the_radius():
    # p = 5: r = (25 + u^2)/10 = 2.6 at u = +-1. Four parabolas, each cut in two.
    whole = build_diagram(World.build(SQUARE, [Obstacle(((5.0, 5.0),))]))
    cut = whole.restricted(2.6)
    bows = cut.curves.take(cut.curves.kind == PARABOLA)
    assert len(bows) == 8
    assert np.abs(bows.span).min(axis=1) == pytest.approx(np.ones(8), rel=1e-12)
    assert not bows.has_interior_minimum.any()


@settings(max_examples=20)
@given(
    angle=st.floats(-math.pi, math.pi),
    shift=st.tuples(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3)),
    radius=st.sampled_from([0.0, 0.3, 0.7]),
)
def test_moving_the_world_moves_the_diagram(angle: float, shift: tuple[float, float], radius: float):
    here = build_diagram(World.build(SQUARE, MIXED), radius)
    there = build_diagram(moved_world(SQUARE, MIXED, angle, shift), radius)
    assert len(there.arcs) == len(here.arcs)
    assert len(there.nodes) == len(here.nodes)
    assert arc_length(there) == pytest.approx(arc_length(here), rel=1e-8)
    assert np.sort(there.node_distance) == pytest.approx(np.sort(here.node_distance), abs=PLACE)


def test_mirroring_the_world_mirrors_the_diagram():
    def flipped(points) -> list[tuple[float, float]]:
        return [(-x, y) for x, y in points]

    here = build_diagram(World.build(SQUARE, MIXED), 0.3)
    mirrored = [Obstacle(tuple(flipped(o.vertices))) for o in MIXED]
    there = build_diagram(World.build(flipped(SQUARE), mirrored), 0.3)
    assert len(there.arcs) == len(here.arcs)
    assert len(there.nodes) == len(here.nodes)
    assert arc_length(there) == pytest.approx(arc_length(here), rel=1e-8)


@given(room=rooms, obstacles=obstacle_lists)
def test_arcs_of_a_cell_cover_its_feature_once(room, obstacles: list[Obstacle]):
    # Cells are strips over their feature: the feet of its arcs cover an edge from end to end, and a
    # vertex over the angle by which the walls there turn more than half round (2 pi for a point).
    world = World.build(room, obstacles)
    built = build_diagram(world)
    edges = len(world.edges)
    for cell in np.unique(built.cells):
        border, against = built.cell_borders(cell)
        arcs = built.primary[border]
        theta = built.foot_coordinate(cell, built.curves.take(border[arcs]))
        theta = np.where(against[arcs][:, None], theta[:, ::-1], theta)
        assert (theta[:, 1] >= theta[:, 0]).all()
        assert theta[1:, 0] == pytest.approx(theta[:-1, 1], abs=1e-5)
        covered = float((theta[:, 1] - theta[:, 0]).sum())
        if cell < 2 * edges:
            ends = world.vertices[world.edges[cell // 2]]
            assert covered == pytest.approx(math.dist(*ends), abs=1e-5)
            continue
        vertex = cell - 2 * edges
        around = world.edges[(world.edges == vertex).any(axis=1)]
        if len(around) == 0:
            assert covered == pytest.approx(2.0 * math.pi, abs=1e-5)
            continue
        offset = world.vertices[around.sum(axis=1) - vertex] - world.vertices[vertex]
        angle = np.sort(np.arctan2(offset[:, 1], offset[:, 0]))
        gap = np.diff(np.append(angle, angle[0] + 2.0 * math.pi))
        assert covered == pytest.approx(gap.max() - math.pi, abs=1e-5)


@given(room=rooms, obstacles=obstacle_lists, seed=st.integers(0, 1000))
def test_cell_of_names_the_nearest_feature(room, obstacles: list[Obstacle], seed: int):
    world = World.build(room, obstacles)
    built = build_diagram(world)
    rng = np.random.default_rng(seed)
    points = rng.uniform(0.0, 20.0, (30, 2))
    points = points[world.is_floor(points)]
    cell = built.cell_of(points)
    edges = len(world.edges)
    for p, c in zip(points, cell, strict=True):
        distance = float(world.distance(p))
        if c >= 2 * edges:
            assert math.dist(p, world.vertices[c - 2 * edges]) == pytest.approx(distance, abs=1e-9)
        else:
            a, b = world.vertices[world.edges[c // 2]]
            t, w = b - a, p - a
            height = (t[0] * w[1] - t[1] * w[0]) / math.hypot(*t)
            assert abs(height) == pytest.approx(distance, abs=1e-9)
            assert (height < 0.0) == (c % 2 == 1)


def test_curves_agree_with_finite_differences():
    built = build_diagram(World.build(SQUARE, MIXED))
    curves = built.curves.reversed(np.arange(len(built.curves)) % 2 == 1)
    u, h = curves.middle, 1e-5
    sign = np.sign(curves.span[:, 1] - curves.span[:, 0])
    before, here, after = (curves.points(u + sign * k * h) for k in (-1, 0, 1))
    speed = np.hypot(*(after - before).T) / (2.0 * h)
    assert curves.tangents(u) == pytest.approx((after - before) / (2.0 * h) / speed[:, None], abs=1e-9)
    length = (curves.arc_length(u + h) - curves.arc_length(u - h)) / (2.0 * h)
    assert length == pytest.approx(speed, rel=1e-8)
    assert curves.at_arc_length(curves.arc_length(u)) == pytest.approx(u, abs=1e-12)
    v, w = (after - before) / (2.0 * h), (after - 2.0 * here + before) / h**2
    bend = (v[:, 0] * w[:, 1] - v[:, 1] * w[:, 0]) / speed**3
    assert curves.curvature(u) == pytest.approx(bend, abs=1e-4)


def test_polylines_lie_on_the_arcs_and_respect_the_spacing():
    world = World.build(SQUARE, MIXED)
    built = build_diagram(world, 0.3)
    lines = built.polylines(0.2)
    assert len(lines) == len(built.arcs)
    for line, arc in zip(lines, built.arcs, strict=True):
        assert (world.distance(line) >= 0.3 - 1e-9).all()
        if built.curves.kind[arc] == PARABOLA:
            assert np.hypot(*np.diff(line, axis=0).T).max() <= 0.2 + 1e-9
        assert line[[0, -1]] == pytest.approx(built.nodes[built.ends[arc]], abs=PLACE)


@pytest.mark.parametrize("foot", [2.125, 2.0625, 2.03])
def test_edges_that_are_straight_up_to_rounding_inside_an_obstacle(foot: float):
    # Two walls end in a polygon and cut its side into three; rounding bends it by 1e-9 m over 1e-5 m, so
    # that inside the polygon the borders' geometry is noise, which must not reach the free side.
    star = (
        (1.0, 6.4),
        (1.4362354011056992, 6.1740644837316),
        (2.197605442609428, 5.418547771334483),
        (3.0, 7.0),
    )
    tip = (2.0, 5.61672130016084)
    walls = [Obstacle((tip, (1.5, 2.0))), Obstacle((tip, (1.5, foot)))]
    built = build_diagram(World.build(SQUARE, [Obstacle(star), *walls]))
    assert built.notes == ()


def _moved_node(built: VoronoiDiagram) -> VoronoiDiagram:
    nodes = built.nodes.copy()
    nodes[np.argmax(built.node_distance)] += [1e-5, 0.0]
    return dataclasses.replace(built, nodes=nodes)


def _nearer_node(built: VoronoiDiagram) -> VoronoiDiagram:
    distance = built.node_distance.copy()
    distance[np.argmax(distance)] -= 1e-5
    return dataclasses.replace(built, node_distance=distance)


def _lost_arc(built: VoronoiDiagram) -> VoronoiDiagram:
    keep = np.arange(len(built.curves)) != built.arcs[np.argmax(built.curves.length[built.arcs])]
    return _only(built, keep)


def _lost_border(built: VoronoiDiagram) -> VoronoiDiagram:
    return _only(built, np.arange(len(built.curves)) != np.flatnonzero(~built.primary)[0])


def _lost_island(built: VoronoiDiagram) -> VoronoiDiagram:
    return _only(built, built.primary & (built.curves.kind == PARABOLA))


def _only(built: VoronoiDiagram, keep: NDArray[np.bool_]) -> VoronoiDiagram:
    return dataclasses.replace(
        built,
        curves=built.curves.take(keep),
        ends=built.ends[keep],
        cells=built.cells[keep],
        primary=built.primary[keep],
    )


def _swapped_sides(built: VoronoiDiagram) -> VoronoiDiagram:
    cells = built.cells.copy()
    arc = built.arcs[np.argmin(built.node_distance[built.ends[built.arcs]].min(axis=1) == 0.0)]
    cells[arc] = cells[arc, ::-1]
    return dataclasses.replace(built, cells=cells)


def _wrong_feature(built: VoronoiDiagram) -> VoronoiDiagram:
    cells = built.cells.copy()
    cells[0] = cells[len(cells) // 2]
    return dataclasses.replace(built, cells=cells)


def _bent_arc(built: VoronoiDiagram) -> VoronoiDiagram:
    size = built.curves.size.copy()
    size[np.flatnonzero(built.curves.kind == PARABOLA)[0]] *= 1.0 + 1e-5
    return dataclasses.replace(built, curves=dataclasses.replace(built.curves, size=size))


@pytest.mark.parametrize(
    "spoil",
    [
        _moved_node,
        _nearer_node,
        _lost_arc,
        _lost_border,
        _lost_island,
        _swapped_sides,
        _wrong_feature,
        _bent_arc,
    ],
)
def test_a_spoiled_diagram_is_refused(spoil):
    built = build_diagram(World.build(SQUARE, MIXED))
    verify_diagram(built)
    with pytest.raises(DiagramError):
        verify_diagram(spoil(built))


def test_a_failed_check_leads_to_perturbed_input_and_a_note(monkeypatch):
    calls = []

    def fails_once(built: VoronoiDiagram) -> None:
        calls.append(built)
        if len(calls) == 1:
            raise DiagramError("for the test")
        verify_diagram(built)

    monkeypatch.setattr(diagram, "verify_diagram", fails_once)
    world = World.build(SQUARE, MIXED)
    built = build_diagram(world, 0.3)
    assert len(built.notes) == 1
    assert "perturbed" in built.notes[0]
    assert arc_length(built) == pytest.approx(arc_length(calls[0].restricted(0.3)), rel=1e-8)


def test_no_valid_diagram_is_a_planning_error(monkeypatch):
    def fails(_built: VoronoiDiagram) -> None:
        raise DiagramError("for the test")

    monkeypatch.setattr(diagram, "verify_diagram", fails)
    with pytest.raises(PlanningError, match="attempt 3: for the test"):
        build_diagram(World.build(SQUARE))


@pytest.mark.parametrize("angle", [0.0, 0.3])
def test_two_thousand_vertices(angle: float):
    # 20 x 25 racks in a hall: 2,004 vertices. Around each rack runs a loop: the Euler characteristic
    # of the floor is 1 - 500, which `verify_diagram` has compared with the arcs.
    racks = [rectangle(3.0 + 14.0 * i, 3.0 + 8.0 * j, 10.0, 5.0) for i in range(20) for j in range(25)]
    hall = ((0.0, 0.0), (285.0, 0.0), (285.0, 205.0), (0.0, 205.0))
    built = build_diagram(moved_world(hall, racks, angle, (1e4, -5e3)))
    assert built.notes == ()
    assert len(np.unique(built.ends[built.arcs])) - len(built.arcs) == 1 - 500


@settings(max_examples=20)
@given(obstacles=obstacle_lists, shift=st.sampled_from([1e5, -1e6]))
def test_far_from_the_origin(obstacles: list[Obstacle], shift: float):
    built = build_diagram(moved_world(ROOM, obstacles, 0.0, (shift, 0.5 * shift)))
    assert built.notes == ()


def test_a_node_without_a_place_leads_to_another_attempt():
    # Perturbed coordinates of this world made Boost give a node at infinity.
    obstacles = [
        rectangle(3.0, 0.0, 1.0, 5.0),
        rectangle(4.0, 1.0, 1.0, 5.0),
        Obstacle(((1.0, 1.0),)),
        Obstacle(((6.5, 3.866025403784439), (6.5, 2.1339745962155616), (8.0, 2.9999999999999996))),
        Obstacle(
            (
                (2.6736481776669305, 2.984807753012208),
                (1.5603073792140916, 2.342020143325669),
                (1.9999999999999996, 1.1339745962155616),
                (3.266044443118978, 1.3572123903134603),
                (2.875, 2.0),
            )
        ),
    ]
    verify_diagram(build_diagram(World.build(ROOM, obstacles)))
