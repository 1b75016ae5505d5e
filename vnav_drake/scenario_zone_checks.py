"""The braking zone of a scenario: what a file asks for made into a zone, and whether it fits at the ends."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from vnav_drake.braking import UniformBraking
from vnav_drake.robot import Robot
from vnav_drake.scenario_file import Fault, KeyPath, split_path
from vnav_drake.scenario_spec import ScenarioSpec
from vnav_drake.world import World
from vnav_drake.zones.convex_zone import ConvexZone, GaugeZone
from vnav_drake.zones.errors import ZoneError
from vnav_drake.zones.touch import into_body, separation, stopping_room

if TYPE_CHECKING:
    from vnav_drake.zones.field_set import FieldSet

Array = NDArray[np.float64]

HEADINGS = 180  # tried where an end leaves the heading free, before the best of them is refined
HALVINGS = 40  # of the speed of a zone of which only the support function is known
FITS = -1e-9  # [m]: touching is free up to rounding
_CHUNK = 2048  # features at a time
_EVEN = np.linspace(-math.pi, math.pi, 360, endpoint=False)
SLOWEST = 1e-6  # [m/s]: below, a robot stands


def zone_of(
    spec: ScenarioSpec, robot: Robot, braking: UniformBraking
) -> tuple[ConvexZone | None, FieldSet | None, list[Fault]]:
    """The zone to plan with (None: the disc of uniform braking), the fields that a file gives, and faults."""
    asked = spec.braking.zone
    if asked.type == "uniform":
        return None, None, []
    from vnav_drake.zones.catalogue import build_zone, field_set  # takes a while, for those who need it

    reserve = robot.reserved_lateral_acceleration() if spec.braking.friction_reserve else None
    if reserve == 0.0:
        return None, None, []  # which is a fault of its own
    try:
        zone = build_zone(asked.type, asked.parameters, braking, robot.radius, reserve)
        is_set = asked.type == "field_set"
        fields = field_set(asked.parameters, braking, robot.radius, reserve) if is_set else None
        _require_held_arcs(spec.braking.friction_reserve, zone, fields)
    except ZoneError as error:
        return None, None, [Fault(("braking", "zone", *split_path(error.key)), error.message)]
    return zone, fields, []


def _require_held_arcs(reserve: bool, zone: ConvexZone | None, fields: FieldSet | None) -> None:
    """Held arcs are planned from a zone's shape in units of the stopping distance."""
    known = zone is None or isinstance(zone, GaugeZone)
    if reserve and (not known or (fields is not None and fields.polygons is not None)):
        raise ZoneError(
            "type",
            "with braking.friction_reserve stops with the steering held must stay in the zone, which is "
            "planned for zones that grow with the stopping distance only; expected friction_reserve false, a "
            "field set with count, or a zone that is a gauge",
        )


def zone_end_faults(name: str, spec: ScenarioSpec, world: World, zone: ConvexZone) -> list[Fault]:
    """Faults of an end whose zone at standstill, or at the speed asked for, cannot be free."""
    end = spec.start if name == "start" else spec.goal
    place: KeyPath = (name, "position")
    around = _Surroundings(world, np.array(end.position, dtype=float), zone)
    told = "whatever the heading" if end.heading is None else f"at heading {end.heading:g}"
    headings = np.linspace(-math.pi, math.pi, HEADINGS, endpoint=False)
    if end.heading is not None:
        headings = np.array([end.heading])
    if not any(around.free(0.0, heading) for heading in headings):
        message = f"the braking zone of a robot that stands does not fit here, {told}; expected more room [m]"
        return [Fault(place, message)]
    if isinstance(end.speed, str) or end.speed <= SLOWEST:
        return []
    if end.speed <= zone.law.max_speed and any(around.free(end.speed, heading) for heading in headings):
        return []
    most = min(around.greatest_speed(headings), zone.law.max_speed)
    if end.speed <= most:
        return []
    message = (
        f"is too fast for the braking zone to be free, {told}; expected at most {most:.9g} [m/s], or safe"
    )
    return [Fault((name, "speed"), message)]


def fastest_anywhere(
    zone: ConvexZone | None, braking: UniformBraking, half_width: float, across: float
) -> float:
    """A speed [m/s] that no robot has whose zone is free of what bounds the floor.

    Parameters
    ----------
    half_width : [m], no disc of a greater radius fits. across : [m], no way is longer that is straight.
    """
    if zone is None:
        return float(braking.speed(half_width))
    straight = float(braking.speed(across + braking.margin))  # the zone holds the straight stop
    inner = zone.inner_law()
    return straight if inner is None else min(straight, float(inner.speed(half_width)))


class _Surroundings:
    """What stands around a place, edge by edge; a zone is connected and holds the place."""

    def __init__(self, world: World, place: Array, zone: ConvexZone) -> None:
        points = np.repeat(world.vertices[world.isolated][:, None, :], 2, axis=1)
        features = np.concatenate([world.vertices[world.edges], points]) - place
        start, way = features[:, 0], features[:, 1] - features[:, 0]
        square = np.einsum("nj,nj->n", way, way)
        share = -np.einsum("nj,nj->n", start, way) / np.where(square > 0.0, square, 1.0)
        foot = start + np.clip(share, 0.0, 1.0)[:, None] * way
        away = np.hypot(*foot.T)
        order = np.argsort(away)
        self.features, self.away = features[order], away[order]  # the nearest first
        self.towards = np.arctan2(foot[order, 1], foot[order, 0])
        self.zone = zone

    def free(self, speed: float, heading: float) -> bool:
        """Whether the zone at `speed` [m/s] and `heading` [rad] touches nothing."""
        near = slice(0, int(np.searchsorted(self.away, self._reach(speed))))
        # a line across the way to its nearest point parts most features from the zone
        angle = self.towards[near] - heading
        open_ = np.flatnonzero(self.away[near] < self.zone.support(angle, np.full(len(angle), speed))[0])
        for first in range(0, len(open_), _CHUNK):
            corners = self._in_body(open_[first : first + _CHUNK], heading)
            if np.any(separation(self.zone, corners, np.full(len(corners), speed)).gap < FITS):
                return False
        return True

    def greatest_speed(self, headings: Array) -> float:
        """Greatest speed [m/s] whose zone is free at one of these headings, or between two of them."""
        from scipy.optimize import minimize_scalar

        speeds = [self._speed(float(heading)) for heading in headings]
        best = int(np.argmax(speeds))
        if len(headings) == 1:
            return speeds[0]
        step = float(headings[1] - headings[0])
        found = minimize_scalar(
            lambda heading: -self._speed(float(heading)),
            bounds=(headings[best] - step, headings[best] + step),
            method="bounded",
        )
        return max(speeds[best], -float(found.fun))

    def _speed(self, heading: float) -> float:
        """Greatest speed [m/s] whose zone is free at a heading."""
        zone, law = self.zone, self.zone.law
        if isinstance(zone, GaugeZone):
            room, first = math.inf, 0
            while first < len(self.away) and self.away[first] <= self._reach(
                float(law.speed(room + law.margin))
            ):
                index = np.arange(first, min(first + _CHUNK, len(self.away)))
                room = min(room, float(stopping_room(zone, self._in_body(index, heading))[0].min()))
                first += _CHUNK
            return float(law.speed(room + law.margin))
        top = law.max_speed
        if top == math.inf:  # a straight stop longer than anything here
            top = float(law.speed(2.0 * float(self.away[-1]) + law.margin))
        low, high = 0.0, top
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self.free(middle, heading) else (low, middle)
        return low

    def _reach(self, speed: float) -> float:
        """Radius [m] of a disc that holds the zone."""
        if not math.isfinite(speed):
            return math.inf
        h = self.zone.support(_EVEN, np.full(len(_EVEN), speed))[0]
        return float(h.max()) / math.cos(math.pi / len(_EVEN))

    def _in_body(self, index: NDArray[np.int64], heading: float) -> Array:
        """(n, 2, 2) [m]: features in the frame of a body here."""
        zero = np.zeros(len(index))
        return into_body(self.features[index], zero, zero, np.full(len(index), heading))
