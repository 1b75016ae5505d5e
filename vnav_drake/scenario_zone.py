"""Braking zones as a scenario file names them: the built-in types with their parameters, and others by name.

Only form is checked here, so that whoever reads a file needs no zone. What a zone means is said by
`zones.catalogue`, and an unknown type is found there: it may be one that a plugin registers.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import (
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    GetJsonSchemaHandler,
    Strict,
    Tag,
    field_validator,
    model_validator,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, PydanticCustomError

from vnav_drake.scenario_section import Point, Section, number

MOST_SHARE = 100.0  # of the stopping distance: zones much longer than the way to stop are no use
MOST_CORNERS = 64  # of a polygon
MOST_FIELDS = 64
BUILT_IN = ("uniform", "ellipse", "protective_field", "polygon", "field_set")
MOST_DWELL = 60.0  # [s]
NEEDING_PARAMETERS = {  # types whose name alone is not enough, and what is missing then
    "polygon": "lacks its vertices; expected {type: polygon, vertices: [[x, y], ...]}"
}
TAG = "zone:"  # marks the type in the places of validation errors

_Share = Annotated[float, Field(ge=-MOST_SHARE, le=MOST_SHARE)]
_SharePoint = Annotated[tuple[_Share, _Share], Strict(False)]


class ZoneSpec(Section):
    """A type and its parameters."""

    type: str = Field(description="Its name.")

    @property
    def parameters(self) -> dict[str, Any]:
        """All parameters as plain data, defaults filled in; what is left to be derived is None."""
        return self.model_dump(mode="json", exclude={"type"})


class UniformSpec(ZoneSpec):
    """The same braking distance in every direction."""

    type: Literal["uniform"] = Field(description="A disc.")


class EllipseSpec(ZoneSpec):
    """An ellipse along the heading, in shares of the stopping distance, around the body."""

    type: Literal["ellipse"] = Field(description="An ellipse along the heading.")
    lateral_ratio: float = number("How far it reaches to either side.", None, 0.5, ge=1.0e-3, le=MOST_SHARE)
    ahead: float | None = Field(
        default=None,
        description="How far it reaches ahead; null: 1, with friction_reserve what a stop in a turn needs.",
        json_schema_extra={"minimum": 1.0, "maximum": MOST_SHARE},
    )
    behind: float | None = number(
        "How far it reaches behind, at most as far as ahead; null: as far as ahead.",
        None,
        None,
        ge=0.0,
        le=MOST_SHARE,
    )

    @field_validator("ahead")
    @classmethod
    def _holds_a_straight_stop(cls, ahead: float | None) -> float | None:
        if ahead is not None and not 1.0 <= ahead <= MOST_SHARE:
            raise PydanticCustomError(
                "zone",
                "must be from 1 to {most}: a zone that reaches less far ahead than the stopping distance "
                "does not hold a straight stop",
                {"most": f"{MOST_SHARE:g}"},
            )
        return ahead


class ProtectiveFieldSpec(ZoneSpec):
    """What a safety scanner watches: the body, as far ahead as the stopping distance."""

    type: Literal["protective_field"] = Field(description="A field as wide as the vehicle.")
    form: Literal["capsule", "rectangle"] = Field(
        default="capsule", description="capsule: round ends; rectangle: around the disc of the robot."
    )
    side: float = Field(
        default=0.0,
        description="Supplement to either side, besides the margin.",
        json_schema_extra={"minimum": 0.0, "maximum": 1.0e3, "unit": "m"},
    )

    @field_validator("side")
    @classmethod
    def _as_wide_as_the_vehicle(cls, side: float) -> float:
        if not 0.0 <= side <= 1.0e3:
            raise PydanticCustomError(
                "zone", "must be from 0 to 1000 [m]: a field is never narrower than the vehicle"
            )
        return side


class PolygonSpec(ZoneSpec):
    """A convex polygon in shares of the stopping distance, around the body."""

    type: Literal["polygon"] = Field(description="A polygon of one's own.")
    vertices: Annotated[tuple[_SharePoint, ...], Strict(False)] = Field(
        min_length=3,
        max_length=MOST_CORNERS,
        description="[[x, y], ...]: convex, either way round, x ahead; holds (0, 0) and (1, 0).",
    )


class OtherSpec(ZoneSpec):
    """A type that is not built in, with whatever parameters it has."""

    model_config = ConfigDict(extra="allow")

    type: str = Field(
        description="The name under which a plugin registers it.",
        json_schema_extra={"not": {"enum": list(BUILT_IN)}},
    )

    @property
    def parameters(self) -> dict[str, Any]:
        """As the file gives them."""
        return dict(self.model_extra or {})


def _mapping(value: Any) -> Any:
    """`{type: ellipse}` and `ellipse` are the same."""
    if isinstance(value, str):
        if value in NEEDING_PARAMETERS:
            raise PydanticCustomError("zone", NEEDING_PARAMETERS[value])
        return {"type": value}
    if isinstance(value, ZoneSpec):
        return value
    if not isinstance(value, dict):
        raise PydanticCustomError("zone", "must be the name of a zone, or a mapping with type and parameters")
    if "type" not in value:
        raise PydanticCustomError("zone", "must have the key type, the name of a zone")
    if not isinstance(value["type"], str):
        raise PydanticCustomError("zone", "has a type that is not text; expected the name of a zone")
    return value


def _plain_mapping(value: Any) -> Any:
    found = _mapping(value)
    if isinstance(found, dict) and found["type"] == "field_set":
        raise PydanticCustomError(
            "zone", "is a field_set itself; expected the zone that its fields stand for"
        )
    return found


def _tag(value: Any) -> str:
    kind = value.type if isinstance(value, ZoneSpec) else value["type"]
    return TAG + (kind if kind in BUILT_IN else "other")


class _OrName:
    """In the JSON Schema: a name instead of a mapping."""

    def __init__(self, *built_in: str) -> None:
        self.built_in = list(built_in)

    def __get_pydantic_json_schema__(
        self, core: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        name = {
            "type": "string",
            "not": {"enum": [*NEEDING_PARAMETERS]},
            "description": f"{', '.join(self.built_in)}, or the name that a plugin registers.",
        }
        return {"anyOf": [name, *handler(core)["oneOf"]]}


PlainZone = Annotated[
    Annotated[UniformSpec, Tag(f"{TAG}uniform")]
    | Annotated[EllipseSpec, Tag(f"{TAG}ellipse")]
    | Annotated[ProtectiveFieldSpec, Tag(f"{TAG}protective_field")]
    | Annotated[PolygonSpec, Tag(f"{TAG}polygon")]
    | Annotated[OtherSpec, Tag(f"{TAG}other")],
    Discriminator(_tag),
    BeforeValidator(_plain_mapping),
    _OrName("uniform", "ellipse", "protective_field"),
]


class FieldSpec(Section):
    """One field of a set."""

    max_speed: float = number("Up to which it is watched.", "m/s", ge=1.0e-6, le=1.0e3)
    polygon: Annotated[tuple[Point, ...], Strict(False)] = Field(
        min_length=3,
        max_length=MOST_CORNERS,
        description="[[x, y], ...] in the frame of the body, x ahead: convex, either way round.",
        json_schema_extra={"unit": "m"},
    )


class FieldSetSpec(ZoneSpec):
    """A finite number of fields, switched by speed."""

    type: Literal["field_set"] = Field(description="Fields switched by speed.")
    base: PlainZone = Field(
        default=UniformSpec(type="uniform"), description="The zone that the path is planned with."
    )
    count: int | None = Field(
        default=None, ge=2, le=MOST_FIELDS, description="How many to fit to the route; null: 4."
    )
    fields: Annotated[tuple[FieldSpec, ...], Strict(False)] | None = Field(
        default=None, min_length=1, max_length=MOST_FIELDS, description="The fields themselves."
    )
    dwell: float = number(
        "How long a field is watched at least, but for the first and the last; 0: as the speed alone asks.",
        "s",
        0.0,
        ge=0.0,
        le=MOST_DWELL,
    )

    @model_validator(mode="after")
    def _either_fitted_or_given(self) -> FieldSetSpec:
        if self.count is not None and self.fields is not None:
            raise PydanticCustomError("zone", "must have either count or fields, not both")
        return self

    @property
    def parameters(self) -> dict[str, Any]:
        """`base` as a mapping with its type, `dwell`, and either `count` or `fields`."""
        base = {"type": self.base.type, **self.base.parameters}
        found: dict[str, Any] = {"base": base, "dwell": self.dwell}
        if self.fields is None:
            return {**found, "count": 4 if self.count is None else self.count}
        return {**found, "fields": [field.model_dump(mode="json") for field in self.fields]}


Zone = Annotated[
    Annotated[UniformSpec, Tag(f"{TAG}uniform")]
    | Annotated[EllipseSpec, Tag(f"{TAG}ellipse")]
    | Annotated[ProtectiveFieldSpec, Tag(f"{TAG}protective_field")]
    | Annotated[PolygonSpec, Tag(f"{TAG}polygon")]
    | Annotated[FieldSetSpec, Tag(f"{TAG}field_set")]
    | Annotated[OtherSpec, Tag(f"{TAG}other")],
    Discriminator(_tag),
    BeforeValidator(_mapping),
    _OrName("uniform", "ellipse", "protective_field", "field_set"),
]


def untagged(place: tuple[str | int, ...]) -> tuple[str | int, ...]:
    """A validation error's place without the types of zones in it, which are no keys of the file."""
    return tuple(key for i, key in enumerate(place) if not is_tag(place, i))


def is_tag(place: tuple[str | int, ...], index: int) -> bool:
    """Whether an entry of a validation error's place is the type of a zone."""
    key = place[index]
    return index > 0 and place[index - 1] in ("zone", "base") and isinstance(key, str) and key in SPECS


SPECS: dict[str, type[ZoneSpec]] = {
    f"{TAG}uniform": UniformSpec,
    f"{TAG}ellipse": EllipseSpec,
    f"{TAG}protective_field": ProtectiveFieldSpec,
    f"{TAG}polygon": PolygonSpec,
    f"{TAG}field_set": FieldSetSpec,
    f"{TAG}other": OtherSpec,
}
