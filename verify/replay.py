"""The run in three dimensions as one page that needs no network: Drake's Meshcat, recorded.

    write_replay(folder / "replay.html", scenario=scenario, trajectory=executed, run=columns)

`replay_motion` turns the run into frames, `replay_scene` builds what is seen from the triangles of
`replay_shapes`, `replay_page` makes Meshcat's page one file. The server that Meshcat needs to collect the
scene listens on a free port of this machine alone, and is gone when the page is written.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.geometry import Meshcat, MeshcatAnimation, MeshcatParams

from verify.replay_motion import (
    FALLEN,
    STOPPED,
    STOPPING,
    WHEELS,
    Frames,
    ZoneStep,
    frames,
    key_rows,
    zone_steps,
)
from verify.replay_page import ReplayError, finished
from verify.replay_scene import (
    BRAKING,
    BRAKING_COLOUR,
    BRAKING_STOP,
    PLACE_TOLERANCE,
    ROBOT,
    UNIFORM,
    UNIFORM_COLOUR,
    build_paths,
    build_robot,
    build_world,
    top_speed,
    views,
)
from verify.replay_shapes import drawn_thickness
from verify.report.html import write_whole
from verify.report.palette import INK, LIMIT, MUTED, PAPER, RACK_EDGE, RULE, method
from verify.report.speed_scale import speed_colours
from vnav_drake.plan import Trajectory
from vnav_drake.problem import Problem
from vnav_drake.scenario import Scenario
from vnav_drake.zones.convex_zone import ConvexZone

Array = NDArray[np.float64]

__all__ = ["ReplayError", "write_replay"]

HOST, PORT = "127.0.0.1", 0  # any free port
LAPS = 1000  # how often the run is shown: the page plays until it is told to stop

STRETCH_TOLERANCE = 2e-3  # of the zone's size, of animated sizes
TURN_TOLERANCE = 4e-3  # [rad], of animated angles
NEAR_BASES, NEAR_REACH = 14.0, 2.5  # distance of an onlooker that follows: wheelbases, greatest braking discs
MODE_WORDS = {STOPPING: "emergency stop", STOPPED: "stopped", FALLEN: "fallen"}


def write_replay(
    file: Path,
    *,
    scenario: Scenario,
    trajectory: Trajectory,
    run: Mapping[str, ArrayLike],
    title: str = "",
    stops: Sequence[ArrayLike] = (),
    zone: ConvexZone | None = None,
) -> None:
    """Write the recorded run as a page to look at from all sides, whole or not at all.

    World, start and goal, the planned path coloured by its speed, the driven path; the robot with wheels
    that steer (Ackermann) and turn (as if they rolled without slip), upright, with its disc and the disc that
    it may need to stop, rho + v t_r + v^2 / (2 a_b) + margin; with a zone that turns with the robot
    that zone, and of the disc the rim. A point robot is a marker.

    Parameters
    ----------
    file : where to write; its folder must exist.
    scenario : world, robot and braking law.
    trajectory : the plan that was executed.
    run : columns (m,) of one length: t [s], x, y [m], heading [rad], v [m/s], steering [rad] of the mean
        front wheel; `mode` where there is one (1 emergency stop, 3 fallen: the braking disc is red); others
        are not looked at.
    title : name of the page, the scenario's when empty.
    stops : paths (n, 2) [m] of emergency stops to draw on the floor.
    zone : what the run obeys where that is not the scenario's zone itself: fields fitted to it.

    Raises
    ------
    ReplayError : Meshcat cannot start or its page is not of the form that is known.
    ValueError : columns of `run` or shapes of `stops` are not as above.
    OSError : the file cannot be written.
    """
    problem = scenario.problem
    motion = frames(problem, run)
    lines = [_floor_path(stop) for stop in stops]
    zone = problem.zone if zone is None else zone
    around = [] if zone is None else zone_steps(zone, motion.v)
    with _quiet():
        try:
            meshcat = Meshcat(MeshcatParams(host=HOST, port=PORT, show_stats_plot=False))
        except (RuntimeError, OSError) as error:
            raise ReplayError(f"Meshcat cannot start: {error}") from error
        build_world(meshcat, problem)
        build_paths(meshcat, problem, trajectory, motion, lines)
        build_robot(meshcat, problem, around)
        meshcat.SetAnimation(_animation(problem, motion, around))
        page = str(meshcat.StaticHtml())
    name = title or scenario.name
    text = finished(
        page,
        title=name,
        panel=_panel(problem, trajectory, motion, stops, zoned=zone is not None),
        data=_data(problem, motion),
    )
    write_whole(file, text)


@contextmanager
def _quiet() -> Iterator[None]:
    """Meshcat's words about where it listens are of no use: it is gone before one could look."""
    logger = logging.getLogger("drake")

    def other(record: logging.LogRecord) -> bool:
        return "Meshcat listening" not in record.getMessage()

    logger.addFilter(other)
    try:
        yield
    finally:
        logger.removeFilter(other)


def _floor_path(points: ArrayLike) -> Array:
    line = np.asarray(points, dtype=float)
    if line.ndim != 2 or line.shape[1] != 2 or not len(line) or not np.isfinite(line).all():
        raise ValueError(f"a stop of shape {line.shape}: must be (n, 2) [m] with n >= 1, and finite")
    return line


def _animation(problem: Problem, motion: Frames, zone: Sequence[ZoneStep]) -> MeshcatAnimation:
    """Key frames: no more than straight lines between them need."""
    animation = MeshcatAnimation(motion.rate)
    place = PLACE_TOLERANCE * problem.world.diameter
    for row in key_rows(np.column_stack([motion.x, motion.y]), place).tolist():
        animation.SetProperty(row, ROBOT, "position", [float(motion.x[row]), float(motion.y[row]), 0.0])

    def turn(path: str, axis: str, angle: Array) -> None:
        for row in key_rows(angle, TURN_TOLERANCE).tolist():
            animation.SetProperty(row, path, f"rotation[{axis}]", float(angle[row]))

    turn(ROBOT, "z", motion.heading)
    if problem.robot.radius > 0.0:
        for name, steering, spin in zip(WHEELS, motion.steering.T, motion.spin.T, strict=True):
            turn(f"{ROBOT}/{name}", "z", steering)
            turn(f"{ROBOT}/{name}/spin", "y", spin)
    if zone:
        _grow_zone(animation, motion, zone)
        _grow(animation, UNIFORM, motion.reach, place)
    else:
        for path, shown in ((BRAKING, ~motion.alarm), (BRAKING_STOP, motion.alarm)):
            _grow(animation, path, motion.reach, place)
            _show(animation, path, shown)
    animation.set_autoplay(True)
    animation.set_loop_mode(MeshcatAnimation.LoopMode.kLoopRepeat)
    animation.set_repetitions(LAPS)
    return animation


def _grow(animation: MeshcatAnimation, path: str, reach: Array, tolerance: float) -> None:
    """A disc of radius 1 m as large as `reach` (n,) [m] at each frame."""
    for row in key_rows(reach, tolerance).tolist():
        animation.SetProperty(row, path, "scale", [float(reach[row]), float(reach[row]), 1.0])


def _show(animation: MeshcatAnimation, path: str, shown: NDArray[np.bool_]) -> None:
    """Seen in the frames where `shown` (n,)."""
    changed = [0, *(np.flatnonzero(np.diff(shown)) + 1).tolist(), len(shown) - 1]
    for row in changed:
        animation.SetProperty(row, path, "visible", bool(shown[row]))


def _grow_zone(animation: MeshcatAnimation, motion: Frames, zone: Sequence[ZoneStep]) -> None:
    """The outline that goes with the speed, stretched to its size, in calm or in red."""
    for k, step in enumerate(zone):
        rows = key_rows(np.where(step.shown[:, None], step.stretch, 1.0), STRETCH_TOLERANCE).tolist()
        for path, kind in ((BRAKING, ~motion.alarm), (BRAKING_STOP, motion.alarm)):
            _show(animation, f"{path}/{k}", step.shown & kind)
            if not np.any(step.shown & kind):
                continue
            for row in rows:
                across = step.stretch[row] if step.shown[row] else np.ones(2)
                animation.SetProperty(row, f"{path}/{k}", "scale", [float(across[0]), float(across[1]), 1.0])


def _panel(
    problem: Problem, trajectory: Trajectory, motion: Frames, stops: Sequence[ArrayLike], *, zoned: bool
) -> dict[str, object]:
    """What the panel shows; `zoned`: whether the zone is no disc."""
    shades = speed_colours(np.linspace(0.0, 1.0, 9), 1.0)
    scale = ", ".join("rgb({} {} {})".format(*np.rint(255.0 * shade).astype(int)) for shade in shades)
    swatches = [
        (method("simulation").light, "driven path and robot"),
        (BRAKING_COLOUR, "braking zone" if zoned else "what it may need to stop"),
    ]
    if zoned:
        swatches.append((UNIFORM_COLOUR, "rim of the disc of uniform braking"))
    if motion.alarm.any():
        swatches.append((LIMIT.light, "the same, in an emergency stop or fallen"))
    if len(stops):
        many = f"paths of {len(stops)} emergency stops"
        swatches.append((LIMIT.light, many if len(stops) > 1 else "path of an emergency stop"))
    thin = len(problem.world.walls) + len(problem.world.isolated)
    thickness = 100.0 * drawn_thickness(problem.world)
    note = f"Walls and points, which have no thickness, are drawn {thickness:.0f} cm thick." if thin else ""
    return {
        "duration": f"{motion.duration:.9g}",
        "top": f"{top_speed(trajectory):.2f} m/s",
        "scale": scale,
        "swatches": [{"colour": colour, "text": text} for colour, text in swatches],
        "note": note,
        "ink": INK.light,
        "muted": MUTED.light,
        "paper": PAPER.light,
        "rule": RULE.light,
        "edge": RACK_EDGE.light,
    }


def _data(problem: Problem, motion: Frames) -> dict[str, object]:
    """What the panel's script reads."""
    near = max(NEAR_BASES * problem.robot.wheelbase, NEAR_REACH * float(motion.reach.max()))
    return {
        "views": views(problem.world),
        "near": near,
        "rate": motion.rate,
        "duration": motion.duration,
        "robot": ROBOT.strip("/").split("/"),
        "speed": np.round(motion.v, 2).tolist(),
        "mode": motion.mode.tolist() if motion.mode.any() else [],
        "words": MODE_WORDS,
    }
