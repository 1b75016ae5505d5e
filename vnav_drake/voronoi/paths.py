"""A route as a path of circular arcs: straight pieces exactly, parabolas by biarcs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vnav_drake.biarcs import biarcs
from vnav_drake.plan import Path
from vnav_drake.voronoi.curves import PARABOLA, Curves

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
        arcs = biarcs(curve.points(u[None])[0], curve.tangents(u[None])[0])
        if _deviation(curve, *arcs) <= DEVIATION or count > 10_000:
            return arcs
        count = 2 * count


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
