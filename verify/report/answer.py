"""The answer in three sentences: how fast, whether anything is faster, whether a vehicle does it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from verify.report.numbers import (
    bracket,
    count,
    metres,
    number_in,
    percent,
    seconds,
    seconds_proven,
    with_unit,
)
from verify.report.palette import method
from verify.report.story import (
    Result,
    executed_plan,
    is_executed,
    mapping,
    strayed,
    travel_times,
    unfinished,
    words,
)
from verify.report.story_bound import bound_story, least_time
from verify.report.story_stops import audit
from verify.report.text import plain
from verify.report.wording import VEHICLES

LESS = "<\u00a0"
SAME = 5e-4  # [s]: what is written with milliseconds does not tell two times apart that are nearer


def answer(result: Result, *, through: Sequence[str] = (), lost: str = "") -> tuple[str, str, str]:
    """The answer from the figures of the result, a sentence each, whatever there is and is not.

    Parameters
    ----------
    result : the content of result.json.
    through : gates that the way was asked to pass.
    lost : where and when a simulated run ended that did not arrive, a sentence.
    """
    plan, times = executed_plan(result), travel_times(result)
    return (
        _how_fast(result, plan, times, through),
        _nothing_faster(result, plan, times, through),
        _a_vehicle(result, lost),
    )


def _how_fast(result: Result, plan: str, times: Mapping[str, float], through: Sequence[str]) -> str:
    if plan not in times:
        return "There is no motion to execute: no stage produced a trajectory."
    length = number_in(result, "plans", plan, "length")
    way = f" on a path of {metres(length)}" if length is not None else ""
    if not is_executed(result):
        name = method(plan).label.lower().replace("voronoi", "Voronoi")
        return f"No trajectory passed all checks; the {name} would take {seconds(times[plan])}{way}."
    gates = f" through {', '.join(map(plain, through))}, as asked" if through else ""
    return f"The robot gets there in {seconds(times[plan])}{way}{gates}{_zone(result, plan, times)}."


def _zone(result: Result, plan: str, times: Mapping[str, float]) -> str:
    """What the braking zone gains, where it is no disc."""
    uniform = times.get("uniform")
    if mapping(result, "zone").get("isotropic") is not False or uniform is None or plan == "uniform":
        return ""
    gained = uniform - times[plan]
    if abs(gained) < SAME:
        return ", no sooner than with uniform braking"
    return f", {seconds(abs(gained))} {'sooner' if gained > 0.0 else 'later'} than with uniform braking"


def _nothing_faster(
    result: Result, plan: str, times: Mapping[str, float], through: Sequence[str] = ()
) -> str:
    """What is proven about every motion, and how near to that this one is."""
    missing = bound_story(result).missing
    proven, least = number_in(result, "lower_bound", "travel_time"), least_time(result, plan)
    if missing or proven is None or least is None:
        return f"Nothing proves that no motion is faster: {_cause(missing)}."
    ends = " with these ends" if least > proven else ""
    ends += ", by whatever way," if through else ""  # the bound knows of no gates
    time = times.get(plan)
    if time is None or time < least:  # what breaks a limit may well be faster
        return f"That no motion{ends} can take less than {seconds_proven(least)} is proven."
    low, high = bracket(least, time)
    more = f"{percent(time / least - 1.0)} more" if time - least >= SAME else f"{high}, as good as that"
    asked = f", through the {'gates' if len(through) > 1 else 'gate'} asked for," if through else ""
    return f"No motion{ends} can take less than {low}, which is proven; this one{asked} takes {more}."


def _cause(missing: str) -> str:
    """Why nothing is proven, up to the reason: that stands where the bound would."""
    return "the certificate is refused" if "refused" in missing else "there is no lower bound"


def _a_vehicle(result: Result, lost: str) -> str:
    word = unfinished(result)
    if word:
        return lost or f"In simulation the vehicle {word}."
    time = number_in(result, "simulation", "travel_time")
    if time is None:
        return "Whether a vehicle can drive it is open: nothing was simulated."
    model = words(mapping(result, "simulation").get("model"))
    vehicle = VEHICLES.get(model.replace("-", "_"), "vehicle")
    error = number_in(result, "simulation", "max_tracking_error")
    within = "" if error is None else f" within {with_unit(error, 'm').removeprefix(LESS)} of the plan"
    if strayed(result):
        within = ", but did not follow the plan"
    return f"In simulation a {vehicle} drove it in {seconds(time)}{within}{_stops(result)}."


def _stops(result: Result) -> str:
    found = audit(result)
    tried, bad = number_in(found, "tried"), number_in(found, "bad")
    if tried is None or bad is None:
        return "; emergency stops were not judged"
    stops = f"{count(tried)} emergency stops on the way"
    return f", and none of {stops} failed" if bad == 0.0 else f"; {count(bad)} of {stops} failed"
