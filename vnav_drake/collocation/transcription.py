"""How a path between knots is written down: circular arcs (here), or Hermite-Simpson."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from pydrake.solvers import MathematicalProgram

from vnav_drake.collocation.blocks import Block, Layout, friction_block, geometry_block, lateral_block
from vnav_drake.collocation.mesh import Mesh
from vnav_drake.collocation.turning import rate_block
from vnav_drake.plan import Model
from vnav_drake.problem import Problem

Array = NDArray[np.float64]
Index = NDArray[np.int64]

LIMIT_SHARE = 1.0 - 1e-6  # of the steering limit, so that rounding in the solver cannot exceed it
TURN_RESERVE = 2e-7  # [rad] of each interval's turn: twice the solver's feasibility tolerance


class Transcription(Protocol):
    """The part of the program that depends on the shape of the path between knots."""

    name: str

    def extra(self, intervals: int) -> int:
        """Number of variables beside x, y, theta, v and L; they come last."""

    def guess(self, mesh: Mesh) -> Array:
        """(extra,) first values of those variables."""

    def blocks(
        self, layout: Layout, problem: Problem, shares: Array, run: Index, model: Model, rate: float
    ) -> list[Block]:
        """Geometry of the intervals `run`; in the full model also the limits on turning.

        `rate` is the steering rate allowed [rad/s].
        """

    def limit_steering(
        self, prog: MathematicalProgram, z: Array, layout: Layout, problem: Problem, shares: Array
    ) -> None:
        """Add |kappa| <= 1/r_kin, which is linear."""

    def geometry(self, mesh: Mesh, extra: Array) -> Mesh:
        """The solution as arcs, on a finer mesh where need be."""


class Arcs:
    """One circular arc an interval: friction, tip-over and steering are exact at its ends."""

    name = "arcs"

    def extra(self, intervals: int) -> int:
        return 0

    def guess(self, mesh: Mesh) -> Array:
        return np.zeros(0)

    def blocks(
        self, layout: Layout, problem: Problem, shares: Array, run: Index, model: Model, rate: float
    ) -> list[Block]:
        blocks = [geometry_block(layout, shares, run)]
        if model == "full":
            blocks.append(friction_block(layout, problem, shares, run))
            if problem.lateral_limit < problem.robot.friction_acceleration:
                blocks.append(lateral_block(layout, problem, shares, run))
            first = run[run < layout.intervals - 1]
            if np.isfinite(rate) and len(first) > 0:
                blocks.append(rate_block(layout, problem.robot, rate, shares, first))
        return blocks

    def limit_steering(
        self, prog: MathematicalProgram, z: Array, layout: Layout, problem: Problem, shares: Array
    ) -> None:
        """|theta_1 - theta_0| <= limit f L, less the solver's tolerance."""
        n, i = layout.intervals, np.arange(layout.intervals)
        matrix = np.zeros((2 * n, layout.knots + 1))
        for sign, rows in ((1.0, i), (-1.0, n + i)):
            matrix[rows, i], matrix[rows, i + 1] = -sign, sign
            matrix[rows, -1] = -problem.robot.max_curvature * LIMIT_SHARE * shares
        variables = np.append(z[layout.theta(np.arange(layout.knots))], z[layout.length])
        prog.AddLinearConstraint(matrix, np.full(2 * n, -np.inf), np.full(2 * n, -TURN_RESERVE), variables)

    def geometry(self, mesh: Mesh, extra: Array) -> Mesh:
        return mesh
