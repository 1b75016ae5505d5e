"""Is the promise of a braking zone kept in turns? Stops with the steering held, along the warehouse.

Turning and braking share the friction, so a stop in a bend slows down by a_b or sqrt((mu g)^2 - kappa^2 v^4),
whichever is less, along an arc. Counted are the poses whose arc leads the robot's disc out of the zone
claimed there, and into an obstacle, at the curvature driven and at half of it: without friction in reserve
(mu g = a_b), and with it (mu g = 1.2 a_b).

`python -m benchmarks.held_stops`
"""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.zones import WAYS, plans, setting, zones_of
from vnav_drake.plan import Trajectory, arc_step
from vnav_drake.problem import Problem
from vnav_drake.zones.catalogue import ahead_with_reserve
from vnav_drake.zones.convex_zone import GaugeZone
from vnav_drake.zones.shapes import DiscZone, EllipseZone
from vnav_drake.zones.touch import separation

Array = NDArray[np.float64]

POSES = 800  # at even times
POINTS = 65  # of each arc
SHARES = (1.0, 0.5)  # of the curvature driven
FRICTION = 1.2  # mu g over a_b, with the reserve
MARGIN = 0.05  # [m] of the capsule with the reserve: without any, held arcs forbid it to turn
DEEP = 1e-3  # [m]: less is rounding and what the profile is rounded by


def held_way(problem: Problem, speed: Array, curvature: Array) -> Array:
    """Length (n,) [m] of stops with the steering held, by the integral of d(v^2) / (2 a).

    Derived: with G = mu g and u = |kappa| v^2 the robot slows down by sqrt(G^2 - u^2) while that is less than
    a_b, that is down to u* = sqrt(G^2 - a_b^2), over (asin(u / G) - asin(u* / G)) / (2 |kappa|), then by a_b.
    """
    robot, bend = problem.robot, np.abs(curvature)
    grip, brake = robot.friction_acceleration, robot.max_braking
    load = np.minimum(bend * speed**2, grip)
    spare = np.sqrt(max(0.0, (grip - brake) * (grip + brake)))
    turning = np.maximum(np.arcsin(load / grip) - np.arcsin(min(spare / grip, 1.0)), 0.0)
    turned = bend > 0.0
    shared = np.where(turned, turning / np.where(turned, 2.0 * bend, 1.0), 0.0)
    rest = np.where(load > spare, spare / np.where(turned, bend, 1.0), speed**2)
    return np.asarray(speed * problem.braking.reaction_time + shared + rest / (2.0 * brake))


def audit(problem: Problem, motion: Trajectory) -> dict[str, float]:
    """Poses whose stops leave the zone or hit something, and by how much at most [m]."""
    law, radius = problem.braking, problem.robot.radius
    zone = problem.zone or DiscZone(law=law, radius=radius)
    time = motion.travel_time * (np.arange(POSES) + 0.5) / POSES
    x, y, heading, v, _, kappa = motion.at(time)
    leaves, hits = np.zeros(POSES, dtype=bool), np.zeros(POSES, dtype=bool)
    out, deep = -np.inf, -np.inf
    for share in SHARES:
        way = held_way(problem, v, share * kappa)
        along = way[:, None] * np.linspace(0.0, 1.0, POINTS)
        ahead = arc_step(np.zeros((POSES, 1)), share * kappa[:, None], along)
        beyond = _outside(zone, np.stack(ahead, axis=-1), v)
        dx, dy = arc_step(heading[:, None], share * kappa[:, None], along)
        clearance = problem.clearance(np.stack([x[:, None] + dx, y[:, None] + dy], axis=-1)).min(axis=1)
        leaves |= beyond > DEEP
        hits |= clearance < -DEEP
        out, deep = max(out, float(beyond.max())), max(deep, float(-clearance.min()))
    return {"leave": int(leaves.sum()), "hit": int(hits.sum()), "out": out, "deep": deep}


def _outside(zone: object, points: Array, speed: Array) -> Array:
    """How far (n,) [m] the disc comes out of the zone at points (n, k, 2) [m] of the body's frame.

    Minus the separation of a point in the zone is its depth, at least the radius where the disc is inside.
    """
    if not isinstance(zone, GaugeZone):
        raise TypeError("only zones of one shape are audited")
    n, k, _ = points.shape
    gap = separation(zone, points.reshape(n * k, 1, 2), np.repeat(speed, k)).gap
    return np.asarray(gap.reshape(n, k).max(axis=1) + zone.radius)


def table(title: str, problem: Problem, zones: dict[str, GaugeZone]) -> None:
    """One row a zone and way."""
    print(f"\n{title}")
    print("way zone            T [s]  poses  leave   by [m]   hit  deep [m]")
    for way in WAYS if "B" in sys.argv[1:] else ["A"]:
        for row in plans(problem, way, zones):
            found = audit(row.problem, row.plan.trajectory)
            print(
                f"{way:<4}{row.zone:<14}{row.plan.travel_time:9.3f}{POSES:7d}{found['leave']:7d}"
                f"{max(found['out'], 0.0):9.3f}{found['hit']:6d}{max(found['deep'], 0.0):10.3f}",
                flush=True,
            )


def main() -> None:
    """Print both tables; with the argument B also the way through the gaps."""
    problem = setting()
    some = {name: zone for name, zone in zones_of(problem).items() if name != "ellipse 0.7"}
    table("mu g = a_b, no friction reserve", problem, some)
    problem = setting(FRICTION, reserve=True)
    reserve = problem.robot.reserved_lateral_acceleration()
    held: dict[str, GaugeZone] = {
        name: replace(zone, ahead=ahead_with_reserve(zone.lateral_ratio, reserve, zone.law))
        for name, zone in zones_of(problem).items()
        if isinstance(zone, EllipseZone) and name != "ellipse 0.7"
    }
    table(f"mu g = {FRICTION:g} a_b, friction reserve", problem, held)
    problem = setting(FRICTION, reserve=True, margin=MARGIN)
    capsule = {"capsule": zones_of(problem)["capsule"]}
    table(f"mu g = {FRICTION:g} a_b, friction reserve, margin {MARGIN:g} m", problem, capsule)


if __name__ == "__main__":
    main()
