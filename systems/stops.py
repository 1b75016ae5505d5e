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

from systems.diagram import CONTROL_PERIODS, TrackingDiagram, tracking_diagram
from systems.four_wheel import WHEELS
from systems.parallel import in_parallel
from systems.run import SLIDE_DEMAND
from systems.simulation import ARRIVED, SimulationError, check_motion, mode_of, started
from systems.single_track import Motion
from systems.supervisor import Mode
from systems.wheels import RECORD
from vnav_drake.plan import Trajectory
from vnav_drake.robot import GRAVITY, Robot

Array = NDArray[np.float64]

SCHEMA = 1
PARTS = 2  # shares of the work for each worker
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
    workers: int = 1,
    progress: Callable[[str], None] = lambda _text: None,
) -> StopRecords:
    """Stop the vehicle at `count` instants of its run along `trajectory`, twice each.

    The instants are spread evenly over the run and lie on the ticks of the controller; a run shorter than
    `count` ticks has as many as it has ticks. The brakes act `reaction_time` [s] after the instant, until
    when the vehicle follows its trajectory. Each of the `workers` drives the run for itself, so that the
    records do not depend on their number.

    Raises
    ------
    ValueError for a trajectory that is none, SimulationError when Drake fails, WorkerError when a worker
    process is killed.
    """
    check_motion(trajectory)
    began = time.perf_counter()
    instants = stop_instants(trajectory.travel_time, count, CONTROL_PERIODS[model])
    parts = min(PARTS * workers, len(instants)) if workers > 1 else max(len(instants) // 10, 1)
    shares = [instants[k::parts] for k in range(parts)]

    def told(done: int) -> None:
        progress(f"{done / max(parts, 1):.0%} of {2 * len(instants)}")

    if workers > 1:
        tasks = [(robot, trajectory, share, model, reaction_time) for share in shares]
        found = in_parallel(_stops_at, tasks, workers, told)
    else:
        stopper = _Stopper.of(robot, trajectory, model, reaction_time)
        found = in_parallel(stopper.stop_at, [(part,) for part in np.array_split(instants, parts)], 1, told)
    tables = dict(pair for part in found for pair in part.items())
    kept = [instant for instant in instants.tolist() if instant in tables]
    ordered = [table for instant in kept for table in tables[instant]]
    return StopRecords(
        model=model,
        instant=np.repeat(kept, 2),
        straightened=np.tile([False, True], len(kept)),
        first=np.concatenate([[0], np.cumsum([len(table) for table in ordered])]).astype(np.int64),
        rows=np.concatenate(ordered) if ordered else np.empty((0, len(ROWS))),
        compute_time=time.perf_counter() - began,
    )


def stop_instants(duration: float, count: int, period: float) -> Array:
    """Instants (k,) [s], k <= count, on multiples of `period`, in the middle of equal parts of a run."""
    ticks = np.floor((np.arange(count) + 0.5) / max(count, 1) * duration / period + 1e-9)
    return period * np.unique(ticks)


@dataclass(frozen=True)
class _Stopper:
    """The run, as far as it has been driven, and a second simulator in which it is left to stop."""

    loop: TrackingDiagram
    robot: Robot
    reaction_time: float
    run: Simulator
    aside: Simulator

    @classmethod
    def of(cls, robot: Robot, trajectory: Trajectory, model: str, reaction_time: float) -> _Stopper:
        try:
            loop = tracking_diagram(
                robot, trajectory, model=model, reaction_time=reaction_time, log_period=ROW_PERIOD
            )
            return cls(loop, robot, reaction_time, started(loop, loop.start), started(loop, loop.start))
        except RuntimeError as error:
            raise SimulationError(f"{model}: emergency stops: Drake stopped: {error}") from error

    def stop_at(self, instants: Array) -> dict[float, tuple[Array, Array]]:
        """Rows of both stops, steering held and straightened, by instant; none after the robot has fallen.

        Instants ascend, from call to call too. A stop begins with the state before the controller's tick.
        """
        found = {}
        try:
            for instant in instants.tolist():
                self.run.AdvanceTo(instant)
                if mode_of(self.loop, self.run.get_context()) == Mode.FALLEN:
                    break
                found[instant] = (self._stop(instant, False), self._stop(instant, True))
        except RuntimeError as error:
            raise SimulationError(f"{self.loop.model}: emergency stops: Drake stopped: {error}") from error
        return found

    def _stop(self, instant: float, straightened: bool) -> Array:
        """Rows (k, 8) of one stop."""
        loop, context = self.loop, self.aside.get_mutable_context()
        context.SetTimeStateAndParametersFrom(self.run.get_context())
        loop.ask_to_stop(context, instant, straightened=straightened)
        log = loop.log.FindMutableLog(context)
        log.Clear()
        self.aside.Initialize()
        loop.diagram.ForcedPublish(context)  # a row at the instant, wherever the log has its own
        speed = math.hypot(*loop.vehicle.state(context)[3:5])
        needed = self.reaction_time + speed / self.robot.max_braking
        end, latest = instant + 0.9 * needed, instant + 3.0 * needed + PATIENCE
        while True:
            end += LOOK
            self.aside.AdvanceTo(end)
            mode, state = mode_of(loop, context), loop.vehicle.state(context)
            # a tall body that sways on its tyres may stand for a moment only
            standing = mode == Mode.STOPPED and math.hypot(*state[3:5]) < ARRIVED
            if standing or mode == Mode.FALLEN or end >= latest:
                break
        loop.diagram.ForcedPublish(context)
        return _rows(loop.model, self.robot, log.sample_times() - instant, log.data())


def _stops_at(
    robot: Robot, trajectory: Trajectory, instants: Array, model: str, reaction_time: float
) -> dict[float, tuple[Array, Array]]:
    """A worker's share: it drives the run for itself."""
    return _Stopper.of(robot, trajectory, model, reaction_time).stop_at(instants)


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
    # the last row may fall on one that was logged
    kept: Array = table[np.append(np.diff(t) > 1e-9, True)]
    return kept
