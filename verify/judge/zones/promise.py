"""The zone's promise, by kinematics: stops with the steering held, all along the motion that is executed."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.judge.finding import VIOLATION_TOLERANCE
from verify.judge.geometry import Surroundings
from verify.judge.limits import Limits
from verify.judge.motion import Motion
from verify.judge.zones.held import arc_point, held_way, outside
from verify.judge.zones.zone import Zone

Array = NDArray[np.float64]

POSES = 800  # at even times
SHARES = (1.0, 0.5)  # of the curvature: wheels may be on their way to straight ahead
POINTS = 33  # of each stop's arc
EACH = 4  # of them whether the disc is in the zone: the zone is convex, so that shows at the end first
LISTED = 20  # stops told one by one


def audit(motion: Motion, zone: Zone, surroundings: Surroundings, limits: Limits) -> dict[str, Any]:
    """What becomes of stops with the steering held at poses along a motion.

    Turning and braking share the friction. `held_leaves` counts poses from which the robot's disc comes out
    of the zone claimed there, with the curvature or a share of it; `held_collides` those from which it
    touches anything.

    Returns
    -------
    The block `zone.promise` of result.json: counts, `worst_excess` [m] out of the zone and `worst_depth` [m]
    in an obstacle (negative where there is none), `at` of the worst excess, the worst stops in `failed`.
    """
    pose = _poses(motion)
    curvature = np.concatenate([share * pose["curvature"] for share in SHARES])
    speed, heading = (np.tile(pose[name], len(SHARES)) for name in ("v", "heading"))
    place = np.tile(np.column_stack([pose["x"], pose["y"]]), (len(SHARES), 1))
    way = held_way(speed, curvature, limits)[:, None] * np.linspace(0.0, 1.0, POINTS)
    arc = arc_point(way, np.broadcast_to(curvature[:, None], way.shape))
    some = arc[:, ::EACH]
    beyond = outside(zone, limits.radius, some.reshape(-1, 2), np.repeat(speed, some.shape[1]))
    excess = beyond.reshape(len(way), -1).max(axis=1)
    cos, sin = np.cos(heading)[:, None], np.sin(heading)[:, None]
    x = place[:, :1] + cos * arc[..., 0] - sin * arc[..., 1]
    y = place[:, 1:] + sin * arc[..., 0] + cos * arc[..., 1]
    first = np.arange(len(way) + 1) * POINTS
    gap, _ = surroundings.along(np.column_stack([x.ravel(), y.ravel()]), first)
    depth = limits.radius - gap
    leaves, collides = excess > VIOLATION_TOLERANCE, depth > VIOLATION_TOLERANCE
    t = np.tile(pose["t"], len(SHARES))

    def told(i: int) -> dict[str, float]:
        return {"t": float(t[i]), "x": float(place[i, 0]), "y": float(place[i, 1])}

    worst = int(np.argmax(excess))
    bad = np.flatnonzero(leaves | collides)
    gravest = bad[np.lexsort((-excess[bad], -np.maximum(depth[bad], 0.0)))][:LISTED]
    return {
        "poses": len(pose["t"]),
        "held_leaves": int(leaves.reshape(len(SHARES), -1).any(axis=0).sum()),
        "held_collides": int(collides.reshape(len(SHARES), -1).any(axis=0).sum()),
        "worst_excess": float(excess[worst]),
        "worst_depth": float(depth.max()),
        "at": told(worst),
        "failed": [
            {
                **told(i),
                "heading": float(heading[i]),
                "v": float(speed[i]),
                "kappa": float(curvature[i]),
                "way": float(way[i, -1]),
                "excess": float(excess[i]),
                "depth": float(depth[i]),
            }
            for i in sorted(gravest.tolist(), key=lambda i: (t[i], i))
        ],
    }


def _poses(motion: Motion) -> dict[str, Array]:
    """Poses at the middles of even parts of the travel time, with speed and curvature; (n,) each."""
    time = motion.t[0] + motion.travel_time * (np.arange(POSES) + 0.5) / POSES
    row = np.clip(np.searchsorted(motion.t, time, side="right") - 1, 0, len(motion.t) - 2)
    points, heading = motion.at(time)
    speed = motion.v[row] + motion.a[row] * (time - motion.t[row])
    return {
        "t": time,
        "x": points[:, 0],
        "y": points[:, 1],
        "heading": heading,
        "v": np.maximum(speed, 0.0),
        "curvature": motion.curvature[row],
    }
