"""A braking zone along a motion: where it is, what comes near it, and which limit holds the motion there.

For pictures and words only; the verdict rests on the judge, which has formulas of its own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verify.report.series import Margin, distance_at
from vnav_drake.convex import ConvexPieces
from vnav_drake.plan import Trajectory
from vnav_drake.problem import Problem
from vnav_drake.world import World
from vnav_drake.zones.convex_zone import ConvexZone, GaugeZone
from vnav_drake.zones.field_set import FieldSet
from vnav_drake.zones.held_arc import PLAN_SHARE, arc_excess, side_room
from vnav_drake.zones.touch import separation

Array = NDArray[np.float64]

SAMPLES = 400  # instants, at even steps along the path
NEAR = 0.01  # of a limit: what is nearer than that is held by it
SLACK = 5e-3  # [m]: a zone that touches within what rows and their proofs leave
HALVINGS = 22  # of the search for the greatest speed: to a millionth of the highest one looked at
HIGHEST = 1.6  # of the motion's top speed: faster than that nothing is drawn

# What can hold a motion, the first that does is told: key and words. What limits the bend comes last: where
# the motion gains or loses speed as fast as it may, that is what holds its speed.
LIMITS = {
    "zone": "braking zone",
    "speed": "top speed",
    "drive": "drive",
    "brakes": "brakes",
    "reserve": "friction reserve",
    "friction": "friction",
    "tip": "tip-over",
    "arc": "held arc within the zone",
    "steering": "steering",
    "none": "none of them alone",
}
KEYS = tuple(LIMITS)


@dataclass(frozen=True, kw_only=True, eq=False)
class ZoneAlong:
    """The motion at instants along it, (n,) each."""

    zone: ConvexZone
    t: Array  # [s]
    s: Array  # [m]
    x: Array  # [m]
    y: Array  # [m]
    heading: Array  # [rad], of the motion
    v: Array  # [m/s]
    curvature: Array  # [1/m]
    gap: Array  # [m], from the zone to what is nearest; infinite where nothing is in reach
    fastest: Array  # [m/s], greatest safe speed at this pose, as far as `HIGHEST` looks
    limit: NDArray[np.int64]  # which of `KEYS` holds the motion

    def __len__(self) -> int:
        return len(self.t)

    def outline(self, i: int, points: int = 96) -> Array:
        """The zone (m, 2) [m] on the map at instant i."""
        return placed(
            self.zone.outline(float(self.v[i]), points),
            (float(self.x[i]), float(self.y[i])),
            float(self.heading[i]),
        )

    def moments(self, count: int) -> NDArray[np.int64]:
        """About `count` instants at even steps of time, both ends with them."""
        at = np.linspace(self.t[0], self.t[-1], count)
        return np.unique(np.clip(np.searchsorted(self.t, at), 0, len(self) - 1))

    def margin(self) -> Margin | None:
        """The zone's distance from obstacles as a margin to draw; None where nothing ever is in reach."""
        near = np.isfinite(self.gap)
        if np.count_nonzero(near) < 2:
            return None
        return Margin(
            key="braking", name="Braking zone", formula="distance of the zone from what is nearest", unit="m",
            t=self.t[near], value=self.gap[near], x=self.x[near], y=self.y[near],
        )  # fmt: skip


def placed(shape: Array, at: tuple[float, float], heading: float) -> Array:
    """A shape (m, 2) [m] of the body's frame on the map."""
    cos, sin = math.cos(heading), math.sin(heading)
    return np.asarray(shape @ np.array([[cos, sin], [-sin, cos]]) + np.array(at))


def zone_along(problem: Problem, zone: ConvexZone, motion: Trajectory, *, share: float = 1.0) -> ZoneAlong:
    """The zone at the middles of rows, `SAMPLES` of them at even steps along the path, and at both ends.

    `zone` is what the motion obeys: `problem.zone`, or the fields fitted to it. `share`: of grip, tip-over,
    steering and drive limits, what the motion was planned with.
    """
    lasting = np.flatnonzero(np.diff(motion.t) > 0.0)
    s = motion.arc_length
    middle = 0.5 * (s[lasting] + s[lasting + 1])
    wanted = np.linspace(0.0, s[-1], SAMPLES)
    row = lasting[np.unique(np.clip(np.searchsorted(middle, wanted), 0, len(lasting) - 1))]
    t = np.concatenate([motion.t[:1], 0.5 * (motion.t[row] + motion.t[row + 1]), motion.t[-1:]])
    x, y, heading, v, a, curvature = motion.at(t)
    a[1:-1], curvature[1:-1] = motion.a[row], motion.curvature[row]
    heading[0], heading[-1] = motion.heading[0], motion.heading[-1]
    pose = np.column_stack([x, y, heading])
    highest = HIGHEST * max(float(v.max()), 1e-3)
    reach = _reach(zone, highest)
    near = Nearby.of(problem.world, pose, reach)
    gap, fastest = near.gap(zone, v), _fastest(zone, near, v, highest)
    return ZoneAlong(
        zone=zone,
        t=t,
        s=distance_at(motion, t),
        x=x,
        y=y,
        heading=heading,
        v=v,
        curvature=curvature,
        gap=gap,
        fastest=fastest,
        limit=_limits(problem, zone, np.column_stack([v, a, curvature]), gap, fastest, share),
    )


@dataclass(frozen=True, eq=False)
class Nearby:
    """Convex pieces near poses, in the poses' frames: pair k is of pose `owner[k]`."""

    poses: int
    owner: NDArray[np.int64]  # (m,)
    corners: Array  # (m, k, 2) [m]

    @classmethod
    def of(cls, world: World, pose: Array, reach: float) -> Nearby:
        """Pieces within `reach` [m] of poses (n, 3): x, y [m], heading [rad]."""
        pieces = ConvexPieces.of(world)
        owner, piece = pieces.near(pose[:, :2], np.full(len(pose), reach))
        off = pieces.corners[piece] - pose[owner, None, :2]
        cos, sin = np.cos(pose[owner, 2])[:, None], np.sin(pose[owner, 2])[:, None]
        turned = [cos * off[..., 0] + sin * off[..., 1], cos * off[..., 1] - sin * off[..., 0]]
        return cls(len(pose), owner, np.stack(turned, axis=-1))

    def gap(self, zone: ConvexZone, speed: Array) -> Array:
        """Least distance (n,) [m] of the zone at speeds (n,) from any piece; infinite where there is none."""
        least = np.full(self.poses, math.inf)
        if len(self.owner):
            np.minimum.at(least, self.owner, separation(zone, self.corners, speed[self.owner]).gap)
        return least


def _reach(zone: ConvexZone, speed: float) -> float:
    even = np.linspace(-math.pi, math.pi, 72, endpoint=False)
    return 1.01 * float(zone.support(even, np.full(72, speed))[0].max())


def _fastest(zone: ConvexZone, near: Nearby, v: Array, highest: float) -> Array:
    """Greatest speed (n,) [m/s] up to `highest` at which the zone is free: it grows with the speed."""
    low, high = np.zeros(near.poses), np.full(near.poses, highest)
    if isinstance(zone, GaugeZone):
        low = np.where(near.gap(zone, v) >= 0.0, v, low)
    low = np.where(near.gap(zone, high) >= 0.0, high, low)
    for _ in range(HALVINGS):
        open_ = high - low > 1e-6 * highest
        if not open_.any():
            break
        middle = 0.5 * (low + high)
        free = near.gap(zone, middle) >= 0.0
        low, high = np.where(free, middle, low), np.where(free, high, middle)
    return low


def _limits(
    problem: Problem, zone: ConvexZone, rows: Array, gap: Array, fastest: Array, share: float
) -> NDArray[np.int64]:
    """Which of `KEYS` holds each row (n, 3) of speed, acceleration and curvature."""
    robot, (v, a, curvature) = problem.robot, rows.T
    turn, most = np.abs(curvature) * v * v, 1.0 - NEAR
    own = most * share
    moving = v > NEAR * max(float(v.max()), 1e-9)
    reserve = robot.reserved_lateral_acceleration() if problem.friction_reserve else math.inf
    held = {
        "zone": moving & ((gap <= SLACK) | (v >= most * fastest)),
        "speed": v >= most * zone.law.max_speed,
        "drive": a >= own * robot.max_acceleration,
        "brakes": a <= -own * robot.max_braking,
        "reserve": turn >= own * reserve,
        "friction": np.hypot(a, turn) >= own * robot.friction_acceleration,
        "tip": turn >= own * robot.tip_acceleration,
        "arc": moving & _at_arc(problem, zone, v, curvature),
        "steering": np.abs(curvature) >= own * robot.max_curvature,
        "none": np.ones(len(v), dtype=bool),
    }
    return np.asarray(np.argmax(np.stack([held[key] for key in KEYS]), axis=0))


def _at_arc(problem: Problem, zone: ConvexZone, v: Array, curvature: Array) -> NDArray[np.bool_]:
    """Whether the held arc under full braking just stays in the zone (docs/braking_zones.md)."""
    shape = gauge_of(zone)
    if not problem.friction_reserve or shape is None:
        return np.zeros(len(v), dtype=bool)
    far = shape.law.distance(v) - shape.law.margin
    excess, _ = arc_excess(shape, np.abs(curvature) * far / PLAN_SHARE)  # the rest is for the steering
    return np.asarray((far * excess >= side_room(shape) - SLACK) & (np.abs(curvature) * far > NEAR))


def gauge_of(zone: ConvexZone) -> GaugeZone | None:
    """The zone that grows with the stopping distance, for fields the one they stand for; None without one."""
    found = zone.base if isinstance(zone, FieldSet) else zone
    return found if isinstance(found, GaugeZone) else None


def held_arc_length(problem: Problem, v: float, curvature: float) -> float:
    """Length [m] of a stop with steering held from speed v [m/s]: turning and braking share the friction.

    Derived: with z = v^2 and k = |kappa| the brakes give min(a_b, sqrt((mu g)^2 - k^2 z^2)), and ds = -dz / 2
    over that. Above k z = r = sqrt((mu g)^2 - a_b^2) the integral is (asin(k z/mu g) - asin(r/mu g)) / (2 k),
    below it is the rest of z over 2 a_b; before it, v t_r at constant speed.
    """
    grip, a_b = problem.robot.friction_acceleration, problem.braking.max_braking
    way, k, z = v * problem.braking.reaction_time, abs(curvature), v * v
    spared = math.sqrt(max(grip * grip - a_b * a_b, 0.0))
    if k * z > spared:
        way += (math.asin(min(k * z / grip, 1.0)) - math.asin(min(spared / grip, 1.0))) / (2.0 * k)
        z = spared / k
    return way + z / (2.0 * a_b)


def arc_points(length: float, curvature: float, points: int = 40) -> Array:
    """An arc (points, 2) [m] that begins at the origin, straight ahead."""
    s = np.linspace(0.0, length, points)
    half = 0.5 * curvature * s
    chord = s * np.sinc(half / math.pi)
    return np.column_stack([chord * np.cos(half), chord * np.sin(half)])
