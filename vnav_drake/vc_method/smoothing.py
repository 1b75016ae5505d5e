"""Which circle rounds each corner of a road, and the smooth path that comes of it (Manor 2015, sec. 2.6)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vnav_drake.biarcs import biarcs
from vnav_drake.plan import Path
from vnav_drake.problem import PlanningError, Problem
from vnav_drake.vc_method.fillets import Fillets, fillets
from vnav_drake.vc_method.road import Road
from vnav_drake.voronoi.paths import route_path

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]

GENTLE = 1e-3  # [rad]: a smaller turn is rounded by a biarc, whose ends are exact for any turn
GENTLE_REACH = 0.02  # [m] of it on either side
SMALLEST = 1e-4  # [m]: least radius tried
LARGEST = 4.0  # times the radius wanted: a stretch that must lie within the arc may need a larger one
_FREED = 3  # corners from an end that one arc may replace
_SHARINGS = 3  # times that neighbours share again the road between them
_GRID = 40  # radii tried at once
_BISECTIONS = 10  # of the ratio between two of them, which leaves 3e-4
_SHARE = 0.999  # of a run of road that two arcs share, so that a piece of it is left between them


@dataclass(frozen=True)
class Corners:
    """Corners of one road with the room beside them; rows in order of travel."""

    stretch: Array  # (n, 2) [m], arc lengths that the arc must span
    turn: Array  # (n,) [rad], left positive
    free: Mask  # (n, 2) begins at the start, or ends at the goal, with any heading

    def __len__(self) -> int:
        return len(self.turn)

    def runs(self, road: Road) -> Array:
        """(n + 1,) [m], lengths of the smooth road before, between and behind the corners."""
        marks = np.concatenate([[0.0], self.stretch.reshape(-1), [road.length]])
        return np.asarray(marks[1::2] - marks[::2])

    @property
    def gentle(self) -> Mask:
        """(n,) kinks too slight for a circle to be found exactly."""
        slight = (self.stretch[:, 0] == self.stretch[:, 1]) & (np.abs(self.turn) < GENTLE)
        return slight & ~self.free.any(axis=1)

    def take(self, index: Indices | Mask) -> Corners:
        """Some rows."""
        return Corners(self.stretch[index], self.turn[index], self.free[index])

    @classmethod
    def join(cls, one: Corners, other: Corners) -> Corners:
        """Both, in order of travel."""
        stretch = np.concatenate([one.stretch, other.stretch])
        order = np.argsort(stretch[:, 0], kind="stable")
        turn, free = np.concatenate([one.turn, other.turn]), np.concatenate([one.free, other.free])
        return cls(stretch[order], turn[order], free[order])


@dataclass(frozen=True)
class _Step:
    """The arcs for radii wanted (n,) [m] in rooms (n, 2) [m]."""

    radius: Array
    room: Array
    arcs: Fillets


@dataclass(frozen=True)
class Rounding:
    """Corners with the arcs chosen; gentle ones reach `reach` [m] to either side."""

    road: Road
    corners: Corners
    arcs: Fillets  # (n,), of no meaning for gentle corners
    reach: Array  # (n,) [m], zero unless gentle
    steps: tuple[_Step, ...]  # how the arcs came about

    @property
    def ends(self) -> Array:
        """(n, 2) [m], arc lengths on the road between which it is left."""
        stretch, reach = self.corners.stretch, self.reach[:, None] * np.array([-1.0, 1.0])
        of_arcs = np.column_stack([self.arcs.begin, self.arcs.end])
        return np.where(self.corners.gentle[:, None], stretch + reach, of_arcs)


def smallest_radius(problem: Problem, speed: Array) -> Array:
    """r_min [m] at each speed [m/s] for steering, sliding, tip-over and reserve (Manor 2015, Lemma A.1)."""
    limit = problem.lateral_limit
    steering = 1.0 / problem.robot.max_curvature
    slide = np.square(speed) / limit if limit > 0.0 else np.where(speed > 0.0, np.inf, 0.0)
    return np.asarray(np.maximum(steering, slide))


def corners_of(problem: Problem, road: Road) -> Corners:
    """The corners of a road; those too near for an arc each become one where one arc fits around them."""
    corners = _bound(*road.obstructions(problem.robot.max_curvature))
    steering = 1.0 / problem.robot.max_curvature
    while len(corners) > 1:
        arcs = _largest(
            problem, road, corners, np.full(len(corners), steering), _rooms(corners, road), rough=True
        )
        good = arcs.fits & (arcs.radius >= steering) | corners.gentle
        before, behind = _reaches(corners, arcs).T
        need = np.where(corners.gentle | ~arcs.fits, 0.0, behind)[:-1]
        need = need + np.where(corners.gentle | ~arcs.fits, 0.0, before)[1:]
        near = corners.runs(road)[1:-1] < np.maximum(need, 2.0 * steering * ~(good[1:] & good[:-1]))
        merged = _merged(problem, road, corners, np.flatnonzero(near))
        if merged is None:
            break
        corners = merged
    for side, end in ((0, problem.start), (1, problem.goal)):
        if end.heading is None:
            corners = _freed(problem, road, corners, side)
    return corners


def round_corners(
    problem: Problem, road: Road, corners: Corners, radius: Array, last: Rounding | None = None
) -> Rounding:
    """Arcs of the radii wanted (n,) [m], smaller ones where those do not fit, never none.

    A stretch that no arc spans has `fits` unset: it must give way to the kinks in it (`kinks_only`).
    `last` is a rounding of the same corners, of which all that is asked for again is kept.
    """
    room = _rooms(corners, road)
    steps: list[_Step] = []
    for k in range(_SHARINGS + 1):
        known = last.steps[k] if last is not None and k < len(last.steps) else None
        before = steps[-1] if steps else None
        changed = np.ones(len(corners), dtype=bool)
        arcs = known.arcs if known is not None else (before.arcs if before is not None else None)
        if known is not None:
            changed = (known.radius != radius) | np.any(known.room != room, axis=1)
        elif before is not None:
            changed = np.any(before.room != room, axis=1)
        rows = np.flatnonzero(changed)
        some = _largest(problem, road, corners.take(rows), radius[rows], room[rows])
        arcs = some if arcs is None else arcs.replaced(rows, some)
        steps.append(_Step(radius, room, arcs))
        tighter = _shared(problem, road, corners, arcs, room)  # neighbours share the road between them
        if np.array_equal(tighter, room):
            break
        room = tighter
    reach = np.where(corners.gentle, np.minimum(GENTLE_REACH, room.min(axis=1) / 3.0), 0.0)
    return Rounding(road, corners, steps[-1].arcs, reach, tuple(steps))


def kinks_only(road: Road, corners: Corners, failed: Mask) -> Corners:
    """Corners where those that `failed` are replaced by the kinks within them."""
    stretch, turn = road.obstructions(np.inf)
    place = stretch[:, 0]
    at = np.searchsorted(corners.stretch[:, 0], place, side="right") - 1
    inside = (at >= 0) & failed[at] & (place <= corners.stretch[at, 1])
    return Corners.join(corners.take(~failed), _bound(stretch[inside], turn[inside]))


def smooth_path(problem: Problem, rounding: Rounding) -> tuple[Path, Indices]:
    """The path, and the corner of each of its pieces (-1: on the road).

    Raises
    ------
    PlanningError : neighbouring arcs overlap, which would mean that they were not made to share the road.
    """
    road, ends = rounding.road, rounding.ends
    parts: list[tuple[Array, Array, Array, Array]] = []
    owner: list[Indices] = []
    marks = np.concatenate([[0.0], ends.reshape(-1), [road.length]])
    crossed = np.flatnonzero(np.diff(marks) < 0.0)
    if len(crossed):
        x, y = road.at(marks[crossed[:1]], after=False)[0][0]
        raise PlanningError(f"arcs of neighbouring corners overlap near ({x:.3f}, {y:.3f}) m")
    for i in range(len(ends) + 1):
        curves = road.between(float(marks[2 * i]), float(marks[2 * i + 1]))
        if len(curves):
            run = route_path(curves, curves.ends[0, 0], curves.ends[-1, 1])
            start = np.column_stack([run.x, run.y])[:-1]
            parts.append((start, run.heading, run.curvature, run.piece_length))
            owner.append(np.full(len(start), -1))
        if i < len(ends):
            parts.append(
                _gentle_turn(road, ends[i]) if rounding.corners.gentle[i] else _arc(rounding.arcs, i)
            )
            owner.append(np.full(len(parts[-1][1]), i))
    points, heading, bend, length = (np.concatenate(column) for column in zip(*parts, strict=True))
    points = np.concatenate([points, problem.goal.point[None]])
    points[0] = problem.start.point
    jump = heading[1:] - (heading + bend * length)[:-1]
    turns = np.concatenate([[0.0], np.cumsum(np.rint(jump / (2.0 * np.pi)))])
    path = Path(points[:, 0], points[:, 1], heading - 2.0 * np.pi * turns, bend, length)
    return path, np.concatenate(owner)


def _arc(arcs: Fillets, i: int) -> tuple[Array, Array, Array, Array]:
    side = np.sign(arcs.turn[[i]])
    bend, length = side / arcs.radius[[i]], np.abs(arcs.turn[[i]]) * arcs.radius[[i]]
    return arcs.point[[i]], arcs.heading[[i]], bend, length


def _gentle_turn(road: Road, ends: Array) -> tuple[Array, Array, Array, Array]:
    x, p, _ = road.at(ends[:1], after=False)
    y, q, _ = road.at(ends[1:], after=True)
    return biarcs(np.concatenate([x, y]), np.concatenate([p, q]))


def _rooms(corners: Corners, road: Road) -> Array:
    """(n, 2) [m], all the smooth road before and behind each corner."""
    runs = corners.runs(road)
    return np.column_stack([runs[:-1], runs[1:]])


def _shared(problem: Problem, road: Road, corners: Corners, arcs: Fillets, room: Array) -> Array:
    """Room (n, 2) [m] where two arcs want more than the road between them: first what steering needs."""
    runs = corners.runs(road)[1:-1] * _SHARE
    gentle = corners.gentle
    want = _reaches(corners, arcs)
    want[gentle] = GENTLE_REACH
    steering = 1.0 / problem.robot.max_curvature
    # the tangent length goes with the radius, about
    least = want * np.minimum(1.0, steering / np.maximum(arcs.radius, SMALLEST))[:, None]
    left, right, need_left, need_right = want[:-1, 1], want[1:, 0], least[:-1, 1], least[1:, 0]
    crowded = left + right > runs
    need, more = need_left + need_right, left + right - need_left - need_right
    spare = np.maximum(runs - need, 0.0)
    share = need_left + spare * (left - need_left) / np.where(more > 0.0, more, 1.0)
    share = np.where(need > runs, runs * need_left / np.where(need > 0.0, need, 1.0), share)
    out = room.copy()
    out[:-1, 1] = np.where(crowded, np.minimum(room[:-1, 1], share), room[:-1, 1])
    out[1:, 0] = np.where(crowded, np.minimum(room[1:, 0], runs - share), room[1:, 0])
    return out


def _largest(
    problem: Problem, road: Road, corners: Corners, radius: Array, room: Array, *, rough: bool = False
) -> Fillets:
    """Arcs of the radii wanted, else of the largest below that fits, else of the least above.

    `rough` ones are of the nearest radii tried, which is enough to know on which side of the wanted ones.
    """
    level = problem.robot.radius + problem.braking.margin

    def arcs_of(rows: Indices, size: Array) -> Fillets:
        return fillets(
            problem.world,
            road,
            corners.stretch[rows],
            corners.turn[rows],
            corners.free[rows],
            size,
            room[rows],
            level,
        )

    every = np.arange(len(corners))
    wanted = np.where(np.isfinite(radius), radius, 1.0 / problem.robot.max_curvature)
    best = arcs_of(every, wanted)
    rows = np.flatnonzero(~best.fits & ~corners.gentle)
    if len(rows) == 0:
        return best
    top = wanted[rows, None]
    below = top * (SMALLEST / top) ** np.linspace(1.0, 0.0, _GRID)
    above = top * LARGEST ** np.linspace(0.0, 1.0, _GRID // 4 + 1)[1:]
    grid = np.concatenate([below, above], axis=1)
    tried = arcs_of(np.repeat(rows, grid.shape[1]), grid.reshape(-1))
    fits = tried.fits.reshape(grid.shape)
    last_below = _GRID - 1 - np.argmax(fits[:, _GRID - 1 :: -1], axis=1)
    first_above = _GRID + np.argmax(fits[:, _GRID:], axis=1)
    some_below, some_above = fits[:, :_GRID].any(axis=1), fits[:, _GRID:].any(axis=1)
    steering = 1.0 / problem.robot.max_curvature
    pick = np.arange(len(rows)), np.where(some_below, last_below, first_above)
    enough = grid[pick] >= steering
    pick = pick[0], np.where(some_above & ~(some_below & enough), first_above, pick[1])
    found = np.flatnonzero(some_below | some_above)
    rows, pick = rows[found], (pick[0][found], pick[1][found])
    best = best.replaced(rows, tried.take(pick[0] * grid.shape[1] + pick[1]))
    # from the last that fits towards the radius wanted, where the next one does not fit
    good = grid[pick]
    inward = np.where(pick[1] < _GRID, pick[1] + 1, np.maximum(pick[1] - 1, 0))
    bad = grid[pick[0], inward]
    for _ in range(0 if rough else _BISECTIONS):
        middle = np.sqrt(good * bad)
        arcs = arcs_of(rows, middle)
        good, bad = np.where(arcs.fits, middle, good), np.where(arcs.fits, bad, middle)
        best = best.replaced(rows[arcs.fits], arcs.take(arcs.fits))
    return best


def _merged(problem: Problem, road: Road, corners: Corners, near: Indices) -> Corners | None:
    """Corners i and i + 1 as one for those i in `near` where one arc fits; None where none does."""
    if len(near) == 0:
        return None
    steering = 1.0 / problem.robot.max_curvature
    stretch = np.column_stack([corners.stretch[near, 0], corners.stretch[near + 1, 1]])
    between = corners.runs(road)[near + 1]
    turn = corners.turn[near] + corners.turn[near + 1] + _bend(road, corners, near, between)
    pair = _bound(stretch, turn)
    room = np.column_stack([corners.runs(road)[near], corners.runs(road)[near + 2]])
    arcs = _largest(problem, road, pair, np.full(len(near), steering), room, rough=True)
    good = arcs.fits & (arcs.radius >= steering * (1.0 - 1e-9))
    taken = np.zeros(len(corners) + 1, dtype=bool)
    rows = []
    for k in np.flatnonzero(good):
        i = int(near[k])
        if not taken[i] and not taken[i + 1]:
            taken[i], taken[i + 1] = True, True
            rows.append(k)
    if not rows:
        return None
    return Corners.join(corners.take(~taken[:-1]), pair.take(np.array(rows)))


def _freed(problem: Problem, road: Road, corners: Corners, side: int) -> Corners:
    """The first (side 0) or last corners as one arc from the start (to the goal), where they do not fit else.

    The leg between an end and its Voronoi arc is often too short to turn from it; the heading at the end is
    free, so an arc through the end alone can do.
    """
    steering = 1.0 / problem.robot.max_curvature
    count = min(len(corners), _FREED)
    if count == 0:
        return corners
    arcs = _largest(
        problem, road, corners, np.full(len(corners), steering), _rooms(corners, road), rough=True
    )
    shared = _shared(problem, road, corners, arcs, _rooms(corners, road))
    narrow = np.any(shared < np.minimum(_rooms(corners, road), _reaches(corners, arcs)) - 1e-9, axis=1)
    bad = ~(arcs.fits & (arcs.radius >= steering * (1.0 - 1e-9))) & ~corners.gentle | narrow
    near = np.arange(count) if side == 0 else len(corners) - 1 - np.arange(count)
    if not bad[near[0]]:
        return corners
    runs = corners.runs(road)
    far = np.repeat(near, 2)
    length = np.full(len(far), road.length)
    stretch, room = np.zeros((len(far), 2)), np.zeros((len(far), 2))
    stretch[:, 1 - side] = corners.stretch[far, 1 - side]
    stretch[:, side] = 0.0 if side == 0 else length
    room[:, 1 - side] = runs[far + 1 - side]
    sign = np.where(corners.turn[far] < 0.0, -1.0, 1.0) * np.tile([1.0, -1.0], count)
    free = np.zeros((len(far), 2), dtype=bool)
    free[:, side] = True
    tried = Corners(stretch, sign, free)
    arcs = _largest(problem, road, tried, np.full(len(far), steering), room, rough=True)
    good = np.flatnonzero(arcs.fits & (arcs.radius >= steering * (1.0 - 1e-9)))
    if len(good) == 0:
        return corners
    pick = good[:1]
    keep = np.ones(len(corners), dtype=bool)
    keep[near[: pick[0] // 2 + 1]] = False
    return Corners.join(corners.take(keep), tried.take(pick))


def _reaches(corners: Corners, arcs: Fillets) -> Array:
    """(n, 2) [m], how far before and behind its stretch each arc begins and ends."""
    return np.column_stack([corners.stretch[:, 0] - arcs.begin, arcs.end - corners.stretch[:, 1]])


def _bound(stretch: Array, turn: Array) -> Corners:
    """Corners with road on both sides."""
    return Corners(stretch, turn, np.zeros((len(turn), 2), dtype=bool))


def _bend(road: Road, corners: Corners, near: Indices, between: Array) -> Array:
    """Turn [rad] of the smooth road between corners i and i + 1; less than half a turn."""
    _, p, _ = road.at(corners.stretch[near, 1], after=True)
    _, q, _ = road.at(corners.stretch[near + 1, 0], after=False)
    turned = np.arctan2(p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0], np.einsum("ij,ij->i", p, q))
    return np.where(between > 0.0, turned, 0.0)
