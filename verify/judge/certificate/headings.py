"""The inequality g.t(theta) <= m(theta) for every heading theta: proven between samples, in floating point.

D_f(q, theta), the greatest stopping distance at which the zone keeps clear of a feature f, is at most
gamma(R(-theta) z) for every z = p - q - b with a point p of f and |b| up to the radius of the zone's disc: at
that stopping distance p is in the zone. A robot with a stopping distance D has 1/V = n(D), convex and
falling, so for every w > 0

    1/V(q, theta) >= 1/w + s (D(w) - gamma(R(-theta) z)),    s = a_b / (w^2 (w + a_b t_r)).

On a triangle D_f is convex in q for each theta (the places from which a zone touches f grow concavely with
its stopping distance, as sums of convex sets), so the affine interpolant of such values at the corners is
below 1/V; and so are combinations of these, with weights that sum to 1 or less, and the constant 1/v_max. The
inequality is shown by cells of headings, on each of which w and, for each corner, z are fixed. It then reads

    H(theta) = sum of weight s gamma(R(-theta) z) + g.t(theta) <= C.

gamma is sublinear and t(theta) is a positive combination of t(a) and t(b) for theta between a and b, less
than pi apart, so H lies below the sinusoid through H(a) and H(b), whose greatest value is known: that is what
is compared with C. Cells where this fails are halved. Which w, z and terms are taken is of no matter to the
proof.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verify.judge.certificate.floating import ROUNDING
from verify.judge.certificate.gauge import Gauge
from verify.judge.certificate.minorant import Corners, Minorants

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]

CELLS = 16  # of headings, to begin with
DEEPEST = 18  # halvings of them: to 1.5e-6 rad
MOST_CELLS = 1000  # a triangle, on average
HOPELESS = 50.0  # at a cell's own heading it falls short by this times the width squared: it is no matter
FURTHEST = 0.55  # contact at this share of the greatest stopping distance at least
SLOWEST, FASTEST = 1e-9, 1e9  # [m/s], of contact speeds
BLUR = 256.0 * ROUNDING  # of the sum of sizes of all terms: more than all roundings of a cell
SEARCH = 24  # halvings of the bracket of the direction in which a point is touched
CHUNK = 2**11  # triangles at once


@dataclass(frozen=True)
class ZoneGauge:
    """What the proof needs to know of a zone D(v) E (+) body."""

    gauge: Gauge  # of E
    reach: float  # [m], radius of a disc in the body


@dataclass(frozen=True)
class _Cells:
    """Intervals of headings, each for one triangle."""

    triangle: Indices  # (n,)
    begin: Array  # (n,) [rad]


def slack(corners: Corners, minorants: Minorants, contact: Array, zone: ZoneGauge) -> Array:
    """Lower bounds of (C - H) / C at corners (t, 3), over all headings; below zero where not shown to hold.

    Parameters
    ----------
    contact : (t, 3), at least zero: of the place where tangents touch; only a choice.
    """
    found = np.empty((len(minorants.triangles), 3))
    for first in range(0, len(found), CHUNK):
        rows = np.arange(first, min(first + CHUNK, len(found)))
        found[rows] = _slack(corners, minorants, contact, zone, rows)
    return found


def _slack(corners: Corners, minorants: Minorants, contact: Array, zone: ZoneGauge, rows: Indices) -> Array:
    slope, blur = _gradients(corners, rows)
    least = np.full((len(rows), 3), np.inf)
    width = 2.0 * math.pi / CELLS
    triangle, cell = np.divmod(np.arange(len(rows) * CELLS), CELLS)
    cells = _Cells(triangle, -math.pi + width * cell)
    budget = MOST_CELLS * len(rows)
    for level in range(DEEPEST + 1):
        shown, middle = _shown(cells, width, slope, blur, minorants, contact, zone, rows)
        good: Mask = np.all(shown >= 0.0, axis=1)
        budget -= len(good)
        # At one heading nothing is lost by the width, at kinks either: cells around it would show no more.
        lost = np.zeros(len(rows), dtype=bool)
        lost[cells.triangle[(middle < -HOPELESS * width * width).any(axis=1)]] = True
        last = level == DEEPEST or budget <= 0
        final = good | (lost[cells.triangle]) | last
        np.minimum.at(least, cells.triangle[final], shown[final])
        triangle, begin = cells.triangle[~final], cells.begin[~final]
        if not len(triangle):
            break
        width *= 0.5
        cells = _Cells(np.concatenate([triangle, triangle]), np.concatenate([begin, begin + width]))
    return least


def _gradients(corners: Corners, rows: Indices) -> tuple[Array, Array]:
    """grad u (r, 3, 2) [s/m] and bounds of its rounding errors (r, 3); see `floating.gradient_above`."""
    ahead, back = (corners.towards[rows, :, i] - corners.own[rows] for i in (0, 1))
    side = corners.sides[rows].astype(np.float64)
    e_j, e_k = side[..., 0, :], side[..., 1, :]
    area = (corners.twice_area[rows].astype(np.float64) * (0.5 * corners.unit))[:, None]
    x = (ahead * e_k[..., 1] - back * e_j[..., 1]) / area
    y = (back * e_j[..., 0] - ahead * e_k[..., 0]) / area
    size = np.abs(ahead) * np.hypot(*np.moveaxis(e_k, -1, 0)) + np.abs(back) * np.hypot(
        *np.moveaxis(e_j, -1, 0)
    )
    return np.stack([x, y], axis=2), 64.0 * ROUNDING * size / area


def _shown(
    cells: _Cells,
    width: float,
    slope: Array,
    blur: Array,
    minorants: Minorants,
    contact: Array,
    zone: ZoneGauge,
    rows: Indices,
) -> tuple[Array, Array]:
    """What the best choice of terms shows of each cell: (C - H) / C at the three corners; (n, 3).

    And what the best choice comes to at the cell's middle, the heading that it is made for; (n, 3).
    """
    law = minorants.limits
    steady = 1.0 / law.speed
    ends = np.stack([cells.begin, cells.begin + width, cells.begin + 0.5 * width])  # (3, n), and the middle
    g, off = slope[cells.triangle], blur[cells.triangle]
    along = np.cos(ends)[..., None] * g[..., 0] + np.sin(ends)[..., None] * g[..., 1]  # (3, n, 3)
    size = np.abs(g).sum(axis=2)
    found, middle = _compared(along, np.full(size.shape, steady), size + steady, off, width)
    left = np.flatnonzero((found < 0.0).any(axis=1))
    if not len(left):
        return found, middle
    which = rows[cells.triangle[left]]
    slots = minorants.weight.shape[1]
    uses, level = np.zeros((3, len(left), 3, slots)), np.full((len(left), 3, slots), steady)
    best_uses, best_level = uses.copy(), level.copy()  # of tangents that beat the constant where they touch
    for slot in range(slots):
        used = np.flatnonzero((minorants.weight[which, slot] > 0.0) & (minorants.feature[which, slot] >= 0))
        if not len(used):
            continue
        terms, constant, finite, better = _term(
            minorants, contact, zone, which[used], slot, ends[:, left[used]], steady
        )
        for into, onto, which_ones in ((uses, level, finite), (best_uses, best_level, finite & better)):
            part = used[which_ones]
            into[..., slot][:, part] = terms[:, which_ones]
            onto[..., slot][part] = constant[which_ones, None]
    weight = minorants.weight[which]
    weight = weight / np.maximum(weight.sum(axis=1, keepdims=True) * (1.0 + 8.0 * ROUNDING), 1.0)
    together = (weight[:, None] * best_uses).sum(axis=3), (weight[:, None] * best_level).sum(axis=2)
    alone = ((uses[..., slot], level[..., slot]) for slot in range(slots))
    for terms, above in (together, *alone):
        sizes = size[left] + np.abs(above) + terms.max(axis=0)
        compared = _compared(terms + along[:, left], above, sizes, off[left], width)
        for best, shown in zip((found, middle), compared, strict=True):
            better = shown.min(axis=1) > best[left].min(axis=1)
            best[left[better]] = shown[better]
    return found, middle


def _compared(values: Array, above: Array, sizes: Array, off: Array, width: float) -> tuple[Array, Array]:
    """(C - H) / C with H the greatest of the sinusoid through its values at both ends, and at the middle.

    Parameters
    ----------
    values : (3, n, 3), of H at both ends and the middle of cells.
    """
    first, last, middle = values
    cos, sin = math.cos(width), math.sin(width)
    inside = (first * cos < last) & (last * cos < first) & (np.maximum(first, last) > 0.0)
    # first^2 + last^2 - 2 first last cos(width), of two positive numbers, without cancellation
    square = np.square(first - last) + 4.0 * first * last * math.sin(0.5 * width) ** 2
    top = np.where(inside, np.sqrt(np.maximum(square, 0.0)) / sin, np.maximum(first, last))
    whole, there = (above - most - off - BLUR * sizes for most in (top, middle))
    return _relative(whole, above), _relative(there, above)


def _relative(room: Array, above: Array) -> Array:
    """Room as a share of what it is in; where u does not rise against a bound of zero nothing is tight."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(above > 0.0, room / above, np.where(room >= 0.0, 1.0, -np.inf))


def _term(
    minorants: Minorants,
    contact: Array,
    zone: ZoneGauge,
    which: Indices,
    slot: int,
    ends: Array,
    steady: float,
) -> tuple[Array, Array, Mask, Mask]:
    """One feature's part of H at both ends and the middle, its part of C, and which are numbers and good.

    Good are those that beat the constant at the place of contact: a tangent may still be better at corners
    nearer by where it does not.

    Parameters
    ----------
    ends : (3, n) [rad], begin, end and middle of cells.

    Returns
    -------
    (3, n, 3), (n,), (n,), (n,)
    """
    law = minorants.limits
    middle = ends[2]
    feature = minorants.features[minorants.feature[which, slot]]
    corner = minorants.points[minorants.triangles[which]]
    z = _contacts(zone, corner, feature[:, None, :], middle[:, None])  # (n, 3, 2)
    # z is a difference of coordinates: what they are rounded by is as large as the world, z may be small.
    size = np.abs(corner).max(axis=(1, 2)) + np.abs(feature).max(axis=1) + zone.reach
    off = (BLUR * size / zone.gauge.inscribed)[:, None]
    here = _turned(zone.gauge, z, middle[:, None]) + off
    place = contact[which]
    touch = np.maximum(np.einsum("nc,nc->n", here, place), FURTHEST * here.max(axis=1))
    lag = law.braking * law.reaction_time
    fast = np.sqrt(lag * lag + 2.0 * law.braking * touch)
    fast = fast if lag == 0.0 else 2.0 * law.braking * touch / (lag + fast)
    # Wherever a tangent that touches beyond v_max is above 1/v_max, the one that touches there is higher.
    w = np.clip(np.maximum(fast, minorants.speed[which, slot]), SLOWEST, min(FASTEST, law.speed))
    s = law.braking / (w * w * (w + lag))
    constant = 1.0 / w + s * w * (law.reaction_time + 0.5 * w / law.braking)
    value = constant - s * np.einsum("nc,nc->n", here, place)
    finite: Mask = np.isfinite(value) & np.isfinite(constant)
    turned = [_turned(zone.gauge, z, end[:, None]) + off for end in ends[:2]]
    terms = s[:, None] * np.stack([*turned, here])
    return terms, constant, finite & np.isfinite(terms).all(axis=(0, 2)), value > steady


def _turned(gauge: Gauge, z: Array, heading: Array) -> Array:
    """gamma(R(-theta) z), for vectors (..., 2) and headings that broadcast to (...)."""
    cos, sin = np.cos(heading), np.sin(heading)
    return gauge(cos * z[..., 0] + sin * z[..., 1], cos * z[..., 1] - sin * z[..., 0])


def _contacts(zone: ZoneGauge, points: Array, features: Array, heading: Array) -> Array:
    """Vectors z (..., 2) [m] from places (..., 2) to features (..., 5), less some of the disc.

    Whatever the search gives, the point is one of the feature and the part of the disc is in the disc.
    """
    features = np.broadcast_to(features, (*points.shape[:-1], 5))
    heading = np.broadcast_to(heading, points.shape[:-1])
    first, along = features[..., :2] - points, features[..., 2:4] - features[..., :2]
    reach = (zone.reach + features[..., 4]) * (1.0 - 4.0 * ROUNDING)
    square = np.einsum("...i,...i->...", along, along)
    wall = square > 0.0
    length = np.sqrt(np.where(wall, square, 1.0))
    across = np.stack([-along[..., 1], along[..., 0]], axis=-1) / length[..., None]
    offset = np.einsum("...i,...i->...", first, across)
    across = across * np.where(offset < 0.0, -1.0, 1.0)[..., None]
    offset = np.abs(offset)
    x, y = zone.gauge.touch(np.arctan2(across[..., 1], across[..., 0]) - heading)
    cos, sin = np.cos(heading), np.sin(heading)
    there = np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)  # where E touches a line across
    high = np.einsum("...i,...i->...", there, across)
    with np.errstate(divide="ignore", invalid="ignore"):
        room = np.where(high > 0.0, np.maximum(offset - reach, 0.0) / high, 0.0)
    hit = room[..., None] * there + np.minimum(reach, offset)[..., None] * across
    part = np.einsum("...i,...i->...", hit - first, along) / np.where(wall, square, 1.0)
    inside = wall & (part > 0.0) & (part < 1.0)
    share = np.where(wall, np.clip(np.nan_to_num(part), 0.0, 1.0), 0.0)
    point = first + share[..., None] * along
    body = reach[..., None] * across
    rest = np.nonzero(~inside & (reach > 0.0))
    body[rest] = reach[rest][:, None] * _towards(zone.gauge, point[rest], reach[rest], heading[rest])
    far = np.hypot(point[..., 0], point[..., 1])
    body = np.where((far <= reach)[..., None], point, body)
    body = np.where((inside & (offset < reach))[..., None], offset[..., None] * across, body)
    return point - body


def _towards(gauge: Gauge, point: Array, reach: Array, heading: Array) -> Array:
    """Unit vectors (n, 2) in which a disc and a zone around it touch points (n, 2) first, nearly."""
    far = np.maximum(np.hypot(point[:, 0], point[:, 1]), reach)
    base = np.arctan2(point[:, 1], point[:, 0])
    half = np.arccos(reach / np.where(far > 0.0, far, 1.0))
    low, high = base - half, base + half
    for _ in range(SEARCH):
        angle = 0.5 * (low + high)
        # Rises where the touching point of E lies to the right of the one that is left of the disc.
        x, y = gauge.touch(angle - heading)
        cos, sin = np.cos(heading), np.sin(heading)
        there = np.stack([cos * x - sin * y, sin * x + cos * y], axis=1)
        rest = point - reach[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        left = there[:, 0] * rest[:, 1] - there[:, 1] * rest[:, 0] > 0.0
        low, high = np.where(left, angle, low), np.where(left, high, angle)
    angle = 0.5 * (low + high)
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)
