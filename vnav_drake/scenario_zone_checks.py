"""The braking zone of a scenario: what a file asks for made into a zone, and whether it fits at the ends."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from vnav_drake.braking import UniformBraking
from vnav_drake.robot import Robot
from vnav_drake.scenario_file import Fault, KeyPath, split_path
from vnav_drake.scenario_spec import ScenarioSpec
from vnav_drake.world import World
from vnav_drake.zones.catalogue import build_zone, field_set
from vnav_drake.zones.convex_zone import ConvexZone, GaugeZone
from vnav_drake.zones.errors import ZoneError
from vnav_drake.zones.field_set import FieldSet
from vnav_drake.zones.touch import into_body, separation, stopping_room

Array = NDArray[np.float64]

HEADINGS = 180  # tried where an end leaves the heading free, before the best of them is refined
HALVINGS = 40  # of the speed of a zone of which only the support function is known
FITS = -1e-9  # [m]: touching is free up to rounding
SLOWEST = 1e-6  # [m/s]: below, a robot stands


def zone_of(
    spec: ScenarioSpec, robot: Robot, braking: UniformBraking
) -> tuple[ConvexZone | None, FieldSet | None, list[Fault]]:
    """The zone to plan with (None: the disc of uniform braking), the fields that a file gives, and faults."""
    asked = spec.braking.zone
    reserve = robot.reserved_lateral_acceleration() if spec.braking.friction_reserve else None
    if reserve == 0.0:
        return None, None, []  # which is a fault of its own
    try:
        zone = build_zone(asked.type, asked.parameters, braking, robot.radius, reserve)
        is_set = asked.type == FieldSet.type_name
        fields = field_set(asked.parameters, braking, robot.radius, reserve) if is_set else None
    except ZoneError as error:
        return None, None, [Fault(("braking", "zone", *split_path(error.key)), error.message)]
    return zone, fields, []


def zone_end_faults(name: str, spec: ScenarioSpec, world: World, zone: ConvexZone) -> list[Fault]:
    """Faults of an end whose zone at standstill, or at the speed asked for, cannot be free."""
    end = spec.start if name == "start" else spec.goal
    place: KeyPath = (name, "position")
    around = _Surroundings(world, np.array(end.position, dtype=float), zone)
    told = "whatever the heading" if end.heading is None else f"at heading {end.heading:g}"
    headings = np.linspace(-math.pi, math.pi, HEADINGS, endpoint=False)
    if end.heading is not None:
        headings = np.array([end.heading])
    if not np.any(around.free(0.0, headings)):
        message = f"the braking zone of a robot that stands does not fit here, {told}; expected more room [m]"
        return [Fault(place, message)]
    if isinstance(end.speed, str) or end.speed <= SLOWEST:
        return []
    if np.any(around.free(end.speed, headings)) and end.speed <= zone.law.max_speed:
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
        self.features = np.concatenate([world.vertices[world.edges], points])
        self.place, self.zone = place, zone
        start, way = self.features[:, 0], self.features[:, 1] - self.features[:, 0]
        square = np.einsum("nj,nj->n", way, way)
        share = np.einsum("nj,nj->n", place - start, way) / np.where(square > 0.0, square, 1.0)
        foot = start + np.clip(share, 0.0, 1.0)[:, None] * way
        self.away = np.hypot(*(foot - place).T)

    def free(self, speed: float, headings: Array) -> NDArray[np.bool_]:
        """Whether the zone at `speed` [m/s] touches nothing, at headings (n,) [rad]."""
        angle = np.linspace(-math.pi, math.pi, 361)
        reach = float(self.zone.support(angle, np.full(361, speed))[0].max()) / math.cos(math.pi / 360.0)
        near = self.features[self.away <= reach]
        if len(near) == 0:
            return np.ones(len(headings), dtype=bool)
        corners = self._in_body(near, headings)
        gap = separation(self.zone, corners, np.full(len(corners), speed)).gap
        return np.asarray(gap.reshape(len(headings), len(near)).min(axis=1) >= FITS)

    def greatest_speed(self, headings: Array) -> float:
        """Greatest speed [m/s] whose zone is free at one of these headings, or between two of them."""
        speeds = self._speeds(headings)
        best = int(np.argmax(speeds))
        if len(headings) == 1:
            return float(speeds[0])
        step = float(headings[1] - headings[0])
        found = minimize_scalar(
            lambda heading: -float(self._speeds(np.array([heading]))[0]),
            bounds=(headings[best] - step, headings[best] + step),
            method="bounded",
        )
        return max(float(speeds[best]), -float(found.fun))

    def _speeds(self, headings: Array) -> Array:
        zone = self.zone
        if isinstance(zone, GaugeZone):
            room, _ = stopping_room(zone, self._in_body(self.features, headings))
            least = room.reshape(len(headings), len(self.features)).min(axis=1)
            return zone.law.speed(least + zone.law.margin)
        low = np.zeros(len(headings))
        top = zone.law.max_speed if zone.law.max_speed < math.inf else self._beyond()
        high = np.full(len(headings), top)
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            free = np.array([self.free(v, headings[i : i + 1])[0] for i, v in enumerate(middle)])
            low, high = np.where(free, middle, low), np.where(free, high, middle)
        return low

    def _beyond(self) -> float:
        """A speed [m/s] whose straight stop is longer than anything here."""
        return float(self.zone.law.speed(2.0 * float(self.away.max()) + self.zone.law.margin))

    def _in_body(self, features: Array, headings: Array) -> Array:
        """(n m, 2, 2): features (m, 2, 2) in the frames of bodies here with headings (n,)."""
        count = len(features)
        corners = np.tile(features, (len(headings), 1, 1))
        x, y = (np.full(len(corners), value) for value in self.place)
        return into_body(corners, x, y, np.repeat(headings, count))
