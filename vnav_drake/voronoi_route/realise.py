"""A route as a path of circular arcs: straight pieces exactly, parabolas by biarcs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vnav_drake.plan import Path
from vnav_drake.voronoi import PARABOLA, Curves

Array = NDArray[np.float64]

DEVIATION = 2.5e-7  # [m]: greatest distance of a biarc from its parabola
SHORTEST = 1e-12  # [m]: shorter pieces are rounding and left out


def route_path(curves: Curves, start: Array, goal: Array) -> Path:
    """The path along `curves`, from `start` to `goal` (2,) [m], which they meet up to rounding."""
    curves = curves.take(curves.length > SHORTEST)
    heading, curvature, length, corner, row = [], [], [], [], []
    straight = np.flatnonzero(curves.kind != PARABOLA)
    tangent = curves.tangents(curves.middle)[straight]
    row.append(straight)
    heading.append(np.arctan2(tangent[:, 1], tangent[:, 0]))
    curvature.append(np.zeros(len(straight)))
    length.append(curves.length[straight])
    corner.append(curves.ends[straight, 0])
    for i in np.flatnonzero(curves.kind == PARABOLA):
        arcs = parabola_biarcs(curves.take([i]))
        row.append(np.full(len(arcs[0]), i))
        for values, part in zip((corner, heading, curvature, length), arcs, strict=True):
            values.append(part)
    order = np.argsort(np.concatenate(row), kind="stable")
    points = np.concatenate([np.concatenate(corner)[order], goal[None]])
    points[0] = start
    headings = np.concatenate(heading)[order]
    bend, size = np.concatenate(curvature)[order], np.concatenate(length)[order]
    jump = headings[1:] - (headings + bend * size)[:-1]
    turns = np.concatenate([[0.0], np.cumsum(np.rint(jump / (2.0 * np.pi)))])
    return Path(points[:, 0], points[:, 1], headings - 2.0 * np.pi * turns, bend, size)


def parabola_biarcs(curve: Curves) -> tuple[Array, Array, Array, Array]:
    """Circular arcs along one parabola: starts (n, 2), headings, curvatures and lengths (n,).

    Cut evenly in w = asinh(u / p), where the error of a biarc, which goes with the derivative of the
    curvature times the length cubed, varies least; cut finer until the measured error is small.
    """
    p = curve.size[0]
    w = np.arcsinh(curve.span[0] / p)
    # error about kappa' h^3 / 100 with kappa' h^3 = 3 p sinh(w) dw^3
    steep = 3.0 * p * max(float(np.abs(np.sinh(w)).max()), 0.1) / 100.0
    count = int(np.ceil(abs(w[1] - w[0]) * (steep / DEVIATION) ** (1.0 / 3.0))) + 1
    while True:
        u = p * np.sinh(np.linspace(w[0], w[1], count + 1))
        u[0], u[-1] = curve.span[0]
        arcs = _biarcs(curve.points(u[None])[0], curve.tangents(u[None])[0])
        if _deviation(curve, *arcs) <= DEVIATION or count > 10_000:
            return arcs
        count = 2 * count


def _biarcs(points: Array, tangents: Array) -> tuple[Array, Array, Array, Array]:
    """Two arcs between each two points, tangent to both directions, with equal tangent lengths.

    Standard: the tangent length d solves 2 (1 - t0.t1) d^2 + 2 v.(t0 + t1) d = v.v, v the chord.
    """
    t0, t1 = tangents[:-1], tangents[1:]
    chord = np.diff(points, axis=0)
    both = np.einsum("ij,ij->i", chord, t0 + t1)
    apart = np.einsum("ij,ij->i", t0 - t1, t0 - t1)  # 2 (1 - t0.t1)
    square = np.einsum("ij,ij->i", chord, chord)
    d = square / (both + np.sqrt(both * both + apart * square))
    middle = 0.5 * (points[:-1] + points[1:] + d[:, None] * (t0 - t1))
    starts = np.stack([points[:-1], middle], axis=1).reshape(-1, 2)
    ends = np.stack([middle, points[1:]], axis=1).reshape(-1, 2)
    step = ends - starts
    chord_length = np.hypot(step[:, 0], step[:, 1])
    # the first arc is tangent to t0 at its start, the second to t1 at its end
    tangent = np.stack([t0, t1], axis=1).reshape(-1, 2)
    cross = tangent[:, 0] * step[:, 1] - tangent[:, 1] * step[:, 0]
    half = np.arctan2(cross, np.einsum("ij,ij->i", tangent, step))  # half the turn; its sign at a start
    half[1::2] = -half[1::2]
    length = chord_length / np.sinc(half / np.pi)
    heading = np.arctan2(tangent[:, 1], tangent[:, 0])
    heading[1::2] -= 2.0 * half[1::2]
    return starts, heading, 2.0 * half / length, length


def _deviation(curve: Curves, starts: Array, heading: Array, bend: Array, length: Array) -> float:
    """Greatest distance [m] of the arcs from the parabola, at their quarter points."""
    s = length[:, None] * np.linspace(0.0, 1.0, 5)
    half = 0.5 * bend[:, None] * s
    chord, mean = s * np.sinc(half / np.pi), heading[:, None] + half
    points = starts[:, None] + chord[..., None] * np.stack([np.cos(mean), np.sin(mean)], axis=-1)
    offset = points - curve.origin[0]
    u, height = offset @ curve.axis[0], offset @ curve.normal[0]
    p = curve.size[0]
    # vertical miss times the cosine of the slope: the distance to first order
    return float(np.abs((height - (p * p + u * u) / (2.0 * p)) / np.hypot(1.0, u / p)).max())
