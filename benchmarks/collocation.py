"""The warehouse program in Drake + SNOPT against the same program in CasADi + IPOPT.

Same variables, constraints, mesh and first guess; CasADi has exact sparse Hessians by automatic
differentiation, ours analytic first derivatives. Solve times only, building excluded on both sides.
"""

from __future__ import annotations

import statistics
import time

import casadi
import numpy as np

from vnav_drake.braking import UniformBraking
from vnav_drake.collocation.blocks import Layout
from vnav_drake.collocation.mesh import Mesh
from vnav_drake.collocation.program import LEAST_SPEED, solve
from vnav_drake.collocation.seed import first_mesh
from vnav_drake.convex import ConvexPieces
from vnav_drake.plan import Model, Path
from vnav_drake.problem import End, Problem
from vnav_drake.robot import Robot
from vnav_drake.world import Obstacle, World

REACH = 1.0  # [m]
ROUNDS = 5
CORNER = [(28.5, 1.9), (3.5, 2.0), (2.0, 3.5), (2.0, 22.0)]  # bottom corridor, left corridor


def warehouse(end_speed: str) -> Problem:
    """The warehouse of the gallery, friction 0.6."""
    racks = [
        Obstacle(((x, y), (x + 10.0, y), (x + 10.0, y + 5.0), (x, y + 5.0)))
        for x in (4.0, 15.0)
        for y in (4.0, 10.0, 16.0, 22.0)
    ]
    return Problem(
        world=World.build([[0, 0], [32, 0], [32, 31], [0, 31]], racks),
        robot=Robot(radius=0.4),
        braking=UniformBraking(max_braking=1.0),
        start=End(position=(28.5, 1.9), speed=end_speed),  # type: ignore[arg-type]
        goal=End(position=(2.0, 22.0), speed=end_speed),  # type: ignore[arg-type]
    )


def casadi_solver(problem: Problem, guess: Mesh, pieces: ConvexPieces, model: Model) -> casadi.Function:
    """The program as CasADi sees it, ready to solve; returns (solver, arguments)."""
    layout, robot = Layout(guess.intervals), problem.robot
    k = np.arange(layout.knots)
    z = casadi.SX.sym("z", layout.size)
    x, y, theta, v = (z[at(k).tolist()] for at in (layout.x, layout.y, layout.theta, layout.v))
    ds = casadi.DM(guess.shares) * z[layout.length]
    turn, mean = theta[1:] - theta[:-1], 0.5 * (theta[1:] + theta[:-1])
    half = 0.5 * turn
    series = 1.0 - half**2 / 6.0 * (1.0 - half**2 / 20.0)
    safe = casadi.if_else(casadi.fabs(half) < 1e-3, 1.0, half)
    chord = ds * casadi.if_else(casadi.fabs(half) < 1e-3, series, casadi.sin(safe) / safe)
    zero, one, many = np.zeros, np.ones, np.full
    n = guess.intervals
    rows = [
        (x[1:] - x[:-1] - chord * casadi.cos(mean), zero(n), zero(n)),
        (y[1:] - y[:-1] - chord * casadi.sin(mean), zero(n), zero(n)),
    ]
    clearance = np.maximum(problem.world.distance(guess.points), 0.0)
    knot, piece = pieces.near(guess.points, clearance + REACH)
    gap = _box_distance(x[knot.tolist()], y[knot.tolist()], pieces.bounds[piece])
    need = v[knot.tolist()] ** 2 / (2.0 * problem.braking.max_braking)
    rows.append((gap - robot.radius - need, zero(len(knot)), many(len(knot), np.inf)))
    if model == "full":
        a, kappa = (v[1:] ** 2 - v[:-1] ** 2) / (2.0 * ds), turn / ds
        rows.append((a, many(n, -robot.max_braking), many(n, robot.max_acceleration)))
        for speed in (v[:-1], v[1:]):
            circle = (a**2 + (speed**2 * kappa) ** 2) / robot.friction_acceleration**2
            rows.append((circle, many(n, -np.inf), one(n)))
        bend = robot.max_curvature
        rows.append((turn - bend * ds, many(n, -np.inf), zero(n)))
        rows.append((-turn - bend * ds, many(n, -np.inf), zero(n)))
    lower, upper = many(layout.size, -np.inf), many(layout.size, np.inf)
    lower[layout.v(k)] = LEAST_SPEED
    lower[layout.length] = 0.5 * guess.length
    upper[layout.length] = 2.0 * guess.length + 4.0 * np.pi / robot.max_curvature
    for end, i in ((problem.start, 0), (problem.goal, n)):
        fixed = [(layout.x(i), end.position[0]), (layout.y(i), end.position[1])]
        if model == "full" and end.fixed_speed is not None:
            fixed.append((layout.v(i), end.fixed_speed))
        else:
            lower[layout.v(i)] = 0.0
        for index, value in fixed:
            lower[index] = upper[index] = value
    cost = casadi.sum1(2.0 * ds / (v[1:] + v[:-1]))
    program = {"x": z, "f": cost, "g": casadi.vertcat(*(row[0] for row in rows))}
    quiet = {"ipopt.print_level": 0, "print_time": False, "ipopt.sb": "yes", "ipopt.tol": 1e-7}
    solver = casadi.nlpsol("warehouse", "ipopt", program, quiet)
    start = np.concatenate([guess.x, guess.y, guess.theta, guess.v, [guess.length]])
    arguments = {
        "x0": np.clip(start, lower, upper),
        "lbx": lower,
        "ubx": upper,
        "lbg": np.concatenate([row[1] for row in rows]),
        "ubg": np.concatenate([row[2] for row in rows]),
    }
    return solver, arguments


def _box_distance(x: casadi.SX, y: casadi.SX, bounds: np.ndarray) -> casadi.SX:
    """Signed distance to axis-parallel boxes, which all pieces of the warehouse are."""
    low_x, low_y, high_x, high_y = (casadi.DM(column) for column in bounds.T)
    dx = casadi.fmax(low_x - x, x - high_x)
    dy = casadi.fmax(low_y - y, y - high_y)
    out_x, out_y = casadi.fmax(dx, 0.0), casadi.fmax(dy, 0.0)
    corner = casadi.logic_and(dx > 0.0, dy > 0.0)
    square = casadi.if_else(corner, out_x**2 + out_y**2, 1.0)
    return casadi.if_else(corner, casadi.sqrt(square), casadi.fmax(dx, dy))


def main() -> None:
    """Print a table of medians and their ratio."""
    print("collocation of the warehouse, N = 100: median solve time [s] of", ROUNDS)
    print(f"{'model':<26}{'Drake+SNOPT':>12}{'CasADi+IPOPT':>14}{'ratio':>8}{'relative difference of T':>26}")
    for model, ends in (("variational", "safe"), ("full", "safe"), ("full", "rest")):
        problem = warehouse(ends)
        pieces = ConvexPieces.of(problem.world)
        guess = first_mesh(problem, Path.polyline(CORNER), 100)
        solver, arguments = casadi_solver(problem, guess, pieces, model)
        ours, peers, difference = [], [], 0.0
        for _ in range(ROUNDS):
            mine = solve(problem, guess, pieces, model, reach=REACH)
            begun = time.perf_counter()
            peer = solver(**arguments)
            peers.append(time.perf_counter() - begun)
            ours.append(mine.solve_time)
            difference = mine.travel_time / float(peer["f"]) - 1.0
        one, other = statistics.median(ours), statistics.median(peers)
        print(
            f"{model + ', ' + ends + ' ends':<26}{one:12.3f}{other:14.3f}{one / other:8.2f}{difference:26.1e}"
        )


if __name__ == "__main__":
    main()
