"""What a simulated vehicle did, row by row."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path as FilePath
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SLIDE_TIME = 0.1  # [s], sustained: sliding
LIFT_TIME = 0.2  # [s], sustained: a side is off the floor; the swing of a tall body may take it off for less
SLIDE_DEMAND = 1.001  # friction asked over friction there: beyond rounding of a plan on the limit
SLIP_SPEED = 0.05  # [m/s], of a wheel over the floor: below it creeps, as friction is regularised
SLIP_LOAD = 0.1  # of its share at rest, which a wheel must carry for its slip to count
NO_LOAD = 1e-3  # of their share at rest, that wheels carry at most when they are off the floor


@dataclass(frozen=True, kw_only=True)
class SimulationRun:
    """A recorded run; arrays (m,), about every 10 ms, the last row at the end of the run."""

    model: str  # "four_wheel", "single_track"
    t: Array  # [s], from the start
    x: Array  # [m], centre of mass (four_wheel: midway between the axles)
    y: Array  # [m]
    heading: Array  # [rad], of the body, unwrapped; the direction of travel is heading + atan2(v_lat, v_long)
    v: Array  # [m/s], speed of the centre of mass, negative when rolling backwards
    longitudinal_velocity: Array  # [m/s], along the body
    lateral_velocity: Array  # [m/s], to the left of the body
    yaw_rate: Array  # [rad/s]
    steering: Array  # [rad], of the mean front wheel
    steering_command: Array  # [rad]
    force_command: Array  # [N], of drive and brakes
    longitudinal_force: Array  # [N], on the body, along it
    lateral_acceleration: Array  # [m/s^2], on the body, to its left
    channels: Mapping[str, Array]  # what only this model has, by name
    step: float  # [s], of the integrator
    details: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("channels", "details"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))

    @property
    def columns(self) -> dict[str, Array]:
        """All recorded columns by name, in the order of the file."""
        return {name: getattr(self, name) for name in run_columns()} | dict(self.channels)

    def to_csv(self, file: FilePath) -> None:
        """Write the rows with 17 significant digits, so that reading gives back every bit."""
        columns = self.columns
        rows = np.column_stack(list(columns.values()))
        np.savetxt(file, rows, fmt="%.17g", delimiter=",", header=",".join(columns), comments="")


def run_columns() -> tuple[str, ...]:
    """Names of the columns that runs of every model have, in the order of the file."""
    other = {"model", "channels", "step", "details"}
    return tuple(f.name for f in fields(SimulationRun) if f.name not in other)


def sustained(t: Array, holds: NDArray[np.bool_], least: float, spacing: float) -> float | None:
    """Start [s] of the first stretch of at least `least` [s] in which `holds` (m,) is true throughout."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], holds, [False]]).astype(int)))
    starts, ends = edges[::2], edges[1::2] - 1
    long = t[ends] - t[starts] >= least - 0.5 * spacing
    return float(t[starts[long][0]]) if long.any() else None
