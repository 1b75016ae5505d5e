"""How fast a robot may be along short arcs so that its zone touches nothing at any instant.

Along an arc of length l and curvature kappa the heading and, with constant acceleration, v^2 are linear in
the way s. For a fixed direction n of the world, and an obstacle with corners p_k,

    phi(s) = min over k of n.(p_k - q(s)) - h_body(n - theta(s)) - D(s) h_E(n - theta(s))

is a lower bound of the gap between zone and obstacle (weak duality, see `touch`). D = v t_r + v^2/(2 a_b)
lies above its chord by at most b = t_r (v_1 - v_0)^2 / (4 (v_0 + v_1)). Derived: a support function has
h + h'' >= 0 (at kinks as a measure), and |h|, |h'| are at most the radius R of the set, so without b

    phi'' <= c = |kappa| + kappa^2 (R_body + R D) + 2 |kappa| R |D'|      (R_body = 0 for a disc: h'' = 0),

hence phi(s) >= chord of its end values - c l^2 / 8 - R b. So both ends and this term prove the whole row.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from vnav_drake.convex import ConvexPieces
from vnav_drake.plan import Path
from vnav_drake.problem import Problem
from vnav_drake.zones.convex_zone import ConvexZone, GaugeZone
from vnav_drake.zones.held_arc import PLAN_SHARE, TurnLimit
from vnav_drake.zones.touch import into_body, separation, stopping_room

Array = NDArray[np.float64]
Index = NDArray[np.int64]

SPEED_STEPS = 34  # halvings of the speed for zones of which only the support function is known


class RowLimits(Protocol):
    """What the speed profile asks of a zone."""

    def speed(self, needed: Array) -> Array:
        """Greatest speed (n + 1,) [m/s] at the ends of the rows with `needed` (n + 1,) [m] to spare there."""

    def lacking(self, square: Array) -> Array:
        """How much [m] each row (n,) lacks when v^2 at its ends is `square` (n + 1,); zero or less: safe."""


def row_limits(problem: Problem, zone: ConvexZone, rows: Path) -> RowLimits:
    """The limits of a zone along the pieces of a path."""
    if isinstance(zone, GaugeZone):
        return GaugeRows.of(problem, zone, rows)
    return SteppedRows.of(problem, zone, rows)


def held_arc_limit(problem: Problem) -> TurnLimit | None:
    """What a plan's turns are held to, where friction is in reserve and the zone does not hold every arc."""
    if not problem.friction_reserve or not isinstance(problem.zone, GaugeZone):
        return None
    return TurnLimit.of(problem.zone, PLAN_SHARE)


@dataclass(frozen=True)
class _Poses:
    """Both ends of each row: (n, 2) of x, y, heading, with that of a kink on its own side."""

    x: Array
    y: Array
    heading: Array

    @classmethod
    def of(cls, rows: Path) -> _Poses:
        x = np.stack([rows.x[:-1], rows.x[1:]], axis=1)
        y = np.stack([rows.y[:-1], rows.y[1:]], axis=1)
        return cls(x, y, np.stack([rows.heading, rows.end_heading], axis=1))

    def corners(self, corners: Array, row: Index, end: int) -> Array:
        """Corners (m, k, 2) of pieces, one a row in `row` (m,), in the frame of the body at that end."""
        return into_body(corners, self.x[row, end], self.y[row, end], self.heading[row, end])


@dataclass(frozen=True)
class GaugeRows:
    """Rows with the pieces that can matter to them, and a direction that shows how far each is away."""

    zone: GaugeZone
    length: Array  # (n,) [m] of the rows
    curvature: Array  # (n,) [1/m]
    row: Index  # (m,), of the pairs of row and piece
    free: Array  # (m, 2) [m], n.p - h_body at both ends of the row
    shape: Array  # (m, 2), h_E there
    furthest: float  # [m]: no stopping distance is longer
    body: float  # radius [m] of the zone at standstill, where it is no disc; else 0

    @classmethod
    def of(cls, problem: Problem, zone: GaugeZone, rows: Path) -> GaugeRows:
        """Pairs are left out only where the piece is too far away for any speed that the rest allow."""
        poses, pieces = _Poses.of(rows), ConvexPieces.of(problem.world)
        angle = np.linspace(-math.pi, math.pi, 361)
        reach = zone.body(angle)[0]
        round_body = float(np.ptp(reach)) == 0.0
        radius = float(reach.max()) / math.cos(math.pi / 360.0)
        furthest = _furthest(problem, zone)
        middle = np.stack([poses.x.mean(axis=1), poses.y.mean(axis=1)], axis=1)
        away = _box_distance(pieces, middle) - 0.5 * rows.piece_length[:, None]
        least = np.maximum(away - radius, 0.0) / zone.extent  # stopping distance that could just reach it
        parts: list[tuple[Index, Array, Array]] = []
        done = np.zeros(least.shape, dtype=bool)
        bound = np.full(len(middle), 0.0)
        wanted = least <= least.min(axis=1)[:, None]  # the nearest first
        while np.any(wanted):
            row, piece = np.nonzero(wanted)
            parts.append((row, *_pairs(zone, poses, pieces.corners[piece], row)))
            done |= wanted
            bound = np.full(len(middle), furthest)
            for of, free, shape in parts:
                np.minimum.at(bound, of, _room(free, shape).max(axis=1))
            wanted = (least <= bound[:, None]) & ~done
        row = np.concatenate([part[0] for part in parts])
        free, shape = (np.concatenate([part[i] for part in parts]) for i in (1, 2))
        return cls(
            zone, rows.piece_length, rows.curvature, row, free, shape, furthest, 0.0 if round_body else radius
        )

    def speed(self, needed: Array) -> Array:
        room = np.full(len(needed), self.furthest)
        for end in (0, 1):
            node = self.row + end
            np.minimum.at(room, node, _room(self.free[:, end] - needed[node], self.shape[:, end]))
        law = self.zone.law
        return law.speed(room + law.margin)

    def lacking(self, square: Array) -> Array:
        law, zone = self.zone.law, self.zone
        v = np.sqrt(square)
        far = law.distance(v) - law.margin
        spare = np.full(len(self.length), math.inf)
        gap = np.minimum(
            self.free[:, 0] - far[self.row] * self.shape[:, 0],
            self.free[:, 1] - far[self.row + 1] * self.shape[:, 1],
        )
        np.minimum.at(spare, self.row, gap)
        total = v[1:] + v[:-1]
        bulge = law.reaction_time * np.diff(v) ** 2 / (4.0 * np.where(total > 0.0, total, 1.0))
        bend, most = np.abs(self.curvature), np.maximum(far[1:], far[:-1]) + bulge
        steady = bend + bend**2 * (self.body + zone.extent * most)
        turning = 2.0 * bend * zone.extent * np.abs(np.diff(far)) * self.length
        return np.asarray((steady * self.length**2 + turning) / 8.0 + zone.extent * bulge - spare)


@dataclass(frozen=True)
class SteppedRows:
    """Rows of a zone of which only the support function is known: one speed for all of a row."""

    row_speed: Array  # (n,) [m/s]

    @classmethod
    def of(cls, problem: Problem, zone: ConvexZone, rows: Path) -> SteppedRows:
        """The greatest speed whose zone is free at all of the row; what is slower needs less.

        At a fixed speed the support function h of the zone takes the place of h_body + D h_E.
        """
        poses, pieces = _Poses.of(rows), ConvexPieces.of(problem.world)
        fastest = float(zone.law.speed(_furthest(problem, zone) + zone.law.margin))
        angle = np.linspace(-math.pi, math.pi, 361)
        reach = float(zone.support(angle, np.full(361, fastest))[0].max()) / math.cos(math.pi / 360.0)
        middle = np.stack([poses.x.mean(axis=1), poses.y.mean(axis=1)], axis=1)
        away = _box_distance(pieces, middle) - 0.5 * rows.piece_length[:, None]
        row, piece = np.nonzero(away <= reach)
        corners = pieces.corners[piece]
        ends = [poses.corners(corners, row, end) for end in (0, 1)]
        turn = poses.heading[row, 1] - poses.heading[row, 0]
        bend = np.abs(rows.curvature)
        sag = (bend + bend**2 * reach) * rows.piece_length**2 / 8.0

        def free(speed: Array) -> NDArray[np.bool_]:
            touch = separation(zone, ends[0], speed[row])
            # the same direction of the world at the other end
            other = touch.angle - turn
            along = np.stack([np.cos(other), np.sin(other)], axis=1)
            gap = np.einsum("nkj,nj->nk", ends[1], along).min(axis=1) - zone.support(other, speed[row])[0]
            fits = np.minimum(touch.gap, gap) >= sag[row]
            good = np.ones(len(speed), dtype=bool)
            np.logical_and.at(good, row, fits)
            return good

        low, high = np.zeros(len(middle)), np.full(len(middle), fastest)
        low = np.where(free(high), high, low)
        if len(zone.steps):
            for speed in np.sort(zone.steps):
                low = np.where(free(np.full(len(middle), speed)), np.maximum(low, speed), low)
            return cls(np.where(free(low), low, 0.0))
        for _ in range(SPEED_STEPS):
            middle_speed = 0.5 * (low + high)
            good = free(middle_speed)
            low, high = np.where(good, middle_speed, low), np.where(good, high, middle_speed)
        return cls(low)

    def speed(self, needed: Array) -> Array:
        padded = np.concatenate([[math.inf], self.row_speed, [math.inf]])
        return np.minimum(padded[1:], padded[:-1])

    def lacking(self, square: Array) -> Array:
        v = np.sqrt(square)
        safe = np.maximum(v[1:], v[:-1]) <= self.row_speed * (1.0 + 1e-12)
        return np.where(safe, 0.0, math.inf)


def _furthest(problem: Problem, zone: ConvexZone) -> float:
    """A stopping distance [m] that no robot in this world has or needs."""
    law = zone.law
    world = 2.0 * problem.world.diameter
    return min(world, float(law.distance(law.max_speed)) - law.margin) if law.max_speed < math.inf else world


def _box_distance(pieces: ConvexPieces, points: Array) -> Array:
    """Distance (n, p) [m] from points (n, 2) to the boxes around the pieces."""
    low, high = pieces.bounds[:, :2], pieces.bounds[:, 2:]
    outside = np.maximum(np.maximum(low[None] - points[:, None], points[:, None] - high[None]), 0.0)
    return np.asarray(np.hypot(outside[..., 0], outside[..., 1]))


def _pairs(zone: GaugeZone, poses: _Poses, corners: Array, row: Index) -> tuple[Array, Array]:
    """n.p - h_body and h_E at both ends of rows (m,), in the direction that allows the most at both."""
    turn = poses.heading[row, 1] - poses.heading[row, 0]
    ends = [poses.corners(corners, row, end) for end in (0, 1)]
    _, angle = stopping_room(zone, ends[0])
    _, other = stopping_room(zone, ends[1])
    options = []
    for first in (angle, other + turn):
        free, shape = [], []
        for corner, at in zip(ends, (first, first - turn), strict=True):
            along = np.stack([np.cos(at), np.sin(at)], axis=1)
            free.append(np.einsum("nkj,nj->nk", corner, along).min(axis=1) - zone.body(at)[0])
            shape.append(np.maximum(zone.shape(at)[0], 0.0))
        options.append((np.stack(free, axis=1), np.stack(shape, axis=1)))
    least = [_room(free, shape).min(axis=1) for free, shape in options]
    second = (least[1] > least[0])[:, None]
    return np.where(second, options[1][0], options[0][0]), np.where(second, options[1][1], options[0][1])


def _room(free: Array, shape: Array) -> Array:
    """Stopping distance [m] that a direction allows; zero where not even the body fits."""
    far = np.where(shape > 0.0, free / np.where(shape > 0.0, shape, 1.0), math.inf)
    return np.where(free > 0.0, far, 0.0)
