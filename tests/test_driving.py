"""The simulation as stages: what is shown of the stops."""

from __future__ import annotations

import numpy as np
from report_case import warehouse

from systems.stops import ROWS, StopRecords
from verify.driving import SHOWN, closest_stops


def records(*ways: np.ndarray) -> StopRecords:
    """Stops along these ways (k, 2) [m]."""
    rows = [np.column_stack([np.zeros(len(way)), way, np.zeros((len(way), len(ROWS) - 3))]) for way in ways]
    return StopRecords(
        model="four_wheel",
        instant=np.arange(float(len(ways))),
        straightened=np.zeros(len(ways), dtype=bool),
        first=np.concatenate([[0], np.cumsum([len(way) for way in ways])]).astype(np.int64),
        rows=np.concatenate(rows) if rows else np.empty((0, len(ROWS))),
        compute_time=0.0,
    )


def test_the_stops_that_come_closest_are_shown_in_order():
    # ways along the bottom corridor, between the wall at y = 0 and the racks at 4 m: less y is closer
    ways = [np.array([[20.0, y], [21.0, y]]) for y in (1.9, 1.2, 1.5, 1.0, 1.8, 1.1, 1.7, 1.3)]
    shown = closest_stops(warehouse().problem, records(*ways))
    assert [way[0, 1] for way in shown] == [1.0, 1.1, 1.2, 1.3, 1.5, 1.7]
    assert len(shown) == SHOWN


def test_without_stops_none_are_shown():
    assert closest_stops(warehouse().problem, records()) == []
