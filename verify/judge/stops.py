"""What became of the emergency stops: recomputed from the recorded stops and the scenario's vertices."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.judge.continuous import CONTACT
from verify.judge.finding import Check, Place
from verify.judge.geometry import Surroundings
from verify.judge.limits import Limits
from verify.judge.question import Drive
from verify.judge.stops_evidence import faults, recorded_course, recorded_speed
from verify.judge.stops_file import StopsFile
from verify.judge.tracking import Record
from verify.judge.wheels import FALLEN, lifted, slid
from verify.judge.zones import Zone, outside

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

NAME = "emergency_stops"
STANDING = 1e-2  # [m/s]: the record of a stop ends below this
# Beyond the braking distance claimed. A simulation goes by steps of some ms, so the brakes act up to one
# late, and a vehicle that pitches as it stands moves by some tenths of a millimetre.
STEP = 2e-3  # [s]
SETTLING = 1e-3  # [m]
LEAST_CLAIM = 0.05  # [m]: of less, a ratio would tell of the settling
MOST_LISTED = 50  # stops listed one by one

# In the order in which a stop's cause is told: the gravest first.
COLLISION, FALL, NO_STOP, LEFT = "collision", "fall", "did not stop", "left the zone"


@dataclass(frozen=True, kw_only=True)
class Stops:
    """What the recorded stops show, or why they show nothing."""

    refused: tuple[str, ...] = ()  # reasons not to take them for evidence
    figures: dict[str, Any] | None = None  # simulation.emergency_stops of result.json; None where refused
    place: Place | None = None  # of the first bad stop, else of the least clearance

    @property
    def bad(self) -> int | None:
        """Stops that the gate counts; None where they are refused."""
        return None if self.figures is None else int(self.figures["bad"])


@dataclass(frozen=True, eq=False)
class _Outcomes:
    """By stop; (n,) each."""

    clearance: Array  # [m], of the disc, least on the way, between rows too; negative: how deep it collides
    collision: Flags
    fall: Flags
    no_stop: Flags
    left: Flags  # out of the zone claimed where the stop began
    slid: Flags
    lifted: Flags
    way: Array  # [m], driven
    reach: Array  # [m], greatest distance from where the stop began
    claimed: Array  # [m], braking distance v t_r + v^2 / (2 a_b) at the instant
    beyond: Array  # (m,) [m], of each row, out of the zone claimed at its instant
    excess: Array  # [m], the greatest of `beyond`
    allowed: Array  # [m], of it: what a simulation's steps add
    bad: Flags


def judge_stops(
    file: StopsFile,
    record: Record,
    planned: float,
    surroundings: Surroundings,
    drive: Drive,
    limits: Limits,
    zone: Zone | None = None,
) -> Stops:
    """Judge every recorded stop; `planned` is the travel time [s] of the motion that is executed.

    A stop is bad when the disc touches anything on the way, the vehicle falls, it does not come to rest, or,
    where friction is reserved for braking, it leaves the zone claimed where it began: then every stop is
    promised to stay within. That is the disc of the braking distance around the place, or the robot's disc
    within the `zone` at the place, course and speed of the recorded run. Without the reserve a stop in a bend
    shares the friction with the turn and may be longer; that is told.
    """
    refused = faults(file, record, planned, drive, limits, by_course=zone is not None)
    if refused:
        return Stops(refused=refused)
    gap, at_rows = surroundings.along(file.points, file.first)
    found = _outcomes(file, record, limits, gap, zone)
    everything = np.ones(len(file), dtype=bool)
    figures: dict[str, Any] = {"instants": len(file) // 2, "friction_reserve": limits.reserves_friction}
    figures |= _figures(found, everything)
    if zone is not None:
        figures["worst_excess"] = float(found.excess.max())
    figures |= {
        "held": _figures(found, ~file.straightened),
        "straightened": _figures(found, file.straightened),
        "failed": [
            _failure(file, found, at_rows, i) for i in np.flatnonzero(found.bad)[:MOST_LISTED].tolist()
        ],
    }
    return Stops(figures=figures, place=_place(file, found, at_rows))


def stops_check(drive: Drive, stops: Stops | None, limit: float) -> Check:
    """The check `emergency_stops`, with the limit of its gate."""
    if drive.stops == 0:
        return _not_evaluated("the scenario asks for no emergency stops", wanted=False)
    if stops is None:
        return _not_evaluated("no emergency stops were recorded")
    if stops.bad is None:
        text = "; ".join(stops.refused)
        return Check(name=NAME, trajectory="simulation", status="failed", message=f"no evidence: {text}")
    excess = stops.bad - limit
    return Check(
        name=NAME,
        trajectory="simulation",
        status="failed" if excess > 0.0 else "passed",
        message=in_words(stops.figures or {}),
        worst=0.0 - excess,
        unit="stops",
        violation=max(0.0, excess),
        at=stops.place,
    )


def why_no_stops(drive: Drive, stops: Stops | None) -> str:
    """Why the gate is not evaluated, where it is not."""
    if drive.stops == 0:
        return "the scenario asks for no emergency stops"
    return "no emergency stops were recorded" if stops is None else "the emergency stops are no evidence"


def in_words(figures: Any) -> str:
    """How the stops went, in one phrase."""
    tried, bad = figures["tried"], figures["bad"]
    if not bad:
        return f"{tried} stops, least clearance {figures['min_clearance']:.3f} m"
    causes = (("collisions", "collide"), ("falls", "fall"), ("not_stopped", "do not stop"))
    counted = [(figures[key], words) for key, words in causes if figures[key]]
    if figures["left_zone"] and figures["friction_reserve"]:
        counted.append((figures["left_zone"], "leave the braking zone"))
    if len(counted) == 1:
        return f"{bad} of {tried} stops {counted[0][1]}"
    told = ", ".join(f"{count} {words}" for count, words in counted)
    return f"{bad} of {tried} stops end badly ({told})"


def _not_evaluated(message: str, *, wanted: bool = True) -> Check:
    return Check(name=NAME, trajectory="simulation", status="not_evaluated", message=message, wanted=wanted)


def _outcomes(file: StopsFile, record: Record, limits: Limits, gap: Array, zone: Zone | None) -> _Outcomes:
    begin, last = file.first[:-1], file.first[1:] - 1
    # The run's rows say how fast it was, too: no stop claims more than they do.
    v = np.minimum(file.speed[begin], recorded_speed(file, record))
    claimed = v * limits.reaction_time + v * v / (2.0 * limits.braking)
    allowed = SETTLING + STEP * v
    away = np.hypot(*(file.points - file.points[begin][file.owner]).T)
    row = file.inner
    step = np.hypot(*(file.points[row + 1] - file.points[row]).T)
    reach = file.most(away)  # of straight lines between rows the ends are furthest
    if zone is None:
        beyond = away - claimed[file.owner]
    else:
        beyond = _out_of(zone, limits.radius, file, v, recorded_course(file, record))
    excess = file.most(beyond)  # the places with the disc in the zone are a convex set
    clearance = gap - limits.radius
    collision = (clearance < 0.0) | (gap <= CONTACT)
    fall = file.any(file.tilt > FALLEN)
    no_stop = (file.speed[last] > STANDING) & ~fall
    left = excess > allowed
    return _Outcomes(
        clearance=clearance,
        collision=collision,
        fall=fall,
        no_stop=no_stop,
        left=left,
        slid=file.any(slid(file.slip, file.t, file.first)),
        lifted=file.any(lifted(file.least_load, file.t, file.first)),
        way=file.total(step),
        reach=reach,
        claimed=claimed,
        beyond=beyond,
        excess=excess,
        allowed=allowed,
        bad=collision | fall | no_stop | (left & limits.reserves_friction),
    )


def _out_of(zone: Zone, radius: float, file: StopsFile, speed: Array, course: Array) -> Array:
    """How far the disc is out of the zone claimed at the instant, at each row [m]; (m,).

    `speed` [m/s] and `course` [rad] of the run at the instants, (n,) each.
    """
    owner = file.owner
    dx, dy = (file.points - file.points[file.first[:-1]][owner]).T
    cos, sin = np.cos(course)[owner], np.sin(course)[owner]
    local = np.column_stack([cos * dx + sin * dy, cos * dy - sin * dx])
    return outside(zone, radius, local, speed[owner])


def _figures(found: _Outcomes, chosen: Flags) -> dict[str, Any]:
    """Counts over the chosen stops, at least one; ratios where a stop claims enough to form one."""
    figures: dict[str, Any] = {
        "tried": int(chosen.sum()),
        "bad": int(found.bad[chosen].sum()),
        "collisions": int(found.collision[chosen].sum()),
        "falls": int(found.fall[chosen].sum()),
        "not_stopped": int(found.no_stop[chosen].sum()),
        "left_zone": int(found.left[chosen].sum()),
        "slid": int(found.slid[chosen].sum()),
        "lifted": int(found.lifted[chosen].sum()),
        "min_clearance": float(found.clearance[chosen].min()),
    }
    telling = chosen & (found.claimed >= LEAST_CLAIM)
    if telling.any():
        claimed = found.claimed[telling]
        figures["worst_distance_ratio"] = float((found.way[telling] / claimed).max())
        figures["worst_displacement_ratio"] = float((found.reach[telling] / claimed).max())
    return figures


def _failure(file: StopsFile, found: _Outcomes, at_rows: Array, stop: int) -> dict[str, Any]:
    """A bad stop: its gravest cause, and where along it that shows first (a collision: is deepest)."""
    rows = slice(int(file.first[stop]), int(file.first[stop + 1]))
    amount: dict[str, float] = {}
    if found.collision[stop]:
        cause, row = COLLISION, int(np.argmin(at_rows[rows]))
        amount = {"depth": float(-found.clearance[stop])}
    elif found.fall[stop]:
        cause, row = FALL, int(np.argmax(file.tilt[rows] > FALLEN))
    elif found.no_stop[stop]:
        cause, row = NO_STOP, int(file.first[stop + 1] - file.first[stop]) - 1
        amount = {"speed": float(file.speed[rows][row])}
    else:
        cause, row = LEFT, int(np.argmax(found.beyond[rows] > found.allowed[stop]))
        amount = {"beyond": float(found.excess[stop])}
    row += rows.start
    return {
        "stop": stop,
        "instant": float(file.instant[stop]),
        "straightened": bool(file.straightened[stop]),
        "cause": cause,
        "x": float(file.x[row]),
        "y": float(file.y[row]),
        "t": float(file.t[row]),
        **amount,
    }


def _place(file: StopsFile, found: _Outcomes, at_rows: Array) -> Place:
    """Of the first bad stop, on the clock of the run; without one, of the row nearest to anything."""
    if found.bad.any():
        told = _failure(file, found, at_rows, int(np.argmax(found.bad)))
        return Place(t=told["instant"] + told["t"], x=told["x"], y=told["y"])
    row = int(np.argmin(at_rows))
    t = float(file.instant[file.owner[row]] + file.t[row])
    return Place(t=t, x=float(file.x[row]), y=float(file.y[row]))
