"""Clearance of 100,000 points in a world of 2,000 vertices, against Shapely on the united obstacles.

Shapely gets the same signed distance from its own calls: the distance to all lines as one geometry,
and point in polygon for the sign. Both answers are compared before the times are.
"""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable

import numpy as np
import shapely
from numpy.typing import NDArray

from vnav_drake.world import Obstacle, World

Array = NDArray[np.float64]

POINTS = 100_000
ROUNDS = 5
SIDE = 60.0  # [m]


def scattered_hexagons() -> World:
    """333 irregular hexagons in a square room: 2,002 vertices."""
    rng = np.random.default_rng(7)
    cell = np.stack(np.divmod(np.arange(333), 19), axis=1)
    center = 3.0 * cell + 2.0 + rng.uniform(-0.3, 0.3, (333, 2))
    angle = 2.0 * math.pi * np.arange(6) / 6.0 + rng.uniform(0.0, 1.0, (333, 1))
    radius = rng.uniform(0.3, 1.0, (333, 6, 1))
    rings = center[:, None] + radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    obstacles = [Obstacle(tuple(map(tuple, ring.tolist()))) for ring in rings]
    return World.build([(0.0, 0.0), (SIDE, 0.0), (SIDE, SIDE), (0.0, SIDE)], obstacles)


def by_shapely(floor: shapely.Geometry, lines: shapely.Geometry, points: Array) -> Array:
    """Signed distance (n,) [m] without a spatial index over the edges."""
    sign = np.where(shapely.contains_xy(floor, points[:, 0], points[:, 1]), 1.0, -1.0)
    return sign * shapely.distance(lines, shapely.points(points))


def median_time(run: Callable[[], object]) -> float:
    """[s], of several rounds after one to warm up."""
    run()
    times = []
    for _ in range(ROUNDS):
        begun = time.perf_counter()
        run()
        times.append(time.perf_counter() - begun)
    return statistics.median(times)


def main() -> None:
    """Print a table of medians and their ratio to Shapely."""
    world = scattered_hexagons()
    points = np.random.default_rng(1).uniform(0.0, SIDE, (POINTS, 2))
    united = shapely.Polygon(world.boundary).difference(shapely.union_all(world.blocked))
    lines = united.boundary
    shapely.prepare(united)
    shapely.prepare(lines)
    worst = float(np.max(np.abs(world.distance(points) - by_shapely(united, lines, points))))
    peer = median_time(lambda: by_shapely(united, lines, points))
    print(f"{POINTS} points, {len(world.vertices)} vertices: median time [s] of {ROUNDS}")
    print(f"largest difference between the two: {worst:.1e} m")
    print(f"{'call':<34}{'time':>8}{'ratio':>8}")
    rows: list[tuple[str, Callable[[], object]]] = [
        ("World.distance", lambda: world.distance(points)),
        ("World.distance_and_gradient", lambda: world.distance_and_gradient(points)),
    ]
    for name, run in rows:
        own = median_time(run)
        print(f"{name:<34}{own:8.3f}{own / peer:8.3f}")
    print(f"{'shapely.distance to the union':<34}{peer:8.3f}{1.0:8.3f}")
    print(f"{'World.build':<34}{median_time(scattered_hexagons):8.3f}")


if __name__ == "__main__":
    main()
