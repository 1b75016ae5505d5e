"""A path through the speed graph: what the search hands to the optimum of a class."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


@dataclass(frozen=True)
class Route:
    """Stops on borders of proximity cells, and how the path runs from each to the next.

    Consecutive pieces along one border in one direction are a single leg.
    """

    time: float  # [s]
    word: tuple[int, ...]  # reduced word of gates, see `vnav_drake.homotopy`
    point: Array  # (m, 2) [m] of the stops
    border: Indices  # (m,) row of the restricted diagram's curves; -1 at start and goal inside a cell
    parameter: Array  # (m,) [m] u on that curve; at an end that lies on a border too
    cell: Indices  # (m - 1,) cell in which each leg runs; -1: along a border
    along: Indices  # (m - 1,) border followed where `cell` is -1, else -1
    turn: Indices  # (m - 1,) around an isolated point +1 anticlockwise, -1 clockwise; 0 elsewhere

    @property
    def stops(self) -> int:
        """Start and goal included."""
        return len(self.border)
