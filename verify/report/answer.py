"""The answer in plain English, generated from the figures of the result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from verify.report.numbers import fine_percent, metres, number_in, percent, seconds, seconds_proven, with_unit
from verify.report.palette import method
from verify.report.story import (
    NOT_PROMISED,
    OPTIMA,
    Result,
    check_rows,
    executed_plan,
    is_stuck,
    travel_times,
    verdict,
)
from verify.report.story_bound import bracket_sentence, full_sentence
from verify.report.story_classes import certificate
from verify.report.text import plain
from verify.report.wording import LIMITS


def answer(result: Result, *, rest_ends: bool, through: Sequence[str] = ()) -> list[str]:
    """The answer in plain English, sentence by sentence; `through`: gates that the way was asked to pass."""
    plan, times = executed_plan(result), travel_times(result)
    sentences = [_gets_there(result, plan, times)]
    if through:
        sentences.append(f"It was asked to pass {', '.join(map(plain, through))}; faster ways may exist.")
    optimal = next((name for name in OPTIMA if name in times), "")
    optimum = times.get(optimal)
    if optimum is not None and plan in times and plan != optimal:
        ends = (
            ", which knows the braking limit alone and may start and end at the safe speed"
            if rest_ends
            else ", which knows the braking limit alone"
        )
        ratio = times[plan] / optimum - 1.0
        near = _compared(ratio, "above", "below")
        sentences.append(f"That is {near} the variational optimum of {seconds(optimum)}{ends}.")
    sentences += _analytic(result, times)
    cost, gap = number_in(result, "end_cost"), number_in(result, "gaps", "refinement")
    if cost is not None and cost > 0.0 and gap is not None:
        sentences.append(
            f"Starting and ending as asked costs at least {seconds_proven(cost)}; "
            f"the motion is {_compared(gap, 'above', 'below')} the optimum with that cost added."
        )
    sentences += filter(None, [bracket_sentence(result), full_sentence(result)])
    route = times.get("voronoi_route")
    if route is not None and optimum is not None:
        sentences.append(
            f"The fastest route along Voronoi arcs, with exact arc times, takes {seconds(route)}, "
            f"{_compared(route / optimum - 1.0, 'more than', 'less than')} that optimum."
        )
    sentences += _others(result, plan, times, optimum)
    broken = _broken(result, optimal)
    if broken:
        sentences.append(f"The variational optimum itself breaks {broken}: the refinement repairs that.")
    sentences += _held_back(result)
    sentences += _simulated(result)
    return sentences


def _compared(ratio: float, more: str, less: str) -> str:
    """`more` and `less` end with the word before what is compared with."""
    if abs(ratio) < 5e-6:
        return f"within {percent(1e-5)} of"
    return f"{percent(abs(ratio))} {more if ratio >= 0.0 else less}"


def _gets_there(result: Result, plan: str, times: Mapping[str, float]) -> str:
    if not plan:
        return "There is no motion to execute: no stage produced a trajectory."
    length = number_in(result, "plans", plan, "length")
    way = f" on a path of {metres(length)}" if length is not None else ""
    if verdict(result) == "failed":
        name = method(plan).label.lower().replace("voronoi", "Voronoi")
        return f"No trajectory passed all checks; the {name} would take {seconds(times[plan])}{way}."
    return f"The robot gets there in {seconds(times[plan])}{way}."


def _analytic(result: Result, times: Mapping[str, float]) -> list[str]:
    """The speed graph against the collocation of the same model, where there are both."""
    one, other, gap = (
        times.get("speed_graph"),
        times.get("collocation"),
        number_in(result, "gaps", "analytic"),
    )
    if one is None or other is None or gap is None:
        return []
    proven = certificate(result)
    words = f"The speed graph's {seconds(one)}{f' is {proven} and' if proven else ''}"
    return [
        f"{words} compares with {seconds(other)} of the collocation of the same model: "
        f"gap {fine_percent(gap)}."
    ]


def _others(result: Result, plan: str, times: Mapping[str, float], optimum: float | None) -> list[str]:
    """The vc-method and the dynamic window, where they were run and are not executed themselves."""
    sentences = []
    for name, title in (("vc_method", "vc-method"), ("dwa", "dynamic window")):
        if is_stuck(result, name):
            sentences.append(f"The {title} got stuck and did not reach the goal.")
        elif name in times and name != plan:
            text = f"The {title} takes {seconds(times[name])}"
            if optimum and name == "vc_method":
                near = _compared(times[name] / optimum - 1.0, "above", "below")
                text += f", {near} the variational optimum"
            broken = _broken(result, name)
            sentences.append(text + (f", but breaks {broken}." if broken else "."))
    return sentences


def _broken(result: Result, name: str) -> str:
    """The limits that plan `name` breaks as its model does not know them, in words."""
    rows = (row for row in check_rows(result) if row.trajectory == name and row.status == NOT_PROMISED)
    names = [LIMITS.get(row.name, row.name.replace("_", " ")) for row in rows]
    return " and ".join(filter(None, (", ".join(names[:-1]), *names[-1:])))


def _held_back(result: Result) -> list[str]:
    """What was kept for the controller, where a plan at the limits could not be followed."""
    share = number_in(result, "plans", "refined", "limit_share")
    before = number_in(result, "plans", "refined", "full_limit_time")
    if share is None or before is None:
        return []
    return [
        f"At the very limits ({seconds(before)}) the simulated vehicle could not follow, so the motion was "
        f"planned again with {100.0 * share:g}\u00a0% of grip, tip-over, steering and drive limits."
    ]


def _bound(length: float) -> str:
    return with_unit(length, "m").removeprefix("<\u00a0")


def _simulated(result: Result) -> list[str]:
    time = number_in(result, "simulation", "travel_time")
    error = number_in(result, "simulation", "max_tracking_error")
    if time is None:
        return []
    text = f"In simulation the vehicle took {seconds(time)}"
    return [text + (f" and stayed within {_bound(error)} of the plan." if error is not None else ".")]
