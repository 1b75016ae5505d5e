"""What the planners tell beyond the result folder, in the form in which it is drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vnav_drake.plan import Trajectory

Array = NDArray[np.float64]

MOST_LINES = 2000  # of a graph that are drawn: more are one blue area, and half a megabyte


@dataclass(frozen=True, kw_only=True)
class GraphDrawing:
    """A speed graph, its edges as polylines of equally many points each; edges may share lines."""

    kind: str  # sampled, published
    nodes: Array  # (n, 2) [m]
    lines: Array  # (k, p, 2) [m]
    shown: int  # edges that the lines draw
    total: int  # edges of the graph


@dataclass(frozen=True, kw_only=True)
class ClassDrawing:
    """The optimal path of one homotopy class."""

    rank: int  # from 1
    name: str
    points: Array  # (n, 2) [m], along the path
    motion: Trajectory | None  # its fastest motion in the variational model
    iteration_times: Sequence[float] = ()  # [s], travel time after each Newton iteration
    residuals: Sequence[float] = ()  # of the optimality conditions after each Newton iteration


@dataclass(frozen=True, kw_only=True)
class SpeedGraphDrawing:
    """The graphs and the classes, best class first."""

    graphs: Sequence[GraphDrawing] = ()
    classes: Sequence[ClassDrawing] = ()


def share(count: int, most: int) -> NDArray[np.int64]:
    """At most `most` of the numbers 0 .. count - 1, evenly spread and always the same."""
    if count <= most:
        return np.arange(count)
    return np.linspace(0, count - 1, most).round().astype(np.int64)
