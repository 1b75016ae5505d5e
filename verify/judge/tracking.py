"""Did the simulated vehicle follow the trajectory it was given?"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.judge.continuous import CONTACT, Need, least_margin
from verify.judge.finding import Check, Place
from verify.judge.following import follow
from verify.judge.geometry import Surroundings
from verify.judge.limits import GRAVITY, Limits
from verify.judge.motion import Motion
from verify.judge.wheels import FALLEN, TIPPING, UNLOADED, lifted

Array = NDArray[np.float64]

RECORD_COLUMNS = ("t", "x", "y", "heading", "v", "lateral_acceleration")
LOAD_COLUMNS = ("load_front_left", "load_front_right", "load_rear_left", "load_rear_right")
WHEEL_COLUMNS = (*LOAD_COLUMNS, "tilt", "mode")  # of the four-wheel model, all of them
VELOCITY_COLUMNS = ("lateral_velocity", "longitudinal_velocity")  # of the body, where they are recorded
FELL = 3.0  # mode of a vehicle that has fallen

# A tracking controller at 0.70 to 0.95 of the friction limit stays within 20 mm of its path, and within
# 50 mm at the full steering angle; a vehicle that slides leaves it by metres. Where the curvature of a plan
# jumps, a vehicle waits for its steering, so it may be late, but no more than a run may take longer in all.
LATERAL_LIMIT = 0.05  # [m], across the planned path
AHEAD_LIMIT = 0.10  # [m], along the path, of the place planned for the same time
ON_SCHEDULE = 0.02  # [m], behind that place is not late: near rest a clock makes much of millimetres
LATENESS_LIMIT = 0.1  # [s], behind schedule, at every instant and on arrival ...
TIME_LIMIT = 0.01  # ... or this part of the planned travel time, if that is more
GOAL_LIMIT = 0.10  # [m], closest approach to the goal
ARRIVAL_BAND = 1e-5  # [m] from the end counts as arrived: braking at 1 m/s^2 ends 5 ms later
REST = 1e-9  # [m/s]: a plan that ends no faster ends at rest
SAMPLING_LIMIT = 0.1  # [s] between samples; coarser records say too little about the run
# Over a run the floor carries the weight, exactly but for the vertical motion at its ends; contacts chatter.
LOAD_SHARE = 0.1  # of m g
# A tall body sways from bend to bend and takes the weight off a side for 2 % of its run. One that has
# two wheels in the air again and again, each time for less than `TIPPING`, is not one that drives.
AIR_SHARE = 0.2  # of the time
JUMP_SLACK = 5e-3  # [m], by which a sample may lie further than its speeds explain (side slip, integration)
JUMP_FACTOR = 1.5  # times the greater speed of both samples: side slip adds to the forward speed


@dataclass(frozen=True, kw_only=True)
class Wheels:
    """What a record of the four-wheel model says besides."""

    loads: Array  # (n, 4) [N], front left, front right, rear left, rear right
    tilt: Array  # (n,) [rad], of the body's axis from the plumb line
    mode: Array  # (n,) 0 tracks, 1 emergency stop, 2 stopped, 3 fallen

    def least_side(self, weight: float) -> Array:
        """(n,) least load of a side or an axle, over half the `weight` [N].

        At 0 the robot tips. A single wheel may be without load before: four on a plane are one too many.
        """
        pairs = np.array([[0, 2], [1, 3], [0, 1], [2, 3]])  # left, right, front, rear
        return np.asarray(self.loads[:, pairs].sum(axis=2).min(axis=1) / (0.5 * weight))

    @property
    def fallen(self) -> NDArray[np.bool_]:
        """(n,) rows at which the vehicle has fallen."""
        return np.asarray((self.mode >= FELL) | (np.abs(self.tilt) > FALLEN))


@dataclass(frozen=True)
class Record:
    """The recorded run of the simulated vehicle."""

    t: Array  # (n,) [s]
    x: Array  # (n,) [m]
    y: Array  # (n,) [m]
    heading: Array  # (n,) [rad]
    v: Array  # (n,) [m/s]
    lateral_acceleration: Array | None = None  # (n,) [m/s^2], of the body; without it no wheel is judged
    wheels: Wheels | None = None  # of the four-wheel model
    steering: Array | None = None  # (n,) [rad], of the mean front wheel
    drift: Array | None = None  # (n,) [rad], of the course from the heading, to the left

    @property
    def vehicle(self) -> str:
        """The model that such a record is of."""
        return "single_track" if self.wheels is None else "four_wheel"

    @property
    def fell_at(self) -> float | None:
        """When the vehicle fell [s]; None where it did not."""
        if self.wheels is None or not self.wheels.fallen.any():
            return None
        return float(self.t[np.argmax(self.wheels.fallen)])


@dataclass(frozen=True)
class Run:
    """What the record shows."""

    check: Check
    # travel_time, max_lateness [s], max_tracking_error, max_lateral_error, min_clearance, goal_distance [m]
    figures: dict[str, Any]


def judge_run(
    record: Record,
    motion: Motion,
    goal: tuple[float, float],
    surroundings: Surroundings,
    limits: Limits,
    *,
    vehicle: str = "single_track",
    name: str = "simulation",
) -> Run:
    """Compare a recorded run of a `vehicle` with the trajectory `motion` it was to follow.

    `name` is the check's trajectory. Wheels are off the floor when their loads say so; of a single track the
    lateral acceleration says that the inner ones would be.

    At every sample up to the end of the planned motion the vehicle must be near the planned path, and
    near in time to when the plan passes that place; how far it is from the place planned for the same
    instant (`max_tracking_error`) is told, but not judged. The simulated travel time is the first time
    within `ARRIVAL_BAND` of the closest approach to the goal; where the plan ends at rest, of the place where
    the vehicle came to rest: one that brakes at 0.1 m/s^2 to stop 2 mm too far passes its goal 0.2 s before.
    """
    points = np.column_stack([record.x, record.y])
    during = record.t <= motion.t[-1]
    during[0] = True
    clock = np.minimum(record.t[during], motion.t[-1])
    planned, _ = motion.at(clock)
    error = np.hypot(*(points[during] - planned).T)
    beside = follow(clock, points[during], motion)
    behind = np.where(beside.lag > ON_SCHEDULE, beside.behind, 0.0)
    allowed = max(LATENESS_LIMIT, TIME_LIMIT * motion.travel_time)
    to_goal = np.hypot(record.x - goal[0], record.y - goal[1])
    to_end = to_goal
    if motion.v[-1] <= REST:
        to_end = np.hypot(*(points - points[-1]).T)
    arrival = int(np.argmax(to_end <= to_end.min() + ARRIVAL_BAND))
    time = float(record.t[arrival])
    least = least_margin(_polyline(record), surroundings.distance, Need(constant=limits.radius))
    sideways, slowest, fastest = (int(np.argmax(a)) for a in (beside.across, behind, -beside.lag))
    across, lead = float(beside.across[sideways]), -float(beside.lag[fastest])
    jump = _jump(record)
    gap = np.diff(record.t)
    coarse = int(np.argmax(gap))
    faults = [
        (gap[coarse] > SAMPLING_LIMIT, coarse, f"no sample for {gap[coarse]:.3f} s"),
        (jump is not None, jump or 0, "the record jumps further than its speed explains"),
        (across > LATERAL_LIMIT, sideways, f"{across:.4f} m beside the planned path"),
        (behind[slowest] > allowed, slowest, f"{behind[slowest]:.3f} s behind schedule"),
        (lead > AHEAD_LIMIT, fastest, f"{lead:.4f} m ahead of schedule"),
        (to_goal.min() > GOAL_LIMIT, arrival, f"came no closer to the goal than {to_goal.min():.4f} m"),
        *_off_the_floor(record, vehicle, limits),
        (
            abs(time - motion.travel_time) > allowed,
            arrival,
            f"took {time:.3f} s instead of {motion.travel_time:.3f} s",
        ),
    ]
    figures = {
        "model": record.vehicle,
        "travel_time": time,
        "max_tracking_error": float(error.max()),
        "max_lateral_error": across,
        "max_lateness": float(behind[slowest]),
        "min_clearance": least.proven,
        "goal_distance": float(to_goal.min()),
    }
    broken = [(f"{text}, at t = {record.t[i]:.3f} s", i) for fault, i, text in faults if fault]
    if least.proven < 0.0 or least.proven + limits.radius <= CONTACT:
        where = int(np.clip(np.searchsorted(record.t, least.t), 0, len(record.t) - 1))
        broken.append((f"collision {-least.proven:.4f} m deep, at t = {least.t:.3f} s", where))
    text = "; ".join(words for words, _ in broken)
    fine = f"at most {across:.4f} m beside the path, {behind[slowest]:.3f} s late; {time:.3f} s in all"
    row = broken[0][1] if broken else sideways
    check = Check(
        name="tracking",
        trajectory=name,
        status="failed" if broken else "passed",
        message=text or fine,
        worst=LATERAL_LIMIT - across,
        unit="m",
        violation=max(0.0, across - LATERAL_LIMIT),
        at=Place(t=float(record.t[row]), x=float(record.x[row]), y=float(record.y[row])),
    )
    return Run(check, figures)


def _jump(record: Record) -> int | None:
    """Index of the first sample that its predecessor's speed cannot reach, if any."""
    travelled = np.hypot(np.diff(record.x), np.diff(record.y))
    fastest = np.maximum(np.abs(record.v[:-1]), np.abs(record.v[1:]))
    far = travelled > JUMP_FACTOR * fastest * np.diff(record.t) + JUMP_SLACK
    return int(np.argmax(far)) + 1 if far.any() else None


def _polyline(record: Record) -> Motion:
    """Straight lines from sample to sample at even speed, for the clearance between samples."""
    dx, dy = np.diff(record.x), np.diff(record.y)
    length = np.hypot(dx, dy)
    moved = np.append(length > 0.0, True)
    if not (length > 0.0).any():
        rest = np.zeros(2)
        return Motion(np.arange(2.0), record.x[:2], record.y[:2], rest, rest, rest, rest, rest)
    x, y = record.x[moved], record.y[moved]
    dx, dy = np.diff(x), np.diff(y)
    clock = np.concatenate([[0.0], np.cumsum(np.hypot(dx, dy))])  # unit speed
    heading = np.append(np.arctan2(dy, dx), 0.0)
    zero, one = np.zeros(len(x)), np.ones(len(x))
    return Motion(clock, x, y, heading, one, zero, zero, zero)


def _off_the_floor(record: Record, vehicle: str, limits: Limits) -> list[tuple[bool, int, str]]:
    """Whether wheels were in the air, or the vehicle fell: fault, row, words."""
    if record.vehicle != vehicle:
        return [(True, 0, f"a run of the model {record.vehicle}, where {vehicle} was to drive")]
    if record.wheels is not None:
        weight = limits.mass * GRAVITY
        whole, fallen = np.array([0, len(record.t)]), record.wheels.fallen
        least = record.wheels.least_side(weight)
        airborne = lifted(least, record.t, whole, TIPPING)
        up = f"two wheels were in the air for {TIPPING} s or longer"
        share = _mean((least <= UNLOADED).astype(float), record.t)
        often = f"two wheels were in the air for {share:.0%} of the run, {AIR_SHARE:.0%} is allowed"
        # a vehicle that has fallen does not stand on its wheels
        carried = weight if fallen.any() else _mean(record.wheels.loads.sum(axis=1), record.t)
        heavy = f"wheels that carry {carried:.1f} N on average, where the robot weighs {weight:.1f} N"
        return [
            (bool(airborne.any()), int(np.argmax(airborne)), up),
            (share > AIR_SHARE, int(np.argmax(least <= UNLOADED)), often),
            (bool(fallen.any()), int(np.argmax(fallen)), "the vehicle fell"),
            (abs(carried - weight) > LOAD_SHARE * weight, 0, heavy),
        ]
    sway = np.zeros(1) if record.lateral_acceleration is None else np.abs(record.lateral_acceleration)
    most = int(np.argmax(sway))
    return [(bool(sway[most] > limits.tip), most, f"inner wheels lifted at {sway[most]:.3f} m/s^2")]


def _mean(values: Array, t: Array) -> float:
    """Of sampled values over time."""
    return float(np.trapezoid(values, t) / (t[-1] - t[0]))


def record_from_columns(columns: dict[str, Array]) -> Record:
    """From the columns of simulation.csv, those of wheels where they are; others are not judged."""
    wheels = None
    if all(name in columns for name in WHEEL_COLUMNS):
        loads = np.column_stack([columns[name] for name in LOAD_COLUMNS])
        wheels = Wheels(loads=loads, tilt=columns["tilt"], mode=columns["mode"])
    t, x, y, heading, v, sway = (columns[name] for name in RECORD_COLUMNS)
    drift = None
    if all(name in columns for name in VELOCITY_COLUMNS):
        drift = np.arctan2(*(columns[name] for name in VELOCITY_COLUMNS))
    return Record(
        *(t, x, y, heading, v),
        lateral_acceleration=sway,
        wheels=wheels,
        steering=columns.get("steering"),
        drift=drift,
    )
