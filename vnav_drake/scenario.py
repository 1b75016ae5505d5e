"""The scenario file: what is asked, checked before anything is planned.

    scenario = load_scenario("scenarios/warehouse.yaml")
    scenario.problem.safe_speed([[28.5, 1.9]])

`scenario_file` reads text into data with line numbers, `scenario_spec` holds the keys, `scenario_checks`
the rules that join them, `scenario_zone_checks` those of the braking zone, `scenario_simulation` how the
result is driven. `docs/scenario.md` is the reference.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

from vnav_drake.braking import UniformBraking
from vnav_drake.problem import End, Problem
from vnav_drake.scenario_checks import build_robot, build_world, end_faults, robot_faults
from vnav_drake.scenario_faults import validate_spec
from vnav_drake.scenario_file import Document, Fault, ScenarioError, read_bytes, read_document, split_path
from vnav_drake.scenario_simulation import (
    SimulationSettings,
    duration_faults,
    simulation_settings,
    vehicle_faults,
)
from vnav_drake.scenario_spec import EndSpec, ScenarioSpec, scenario_schema
from vnav_drake.scenario_zone_checks import zone_of

__all__ = [
    "DwaSettings",
    "PlanSettings",
    "Scenario",
    "ScenarioError",
    "ScenarioSpec",
    "SimulationSettings",
    "load_scenario",
    "parse_scenario",
    "scenario_schema",
]


@dataclass(frozen=True, kw_only=True)
class DwaSettings:
    """The dynamic window approach."""

    weights: tuple[float, float, float] = (1.0, 1.0, 1.0)  # of heading, free way and speed
    window: float = 1.0  # [s]
    step: float | None = None  # [s], the method's own when None


@dataclass(frozen=True, kw_only=True)
class PlanSettings:
    """What plans are made."""

    methods: tuple[str, ...]
    homotopy_classes: int
    effort: Literal["quick", "full"]
    graph: Literal["sampled", "published"] = "sampled"
    through: tuple[str, ...] = ()  # gates to pass, in this order
    edge_cost: Literal["realised", "published"] = "realised"
    dwa: DwaSettings = DwaSettings()


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """One validated scenario file."""

    name: str
    description: str
    spec: ScenarioSpec = field(repr=False)  # numbers as written
    problem: Problem
    plan: PlanSettings
    simulation: SimulationSettings
    gates: Mapping[str, float]  # all gates, defaults filled in
    named_gates: frozenset[str]  # those that the file names itself
    data: bytes = field(repr=False)  # the file, byte by byte
    sha256: str  # of `data`, hexadecimal
    source: Path | None
    document: Document = field(repr=False, compare=False)  # where each key stands

    def error(self, key: str, message: str) -> ScenarioError:
        """Bad input that a later stage found, placed at a key such as `start.position`."""
        return self.document.error([Fault(split_path(key), message)])


def load_scenario(path: str | os.PathLike[str]) -> Scenario:
    """Read and check one scenario file.

    Raises
    ------
    ScenarioError : all faults of the file with line, key, value and what was expected; also when it
        is missing, unreadable, not a regular file or too large.
    """
    return _build(read_bytes(path), os.fspath(path), Path(path))


def parse_scenario(data: bytes, where: str) -> Scenario:
    """As `load_scenario`, for bytes at hand; `where` names them in messages."""
    return _build(data, where, None)


def _build(data: bytes, where: str, source: Path | None) -> Scenario:
    document = read_document(data, where)
    spec, form_faults = validate_spec(document)
    if spec is None or document.faults:
        raise document.error([*document.faults, *form_faults])
    robot = build_robot(spec.robot)
    braking = UniformBraking(
        max_braking=robot.max_braking,
        reaction_time=spec.braking.reaction_time,
        margin=spec.braking.margin,
        max_speed=robot.max_speed,
    )
    world, faults = build_world(spec)
    zone, fields, zone_faults = zone_of(spec, robot, braking)
    faults += robot_faults(spec) + vehicle_faults(spec) + zone_faults
    if world is not None and not zone_faults:
        faults += end_faults(spec, world, braking, fields or zone) + duration_faults(spec, braking, zone)
    if world is None or faults:
        raise document.error(faults)
    if fields is not None:  # nothing is planned faster than the last of them, whatever its zone
        braking = fields.law
        robot = replace(robot, max_speed=braking.max_speed)
        zone = None if zone is None else zone.with_law(braking)
    problem = Problem(
        world=world,
        robot=robot,
        braking=braking,
        zone=zone,
        friction_reserve=spec.braking.friction_reserve,
        start=_end(spec.start),
        goal=_end(spec.goal),
    )
    plan = PlanSettings(
        methods=spec.plan.methods,
        homotopy_classes=spec.plan.homotopy_classes,
        effort=spec.plan.effort,
        graph=spec.plan.graph,
        through=spec.plan.through,
        edge_cost=spec.plan.edge_cost,
        dwa=DwaSettings(weights=spec.plan.dwa.weights, window=spec.plan.dwa.window, step=spec.plan.dwa.step),
    )
    return Scenario(
        name=spec.name,
        description=spec.description,
        spec=spec,
        problem=problem,
        plan=plan,
        simulation=simulation_settings(spec),
        gates={name: float(limit) for name, limit in spec.gates.model_dump().items()},
        named_gates=frozenset(spec.gates.model_fields_set),
        data=data,
        sha256=hashlib.sha256(data).hexdigest(),
        source=source,
        document=document,
    )


def _end(spec: EndSpec) -> End:
    return End(position=spec.position, speed=spec.speed, heading=spec.heading)
