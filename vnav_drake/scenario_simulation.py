"""How a scenario's result is driven: what the file leaves out, and what no simulated vehicle can be."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from vnav_drake.braking import UniformBraking
from vnav_drake.scenario_checks import rounded_down
from vnav_drake.scenario_file import Fault
from vnav_drake.scenario_spec import ScenarioSpec
from vnav_drake.scenario_zone_checks import fastest_anywhere
from vnav_drake.zones.convex_zone import ConvexZone

STOPS, QUICK_STOPS = 200, 20  # instants of the emergency-stop audit unless the file says otherwise
# Wheels sink in under the load, by a thousandth of the wheelbase: a centre of mass 250 wheelbases up, or
# 250 track^2 / wheelbase, would fall over where it stands. At a tenth of that it tips 10 % early.
MOST_HEIGHT = 25.0
LONGEST_RUN = 10_000.0  # [s]: an hour of computing, and what is recorded of more cannot be judged
LONGEST_AUDIT = 30_000.0  # [s], of all emergency stops together: likewise


@dataclass(frozen=True, kw_only=True)
class SimulationSettings:
    """How the result is driven; what the file leaves out follows from the robot and `plan.effort`."""

    model: Literal["single_track", "four_wheel", "both"]
    stops: int  # instants of the emergency-stop audit, two stops each; 0: none
    studies: bool  # limits finder and robustness sweep


def simulation_settings(spec: ScenarioSpec) -> SimulationSettings:
    """The settings of a valid specification, defaults filled in."""
    asked, full = spec.simulation, spec.plan.effort == "full"
    return SimulationSettings(
        model=asked.model or ("single_track" if spec.robot.radius == 0.0 else "four_wheel"),
        stops=(STOPS if full else QUICK_STOPS) if asked.stops is None else asked.stops,
        studies=full if asked.studies is None else asked.studies,
    )


def vehicle_faults(spec: ScenarioSpec) -> list[Fault]:
    """Faults of a robot that the four-wheeled model cannot be."""
    robot = spec.robot
    if simulation_settings(spec).model == "single_track":
        return []
    if robot.radius == 0.0:
        message = "a point robot (robot.radius 0) has no room for four wheels; expected single_track"
        return [Fault(("simulation", "model"), message)]
    most = MOST_HEIGHT * min(robot.wheelbase, robot.track**2 / robot.wheelbase)
    if robot.com_height <= most:
        return []
    message = (
        f"too tall to stand on four wheels {robot.wheelbase:g} m by {robot.track:g} m apart; expected "
        f"at most {MOST_HEIGHT:g} min(wheelbase, track^2 / wheelbase) = {rounded_down(most)} [m], "
        "or simulation.model single_track"
    )
    return [Fault(("robot", "com_height"), message)]


def duration_faults(
    spec: ScenarioSpec, braking: UniformBraking, zone: ConvexZone | None = None
) -> list[Fault]:
    """A run or an audit that would be simulated for hours, however the robot drives in this world.

    No clearance is more than half the narrower extent of the floor, no speed more than what is safe there;
    with a zone that reaches less far to the sides, than what can be stopped from on the longest way across.
    """
    extent = np.ptp(np.array(spec.world.boundary), axis=0)
    room = max(0.5 * float(extent.min()) - spec.robot.radius, 0.0)
    speed = fastest_anywhere(zone, braking, room, float(np.hypot(*extent)))
    if speed == 0.0:
        return []  # there is no room, which is another fault
    apart = math.dist(spec.start.position, spec.goal.position)
    faults = []
    if apart / speed > LONGEST_RUN:
        message = (
            f"lies {apart:g} m from the start, at least {apart / speed:.4g} s at {speed:.4g} m/s, "
            f"the most that this room and robot allow; expected at most {LONGEST_RUN:g} s"
        )
        faults.append(Fault(("goal", "position"), message))
    stops = simulation_settings(spec).stops
    each = braking.reaction_time + speed / braking.max_braking
    if 2 * stops * each > LONGEST_AUDIT:
        message = (
            f"two stops at each of {stops} instants, of up to {each:.4g} s, would be simulated for more than "
            f"{LONGEST_AUDIT:g} s; expected at most {int(LONGEST_AUDIT / (2.0 * each))} instants"
        )
        faults.append(Fault(("simulation", "stops"), message))
    return faults
