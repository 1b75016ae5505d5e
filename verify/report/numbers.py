"""Numbers as text, with the digits they deserve. A missing number is a dash, never zero."""

from __future__ import annotations

import math
from collections.abc import Mapping
from decimal import ROUND_FLOOR, Context, Decimal
from typing import Any

DASH = "–"
LONGEST = 400  # digits: more than any float has before its point, and ten decimals
SPACE = "\u00a0"  # keeps a number and its unit on one line
_SUPERSCRIPT = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


def number_in(tree: Any, *keys: str) -> float | None:
    """The finite number at `keys` of nested mappings, or None."""
    for key in keys:
        if not isinstance(tree, Mapping):
            return None
        tree = tree.get(key)
    if isinstance(tree, bool) or not isinstance(tree, int | float) or not math.isfinite(tree):
        return None
    return float(tree)


def _minus(text: str) -> str:
    return text.replace("-", "−")


def power_of_ten(exponent: int) -> str:
    """10⁻³ and the like."""
    return "10" + str(exponent).translate(_SUPERSCRIPT)


def significant(value: float | None, digits: int = 3) -> str:
    """`digits` significant digits; powers of ten outside 1e-3 .. 1e6."""
    if value is None or not math.isfinite(value):
        return DASH
    if value == 0.0:
        return "0"
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    power = int(exponent)
    if -3 <= power < 6:
        return _minus(f"{float(f'{mantissa}e{power}'):.{max(0, digits - 1 - power)}f}")
    return _minus(mantissa) + "\u00a0×\u00a0" + power_of_ten(power)


def exact(value: float | None) -> str:
    """A chosen number, such as a limit, with no more digits than it was given: 0.05, 10⁻⁶."""
    if value is None or not math.isfinite(value):
        return DASH
    text = f"{value:.6g}"
    if "e" not in text:
        return _minus(text)
    mantissa, exponent = text.split("e")
    power = power_of_ten(int(exponent))
    return power if mantissa == "1" else f"{_minus(mantissa)}{SPACE}×{SPACE}{power}"


def seconds(value: float | None) -> str:
    """Travel times: milliseconds matter."""
    return DASH if value is None else _minus(f"{value:.3f}") + SPACE + "s"


def seconds_proven(value: float | None) -> str:
    """Lower bounds, rounded down: what is written is proven too."""
    if value is None:
        return DASH
    return rounded(value, 3, ROUND_FLOOR) + SPACE + "s"


def rounded(value: float, decimals: int, way: str) -> str:
    """`value` with so many decimals, rounded one way (a rounding mode of `decimal`) from its exact value."""
    unit = Decimal(1).scaleb(-decimals)
    return _minus(str(Decimal(value).quantize(unit, rounding=way, context=Context(prec=LONGEST))))


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
    size = abs(value)
    if size != 0.0 and size < 5e-4:
        return f"<{SPACE}0.001{SPACE}%" if value > 0.0 else f">{SPACE}−0.001{SPACE}%"
    digits = 3 if size < 1.0 else 2 if size < 10.0 else 1
    text = f"{value:+.{digits}f}" if signed else f"{value:.{digits}f}"
    return _minus(text) + SPACE + "%"


def fine_percent(ratio: float) -> str:
    """A signed gap, two digits of it however small: the exact and the optimised time differ by millionths."""
    if abs(100.0 * ratio) >= 5e-4 or ratio == 0.0:
        return percent(ratio, signed=True)
    sign = "+" if ratio > 0.0 else ""
    return f"{sign}{significant(100.0 * ratio, 2)}{SPACE}%"


_SMALLER = ((1.0, 1.0, "m"), (1e-3, 1e-3, "mm"), (1e-6, 1e-6, "µm"))


def with_unit(value: float | None, unit: str) -> str:
    """A margin or worst value in its unit; small lengths in mm or µm."""
    if value is None:
        return DASH
    if unit == "s":
        return seconds(value)
    if unit == "m":
        size = abs(value)
        if size >= 100.0:
            return metres(value)
        for least, scale, name in _SMALLER:
            if size >= 0.1 * least or (name == "µm" and size >= 1e-9):
                return significant(value / scale) + SPACE + name
        if value != 0.0:
            return f"<{SPACE}1{SPACE}nm" if value > 0.0 else f">{SPACE}−1{SPACE}nm"
    text = significant(value)
    return f"{text}{SPACE}{unit}" if unit and unit != "1" else text


def count(value: float | None) -> str:
    """Whole numbers, thousands apart."""
    return DASH if value is None else _minus(f"{round(value):,}").replace(",", "\u202f")
