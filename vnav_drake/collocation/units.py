"""Time in units that make the braking limit one, so that the solver sees the same numbers whatever a_b is."""

from __future__ import annotations

import math
from dataclasses import replace

from vnav_drake.problem import End, Problem
from vnav_drake.zones.convex_zone import GaugeZone


def unit_braking(problem: Problem) -> tuple[Problem, float]:
    """The same problem with a_b = 1 m/s^2, and the length [s] of its unit of time.

    With t = tau t', tau = 1/sqrt(a_b), lengths stay, speeds divide by sqrt(a_b), accelerations by a_b:
    every limit keeps its place, so paths agree and travel times scale with tau. A zone that is no gauge keeps
    its units.
    """
    if not (problem.zone is None or isinstance(problem.zone, GaugeZone)):
        return problem, 1.0  # it may know speeds of its own
    a_b = problem.braking.max_braking
    root = math.sqrt(a_b)
    robot, law = problem.robot, problem.braking
    scaled_robot = replace(
        robot,
        friction=robot.friction / a_b,
        com_height=robot.com_height * a_b,
        max_braking=robot.max_braking / a_b,
        max_acceleration=robot.max_acceleration / a_b,
        max_speed=robot.max_speed / root,
        max_steering_rate=robot.max_steering_rate / root,
    )
    scaled_law = replace(
        law, max_braking=1.0, reaction_time=law.reaction_time * root, max_speed=law.max_speed / root
    )
    start, goal = _scaled(problem.start, root), _scaled(problem.goal, root)
    zone = None if problem.zone is None else problem.zone.with_law(scaled_law)
    return (
        replace(problem, robot=scaled_robot, braking=scaled_law, zone=zone, start=start, goal=goal),
        1.0 / root,
    )


def _scaled(end: End, root: float) -> End:
    return end if isinstance(end.speed, str) else replace(end, speed=end.speed / root)
