"""The cells and borders around a Voronoi node, by angle."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vnav_drake.voronoi import VoronoiDiagram

Array = NDArray[np.float64]

TURN = 2.0 * math.pi


@dataclass(frozen=True)
class Around:
    """Borders that leave a node, counter-clockwise; sector j lies between border j and border j + 1."""

    node: int
    border: tuple[int, ...]
    end: tuple[int, ...]  # 0 or 1: which end of the border is at the node
    angle: tuple[float, ...]  # [rad] direction in which it leaves
    cell: tuple[int, ...]  # of each sector

    def __len__(self) -> int:
        return len(self.border)

    def sector_of(self, cell: int, angle: float) -> int | None:
        """The sector of a cell; where it has several the one that holds `angle`, or the nearest one."""
        own = [j for j, c in enumerate(self.cell) if c == cell]
        return min(own, key=lambda j: self.outside(j, angle), default=None)

    def outside(self, sector: int, angle: float) -> float:
        """How far [rad] a direction lies outside a sector; zero inside."""
        width = (self.angle[(sector + 1) % len(self)] - self.angle[sector]) % TURN or TURN
        into = (angle - self.angle[sector]) % TURN
        return 0.0 if into <= width else min(into - width, TURN - into)

    def nearest_side(self, sector: int, angle: float) -> int:
        """The border of a sector, of its two, that is nearer to a direction."""
        other = (sector + 1) % len(self)
        return min((sector, other), key=lambda j: abs((angle - self.angle[j] + math.pi) % TURN - math.pi))


def around(diagram: VoronoiDiagram, node: int) -> Around:
    """The borders and cells around a node of the diagram."""
    border, end = diagram.incident(node)
    curves = diagram.curves.take(border)
    tangent = (
        curves.tangents(curves.span)[np.arange(len(border)), end] * np.where(end == 0, 1.0, -1.0)[:, None]
    )
    angle = np.arctan2(tangent[:, 1], tangent[:, 0])
    # left of a curve that leaves along its own direction is its left cell, else its right one
    left = diagram.cells[border, end]
    return Around(
        node,
        tuple(border.tolist()),
        tuple(end.tolist()),
        tuple(angle.tolist()),
        tuple(left.tolist()),
    )
