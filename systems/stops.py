"""Emergency stops at many instants of a run: does the robot stop before anything it could hit?

The run is driven once more, and its state kept at evenly spread instants. From each the vehicle brakes as
hard as it may, once with the steering held and once with the wheels straightened. All that changes in the
diagram is in its Context, so a restored state goes on as the run did, bit by bit.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path as FilePath

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from systems.diagram import LOG_PERIOD, TrackingDiagram, tracking_diagram
from systems.four_wheel import WHEELS
from systems.run import SLIDE_DEMAND
from systems.simulation import SimulationError, check_motion, mode_of, started
from systems.single_track import Motion
from systems.supervisor import Mode
from systems.wheels import RECORD
from vnav_drake.plan import Trajectory
from vnav_drake.robot import GRAVITY, Robot

Array = NDArray[np.float64]

SCHEMA = 1
ROW_PERIOD = 0.02  # [s], between two rows of a stop
PATIENCE = 2.0  # [s], beyond three times the time that braking at a_b takes, to come to rest
LOOK = 0.05  # [s], between two looks whether the vehicle stands
ROWS = ("t", "x", "y", "heading", "v", "tilt", "least_load", "slip")


@dataclass(frozen=True, kw_only=True)
class StopRecords:
    """Recorded emergency stops; those of one instant follow one another, steering held first."""

    model: str  # "four_wheel", "single_track"
    instant: Array  # (n,) [s], of the run, at which the stop was asked for
    straightened: NDArray[np.bool_]  # (n,), the wheels, otherwise held
    first: NDArray[np.int64]  # (n + 1,): stop i has the rows first[i] to first[i + 1]
    rows: Array  # (m, 8), columns `ROWS`: [s] since the instant, [m], [m], [rad], [m/s], [rad], share, [m/s]
    compute_time: float  # [s], for all stops

    def save(self, file: FilePath) -> None:
        """Write an npz file without pickled objects; the compute time is not in it."""
        columns = dict(zip(ROWS, self.rows.T, strict=True))
        with file.open("wb") as stream:
            np.savez_compressed(
                stream,
                schema=np.int64(SCHEMA),
                model=np.str_(self.model),
                instant=self.instant,
                straightened=self.straightened,
                first=self.first,
                **columns,
            )


def emergency_stops(
    robot: Robot,
    trajectory: Trajectory,
    *,
    count: int,
    model: str = "four_wheel",
    reaction_time: float = 0.0,
    progress: Callable[[str], None] = lambda _text: None,
) -> StopRecords:
    """Stop the vehicle at `count` instants of its run along `trajectory`, twice each.

    The instants are spread evenly over the run and lie on the ticks of the controller; a run shorter than
    `count` ticks has as many as it has ticks. The brakes act `reaction_time` [s] after the instant, until
    when the vehicle follows its trajectory.

    Raises
    ------
    ValueError for a trajectory that is none, SimulationError when Drake fails.
    """
    check_motion(trajectory)
    began = time.perf_counter()
    try:
        loop = tracking_diagram(robot, trajectory, model=model, reaction_time=reaction_time)
        instants, snapshots = _snapshots(loop, trajectory, count)
        simulator = Simulator(loop.diagram)
        tables = []
        for i, (instant, snapshot) in enumerate(zip(instants, snapshots, strict=True)):
            if i % 10 == 0:
                progress(f"emergency stop {2 * i + 1} of {2 * len(instants)}")
            for straightened in (False, True):
                tables.append(_stop(simulator, loop, robot, snapshot, instant, straightened, reaction_time))
    except RuntimeError as error:
        raise SimulationError(f"{model}: emergency stops: Drake stopped: {error}") from error
    return StopRecords(
        model=model,
        instant=np.repeat(instants, 2),
        straightened=np.tile([False, True], len(instants)),
        first=np.concatenate([[0], np.cumsum([len(table) for table in tables])]).astype(np.int64),
        rows=np.concatenate(tables) if tables else np.empty((0, len(ROWS))),
        compute_time=time.perf_counter() - began,
    )


def stop_instants(duration: float, count: int, period: float) -> Array:
    """Instants (k,) [s], k <= count, on multiples of `period`, in the middle of equal parts of a run."""
    ticks = np.floor((np.arange(count) + 0.5) / max(count, 1) * duration / period + 1e-9)
    return period * np.unique(ticks)


def _snapshots(loop: TrackingDiagram, trajectory: Trajectory, count: int) -> tuple[Array, list[Context]]:
    """States of the run at the instants, before the controller's tick there."""
    # where the controller decides and the log has a row: one period is a multiple of the other
    instants = stop_instants(trajectory.travel_time, count, max(loop.period, LOG_PERIOD))
    simulator = started(loop, loop.start)
    context = simulator.get_mutable_context()
    found = []
    for instant in instants.tolist():
        simulator.AdvanceTo(instant)
        if mode_of(loop, context) == Mode.FALLEN:
            break  # a fallen robot need not stop any more
        snapshot = context.Clone()
        loop.log.FindMutableLog(snapshot).Clear()
        found.append(snapshot)
    return instants[: len(found)], found


def _stop(
    simulator: Simulator,
    loop: TrackingDiagram,
    robot: Robot,
    snapshot: Context,
    instant: float,
    straightened: bool,
    reaction_time: float,
) -> Array:
    """Rows (k, 8) of one stop."""
    context = simulator.get_mutable_context()
    context.SetTimeStateAndParametersFrom(snapshot)
    loop.ask_to_stop(context, instant, straightened=straightened)
    loop.log.FindMutableLog(context).Clear()
    simulator.Initialize()
    speed = math.hypot(*loop.vehicle.state(context)[3:5])
    needed = reaction_time + speed / robot.max_braking
    end, latest = instant + 0.9 * needed, instant + 3.0 * needed + PATIENCE
    while True:
        end += LOOK
        simulator.AdvanceTo(end)
        if mode_of(loop, context) in (Mode.STOPPED, Mode.FALLEN) or end >= latest:
            break
    loop.diagram.ForcedPublish(context)
    log = loop.log.FindLog(context)
    return _rows(loop.model, robot, log.sample_times() - instant, log.data())


def _rows(model: str, robot: Robot, t: Array, data: Array) -> Array:
    """A log's times (k,) and channels (c, k) as the rows of a stop."""
    row = dict(zip(RECORD if model == "four_wheel" else Motion._fields, data, strict=True))
    if model == "four_wheel":
        slip = np.max([row[f"slip_{wheel}"] for wheel in WHEELS], axis=0)
        tilt, least = row["tilt"], row["least_load"]
    else:
        weight = robot.mass * GRAVITY
        asked = np.maximum(row["front_demand"], row["rear_demand"])
        slip = np.where(asked > SLIDE_DEMAND, np.abs(row["lateral_velocity"]), 0.0)
        tilt, least = (
            np.zeros(len(t)),
            np.minimum(row["front_load"], weight - row["front_load"]) / (0.5 * weight),
        )
    heading = np.unwrap(row["heading"])
    table = np.column_stack([t, row["x"], row["y"], heading, row["v"], tilt, least, slip])
    table = table[np.append(np.diff(t) > 1e-9, True)]
    keep = np.zeros(len(table), dtype=bool)
    keep[:: round(ROW_PERIOD / 0.01)] = True
    keep[-1] = True
    return table[keep]
