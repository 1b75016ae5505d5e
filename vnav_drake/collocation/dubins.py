"""Seeds that turn: shortest paths of bounded curvature between two poses, where nothing is in the way.

A path along obstacles says nothing about headings; where an end has one, the robot may need a loop, which
no local change of such a path finds.
"""

from __future__ import annotations

import math
from itertools import product

import numpy as np
from numpy.typing import NDArray

from vnav_drake.collocation.seed import Seed
from vnav_drake.plan import Path
from vnav_drake.problem import End, Problem

Array = NDArray[np.float64]

EASE = 1.1  # turning radius over the least one, so that the seed lies within the limit
FREE_HEADINGS = 12  # tried where an end has none
MOST_SEEDS = 3  # the shortest that are clear
CLEARANCE_STEP = 0.05  # [of the radius of turning], between points at which clearance is looked at
FULL_TURN = 1e-9  # [rad]: a turn that lacks no more than this of a full one is rounding
WORDS = ("LSL", "RSR", "LSR", "RSL", "RLR", "LRL")


def dubins_seeds(problem: Problem) -> list[Seed]:
    """The shortest clear Dubins paths between the ends, none when neither end has a heading."""
    if problem.start.heading is None and problem.goal.heading is None:
        return []
    radius = EASE / problem.robot.max_curvature
    found = []
    for first, last in product(_headings(problem.start), _headings(problem.goal)):
        for word in WORDS:
            path = dubins_path(problem.start.point, first, problem.goal.point, last, radius, word)
            if path is not None and _is_clear(problem, path, radius):
                found.append(path)
    found.sort(key=lambda path: path.length)
    return [Seed(path, "dubins") for path in found[:MOST_SEEDS]]


def dubins_path(
    start: Array, first: float, goal: Array, last: float, radius: float, word: str
) -> Path | None:
    """Turn, straight or turn, turn from one pose to another.

    Parameters
    ----------
    start, goal : (2,) [m]; first, last : [rad], headings there.
    radius : [m], of every turn. word : such as "LSL" or "RLR".

    Returns
    -------
    None where the word does not reach.

    Notes
    -----
    Dubins 1957; closed forms of Shkel and Lumelsky 2001, table 1, lengths in units of the radius.
    """
    offset = goal - start
    d, theta = float(np.hypot(*offset)) / radius, math.atan2(offset[1], offset[0])
    a, b = first - theta, last - theta
    lengths = _lengths(word, d, a, b)
    if lengths is None:
        return None
    turn = {"L": 1.0, "R": -1.0, "S": 0.0}
    pieces = [(turn[letter] / radius, part * radius) for letter, part in zip(word, lengths, strict=True)]
    kept = [(kappa, length) for kappa, length in pieces if length > 1e-9 * radius]
    if not kept:
        return None
    curvature, length = zip(*kept, strict=True)
    return Path.from_arcs(start, first, curvature, length)


def _lengths(word: str, d: float, a: float, b: float) -> tuple[float, float, float] | None:
    """Lengths of the three parts; the mirror image of a word is the word with both angles negated."""
    if word[0] == "R":
        return _lengths(word.translate(str.maketrans("LR", "RL")), d, -a, -b)
    sin_a, sin_b, cos_a, cos_b, cos_ab = math.sin(a), math.sin(b), math.cos(a), math.cos(b), math.cos(a - b)
    if word == "LSL":
        square = 2.0 + d * d - 2.0 * cos_ab + 2.0 * d * (sin_a - sin_b)
        turn = math.atan2(cos_b - cos_a, d + sin_a - sin_b)
        return None if square < 0.0 else (_turn(turn - a), math.sqrt(square), _turn(b - turn))
    if word == "LSR":
        square = d * d - 2.0 + 2.0 * cos_ab + 2.0 * d * (sin_a + sin_b)
        if square < 0.0:
            return None
        p = math.sqrt(square)
        turn = math.atan2(-cos_a - cos_b, d + sin_a + sin_b) - math.atan2(-2.0, p)
        return _turn(turn - a), p, _turn(turn - b)
    cosine = (6.0 - d * d + 2.0 * cos_ab + 2.0 * d * (sin_b - sin_a)) / 8.0  # LRL
    if abs(cosine) > 1.0:
        return None
    p = 2.0 * math.pi - math.acos(cosine)
    t = _turn(-a + math.atan2(cos_b - cos_a, d + sin_a - sin_b) + 0.5 * p)
    return t, p, _turn(b - a - t + p)


def _turn(angle: float) -> float:
    """From 0 to a full turn, which itself counts as none."""
    full = 2.0 * math.pi
    wrapped = angle % full
    return 0.0 if full - wrapped < FULL_TURN else wrapped


def _headings(end: End) -> list[float]:
    if end.heading is not None:
        return [end.heading]
    return [2.0 * math.pi * k / FREE_HEADINGS for k in range(FREE_HEADINGS)]


def _is_clear(problem: Problem, path: Path, radius: float) -> bool:
    """Whether the robot fits everywhere, by the Lipschitz property between points."""
    count = 2 + math.ceil(path.length / (CLEARANCE_STEP * radius))
    x, y, _, _ = path.at(np.linspace(0.0, path.length, count))
    clearance = problem.clearance(np.column_stack([x, y])) - problem.braking.margin
    return bool(np.min(clearance) > 0.5 * path.length / (count - 1))
