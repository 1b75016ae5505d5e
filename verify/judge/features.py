"""What stands in the way, one side at a time, from the scenario's raw numbers: nothing united or cut."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

BOUNDARY = -1  # owner of the boundary's sides


@dataclass(frozen=True, eq=False)
class Features:
    """Segments widened by a radius: a side or a wall has radius 0, a circle is a point with its radius.

    Each lies in the closed set that blocks the way, so the clearance is at most the distance to it.
    """

    table: Array  # (f, 5) [m]: ends ax, ay, bx, by, radius; the boundary's sides, then obstacle by obstacle
    owner: NDArray[np.int64]  # (f,) index of the obstacle in the file, `BOUNDARY` for the boundary
    side: NDArray[np.int64]  # (f,) number of the side within its owner: from vertex `side` to the next
    boundary: Array  # (n, 2) [m]
    polygons: Mapping[int, Array]  # by index of the obstacle: vertices (k, 2) [m], three or more
    circles: frozenset[int]  # indices of obstacles given as circles
    names: tuple[str, ...]  # of the obstacles, empty where none was given

    @classmethod
    def from_spec(cls, world: Any) -> Self:
        """From the `world` section of a scenario as parsed."""
        boundary = np.array(world.boundary, dtype=float)
        rows, owners = [_sides(boundary)], [BOUNDARY]
        polygons, circles = {}, set()
        for index, obstacle in enumerate(world.obstacles):
            owners.append(index)
            if obstacle.circle is not None:
                x, y = obstacle.circle.center
                rows.append(np.array([[x, y, x, y, obstacle.circle.radius]], dtype=float))
                circles.add(index)
                continue
            vertices = np.array(obstacle.vertices, dtype=float)
            rows.append(_sides(vertices))
            if len(vertices) >= 3:
                polygons[index] = vertices
        counts = [len(part) for part in rows]
        return cls(
            table=np.concatenate(rows),
            owner=np.repeat(owners, counts).astype(np.int64),
            side=np.concatenate([np.arange(count) for count in counts]),
            boundary=boundary,
            polygons=polygons,
            circles=frozenset(circles),
            names=tuple(obstacle.name for obstacle in world.obstacles),
        )

    def keys(self, row: int) -> Iterator[str]:
        """Where in the scenario file the five numbers of a row stand."""
        owner, side = int(self.owner[row]), int(self.side[row])
        if owner in self.circles:
            here = f"world.obstacles[{owner}].circle"
            yield from (f"{here}.center[{i}]" for i in (0, 1, 0, 1))
            yield f"{here}.radius"
            return
        place = "world.boundary" if owner == BOUNDARY else f"world.obstacles[{owner}].vertices"
        count = int((self.owner == owner).sum())
        following = (side + 1) % count if count > 1 else int(self._is_wall(row))
        yield from (f"{place}[{vertex}][{i}]" for vertex in (side, following) for i in (0, 1))
        yield f"{place}: radius"

    def _is_wall(self, row: int) -> bool:
        return bool((self.table[row, :2] != self.table[row, 2:4]).any())


def _sides(vertices: Array) -> Array:
    """Rows of the table for a point (1 vertex), a wall (2) or a closed polygon (3 or more)."""
    ends = np.hstack([vertices, np.roll(vertices, -1, axis=0), np.zeros((len(vertices), 1))])
    return ends[:1] if len(vertices) == 2 else ends
