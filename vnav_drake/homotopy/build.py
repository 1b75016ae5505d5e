"""Gates of a world: one across every chain of Voronoi arcs that a homotopy class can depend on."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vnav_drake.homotopy.core import Core, find_core, pieces
from vnav_drake.homotopy.gates import Gates
from vnav_drake.homotopy.outlines import Outlines, obstacle_names
from vnav_drake.voronoi import LINEAR, VoronoiDiagram

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

TIE = 1e-7  # of the world's diameter: lengths this near are equal, far above rounding, far below a drawing
NARROW = 0.05  # of a chain's least distance: places wider by less are as narrow, whatever the drawing says
ASIDE = 0.1375  # part of the way from the narrowest place to the arc's end: no symmetry leads there


def build_gates(diagram: VoronoiDiagram, level: float) -> Gates:
    """Gates for paths that keep the distance `level` [m] to every feature.

    Parameters
    ----------
    diagram : of the world; any restriction of it will do.
    level : [m], not negative: robot radius and braking margin.

    Raises
    ------
    ValueError : `level` is negative or not finite.

    Notes
    -----
    Numbers, places and tokens of gates follow from the scenario's own order of obstacles and vertices, not
    from coordinates: moving, turning or mirroring a scenario changes none of them, save that a mirror may
    move a gate between two points, or swap the numbers of two gates, that are their own mirror images.
    """
    if not 0.0 <= level < np.inf:
        raise ValueError(f"level = {level!r}: must be finite and not negative [m]")
    part = diagram.restricted(level)
    core = find_core(part)
    outlines, tie = Outlines(part.world), TIE * part.world.diameter
    row, parameter = _places(part, core, outlines, tie)
    border = core.arcs[row]
    point = part.curves.take(border).points(parameter)
    feet = feet_of(part, border, point)
    passage = _passage(outlines, feet)
    first = np.take_along_axis(feet, np.where(passage.swapped, 1, 0)[:, None, None], axis=1)[:, 0]
    second = np.take_along_axis(feet, np.where(passage.swapped, 0, 1)[:, None, None], axis=1)[:, 0]
    across = second - first
    sideways = across[:, 0] * (point - first)[:, 1] - across[:, 1] * (point - first)[:, 0]
    size = np.hypot(across[:, 0], across[:, 1])
    sideways = sideways / np.where(size > 0.0, size, 1.0)
    order = np.lexsort(
        [
            *(_ranks(v, tie) for v in (sideways, core.least[core.chain[row]], *passage.position.T[::-1])),
            *passage.owners.T[::-1],
        ]
    )
    sides = pieces(core, row)
    against = np.diff(part.curves.span[border], axis=1)[:, 0] < 0.0
    sides = np.where(against[:, None], sides[:, ::-1], sides)
    feet = np.where(against[:, None, None], feet[:, ::-1], feet)
    return Gates(
        diagram=part,
        border=border[order],
        parameter=parameter[order],
        point=point[order],
        feet=feet[order],
        tokens=_tokens(obstacle_names(part.world), passage.owners[order]),
        sides=sides[order],
        anticlockwise=np.where(passage.swapped != against, -1, 1)[order],
    )


def feet_of(diagram: VoronoiDiagram, border: Indices, points: Array) -> Array:
    """Feet (n, 2, 2) [m] of points (n, 2) on borders: on the left feature and on the right one."""
    world, edges = diagram.world, len(diagram.world.edges)
    feature = diagram.feature(diagram.cells[border])
    is_edge = feature < edges
    edge = (
        world.edges[np.where(is_edge, feature, 0)] if edges else np.zeros((*feature.shape, 2), dtype=np.int64)
    )
    a, along = world.vertices[edge[..., 0]], world.vertices[edge[..., 1]] - world.vertices[edge[..., 0]]
    square = np.sum(along * along, axis=-1)
    part = np.sum((points[:, None] - a) * along, axis=-1) / np.where(square > 0.0, square, 1.0)
    foot = a + np.clip(part, 0.0, 1.0)[..., None] * along
    vertex = world.vertices[np.where(is_edge, 0, feature - edges)]
    return np.where(is_edge[..., None], foot, vertex)


@dataclass(frozen=True)
class _Passage:
    """What two feet stand on, the obstacle that comes first in the scenario first (the boundary last)."""

    owners: Indices  # (n, 2)
    position: Array  # (n, 2) [m], along their outlines
    swapped: NDArray[np.bool_]  # (n,) whether the first one is on the right


def _passage(outlines: Outlines, feet: Array) -> _Passage:
    flat = feet.reshape(-1, 2)
    owner = outlines.owner(flat)
    position = outlines.position(owner, flat).reshape(-1, 2)
    owners = owner.reshape(-1, 2)
    same = owners[:, 0] == owners[:, 1]
    swapped = (owners[:, 0] > owners[:, 1]) | (same & (position[:, 0] > position[:, 1]))
    flip = swapped[:, None]
    return _Passage(
        np.where(flip, owners[:, ::-1], owners), np.where(flip, position[:, ::-1], position), swapped
    )


def _places(part: VoronoiDiagram, core: Core, outlines: Outlines, tie: float) -> tuple[Indices, Array]:
    """Row of the core and parameter of each gate: beside the narrowest place of its chain.

    Where several arcs of a chain are equally narrow (NARROW), the longest of them, and of equally long ones
    that whose feet come first in the scenario.
    """
    curves = part.curves.take(core.arcs)
    limit = (1.0 + NARROW) * core.least[core.chain] + tie
    row = np.flatnonzero((curves.least_distance <= limit) & ~core.gateless[core.chain])
    curves, border, limit = curves.take(row), core.arcs[row], limit[row]
    low, high = curves.span.min(axis=1), curves.span.max(axis=1)
    widest = np.maximum(curves.distance(high), curves.distance(low))
    steady = (curves.kind == LINEAR) & (widest <= limit)
    narrow = np.where(steady, curves.middle, curves.least_distance_at)
    passage = _passage(outlines, feet_of(part, border, curves.points(curves.middle)))
    order = np.lexsort(
        [
            *(_ranks(v, tie) for v in passage.position.T[::-1]),
            *passage.owners.T[::-1],
            _ranks(-curves.length, tie),
            core.chain[row],
        ]
    )
    _, first = np.unique(core.chain[row][order], return_index=True)
    pick = order[first]
    row, border, curves = row[pick], border[pick], curves.take(pick)
    low, high, narrow = low[pick], high[pick], narrow[pick]
    reach = ASIDE * np.maximum(high - narrow, narrow - low)
    up = high - narrow > narrow - low
    even = np.abs((high - narrow) - (narrow - low)) <= tie
    up = np.where(even, _onward(part, outlines, border, narrow - reach, narrow + reach, tie), up)
    return row, np.where(up, narrow + reach, narrow - reach)


def _onward(
    part: VoronoiDiagram, outlines: Outlines, border: Indices, less: Array, more: Array, tie: float
) -> NDArray[np.bool_]:
    """Whether the feet at parameter `more` lie further along the outlines than those at `less`.

    Further along the first outline, else along the second; between two points, with the first on the left.
    """
    curves = part.curves.take(border)
    before = _passage(outlines, feet_of(part, border, curves.points(less)))
    after = _passage(outlines, feet_of(part, border, curves.points(more)))
    around = outlines.circumference(after.owners.reshape(-1)).reshape(-1, 2)
    step = after.position - before.position
    step = np.where(np.abs(step) > 0.5 * around, -step, step)
    steady = (before.owners == after.owners) & (np.abs(step) > tie)
    return np.where(steady[:, 0], step[:, 0] > 0.0, np.where(steady[:, 1], step[:, 1] > 0.0, ~after.swapped))


def _ranks(values: Array, tie: float) -> Indices:
    """Order (n,) of numbers, equal for those that are nearer than `tie` to the next."""
    order = np.argsort(values, kind="stable")
    rank = np.zeros(len(values), dtype=np.int64)
    rank[order[1:]] = np.cumsum(np.diff(values[order]) > tie)
    return rank


def _tokens(names: tuple[str, ...], owners: Indices) -> tuple[str, ...]:
    """ "A/B" for a passage between A and B, "A/B.1", "A/B.2" for the passages of a pair that has several."""
    plain = [f"{names[i]}/{names[j]}" for i, j in owners.tolist()]
    many, seen = Counter(plain), Counter[str]()
    tokens = []
    for token in plain:
        seen[token] += 1
        tokens.append(f"{token}.{seen[token]}" if many[token] > 1 else token)
    return tuple(tokens)
