"""Stretches of a smooth path too tight for the wheels, driven around by circles of the least radius.

A circle for each corner alone is not enough where two corners to different sides share a short piece of road,
or a node lies so near to an end that the road has no room: there the stretch as a whole is replaced by turn,
straight, turn (Dubins 1957), tangent to the path at both ends, wherever one that is free passes obstacles on
the same side as the path does.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
import shapely
from numpy.typing import NDArray

from vnav_drake.plan import Path
from vnav_drake.problem import Problem
from vnav_drake.vc_method.fillets import arc_points, least_distance

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]

TOO_TIGHT = 1e-9  # relative: a curvature this much beyond the greatest is beyond it
EASE = 1.0 + 1e-9  # turning radius over the least one
REACH = 5.0  # turning radii before and behind a stretch where it may be left and met
PLACES = 20  # tried on either side
HEADINGS = 36  # tried at an end without one
ROUGH = 8  # every so manyth sample is looked at first
TRIED = 100  # of the quickest free ones: looked at for obstacles between them and the path
SPACING = 0.02  # [m] between samples of the time along the path
SNAP = 1e-6  # [m]: a place this near to a joint of the path is the joint
NOTHING = 1e-12  # [m]: a part shorter than this is left out, the gap it leaves is rounding
FULL_TURN = 1e-9  # [rad]: a turn that lacks no more than this of a full one is none
SIDES = tuple(product((1.0, -1.0), repeat=2))


@dataclass(frozen=True)
class Poses:
    """Where the path may be left or met."""

    s: Array  # (n,) [m], arc length on the path
    point: Array  # (n, 2) [m]
    heading: Array  # (n,) [rad]

    def take(self, index: Indices) -> Poses:
        return Poses(self.s[index], self.point[index], self.heading[index])


@dataclass(frozen=True)
class Detours:
    """Turn, straight, turn between poses."""

    leave: Poses
    meet: Poses
    curvature: Array  # (n, 3) [1/m]
    length: Array  # (n, 3) [m]

    def take(self, index: Indices | Mask) -> Detours:
        rows = np.arange(len(self.length))[index]
        return Detours(self.leave.take(rows), self.meet.take(rows), self.curvature[rows], self.length[rows])

    def points(self) -> Array:
        """(n, 3, k, 2) [m], evenly along each part."""
        point, heading, parts = self.leave.point, self.leave.heading, []
        for k in range(3):
            along = arc_points(point, heading, self.curvature[:, k], self.length[:, k])
            parts.append(along)
            point, heading = along[:, -1], heading + self.curvature[:, k] * self.length[:, k]
        return np.stack(parts, axis=1)


def turn_straight_turn(leave: Poses, meet: Poses, radius: float) -> Detours:
    """All four ways of turning by less than half a turn at either end, where they exist.

    A part is longer than `SNAP` or shorter than `NOTHING`. A way with one in between is left out: the path
    would not close without that part, and with it would have a piece too short to drive along.

    Notes
    -----
    Derived: circles of radius R on the sides a, b (1 left, -1 right) have centres c + a R n and c' + b R n'.
    With D between them, the straight part S of heading psi has D = S t(psi) - (a - b) R n(psi): for a = b it
    is D itself, else S^2 = |D|^2 - 4 R^2 and psi = arg D + atan2(2 a R, S).
    """
    parts = []
    for a, b in SIDES:
        p = leave.point + a * radius * _normal(leave.heading)
        q = meet.point + b * radius * _normal(meet.heading)
        way = q - p
        square = np.einsum("ij,ij->i", way, way) - ((a - b) * radius) ** 2
        straight = np.sqrt(np.maximum(square, 0.0))
        psi = np.arctan2(way[:, 1], way[:, 0]) + np.arctan2((a - b) * radius, straight)
        first, last = _turn(a * (psi - leave.heading)), _turn(b * (meet.heading - psi))
        length = np.column_stack([radius * first, straight, radius * last])
        sliver = np.any((length > NOTHING) & (length < SNAP), axis=1)
        rows = np.flatnonzero((square >= 0.0) & (first <= np.pi) & (last <= np.pi) & ~sliver)
        parts.append(
            Detours(
                leave.take(rows),
                meet.take(rows),
                np.tile([a / radius, 0.0, b / radius], (len(rows), 1)),
                length[rows],
            )
        )
    leave, meet = (_joined([getattr(d, end) for d in parts]) for end in ("leave", "meet"))
    return Detours(
        leave,
        meet,
        np.concatenate([d.curvature for d in parts]),
        np.concatenate([d.length for d in parts]),
    )


def _joined(parts: list[Poses]) -> Poses:
    return Poses(
        np.concatenate([p.s for p in parts]),
        np.concatenate([p.point for p in parts]),
        np.concatenate([p.heading for p in parts]),
    )


def widened(problem: Problem, path: Path, owner: Indices) -> tuple[Path, Indices, Mask]:
    """The path with stretches that the wheels cannot follow replaced, as many as free space lets be.

    Parameters
    ----------
    owner : (n,) corner of each piece, -1 on the road, in ascending order.

    Returns
    -------
    The path, its owners (a replaced stretch has that of its first corner), and which pieces are new.
    """
    bend = np.abs(path.curvature)
    tight = np.flatnonzero(bend > problem.robot.max_curvature * (1.0 + TOO_TIGHT))
    new = np.zeros(len(bend), dtype=bool)
    if len(tight) == 0:
        return path, owner, new
    radius = EASE / problem.robot.max_curvature
    ends = np.concatenate([[0.0], np.cumsum(path.piece_length)])
    begin, end = ends[tight], ends[tight + 1]
    groups = np.split(np.arange(len(tight)), np.flatnonzero(begin[1:] > end[:-1] + radius) + 1)
    chosen: list[tuple[int, Detours]] = []  # and the owner
    waiting = [(float(begin[g[0]]), float(end[g[-1]]), int(owner[tight[g[0]]])) for g in groups]
    low = 0.0
    while waiting:
        first, last, name = waiting.pop(0)
        high = waiting[0][0] if waiting else path.length
        found = _quickest(problem, path, (low, first, last, high), radius)
        if found is not None:
            chosen.append((name, found))
            low = float(found.meet.s[0])
        elif waiting and waiting[0][0] - last < 2.0 * REACH * radius:
            waiting[0] = (first, waiting[0][1], name)  # both at once
        else:
            low = last
    for name, detour in reversed(chosen):
        path, owner, new = _spliced(path, owner, new, name, detour)
    return path, owner, new


def _quickest(
    problem: Problem, path: Path, marks: tuple[float, float, float, float], radius: float
) -> Detours | None:
    """The quickest free way round the stretch between the middle two of four marks, within the outer two."""
    low, first, last, high = marks  # [m]
    low, high = max(low, first - REACH * radius), min(high, last + REACH * radius)
    leave = _poses(path, np.linspace(low, first, PLACES))
    meet = _poses(path, np.linspace(last, high, PLACES))
    if low <= SNAP and problem.start.heading is None:
        leave = _turned(leave, path, 0.0)
    if high >= path.length - SNAP and problem.goal.heading is None:
        meet = _turned(meet, path, path.length)
    i, j = (k.reshape(-1) for k in np.indices((len(leave.s), len(meet.s))))
    ways = turn_straight_turn(leave.take(i), meet.take(j), radius)
    ways = ways.take(ways.length.sum(axis=1) <= 2.0 * (ways.meet.s - ways.leave.s) + np.pi * radius)
    points, level = ways.points(), problem.robot.radius + problem.braking.margin
    free = np.flatnonzero(problem.world.distance(points[:, :, ::ROUGH]).min(axis=(1, 2)) >= level)
    ways, points = ways.take(free), points[free]
    distance = problem.world.distance(points)
    part = distance.reshape(-1, distance.shape[-1])
    least = least_distance(part, np.abs(ways.curvature).reshape(-1), ways.length.reshape(-1))
    least = least.reshape(-1, 3).min(axis=1)
    free = np.flatnonzero((least >= level) & (least > 0.0))
    ways, points, distance = ways.take(free), points[free], distance[free]
    time = _time_along(problem, ways, distance) - _time_saved(problem, path, ways, low, high)
    for k in np.argsort(time, kind="stable")[:TRIED]:
        way = ways.take(np.array([k]))
        if _same_side(problem, path, way, points[k]):
            return way
    return None


def _poses(path: Path, s: Array) -> Poses:
    joints = np.concatenate([[0.0], np.cumsum(path.piece_length)])
    near = joints[np.argmin(np.abs(joints[:, None] - s), axis=0)]
    s = np.unique(np.where(np.abs(near - s) <= SNAP, near, s))
    x, y, heading, _ = path.at(s)
    return Poses(s, np.column_stack([x, y]), heading)


def _turned(poses: Poses, path: Path, s: float) -> Poses:
    """With all headings at an end of the path that has none."""
    x, y, _, _ = path.at(s)
    count = np.full(HEADINGS, 1.0)
    turn = np.linspace(0.0, 2.0 * np.pi, HEADINGS, endpoint=False)
    return Poses(
        np.concatenate([poses.s, s * count]),
        np.concatenate([poses.point, np.column_stack([x * count, y * count])]),
        np.concatenate([poses.heading, turn]),
    )


def _time_along(problem: Problem, ways: Detours, distance: Array) -> Array:
    """(n,) [s] at the greatest speeds that clearance and turning allow, by trapezoids."""
    speed = problem.braking.speed(distance - problem.robot.radius)
    turning = np.where(ways.curvature == 0.0, np.inf, problem.lateral_limit * _inverse(ways.curvature))
    speed = np.maximum(np.minimum(speed, np.sqrt(turning)[..., None]), 1e-9)
    return np.asarray((ways.length * np.trapezoid(1.0 / speed, axis=-1)).sum(axis=1) / (speed.shape[-1] - 1))


def _inverse(curvature: Array) -> Array:
    return np.asarray(1.0 / np.where(curvature == 0.0, 1.0, np.abs(curvature)))


def _time_saved(problem: Problem, path: Path, ways: Detours, low: float, high: float) -> Array:
    """(n,) [s] along the stretches of the path that each way replaces."""
    s = np.linspace(low, high, 2 + int((high - low) / SPACING))
    x, y, _, bend = path.at(s)
    speed = problem.safe_speed(np.column_stack([x, y]))
    turning = np.where(bend == 0.0, np.inf, problem.lateral_limit * _inverse(bend))
    slow = 1.0 / np.maximum(np.minimum(speed, np.sqrt(turning)), 1e-9)
    time = np.concatenate([[0.0], np.cumsum(0.5 * (slow[1:] + slow[:-1]) * np.diff(s))])
    return np.asarray(np.interp(ways.meet.s, s, time) - np.interp(ways.leave.s, s, time))


def _same_side(problem: Problem, path: Path, way: Detours, points: Array) -> bool:
    """Whether no obstacle lies between a way and the stretch that it replaces."""
    s = np.linspace(way.meet.s[0], way.leave.s[0], 2 + int((way.meet.s[0] - way.leave.s[0]) / SPACING))
    x, y, _, _ = path.at(s)
    ring = np.concatenate([points.reshape(-1, 2), np.column_stack([x, y])])
    between = shapely.make_valid(shapely.Polygon(ring))
    return len(problem.world.edge_tree.query(between, predicate="intersects")) == 0


def _spliced(path: Path, owner: Indices, new: Mask, name: int, way: Detours) -> tuple[Path, Indices, Mask]:
    """The path with the stretch that a way replaces taken out, and the way put in."""
    leave, meet = float(way.leave.s[0]), float(way.meet.s[0])
    ends = np.concatenate([[0.0], np.cumsum(path.piece_length)])
    before = np.flatnonzero(ends[:-1] < leave - SNAP / 2)
    behind = np.flatnonzero(ends[1:] > meet + SNAP / 2)
    own = np.flatnonzero(way.length[0] > NOTHING)
    length_before = np.minimum(ends[before + 1], leave) - ends[before]
    first = np.maximum(ends[behind], meet)
    x, y, heading_behind, _ = path.at(first)
    heading_behind = np.where(first == ends[behind], path.heading[behind], heading_behind)
    at_joint = first == ends[behind]
    x, y = np.where(at_joint, path.x[behind], x), np.where(at_joint, path.y[behind], y)
    heading_own = way.leave.heading[0] + np.concatenate([[0.0], np.cumsum(way.curvature[0] * way.length[0])])
    point_own = way.points()[0, own, 0]
    heading = np.concatenate([path.heading[before], heading_own[own], heading_behind])
    bend = np.concatenate([path.curvature[before], way.curvature[0, own], path.curvature[behind]])
    length = np.concatenate([length_before, way.length[0, own], ends[behind + 1] - first])
    jump = heading[1:] - (heading + bend * length)[:-1]
    turns = np.concatenate([[0.0], np.cumsum(np.rint(jump / (2.0 * np.pi)))])
    return (
        Path(
            np.concatenate([path.x[before], point_own[:, 0], x, path.x[-1:]]),
            np.concatenate([path.y[before], point_own[:, 1], y, path.y[-1:]]),
            heading - 2.0 * np.pi * turns,
            bend,
            length,
        ),
        np.concatenate([owner[before], np.full(len(own), name), owner[behind]]),
        np.concatenate([new[before], np.ones(len(own), dtype=bool), new[behind]]),
    )


def _normal(heading: Array) -> Array:
    return np.column_stack([-np.sin(heading), np.cos(heading)])


def _turn(angle: Array) -> Array:
    """From 0 to a full turn, which itself counts as none."""
    wrapped = angle % (2.0 * np.pi)
    return np.where(2.0 * np.pi - wrapped < FULL_TURN, 0.0, wrapped)
