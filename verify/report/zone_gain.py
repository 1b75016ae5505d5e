"""Two motions of the same robot on one scale: where along the way the one is ahead of the other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from verify.report.figures_zone import runs
from verify.report.zone_along import KEYS, ZoneAlong
from vnav_drake.plan import Trajectory

Array = NDArray[np.float64]

APART = 0.08  # of the executed path's length: motions further apart than this drive different ways
SHORT = 0.04  # of the path: stretches shorter than this are told with a neighbour


@dataclass(frozen=True, kw_only=True)
class Gain:
    """Uniform braking beside the motion with the zone, on the scale of the latter's path; (n,) each."""

    s: Array  # [m], along the motion with the zone
    v: Array  # [m/s], of the motion with uniform braking where it passes
    saved: Array  # [s], how much longer uniform braking took to get there
    same_way: bool  # else the two are compared at equal shares of their ways

    @property
    def total(self) -> float:
        """[s]"""
        return float(self.saved[-1])


@dataclass(frozen=True, kw_only=True)
class Stretch:
    """A part of the way held mostly by one limit."""

    first: float  # [m]
    last: float  # [m]
    key: str  # of `zone_along.LIMITS`
    share: float  # of its length on which that limit holds
    time: float  # [s]
    saved: float | None  # [s] against uniform braking, None without it


def gain(along: ZoneAlong, uniform: Trajectory) -> Gain:
    """Where `uniform` passes beside each instant of the motion with the zone.

    Beside: the nearest place of its path, never further back than before; where the two are far apart at
    some place, they drive different ways, and equal shares of their lengths are compared.
    """
    lasting = np.concatenate([[True], np.diff(uniform.arc_length) > 0.0])
    s, x, y = uniform.arc_length[lasting], uniform.x[lasting], uniform.y[lasting]
    line = shapely.LineString(np.column_stack([x, y]))
    points = shapely.points(np.column_stack([along.x, along.y]))
    share = s[-1] * along.s / along.s[-1]
    same = bool(shapely.distance(line, points).max() <= APART * along.s[-1])
    at = np.maximum.accumulate(shapely.line_locate_point(line, points)) if same else share
    at[0], at[-1] = 0.0, s[-1]
    rows = np.clip(np.searchsorted(s, at, side="right") - 1, 0, len(s) - 2)
    t, v = uniform.t[lasting], uniform.v[lasting]
    part = (at - s[rows]) / np.diff(s)[rows]
    speed = np.sqrt((1.0 - part) * v[rows] ** 2 + part * v[rows + 1] ** 2)  # v^2 is linear within a row
    later = t[rows] + 2.0 * (at - s[rows]) / np.maximum(speed + v[rows], 1e-9)
    return Gain(s=along.s, v=speed, saved=later - t[0] - (along.t - along.t[0]), same_way=same)


def stretches(along: ZoneAlong, found: Gain | None) -> Sequence[Stretch]:
    """The way cut where another limit takes hold, short stretches joined to the longer neighbour."""
    steps = np.diff(along.s)
    label = along.limit.copy()
    for _ in range(len(label)):
        parts = runs(label)
        sizes = [float(along.s[min(b + 1, len(label) - 1)] - along.s[a]) for a, b in parts]
        least = int(np.argmin(sizes))
        if len(parts) == 1 or sizes[least] >= SHORT * along.s[-1]:
            break
        beside = [k for k in (least - 1, least + 1) if 0 <= k < len(parts)]
        into = max(beside, key=lambda k: sizes[k])
        a, b = parts[least]
        label[a : b + 1] = label[parts[into][0]]
    told = []
    for a, b in runs(label):
        end = min(b + 1, len(label) - 1)
        own = along.limit[a:end] == label[a]
        length = float(along.s[end] - along.s[a])
        told.append(
            Stretch(
                first=float(along.s[a]),
                last=float(along.s[end]),
                key=KEYS[label[a]],
                share=float(steps[a:end][own].sum()) / length if length > 0.0 else 1.0,
                time=float(along.t[end] - along.t[a]),
                saved=None if found is None else float(found.saved[end] - found.saved[a]),
            )
        )
    return told
