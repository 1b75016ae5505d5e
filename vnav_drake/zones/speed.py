"""How fast is safe at poses, and how far zones are from what stands around them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vnav_drake.convex import ConvexPieces
from vnav_drake.world import World
from vnav_drake.zones.convex_zone import ConvexZone, GaugeZone
from vnav_drake.zones.touch import into_body, separation, stopping_room

Array = NDArray[np.float64]
Index = NDArray[np.int64]

HALVINGS = 50  # of the speed, for a zone of which only the support function is known
CHUNK = 50_000  # pairs of pose and piece at a time


def safe_speed(zone: ConvexZone, world: World, poses: Array) -> Array:
    """Greatest safe speed [m/s] at poses.

    Parameters
    ----------
    poses : (n, 3) x [m], y [m], heading [rad].

    Returns
    -------
    (n,), at most the greatest speed of the zone's law; zero where the zone at standstill does not fit.
    """
    pieces = ConvexPieces.of(world)
    longest = 2.0 * world.diameter
    if isinstance(zone, GaugeZone):
        room = np.full(len(poses), longest)
        for pose, corners in _pairs(pieces, poses):
            np.minimum.at(room, pose, stopping_room(zone, corners)[0])
        return zone.law.speed(room + zone.law.margin)
    fastest = float(zone.law.speed(longest + zone.law.margin))
    low, high = np.zeros(len(poses)), np.full(len(poses), fastest)
    low = np.where(least_gap(zone, world, poses, high) >= 0.0, high, low)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        good = least_gap(zone, world, poses, middle) >= 0.0
        low, high = np.where(good, middle, low), np.where(good, high, middle)
    return low


def least_gap(zone: ConvexZone, world: World, poses: Array, speed: Array) -> Array:
    """Signed distance (n,) [m] between the zone at poses (n, 3) and speeds (n,) and what is nearest to it."""
    gap = np.full(len(poses), np.inf)
    for pose, corners in _pairs(ConvexPieces.of(world), poses):
        np.minimum.at(gap, pose, separation(zone, corners, speed[pose]).gap)
    return gap


def _pairs(pieces: ConvexPieces, poses: Array) -> list[tuple[Index, Array]]:
    """All pairs of pose and piece in parts: which pose (m,), and the corners (m, k, 2) in its frame."""
    count = len(pieces.corners)
    pose = np.repeat(np.arange(len(poses)), count)
    piece = np.tile(np.arange(count), len(poses))
    parts = []
    for first in range(0, len(pose), CHUNK):
        of, which = pose[first : first + CHUNK], piece[first : first + CHUNK]
        parts.append((of, into_body(pieces.corners[which], *poses[of].T)))
    return parts
