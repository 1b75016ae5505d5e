"""An ellipse in the set of gradients that a zone allows, one cone for the program.

Derived. A gradient g is allowed at a corner where g.t(theta) <= m(theta) for all headings theta: a convex set
S. The ellipse {c + P b, |b| <= 1} lies in it where c.t + |P' t| <= m for all theta. Let g0 be on the border
of S with the normal tau = t(theta0), nu across, and G(theta) = m(theta) - g0.t(theta) >= 0. With P = sigma
[[1, 0], [k, B]] in (tau, nu) and c = g0 - sigma (tau + k nu) the ellipse touches S at g0, and lies in it
where for all D = theta - theta0

    sigma (sqrt(a^2 + B^2 sin^2 D) - a) <= G,    a = cos D + k sin D.

So for any k and B the greatest sigma is a minimum of quotients; as D -> 0 they tend to G''(theta0) / B^2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Headings [rad] beside the flow's own at which S is looked at: dense where the ellipse touches.
_HALF = np.array(
    [
        0.02,
        0.05,
        0.09,
        0.14,
        0.2,
        0.28,
        0.37,
        0.47,
        0.6,
        0.75,
        0.9,
        1.05,
        1.2,
        1.35,
        1.5,
        1.7,
        1.9,
        2.15,
        2.4,
        2.65,
        2.9,
    ]
)
BESIDE = np.concatenate([-_HALF[::-1], [0.0], _HALF, [np.pi]])
_ZERO = len(_HALF)
LEANS = (1.0, 0.5, 0.0)  # of k, as shares of the lean towards the origin
WIDTHS = (1.0, 0.8, 0.6, 0.4, 1.3)  # of B, as shares of the width with S's own curvature
SEARCH = 40  # golden sections
INSIDE = 1.0 - 1e-9
# Shares of the touching point that are tried where sigma B is less than a share of what an ellipse around
# zero with S's own curvature has.
SHRUNK = ((0.999, 0.1), (0.99, 0.1), (0.97, 0.02), (0.93, 0.02))
LEAST = 0.02  # share of the disc in S: where sigma B is less, the disc is better


@dataclass(frozen=True, eq=False)
class Ellipses:
    """For each of t corners two ellipses of one shape: c_k + sigma_k P b."""

    inverse: Array  # (t, 2, 2), of P
    centre: Array  # (t, 2, 2) [s/m]: of the first and the second
    size: Array  # (t, 2) [s/m], sigma


def discs(minorant: Array) -> Ellipses:
    """Discs around zero, for minorants (t, 2, h) [s/m] at headings all around."""
    count = len(minorant)
    shape = np.broadcast_to(np.eye(2), (count, 2, 2))
    return Ellipses(shape, np.zeros((count, 2, 2)), minorant.min(axis=2))


def ellipses(minorant: Array, heading: Array) -> Ellipses:
    """The best ellipses found that touch at a heading.

    Parameters
    ----------
    minorant : (t, 2, h) [s/m], both minorants at `heading + BESIDE`.
    heading : (t,) [rad].
    """
    x, y = touching(minorant)
    found = _fitted(minorant, x, y)
    whole = x.copy(), y.copy()
    for share, least in SHRUNK:  # at a vertex of S no ellipse touches: stay away from it
        poor = np.flatnonzero(found[3] < least * np.sqrt(_radius(minorant, x)[0] * x[:, 0]))
        again = _fitted(minorant[poor], share * whole[0][poor], share * whole[1][poor])
        better = again[3] > found[3][poor]
        rows = poor[better]
        x[rows], y[rows] = share * whole[0][rows], share * whole[1][rows]
        for part, other in zip(found, again, strict=True):
            part[rows] = other[better]
    k, width, size, merit = found
    tau = np.stack([np.cos(heading), np.sin(heading)], axis=1)
    nu = np.stack([-tau[:, 1], tau[:, 0]], axis=1)
    inverse = np.stack([tau, (nu - k[:, None] * tau) / width[:, None]], axis=1)  # rows of P's, times sigma
    point = x[..., None] * tau[:, None] + y[..., None] * nu[:, None]
    centre = point - size[..., None] * (tau + k[:, None] * nu)[:, None]
    plain = discs(minorant)
    plainer = merit < LEAST * plain.size.min(axis=1)
    return Ellipses(
        np.where(plainer[:, None, None], plain.inverse, inverse),
        np.where(plainer[:, None, None], plain.centre, centre),
        np.where(plainer[:, None], plain.size, size),
    )


def _fitted(minorant: Array, x: Array, y: Array) -> tuple[Array, Array, Array, Array]:
    """The best k, B (t,), sigma (t, 2) and sigma B (t,) found that touch at x tau + y nu, (t, 2) each."""
    cos, sin = np.cos(BESIDE), np.sin(BESIDE)
    room = minorant - x[..., None] * cos - y[..., None] * sin  # G
    radius, bend = _radius(minorant, x)
    firm = np.where(room[..., _ZERO] <= 1e-9 * minorant[..., _ZERO], bend, np.inf)
    near = np.maximum(np.delete(room, _ZERO, axis=2), 0.0)
    c, s = np.delete(cos, _ZERO), np.delete(sin, _ZERO)
    lean = y[:, 0] / x[:, 0]
    merit = np.full(len(x), -1.0)
    kept = [np.zeros(len(x)), np.ones(len(x)), np.zeros_like(x)]
    for part in LEANS:
        for share in WIDTHS:
            k, width = part * lean, share * np.sqrt(radius / x[:, 0])
            a = c + k[:, None] * s
            reach = np.sqrt(np.square(a) + np.square(width[:, None] * s)) - a
            size = (near / np.maximum(reach, 1e-300)[:, None]).min(axis=2)
            size = INSIDE * np.minimum(size, firm / np.square(width)[:, None])
            worth = size.mean(axis=1) * width
            better = worth > merit
            merit = np.where(better, worth, merit)
            kept = [
                np.where(better, k, kept[0]),
                np.where(better, width, kept[1]),
                np.where(better[:, None], size, kept[2]),
            ]
    return kept[0], kept[1], kept[2], merit


def _radius(minorant: Array, x: Array) -> tuple[Array, Array]:
    """Radius of curvature m + m'' of S where it touches: of the first (t,), moderate, and both (t, 2)."""
    step = _HALF[0]
    bend = (minorant[..., _ZERO - 1] - 2.0 * minorant[..., _ZERO] + minorant[..., _ZERO + 1]) / step**2
    bend = np.maximum(bend + minorant[..., _ZERO], 0.0)
    return np.clip(bend[:, 0], 0.02 * x[:, 0], 50.0 * x[:, 0]), bend


def touching(minorant: Array) -> tuple[Array, Array]:
    """The point x tau + y nu of S farthest in the direction tau, for minorants (..., h); (...) [s/m] each."""
    front = np.abs(BESIDE) < 1.54
    cos, tan = np.cos(BESIDE[front]), np.tan(BESIDE[front])
    over = minorant[..., front] / cos

    def farthest(y: Array) -> Array:
        return np.asarray((over - y[..., None] * tan).min(axis=-1))

    level = minorant[..., _ZERO]
    y = (minorant[..., _ZERO + 1] - minorant[..., _ZERO - 1]) / (2.0 * _HALF[0])
    x = farthest(y)
    hard = np.flatnonzero((x < level * (1.0 - 1e-9)).ravel())
    if hard.size:
        rows = over.reshape(-1, over.shape[-1])[hard]
        low, high = -4.0 * level.ravel()[hard], 4.0 * level.ravel()[hard]
        golden = 0.5 * (np.sqrt(5.0) - 1.0)
        for _ in range(SEARCH):
            left, right = high - golden * (high - low), low + golden * (high - low)
            up = (rows - left[:, None] * tan).min(axis=1) < (rows - right[:, None] * tan).min(axis=1)
            low, high = np.where(up, left, low), np.where(up, high, right)
        flat_x, flat_y = x.ravel().copy(), y.ravel().copy()
        flat_y[hard] = 0.5 * (low + high)
        flat_x[hard] = (rows - flat_y[hard][:, None] * tan).min(axis=1)
        x, y = flat_x.reshape(x.shape), flat_y.reshape(y.shape)
    # Headings to the side and behind are limits, too.
    along = x[..., None] * np.cos(BESIDE) + y[..., None] * np.sin(BESIDE)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(along > 0.0, minorant / along, np.inf).min(axis=-1)
    share = np.clip(share, 0.0, 1.0)
    return x * share, y * share
