"""What a scenario file may hold: keys, types, units, ranges and defaults, and their JSON Schema.

The models keep the numbers as the file gives them and know nothing of geometry; rules that join several
keys are in `scenario_checks`.
"""

from __future__ import annotations

import math
import unicodedata
from collections.abc import Callable
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BeforeValidator,
    ConfigDict,
    Field,
    Strict,
    ValidationError,
    ValidationInfo,
    WrapValidator,
    field_validator,
    model_validator,
)
from pydantic_core import PydanticCustomError

from vnav_drake.scenario_section import MAX_COORDINATE, Point, Section, number
from vnav_drake.scenario_zone import UniformSpec, Zone

MAX_VERTICES = 100_000  # of the boundary and all obstacles together
CIRCLE_SIDES = 96  # of the polygon around a circle
METHODS = ("voronoi_route", "vc_method", "speed_graph", "dwa")
MOST_TOKENS = 100  # gates that a class may be asked to cross
RESERVED_NAMES = (
    "index",
    "con",
    "prn",
    "aux",
    "nul",
    *(f"{d}{i}" for d in ("com", "lpt") for i in range(1, 10)),
)
SCHEMA_DIALECT = "https://json-schema.org/draft/2020-12/schema"


def _plain_text(text: str) -> str:
    """Refuse what could disturb a terminal or a page: control, format and separator characters."""
    for character in text:
        if unicodedata.category(character) in {"Cc", "Cf", "Cs", "Zl", "Zp"} and character not in "\n\u200d":
            raise PydanticCustomError("text", f"must not hold the control character {character!a}")
    return text


def _one_line(text: str) -> str:
    if "\n" in text:
        raise PydanticCustomError("text", "must be a single line")
    return _plain_text(text)


def _version(value: Any) -> Any:
    if type(value) is not int or value != 1:  # True == 1 and 1.0 == 1
        raise PydanticCustomError("version", "must be 1, the only version of this format")
    return value


def _free_name(name: str) -> str:
    if name in RESERVED_NAMES:
        raise PydanticCustomError("name", "is reserved; expected another name")
    return name


def _speed(value: Any, inner: Callable[[Any], Any]) -> Any:
    try:
        return inner(value)
    except ValidationError as error:
        raise PydanticCustomError("speed", "must be safe, rest, or a speed from 0 to 1000 [m/s]") from error


def _distinct(methods: tuple[str, ...]) -> tuple[str, ...]:
    if len(set(methods)) < len(methods):
        raise PydanticCustomError("methods", "names a method twice; expected each once")
    return methods


Speed = Annotated[Literal["safe", "rest"] | Annotated[float, Field(ge=0.0, le=1000.0)], WrapValidator(_speed)]
Method = Literal["voronoi_route", "vc_method", "speed_graph", "dwa"]
Weight = Annotated[float, Field(ge=0.0, le=1.0e6)]
Token = Annotated[str, Field(min_length=1, max_length=250), AfterValidator(_one_line)]


class CircleSpec(Section):
    """A disc on the floor."""

    center: Point = Field(description="Centre [x, y].", json_schema_extra={"unit": "m"})
    radius: float = number("Radius.", "m", ge=1.0e-3, le=MAX_COORDINATE)


class ObstacleSpec(Section):
    """Either vertices (one: a point, two: a wall segment, three or more: a polygon) or a circle."""

    model_config = ConfigDict(
        json_schema_extra={"oneOf": [{"required": ["vertices"]}, {"required": ["circle"]}]}
    )

    name: Annotated[str, AfterValidator(_one_line)] = Field(
        default="", max_length=100, description="For messages and the map."
    )
    vertices: Annotated[tuple[Point, ...], Strict(False)] = Field(
        default=(),
        min_length=1,
        description="[[x, y], ...]: a point, a wall segment or a simple polygon, either way round.",
        json_schema_extra={"unit": "m"},
    )
    circle: CircleSpec | None = Field(default=None, description="A disc; planners see a polygon around it.")

    @model_validator(mode="after")
    def _exactly_one_shape(self) -> ObstacleSpec:
        given = self.model_fields_set & {"vertices", "circle"}
        if len(given) != 1 or not (self.vertices or self.circle):
            raise PydanticCustomError("shape", "must have either vertices or circle, exactly one of them")
        return self


class WorldSpec(Section):
    """The floor and what stands on it."""

    boundary: Annotated[tuple[Point, ...], Strict(False)] = Field(
        min_length=3,
        description="Corners of the outer wall: a simple polygon, not closed by repetition.",
        json_schema_extra={"unit": "m"},
    )
    obstacles: Annotated[tuple[ObstacleSpec, ...], Strict(False)] = Field(
        default=(), description="They may touch and overlap; they are united."
    )


class RobotSpec(Section):
    """The robot's body and limits."""

    radius: float = number("Of the disc that contains the body; 0 for a point robot.", "m", ge=0.0, le=1.0e3)
    mass: float = number("Mass.", "kg", ge=1.0e-3, le=1.0e6)
    wheelbase: float = number("Distance between the axles.", "m", ge=1.0e-3, le=1.0e3)
    track: float = number("Distance between the left and right wheels.", "m", ge=1.0e-3, le=1.0e3)
    com_height: float = number("Height of the centre of mass above the floor.", "m", ge=0.0, le=1.0e3)
    friction: float = number(
        "mu, tyre on floor; mu g bounds braking and turning together.", ge=1.0e-6, le=100.0
    )
    max_braking: float = number("a_b, the greatest deceleration.", "m/s^2", ge=1.0e-6, le=1.0e3)
    max_acceleration: float = number("a_max, the greatest acceleration.", "m/s^2", ge=1.0e-6, le=1.0e3)
    max_speed: float | None = number("null: not limited.", "m/s", None, ge=1.0e-6, le=1.0e3)
    max_steering: float = number("Of the mean front wheel, below pi/2.", "rad", ge=1.0e-6, lt=math.pi / 2.0)
    max_steering_rate: float | None = number("null: not limited.", "rad/s", None, ge=1.0e-6, le=1.0e3)


class BrakingSpec(Section):
    """How the robot brakes: v t_r + v^2 / (2 a_b) + m must fit into the clearance."""

    zone: Zone = Field(
        default=UniformSpec(type="uniform"),
        description="Shape of the braking zone: a type, or a mapping of type and parameters.",
    )
    reaction_time: float = number("t_r, before the brakes act.", "s", 0.0, ge=0.0, le=100.0)
    margin: float = number("m, kept free at standstill.", "m", 0.0, ge=0.0, le=1.0e3)
    friction_reserve: bool = Field(default=False, description="Keep full braking available while turning.")


class EndSpec(Section):
    """Start or goal."""

    position: Point = Field(description="[x, y] of the robot's centre.", json_schema_extra={"unit": "m"})
    speed: Speed = Field(
        default="safe",
        description="safe: any speed up to the braking limit; rest: zero; or a speed.",
        json_schema_extra={"unit": "m/s"},
    )
    heading: float | None = number(
        "From the x axis to the left; null: free.", "rad", None, ge=-100.0, le=100.0
    )


class DwaSpec(Section):
    """The dynamic window approach."""

    weights: tuple[Weight, Weight, Weight] = Field(
        default=(1.0, 1.0, 1.0),
        description="Of heading, free way and speed in the objective; not all zero.",
        strict=False,
    )
    window: float = number("Time for which an arc and a speed are chosen.", "s", 1.0, ge=0.02, le=100.0)
    step: float | None = number(
        "Time after which it chooses again, at most the window; null: the default.", "s", None, ge=0.02
    )

    @field_validator("weights")
    @classmethod
    def _one_counts(cls, weights: tuple[float, float, float]) -> tuple[float, float, float]:
        if not any(weights):
            raise PydanticCustomError("weights", "must have one weight above zero at least")
        return weights

    @field_validator("step")
    @classmethod
    def _within_the_window(cls, step: float | None, info: ValidationInfo) -> float | None:
        window = info.data.get("window")
        if step is not None and window is not None and step > window:
            raise PydanticCustomError(
                "step", "must be at most plan.dwa.window, {window} s", {"window": window}
            )
        return step


class PlanSpec(Section):
    """What plans are made."""

    methods: Annotated[tuple[Method, ...], Strict(False), AfterValidator(_distinct)] = Field(
        default=("speed_graph",), min_length=1, description="What seeds and what is compared."
    )
    homotopy_classes: int = Field(default=6, ge=1, le=50, description="How many of the best classes to plan.")
    graph: Literal["sampled", "published"] = Field(
        default="sampled", description="Speed graph that ranks the classes; published: that of Manor 2015."
    )
    through: Annotated[tuple[Token, ...], Strict(False)] = Field(
        default=(),
        max_length=MOST_TOKENS,
        description="Plan only classes that pass these gates in this order, each named by the two "
        "obstacles it lies between: O4/O6.",
    )
    edge_cost: Literal["realised", "published"] = Field(
        default="realised",
        description="What an edge of the vc-method's graph costs: the least time along it, or the formula of "
        "Manor 2015, Sec. 2.5.",
    )
    dwa: DwaSpec = Field(default=DwaSpec(), description="Settings of the dynamic window approach.")
    effort: Literal["quick", "full"] = Field(default="full", description="Budget of counted work.")

    @field_validator("through")
    @classmethod
    def _needs_the_speed_graph(cls, through: tuple[str, ...], info: ValidationInfo) -> tuple[str, ...]:
        if through and "speed_graph" not in info.data.get("methods", ("speed_graph",)):
            raise PydanticCustomError("methods", "needs speed_graph among plan.methods")
        return through


class SimulationSpec(Section):
    """How the result is driven, and how often it is asked to stop."""

    model: Literal["single_track", "four_wheel", "both"] | None = Field(
        default=None, description="Vehicle that drives; null: four_wheel, single_track for a point robot."
    )
    stops: int | None = Field(
        default=None,
        ge=0,
        le=2000,
        description="Instants of the emergency-stop audit, two stops each; 0: none; null: 200, or 20 with "
        "plan.effort quick.",
    )
    studies: bool | None = Field(
        default=None, description="Limits finder and robustness sweep; null: with plan.effort full."
    )


class GatesSpec(Section):
    """Limits that the result must keep; exit code 1 otherwise."""

    analytic_gap: float = number("Speed graph against collocation of the same model.", None, 0.01, ge=0.0)
    refinement_gap: float = number("Full robot against the variational optimum.", None, 0.05, ge=0.0)
    certified_gap: float = number("Best upper against the global lower bound.", None, 0.03, ge=0.0)
    constraint_violation: float = number("Worst normalised violation.", None, 1.0e-6, ge=0.0)
    braking_margin: float = number("Least clearance minus braking distance, at least this.", "m", 0.0, ge=0.0)
    emergency_stops: int = Field(default=0, ge=0, description="Simulated stops that may end badly.")


class ScenarioSpec(Section):
    """A scenario file as written."""

    schema_version: Annotated[Literal[1], BeforeValidator(_version)] = Field(
        alias="schema", description="Version of this format."
    )
    name: Annotated[str, AfterValidator(_free_name)] = Field(
        pattern="^[a-z0-9_-]+$",
        max_length=64,
        description="Names the output folder.",
        json_schema_extra={"not": {"enum": list(RESERVED_NAMES)}},
    )
    description: Annotated[str, AfterValidator(_plain_text)] = Field(
        default="", max_length=10_000, description="What the scenario shows; one line or more."
    )
    world: WorldSpec
    robot: RobotSpec
    braking: BrakingSpec = BrakingSpec()
    start: EndSpec
    goal: EndSpec
    plan: PlanSpec = PlanSpec()
    simulation: SimulationSpec = SimulationSpec()
    gates: GatesSpec = GatesSpec()


def scenario_schema() -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of scenario files, with descriptions and units, for editors."""
    schema = ScenarioSpec.model_json_schema(by_alias=True)
    return {"$schema": SCHEMA_DIALECT, **schema, "title": "vnav-drake scenario"}
