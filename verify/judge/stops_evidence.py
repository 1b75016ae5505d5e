"""Are the recorded stops those asked for, of the run beside them, and motions of a vehicle at all?"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from verify.judge.limits import Limits
from verify.judge.question import Drive
from verify.judge.stops_file import StopsFile
from verify.judge.stops_motion import no_motion, turn_between, unheard_orders
from verify.judge.tracking import Record

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

SPREAD = 2.0  # the run's part between neighbouring instants is at most this over their number: evenly is 1
CLOCK = 0.01  # [s], by which an instant may be off its place: steps of a simulation, rows of a record
# A stop begins in a state of the run, which is recorded in rows. Between two rows the position bulges
# from the chord by at most A h^2 / 8 with A the floor's grip; speed and heading lie between their values.
# Above that:
SAME_PLACE = 1e-3  # [m]: far below any clearance that counts
SAME_HEADING = 0.01  # [rad]
SAME_SPEED = 0.01  # [m/s]: 1 cm of braking distance at 1 m/s and 1 m/s^2


# A row's course lies between those of its ends; measured: to 1 mrad.
SAME_COURSE = 0.01  # [rad]
TELLING_STEP = 2e-3  # [m]: the direction of a shorter row says nothing


def faults(
    file: StopsFile, record: Record, planned: float, drive: Drive, limits: Limits, *, by_course: bool = False
) -> tuple[str, ...]:
    """Every reason not to take the stops for evidence about this run; empty when they are.

    `planned` is the travel time [s] of the motion that the run follows: what a run takes longer, which
    `tracking` limits, need not be covered. With `by_course` the run must say which way the vehicle moved.
    """
    found = _not_asked_for(file, drive, record, planned)
    if found:
        return tuple(found)  # the rest would be told of stops that nobody asked for
    return (
        *_not_spread(file, record, planned, drive),
        *_not_of_the_run(file, record, limits),
        *no_motion(file, float(record.t[-1]), limits),
        *unheard_orders(file, record, limits),
        *(_off_course(record) if by_course else ()),
    )


def recorded_speed(file: StopsFile, record: Record) -> Array:
    """The greater speed [m/s] of the run's rows on both sides of each instant; (n,)."""
    before, after, _ = _between(file.instant, record)
    return np.maximum(np.abs(record.v[before]), np.abs(record.v[after]))


def recorded_course(file: StopsFile, record: Record) -> Array:
    """Direction of motion [rad] of the run at each instant; (n,)."""
    before, after, part = _between(file.instant, record)
    course = _course(record)
    return np.asarray(course[before] + part * turn_between(course[before], course[after]))


def _course(record: Record) -> Array:
    """Direction of motion [rad] at each row, that of the body where the record does not tell; (n,)."""
    return record.heading if record.drift is None else record.heading + record.drift


def _off_course(record: Record) -> list[str]:
    """Rows whose course is not the way to the next row."""
    if record.drift is None:
        return ["of a run whose record does not say which way it moved (its velocities along and across)"]
    course = _course(record)
    turn = turn_between(course[:-1], course[1:])
    dx, dy = np.diff(record.x), np.diff(record.y)
    off = np.abs(turn_between(course[:-1] + 0.5 * turn, np.arctan2(dy, dx)))
    wrong = (np.hypot(dx, dy) > TELLING_STEP) & (off > SAME_COURSE + 0.5 * np.abs(turn))
    return [
        f"of a run that moves {off[i]:.3f} rad off the course its velocities say, at {record.t[i]:.3f} s"
        for i in np.flatnonzero(wrong)[:1].tolist()
    ]


def _not_asked_for(file: StopsFile, drive: Drive, record: Record, planned: float) -> list[str]:
    """Another vehicle, another number of stops, or not two of every instant.

    A run that lasts shorter than one `CLOCK` an instant has room for fewer, and one on which the vehicle
    fell has instants up to there only: with n of them in the middle of equal parts of `planned` [s] no
    fewer than n t / `planned` - 1/2 before the time t of the fall.
    """
    if file.model != drive.vehicle:
        return [f"of the model {file.model!a}, where {drive.vehicle} was to be stopped"]
    least, fell = min(drive.stops, int(min(float(record.t[-1]), planned) / CLOCK)), record.fell_at
    if fell is not None:
        least = min(least, max(int(drive.stops * fell / planned) - 1, 0))
    if not len(file) and not least and fell is not None:
        return [f"no stop at all: the vehicle fell on its run, {fell:.3f} s after its start"]
    if not max(2 * least, 1) <= len(file) <= 2 * drive.stops or len(file) % 2:
        return [f"{len(file)} stops, where 2 at each of {drive.stops} instants were asked for"]
    pairs = file.instant.reshape(-1, 2)
    flags = file.straightened.reshape(-1, 2)
    if (pairs[:, 0] != pairs[:, 1]).any() or flags[:, 0].any() or not flags[:, 1].all():
        return ["not one stop with the steering held and then one with straight wheels at each instant"]
    return []


def _not_spread(file: StopsFile, record: Record, planned: float, drive: Drive) -> list[str]:
    """Parts of the run in which no stop begins, and instants outside of it."""
    begin, end, fell = float(record.t[0]), float(record.t[-1]), record.fell_at
    if fell is not None:
        end = fell
    instants = file.instant[::2]
    if instants[0] < begin - CLOCK or instants[-1] > end + CLOCK or (np.diff(instants) <= 0.0).any():
        return [f"instants that do not increase within the run, {begin:.3f} to {end:.3f} s"]
    covered = max(min(end, planned), float(instants[-1]))
    marks = np.concatenate([[begin], instants, [covered]])
    gap = np.diff(marks)
    widest = int(np.argmax(gap))
    # of a run that ended in a fall the instants are those of the whole that was planned
    spread_over = covered - begin if fell is None else planned
    allowed = SPREAD * spread_over / drive.stops + CLOCK
    if gap[widest] <= allowed:
        return []
    return [
        f"no stop from {marks[widest]:.3f} to {marks[widest + 1]:.3f} s, at most {allowed:.3f} s is allowed"
    ]


def _between(clock: Array, record: Record) -> tuple[Rows, Rows, Array]:
    """The run's rows before and after each time, and the part of the time between that has passed."""
    before = np.clip(np.searchsorted(record.t, clock, side="right") - 1, 0, len(record.t) - 2)
    part = (clock - record.t[before]) / (record.t[before + 1] - record.t[before])
    return before, before + 1, np.clip(part, 0.0, 1.0)


def _not_of_the_run(file: StopsFile, record: Record, limits: Limits) -> list[str]:
    """Rows that are not the state in which the run was: the first, and all until the brakes act.

    For the reaction time the vehicle follows its trajectory, as it does on its run, as far as that lasts.
    """
    owner, begin = file.owner, file.first[:-1]
    clock = file.instant[owner] + file.t
    same = (file.t <= limits.reaction_time) & (clock <= record.t[-1])
    same[begin] = True
    row = np.flatnonzero(same)
    before, after, part = _between(clock[row], record)
    place = np.stack([record.x, record.y], axis=1)
    chord = place[before] + part[:, None] * (place[after] - place[before])
    off = np.hypot(*(file.points[row] - chord).T)
    bulge = limits.grip * (record.t[after] - record.t[before]) ** 2 / 8.0
    turn = turn_between(record.heading[before], record.heading[after])
    turned = np.abs(turn_between(record.heading[before] + part * turn, file.heading[row]))
    low, high = (f(record.v[before], record.v[after]) for f in (np.minimum, np.maximum))
    v = file.v[row]
    faster = np.maximum(v - high, low - v)
    rules = (
        (off > SAME_PLACE + bulge, off, "m from where the run was"),
        (turned > SAME_HEADING + 0.5 * np.abs(turn), turned, "rad off the run's heading"),
        (faster > SAME_SPEED, faster, "m/s off the run's speed"),
    )
    return [
        f"{file.name_of(int(owner[row[i]]))} {_still(file.t[row[i]])} {amount[i]:.4f} {words}"
        for wrong, amount, words in rules
        for i in np.flatnonzero(wrong)[:1].tolist()
    ]


def _still(t: float) -> str:
    """How far a stop has come, in words; `t` [s] since its instant."""
    return "begins" if t == 0.0 else f"is, {t:.3f} s after its instant and before the brakes act,"
