"""Which braking zones there are, by name: those built in, and those that plugins bring.

    zone = build_zone("ellipse", {"lateral_ratio": 0.5}, law, radius=0.4)

A zone from elsewhere is a dataclass that extends `GaugeZone` or `ConvexZone` and has a `type_name`; the
fields it adds are its parameters (see `plugins`). `docs/tutorials/new_braking_zone.md` makes one.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from vnav_drake.braking import UniformBraking
from vnav_drake.testing import check_zone
from vnav_drake.zones import plugins
from vnav_drake.zones.convex_zone import ConvexZone, GaugeZone
from vnav_drake.zones.errors import PluginError, ZoneError, ZoneFault
from vnav_drake.zones.field_set import FieldSet
from vnav_drake.zones.held_arc import MOST_AHEAD, ROUNDING, arc_excess, least_ahead, side_room
from vnav_drake.zones.shapes import DiscZone, EllipseZone, PolygonZone, ProtectiveField

BUILT_IN: Mapping[str, type[ConvexZone]] = {
    zone.type_name: zone for zone in (DiscZone, EllipseZone, ProtectiveField, PolygonZone, FieldSet)
}
SMALL_TURN = 1e-3  # [rad]: what cannot turn by this cannot turn


def known_types() -> tuple[str, ...]:
    """Names of all zones that a scenario can ask for here."""
    return (*BUILT_IN, *sorted(set(plugins.names()) - set(BUILT_IN)))


def build_zone(
    type_name: str,
    parameters: Mapping[str, Any],
    law: UniformBraking,
    radius: float,
    reserve: float | None = None,
) -> ConvexZone | None:
    """The zone that paths are planned with; None where that is the disc of uniform braking.

    Parameters
    ----------
    type_name : one of `known_types()`. parameters : plain data as a scenario file gives them; a field set's
        `base` is a name or a mapping with `type`.
    law : stopping distance, margin, greatest speed. radius : of the robot's disc [m].
    reserve : lateral acceleration [m/s^2] that leaves full braking available, where that is asked for.

    Returns
    -------
    Of a field set the base zone: which field is watched follows from the speed along the path (`field_set`).

    Raises
    ------
    ZoneError : an unknown name, a parameter that is unknown, missing or wrong, a zone that does not hold the
        way of a straight stop, one that forbids turning, a plugin's zone that breaks the rules of zones.
    """
    if type_name == FieldSet.type_name:
        _known("field_set", parameters, ("base", "count", "fields", "dwell"))
        base_type, base_parameters = _base(parameters)
        try:
            return build_zone(base_type, base_parameters, law, radius, reserve)
        except ZoneError as error:
            raise ZoneError(f"base.{error.key}" if error.key else "base", error.message) from error
    zone = _built_in(type_name, parameters, law, radius, reserve)
    if zone is None:
        zone = _from_plugin(type_name, parameters, law, radius)
    if isinstance(zone, DiscZone) or (isinstance(zone, EllipseZone) and zone.is_disc):
        return None
    if reserve is not None and isinstance(zone, GaugeZone):
        _must_turn(zone, reserve)
    return zone


def field_set(
    parameters: Mapping[str, Any], law: UniformBraking, radius: float, reserve: float | None = None
) -> FieldSet | None:
    """The fields that a scenario gives; None where they are to be fitted (`count`).

    Raises
    ------
    ZoneError : fields that are not nested, do not rise in speed, are narrower than the vehicle, or lack the
        way of a straight stop; a base that cannot be.
    """
    base = build_zone(FieldSet.type_name, parameters, law, radius, reserve)
    fields = parameters.get("fields")
    if fields is None:
        return None
    for i, field in enumerate(fields):
        _as_wide_as_the_vehicle(i, field["polygon"], radius + law.margin)
    try:
        return FieldSet(
            law=law,
            radius=radius,
            base=DiscZone(law=law, radius=radius) if base is None else base,
            max_speeds=tuple(float(field["max_speed"]) for field in fields),
            polygons=tuple(_points(field["polygon"]) for field in fields),
        )
    except ValueError as error:
        raise plugins.told(error, ("fields",)) from error


def _base(parameters: Mapping[str, Any]) -> tuple[str, Mapping[str, Any]]:
    base = parameters.get("base", DiscZone.type_name)
    if isinstance(base, str):
        base = {"type": base}
    if not isinstance(base, Mapping) or not isinstance(base.get("type"), str):
        raise ZoneError("base", "must be the name of a zone, or a mapping with type and parameters")
    if base["type"] == FieldSet.type_name:
        raise ZoneError("base", "is a field_set itself; expected the zone that its fields stand for")
    return base["type"], {key: value for key, value in base.items() if key != "type"}


def _as_wide_as_the_vehicle(i: int, polygon: Any, width: float) -> None:
    for side, reach in (("left", max(y for _, y in polygon)), ("right", -min(y for _, y in polygon))):
        if reach < width - 1e-9:
            raise ZoneError(
                f"fields[{i}].polygon",
                f"is narrower than the vehicle: it reaches {reach:g} m to the {side}; expected the radius "
                f"and the margin, {width:g} m, at least",
            )


def _built_in(
    type_name: str, parameters: Mapping[str, Any], law: UniformBraking, radius: float, reserve: float | None
) -> ConvexZone | None:
    """A zone of the package; None where the name is none of those."""
    given: dict[str, Any] = dict(parameters)
    if type_name == DiscZone.type_name:
        _known(type_name, given, ())
        return DiscZone(law=law, radius=radius)
    try:
        if type_name == EllipseZone.type_name:
            _known(type_name, given, ("lateral_ratio", "ahead", "behind"))
            return _ellipse(given, law, radius, reserve)
        if type_name == ProtectiveField.type_name:
            _known(type_name, given, ("form", "side"))
            return ProtectiveField(law=law, radius=radius, **given)
        if type_name == PolygonZone.type_name:
            _known(type_name, given, ("vertices",))
            if "vertices" not in given:
                raise ZoneError("vertices", "is missing; expected a list of [x, y]")
            return PolygonZone(law=law, radius=radius, vertices=_points(given["vertices"]))
    except ValueError as error:
        raise plugins.told(error, tuple(given)) from error
    return None


def _ellipse(
    given: Mapping[str, Any], law: UniformBraking, radius: float, reserve: float | None
) -> EllipseZone:
    """`ahead` None: 1, or with a reserve what the sharpest held arc needs."""
    shape = {key: value for key, value in given.items() if value is not None}
    if reserve is not None and "ahead" not in shape:
        shape["ahead"] = ahead_with_reserve(float(shape.get("lateral_ratio", 0.5)), reserve, law)
    return EllipseZone(law=law, radius=radius, **shape)


def ahead_with_reserve(lateral_ratio: float, reserve: float, law: UniformBraking) -> float:
    """How far ahead an ellipse must reach for the arcs of stops with the steering held.

    At the lateral acceleration `reserve` [m/s^2] and without reaction time an arc turns by
    |kappa| D = reserve / (2 a_b). At most `MOST_AHEAD`: beyond, less turning is asked for instead. Far ahead
    a one-sided ellipse is wider than the centred one.
    """
    if not 0.0 < lateral_ratio < math.inf:
        return 1.0  # which the ellipse refuses in its own words
    return min(least_ahead(lateral_ratio, reserve / (2.0 * law.max_braking)), MOST_AHEAD)


def _must_turn(zone: GaugeZone, reserve: float) -> None:
    """Refuse a zone that no held arc stays in: with the friction reserve it could only go straight."""
    if side_room(zone) > 0.0 or arc_excess(zone, np.array([SMALL_TURN]))[0][0] <= ROUNDING:
        return
    why = (
        "with friction_reserve the arc of a stop in a turn must stay in the zone, and no arc does: turning "
        "would be forbidden; expected"
    )
    remedy = "braking.margin above 0 [m]"
    if isinstance(zone, EllipseZone):
        ahead = ahead_with_reserve(zone.lateral_ratio, reserve, zone.law)
        raise ZoneError("ahead", f"{why} {math.ceil(1e4 * ahead) / 1e4:g}, which does, or null")
    if isinstance(zone, ProtectiveField) and zone.form == "capsule":
        remedy += " or side above 0 [m]"
    if isinstance(zone, ProtectiveField):
        raise ZoneError("", f"{why} {remedy}")
    raise ZoneError("", f"{why} a zone that is wider ahead, or {remedy}")


def _from_plugin(
    type_name: str, parameters: Mapping[str, Any], law: UniformBraking, radius: float
) -> ConvexZone:
    try:
        found = plugins.zone_class(type_name)
    except PluginError as error:
        raise ZoneError("", str(error)) from error
    if found is None:
        raise ZoneError(
            "",
            f"unknown braking zone; known: {', '.join(known_types())}. A zone of your own is loaded with "
            "--plugin MODULE",
        )
    zone = plugins.build(found, parameters, law, radius)
    try:
        with plugins.Foreign(f"the zone {type_name!r} fails", PluginError):
            check_zone(zone)
    except (PluginError, ZoneFault) as error:
        text = str(error)
        raise ZoneError("", text if isinstance(error, PluginError) else f"is refused: {text}") from error
    return zone


def _known(type_name: str, parameters: Mapping[str, Any], names: tuple[str, ...]) -> None:
    for key in parameters:
        if key not in names:
            known = ", ".join(names) or "it takes none"
            raise ZoneError(str(key), f"unknown parameter of the zone {type_name!r}; known: {known}")


def _points(vertices: Any) -> tuple[tuple[float, float], ...]:
    try:
        return tuple((float(x), float(y)) for x, y in vertices)
    except (TypeError, ValueError) as error:
        raise ZoneError("vertices", "must be a list of pairs [x, y] of numbers") from error
