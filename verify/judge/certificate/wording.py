"""How faults are told: each kind once, with the first places where it occurs."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.judge.certificate.file import CertificateFile

MOST_PLACES = 5


def listed(kind: str, faults: NDArray[Any], tell: Callable[[Any], str]) -> list[str]:
    """One line for all faults of a kind, with the first places as `tell` words them; none without faults."""
    if not len(faults):
        return []
    text = f"{kind} {'; '.join(tell(fault) for fault in faults[:MOST_PLACES])}"
    more = len(faults) - MOST_PLACES
    return [f"{text}; and {more} more" if more > 0 else text]


def place_of(file: CertificateFile, triangle: NDArray[np.int64]) -> str:
    """A triangle (3,), by the middle of its corners in metres."""
    x, y = file.points[triangle].mean(axis=0)
    return f"the triangle around ({x:.9g}, {y:.9g}) m"


def side_of(file: CertificateFile, start: int, end: int) -> str:
    """A side, by its ends in metres."""
    (x0, y0), (x1, y1) = file.points[[start, end]]
    return f"the side from ({x0:.9g}, {y0:.9g}) to ({x1:.9g}, {y1:.9g}) m"
