"""The least time of a motion of known least length, with given end speeds and a drive with limits."""

from __future__ import annotations

import math
from typing import Any

from verify.judge.limits import Limits

ROUNDING = 1e-12  # relative, that the time is taken lower: far more than the roundings of its sum


def drive_time(limits: Limits, start: Any, goal: Any, length: float) -> float:
    """Least time [s] of any motion at least `length` [m] long; zero where nothing limits it.

    Derived. Along a path speeds are those of a double integrator: dv/dt from -a_b to a_max, v at most v_max.
    Among motions of one length from v0 to v1 the fastest speeds up to a peak p, cruises there if p = v_max,
    and brakes: any other is nowhere faster at the same place. With (p^2 - v0^2)/(2 a_max) + (p^2 - v1^2)/(2
    a_b) = length its time is (p - v0)/a_max + (p - v1)/a_b, which grows with the length (by 1/p a metre), so
    it bounds longer ones. Where even p = max(v0, v1) needs more than the length, the motion is longer, and
    that p bounds it. An end with the speed `safe` has any speed up to v_max, of which the greatest that leads
    to the other end's within the length is best: more would have to be lost, or could not have been gained,
    on the way.
    """
    gain, brake, top = limits.acceleration, limits.braking, limits.speed
    speeds = [_speed(end) for end in (start, goal)]
    if speeds[0] is None and speeds[1] is None and math.isinf(top):
        return 0.0
    v0, v1 = (top if speed is None else min(speed, top) for speed in speeds)
    if speeds[0] is None:
        v0 = min(v0, math.sqrt(v1 * v1 + 2.0 * brake * length))
    if speeds[1] is None:
        v1 = min(v1, math.sqrt(v0 * v0 + 2.0 * gain * length))
    energy = length + v0 * v0 / (2.0 * gain) + v1 * v1 / (2.0 * brake)
    peak = max(min(math.sqrt(2.0 * energy * gain * brake / (gain + brake)), top), v0, v1)
    if peak <= 0.0:
        return 0.0
    ramps = (peak**2 - v0**2) / (2.0 * gain) + (peak**2 - v1**2) / (2.0 * brake)
    cruise = max(0.0, length - ramps) / peak
    return ((peak - v0) / gain + (peak - v1) / brake + cruise) * (1.0 - ROUNDING)


def _speed(end: Any) -> float | None:
    """[m/s], None where it is free."""
    if end.speed == "safe":
        return None
    return 0.0 if end.speed == "rest" else float(end.speed)
