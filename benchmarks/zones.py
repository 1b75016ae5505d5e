"""Braking zones that depend on the heading, on the warehouse: times, solving, what is proven, fields, bounds.

The setting of every figure: rest to rest, mu g = a_b = 1 m/s^2, no friction reserve, no margin, and steering
that never binds. Class A runs along the outer corridors, class B through the gaps at y = 9.5, x = 14.5 and
y = 21.5. Seconds are of the processor, so that they can be compared on a busy machine; the first row of each
class is uniform braking in the same run.

`python -m benchmarks zones`; what becomes of stops with the steering held is `benchmarks.held_stops`.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.collocation import warehouse
from verify.judge.motion import Motion
from verify.judge.zones.separation import least_separation
from verify.judge.zones.shapes import Disc, Ellipse, Shape, Straight
from verify.judge.zones.zone import GaugeZone as JudgedZone
from vnav_drake.collocation import Seed, plan_full, plan_variational
from vnav_drake.field_fitting import drive_fields, fit_fields
from vnav_drake.lower_bound import lower_bound
from vnav_drake.plan import COLUMNS, Path, Plan
from vnav_drake.problem import PlanningError, Problem
from vnav_drake.robot import GRAVITY
from vnav_drake.zones.convex_zone import GaugeZone
from vnav_drake.zones.shapes import EllipseZone, ProtectiveField

Array = NDArray[np.float64]

WAYS = {
    "A": [(28.5, 1.9), (3.5, 2.0), (2.0, 3.5), (2.0, 22.0)],
    "B": [(28.5, 1.9), (28.0, 9.5), (14.5, 9.5), (14.5, 21.5), (2.0, 21.5), (2.0, 22.0)],
}
RATIOS = (0.7, 0.5, 0.3)  # of ellipses, each seeded by the one before
COUNTS = (4, 8, 16)  # of fields
DWELL = 0.5  # [s]
BOUND_RATIO = 0.5
STEERING = 1.5  # [rad]: so much that it never binds, as it would in the corners of the gaps


@dataclass(frozen=True)
class Row:
    """One zone along one way."""

    way: str
    zone: str
    problem: Problem
    plan: Plan
    seconds: float  # of the processor


def setting(friction: float = 1.0, *, reserve: bool = False, margin: float = 0.0) -> Problem:
    """The warehouse from rest to rest with mu g = `friction` a_b, a_b = 1 m/s^2."""
    problem = warehouse("rest")
    return replace(
        problem,
        robot=replace(problem.robot, friction=friction / GRAVITY, max_steering=STEERING),
        braking=replace(problem.braking, margin=margin),
        friction_reserve=reserve,
    )


def plans(problem: Problem, way: str, zones: dict[str, GaugeZone]) -> Iterator[Row]:
    """Uniform braking, then each zone; the seed is the plan before, of capsules that of uniform braking.

    Uniform braking begins with the optimum of the variational model, which is not counted.
    """
    path = Path.polyline(WAYS[way])
    path = plan_variational(replace(problem, zone=None), path).path or path
    uniform: Plan | None = None
    for name, zone in {"uniform": None, **zones}.items():
        asked = replace(problem, zone=zone)
        if uniform is not None and isinstance(zone, ProtectiveField):
            path = uniform.path or path
        begun = time.process_time()
        try:
            plan = plan_full(asked, [Seed(path, as_mesh=False)])
        except PlanningError as error:
            print(f"{way} {name}: {error}")
            continue
        yield Row(way, name, asked, plan, time.process_time() - begun)
        uniform, path = uniform or plan, plan.path or path


def zones_of(problem: Problem) -> dict[str, GaugeZone]:
    """The zones of the study."""
    law, radius = problem.braking, problem.robot.radius
    found: dict[str, GaugeZone] = {
        f"ellipse {ratio:g}": EllipseZone(law=law, radius=radius, lateral_ratio=ratio) for ratio in RATIOS
    }
    return found | {"capsule": ProtectiveField(law=law, radius=radius)}


def judged_zone(problem: Problem) -> JudgedZone:
    """The zone as the judge sees it, from its own formulas."""
    zone, law, body = problem.zone, problem.braking, Disc(problem.robot.radius + problem.braking.margin)
    shape: Shape = Disc(1.0)
    if isinstance(zone, EllipseZone):
        shape = Ellipse(0.0, zone.ahead, zone.lateral_ratio)
    elif isinstance(zone, ProtectiveField):
        shape = Straight()
    return JudgedZone(shape, body, braking=law.max_braking, reaction_time=law.reaction_time)


def certified(row: Row) -> tuple[float, float]:
    """Least separation [m] proven in continuous time by the judge, and the seconds that takes."""
    world = row.problem.world
    sides = [np.column_stack([ring, np.roll(ring, -1, axis=0)]) for ring in _rings(world)]
    features = np.pad(np.concatenate(sides), ((0, 0), (0, 1)))
    motion = Motion(*(getattr(row.plan.trajectory, name) for name in COLUMNS))
    begun = time.process_time()
    found = least_separation(motion, features, judged_zone(row.problem))
    return found.proven, time.process_time() - begun


def _rings(world) -> Iterator[Array]:
    for polygon in (world.boundary, *world.blocked):
        yield np.asarray(polygon.exterior.coords)[:-1]


def table_of_times(rows: list[Row]) -> None:
    """Times, solving and what is proven between the rows."""
    print("way zone            T [s]  solve [s]  over uniform  proven [m]  in [s]")
    alone = {row.way: row.seconds for row in rows if row.zone == "uniform"}
    for row in rows:
        proven, seconds = certified(row)
        print(
            f"{row.way:<4}{row.zone:<14}{row.plan.travel_time:9.3f}{row.seconds:11.1f}"
            f"{row.seconds / alone[row.way]:14.2f}{proven:12.2e}{seconds:8.2f}"
        )


def table_of_fields(rows: list[Row]) -> None:
    """What a few switched fields cost, and how often they switch, alone and with a dwell."""
    print(f"\nfields fitted to each route: cost in travel time, switches; with a dwell of {DWELL:g} s")
    print(f"{'way':<4}{'zone':<14}" + "".join(f"{f'K = {count}':>26}" for count in COUNTS))
    for row in rows:
        motion, cells = row.plan.trajectory, []
        for count in COUNTS:
            fields = fit_fields(row.problem, motion, count)
            told = []
            for dwell in (0.0, DWELL):
                run = drive_fields(row.problem, motion, fields, dwell=dwell)
                cost = run.trajectory.travel_time / motion.travel_time - 1.0
                told.append(f"{100.0 * cost:6.2f} % {len(run.switches):4d}")
            cells.append(f"{' '.join(told):>26}")
        print(f"{row.way:<4}{row.zone:<14}" + "".join(cells))


def table_of_bounds() -> None:
    """The variational model between safe ends: the collocation against what no motion beats."""
    problem = warehouse("safe")
    zone = EllipseZone(law=problem.braking, radius=problem.robot.radius, lateral_ratio=BOUND_RATIO)
    problem = replace(problem, zone=zone)
    upper = plan_variational(problem, Path.polyline(WAYS["A"])).travel_time
    begun = time.process_time()
    found = lower_bound(problem, upper=upper, gap=0.005)
    seconds = time.process_time() - begun
    print(f"\nellipse {BOUND_RATIO:g}, safe ends: {upper:.4f} s, at least {found.travel_time:.4f} s", end="")
    print(f" ({100.0 * (upper / found.travel_time - 1.0):.3f} %), bound in {seconds:.1f} s")


def main() -> None:
    """Print the tables."""
    problem = setting()
    print(f"rest to rest, mu g = a_b = {problem.robot.max_braking:g} m/s^2, no reserve")
    rows = [row for way in WAYS for row in plans(problem, way, zones_of(problem))]
    table_of_times(rows)
    table_of_fields(rows)
    table_of_bounds()


if __name__ == "__main__":
    main()
