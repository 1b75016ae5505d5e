"""Circles tangent to a road on both sides of a corner (Manor 2015, fig. 2.12)."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from vnav_drake.speed_profile import row_sag
from vnav_drake.vc_method.road import Road
from vnav_drake.world import World

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]

_ROUNDS = 15  # of Newton; a few suffice where there is a circle
_EXACT = 1e-10  # [m] and relative to the radius: how far centres seen from both sides may differ
_SAMPLES = 17  # on a circle's arc; what lies between them is bounded


@dataclass(frozen=True)
class Fillets:
    """Circular arcs, one a row, that leave the road at `begin` and meet it again at `end`."""

    radius: Array  # (n,) [m]
    begin: Array  # (n,) [m], arc length on the road
    end: Array  # (n,) [m]
    point: Array  # (n, 2) [m], where the arc begins
    heading: Array  # (n,) [rad] there
    turn: Array  # (n,) [rad], left positive
    clearance: Array  # (n,) [m], lower bound of the distance to obstacles along the arc; of a point
    fits: Mask  # (n,) the arc exists, in the room given, free, and passes obstacles as the road does

    def take(self, index: ArrayLike) -> Fillets:
        """Some rows."""
        return Fillets(*(getattr(self, f.name)[np.asarray(index)] for f in fields(self)))

    def replaced(self, index: Indices, other: Fillets) -> Fillets:
        """Rows `index` replaced by those of `other`."""
        columns = []
        for f in fields(self):
            column = getattr(self, f.name).copy()
            column[index] = getattr(other, f.name)
            columns.append(column)
        return Fillets(*columns)


def fillets(
    world: World,
    road: Road,
    stretch: Array,
    turn: Array,
    free: Mask,
    radius: Array,
    room: Array,
    level: float,
) -> Fillets:
    """Tangent arcs around stretches of the road.

    Parameters
    ----------
    stretch : (n, 2) [m], arc lengths that must lie within the arc.
    turn : (n,) [rad], whose sign is the side of the centre.
    free : (n, 2), whether the stretch begins at the start, or ends at the goal, with any heading: there the
        arc must pass through the point alone.
    radius : (n,) [m]
    room : (n, 2) [m], how far before and behind the stretch the road may be left and met.
    level : [m], least distance to obstacles.

    Notes
    -----
    The centre lies at distance R on the inner side of both tangent points: the offset curves of the road
    before and behind the corner meet there. Newton's method in the two arc lengths, where a step on the
    road moves the centre by 1 - R kappa; or in the heading at a free end, which moves it by R.
    """
    side = np.where(turn < 0.0, -1.0, 1.0)
    signed = side * radius
    a, b = _first_guess(road, stretch, free, radius, side)
    for k in range(_ROUNDS):
        miss, tangent, bend = _miss(road, stretch, free, signed, a, b)
        if k == 0:
            bend = np.zeros_like(bend)  # as if both sides were straight
        p, q = tangent
        kp = np.where(free[:, 0], signed, _apart(1.0 - signed * bend[0]))
        kq = np.where(free[:, 1], -signed, _apart(1.0 - signed * bend[1]))
        cross = p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]
        scale = np.where(np.abs(cross) > 1e-12, cross, 1e-12)
        step_a = (miss[:, 0] * q[:, 1] - miss[:, 1] * q[:, 0]) / (scale * kp)
        step_b = (p[:, 0] * miss[:, 1] - p[:, 1] * miss[:, 0]) / (scale * kq)
        a_next = np.where(free[:, 0], a + np.clip(step_a, -0.5, 0.5), np.clip(a + step_a, 0.0, room[:, 0]))
        b_next = np.where(free[:, 1], b + np.clip(step_b, -0.5, 0.5), np.clip(b + step_b, 0.0, room[:, 1]))
        still = bool(np.all((a_next == a) & (b_next == b)))
        a, b = a_next, b_next
        if still:
            break
    miss, (p, q), _ = _miss(road, stretch, free, signed, a, b)
    exists = np.hypot(miss[:, 0], miss[:, 1]) <= _EXACT * (1.0 + radius)
    swing = np.arctan2(p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0], np.einsum("ij,ij->i", p, q))
    exists &= swing * side > 0.0
    begin = stretch[:, 0] - np.where(free[:, 0], 0.0, a)
    end = stretch[:, 1] + np.where(free[:, 1], 0.0, b)
    point = road.at(begin, after=False)[0]
    heading = np.arctan2(p[:, 1], p[:, 0])
    clearance = np.full(len(radius), -np.inf)
    rows = np.flatnonzero(exists)
    arcs = arc_points(point[rows], heading[rows], side[rows] / radius[rows], (radius * np.abs(swing))[rows])
    clearance[rows] = least_distance(world.distance(arcs), 1.0 / radius[rows], (radius * np.abs(swing))[rows])
    free = clearance >= level
    free &= clearance > 0.0
    rows = np.flatnonzero(free)
    free[rows] = _same_side(world, road, arcs[free[exists]], begin[rows], end[rows])
    return Fillets(radius, begin, end, point, heading, swing, clearance, free)


def arc_points(point: Array, heading: Array, curvature: Array, length: Array) -> Array:
    """Points (n, k, 2) [m], evenly along circular arcs."""
    s = length[:, None] * np.linspace(0.0, 1.0, _SAMPLES)
    half = 0.5 * curvature[:, None] * s
    chord, mean = s * np.sinc(half / np.pi), heading[:, None] + half
    return np.asarray(point[:, None] + chord[..., None] * np.stack([np.cos(mean), np.sin(mean)], axis=-1))


def _first_guess(road: Road, stretch: Array, free: Mask, radius: Array, side: Array) -> tuple[Array, Array]:
    """No way from the corner; at a free end the heading of a circle that meets a straight road."""
    a, b = np.zeros(len(radius)), np.zeros(len(radius))
    if free.any():
        x, before, _ = road.at(stretch[:, 0], after=False)
        y, behind, _ = road.at(stretch[:, 1], after=True)
        for mine, unknown, other, here, there, sign in (
            (free[:, 0], a, behind, x, y, -1.0),
            (free[:, 1], b, before, y, x, 1.0),
        ):
            offset = here - there
            height = np.abs(other[:, 0] * offset[:, 1] - other[:, 1] * offset[:, 0])
            swing = np.arccos(np.clip(1.0 - height / radius, -1.0, 1.0))
            unknown[mine] = (np.arctan2(other[:, 1], other[:, 0]) + sign * side * swing)[mine]
    return a, b


def _miss(
    road: Road, stretch: Array, free: Mask, signed: Array, a: Array, b: Array
) -> tuple[Array, tuple[Array, Array], Array]:
    """Centre seen from before less centre seen from behind (n, 2), tangents, and curvatures (2, n)."""
    x, p, kp = road.at(stretch[:, 0] - np.where(free[:, 0], 0.0, a), after=False)
    y, q, kq = road.at(stretch[:, 1] + np.where(free[:, 1], 0.0, b), after=True)
    p = np.where(free[:, :1], np.column_stack([np.cos(a), np.sin(a)]), p)
    q = np.where(free[:, 1:], np.column_stack([np.cos(b), np.sin(b)]), q)
    normal = np.column_stack([q[:, 1] - p[:, 1], p[:, 0] - q[:, 0]])  # of p less that of q
    return x - y + signed[:, None] * normal, (p, q), np.stack([kp, kq])


def _apart(factor: Array) -> Array:
    """1 - R kappa, kept from zero, where a circle of the road's own curvature has no one centre."""
    return np.where(np.abs(factor) > 1e-3, factor, 1e-3)


def least_distance(distance: Array, bend: Array, length: Array) -> Array:
    """Lower bound (n,) of the distance [m] along arcs, between their samples (n, k) [m] too."""
    if len(distance) == 0:
        return np.zeros(0)
    rows = _SAMPLES - 1
    # all arcs in one line; what row_sag says of the seams is dropped
    step = np.repeat(length / rows, _SAMPLES)[:-1]
    sag = np.append(row_sag(distance.reshape(-1), step, np.repeat(bend, _SAMPLES)[:-1]), 0.0)
    sag = sag.reshape(-1, _SAMPLES)[:, :-1]
    return np.asarray((np.minimum(distance[:, 1:], distance[:, :-1]) - sag).min(axis=1))


def _same_side(world: World, road: Road, arcs: Array, begin: Array, end: Array) -> Mask:
    """Whether no obstacle lies between the arc and the road that it replaces."""
    if len(arcs) == 0:
        return np.zeros(0, dtype=bool)
    share = np.linspace(1.0, 0.0, 4 * _SAMPLES)
    s = begin[:, None] + (end - begin)[:, None] * share
    back = road.at(s.reshape(-1), after=False)[0].reshape(len(arcs), -1, 2)
    between = shapely.make_valid(shapely.polygons(np.concatenate([arcs, back], axis=1)))
    inside = np.ones(len(arcs), dtype=bool)
    inside[world.edge_tree.query(between, predicate="intersects")[0]] = False
    return inside
