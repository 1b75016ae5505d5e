"""Constraint blocks for a braking zone that depends on the heading: gaps to obstacles, and held arcs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from vnav_drake.collocation.blocks import Block, Layout
from vnav_drake.collocation.mesh import Mesh
from vnav_drake.convex import ConvexPieces
from vnav_drake.problem import Problem
from vnav_drake.zones.convex_zone import ConvexZone, GaugeZone, WidenedZone
from vnav_drake.zones.held_arc import TurnLimit
from vnav_drake.zones.touch import into_body, separation

Array = NDArray[np.float64]
Index = NDArray[np.int64]

# A zone in which no disc lies may be entered suddenly, and speeds jump there: it is planned with this much
# more all around [m], and this share of the stopping distance. The speeds in the end are those of the zone.
PLAN_SPARE, PLAN_SHARE = 2e-3, 0.02
LEAST_TURN = 1e-6  # [rad]: where no turn is allowed at all
SWING = 0.3  # share of its length by which a zone may swing aside before it is looked at anew


def planned_zone(zone: ConvexZone) -> ConvexZone:
    """The zone as the program sees it: a little wider where no disc lies in it."""
    if zone.inner_law() is not None:
        return zone
    wider = replace(zone, radius=zone.radius + PLAN_SPARE)
    if not isinstance(wider, GaugeZone):
        return wider
    return WidenedZone(law=wider.law, radius=wider.radius, of=wider, share=PLAN_SHARE)


def near_pairs(zone: ConvexZone, pieces: ConvexPieces, guess: Mesh, reach: float) -> tuple[Index, Index]:
    """Pairs (knot, piece) whose gap at the guess is at most `reach` [m] and a share of the zone's length."""
    knots, count = len(guess.v), len(pieces.corners)
    knot, piece = np.repeat(np.arange(knots), count), np.tile(np.arange(count), knots)
    poses = (guess.x[knot], guess.y[knot], guess.theta[knot])
    gap = separation(zone, into_body(pieces.corners[piece], *poses), guess.v[knot]).gap
    far = zone.law.distance(guess.v)[knot]
    keep = gap <= reach + SWING * far
    return knot[keep], piece[keep]


def zone_block(layout: Layout, zone: ConvexZone, pieces: ConvexPieces, knot: Index, piece: Index) -> Block:
    """The gap between the zone at a knot and a piece is at least zero.

    One row for each pair (knot[i], piece[i]); `knot` must be sorted. With the best direction n, at the
    angle a of the body's frame, the gap is n.(p - q) - h(a, v): its derivatives are -n by position,
    h' by heading (the body turns under n) and -dh/dv by speed, as n itself is optimal.
    """
    used, which = np.unique(knot, return_inverse=True)
    m, n = len(used), len(knot)
    variables = np.concatenate([layout.x(used), layout.y(used), layout.theta(used), layout.v(used)])
    row, corners = np.arange(n), pieces.corners[piece]

    def evaluate(z: Array) -> tuple[Array, Array]:
        x, y, theta, v = (part[which] for part in z.reshape(4, m))
        touch = separation(zone, into_body(corners, x, y, theta), v)
        _, by_angle, by_speed = zone.support(touch.angle, v)
        world = touch.angle + theta
        return touch.gap, np.concatenate([-np.cos(world), -np.sin(world), by_angle, -by_speed])

    cols = np.concatenate([which, m + which, 2 * m + which, 3 * m + which])
    return Block("zone", variables, np.tile(row, 4), cols, evaluate, np.zeros(n), np.full(n, np.inf))


def held_arc_block(
    layout: Layout, problem: Problem, limit: TurnLimit, shares: Array, intervals: Index
) -> Block:
    """|kappa| D(v) / (greatest turn at D) <= 1 at both ends of each interval.

    Kappa is constant on it, and D lies between its end values.
    """
    n = len(intervals)
    m = n + 1
    knots = np.append(intervals, intervals[-1] + 1)
    variables = np.concatenate([layout.theta(knots), layout.v(knots), [layout.length]])
    k, f = np.arange(n), shares[intervals]
    law = problem.braking

    def evaluate(z: Array) -> tuple[Array, Array]:
        theta, v, length = z[:m], z[m : 2 * m], z[-1]
        step = f * length
        kappa = np.diff(theta) / step
        far = law.distance(v) - law.margin
        most, by_far = limit.greatest(far)
        allowed = np.maximum(most, LEAST_TURN)
        ratio = far / allowed
        slope = law.distance_slope(v) * (1.0 - ratio * by_far) / allowed
        values, data = [], []
        for end in (0, 1):
            here = ratio[end : n + end]
            values.append(kappa * here)
            data += [-here / step, here / step, kappa * slope[end : n + end], -kappa * here / length]
        return np.concatenate(values), np.concatenate(data)

    rows = np.concatenate([np.tile(k, 4), np.tile(n + k, 4)])
    cols = np.concatenate([part for end in (0, 1) for part in (k, k + 1, m + k + end, np.full(n, 2 * m))])
    one = np.ones(2 * n)
    return Block("held arc", variables, rows, cols, evaluate, -one, one)
