"""Is this a braking zone? `check_zone` puts one to the proof that planners and judge rely on.

    from vnav_drake.testing import check_zone

    def test_my_zone():
        check_zone(MyZone(law=UniformBraking(max_braking=1.0), radius=0.4))

Speeds, angles and obstacles are sampled, the same ones every time: what passes has not been proven, but what
is refused is wrong, and the reason says where.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray

from vnav_drake.zones.convex_zone import ConvexZone, GaugeZone
from vnav_drake.zones.errors import ZoneFault
from vnav_drake.zones.touch import separation

__all__ = ["ZoneFault", "check_zone"]

Array = NDArray[np.float64]

LONGEST = 10.0  # [m]: stopping distances are tried up to this, or up to the law's greatest speed
SAME = 1e-9  # [m], for each metre of the zone: rounding
STEP = 1e-6  # [rad], [m/s] of differences that slopes are compared with
SLOPE = 1e-4  # [m/rad], [s], for each metre of the zone: what such a difference may be off by
JUMP = 1e-6  # [m], for each metre of the zone
HALVINGS = 34  # of an interval in search of a jump, down to a billionth of it
SPEEDS, ANGLES, POSES = 41, 720, 600  # that are tried
OUTLINE, OBSTACLES = 720, 120  # of the dense check: points, obstacles at each speed
SEED = 7  # the same samples every time
BEYOND_STEP = 1e-6  # [m/s]: from here on the zone has jumped


def check_zone(zone: ConvexZone) -> None:
    """Put a braking zone to the proof.

    It must be finite; hold the body with its margin at standstill and the way of a straight stop at every
    speed; not shrink with speed; be convex; have slopes that agree with differences; not jump, except at the
    speeds of its attribute `steps` where it has one; have an `outline` that its support function agrees with,
    so that a dense check never finds an obstacle in a zone that the planners' constraint calls free; and have
    discs in it and around it that are.

    Raises
    ------
    ZoneFault : with all reasons.
    """
    trial = _Trial(zone)
    reasons = list(_form(trial))
    if not reasons:
        reasons = list(_holds(trial)) or list(_with_law(trial))
        reasons += [*_nested(trial), *(list(_gauge(trial)) or _discs(trial))]
        shape = list(_continuous(trial)) or [*_convex(trial), *_slopes(trial)]
        reasons += shape or _dense(trial)  # where the shape is wrong, more would only follow
    if reasons:
        raise ZoneFault(*reasons)


@dataclass(frozen=True)
class _Trial:
    """A zone and what it is tried with."""

    zone: ConvexZone

    @cached_property
    def steps(self) -> Array:
        """Speeds [m/s] at which the zone says that it may jump."""
        return np.asarray(self.zone.steps, dtype=float)

    @cached_property
    def speeds(self) -> Array:
        """(n,) [m/s], rising, from standstill on: even in speed and, where it is slow, in distance."""
        law = self.zone.law
        top = min(float(law.speed(LONGEST + law.margin)), law.max_speed)
        share = np.linspace(0.0, 1.0, SPEEDS)
        beside = np.concatenate([self.steps, self.steps + BEYOND_STEP])
        return np.unique(np.concatenate([top * share, top * share**3, beside[beside <= top]]))

    @cached_property
    def angles(self) -> Array:
        """(m,) [rad] in one turn, rising: even ones, and both sides of each kink."""
        even = np.linspace(-math.pi, math.pi, ANGLES, endpoint=False)
        kinks = np.asarray(self.zone.kinks, dtype=float)
        return np.unique(_principal(np.concatenate([even, kinks - 1e-7, kinks, kinks + 1e-7])))

    @cached_property
    def reach(self) -> Array:
        """h (n, m) [m] at all speeds and angles."""
        return self.zone.support(self.angles, self.speeds[:, None])[0]

    @cached_property
    def size(self) -> Array:
        """Greatest reach (n,) [m] at each speed, at least 1."""
        return np.maximum(np.abs(self.reach).max(axis=1), 1.0)


def _form(trial: _Trial) -> Iterator[str]:
    """Arrays of the right shape, with numbers in them."""
    kinks = np.asarray(trial.zone.kinks, dtype=float)
    if kinks.ndim != 1 or not np.isfinite(kinks).all():
        yield "kinks: must be angles (k,) [rad]"
        return
    angle, speed = np.linspace(-math.pi, math.pi, 7), np.array([[0.0], [trial.speeds[-1]]])
    answer = trial.zone.support(angle, speed)
    if not isinstance(answer, tuple) or len(answer) != 3:
        yield "support: must return three arrays, h, dh/dangle and dh/dspeed"
        return
    for part, name in zip(answer, ("h", "dh/dangle", "dh/dspeed"), strict=True):
        if np.shape(part) != (2, 7):
            yield (
                f"support: {name} has the shape {np.shape(part)} for angles (7,) and speeds (2, 1); expected "
                f"(2, 7): they broadcast"
            )
            return
    speed = trial.speeds[:, None]
    for values, name in zip(
        trial.zone.support(trial.angles, speed), ("h", "dh/dangle", "dh/dspeed"), strict=True
    ):
        wrong = np.argwhere(~np.isfinite(values))
        if len(wrong):
            i, j = wrong[0]
            yield f"finite: {name} is {values[i, j]} {_at(trial, i, j)}"


def _holds(trial: _Trial) -> Iterator[str]:
    """The body at standstill, and the capsule of a straight stop."""
    law = trial.zone.law
    body = trial.zone.radius + law.margin
    far = law.distance(trial.speeds) - law.margin
    ahead = far[:, None] * np.maximum(np.cos(trial.angles), 0.0)
    lacks = body + ahead - trial.reach
    j = int(np.argmax(lacks[0]))
    if lacks[0, j] > SAME:
        yield (
            f"body: at standstill the zone lacks {lacks[0, j]:.3g} m of the robot's disc and margin, "
            f"{body:g} m, at angle {trial.angles[j]:.4g} rad"
        )
        return
    i, j = _worst(lacks / trial.size[:, None])
    if lacks[i, j] > SAME * trial.size[i]:
        yield (
            f"straight stop: the zone lacks {lacks[i, j]:.3g} m of the way of a straight stop, {far[i]:.4g} "
            f"m ahead, {_at(trial, i, j)}"
        )


def _nested(trial: _Trial) -> Iterator[str]:
    """A zone does not shrink with speed."""
    fall = trial.reach[:-1] - trial.reach[1:]
    i, j = _worst(fall)
    if fall[i, j] > SAME * trial.size[i]:
        yield (
            f"nested: as the speed rises from {trial.speeds[i]:.6g} to {trial.speeds[i + 1]:.6g} m/s the "
            f"zone shrinks by {fall[i, j]:.3g} m at angle {trial.angles[j]:.4g} rad"
        )
        return
    rise = trial.zone.support(trial.angles, trial.speeds[:, None])[2]
    i, j = _worst(-rise)
    if rise[i, j] < -SAME * trial.size[i]:
        yield f"nested: dh/dspeed is {rise[i, j]:.3g} s {_at(trial, i, j)}; expected zero or more"


def _convex(trial: _Trial) -> Iterator[str]:
    """Of three directions the middle one reaches no farther than the corner of the outer tangents.

    That is h + h'' >= 0 without derivatives: sin(c - b) h(a) + sin(b - a) h(c) >= sin(c - a) h(b).
    """
    for stride in (1, 2, 7):
        a, b, c = trial.angles, np.roll(trial.angles, -stride), np.roll(trial.angles, -2 * stride)
        before, after = np.remainder(b - a, 2.0 * math.pi), np.remainder(c - b, 2.0 * math.pi)
        h_b, h_c = np.roll(trial.reach, -stride, axis=1), np.roll(trial.reach, -2 * stride, axis=1)
        excess = np.sin(before + after) * h_b - np.sin(after) * trial.reach - np.sin(before) * h_c
        i, j = _worst(excess / trial.size[:, None])
        if excess[i, j] > SAME * trial.size[i]:
            yield (
                f"convex: h is no support function {_at(trial, i, (j + stride) % len(b))}: it is greater "
                f"than the neighbouring tangents allow, so that h + h'' < 0"
            )
            return


def _slopes(trial: _Trial) -> Iterator[str]:
    """dh/dangle and dh/dspeed lie between the differences to either side."""
    random, top = np.random.default_rng(SEED), float(trial.speeds[-1])
    angle = random.uniform(-math.pi, math.pi, POSES)
    speed = random.uniform(0.02 * top, 0.98 * top, POSES)
    if len(trial.steps):
        near = np.abs(speed[:, None] - trial.steps).min(axis=1) < 2.0 * BEYOND_STEP
        speed = np.where(near, speed + 10.0 * BEYOND_STEP, speed)
    support = trial.zone.support
    h, by_angle, by_speed = support(angle, speed)
    for slope, turn, rise, name in ((by_angle, STEP, 0.0, "dh/dangle"), (by_speed, 0.0, STEP, "dh/dspeed")):
        after = (support(angle + turn, speed + rise)[0] - h) / STEP
        before = (h - support(angle - turn, speed - rise)[0]) / STEP
        wrong = np.maximum(np.minimum(before, after) - slope, slope - np.maximum(before, after))
        i = int(np.argmax(wrong / np.maximum(np.abs(h), 1.0)))
        if wrong[i] > SLOPE * max(abs(h[i]), 1.0):
            yield (
                f"slope: {name} is {slope[i]:.6g} at angle {angle[i]:.4g} rad and speed {speed[i]:.4g} m/s, "
                f"where differences give {0.5 * (before[i] + after[i]):.6g}"
            )


def _continuous(trial: _Trial) -> Iterator[str]:
    """No jumps, found by halving intervals towards the greater change."""
    support, speeds, angles = trial.zone.support, trial.speeds, trial.angles
    some = speeds[:: max(1, len(speeds) // 6)]
    ends = np.append(angles, angles[0] + 2.0 * math.pi)
    grid, fixed = np.meshgrid(ends[:-1], some)
    last = np.broadcast_to(ends[1:], grid.shape)
    at, jump = _greatest_jump(lambda x: support(x, fixed)[0], grid, last)
    i, j = _worst(jump)
    if jump[i, j] > JUMP * trial.size.max():
        yield (
            f"continuous: h jumps by {jump[i, j]:.3g} m in angle, at {at[i, j]:.6g} rad and speed "
            f"{some[i]:.4g} m/s"
        )
    free = np.ones(len(speeds) - 1, dtype=bool)
    if len(trial.steps):
        free = ~np.any((speeds[:-1, None] <= trial.steps) & (trial.steps < speeds[1:, None]), axis=1)
    low, fixed = np.meshgrid(speeds[:-1][free], angles[::12], indexing="ij")
    high = np.broadcast_to(speeds[1:][free][:, None], low.shape)
    at, jump = _greatest_jump(lambda x: support(fixed, x)[0], low, high)
    i, j = _worst(jump)
    if jump[i, j] > JUMP * trial.size.max():
        yield (
            f"continuous: h jumps by {jump[i, j]:.3g} m in speed, at {at[i, j]:.6g} m/s and angle "
            f"{fixed[i, j]:.4g} rad, which the attribute `steps` does not tell"
        )


def _greatest_jump(h: Callable[[Array], Array], low: Array, high: Array) -> tuple[Array, Array]:
    """Where a function changes most within intervals, and by how much there."""
    at_low, at_high = h(low), h(high)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        here = h(middle)
        left = np.abs(here - at_low) > np.abs(at_high - here)
        low, at_low = np.where(left, low, middle), np.where(left, at_low, here)
        high, at_high = np.where(left, middle, high), np.where(left, here, at_high)
    return 0.5 * (low + high), np.abs(at_high - at_low)


def _gauge(trial: _Trial) -> Iterator[str]:
    """A zone D(v) E (+) body reaches as far as body and E say."""
    zone = trial.zone
    if not isinstance(zone, GaugeZone):
        return
    shape, body = zone.shape(trial.angles)[0], zone.body(trial.angles)[0]
    far = zone.law.distance(trial.speeds) - zone.law.margin
    apart = body + far[:, None] * shape - trial.reach
    i, j = _worst(np.abs(apart))
    if abs(apart[i, j]) > SAME * trial.size[i]:
        kind = "conservative: the constraint is laxer than" if apart[i, j] > 0.0 else "gauge: support exceeds"
        yield f"{kind} body + D shape, by {abs(apart[i, j]):.3g} m {_at(trial, i, j)}"
        return
    if float(shape.max()) > zone.extent + SAME:
        yield f"gauge: extent is {zone.extent:.6g}, and E reaches {float(shape.max()):.6g}"
    if float(shape.min()) < zone.inscribed - SAME:
        yield f"gauge: inscribed is {zone.inscribed:.6g}, and E reaches only {float(shape.min()):.6g}"


def _with_law(trial: _Trial) -> Iterator[str]:
    """With another law it is a zone of that law."""
    law = replace(trial.zone.law, max_braking=0.5 * trial.zone.law.max_braking)
    other = trial.zone.with_law(law)
    far = law.distance(trial.speeds) - law.margin
    lacks = trial.zone.radius + law.margin + far - other.support(0.0, trial.speeds)[0]
    if float(np.max(lacks / (1.0 + far))) > SAME:
        yield f"with_law: with brakes half as strong it lacks {lacks.max():.3g} m of a straight stop"


def _discs(trial: _Trial) -> Iterator[str]:
    """Uniform braking in the zone and around it is what it says."""
    radius = trial.zone.radius
    for law, sign, what in (
        (trial.zone.inner_law(), 1.0, "inner_law: its disc is not in the zone"),
        (trial.zone.outer_law(), -1.0, "outer_law: its disc does not hold the zone"),
    ):
        if law is None:
            continue
        beyond = sign * (radius + law.distance(trial.speeds)[:, None] - trial.reach)
        i, j = _worst(beyond)
        if beyond[i, j] > SAME * trial.size[i]:
            yield f"{what}: {beyond[i, j]:.3g} m too far {_at(trial, i, j)}"


def _dense(trial: _Trial) -> Iterator[str]:
    """The planners' constraint against the zone's outline, and against the distance to that by Shapely."""
    zone, random = trial.zone, np.random.default_rng(SEED)
    for i in range(0, len(trial.speeds), 6):
        speed = float(trial.speeds[i])
        ring = np.asarray(zone.outline(speed, OUTLINE), dtype=float)
        if ring.ndim != 2 or ring.shape[1] != 2 or not np.isfinite(ring).all():
            yield f"outline: must give finite points (m, 2) [m]; at {speed:.4g} m/s it gives {ring.shape}"
            return
        hull = shapely.convex_hull(shapely.multipoints(ring))
        size = max(float(np.hypot(*ring.T).max()), 1.0)
        along = np.stack([np.cos(trial.angles), np.sin(trial.angles)])
        short = trial.reach[i] - (ring @ along).max(axis=0)
        j = int(np.argmin(short))
        if short[j] < -SAME * size:
            yield (
                f"conservative: the constraint is laxer than the dense check: the outline reaches "
                f"{-short[j]:.3g} m beyond the support function {_at(trial, i, j)}"
            )
            return
        # Between two tangents that differ by an angle a zone is within chord x angle / 4 of its chord.
        chord = float(np.hypot(*(ring - np.roll(ring, 1, axis=0)).T).max())
        slack = chord * (2.0 * math.pi / OUTLINE) / 4.0 + SAME * size
        j = int(np.argmax(short))
        if short[j] > slack:
            yield f"outline: it lacks {short[j]:.3g} m of what the support function says {_at(trial, i, j)}"
            return
        corners = _obstacles(random, OBSTACLES, size)
        distance = shapely.distance(shapely.convex_hull(shapely.multipoints(corners)), hull)
        gap = separation(zone, corners, np.full(len(corners), speed)).gap
        k = int(np.argmax(gap - distance))
        if gap[k] - distance[k] > SAME * size:
            yield (
                f"conservative: the constraint is laxer than the dense check: it puts an obstacle at "
                f"{gap[k]:.6g} m that is {distance[k]:.6g} m from the outline, at speed {speed:.4g} m/s"
            )
            return
        k = int(np.argmax(distance - np.maximum(gap, 0.0)))
        if distance[k] - max(gap[k], 0.0) > slack:
            yield (
                f"constraint: it puts an obstacle at {gap[k]:.6g} m that the dense check finds "
                f"{distance[k]:.6g} m from the outline, at speed {speed:.4g} m/s"
            )
            return


def _obstacles(random: np.random.Generator, count: int, size: float) -> Array:
    """Triangles, walls and points (count, 3, 2) [m] around a zone, and in it."""
    towards = random.uniform(-math.pi, math.pi, count)
    away = size * random.uniform(0.0, 1.6, count)
    centre = away[:, None] * np.stack([np.cos(towards), np.sin(towards)], axis=1)
    corners = centre[:, None, :] + 0.2 * size * random.normal(size=(count, 3, 2))
    corners[::3, 2] = corners[::3, 1]  # a wall
    corners[1::3, 1:] = corners[1::3, :1]  # a point
    (a, b), (c, d) = (corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T
    clockwise = a * d < b * c
    corners[clockwise] = corners[clockwise][:, ::-1]
    return corners


def _worst(values: Array) -> tuple[int, int]:
    """Where an array (n, m) is greatest."""
    return divmod(int(np.argmax(values)), values.shape[1])


def _at(trial: _Trial, i: int, j: int) -> str:
    return f"at angle {trial.angles[j]:.4g} rad and speed {trial.speeds[i]:.4g} m/s"


def _principal(angle: Array) -> Array:
    """Angles from -pi to pi."""
    return np.asarray(np.remainder(angle + math.pi, 2.0 * math.pi) - math.pi)
