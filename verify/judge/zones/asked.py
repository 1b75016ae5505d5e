"""The braking zone that a scenario asks for, from its raw numbers and by formulas of our own."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from verify.judge.limits import Limits
from verify.judge.zones.errors import ZoneError
from verify.judge.zones.fields import convex, given_fields
from verify.judge.zones.plugin import plugin_zone
from verify.judge.zones.shapes import Box, Disc, Ellipse, Hull, Shape, Straight
from verify.judge.zones.zone import FieldSet, GaugeZone, Zone

SAME = 1e-9  # relative
# Share of the stopping distance: with a smaller disc inside nothing is said about speeds. 1e-3 is enough,
# however it is rounded.
LEAST_INSCRIBED = 0.999e-3
MOST_AHEAD = 1.25  # an ellipse whose `ahead` is derived reaches no further
TURNS = 4096  # of held arcs, at which that is derived for a centred ellipse
TURNS_ONE_SIDED = 256  # and for others: part of what `ahead: null` means
HALVINGS = 60

_FORMS = {"capsule": "a capsule", "rectangle": "a rectangle"}
_BUILT_IN = ("uniform", "ellipse", "protective_field", "polygon")


@dataclass(frozen=True, kw_only=True, eq=False)
class AskedZone:
    """What a scenario asks for, where that is not the disc of uniform braking."""

    type: str
    parameters: Mapping[str, Any]  # plain data, defaults filled in
    zone: Zone  # that paths are planned with: of field sets the base
    isotropic: bool  # whether that is a disc
    fields: FieldSet | None = None  # where the scenario gives the fields themselves
    count: int | None = None  # of fields that are fitted to the route, at most

    @property
    def path_type(self) -> str:
        """The type of the zone that paths are planned with."""
        return self.type if self.type != "field_set" else str(self.parameters["base"]["type"])

    @property
    def plugin(self) -> bool:
        """Whether the zone's own functions are taken at their word."""
        return self.path_type not in _BUILT_IN

    @property
    def relaxation(self) -> Literal["inner", "outer", "uniform"]:
        """Which disc stands for the zone in methods for uniform braking: one in it, else one around it.

        Of zones that are no gauge zones nothing is known here: that of their own stopping distance.
        """
        if not isinstance(self.zone, GaugeZone):
            return "uniform"
        return "inner" if self.zone.shape.inscribed >= LEAST_INSCRIBED else "outer"

    def within_disc(self, limits: Limits) -> bool:
        """Whether uniform braking by the same law keeps more free at every speed."""
        zone = self.zone
        return (
            isinstance(zone, GaugeZone)
            and zone.shape.extent <= 1.0 + SAME
            and zone.body.extent <= (limits.radius + limits.margin) * (1.0 + SAME)
        )

    @property
    def statement(self) -> str:
        """What must be free of obstacles, in a sentence."""
        if self.type == "field_set":
            base = self.parameters["base"]
            many = f"up to {self.count}" if self.fields is None else str(len(self.fields.speeds))
            how = "" if self.fields is not None else ", each the base zone at its greatest speed"
            return f"{many} fields switched by speed{how}; base: {_words(base['type'], base, self.zone)}."
        words = _words(self.type, self.parameters, self.zone)
        return f"{words[0].upper()}{words[1:]}."


def asked_zone(spec: Any, limits: Limits) -> AskedZone | None:
    """The zone of a parsed scenario; None where it is a disc, that is, uniform braking.

    Raises
    ------
    ZoneError : it is not convex, or does not hold the robot's centre and a straight stop.
    """
    asked = spec.braking.zone
    kind, parameters = asked.type, asked.parameters
    if kind != "field_set":
        zone = plain_zone(kind, parameters, limits)
        if _is_disc(zone, limits):
            return None
        return AskedZone(type=kind, parameters=parameters, zone=zone, isotropic=False)
    of_base = {key: value for key, value in parameters["base"].items() if key != "type"}
    base = plain_zone(parameters["base"]["type"], of_base, limits)
    given = parameters.get("fields")
    return AskedZone(
        type=kind,
        parameters=parameters,
        zone=base,
        isotropic=_is_disc(base, limits),
        fields=None if given is None else given_fields(given, limits),
        count=int(parameters["count"]) if given is None else None,
    )


def plain_zone(kind: str, parameters: Mapping[str, Any], limits: Limits) -> Zone:
    """A zone that is no field set.

    Raises
    ------
    ZoneError : as from `asked_zone`.
    """
    around = limits.radius + limits.margin
    shape: Shape
    body: Shape = Disc(around)
    if kind == "uniform":
        shape = Disc(1.0)
    elif kind == "ellipse":
        shape = _ellipse(parameters, limits)
    elif kind == "protective_field":
        side = float(parameters["side"])
        if not 0.0 <= side < math.inf:
            raise ZoneError("braking.zone.side: must be zero or more")
        shape = Straight()
        body = Disc(around + side) if parameters["form"] == "capsule" else Box(around, around + side)
    elif kind == "polygon":
        shape = Hull(convex(parameters["vertices"], "braking.zone.vertices", ((0.0, 0.0), (1.0, 0.0))))
    else:
        return plugin_zone(kind, parameters, limits)
    return GaugeZone(shape, body, limits.braking, limits.reaction_time)


def least_ahead(lateral_ratio: float, turn: float) -> float:
    """Least semi-axis A >= 1 of a centred ellipse (A, beta) that holds all arcs of up to `turn` [rad].

    Derived. An arc of length 1 and turn x ends at (sin x, 1 - cos x) / x, which is in the ellipse when
    A^2 >= (sin x / x)^2 / (1 - ((1 - cos x) / (beta x))^2); infinite where the arc is wider than beta.
    """
    best, low, high = 1.0, 0.0, turn
    for _ in range(4):  # each time around the greatest found
        x = np.linspace(low, high, TURNS + 1)[1:]
        wide = (1.0 - np.cos(x)) / (lateral_ratio * x)
        if (wide >= 1.0).any():
            return math.inf
        square = (np.sin(x) / x) ** 2 / (1.0 - wide * wide)
        at = int(np.argmax(square))
        best = max(best, float(square[at]))
        step = float(x[1] - x[0])
        low, high = max(0.0, float(x[at]) - step), min(turn, float(x[at]) + step)
    return math.sqrt(best)


def _least_ahead_one_sided(lateral_ratio: float, behind: float, turn: float) -> float:
    """The like of an ellipse from -`behind` to A, at `TURNS_ONE_SIDED` even turns; `MOST_AHEAD` at most.

    Derived. (X, Y) is in the ellipse around c = (A - b)/2 with semi-axes a = (A + b)/2 and beta when
    ((X - c)/a)^2 + (Y/beta)^2 <= 1. The ellipse grows with A where X >= 0; arcs of more than half a turn end
    behind the robot and are no narrower with a smaller A.
    """
    x = np.linspace(0.0, turn, TURNS_ONE_SIDED + 1)[1:]
    ahead, aside = np.sin(x) / x, (1.0 - np.cos(x)) / (lateral_ratio * x)
    low, high = max(1.0, behind), MOST_AHEAD
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        centre, long = 0.5 * (middle - behind), 0.5 * (middle + behind)
        holds = bool((((ahead - centre) / long) ** 2 + aside**2 <= 1.0).all())
        low, high = (low, middle) if holds else (middle, high)
    return high


def _ellipse(parameters: Mapping[str, Any], limits: Limits) -> Ellipse:
    wide, ahead, behind = (parameters[key] for key in ("lateral_ratio", "ahead", "behind"))
    if ahead is None:
        ahead = 1.0
        if limits.reserves_friction and limits.reserve > 0.0:
            turn = 0.5 * limits.reserve / limits.braking
            if behind is None:
                ahead = min(MOST_AHEAD, least_ahead(wide, turn))
            else:
                ahead = _least_ahead_one_sided(wide, behind, turn)
    behind = ahead if behind is None else behind
    if not (0.0 < wide < math.inf and 1.0 <= ahead < math.inf and 0.0 <= behind <= ahead):
        raise ZoneError("braking.zone: an ellipse that does not hold the robot's centre and a straight stop")
    return Ellipse(0.5 * (ahead - behind), 0.5 * (ahead + behind), wide)


def _is_disc(zone: Zone, limits: Limits) -> bool:
    """Whether this is uniform braking."""
    if not isinstance(zone, GaugeZone) or zone.body != Disc(limits.radius + limits.margin):
        return False
    return zone.shape in (Disc(1.0), Ellipse(0.0, 1.0, 1.0))


def _words(kind: str, parameters: Mapping[str, Any], zone: Zone) -> str:
    """A zone that is no field set, in words."""
    if kind == "uniform":
        return "a disc, the robot's with the stopping distance around it"
    shape = zone.shape if isinstance(zone, GaugeZone) else None
    if isinstance(shape, Ellipse):
        ahead, behind = shape.long + shape.centre, shape.long - shape.centre
        return (
            f"an ellipse along the heading around the robot, {ahead:.4g} of the stopping distance ahead, "
            f"{behind:.4g} behind and {shape.wide:.4g} to either side"
        )
    if kind == "protective_field":
        side = parameters["side"]
        aside = f" and {side:g} m more to either side" if side else ""
        return f"{_FORMS[parameters['form']]} around the robot, as far ahead as the stopping distance{aside}"
    if isinstance(shape, Hull):
        return f"a polygon of {len(shape.kinks)} corners around the robot, in shares of the stopping distance"
    return f"the zone {kind} of a plugin, by its own functions"
