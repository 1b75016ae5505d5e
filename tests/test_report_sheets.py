"""The certificate's pictures for a point robot: across a wall without thickness the potential jumps."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from judged import scenario_bytes

from verify.judge.certificate import check_certificate, read_certificate
from verify.judge.question import read_question
from verify.report.bound import BoundMesh
from verify.report.figures_potential import draw_potential, draw_slack
from vnav_drake.lower_bound import lower_bound
from vnav_drake.scenario import parse_scenario

BRAKING = 1.0  # [m/s^2]
WALL = np.array([[5.7, 1.1], [6.4, 6.3]])
ROOM = {"boundary": [[0, 0], [12, 0], [12, 8], [0, 8]], "obstacles": [{"vertices": WALL.tolist()}]}
START, GOAL = np.array([5.0, 3.7]), np.array([7.1, 3.6])  # one on each side
ALONG = (WALL[1] - WALL[0]) / np.hypot(*(WALL[1] - WALL[0]))
LEFT = np.array([-ALONG[1], ALONG[0]])


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    data = scenario_bytes(
        world=ROOM,
        robot={"radius": 0.0, "max_braking": BRAKING},
        start={"position": START.tolist()},
        goal={"position": GOAL.tolist()},
    )
    problem = parse_scenario(data, "room.yaml").problem
    folder = tmp_path_factory.mktemp("sheets")
    found = lower_bound(problem, effort="quick", budget=3000)
    found.certificate.save(folder / "certificate.npz")
    file = read_certificate(folder)
    proof = check_certificate(file, read_question(data))
    assert proof.holds, proof.reasons
    return problem, BoundMesh.of(file, np.asarray(proof.slack)), proof


def beside(away: float, count: int = 200) -> np.ndarray:
    """Points (count, 2) at a distance from the wall's middle third, negative on its right."""
    share = np.linspace(1 / 3, 2 / 3, count)[:, None]
    return WALL[0] + share * (WALL[1] - WALL[0]) + away * LEFT


def test_some_triangles_stand_twice(case):
    mesh = case[1]
    assert (mesh.side > 0).sum() == (mesh.side < 0).sum() > 0


def test_the_potential_is_that_of_the_points_own_side(case):
    # A u that is continuous across the wall has |grad u| <= 1/V = 1/sqrt(2 a l), so between two points at
    # the distance l on both sides of it grows by at most 2 sqrt(2 l / a): 0.09 s for 1 mm. The way round the
    # wall's end takes seconds, and the certificate proves most of them.
    _, mesh, proof = case
    away = 1e-3
    rise = mesh.potential(beside(-away)) - mesh.potential(beside(away))  # the start is on the left
    assert np.isfinite(rise).all()
    assert rise.min() > 10.0 * 2.0 * np.sqrt(2.0 * away / BRAKING)
    ends = mesh.potential(np.array([START, GOAL]))
    assert ends[1] - ends[0] == pytest.approx(proof.travel_time, rel=1e-9)


def test_the_potential_changes_no_faster_than_the_robot_moves_on_either_side(case):
    # Along a line at the distance l from the wall V <= sqrt(2 a l), and with it |du/ds| <= 1/V up to the
    # minorants: no jump where copies and whole triangles meet. The other walls are farther than l.
    _, mesh, _ = case
    for away in (0.05, -0.05):
        line = beside(away, 4000)
        step = np.hypot(*np.diff(line, axis=0).T)
        rate = np.abs(np.diff(mesh.potential(line))) / step
        assert rate.max() <= (1.0 + 1e-6) / np.sqrt(2.0 * BRAKING * abs(away))


def test_pieces_of_a_copy_lie_on_its_own_side_and_tile_the_floor_once(case):
    _, mesh, _ = case
    points, triangles, u = mesh.pieces()
    corners = points[triangles]
    places = np.sort(mesh.place[mesh.triangles], axis=1)
    _, once = np.unique(places, axis=0, return_index=True)
    floor = shapely.area(shapely.polygons(mesh.corners[once])).sum()
    assert len(once) < len(mesh.triangles)
    assert shapely.area(shapely.polygons(corners)).sum() == pytest.approx(floor, rel=1e-12)
    # u of a piece is that of its centre's side: at the centre of a small triangle it differs from the mean
    # of its corners by at most a part of their spread.
    centre = corners.mean(axis=1)
    height = (centre - WALL[0]) @ LEFT
    clear = np.abs(height) > 1e-9
    spread = np.ptp(u[triangles], axis=1)
    off = np.abs(mesh.potential(centre) - u[triangles].mean(axis=1))
    assert (off[clear] <= spread[clear] + 1e-9).all()


def test_parts_of_the_triangles_are_those_beside_the_wall(case):
    _, mesh, _ = case
    cut = mesh.side != 0
    parts = shapely.area(mesh.parts)
    whole = shapely.area(shapely.polygons(mesh.corners))
    np.testing.assert_allclose(parts[~cut], whole[~cut], rtol=1e-12)
    assert parts[cut].sum() == pytest.approx(0.5 * whole[cut].sum(), rel=1e-9)  # two parts, one triangle
    inside = shapely.get_coordinates(shapely.point_on_surface(mesh.parts[cut]))
    assert (((inside - WALL[0]) @ LEFT) * np.sign(mesh.side[cut]) > 0.0).all()


def test_both_pictures_are_drawn(case):
    problem, mesh, _ = case
    assert "<path" in draw_potential(problem, mesh, None).svg
    assert all("<path" in picture.svg for picture in draw_slack(problem, mesh, None))
