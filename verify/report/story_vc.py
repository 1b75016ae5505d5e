"""The vc-method's part of `result.json` as sentences, facts and table rows."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from verify.report.numbers import count, metres, number_in, percent, seconds, significant
from verify.report.story import KeyFigure, Result, entries, mapping, words
from verify.report.story_times import ANOTHER_WAY, against_best, against_optimum, broken, goes_astray
from verify.report.text import plain

COSTS = ("published", "realised")
LONGEST_NAME = 80  # characters of a class in a sentence
CLOSE = 1e-3  # relative: a radius this near to the one wanted is that one


@dataclass(frozen=True, kw_only=True)
class CornerRow:
    """One corner of the route as the page shows it."""

    number: str
    place: str
    turn: str
    radius: str
    wanted: str
    speed: str


@dataclass(frozen=True, kw_only=True)
class VcStory:
    """What the page says about the vc-method."""

    sentences: tuple[str, ...]
    facts: tuple[KeyFigure, ...]
    corners: tuple[CornerRow, ...]
    shortfalls: tuple[str, ...]  # what of the robot the motion cannot meet, and where


def vc_story(result: Result, *, rest_ends: bool) -> VcStory:
    """All sentences about the vc-method, as far as the result tells; `rest_ends`: not all ends are safe."""
    plan = mapping(mapping(result, "plans"), "vc_method")
    told = plan.get("shortfalls")
    return VcStory(
        sentences=tuple(
            filter(
                None,
                [
                    _cells(mapping(plan, "graph"), mapping(plan, "route")),
                    cost_sentence(plan),
                    _driven(result, plan),
                    _against(result, rest_ends=rest_ends),
                    _shortest(mapping(plan, "shortest_route")),
                ],
            )
        ),
        facts=_facts(mapping(plan, "graph"), mapping(plan, "route")),
        corners=_corners(plan),
        shortfalls=tuple(filter(None, map(words, told))) if isinstance(told, list | tuple) else (),
    )


def _facts(graph: Mapping[str, Any], route: Mapping[str, Any]) -> tuple[KeyFigure, ...]:
    share, nodes, edges = (number_in(graph, key) for key in ("share_of_four", "nodes", "edges"))
    found = [
        KeyFigure(
            "Stacks of cells", count(number_in(graph, "stacks")), f"{count(number_in(graph, 'cells'))} cells"
        ),
        KeyFigure(
            "Stacks of four cells",
            "–" if share is None else f"{100.0 * share:.0f}\u00a0%",
            "the source expects nearly all",
        ),
        KeyFigure(
            "Critical points",
            f"{count(number_in(graph, 'saddles'))} + {count(number_in(graph, 'maxima'))}",
            "saddles (Type I) and maxima (Type II)",
        ),
        KeyFigure("Adjacency graph", f"{count(nodes)} + {count(edges)}", "vertices and edges"),
        KeyFigure(
            "Chain of the route",
            f"{count(number_in(route, 'cells'))} cells",
            f"through {count(number_in(route, 'saddles'))} saddles",
        ),
    ]
    return tuple(figure for figure in found if not figure.value.startswith("–"))


def _cells(graph: Mapping[str, Any], route: Mapping[str, Any]) -> str:
    stacks, cells, passed = number_in(graph, "stacks"), number_in(graph, "cells"), number_in(route, "cells")
    if stacks is None or cells is None:
        return ""
    text = f"Free position-velocity space falls into {_number(stacks, 'stack')} with {_number(cells, 'cell')}"
    if passed is None:
        return text + "."
    return text + f"; the fastest chain found has {_number(passed, 'cell')}."


def _number(value: float, noun: str) -> str:
    return f"{count(value)}\u00a0{noun}{'s' * (round(value) != 1)}"


def cost_sentence(plan: Mapping[str, Any]) -> str:
    """Whether both costs of edges choose the same route, and what the other one would cost."""
    cost, route, other = words(plan.get("cost")), mapping(plan, "route"), mapping(plan, "other_route")
    if cost not in COSTS or not other:
        return ""
    another = COSTS[1 - COSTS.index(cost)]
    if other.get("same") is True:
        return (
            f"Both costs of edges choose this route: the {cost} one, which was asked for, and the {another}."
        )
    one, two = (number_in(r, "arc_time") for r in (route, other))
    if other.get("same") is not False or one is None or two is None or one <= 0.0:
        return ""
    apart = abs(two - one)
    worse = "more" if two >= one else "less"
    lengths = [number_in(r, "arc_length") for r in (route, other)]
    ways = "" if None in lengths else f", {metres(lengths[1])} long instead of {metres(lengths[0])}"
    classes = [words(plan.get("class")), words(other.get("class"))]
    where = f" It passes {_named(classes[1])} instead of {_named(classes[0])}." if all(classes) else ""
    return (
        f"The two costs of edges disagree: the {another} one chooses another route{ways}, that takes "
        f"{seconds(two)} along its arcs against {seconds(one)}, {seconds(apart)} or {percent(apart / one)} "
        f"{worse}.{where}"
    )


def _named(name: str) -> str:
    shown = plain(name)
    return f"“{shown if len(shown) <= LONGEST_NAME else shown[: LONGEST_NAME - 1] + '…'}”"


def _driven(result: Result, plan: Mapping[str, Any]) -> str:
    arcs, time = number_in(plan, "arc_time"), number_in(plan, "travel_time")
    if arcs is None or time is None:
        return ""
    corners = len(entries(plan, "corners"))
    text = f"Along the arcs with their corners the fastest profile takes {seconds(arcs)}"
    if corners:
        text += f"; with {_number(corners, 'corner')} rounded the motion takes {seconds(time)}"
    else:
        text += f", and the motion {seconds(time)}: there is no corner to round"
    limits = broken(result, "vc_method")
    if limits:
        text += f", but it breaks {limits}"
    if plan.get("consistent") is False:
        text += ". Radii and speeds did not settle, so some corners are wider or slower than needed"
    return text + "."


def _against(result: Result, *, rest_ends: bool) -> str:
    if goes_astray(result, "vc_method"):
        return (
            f"It goes {ANOTHER_WAY}, as the method knows of no passages, so its time compares with none here."
        )
    best = against_best(result, "vc_method", rest_ends=rest_ends)
    optimum = against_optimum(result, "vc_method")
    if optimum:
        optimum += ", which knows no limit of drive or turning"
        optimum += " and may start and end at the safe speed" if rest_ends else ""
    parts = ", ".join(filter(None, [best, optimum]))
    return f"That is {parts}." if parts else ""


def _shortest(route: Mapping[str, Any]) -> str:
    time, length = number_in(route, "arc_time"), number_in(route, "arc_length")
    if time is None or length is None:
        return ""
    return f"The geometrically shortest route along the arcs, {metres(length)}, would take {seconds(time)}."


def _corners(plan: Mapping[str, Any]) -> tuple[CornerRow, ...]:
    rows = []
    for number, corner in enumerate(entries(plan, "corners"), 1):
        x, y, turn, radius, wanted, speed = (
            number_in(corner, key) for key in ("x", "y", "turn", "radius", "wanted_radius", "speed")
        )
        place = "–" if x is None or y is None else f"({x:.2f}, {y:.2f})\u00a0m".replace("-", "−")
        less = wanted is not None and radius is not None and radius < wanted * (1.0 - CLOSE)
        rows.append(
            CornerRow(
                number=str(number),
                place=place,
                turn="–" if turn is None else f"{math.degrees(turn):.1f}°".replace("-", "−"),
                radius="–"
                if radius is None
                else f"{significant(radius)}\u00a0m" + (", smaller" if less else ""),
                wanted="–" if wanted is None else f"{significant(wanted)}\u00a0m",
                speed="–" if speed is None else f"{speed:.3f}\u00a0m/s",
            )
        )
    return tuple(rows)
