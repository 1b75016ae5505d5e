"""The least time of a motion of known least length, with given end speeds and a drive with limits."""

from __future__ import annotations

import math
from typing import Any

from verify.judge.limits import Limits

ROUNDING = 1e-12  # relative, that the time is taken lower: far more than the roundings of its sum
HALVINGS = 120  # of the bracket of the peak speed: down to neighbouring doubles


def drive_time(limits: Limits, start: Any, goal: Any, length: float) -> float:
    """Least time [s] of any motion at least `length` [m] long; zero where nothing limits it.

    Derived. Along a path speeds are those of a double integrator: dv/dt from -a_b to a_max, v at most v_max.
    Let p be the greatest speed of a motion. Between it and an end with a given speed v it has a ramp, which
    takes (p - v)/a at least, and goes (p^2 - v^2)/(2 a) in that time, as the integral of v dv / a; an end
    with the speed `safe` may have p itself, and no ramp. What is left of the length takes 1/p a metre at
    least. So the time is at least

        T(p) = sum of (p - v)/a + (length - way(p))/p,    way(p) = sum of (p^2 - v^2)/(2 a),

    whose slope in p is (way(p) - length)/p^2: it is least where the ramps alone are the length, which is
    found by bisection as way rises, or at v_max where they are shorter there. Where they are longer even for
    the least p, the greater of the given speeds, so is the motion, and no less than the ramps is needed. T
    grows with the length, so it bounds longer motions.
    """
    ramps = [
        (min(speed, limits.speed), rate)
        for end, rate in ((start, limits.acceleration), (goal, limits.braking))
        if (speed := _speed(end)) is not None
    ]
    if not ramps and math.isinf(limits.speed):
        return 0.0

    def way(peak: float) -> float:
        return sum((peak - v) * (peak + v) / (2.0 * rate) for v, rate in ramps)

    low = max((v for v, _ in ramps), default=limits.speed)
    # The way of any one ramp to this speed is the length.
    high = min([limits.speed, *(math.sqrt(v * v + 2.0 * rate * length) for v, rate in ramps)])
    peak = high = max(low, high)
    if way(high) > length:
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if way(middle) < length else (low, middle)
        peak = low
    if peak <= 0.0:
        return 0.0
    cruise = max(0.0, length - way(peak)) / peak
    return (sum((peak - v) / rate for v, rate in ramps) + cruise) * (1.0 - ROUNDING)


def _speed(end: Any) -> float | None:
    """[m/s], None where it is free."""
    if end.speed == "safe":
        return None
    return 0.0 if end.speed == "rest" else float(end.speed)
