"""What the report says of the seeds of the collocation."""

from __future__ import annotations

from typing import Any

from verify.report.story_seeds import seed_story


def seeds(*rows: dict[str, Any]) -> dict[str, Any]:
    return {"plans": {"collocation": {"comparison": list(rows)}}}


ONE = {"method": "speed_graph", "class": "A", "travel_time": 20.0, "iterations": 50, "rounds": 4}


def test_seeds_of_one_class_are_said_to_agree_and_within_what():
    # 20.001 / 20 - 1 = 5e-5 = 0.005 %
    story = seed_story(seeds(ONE, {**ONE, "method": "vc_method", "travel_time": 20.001}))
    words = story.sentences[0].replace("\u00a0", " ")
    assert words == "Speed graph and vc-method lead to the same class and agree within 0.005 %."
    assert [row.above for row in story.compared] == ["best", "+0.005\u00a0%"]


def test_however_close_seeds_agree_the_figure_is_told():
    # 20.000002 / 20 - 1 = 1e-7 = 10^-5 %
    story = seed_story(seeds(ONE, {**ONE, "method": "vc_method", "travel_time": 20.000002}))
    assert story.sentences[0].replace("\u00a0", " ").endswith("agree within 1.0 × 10⁻⁵ %.")


def test_seeds_of_different_classes_are_not_compared():
    other = {**ONE, "method": "vc_method", "class": "B", "travel_time": 25.0}
    assert "a homotopy class of its own" in seed_story(seeds(ONE, other)).sentences[0]
    third = {**ONE, "method": "voronoi_route"}
    words = seed_story(seeds(ONE, other, third)).sentences
    assert words[0] == "Speed graph and Voronoi route lead to the same class and agree to the last digit."
    assert words[1] == "vc-method ended in another class."


def test_a_cold_start_that_found_nothing_is_told_with_its_reason():
    story = seed_story(seeds(ONE, {"method": "cold_start", "message": "no safe motion", "compute_time": 3.0}))
    assert story.sentences[-1] == "The cold start, the straight line from start to goal, led to nothing safe."
    row = story.compared[-1]
    assert (row.travel_time, row.above, row.message) == ("–", "–", "no safe motion")


def test_a_cold_start_is_compared_with_the_best_of_the_others():
    # 21 s against 20 s: 5 % more
    words = seed_story(seeds(ONE, {"method": "cold_start", "class": "C", "travel_time": 21.0})).sentences
    assert (
        words[-1].replace("\u00a0", " ").endswith("led to 21.000 s, 5.00 % more than the best of the others.")
    )


def test_a_row_without_a_class_agrees_with_none():
    told = {**ONE, "method": "vc_method"}
    bare = [{k: v for k, v in {**ONE, "method": m}.items() if k != "class"} for m in ("dwa", "cold_start")]
    assert seed_story(seeds(bare[0], {**bare[0], "method": "voronoi_route"})).sentences == ()
    assert seed_story(seeds(ONE, bare[0])).sentences == ()
    words = seed_story(seeds(ONE, told, *bare)).sentences
    assert words[0] == "Speed graph and vc-method lead to the same class and agree to the last digit."
    assert not any("another class" in sentence or "Dynamic" in sentence for sentence in words)
    # two of four are known to be of different classes; of the others nothing is said
    (words, _) = seed_story(seeds(ONE, {**told, "class": "B"}, *bare)).sentences
    assert words.startswith("Speed graph and vc-method each ended in a homotopy class of its own")


def test_first_tries_tell_where_the_seed_was_and_where_it_ended():
    rows = [
        {**ONE, "ended_in": "A"},
        {**ONE, "method": "vc_method", "ended_in": "B"},
        {"method": "cold_start", "travel_time": 21.0, "ended_in": "A"},
        {**ONE, "method": "voronoi_route"},  # of an old result
        {"method": "dwa", "class": "C", "message": "no safe motion"},
        {"method": "cold_start"},
    ]
    story = seed_story({"plans": {"collocation": {"seeds": rows}}})
    assert [(row.seed_class, row.ended_in) for row in story.tried] == [
        ("A", "the same"), ("A", "B"), ("–", "A"), ("A", "–"), ("C", "–"), ("–", "–"),
    ]  # fmt: skip
    # the class of compared rows is that of what came out
    assert [row.ended_in for row in seed_story(seeds(ONE, rows[4])).compared] == ["A", "C"]
