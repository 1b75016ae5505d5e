"""Scenarios and exact motions for tests of the judge, made without the planners."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import yaml

from verify.judge.checks import Setting
from verify.judge.motion import Motion
from vnav_drake.scenario import Scenario, parse_scenario

# A hall of 40 x 4 m; on its centre line the clearance of a robot of radius 0.5 m is 1.5 m away from the ends.
BASE: dict[str, Any] = {
    "schema": 1,
    "name": "hall",
    "world": {"boundary": [[0, 0], [40, 0], [40, 4], [0, 4]], "obstacles": []},
    "robot": {
        "radius": 0.5,
        "mass": 40.0,
        "wheelbase": 0.5,
        "track": 0.4,
        "com_height": 0.12,
        "friction": 0.6,
        "max_braking": 1.0,
        "max_acceleration": 1.0,
        "max_speed": None,
        "max_steering": 0.6,
        "max_steering_rate": None,
    },
    "start": {"position": [5.0, 2.0]},
    "goal": {"position": [35.0, 2.0]},
}


def scenario_bytes(**changes: Any) -> bytes:
    """The base scenario; a mapping is merged into its section, anything else replaces it."""
    data = {key: dict(value) if isinstance(value, dict) else value for key, value in BASE.items()}
    for key, value in changes.items():
        data[key] = {**data.get(key, {}), **value} if isinstance(value, dict) else value
    return yaml.safe_dump(data).encode()


def scenario(**changes: Any) -> Scenario:
    return parse_scenario(scenario_bytes(**changes), "test.yaml")


def setting(**changes: Any) -> Setting:
    return Setting.from_spec(scenario(**changes).spec)


def arcs_motion(
    start: Sequence[float],
    heading: float,
    arcs: Sequence[tuple[float, float]],
    speeds: Sequence[float],
    within: Setting | None = None,
) -> Motion:
    """Arcs (length [m], curvature [1/m]) end to end with the speeds [m/s] at their ends.

    Positions by the textbook form x = (sin theta1 - sin theta0)/kappa, and t, a from constant
    acceleration: dt = 2 ds/(v0 + v1), a = (v1^2 - v0^2)/(2 ds).
    """
    x, y, theta, t = [start[0]], [start[1]], [heading], [0.0]
    a, kappa = [], []
    for (length, bend), v0, v1 in zip(arcs, speeds[:-1], speeds[1:], strict=True):
        turned = theta[-1] + bend * length
        if bend == 0.0:
            x.append(x[-1] + length * np.cos(turned))
            y.append(y[-1] + length * np.sin(turned))
        else:
            x.append(x[-1] + (np.sin(turned) - np.sin(theta[-1])) / bend)
            y.append(y[-1] - (np.cos(turned) - np.cos(theta[-1])) / bend)
        theta.append(turned)
        t.append(t[-1] + 2.0 * length / (v0 + v1))
        a.append((v1 * v1 - v0 * v0) / (2.0 * length))
        kappa.append(bend)
    columns = [t, x, y, theta, speeds, [*a, a[-1]], [*kappa, kappa[-1]]]
    rows = np.array([list(map(float, column)) for column in columns])
    clearance = np.zeros(len(t))
    if within is not None:
        clearance = within.surroundings.distance(rows[1:3].T) - within.limits.radius
    return Motion.from_rows(np.vstack([rows, clearance]).T)


def edited(motion: Motion, column: str, row: int, by: float) -> Motion:
    """The motion with one number changed."""
    values = {name: getattr(motion, name).copy() for name in motion.__dataclass_fields__}
    values[column][row] += by
    return Motion(**values)
