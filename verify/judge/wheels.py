"""Does the vehicle keep its wheels on the floor? From recorded wheel loads, slip and tilt."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# [rad], of the body's axis from the plumb line: beyond what wheels or springs give
FALLEN = math.radians(30.0)
UNLOADED = 1e-3  # of the load at rest: wheels that carry less are in the air
SLIDING = 0.05  # [m/s], of a contact patch over the floor: rolling wheels creep by some mm/s
LASTING = 0.05  # [s], that a wheel slides or is in the air; less is the chatter of a contact
# [s], that a side or an axle is in the air. A tall body that sways from one bend into the next takes the
# weight off a side for half a swing, about 0.1 s, and by a millimetre or two; what tips stays up.
TIPPING = 0.2


def lifted(load: Array, t: Array, first: NDArray[np.int64], duration: float = LASTING) -> NDArray[np.bool_]:
    """(m,) rows at which what carries `load`, over its share at rest, is in the air for `duration` [s].

    See `lasting`.
    """
    return lasting(load <= UNLOADED, t, first, duration)


def slid(slip: Array, t: Array, first: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(m,) rows at which a wheel slides for `LASTING` or longer; see `lasting`."""
    return lasting(slip > SLIDING, t, first, LASTING)


def lasting(
    flag: NDArray[np.bool_], t: Array, first: NDArray[np.int64], duration: float
) -> NDArray[np.bool_]:
    """Rows within a stretch of successive flagged rows that spans at least `duration`.

    Parameters
    ----------
    flag : (m,); t : (m,) [s]
    first : (n + 1,) indices: stretches end where the rows first[i]:first[i + 1] do.
    duration : [s], from the first to the last row of a stretch.

    Returns
    -------
    (m,) bool
    """
    begins, ends = flag.copy(), flag.copy()
    begins[1:] &= ~flag[:-1]
    begins[first[:-1]] = flag[first[:-1]]
    ends[:-1] &= ~flag[1:]
    ends[first[1:] - 1] = flag[first[1:] - 1]
    start, last = np.flatnonzero(begins), np.flatnonzero(ends)
    # t goes by milliseconds and its differences round: a nanosecond decides nothing
    long = t[last] - t[start] >= duration - 1e-9
    change = np.zeros(len(flag) + 1, dtype=np.int64)
    change[start[long]] += 1
    change[last[long] + 1] -= 1
    return np.cumsum(change)[:-1] > 0
