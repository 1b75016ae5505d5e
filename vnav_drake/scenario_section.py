"""What the sections of a scenario file are made of: strict models, numbers with units, points."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, Strict

MAX_COORDINATE = 1.0e5  # [m]: doubles lie 1.5e-11 m apart there, well below the 1e-9 m that unites obstacles

Coordinate = Annotated[float, Field(ge=-MAX_COORDINATE, le=MAX_COORDINATE, json_schema_extra={"unit": "m"})]
# A YAML list where the model has a tuple: only the container is lenient, not the numbers in it.
Point = Annotated[tuple[Coordinate, Coordinate], Strict(False)]


class Section(BaseModel):
    """A mapping of the file: no key but those known, no number from text, none that is not finite."""

    model_config = ConfigDict(
        strict=True, extra="forbid", frozen=True, allow_inf_nan=False, hide_input_in_errors=True
    )


def number(
    text: str,
    unit: str | None = None,
    default: Any = ...,
    *,
    ge: float | None = None,
    le: float | None = None,
    lt: float | None = None,
) -> Any:
    """A number field with its description, unit and range."""
    extra: dict[str, Any] = {} if unit is None else {"unit": unit}
    return Field(default=default, description=text, json_schema_extra=extra, ge=ge, le=le, lt=lt)
