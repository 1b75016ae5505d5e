"""What both arithmetics are given: controls around each corner, and the terms of each triangle's minorant."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.judge.certificate.file import CertificateFile
from verify.judge.features import Features
from verify.judge.limits import Limits

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

WEIGHT_ROUNDING = 2.0**-48  # by how much weights may sum above 1 (doubles rounded apart); divided out below


@dataclass(frozen=True, eq=False)
class Corners:
    """The control values and sides that determine grad u at each corner i of t triangles.

    u = sum_i c_i lam_i^2 + 2 sum_{i<j} c_ij lam_i lam_j in barycentric coordinates lam. With the corners
    i, j, k anticlockwise, e_j = v_j - v_i, e_k = v_k - v_i, and as grad lam_i = -grad lam_j - grad lam_k,

        grad u (v_i) = 2 (c_ij - c_i) grad lam_j + 2 (c_ik - c_i) grad lam_k
                     = (2 / D) ((c_ij - c_i) (e_k,y, -e_k,x) - (c_ik - c_i) (e_j,y, -e_j,x)),

    D = e_j x e_k twice the area. The common part of the controls cancels before any product is formed.
    """

    own: Array  # (t, 3) [s], c_i
    towards: Array  # (t, 3, 2) [s], c_ij and c_ik
    sides: Indices  # (t, 3, 2, 2) lattice vectors e_j, e_k
    twice_area: NDArray[Any]  # (t,) integers, lattice units squared
    unit: float  # [m]


@dataclass(frozen=True, eq=False)
class Minorants:
    """Lower bounds of 1/V, affine on each triangle: sums of weighted tangents.

    For an isotropic law a speed w needs level(w) = rho + m + w t_r + w^2 / (2 a_b) between the robot's
    centre and every feature, so at the distance l of one feature 1/V >= n(l), where n is the inverse of
    the speed with level = l. V is concave in l, so n is convex, and for every w > 0

        n(l) >= 1/w + s (level(w) - l),  s = a_b / (w^2 (w + a_b t_r)),
              = (1.5 w^2 + 2 a_b t_r w + a_b (rho + m - l)) / (w^2 (w + a_b t_r)),

    the tangent at l = level(w): n' = -(dw/dl) / w^2 with dl/dw = t_r + w / a_b. It decreases in l, and
    the distance to a convex set is convex, so on a triangle l is at most the affine interpolant of its
    corner values: the tangent taken there is affine and below n. Also 1/V >= 1 / v_max, and 1/V >= 0, so
    a sum of these with weights >= 0 that sum to 1 or less is below 1/V.
    """

    points: Array  # (n, 2) [m], corners of the mesh
    triangles: Indices  # (t, 3) rows of `points`
    features: Array  # (f, 5) [m]
    feature: Indices  # (t, K), -1: the constant
    speed: Array  # (t, K) [m/s]
    weight: Array  # (t, K), zero: not used
    limits: Limits

    @property
    def tangents(self) -> tuple[Indices, Indices]:
        """Triangle and slot of each tangent in use; (p,) each."""
        triangle, slot = np.nonzero((self.weight > 0.0) & (self.feature >= 0))
        return triangle, slot

    @property
    def constant(self) -> Array:
        """Weights (t, K) of the constant, zero elsewhere."""
        return np.where(self.feature < 0, self.weight, 0.0)


def corners_of(file: CertificateFile, side_edges: Indices, twice_area: NDArray[Any], rows: slice) -> Corners:
    """The corners of some kept triangles.

    Parameters
    ----------
    side_edges : (t, 3), row in `edges` of the side from corner i to i + 1.
    twice_area : (t,) integers, lattice units squared.
    """
    triangles, side_edges = file.triangles[rows], side_edges[rows]
    place = file.vertices[triangles]
    following, last = np.roll(place, -1, axis=1), np.roll(place, -2, axis=1)
    sides = np.stack([following - place, last - place], axis=2)
    own = file.u_vertex[triangles]
    towards = file.u_edge[np.stack([side_edges, np.roll(side_edges, 1, axis=1)], axis=2)]
    return Corners(own=own, towards=towards, sides=sides, twice_area=twice_area[rows], unit=float(file.unit))


def minorants_of(file: CertificateFile, features: Features, limits: Limits, rows: slice) -> Minorants:
    """The minorants of some kept triangles, with the numbers of the scenario."""
    return Minorants(
        points=file.points,
        triangles=file.triangles[rows].astype(np.int64),
        features=features.table,
        feature=file.feature[rows].astype(np.int64),
        speed=file.speed[rows],
        weight=file.weight[rows],
        limits=limits,
    )
