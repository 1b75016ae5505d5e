"""Exact numbers: Python integers over a common power of two, with directed rounding where one must round.

Every double is such a number. Sums, differences and products of them are again, without any rounding;
quotients and square roots are rounded in a direction that the caller names.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

Integers = NDArray[np.object_]

_isqrt: Callable[[Any], Any] = np.frompyfunc(math.isqrt, 1, 1)


@dataclass(frozen=True, eq=False)
class Dyadic:
    """An array of numbers `numerator / 2**places`."""

    numerator: Integers
    places: int

    def __post_init__(self) -> None:
        # numpy hands out plain integers for arrays without axes
        object.__setattr__(self, "numerator", np.asarray(self.numerator, dtype=object))

    @classmethod
    def of(cls, numbers: ArrayLike) -> Self:
        """The finite doubles, exactly; same shape."""
        values = np.asarray(numbers, dtype=np.float64)
        fraction, exponent = np.frexp(values)
        mantissa = np.ldexp(fraction, 53).astype(np.int64)  # value = mantissa 2^(exponent - 53)
        # Trailing zeros dropped, so that plain numbers stay short.
        low = mantissa & -mantissa
        spare = np.where(mantissa == 0, 0, np.frexp(low.astype(np.float64))[1] - 1).astype(np.int64)
        mantissa >>= spare
        shift = exponent.astype(np.int64) - 53 + spare
        places = max(0, -int(np.min(shift, where=mantissa != 0, initial=0)))
        lift = np.where(mantissa == 0, 0, shift + places)
        return cls(_objects(mantissa) << _objects(lift), places)

    @classmethod
    def integers(cls, numbers: NDArray[np.int64]) -> Self:
        """Integers, exactly; same shape."""
        return cls(_objects(numbers), 0)

    def __getitem__(self, index: Any) -> Dyadic:
        return Dyadic(self.numerator[index], self.places)

    def __add__(self, other: Dyadic) -> Dyadic:
        mine, its, places = self.aligned(other)
        return Dyadic(mine + its, places)

    def __sub__(self, other: Dyadic) -> Dyadic:
        mine, its, places = self.aligned(other)
        return Dyadic(mine - its, places)

    def __mul__(self, other: Dyadic) -> Dyadic:
        return Dyadic(self.numerator * other.numerator, self.places + other.places)

    def scaled(self, power: int) -> Dyadic:
        """Times 2**power."""
        if self.places >= power:
            return Dyadic(self.numerator, self.places - power)
        return Dyadic(self.numerator << (power - self.places), 0)

    def sign(self) -> NDArray[np.int8]:
        """-1, 0 or 1; same shape."""
        positive, negative = self.numerator > 0, self.numerator < 0
        return np.asarray(positive, dtype=np.int8) - np.asarray(negative, dtype=np.int8)

    def not_above(self, other: Dyadic) -> NDArray[np.bool_]:
        """Whether each number is at most the other."""
        return np.asarray((other - self).sign() >= 0)

    def over(self, other: Dyadic, places: int, *, up: bool) -> Dyadic:
        """Quotient by positive numbers, rounded up or down to a multiple of 2**-places."""
        lift = places + other.places - self.places
        above, below = self.numerator, other.numerator
        above, below = (above << lift, below) if lift >= 0 else (above, below << -lift)
        return Dyadic(-(-above // below) if up else above // below, places)

    def root_up(self, places: int) -> Dyadic:
        """Square root of numbers >= 0, rounded up to a multiple of 2**-places."""
        lift = 2 * places - self.places
        # ceil(sqrt(x)) = ceil(sqrt(ceil(x))), as the square of an integer is an integer
        inside = self.numerator << lift if lift >= 0 else -(-self.numerator >> -lift)
        root = _isqrt(inside)
        return Dyadic(root + (root * root < inside), places)

    def float_below(self) -> NDArray[np.float64]:
        """Doubles that are no greater, and no more than a few units of rounding less; same shape."""
        size = 1 << self.places
        near = np.frompyfunc(lambda n: _below(n, size), 1, 1)(self.numerator)
        return np.asarray(near, dtype=np.float64)

    def aligned(self, other: Dyadic) -> tuple[Integers, Integers, int]:
        """Numerators of both over the same power of two, and that power."""
        places = max(self.places, other.places)
        mine = self.numerator << (places - self.places) if places > self.places else self.numerator
        its = other.numerator << (places - other.places) if places > other.places else other.numerator
        return mine, its, places


def _objects(numbers: NDArray[np.int64]) -> Integers:
    return np.asarray(numbers, dtype=np.int64).astype(object)


def _below(numerator: int, denominator: int) -> float:
    try:
        value = numerator / denominator  # correctly rounded, so at most half a unit too great
    except OverflowError:
        return sys.float_info.max if numerator > 0 else -math.inf
    return math.nextafter(value, -math.inf) if value else value - (numerator < 0) * 5e-324
