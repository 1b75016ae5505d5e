"""Zones that plugins bring: their own functions, as nobody else has them, looked at before they are used.

The one place of the judge that knows the planners' registry of zones. No type that is built in gets here.
"""

from __future__ import annotations

import hashlib
import inspect
import sys
from collections.abc import Callable, Mapping
from importlib.metadata import packages_distributions, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from verify.evidence import EvidenceError
from verify.judge.limits import Limits
from verify.judge.zones.errors import ZoneError
from verify.judge.zones.shapes import Disc, Measured, Shape
from verify.judge.zones.zone import ForeignZone, GaugeZone, Zone

if TYPE_CHECKING:
    from vnav_drake.zones.convex_zone import GaugeZone as PlannersGaugeZone

Array = NDArray[np.float64]

ROUNDING = 1e-9  # relative, as the kit that tests plugins allows: by how much their functions may be off
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
        Measured(lambda angle: _asked(lambda: zone.support(angle, np.zeros_like(angle))[0]))
    except ValueError as error:
        raise ZoneError(f"braking.zone: {kind}: {error}") from error
    return ForeignZone(
        lambda angle, speed: _asked(lambda: zone.support(angle, speed)[0]),
        np.asarray(zone.kinks, dtype=float),
    )


def _asked(function: Callable[[], Array]) -> Array:
    """What a plugin's function gives.

    Raises
    ------
    EvidenceError : it fails, so nothing can be said of the motion.
    """
    from vnav_drake.zones import errors, plugins

    try:
        with plugins.Watched():
            return function()
    except errors.PluginError as error:
        raise EvidenceError(str(error)) from error


def identity(kind: str) -> dict[str, str]:
    """Which plugin brings the zone `kind` here.

    Returns
    -------
    `module`; `distribution` and `version` of the installed package that brings it, `sha256` of the module's
    source file, as far as known. Empty where no plugin brings such a zone.
    """
    from vnav_drake.zones import errors, plugins

    try:
        found = plugins.zone_class(kind)
    except errors.PluginError:
        return {}
    if found is None:
        return {}
    module = found.__module__
    told = {"module": module}
    packages = sorted(set(packages_distributions().get(module.partition(".")[0], ())))
    if len(packages) == 1:
        told |= {"distribution": packages[0], "version": version(packages[0])}
    try:
        source = inspect.getsourcefile(sys.modules[module])
        if source is not None:
            told["sha256"] = hashlib.sha256(Path(source).read_bytes()).hexdigest()
    except (KeyError, TypeError, OSError):
        pass  # made on the fly, or its file is gone: not known
    return told


def differences(result: Mapping[str, Any]) -> tuple[str, ...]:
    """Whether the plugin of a result's zone is the one known here: no sentence, or one that says what is not.

    A plugin that is not loaded is for the scenario's reader to tell.
    """
    zone = result.get("zone")
    claimed = zone.get("plugin") if isinstance(zone, Mapping) else None
    if not isinstance(zone, Mapping) or not isinstance(claimed, Mapping):
        return ()
    parameters = zone.get("parameters")
    base = parameters.get("base") if isinstance(parameters, Mapping) else None
    kind = (
        base.get("type")
        if zone.get("type") == "field_set" and isinstance(base, Mapping)
        else zone.get("type")
    )
    here = identity(kind) if isinstance(kind, str) else {}
    other = [key for key in _TOLD if claimed.get(key) != here.get(key)]
    if not here or not other:
        return ()
    said = ", ".join(
        f"{_TOLD[key]} is {_short(here.get(key))}, was {_short(claimed.get(key))}" for key in other
    )
    return (f"the plugin {here['module']} is not the one this was made with: {said}",)


_TOLD = {
    "module": "module",
    "distribution": "package",
    "version": "version",
    "sha256": "SHA-256 of its source",
}


def _short(value: Any) -> str:
    return "not known" if value is None else ascii(value)[1:-1][:16] if isinstance(value, str) else "no text"


def _gauge(kind: str, zone: PlannersGaugeZone, limits: Limits) -> GaugeZone:
    """D(v) E (+) body with the plugin's E and body, and a stopping distance of our own."""
    try:
        shape = Measured(lambda angle: _asked(lambda: zone.shape(angle)[0]), zone.kinks)
        body: Shape = Measured(lambda angle: _asked(lambda: zone.body(angle)[0]), zone.kinks)
    except ValueError as error:
        raise ZoneError(f"braking.zone: {kind}: {error}") from error
    around = body.support(PROBES)
    least = limits.radius + limits.margin
    if np.ptp(around) <= ROUNDING * around.max():
        body = Disc(float(around.max()))
    if float(shape.support(np.zeros(1))[0]) < 1.0 - ROUNDING or around.min() < least * (1.0 - ROUNDING):
        raise ZoneError(f"braking.zone: {kind}: does not hold the robot and a straight stop")
    return GaugeZone(shape, body, limits.braking, limits.reaction_time)
