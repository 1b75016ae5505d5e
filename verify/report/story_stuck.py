"""Runs that gave up on their way or fell: they have no travel time, and stand nowhere as if they had one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from verify.judge.wheels import FALLEN
from verify.report.evidence import SimulatedRun
from verify.report.numbers import DASH, duration, metres, number_in, seconds
from verify.report.palette import method
from verify.report.story import Result, is_stuck, mapping, unfinished, words
from verify.report.story_times import TimeRow
from verify.report.text import plain
from verify.report.wording import STUCK

FELL = 3  # the supervisor's mode in simulation.csv


@dataclass(frozen=True, kw_only=True)
class StuckRun:
    """A run that did not reach the goal."""

    method: str
    sentence: str  # why, when and where it gave up
    place: tuple[float, float] | None  # [m]
    row: TimeRow  # for the table of travel times
    word: str = "stuck"  # what became of it


def stuck_runs(result: Result) -> list[StuckRun]:
    """The plans that never reached the goal."""
    plans = mapping(result, "plans")
    names = [name for name in plans if isinstance(name, str) and is_stuck(result, name)]
    return [_run(name, mapping(plans, name)) for name in names]


def lost_run(result: Result, run: SimulatedRun | None) -> StuckRun | None:
    """The simulated run where it fell or did not arrive, else None; `run`: its record, which tells where."""
    word = unfinished(result)
    if not word:
        return None
    facts, place, when = mapping(result, "simulation"), None, ""
    if run is not None:
        down = np.zeros(len(run.t), dtype=bool)
        if word == "fell":
            down |= np.asarray(run.channels.get("mode", run.t * 0.0)) > FELL - 0.5
            down |= np.abs(run.channels.get("tilt", run.t * 0.0)) > FALLEN
        row = int(np.argmax(down)) if down.any() else -1
        place = (float(run.x[row]), float(run.y[row]))
        where = f"at ({place[0]:.2f}, {place[1]:.2f})\u00a0m".replace("-", "−")
        time = f"{run.t[row] - run.t[0]:.2f}\u00a0s"
        when = f" after {time}, {where}" if word == "fell" else f": after {time} it was {where}"
    left = number_in(facts, "goal_distance")
    far = "" if left is None else f", never nearer to the goal than {metres(left)}"
    row_words = replace(_row("simulation", facts), travel_time=word)
    sentence = f"In simulation the vehicle {word}{when}{far}."
    return StuckRun(method="simulation", sentence=sentence, place=place, row=row_words, word=word)


def _run(name: str, plan: Mapping[str, Any]) -> StuckRun:
    told = mapping(plan, "stuck")
    place = _place(told.get("place"))
    parts = [f"{method(name).label} got stuck and did not reach the goal"]
    time, left = number_in(told, "time"), number_in(plan, "goal_distance")
    if time is not None:
        parts.append(f"after {seconds(time)}")
    if place is not None:
        parts.append(f"at ({place[0]:.2f}, {place[1]:.2f})\u00a0m".replace("-", "−"))
    if left is not None:
        parts.append(f"{metres(left)} from the goal")
    reason, more = words(told.get("reason")), plain(words(told.get("message")))
    why = STUCK.get(reason, plain(reason.replace("_", " ")))
    text = ", ".join(parts) + (f": {why}" if why else "") + (f" ({more})" if more else "")
    return StuckRun(method=name, sentence=text + ".", place=place, row=_row(name, plan))


def _place(at: Any) -> tuple[float, float] | None:
    if not isinstance(at, list | tuple) or len(at) != 2:
        return None
    x, y = (number_in({"at": value}, "at") for value in at)
    return None if x is None or y is None else (x, y)


def _row(name: str, plan: Mapping[str, Any]) -> TimeRow:
    length = number_in(plan, "length")
    return TimeRow(
        look=method(name),
        model=words(plan.get("model")).replace("_", " ") or DASH,
        breaks="",
        travel_time="stuck",
        above="no time",
        length=DASH if length is None else f"{metres(length)} so far",
        solver=DASH,
        intervals=DASH,
        iterations=DASH,
        compute_time=duration(number_in(plan, "compute_time")),
        executed=False,
    )
