"""The conformance kit for braking zones passes those of the package and refuses broken ones, and says why."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from vnav_drake import testing
from vnav_drake.braking import UniformBraking
from vnav_drake.testing import ZoneFault, check_zone
from vnav_drake.zones.convex_zone import ConvexZone, GaugeZone
from vnav_drake.zones.field_set import FieldSet
from vnav_drake.zones.shapes import DiscZone, EllipseZone, PolygonZone, ProtectiveField
from vnav_drake.zones.touch import separation

PLAIN = {"law": UniformBraking(max_braking=1.0), "radius": 0.4}
SLOW = {
    "law": UniformBraking(max_braking=0.5, reaction_time=0.3, margin=0.1, max_speed=2.0),
    "radius": 0.0,
}
QUAD = ((-0.2, -0.3), (1.2, -0.4), (1.3, 0.2), (0.0, 0.6))


@pytest.mark.parametrize("robot", [PLAIN, SLOW], ids=["plain", "slow"])
def test_zones_of_the_package_pass(robot):
    disc, ellipse = DiscZone(**robot), EllipseZone(**robot)
    # Squares of half-width 1.5 and 6 m: the stop from 1 m/s is at most 1 / (2 * 0.5) + 0.3 = 1.3 m long.
    squares = tuple(((-s, -s), (s, -s), (s, s), (-s, s)) for s in (1.5, 6.0))
    for zone in (
        disc,
        ellipse,
        EllipseZone(**robot, lateral_ratio=0.001),
        EllipseZone(**robot, lateral_ratio=0.3, ahead=1.2, behind=0.0),
        ProtectiveField(**robot),
        ProtectiveField(**robot, form="rectangle", side=0.2),
        PolygonZone(**robot, vertices=QUAD),
        FieldSet(**robot, base=ellipse, max_speeds=(0.3, 0.7, 1.9)),
        FieldSet(**robot, base=disc, max_speeds=(0.5, 1.0), polygons=squares),
    ):
        check_zone(zone)


@dataclass(frozen=True, kw_only=True)
class _Disc(ConvexZone):
    """A disc of radius body + D(v), to be broken."""

    def support(self, angle, speed):
        h = self.radius + self.law.distance(speed) + 0.0 * angle
        return h, 0.0 * h, self.law.distance_slope(speed) + 0.0 * h


class _Shrinking(_Disc):
    """A supplement of 3 exp(-v) m, which falls faster than v / a_b rises up to about 1 m/s."""

    def support(self, angle, speed):
        h, turn, rise = super().support(angle, speed)
        more = 3.0 * np.exp(-speed)
        return h + more, turn, rise - more


class _WrongGradient(EllipseZone):
    def support(self, angle, speed):
        h, turn, rise = super().support(angle, speed)
        return h, -turn, rise


class _WrongSpeedGradient(_Disc):
    def support(self, angle, speed):
        h, turn, rise = super().support(angle, speed)
        return h, turn, 0.9 * rise


class _Lax(EllipseZone):
    """Drawn and checked as an ellipse that is wider than the one that is planned with."""

    def outline(self, speed, points=96):
        return replace(EllipseZone(**PLAIN), lateral_ratio=0.8).outline(speed, points)


class _JumpsInSpeed(_Disc):
    def support(self, angle, speed):
        h, turn, rise = super().support(angle, speed)
        return h + np.where(speed > 1.2345, 0.01, 0.0), turn, rise


class _JumpsInAngle(_Disc):
    def support(self, angle, speed):
        h, turn, rise = super().support(angle, speed)
        return h + np.where(np.cos(angle - 0.7) > 0.3, 0.001, 0.0), turn, rise


class _NotANumber(_Disc):
    def support(self, angle, speed):
        h, turn, rise = super().support(angle, speed)
        with np.errstate(invalid="ignore"):
            return h + 0.0 * np.sqrt(np.cos(angle) + 0.99), turn, rise


class _Thin(_Disc):
    def support(self, angle, speed):
        h, turn, rise = super().support(angle, speed)
        return h - 0.001, turn, rise


class _Short(GaugeZone):
    """E reaches 0.9 of the stopping distance ahead."""

    def shape(self, angle):
        return 0.9 + 0.0 * angle, 0.0 * angle


class _Clover(_Disc):
    """h = ... + D cos(4 angle) / 10: h + h'' = body + D (1.1 - 1.5 cos(4 angle)) falls below 0."""

    def support(self, angle, speed):
        h, turn, rise = super().support(angle, speed)
        far, slope = self.law.distance(speed) - self.law.margin, self.law.distance_slope(speed)
        wave = 0.1 * (1.0 + np.cos(4.0 * angle))
        return h + far * wave, turn - 0.4 * far * np.sin(4.0 * angle), rise + slope * wave


class _Inner(EllipseZone):
    def inner_law(self):
        return self.law


class _Constraint(EllipseZone):
    """The constraint of the planners is smaller than body and shape say."""

    def support(self, angle, speed):
        h, turn, rise = super().support(angle, speed)
        far, slope = self.law.distance(speed) - self.law.margin, self.law.distance_slope(speed)
        side = 0.05 * np.sin(angle) ** 2
        return h - far * side, turn - 0.05 * far * np.sin(2.0 * angle), rise - slope * side


class _Flat(_Disc):
    def support(self, angle, speed):
        h, turn, rise = super().support(angle, speed)
        return np.ravel(h), turn, rise


class _LawKept(_Disc):
    def with_law(self, law):
        return self


BROKEN = [
    (_Shrinking(**PLAIN), "nested: as the speed rises"),
    (_WrongGradient(**PLAIN), "slope: dh/dangle is"),
    (_WrongSpeedGradient(**PLAIN), "slope: dh/dspeed is"),
    (_Lax(**PLAIN), "conservative: the constraint is laxer than the dense check"),
    (_JumpsInSpeed(**PLAIN), "continuous: h jumps by 0.01 m in speed, at 1.2345 m/s"),
    (_JumpsInAngle(**PLAIN), "continuous: h jumps by 0.001 m in angle"),
    (_NotANumber(**PLAIN), "finite: h is nan"),
    (_Thin(**PLAIN), "body: at standstill the zone lacks 0.001 m"),
    (_Short(**PLAIN), "straight stop: the zone lacks 1 m"),  # 0.1 of the longest stop tried, 10 m
    (_Clover(**PLAIN), "convex: h is no support function"),
    (_Inner(**PLAIN), "inner_law: its disc is not in the zone"),
    (_Constraint(**PLAIN), "conservative: the constraint is laxer than body + D shape"),
    (_Flat(**PLAIN), "support: h has the shape (14,)"),
    (_LawKept(**PLAIN), "with_law: with brakes half as strong"),
]


@pytest.mark.parametrize(("zone", "reason"), BROKEN, ids=[type(zone).__name__ for zone, _ in BROKEN])
def test_a_broken_zone_is_refused_with_its_own_reason(zone, reason):
    with pytest.raises(ZoneFault) as caught:
        check_zone(zone)
    assert len(caught.value.reasons) == 1, caught.value.reasons
    assert caught.value.reasons[0].startswith(reason)


def test_all_reasons_are_told():
    class Both(_Shrinking):
        def with_law(self, law):
            return self

    with pytest.raises(ZoneFault) as caught:
        check_zone(Both(**PLAIN))
    assert [reason.partition(":")[0] for reason in caught.value.reasons] == ["with_law", "nested"]
    assert str(caught.value) == "; ".join(caught.value.reasons)


def test_only_a_zone_that_tells_its_steps_may_jump():
    class Silent(FieldSet):
        steps = ()

    fields = {"base": DiscZone(**PLAIN), "max_speeds": (0.5, 1.0)}
    check_zone(FieldSet(**PLAIN, **fields))
    # From D(0.5) = 0.125 m to D(1) = 0.5 m.
    with pytest.raises(ZoneFault, match=r"h jumps by 0.375 m in speed, at 0.5 m/s"):
        check_zone(Silent(**PLAIN, **fields))


@pytest.mark.parametrize(("by", "reason"), [(0.01, "conservative"), (-0.1, "constraint")])
def test_the_planners_constraint_is_compared_with_distances_by_shapely(monkeypatch, by, reason):
    def wrong(zone, corners, speed):
        touch = separation(zone, corners, speed)
        return replace(touch, gap=touch.gap + by)

    monkeypatch.setattr(testing, "separation", wrong)
    with pytest.raises(ZoneFault, match=f"^{reason}: [^;]*$"):
        check_zone(EllipseZone(**PLAIN))
