"""What of a scenario file is the question, and what only words and limits."""

from __future__ import annotations

from collections.abc import Iterator
from copy import deepcopy
from typing import Any

import pytest
from judged import BASE, scenario_bytes

from verify.question import asked_in, question_of
from vnav_drake.scenario import ScenarioError, parse_scenario
from vnav_drake.scenario_spec import ScenarioSpec


def asked(**changes: Any) -> str:
    return question_of(parse_scenario(scenario_bytes(**changes), "here").spec)


def test_the_question_is_what_is_asked_not_how_it_is_told_or_limited():
    same = [
        asked(),
        asked(plan={"effort": "quick"}),
        asked(plan={"homotopy_classes": 6}),  # the default
        asked(gates={"analytic_gap": 0.5}),
        asked(description="other words"),
        asked(name="other"),
    ]
    assert len(set(same)) == 1
    others = [
        asked(plan={"homotopy_classes": 3}),
        asked(plan={"homotopy_classes": 3, "effort": "quick"}),
        asked(simulation={"stops": 2}),
        asked(simulation={"stops": 3}),
    ]
    assert others[0] == others[1]
    assert len({*same, *others}) == 4


# Every key of a scenario file, none at its default value; rules that join several keys do not matter here.
WHOLE: dict[str, Any] = {
    "schema": 1,
    "name": "hall",
    "description": "words",
    "world": {
        "boundary": [[0, 0], [40, 0], [40, 4], [0, 4]],
        "obstacles": [
            {"name": "A", "vertices": [[9, 1]]},
            {"name": "B", "circle": {"center": [9, 3], "radius": 0.25}},
        ],
    },
    "robot": {**BASE["robot"], "max_speed": 2.0, "max_steering_rate": 1.0},
    "braking": {
        "zone": {
            "type": "field_set",
            "base": {"type": "ellipse", "lateral_ratio": 0.25, "ahead": 1.5, "behind": 0.5},
            "fields": [{"max_speed": 1.0, "polygon": [[0, 0], [2, 0], [0, 1]]}],
            "dwell": 0.5,
        },
        "reaction_time": 0.25,
        "margin": 0.125,
        "friction_reserve": True,
    },
    "start": {"position": [5.0, 2.0], "speed": "rest", "heading": 0.5},
    "goal": {"position": [35.0, 2.0], "speed": 1.0, "heading": 0.25},
    "plan": {
        "methods": ["speed_graph", "dwa"],
        "homotopy_classes": 3,
        "graph": "published",
        "through": ["A/B"],
        "edge_cost": "published",
        "dwa": {"weights": [0.5, 0.25, 0.125], "window": 2.0, "step": 0.5},
        "effort": "quick",
    },
    "simulation": {"model": "both", "stops": 3, "studies": True},
    "gates": {
        "analytic_gap": 0.5,
        "refinement_gap": 0.5,
        "certified_gap": 0.5,
        "constraint_violation": 0.5,
        "braking_margin": 0.5,
        "emergency_stops": 5,
    },
}
OTHER_WORDS = {"rest": "safe", "field_set": "other", "ellipse": "other", "published": "sampled",
               "both": "single_track", "quick": "full",
               "dwa": "vc_method"}  # fmt: skip


def leaves(node: Any, *way: str | int) -> Iterator[tuple[str | int, ...]]:
    if isinstance(node, dict | list):
        for key, inner in node.items() if isinstance(node, dict) else enumerate(node):
            yield from leaves(inner, *way, key)
    else:
        yield way


def with_other(content: dict[str, Any], way: tuple[str | int, ...]) -> dict[str, Any]:
    """The content with another value at one leaf."""
    made = deepcopy(content)
    *parents, last = way
    place: Any = made
    for key in parents:
        place = place[key]
    old = place[last]
    if last == "edge_cost":
        place[last] = "realised"
    elif isinstance(old, str):
        place[last] = OTHER_WORDS.get(old, old + "x")
    else:
        place[last] = not old if isinstance(old, bool) else old + 1 if isinstance(old, int) else 0.75 * old
    return made


def question(content: dict[str, Any]) -> str:
    return question_of(ScenarioSpec.model_validate(content))


def test_the_whole_scenario_has_every_key():
    def keys(node: Any, *way: str) -> Iterator[tuple[str, ...]]:
        if isinstance(node, dict):
            for key, inner in node.items():
                yield from keys(inner, *way, key)
        elif isinstance(node, list | tuple) and node and isinstance(node[0], dict):
            for inner in node:
                yield from keys(inner, *way)
        else:
            yield way

    dumped = ScenarioSpec.model_validate(WHOLE).model_dump(mode="json", by_alias=True)
    # Of an obstacle and of a field set one of two keys is there, the other one None or empty.
    missing = set(keys(dumped)) - set(keys(WHOLE))
    assert missing <= {
        ("world", "obstacles", "circle"),
        ("world", "obstacles", "vertices"),
        ("braking", "zone", "count"),
    }


@pytest.mark.parametrize("through", [True, False])
def test_which_keys_are_of_the_question(through: bool):
    whole = deepcopy(WHOLE)
    if not through:
        del whole["plan"]["through"]
    asked = question(whole)
    alike = set()
    for way in leaves(whole):
        if way in (("schema",), ("plan", "methods", 0)):  # has one value only; needed by `through`
            continue
        if question(with_other(whole, way)) == asked:
            alike.add(".".join(map(str, way)))
    # World, robot, braking, both ends, what to plan and what to simulate are the question; words, the time
    # to search and limits are not. Gates to go through are called by the obstacles' names.
    names = set() if through else {"world.obstacles.0.name", "world.obstacles.1.name"}
    assert alike == names | {
        "name",
        "description",
        "plan.effort",
        *(f"gates.{key}" for key in whole["gates"]),
    }


def test_what_a_file_asks_is_that_of_the_scenario_it_holds():
    data = scenario_bytes(plan={"effort": "quick"})
    found = asked_in(b"# a comment\n" + data)
    assert found.question == asked(plan={"effort": "quick"})
    assert found.effort == "quick"
    with pytest.raises(ScenarioError, match="radius"):
        asked_in(scenario_bytes(robot={"radius": -1.0}))
