"""A finite set of fields, switched by speed: what a scanner can hold in place of a zone that grows smoothly.

Each field has a greatest speed. The zone at a speed is the field with the least greatest speed that is not
below it; faster than the last the robot may not go. So the zone grows in steps, and what is free of obstacles
at the last speed of a step is free at all its speeds.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar, Self

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from vnav_drake.braking import UniformBraking
from vnav_drake.zones.convex_zone import ConvexZone

Array = NDArray[np.float64]
Polygon = tuple[tuple[float, float], ...]

HOLDS = 1e-9  # [m]: what a field may lack of what it must hold is rounding
TANGENTS = 180  # of the polygon around a field
SAME_CORNER = 1e-9  # [m]


@dataclass(frozen=True, kw_only=True)
class FieldSet(ConvexZone):
    """Fields of rising speed: `base` at the greatest speed of each case, or a polygon each.

    Raises
    ------
    ValueError : speeds that do not rise; polygons that are not convex, lack the robot's disc with its margin
        on the way of a straight stop from the field's greatest speed, or lack the field before.
    """

    base: ConvexZone  # of the same law; with polygons what the path is planned with
    max_speeds: tuple[float, ...]  # (k,) of each field [m/s], rising
    polygons: tuple[Polygon, ...] | None = None  # (k,) of [x, y] [m], body frame; the body is part of them

    type_name: ClassVar[str] = "field_set"

    def __post_init__(self) -> None:
        speeds = self.max_speeds
        if isinstance(self.base, FieldSet):
            raise ValueError("base: must not be a field set itself")
        if not speeds:
            raise ValueError("fields: at least one is needed")
        for i, speed in enumerate(speeds):
            if not 0.0 < speed < math.inf:
                raise ValueError(f"fields[{i}].max_speed = {speed!r}: must be positive and finite [m/s]")
            if i and speed <= speeds[i - 1]:
                raise ValueError(
                    f"fields[{i}].max_speed = {speed!r}: must be above {speeds[i - 1]:g}, "
                    "that of the field before"
                )
        object.__setattr__(self, "law", _capped(self.law, speeds[-1]))
        if self.polygons is not None and len(self.polygons) != len(speeds):
            raise ValueError(f"fields: {len(speeds)} speeds and {len(self.polygons)} polygons")
        self._check_polygons()

    def _check_polygons(self) -> None:
        for i, (normal, offset) in enumerate(zip(self._normals, self._offsets, strict=True)):
            direction = np.stack([np.cos(normal), np.sin(normal)])
            stop = float(self.law.distance(self.max_speeds[i])) - self.law.margin
            width = self.radius + self.law.margin
            lacks = float(np.max(np.maximum(direction[0] * stop, 0.0) + width - offset))
            if lacks > HOLDS:
                raise ValueError(
                    f"fields[{i}].polygon: must hold the robot's disc and margin, {width:g} m, all along the "
                    f"{stop:.4g} m of a straight stop from {self.max_speeds[i]:g} m/s; it lacks {lacks:.3g} m"
                )
            if i:
                lacks = float(np.max((self._rings[i - 1] @ direction).max(axis=0) - offset))
                if lacks > HOLDS:
                    raise ValueError(
                        f"fields[{i}].polygon: must hold the field before; it lacks {lacks:.3g} m of it"
                    )

    def case(self, speed: ArrayLike) -> NDArray[np.intp]:
        """Which field is watched at `speed` [m/s], from 0; same shape. Beyond the last speed the last."""
        first = np.searchsorted(np.asarray(self.max_speeds), np.asarray(speed, dtype=float), side="left")
        return np.minimum(first, len(self.max_speeds) - 1)

    @property
    def steps(self) -> Array:
        """Speeds [m/s] above which the zone jumps, (k - 1,); at the last it ends."""
        return np.asarray(self.max_speeds[:-1])

    def support(self, angle: ArrayLike, speed: ArrayLike) -> tuple[Array, Array, Array]:
        angle, speed = np.broadcast_arrays(np.asarray(angle, dtype=float), np.asarray(speed, dtype=float))
        case = self.case(speed)
        if self.polygons is None:
            h, slope, _ = self.base.support(angle, np.asarray(self.max_speeds)[case])
        else:
            corner = self._table[np.searchsorted(self._keys, _principal(angle) + TURN * case) + case]
            cos, sin = np.cos(angle), np.sin(angle)
            h = corner[..., 0] * cos + corner[..., 1] * sin
            slope = corner[..., 1] * cos - corner[..., 0] * sin
        return h, slope, np.zeros_like(h)

    @property
    def kinks(self) -> Array:
        return self.base.kinks if self.polygons is None else np.unique(np.concatenate(self._normals))

    def inner_law(self) -> UniformBraking | None:
        """That of the base, where the fields hold it."""
        law = self.base.inner_law() if self.holds_base else None
        return None if law is None else _capped(law, self.max_speeds[-1])

    @cached_property
    def holds_base(self) -> bool:
        """Whether each field holds the base zone at all its speeds: nothing is faster with the fields."""
        return self.narrower is None

    @cached_property
    def narrower(self) -> int | None:
        """The first field, from 0, that does not hold the base zone at its greatest speed; None if all do."""
        if self.polygons is None:
            return None
        reach = (self.base.support(n, v)[0] for n, v in zip(self._normals, self.max_speeds, strict=True))
        holds = [bool(np.all(h <= c + HOLDS)) for h, c in zip(reach, self._offsets, strict=True)]
        return None if all(holds) else holds.index(False)

    def with_law(self, law: UniformBraking) -> Self:
        return replace(self, law=law, base=self.base.with_law(law))

    def polygon(self, case: int) -> Array:
        """Corners (m, 2) [m] of a field, anticlockwise: its own, or those of a polygon around it."""
        if self.polygons is not None:
            return self._rings[case].copy()
        return polygon_around(self.base, self.max_speeds[case])

    def scanner_range(self) -> float:
        """How far [m] from the robot's centre a scanner there must see."""
        corners = np.concatenate([self.polygon(case) for case in range(len(self.max_speeds))])
        return float(np.hypot(corners[:, 0], corners[:, 1]).max())

    @cached_property
    def _rings(self) -> list[Array]:
        return [_ring(i, polygon) for i, polygon in enumerate(self.polygons or ())]

    @cached_property
    def _normals(self) -> list[Array]:
        """Directions [rad] of the edges' outward normals, rising, one array a field.

        Edge j of a ring goes from its corner j to the next; corner j touches the tangents between the normals
        of edges j - 1 and j. `_rings` begin where these rise from -pi.
        """
        return [_edge_normals(ring) for ring in self._rings]

    @cached_property
    def _offsets(self) -> list[Array]:
        """Distances [m] of the edges' lines from the centre."""
        return [
            ring[:, 0] * np.cos(normal) + ring[:, 1] * np.sin(normal)
            for ring, normal in zip(self._rings, self._normals, strict=True)
        ]

    @cached_property
    def _keys(self) -> Array:
        """All normals in one rising array, a turn and more between two fields."""
        return np.concatenate([normal + TURN * i for i, normal in enumerate(self._normals)])

    @cached_property
    def _table(self) -> Array:
        """The corner before each key and, of each field, the first once more."""
        return np.concatenate([np.vstack([ring, ring[:1]]) for ring in self._rings])


TURN = 8.0  # [rad], more than a whole turn


def polygon_around(zone: ConvexZone, speed: float, tangents: int = TANGENTS) -> Array:
    """A polygon (m, 2) [m] that holds the zone at a speed, of its tangents at even angles and at its kinks.

    Where the zone's boundary is a circle of radius r, it reaches beyond by r/cos(pi/tangents) - r at most.
    """
    even = np.linspace(-math.pi, math.pi, tangents, endpoint=False)
    angle = np.unique(np.concatenate([_principal(zone.kinks), even]))
    angle = angle[np.append(np.diff(angle) > 1e-6, angle[-1] < angle[0] + 2.0 * math.pi - 1e-6)]
    h, _, _ = zone.support(angle, np.full(len(angle), float(speed)))
    ahead, after = np.roll(angle, -1), np.roll(h, -1)
    turn = np.sin(ahead - angle)
    corners = np.stack(
        [
            (h * np.sin(ahead) - after * np.sin(angle)) / turn,
            (after * np.cos(angle) - h * np.cos(ahead)) / turn,
        ],
        axis=1,
    )
    gap = np.roll(corners, -1, axis=0) - corners
    return corners[np.hypot(gap[:, 0], gap[:, 1]) > SAME_CORNER]


def _capped(law: UniformBraking, speed: float) -> UniformBraking:
    return replace(law, max_speed=min(law.max_speed, speed))


def _ring(i: int, polygon: Sequence[tuple[float, float]]) -> Array:
    """Corners of a convex polygon, anticlockwise, the first being the one that touches the tangent at -pi."""
    corners = np.asarray(polygon, dtype=float)
    if corners.ndim != 2 or corners.shape[1] != 2 or len(corners) < 3 or not np.isfinite(corners).all():
        raise ValueError(f"fields[{i}].polygon: must be three or more points [x, y]")
    shape = shapely.Polygon(corners)
    if not shape.is_valid or shape.area <= 0.0:
        raise ValueError(f"fields[{i}].polygon: must be a simple polygon with an area")
    hull = shapely.geometry.polygon.orient(shape.convex_hull)
    if hull.area - shape.area > 1e-9 * shape.area:
        raise ValueError(f"fields[{i}].polygon: must be convex")
    ring = shapely.get_coordinates(hull)[:-1]
    return np.roll(ring, -int(np.argmin(_edge_normals(ring))), axis=0)


def _edge_normals(ring: Array) -> Array:
    edge = np.roll(ring, -1, axis=0) - ring
    normal = np.arctan2(-edge[:, 0], edge[:, 1])
    return np.where(normal >= math.pi, -math.pi, normal)


def _principal(angle: Array) -> Array:
    """Angles from -pi to pi."""
    return np.asarray(np.remainder(angle + math.pi, 2.0 * math.pi) - math.pi)
