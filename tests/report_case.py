"""A result folder made by hand for the tests of the report: warehouse, three motions, one simulated run."""

from __future__ import annotations

from functools import cache
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from verify.pipeline import plain
from verify.report import VcDrawing
from verify.vc_drawing import vc_drawing
from vnav_drake.plan import Path, Trajectory
from vnav_drake.scenario import Scenario, parse_scenario
from vnav_drake.vc_method import VcResult, as_plan, vc_method

RACKS = [(f"O{i + 1}", x, y) for i, (y, x) in enumerate((y, x) for y in (22, 16, 10, 4) for x in (4, 15))]


def warehouse_text(*, name: str = "warehouse", description: str = "Rest to rest", rack: str = "O1") -> str:
    """The scenario file; the words go into it as they are, so quote what YAML would not take."""
    lines = [
        "schema: 1",
        f"name: {name}",
        f"description: {description}",
        "world:",
        "  boundary: [[0, 0], [32, 0], [32, 31], [0, 31]]",
        "  obstacles:",
    ]
    for own, x, y in RACKS:
        shown = rack if own == "O1" else own
        corners = [[x, y], [x + 10, y], [x + 10, y + 5], [x, y + 5]]
        lines.append(f"    - {{name: {shown}, vertices: {corners}}}")
    lines += [
        "robot: {radius: 0.4, mass: 40, wheelbase: 0.5, track: 0.4, com_height: 0.12, friction: 0.6,",
        "  max_braking: 1.0, max_acceleration: 1.0, max_steering: 0.6}",
        "start: {position: [28.5, 1.9], speed: rest}",
        "goal: {position: [2.0, 22.0], speed: rest}",
        "",
    ]
    return "\n".join(lines)


def warehouse(**words: str) -> Scenario:
    """The scenario of `warehouse_text`."""
    return parse_scenario(warehouse_text(**words).encode(), "warehouse.yaml")


def corner_path(radius: float = 1.6, y: float = 1.9) -> Path:
    """Bottom corridor, a rounded corner (a sharp one for radius 0), left corridor."""
    start, goal = (28.5, 1.9), (2.0, 22.0)
    if radius == 0.0:
        return Path.polyline([start, (2.0, y), goal])
    lengths = [start[0] - goal[0] - radius, 0.5 * np.pi * radius, goal[1] - y - radius]
    return Path.from_arcs(start, np.pi, [0.0, -1.0 / radius, 0.0], lengths)


def motion(
    scenario: Scenario, path: Path, *, share: float, ends: float | None, step: float = 0.02
) -> Trajectory:
    """Drive `path` at `share` of the braking limit, accelerating and braking at the same share of 1 m/s^2."""
    fine = path.subdivided(np.maximum(1, np.ceil(path.piece_length / step)).astype(np.int64))
    clearance = scenario.problem.clearance(np.column_stack([fine.x, fine.y]))
    square = (share * scenario.problem.braking.speed(clearance)) ** 2
    if ends is not None:
        square[[0, -1]] = ends**2
    for i in range(len(square) - 1):
        square[i + 1] = min(square[i + 1], square[i] + 2.0 * share * fine.piece_length[i])
    for i in range(len(square) - 1, 0, -1):
        square[i - 1] = min(square[i - 1], square[i] + 2.0 * share * fine.piece_length[i - 1])
    v = np.sqrt(square)
    t = np.concatenate([[0.0], np.cumsum(2.0 * fine.piece_length / (v[1:] + v[:-1]))])
    a = np.diff(square) / (2.0 * fine.piece_length)
    return Trajectory(
        t,
        fine.x,
        fine.y,
        np.append(fine.heading, fine.end_heading[-1]),
        v,
        np.append(a, a[-1]),
        np.append(fine.curvature, fine.curvature[-1]),
        clearance,
    )


def write_folder(folder: FilePath, scenario: Scenario) -> dict[str, Any]:
    """Fill `folder` with evidence and return a result that goes with it."""
    plans = {
        "voronoi_route": motion(scenario, corner_path(0.0), share=0.9, ends=None),
        "collocation": motion(scenario, corner_path(2.4), share=1.0, ends=None),
        "refined": motion(scenario, corner_path(1.6), share=0.97, ends=0.0),
    }
    (folder / "trajectories").mkdir(parents=True)
    for name, plan in plans.items():
        plan.to_csv(folder / "trajectories" / f"{name}.csv")
    plans["refined"].to_csv(folder / "trajectory.csv")
    (folder / "scenario.yaml").write_bytes(scenario.data)
    best = plans["refined"]
    t = np.arange(0.0, best.t[-1] + 0.1, 0.01)
    x, y, heading, v, *_ = best.at(t)
    lateral = 0.008 * np.sin(2.0 * np.pi * t / 5.0)
    rows = np.column_stack(
        [
            t,
            x - lateral * np.sin(heading),
            y + lateral * np.cos(heading),
            heading,
            v + 0.01 * np.sin(t),
            0 * t,
        ]
    )
    columns = "t,x,y,heading,v,lateral_acceleration"
    np.savetxt(folder / "simulation.csv", rows, delimiter=",", header=columns, comments="")
    facts = {name: {"travel_time": plan.travel_time, "length": plan.length} for name, plan in plans.items()}
    optimum = plans["collocation"].travel_time
    result: dict[str, Any] = {
        "schema": 1,
        "scenario": scenario.name,
        "scenario_sha256": scenario.sha256,
        "verdict": "refined",
        "plans": {
            "voronoi_route": {**facts["voronoi_route"], "model": "variational", "compute_time": 0.21},
            "collocation": {
                **facts["collocation"],
                "model": "variational",
                "solver": "SNOPT",
                "intervals": 148,
                "iterations": 212,
                "compute_time": 1.42,
            },
            "refined": {
                **facts["refined"],
                "model": "full",
                "solver": "SNOPT",
                "intervals": 171,
                "iterations": 155,
                "compute_time": 1.9,
            },
        },
        "gaps": {"refinement": best.travel_time / optimum - 1.0},
        "simulation": {
            "model": "single-track",
            "travel_time": best.travel_time + 0.05,
            "max_tracking_error": 0.008,
            "min_clearance": 0.9,
        },
        "gates": [
            {"name": "constraint_violation", "value": 2.3e-8, "limit": 1e-6, "passed": True},
            {"name": "braking_margin", "value": 0.0012, "limit": 0.0, "passed": True},
            {
                "name": "refinement_gap",
                "value": 0.08,
                "limit": 0.05,
                "passed": False,
                "reason": "longer than the limit",
            },
            {"name": "certified_gap", "limit": 0.03, "passed": None, "reason": "no lower bound was computed"},
        ],
        "checks": [
            {
                "name": "clearance",
                "trajectory": "refined",
                "status": "passed",
                "worst": 0.91,
                "unit": "m",
                "at": {"t": 3.2, "x": 20.0, "y": 1.9},
                "message": "",
            },
            {
                "name": "emergency_stops",
                "trajectory": "refined",
                "status": "not_evaluated",
                "message": "no stops were recorded",
            },
        ],
        "missing": [{"stage": "lower_bound", "reason": "not part of this version"}],
        "versions": {"vnav_drake": "0.1.0", "drake": "1.51.1", "python": "3.11"},
        "files": {"trajectory.csv": "ab" * 32},
    }
    result["plans"]["collocation"]["unpromised"] = [
        {
            "name": "steering",
            "trajectory": "collocation",
            "status": "failed",
            "worst": -0.12,
            "unit": "1/m",
            "at": {"t": 14.0, "x": 2.1, "y": 2.2},
            "message": "turns tighter than the wheels allow (not promised by the variational model)",
        }
    ]
    return result


# A floor with three obstacles as in Manor 2015, Fig. 2.9. Rest to rest and a_max < a_b, so that the profile
# accelerates, follows the limit and brakes.
THREE_OBSTACLES = """\
schema: 1
name: three_obstacles
world:
  boundary: [[0, 0], [16, 0], [16, 11], [0, 11]]
  obstacles:
    - {name: A, vertices: [[3, 3], [6.5, 2.5], [6, 4.5], [3.5, 5]]}
    - {name: B, vertices: [[8.5, 6], [12, 7.5], [8, 8.5]]}
    - {name: "</script><b>C</b>", vertices: [[11, 2], [13, 2.2], [13.2, 4.4], [11.2, 4]]}
robot: {radius: 0.25, mass: 40, wheelbase: 0.3, track: 0.2, com_height: 0.12, friction: 0.6,
  max_braking: 1.0, max_acceleration: 0.4, max_steering: 0.6}
start: {position: [1.5, 1.5], speed: rest}
goal: {position: [14.5, 9.2], speed: rest}
"""


@cache
def vc_case() -> tuple[Scenario, VcResult, VcDrawing]:
    """The floor with three obstacles, what the vc-method finds there, and how it is drawn."""
    scenario = parse_scenario(THREE_OBSTACLES.encode(), "three_obstacles.yaml")
    result = vc_method(scenario.problem)
    return scenario, result, vc_drawing(scenario.problem, result)


def write_vc_folder(folder: FilePath) -> dict[str, Any]:
    """Fill `folder` with the evidence of `vc_case` and return a result that goes with it."""
    scenario, found, _ = vc_case()
    plan = as_plan(found)
    (folder / "trajectories").mkdir(parents=True)
    plan.trajectory.to_csv(folder / "trajectories" / "vc_method.csv")
    plan.trajectory.to_csv(folder / "trajectories" / "refined.csv")
    plan.trajectory.to_csv(folder / "trajectory.csv")
    (folder / "scenario.yaml").write_bytes(scenario.data)
    facts = {"travel_time": plan.travel_time, "length": plan.length, "model": "full"}
    return {
        "schema": 1,
        "scenario": scenario.name,
        "verdict": "refined",
        "plans": {
            "vc_method": {**facts, "class": "A|B", **plain(plan.details), "compute_time": 0.2},
            "refined": facts,
            "collocation": {"travel_time": 13.0, "length": 18.0, "model": "variational"},
        },
    }


HISTORY = {
    "collocation": [
        {
            "round": i + 1,
            "intervals": n,
            "iterations": k,
            "travel_time": 24.0 + 0.01 * i,
            "worst_violation": w,
            "solver_time": 0.2,
        }
        for i, (n, k, w) in enumerate([(60, 90, 3e-2), (92, 40, 4e-3), (120, 31, 2e-4), (148, 22, 3e-7)])
    ],
    "refined": [
        {
            "round": i + 1,
            "intervals": n,
            "iterations": k,
            "travel_time": 26.0 + 0.01 * i,
            "worst_violation": w,
            "solver_time": 0.3,
        }
        for i, (n, k, w) in enumerate([(80, 70, 1e-2), (130, 30, 1e-4), (171, 20, 5e-8)])
    ],
}
