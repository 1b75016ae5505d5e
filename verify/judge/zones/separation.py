"""How far zones are from what stands in the way: proven over a whole motion, between its rows too.

For any unit vector n, min over a feature's points of n.p less the zone's reach in the direction n is how far
the line that touches the zone there stays clear of the feature. So every n gives a lower bound of their
separation, and the best gives the separation (minus the least shift that parts them, where they meet). No
search for n needs to be trusted: what is proven is the sum for the n that was found.

Along an arc of curvature kappa let n be fixed in the world. Then with psi = angle(n) - theta(s)

    phi(s) = min_k n.p_k - radius - n.q(s) - h(psi(s), v(s)),    (-n.q)'' <= |kappa|,

as q'' is kappa times the left normal. `Zone.along` bounds the rest: with h replaced by the h of a stopping
distance linear between its end values, which is at most `excess` too little, phi'' <= c = |kappa| + bend. A
function with phi'' <= c on a piece of length h has phi(s) >= chord - c s (h - s)/2. The least of that
parabola, less the excess, holds for the whole piece; n is the best in its middle, and pieces on which this is
not tight enough are halved.

Features are the sides of the hall and of the obstacles, points, and circles as points with a radius. A zone
that keeps off all sides keeps off the obstacles themselves: it holds the robot's centre and is connected, so
it could lie inside of one only if the centre did, which the check of clearance rules out along the motion.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import shapely
from numpy.typing import NDArray

from verify.judge.continuous import COARSE, RESOLUTION, LeastMargin, parabola_minimum
from verify.judge.finding import VIOLATION_TOLERANCE
from verify.judge.motion import Motion
from verify.judge.zones.zone import Zone

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

DIRECTIONS = 24  # of the first look for the best one
NARROWINGS = 34  # of its bracket by the golden ratio: to 4e-8 rad, and the gap is flat where it is greatest
BUDGET = 400_000  # pieces looked at; a coarser (still proven) bound is returned beyond it
PAIRS = 400_000  # rows times features handled at once
CHUNK = 20_000  # searches for the best direction made at once
LOOSE = 1e-4  # [m], resolution with zones whose bounds fall only with the length of a piece
GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)


@dataclass(frozen=True)
class _Pieces:
    """Parts of rows, each with one feature."""

    row: Rows
    feature: Rows
    begin: Array  # [m] along the row
    end: Array

    def __len__(self) -> int:
        return len(self.row)

    def only(self, which: NDArray[np.bool_]) -> _Pieces:
        return _Pieces(self.row[which], self.feature[which], self.begin[which], self.end[which])

    def halves(self) -> _Pieces:
        middle = 0.5 * (self.begin + self.end)
        return _Pieces(
            np.concatenate([self.row, self.row]),
            np.concatenate([self.feature, self.feature]),
            np.concatenate([self.begin, middle]),
            np.concatenate([middle, self.end]),
        )


def gap_towards(zone: Zone, ends: Array, radius: Array, angle: Array, speed: Array) -> Array:
    """Gap [m] that each direction shows between a zone and a feature.

    Parameters
    ----------
    ends : (n, 4) [m], both ends ax, ay, bx, by of segments in the body's frame.
    radius : (n,) [m], around them.
    angle : (n, m) [rad] in the body's frame; speed : (n,) [m/s].

    Returns
    -------
    (n, m) [m]
    """
    cos, sin = np.cos(angle), np.sin(angle)
    least = np.minimum(ends[:, :1] * cos + ends[:, 1:2] * sin, ends[:, 2:3] * cos + ends[:, 3:] * sin)
    return np.asarray(least - radius[:, None] - zone.support(angle, speed[:, None]))


def separation(zone: Zone, ends: Array, radius: Array, speed: Array) -> tuple[Array, Array]:
    """Best direction and the gap it shows, of each of several zones and features; as for `gap_towards`.

    The gap is negative where a feature reaches into the zone: minus the least shift that parts them, or less.

    Returns
    -------
    (n,) [m], (n,) [rad] in the body's frame, from the zone to the feature

    Notes
    -----
    The gap f of the angle has f + f'' <= 0 in the weak sense, so it is concave where it is positive. The
    best direction of a first look is refined in a bracket around it. Kinks of the zone and the normals of the
    feature belong to that look: there f has its corners.
    """
    even = np.linspace(-math.pi, math.pi, DIRECTIONS, endpoint=False)
    grid = np.broadcast_to(even, (len(ends), DIRECTIONS))
    normal = np.arctan2(ends[:, 0] - ends[:, 2], ends[:, 3] - ends[:, 1])[:, None]
    angle = np.concatenate([grid, zone.kinks(speed), normal, normal + math.pi], axis=1)
    found = gap_towards(zone, ends, radius, angle, speed)
    at = np.argmax(found, axis=1)[:, None]
    best, best_angle = (np.take_along_axis(values, at, axis=1) for values in (found, angle))
    low, high = best_angle - 2.0 * math.pi / DIRECTIONS, best_angle + 2.0 * math.pi / DIRECTIONS
    inner, outer = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
    at_inner, at_outer = (gap_towards(zone, ends, radius, a, speed) for a in (inner, outer))
    for _ in range(NARROWINGS):
        left = at_inner >= at_outer
        low, high = np.where(left, low, inner), np.where(left, outer, high)
        new = np.where(left, high - GOLDEN * (high - low), low + GOLDEN * (high - low))
        value = gap_towards(zone, ends, radius, new, speed)
        inner, outer = np.where(left, new, outer), np.where(left, inner, new)
        at_inner, at_outer = np.where(left, value, at_outer), np.where(left, at_inner, value)
    for value, refined in ((at_inner, inner), (at_outer, outer)):
        better = value > best
        best, best_angle = np.where(better, value, best), np.where(better, refined, best_angle)
    return best[:, 0], best_angle[:, 0]


def least_separation(motion: Motion, features: Array, zone: Zone, rows: Rows | None = None) -> LeastMargin:
    """Least separation of the zone and everything that stands in the way, over the continuous motion.

    Parameters
    ----------
    features : (f, 5) [m], segments ax, ay, bx, by and a radius around them (`Features.table`).
    rows : the rows of the motion to look at, by default all and the pose at the end.

    Returns
    -------
    LeastMargin: `proven` is a lower bound within `RESOLUTION` of a value that is attained, unless `BUDGET`
    runs out first or the zone's bounds are not `tight`; then it is lower but still proven. At a kink of the
    path, where it turns without moving, the poses before and after count.
    """
    search = _Search(_with_last_pose(motion), features, zone)
    pieces = search.near(np.arange(len(motion.t)) if rows is None else rows)
    while len(pieces):
        pieces = search.halved(pieces)
    x, y = search.motion.position(search.at_row, search.at_along)[0]
    t = float(search.motion.time(search.at_row, search.at_along)[0])
    return LeastMargin(
        proven=min(search.proven, search.best), attained=search.best, t=t, x=float(x), y=float(y)
    )


class _Search:
    """What is known so far: the least that is proven of decided pieces, and the least attained."""

    def __init__(self, motion: Motion, features: Array, zone: Zone) -> None:
        self.motion, self.features, self.zone = motion, features, zone
        self.proven, self.best = math.inf, math.inf
        self.at_row, self.at_along = np.zeros(1, dtype=np.int64), np.zeros(1)
        self._spent = 0

    def near(self, row: Rows) -> _Pieces:
        """Whole rows with the features that may matter to them, those not decided by the nearest point.

        A feature further from the middle of a row than half the row and the zone's extent there is further
        from the zone by what is left.
        """
        motion, zone = self.motion, self.zone
        step = motion.step[row]
        shapes = _as_shapes(self.features)
        tree = shapely.STRtree(shapes)
        middle = motion.position(row, 0.5 * step)
        widest = float(self.features[:, 4].max(initial=0.0))
        nearest = tree.query_nearest(shapely.points(middle), all_matches=False)[1]
        self._look(_Pieces(row, nearest, np.zeros(len(row)), step))
        fastest = np.maximum(np.abs(motion.v[row]), np.abs(motion.v[row + 1]))
        reach = zone.extent(fastest) + 0.5 * step + widest + max(self.best, 0.0)
        size = max(1, PAIRS // len(self.features))
        kept = []
        for first in range(0, len(row), size):
            here = slice(first, first + size)
            index, feature = tree.query(
                shapely.points(middle[here]), predicate="dwithin", distance=reach[here]
            )
            index = row[index + first]
            pieces = _Pieces(index, feature, np.zeros(len(index)), motion.step[index])
            kept.append(self._undecided(pieces, self._towards_nearest(pieces)))
        return _Pieces(*(np.concatenate([getattr(p, name) for p in kept]) for name in _NAMES))

    def halved(self, pieces: _Pieces) -> _Pieces:
        """Look at pieces in the best direction of their middles; the halves of those not decided."""
        self._spent += len(pieces)
        open_pieces = self._undecided(pieces, self._look(pieces))
        if self._spent > BUDGET and len(open_pieces):
            lower = self._lower(open_pieces, self._look(open_pieces))
            self.proven = min(self.proven, float(lower.min()))
            return open_pieces.only(np.zeros(len(open_pieces), dtype=bool))
        return open_pieces.halves()

    def _look(self, pieces: _Pieces) -> Array:
        """Best direction [rad, world] in the middle of each piece; the gap there is attained."""
        along = 0.5 * (pieces.begin + pieces.end)
        ends, heading = self._in_body_frame(pieces, along)
        speed, radius = self.motion.speed(pieces.row, along), self.features[pieces.feature, 4]
        gap, angle = np.empty(len(pieces)), np.empty(len(pieces))
        for first in range(0, len(pieces), CHUNK):
            here = slice(first, first + CHUNK)
            gap[here], angle[here] = separation(self.zone, ends[here], radius[here], speed[here])
        least = int(np.argmin(gap))
        if gap[least] < self.best:
            self.best = float(gap[least])
            self.at_row, self.at_along = pieces.row[[least]], along[[least]]
        return np.asarray(angle + heading)

    def _towards_nearest(self, pieces: _Pieces) -> Array:
        """Direction [rad, world] from the middle of each piece to the nearest point of its feature."""
        p = self.motion.position(pieces.row, 0.5 * (pieces.begin + pieces.end))
        a, b = self.features[pieces.feature, :2], self.features[pieces.feature, 2:4]
        along = b - a
        square = np.sum(along * along, axis=1)
        part = np.sum((p - a) * along, axis=1)
        part = np.divide(part, square, out=np.zeros_like(part), where=square > 0.0)
        off = a + np.clip(part, 0.0, 1.0)[:, None] * along - p
        return np.arctan2(off[:, 1], off[:, 0])

    def _undecided(self, pieces: _Pieces, angle: Array) -> _Pieces:
        """Those of which it is open whether they hold less than what is attained."""
        lower = self._lower(pieces, angle)
        resolution = RESOLUTION if self.best > -RESOLUTION / COARSE else COARSE * -self.best
        if not self.zone.tight:
            resolution = max(
                resolution, min(LOOSE, self.best) if self.best > 0.0 else 0.1 * VIOLATION_TOLERANCE
            )
        limit = self.best - resolution
        undecided = lower < limit
        self.proven = min(self.proven, float(lower[~undecided].min(initial=math.inf)))
        return pieces.only(undecided)

    def _lower(self, pieces: _Pieces, angle: Array) -> Array:
        """Lower bound of the gap over each piece [m], with directions `angle` [rad] fixed in the world."""
        row, length = pieces.row, pieces.end - pieces.begin
        curvature = self.motion.curvature[row]
        v = [self.motion.speed(row, along) for along in (pieces.begin, pieces.end)]
        change = self.zone.along(v[0], v[1], curvature, length)
        gap = []
        for along, speed in ((pieces.begin, change.begin), (pieces.end, change.end)):
            ends, heading = self._in_body_frame(pieces, along)
            radius = self.features[pieces.feature, 4]
            gap.append(gap_towards(self.zone, ends, radius, (angle - heading)[:, None], speed)[:, 0])
        bend = np.abs(curvature) + change.bend
        return np.asarray(parabola_minimum(gap[0], gap[1], bend, length) - change.excess)

    def _in_body_frame(self, pieces: _Pieces, along: Array) -> tuple[Array, Array]:
        """Both ends (n, 4) [m] of each piece's feature from the robot `along` it, and the heading there."""
        row = pieces.row
        q = self.motion.position(row, along)
        heading = self.motion.heading[row] + self.motion.curvature[row] * along
        cos, sin = np.cos(heading), np.sin(heading)
        table = self.features[pieces.feature]
        columns = []
        for first in (0, 2):
            x, y = table[:, first] - q[:, 0], table[:, first + 1] - q[:, 1]
            columns += [cos * x + sin * y, cos * y - sin * x]
        return np.stack(columns, axis=1), heading


_NAMES = ("row", "feature", "begin", "end")


def _with_last_pose(motion: Motion) -> Motion:
    """The same with a row more that takes no time, so that every pose begins one."""
    columns = {name: getattr(motion, name) for name in ("t", "x", "y", "heading", "v", "a", "curvature")}
    longer = {name: np.append(values, values[-1]) for name, values in columns.items()}
    return replace(motion, **longer, clearance=np.append(motion.clearance, motion.clearance[-1]))


def _as_shapes(features: Array) -> NDArray[np.object_]:
    """Centre lines as Shapely geometries; points where both ends are the same."""
    ends = features[:, :4].reshape(-1, 2, 2)
    shapes = np.empty(len(features), dtype=object)
    point = (ends[:, 0] == ends[:, 1]).all(axis=1)
    shapes[point] = shapely.points(ends[point, 0])
    shapes[~point] = shapely.linestrings(ends[~point])
    return shapes
