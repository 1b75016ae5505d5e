"""Travel times side by side: rows of their table, and what stands beside a time that is none to compare."""

from __future__ import annotations

from dataclasses import dataclass

from verify.report.numbers import (
    DASH,
    count,
    duration,
    metres,
    number_in,
    percent,
    percent_or_times,
    seconds,
    seconds_proven,
    significant,
)
from verify.report.palette import Method, method
from verify.report.story import (
    NOT_PROMISED,
    Result,
    check_rows,
    executed_plan,
    is_executed,
    mapping,
    optima,
    reference_plan,
    travel_times,
    words,
)
from verify.report.wording import BROKEN, LIMITS

ANOTHER_WAY = "by another way than asked for"


@dataclass(frozen=True, kw_only=True)
class TimeRow:
    """One travel time as the page shows it."""

    look: Method
    model: str
    breaks: str  # limits of the full robot that it breaks though its model is that of the full robot
    travel_time: str
    above: str
    length: str
    solver: str
    intervals: str
    iterations: str
    compute_time: str
    executed: bool


def time_rows(result: Result) -> list[TimeRow]:
    """The table of travel times, analytic against optimised."""
    times = travel_times(result)
    rows = []
    for name, time in times.items():
        if name in ("lower_bound", "simulation"):
            facts = mapping(result, name)
        else:
            facts = mapping(mapping(result, "plans"), name)
        rows.append(
            TimeRow(
                look=method(name),
                model=words(facts.get("model")).replace("_", " ")
                or ("variational" if name == "lower_bound" else DASH),
                breaks=breaks(result, name),
                travel_time=seconds_proven(time) if name == "lower_bound" else seconds(time),
                above=_above(result, name, time, times.get(reference_plan(result))),
                length=metres(number_in(facts, "length")),
                solver=words(facts.get("solver") or facts.get("method")) or DASH,
                intervals=f"{count(number_in(facts, 'triangles'))} triangles"
                if name == "lower_bound"
                else count(number_in(facts, "intervals")),
                iterations=count(number_in(facts, "iterations")),
                compute_time=duration(number_in(facts, "compute_time")),
                executed=name == executed_plan(result) and is_executed(result),
            )
        )
    return rows


def _above(result: Result, name: str, time: float, reference: float | None) -> str:
    if goes_astray(result, name):
        return ANOTHER_WAY
    if name == reference_plan(result):
        return "reference"
    return percent_or_times(time / reference - 1.0) if reference else DASH


def goes_astray(result: Result, name: str) -> bool:
    """Whether a plan does not pass what the way was asked to pass: its time answers another question."""
    return mapping(mapping(result, "plans"), name).get("passes_through") is False


def breaks(result: Result, name: str) -> str:
    """What a plan of the full model breaks, in a few words; empty for others and where nothing breaks."""
    plan = mapping(mapping(result, "plans"), name)
    if plan.get("feasible") is not False or plan.get("model") != "full":
        return ""
    keys = _broken_keys(result, name)
    if not keys and mapping(plan, "violations"):
        return ""
    return f"breaks: {', '.join(BROKEN.get(key, key.replace('_', ' ')) for key in keys) or 'a check'}"


def broken(result: Result, name: str) -> str:
    """The limits that plan `name` breaks, in words of a sentence."""
    names = [LIMITS.get(key, key.replace("_", " ")) for key in _broken_keys(result, name)]
    return " and ".join(filter(None, (", ".join(names[:-1]), *names[-1:])))


def _broken_keys(result: Result, name: str) -> list[str]:
    """Checks that a plan fails as its model does not know them, and of a full model all that it fails.

    Not the held arcs of uniform braking: its own disc holds every arc, whatever the zone beside it does.
    """
    keys = [row.name for row in check_rows(result) if row.trajectory == name and row.status == NOT_PROMISED]
    plan = mapping(mapping(result, "plans"), name)
    if plan.get("feasible") is False and plan.get("model") == "full":
        keys += map(words, mapping(plan, "violations"))
    return [key for key in dict.fromkeys(keys) if key and (name, key) != ("uniform", "braking_arc")]


def compared(ratio: float, more: str, less: str) -> str:
    """`more` and `less` end with the word before what is compared with; above 100 % the multiple of that."""
    if abs(ratio) < 5e-6:
        return f"within {percent(1e-5)} of"
    if ratio > 1.0:
        return f"{significant(1.0 + ratio)} times"
    return f"{percent(abs(ratio))} {more if ratio >= 0.0 else less}"


def against_best(result: Result, name: str, *, rest_ends: bool) -> str:
    """A plan of the full robot against the best of the full robot, with ends as asked for; else empty.

    With safe ends there is nothing to tell apart: the variational optimum has the same ends.
    """
    refined = mapping(mapping(result, "plans"), "refined")
    best, time = number_in(refined, "travel_time"), travel_times(result).get(name)
    if not rest_ends or not best or time is None or refined.get("feasible") is False:
        return ""
    if goes_astray(result, name):
        return ""
    ratio = time / best - 1.0
    what = "the full robot's best" if ratio >= 0.0 else "the full-robot collocation"
    return f"{compared(ratio, 'above', 'below')} {what}"


def against_optimum(result: Result, name: str) -> str:
    """A plan's time against the variational optimum; empty without one, or where the way is another."""
    times = travel_times(result)
    optimum = next((times[key] for key in optima(result) if key in times), None)
    if name not in times or not optimum or goes_astray(result, name):
        return ""
    return f"{compared(times[name] / optimum - 1.0, 'above', 'below')} the variational optimum"


def window_sentence(result: Result) -> str:
    """How the dynamic window was set where it reached the goal; empty where it did not or was not run."""
    plan = mapping(mapping(result, "plans"), "dwa")
    if plan.get("reached") is not True:
        return ""
    parts = []
    told = plan.get("weights")
    weights = [number_in({"w": w}, "w") for w in told] if isinstance(told, list | tuple) else []
    if len(weights) == 3 and None not in weights:
        named = zip(("heading", "clearance", "speed"), weights, strict=True)
        parts.append("weights " + ", ".join(f"{weight:g} ({name})" for name, weight in named))
    for key in ("window", "step"):
        value = number_in(plan, key)
        if value is not None:
            parts.append(f"{key} {value:g}\u00a0s")
    decisions = number_in(plan, "decisions")
    if decisions is not None:
        parts.append(f"{count(decisions)}\u00a0decision{'s' * (round(decisions) != 1)}")
    return f"Dynamic window: {', '.join(parts)}." if parts else ""
