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
        bent = path.piece_length**2 * np.abs(path.curvature) > 8.0 * FLAT
        halved = path.subdivided(np.full(len(bent), 2))
        middle = np.column_stack([halved.x, halved.y])[1::2]
        doubtful = np.flatnonzero(bent)
        room = world.nearest(middle[doubtful])[0]
        doubtful = doubtful[0.5 * path.piece_length[doubtful] >= room]
        if len(doubtful) == 0:
            break
        parts = np.ones(len(bent), dtype=np.int64)
        parts[doubtful] = 2
        path = path.subdivided(parts)
    return np.column_stack([path.x, path.y])
