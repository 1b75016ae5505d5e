"""The emergency stops in words: what the judge counted, what failed, and what it says about braking zones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.judge.stops import SETTLING, STEP
from verify.report.evidence import SimulatedRun
from verify.report.numbers import DASH, count, number_in, seconds, significant, with_unit
from verify.report.stops import LEAST_CLAIM, StopPaths
from verify.report.stops_zone import ClaimedZones, zone_finding
from verify.report.story import Result, entries, mapping, stops_notes, words
from verify.report.text import label, plain
from vnav_drake.problem import Problem

CAUSE_LENGTH = 40  # characters of a cause in a picture
WORST_CHORD = 4.0 * np.sin(np.pi / 8.0)  # chord over v^2/(2 a_b) of a stop at lambda = 1, see `finding`
SHARED = 0.95  # of a_b: with less than that left to brake with, turning is what makes a stop longer
NO_RESERVE = 0.1  # of a_b: what is left to turn with where a_b takes about all the friction
_COUNTS = (  # key, one, several
    ("collisions", "collides", "collide"),
    ("falls", "falls over", "fall over"),
    ("not_stopped", "does not come to rest", "do not come to rest"),
)


@dataclass(frozen=True, kw_only=True)
class FailedStop:
    """One stop that the gate counts."""

    index: int  # of stops.npz, -1 where that is not told
    cause: str
    place: tuple[float, float] | None  # [m]
    row: tuple[str, ...]  # instant, wheels, cause, where, after, by how much

    @property
    def cause_word(self) -> str:
        """The cause as it is drawn."""
        return label(self.cause, CAUSE_LENGTH) or "failed"


@dataclass(frozen=True, kw_only=True)
class StopStory:
    """What the page says about the stops."""

    sentences: Sequence[str] = ()
    finding: Sequence[str] = ()  # where stops leave the disc that they claim
    failed: Sequence[FailedStop] = ()
    unlisted: str = ""  # how many failed ones are not in the list
    missing: str = ""


def audit(result: Result) -> Mapping[str, Any]:
    """What the judge found of the stops, empty when it judged none."""
    found = mapping(mapping(result, "simulation"), "emergency_stops")
    return found if number_in(found, "tried") else {}


def stops_sentence(result: Result) -> str:
    """The stops in one sentence, "" when there are none."""
    found = audit(result)
    tried = number_in(found, "tried")
    if tried is None:
        return ""
    return f"{count(tried)} emergency stops on the way: {_outcome(found, stops_notes(result))}."


def _outcome(found: Mapping[str, Any], notes: Sequence[str]) -> str:
    """None collides; or how many do what; `notes`; how many count against the gate for another reason."""
    parts, told = [], 0.0
    for key, one, several in _COUNTS:
        number = number_in(found, key)
        if number:
            told += number
            parts.append(f"{count(number)} {one if number == 1 else several}")
    bad = number_in(found, "bad") or 0.0
    against = ""
    if bad and bad > told:
        against = f"{count(bad)} count against the gate{' in all' if parts else ''}"
    none = number_in(found, "collisions") == 0.0
    first = ", ".join(parts) or ("none collides" if none else "no count of collisions was recorded")
    least = number_in(found, "min_clearance")
    near = "" if least is None else f" (least clearance {with_unit(least, 'm')})"
    return ", ".join(filter(None, [first + near, *notes, against]))


def stop_story(
    result: Result,
    problem: Problem,
    stops: StopPaths | None,
    run: SimulatedRun | None,
    *,
    asked: bool,
    claims: ClaimedZones | None = None,
) -> StopStory:
    """The stops in words.

    `asked`: whether the scenario asks for any; `claims`: the zones that they claim, where those are no discs.
    """
    found = audit(result)
    if not found:
        gate = next((g for g in entries(result, "gates") if g.get("name") == "emergency_stops"), {})
        reason = plain(words(gate.get("reason"))).removeprefix("not evaluated: ")
        check = next((c for c in entries(result, "checks") if c.get("name") == "emergency_stops"), {})
        message = plain(words(check.get("message")))
        if check.get("status") == "failed" and message:  # it says more than the gate does
            reason = f"the judge refused them: {message}"
        if not asked:
            reason = "the scenario asks for none (simulation.stops: 0)"
        return StopStory(missing=f"No emergency stops: {reason or 'none were judged'}.")
    failed = [_failed(item) for item in entries(found, "failed")]
    bad = number_in(found, "bad") or 0.0
    more = int(bad) - len(failed)
    return StopStory(
        sentences=[*_sentences(result, found, problem), *_too_short(problem, stops)],
        finding=[*zone_finding(found, problem, claims), *_zone_reaction(problem, stops, claims)]
        if problem.zone is not None
        else []
        if stops is None
        else finding(found, problem, stops, run),
        failed=failed,
        unlisted=f"{count(more)} more failed and are not listed." if failed and more > 0 else "",
    )


def _too_short(problem: Problem, stops: StopPaths | None) -> list[str]:
    """Why no stop's way is drawn, where that is so."""
    if stops is None or (stops.claimed(problem.braking) >= LEAST_CLAIM).any():
        return []
    return [
        f"Every stop claims less than {100.0 * LEAST_CLAIM:g}\u00a0cm of way, too little to compare what it "
        "takes with what it claims."
    ]


def _sentences(result: Result, found: Mapping[str, Any], problem: Problem) -> list[str]:
    tried, instants = number_in(found, "tried") or 0.0, number_in(found, "instants")
    at = f"{count(instants)} instants, " if instants else ""
    notes = stops_notes(result, wheels=False)
    sentences = [
        f"{count(tried)} stops ({at}steering held and wheels straightened): {_outcome(found, notes)}."
    ]
    law = "v t_r + v²/(2 a_b)" if problem.braking.reaction_time > 0.0 else "v²/(2 a_b)"
    held, straight = (number_in(found, kind, "worst_distance_ratio") for kind in ("held", "straightened"))
    if held is not None and straight is not None:
        sentences.append(
            f"With the steering held a stop takes up to {significant(held, 4)} times {law}, "
            f"with the wheels straightened up to {significant(straight, 4)} times."
        )
    if problem.braking.reaction_time > 0.0:
        sentences.append(f"The brakes act {problem.braking.reaction_time:g}\u00a0s after the command.")
    slid, lifted = number_in(found, "slid"), number_in(found, "lifted")
    if slid is not None and lifted is not None:
        sentences.append(f"{_number(slid)} slid on the way, {_number(lifted).lower()} lifted a wheel.")
    return sentences


def _number(value: float) -> str:
    return "None" if value == 0.0 else count(value)


def finding(
    found: Mapping[str, Any], problem: Problem, stops: StopPaths, run: SimulatedRun | None
) -> list[str]:
    """Stops that leave the disc of the braking distance, and why; nothing where none does.

    Derived: with the steering held a stop is an arc of curvature kappa, on which turning and braking share
    the friction mu g. With sin(theta) = kappa v^2/(mu g) and braking as hard as friction allows,
    d(theta)/ds = -2 kappa: from lambda = sin(theta) the arc is asin(lambda)/(2 kappa) long and its chord
    (2/kappa) sin(asin(lambda)/4): 4 sin(asin(lambda)/4)/lambda times v^2/(2 mu g), 1.531 at lambda = 1.
    """
    left = number_in(found, "left_zone")
    if not left:
        return []
    tried, worst = number_in(found, "tried") or 0.0, _worst(found, problem, stops)
    held, straight = (number_in(found, kind, "left_zone") for kind in ("held", "straightened"))
    kinds = "" if held is None or straight is None else (
        f": {_number(held).lower()} with steering held, {_number(straight).lower()} with the wheels straight"
    )  # fmt: skip
    far = "" if worst is None else f", at the worst {significant(worst, 4)} times its radius away"
    sentences = [
        f"{count(left)} of {count(tried)} stops {'leaves' if left == 1.0 else 'leave'} the disc of the "
        f"braking distance around the place where {'it begins' if left == 1.0 else 'they begin'}{far}{kinds}."
    ]
    away = leaving(problem, stops)
    gained = away & _mostly_gained(problem, stops)
    if gained.any():
        sentences += _reaction(
            problem, stops, gained, (stops.displacement - stops.claimed(problem.braking))[gained]
        )
    shared, turn = sharing(problem, stops, run, but=gained)
    if shared.any():
        sentences += _source(problem, int(shared.sum()), turn)
    claimed = stops.claimed(problem.braking)
    rest = away & ~shared & ~gained & (claimed >= LEAST_CLAIM)
    if rest.any():
        most = float((stops.displacement[rest] / claimed[rest]).max())
        whose = "The others" if shared.any() or gained.any() else "They"
        sentences.append(
            f"{whose} end up to {significant(most, 4)} times as far away as claimed: there the vehicle "
            "itself brakes less than a_b."
        )
    if problem.friction_reserve:
        sentences.append("As braking.friction_reserve is asked for, each of them counts as failed.")
    elif shared.any():
        sentences.append(_cure(problem))
    return sentences


def _worst(found: Mapping[str, Any], problem: Problem, stops: StopPaths | None) -> float | None:
    """Greatest displacement over the claim, of the stops that leave their disc where the rows are there."""
    if stops is not None:
        claimed = stops.claimed(problem.braking)
        away = leaving(problem, stops) & (claimed >= LEAST_CLAIM)
        if away.any():
            return float((stops.displacement[away] / claimed[away]).max())
    return number_in(found, "worst_displacement_ratio")


def _mostly_gained(problem: Problem, stops: StopPaths) -> NDArray[np.bool_]:
    """Stops (n,) whose way beyond the claim is for half or more due to speed won before the brakes act."""
    if problem.braking.reaction_time <= 0.0:
        return np.zeros(len(stops), dtype=bool)
    beyond = stops.displacement - stops.claimed(problem.braking)
    return np.asarray(2.0 * stops.won(problem.braking) >= np.maximum(beyond, 2.0 * SETTLING))


def _zone_reaction(problem: Problem, stops: StopPaths | None, claims: ClaimedZones | None) -> list[str]:
    """The same where the zone is no disc; nothing where no stop leaves its zone for that reason."""
    if stops is None or claims is None or problem.braking.reaction_time <= 0.0:
        return []
    away = claims.beyond > SETTLING + STEP * stops.speed
    gained = away & (2.0 * stops.won(problem.braking) >= claims.beyond)
    return _reaction(problem, stops, gained, claims.beyond[gained], "zone") if gained.any() else []


def _reaction(
    problem: Problem,
    stops: StopPaths,
    gained: NDArray[np.bool_],
    beyond: NDArray[np.float64],
    claimed: str = "disc",
) -> list[str]:
    """What a reaction time does to the braking law where the plan speeds up.

    `beyond` [m]: how far each of the stops `gained` comes out of what it claims.
    """
    delay = problem.braking.reaction_time
    most = int(np.argmax(beyond))
    won = float(stops.won(problem.braking)[gained][most])
    faster = (stops.speed_after(delay) - stops.speed)[gained][most]
    share = f"{100.0 * min(won / float(beyond[most]), 1.0):.0f}\u00a0%"
    return [
        f"In {count(len(beyond))} of them the plan speeds up: until the brakes act, {delay:g}\u00a0s after "
        f"the command, the vehicle goes on along its plan. Of the one that goes farthest beyond its "
        f"{claimed}, "
        f"{with_unit(float(beyond[most]), 'm')}, the {with_unit(float(faster), 'm/s')} won by then explain "
        f"{share}.",
        "This is a finding about the braking law with a reaction time: v t_r + v²/(2 a_b) takes the speed at "
        "the command for the speed at which braking begins. Where the plan accelerates by a, braking begins "
        "at v + a t_r, after v t_r + a t_r²/2.",
    ]


def _source(problem: Problem, shared: int, turn: float) -> list[str]:
    """What the data say of `shared` stops, up to lambda = `turn`, and what that means for the source."""
    robot = problem.robot
    spared = robot.friction_acceleration * float(np.sqrt(max(0.0, 1.0 - min(turn, 1.0) ** 2)))
    return [
        f"In {count(shared)} of them the steering was held in a bend, where turning and braking share the "
        f"friction: with λ = κv²/(μg), here up to {significant(turn)}, only μg√(1 − λ²) = "
        f"{with_unit(spared, 'm/s²')} are left to brake with, less than "
        f"a_b = {with_unit(robot.max_braking, 'm/s²')}.",
        "This is a finding about the source, too: with μg = a_b such a stop is an arc asin(λ)/(2κ) long, "
        f"whose chord is up to {WORST_CHORD:.3f} times v²/(2 a_b) (at λ = 1), outside the disc that Manor "
        "2015, Definition 9, takes for the braking zone.",
    ]


def _cure(problem: Problem) -> str:
    law = "braking.friction_reserve keeps v²|κ| ≤ √((μg)² − a_b²), so that full braking is left in every bend"
    if problem.robot.reserved_lateral_acceleration() > NO_RESERVE * problem.robot.max_braking:
        return f"{law}: it cures this."
    return (
        f"{law}; here it would forbid to turn at all, as a_b takes all of μg: it cures this with a lower a_b."
    )


def leaving(problem: Problem, stops: StopPaths) -> NDArray[np.bool_]:
    """Stops (n,) that leave the disc of the braking distance, beyond what steps and settling explain."""
    claimed = stops.claimed(problem.braking)
    return np.asarray(stops.displacement > claimed + SETTLING + STEP * stops.speed)


def sharing(
    problem: Problem, stops: StopPaths, run: SimulatedRun | None, but: NDArray[np.bool_] | None = None
) -> tuple[NDArray[np.bool_], float]:
    """Stops (n,) that leave their disc, steering held, where turning leaves much less friction than a_b.

    Other than those of `but` (n,), which another cause explains. And the greatest lambda of those; 0 where
    there are none, or where the run does not tell.
    """
    sway = None if run is None else run.channels.get("lateral_acceleration")
    if run is None or sway is None:
        return np.zeros(len(stops), dtype=bool), 0.0
    grip = problem.robot.friction_acceleration
    share = np.abs(np.interp(stops.instant, run.t, sway)) / grip
    spared = grip * np.sqrt(np.maximum(1.0 - np.square(share), 0.0))
    shared = leaving(problem, stops) & ~stops.straightened & (spared < SHARED * problem.robot.max_braking)
    if but is not None:
        shared &= ~but
    return shared, float(share[shared].max()) if shared.any() else 0.0


def _failed(item: Mapping[str, Any]) -> FailedStop:
    index, x, y = (number_in(item, key) for key in ("stop", "x", "y"))
    cause = plain(words(item.get("cause"))) or "failed"
    place = None if x is None or y is None else (x, y)
    straight = item.get("straightened")
    amounts = (  # whichever the judge tells of its cause
        (f"{with_unit(number, unit)} {word}")
        for key, unit, word in (("depth", "m", "deep"), ("speed", "m/s", "left"), ("beyond", "m", "too far"))
        if (number := number_in(item, key)) is not None
    )
    return FailedStop(
        index=-1 if index is None or not 0.0 <= index < 1e9 else int(index),
        cause=cause,
        place=place,
        row=(
            seconds(number_in(item, "instant")),
            "straightened" if straight is True else "held" if straight is False else DASH,
            cause,
            DASH if place is None else f"({place[0]:.2f}, {place[1]:.2f})\u00a0m".replace("-", "−"),
            seconds(number_in(item, "t")),
            next(amounts, DASH),
        ),
    )
