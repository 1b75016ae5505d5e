"""How steep u is for the pace that a zone allows: the worst quotient over all headings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vnav_drake.lower_bound.features import Features
from vnav_drake.lower_bound.headings import ZoneLaw
from vnav_drake.lower_bound.inscribed import BESIDE, Ellipses, discs, ellipses
from vnav_drake.lower_bound.minorant import Choice

Array = NDArray[np.float64]

CLOSER, CLOSER_KINKED = 4, 9  # looks between headings, each four times as close
NEARLY, NEARLY_KINKED = 0.03, 0.08  # quotients this share below the worst are looked at more closely


@dataclass(frozen=True, eq=False)
class Directions:
    """Triangles with what bounds 1/V in them, for every heading."""

    zone: ZoneLaw
    features: Features
    corners: Array  # (t, 3, 2) [m]
    choice: Choice
    place: Array  # (t, 3), barycentric: where the tangents touch
    heading: Array  # (t,) [rad], of the flow
    minorant: Array  # (t, 2, 3, h) [s/m] at `heading + BESIDE`

    @classmethod
    def of(
        cls, zone: ZoneLaw, features: Features, corners: Array, choice: Choice, place: Array, heading: Array
    ) -> Directions:
        """With the minorants at the headings that are looked at first."""
        minorant = zone.minorants(features, corners, choice, place, heading[:, None] + BESIDE)
        return cls(zone, features, corners, choice, place, heading, minorant)

    def allowed(self, known: bool) -> Ellipses:
        """Ellipses of gradients at the 3 t corners; discs where the flow is not `known`."""
        single = ~self.choice.ridge[:, None, None, None]
        first = np.where(single, self.minorant[:, :1], self.minorant)  # the second is of no use there
        flat = np.swapaxes(first, 1, 2).reshape(-1, 2, len(BESIDE))
        return ellipses(flat, np.repeat(self.heading, 3)) if known else discs(flat)

    def worst(self, slope: Array, weight: Array) -> float:
        """The greatest g.t / m over all corners, gradients (t, 3, 2) [s/m], and headings.

        Parameters
        ----------
        weight : (t,), of the first minorant.
        """
        mixed = _mixed(self.minorant, weight)
        angle = self.heading[:, None] + BESIDE
        ratio = _quotient(slope, mixed, angle[:, None])
        greatest = float(ratio.max())
        smooth = self.zone.shape.smooth
        high = ratio >= (1.0 - (NEARLY if smooth else NEARLY_KINKED)) * greatest
        high &= (ratio >= np.roll(ratio, 1, axis=2)) & (ratio >= np.roll(ratio, -1, axis=2))
        triangle, corner, peak = np.nonzero(high)
        wide = np.append(np.diff(BESIDE), BESIDE[0] + 2.0 * np.pi - BESIDE[-1])
        centre, step = angle[triangle, peak], np.maximum(wide[peak - 1], wide[peak])
        few = self.choice.of(triangle)
        for _ in range(CLOSER if smooth else CLOSER_KINKED):
            near = centre[:, None] + step[:, None] * np.linspace(-1.0, 1.0, 9)
            bound = self.zone.minorants(
                self.features, self.corners[triangle], few, self.place[triangle], near
            )
            here = _mixed(bound, weight[triangle])[np.arange(len(triangle)), corner]
            found = _quotient(slope[triangle, corner], here, near)
            first = found.argmax(axis=1)
            centre, step = near[np.arange(len(near)), first], 0.25 * step
            greatest = max(greatest, float(found.max()))
        return greatest


def _mixed(minorant: Array, weight: Array) -> Array:
    """(t, 3, h) from (t, 2, 3, h)."""
    share = weight[:, None, None]
    return np.asarray(share * minorant[:, 0] + (1.0 - share) * minorant[:, 1])


def _quotient(slope: Array, bound: Array, angle: Array) -> Array:
    """g.t / m for gradients (..., 2) and bounds (..., h) at headings (..., h)."""
    along = slope[..., :1] * np.cos(angle) + slope[..., 1:] * np.sin(angle)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(along > 0.0, np.where(bound > 0.0, along / bound, np.inf), 0.0)
