"""What the certificate's function is at start and goal, in fractions: nothing is rounded."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from verify.judge.certificate.file import CertificateFile

Indices = NDArray[np.int64]


def barycentric(file: CertificateFile, triangle: int, position: Sequence[float]) -> tuple[Fraction, ...]:
    """The three barycentric coordinates of a position [m] in a kept triangle of positive area."""
    unit = Fraction(float(file.unit))
    origin = [Fraction(float(c)) for c in file.origin]
    place = [(Fraction(float(p)) - o) / unit for p, o in zip(position, origin, strict=True)]
    corner = [[int(c) for c in file.vertices[v]] for v in file.triangles[triangle]]
    return tuple(
        _twice_area(place, corner[(i + 1) % 3], corner[(i + 2) % 3]) / _twice_area(*corner) for i in range(3)
    )


def potential(
    file: CertificateFile, triangle: int, side_edges: Indices, weights: Sequence[Fraction]
) -> Fraction:
    """u [s] at barycentric coordinates of a kept triangle: sum c_i lam_i^2 + 2 sum c_ij lam_i lam_j.

    `side_edges` (t, 3) are the rows in `edges` of the sides from corner i to i + 1.
    """
    value = Fraction(0)
    for i in range(3):
        own = Fraction(float(file.u_vertex[file.triangles[triangle, i]]))
        side = Fraction(float(file.u_edge[side_edges[triangle, i]]))
        value += weights[i] * (own * weights[i] + 2 * side * weights[(i + 1) % 3])
    return value


def float_at_most(value: Fraction) -> float:
    """The greatest double that is no more than the value."""
    near = float(value)
    return near if Fraction(near) <= value else math.nextafter(near, -math.inf)


def _twice_area(a: Sequence[Fraction | int], b: Sequence[int], c: Sequence[int]) -> Fraction:
    u, w = [p - q for p, q in zip(b, a, strict=True)], [p - q for p, q in zip(c, a, strict=True)]
    return Fraction(u[0] * w[1] - u[1] * w[0])
