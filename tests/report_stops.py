"""Emergency stops and wheels made by hand for the tests of the report: a point braking within friction."""

from __future__ import annotations

from pathlib import Path as FilePath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vnav_drake.problem import Problem

Array = NDArray[np.float64]

GRAVITY = 9.81  # [m/s^2]
STEP = 0.02  # [s] between rows of a stop
WHEELS = ("front_left", "front_right", "rear_left", "rear_right")


def stop_rows(
    problem: Problem, start: tuple[float, float, float, float], curvature: float, longest: float = 60.0
) -> Array:
    """Rows t, x, y, heading, v of a stop of a point from x, y, heading, v along a circle of `curvature`.

    After the reaction time it brakes at a_b, or at what turning leaves of the friction:
    sqrt((mu g)^2 - (kappa v^2)^2), whichever is less.
    """
    grip, braking = problem.robot.friction_acceleration, problem.braking
    x, y, heading, v = start
    rows = [(0.0, x, y, heading, v)]
    fine = 20  # steps of integration between rows
    while (v > 1e-2 or len(rows) < 2) and len(rows) * STEP < longest:
        way = 0.0
        for k in range(fine):
            late = rows[-1][0] + k * STEP / fine < braking.reaction_time
            turn = min(abs(curvature) * v * v, grip)
            slower = 0.0 if late else min(braking.max_braking, np.sqrt(grip * grip - turn * turn))
            slower = max(
                slower, 0.0 if late else 0.02 * grip
            )  # at the limit itself nothing would ever slow it
            way += max(v - 0.5 * slower * STEP / fine, 0.0) * STEP / fine
            v = max(v - slower * STEP / fine, 0.0)
        middle = heading + 0.5 * curvature * way
        chord = way * np.sinc(0.5 * curvature * way / np.pi)
        x, y, heading = x + chord * np.cos(middle), y + chord * np.sin(middle), heading + curvature * way
        rows.append((rows[-1][0] + STEP, x, y, heading, v))
    return np.array(rows)


def wheels(t: Array, v: Array, curvature: Array, *, mass: float, height: float, base: float, track: float):
    """Columns of a four-wheel record by statics: acceleration shifts loads through the height of the mass."""
    along, across = np.gradient(v, t), v * v * curvature
    columns = {}
    for wheel in WHEELS:
        front, left = wheel.startswith("front"), wheel.endswith("left")
        pitch = (-1.0 if front else 1.0) * mass * along * height / (2.0 * base)
        roll = (-1.0 if left else 1.0) * mass * across * height / (2.0 * track)
        load = np.maximum(mass * GRAVITY / 4.0 + pitch + roll, 0.0)
        columns[f"load_{wheel}"] = load
        columns[f"slip_{wheel}"] = 0.01 * np.abs(along) + 0.004 * np.abs(across)
        columns[f"torque_{wheel}"] = 0.25 * mass * along * 0.08
    columns["tilt"] = 0.002 * np.abs(across)
    least = np.min([columns[f"load_{wheel}"] for wheel in WHEELS], axis=0)
    columns["least_load"] = least / (mass * GRAVITY / 4.0)
    columns["mode"] = np.where(t < t[-1] - 0.3, 0.0, 2.0)
    columns["steering"] = np.arctan(base * curvature)
    columns["steering_command"] = np.arctan(base * np.interp(t + 0.03, t, curvature))
    return columns


def add_stops(folder: FilePath, problem: Problem, result: dict[str, Any], instants: int) -> None:
    """Give the run in `folder` wheels and twice `instants` stops, and `result` what is told of them."""
    file = folder / "simulation.csv"
    table = np.genfromtxt(file, delimiter=",", names=True)
    t, x, y, heading, v = (table[name] for name in ("t", "x", "y", "heading", "v"))
    curvature = np.gradient(np.unwrap(heading), t) / np.maximum(v, 0.05)
    robot = problem.robot
    more = wheels(
        t, v, curvature, mass=robot.mass, height=robot.com_height, base=robot.wheelbase, track=robot.track
    )
    kept = [name for name in table.dtype.names if name not in more]
    names, columns = [*kept, *more], [*(table[name] for name in kept), *more.values()]
    np.savetxt(file, np.column_stack(columns), delimiter=",", header=",".join(names), comments="")

    at = np.linspace(0, len(t) - 2, instants).astype(int)
    stops = [
        stop_rows(problem, (x[i], y[i], heading[i], v[i]), 0.0 if straight else curvature[i])
        for i in at
        for straight in (False, True)
    ]
    first = np.concatenate([[0], np.cumsum([len(rows) for rows in stops])])
    rows = np.concatenate(stops)
    zero = np.zeros(len(rows))
    np.savez_compressed(
        folder / "stops.npz",
        schema=np.int64(1), model=np.array("four_wheel"), instant=np.repeat(t[at], 2),
        straightened=np.tile([False, True], instants), first=first.astype(np.int64),
        t=rows[:, 0], x=rows[:, 1], y=rows[:, 2], heading=rows[:, 3], v=rows[:, 4],
        tilt=zero, least_load=zero + 1.0, slip=zero,
    )  # fmt: skip
    result["simulation"] |= {"model": "four_wheel", "emergency_stops": found(problem, stops), **STUDIES}


def found(problem: Problem, stops: list[Array]) -> dict[str, Any]:
    """What a judge finds of stops, held and straightened by turns, by the plain definition of each figure."""
    braking, kinds = problem.braking, {"held": stops[0::2], "straightened": stops[1::2]}

    def counted(some: list[Array]) -> dict[str, Any]:
        claimed = [r[0, 4] * braking.reaction_time + r[0, 4] ** 2 / (2.0 * braking.max_braking) for r in some]
        driven = [float(np.hypot(*np.diff(r[:, 1:3], axis=0).T).sum()) for r in some]
        away = [float(np.hypot(*(r[:, 1:3] - r[0, 1:3]).T).max()) for r in some]
        least = [float(problem.clearance(r[:, 1:3]).min()) for r in some]
        moving = [i for i, c in enumerate(claimed) if c > 1e-3]
        return {
            "tried": len(some), "collisions": sum(d < 0.0 for d in least), "falls": 0, "not_stopped": 0,
            "left_zone": int(sum(a > c + 1e-3 for a, c in zip(away, claimed, strict=True))),
            "slid": 0, "lifted": 0,
            "min_clearance": min(least), "bad": sum(d < 0.0 for d in least),
            "worst_distance_ratio": float(max(driven[i] / claimed[i] for i in moving)),
            "worst_displacement_ratio": float(max(away[i] / claimed[i] for i in moving)),
        }  # fmt: skip

    failed = []
    for i, rows in enumerate(stops):
        clearance = problem.clearance(rows[:, 1:3])
        if clearance.min() < 0.0:
            k = int(np.argmin(clearance))
            failed.append({
                "stop": i, "instant": 0.0, "straightened": i % 2 == 1, "cause": "collision",
                "x": float(rows[k, 1]), "y": float(rows[k, 2]), "t": float(rows[k, 0]),
                "depth": float(-clearance[k]),
            })  # fmt: skip
    return {
        **counted(stops), "instants": len(stops) // 2, "failed": failed,
        **{kind: counted(some) for kind, some in kinds.items()},
    }  # fmt: skip


STUDIES: dict[str, Any] = {
    "margin": {
        "factor": 2.31, "ended_by": "slides", "analytic": 2.43, "analytic_by": "friction circle",
        "runs": [
            {"factor": 1.0, "holds": True, "cause": "", "demand": 0.17},
            {"factor": 2.0, "holds": True, "cause": "", "demand": 0.68},
            {"factor": 4.0, "holds": False, "cause": "slides", "demand": 2.71},
            {"factor": 2.28, "holds": True, "cause": "", "demand": 0.88},
            {"factor": 2.31, "holds": True, "cause": "", "demand": 0.9},
            {"factor": 2.34, "holds": False, "cause": "leaves the path", "demand": 0.93},
        ],
        "over": {"factor": 2.55, "demand": 1.1, "flagged": True, "cause": "slides"},
    },
    "robustness": [
        {"case": "friction -10 %", "holds": True, "cause": "", "max_lateral_error": 0.004,
         "travel_time": 25.5, "least_load": 0.81, "slid": False},
        {"case": "mass +10 %", "holds": True, "cause": "", "max_lateral_error": 0.006, "travel_time": 25.6,
         "least_load": 0.8, "slid": False},
        {"case": "height of the centre of mass +10 %", "holds": False, "cause": "lifts a wheel",
         "max_lateral_error": 0.071, "travel_time": 26.9, "least_load": 0.0, "slid": True},
    ],
}  # fmt: skip
