"""Trajectories for the tests of `systems`: a path and the fastest constant-acceleration speeds along it."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from vnav_drake.plan import Path, Trajectory

PIECE = 0.02  # [m], longest row


def drive(path: Path, *, start: float, end: float, cruise: float, rate: float = 1.0) -> Trajectory:
    """Accelerate from `start`, cruise, brake to `end` [m/s]; accelerations +-`rate` [m/s^2]."""
    length = path.length
    # v^2 = start^2 + 2 rate s meets cruise^2, or end^2 + 2 rate (length - s) when the path is short
    up = (cruise**2 - start**2) / (2 * rate)
    down = length - (cruise**2 - end**2) / (2 * rate)
    meet = 0.5 * length + (end**2 - start**2) / (4 * rate)
    switches = [up, down] if up < down else [meet]
    ends = np.concatenate([[0.0], np.cumsum(path.piece_length)])
    knots = np.unique(np.concatenate([ends, np.clip(switches, 0.0, length)]))
    knots = knots[np.append(True, np.diff(knots) > 1e-12)]
    parts = [
        np.linspace(a, b, max(int(np.ceil((b - a) / PIECE)), 1), endpoint=False) for a, b in pairwise(knots)
    ]
    s = np.concatenate([*parts, [length]])
    square = np.minimum(start**2 + 2 * rate * s, end**2 + 2 * rate * (length - s))
    v = np.sqrt(np.clip(square, 0.0, cruise**2))
    step = np.diff(s)
    t = np.concatenate([[0.0], np.cumsum(2 * step / (v[1:] + v[:-1]))])
    a = (v[1:] ** 2 - v[:-1] ** 2) / (2 * step)
    curvature = path.at(0.5 * (s[1:] + s[:-1]))[3]
    x, y, heading, _ = path.at(s)
    far = np.full(len(s), 10.0)
    return Trajectory(t, x, y, heading, v, np.append(a, a[-1]), np.append(curvature, curvature[-1]), far)


def straight(length: float, **speeds: float) -> Trajectory:
    """A straight line, neither along an axis of the world nor from its origin; speeds as for `drive`."""
    return drive(Path.from_arcs((1.0, 2.0), 0.3, [0.0], [length]), **speeds)


def mirrored(m: Trajectory) -> Trajectory:
    """Mirrored at the x axis."""
    return replace(m, y=-m.y, heading=-m.heading, curvature=-m.curvature)


def enlarged(m: Trajectory, factor: float) -> Trajectory:
    """The path enlarged, at speeds that leave all accelerations what they are."""
    root = np.sqrt(factor)
    return replace(
        m, x=factor * m.x, y=factor * m.y, t=root * m.t, v=root * m.v, curvature=m.curvature / factor
    )


def circle(radius: float, speed: float, turns: float = 1.0) -> Trajectory:
    """At constant speed to the left."""
    path = Path.from_arcs((0.0, 0.0), 0.0, [1.0 / radius], [2.0 * np.pi * radius * turns])
    return drive(path, start=speed, end=speed, cruise=speed)


def s_curve(*, start: float, end: float, cruise: float) -> Trajectory:
    """Straight, left, right, left, straight; curvature steps of 0.25 up to 1 1/m, like a clothoid."""
    ramp = [0.25, 0.5, 0.75]
    left = [*ramp, 1.0, *ramp[::-1]]
    right = [-k for k in left]
    lengths = [0.2, 0.2, 0.2, 1.0, 0.2, 0.2, 0.2]
    curvature = [0.0, *left, *right, *right, *left, 0.0]
    return drive(
        Path.from_arcs((0.0, 0.0), 0.0, curvature, [1.5, *lengths * 4, 1.5]),
        start=start,
        end=end,
        cruise=cruise,
    )


def corridors(
    *,
    start: float,
    end: float,
    cruise: float,
    radius: float = 1.5,
    straights: tuple[float, float] = (25.0, 18.0),
) -> Trajectory:
    """Along the bottom of a warehouse, then up its left side: a right turn of a quarter."""
    quarter = 0.5 * np.pi * radius
    path = Path.from_arcs(
        (28.5, 1.9), np.pi, [0.0, -1.0 / radius, 0.0], [straights[0], quarter, straights[1]]
    )
    return drive(path, start=start, end=end, cruise=cruise)


def lateral_error(trajectory: Trajectory, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Distance [m] from points to the path, sampled every millimetre or so."""
    from scipy.spatial import KDTree

    t = np.linspace(trajectory.t[0], trajectory.t[-1], int(trajectory.length / 1e-3) + 2)
    px, py, heading, *_ = trajectory.at(t)
    _, i = KDTree(np.column_stack([px, py])).query(np.column_stack([x, y]))
    return np.abs((y - py[i]) * np.cos(heading[i]) - (x - px[i]) * np.sin(heading[i]))
