"""Which arcs and speeds a robot may choose next: the dynamic window, and what is admissible in it.

A choice is a circular arc and a speed at the end of the window. The robot changes its speed evenly
until then and could brake to a standstill afterwards, on the same arc. The choice is admissible when
the whole motion, the stop included, obeys the robot's limits and the braking condition in continuous
time. So whoever follows an admissible choice can always stop safely on the arc he is on.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vnav_drake.plan import arc_step
from vnav_drake.problem import Problem
from vnav_drake.robot import Robot
from vnav_drake.speed_profile import row_sag

Array = NDArray[np.float64]

ARC_NODES = 49  # of each arc where its clearance is taken; the bound between them is second order
ROUNDING = 1e-9  # relative, kept from the limits of friction and steering; the checks allow 1e-6
CONTACT = 1e-3  # [m]: clearance at which an arc counts as blocked
LOOK_STEPS = 200  # shortest step along an arc that looks for contact: this part of the whole look


@dataclass(frozen=True)
class Arcs:
    """Circular arcs from one place."""

    place: Array  # (2,) [m]
    heading: Array  # (k,) [rad], at the place
    curvature: Array  # (k,) [1/m], left turns positive

    def at(self, s: Array) -> tuple[Array, Array]:
        """Points (..., k, 2) [m] and headings (..., k) [rad] at arc lengths (..., k) [m]."""
        dx, dy = arc_step(self.heading, self.curvature, s)
        return self.place + np.stack([dx, dy], axis=-1), self.heading + self.curvature * s

    def take(self, rows: NDArray[np.int64]) -> Arcs:
        """Some of the arcs."""
        return Arcs(self.place, self.heading[rows], self.curvature[rows])


@dataclass(frozen=True)
class Choices:
    """Speeds at the end of the window for each of k arcs, and the motions that they stand for."""

    arcs: Arcs
    speed: Array  # (n, k) [m/s], at the end of the window
    moving: Array  # (n, k) [m], travelled within the window
    stopping: Array  # (n, k) [m], from there to a standstill
    admissible: NDArray[np.bool_]  # (n, k)


def greatest_deceleration(problem: Problem, speed: Array | float, curvature: Array | float) -> Array:
    """Deceleration [m/s^2] that brakes and friction allow from `speed` [m/s] on, in a turn [1/m].

    sqrt((mu g)^2 - (v^2 kappa)^2), at most a_b: the friction circle is tightest where the robot is
    fastest, so this may be kept up until it stands. Zero where the turn takes all the friction.
    """
    robot = problem.robot
    turn = np.square(speed) * np.asarray(curvature, dtype=float)
    left = (1.0 - ROUNDING) * robot.friction_acceleration**2 - np.square(turn)
    return np.minimum(robot.max_braking, np.sqrt(np.maximum(left, 0.0)))


def window_speeds(problem: Problem, place: Array, speed: float, window: float, count: int) -> Array:
    """`count` speeds [m/s] that the drive can reach within `window` [s], ascending, evenly spaced.

    The upper end is also bounded by what no arc can exceed: clearance grows by at most the length
    travelled, so v^2 / (2 a_b) + m <= d + (v_0 + v) window / 2.
    """
    robot, braking = problem.robot, problem.braking
    low = max(0.0, speed - robot.max_braking * window)
    room = float(problem.clearance(place)) - braking.margin + 0.5 * speed * window
    lag = 0.5 * braking.max_braking * window
    most = lag + math.sqrt(lag * lag + 2.0 * braking.max_braking * max(room, 0.0))
    high = min(speed + robot.max_acceleration * window, most, braking.max_speed)
    return np.linspace(low, max(low, high), count)


def curvature_window(robot: Robot, curvature: float | None, time: float) -> tuple[float, float]:
    """Least and greatest curvature [1/m] that the steering reaches from `curvature` within `time` [s].

    With None, the wheels may stand anywhere.
    """
    most = robot.max_curvature * (1.0 - ROUNDING)
    if curvature is None or math.isinf(robot.max_steering_rate):
        return -most, most
    angle = robot.steering_angle(curvature)
    turn = robot.max_steering_rate * time * (1.0 - ROUNDING)
    low, high = (_curvature(robot, angle + side * turn) for side in (-1.0, 1.0))
    return max(low, -most), min(high, most)


def _curvature(robot: Robot, angle: float) -> float:
    """Curvature [1/m] at a steering angle [rad]: inverse of `Robot.steering_angle`."""
    limited = min(max(angle, -robot.max_steering), robot.max_steering)
    return 2.0 * math.sin(math.atan(0.5 * math.tan(limited))) / robot.wheelbase


def choices(problem: Problem, arcs: Arcs, speed: float, speeds: Array, window: float) -> Choices:
    """Judge every pair of an arc (k) and a speed (n,) at the end of the window.

    Parameters
    ----------
    speed : [m/s], now.
    speeds : (n,) [m/s], ascending, reachable by the drive.

    Notes
    -----
    Admissible in the sense of Fox, Burgard and Thrun 1997 (their set V_a): the robot can stop along the
    arc before it collides. Also (braking safety, as in Brock and Khatib 1999; Manor 2015, eq. (3.13))
    `v t_r + v^2/(2 a_b) + m <= d` at every instant of the motion until then. Along an arc v^2 is linear in
    the length before the end of the window and after it. Clearance is at least its chord between two
    nodes less `row_sag`, so the condition holds between nodes when it holds at nodes, at the end of the
    window and at the end of the stop, with clearances lowered by that sag (and by the bulge of
    v t_r above its chord).
    """
    after = speeds[:, None]
    bend = arcs.curvature
    rate = (after - speed) / window
    fastest = np.maximum(after, speed)
    turn = np.square(fastest) * np.abs(bend)
    grip = problem.robot.friction_acceleration * (1.0 - ROUNDING)
    braking = greatest_deceleration(problem, after, bend)
    allowed = (turn <= problem.lateral_limit * (1.0 - ROUNDING)) & (np.hypot(rate, turn) <= grip)
    allowed &= (fastest > 0.0) & ((braking > 0.0) | (after == 0.0))
    moving = np.broadcast_to(0.5 * (speed + after) * window, allowed.shape)
    stopping = np.where(
        allowed & (after > 0.0), np.square(after) / (2.0 * np.where(allowed, braking, 1.0)), 0.0
    )
    total = moving + stopping
    reach = np.max(np.where(allowed, total, 0.0), axis=0)
    some = np.flatnonzero(reach > 0.0)
    safe = np.zeros_like(allowed)
    if len(some) > 0:
        room = _room(problem, arcs.take(some), reach[some])
        part = np.ix_(np.arange(len(speeds)), some)
        safe[part] = _safe(
            problem,
            room,
            reach[some],
            speed,
            np.broadcast_to(after, allowed.shape)[part],
            moving[part],
            total[part],
            rate,
            braking[part],
        )
    return Choices(arcs, np.broadcast_to(after, allowed.shape), moving, stopping, allowed & safe)


def _room(problem: Problem, arcs: Arcs, reach: Array) -> Array:
    """Values (m + 1, k) [m] at evenly spaced nodes whose chords lie below the clearance of k arcs."""
    s = np.linspace(0.0, 1.0, ARC_NODES)[:, None] * reach
    distance = problem.world.distance(arcs.at(s)[0])
    sag = row_sag(distance, np.diff(s, axis=0), arcs.curvature)
    lost = np.zeros_like(distance)
    lost[:-1] = sag
    lost[1:] = np.maximum(lost[1:], sag)
    passable = np.isfinite(lost)
    return np.where(passable, distance - problem.robot.radius - np.where(passable, lost, 0.0), -1.0)


def _safe(
    problem: Problem,
    room: Array,
    reach: Array,
    speed: float,
    after: Array,
    moving: Array,
    total: Array,
    rate: Array,
    deceleration: Array,
) -> NDArray[np.bool_]:
    """Whether the braking condition holds along each motion (n, k); `room` (m + 1, k) on its arc."""
    law = problem.braking
    spacing = reach / (len(room) - 1)
    s = (np.arange(len(room))[:, None] * spacing)[:, None, :]  # (m + 1, 1, k)
    square = np.where(
        s < moving, speed * speed + 2.0 * rate * s, np.square(after) - 2.0 * deceleration * (s - moving)
    )
    v = np.sqrt(np.maximum(square, 0.0))
    left = np.broadcast_to(room[:, None, :], v.shape)
    if law.reaction_time > 0.0:
        left = left - law.reaction_time * _bulge(v, after, s, moving)
    # The node before the first one beyond the end still counts; the end itself is taken below.
    holds = np.all((left >= law.distance(v)) | (s > total), axis=0)
    for along, there in ((moving, after), (total, np.zeros_like(after))):
        node = np.clip((along / spacing).astype(np.int64), 0, len(room) - 2)
        share = np.clip(along / spacing - node, 0.0, 1.0)
        before = np.take_along_axis(left, node[None], axis=0)[0]
        beyond = np.take_along_axis(left, node[None] + 1, axis=0)[0]
        holds &= before + share * (beyond - before) >= law.distance(there)
    return np.asarray(holds)


def _bulge(v: Array, after: Array, s: Array, moving: Array) -> Array:
    """How far [m/s] the speed may exceed its chord on the intervals next to each node.

    sqrt lies above its chord between p and q by at most (q - p)^2/(4 (p + q)), which grows with the
    interval.
    """
    turning = (s[:-1] <= moving) & (moving <= s[1:])
    high = np.maximum(np.maximum(v[1:], v[:-1]), np.where(turning, after, 0.0))
    low = np.minimum(v[1:], v[:-1])
    total = high + low
    excess = np.divide(np.square(high - low), 4.0 * total, out=np.zeros_like(total), where=total > 0.0)
    out = np.zeros_like(v)
    out[:-1] = excess
    out[1:] = np.maximum(out[1:], excess)
    return out


def free_length(problem: Problem, arcs: Arcs, look: float) -> Array:
    """How far [m] each of k arcs runs before it comes to contact (or into the margin), at most `look`.

    Steps as long as the clearance cannot meet an obstacle, because distance is 1-Lipschitz; steps are at
    least look / LOOK_STEPS. Where such a step comes out too near, contact is taken on the chord of the
    clearance.
    """
    s = np.zeros(len(arcs.curvature))
    active, step, before = np.arange(len(s)), np.zeros(len(s)), np.full(len(s), math.inf)
    while len(active) > 0:
        points = arcs.take(active).at(s[active])[0]
        room = problem.clearance(points) - problem.braking.margin
        near = room <= CONTACT
        over = np.clip((CONTACT - room[near]) / (before[near] - room[near]), 0.0, 1.0)
        s[active[near]] -= over * step[near]
        active, before = active[~near], room[~near]
        step = np.maximum(before, look / LOOK_STEPS)
        s[active] += step
        kept = s[active] < look
        active, step, before = active[kept], step[kept], before[kept]
    return np.minimum(s, look)
