"""stops.npz as a file: the recorded emergency stops, read strictly. What they show is judged elsewhere."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify import evidence
from verify.evidence import EvidenceError
from verify.judge.archive import TEXT, Layout, first_fault, read_archive, shape_faults

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

SCHEMA = 1
MOST_STOPS = 4000  # two at each of the most instants a scenario may ask for
LEAST_ROWS = 2  # of one stop

_LAYOUT: Layout = {
    "schema": ("<i8", ()),
    "model": (TEXT, ()),
    "instant": ("<f8", ("n",)),
    "straightened": ("|b1", ("n",)),
    "first": ("<i8", ("n + 1",)),  # a length of its own: see `_layout_for`
    **dict.fromkeys(("t", "x", "y", "heading", "v", "tilt", "least_load", "slip"), ("<f8", ("m",))),
}
_NOT_NEGATIVE = ("instant", "t", "tilt", "least_load", "slip")


@dataclass(frozen=True, eq=False)
class StopsFile:
    """The recorded stops, well-formed: types, shapes, every stop with its rows, finite numbers.

    There may be none: of a vehicle that fell before the first. Whether that is right is judged elsewhere.
    """

    model: str  # of the vehicle: four_wheel, single_track
    instant: Array  # (n,) [s], at which each stop is commanded, on the clock of simulation.csv
    straightened: NDArray[np.bool_]  # (n,) wheels straightened, else steering held
    first: Rows  # (n + 1,) stop i has the rows first[i]:first[i + 1]
    t: Array  # (m,) [s] since the instant
    x: Array  # (m,) [m], centre of mass
    y: Array  # (m,) [m]
    heading: Array  # (m,) [rad], of the body
    v: Array  # (m,) [m/s], negative backwards
    tilt: Array  # (m,) [rad], of the body's axis from the plumb line
    least_load: Array  # (m,) least wheel (single track: axle) load over its share at rest
    slip: Array  # (m,) [m/s], greatest of a wheel over the floor

    def __len__(self) -> int:
        """How many stops."""
        return len(self.instant)

    def name_of(self, stop: int) -> str:
        """A stop in words."""
        how = "wheels straightened" if self.straightened[stop] else "steering held"
        return f"stop {stop} (at {self.instant[stop]:.3f} s, {how})"

    @cached_property
    def points(self) -> Array:
        """(m, 2) [m]"""
        return np.column_stack([self.x, self.y])

    @cached_property
    def speed(self) -> Array:
        """(m,) [m/s], whichever way it goes."""
        return np.abs(self.v)

    @cached_property
    def owner(self) -> Rows:
        """(m,) index of the stop that each row belongs to."""
        return np.repeat(np.arange(len(self)), np.diff(self.first))

    @cached_property
    def inner(self) -> Rows:
        """Rows that another one of the same stop follows."""
        return np.delete(np.arange(len(self.t)), self.first[1:] - 1)

    def most(self, values: Array) -> Array:
        """(n,) greatest over the rows of each stop."""
        return np.asarray(np.maximum.reduceat(values, self.first[:-1]))

    def any(self, flag: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """(n,) whether any row of each stop is flagged."""
        return np.asarray(np.logical_or.reduceat(flag, self.first[:-1]))

    def total(self, pieces: Array) -> Array:
        """(n,) sum over the pieces that begin at the `inner` rows of each stop."""
        return np.bincount(self.owner[self.inner], weights=pieces, minlength=len(self)).astype(float)


def read_stops(folder: Path) -> StopsFile | None:
    """Read stops.npz of a result folder; None when there is none.

    Raises
    ------
    EvidenceError : truncated, not such an archive, an array missing, unknown, of another type or shape,
        rows that belong to no stop, a number not finite or out of range.
    """
    arrays = read_archive(folder, evidence.STOPS, _LAYOUT)
    if arrays is None:
        return None
    wrong = shape_faults(arrays, _layout_for(arrays))
    wrong = wrong or _row_faults(arrays) or _number_faults(arrays)
    if wrong:
        raise EvidenceError(*(f"{evidence.STOPS}: {text}" for text in wrong))
    columns = {field.name: arrays[field.name] for field in fields(StopsFile) if field.name != "model"}
    return StopsFile(model=str(arrays["model"]), **columns)


def _layout_for(arrays: Mapping[str, NDArray[Any]]) -> Layout:
    """The layout with the length of `first`, which is one more than that of `instant`."""
    return {**_LAYOUT, "first": ("<i8", (arrays["instant"].size + 1,))}


def _row_faults(arrays: Mapping[str, NDArray[Any]]) -> list[str]:
    """Stops without rows of their own, too many or none."""
    first, rows, count = arrays["first"], len(arrays["t"]), len(arrays["instant"])
    if count > MOST_STOPS:
        return [f"instant: {count} stops, expected at most {MOST_STOPS}"]
    if first[0] != 0 or first[-1] != rows:
        return [f"first: begins at {first[0]} and ends at {first[-1]}, expected 0 and {rows}"]
    # compared, not subtracted: differences of numbers this large wrap around
    good = (first[1:] > first[:-1]) & (first[:-1] >= 0) & (first[1:] <= rows)
    if good.all():
        good = np.diff(first) >= LEAST_ROWS
    return first_fault(
        "end of stop ", first[1:], good, f"a stop has {LEAST_ROWS} rows or more, after the one before"
    )


def _number_faults(arrays: Mapping[str, NDArray[Any]]) -> list[str]:
    """Numbers that are not finite or out of range, with the first of them in each array."""
    wrong = first_fault("schema", arrays["schema"], arrays["schema"] == SCHEMA, f"must be {SCHEMA}")
    flags = arrays["straightened"].view(np.uint8)
    wrong += first_fault("straightened", flags, flags <= 1, "must be 0 or 1")
    for key, (dtype, _) in _LAYOUT.items():
        if dtype == "<f8":
            sane = np.abs(arrays[key]) <= evidence.MAX_NUMBER  # false where not a number
            wrong += first_fault(key, arrays[key], sane, "is not finite or absurd")
            if key in _NOT_NEGATIVE and sane.all():
                wrong += first_fault(key, arrays[key], arrays[key] >= 0.0, "must not be negative")
    return wrong
