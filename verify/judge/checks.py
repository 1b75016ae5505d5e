"""Every rule a trajectory must obey, recomputed from its rows and the scenario's vertices."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.judge.arithmetic import check_arithmetic, turn_errors
from verify.judge.continuous import CONTACT, LeastMargin, Need, least_margin
from verify.judge.features import Features
from verify.judge.finding import VIOLATION_TOLERANCE, Check, Place, finding
from verify.judge.geometry import Surroundings
from verify.judge.limits import Limits
from verify.judge.motion import Motion
from verify.judge.promises import ENDS, FIELD_PLAN, UNIFORM_PLAN, Promise, promise_of
from verify.judge.zones import (
    AskedZone,
    FieldSet,
    ForeignZone,
    Zone,
    asked_zone,
    least_arc_room,
    least_separation,
    sampled_faults,
)

Array = NDArray[np.float64]


KINK_TOLERANCE = 1e-6  # [rad]: heading jumps that count as a kink, all together; rounding gives 1e-12


@dataclass(frozen=True, kw_only=True)
class Setting:
    """What the rules refer to."""

    limits: Limits
    surroundings: Surroundings
    features: Features  # what stands in the way, side by side
    zone: AskedZone | None  # what must be free where that is not the disc of uniform braking
    fields: FieldSet | None  # what must be free of the plan that is driven under a field set
    start: Any  # the scenario's raw start: position [m], speed [m/s or a word], heading [rad or None]
    goal: Any

    @classmethod
    def from_spec(cls, spec: Any) -> Setting:
        """From a parsed scenario's raw numbers (`Scenario.spec`).

        Raises
        ------
        ZoneError : as from `asked_zone`.
        """
        limits = Limits.from_spec(spec)
        zone = asked_zone(spec, limits)
        return cls(
            limits=limits,
            surroundings=Surroundings.from_spec(spec.world),
            features=Features.from_spec(spec.world),
            zone=zone,
            fields=None if zone is None else zone.fields,
            start=spec.start,
            goal=spec.goal,
        )

    @property
    def isotropic(self) -> bool:
        """Whether paths are planned with a disc, in which the heading does not matter."""
        return self.zone is None or self.zone.isotropic

    def zone_of(self, plan: str) -> Zone | None:
        """What must be free in a plan; None for the disc of uniform braking."""
        if plan == FIELD_PLAN and self.fields is not None:
            return self.fields
        return None if self.zone is None else self.zone.zone


def check_motion(motion: Motion, name: str, model: str, setting: Setting) -> tuple[Check, ...]:
    """All checks of one trajectory; those that the plan `name` of `model` does not promise are marked so."""
    zone = setting.zone_of(name)
    rules: list[Callable[[Motion, Setting], Check]] = [
        _boundary,
        _start,
        _goal,
        _clearance,
        partial(_braking_distance, zone=zone),
        *_zone_rules(name, zone, setting),
        _friction_circle,
        _tip_over,
        _steering,
        _drive,
        _speed,
        _travel_time,
    ]
    found = [replace(rule(motion, setting), trajectory=name) for rule in rules]
    within = setting.zone is None or setting.zone.within_disc(setting.limits)
    promise = promise_of(name, model, zone_within_disc=within)
    if promise is not None:
        found = [entry for check in found for entry in _as_promised(check, promise, motion, setting)]
    return tuple(found)


def reaches(motion: Motion, setting: Setting) -> bool:
    """Whether a motion leads from the start to the goal, at whatever speed."""
    ends = ((0, setting.start), (-1, setting.goal))
    return all(_miss(motion, row, end) <= VIOLATION_TOLERANCE for row, end in ends)


def _as_promised(check: Check, promise: Promise, motion: Motion, setting: Setting) -> list[Check]:
    """A check as far as it is promised; what remains of it is marked as not promised."""
    unpromised = f" (not promised by {promise.by})"
    if check.name not in promise.checks:
        note = unpromised if check.status == "failed" else ""
        return [replace(check, promised=False, message=check.message + note)]
    if check.name not in ENDS or promise.end_motion or check.status != "failed":
        return [check]
    row, end = (0, setting.start) if check.name == "start" else (-1, setting.goal)
    miss = _miss(motion, row, end)
    place = finding(check.name, -miss, "m", _row_place(motion, row), f"{miss:.6f} m from where it must be")
    if place.status == "failed":
        return [replace(place, trajectory=check.trajectory)]
    rest = replace(check, promised=False, message=check.message + unpromised)
    return [replace(place, trajectory=check.trajectory), rest]


def _boundary(motion: Motion, setting: Setting) -> Check:
    need = Need(constant=setting.limits.radius)
    least = least_margin(motion, setting.surroundings.boundary_distance, need)
    return _margin_finding("boundary", least, "from the disc to the outer boundary at least")


def _clearance(motion: Motion, setting: Setting) -> Check:
    """The disc keeps off every obstacle, and its centre crosses none.

    A wall, a point or the side of a polygon has no depth, so that a path through one is nowhere far
    inside: where the distance is proven positive all along, none is crossed. The rows of a motion join
    up to less than `CONTACT`.
    """
    radius = setting.limits.radius
    least = least_margin(motion, setting.surroundings.distance, Need(constant=radius))
    if least.proven + radius > CONTACT:
        return _margin_finding("clearance", least, "from the disc to the nearest obstacle at least")
    at = Place(t=least.t, x=least.x, y=least.y)
    return finding("clearance", -1.0, "crossing", at, "the centre touches or crosses an obstacle")


def _braking_distance(motion: Motion, setting: Setting, zone: Zone | None) -> Check:
    if zone is None:
        return _uniform_distance(motion, setting, name="braking_distance")
    least = least_separation(motion, setting.features.table, zone)
    own = " (by the functions of the plugin)" if setting.zone is not None and setting.zone.plugin else ""
    if isinstance(zone, ForeignZone):
        faults = sampled_faults(zone, motion.v)
        if faults:
            text = f"the zone of the plugin cannot be judged at the speeds driven: {'; '.join(faults)}"
            return finding("braking_distance", -1.0, "zone", _row_place(motion, 0), text)
        own = " (by the functions of the plugin, nested and convex at sampled speeds and angles)"
    what = f"between the braking zone{own} and what stands in the way, at least"
    return _margin_finding("braking_distance", least, what)


def _zone_rules(
    name: str, zone: Zone | None, setting: Setting
) -> Iterator[Callable[[Motion, Setting], Check]]:
    """What else is to be checked of a plan where the zone is not a disc."""
    asked = setting.zone
    if asked is None or zone is None:
        return
    if name == UNIFORM_PLAN:
        yield _uniform_distance
        return  # its disc holds every arc
    # Fitted fields hold the base zone, and it the arcs.
    held = asked.zone if asked.fields is None else zone
    if setting.limits.reserves_friction and not (asked.isotropic and held is asked.zone):
        yield partial(_braking_arc, zone=held)


def _uniform_distance(motion: Motion, setting: Setting, name: str = "uniform_distance") -> Check:
    """Uniform braking, in every direction."""
    limits = setting.limits
    need = Need(
        constant=limits.radius + limits.margin,
        linear=limits.reaction_time,
        quadratic=0.5 / limits.braking,
    )
    least = least_margin(motion, setting.surroundings.distance, need)
    return _margin_finding(name, least, "left after stopping, at least")


def _braking_arc(motion: Motion, setting: Setting, zone: Zone) -> Check:
    """Stops with full braking and the steering held, for which friction is kept, stay in the zone."""
    least = least_arc_room(motion, zone, setting.limits)
    if least is None:
        text = "the robot never moves"
        return Check(name="braking_arc", trajectory="", status="not_evaluated", message=text)
    return _margin_finding("braking_arc", least, "in the zone beside stops with the steering held, at least")


def _margin_finding(name: str, least: LeastMargin, what: str) -> Check:
    at = Place(t=least.t, x=least.x, y=least.y)
    return finding(name, least.proven, "m", at, f"{what} {least.proven:.6f} m")


def _row_place(motion: Motion, row: int) -> Place:
    return Place(t=float(motion.t[row]), x=float(motion.x[row]), y=float(motion.y[row]))


def _miss(motion: Motion, row: int, end: Any) -> float:
    """Distance [m] of one row from the position asked for."""
    return math.hypot(motion.x[row] - end.position[0], motion.y[row] - end.position[1])


def _end(name: str, motion: Motion, row: int, end: Any) -> Check:
    """Position, and speed and heading where the scenario fixes them: the worst of the three."""
    miss = _miss(motion, row, end)
    candidates = [(miss, "m", f"{miss:.6f} m from where it must be")]
    if end.speed != "safe":
        wanted = 0.0 if end.speed == "rest" else float(end.speed)
        error = abs(float(motion.v[row]) - wanted)
        text = f"speed {motion.v[row]:.6f} m/s where {wanted:.6f} m/s is asked for"
        candidates.append((error, "m/s", text))
    if end.heading is not None:
        error = abs(math.remainder(_end_heading(motion, row) - end.heading, 2.0 * math.pi))
        candidates.append((error, "rad", f"heading {error:.6f} rad off"))
    error, unit, text = max(candidates, key=lambda candidate: candidate[0])
    return finding(name, -error, unit, _row_place(motion, row), text)


def _end_heading(motion: Motion, row: int) -> float:
    """Heading [rad] with which the motion begins (`row` 0) or ends (-1): of the rows that take time."""
    moving = np.flatnonzero(motion.moving)
    if not moving.size:
        return float(motion.heading[row])
    last = moving[row]
    turned = 0.0 if row == 0 else motion.curvature[last] * motion.step[last]
    return float(motion.heading[last] + turned)


def _start(motion: Motion, setting: Setting) -> Check:
    return _end("start", motion, 0, setting.start)


def _goal(motion: Motion, setting: Setting) -> Check:
    return _end("goal", motion, -1, setting.goal)


def _row_ends(motion: Motion) -> tuple[NDArray[np.int64], Array, Array, Array]:
    """Row index, speed, acceleration and curvature at both ends of all rows that take time.

    Curvature and tangential acceleration are constant within a row and v^2 is linear in the distance,
    so v^2 |kappa| and the total acceleration are greatest at one of the ends.
    """
    first = np.flatnonzero(motion.moving)
    row = np.concatenate([first, first])
    speed = np.concatenate([motion.v[first], motion.v[first + 1]])
    return np.concatenate([first, first + 1]), speed, motion.a[row], motion.curvature[row]


def _greatest(name: str, motion: Motion, value: Array, limit: float, what: str) -> Check:
    """A quantity [m/s^2] at row ends against its greatest allowed value."""
    index, *_ = _row_ends(motion)
    if not index.size:
        return Check(name=name, trajectory="", status="not_evaluated", message="the robot never moves")
    worst = int(np.argmax(value))
    text = f"{what} at most {value[worst]:.6f} m/s^2, limit {limit:.6f} m/s^2"
    at = _row_place(motion, int(index[worst]))
    return finding(name, limit - float(value[worst]), "m/s^2", at, text, scale=limit)


def _friction_circle(motion: Motion, setting: Setting) -> Check:
    _, v, a, curvature = _row_ends(motion)
    limits = setting.limits
    lateral = v * v * np.abs(curvature)
    total = _greatest("friction_circle", motion, np.hypot(a, lateral), limits.grip, "total acceleration")
    if not math.isfinite(limits.reserve):
        return total
    if limits.reserve <= 0.0:
        turn = float(lateral.max(initial=0.0))
        text = f"braking takes all the friction, and turning takes {turn:.6f} m/s^2"
        index, *_ = _row_ends(motion)
        at = _row_place(motion, int(index[np.argmax(lateral)]))
        reserved = finding("friction_circle", -turn, "m/s^2", at, text, scale=limits.grip)
    else:
        what = "lateral acceleration with full braking kept in reserve"
        reserved = _greatest("friction_circle", motion, lateral, limits.reserve, what)
    return _worse(total, reserved)


def _worse(one: Check, other: Check) -> Check:
    def rank(check: Check) -> tuple[float, float]:
        return (check.violation or 0.0, -(math.inf if check.worst is None else check.worst))

    return max(one, other, key=rank)


def _tip_over(motion: Motion, setting: Setting) -> Check:
    limit = setting.limits.tip
    if not math.isfinite(limit):
        text = "a centre of mass on the floor cannot tip"
        return Check(name="tip_over", trajectory="", status="passed", message=text)
    _, v, _, curvature = _row_ends(motion)
    return _greatest("tip_over", motion, v * v * np.abs(curvature), limit, "lateral acceleration")


def _steering(motion: Motion, setting: Setting) -> Check:
    limits = setting.limits
    rows = np.flatnonzero(motion.moving)
    if not rows.size:
        text = "the robot never moves"
        return Check(name="steering", trajectory="", status="not_evaluated", message=text)
    curvature = np.abs(motion.curvature[rows])
    worst = int(np.argmax(curvature))
    value, at = float(curvature[worst]), _row_place(motion, int(rows[worst]))
    limited = math.isfinite(limits.steering_rate)
    free = "" if limited else "; the steering rate is not limited"
    text = f"curvature at most {value:.6f} 1/m, limit {limits.curvature:.6f} 1/m{free}"
    bend = finding("steering", limits.curvature - value, "1/m", at, text, scale=limits.curvature)
    checks = [bend]
    kink = _kink(motion)
    if kink is not None:
        checks.append(kink)
    if limited:
        checks.append(_steering_rate(motion, rows, limits))
    found = checks[0]
    for check in checks[1:]:
        found = _worse(found, check) if (check.violation or 0.0) > 0.0 else found
    return found


def _kink(motion: Motion) -> Check | None:
    """Headings that jump between rows, which no wheel can follow; None when there are none.

    Rows that take no time count too: before the first that does, after the last, and in between.
    """
    jump, rounding = turn_errors(motion)
    total = float(jump.sum())
    if total <= KINK_TOLERANCE + float(rounding.sum()):
        return None
    worst = int(np.argmax(jump))
    angle, text = float(jump[worst]), f"the heading jumps by {jump[worst]:.6f} rad"
    if angle <= KINK_TOLERANCE:
        angle, text = total, f"the heading jumps by {total:.3g} rad in many small steps"
    return finding("steering", -angle, "rad", _row_place(motion, worst), text, tolerance=0.0)


def _steering_rate(motion: Motion, rows: NDArray[np.int64], limits: Limits) -> Check:
    """Change of the steering angle between neighbouring runs of equal curvature.

    Curvature is constant in pieces in this file format. A jump stands for a steady turn of the wheels
    with the joint in its middle, which may last as long as the shorter of both runs: then it takes no
    more than half of each, the turns at both ends of a run do not overlap, and a wheel could follow.
    """
    curvature = motion.curvature[rows]
    first = np.concatenate([[0], np.flatnonzero(np.diff(curvature) != 0.0) + 1])
    lasting = np.add.reduceat(motion.duration[rows], first)
    angle = limits.steering_angle(curvature[first])
    rate = np.abs(np.diff(angle)) / np.minimum(lasting[1:], lasting[:-1])
    worst = int(np.argmax(rate)) if rate.size else 0
    value = float(rate[worst]) if rate.size else 0.0
    text = (
        f"steering rate at most {value:.6f} rad/s, limit {limits.steering_rate:.6f} rad/s "
        "(curvature is constant in pieces; each jump read as a turn of the wheels over the shorter piece)"
    )
    at = _row_place(motion, int(rows[first[min(worst + 1, len(first) - 1)]]))
    room = limits.steering_rate - value
    return finding("steering", room, "rad/s", at, text, scale=limits.steering_rate)


def _drive(motion: Motion, setting: Setting) -> Check:
    limits = setting.limits
    index, _, a, _ = _row_ends(motion)
    if not index.size:
        text = "the robot never moves"
        return Check(name="drive", trajectory="", status="not_evaluated", message=text)
    over, under = limits.acceleration - a, a + limits.braking
    if over.min() / limits.acceleration <= under.min() / limits.braking:
        worst, limit = int(np.argmin(over)), limits.acceleration
        room, word = float(over[worst]), "acceleration"
    else:
        worst, limit = int(np.argmin(under)), limits.braking
        room, word = float(under[worst]), "deceleration"
    text = f"{word} at most {limit - room:.6f} m/s^2, limit {limit:.6f} m/s^2"
    return finding("drive", room, "m/s^2", _row_place(motion, int(index[worst])), text, scale=limit)


def _speed(motion: Motion, setting: Setting) -> Check:
    """Speed is linear in time within a row, so its extremes are at the rows."""
    limit = setting.limits.speed
    slow, fast = int(np.argmin(motion.v)), int(np.argmax(motion.v))
    backwards, room = float(motion.v[slow]), limit - float(motion.v[fast])
    scale = limit if math.isfinite(limit) else 1.0
    if backwards < 0.0 or not math.isfinite(limit):
        text = f"speed at least {backwards:.6f} m/s"
        return finding("speed", backwards, "m/s", _row_place(motion, slow), text, scale=scale)
    text = f"speed at most {motion.v[fast]:.6f} m/s, limit {limit:.6f} m/s"
    return finding("speed", room, "m/s", _row_place(motion, fast), text, scale=scale)


def _travel_time(motion: Motion, setting: Setting) -> Check:
    return check_arithmetic(motion, setting.surroundings, setting.limits.radius)
