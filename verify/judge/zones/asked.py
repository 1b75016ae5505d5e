"""The braking zone that a scenario asks for, from its raw numbers and by formulas of our own."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely

from verify.judge.limits import Limits
from verify.judge.zones.shapes import Box, Disc, Ellipse, Hull, Shape, Straight
from verify.judge.zones.zone import FieldSet, GaugeZone, Zone

HOLDS = 1e-9  # relative, and [m]: what a polygon may lack of what it must hold is rounding
LEAST_INSCRIBED = 1e-3  # share of the stopping distance: a smaller disc in a zone says nothing about speeds
MOST_AHEAD = 1.25  # an ellipse whose `ahead` is derived reaches no further
TURNS = 4096  # of held arcs, at which that is derived


class ZoneError(ValueError):
    """A scenario's zone is none that could be judged."""


@dataclass(frozen=True, kw_only=True, eq=False)
class AskedZone:
    """What a scenario asks for, where that is not a disc."""

    type: str
    parameters: Mapping[str, Any]  # plain data, as scenarios give them
    zone: Zone  # that paths are planned with: of field sets the base
    fields: FieldSet | None = None  # where the scenario gives the fields themselves
    count: int | None = None  # of fields that are fitted to the route
    plugin: bool = False  # not built in: its own functions are taken at their word

    @property
    def relaxation(self) -> str:
        """`inner` where a disc in the zone stands for it in methods for uniform braking, else `outer`."""
        zone = self.zone
        inside = isinstance(zone, GaugeZone) and zone.shape.inscribed >= LEAST_INSCRIBED
        return "inner" if inside else "outer"

    def within_disc(self, limits: Limits) -> bool:
        """Whether uniform braking by the same law keeps more free at every speed."""
        zone = self.zone
        return (
            isinstance(zone, GaugeZone)
            and zone.shape.extent <= 1.0 + HOLDS
            and zone.body.extent <= (limits.radius + limits.margin) * (1.0 + HOLDS)
        )


def asked_zone(spec: Any, limits: Limits) -> AskedZone | None:
    """The zone of a parsed scenario; None where it is a disc, that is, uniform braking.

    Raises
    ------
    ZoneError : it is not convex, or does not hold the robot's centre and a straight stop.
    """
    asked = spec.braking.zone
    if isinstance(asked, str):
        kind, parameters = asked, {}
    else:
        kind, parameters = asked.type, asked.parameters
    if kind == "field_set":
        return _field_set(parameters, limits)
    zone = plain_zone(kind, parameters, limits)
    if _is_disc(zone, limits):
        return None
    return AskedZone(type=kind, parameters=parameters, zone=zone, plugin=kind not in _BUILT_IN)


def plain_zone(kind: str, parameters: Mapping[str, Any], limits: Limits) -> GaugeZone:
    """A zone that is no field set.

    Raises
    ------
    ZoneError : as from `asked_zone`.
    """
    if kind not in _BUILT_IN:
        raise ZoneError(f"braking.zone: unknown type {kind!a}; known: {', '.join(_BUILT_IN)}, field_set")
    body, beside = limits.radius + limits.margin, limits.margin
    shape: Shape
    hull: Shape = Disc(body)
    if kind == "uniform":
        shape = Disc(1.0)
    elif kind == "ellipse":
        shape = _ellipse(parameters, limits)
    elif kind == "protective_field":
        side = float(parameters["side"])
        if not 0.0 <= side < math.inf:
            raise ZoneError("braking.zone.side: must be zero or more")
        shape, beside = Straight(), beside + side
        hull = Disc(body + side) if parameters["form"] == "capsule" else Box(body, body + side)
    else:
        shape = Hull(_convex(parameters["vertices"], "braking.zone.vertices", ((0.0, 0.0), (1.0, 0.0))))
    return GaugeZone(shape, hull, limits.braking, limits.reaction_time, beside)


def least_ahead(lateral_ratio: float, turn: float) -> float:
    """Least semi-axis A >= 1 of a centred ellipse (A, beta) that holds all arcs of up to `turn` [rad].

    Derived. An arc of length 1 and turn x ends at (sin x, 1 - cos x) / x, which is in the ellipse when
    A^2 >= (sin x / x)^2 / (1 - ((1 - cos x) / (beta x))^2); infinite where the arc is wider than beta.
    """
    best, low, high = 1.0, 0.0, turn
    for _ in range(4):
        x = np.linspace(low, high, TURNS + 1)[1:]
        wide = (1.0 - np.cos(x)) / (lateral_ratio * x)
        if (wide >= 1.0).any():
            return math.inf
        square = (np.sin(x) / x) ** 2 / (1.0 - wide * wide)
        at = int(np.argmax(square))
        best = max(best, float(square[at]))
        step = x[1] - x[0]
        low, high = max(0.0, float(x[at] - step)), min(turn, float(x[at] + step))
    return math.sqrt(best)


def _ellipse(parameters: Mapping[str, Any], limits: Limits) -> Ellipse:
    wide, ahead, behind = (parameters[key] for key in ("lateral_ratio", "ahead", "behind"))
    if ahead is None:
        ahead = 1.0
        if limits.reserves_friction and limits.reserve > 0.0:
            ahead = min(MOST_AHEAD, least_ahead(wide, 0.5 * limits.reserve / limits.braking))
    behind = ahead if behind is None else behind
    if not (0.0 < wide < math.inf and 1.0 <= ahead < math.inf and 0.0 <= behind <= ahead):
        raise ZoneError("braking.zone: an ellipse that does not hold the robot's centre and a straight stop")
    return Ellipse(0.5 * (ahead - behind), 0.5 * (ahead + behind), wide)


def _field_set(parameters: Mapping[str, Any], limits: Limits) -> AskedZone:
    of_base = dict(parameters["base"])
    base = plain_zone(of_base.pop("type"), of_base, limits)
    given = parameters.get("fields")
    return AskedZone(
        type="field_set",
        parameters=parameters,
        zone=base,
        fields=None if given is None else given_fields(given, limits),
        count=None if given is not None else int(parameters["count"]),
    )


def given_fields(given: Any, limits: Limits) -> FieldSet:
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
        hull = Hull(_convex(field["polygon"], where, ((0.0, 0.0),)))
        stop = speed * (limits.reaction_time + 0.5 * speed / limits.braking)
        normal = hull.kinks
        needed = stop * np.maximum(np.cos(normal), 0.0) + limits.radius + limits.margin
        if fields:
            needed = np.maximum(needed, fields[-1].support(normal))
        if (hull.support(normal) < needed - HOLDS).any():
            raise ZoneError(f"{where}: does not hold the way of a straight stop, or the field before")
        fields.append(hull)
    return FieldSet(speeds, tuple(fields))


def fitted_fields(base: GaugeZone, speeds: np.ndarray[Any, np.dtype[np.float64]]) -> FieldSet:
    """The zone `base` at the greatest speed of each case (c,) [m/s], rising."""
    return FieldSet(speeds, tuple(_Fixed(base, float(speed)) for speed in speeds))


@dataclass(frozen=True, eq=False)
class _Fixed(Shape):
    """A zone at one speed."""

    zone: GaugeZone
    speed: float  # [m/s]

    def support(self, angle: np.ndarray[Any, np.dtype[np.float64]]) -> np.ndarray[Any, np.dtype[np.float64]]:
        return self.zone.support(angle, np.asarray(self.speed))

    @property
    def extent(self) -> float:
        return float(self.zone.extent(np.asarray(self.speed)))

    @property
    def inscribed(self) -> float:
        far = float(self.zone.distance(np.asarray(self.speed)))
        return self.zone.body.inscribed + far * self.zone.shape.inscribed

    @property
    def kinks(self) -> np.ndarray[Any, np.dtype[np.float64]]:
        return self.zone.kinks(np.zeros(1))[0]


def _convex(vertices: Any, where: str, must_hold: tuple[tuple[float, float], ...]) -> Any:
    """The vertices of a convex polygon with an area that holds some points."""
    polygon = shapely.Polygon(vertices)
    if not polygon.is_valid or polygon.area <= 0.0:
        raise ZoneError(f"{where}: not a simple polygon with an area")
    if polygon.convex_hull.area - polygon.area > HOLDS * polygon.area:
        raise ZoneError(f"{where}: not convex")
    for point in must_hold:
        if polygon.distance(shapely.Point(point)) > HOLDS:
            raise ZoneError(f"{where}: does not hold ({point[0]:g}, {point[1]:g})")
    return vertices


def _is_disc(zone: Zone, limits: Limits) -> bool:
    """Whether this is uniform braking."""
    if not isinstance(zone, GaugeZone) or zone.body != Disc(limits.radius + limits.margin):
        return False
    return zone.shape in (Disc(1.0), Ellipse(0.0, 1.0, 1.0))


_BUILT_IN = ("uniform", "ellipse", "protective_field", "polygon")
