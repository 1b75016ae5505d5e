"""Where a finer mesh helps: the first mesh, and the triangles that cost the bound most."""

from __future__ import annotations

import math
import sys
from functools import partial

import numpy as np
from numpy.typing import NDArray

from vnav_drake.lower_bound.blocked import FREE
from vnav_drake.lower_bound.cover import Cover, Ground
from vnav_drake.lower_bound.mesh import LEVELS, Mesh

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

FIRST_TRIANGLES, FIRST_PER_FEATURE = 1500, 8  # kept ones of the first mesh, at least
END_GRADING = 0.5  # first mesh: sides at most this share of the distance to an end
BULK = 0.7  # share of the expected loss that the marked triangles make up
BEND_AT_ENDS = 0.05  # loss of a quadratic u around an end, times (side/distance)^2
BEND_AT_FEATURES = 0.01  # and where the flow bends near a feature, times (side/clearance)^2
IDLE = 1e-8  # share of the travel time below which a triangle is left as it is

# Where the slowness is compared with its minorant: near each corner, and in the middle.
_SPOTS = np.array([[4.0, 1.0, 1.0], [1.0, 4.0, 1.0], [1.0, 1.0, 4.0], [2.0, 2.0, 2.0]]) / 6.0


def first_cover(ground: Ground, bounds: tuple[float, float, float, float]) -> Cover:
    """A mesh that is finer near features and both ends, with about as many triangles as the world needs."""
    enough = FIRST_TRIANGLES + FIRST_PER_FEATURE * len(ground.features.table)
    cover = Cover.begin(ground, Mesh.around(bounds))
    side = math.ldexp(cover.mesh.lattice.unit, LEVELS)
    while True:
        cover = cover.grown(partial(_too_wide, side=side), sys.maxsize)
        if len(cover.kept) >= enough or not cover.mesh.divisible.any():
            return cover
        side /= math.sqrt(2.0)


def _too_wide(cover: Cover, side: float) -> Mask:
    """Triangles wider than their clearance and `side` [m] together, or too wide for the nearest end."""
    rows = np.arange(len(cover.mesh.triangles))
    corners = cover.corners(rows)
    middle, width = corners.mean(axis=1), _width(corners)
    free = np.maximum(_clearance(cover.ground, middle), 0.0)
    ends = np.minimum(_away(middle, cover.ground.start), _away(middle, cover.ground.goal))
    return (width > free + side) | (width > END_GRADING * ends + 0.02 * side)


def worst(cover: Cover) -> Mask:
    """The fewest triangles that make up the share `BULK` of the expected loss; (t,)."""
    loss = losses(cover)
    order = np.argsort(-loss, kind="stable")
    total = np.cumsum(loss[order])
    marked = np.zeros(len(loss), dtype=bool)
    if total[-1] > 0.0:
        marked[order[: int(np.searchsorted(total, BULK * total[-1])) + 1]] = True
    return marked & (loss > 0.0)


def losses(cover: Cover) -> Array:
    """Expected loss of each triangle, as a share of the travel time; (t,).

    The flow's time in the triangle, times what the bound there falls short of the slowness, and what a
    quadratic u cannot follow: wave fronts around an end, and bends near features.
    """
    rows = np.flatnonzero((cover.time > IDLE) & (cover.reason == FREE))
    corners, minorant = cover.corners(rows), cover.choice(rows).corner[:, 0]
    spots = np.einsum("sk,tkd->tsd", _SPOTS, corners)
    free = _clearance(cover.ground, spots.reshape(-1, 2)).reshape(len(rows), len(_SPOTS))
    zone, heading = cover.ground.zone, np.repeat(cover.heading[rows], len(_SPOTS))
    if cover.ground.lengths:
        slowness = np.ones_like(free)
    elif zone is None:
        slowness = cover.ground.law.slowness(free + cover.ground.law.level)
    else:
        slowness = zone.pace(cover.ground.features, spots.reshape(-1, 2), heading).reshape(free.shape)
    below = np.einsum("sk,tk->ts", _SPOTS, minorant)
    short = np.where(np.isfinite(slowness), 1.0 - below / slowness, 1.0)
    share = np.einsum("sk,tk->ts", _SPOTS, cover.flow[rows])
    short = np.einsum("ts,ts->t", short, share) / share.sum(axis=1)
    width, middle = _width(corners), corners.mean(axis=1)
    for end in (cover.ground.start, cover.ground.goal):
        short += BEND_AT_ENDS * np.square(width / (_away(middle, end) + 0.25 * width))
    short += BEND_AT_FEATURES * np.square(width / (np.maximum(free[:, -1], 0.0) + 0.25 * width))
    loss = np.zeros(len(cover.time))
    loss[rows] = cover.time[rows] * short
    return loss


def _clearance(ground: Ground, points: Array) -> Array:
    return ground.features.distance(points, ground.features.nearest(points)) - ground.law.level


def _width(corners: Array) -> Array:
    """Longest side [m] of each triangle (t, 3, 2): the one opposite the right angle."""
    side = corners[:, 1] - corners[:, 2]
    return np.asarray(np.hypot(side[:, 0], side[:, 1]))


def _away(points: Array, end: Array) -> Array:
    return np.asarray(np.hypot(points[:, 0] - end[0], points[:, 1] - end[1]))
