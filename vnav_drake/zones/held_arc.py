"""Stops with the steering held: does the braking arc stay in the zone?

With friction in reserve a robot that turns with curvature kappa brakes fully on an arc of length D. In units
of D the arc ends at P(x) = (sin x, 1 - cos x) / x with x = |kappa| D, outside E by e(x), the greatest of
n.P(x) - h_E(n) over unit n, and negative inside. An arc stays in the zone where D e(y) <= m for all y <= x,
where m is the room that the zone keeps beside the vehicle's own disc.

Derived. The point of the arc after the share s of its length is s P(s x) D. E is convex and holds 0, so that
point is outside E by at most s e(s x) D where e is positive there, and inside where it is not. So arcs that
end within m, for all turns up to x, are within m all along, and so are those of smaller curvature.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from vnav_drake.zones.convex_zone import GaugeZone
from vnav_drake.zones.touch import outside_shape

Array = NDArray[np.float64]

# Of the turns that the zone allows, what a plan uses: wheels are still on their way where its curvature
# changes, and the controller steers too.
PLAN_SHARE = 0.8
FULL_TURN = math.pi  # [rad]: a stop turns by less
SHORTEST = 1e-9  # [m], of stopping distances
TABLE = 4001  # turns of the table
HALVINGS = 60
ROUNDING = 1e-12  # of an excess in units of the stopping distance
MOST_AHEAD = 1.25  # an ellipse that must hold held arcs reaches no further ahead of itself than this


def arc_excess(zone: GaugeZone, turn: Array) -> tuple[Array, Array]:
    """How far the arc's end lies outside E, in units of the stopping distance.

    Parameters
    ----------
    turn : (n,) [rad], x = kappa D, to the right where it is negative.

    Returns
    -------
    e (n,) and de/dx (n,).
    """
    point, by_turn = _arc_end(turn)
    gap, angle = outside_shape(zone, point)
    along = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return gap, np.einsum("nj,nj->n", along, by_turn)


def side_room(zone: GaugeZone) -> float:
    """How far [m] a zone at standstill reaches beyond the vehicle's disc at least."""
    angle = np.linspace(-math.pi, math.pi, 361)
    return float(zone.body(angle)[0].min()) - zone.radius


@dataclass(frozen=True)
class TurnLimit:
    """Greatest |kappa| D(v) whose held arc stays in a zone, as a function of the stopping distance."""

    side: float  # m [m]
    turn: Array  # (k,) [rad], rising
    excess: Array  # (k,), greatest e up to that turn
    share: float = 1.0

    @classmethod
    def of(cls, zone: GaugeZone, share: float = 1.0) -> TurnLimit | None:
        """None where every arc stays in the zone, as in a disc; `share` of the turns is allowed."""
        turn = np.linspace(0.0, FULL_TURN, TABLE)
        either = np.maximum(
            arc_excess(zone, turn)[0], arc_excess(zone, -turn)[0]
        )  # to the left, to the right
        excess = np.maximum.accumulate(either)
        if excess[-1] <= ROUNDING:
            return None
        return cls(side_room(zone), turn, excess, share)

    @property
    def always(self) -> float:
        """x_E [rad], a turn that is allowed at any stopping distance."""
        return float(self.greatest(np.array([math.inf]))[0][0])

    def greatest(self, far: Array) -> tuple[Array, Array]:
        """Greatest |kappa| D [rad] at stopping distances (n,) [m], and its derivative [rad/m].

        Between the entries of the table by straight lines, good to (pi / TABLE)^2 / 8 of the distance.
        """
        far = np.maximum(far, SHORTEST)
        share = self.side / far
        last = np.searchsorted(self.excess, np.maximum(share, ROUNDING), side="right") - 1
        inside = (last >= 0) & (last < len(self.turn) - 1)
        at = np.clip(last, 0, len(self.turn) - 2)
        step, rise = self.turn[1], self.excess[at + 1] - self.excess[at]
        above = np.maximum(share - self.excess[at], 0.0)
        slope = np.where(inside & (share > ROUNDING), step / np.where(rise > 0.0, rise, 1.0), 0.0)
        value = np.where(inside, self.turn[at] + slope * above, np.where(last < 0, 0.0, FULL_TURN))
        by_far = -slope * share / far
        return self.share * value, self.share * by_far

    def stopping_distance(self, curvature: Array) -> Array:
        """Greatest stopping distance [m] that turns (n,) [1/m] allow; infinite straight ahead."""
        bend = np.abs(curvature)
        curved = bend > 0.0
        high = np.where(curved, FULL_TURN / np.where(curved, bend, 1.0), math.inf)
        low = np.zeros_like(high)
        safe = np.where(curved, high, 1.0)
        for _ in range(HALVINGS):
            middle = 0.5 * (low + safe)
            fits = bend * middle <= self.greatest(middle)[0]
            low, safe = np.where(fits, middle, low), np.where(fits, safe, middle)
        return np.where(curved, low, math.inf)


def greatest_turn(zone: GaugeZone, far: float) -> float:
    """Greatest |kappa| D [rad] whose arc stays in the zone at the stopping distance `far` [m].

    Zero where no turn does; at most half a full turn.
    """
    limit = TurnLimit.of(zone)
    return FULL_TURN if limit is None else float(limit.greatest(np.array([far]))[0][0])


def least_ahead(lateral_ratio: float, turn: float) -> float:
    """Least semi-axis ahead of a centred ellipse that holds all arcs of up to `turn` [rad].

    A^2 = max over x of (sin x / x)^2 / (1 - ((1 - cos x) / (beta x))^2), at least 1; infinite where the arc
    is wider than the ellipse.
    """

    def square(x: float) -> float:
        wide = (1.0 - math.cos(x)) / (lateral_ratio * x)
        return (math.sin(x) / x) ** 2 / (1.0 - wide * wide) if wide < 1.0 else math.inf

    ends = np.linspace(0.0, turn, 65)[1:]
    values = [square(float(x)) for x in ends]
    if not np.isfinite(values).all():
        return math.inf
    best = minimize_scalar(lambda x: -square(x), bounds=(1e-9, turn), method="bounded").fun
    return math.sqrt(max(1.0, -float(best), *values))


def _arc_end(turn: Array) -> tuple[Array, Array]:
    """P(x) (n, 2) and its derivative, by their series below 1e-3."""
    small = np.abs(turn) < 1e-3
    x = np.where(small, 1.0, turn)
    sin, cos = np.sin(x), np.cos(x)
    point = np.stack(
        [np.where(small, 1.0 - turn**2 / 6.0, sin / x), np.where(small, turn / 2.0, (1.0 - cos) / x)], axis=1
    )
    slope = np.stack(
        [
            np.where(small, -turn / 3.0, (x * cos - sin) / (x * x)),
            np.where(small, 0.5 - turn**2 / 8.0, (x * sin - 1.0 + cos) / (x * x)),
        ],
        axis=1,
    )
    return point, slope
