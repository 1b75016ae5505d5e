"""Does a vehicle drive as the recorded stops say? Their clock, way and speed, and what the wheels were told.

The speed changes by what brakes and floor give. That is allowed over any stretch of rows together, so that it
does not matter how many rows there are. While the brakes act:

* They give at most a_b, whether their wheels roll or are locked (`BRAKE_FACTOR`), and what the energy of
  turning takes: at the curvature kappa it is m v^2 / 2 (1 + k^2 kappa^2) in all, k^2 = (l^2 + w^2) / 12.
* A wheel that creeps or slides over the floor at the speed s loses, as friction is at most m mu g in all,
  the power m mu g s at most, which slows a vehicle of speed v by mu g s / v.
* Together no more than the floor gives, mu g (`FLOOR_FACTOR`).

The way follows, as the speeds say how long it is: at least v^2 / (2 a_b) but for these factors and slacks.
Until the brakes act the vehicle is on its run, which is compared elsewhere.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from verify.judge.limits import Limits
from verify.judge.stops_file import StopsFile
from verify.judge.tracking import JUMP_FACTOR, JUMP_SLACK, SAMPLING_LIMIT, Record
from verify.judge.wheels import FALLEN, UNLOADED, slid

Array = NDArray[np.float64]

LEAST_APART = 1e-3  # [s], between rows but for a stop's last: the simulation's own are 5 ms apart or more
BRAKE_FACTOR = 1.05  # of a_b: a torque acts on wheels that spin and tyres that creep; measured: below 1.01
FLOOR_FACTOR = 1.2  # of mu g: what a contact pushes while a body pitches is not as steady
# Once in a stop. Sampled speeds are good to well below a millimetre a second; the first may be as far off as
# it may be off the run.
SPEED_SLACK = 0.01  # [m/s]
# Besides, once in a stop: the centre of mass of height h moves by h times the rate at which the body pitches,
# as brakes shift load. That goes with the share of an axle's load that they take off, 2 h a_b / (g l), and is
# all where a wheel is in the air. Measured for h = 0.7 to 0.8 m: 0.035 m/s at 0.7, 0.09 m/s in the air.
JOLT = 0.15  # [m/s]
# A row every 20 ms says by its speeds how far the vehicle goes, to second order.
WAY_SHARE = 0.03
WAY_SLACK = 5e-3  # [m]
# Wheels that are straightened turn the vehicle less than wheels that are held. That shows where they stand at
# an angle for as long as an order takes to be heard, and the way driven with it is long enough. Steering that
# takes the part r of a stop to be straight leaves r - r^2 / 3 of the turn (the speed falls evenly, the angle
# too): 0.42 where that happens in half of its time, that is, before the whole way is driven at full speed.
STEERED = 0.05  # [rad]
ORDER_TIME = 0.1  # [s]
TELLING_WAY = 0.5  # [m]
SLOW_TURN = 0.1  # [m/s]: slower, rows say nothing of how sharply a vehicle turns
LESS = 0.9  # of the held one's heading change, at most that of the straightened one


def turn_between(before: Array, after: Array) -> Array:
    """From one heading to another the shorter way round [rad]."""
    return np.asarray(np.remainder(after - before + np.pi, 2.0 * np.pi) - np.pi)


def no_motion(file: StopsFile, run_end: float, limits: Limits) -> list[str]:
    """Rows that no vehicle drives, in words: clock, way and speed that do not go together.

    `run_end` [s] is the last time of the run, up to which rows before the reaction time are on it.
    """
    row = file.inner
    owner = file.owner[row]
    dt = file.t[row + 1] - file.t[row]
    step = np.hypot(file.x[row + 1] - file.x[row], file.y[row + 1] - file.y[row])
    v, after = file.speed[row], file.speed[row + 1]
    ends = np.isin(row + 1, file.first[1:] - 1)
    upright = ~file.any(file.tilt > FALLEN)
    pieces = (
        (dt <= 0.0, "times that do not increase"),
        ((dt < LEAST_APART) & (dt > 0.0) & ~ends, f"rows less than {LEAST_APART} s apart"),
        (dt > SAMPLING_LIMIT, f"rows more than {SAMPLING_LIMIT} s apart"),
        (
            step > JUMP_FACTOR * np.maximum(v, after) * dt + JUMP_SLACK,
            "a jump that its speed does not explain",
        ),
        (
            _too_much(file, _allowed(file, run_end, limits), limits) & upright[owner],
            "a change of speed that neither brakes nor floor give",
        ),
    )
    found = [
        f"{file.name_of(int(owner[i]))} has {words}, {file.t[row[i]]:.3f} s after its instant"
        for wrong, words in pieces
        for i in np.flatnonzero(wrong)[:1].tolist()
    ]
    way, told = file.total(step), file.total(0.5 * (v + after) * dt)
    late = np.flatnonzero(file.t[file.first[:-1]] != 0.0)
    strange = np.flatnonzero((np.abs(way - told) > WAY_SHARE * told + WAY_SLACK) & upright)
    found += [f"{file.name_of(i)} does not begin at its instant" for i in late[:1].tolist()]
    found += [
        f"{file.name_of(i)} drives {way[i]:.3f} m at speeds that make {told[i]:.3f} m"
        for i in strange[:1].tolist()
    ]
    return found


def _allowed(file: StopsFile, run_end: float, limits: Limits) -> Array:
    """By how much the speed may change [m/s] between each of the `inner` rows and the next.

    A piece across the end of the reaction time has the drive up to there; one that ends before, on the run,
    is compared with that, and here only held to what the floor gives.
    """
    row = file.inner
    owner = file.owner[row]
    dt = np.maximum(file.t[row + 1] - file.t[row], 0.0)
    tracked = np.clip(limits.reaction_time - file.t[row], 0.0, dt)
    bend = np.abs(file.heading[row + 1] - file.heading[row])
    bend /= np.maximum(np.hypot(*(file.points[row + 1] - file.points[row]).T), SLOW_TURN * dt + 1e-9)
    sharpest = np.zeros(len(file))
    np.maximum.at(sharpest, owner, np.minimum(bend, limits.curvature))
    turning = 1.0 + (limits.wheelbase**2 + limits.track**2) / 12.0 * sharpest[owner] ** 2
    brakes = limits.braking * turning * (dt - tracked) + max(limits.braking, limits.acceleration) * tracked
    slip = np.maximum(file.slip[row], file.slip[row + 1])
    fastest = np.maximum(file.speed[row], file.speed[row + 1])
    share = np.divide(slip, fastest, out=np.ones_like(slip), where=fastest > slip)
    floor = FLOOR_FACTOR * limits.grip * dt
    on_the_run = (file.t[row + 1] <= limits.reaction_time) & (
        file.instant[owner] + file.t[row + 1] <= run_end
    )
    given = np.where(on_the_run, floor, BRAKE_FACTOR * brakes + limits.grip * share * dt)
    return np.asarray(np.minimum(given, floor))


def _too_much(file: StopsFile, allowed: Array, limits: Limits) -> NDArray[np.bool_]:
    """Whether up to the end of each piece the speed fell, or rose, over any stretch by more than is allowed.

    The speed plus all that was allowed so far never decreases, and less that never increases; both per stop.
    """
    row = file.inner
    budget = np.zeros(len(file.t))
    budget[row + 1] = allowed
    budget = np.cumsum(budget)
    budget -= np.repeat(budget[file.first[:-1]], np.diff(file.first))
    # g w / (2 h) is the lateral acceleration at which a side is without load
    shifted = min(1.0, limits.braking * limits.track / (limits.tip * limits.wheelbase))
    jolt = JOLT * np.where(file.any(file.least_load <= UNLOADED), 1.0, shifted)
    slack = (SPEED_SLACK + jolt)[file.owner]
    # each stop above the one before, so that one running maximum serves all of them
    apart = file.owner * (1.0 + 2.0 * (np.ptp(file.speed) + budget.max()))
    excess = [
        np.maximum.accumulate(level) - level
        for level in (file.speed + budget + apart, budget - file.speed + apart)
    ]
    return np.asarray((np.maximum(*excess) > slack)[row + 1])


def unheard_orders(file: StopsFile, record: Record, limits: Limits) -> list[str]:
    """Instants at which the wheels stood at an angle and both stops turn alike, in words.

    A stop that slides is led by its momentum, not by its wheels: of it no more is asked than that both are
    not the same. A reaction time is over before the wheels are told anything.
    """
    if record.steering is None:
        return ["of a run whose record does not say how the wheels stood (column steering)"]
    told = file.instant[::2] + limits.reaction_time
    now, soon = (np.interp(told + late, record.t, record.steering) for late in (0.0, ORDER_TIME))
    angle = np.where(now * soon > 0.0, np.minimum(np.abs(now), np.abs(soon)), 0.0)
    acting = file.t >= limits.reaction_time
    row = file.inner
    step = np.hypot(file.x[row + 1] - file.x[row], file.y[row + 1] - file.y[row])
    way = file.total(np.where(acting[row], step, 0.0))
    waiting = file.total((~acting[row]).astype(np.float64))
    start = np.minimum(file.first[:-1] + waiting.astype(np.int64), file.first[1:] - 1)
    turned = np.abs(file.heading[file.first[1:] - 1] - file.heading[start])
    loose = file.any(slid(file.slip, file.t, file.first) | (file.tilt > FALLEN))
    slow = file.speed[start] * np.repeat(angle, 2) / limits.steering_rate
    fine = ((way > TELLING_WAY) & (slow <= way)).reshape(-1, 2).all(axis=1)
    asked = fine & (angle > STEERED) & (told + ORDER_TIME <= record.t[-1])
    held, straightened = turned[::2], turned[1::2]
    led = ~loose.reshape(-1, 2).any(axis=1)
    alike = np.flatnonzero(asked & ((led & (straightened > LESS * held)) | (straightened == held)))
    return [
        f"{file.name_of(2 * i + 1)} turns by {straightened[i]:.3f} rad, the one with the steering held by "
        f"{held[i]:.3f} rad, where the wheels stood at {angle[i]:.3f} rad"
        for i in alike[:1].tolist()
    ]
