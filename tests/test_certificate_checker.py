"""What the checker of certificates proves, and what it finds wrong with a mesh and its terms."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction

import certificate_case as case
import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from verify.judge.certificate import check_certificate, floating, rational
from verify.judge.certificate.bound import float_at_most
from verify.judge.certificate.dyadic import Dyadic
from verify.judge.certificate.minorant import corners_of, minorants_of
from verify.judge.certificate.sheets import Sheets
from verify.judge.certificate.signs import orientation, within
from verify.judge.certificate.tiling import check_tiling

BOTH = pytest.mark.parametrize("exact", [False, True], ids=["float", "exact"])

# A hall of 12 x 8 m: a rack on mesh lines, one off them, a point, a wall and a circle.
ROOM = {
    "world": {
        "boundary": [[0, 0], [12, 0], [12, 8], [0, 8]],
        "obstacles": [
            {"name": "rack", "vertices": [[3, 2], [5, 2], [5, 4], [3, 4]]},
            {"vertices": [[7.1, 4.9], [8.7, 4.3], [8.9, 6.1]]},
            {"vertices": [[6, 2]]},
            {"vertices": [[9, 1], [10.3, 2.2]]},
            {"circle": {"center": [2, 6.5], "radius": 0.4}},
        ],
    },
    "start": {"position": [1.0, 1.0]},
    "goal": {"position": [11.0, 7.0]},
}


def room(potential=lambda p: p[:, 0] + 0.5 * p[:, 1], columns=25, rows=17, **changes):
    asked = case.question(**{**ROOM, **changes})
    mesh = case.grid(np.linspace(0.0, 12.0, columns), np.linspace(0.0, 8.0, rows))
    return asked, case.make(asked, *mesh, potential)


def corridor(asked, speed):
    """u = x on the hall cut in two, 1/V bounded by half the tangents of both long walls at `speed`."""
    arrays = case.make(asked, *case.grid([0, 40], [0, 4]), lambda p: p[:, 0], scale=False)
    arrays["feature"][:], arrays["speed"][:], arrays["weight"][:] = [0, 2], speed, 0.5
    case.rescale(arrays)
    return case.sealed(arrays)


# --- what is proven ---------------------------------------------------------------------------------


@BOTH
@pytest.mark.parametrize(
    ("robot", "braking", "speed"),
    [
        ({}, {}, math.sqrt(3.0)),
        ({"radius": 0.4}, {"margin": 0.25}, math.sqrt(2.7)),
        ({}, {"reaction_time": 0.5}, math.sqrt(0.25 + 3.0) - 0.5),
        ({"max_braking": 2.0}, {"reaction_time": 0.25, "margin": 0.5}, math.sqrt(0.25 + 4.0) - 0.5),
    ],
    ids=["plain", "margin", "reaction", "all"],
)
def test_a_corridor_is_solved_exactly_by_two_triangles(robot, braking, speed, exact, tmp_path):
    # Half-width 2 m: on the centre line the clearance is 2 - rho - m, where V solves v t_r + v^2/(2 a_b) =
    # 2 - rho - m. Half the sum of both walls' tangents at that speed is 1/V all over the hall, as the
    # distances to the walls sum to 4 m: u = x/V. So 30 m take 30/V, which the centre line attains.
    friction = {"friction": 0.6 if robot.get("max_braking", 1.0) < 2.0 else 0.9}
    asked = case.question(robot={**robot, **friction}, braking=braking)
    proof = case.proof(corridor(asked, speed), asked, tmp_path, exact=exact)
    assert proof.holds, proof.reasons
    assert proof.reasons == ()
    assert proof.travel_time <= 30.0 / speed
    assert proof.travel_time == pytest.approx(30.0 / speed, rel=1e-10)
    assert (proof.triangles, proof.dropped, proof.exact) == (2, 0, exact)
    assert 0.0 <= proof.worst < 1e-11


@BOTH
def test_the_speed_limit_alone_bounds_the_time_by_the_distance(exact, tmp_path):
    # |grad u| <= 1/v_max with v_max = 0.75 m/s: 30 m take 40 s.
    asked = case.question(robot={"max_speed": 0.75})
    arrays = case.make(asked, *case.grid([0, 40], [0, 4]), lambda p: p[:, 0], scale=False)
    arrays["feature"][:], arrays["weight"][:] = -1, [1.0, 0.0]
    case.rescale(arrays)
    proof = case.proof(case.sealed(arrays), asked, tmp_path, exact=exact)
    assert proof.holds, proof.reasons
    assert proof.travel_time == pytest.approx(40.0, rel=1e-10)


@BOTH
def test_without_a_speed_limit_the_constant_proves_nothing(exact, tmp_path):
    asked = case.question()
    arrays = corridor(asked, math.sqrt(3.0))
    arrays["feature"][:] = -1
    proof = case.proof(case.sealed(arrays), asked, tmp_path, exact=exact)
    assert not proof.holds
    assert any("u is steeper" in reason for reason in proof.reasons)


@BOTH
def test_a_constant_function_holds_without_terms_and_proves_zero(exact, tmp_path):
    # grad u = 0 needs no lower bound of 1/V but 0 itself.
    asked = case.question()
    arrays = case.make(asked, *case.grid([0, 40], [0, 4]), lambda p: np.full(len(p), 25.0), scale=False)
    arrays["weight"][:] = 0.0
    proof = case.proof(case.sealed(arrays), asked, tmp_path, exact=exact)
    assert proof.holds, proof.reasons
    assert (proof.travel_time, proof.worst) == (0.0, 0.0)


@BOTH
def test_racks_on_mesh_lines_are_dropped_and_the_rest_is_proven(exact, tmp_path):
    asked, arrays = room()
    assert (arrays["blocked_by"] == -2).sum() == 2 * 4 * 4  # 2 x 2 m of cells of 0.5 m, two triangles each
    assert (arrays["blocked_by"] >= 0).any()
    proof = case.proof(arrays, asked, tmp_path, exact=exact)
    assert proof.holds, proof.reasons
    assert proof.travel_time > 0.0
    rise = case.at(arrays, "goal") - case.at(arrays, "start")
    assert proof.travel_time == pytest.approx(rise, rel=1e-12)
    assert proof.slack.shape == (proof.triangles,)
    assert proof.slack.min() == proof.worst


def test_the_statement_says_what_was_asked_and_what_is_proven(tmp_path):
    asked = case.question()
    arrays = corridor(asked, math.sqrt(3.0))
    proof = case.proof(arrays, asked, tmp_path)
    assert "\n" not in proof.statement
    # 30/sqrt(3) = 17.3205080..., rounded down
    for words in ("from (5, 2) m to (35, 2) m", "17.320508 s", "floating point", "2 triangles", "6 inequal"):
        assert words in proof.statement
    assert "rational" in case.proof(arrays, asked, tmp_path, exact=True).statement
    arrays["u_vertex"] *= 2.0
    refused = case.proof(arrays, asked, tmp_path)
    assert "refused" in refused.statement
    assert "17.3" not in refused.statement
    assert refused.travel_time == 0.0


# --- both arithmetics -------------------------------------------------------------------------------

dyadic = st.integers(1, 63)


@st.composite
def cases(draw):
    """A random room with a mesh that knows nothing of it, and a random quadratic function."""
    width, height = draw(st.integers(6, 12)), draw(st.integers(5, 9))
    number = st.floats(0.3, 0.45)  # away from start and goal
    obstacles = []
    for kind in draw(st.lists(st.sampled_from(["point", "wall", "rack", "circle"]), max_size=4)):
        x, y = width * draw(number), height * draw(number)
        a, b = draw(st.floats(0.3, 1.2)), draw(st.floats(0.3, 1.2))
        obstacles.append(
            {
                "point": {"vertices": [[x, y]]},
                "wall": {"vertices": [[x, y], [x + a, y - b]]},
                "rack": {"vertices": [[x, y], [x + a, y], [x + a, y + b], [x, y + b]]},
                "circle": {"circle": {"center": [x, y], "radius": 0.5 * a}},
            }[kind]
        )
    asked = case.question(
        world={"boundary": [[0, 0], [width, 0], [width, height], [0, height]], "obstacles": obstacles},
        robot={"max_speed": draw(st.sampled_from([None, 1.3]))},
        braking={
            "reaction_time": draw(st.sampled_from([0.0, 0.3])),
            "margin": draw(st.sampled_from([0.0, 0.1])),
        },
        start={"position": [1.0, 1.0]},
        goal={"position": [width - 1.0, height - 1.0]},
    )
    lines = [
        np.unique([0.0, size, *(size * draw(dyadic) / 64.0 for _ in range(draw(st.integers(3, 8))))])
        for size in (width, height)
    ]
    form = draw(st.lists(st.integers(-20, 20), min_size=5, max_size=5).filter(any))

    def potential(p):
        x, y = p[:, 0], p[:, 1]
        return form[0] * x + form[1] * y + 0.1 * (form[2] * x * x + form[3] * x * y + form[4] * y * y)

    return asked, case.make(asked, *case.grid(*lines), potential)


@settings(max_examples=40, deadline=None)
@given(case=cases(), seed=st.integers(0, 2**32 - 1))
def test_random_certificates_hold_in_both_arithmetics_and_mean_what_they_say(case, seed, tmp_path_factory):
    asked, arrays = case
    file = read(arrays, tmp_path_factory.mktemp("certificate"))
    proofs = [check_certificate(file, asked, exact=exact) for exact in (False, True)]
    for proof in proofs:
        assert proof.holds, proof.reasons
    assert proofs[0].travel_time == proofs[1].travel_time
    finite = np.isfinite(proofs[1].slack)
    np.testing.assert_allclose(proofs[0].slack[finite], proofs[1].slack[finite], atol=1e-12)
    # |grad u| <= 1/V at random points of all kept triangles: V from the distance to everything, by Shapely
    random = np.random.default_rng(seed)
    weights = random.dirichlet(np.ones(3), len(file.triangles))
    points = np.einsum("ti,tic->tc", weights, file.points[file.triangles])
    slope = np.linalg.norm(np.einsum("ti,tic->tc", weights, gradient(arrays)), axis=1)
    limits = asked.setting.limits
    clearance = asked.setting.surroundings.distance(points) - limits.radius
    speed = np.array([limits.safe_speed(gap) for gap in clearance])
    assert (slope * speed <= 1.0 + 1e-9).all()


gradient, read = case.gradient, case.read


def slacks(arrays, asked, folder):
    file = case.read(arrays, folder)
    found = check_tiling(file, asked.features, Sheets.of(file))
    assert not found.faults
    every = slice(None)
    corners = corners_of(file, found.side_edges, found.twice_area, every)
    minorants = minorants_of(file, asked.features, asked.setting.limits, every)
    return floating.slack(corners, minorants), rational.slack(corners, minorants)


def test_rounding_outward_costs_little_and_never_flatters(tmp_path):
    asked, arrays = room()
    quick, true = slacks(arrays, asked, tmp_path)
    assert (quick <= true).all()
    assert (true - quick)[np.isfinite(true)].max() < 1e-13


@pytest.mark.parametrize("heavy", [1.0, 1.0 + 2.0**-48 - 2.0**-52], ids=["one", "rounded above one"])
def test_both_sides_of_the_inequality_are_rounded_outward(heavy, tmp_path):
    # Against integers: |grad u|^2 from above, the minorant from below; slivers, where products cancel, too.
    asked = case.question(**ROOM)
    xs, ys = np.array([0.0, 3.0, 3.0 + case.UNIT, 7.5, 12.0]), np.array([0.0, 2.0, 2.0 + case.UNIT, 5.5, 8.0])
    arrays = case.make(
        asked, *case.grid(xs, ys), lambda p: np.sin(p[:, 0]) + 25.0 + p[:, 1] / 3.0, scale=False
    )
    arrays["weight"] = arrays["weight"] * heavy
    file = case.read(case.sealed(arrays), tmp_path)
    found, every = check_tiling(file, asked.features, Sheets.of(file)), slice(None)
    corners = corners_of(file, found.side_edges, found.twice_area, every)
    minorants = minorants_of(file, asked.features, asked.setting.limits, every)
    # |g| = 2 sqrt(N) / (unit D): compare 4 N with (above unit D)^2
    above = Dyadic.of(floating.gradient_above(corners) * file.unit)  # the unit is a power of two
    width = above * Dyadic(corners.twice_area.astype(object)[:, None], 0)
    assert rational._gradient_square(corners).scaled(2).not_above(width * width).all()
    below = Dyadic.of(floating.minorant_below(minorants))
    assert below.not_above(rational._minorant(minorants)).all()
    # Weights 1 or 1/2 each, times `heavy`, are divided by their sum `heavy`, which leaves the former.
    plain = replace(minorants, weight=minorants.weight / heavy)
    assert set(plain.weight.sum(axis=1)) == {1.0}
    last_place = Dyadic(1, rational.TANGENT_PLACES - 2)
    assert rational._minorant(minorants).not_above(rational._minorant(plain) + last_place).all()


def around_a_point(levels):
    """A hall of 40 x 4 m as nested squares around (4, 2), each half as wide as the one around it."""
    ring = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1]], dtype=float)
    squares = [[4.0, 2.0] + 2.0 * 0.5**k * ring for k in range(levels)]
    vertices = np.concatenate([*squares, [[4.0, 2.0], [0, 0], [0, 4], [40, 0], [40, 4]]])
    here = np.arange(8)
    following = (here + 1) % 8
    triangles = []
    for k in range(levels - 1):
        out, inner = 8 * k, 8 * (k + 1)
        triangles.append(np.stack([out + here, out + following, inner + here], 1))
        triangles.append(np.stack([out + following, inner + following, inner + here], 1))
    centre, last = 8 * levels, 8 * (levels - 1)
    triangles.append(np.stack([last + here, last + following, np.full(8, centre)], 1))
    low_left, high_left, low_right, high_right = centre + 1 + np.arange(4)
    rim = [[low_left, 5, 4], [low_left, 4, high_left], [high_left, 4, 3]]
    rim += [[low_right, 0, 7], [low_right, high_right, 0], [high_right, 1, 0]]
    return vertices, np.concatenate([*triangles, rim])


def test_tiny_triangles_with_large_values_lose_no_digits(tmp_path):
    # Sides of 2^-20 m (1e-6 m) where u is 25 s: the controls themselves round by 4e-15 s, which is 4e-9 of
    # their differences; what the checker adds is far below.
    asked = case.question()
    mesh = around_a_point(22)
    arrays = case.make(asked, *mesh, lambda p: 25.0 + 0.5 * p[:, 0], scale=False, unit=2.0**-24)
    # 1/V >= 1/sqrt(3) > 0.5 by half the tangents of both walls, see the corridor
    arrays["feature"][:], arrays["speed"][:], arrays["weight"][:] = [0, 2], math.sqrt(3.0), 0.5
    proof = case.proof(case.sealed(arrays), asked, tmp_path)
    assert proof.holds, proof.reasons
    assert np.ptp((arrays["vertices"] * arrays["unit"])[arrays["triangles"]], axis=1).min() == 2.0**-20
    quick, true = slacks(case.sealed(arrays), asked, tmp_path)
    assert (quick <= true).all()
    assert (true - quick).max() < 1e-13
    assert quick.min() == pytest.approx(1.0 - 0.5 * math.sqrt(3.0), abs=1e-7)


def fraction(number):
    return Fraction(float(number))


finite = st.floats(-1e5, 1e5)


@settings(max_examples=300, deadline=None)
@given(
    points=st.lists(st.tuples(finite, finite), min_size=2, max_size=2),
    s=st.floats(-2, 2),
    off=st.integers(-2, 2),
)
def test_orientation_is_exact_for_points_nearly_on_a_line(points, s, off):
    (ax, ay), (bx, by) = points
    cx, cy = ax + s * (bx - ax), ay + s * (by - ay)
    cy = float(cy + off * np.spacing(cy))
    det = (fraction(bx) - fraction(ax)) * (fraction(cy) - fraction(ay)) - (fraction(by) - fraction(ay)) * (
        fraction(cx) - fraction(ax)
    )
    expected = (det > 0) - (det < 0)
    a, b, c = (np.array([p]) for p in ((ax, ay), (bx, by), (cx, cy)))
    for exact in (False, True):
        assert orientation(a, b, c, exact=exact)[0] == expected


@settings(max_examples=200, deadline=None)
@given(
    numbers=st.lists(st.floats(-50, 50), min_size=6, max_size=6),
    radius=st.sampled_from([0.0, 0.4]),
    nudge=st.integers(-2, 2),
)
def test_distances_are_compared_exactly(numbers, radius, nudge):
    px, py, ax, ay, bx, by = map(Fraction, numbers)
    dx, dy = bx - ax, by - ay
    length = dx * dx + dy * dy
    s = min(max(((px - ax) * dx + (py - ay) * dy) / length, 0), 1) if length else Fraction(0)
    square = (px - ax - s * dx) ** 2 + (py - ay - s * dy) ** 2
    gap = math.sqrt(square)
    reach = max(0.0, gap - radius)
    reach = float(reach + nudge * np.spacing(reach)) if reach else reach
    total = Fraction(reach) + Fraction(radius) if radius else Fraction(reach)
    point, row = np.array([numbers[:2]]), np.array([[*numbers[2:], radius]])
    for exact in (False, True):
        assert within(point, row, reach, 0.0, exact=exact)[0] == (total >= 0 and square <= total**2)
    above = float(floating.distance_above(point, row)[0])
    assert (Fraction(above) + Fraction(radius)) ** 2 >= square
    assert above <= gap - radius + 1e-12


@settings(max_examples=200, deadline=None)
@given(a=st.floats(-1e9, 1e9), b=st.floats(1e-9, 1e9), c=st.floats(0.0, 1e300))
def test_dyadic_numbers_are_exact_and_round_as_told(a, b, c):
    def value(number):
        return Fraction(int(number.numerator), 1 << number.places)

    x, y = Dyadic.of(a), Dyadic.of(b)
    assert value(x) == fraction(a)
    assert value(x + y) == fraction(a) + fraction(b)
    assert value(x - y) == fraction(a) - fraction(b)
    assert value(x * y) == fraction(a) * fraction(b)
    assert value(x.scaled(-70)) == fraction(a) / 2**70
    down, up = value(x.over(y, 40, up=False)), value(x.over(y, 40, up=True))
    assert down <= fraction(a) / fraction(b) <= up
    assert up - down <= Fraction(1, 2**40)
    root = value(Dyadic.of(c).root_up(40))
    assert root**2 >= fraction(c)
    assert root == 0 or (root - Fraction(1, 2**40)) ** 2 < fraction(c)
    assert Fraction(float(x.float_below())) <= fraction(a)
    third = fraction(a) / 3
    assert Fraction(float_at_most(third)) <= third


# --- the mesh ---------------------------------------------------------------------------------------


def reasons(arrays, asked, folder):
    found = [case.proof(case.sealed(arrays), asked, folder, exact=exact) for exact in (False, True)]
    assert found[0].reasons == found[1].reasons or any("steeper" in r for r in found[0].reasons)
    assert not found[0].holds
    return " | ".join(found[0].reasons)


def simple(**changes):
    asked = case.question(**changes)
    speed = math.sqrt(3.0)
    arrays = case.make(asked, *case.grid([0, 20, 40], [0, 4]), lambda p: p[:, 0], scale=False)
    arrays["feature"][:], arrays["speed"][:], arrays["weight"][:] = [0, 2], speed, 0.5
    case.rescale(arrays)
    return asked, arrays


def test_a_vertex_that_hangs_on_a_side_is_found(tmp_path):
    # The left half keeps its side from (20, 0) to (20, 4); on the right a vertex is put on its middle.
    asked = case.question()
    vertices = np.array([[0, 0], [0, 4], [20, 0], [20, 4], [40, 0], [40, 4], [20, 2]], dtype=float)
    triangles = np.array([[0, 2, 3], [0, 3, 1], [2, 4, 6], [4, 5, 6], [5, 3, 6]])
    arrays = case.make(asked, vertices, triangles, lambda p: p[:, 0])
    found = reasons(arrays, asked, tmp_path)
    assert "no other triangle has, as a whole side, the side from (20, 0) to (20, 4) m" in found
    assert "the areas" not in found


def test_two_sheets_over_the_box_are_found(tmp_path):
    # Two copies with vertices of their own: with rows of `vertices` alone every side would be shared.
    asked, arrays = simple()
    count, edges = len(arrays["vertices"]), len(arrays["edges"])
    for key in ("triangles", "edges"):
        arrays[key] = np.concatenate([arrays[key], arrays[key] + np.int32(count)])
    for key in ("vertices", "u_vertex", "u_edge", "side", "feature", "speed", "weight"):
        arrays[key] = np.concatenate([arrays[key], arrays[key]])
    assert len(arrays["edges"]) == 2 * edges
    found = reasons(arrays, asked, tmp_path)
    assert "sum to 160 m^2 more than the box" in found  # the hall has 40 m x 4 m
    assert "two triangles lie on the same side of the side from (0, " in found
    assert "more than once, and not once for each side of one wall: the triangle around (" in found


def test_two_vertices_at_one_place_do_not_join_triangles(tmp_path):
    # Cut along x = 20: both halves have vertices of their own there, so u might jump.
    asked, arrays = simple()
    here = np.flatnonzero(arrays["vertices"][:, 0] == round(20 / case.UNIT))
    right = (arrays["vertices"][arrays["triangles"]][..., 0].max(axis=1) * case.UNIT) > 20.5
    copies = {int(v): len(arrays["vertices"]) + i for i, v in enumerate(here)}
    moved = np.vectorize(lambda v: copies.get(int(v), int(v)))(arrays["triangles"]).astype(np.int32)
    arrays["triangles"] = np.where(right[:, None], moved, arrays["triangles"])
    arrays["vertices"] = np.concatenate([arrays["vertices"], arrays["vertices"][here]])
    arrays["u_vertex"] = np.concatenate([arrays["u_vertex"], arrays["u_vertex"][here]])
    edges = np.sort(np.stack([arrays["triangles"], np.roll(arrays["triangles"], -1, 1)], 2).reshape(-1, 2), 1)
    arrays["edges"] = np.unique(edges, axis=0)
    arrays["u_edge"] = arrays["u_vertex"][arrays["edges"]].mean(axis=1)  # u is linear
    found = reasons(arrays, asked, tmp_path)
    assert "u may jump, without a wall all along, across the side from (20, " in found
    assert "edges" not in found
    assert "no other triangle" not in found


def test_a_box_that_does_not_hold_the_floor_is_refused(tmp_path):
    asked = case.question()
    arrays = case.make(asked, *case.grid([0, 39], [0, 4]), lambda p: p[:, 0])
    assert "the box does not contain world.boundary[1] = (40, 0) m" in reasons(arrays, asked, tmp_path)


def test_a_corner_outside_the_box_is_refused(tmp_path):
    asked, arrays = simple()
    arrays["vertices"][0, 0] -= 1
    assert "outside the box: the triangle around" in reasons(arrays, asked, tmp_path)


@pytest.mark.parametrize("change", ["missing", "extra", "twice", "order", "swapped"])
def test_the_list_of_edges_must_be_that_of_the_kept_triangles(change, tmp_path):
    asked, arrays = simple()
    edges, values = arrays["edges"], arrays["u_edge"]
    words = {
        "missing": "edges: missing is the side",
        "extra": "edges: not a side of a kept triangle",
        "twice": "edges: more than once there is the side",
        "order": "edges: not sorted",
        "swapped": "edges: not a side of a kept triangle, or not in order",
    }[change]
    if change == "missing":
        edges, values = edges[1:], values[1:]
    elif change == "extra":
        edges, values = np.append(edges, [[0, 5]], axis=0), np.append(values, 0.0)
    elif change == "twice":
        edges, values = edges[[0, *range(len(edges))]], values[[0, *range(len(edges))]]
    elif change == "order":
        edges, values = edges[::-1], values[::-1]
    else:
        edges = np.concatenate([edges[:1, ::-1], edges[1:]])
    arrays["edges"], arrays["u_edge"] = np.ascontiguousarray(edges, dtype=np.int32), values.copy()
    assert words in reasons(arrays, asked, tmp_path)


def test_huge_lattices_are_summed_without_overflow(tmp_path):
    # unit 2^-34: the hall is 40 * 2^34 lattice units wide, and doubled areas need 75 bits
    asked = case.question()
    arrays = case.make(asked, *case.grid([0, 13, 40], [0, 4]), lambda p: p[:, 0], scale=False, unit=2.0**-34)
    arrays["feature"][:], arrays["speed"][:], arrays["weight"][:] = [0, 2], math.sqrt(3.0), 0.5
    case.rescale(arrays)
    for exact in (False, True):
        proof = case.proof(case.sealed(arrays), asked, tmp_path, exact=exact)
        assert proof.holds, proof.reasons
    arrays["vertices"][-1, 0] -= 1  # a lattice unit is 6e-11 m
    assert "the areas of all triangles sum to" in reasons(arrays, asked, tmp_path)


# --- dropped triangles ------------------------------------------------------------------------------


def dropping(arrays, row, reason):
    """The certificate with one kept triangle dropped for a reason."""
    changed = dict(arrays)
    changed["dropped"] = np.append(arrays["dropped"], arrays["triangles"][row : row + 1], axis=0)
    changed["blocked_by"] = np.append(arrays["blocked_by"], np.int32(reason))
    for key in ("triangles", "side", "feature", "speed", "weight"):
        changed[key] = np.delete(arrays[key], row, axis=0)
    kept = changed["triangles"]
    ends = np.unique(np.sort(np.stack([kept, np.roll(kept, -1, 1)], 2).reshape(-1, 2), 1), axis=0)
    count = len(arrays["vertices"])
    keys = arrays["edges"][:, 0].astype(np.int64) * count + arrays["edges"][:, 1]
    changed["edges"] = ends.astype(np.int32)
    changed["u_edge"] = arrays["u_edge"][
        np.searchsorted(keys, ends[:, 0].astype(np.int64) * count + ends[:, 1])
    ]
    for end in ("start", "goal"):
        changed[f"{end}_triangle"] = arrays[f"{end}_triangle"] - (row < arrays[f"{end}_triangle"])
    return changed


def holding(arrays, x, y):
    """The kept triangle around a place."""
    corners = (arrays["vertices"] * arrays["unit"])[arrays["triangles"]]
    return case._around(corners, (x, y))


@pytest.mark.parametrize(
    ("place", "reason", "words"),
    [
        ((6.3, 6.6), 0, "a corner is farther from its feature than the robot must stay"),
        ((6.3, 6.6), -1, "dropped as outside the boundary, but inside it"),
        ((6.3, 6.6), -2, "dropped as inside an obstacle, but outside of it"),
        ((5.2, 3.2), -2, "dropped as inside an obstacle, but outside of it"),  # beside the rack
        ((6.3, 6.6), -4, "blocked_by names neither a feature nor a polygon obstacle"),  # a point
        ((6.3, 6.6), -6, "blocked_by names neither a feature nor a polygon obstacle"),  # a circle
        ((6.3, 6.6), -7, "blocked_by names neither a feature nor a polygon obstacle"),  # nothing
        ((6.3, 6.6), 14, "blocked_by names neither a feature nor a polygon obstacle"),
        ((6.3, 6.6), 2**31 - 1, "blocked_by names neither a feature nor a polygon obstacle"),
        ((6.3, 6.6), -(2**31), "blocked_by names neither a feature nor a polygon obstacle"),
    ],
)
def test_free_triangles_must_not_be_dropped(place, reason, words, tmp_path):
    asked, arrays = room()
    assert len(arrays["features"]) == 4 + 4 + 3 + 1 + 1 + 1  # hall, rack, triangle, point, wall, circle
    changed = dropping(arrays, holding(arrays, *place), reason)
    assert words in reasons(changed, asked, tmp_path)


def test_a_triangle_partly_inside_an_obstacle_must_not_be_dropped(tmp_path):
    asked, arrays = room(columns=13, rows=9)
    corners = (arrays["vertices"] * arrays["unit"])[arrays["triangles"]]
    solid = shapely.Polygon(asked.features.polygons[1])
    partly = np.flatnonzero(shapely.relate_pattern(shapely.polygons(corners), solid, "T*T******"))
    assert len(partly)
    for row in partly:
        found = reasons(dropping(arrays, int(row), -3), asked, tmp_path)
        assert "a side of what it is said to lie in or outside of runs through it" in found


def test_the_reason_must_be_the_right_one(tmp_path):
    asked, arrays = room()
    inside = np.flatnonzero(arrays["blocked_by"] == -2)[0]
    arrays["blocked_by"][inside] = -3  # the other polygon
    assert "dropped as inside an obstacle, but outside of it" in reasons(arrays, asked, tmp_path)


@BOTH
def test_a_corner_exactly_at_the_limit_is_blocked_and_one_beyond_is_not(exact, tmp_path):
    # Radius 0.5 m: the strip up to y = 0.5 m is blocked; lattice lines are 2^-10 m apart.
    asked = case.question()
    for top, holds in ((0.5, True), (0.5 + case.UNIT, False)):
        arrays = case.make(asked, *case.grid([0, 40], [0, top, 4]), lambda p: p[:, 0])
        if not holds:
            arrays["weight"][:] = 0.0
            arrays["u_vertex"][:], arrays["u_edge"][:] = 0.0, 0.0
            for _ in range(2):
                low = np.flatnonzero(arrays["vertices"][arrays["triangles"]][..., 1].max(axis=1) < 1024)
                arrays = dropping(arrays, int(low[0]), 0)
            arrays["travel_time"] = np.array(0.0)
        assert len(arrays["dropped"]) == 2
        proof = case.proof(case.sealed(arrays), asked, tmp_path, exact=exact)
        assert proof.holds == holds, proof.reasons


@BOTH
def test_notches_of_the_floor_and_bent_obstacles_are_dropped(exact, tmp_path):
    # An L-shaped floor, an L-shaped rack: the open triangles beside them are on the other side.
    asked = case.question(
        world={
            "boundary": [[0, 0], [12, 0], [12, 4], [6, 4], [6, 8], [0, 8]],
            "obstacles": [{"vertices": [[2, 2], [4, 2], [4, 3], [3, 3], [3, 5], [2, 5]]}],
        },
        start={"position": [1.0, 1.0]},
        goal={"position": [11.0, 2.0]},
    )
    arrays = case.make(asked, *case.grid(np.arange(13.0), np.arange(9.0)), lambda p: p[:, 0])
    assert (arrays["blocked_by"] == -1).sum() == 2 * 6 * 4  # 6 x 4 cells of 1 m
    assert (arrays["blocked_by"] == -2).sum() == 2 * 4  # an L of 4 cells
    proof = case.proof(arrays, asked, tmp_path, exact=exact)
    assert proof.holds, proof.reasons
    corner = holding(arrays, 3.6, 3.4)  # in the bend of the rack
    assert "but outside of it" in reasons(dropping(arrays, corner, -2), asked, tmp_path)


# --- terms, start and goal --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("weight", [-0.25, 0.5], "a weight is negative in"),
        ("weight", [0.5, 0.5 + 1e-9], "the weights sum to more than 1 in"),
        ("weight", [1e300, 1e308], "the weights sum to more than 1 in"),
        ("speed", [0.0, 1.0], "the speed of a tangent is not between"),
        ("speed", [1.0, -1.0], "the speed of a tangent is not between"),
        ("speed", [1e-300, 1.0], "the speed of a tangent is not between"),
        ("speed", [1e300, 1.0], "the speed of a tangent is not between"),
        ("speed", [3.0, 3.0], "u is steeper than the lower bound of 1/V at"),
    ],
)
def test_terms_that_are_no_lower_bound_are_refused(key, value, words, tmp_path):
    asked, arrays = simple()
    arrays[key][1] = value
    found = reasons(arrays, asked, tmp_path)
    assert words in found
    assert "m" in found.partition("triangle around (")[2]  # its place


@BOTH
def test_weights_that_round_above_one_are_divided_out(exact, tmp_path):
    # 0.1 + 0.9 twice over in tenths: ten weights of fl(0.1) sum to 1 + 5.6e-17, which only exact sums see.
    asked, arrays = simple()
    for key, value in (("weight", 0.1), ("speed", math.sqrt(3.0))):
        arrays[key] = np.full((len(arrays["triangles"]), 10), value)
    arrays["feature"] = np.tile(np.array([0, 2], dtype=np.int32), (len(arrays["triangles"]), 5))
    assert sum([Fraction(0.1)] * 10) > 1
    proof = case.proof(case.sealed(arrays), asked, tmp_path, exact=exact)
    assert proof.holds, proof.reasons


@pytest.mark.parametrize("end", ["start", "goal"])
def test_start_and_goal_must_lie_in_their_triangles(end, tmp_path):
    asked, arrays = room()
    arrays[f"{end}_triangle"] = np.array(holding(arrays, 6.3, 6.6))
    assert f"the {end} (" in reasons(arrays, asked, tmp_path)


def test_a_start_on_a_side_lies_in_both_triangles(tmp_path):
    asked, arrays = room()  # (1, 1) is a vertex of the mesh
    corners = (arrays["vertices"] * arrays["unit"])[arrays["triangles"]]
    rows = np.flatnonzero((corners == [1.0, 1.0]).all(axis=2).any(axis=1))
    assert len(rows) > 1
    for row in rows:
        arrays["start_triangle"] = np.array(row)
        assert case.proof(case.sealed(arrays), asked, tmp_path).holds


def test_a_claim_above_what_u_shows_is_refused(tmp_path):
    asked, arrays = simple()
    arrays["travel_time"] = arrays["travel_time"] * (1.0 + 1e-11)
    assert "but u(goal) - u(start) is only" in reasons(arrays, asked, tmp_path)
