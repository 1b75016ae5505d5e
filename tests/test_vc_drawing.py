"""What is drawn of the vc-method is what it found: roof, cells, partitions, graph, and the unfolded route."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import shapely
from report_case import vc_case

from verify import vc_drawing as drawing_module
from verify.report.figures_space import shown_words
from verify.vc_shapes import slice_of
from vnav_drake.problem import Problem


def eroded(problem: Problem, distance: float) -> shapely.Geometry:
    """The floor at least `distance` [m] from everything, by Shapely alone."""
    world = problem.world
    solid = shapely.union_all([shapely.Polygon(o.vertices) for o in world.obstacles])
    return world.boundary.buffer(-distance).difference(solid.buffer(distance, quad_segs=200))


def areas(patches: np.ndarray) -> np.ndarray:
    return np.asarray(shapely.area(shapely.polygons(patches[..., :2])))


def test_every_corner_of_the_roof_is_at_the_braking_limit():
    scenario, _, drawing = vc_case()
    points = drawing.space.roof.reshape(-1, 3)
    np.testing.assert_allclose(points[:, 2], scenario.problem.safe_speed(points[:, :2]), atol=1e-6)


def test_the_roof_covers_the_free_floor_once():
    # The ways from arcs to feet cover each free point once. Patches have straight sides, so that bends of
    # arcs and of clearances around corners cost a little area.
    scenario, _, drawing = vc_case()
    free = eroded(scenario.problem, scenario.problem.robot.radius)
    assert areas(drawing.space.roof).sum() == pytest.approx(free.area, rel=5e-3)
    covered = shapely.union_all(shapely.polygons(drawing.space.roof[..., :2]), grid_size=1e-9)
    assert covered.area == pytest.approx(free.area, rel=5e-3)


@pytest.mark.parametrize("distance", [0.25, 0.6, 1.1])
def test_slices_of_all_stacks_are_the_floor_at_that_distance(distance):
    # Vertical partitions only divide F^v, so that the stacks' slices at a height tile the whole slice there.
    scenario, result, _ = vc_case()
    parts = [slice_of(result.decomposition, k, distance) for k in range(len(result.decomposition.maximum))]
    whole = eroded(scenario.problem, distance)
    assert sum(part.area for part in parts) == pytest.approx(whole.area, rel=3e-3)
    assert shapely.union_all(parts).symmetric_difference(whole).area < 3e-3 * whole.area


def test_horizontal_partitions_lie_in_free_space_at_the_height_of_a_critical_point():
    scenario, result, drawing = vc_case()
    heights = result.critical.speed
    assert len(drawing.space.horizontal) == len(result.decomposition.cell_top) - len(
        result.decomposition.maximum
    )
    for speed, plan in drawing.space.horizontal:
        assert np.abs(heights - speed).min() < 1e-9
        corners = shapely.get_coordinates(plan)
        # outlines may be off by SIMPLER of the world's diameter, and V rises by a_b / V per metre
        slack = 2.0 * drawing_module.SIMPLER * scenario.problem.world.diameter / speed
        assert scenario.problem.safe_speed(corners).min() > speed - slack


def test_vertical_partitions_end_at_their_saddle_and_follow_the_roof():
    scenario, result, drawing = vc_case()
    assert len(drawing.space.vertical) == len(result.critical.saddles)
    for wall, saddle in zip(drawing.space.vertical, drawing.space.saddles, strict=True):
        np.testing.assert_allclose(wall[:, 2], scenario.problem.safe_speed(wall[:, :2]), atol=1e-6)
        np.testing.assert_allclose(wall[np.argmax(wall[:, 2])], saddle, atol=1e-9)
        np.testing.assert_allclose(wall[[0, -1], 2], 0.0, atol=1e-6)
    clearance = scenario.problem.clearance(drawing.space.feet.reshape(-1, 2))
    np.testing.assert_allclose(clearance, 0.0, atol=1e-9)


def test_the_graph_is_drawn_whole_and_its_route_is_one_chain():
    _, result, drawing = vc_case()
    graph = drawing.space.graph
    assert (len(graph.nodes), len(graph.type_a) + len(graph.type_b)) == result.graph.size
    ends = {tuple(np.round(node, 9)) for node in graph.nodes}
    for line in graph.type_a:
        assert {tuple(np.round(line[0], 9)), tuple(np.round(line[-1], 9))} <= ends
    np.testing.assert_allclose(graph.type_b[:, 0, :2], graph.type_b[:, 1, :2])
    assert (graph.type_b[:, 1, 2] > graph.type_b[:, 0, 2]).all()
    # a chain of n cells has n - 1 edges
    used = sum(graph.type_a_on_route) + sum(graph.type_b_on_route)
    assert int(graph.on_route.sum()) == len(set(result.route.cells)) == used + 1


def test_the_profile_is_unbroken_below_the_roof_and_takes_the_routes_time():
    _, result, drawing = vc_case()
    found = drawing.unfolded
    kinds = [kind for kind, _, _ in found.pieces]
    assert set(kinds) == {"boundary", "accelerate", "brake"}
    time = 0.0
    for kind, s, v in found.pieces:
        assert (v <= np.interp(s, found.s, found.roof) + 2e-3).all()
        if kind != "boundary":
            # constant acceleration: a_max = 0.4 and a_b = 1 m/s^2 of the scenario
            rate = np.diff(np.square(v)) / (2.0 * np.diff(s))
            np.testing.assert_allclose(rate, 0.4 if kind == "accelerate" else -1.0, rtol=1e-6)
        time += float((2.0 * np.diff(s) / (v[1:] + v[:-1])).sum())
    for (_, s, v), (_, t, w) in pairwise(found.pieces):
        assert t[0] == pytest.approx(s[-1], abs=1e-9)
        assert w[0] == pytest.approx(v[-1], abs=1e-6)
    # trapezoids are exact on ramps; on the limit ten points a piece leave about 1e-4 of the time
    assert time == pytest.approx(result.route.travel_time, rel=2e-4)


def test_strips_follow_each_other_between_the_saddles_of_the_route():
    _, result, drawing = vc_case()
    found = drawing.unfolded
    assert len(found.stacks) == len(result.route.saddles) + 1
    bounds = [0.0, *found.saddles[:, 0], found.s[-1]]
    for stack, (begin, end) in zip(found.stacks, pairwise(bounds), strict=True):
        assert (stack.begin, stack.end) == (begin, end)
        assert end > begin
    np.testing.assert_allclose(
        np.interp(found.saddles[:, 0], found.s, found.roof), found.saddles[:, 1], atol=1e-3
    )
    assert sum(sum(stack.used) for stack in found.stacks) == len(result.route.cells) == len(found.chain)
    heights = [
        (low, high)
        for stack in found.stacks
        for low, high, used in zip([0.0, *stack.tops], stack.tops, stack.used, strict=False)
        if used
    ]
    # the chain may lead up or down within a stack; each of its vertices lies inside its own cell
    assert all(any(low < v < high for low, high in heights) for v in found.chain[:, 1])


def test_the_route_through_a_stack_stays_on_its_ground():
    drawing = vc_case()[2]
    run = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(drawing.route, axis=0).T))])
    for stack in drawing.unfolded.stacks:
        inside = (run > stack.begin + 0.05) & (run < stack.end - 0.05)
        assert shapely.distance(shapely.points(drawing.route[inside]), stack.ground).max() < 0.02


def test_the_motion_is_told_along_the_arcs_with_its_corners_on_it():
    _, result, drawing = vc_case()
    driven, corners = drawing.unfolded.driven, drawing.unfolded.corners
    assert (np.diff(driven[:, 0]) >= 0.0).all()
    assert driven[0, 1] == driven[-1, 1] == 0.0  # rest to rest
    assert len(corners) == len(result.realisation.point) > 0
    np.testing.assert_array_equal(corners[:, 2], result.realisation.radius)
    assert (corners[:, 1] <= result.realisation.speed + 1e-9).all()


def test_of_many_stacks_those_of_the_route_come_first_and_the_words_say_how_many(monkeypatch):
    scenario, result, whole = vc_case()
    assert shown_words(whole.space) == ""
    passed = {int(result.decomposition.cell_stack[cell]) for cell in result.route.cells}
    slopes = np.bincount(result.decomposition.slope_stack)
    monkeypatch.setattr(drawing_module, "MOST_SLOPES", int(slopes[list(passed)].sum()))
    drawing = drawing_module.vc_drawing(scenario.problem, result)
    assert drawing.space.stacks == len(passed) < drawing.space.total == len(result.decomposition.maximum)
    tops = result.critical.point[result.decomposition.maximum[sorted(passed)]]
    np.testing.assert_array_equal(drawing.space.maxima[:, :2], tops)
    assert (
        shown_words(drawing.space)
        == f"Of {drawing.space.total} stacks {len(passed)} on or near the route are drawn."
    )


def test_the_roof_has_no_more_patches_than_allowed(monkeypatch):
    scenario, result, _ = vc_case()
    monkeypatch.setattr(drawing_module, "MOST_PATCHES", 400)
    roof = drawing_module.vc_drawing(scenario.problem, result).space.roof
    assert 0 < len(roof) <= 400
