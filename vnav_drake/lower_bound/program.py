"""The cone program: the greatest u(goal) - u(start) under the gradient bounds at all corners.

u is quadratic on each triangle, in Bernstein form: one control value per vertex and per edge. Its
gradient at corner i is 2 sum_j c_ij grad lambda_j, so each corner is one second-order cone of size three.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from pydrake.solvers import ClarabelSolver, MathematicalProgram, SolverOptions

from vnav_drake.lower_bound.cover import barycentric_gradients
from vnav_drake.lower_bound.inscribed import Ellipses
from vnav_drake.lower_bound.minorant import WEIGHT_GRID, Choice

HOLDS_ZERO = 0.98  # an ellipse holds zero well where it is at most this share of its size from the centre

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Elements:
    """Triangles of one connected part of the mesh, and the control values on them."""

    corners: Array  # (t, 3, 2) [m]
    control: Indices  # (t, 3, 3), number of the control value c_ij; symmetric
    choice: Choice  # of minorants
    count: int  # of control values
    allowed: Ellipses | None = None  # of gradients at 3 t corners; None: discs as large as the minorants

    @cached_property
    def gradients(self) -> Array:
        """2 grad lambda_j [1/m], (t, 3, 2)"""
        return 2.0 * barycentric_gradients(self.corners)

    def gradient(self, values: Array) -> Array:
        """grad u at the corners (t, 3, 2) for control values (n,); in the unit of the values per metre.

        As differences to the corner's own value, as the grad lambda_j add up to zero: least rounding.
        """
        own = np.einsum("tii->ti", self.control)
        step = values[self.control] - values[own][:, :, None]
        return np.asarray(np.einsum("tij,tjk->tik", step, self.gradients))

    def bounds(self, weight: Array) -> Array:
        """The minorants at the corners (t, 3) [s/m], with `weight` (t,) on the first of the two tangents."""
        one, two = self.choice.corner[:, 0], self.choice.corner[:, 1]
        return np.asarray(weight[:, None] * one + (1.0 - weight)[:, None] * two)


@dataclass(frozen=True, eq=False)
class Functional:
    """The value of u at a point: factors of some control values."""

    point: Array  # (2,) [m]
    number: Indices
    factor: Array

    def __call__(self, values: Array) -> float:
        """The value [s] for control values (n,) [s]."""
        return float(self.factor @ values[self.number])


@dataclass(frozen=True, eq=False)
class Solution:
    """What the solver gave; nothing of it is trusted."""

    values: Array  # (n,) [s], control values
    weight: Array  # (t,), of the first tangent in each triangle, on the grid of weights
    time: Array  # (t, 3), share of the travel time the optimal flow spends near each corner: its multiplier
    push: Array  # (t, 3), the multipliers themselves: where the bound would be raised with most effect
    status: str
    drift: Array | None = None  # (t, 2), the flow through each triangle; with `allowed` only


@dataclass(frozen=True)
class Setting:
    """How Clarabel is asked: rarely it meets a numerical error that another setting avoids."""

    tolerance: float  # of residuals and gap
    regularization: float = 1e-8  # constant part, added to the linear systems' diagonal
    step: float = 0.99  # share of the way to the cones' border that a step may take
    equilibrate: bool = True  # scale rows and columns once more

    def options(self) -> SolverOptions:
        """In Drake's words."""
        options = SolverOptions()
        for name in ("tol_gap_abs", "tol_gap_rel", "tol_feas"):
            options.SetOption(ClarabelSolver.id(), name, self.tolerance)
        options.SetOption(ClarabelSolver.id(), "static_regularization_constant", self.regularization)
        options.SetOption(ClarabelSolver.id(), "max_step_fraction", self.step)
        options.SetOption(ClarabelSolver.id(), "equilibrate_enable", int(self.equilibrate))
        return options


def solve(elements: Elements, start: Functional, goal: Functional, setting: Setting) -> Solution:
    """Maximise u(goal) - u(start).

    Rows are scaled so that each bound is about one: then the solver's residuals are relative errors of
    the bounds, in the smallest triangle as in the largest.
    """
    choice, count = elements.choice, len(elements.corners)
    typical = choice.corner[:, 0].max(axis=1)  # [s/m]
    scale = float(np.hypot(*(goal.point - start.point)) * np.median(typical)) or 1.0  # [s], of u
    rows = elements.gradients * (scale / typical)[:, None, None]
    limit = choice.corner / typical[:, None, None]
    program = MathematicalProgram()
    u = program.NewContinuousVariables(elements.count, "u")
    mixed = np.flatnonzero(choice.ridge)
    alpha = program.NewContinuousVariables(len(mixed), "alpha")
    share = np.empty(count, dtype=object)
    share[mixed] = alpha
    part: dict[tuple[int, int], NDArray[np.object_]] = {}
    if elements.allowed is None:
        matrix, offset = _discs(rows, limit, choice)
    else:
        matrix, offset, lifted = _ellipses(rows, elements.allowed, typical, choice)
        part = _parts(program, lifted, share, choice)
    cones = []
    for t, (mix, variables) in enumerate(zip(choice.ridge.tolist(), u[elements.control], strict=True)):
        for i in range(3):
            x = np.append(variables[i], share[t]) if mix else variables[i]
            if part and (t, i) in part:
                x = np.append(variables[i], part[t, i])
            cones.append(program.AddLorentzConeConstraint(matrix[t, i, :, : len(x)], offset[t, i], x))
    if len(mixed):
        program.AddBoundingBoxConstraint(0.0, 1.0, alpha)
    program.AddBoundingBoxConstraint(0.0, 0.0, u[start.number[:1]])  # u is free up to a constant
    program.AddLinearCost(-goal.factor, 0.0, u[goal.number])
    program.AddLinearCost(start.factor, 0.0, u[start.number])
    result = ClarabelSolver().Solve(program, None, setting.options())
    weight = np.ones(count)
    if len(mixed):
        weight[mixed] = _on_grid(result.GetSolution(alpha))
    values, drift = np.nan_to_num(result.GetSolution(u)) * scale, None
    if elements.allowed is None:
        multiplier = np.array([result.GetDualSolution(cone)[0] for cone in cones]).reshape(-1, 3)
        push = np.maximum(np.nan_to_num(multiplier), 0.0)
        time = push * (elements.bounds(weight) / typical[:, None])
    else:
        dual = np.nan_to_num([result.GetDualSolution(cone)[1:] for cone in cones]).reshape(-1, 2)
        flow = -np.einsum("cki,ck->ci", elements.allowed.inverse, dual).reshape(-1, 3, 2)
        push, drift = np.hypot(flow[..., 0], flow[..., 1]), flow.sum(axis=1)
        slope = elements.gradient(values) / typical[:, None, None]
        time = np.maximum(np.einsum("tci,tci->tc", flow, slope), 0.0)
    total = float(time.sum())
    return Solution(
        values=values,
        weight=weight,
        time=time / total if total > 0.0 else time,
        push=push,
        status=str(result.get_solver_details().status),
        drift=drift,
    )


def _discs(rows: Array, limit: Array, choice: Choice) -> tuple[Array, Array]:
    """Cones |g| <= m: matrix (t, 3, 3, 4), offset (t, 3, 3): triangle, corner, row of the cone, variable."""
    mixed, first = choice.ridge, limit[:, 0]
    matrix = np.zeros((len(rows), 3, 3, 4))
    matrix[:, :, 1:, :3] = np.swapaxes(rows, 1, 2)[:, None]
    matrix[mixed, :, 0, 3] = (first - limit[:, 1])[mixed]
    offset = np.zeros((len(rows), 3, 3))
    offset[:, :, 0] = np.where(mixed[:, None], limit[:, 1], first)
    return matrix, offset


def _parts(
    program: MathematicalProgram, lifted: NDArray[np.bool_], share: NDArray[np.object_], choice: Choice
) -> dict[tuple[int, int], NDArray[np.object_]]:
    """Variables for each lifted corner: the shares of its one or two ellipses, together at most one."""
    corner = np.argwhere(lifted)
    found = {}
    if len(corner):
        parts = program.NewContinuousVariables(len(corner), 2, "part")
        program.AddBoundingBoxConstraint(0.0, 1.0, parts.ravel())
        for (t, i), part in zip(corner.tolist(), parts, strict=True):
            found[t, i] = part if choice.ridge[t] else part[:1]
            if choice.ridge[t]:
                program.AddLinearConstraint(part[0] - share[t] <= 0.0)
                program.AddLinearConstraint(part[1] + share[t] <= 1.0)
    return found


def _ellipses(
    rows: Array, allowed: Ellipses, typical: Array, choice: Choice
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Cones |P^-1 (g - c)| <= sigma: c and sigma of the second ellipse, plus weight times the difference.

    Gradients of control values are the same at a triangle's corners: `rows` (t, 3, 2). Where an ellipse does
    not hold zero, the program could be infeasible: there the set of gradients, which is convex and holds
    zero, also holds shares of them, and the corner is `lifted` (t, 3): its cone is |P^-1 g - sum s_k c_k| <=
    sum s_k sigma_k.
    """
    inverse = allowed.inverse.reshape(-1, 3, 2, 2)
    centre = np.einsum("tcki,tcsi->tcsk", inverse, allowed.centre.reshape(-1, 3, 2, 2))
    centre /= typical[:, None, None, None]
    size = allowed.size.reshape(-1, 3, 2) / typical[:, None, None]
    mixed = choice.ridge
    matrix = np.zeros((len(rows), 3, 3, 5))
    matrix[:, :, 1:, :3] = np.einsum("tcki,tji->tckj", inverse, rows)
    matrix[mixed, :, 0, 3] = (size[..., 0] - size[..., 1])[mixed]
    matrix[mixed, :, 1:, 3] = (centre[:, :, 1] - centre[:, :, 0])[mixed]
    offset = np.zeros((len(rows), 3, 3))
    which = mixed.astype(np.int64)[:, None]
    offset[:, :, 0] = np.where(which == 1, size[..., 1], size[..., 0])
    offset[:, :, 1:] = -np.where(which[..., None] == 1, centre[:, :, 1], centre[:, :, 0])
    away = np.hypot(centre[..., 0], centre[..., 1]) > HOLDS_ZERO * size  # (t, 3, 2)
    lifted = np.where(mixed[:, None], away.any(axis=2), away[..., 0])
    matrix[lifted, 0, 3:] = size[lifted]
    matrix[lifted, 1:, 3:] = -np.swapaxes(centre[lifted], 1, 2)
    offset[lifted] = 0.0
    return matrix, offset, lifted


def _on_grid(weight: Array) -> Array:
    """Weights as multiples of `WEIGHT_GRID` from 0 to 1; what is not a number is 0."""
    return np.asarray(np.round(np.clip(np.nan_to_num(weight), 0.0, 1.0) / WEIGHT_GRID) * WEIGHT_GRID)
