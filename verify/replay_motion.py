"""The run as the replay needs it: frames in time, wheels that steer and roll, the braking disc's radius."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from vnav_drake.problem import Problem
from vnav_drake.robot import Robot
from vnav_drake.zones.convex_zone import ConvexZone
from vnav_drake.zones.field_set import FieldSet

Array = NDArray[np.float64]

COLUMNS = ("t", "x", "y", "heading", "v", "steering")
WHEELS = ("front_left", "front_right", "rear_left", "rear_right")
FRAME_RATE = 30.0  # [1/s]
MOST_FRAMES = 3000  # a longer run has fewer frames a second
WHEEL_SHARE = 0.16  # radius of a wheel over the wheelbase
ZONE_STEPS, OUTLINE = 12, 72  # outlines in which a zone that grows is drawn, corners of each
_FINE = np.linspace(0.0, 1.0, 513)
STOPPING, STOPPED, FALLEN = 1, 2, 3  # values of `mode`


@dataclass(frozen=True, kw_only=True)
class Frames:
    """The run at equal steps of time; arrays (n,) unless they say otherwise. The last frame is its end."""

    rate: float  # [1/s], frames in a second
    x: Array  # [m], centre of mass
    y: Array  # [m]
    heading: Array  # [rad], of the body, unwrapped
    v: Array  # [m/s]
    steering: Array  # (n, 4) [rad], of each of `WHEELS`
    spin: Array  # (n, 4) [rad], how far each of `WHEELS` has turned
    reach: Array  # [m], radius of the braking disc
    mode: NDArray[np.int64]  # 0 track, 1 emergency stop, 2 stopped, 3 fallen; 0 where it is not recorded

    @property
    def alarm(self) -> NDArray[np.bool_]:
        """Whether an emergency stop is on or the vehicle has fallen (n,)."""
        return np.isin(self.mode, (STOPPING, FALLEN))

    @property
    def duration(self) -> float:
        """[s]"""
        return (len(self.x) - 1) / self.rate


def frames(problem: Problem, run: Mapping[str, ArrayLike]) -> Frames:
    """The run at `FRAME_RATE`, at most `MOST_FRAMES` frames.

    Parameters
    ----------
    problem : robot and braking law.
    run : columns (m,) of one length m >= 2: t [s], x, y [m], heading [rad], v [m/s], steering [rad] of the
        mean front wheel; `mode` (1: emergency stop, 3: fallen) where there is one.

    Raises
    ------
    ValueError : a column is missing, has another length or a number that is not finite, time runs backwards
        or stands still.
    """
    columns = _checked(run)
    t = columns["t"] - columns["t"][0]
    keep = np.append(np.diff(t) > 0.0, True)
    t = t[keep]
    duration = float(t[-1])
    if not duration > 0.0:
        raise ValueError("the run: column t: must take time")
    count = min(max(math.ceil(duration * FRAME_RATE), 1), MOST_FRAMES - 1)
    now = np.linspace(0.0, duration, count + 1)
    robot = problem.robot
    speed, steering = columns["v"][keep], columns["steering"][keep]
    heading = np.unwrap(columns["heading"][keep])
    spins = rolled(robot, t, speed, steering)

    def at(values: Array) -> Array:
        return np.interp(now, t, values)

    v = at(speed)
    return Frames(
        rate=count / duration,
        x=at(columns["x"][keep]),
        y=at(columns["y"][keep]),
        heading=at(heading),
        v=v,
        steering=wheel_angles(robot, at(steering)),
        spin=np.column_stack([at(spin) for spin in spins.T]),
        reach=braking_reach(problem, v),
        mode=_mode(columns["mode"][keep], t, now)
        if "mode" in columns
        else np.zeros(len(now), dtype=np.int64),
    )


def _checked(run: Mapping[str, ArrayLike]) -> dict[str, Array]:
    absent = [name for name in COLUMNS if name not in run]
    if absent:
        raise ValueError(f"the run has no column {', '.join(absent)}")
    names = [*COLUMNS, *(["mode"] if "mode" in run else [])]
    columns = {name: np.asarray(run[name], dtype=float) for name in names}
    length = columns["t"].shape
    for name, values in columns.items():
        if values.ndim != 1 or len(values) < 2 or values.shape != length:
            raise ValueError(
                f"the run: column {name} has shape {values.shape}: all must have one length >= 2"
            )
        if not np.isfinite(values).all():
            raise ValueError(f"the run: column {name}: must be finite")
    if np.any(np.diff(columns["t"]) < 0.0):
        raise ValueError("the run: column t: must not run backwards")
    return columns


def _mode(mode: Array, t: Array, now: Array) -> NDArray[np.int64]:
    """The mode at each frame: that of the last row not later."""
    row = np.clip(np.searchsorted(t, now, side="right") - 1, 0, len(t) - 1)
    return np.rint(mode[row]).astype(np.int64)


def braking_reach(problem: Problem, speed: ArrayLike) -> Array:
    """Radius [m] of the disc that the robot may need to stop: rho + v t_r + v^2 / (2 a_b) + margin."""
    return problem.robot.radius + problem.braking.distance(np.abs(np.asarray(speed, dtype=float)))


@dataclass(frozen=True, kw_only=True)
class ZoneStep:
    """The zone as it is drawn over a range of speeds: one outline, stretched to the size at each frame."""

    outline: Array  # (k, 2) [m], at the top of the range, in the body's frame
    shown: NDArray[np.bool_]  # (n,) frames in which the speed is in the range
    stretch: Array  # (n, 2), ahead and across


def zone_steps(zone: ConvexZone, speed: ArrayLike, steps: int = ZONE_STEPS) -> list[ZoneStep]:
    """The zone at the speeds (n,) [m/s] of the frames, in `steps` outlines.

    Between two steps the larger outline is stretched so that its reach ahead and across is exact. Fields that
    are switched by speed are drawn one by one as they are.
    """
    v = np.abs(np.asarray(speed, dtype=float))
    if isinstance(zone, FieldSet):
        tops = np.array(zone.max_speeds)
        inside = zone.case(v)
    else:  # even in the stopping distance
        far = zone.law.distance(v)
        most = float(zone.law.distance(max(float(v.max()), 1e-3)))
        edges = np.linspace(zone.law.margin, most, steps + 1)
        inside = np.clip(np.searchsorted(edges, far) - 1, 0, steps - 1)
        tops = np.interp(edges[1:], zone.law.distance(_FINE * v.max()), _FINE * v.max())
    ahead, across = (_reach(zone, angle, v) for angle in (0.0, 0.5 * math.pi))
    found = []
    for step, top in enumerate(tops.tolist()):
        shown = inside == step
        if shown.any():
            whole = [_reach(zone, angle, np.array([top]))[0] for angle in (0.0, 0.5 * math.pi)]
            stretch = np.column_stack([ahead / whole[0], across / whole[1]])
            found.append(ZoneStep(outline=zone.outline(top, OUTLINE), shown=shown, stretch=stretch))
    return found


def _reach(zone: ConvexZone, angle: float, speed: Array) -> Array:
    """How far (n,) [m] the zone reaches in a direction; at least a little, as it divides."""
    return np.maximum(zone.support(np.full(len(speed), angle), speed)[0], 1e-6)


def wheel_radius(robot: Robot) -> float:
    """Radius [m] with which wheels are drawn."""
    return WHEEL_SHARE * robot.wheelbase


def wheel_places(robot: Robot) -> Array:
    """(4, 2) [m], forward and left of the centre of mass, midway between the axles."""
    length, width = 0.5 * robot.wheelbase, 0.5 * robot.track
    return np.array([[length, width], [length, -width], [-length, width], [-length, -width]])


def wheel_angles(robot: Robot, steering: ArrayLike) -> Array:
    """Angles (n, 4) [rad] of the wheels for a mean angle (n,) [rad]: all axes meet in one point (Ackermann).

    Derived: for the mean angle omega the centre of turning lies on the rear axle, R = l / tan(omega) to the
    left of its middle; a front wheel w / 2 to the left of the middle stands at tan = l / (R - w / 2).
    """
    tangent = np.tan(np.asarray(steering, dtype=float))
    half = 0.5 * robot.track / robot.wheelbase * tangent
    still = np.zeros_like(tangent)
    return np.column_stack(
        [np.arctan2(tangent, 1.0 - half), np.arctan2(tangent, 1.0 + half), still, still]
    )  # fmt: skip


def rolled(robot: Robot, t: Array, speed: Array, steering: Array) -> Array:
    """How far (m, 4) [rad] each wheel has turned, rolling on the floor without slip.

    Derived: with the centre of turning as in `wheel_angles` at distance D from the centre of mass and D_i
    from wheel i, the wheel moves at v D_i / D. In multiples of R, with k = tan(omega) / l = 1 / R: D^2 ~
    1 + (k l / 2)^2, the rear wheels 1 -+ k w / 2, the front wheels hypot(1 -+ k w / 2, k l).
    """
    k = np.tan(steering) / robot.wheelbase
    centre = np.hypot(1.0, 0.5 * k * robot.wheelbase)
    left, right = 1.0 - 0.5 * k * robot.track, 1.0 + 0.5 * k * robot.track
    forward = k * robot.wheelbase
    ways = np.column_stack([np.hypot(left, forward), np.hypot(right, forward), left, right]) / centre[:, None]
    rates = speed[:, None] * ways / wheel_radius(robot)
    steps = 0.5 * (rates[1:] + rates[:-1]) * np.diff(t)[:, None]
    return np.vstack([np.zeros((1, 4)), np.cumsum(steps, axis=0)])


def key_rows(values: ArrayLike, tolerance: float) -> NDArray[np.int64]:
    """Rows of `values` (n,) or (n, k) between which straight lines stay within `tolerance` of all the others.

    Always the first and the last; rows are equal steps apart.

    Derived: a line whose steps across are at least as long as its steps up is nowhere steeper than 45
    degrees, so a simplification that is off by e at right angles is off by at most sqrt(2) e upwards. Each
    column is simplified on its own (Douglas and Peucker), and all rows that one of them needs are kept.
    """
    table = np.asarray(values, dtype=float)
    table = table.reshape(len(table), -1)
    needed = {0, len(table) - 1}
    for column in table.T:
        across = np.arange(len(column)) * max(float(np.abs(np.diff(column)).max(initial=0.0)), tolerance)
        line = shapely.LineString(np.column_stack([across, column]))
        kept = shapely.simplify(line, tolerance / math.sqrt(2.0), preserve_topology=False)
        needed |= set(np.searchsorted(across, shapely.get_coordinates(kept)[:, 0]).tolist())
    return np.array(sorted(needed), dtype=np.int64)
