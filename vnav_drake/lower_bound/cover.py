"""The mesh over the world: which triangles are kept, which are blocked and why, and where the flow is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vnav_drake.lower_bound.blocked import FREE, Solids, blocked_by
from vnav_drake.lower_bound.exact import side_of
from vnav_drake.lower_bound.features import Features
from vnav_drake.lower_bound.headings import ZoneLaw, zone_law
from vnav_drake.lower_bound.lengths import standing_radius
from vnav_drake.lower_bound.mesh import Mesh
from vnav_drake.lower_bound.minorant import Choice, Law, choose
from vnav_drake.problem import PlanningError, Problem

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]

CENTRE = 1.0 / 3.0  # barycentric coordinates of the middle
NARROWER = 2e-9  # relative, that the disc is taken narrower where motions may touch what blocks them
NEAR_SIDE = 1e-9  # barycentric: triangles that contain a point up to this are asked exactly


@dataclass(frozen=True, eq=False)
class Ground:
    """What does not change while the mesh grows."""

    features: Features
    solids: Solids
    law: Law
    start: Array  # (2,) [m]
    goal: Array  # (2,) [m]
    zone: ZoneLaw | None = None  # where the speed depends on the heading
    lengths: bool = False  # u measures lengths: a zone from which no bound of the speed follows

    @classmethod
    def of(cls, problem: Problem) -> Ground:
        """The geometry, speed law and ends of a problem."""
        zone = zone_law(problem)
        lengths = problem.zone is not None and zone is None
        level = problem.robot.radius + problem.braking.margin
        if lengths:
            level = standing_radius(problem) * (1.0 - NARROWER)
        return cls(
            Features.of(problem.world),
            Solids(problem.world),
            Law.within(problem.braking, level, problem.world.diameter),
            problem.start.point,
            problem.goal.point,
            zone,
            lengths,
        )


@dataclass(frozen=True, eq=False)
class Cover:
    """A mesh of the box with what is known of its vertices and triangles."""

    ground: Ground
    mesh: Mesh
    nearest: Indices  # (n,), nearest feature of each vertex
    reason: Indices  # (t,), why a triangle is blocked, or `FREE`
    flow: Array  # (t, 3), barycentric: where in the triangle the optimal flow is thought to be
    time: Array  # (t,), share of the travel time that it spends there
    heading: Array  # (t,) [rad], of that flow, as far as it is known; of use with a zone only

    @classmethod
    def begin(cls, ground: Ground, mesh: Mesh) -> Cover:
        """Nothing known of the flow."""
        count = len(mesh.triangles)
        every = np.arange(count)
        nearest = ground.features.nearest(mesh.points)
        reason = _reasons(ground, mesh, nearest, np.full(count, FREE), every)
        way = ground.goal - ground.start
        heading = np.full(count, np.arctan2(way[1], way[0]))
        return cls(ground, mesh, nearest, reason, np.full((count, 3), CENTRE), np.zeros(count), heading)

    @property
    def kept(self) -> Indices:
        """Rows of the triangles that are not blocked."""
        return np.flatnonzero(self.reason == FREE)

    def corners(self, rows: Indices) -> Array:
        """(k, 3, 2) [m]"""
        return self.mesh.points[self.mesh.triangles[rows]]

    def choice(self, rows: Indices) -> Choice:
        """The best minorants for these triangles, where the flow is; with a zone, for its heading."""
        zone = self.ground.zone
        if zone is not None:
            corners = self.corners(rows)
            return zone.choice(self.ground.features, corners, self.flow[rows], self.heading[rows])
        if self.ground.lengths:
            return Choice.constant(len(rows))
        candidate, distance = _candidates(self.ground, self.mesh, self.nearest, rows)
        return choose(self.ground.law, distance, candidate, self.flow[rows])

    def divided(self, marked: Mask) -> Cover:
        """With the marked triangles (t,) halved; halves share their parent's time."""
        mesh = self.mesh.refined(marked)
        parent = mesh.parent
        halves = np.bincount(parent, minlength=len(self.mesh.triangles))[parent]
        fresh = mesh.points[len(self.mesh.vertices) :]
        nearest = np.concatenate([self.nearest, self.ground.features.nearest(fresh)])
        reason = self.reason[parent]
        new = np.flatnonzero((halves > 1) & (reason == FREE))
        reason = _reasons(self.ground, mesh, nearest, reason, new)
        flow = np.where((halves > 1)[:, None], CENTRE, self.flow[parent])
        return Cover(
            self.ground, mesh, nearest, reason, flow, self.time[parent] / halves, self.heading[parent]
        )

    def grown(self, marks: Callable[[Cover], Mask], target: int) -> Cover:
        """Divided by `marks` again and again, until `target` triangles are kept or none is marked."""
        cover = self
        while len(cover.kept) < target:
            marked = marks(cover) & cover.mesh.divisible & (cover.reason == FREE)
            if not marked.any():
                break
            cover = cover.divided(marked)
        return cover

    def locate(self, point: Array) -> int:
        """Row of a kept triangle that contains a point (2,) [m], decided exactly.

        Raises
        ------
        PlanningError : none does.
        """
        kept = self.kept
        inside = np.flatnonzero(barycentric(self.corners(kept), point).min(axis=1) >= -NEAR_SIDE)
        for row in kept[inside]:
            if _contains(self.corners(np.array([row]))[0], point):
                return int(row)
        raise PlanningError(f"no free triangle contains the point ({point[0]:g}, {point[1]:g}) m")


def barycentric_gradients(corners: Array) -> Array:
    """grad lambda_j [1/m] of triangles (t, 3, 2) [m]; (t, 3, 2)."""
    opposite = np.roll(corners, -2, axis=1) - np.roll(corners, -1, axis=1)
    one, two = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    double = one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]
    turned = np.stack([-opposite[..., 1], opposite[..., 0]], axis=2)
    return np.asarray(turned / double[:, None, None])


def barycentric(corners: Array, point: Array) -> Array:
    """Barycentric coordinates (t, 3) of a point (2,) [m] in triangles (t, 3, 2) [m]."""
    to_point = point - np.roll(corners, -1, axis=1)  # from another corner than the coordinate's own
    return np.asarray(np.einsum("tjk,tjk->tj", barycentric_gradients(corners), to_point))


def _contains(corners: Array, point: Array) -> bool:
    """Whether a closed anticlockwise triangle (3, 2) contains a point (2,), in exact arithmetic."""
    return bool((side_of(corners, np.roll(corners, -1, axis=0), point) >= 0).all())


def _candidates(ground: Ground, mesh: Mesh, nearest: Indices, rows: Indices) -> tuple[Indices, Array]:
    """Features (k, 4) that are near at the corners or in the middle, and their distances (k, 4, 3) [m]."""
    triangles = mesh.triangles[rows]
    corners = mesh.points[triangles]
    middle = ground.features.nearest(corners.mean(axis=1))
    candidate = np.concatenate([nearest[triangles], middle[:, None]], axis=1)
    which = np.broadcast_to(candidate[:, :, None], (len(rows), 4, 3))
    return candidate, ground.features.distance(corners[:, None], which)


def _reasons(ground: Ground, mesh: Mesh, nearest: Indices, reason: Indices, rows: Indices) -> Indices:
    """`reason` with those of `rows` found out; a triangle with an end in it is never blocked."""
    candidate, distance = _candidates(ground, mesh, nearest, rows)
    corners = mesh.points[mesh.triangles[rows]]
    found = blocked_by(ground.features, ground.solids, ground.law.level, corners, distance, candidate)
    for end in (ground.start, ground.goal):
        found[barycentric(corners, end).min(axis=1) >= -NEAR_SIDE] = FREE
    new = reason.copy()
    new[rows] = found
    return new
