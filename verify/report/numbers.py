"""Numbers as text, with the digits they deserve. A missing number is a dash, never zero."""

from __future__ import annotations

import math
from collections.abc import Mapping
from decimal import ROUND_CEILING, ROUND_FLOOR, ROUND_HALF_EVEN, Decimal
from typing import Any

from verify.digits import digits_beside, rounded, tells_side, written
from verify.metrics import finite_number

DASH = "–"
FEWEST, MOST = 3, 9  # decimals [s] of a bracket
SPACE = "\u00a0"  # keeps a number and its unit on one line
_SUPERSCRIPT = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


def number_in(tree: Any, *keys: str) -> float | None:
    """The finite number at `keys` of nested mappings, or None."""
    for key in keys:
        if not isinstance(tree, Mapping):
            return None
        tree = tree.get(key)
    return finite_number(tree)


def _minus(text: str) -> str:
    return text.replace("-", "−")


def power_of_ten(exponent: int) -> str:
    """10⁻³ and the like."""
    return "10" + str(exponent).translate(_SUPERSCRIPT)


def significant(value: float | Decimal | None, digits: int = 3) -> str:
    """`digits` significant digits; powers of ten outside 1e-3 .. 1e6."""
    if value is None or not math.isfinite(value):
        return DASH
    if value == 0:
        return "0"
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    power = int(exponent)
    if -3 <= power < 6:
        return _minus(f"{Decimal(f'{mantissa}e{power}'):.{max(0, digits - 1 - power)}f}")
    return _minus(mantissa) + "\u00a0×\u00a0" + power_of_ten(power)


def exact(value: float | None) -> str:
    """A chosen number, such as a limit, with the digits it was given: 0.05, 10⁻⁶."""
    return DASH if value is None or not math.isfinite(value) else _exact(written(value))


def exact_percent(ratio: float) -> str:
    """A chosen ratio in percent, with the digits it was given: 3 %, 10⁻⁵ %."""
    return DASH if not math.isfinite(ratio) else _exact(100 * written(ratio)) + SPACE + "%"


def _exact(value: Decimal) -> str:
    value = value.normalize()
    if value == 0 or Decimal("1e-4") <= abs(value) < Decimal("1e6"):
        return _minus(f"{value:f}")
    mantissa, exponent = f"{value:e}".split("e")
    power = power_of_ten(int(exponent))
    return power if mantissa == "1" else f"{_minus(mantissa)}{SPACE}×{SPACE}{power}"


def seconds(value: float | None) -> str:
    """Travel times: milliseconds matter."""
    return DASH if value is None else _minus(f"{value:.3f}") + SPACE + "s"


def seconds_proven(value: float | None, decimals: int = FEWEST) -> str:
    """Lower bounds, rounded down: what is written is proven too."""
    if value is None:
        return DASH
    return _minus(rounded(value, decimals, ROUND_FLOOR)) + SPACE + "s"


def bracket(lower: float, best: float) -> tuple[str, str]:
    """A lower bound, rounded down, and a time above it with the decimals that tell them apart.

    The time is rounded to nearest, as everywhere, and up only where it would not be above the bound.
    """
    apart = abs(best - lower)
    decimals = FEWEST if apart == 0.0 else min(max(1 + math.ceil(-math.log10(apart)), FEWEST), MOST)
    low, high = rounded(lower, decimals, ROUND_FLOOR), rounded(best, decimals, ROUND_HALF_EVEN)
    if lower < best and Decimal(high) <= Decimal(low):
        high = rounded(best, decimals, ROUND_CEILING)
    return _minus(low) + SPACE + "s", _minus(high) + SPACE + "s"


def duration(value: float | None) -> str:
    """Computing times: two or three digits are enough."""
    if value is None:
        return DASH
    return f"{value:.2f}{SPACE}s" if value < 10.0 else f"{value:.1f}{SPACE}s"


def metres(value: float | None) -> str:
    """Lengths of paths."""
    return DASH if value is None else _minus(f"{value:.2f}") + SPACE + "m"


def percent(ratio: float | None, *, signed: bool = False) -> str:
    """A ratio in percent: 0.003 %, 1.25 %, 12.3 %; what is smaller says so."""
    if ratio is None:
        return DASH
    value = 100.0 * ratio
    if _tiny(ratio):
        return f"<{SPACE}0.001{SPACE}%" if value > 0.0 else f">{SPACE}−0.001{SPACE}%"
    digits = _decimals(value)
    text = f"{value:+.{digits}f}" if signed else f"{value:.{digits}f}"
    return _minus(text) + SPACE + "%"


def percent_or_times(ratio: float) -> str:
    """How much more one number is than another, signed: in percent, above 100 % as a multiple."""
    return percent(ratio, signed=True) if ratio <= 1.0 else f"{significant(1.0 + ratio)} times"


def _tiny(ratio: float) -> bool:
    """Whether `percent` says no more of it than its sign and that it is small."""
    return 0.0 < abs(100.0 * ratio) < 5e-4


def _decimals(value: float) -> int:
    return 3 if abs(value) < 1.0 else 2 if abs(value) < 10.0 else 1


def fine_percent(ratio: float) -> str:
    """A signed gap, two digits of it however small: the exact and the optimised time differ by millionths."""
    if abs(100.0 * ratio) >= 5e-4 or ratio == 0.0:
        return percent(ratio, signed=True)
    sign = "+" if ratio > 0.0 else ""
    return f"{sign}{significant(100.0 * ratio, 2)}{SPACE}%"


def percent_beside(ratio: float | None, limit: float | None, *, signed: bool = False) -> str:
    """A ratio in percent with as many digits as show on which side of `limit` it is."""
    if ratio is None or limit is None:
        return percent(ratio, signed=signed)
    value = 100.0 * ratio
    if _tiny(ratio):
        told = not 0.0 < math.copysign(1.0, ratio) * limit < 1e-5
    else:
        told = tells_side(Decimal(f"{value:.{_decimals(value)}f}") / 100, ratio, limit)
    if told:
        return percent(ratio, signed=signed)
    sign = "+" if signed and ratio > 0.0 else ""
    return f"{sign}{significant(100 * written(ratio), digits_beside(ratio, limit, 2))}{SPACE}%"


_SMALLER = ((1.0, 1.0, "m"), (1e-3, 1e-3, "mm"), (1e-6, 1e-6, "µm"))


def with_unit(value: float | None, unit: str, digits: int | None = None) -> str:
    """A margin or worst value in its unit; small lengths in mm or µm. `digits`: significant ones."""
    if value is None:
        return DASH
    if unit == "s":
        return seconds(value)
    if unit == "m":
        size = abs(value)
        if size >= 100.0 and digits is None:
            return metres(value)
        for least, scale, name in _SMALLER:
            if size >= 0.1 * least or (name == "µm" and size >= 1e-9):
                scaled = written(value) / written(scale)
                return significant(scaled, digits or 3) + SPACE + name
        if value != 0.0 and digits is None:
            return f"<{SPACE}1{SPACE}nm" if value > 0.0 else f">{SPACE}−1{SPACE}nm"
    text = significant(value, digits or 3)
    return f"{text}{SPACE}{unit}" if unit and unit != "1" else text


def with_unit_beside(value: float, limit: float, unit: str) -> str:
    """The same with as many digits as show on which side of `limit` it is."""
    fewest = 2 if unit == "1" else 3 if abs(value) < 100.0 else 5
    digits = digits_beside(value, limit, fewest)
    minute = unit == "m" and 0.0 < abs(value) < 1e-9  # then no more is said than its sign, where that will do
    if minute and not 0.0 < math.copysign(1.0, value) * limit < 1e-9:
        return with_unit(value, unit)
    return with_unit(value, unit, digits)


def count(value: float | None) -> str:
    """Whole numbers, thousands apart."""
    return DASH if value is None else _minus(f"{round(value):,}").replace(",", "\u202f")
