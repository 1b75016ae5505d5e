"""Certificates whose u jumps across walls: what is proven with them, and what is refused."""

from __future__ import annotations

import math

import certificate_case as case
import numpy as np
import pytest
import shapely
import sheet_case as sheets
from hypothesis import given, settings
from hypothesis import strategies as st
from judged import scenario_bytes

from verify.evidence import EvidenceError
from verify.judge.certificate import check_certificate, read_certificate
from verify.judge.question import read_question
from vnav_drake.lower_bound import lower_bound
from vnav_drake.scenario import parse_scenario

BOTH = pytest.mark.parametrize("exact", [False, True], ids=["float", "exact"])
ROOM = [[0, 0], [12, 0], [12, 8], [0, 8]]
MESH = (np.arange(0.0, 13.0), np.arange(0.0, 9.0))  # cells of 1 m, alternately cut


def asked_with(*walls, more=(), start=(2.2, 3.3), goal=(10.1, 4.4), radius=0.0, **changes):
    obstacles = [{"name": f"wall {k}", "vertices": wall} for k, wall in enumerate(walls)]
    return case.question(
        world={"boundary": ROOM, "obstacles": [*obstacles, *more]},
        robot={"radius": radius},
        start={"position": list(start)},
        goal={"position": list(goal)},
        **changes,
    )


def flat(asked, rise, apart=frozenset()):
    """u = 0 in the part of the start, `rise` in others, as far as corners are joined: without any slope."""
    random = np.random.default_rng(0)
    arrays = case.make(asked, *case.grid(*MESH), lambda p: np.zeros(len(p)), scale=False)
    arrays = sheets.in_sheets(arrays, asked, random, apart)
    label = np.arange(len(arrays["vertices"]))
    for _ in range(len(label)):
        low = label.copy()
        least = np.repeat(label[arrays["triangles"]].min(axis=1), 3)
        np.minimum.at(low, arrays["triangles"].ravel(), least)
        if (low == label).all():
            break
        label = low
    corners = (arrays["vertices"] * arrays["unit"])[arrays["triangles"]]
    for end in ("start", "goal"):
        around = shapely.intersects(shapely.polygons(corners), shapely.Point(arrays[end]))
        f = np.abs(arrays["side"]) - 1
        a, b = asked.features.table[f, :2], asked.features.table[f, 2:4]
        turn = (b - a)[:, 0] * (arrays[end] - a)[:, 1] - (b - a)[:, 1] * (arrays[end] - a)[:, 0]
        arrays[f"{end}_triangle"] = np.array(
            np.argmax(around & ((arrays["side"] == 0) | (turn * arrays["side"] > 0)))
        )
    of_start, of_goal = (
        label[arrays["triangles"][arrays[f"{end}_triangle"], 0]] for end in ("start", "goal")
    )
    arrays["u_vertex"] = np.where(label == of_start, 0.0, rise)
    arrays["u_edge"] = arrays["u_vertex"][arrays["edges"]].mean(axis=1)
    arrays["weight"][:] = 0.0  # where u does not rise no bound is needed
    arrays["travel_time"] = np.array(rise if of_start != of_goal else 0.0)
    return case.sealed(arrays)


def told(arrays, asked, folder):
    """The reasons for which both arithmetics refuse."""
    found = [case.proof(case.sealed(arrays), asked, folder, exact=exact) for exact in (False, True)]
    assert not found[0].holds
    assert found[0].reasons == found[1].reasons
    return " | ".join(found[0].reasons)


# --- what is proven ---------------------------------------------------------------------------------

# From rim to rim, so that start and goal are in different parts: no motion goes from one to the other.
THROUGH = {
    "along a mesh line": [[6, 0], [6, 8]],
    "between mesh lines": [[6.25, 0], [6.25, 8]],
    "oblique": [[5.1, 0], [6.9, 8]],
    "off the mesh": [[4.7, 0], [7.4, 8]],
    "through vertices": [[4, 0], [8, 8]],
    "along diagonals": [[2, 0], [10, 8]],
}


@BOTH
@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("name", THROUGH)
def test_a_wall_from_rim_to_rim_parts_start_and_goal(name, turned, exact, tmp_path):
    # grad u = 0, u is 0 on one side and 1000 s on the other: no motion takes less, as there is none.
    wall = THROUGH[name][:: -1 if turned else 1]
    asked = asked_with(wall, start=(1.2, 6.3), goal=(11.1, 1.4))
    arrays = flat(asked, 1000.0)
    proof = case.proof(arrays, asked, tmp_path, exact=exact)
    assert proof.holds, proof.reasons
    assert proof.travel_time == 1000.0
    count = int((arrays["side"] > 0).sum())
    assert (count == 0) == (name == "along a mesh line")
    stand = "1 triangle stands in two sheets" if count == 1 else f"{count} triangles stand in two sheets"
    assert stand in proof.statement
    assert "that touches nothing" in proof.statement


def test_without_sheets_the_statement_does_not_speak_of_them(tmp_path):
    asked = asked_with()
    arrays = case.make(asked, *case.grid(*MESH), lambda p: p[:, 0])
    assert not arrays["side"].any()
    proof = case.proof(arrays, asked, tmp_path)
    assert proof.holds, proof.reasons
    assert "sheets" not in proof.statement
    assert "touches" not in proof.statement


@pytest.mark.parametrize(
    "wall",
    [[[6, 0], [6, 7]], [[6.25, 0], [6.25, 7.2]], [[5.1, 0], [6.7, 7.1]], [[4, 0], [7.5, 7]]],
    ids=["along a mesh line", "between mesh lines", "oblique", "through vertices"],
)
def test_a_gap_beside_the_wall_joins_both_sides(wall, tmp_path):
    # The same u with another wall, which leaves a way at the top: the copies there are not told apart.
    asked = asked_with(wall)
    arrays = flat(asked, 1000.0)
    proof = case.proof(arrays, asked, tmp_path)
    assert proof.holds, proof.reasons
    assert proof.travel_time == 0.0  # one component: u = 0


@pytest.mark.parametrize("name", ["along a mesh line", "between mesh lines", "oblique"])
def test_u_that_jumps_across_a_gap_is_refused(name, tmp_path):
    # Made for a wall from rim to rim, then the wall is shorter by 1.5 m, in the certificate too.
    arrays = flat(asked_with(THROUGH[name]), 1000.0)
    a, b = np.array(THROUGH[name], dtype=float)
    short = b + (a - b) / np.linalg.norm(a - b) * 1.5
    asked = asked_with([a.tolist(), short.tolist()])
    arrays["features"] = asked.features.table
    found = told(arrays, asked, tmp_path)
    if name == "along a mesh line":
        # the wall ends at (6, 6.5)
        assert "u may jump, without a wall all along, across the side from (6, 6) to (6, 7) m" in found
        assert "the side from (6, 7) to (6, 8) m" in found
        assert "(6, 5)" not in found
    else:
        assert "not cut through by its wall: the triangle around (" in found


def test_walls_that_cover_a_side_together_do_not_count_as_one(tmp_path):
    # Stricter than needed: no point of the side is off the walls, but each wall is looked at by itself.
    asked = asked_with([[6, 0], [6, 3.5]], [[6, 3.5], [6, 8]])
    arrays = flat(asked_with(THROUGH["along a mesh line"]), 1000.0)
    arrays["features"] = asked.features.table
    found = told(arrays, asked, tmp_path)
    assert found == "u may jump, without a wall all along, across the side from (6, 3) to (6, 4) m"


@BOTH
@pytest.mark.parametrize("turned", [(1, 1), (1, -1), (-1, 1), (-1, -1)])
@pytest.mark.parametrize("shift", [0.0, 0.25, -0.25, 2.0**-40, -(2.0**-40)])
def test_two_walls_that_end_at_one_side_leave_a_gap_between_them(shift, turned, exact, tmp_path):
    # Both end at y = 4 m, one from below at x = 6.5 m, one from above. Where they end at the same point
    # nothing gets through; else there is a gap within the side from (6, 4) to (7, 4).
    def walls(x):
        return [[6.5, 0], [6.5, 4]][:: turned[0]], [[x, 4], [x, 8]][:: turned[1]]

    arrays = flat(asked_with(*walls(6.5)), 1000.0)
    asked = asked_with(*walls(6.5 + shift))
    arrays["features"] = asked.features.table
    proof = case.proof(case.sealed(arrays), asked, tmp_path, exact=exact)
    across = "u may jump, without a wall all along, across the side from (6, 4) to (7, 4) m"
    other_way = "u may jump, without a wall all along, across the side from (7, 4) to (6, 4) m"
    assert proof.holds == (shift == 0.0)
    assert shift == 0.0 or proof.reasons in ((across,), (other_way,))
    assert proof.travel_time == (1000.0 if shift == 0.0 else 0.0)


@pytest.mark.parametrize("turned", [(1, 1), (1, -1), (-1, 1), (-1, -1)])
def test_a_gap_between_a_wall_that_ends_at_a_vertex_and_one_that_ends_at_a_side(turned, tmp_path):
    # The first ends at (7, 4), the second at (6.75, 4): of the side from (6, 4) to (7, 4) all but its end is
    # above the first wall, and what is right of the second is above the first, too.
    walls = [[0, 0.5], [7, 4]][:: turned[0]], [[6.75, 4], [6.75, 8]][:: turned[1]]
    asked = asked_with(*walls)
    joined = flat(asked, 1000.0)
    proof = case.proof(joined, asked, tmp_path)
    assert proof.holds, proof.reasons
    assert proof.travel_time == 0.0
    torn = flat(asked, 1000.0, frozenset({5 * turned[0], -6 * turned[1]}))
    assert torn["travel_time"] == 1000.0
    found = told(torn, asked, tmp_path)
    assert found.startswith("u may jump, without a wall all along, across the side from (")
    assert found.endswith(("(6, 4) to (7, 4) m", "(7, 4) to (6, 4) m"))


def test_a_start_at_a_vertex_that_has_a_copy_on_the_other_side(tmp_path):
    # The wall is at x = 6.225 m beside (6, 5): triangles around are cut, and their other copies have another
    # vertex there, whose value no motion sees.
    asked = asked_with(THROUGH["oblique"], start=(6, 5))
    arrays = flat(asked, 1000.0)
    copies = (arrays["vertices"] * arrays["unit"] == [6, 5]).all(axis=1)
    assert copies.sum() > 1
    proof = case.proof(arrays, asked, tmp_path)
    assert proof.holds, proof.reasons
    assert proof.travel_time == 1000.0


# --- tampering --------------------------------------------------------------------------------------


@pytest.fixture
def oblique():
    asked = asked_with(
        [[5.1, 0], [6.9, 8]], more=[{"vertices": [[1, 1], [2, 1], [2, 2]]}, {"vertices": [[11, 7]]}]
    )
    return asked, flat(asked, 1000.0)


def a_pair(arrays):
    """Rows of the left and the right copy of one triangle, away from the rim."""
    middle = (arrays["vertices"] * arrays["unit"])[arrays["triangles"]].mean(axis=1)
    order = np.argsort(np.hypot(*(middle - [6.0, 4.0]).T), kind="stable")
    left = next(int(row) for row in order if arrays["side"][row] > 0)
    same = np.isclose(middle, middle[left]).all(axis=1) & (arrays["side"] < 0)
    return left, int(np.flatnonzero(same)[0])


def without(arrays, row):
    changed = {**arrays, **{key: np.delete(arrays[key], row, axis=0) for key in sheets.PER_TRIANGLE}}
    for end in ("start", "goal"):
        changed[f"{end}_triangle"] = arrays[f"{end}_triangle"] - (row < arrays[f"{end}_triangle"])
    kept = set(
        map(
            tuple,
            np.sort(np.stack([changed["triangles"], np.roll(changed["triangles"], -1, 1)], 2), 2)
            .reshape(-1, 2)
            .tolist(),
        )
    )
    used = np.array([tuple(pair) in kept for pair in arrays["edges"].tolist()])
    return {**changed, "edges": arrays["edges"][used], "u_edge": arrays["u_edge"][used]}


def test_the_oblique_wall_as_made_holds(oblique, tmp_path):
    asked, arrays = oblique
    proof = case.proof(arrays, asked, tmp_path)
    assert proof.holds, proof.reasons
    assert proof.travel_time == 1000.0


def test_a_copy_without_a_partner(oblique, tmp_path):
    asked, arrays = oblique
    for row in a_pair(arrays):
        found = told(without(arrays, row), asked, tmp_path)
        assert "without a copy for the other side of its wall: the triangle around (" in found
        assert "areas" not in found


def test_a_side_given_to_a_triangle_that_is_whole(oblique, tmp_path):
    asked, arrays = oblique
    arrays["side"][np.flatnonzero(arrays["side"] == 0)[0]] = arrays["side"].max()
    assert "without a copy for the other side of its wall" in told(arrays, asked, tmp_path)


def test_a_side_taken_away(oblique, tmp_path):
    asked, arrays = oblique
    for rows in (a_pair(arrays), a_pair(arrays)[:1], a_pair(arrays)[1:]):
        changed = {**arrays, "side": arrays["side"].copy()}
        changed["side"][list(rows)] = 0
        found = told(changed, asked, tmp_path)
        assert "more than once, and not once for each side of one wall: the triangle around (" in found
        assert "m^2 more than the box" in found


def test_both_copies_on_one_side(oblique, tmp_path):
    asked, arrays = oblique
    left, right = a_pair(arrays)
    arrays["side"][right] = arrays["side"][left]
    assert "more than once, and not once for each side of one wall" in told(arrays, asked, tmp_path)


def test_the_sides_of_two_copies_swapped(oblique, tmp_path):
    asked, arrays = oblique
    pair = list(a_pair(arrays))
    arrays["side"][pair] = arrays["side"][pair[::-1]]
    assert "u may jump, without a wall all along, across the side from (" in told(arrays, asked, tmp_path)


def test_three_copies(oblique, tmp_path):
    asked, arrays = oblique
    left, _ = a_pair(arrays)
    for key in sheets.PER_TRIANGLE:
        arrays[key] = np.concatenate([arrays[key], arrays[key][left : left + 1]])
    found = told(arrays, asked, tmp_path)
    assert "more than once, and not once for each side of one wall" in found
    assert "two triangles lie on the same side" in found


@pytest.mark.parametrize("feature", [0, 5, 6, 8], ids=["boundary", "polygon", "polygon again", "point"])
def test_cut_by_what_is_no_wall(feature, oblique, tmp_path):
    asked, arrays = oblique
    assert len(asked.features.table) == 4 + 1 + 3 + 1  # room, wall, polygon, point
    pair = list(a_pair(arrays))
    arrays["side"][pair] = [feature + 1, -feature - 1]
    assert "cut by what is no wall: the triangle around (" in told(arrays, asked, tmp_path)


def test_cut_by_a_wall_elsewhere(tmp_path):
    asked = asked_with([[5.1, 0], [6.9, 8]], [[1, 5], [4, 6]])
    arrays = flat(asked, 1000.0)
    pair = list(a_pair(arrays))
    assert arrays["side"][pair].tolist() == [5, -5]
    arrays["side"][pair] = [6, -6]
    assert "not cut through by its wall: the triangle around (" in told(arrays, asked, tmp_path)


@pytest.mark.parametrize(
    ("wall", "holds"),
    [
        ([[6, 3], [7, 3.5]], True),  # from a corner to the side opposite
        ([[6, 3], [7 - 2.0**-30, 3.5]], False),
        ([[6.25, 3.125], [7, 3.5]], False),  # its line meets the corner, the wall does not
        ([[5, 3], [9, 3 + 2.0**-30]], True),  # a hair above the side
        ([[5, 3], [9, 3]], False),  # along the side: nothing is on its right
        ([[6.5, 2], [6.5, 3.5]], True),  # from below to the diagonal
        ([[6.5, 2], [6.5, 3.5 - 2.0**-40]], False),
        ([[6.5, 3], [6.5, 3.5]], True),
        ([[6.5, 3 + 2.0**-40], [6.5, 3.5]], False),
        ([[6.5, 3.5], [6.5, 9.5]], False),  # beyond the triangle, on the same line
    ],
)  # fmt: skip
@BOTH
def test_a_wall_cuts_a_triangle_from_rim_to_rim_or_not_at_all(wall, holds, exact, tmp_path):
    # The triangle (6, 3), (7, 3), (7, 4): its copies share all vertices, so that only the cut is in question.
    asked = asked_with(wall)
    vertices, triangles = case.grid(*MESH)
    place = {tuple(xy): k for k, xy in enumerate(vertices.tolist())}
    corner = [place[xy] for xy in ((6.0, 3.0), (7.0, 3.0), (7.0, 4.0), (6.0, 4.0))]
    cell = np.isin(triangles, corner).all(axis=1)
    halves = [[corner[0], corner[1], corner[2]], [corner[0], corner[2], corner[3]]]
    triangles = np.concatenate([triangles[~cell], halves])
    arrays = case.make(asked, vertices, triangles, lambda p: p[:, 0] + 25.0)
    row = np.flatnonzero((arrays["triangles"] == halves[0]).all(axis=1))
    for key in sheets.PER_TRIANGLE:
        arrays[key] = np.concatenate([arrays[key], arrays[key][row]])
    arrays["side"][[row[0], -1]] = [5, -5]
    proof = case.proof(case.sealed(arrays), asked, tmp_path, exact=exact)
    assert proof.holds == holds
    assert proof.reasons == (() if holds else proof.reasons[:1])
    assert holds or proof.reasons[0].startswith(
        "not cut through by its wall: the triangle around (6.66666667, 3.3"
    )


def for_robot(arrays, **change):
    """The case with another robot: a wall from side to side, so that nobody gets across."""
    more = [{"vertices": [[1, 1], [2, 1], [2, 2]]}, {"vertices": [[11, 7]]}]
    asked = asked_with([[5.1, 0], [6.9, 8]], more=more, **change)
    limits = asked.setting.limits
    arrays["law"] = np.array([limits.radius, limits.braking, 0.0, limits.margin, math.inf])
    return asked


def test_copies_are_for_a_robot_without_margin(oblique, tmp_path):
    _, arrays = oblique
    found = told(arrays, for_robot(arrays, braking={"margin": 0.1}), tmp_path)
    assert "m, are for a robot without margin; this one has 0.1 m" in found
    assert "copies, as at (" in found


@BOTH
def test_copies_are_for_a_robot_with_a_radius_too(exact, oblique, tmp_path):
    _, arrays = oblique
    asked = for_robot(arrays, radius=0.5)
    proof = case.proof(case.sealed(arrays), asked, tmp_path, exact=exact)
    assert proof.holds, proof.reasons
    assert "a disc of radius 0.5 m" in proof.statement
    assert "that touches nothing on its way" in proof.statement


@pytest.mark.parametrize("end", ["start", "goal"])
@pytest.mark.parametrize("place", [[5.1, 0.0], [6.0, 4.0], [6.9, 8.0]], ids=["end", "middle", "other end"])
def test_no_end_may_lie_on_a_wall(end, place, oblique, tmp_path):
    # (6, 4) is the wall's middle in doubles, too: 5.1 + 6.9 = 12 are rounded alike or it is off by 1e-16
    wall = [[5.0, 0], [7.0, 8]] if place == [6.0, 4.0] else [[5.1, 0], [6.9, 8]]
    arrays = flat(asked_with(wall), 1000.0)
    data = {"start": (2.2, 3.3), "goal": (10.1, 4.4), end: tuple(place)}
    asked = asked_with(wall, start=data["start"], goal=data["goal"])
    arrays[end] = np.array(place)
    found = told(arrays, asked, tmp_path)
    assert (
        f"copies are not allowed where an end lies on a wall: the {end} ({place[0]:g}, {place[1]:g}) m"
        in found
    )


@pytest.mark.parametrize("end", ["start", "goal"])
def test_an_end_in_the_copy_of_the_other_side(end, tmp_path):
    # Both ends in a triangle that the wall cuts (x = 6.135 m and 6.0675 m beside them).
    wall = [[5.1, 0], [6.9, 8]]
    asked = asked_with(wall, start=(6.1, 4.6), goal=(6.1, 4.3))
    arrays = flat(asked, 1000.0)
    assert case.proof(arrays, asked, tmp_path).travel_time == 1000.0
    row = int(arrays[f"{end}_triangle"])
    corners = (arrays["vertices"] * arrays["unit"])[arrays["triangles"]]
    other = np.flatnonzero(
        (corners == corners[row]).all(axis=(1, 2)) & (arrays["side"] == -arrays["side"][row])
    )
    arrays[f"{end}_triangle"] = np.array(other[0])
    arrays["travel_time"] = np.array(-1000.0)
    found = told(arrays, asked, tmp_path)
    x, y = arrays[end]
    assert f"the {end} ({x:g}, {y:g}) m is not on the side of the wall for which its triangle stands" in found


def test_a_start_where_two_obstacles_touch_has_one_value(tmp_path):
    # At (4, 4) two racks touch by their corners: the free triangles on both sides are not neighbours there,
    # and a motion may set out to either. With a vertex for each, u would jump at the start.
    racks = [[[3, 3], [4, 3], [4, 4], [3, 4]], [[4, 4], [5, 4], [5, 5], [4, 5]]]
    asked = asked_with(more=[{"vertices": rack} for rack in racks])
    mesh = case.grid(*MESH)
    arrays = case.make(asked, *mesh, lambda p: np.zeros(len(p)), scale=False)
    pinch = int(np.flatnonzero((arrays["vertices"] * case.UNIT == [4, 4]).all(axis=1))[0])
    corners = (arrays["vertices"] * arrays["unit"])[arrays["triangles"]]
    above = (arrays["triangles"] == pinch).any(axis=1) & (corners.mean(axis=1)[:, 1] > 4)
    arrays["triangles"] = np.where(
        above[:, None] & (arrays["triangles"] == pinch),
        np.int32(len(arrays["vertices"])),
        arrays["triangles"],
    ).astype(np.int32)
    arrays["vertices"] = np.concatenate([arrays["vertices"], arrays["vertices"][[pinch]]])
    arrays["u_vertex"] = np.append(arrays["u_vertex"], 0.0)
    arrays = sheets.with_edges(arrays, np.random.default_rng(0))
    arrays["u_edge"] = np.zeros(len(arrays["edges"]))
    # Elsewhere two vertices at the place where the racks touch do no harm: no motion gets there.
    assert case.proof(case.sealed(arrays), asked, tmp_path).holds
    for end in ("start", "goal"):
        moved = {**arrays, end: np.array([4.0, 4.0])}
        moved[f"{end}_triangle"] = np.array(np.flatnonzero(above)[0])
        ends = {"start": (2.2, 3.3), "goal": (10.1, 4.4), end: (4.0, 4.0)}
        there = asked_with(more=[{"vertices": rack} for rack in racks], **ends)
        assert told(moved, there, tmp_path) == f"u has more than one value at the {end} (4, 4) m"


@pytest.mark.parametrize("value", [6, -6, 2**31 - 1, -(2**31)])
def test_a_side_that_names_no_feature_is_not_read(value, tmp_path):
    asked = asked_with(THROUGH["oblique"])
    arrays = flat(asked, 1000.0)
    arrays["side"][3] = value
    with pytest.raises(EvidenceError, match=rf"side\[3\] = {value}: must be 0 or up to 5"):
        case.read(case.sealed(arrays), tmp_path)


def test_a_file_without_sides_is_not_read(tmp_path):
    arrays = case.make(asked_with(), *case.grid(*MESH), lambda p: p[:, 0])
    del arrays["side"]
    with pytest.raises(EvidenceError, match="the array side is missing"):
        case.read(case.sealed(arrays), tmp_path)


# --- random rooms -----------------------------------------------------------------------------------


def ends(x, y):
    return st.lists(st.tuples(x, y), min_size=2, max_size=2).filter(lambda wall: math.dist(*wall) > 1e-6)


anywhere = ends(st.floats(0.0, 12.0), st.floats(0.0, 8.0))
at_vertices = ends(*(st.integers(0, size).map(float) for size in (12, 8)))
along_lines = st.tuples(anywhere, st.integers(1, 7)).map(
    lambda drawn: [(x, float(drawn[1])) for x, _ in drawn[0]]
)
wall = st.one_of(anywhere, at_vertices, along_lines.filter(lambda wall: math.dist(*wall) > 1e-6))


@st.composite
def rooms(draw):
    """Walls that lie on mesh lines, end at vertices, cross, or know nothing of the mesh; random values."""
    walls = [draw(wall) for _ in range(draw(st.integers(1, 3)))]
    lines = [
        np.unique([0.0, size, *draw(st.lists(st.integers(1, size - 1), min_size=2, max_size=5))])
        for size in (12, 8)
    ]
    asked = None
    for start, goal in (((1.3, 0.7), (11.2, 7.1)), ((0.3, 5.7), (7.7, 0.6)), ((2.9, 7.6), (10.9, 3.9))):
        asked = asked_with(*(list(map(list, ends)) for ends in walls), start=start, goal=goal)
        if asked.setting.surroundings.distance(np.array([start, goal])).min() > 0.0:
            break
    seed = draw(st.integers(0, 2**32 - 1))
    random = np.random.default_rng(seed)
    arrays = case.make(asked, *case.grid(*lines), lambda p: random.normal(size=len(p)), scale=False)
    arrays = sheets.in_sheets(arrays, asked, random)
    choose_ends(arrays, asked)
    case.rescale(arrays)
    return asked, case.sealed(arrays), random


def choose_ends(arrays, asked):
    for end in ("start", "goal"):
        arrays[f"{end}_triangle"] = np.array(around(arrays, asked, arrays[end][None])[0])


def around(arrays, asked, points):
    """For each point (k, 2) a copy whose closed triangle and open part hold it; (k,)."""
    corner = (arrays["vertices"] * arrays["unit"])[arrays["triangles"]]
    share = shares(corner, points)
    f = np.abs(arrays["side"]) - 1
    a, b = asked.features.table[f, :2], asked.features.table[f, 2:4]
    to = points[:, None] - a
    turn = (b - a)[:, 0] * to[..., 1] - (b - a)[:, 1] * to[..., 0]
    held = (share.min(axis=2) >= -1e-12) & ((arrays["side"] == 0) | (turn * arrays["side"] > 0))
    assert held.any(axis=1).all()
    return np.argmax(held, axis=1)


def shares(corner, points):
    """Barycentric coordinates (k, t, 3)."""
    inverse = np.linalg.inv(np.concatenate([corner, np.ones((len(corner), 3, 1))], axis=2))
    return np.einsum("kc,tcj->ktj", np.column_stack([points, np.ones(len(points))]), inverse)


def values(arrays, asked, points):
    """u [s] at points (k, 2), by the definition."""
    rows = around(arrays, asked, points)
    found = np.empty(len(points))
    for k, row in enumerate(rows):
        triangle = arrays["triangles"][row]
        corner = (arrays["vertices"][triangle] * arrays["unit"])[None]
        lam = shares(corner, points[k : k + 1])[0, 0]
        control = [[case._control(arrays, i, j) for j in triangle] for i in triangle]
        found[k] = lam @ np.array(control) @ lam
    return found


@settings(max_examples=40, deadline=None)
@given(room=rooms())
def test_random_walls_hold_and_no_motion_sees_a_jump(room, tmp_path_factory):
    asked, arrays, random = room
    file = case.read(arrays, tmp_path_factory.mktemp("sheets"))
    proofs = [check_certificate(file, asked, exact=exact) for exact in (False, True)]
    for proof in proofs:
        assert proof.holds, proof.reasons
    assert proofs[0].travel_time == proofs[1].travel_time
    # Straight pieces clear of the walls: u changes by at most ds/V in each step, with V at the clearance in
    # the middle less half a step, the least that there can be on it.
    walls = shapely.multilinestrings(
        [shapely.linestrings(asked.features.table[f, :4].reshape(2, 2)) for f in sheets.walls_of(asked)]
    )
    ends = random.uniform([0.05, 0.05], [11.95, 7.95], size=(6, 2, 2))
    for a, b in ends:
        pieces = shapely.difference(shapely.linestrings([a, b]), shapely.buffer(walls, 0.02))
        for piece in shapely.get_parts(pieces):
            if piece.length > 0.0:
                path = shapely.get_coordinates(
                    shapely.line_interpolate_point(piece, np.linspace(0, 1, 40), normalized=True)
                )
                step = piece.length / 39
                middle = 0.5 * (path[1:] + path[:-1])
                clearance = asked.setting.surroundings.distance(middle) - 0.5 * step
                speed = np.sqrt(2.0 * asked.setting.limits.braking * np.maximum(clearance, 0.0))
                change = np.abs(np.diff(values(arrays, asked, path)))
                assert (change * speed <= step * (1.0 + 1e-9) + 1e-12).all()


@settings(max_examples=60, deadline=None)
@given(room=rooms(), torn=st.integers(1, 3))
def test_copies_that_must_agree_are_found_and_only_those(room, torn, tmp_path_factory):
    # Some corners get vertices of their own, or those of the other sheet: right where fractions say so.
    asked, arrays, random = room
    triangles = arrays["triangles"].copy()
    count = len(arrays["vertices"])
    extra = []
    lattice = arrays["vertices"]
    for row in random.choice(len(triangles), size=min(torn, len(triangles)), replace=False):
        corner = int(random.integers(3))
        twins = np.flatnonzero((lattice == lattice[triangles[row, corner]]).all(axis=1))
        if len(twins) > 1 and random.random() < 0.5:
            triangles[row, corner] = random.choice(twins)
        else:
            extra.append(int(triangles[row, corner]))
            triangles[row, corner] = count + len(extra) - 1
    changed = {**arrays, "triangles": triangles}
    changed["vertices"] = np.concatenate([lattice, lattice[extra]]) if extra else lattice
    changed["u_vertex"] = np.zeros(len(changed["vertices"]))
    changed = sheets.with_edges(changed, random)
    changed["u_edge"] = np.zeros(len(changed["edges"]))
    changed["travel_time"] = np.array(0.0)
    good = all(
        changed["triangles"][one] == changed["triangles"][other]
        for one, other in sheets.meetings(changed, asked)
    )
    folder = tmp_path_factory.mktemp("sheets")
    for exact in (False, True):
        proof = case.proof(case.sealed(changed), asked, folder, exact=exact)
        assert proof.holds == good, proof.reasons
        assert good or proof.reasons[0].startswith(
            "u may jump, without a wall all along, across the side from ("
        )


@pytest.mark.parametrize(
    "walls",
    [
        [[[5, 0], [5, 8]]],  # along mesh lines
        [[[5, 0.3], [5.2, 8]]],
        [[[5, 0], [5.5, 8]], [[2, 5], [7, 4]]],  # crossing
        [[[2.5, 2.5], [7.5, 7.5]], [[2.5, 6.25], [6.25, 2.5]]],  # along diagonals, crossing
        [[[0, 5], [6.1, 5]], [[4, 7.3], [10, 6.9]], [[8, 1.1], [8, 4.9]]],
    ],
)
def test_what_the_solver_writes_for_a_point_robot_holds(walls, tmp_path):
    data = scenario_bytes(
        world={
            "boundary": [[0, 0], [10, 0], [10, 10], [0, 10]],
            "obstacles": [{"vertices": wall} for wall in walls],
        },
        robot={"radius": 0.0},
        start={"position": [3.0, 3.2]},
        goal={"position": [7.0, 3.0]},
    )
    found = lower_bound(parse_scenario(data, "room.yaml").problem, budget=6_000)
    found.certificate.save(tmp_path / "certificate.npz")
    file = read_certificate(tmp_path)
    assert file is not None
    for exact in (False, True):
        proof = check_certificate(file, read_question(data), exact=exact)
        assert proof.holds, proof.reasons
        assert proof.travel_time == pytest.approx(found.travel_time, rel=1e-9)
