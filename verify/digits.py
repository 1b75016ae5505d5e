"""How many digits a number needs, so as not to look as if it were on the other side of its limit."""

from __future__ import annotations

from decimal import ROUND_FLOOR, Context, Decimal

LONGEST = 400  # digits: more than any float has before its point, and ten decimals
MOST = 17  # significant digits: as many tell any two floats apart


def tells_side(shown: Decimal, value: float, limit: float) -> bool:
    """Whether a rounded `value` is as `value` is: above, at or below the limit."""
    return shown.compare(written(limit)) == written(value).compare(written(limit))


def digits_beside(value: float, limit: float, fewest: int) -> int:
    """Least number of significant digits, of `fewest` or more, that show on which side of `limit` a value is.

    Both finite and not subnormal. As many digits as the shortest decimal number has that names the value
    suffice, and more (up to 15) are zeros: such numbers are in the order of their floats.
    """
    # The float and the decimal number that names it may round to different digits: either may be shown.
    names = (value, written(value))
    return next(
        (
            n
            for n in range(fewest, MOST)
            if all(tells_side(Decimal(f"{name:.{n - 1}e}"), value, limit) for name in names)
        ),
        MOST,
    )


def beside(value: float, limit: float, digits: int) -> str:
    """`value` with that many significant digits, or more where it takes more to show its side of `limit`."""
    enough = digits_beside(value, limit, digits)
    return repr(float(value)) if enough == MOST else f"{value:.{enough}g}"  # names are in the order of floats


def as_given(limit: float) -> str:
    """A chosen number with all the digits it was given: 0.05, 1e-07."""
    short = f"{limit:.6g}"
    return short if float(short) == limit else repr(limit)


def rounded(value: float, decimals: int, way: str = ROUND_FLOOR) -> str:
    """`value` with so many decimals, rounded one way (a rounding mode of `decimal`) from its exact value."""
    unit = Decimal(1).scaleb(-decimals)
    return str(Decimal(value).quantize(unit, rounding=way, context=Context(prec=LONGEST)))


def written(value: float) -> Decimal:
    """The shortest decimal number that names the float."""
    return Decimal(repr(float(value)))
