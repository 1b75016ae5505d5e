"""The class of a motion: circular arcs as polylines that are homotopic to them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vnav_drake.homotopy.gates import Gates
from vnav_drake.plan import Path, Trajectory
from vnav_drake.world import World

Array = NDArray[np.float64]

FLAT = 1e-9  # [m]: an arc that departs less from its chord is its chord
ROUNDS = 40  # of halving; an arc of 1 km is flat after 20
BLOCK = 32  # pieces of a path that are first examined together


def class_of(gates: Gates, motion: Trajectory | Path | ArrayLike) -> str:
    """The name of the homotopy class of a trajectory, a path, or a polyline (n, 2) [m].

    Raises
    ------
    ValueError : a polyline that is none.
    """
    return gates.name(word_of(gates, motion))


def word_of(gates: Gates, motion: Trajectory | Path | ArrayLike) -> tuple[int, ...]:
    """The reduced word of a trajectory, a path, or a polyline (n, 2) [m]; errors as in `class_of`."""
    if isinstance(motion, Trajectory):
        motion = Path(
            motion.x, motion.y, motion.heading[:-1], motion.curvature[:-1], np.diff(motion.arc_length)
        )
    if isinstance(motion, Path):
        motion = homotopic_polyline(gates.diagram.world, motion)
    return gates.word(motion)


def homotopic_polyline(world: World, path: Path) -> Array:
    """Points (n, 2) [m] on a path whose polyline is homotopic to it, and meets it at all joints.

    Derived: an arc of length h lies within h/2 of its middle. Where that is less than the distance of
    the middle to the nearest feature, arc and chord lie in one free disc, where they are homotopic. Other
    arcs are halved, until they depart by less than FLAT from their chords.
    """
    for _round in range(ROUNDS):
        length = path.piece_length
        row = np.flatnonzero((length**2 * np.abs(path.curvature) > 8.0 * FLAT) & _near_walls(world, path))
        turn = 0.25 * path.curvature[row] * length[row]  # of the chord to the middle, against the tangent
        reach = 0.5 * length[row] * np.sinc(turn / np.pi)
        angle = path.heading[row] + turn
        middle = np.column_stack([path.x[row] + reach * np.cos(angle), path.y[row] + reach * np.sin(angle)])
        row = row[0.5 * length[row] >= world.nearest(middle)[0]]
        if len(row) == 0:
            break
        parts = np.ones(len(length), dtype=np.int64)
        parts[row] = 2
        path = path.subdivided(parts)
    return np.column_stack([path.x, path.y])


def _near_walls(world: World, path: Path) -> NDArray[np.bool_]:
    """(n,) False where a whole block of pieces is so far from all features that none needs halving.

    The middle of a piece is at most `reach` from the block's central joint, so its distance is at least
    that of the joint less `reach`.
    """
    count = len(path.piece_length)
    first = np.arange(0, count, BLOCK)
    last, centre = np.minimum(first + BLOCK, count), np.minimum(first + BLOCK // 2, count)
    s = np.concatenate([[0.0], np.cumsum(path.piece_length)])
    reach = np.maximum(s[centre] - s[first], s[last] - s[centre])
    longest = np.maximum.reduceat(path.piece_length, first) if count else reach
    room = world.nearest(np.column_stack([path.x[centre], path.y[centre]]))[0]
    return np.repeat(reach + 0.5 * longest >= room, last - first)
