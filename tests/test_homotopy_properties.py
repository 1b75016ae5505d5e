"""Words of random paths in random worlds against what homotopy means, told without any diagram."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
import shapely
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from tests.test_homotopy import windings, words_from
from tests.worlds import ROOM, SIDE, geometry, moved, obstacle_lists, rooms
from vnav_drake.homotopy import Gates, build_gates, reduced, word_of
from vnav_drake.homotopy.crossing import box_tree, crossings, orientation
from vnav_drake.plan import Path
from vnav_drake.problem import PlanningError
from vnav_drake.voronoi import PARABOLA, VoronoiDiagram, build_diagram
from vnav_drake.voronoi.check import free_faces
from vnav_drake.world import Obstacle, World, WorldError

Array = NDArray[np.float64]

FOUR_IN_ROOM = [Obstacle(((5.0 + 9.0 * i, 6.0 + 8.0 * j),)) for i in (0, 1) for j in (0, 1)]
levels = st.sampled_from([0.0, 0.05, 0.3])
seeds = st.integers(0, 2**32 - 1)
ONE_CENTIMETRE = 0.01  # [m]


def gates_or_none(boundary, obstacles, level: float) -> Gates:
    """Gates of a random world; worlds that cannot be built are another module's business."""
    try:
        return build_gates(build_diagram(World.build(boundary, obstacles)), level)
    except (WorldError, PlanningError):
        assume(False)
        raise


def samples(diagram: VoronoiDiagram, row: int) -> Array:
    """Parameters along a border, near enough that the polyline keeps to its own side of the focus.

    Evenly in w = asinh(u / p), p the focal parameter: a chord from w to w + 1/4 departs from the parabola
    by about p cosh(w) / 128, and the focus is p cosh(w)^2 / 2 away.
    """
    size = max(float(diagram.curves.size[row]), 1e-300)
    if diagram.curves.kind[row] != PARABOLA:
        return np.linspace(*diagram.curves.span[row], 6)
    w = np.arcsinh(diagram.curves.span[row] / size)
    u = size * np.sinh(np.linspace(w[0], w[1], 2 + math.ceil(4.0 * abs(w[1] - w[0]))))
    u[[0, -1]] = diagram.curves.span[row]
    return u


def random_walk(diagram: VoronoiDiagram, steps: int, rng, gate_at: Array | None = None):
    """A walk along arcs from a random node: points (n, 2) and (border, direction) of each step.

    Where `gate_at` (m,) is finite that parameter of the arc is one of the points.
    """
    node = int(rng.choice(np.unique(diagram.ends[diagram.arcs])))
    parts, taken = [diagram.nodes[[node]]], []
    for _step in range(steps):
        border, end = diagram.incident(node)
        pick = int(rng.choice(np.flatnonzero(diagram.primary[border])))
        row, at = int(border[pick]), int(end[pick])
        u = samples(diagram, row)
        if gate_at is not None and np.isfinite(gate_at[row]):
            u = np.sort(np.append(u, gate_at[row]))
        line = diagram.curves.take([row]).points(u[None])[0]
        parts.append(line[:: 1 if at == 0 else -1])
        taken.append((row, 1 if at == 0 else -1))
        node = int(diagram.ends[row, 1 - at])
    return np.concatenate(parts), taken


class Floor:
    """Free space of the obstacles as given, for Shapely: which triangles are free of everything."""

    def __init__(self, boundary, obstacles) -> None:
        self.hall = shapely.Polygon(boundary)
        self.shapes = np.array([geometry(o) for o in obstacles], dtype=object)
        shapely.prepare(self.hall)

    def is_free(self, *corners) -> bool:
        """Whether the hull of the corners touches no obstacle and lies within the boundary."""
        hull = shapely.MultiPoint(corners).convex_hull
        return bool(self.hall.contains_properly(hull)) and not shapely.intersects(self.shapes, hull).any()


def wiggled(points: Array, floor: Floor, rng, rounds: int) -> Array:
    """The polyline after moves over free triangles only: homotopic to it by construction."""
    line = [tuple(p) for p in points]
    for _round in range(rounds):
        i = int(rng.integers(1, len(line) - 1)) if len(line) > 2 else 0
        kind = int(rng.integers(3))
        if kind == 0 and i:  # a vertex leaves: the triangle with its neighbours is free
            if floor.is_free(line[i - 1], line[i], line[i + 1]):
                del line[i]
        elif kind == 1 and i:  # a vertex moves
            there = tuple(np.array(line[i]) + rng.normal(0.0, rng.choice([0.1, 1.0, 4.0]), 2))
            if floor.is_free(line[i - 1], line[i], there) and floor.is_free(there, line[i], line[i + 1]):
                line[i] = there
        else:  # there and back again
            j = int(rng.integers(len(line)))
            there = tuple(np.array(line[j]) + rng.normal(0.0, 2.0, 2))
            if floor.is_free(line[j], there):
                line[j + 1 : j + 1] = [there, line[j]]
    return np.array(line)


@given(rooms, obstacle_lists, levels)
def test_pieces_between_gates_are_trees(boundary, obstacles, level):
    # Arcs of the 2-core that carry no gate join its nodes without a ring: in each piece nodes - arcs = 1.
    # And the letters: nodes - arcs of the whole core = pieces - gates.
    gates = gates_or_none(boundary, obstacles, level)
    diagram = gates.diagram
    arcs, count = diagram.arcs, len(diagram.nodes)
    parent = list(range(count))

    def root(i: int) -> int:
        while parent[i] != i:
            i = parent[i]
        return i

    for row in np.setdiff1d(arcs, gates.border).tolist():
        one, other = (root(int(n)) for n in diagram.ends[row])
        assert one != other, "a ring of arcs has no gate"
        parent[one] = other


@given(rooms, obstacle_lists, st.sampled_from([0.0, 0.05, 0.3, 0.7]))
def test_there_are_as_many_independent_rings_as_holes_in_free_space(boundary, obstacles, level):
    # Betti number: gates - pieces + components of the core = interior rings of the floor minus all that is
    # nearer than the level (Shapely). Where a passage is as wide as the level, the buffers' chords decide.
    gates = gates_or_none(boundary, obstacles, level)
    world, holes = gates.diagram.world, set()
    if level == 0.0:  # nothing is too narrow: every island counts
        _, characteristic = free_faces(world)
        holes.add(int((1 - characteristic).sum()))
    for reach in (0.999 * level, 1.001 * level) if level > 0.0 else ():
        walls = shapely.linestrings(world.vertices[world.edges])
        lines = shapely.union_all([*walls, *shapely.points(world.vertices[world.isolated])])
        free = shapely.difference(world.floor, lines.buffer(reach, quad_segs=64))
        holes.add(sum(len(p.interiors) for p in shapely.get_parts(free)))
    assume(len(holes) == 1)
    used = np.unique(gates.sides)
    parts = {int(p): i for i, p in enumerate(used)}
    parent = list(range(len(used)))

    def root(i: int) -> int:
        while parent[i] != i:
            i = parent[i]
        return i

    for one, other in gates.sides.tolist():
        parent[root(parts[one])] = root(parts[other])
    components = len({root(i) for i in range(len(used))})
    assert len(gates) - len(used) + components == holes.pop()


@given(rooms, obstacle_lists, levels)
def test_gates_are_disjoint_and_meet_the_arcs_at_their_points_only(boundary, obstacles, level):
    gates = gates_or_none(boundary, obstacles, level)
    if len(gates) == 0:
        return
    # shortened by a part of 1e-6 at the feet, which several gates may share
    inner = gates.point[:, None] + (1.0 - 1e-6) * (gates.feet - gates.point[:, None])
    lines = shapely.linestrings(np.stack([inner[:, 0], gates.point, inner[:, 1]], axis=1))
    one, other = shapely.STRtree(lines).query(lines, predicate="intersects")
    assert (one == other).all()
    reach = np.hypot(*(gates.feet - gates.point[:, None]).transpose(2, 0, 1))
    middles = 0.5 * (gates.feet + gates.point[:, None])
    # all along a gate the nearest feature is the one it leads to
    assert gates.diagram.world.distance(middles) == pytest.approx(0.5 * reach, abs=1e-6)
    assert gates.diagram.world.distance(gates.point) == pytest.approx(reach[:, 0], abs=1e-6)
    assert reach[:, 0] == pytest.approx(reach[:, 1], abs=1e-6)
    # the first foot is on the left in the direction of growing u
    eps = 1e-3 * np.abs(np.diff(gates.diagram.curves.span[gates.border], axis=1)[:, 0])
    step = gates.diagram.curves.take(gates.border).points(gates.parameter + eps) - gates.point
    toward = gates.feet[:, 0] - gates.feet[:, 1]
    assert (step[:, 0] * toward[:, 1] - step[:, 1] * toward[:, 0] > 0.0).all()


@given(rooms, obstacle_lists, levels, seeds)
def test_riding_an_arc_crosses_its_gate_once(boundary, obstacles, level, seed):
    # Exactly along the arcs, with the gate's own point as a vertex of the polyline.
    gates = gates_or_none(boundary, obstacles, level)
    diagram = gates.diagram
    assume(len(diagram.arcs) > 0)
    at = np.full(len(diagram.curves), np.nan)
    at[gates.border] = gates.parameter
    rng = np.random.default_rng(seed)
    for parameters in (None, at):
        points, taken = random_walk(diagram, 12, rng, parameters)
        growing = np.sign(np.diff(diagram.curves.span, axis=1)[:, 0]).astype(int)
        expected = [
            sign * int(growing[row]) * (int(gates.at_border[row]) + 1)
            for row, sign in taken
            if gates.at_border[row] >= 0
        ]
        assert gates.word(points) == reduced(expected)


@given(rooms, obstacle_lists, levels, seeds)
def test_moves_over_free_triangles_keep_the_word(boundary, obstacles, level, seed):
    gates = gates_or_none(boundary, obstacles, level)
    assume(len(gates.diagram.arcs) > 0)
    rng = np.random.default_rng(seed)
    points, _ = random_walk(gates.diagram, 8, rng)
    other = wiggled(points, Floor(boundary, obstacles), rng, 120)
    assert gates.word(other) == gates.word(points)
    assert gates.name(gates.word(other)) == gates.name(gates.word(points))


@given(obstacle_lists, levels, seeds)
def test_closed_walks_of_the_empty_word_wind_around_nothing(obstacles, level, seed):
    # Also: the number of times a walk winds around anything follows from how often it crosses each gate,
    # since winding numbers add up; so walks with equal sums of letters have equal winding numbers.
    gates = gates_or_none(ROOM, obstacles, level)
    diagram = gates.diagram
    assume(len(gates) > 0)
    rng = np.random.default_rng(seed)
    inside = [np.mean(np.array(o.vertices)[:2], axis=0) for o in obstacles]  # on the outline
    sums, wound = [], []
    for _walk in range(40):
        points, _ = random_walk(diagram, int(rng.integers(2, 30)), rng)
        # close it at the first place that comes again, but not on a wall, where both sides have one place
        keys = {}
        free = diagram.world.distance(points) > 1e-9
        for i, p in enumerate(map(tuple, points)):
            if p in keys and free[i] and i - keys[p] > 12:
                loop = points[keys[p] : i + 1]
                letters = np.zeros(len(gates))
                for letter in gates.crossings(loop):
                    letters[abs(letter) - 1] += math.copysign(1.0, letter)
                sums.append(letters)
                wound.append(windings(loop, np.array(inside)))
                if gates.word(loop) == ():
                    assert (wound[-1] == 0).all()
                break
            keys.setdefault(p, i)
    if not sums:
        return
    # wound = sums @ weights must have an exact solution
    a, b = np.array(sums), np.array(wound, dtype=float)
    weights = np.linalg.lstsq(a, b, rcond=None)[0]
    assert a @ weights == pytest.approx(b, abs=1e-6)


@given(rooms, obstacle_lists, st.floats(0.0, 6.3), st.booleans(), seeds)
def test_random_worlds_keep_their_names_when_turned(boundary, obstacles, angle, quarter, seed):
    if quarter:
        angle = 0.5 * math.pi * round(angle / (0.5 * math.pi))
    shift = np.array([3.0, -40.0])
    here = gates_or_none(boundary, obstacles, 0.1)
    turned = [Obstacle(tuple(map(tuple, moved(o.vertices, angle, shift).tolist()))) for o in obstacles]
    there = gates_or_none(moved(boundary, angle, shift), turned, 0.1)
    assert there.tokens == here.tokens
    gap = np.hypot(*(there.point - moved(here.point, angle, shift)).T)
    assert gap.max(initial=0.0) <= 1e-5
    rng = np.random.default_rng(seed)
    points = rng.uniform(0.0, SIDE, (12, 2))
    assert here.name(here.word(points)) == there.name(there.word(moved(points, angle, shift)))


@given(rooms, obstacle_lists, levels, seeds)
def test_names_tell_words_from_one_place_apart(boundary, obstacles, level, seed):
    gates = gates_or_none(boundary, obstacles, level)
    assume(len(gates) > 0)
    assert len(set(gates.tokens)) == len(gates)
    piece = int(np.random.default_rng(seed).choice(gates.sides.reshape(-1)))
    words = words_from(gates, piece, 4)
    assert len({gates.name(word) for word in words}) == len(words)
    for word in words[:40]:
        assert word in gates.parse(gates.name(word))
        assert gates.matches(word, gates.name(word).split(", ") if word else [])


@given(seeds, st.floats(0.05, 2.0), st.floats(0.0, 3.0))
def test_arcs_have_the_word_of_their_many_small_chords(seed, size, bend):
    # 400 chords of at most 2 m / 400 depart from an arc of curvature 9 by 3e-5 m at most.
    gates = gates_or_none(ROOM, FOUR_IN_ROOM, 0.2)
    rng = np.random.default_rng(seed)
    curvature = bend * rng.uniform(-3.0, 3.0, 60)
    path = Path.from_arcs(rng.uniform(2.0, 18.0, 2), rng.uniform(0.0, 6.3), curvature, np.full(60, size))
    fine = path.subdivided(np.full(60, 400))
    assert word_of(gates, path) == gates.word(np.column_stack([fine.x, fine.y]))


# --- exact crossings


def crossings_by_shift(points, start, end) -> list[tuple[int, int, int]]:
    """Crossings (piece, segment, sign) of the polyline moved by a tiny rational step, in exact arithmetic."""
    tiny = Fraction(1, 10**9)
    line = [(Fraction(int(x)) + tiny, Fraction(int(y)) + tiny * tiny) for x, y in points]

    def turn(a, b, c):
        return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])

    found = []
    for i in range(len(line) - 1):
        x, y = line[i], line[i + 1]
        hits = []
        for k, (a, b) in enumerate(zip(start.tolist(), end.tolist(), strict=True)):
            before, after = turn(a, b, x), turn(a, b, y)
            assert before != 0
            if (before > 0) != (after > 0) and (turn(x, y, a) > 0) != (turn(x, y, b) > 0):
                hits.append((before / (before - after), k, 1 if before > 0 else -1))
        found += [(i, k, sign) for _, k, sign in sorted(hits)]
    return found


small = st.integers(0, 4)
grid_points = st.lists(st.tuples(small, small), min_size=1, max_size=70)


@given(grid_points, st.lists(st.tuples(small, small, small, small), min_size=1, max_size=8))
def test_crossings_on_a_grid_are_those_of_a_line_beside_it(points, segments):
    # On a 5 x 5 grid nearly everything is degenerate: vertices on segments, overlaps, common ends. Moved by
    # (t, t^2) with t = 1e-9 nothing is: determinants of grid points are integers, their changes below 1e-7.
    pairs = np.array([s for s in segments if s[:2] != s[2:]], dtype=float).reshape(-1, 4)
    assume(len(pairs) > 0)
    start, end = np.ascontiguousarray(pairs[:, :2]), np.ascontiguousarray(pairs[:, 2:])
    line = np.array(points, dtype=float)
    piece, _, segment, sign = crossings(line, start, end, box_tree(start, end))
    exact = crossings_by_shift(points, start.astype(int), end.astype(int))
    assert sorted(zip(piece.tolist(), segment.tolist(), sign.tolist(), strict=True)) == sorted(exact)
    assert (np.diff(piece) >= 0).all()


def test_orientation_is_exact_where_rounding_is_not():
    # (0.5, 0.5) + i u, j u with u = 2^-53 against the line through (12, 12) and (24, 24): the sign is that of
    # j - i, which floating-point determinants get wrong (L. Kettner et al., "Classroom examples of robustness
    # problems in geometric computations", Computational Geometry 40, 2008).
    i, j = (a.reshape(-1) for a in np.meshgrid(np.arange(256), np.arange(256)))
    u = 2.0**-53
    p = np.column_stack([0.5 + i * u, 0.5 + j * u])
    rounded_i, rounded_j = np.round((p - 0.5) / u).T  # what is left of i and j above 0.5
    line = [np.tile(q, (len(p), 1)).astype(float) for q in ((12, 12), (24, 24))]
    rows = np.arange(0, len(p), 37)
    found = orientation(line[0][rows], line[1][rows], p[rows])
    assert (found == np.sign(rounded_j - rounded_i)[rows]).all()
    naive = np.sign((12.0 - p[:, 0]) * (24.0 - p[:, 1]) - (12.0 - p[:, 1]) * (24.0 - p[:, 0]))
    assert (naive != np.sign(rounded_j - rounded_i)).any()
