"""The zone that a certificate is about: read from the scenario, and what the file says of it."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

from verify.judge.certificate.file import CertificateFile
from verify.judge.certificate.gauge import gauge_of
from verify.judge.certificate.headings import ZoneGauge
from verify.judge.limits import Limits
from verify.judge.zones import AskedZone, GaugeZone

HOLDS = 1e-9  # relative: what a field may lack of the base zone is rounding
NARROWER = 1e-9  # relative, that the disc is taken narrower where V may be positive in contact


def zone_gauge(asked: AskedZone, limits: Limits) -> ZoneGauge | None:
    """What the proof for all headings needs of a scenario's zone; None where no bound of the speed follows.

    That is so for a zone that is no stopping distance times a shape, and for a shape without a disc around
    the robot in it: there the speed is not limited for some heading, however near obstacles are.
    """
    gauge = gauge_of(asked.zone.shape) if isinstance(asked.zone, GaugeZone) else None
    return None if gauge is None else ZoneGauge(gauge, standing_radius(asked, limits))


def standing_radius(asked: AskedZone, limits: Limits) -> float:
    """Radius [m] of a disc in the zone at standstill: that of the body, where its form is our own."""
    least = limits.radius + limits.margin
    if asked.plugin or not isinstance(asked.zone, GaugeZone):
        return least
    return max(least, asked.zone.body.inscribed)


def length_limits(asked: AskedZone, limits: Limits) -> Limits:
    """For a zone that limits no speed: the pace 1 s/m, so that u is a length, and the disc it has at least.

    A little narrower, so that a motion whose zone touches an obstacle does not enter dropped triangles
    either.
    """
    narrow = standing_radius(asked, limits) * (1.0 - NARROWER)
    return replace(limits, radius=narrow, margin=0.0, speed=1.0)


def zone_faults(file: CertificateFile, asked: AskedZone | None, *, length: bool, bounds: bool) -> list[str]:
    """Whether the certificate was made for the scenario's zone.

    Parameters
    ----------
    length : the file says that u measures lengths, so nothing but the constant pace may bound it.
    bounds : whether speeds follow from the zone.
    """
    if asked is None or asked.isotropic:  # fields that stand for a disc: the bound is that of uniform braking
        faults = [] if file.zone is None else ["made for a braking zone; the scenario has uniform braking"]
        return faults if asked is None else [*faults, *_fields_faults(asked)]
    if file.zone is None:
        return [f"made for uniform braking; the scenario has the braking zone {asked.type}"]
    kind, parameters = asked.type, dict(asked.parameters)
    if kind == "field_set":
        parameters = dict(parameters["base"])
        kind = parameters.pop("type")
    faults = _fields_faults(asked)
    if not length and not bounds:
        faults.append(f"u is said to be a time, but no speed follows from the braking zone {kind}")
    if length and ((file.weight > 0.0) & (file.feature >= 0)).any():
        faults.append("u is said to be a length, but in some triangle features bound it")
    told = _told(file.zone.tobytes())
    if told.get("type") != kind:
        return [*faults, f"made for the braking zone {told.get('type')!a}; the scenario has {kind!a}"]
    for key, value in parameters.items():
        # What a scenario leaves to be derived is derived again from the scenario, not read from the file.
        if value is not None and told.get(key) != _plain(value):
            faults.append(
                f"made for braking.zone.{key} = {told.get(key)!a}; the scenario has {_plain(value)!a}"
            )
    return faults


def _told(text: bytes) -> dict[str, Any]:
    """What the file says of its zone; nothing where that is no such text."""
    try:
        told = json.loads(text.decode("utf-8"))
    except (UnicodeDecodeError, json.JSONDecodeError, RecursionError):
        return {}
    return told if isinstance(told, dict) else {}


def _plain(value: Any) -> Any:
    """As JSON gives it back."""
    return json.loads(json.dumps(value, default=str))


def _fields_faults(asked: AskedZone) -> list[str]:
    """A bound for the base zone is one for fields that hold it: each at its greatest speed."""
    if asked.fields is None or not isinstance(asked.zone, GaugeZone):
        return []
    faults = []
    for number, (speed, field) in enumerate(zip(asked.fields.speeds, asked.fields.fields, strict=True)):
        normal = field.kinks
        if (field.support(normal) < asked.zone.support(normal, speed) * (1.0 - HOLDS)).any():
            faults.append(
                f"braking.zone.fields[{number}] does not hold the base zone at {speed:g} m/s: the bound is "
                "for motions that keep the base zone free, and fields may allow more"
            )
    return faults
