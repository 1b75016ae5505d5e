"""The program of one mesh: variables, blocks and bounds in a Drake MathematicalProgram."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.autodiffutils import ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.solvers import MathematicalProgram, SnoptSolver, SolverOptions

from vnav_drake.collocation.blocks import (
    Block,
    Layout,
    arc_chord,
    clearance_block,
    drive_block,
    friction_block,
    geometry_block,
    lateral_block,
    travel_time,
)
from vnav_drake.convex import ConvexPieces
from vnav_drake.plan import Model, Path
from vnav_drake.problem import Problem

Array = NDArray[np.float64]

BLOCK_INTERVALS = 20  # a block's dense derivative crosses into Drake: small blocks waste less
LEAST_SPEED = 1e-3  # [m/s] at inner knots, which keeps the travel time finite
LIMIT_SHARE = 1.0 - 1e-6  # of the steering limit, so that rounding in the solver cannot exceed it
CLOSING_STEPS = 8
CLOSING_TOLERANCE = 1e-14  # of the path length
FEASIBILITY = 1e-7  # solver tolerance; the final motion does not rely on it
SNOPT_OPTIONS = {
    "Major feasibility tolerance": FEASIBILITY,
    "Minor feasibility tolerance": FEASIBILITY,
    "Major optimality tolerance": 1e-5,
    "Major iterations limit": 500,
    "Minor iterations limit": 50_000,
    "Superbasics limit": 3000,
}


@dataclass(frozen=True)
class Mesh:
    """A guess, or a solution: arcs of f L from knot to knot."""

    shares: Array  # (n,) f, positive, sum 1
    x: Array  # (n + 1,) [m]
    y: Array  # (n + 1,) [m]
    theta: Array  # (n + 1,) [rad], unwrapped
    v: Array  # (n + 1,) [m/s]
    length: float  # [m]

    @property
    def intervals(self) -> int:
        return len(self.shares)

    @property
    def points(self) -> Array:
        """(n + 1, 2) [m]"""
        return np.column_stack([self.x, self.y])

    def path(self, problem: Problem, model: Model) -> Path:
        """The arcs laid end to end, bent by the least change that ends them exactly at the goal.

        The solver leaves gaps of its tolerance between the arcs. Newton's method on the headings and
        the length with least-norm steps; it converges quadratically.
        """
        start, goal = problem.start.point, problem.goal.point
        heading = problem.goal.heading if model == "full" else None
        turns = model == "variational" or problem.start.heading is None
        theta, length, n = self.theta.copy(), self.length, self.intervals
        for _ in range(CLOSING_STEPS):
            chord, by = arc_chord(theta[:-1], theta[1:], self.shares * length)
            slope = np.zeros((3, n + 2))
            slope[:2, :n] += by[:, 0]
            slope[:2, 1 : n + 1] += by[:, 1]
            slope[:2, n + 1] = by[:, 2] @ self.shares
            slope[:2, 0] *= turns
            gap = np.append(start + chord.sum(axis=1) - goal, 0.0)
            if heading is not None:
                gap[2] = math.remainder(theta[-1] - heading, 2.0 * math.pi)
                slope[2, n] = 1.0
            if np.max(np.abs(gap)) <= CLOSING_TOLERANCE * max(1.0, length):
                break
            step = np.linalg.lstsq(slope, gap, rcond=None)[0]
            theta -= step[: n + 1]
            length -= float(step[-1])
        ds = self.shares * length
        return Path.from_arcs(start, float(theta[0]), np.diff(theta) / ds, ds)

    def split(self, counts: NDArray[np.int64]) -> Mesh:
        """The same motion with interval i cut into `counts[i]` >= 1 equal parts."""
        ds = self.shares * self.length
        heading, kappa = self.theta[:-1], np.diff(self.theta) / ds
        fine = Path(self.x, self.y, heading, kappa, ds).subdivided(counts)
        i = np.repeat(np.arange(len(counts)), counts)
        part = (np.arange(len(i)) - np.repeat(np.cumsum(counts) - counts, counts)) / counts[i]
        square = np.square(self.v)
        v = np.append(np.sqrt(square[i] + part * np.diff(square)[i]), self.v[-1])
        theta = np.append(fine.heading, self.theta[-1])
        return Mesh(self.shares[i] / counts[i], fine.x, fine.y, theta, v, self.length)


@dataclass(frozen=True)
class Solution:
    """What the solver returned; its status is a hint, never a proof."""

    mesh: Mesh
    travel_time: float  # [s]
    success: bool
    status: str
    iterations: int
    solve_time: float  # [s]


def solve(problem: Problem, guess: Mesh, pieces: ConvexPieces, model: Model, *, reach: float) -> Solution:
    """Minimise the travel time on the guess's mesh, from the guess.

    Parameters
    ----------
    model : "variational": braking distance and greatest speed. "full": every limit of the robot and
        its end speeds and headings.
    reach : [m], pieces are considered where their distance at the guess exceeds the least by at most
        this; a knot that moves by less than half of it misses none.
    """
    layout = Layout(guess.intervals)
    prog = MathematicalProgram()
    z = prog.NewContinuousVariables(layout.size, "z")
    lower, upper = _bounds(problem, guess, layout, model)
    prog.AddBoundingBoxConstraint(lower, upper, z)
    for block in _blocks(problem, guess, layout, pieces, model, reach):
        binding = prog.AddConstraint(
            _for_drake(block), block.lower, block.upper, z[block.variables], block.name
        )
        binding.evaluator().SetGradientSparsityPattern(
            list(zip(block.rows.tolist(), block.cols.tolist(), strict=True))
        )
    if model == "full":
        _limit_steering(prog, z, layout, guess.shares, problem.robot.max_curvature * LIMIT_SHARE)
    counter = _Counter()
    prog.AddCost(
        _time_cost(guess.shares, counter),
        vars=np.append(z[layout.v(np.arange(layout.knots))], z[layout.length]),
    )
    start = np.concatenate([guess.x, guess.y, guess.theta, guess.v, [guess.length]])
    begun = time.perf_counter()
    result = SnoptSolver().Solve(prog, np.clip(start, lower, upper), _options())
    took = time.perf_counter() - begun
    x, y, theta, v = result.GetSolution(z)[:-1].reshape(4, -1)
    mesh = Mesh(guess.shares, x, y, theta, v, float(result.GetSolution(z[-1])))
    seconds = travel_time(np.maximum(v, 0.0), guess.shares, mesh.length)[0]
    status = result.get_solution_result().name
    return Solution(mesh, seconds, result.is_success(), status, counter.count, took)


class _Counter:
    """Counts evaluations of the cost with derivatives: about one an iteration."""

    count = 0


def _options() -> SolverOptions:
    options = SolverOptions()
    for name, value in SNOPT_OPTIONS.items():
        options.SetOption(SnoptSolver.id(), name, value)
    return options


def _bounds(problem: Problem, guess: Mesh, layout: Layout, model: Model) -> tuple[Array, Array]:
    lower, upper = np.full(layout.size, -np.inf), np.full(layout.size, np.inf)
    knots = np.arange(layout.knots)
    lower[layout.v(knots)] = LEAST_SPEED
    lower[layout.v(np.array([0, -1]) % layout.knots)] = 0.0
    upper[layout.v(knots)] = problem.robot.max_speed
    lower[layout.length] = 0.5 * guess.length
    upper[layout.length] = 2.0 * guess.length
    for end, k in ((problem.start, 0), (problem.goal, layout.intervals)):
        fixed = [(layout.x(k), end.position[0]), (layout.y(k), end.position[1])]
        if model == "full":
            if end.fixed_speed is not None:
                fixed.append((layout.v(k), end.fixed_speed))
            if end.heading is not None:
                turns = round((guess.theta[k] - end.heading) / (2.0 * math.pi))
                fixed.append((layout.theta(k), end.heading + 2.0 * math.pi * turns))
        for index, value in fixed:
            lower[index] = upper[index] = value
    return lower, upper


def _blocks(
    problem: Problem, guess: Mesh, layout: Layout, pieces: ConvexPieces, model: Model, reach: float
) -> list[Block]:
    clearance = np.maximum(problem.world.distance(guess.points), 0.0)
    knot, piece = pieces.near(guess.points, clearance + reach)
    blocks = []
    for begin in range(0, layout.intervals, BLOCK_INTERVALS):
        run = np.arange(begin, min(begin + BLOCK_INTERVALS, layout.intervals))
        blocks.append(geometry_block(layout, guess.shares, run))
        if model == "full":
            blocks.append(drive_block(layout, problem, guess.shares, run))
            blocks.append(friction_block(layout, problem, guess.shares, run))
            if problem.lateral_limit < problem.robot.friction_acceleration:
                blocks.append(lateral_block(layout, problem, guess.shares, run))
    for begin in range(0, layout.knots, BLOCK_INTERVALS):
        mine = (knot >= begin) & (knot < begin + BLOCK_INTERVALS)
        if np.any(mine):
            blocks.append(clearance_block(layout, problem, pieces, knot[mine], piece[mine]))
    return blocks


def _for_drake(block: Block) -> Callable[[Array], Array]:
    """The block as Drake calls it: with floats, or with AutoDiff scalars for the derivative."""

    def evaluate(z: Array) -> Array:
        if z.dtype == float:
            return block.evaluate(z)[0]
        value, data = block.evaluate(ExtractValue(z).ravel())
        gradient = block.jacobian(data) @ ExtractGradient(z)
        return InitializeAutoDiff(value, gradient)

    return evaluate


def _time_cost(shares: Array, counter: _Counter) -> Callable[[Array], object]:
    def evaluate(z: Array) -> object:
        if z.dtype == float:
            return travel_time(z[:-1], shares, z[-1])[0]
        counter.count += 1
        values = ExtractValue(z).ravel()
        seconds, by_v, by_length = travel_time(values[:-1], shares, values[-1])
        gradient = np.append(by_v, by_length) @ ExtractGradient(z)
        return InitializeAutoDiff(np.array([seconds]), gradient[None])[0, 0]

    return evaluate


def _limit_steering(prog: MathematicalProgram, z: Array, layout: Layout, shares: Array, limit: float) -> None:
    """|theta_1 - theta_0| <= limit f L, which is linear."""
    n = layout.intervals
    matrix = np.zeros((2 * n, layout.knots + 1))
    i = np.arange(n)
    for sign, rows in ((1.0, i), (-1.0, n + i)):
        matrix[rows, i], matrix[rows, i + 1] = -sign, sign
        matrix[rows, -1] = -limit * shares
    variables = np.append(z[layout.theta(np.arange(layout.knots))], z[layout.length])
    prog.AddLinearConstraint(matrix, np.full(2 * n, -np.inf), np.zeros(2 * n), variables)
