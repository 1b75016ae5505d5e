"""What was asked: the scenario's raw numbers as the judge reads them, without the planners' geometry."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely

from verify import evidence
from verify.evidence import EvidenceError
from verify.judge.checks import Setting
from verify.judge.features import Features
from verify.judge.limits import GRAVITY
from verify.judge.zones import ZoneError
from vnav_drake.scenario_faults import validate_spec
from vnav_drake.scenario_file import ScenarioError, read_document

MOST_OVERLAPS = 100_000  # pairs of polygons whose boxes meet: what uniting them may cost
STOPS = {
    "full": 200,
    "quick": 20,
}  # instants of the emergency-stop audit by plan.effort, where none are given
ROUNDING = 1e-9  # relative, of mu g against a_b, and [m], of the wheels against the disc


@dataclass(frozen=True, kw_only=True)
class Drive:
    """What is to be simulated, defaults filled in."""

    model: str  # single_track, four_wheel or both
    stops: int  # instants of the emergency-stop audit; 0: none

    @property
    def vehicle(self) -> str:
        """Model of the vehicle that drives the result and makes the stops."""
        return "single_track" if self.model == "single_track" else "four_wheel"

    @property
    def prescreen(self) -> bool:
        """Whether a single track drives the result, too."""
        return self.model == "both"

    @classmethod
    def from_spec(cls, spec: Any) -> Drive:
        """From a parsed scenario's raw settings; a point robot has no wheels to simulate."""
        usual = "four_wheel" if spec.robot.radius > 0.0 else "single_track"
        stops = spec.simulation.stops
        return cls(
            model=spec.simulation.model or usual, stops=STOPS[spec.plan.effort] if stops is None else stops
        )


@dataclass(frozen=True, kw_only=True)
class Question:
    """One scenario file as far as its form was checked."""

    name: str
    sha256: str  # of the file, hexadecimal
    setting: Setting
    drive: Drive
    gates: Mapping[str, float]  # all gates, defaults filled in
    named_gates: frozenset[str]  # those that the file names itself
    some_ways: bool  # plan.through asks for some ways only, which need not hold the fastest

    @property
    def features(self) -> Features:
        """What stands in the way, side by side."""
        return self.setting.features


def read_question(data: bytes) -> Question:
    """From the bytes of a scenario file.

    Keys, types and ranges are checked as for planning. Of the rules that join several keys, only those
    are checked again, with code of our own, without which the checks would mean nothing: outlines that
    enclose an area once, wheels within the disc, brakes that friction and the axles can carry.

    Raises
    ------
    EvidenceError : the file is not such a scenario; all faults of its form are listed.
    """
    try:
        document = read_document(data, evidence.SCENARIO)
        spec, faults = validate_spec(document)
        if spec is None or document.faults:
            raise document.error([*document.faults, *faults])
    except ScenarioError as error:
        raise EvidenceError(*str(error).splitlines()) from error
    wrong = [*_outline_faults(spec.world), *_robot_faults(spec.robot)]
    if spec.robot.radius == 0.0 and spec.simulation.model not in (None, "single_track"):
        wrong.append("simulation.model: a point robot has no four wheels")
    if wrong:
        raise EvidenceError(*(f"{evidence.SCENARIO}: {text}" for text in wrong))
    try:
        setting = Setting.from_spec(spec)
    except ZoneError as error:
        raise EvidenceError(f"{evidence.SCENARIO}: {error}") from error
    return Question(
        name=spec.name,
        sha256=evidence.sha256(data),
        setting=setting,
        drive=Drive.from_spec(spec),
        gates={name: float(limit) for name, limit in spec.gates.model_dump().items()},
        named_gates=frozenset(spec.gates.model_fields_set),
        some_ways=bool(spec.plan.through),
    )


def _outline_faults(world: Any) -> list[str]:
    """Outlines without a definite inside, and more overlaps than can be united in reasonable time."""
    outlines = {"world.boundary": world.boundary}
    for index, obstacle in enumerate(world.obstacles):
        if len(obstacle.vertices) >= 3:
            outlines[f"world.obstacles[{index}]"] = obstacle.vertices
    polygons = np.array([shapely.Polygon(vertices) for vertices in outlines.values()], dtype=object)
    sound = shapely.is_valid(polygons) & (shapely.area(polygons) > 0.0)
    wrong = [f"{key}: not a simple polygon" for key, good in zip(outlines, sound, strict=True) if not good]
    if wrong:
        return wrong
    tree, count = shapely.STRtree(polygons[1:]), 0
    for polygon in polygons[1:]:
        count += len(tree.query(polygon))
        if count > 2 * MOST_OVERLAPS + 3 * len(polygons):
            return ["world.obstacles: too many of them overlap"]
    return []


def _robot_faults(robot: Any) -> list[str]:
    """Wheels outside the disc whose clearance is judged; brakes beyond what floor and axles carry."""
    wrong = []
    if robot.radius > 0.0 and 0.5 * math.hypot(robot.wheelbase, robot.track) > robot.radius + ROUNDING:
        wrong.append("robot.radius: the wheels stand outside the disc")
    if robot.friction * GRAVITY < robot.max_braking * (1.0 - ROUNDING):
        wrong.append("robot.max_braking: more than friction allows")
    hardest = max(robot.max_braking, robot.max_acceleration)
    if 2.0 * robot.com_height * hardest > GRAVITY * robot.wheelbase * (1.0 + ROUNDING):
        wrong.append("robot: braking or accelerating lifts an axle")
    return wrong
