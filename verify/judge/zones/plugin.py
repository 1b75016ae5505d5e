"""Zones that plugins bring: their own functions, as nobody else has them, looked at before they are used.

The one place of the judge that knows the planners' registry of zones. No type that is built in gets here.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from verify.judge.limits import Limits
from verify.judge.zones.errors import ZoneError
from verify.judge.zones.shapes import Disc, Measured, Shape
from verify.judge.zones.zone import ForeignZone, GaugeZone, Zone

if TYPE_CHECKING:
    from vnav_drake.zones.convex_zone import GaugeZone as PlannersGaugeZone

Array = NDArray[np.float64]

PROBES = np.linspace(-np.pi, np.pi, 361)


def plugin_zone(kind: str, parameters: Mapping[str, Any], limits: Limits) -> Zone:
    """The zone that a plugin registers under the name `kind`.

    Raises
    ------
    ZoneError : there is none, or it is not convex and around the robot's centre.
    """
    # loaded here, so that no judgement of a type that is built in ever loads them
    from vnav_drake.braking import UniformBraking
    from vnav_drake.zones import catalogue, convex_zone, errors

    law = UniformBraking(
        max_braking=limits.braking,
        reaction_time=limits.reaction_time,
        margin=limits.margin,
        max_speed=limits.speed,
    )
    try:
        zone = catalogue.build_zone(kind, parameters, law, limits.radius)
    except errors.ZoneError as error:
        raise ZoneError(f"braking.zone: {error}") from error
    if zone is None:
        raise ZoneError(f"braking.zone: {kind!a} is no zone of a plugin")
    own = convex_zone.GaugeZone
    if isinstance(zone, own) and type(zone).support is own.support:
        return _gauge(kind, zone, limits)
    try:
        Measured(lambda angle: zone.support(angle, np.zeros_like(angle))[0])
    except ValueError as error:
        raise ZoneError(f"braking.zone: {kind}: {error}") from error
    return ForeignZone(
        lambda angle, speed: zone.support(angle, speed)[0], np.asarray(zone.kinks, dtype=float)
    )


def _gauge(kind: str, zone: PlannersGaugeZone, limits: Limits) -> GaugeZone:
    """D(v) E (+) body with the plugin's E and body, and a stopping distance of our own."""
    try:
        shape = Measured(lambda angle: zone.shape(angle)[0], zone.kinks)
        body: Shape = Measured(lambda angle: zone.body(angle)[0], zone.kinks)
    except ValueError as error:
        raise ZoneError(f"braking.zone: {kind}: {error}") from error
    around = body.support(PROBES)
    if np.ptp(around) == 0.0:
        body = Disc(float(around[0]))
    if float(shape.support(np.zeros(1))[0]) < 1.0 or around.min() < limits.radius + limits.margin:
        raise ZoneError(f"braking.zone: {kind}: does not hold the robot and a straight stop")
    return GaugeZone(shape, body, limits.braking, limits.reaction_time)
