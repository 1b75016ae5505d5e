"""The speed graph as a stage: its plan, a seed for each class, and what the report draws of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from verify.graph_drawing import published_drawing, sampled_drawing
from verify.report.drawings import ClassDrawing, SpeedGraphDrawing
from vnav_drake.collocation import Seed
from vnav_drake.collocation.turning import greatest_steering_rate
from vnav_drake.homotopy import Gates, class_of
from vnav_drake.plan import Path, Plan, Trajectory
from vnav_drake.problem import End, PlanningError, Problem
from vnav_drake.scenario import PlanSettings
from vnav_drake.speed_graph import ClassOptimum, SpeedGraphResult, as_plan, speed_graph
from vnav_drake.speed_profile import fastest_profile
from vnav_drake.voronoi import VoronoiDiagram

SLOWEST_SEED = 4.0  # classes this many times slower than the best do not seed the collocation
SAME_HEADING = 1e-6  # [rad]: a path that begins or ends this near to the heading asked for has it


@dataclass(frozen=True, kw_only=True)
class Analytic:
    """What the speed graph gave."""

    plan: Plan
    seeds: Sequence[Seed]
    drawing: SpeedGraphDrawing


@dataclass(frozen=True, kw_only=True)
class FullProfile:
    """The full robot on a given path: its travel time, or why it cannot follow it."""

    travel_time: float | None = None  # [s]
    reason: str = ""

    def row(self) -> dict[str, Any]:
        """As in a row of `plans.speed_graph.classes`."""
        if self.travel_time is not None:
            return {"full_profile_time": self.travel_time}
        return {"full_profile_reason": self.reason}


def full_profile(problem: Problem, path: Path) -> FullProfile:
    """The fastest motion of the full robot along a path, with the ends that the problem asks for."""
    robot = problem.robot
    sharpest = float(np.abs(path.curvature).max())
    if sharpest > robot.max_curvature:
        return FullProfile(
            reason=f"bends with {sharpest:.3g} 1/m, the steering allows {robot.max_curvature:.3g} 1/m"
        )
    for name, end, heading in (
        ("start", problem.start, path.heading[0]),
        ("goal", problem.goal, path.end_heading[-1]),
    ):
        if _turned(end, float(heading)) > SAME_HEADING:
            return FullProfile(reason=f"has not the heading asked for at the {name}")
    try:
        motion = fastest_profile(problem, path, model="full")
    except PlanningError as error:
        return FullProfile(reason=str(error))
    rate = greatest_steering_rate(motion, robot) if math.isfinite(robot.max_steering_rate) else 0.0
    if rate > robot.max_steering_rate:
        return FullProfile(
            reason=f"the steering would turn at {rate:.3g} rad/s, it can {robot.max_steering_rate:.3g} rad/s"
        )
    return FullProfile(travel_time=motion.travel_time)


def _turned(end: End, heading: float) -> float:
    """[rad], between a heading and the one asked for; zero where none is."""
    return 0.0 if end.heading is None else abs(math.remainder(heading - end.heading, 2.0 * math.pi))


def run_speed_graph(
    problem: Problem,
    diagram: VoronoiDiagram,
    gates: Gates,
    settings: PlanSettings,
    progress: Callable[[str], None],
    driven: Problem | None = None,
) -> Analytic:
    """Plan with the speed graph; its classes become seeds and rows.

    `driven` is the problem whose full robot drives the paths, where it is not the one that is solved.

    Raises
    ------
    PlanningError : the method gave no answer.
    NoPathError : there is no path for this robot.
    """
    driven = problem if driven is None else driven
    plan, result = _solve(problem, diagram, settings, progress)
    profiles = [full_profile(driven, optimum.path) for optimum in result.classes]
    rows = [dict(row) | profile.row() for row, profile in zip(plan.details["classes"], profiles, strict=True)]
    best = profiles[0].row() if profiles else {}
    details: Mapping[str, Any] = {**plan.details, **best, "classes": rows}
    return Analytic(
        plan=replace(plan, details=details),
        seeds=_seeds(plan.method, result.classes, gates),
        drawing=_drawing(driven, result),
    )


def _seeds(method: str, classes: Sequence[ClassOptimum], gates: Gates) -> list[Seed]:
    """One seed a class, under the class of its path: without a certificate it may have left its own.

    Classes far slower than the best are ranked but not tried: they wind round obstacles, and cost the same.
    """
    seeds: dict[str, Seed] = {}
    limit = SLOWEST_SEED * min((optimum.travel_time for optimum in classes), default=0.0)
    for optimum in classes:
        if optimum.travel_time > limit:
            continue
        name = class_of(gates, optimum.path)
        seeds.setdefault(name, Seed(optimum.path, method, homotopy_class=name, as_mesh=False))
    return list(seeds.values())


def _solve(
    problem: Problem, diagram: VoronoiDiagram, settings: PlanSettings, progress: Callable[[str], None]
) -> tuple[Plan, SpeedGraphResult]:
    result = speed_graph(
        problem,
        diagram,
        classes=settings.homotopy_classes,
        graph=settings.graph,
        through=settings.through,
        progress=progress,
    )
    return as_plan(problem, result), result


def _drawing(problem: Problem, result: SpeedGraphResult) -> SpeedGraphDrawing:
    graphs = [sampled_drawing(result.sampled)]
    if result.published is not None:
        graphs.append(published_drawing(result.published))
    classes = [_class_drawing(problem, optimum) for optimum in result.classes]
    return SpeedGraphDrawing(graphs=graphs, classes=classes)


def _class_drawing(problem: Problem, optimum: ClassOptimum) -> ClassDrawing:
    motion: Trajectory | None
    try:
        motion = fastest_profile(problem, optimum.path, model="variational")
    except PlanningError:  # a path that is not certified may come too close
        motion = None
    return ClassDrawing(
        rank=optimum.rank,
        name=optimum.name,
        points=optimum.points,
        motion=motion,
        iteration_times=[step.time for step in optimum.history],
        residuals=[step.residual for step in optimum.history],
    )
