"""Are the recorded stops those asked for, of the run beside them, and motions of a vehicle at all?"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from verify.judge.limits import Limits
from verify.judge.question import Drive
from verify.judge.stops_file import StopsFile
from verify.judge.tracking import JUMP_FACTOR, JUMP_SLACK, SAMPLING_LIMIT, Record
from verify.judge.wheels import FALLEN, lifted

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
# The floor changes a speed by mu g. A contact is not as steady as that; where a wheel was in the air and
# comes down, there is a jolt, of which nothing is asked.
GRIP_FACTOR = 2.0
GRIP_SLACK = 0.1  # [m/s]
# A row every 20 ms says by its speeds how far the vehicle goes, to second order.
WAY_SHARE = 0.1
WAY_SLACK = 0.02  # [m]


def faults(file: StopsFile, record: Record, planned: float, drive: Drive, limits: Limits) -> tuple[str, ...]:
    """Every reason not to take the stops for evidence about this run; empty when they are.

    `planned` is the travel time [s] of the motion that the run follows: what a run takes longer, which
    `tracking` limits, need not be covered.
    """
    found = _not_asked_for(file, drive, min(float(record.t[-1]), planned))
    if found:
        return tuple(found)  # the rest would be told of stops that nobody asked for
    return (
        *_not_spread(file, record, planned, drive),
        *_not_of_the_run(file, record, limits),
        *_no_motion(file, limits),
    )


def recorded_speed(file: StopsFile, record: Record) -> Array:
    """The greater speed [m/s] of the run's rows on both sides of each instant; (n,)."""
    before, after, _ = _between(file, record)
    return np.maximum(np.abs(record.v[before]), np.abs(record.v[after]))


def name_of(file: StopsFile, stop: int) -> str:
    """A stop in words."""
    how = "wheels straightened" if file.straightened[stop] else "steering held"
    return f"stop {stop} (at {file.instant[stop]:.3f} s, {how})"


def _not_asked_for(file: StopsFile, drive: Drive, duration: float) -> list[str]:
    """Another vehicle, another number of stops, or not two of every instant.

    A run that lasts shorter than one `CLOCK` an instant has room for fewer.
    """
    if file.model != drive.vehicle:
        return [f"of the model {file.model!a}, where {drive.vehicle} was to be stopped"]
    if not 2 * min(drive.stops, int(duration / CLOCK)) <= len(file) <= 2 * drive.stops or len(file) % 2:
        return [f"{len(file)} stops, where 2 at each of {drive.stops} instants were asked for"]
    pairs = file.instant.reshape(-1, 2)
    flags = file.straightened.reshape(-1, 2)
    if (pairs[:, 0] != pairs[:, 1]).any() or flags[:, 0].any() or not flags[:, 1].all():
        return ["not one stop with the steering held and then one with straight wheels at each instant"]
    return []


def _not_spread(file: StopsFile, record: Record, planned: float, drive: Drive) -> list[str]:
    """Parts of the run in which no stop begins, and instants outside of it."""
    begin, end = float(record.t[0]), float(record.t[-1])
    instants = file.instant[::2]
    if instants[0] < begin - CLOCK or instants[-1] > end + CLOCK or (np.diff(instants) < 0.0).any():
        return [f"instants that are not in order within the run, {begin:.3f} to {end:.3f} s"]
    covered = max(min(end, planned), float(instants[-1]))
    marks = np.concatenate([[begin], instants, [covered]])
    gap = np.diff(marks)
    widest = int(np.argmax(gap))
    allowed = SPREAD * (covered - begin) / drive.stops + CLOCK
    if gap[widest] <= allowed:
        return []
    return [
        f"no stop from {marks[widest]:.3f} to {marks[widest + 1]:.3f} s, at most {allowed:.3f} s is allowed"
    ]


def _between(file: StopsFile, record: Record) -> tuple[Rows, Rows, Array]:
    """The run's rows before and after each instant, and the part of the time between that has passed."""
    before = np.clip(np.searchsorted(record.t, file.instant, side="right") - 1, 0, len(record.t) - 2)
    part = (file.instant - record.t[before]) / (record.t[before + 1] - record.t[before])
    return before, before + 1, np.clip(part, 0.0, 1.0)


def _not_of_the_run(file: StopsFile, record: Record, limits: Limits) -> list[str]:
    """First rows that are not the state in which the run was at their instant."""
    before, after, part = _between(file, record)
    begin = file.first[:-1]
    place = np.stack([record.x, record.y], axis=1)
    chord = place[before] + part[:, None] * (place[after] - place[before])
    off = np.hypot(*(file.points[begin] - chord).T)
    bulge = limits.grip * (record.t[after] - record.t[before]) ** 2 / 8.0
    turn = _turn(record.heading[before], record.heading[after])
    turned = np.abs(_turn(record.heading[before] + part * turn, file.heading[begin]))
    low, high = (f(record.v[before], record.v[after]) for f in (np.minimum, np.maximum))
    v = file.v[begin]
    faster = np.maximum(v - high, low - v)
    rules = (
        (off > SAME_PLACE + bulge, off, "m from where the run was"),
        (turned > SAME_HEADING + 0.5 * np.abs(turn), turned, "rad off the run's heading"),
        (faster > SAME_SPEED, faster, "m/s off the run's speed"),
    )
    return [
        f"{name_of(file, i)} begins {amount[i]:.4f} {words}"
        for wrong, amount, words in rules
        for i in np.flatnonzero(wrong)[:1].tolist()
    ]


def _turn(before: Array, after: Array) -> Array:
    """From one heading to another the shorter way round [rad]."""
    return np.asarray(np.remainder(after - before + np.pi, 2.0 * np.pi) - np.pi)


def _no_motion(file: StopsFile, limits: Limits) -> list[str]:
    """Rows that no vehicle drives: clock, way and speed that do not go together."""
    row = file.inner
    owner = file.owner[row]
    dt = file.t[row + 1] - file.t[row]
    step = np.hypot(file.x[row + 1] - file.x[row], file.y[row + 1] - file.y[row])
    v, after = file.speed[row], file.speed[row + 1]
    upright = ~file.any(file.tilt > FALLEN)
    steady = upright & ~file.any(lifted(file.least_load, file.t, file.first))
    pieces = (
        (dt <= 0.0, "times that do not increase"),
        (dt > SAMPLING_LIMIT, f"rows more than {SAMPLING_LIMIT} s apart"),
        (
            step > JUMP_FACTOR * np.maximum(v, after) * dt + JUMP_SLACK,
            "a jump that its speed does not explain",
        ),
        (
            (np.abs(after - v) > GRIP_FACTOR * limits.grip * dt + GRIP_SLACK) & steady[owner],
            "a change of speed that no floor gives",
        ),
    )
    found = [
        f"{name_of(file, int(owner[i]))} has {words}, {file.t[row[i]]:.3f} s after its instant"
        for wrong, words in pieces
        for i in np.flatnonzero(wrong)[:1].tolist()
    ]
    way, told = file.total(step), file.total(0.5 * (v + after) * dt)
    late = np.flatnonzero(file.t[file.first[:-1]] != 0.0)
    strange = np.flatnonzero((np.abs(way - told) > WAY_SHARE * told + WAY_SLACK) & upright)
    found += [f"{name_of(file, i)} does not begin at its instant" for i in late[:1].tolist()]
    found += [
        f"{name_of(file, i)} drives {way[i]:.3f} m at speeds that make {told[i]:.3f} m"
        for i in strange[:1].tolist()
    ]
    return found
