"""Braking zones as the judge knows them: what must be free around a robot that goes its way at some speed."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from verify.judge.continuous import root_excess
from verify.judge.zones.shapes import Disc, Shape

Array = NDArray[np.float64]

SAME_SPEED = 1e-12  # relative: a speed this little above that of a case is rounding


@dataclass(frozen=True)
class Pieces:
    """What bounds the reach of a zone along pieces of arcs; (n,) each.

    With `begin` and `end` for the speeds, the reach h(angle(n) - theta, v) in a fixed direction n is along a
    piece at most `excess` above what lies between its values at both ends plus a parabola: the reach taken
    linear between the ends' stopping distances has a second derivative of -`bend` at least.
    """

    begin: Array  # [m/s]
    end: Array  # [m/s]
    bend: Array  # [1/m]
    excess: Array  # [m]


class Zone(ABC):
    """A convex zone, body and margin in it, that does not shrink with speed."""

    @abstractmethod
    def support(self, angle: Array, speed: Array) -> Array:
        """How far it reaches [m]: `angle` [rad] in the body's frame, `speed` [m/s]; they broadcast."""

    @abstractmethod
    def extent(self, speed: Array) -> Array:
        """Radius [m] of a disc around the robot's centre that holds it at `speed` [m/s]; same shape."""

    @abstractmethod
    def along(self, begin: Array, end: Array, curvature: Array, length: Array) -> Pieces:
        """How it changes along pieces of arcs.

        Parameters
        ----------
        begin, end : (n,) [m/s], speeds at both ends; v^2 is linear in between.
        curvature : (n,) [1/m]; length : (n,) [m].
        """

    @abstractmethod
    def kinks(self, speed: Array) -> Array:
        """(n, k) [rad], where the reach is not differentiable at speeds (n,) [m/s]; repeats allowed."""

    @property
    def tight(self) -> bool:
        """Whether the bounds of `along` tend to the zone itself with the square of a piece's length."""
        return True

    def worst_speeds(self, begin: Array, end: Array) -> tuple[NDArray[np.int64], Array, Array]:
        """Ranges of speeds [m/s] from `begin` to `end`, (n,) each, with all that are the worst to stop from.

        That is, with the steering held.

        Returns
        -------
        (m,) which of the n, (m,) least and (m,) greatest speed: here the whole, as nothing more is known.
        """
        return np.arange(len(begin)), np.minimum(begin, end), np.maximum(begin, end)


@dataclass(frozen=True, eq=False)
class GaugeZone(Zone):
    """D(v) E (+) body, with the stopping distance D(v) = v t_r + v^2 / (2 a_b)."""

    shape: Shape  # E, in units of the stopping distance; it holds the origin and (1, 0)
    body: Shape  # [m], with the margin
    braking: float  # a_b [m/s^2]
    reaction_time: float  # t_r [s]

    def distance(self, speed: Array) -> Array:
        """Stopping distance D [m], same shape."""
        return np.asarray((self.reaction_time + 0.5 * speed / self.braking) * speed)

    def support(self, angle: Array, speed: Array) -> Array:
        return np.asarray(self.body.support(angle) + self.distance(speed) * self.shape.support(angle))

    def extent(self, speed: Array) -> Array:
        return np.asarray(self.body.extent + self.distance(speed) * self.shape.extent)

    def along(self, begin: Array, end: Array, curvature: Array, length: Array) -> Pieces:
        """How it changes along pieces of arcs.

        Notes
        -----
        Derived. Along an arc theta' = kappa, so psi = angle(n) - theta has psi' = -kappa. Let L(s) be linear
        between the values of D at both ends. As v^2 is linear in s, D - L is t_r times what the concave v
        lies above its chord, at most t_r (v1 - v0)^2 / (4 (v0 + v1)), and h_E <= R, the extent of E: the
        excess. A support function has h + h'' >= 0 in the weak sense, also at its kinks, so -h'' <= h, and
        |h'| is no more than the extent, as h' is how far a point of the set lies aside. So

            -(h_B(psi) + L h_E(psi))'' = -kappa^2 h_B'' + 2 kappa L' h_E' - kappa^2 L h_E''
                                      <= kappa^2 (R_B + max(D) R) + 2 |kappa| |D1 - D0| R / h,

        without R_B where the body is a disc, whose h_B is constant.
        """
        far_begin, far_end = self.distance(begin), self.distance(end)
        reach = self.shape.extent
        body = 0.0 if isinstance(self.body, Disc) else self.body.extent
        turn = np.abs(curvature)
        slope = np.divide(np.abs(far_end - far_begin), length, out=np.zeros_like(length), where=length > 0.0)
        bend = turn * turn * (body + np.maximum(far_begin, far_end) * reach) + 2.0 * turn * slope * reach
        return Pieces(begin, end, bend, self.reaction_time * reach * root_excess(begin, end))

    def worst_speeds(self, begin: Array, end: Array) -> tuple[NDArray[np.int64], Array, Array]:
        """The greatest: beside the body the zone grows in proportion to D, and so do the ends of arcs."""
        most = np.maximum(begin, end)
        return np.arange(len(begin)), most, most

    def kinks(self, speed: Array) -> Array:
        own = np.concatenate([self.shape.kinks, self.body.kinks])
        return np.broadcast_to(own, (len(speed), len(own)))


@dataclass(frozen=True, eq=False)
class FieldSet(Zone):
    """Fields switched by speed: the zone is that of the least case whose greatest speed is not exceeded.

    The fields are nested, so along a piece nothing is outside that of its greater end's speed.
    """

    speeds: Array  # (c,) [m/s], greatest of each case, rising
    fields: tuple[Shape, ...]  # (c,) [m], each within the next

    def case(self, speed: Array) -> NDArray[np.int64]:
        """Index of the case at `speed` [m/s], same shape; above the last that is the last."""
        found = np.searchsorted(self.speeds * (1.0 + SAME_SPEED), speed, side="left")
        return np.asarray(np.minimum(found, len(self.speeds) - 1), dtype=np.int64)

    def support(self, angle: Array, speed: Array) -> Array:
        angle, case = np.broadcast_arrays(angle, self.case(np.asarray(speed)))
        h = np.empty(angle.shape)
        for index in np.unique(case):
            here = case == index
            h[here] = self.fields[index].support(angle[here])
        return h

    def extent(self, speed: Array) -> Array:
        reach = np.array([field.extent for field in self.fields])
        return np.asarray(reach[self.case(speed)])

    def along(self, begin: Array, end: Array, curvature: Array, length: Array) -> Pieces:
        fastest = np.maximum(begin, end)
        return Pieces(fastest, fastest, curvature**2 * self.extent(fastest), np.zeros_like(fastest))

    def worst_speeds(self, begin: Array, end: Array) -> tuple[NDArray[np.int64], Array, Array]:
        """The greatest of each case: its field stays the same, and a shorter arc is part of a longer."""
        least, most = np.minimum(begin, end), np.maximum(begin, end)
        across = (least[:, None] < self.speeds) & (self.speeds < most[:, None])
        index, case = np.nonzero(across)
        speed = np.concatenate([most, self.speeds[case]])
        return np.concatenate([np.arange(len(most)), index]), speed, speed

    def kinks(self, speed: Array) -> Array:
        return np.asarray(self._kinks[self.case(speed)])

    @cached_property
    def _kinks(self) -> Array:
        """(c, k) of each field, the last repeated; zero where it has none."""
        own = [field.kinks if len(field.kinks) else np.zeros(1) for field in self.fields]
        most = max(len(angles) for angles in own)
        return np.stack([np.pad(angles, (0, most - len(angles)), mode="edge") for angles in own])


@dataclass(frozen=True, eq=False)
class ForeignZone(Zone):
    """A zone that is no gauge zone, of a plugin: its own support function is taken at its word.

    It grows with speed, so along a piece nothing is outside that of its greater end's speed.
    """

    reach: Callable[[Array, Array], Array]  # of angle [rad] and speed [m/s], broadcast: [m]
    own_kinks: Array  # (k,) [rad]

    def support(self, angle: Array, speed: Array) -> Array:
        return np.asarray(self.reach(angle, speed), dtype=float)

    def extent(self, speed: Array) -> Array:
        """As in `shapes.Measured`: the zone lies within its tangents at even angles."""
        even = np.linspace(-np.pi, np.pi, _DIRECTIONS, endpoint=False)
        h = self.support(even, np.asarray(speed)[..., None])
        return np.asarray(h.max(axis=-1) / np.cos(np.pi / _DIRECTIONS))

    def along(self, begin: Array, end: Array, curvature: Array, length: Array) -> Pieces:
        fastest = np.maximum(begin, end)
        return Pieces(fastest, fastest, curvature**2 * self.extent(fastest), np.zeros_like(fastest))

    def kinks(self, speed: Array) -> Array:
        return np.broadcast_to(self.own_kinks, (len(speed), len(self.own_kinks)))

    @property
    def tight(self) -> bool:
        return False


_DIRECTIONS = 64
