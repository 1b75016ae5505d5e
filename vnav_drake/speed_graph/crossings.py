"""Which gates the edges of a speed graph cross.

A half-gate is radial: it stands on its feature and spans the whole height of a strip. So a leg from theta1
to theta2 crosses exactly the half-gates of its strip with theta between, and a piece of a border those with
u between.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vnav_drake.homotopy import Gates
from vnav_drake.speed_graph.cells import TURN, Strips
from vnav_drake.speed_graph.members import Members, Pairs
from vnav_drake.speed_graph.sampling import Samples

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

_ASIDE = 1e-6  # of the arc's length: a gate through a sample is taken to lie this far beside it


@dataclass(frozen=True)
class Crossings:
    """Signed gates in the order in which growing theta, then growing u, meets them."""

    strips: Strips
    samples: Samples
    letters: Indices  # signed gates, 1-based: those of all strips, then those of all borders
    strip_key: Array  # increasing, of the strips' part of `letters`
    strip_count: Indices  # (n,) half-gates of each strip, counted once
    curve_key: Array  # increasing, of the borders' part

    def of_legs(self, members: Members, pairs: Pairs) -> tuple[Indices, Indices]:
        """Slices of `letters` that legs cross."""
        place = np.searchsorted(self.strip_key, _strip_key(self.strips, members.strip, members.theta))
        begin, end = place[pairs.first], place[pairs.second]
        return begin, end + np.where(pairs.wraps, self.strip_count[members.strip[pairs.first]], 0)

    def of_pieces(self, first: Indices) -> tuple[Indices, Indices]:
        """Slices of `letters` that pieces of borders cross, each from a station to the next."""
        samples = self.samples
        key = _curve_key(self.strips, samples.station_curve, samples.station_parameter)
        place = np.searchsorted(self.curve_key, key) + len(self.strip_key)
        return place[first], place[first + 1]


def gate_crossings(strips: Strips, gates: Gates, samples: Samples) -> Crossings:
    """The half-gates of all strips and the gates of all borders, in order."""
    border = np.asarray(gates.border, dtype=np.int64)
    u = _beside_stations(strips, border, np.asarray(gates.parameter, dtype=float), samples)
    number = np.arange(1, len(border) + 1)
    side = np.concatenate([2 * border, 2 * border + 1])
    strip = strips.side_strip[side]
    theta = strips.wrapped(strip, strips.theta(side, np.tile(u, 2)))
    letter = np.tile(number, 2) * np.where(strips.rate[side] > 0.0, 1, -1)
    again = strips.periodic[strip]  # once more, one turn on
    count = np.bincount(strip, minlength=len(strips))
    key = _strip_key(strips, np.append(strip, strip[again]), np.append(theta, theta[again] + TURN))
    letter = np.append(letter, letter[again])
    by_strip, curve_key = np.argsort(key), _curve_key(strips, border, u)
    by_curve = np.argsort(curve_key)
    letters = np.concatenate([letter[by_strip], number[by_curve]])
    return Crossings(strips, samples, letters, key[by_strip], count, curve_key[by_curve])


def _beside_stations(strips: Strips, border: Indices, u: Array, samples: Samples) -> Array:
    """Parameters of gates, moved off stations that they run through."""
    span = strips.diagram.curves.span[border]
    width = span[:, 1] - span[:, 0]
    station = _curve_key(strips, samples.station_curve, samples.station_parameter)
    share = _curve_key(strips, border, u)
    near = np.searchsorted(station, share)
    at = np.clip(np.stack([near - 1, near]), 0, len(station) - 1)
    touches = (np.abs(station[at] - share) < 0.25 * _ASIDE).any(axis=0)
    inward = np.where(u < 0.5 * (span[:, 0] + span[:, 1]), 1.0, -1.0)
    return np.where(touches, u + inward * _ASIDE * width, u)


def _strip_key(strips: Strips, strip: Indices, theta: Array) -> Array:
    """Orders strips first, theta second, over two turns."""
    width = np.maximum(strips.high - strips.low, np.finfo(float).tiny)[strip]
    return np.asarray(4.0 * strip + np.clip((theta - strips.low[strip]) / width, 0.0, 2.0), dtype=np.float64)


def _curve_key(strips: Strips, curve: Indices, u: Array) -> Array:
    """Orders borders first, u second."""
    span = strips.diagram.curves.span[curve]
    width = np.maximum(span[:, 1] - span[:, 0], np.finfo(float).tiny)
    return np.asarray(2.0 * curve + np.clip((u - span[:, 0]) / width, 0.0, 1.0), dtype=np.float64)
