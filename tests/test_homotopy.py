"""Homotopy classes: words of known paths, names, invariances, and agreement with independent invariants."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.worlds import moved, rectangle
from vnav_drake.homotopy import Gates, build_gates, class_of, homotopic_polyline, reduced, word_of
from vnav_drake.plan import Path, Trajectory
from vnav_drake.voronoi import build_diagram
from vnav_drake.world import Obstacle, World

Array = NDArray[np.float64]

SQUARE = ((0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0))
HALL = ((0.0, 0.0), (32.0, 0.0), (32.0, 31.0), (0.0, 31.0))
# Eight racks of 10 x 5 m (Manor 2015, Sec. 3.7): gaps of 1 m between them, corridors of 4 m.
RACKS = [
    rectangle(x, y, 10.0, 5.0, f"O{i}")
    for i, (y, x) in enumerate(itertools.product((22.0, 16.0, 10.0, 4.0), (4.0, 15.0)), start=1)
]
POINTS = {"P1": (3.0, 3.0), "P2": (7.0, 3.5), "P3": (3.5, 7.0), "P4": (6.5, 6.5)}
FOUR_POINTS = [Obstacle((place,), name) for name, place in POINTS.items()]
# FOUR_POINTS mirror each other in y = x, where no rule tells the ends of the chain P1/P4 apart; these do not.
UNEVEN_POINTS = [*FOUR_POINTS[:2], Obstacle(((3.4, 7.2),), "P3"), FOUR_POINTS[3]]

START, GOAL = (28.5, 1.9), (2.0, 22.0)
LOW, LEFT = (2.0, 2.0), (2.0, 12.5)
WAYS = {
    # Along the wide corridors: in each chain the gate lies in the longest of its narrowest stretches, which
    # is below O7 and O8, beside O3 to O6 and above O1; the goal comes before that.
    "O8/boundary, O7/boundary, O5/boundary, O3/boundary": [START, LOW, GOAL],
    # Over the top: gates beside O6 and O4, above O2 and O1.
    "O6/boundary, O4/boundary, O2/boundary, O1/boundary": [START, (28.5, 29.0), (2.0, 29.0), GOAL],
    # Through the gaps y = 15.5, x = 14.5 and y = 21.5: the short class of Manor 2015, Sec. 3.7.
    "O6/boundary, O4/O6, O3/O4, O1/O3": [START, (28.5, 15.5), (14.5, 15.5), (14.5, 21.5), (2.0, 21.5), GOAL],
    # Up between the columns.
    "O8/boundary, O7/O8, O5/O6, O3/O4, O1/O2, O1/boundary": [
        START,
        (14.5, 2.0),
        (14.5, 29.0),
        (2.0, 29.0),
        GOAL,
    ],
}


def gates_of(boundary, obstacles, level: float = 0.0) -> Gates:
    return build_gates(build_diagram(World.build(boundary, obstacles)), level)


@pytest.fixture(scope="module")
def warehouse() -> Gates:
    return gates_of(HALL, RACKS, 0.4)


@pytest.fixture(scope="module")
def four_points() -> Gates:
    return gates_of(SQUARE, FOUR_POINTS, 0.2)


def unit_loop(center, radius: float = 1.0, turns: float = 1.0, first: float = 0.0) -> Array:
    """A circle around `center`, anticlockwise for positive turns."""
    angle = first + np.linspace(0.0, 2.0 * math.pi * turns, 1 + int(48 * abs(turns)))
    return np.asarray(center) + radius * np.column_stack([np.cos(angle), np.sin(angle)])


def windings(loop: Array, centers: Array) -> NDArray[np.int64]:
    """How often a closed polyline winds around each centre: the sum of its turns seen from there."""
    seen = loop[None] - np.asarray(centers)[:, None]
    angle = np.arctan2(seen[..., 1], seen[..., 0])
    turn = (np.diff(angle, axis=1) + math.pi) % (2.0 * math.pi) - math.pi
    return np.rint(turn.sum(axis=1) / (2.0 * math.pi)).astype(np.int64)


def words_from(gates: Gates, piece: int, longest: int) -> list[tuple[int, ...]]:
    """All reduced words of paths from a piece of free space, of up to so many letters."""
    words: list[tuple[int, ...]] = [()]
    grown = [((), piece)]
    for _length in range(longest):
        longer = []
        for word, here in grown:
            for row, sign in itertools.product(range(len(gates)), (1, -1)):
                before, behind = gates.sides[row][::sign].tolist()
                letter = sign * (row + 1)
                if before == here and (not word or word[-1] != -letter):
                    longer.append(((*word, letter), behind))
        words += [w for w, _ in longer]
        grown = longer
    return words


def other_hand(name: str) -> str:
    """The name in a mirrored world of a class all of whose gates are loops."""
    tokens = name.split(", ")
    if tokens == ["direct"]:
        return name
    return ", ".join(t.removeprefix("-") if t.startswith("-") else "-" + t for t in tokens)


# --- words of known paths


@pytest.mark.parametrize("name", WAYS)
def test_ways_through_the_warehouse_have_the_names_of_what_they_pass(warehouse: Gates, name: str):
    assert class_of(warehouse, WAYS[name]) == name
    backwards = ", ".join(reversed(name.split(", ")))
    assert class_of(warehouse, WAYS[name][::-1]) == backwards


def test_the_warehouse_has_a_gate_for_every_stretch_between_crossings(warehouse: Gates):
    # Ten gaps between the eight racks; the corridor around them in eight stretches: one beside each rack.
    assert set(warehouse.tokens) == {
        "O1/O2", "O3/O4", "O5/O6", "O7/O8", "O1/O3", "O3/O5", "O5/O7", "O2/O4", "O4/O6", "O6/O8",
        *(f"O{i}/boundary" for i in range(1, 9)),
    }  # fmt: skip


def test_the_straight_way_between_four_points(four_points: Gates):
    # From the lower left to the upper right: above P1, between it and P3, then between P3 and P4.
    assert class_of(four_points, [(1.0, 1.2), (3.0, 5.0), (5.0, 7.5), (8.8, 9.0)]) == "P1/P3, P3/P4"
    assert class_of(four_points, [(1.0, 1.2), (5.0, 1.5), (8.5, 5.0), (8.8, 9.0)]) == (
        "P1/boundary, P2/boundary, P4/boundary"
    )


def test_without_obstacles_every_way_is_direct():
    gates = gates_of(SQUARE, [])
    assert len(gates) == 0
    assert class_of(gates, [(1.0, 1.0), (9.0, 2.0), (3.0, 8.0)]) == "direct"
    assert gates.parse("direct") == ((),)


def test_both_ways_round_a_point_and_round_again():
    # One chain around P: one gate, at an angle that the four equally narrow places do not tell, so count
    # letters. From the left of P to its right: below or above it, one of them through the gate.
    gates = gates_of(SQUARE, [Obstacle(((5.0, 5.0),), "P")], 0.1)
    assert gates.tokens == ("P/boundary",)
    assert gates.loops.tolist() == [True]
    once = gates.word(unit_loop((5.0, 5.0), first=0.3))
    assert len(once) == 1
    assert gates.name(once) == "P/boundary"  # anticlockwise: P on the left
    assert gates.name(tuple(-w for w in once)) == "-P/boundary"
    twice = gates.word(unit_loop((5.0, 5.0), turns=-2.0, first=0.3))
    assert gates.name(twice) == "-P/boundary, -P/boundary"
    below, above = ([(3.0, 5.0), (5.0, y), (7.0, 5.0)] for y in (4.0, 6.0))
    assert {len(gates.word(below)), len(gates.word(above))} == {0, 1}
    assert reduced(gates.word(below) + gates.word(above[::-1])) == once
    for word in (once, twice):
        assert gates.parse(gates.name(word)) == (word,)


def test_words_do_not_commute():
    # Around P1, around P2, back around P1, back around P2: no winding number sees it, the word does.
    gates = gates_of(SQUARE, FOUR_POINTS)
    base = np.array([(5.0, 2.0)])
    around = [np.concatenate([base, unit_loop(POINTS[p], first=1.5 * math.pi), base]) for p in ("P1", "P2")]
    loop = np.concatenate([around[0], around[1], around[0][::-1], around[1][::-1]])
    assert (windings(loop, np.array(list(POINTS.values()))) == 0).all()
    assert gates.word(loop) != ()
    assert gates.word(np.concatenate([loop, loop[::-1]])) == ()


def test_ends_in_dead_ends_do_not_matter(four_points: Gates):
    # Retreating into a corner and coming out again crosses no gate: a corner is a dead end.
    way = [(1.0, 1.2), (3.0, 5.0), (5.0, 7.5), (8.8, 9.0)]
    corners = [(0.3, 0.3), *way, (9.7, 9.7)]
    assert class_of(four_points, corners) == class_of(four_points, way)


def test_an_alcove_has_no_gate():
    # A U of 6 x 6 m with a mouth of 2 m: its inside is a dead end, one chain leads around it.
    cup = Obstacle(((2, 2), (8, 2), (8, 8), (6, 8), (6, 4), (4, 4), (4, 8), (2, 8)), "cup")
    gates = gates_of(SQUARE, [cup], 0.1)
    assert gates.tokens == ("cup/boundary",)
    assert class_of(gates, [(5.0, 5.0), (5.0, 9.0), (4.0, 9.0)]) == "direct"


def test_separate_parts_of_free_space_have_gates_of_their_own():
    # A wall from side to side; in each half a point in the middle of its own ring.
    parts = [
        Obstacle(((0.0, 5.0), (10.0, 5.0)), "wall"),
        Obstacle(((5.0, 2.0),), "low"),
        Obstacle(((5.0, 8.0),), "high"),
    ]
    gates = gates_of(SQUARE, parts)
    # below and above each point are the wall and the boundary: one chain, one gate, the narrower side;
    # 2 m to the boundary against 3 m to the wall
    assert sorted(gates.tokens) == ["high/boundary", "low/boundary"]
    assert gates.sides[0].tolist() != gates.sides[1].tolist()
    assert abs(gates.word(unit_loop((5.0, 2.0)))[0]) != abs(gates.word(unit_loop((5.0, 8.0)))[0])


def test_a_passage_too_narrow_has_no_gate():
    # Two boxes 1 m apart: for a level over 0.5 m they are one obstacle with one chain around it.
    boxes = [rectangle(2.0, 3.0, 2.5, 4.0, "A"), rectangle(5.5, 3.0, 2.5, 4.0, "B")]
    assert set(gates_of(SQUARE, boxes, 0.49).tokens) == {"A/B", "A/boundary", "B/boundary"}
    assert len(gates_of(SQUARE, boxes, 0.51)) == 1


def test_several_passages_of_one_pair_are_counted_along_the_first_outline():
    # A slot of A, 1 m wide, with a post P in a wider middle: A faces itself in front of P and behind it.
    outline = ((1, 1), (9, 1), (9, 4), (6, 4), (6, 4.5), (4, 4.5), (4, 4), (1, 4))
    other = ((1, 9), (1, 6), (4, 6), (4, 5.5), (6, 5.5), (6, 6), (9, 6), (9, 9))
    obstacles = [Obstacle(outline, "A"), Obstacle(other, "B"), Obstacle(((5.0, 5.0),), "P")]
    gates = gates_of(SQUARE, obstacles, 0.05)
    assert {"A/B.1", "A/B.2", "A/P", "B/P", "A/boundary", "B/boundary"} == set(gates.tokens)
    # along A's outline from (1, 1) anticlockwise the right side of the slot comes first
    first, second = (gates.point[gates.tokens.index(t), 0] for t in ("A/B.1", "A/B.2"))
    assert first > 5.0 > second
    through = class_of(gates, [(0.5, 5.0), (3.9, 5.0), (5.0, 4.8), (6.1, 5.0), (9.5, 5.0)])
    assert through == "A/B.2, A/P, A/B.1"


def test_a_united_obstacle_is_called_by_the_part_that_holds_the_foot():
    # An L of two overlapping boxes: the gate towards the wall y = 0 stands on the lower one (1 m away).
    boxes = [rectangle(3.0, 2.0, 1.0, 6.0, "upright"), rectangle(3.0, 1.0, 4.0, 1.5, "foot")]
    gates = gates_of(SQUARE, boxes, 0.1)
    assert gates.tokens == ("foot/boundary",)
    assert gates.point[0, 1] == pytest.approx(0.5, abs=1e-12)


def test_a_ring_of_short_chains_keeps_its_gates():
    # 200 posts at 4 m around P: the arcs between P and the posts form a regular polygon at 2 m, with sides of
    # 4 tan(pi / 200) = 0.063 m, shorter than a twentieth of 2 m; without their gates its ring would be lost.
    angle = 2.0 * math.pi * np.arange(200) / 200
    ring = np.array([5.0, 5.0]) + 4.0 * np.column_stack([np.cos(angle), np.sin(angle)])
    posts = [Obstacle((tuple(p),), f"R{i}") for i, p in enumerate(ring.tolist())]
    gates = gates_of(SQUARE, [Obstacle(((5.0, 5.0),), "P"), *posts])
    assert len(gates.word(unit_loop((5.0, 5.0), radius=1.0, first=0.01))) == 200
    assert gates.word(unit_loop((5.0, 5.0), radius=3.0, first=0.01)) != ()


# --- names


def test_names_that_cannot_stand_in_a_name_are_numbers():
    names = ["", "a/b", "a, b", "boundary", "-x", "rack.1", "rack 7"]
    spots = [(2.0, 2.0), (8.0, 2.0), (2.0, 8.0), (8.0, 8.0), (5.0, 5.0), (5.0, 1.5), (5.0, 8.5)]
    obstacles = [Obstacle((p,), n) for p, n in zip(spots, names, strict=True)]
    gates = gates_of(SQUARE, obstacles)
    used = {part for token in gates.tokens for part in token.split("/")}
    used -= {"boundary.1", "boundary.2"}  # the place in the middle sees the boundary on either side
    assert used == {"#1", "#2", "#3", "#4", "#5", "#6", "rack 7", "boundary"}


def test_equal_names_still_give_different_tokens():
    obstacles = [Obstacle((p,), "pole") for p in POINTS.values()]
    gates = gates_of(SQUARE, obstacles)
    assert len(set(gates.tokens)) == len(gates)
    assert all(token.startswith(("pole/pole.", "pole/boundary.")) for token in gates.tokens)


def test_different_words_from_one_place_have_different_names(four_points: Gates):
    (first,) = four_points.word([(1.0, 1.2), (4.5, 5.0)])
    words = words_from(four_points, int(four_points.sides[abs(first) - 1, 0 if first > 0 else 1]), 7)
    assert len(words) > 100
    assert len({four_points.name(w) for w in words}) == len(words)
    for word in words:
        assert word in four_points.parse(four_points.name(word))


def test_parse_refuses_what_no_path_does(warehouse: Gates):
    with pytest.raises(ValueError, match=r"'O4/O9' is no passage here.*nearest: .*O4/O6"):
        warehouse.parse("O4/O9, O3/O4")
    with pytest.raises(ValueError, match="in this order without turning back"):
        warehouse.parse("O1/O2, O7/O8")
    with pytest.raises(ValueError, match="in this order without turning back"):
        warehouse.parse("O1/O2, O1/O2")


def test_matching_finds_passages_in_order(warehouse: Gates):
    word = word_of(warehouse, WAYS["O6/boundary, O4/O6, O3/O4, O1/O3"])
    assert warehouse.matches(word, [])
    assert warehouse.matches(word, ["O4/O6", "O3/O4", "O1/O3"])
    assert warehouse.matches(word, ["O6/O4", "O1/O3"])  # either obstacle first
    assert not warehouse.matches(word, ["O1/O3", "O4/O6"])
    assert not warehouse.matches(word, ["O4/O6", "O4/O6"])
    with pytest.raises(ValueError, match=r"nearest: .*O1/O3"):
        warehouse.matches(word, ["O1/O33"])


def test_matching_without_a_number_means_any_passage_of_the_pair():
    gates = gates_of(SQUARE, [Obstacle((p,), "pole") for p in POINTS.values()])
    word = gates.word([(1.0, 1.2), (4.5, 5.0)])
    assert gates.matches(word, ["pole/pole"])
    assert gates.matches(word, [gates.name(word)])
    others = [t for t in gates.tokens if t != gates.name(word)]
    assert not any(gates.matches(word, [t]) for t in others)


def test_bad_input_is_named(four_points: Gates):
    with pytest.raises(ValueError, match="letter 10: must be"):
        four_points.name((10,))
    with pytest.raises(ValueError, match=r"shape \(3,\)"):
        four_points.word([1.0, 2.0, 3.0])
    with pytest.raises(ValueError, match=r"points\[1\].*must be finite"):
        four_points.word([(1.0, 1.0), (math.nan, 2.0)])
    with pytest.raises(ValueError, match=r"level = -0\.1"):
        build_gates(four_points.diagram, -0.1)
    with pytest.raises(ValueError, match="there are none"):
        gates_of(SQUARE, []).matches((), ["A/B"])


def test_reduction_cancels_from_the_inside():
    assert reduced((1, 2, -2, -1)) == ()
    assert reduced((1, 2, 3, -3, 2)) == (1, 2, 2)
    assert reduced((-1, 1, 2)) == (2,)


# --- motions


def test_arcs_count_by_their_true_place():
    # A half circle of radius 2 m as one row: its chord passes the point on the other side.
    gates = gates_of(SQUARE, [Obstacle(((5.0, 5.5),), "P")], 0.1)
    half = Path.from_arcs((3.0, 5.0), 0.5 * math.pi, [-0.5], [2.0 * math.pi])
    dense = half.at(np.linspace(0.0, 2.0 * math.pi, 2000))
    assert word_of(gates, half) == gates.word(np.column_stack(dense[:2]))
    assert word_of(gates, half) != gates.word([(3.0, 5.0), (7.0, 5.0)])
    speed = np.ones(2)
    motion = Trajectory(
        np.array([0.0, half.length]), half.x, half.y, np.append(half.heading, half.end_heading),
        speed, 0.0 * speed, np.full(2, -0.5), speed,
    )  # fmt: skip
    assert word_of(gates, motion) == word_of(gates, half)


def test_a_path_without_length_is_direct(four_points: Gates):
    none = np.zeros(0)
    assert class_of(four_points, Path(np.array([1.0]), np.array([1.0]), none, none, none)) == "direct"
    assert class_of(four_points, [(1.0, 1.0)]) == "direct"


def test_arcs_that_touch_a_wall_end_in_finitely_many_pieces():
    # From the wall y = 0 straight up, bending: distance zero at the start.
    world = World.build(SQUARE, [Obstacle(((5.0, 5.0),))])
    path = Path.from_arcs((3.0, 0.0), 0.5 * math.pi, [-0.5], [3.0])
    line = homotopic_polyline(world, path)
    assert 3 <= len(line) < 100
    assert line[[0, -1]] == pytest.approx(np.array([[path.x[i], path.y[i]] for i in (0, -1)]), abs=1e-12)


# --- invariances


@pytest.mark.parametrize("angle", [0.0, 0.37, 0.5 * math.pi, 2.9])
@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("room", ["warehouse", "four_points", "single_point"])
def test_moving_turning_and_mirroring_change_no_name(room: str, angle: float, mirrored: bool):
    boundary, obstacles = {
        "warehouse": (HALL, RACKS),
        "four_points": (SQUARE, UNEVEN_POINTS),
        "single_point": (SQUARE, [Obstacle(((5.0, 5.0),), "P")]),
    }[room]

    def put(points) -> Array:
        flipped = np.asarray(points, dtype=float) * np.array([-1.0 if mirrored else 1.0, 1.0])
        return moved(flipped, angle, (3.7, -11.9))

    there = [Obstacle(tuple(map(tuple, put(o.vertices).tolist())), o.name) for o in obstacles]
    here, other = gates_of(boundary, obstacles, 0.2), gates_of(put(boundary), there, 0.2)
    assert other.tokens == here.tokens
    assert other.point == pytest.approx(put(here.point), abs=1e-6)
    rng = np.random.default_rng(5)
    for _path in range(20):
        points = rng.uniform(0.5, 9.5, (6, 2)) * (3.0 if room == "warehouse" else 1.0)
        name = class_of(here, points)
        if mirrored and room == "single_point":  # the only loop: left becomes right, so signs change
            name = other_hand(name)
        assert class_of(other, put(points)) == name


def test_racks_drawn_a_little_off_keep_all_names(warehouse: Gates):
    # 5 mm: crossings of four gaps split into two branchings each; the short chain between has no gate.
    rng = np.random.default_rng(3)
    shifted = [
        Obstacle(tuple(map(tuple, (np.array(o.vertices) + rng.uniform(-5e-3, 5e-3, 2)).tolist())), o.name)
        for o in RACKS
    ]
    gates = gates_of(HALL, shifted, 0.4)
    assert gates.tokens == warehouse.tokens
    for name, way in WAYS.items():
        assert class_of(gates, way) == name
