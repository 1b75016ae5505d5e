"""A result with a braking zone made by hand for the tests of the report: the warehouse, an ellipse."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from tests.report_case import corner_path, warehouse, write_folder
from verify.report.evidence import read_evidence
from verify.report.zone_along import Nearby
from vnav_drake.plan import Path, Trajectory
from vnav_drake.problem import Problem
from vnav_drake.scenario import Scenario
from vnav_drake.zones.convex_zone import GaugeZone
from vnav_drake.zones.shapes import EllipseZone

AHEAD = 1.04  # holds held arcs with mu g = 1.2 a_b and the reserve


def with_zone(scenario: Scenario, zone: GaugeZone, *, reserve: bool = True) -> Scenario:
    """The scenario with a zone in place of the disc."""
    problem = replace(scenario.problem, zone=zone, friction_reserve=reserve)
    return replace(scenario, problem=problem)


@cache
def zone_scenario(*, reserve: bool = True) -> Scenario:
    """The warehouse with an ellipse half as wide as it is long."""
    scenario = warehouse()
    ellipse = EllipseZone(law=scenario.problem.braking, radius=0.4, lateral_ratio=0.5, ahead=AHEAD)
    return with_zone(scenario, ellipse, reserve=reserve)


def timed(problem: Problem, path: Path, *, uniform: bool, step: float = 0.05) -> Trajectory:
    """As fast along `path` as zone (or disc), bends, drive and brakes allow at its samples; rest to rest."""
    fine = path.subdivided(np.maximum(1, np.ceil(path.piece_length / step)).astype(np.int64))
    clearance = problem.clearance(np.column_stack([fine.x, fine.y]))
    heading = np.append(fine.heading, fine.end_heading[-1])
    bend = np.abs(np.append(fine.curvature, fine.curvature[-1]))
    if uniform:
        square = problem.braking.speed(clearance) ** 2
    else:
        near = Nearby.of(problem.world, np.column_stack([fine.x, fine.y, heading]), 8.0)
        low, high = np.zeros(len(heading)), np.full(len(heading), 3.5)
        for _ in range(20):
            middle = 0.5 * (low + high)
            free = near.gap(problem.zone, middle) >= 0.0
            low, high = np.where(free, middle, low), np.where(free, high, middle)
        square = low**2
    square = np.minimum(square, problem.lateral_limit / np.maximum(bend, 1e-12))
    square[[0, -1]] = 0.0
    for i in range(len(square) - 1):
        square[i + 1] = min(square[i + 1], square[i] + 2.0 * fine.piece_length[i])
    for i in range(len(square) - 1, 0, -1):
        square[i - 1] = min(square[i - 1], square[i] + 2.0 * fine.piece_length[i - 1])
    v = np.sqrt(square)
    t = np.concatenate([[0.0], np.cumsum(2.0 * fine.piece_length / (v[1:] + v[:-1]))])
    a = np.diff(square) / (2.0 * fine.piece_length)
    ends = (np.append(a, a[-1]), np.append(fine.curvature, fine.curvature[-1]))
    return Trajectory(t, fine.x, fine.y, heading, v, *ends, clearance)


FAILED = {"t": 14.0, "x": 4.0, "y": 2.0, "heading": math.pi, "depth": 0.21, "kappa": -0.5}


def promise(*, kept: bool) -> dict[str, Any]:
    """What the audit of held stops says; `failed` lists one of them."""
    counts = {"poses": 800, "held_leaves": 0 if kept else 96, "held_collides": 0 if kept else 18}
    worst = {"worst_excess": 0.0 if kept else 1.2, "worst_depth": -0.3 if kept else FAILED["depth"]}
    at = {"t": FAILED["t"], "x": FAILED["x"], "y": FAILED["y"]}
    return {**counts, **worst, "at": at, "failed": [] if kept else [FAILED]}


def write_zone_folder(folder: FilePath, *, reserve: bool = True, uniform: bool = True) -> dict[str, Any]:
    """Fill `folder` with a motion that obeys the zone, one with uniform braking, and return their result."""
    scenario = zone_scenario(reserve=reserve)
    result = write_folder(folder, scenario)
    path = corner_path(2.4)
    motion = timed(scenario.problem, path, uniform=False)
    motion.to_csv(folder / "trajectory.csv")
    motion.to_csv(folder / "trajectories" / "refined.csv")
    plans = result["plans"]
    plans["refined"] |= {"travel_time": motion.travel_time, "length": motion.length}
    plans["voronoi_route"]["relaxation"] = {"kind": "inner", "travel_time": 17.99}
    if uniform:
        other = timed(scenario.problem, path, uniform=True)
        other.to_csv(folder / "trajectories" / "uniform.csv")
        plans["uniform"] = {"travel_time": other.travel_time, "length": other.length, "model": "full"}
    result["zone"] = {
        "type": "ellipse", "parameters": {"lateral_ratio": 0.5}, "isotropic": False,
        "friction_reserve": reserve, "relaxation": "inner", "statement": "An ellipse.",
        "promise": promise(kept=reserve),
    }  # fmt: skip
    assert read_evidence(folder).executed_plan == "refined"
    return result
