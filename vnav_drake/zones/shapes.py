"""The zones that come with the package."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Literal

import numpy as np
import shapely
from numpy.typing import NDArray

from vnav_drake.zones.convex_zone import GaugeZone

Array = NDArray[np.float64]

ROUNDING = 1e-12  # relative, that discs inside are taken smaller
CONTAINS = 1e-12  # share of the stopping distance: what a polygon may lack of a point is rounding


@dataclass(frozen=True, kw_only=True)
class DiscZone(GaugeZone):
    """Uniform braking, Manor 2015, eq. (3.13): E is the unit disc."""

    type_name: ClassVar[str] = "uniform"
    isotropic: ClassVar[bool] = True

    def shape(self, angle: Array) -> tuple[Array, Array]:
        return np.ones_like(angle), np.zeros_like(angle)

    @cached_property
    def extent(self) -> float:
        return 1.0

    @cached_property
    def inscribed(self) -> float:
        return 1.0


@dataclass(frozen=True, kw_only=True)
class EllipseZone(GaugeZone):
    """E is an ellipse along the heading, from -`behind` to `ahead`, `lateral_ratio` to either side.

    All are shares of the stopping distance. Manor 2015, sec. 3.8, has the centred one with ahead = 1.
    """

    lateral_ratio: float = 0.5  # semi-axis to the side, beta
    ahead: float = 1.0  # 1 or more: E must hold the straight stop
    behind: float | None = None  # None: as far as ahead, the centred ellipse; less is one-sided

    type_name: ClassVar[str] = "ellipse"

    def __post_init__(self) -> None:
        if not 0.0 < self.lateral_ratio < math.inf:
            raise ValueError(f"lateral_ratio = {self.lateral_ratio!r}: must be positive and finite")
        if not 1.0 <= self.ahead < math.inf:
            raise ValueError(
                f"ahead = {self.ahead!r}: must be 1 or more, so that the zone holds a straight stop"
            )
        if self.behind is not None and not 0.0 <= self.behind <= self.ahead:
            raise ValueError(f"behind = {self.behind!r}: must be between 0 and ahead = {self.ahead:g}")

    @property
    def centre(self) -> float:
        """Of E, ahead of the robot."""
        return 0.0 if self.behind is None else 0.5 * (self.ahead - self.behind)

    def shape(self, angle: Array) -> tuple[Array, Array]:
        long, wide, centre = self.ahead - self.centre, self.lateral_ratio, self.centre
        cos, sin = np.cos(angle), np.sin(angle)
        root = np.hypot(long * cos, wide * sin)
        slope = (wide * wide - long * long) * sin * cos / root
        return centre * cos + root, slope - centre * sin

    @property
    def is_disc(self) -> bool:
        """Whether this is uniform braking."""
        return self.lateral_ratio == self.ahead == 1.0 and self.centre == 0.0

    @cached_property
    def extent(self) -> float:
        return max(self.ahead, self.lateral_ratio) if self.centre == 0.0 else self.measured_extent()

    @cached_property
    def inscribed(self) -> float:
        """Radius of the greatest disc around the centre in E.

        Derived. The square of the distance of the boundary point (c + A C, B S) is c^2 + B^2 + 2 c A C + (A^2
        - B^2) C^2 with C from -1 to 1. It is least at C = -c A / (A^2 - B^2) where that is within and A > B,
        and there B^2 (1 - c^2 / (A^2 - B^2)); else at C = -1, the rear end.
        """
        centre, long, wide = self.centre, self.ahead - self.centre, self.lateral_ratio
        if centre == 0.0:
            return min(long, wide)
        rear = self.ahead if self.behind is None else self.behind
        bend = (long - wide) * (long + wide)
        if bend <= 0.0 or centre * long >= bend:
            return rear
        return min(rear, wide * math.sqrt(1.0 - centre * centre / bend) * (1.0 - ROUNDING))


@dataclass(frozen=True, kw_only=True)
class ProtectiveField(GaugeZone):
    """What a safety scanner watches: the body, as far ahead as the stopping distance.

    E is the segment from 0 to (1, 0). The body is a disc (`form: capsule`) or a square (`rectangle`), with
    the margin all around and `side` to either side besides.
    """

    form: Literal["capsule", "rectangle"] = "capsule"
    side: float = 0.0  # [m]

    type_name: ClassVar[str] = "protective_field"

    def __post_init__(self) -> None:
        if self.form not in ("capsule", "rectangle"):
            raise ValueError(f"form = {self.form!r}: must be capsule or rectangle")
        if not 0.0 <= self.side < math.inf:
            raise ValueError(f"side = {self.side!r}: must be zero or more [m]")

    def shape(self, angle: Array) -> tuple[Array, Array]:
        cos = np.cos(angle)
        return np.maximum(cos, 0.0), np.where(cos > 0.0, -np.sin(angle), 0.0)

    def body(self, angle: Array) -> tuple[Array, Array]:
        long = self.radius + self.law.margin
        wide = long + self.side
        if self.form == "capsule":
            return np.full_like(angle, wide), np.zeros_like(angle)
        cos, sin = np.cos(angle), np.sin(angle)
        return (
            long * np.abs(cos) + wide * np.abs(sin),
            -long * np.sign(cos) * sin + wide * np.sign(sin) * cos,
        )

    @property
    def kinks(self) -> Array:
        quarter = 0.5 * math.pi
        if self.form == "capsule":
            return np.array([-quarter, quarter])
        return np.array([-math.pi, -quarter, 0.0, quarter])


@dataclass(frozen=True, kw_only=True)
class PolygonZone(GaugeZone):
    """E is a convex polygon, in shares of the stopping distance; it must hold (0, 0) and (1, 0)."""

    vertices: tuple[tuple[float, float], ...]

    type_name: ClassVar[str] = "polygon"

    def __post_init__(self) -> None:
        corners = np.asarray(self.vertices, dtype=float)
        if corners.ndim != 2 or corners.shape[1] != 2 or len(corners) < 3 or not np.isfinite(corners).all():
            raise ValueError("vertices: must be three or more points [x, y]")
        polygon = shapely.Polygon(corners)
        if not polygon.is_valid or polygon.area <= 0.0:
            raise ValueError("vertices: must be a simple polygon with an area")
        if polygon.convex_hull.area - polygon.area > 1e-9 * polygon.area:
            raise ValueError("vertices: must be convex")
        for x, what in ((0.0, "the robot's centre"), (1.0, "where a straight stop ends")):
            if polygon.distance(shapely.Point(x, 0.0)) > CONTAINS:
                raise ValueError(f"vertices: must hold ({x:g}, 0), {what}")

    @cached_property
    def _ring(self) -> Array:
        hull = shapely.geometry.polygon.orient(shapely.Polygon(self.vertices).convex_hull)
        return shapely.get_coordinates(hull)[:-1]

    @cached_property
    def inscribed(self) -> float:
        """Distance of the nearest edge: between normals of edges h is concave, so it is least at one."""
        return max(0.0, float(self.shape(self.kinks)[0].min()) * (1.0 - ROUNDING))

    def shape(self, angle: Array) -> tuple[Array, Array]:
        cos, sin = np.cos(angle)[..., None], np.sin(angle)[..., None]
        x, y = self._ring.T
        reach = x * cos + y * sin
        top = reach.argmax(axis=-1)
        h = np.take_along_axis(reach, top[..., None], axis=-1)[..., 0]
        return h, y[top] * cos[..., 0] - x[top] * sin[..., 0]

    @property
    def kinks(self) -> Array:
        edge = np.roll(self._ring, -1, axis=0) - self._ring
        return np.arctan2(-edge[:, 0], edge[:, 1])
