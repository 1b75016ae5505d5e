"""Fields of a field set: polygons that a scenario gives, or a zone at some speeds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from verify.judge.limits import Limits
from verify.judge.zones.errors import ZoneError
from verify.judge.zones.shapes import Hull, Shape
from verify.judge.zones.zone import FieldSet, Zone

Array = NDArray[np.float64]

HOLDS = 1e-9  # relative, and [m]: what a polygon may lack of what it must hold is rounding


@dataclass(frozen=True, eq=False)
class AtSpeed(Shape):
    """A zone at one speed [m]."""

    zone: Zone
    speed: float  # [m/s]

    def support(self, angle: Array) -> Array:
        return self.zone.support(angle, np.asarray(self.speed))

    @property
    def extent(self) -> float:
        return float(self.zone.extent(np.asarray(self.speed)))

    @property
    def inscribed(self) -> float:
        return 0.0

    @property
    def kinks(self) -> Array:
        return self.zone.kinks(np.full(1, self.speed))[0]


def fitted_fields(base: Zone, speeds: Array) -> FieldSet:
    """The zone `base` at the greatest speed of each case (c,) [m/s], rising."""
    return FieldSet(speeds, tuple(AtSpeed(base, float(speed)) for speed in speeds))


def given_fields(given: Sequence[Mapping[str, Any]], limits: Limits) -> FieldSet:
    """Fields that a scenario gives as polygons.

    Raises
    ------
    ZoneError : speeds do not rise; a polygon does not hold the way of a straight stop, or the field before.
    """
    speeds = np.array([float(field["max_speed"]) for field in given])
    if (speeds <= 0.0).any() or (np.diff(speeds) <= 0.0).any():
        raise ZoneError("braking.zone.fields: the greatest speeds must be positive and rise")
    fields: list[Shape] = []
    for index, (field, speed) in enumerate(zip(given, speeds, strict=True)):
        where = f"braking.zone.fields[{index}].polygon"
        hull = Hull(convex(field["polygon"], where, ((0.0, 0.0),)))
        stop = speed * (limits.reaction_time + 0.5 * speed / limits.braking)
        normal = hull.kinks
        needed = stop * np.maximum(np.cos(normal), 0.0) + limits.radius + limits.margin
        if fields:
            needed = np.maximum(needed, fields[-1].support(normal))
        if (hull.support(normal) < needed - HOLDS).any():
            raise ZoneError(f"{where}: does not hold the way of a straight stop, or the field before")
        fields.append(hull)
    return FieldSet(speeds, tuple(fields))


def convex(vertices: Any, where: str, must_hold: Sequence[tuple[float, float]]) -> Any:
    """The vertices of a convex polygon with an area that holds some points.

    Raises
    ------
    ZoneError : it is none.
    """
    polygon = shapely.Polygon(vertices)
    if not polygon.is_valid or polygon.area <= 0.0:
        raise ZoneError(f"{where}: not a simple polygon with an area")
    if polygon.convex_hull.area - polygon.area > HOLDS * polygon.area:
        raise ZoneError(f"{where}: not convex")
    for point in must_hold:
        if polygon.distance(shapely.Point(point)) > HOLDS:
            raise ZoneError(f"{where}: does not hold ({point[0]:g}, {point[1]:g})")
    return vertices
