"""The four-wheeled vehicle: does contact give what Lemma A.1 of Manor 2015 says, and what does it cost?

* straight braking distance over v^2 / (2 a), torque-limited (a = a_b) and locked (a = mu g)
* v^2 / R at the onset of sliding over mu g (eq. A.2), of wheel lift over g w / (2 h) (eq. A.3); the height at
  which one takes over from the other, over w / (2 mu); for three robots, at two steps of the plant
* brakes at shares of g l / (2 h), beyond which a rigid robot pitches over: does it fall?
* S-curves at shares of the friction: lateral error; beyond it: what is flagged
* stops with held steering on a circle that takes a share of mu g = a_b, over asin(share) / (2 kappa)
* processor time: 200 emergency stops, a run over real time, next to peers in the same process
* with result folders (`reports/` unless named): lateral error and time of every motion to execute

`python -m benchmarks four_wheel`, or `python -m benchmarks.four_wheel FOLDER [FILE.json]`.
"""

from __future__ import annotations

import json
import math
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Any

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from benchmarks.vehicle_alone import crossover, lift_onset, slide_onset
from systems import simulate
from systems.diagram import tracking_diagram
from systems.following import Tolerance, following
from systems.four_wheel import PLANT_STEP, add_four_wheel
from systems.simulation import started
from systems.single_track import State
from systems.stops import ROWS, emergency_stops
from verify.evidence import read_table
from vnav_drake.plan import COLUMNS, Path, Trajectory
from vnav_drake.robot import GRAVITY, Robot
from vnav_drake.scenario import load_scenario

ROBOT = Robot(radius=0.4)
ROBOTS = {
    "40 kg, l = 0.5 m": ROBOT,
    "3 kg, l = 0.12 m": Robot(radius=0.12, mass=3.0, wheelbase=0.12, track=0.1, com_height=0.03),
    "40 kg, l = 0.6 m": Robot(radius=0.5, wheelbase=0.6, track=0.5, com_height=0.2),
}
STEPS = (PLANT_STEP, 0.5 * PLANT_STEP)  # [s]
SPEEDS = (1.0, 1.5, 2.0, 2.5, 3.0)  # [m/s]
RADII = (3.0, 5.0, 8.0)  # wheelbases
SHARES = (0.70, 0.80, 0.90, 0.95, 1.10, 1.20)  # of mu g
ARC_SHARES = (0.3, 0.5, 0.7, 0.8, 0.9)  # of mu g = a_b
PITCH_SHARES = (0.90, 0.95, 0.97, 1.0)  # of g l / (2 h)
PITCH_TIME = 1.0  # [s], that the stop takes: time enough to fall
STRONG = 7.5  # [m/s^2], of brakes that lock the wheels where mu g = 5.9
TOLERANCE = Tolerance(sideways=0.05, lateness=0.01, least_lateness=0.1)  # of the judge's check `tracking`
STOPS = 200  # instants


def steady(path: Path, speed: float) -> Trajectory:
    """A path at constant speed [m/s], a row every 2 cm."""
    s = np.unique(np.concatenate([np.arange(0.0, path.length, 0.02), np.cumsum(path.piece_length)]))
    x, y, heading, _ = path.at(s)
    curvature = path.at(0.5 * (s[1:] + s[:-1]))[3]
    flat = np.ones(len(s))
    return Trajectory(
        s / speed, x, y, heading, speed * flat, 0.0 * flat, np.append(curvature, curvature[-1]), 10.0 * flat
    )


def s_curve(radius: float, speed: float) -> Trajectory:
    """Straight, left, right, left, straight; curvature in four steps up to 1 / radius, like a clothoid."""
    ramp = [0.25, 0.5, 0.75]
    left = np.array([*ramp, 1.0, *ramp[::-1]]) / radius
    lengths = radius * np.array([0.2, 0.2, 0.2, 1.0, 0.2, 0.2, 0.2])
    curvature = np.concatenate([[0.0], left, -left, -left, left, [0.0]])
    ends = [1.5 * radius]
    return steady(
        Path.from_arcs((0.0, 0.0), 0.0, list(curvature), [*ends, *np.tile(lengths, 4), *ends]), speed
    )


def circle(radius: float, speed: float) -> Trajectory:
    """Half a turn to the left."""
    return steady(Path.from_arcs((0.0, 0.0), 0.0, [1.0 / radius], [math.pi * radius]), speed)


def braking(believed: Robot, actual: Robot, speed: float, step: float) -> float:
    """Braking distance on a straight over v^2 / 2 [s^2/m], of `actual` driven as `believed`."""
    motion = steady(Path.from_arcs((1.0, 2.0), 0.3, [0.0], [speed]), speed)
    loop = tracking_diagram(believed, motion, model="four_wheel", actual=actual, step=step)
    simulator = started(loop, loop.start)
    context = simulator.get_mutable_context()
    begin = 0.2
    loop.ask_to_stop(context, begin, straightened=False)
    simulator.AdvanceTo(begin)
    first = loop.vehicle.state(context)
    simulator.AdvanceTo(begin + 0.5 + speed / min(actual.max_braking, actual.friction_acceleration))
    last = loop.vehicle.state(context)
    if abs(last.longitudinal_velocity) > 1e-3:
        raise RuntimeError(f"{speed} m/s: not at rest: {last.longitudinal_velocity} m/s")
    return 2.0 * math.hypot(last.x - first.x, last.y - first.y) / first.longitudinal_velocity**2


def braking_table() -> list[dict[str, Any]]:
    """Braking distance over v^2 / (2 a)."""
    rows = []
    strong = replace(ROBOT, max_braking=STRONG)
    for step in STEPS:
        for speed in SPEEDS:
            torque = braking(ROBOT, ROBOT, speed, step) * ROBOT.max_braking
            locked = braking(replace(strong, friction=2.0), strong, speed, step) * ROBOT.friction_acceleration
            rows.append({"step": step, "speed": speed, "torque_limited": torque, "locked": locked})
    return rows


def onset_table() -> list[dict[str, Any]]:
    """Onsets of sliding and lifting over their closed forms; a lifting robot is tall and grips well."""
    rows = []
    for step in STEPS:
        for name, robot in ROBOTS.items():
            tall = replace(robot, com_height=1.25 * robot.track, friction=1.5)
            for bases in RADII:
                radius = bases * robot.wheelbase
                rows.append(
                    {
                        "step": step,
                        "robot": name,
                        "wheelbases": bases,
                        "slide": slide_onset(robot, radius, step),
                        "lift": lift_onset(tall, radius, step),
                    }
                )
    return rows


def pitch_table() -> list[dict[str, Any]]:
    """Greatest tilt [degrees] in a stop on a straight, brakes on at once, by share of g l / (2 h)."""
    rows = []
    for name, robot in ROBOTS.items():
        row: dict[str, Any] = {"robot": name}
        for share in PITCH_SHARES:
            height = 0.6 * robot.wheelbase
            braked = share * GRAVITY * robot.wheelbase / (2.0 * height)
            high = replace(robot, com_height=height, friction=1.5, max_braking=braked)
            speed = PITCH_TIME * braked
            motion = steady(Path.from_arcs((0.0, 0.0), 0.0, [0.0], [0.5 * speed]), speed)
            stops = emergency_stops(high, motion, count=1)
            row[f"{share:g}"] = float(np.degrees(stops.rows[:, ROWS.index("tilt")].max()))
        rows.append(row)
    return rows


def tracking_table() -> list[dict[str, Any]]:
    """S-curves of radius 2 m at shares of the friction; the schedule does not slow down."""
    rows = []
    for share in SHARES:
        motion = s_curve(2.0, math.sqrt(2.0 * share * ROBOT.friction_acceleration))
        run = simulate(ROBOT, motion, slowing=False)
        found = following(run, motion, TOLERANCE)
        late = run.details.get("travel_time", math.inf) / motion.travel_time - 1.0
        rows.append({"share": share, "lateral": found.sideways, "late": late, "cause": found.cause})
    return rows


def arc_table() -> list[dict[str, Any]]:
    """Way to rest on a circle of 2 m, over that with all friction and over v^2 / (2 a_b); mu g = a_b = 1."""
    robot, radius = replace(ROBOT, friction=1.0 / 9.81), 2.0
    rows = []
    for share in ARC_SHARES:
        speed = math.sqrt(share * radius)
        stops = emergency_stops(robot, circle(radius, speed), count=1)
        ways = []
        for i in range(2):
            table = stops.rows[stops.first[i] : stops.first[i + 1]]
            x, y = table[:, ROWS.index("x")], table[:, ROWS.index("y")]
            ways.append(float(np.hypot(np.diff(x), np.diff(y)).sum()))
        ideal, straight = 0.5 * radius * math.asin(share), 0.5 * speed**2
        rows.append(
            {
                "share": share,
                "held_over_ideal": ways[0] / ideal,
                "held_over_straight": ways[0] / straight,
                "straightened_over_straight": ways[1] / straight,
            }
        )
    return rows


def processor_time(work: Callable[[], object]) -> float:
    """[s]"""
    begun = time.process_time()
    work()
    return time.process_time() - begun


def bare_plant(robot: Robot, duration: float) -> None:
    """The plant alone, coasting straight ahead, its inputs fixed."""
    builder = DiagramBuilder()
    vehicle = add_four_wheel(builder, robot)
    simulator = Simulator(builder.Build())
    plant = vehicle.plant
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    speed = 1.0
    vehicle.set_state(context, State(0.0, 0.0, 0.0, speed, 0.0, 0.0, 0.0))
    count = plant.num_actuators()
    targets = np.zeros(2 * count)
    targets[count + np.array(vehicle.brakes)] = speed / vehicle.wheels.radius
    plant.get_actuation_input_port().FixValue(context, np.zeros(count))
    servo = plant.GetJointActuatorByName("steer_left").model_instance()
    plant.get_desired_state_input_port(servo).FixValue(context, targets)
    simulator.AdvanceTo(duration)


def cost(robot: Robot, motion: Trajectory) -> dict[str, float]:
    """Processor time of runs and stops along a motion, on one processor."""
    lasting = motion.travel_time
    plant = processor_time(lambda: bare_plant(robot, lasting))
    single = processor_time(lambda: simulate(robot, motion, model="single_track"))
    run = processor_time(lambda: simulate(robot, motion))
    stops = processor_time(lambda: emergency_stops(robot, motion, count=STOPS))
    return {
        "motion": lasting,
        "run": run,
        "real_time_factor": lasting / run,
        "run_over_bare_plant": run / plant,
        "run_over_single_track": run / single,
        "stops": stops,
        "stops_over_run": stops / run,
    }


def executed(folder: FilePath) -> tuple[Robot, Trajectory]:
    """Robot and motion to execute of a result folder."""
    robot = load_scenario(folder / "scenario.yaml").problem.robot
    table = read_table(folder, "trajectory.csv", COLUMNS, exact=True)
    return robot, Trajectory(*(table[name] for name in COLUMNS))


def executed_table(folders: Sequence[FilePath]) -> list[dict[str, Any]]:
    """How the motions to execute are followed."""
    rows = []
    for folder in folders:
        robot, motion = executed(folder)
        model = "four_wheel" if robot.radius > 0.0 else "single_track"
        run = simulate(robot, motion, model=model)
        found = following(run, motion, TOLERANCE)
        late = run.details.get("travel_time", math.inf) / motion.travel_time - 1.0
        rows.append(
            {
                "scenario": folder.name,
                "model": model,
                "planned": motion.travel_time,
                "lateral": found.sideways,
                "late": late,
                "least_load": run.details.get("least_load", math.nan),
                "cause": found.cause,
            }
        )
    return rows


def measure(results: FilePath) -> dict[str, Any]:
    """All of it."""
    folders = [file.parent for file in sorted(results.glob("*/trajectory.csv"))]
    warehouse = next((folder for folder in folders if folder.name == "warehouse"), None)
    speed = math.sqrt(0.5 * ROBOT.friction_acceleration * 2.0)
    robot, motion = executed(warehouse) if warehouse else (ROBOT, s_curve(2.0, speed))
    return {
        "braking": braking_table(),
        "onset": onset_table(),
        "crossover": crossover(ROBOT, 2.0),
        "pitch": pitch_table(),
        "tracking": tracking_table(),
        "arc": arc_table(),
        "cost_of": "warehouse" if warehouse else "S-curve",
        "cost": cost(robot, motion),
        "executed": executed_table(folders),
    }


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Rows as a table of Markdown."""
    if not rows:
        return "(none)"
    lines = [list(rows[0]), ["---"] * len(rows[0])]
    lines += [[f"{v:.4g}" if isinstance(v, float) else str(v or "") for v in row.values()] for row in rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def text(found: dict[str, Any]) -> str:
    """What `measure` found."""
    titles = {
        "braking": "straight braking distance over v^2 / (2 a)",
        "onset": "onset of sliding over mu g, of wheel lift over g w / (2 h)",
        "pitch": "greatest tilt [degrees] where brakes give a share of g l / (2 h) (30: it has fallen)",
        "tracking": "S-curve of 2 m radius, schedule kept [m, share of the time]",
        "arc": "way to rest on a circle that takes a share of mu g = a_b",
        "executed": "motions to execute",
    }
    parts = [f"{title}\n\n{table(found[key])}\n" for key, title in titles.items()]
    crossed = found["crossover"]
    parts.append(f"height at which sliding gives way to tipping, over w / (2 mu): {crossed:.3f}\n")
    parts.append(f"processor time [s], {found['cost_of']}, {STOPS} instants\n\n{table([found['cost']])}")
    return "\n".join(parts)


def main(results: FilePath = FilePath("reports"), file: FilePath | None = None) -> None:
    """Measure and print; write JSON where a file is named."""
    found = measure(results)
    print(text(found))
    if file:
        file.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(*(FilePath(name) for name in sys.argv[1:3]))
