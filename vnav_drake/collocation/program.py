"""The program of one mesh: variables, blocks and bounds in a Drake MathematicalProgram."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.autodiffutils import ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.solvers import CommonSolverOption, MathematicalProgram, SnoptSolver, SolverOptions

from vnav_drake.collocation.blocks import Block, Layout, clearance_block, drive_block, travel_time
from vnav_drake.collocation.mesh import Mesh
from vnav_drake.collocation.transcription import Arcs, Transcription
from vnav_drake.collocation.zone_blocks import (
    held_arc_block,
    near_pairs,
    planned_zone,
    zone_block,
)
from vnav_drake.convex import ConvexPieces
from vnav_drake.plan import Model
from vnav_drake.problem import PlanningError, Problem
from vnav_drake.zones.rows import held_arc_limit

Array = NDArray[np.float64]

BLOCK_INTERVALS = 20  # a block's dense derivative crosses into Drake: small blocks waste less
LEAST_SPEED = 1e-3  # [m/s] at inner knots, which keeps the travel time finite
SMOOTHING = 2e-7  # of the travel time: price of a step of 1/D in curvature, D the usual distance to obstacles
KEEP_SHARE = 0.35  # of the distance to obstacles: a square that lies in the circle of half of it
FEASIBILITY = 1e-7  # solver tolerance; the final motion does not rely on it
ARCS = Arcs()
SNOPT_OPTIONS = {
    "Major feasibility tolerance": FEASIBILITY,
    "Minor feasibility tolerance": FEASIBILITY,
    "Major optimality tolerance": 1e-4,  # 1e-5 changes the travel time by under 1e-8
    "QPSolver": "QN",  # a fifth faster than Cholesky: many of the speeds stay superbasic
    "Major iterations limit": 500,
    "Minor iterations limit": 50_000,
    "Superbasics limit": 3000,
}
# The gap of a zone with kinks has them too, and there the last digits are never found; the motion is retimed.
ZONE_OPTIONS = {
    "Major feasibility tolerance": 1e-5,
    "Minor feasibility tolerance": 1e-6,
    "Major optimality tolerance": 5e-4,
    "Major iterations limit": 100,
}


@dataclass(frozen=True)
class Solution:
    """What the solver returned; its status is a hint, never a proof."""

    mesh: Mesh  # at the program's knots
    geometry: Mesh  # the same path as arcs; the mesh itself where an interval is one arc
    travel_time: float  # [s]
    success: bool
    status: str
    iterations: int
    solve_time: float  # [s]


def solve(
    problem: Problem,
    guess: Mesh,
    pieces: ConvexPieces,
    model: Model,
    *,
    reach: float,
    keep_near: bool = False,
    steering_rate: float = math.inf,
    transcription: Transcription = ARCS,
) -> Solution:
    """Minimise the travel time on the guess's mesh, from the guess.

    Parameters
    ----------
    model : "variational": braking distance and greatest speed. "full": every limit of the robot and
        its end speeds and headings.
    reach : [m], pieces are considered where their distance at the guess exceeds the least by at most
        this; a knot that moves by less than half of it misses none.
    keep_near : each knot stays within half its clearance of the guess, so that no obstacle changes sides
        where the guess is clear of all.
    steering_rate : [rad/s], used in the full model.
    """
    layout = Layout(guess.intervals)
    prog = MathematicalProgram()
    z = prog.NewContinuousVariables(layout.size + transcription.extra(guess.intervals), "z")
    lower, upper = _bounds(problem, guess, layout, model, keep_near)
    prog.AddBoundingBoxConstraint(lower, upper, z[: layout.size])
    for block in _blocks(problem, guess, layout, pieces, model, reach):
        _add(prog, z, block)
    for run in _runs(layout.intervals):
        for block in transcription.blocks(layout, problem, guess.shares, run, model, steering_rate):
            _add(prog, z, block)
    if model == "full":
        transcription.limit_steering(prog, z, layout, problem, guess.shares)
    counter = _Counter()
    timed = np.append(z[layout.v(np.arange(layout.knots))], z[layout.length])
    prog.AddCost(_time_cost(guess.shares, counter), vars=timed)
    span = float(np.median(np.abs(problem.world.distance(guess.points))))
    _prefer_even_curvature(prog, z, layout, guess, span)
    start = np.concatenate([guess.x, guess.y, guess.theta, guess.v, [guess.length]])
    start = np.concatenate([np.clip(start, lower, upper), transcription.guess(guess)])
    begun = time.perf_counter()
    try:
        result = SnoptSolver().Solve(prog, start, _options(problem))
    except RuntimeError as error:  # Drake wraps what a constraint raises, an interruption too
        raise PlanningError(f"SNOPT could not go on: {error}") from error
    took = time.perf_counter() - begun
    values = result.GetSolution(z)
    x, y, theta, v = values[: layout.length].reshape(4, -1)
    v = np.maximum(v, np.maximum(lower[layout.v(np.arange(layout.knots))], 0.0))
    mesh = Mesh(guess.shares, x, y, theta, v, float(values[layout.length]))
    seconds = travel_time(v, guess.shares, mesh.length)[0]
    status = result.get_solution_result().name.removeprefix("k")
    geometry = transcription.geometry(mesh, values[layout.size :])
    return Solution(mesh, geometry, seconds, result.is_success(), status, counter.count, took)


def _add(prog: MathematicalProgram, z: Array, block: Block) -> None:
    binding = prog.AddConstraint(_for_drake(block), block.lower, block.upper, z[block.variables], block.name)
    pattern = list(zip(block.rows.tolist(), block.cols.tolist(), strict=True))
    binding.evaluator().SetGradientSparsityPattern(pattern)


def _runs(count: int) -> list[NDArray[np.int64]]:
    return [np.arange(b, min(b + BLOCK_INTERVALS, count)) for b in range(0, count, BLOCK_INTERVALS)]


class _Counter:
    """Counts evaluations of the cost with derivatives: about one an iteration."""

    count = 0


def _options(problem: Problem) -> SolverOptions:
    options = SolverOptions()
    chosen = SNOPT_OPTIONS if problem.zone is None else SNOPT_OPTIONS | ZONE_OPTIONS
    for name, value in chosen.items():
        options.SetOption(SnoptSolver.id(), name, value)
    # without a print file SNOPT writes some messages to standard output
    options.SetOption(CommonSolverOption.kPrintFileName, os.devnull)
    return options


def _bounds(
    problem: Problem, guess: Mesh, layout: Layout, model: Model, keep_near: bool
) -> tuple[Array, Array]:
    lower, upper = np.full(layout.size, -np.inf), np.full(layout.size, np.inf)
    knots = np.arange(layout.knots)
    lower[layout.v(knots)] = LEAST_SPEED
    lower[layout.v(np.array([0, -1]) % layout.knots)] = 0.0
    upper[layout.v(knots)] = problem.robot.max_speed
    lower[layout.length] = 0.5 * guess.length
    upper[layout.length] = 2.0 * guess.length + 4.0 * math.pi / problem.robot.max_curvature
    if keep_near:
        room = KEEP_SHARE * np.maximum(problem.world.distance(guess.points), 0.0)
        for at, place in ((layout.x(knots), guess.x), (layout.y(knots), guess.y)):
            lower[at], upper[at] = place - room, place + room
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
    blocks = []
    if model == "full":
        arcs = held_arc_limit(problem)
        for run in _runs(layout.intervals):
            blocks.append(drive_block(layout, problem, guess.shares, run))
            if arcs is not None:
                blocks.append(held_arc_block(layout, problem, arcs, guess.shares, run))
    zone = None if problem.zone is None else planned_zone(problem.zone)
    if zone is None:
        clearance = np.maximum(problem.world.distance(guess.points), 0.0)
        knot, piece = pieces.near(guess.points, clearance + reach)
    else:
        knot, piece = near_pairs(zone, pieces, guess, reach)
    for run in _runs(layout.knots):
        mine = (knot >= run[0]) & (knot <= run[-1])
        if not np.any(mine):
            continue
        if zone is None:
            blocks.append(clearance_block(layout, problem, pieces, knot[mine], piece[mine]))
        else:
            blocks.append(zone_block(layout, zone, pieces, knot[mine], piece[mine]))
    return blocks


def _prefer_even_curvature(
    prog: MathematicalProgram, z: Array, layout: Layout, guess: Mesh, span: float
) -> None:
    """Add SMOOTHING T sum (D (kappa_2 - kappa_1))^2, quadratic in the headings at the guess's length.

    D is the `span` [m].

    The travel time hardly tells a bend from one that overshoots within a knot's distance. Of motions
    that take the same time this prefers the one that steers less.
    """
    n = layout.intervals
    if n < 2:
        return
    pace = 1.0 / (guess.shares * guess.length)
    step = np.zeros((n - 1, n + 1))  # kappa_2 - kappa_1 = step @ theta
    i = np.arange(n - 1)
    step[i, i], step[i, i + 1], step[i, i + 2] = pace[:-1], -pace[:-1] - pace[1:], pace[1:]
    theta = z[layout.theta(np.arange(layout.knots))]
    seconds = travel_time(guess.v, guess.shares, guess.length)[0]
    weight = 2.0 * SMOOTHING * seconds * span**2
    prog.AddQuadraticCost(weight * step.T @ step, np.zeros(n + 1), theta, is_convex=True)


def _for_drake(block: Block) -> Callable[[Array], Array]:
    """The block as Drake calls it: with floats, or with AutoDiff scalars for the derivative."""
    identity = np.eye(len(block.variables))

    def evaluate(z: Array) -> Array:
        if z.dtype == float:
            return block.evaluate(z)[0]
        value, data = block.evaluate(ExtractValue(z).ravel())
        jacobian, seed = block.jacobian(data), ExtractGradient(z)
        if not np.array_equal(seed, identity):  # solvers ask for plain derivatives
            jacobian = jacobian @ seed
        return InitializeAutoDiff(value, jacobian)

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
