"""What stands behind the answer, in plain English: what else the figures of the result tell, compared."""

from __future__ import annotations

from collections.abc import Mapping

from verify.report.numbers import (
    count,
    fine_percent,
    number_in,
    percent,
    seconds,
    seconds_proven,
)
from verify.report.story import (
    Result,
    executed_plan,
    is_stuck,
    mapping,
    optima,
    travel_times,
)
from verify.report.story_bound import bracket_sentence, full_sentence
from verify.report.story_classes import certificate
from verify.report.story_limits import margin_sentence
from verify.report.story_stops import stops_sentence
from verify.report.story_times import (
    ANOTHER_WAY,
    against_best,
    against_optimum,
    broken,
    compared,
    goes_astray,
)


def details(result: Result, *, rest_ends: bool) -> list[str]:
    """What the answer leaves out, sentence by sentence: other plans of the same question, limits, margins."""
    plan, times = executed_plan(result), travel_times(result)
    sentences = _zone(result, plan, times)
    optimal = next((name for name in optima(result) if name in times), "")
    optimum = times.get(optimal)
    if optimum is not None and plan in times and plan != optimal:
        ends = (
            ", which knows the braking limit alone and may start and end at the safe speed"
            if rest_ends
            else ", which knows the braking limit alone"
        )
        ratio = times[plan] / optimum - 1.0
        near = compared(ratio, "above", "below")
        sentences.append(f"That is {near} the variational optimum of {seconds(optimum)}{ends}.")
    sentences += _analytic(result, times)
    cost, gap = number_in(result, "end_cost"), number_in(result, "gaps", "refinement")
    if cost is not None and cost > 0.0 and gap is not None:
        sentences.append(
            f"Starting and ending as asked costs at least {seconds_proven(cost)}; "
            f"the motion is {compared(gap, 'above', 'below')} the optimum with that cost added."
        )
    sentences += filter(None, [bracket_sentence(result), full_sentence(result)])
    limits = broken(result, optimal)
    if limits:
        repaired = ": the refinement repairs that" if "refined" in times else ""
        sentences.append(f"The variational optimum itself breaks {limits}{repaired}.")
    sentences += _held_back(result)
    sentences += filter(None, [stops_sentence(result), margin_sentence(result)])
    return sentences


def _zone(result: Result, plan: str, times: Mapping[str, float]) -> list[str]:
    """Uniform braking beside the zone, and what its promise is worth, where the zone is no disc."""
    if mapping(result, "zone").get("isotropic") is not False:
        return []
    sentences, uniform = [], times.get("uniform")
    if uniform is not None and plan in times and plan != "uniform":
        gained = uniform - times[plan]
        word = "gains" if gained >= 0.0 else "loses"
        sentences.append(
            f"With uniform braking it would take {seconds(uniform)}: the braking zone {word} "
            f"{seconds(abs(gained))}."
        )
    audit = mapping(mapping(result, "zone"), "promise")
    hits, poses = number_in(audit, "held_collides"), number_in(audit, "poses")
    if hits and poses:
        kept = mapping(result, "zone").get("friction_reserve") is True
        sentences.append(
            f"From {count(hits)} of {count(poses)} poses on the way a stop with the steering held would run "
            f"into an obstacle{'' if kept else ': no friction is kept in reserve'}."
        )
    return sentences


def others(result: Result, *, rest_ends: bool) -> list[str]:
    """What Voronoi route, vc-method and dynamic window came to, where they are not executed themselves."""
    return [*_route(result), *_baselines(result, rest_ends=rest_ends)]


def _route(result: Result) -> list[str]:
    times = travel_times(result)
    route, optimum = (
        times.get("voronoi_route"),
        next((times[name] for name in optima(result) if name in times), None),
    )
    if route is None or optimum is None:
        return []
    near = f"{compared(route / optimum - 1.0, 'more than', 'less than')} the variational optimum"
    near = ANOTHER_WAY if goes_astray(result, "voronoi_route") else near
    return [f"The fastest route along Voronoi arcs, with exact arc times, takes {seconds(route)}, {near}."]


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


def _baselines(result: Result, *, rest_ends: bool) -> list[str]:
    """The vc-method and the dynamic window, where they were run and are not executed themselves."""
    sentences, times, plan = [], travel_times(result), executed_plan(result)
    for name, title in (("vc_method", "vc-method"), ("dwa", "dynamic window")):
        if is_stuck(result, name):
            sentences.append(f"The {title} got stuck and did not reach the goal.")
        elif name in times and name != plan:
            parts = [f"The {title} takes {seconds(times[name])}"]
            if name == "vc_method":
                best = against_best(result, name, rest_ends=rest_ends)
                optimum = against_optimum(result, name)
                free = "which may start and end at the safe speed" if best and optimum else ""
                parts += [best, optimum, free]
            if goes_astray(result, name):
                parts.append(ANOTHER_WAY)
            limits = broken(result, name)
            parts.append(f"but breaks {limits}" if limits else "")
            sentences.append(", ".join(filter(None, parts)) + ".")
    return sentences


def _held_back(result: Result) -> list[str]:
    """What was kept for the controller, where a plan at the limits could not be followed."""
    share, before, after = (
        number_in(result, "plans", "refined", key)
        for key in ("limit_share", "full_limit_time", "travel_time")
    )
    if share is None or before is None:
        return []
    cost = "" if after is None or before <= 0.0 else f", which takes {_longer(after / before - 1.0)}"
    return [
        f"At the very limits ({seconds(before)}) the simulated vehicle could not follow, so the motion was "
        f"planned again with {100.0 * share:g}\u00a0% of grip, tip-over, steering and drive limits{cost}."
    ]


def _longer(ratio: float) -> str:
    return f"{percent(ratio)} longer" if ratio >= 0.0 else f"{percent(-ratio)} less long"
