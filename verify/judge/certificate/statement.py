"""What a certificate proves, in one paragraph."""

from __future__ import annotations

import math
from decimal import ROUND_FLOOR, Context, Decimal
from fractions import Fraction

from verify.judge.certificate.file import CertificateFile
from verify.judge.certificate.sheets import Sheets
from verify.judge.question import Question
from verify.judge.zones import AskedZone

DIGITS = 6  # of seconds after the point


def statement_of(
    file: CertificateFile,
    question: Question,
    sheets: Sheets,
    *,
    proven: Fraction | None,
    worst: float,
    at: tuple[float, float],
    exact: bool,
    driven: float | None = None,
) -> str:
    """The theorem with its numbers, or that nothing is proven.

    Parameters
    ----------
    proven : [s] u(G) - u(S), None when the certificate is refused.
    worst, at : least relative slack and its place [m].
    driven : [s], where u is a length: least time of a drive for it.
    """
    start, goal = _point(question.setting.start.position), _point(question.setting.goal.position)
    if proven is None:
        return f"The certificate is refused: it proves nothing about motions from {start} to {goal}."
    limits, features = question.setting.limits, question.features
    fastest = f"v_max = {limits.speed:g} m/s" if math.isfinite(limits.speed) else "no other speed limit"
    robot = f"a disc of radius {limits.radius:g} m" if limits.radius > 0.0 else "a point robot"
    kept, dropped = len(file.triangles), len(file.dropped)
    low, high = file.metres(file.box.reshape(2, 2)).tolist()
    seconds = _down(max(proven, Fraction(0)))
    arithmetic = (
        "in rational arithmetic (integers, rounded only outward)"
        if exact
        else "in floating point, with every rounding error bounded and counted against the certificate"
    )
    sides = f"{len(features.table)} sides, walls, points and circles with the boundary"
    clear = " that touches nothing on its way" if sheets.used else ""
    function = "function u, continuous off the walls" if sheets.used else "continuous function u"
    law = (
        f"a_b = {limits.braking:g} m/s^2, reaction time {limits.reaction_time:g} s, margin "
        f"{limits.margin:g} m, {fastest}"
    )
    zone = None if question.setting.isotropic else question.setting.zone
    if driven is not None and zone is not None:
        ends = question.setting.start.speed, question.setting.goal.speed
        return (
            f"Asked: how fast {robot} can get from {start} to {goal} among the scenario's "
            f"{_counted(len(features.names), 'obstacle')} ({sides}) if its braking zone ({_named(zone)}) is "
            "free at every instant. Such a zone limits the speed for some headings only, so what is proven "
            f"is a length. The certificate holds a {function}, quadratic on each of "
            f"{_counted(kept, 'triangle')}, with |grad u| <= 1 at their corners and so everywhere "
            f"({arithmetic}). With {_counted(dropped, 'triangle')} that the disc the zone has at least "
            f"cannot enter they tile the box from {_point(low)} to {_point(high)}, which holds the whole "
            f"floor; this was checked in integers. {_copies(sheets, kept)}u(goal) - u(start) is {seconds} m, "
            f"rounded down: no way from {start} to {goal} that touches nothing is shorter. With a start "
            f"speed of {_speed(ends[0])}, a goal speed of {_speed(ends[1])}, at most a_max = "
            f"{limits.acceleration:g} m/s^2 and a_b = {limits.braking:g} m/s^2 along the way, and {fastest}, "
            f"that takes {_down(Fraction(driven))} s at least, rounded down. Hence: no motion of the full "
            "robot between these ends takes less. Motions without limits of the drive may."
        )
    speed = (
        f"it can stop within its clearance at every instant: V is the greatest such speed ({law})"
        if zone is None
        else f"its braking zone ({_named(zone)}) is free at every instant: V(theta), which depends on the "
        f"heading theta, is the greatest such speed ({law})"
    )
    steep = (
        "|grad u| is at most a lower bound of 1/V that is affine on each triangle, so |grad u| <= 1/V"
        if zone is None
        else "the slope of u in every direction theta is at most a lower bound of 1/V(theta) that is affine "
        "on each triangle, so it is at most 1/V(theta)"
    )
    inequalities = (
        f"all {3 * kept} inequalities hold {arithmetic}"
        if zone is None
        else f"all {3 * kept} inequalities hold for all headings, proven between sampled ones as well, "
        f"{arithmetic} (rational arithmetic is not available for zones that depend on the heading)"
    )
    return (
        f"Asked: how fast {robot} can get from {start} to {goal} among the scenario's "
        f"{_counted(len(features.names), 'obstacle')} ({sides}) if {speed}. The certificate holds a "
        f"{function}, quadratic on each of {_counted(kept, 'triangle')}. With "
        f"{_counted(dropped, 'triangle')} in which the robot cannot move they tile the box from "
        f"{_point(low)} to {_point(high)}, which holds the whole floor; this was checked in integers. "
        f"{_copies(sheets, kept)}At their corners {steep} everywhere on it: {inequalities}, "
        f"the tightest with a relative slack of {worst:.2g} at {_point(at)}. "
        f"So u grows by at most one second a second along any motion{clear}, and "
        f"u(goal) - u(start) is {seconds} s, rounded down. Hence: no motion of the variational model from "
        f"{start} to {goal}{clear}, in whatever homotopy class, takes less than {seconds} s."
    )


def _speed(speed: float | str) -> str:
    words = {"rest": "zero", "safe": "any size"}
    return words[speed] if isinstance(speed, str) else f"{speed:g} m/s"


def _named(zone: AskedZone) -> str:
    """A zone in words, and whose word is taken for it."""
    kind = f"of the type {zone.type}"
    if zone.type == "field_set":
        return f"{kind}: the base zone, which every field holds"
    trusted = ", whose own support function is used and trusted to be that of a convex set"
    return kind + (trusted if zone.plugin else "")


def _copies(sheets: Sheets, kept: int) -> str:
    """What stands twice, if anything."""
    if not sheets.used:
        return ""
    count = len(sheets.pairs)
    stand = "triangle stands" if count == 1 else "triangles stand"
    return (
        f"{count} {stand} in two sheets, one for each side of a wall that cuts through (twice among the "
        f"{kept}, once in the tiling), and along walls triangles may part: there alone u jumps, and there "
        f"no motion gets through that touches nothing. "
    )


def _counted(number: int, noun: str) -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def _point(position: tuple[float, float] | list[float]) -> str:
    x, y = position
    return f"({x:.9g}, {y:.9g}) m"


def _down(value: Fraction) -> str:
    """Rounded down to `DIGITS` digits after the point."""
    steps = math.floor(value * 10**DIGITS)
    return str(Decimal(steps).scaleb(-DIGITS, Context(prec=40, rounding=ROUND_FLOOR)))
