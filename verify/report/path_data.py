"""Path data of SVG in few letters: relative, with no more digits than asked for.

SVG 2, sec. 9.3: numbers need no space before a sign, nor before a point where the number before has one;
a command letter that repeats may be left out.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

DECIMALS = 2  # a hundredth of a pixel
_TOKEN = re.compile(r"[A-Za-z]|[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?")
_PAIRS = {"M": 1, "L": 1, "Q": 2, "C": 3}  # points of one step of a command


def compact(data: str, decimals: int = DECIMALS) -> str:
    """Absolute path data (M, L, Q, C, Z) as relative data, every point rounded to `decimals`.

    Each point is rounded by itself before differences are taken, so nothing adds up along the path.

    Raises
    ------
    ValueError : the data hold another command, or numbers that do not make up points.
    """
    unit = 10.0**decimals
    tokens = _TOKEN.findall(data)
    written: list[str] = []
    here = begin = (0, 0)
    said, command, i = "", "", 0
    while i < len(tokens):
        if tokens[i].isalpha():
            command, i = tokens[i].upper(), i + 1
            if command == "Z":
                written.append("z")
                here, said = begin, ""
                continue
        pairs = _PAIRS.get(command)
        if pairs is None or i + 2 * pairs > len(tokens):
            raise ValueError(f"path data {data[:40]!r}: command {command!r} cannot be read")
        numbers = [round(float(token) * unit) for token in tokens[i : i + 2 * pairs]]
        i += 2 * pairs
        origin, here = here, (numbers[-2], numbers[-1])
        steps = [number - origin[k % 2] for k, number in enumerate(numbers)]
        letter, steps = _letter(command, steps)
        if command == "M":
            begin, command = here, "L"  # further pairs are lines
            said = "l" if written else ""  # after the absolute M they would be absolute too
            written.append(("m" if written else "M") + _joined(steps, decimals))
            continue
        words = _joined(steps, decimals)
        if letter != said or not written:
            written.append(letter + words)
        elif words[0] == "-" or (words[0] == "." and "." in _last(written[-1])):
            written.append(words)
        else:
            written.append(" " + words)
        said = letter
    return "".join(written)


def polyline(points: NDArray[np.float64], *, closed: bool = False) -> str:
    """Absolute path data of a polyline (n, 2), n >= 2."""
    pairs = [f"{x:.6g} {y:.6g}" for x, y in points.tolist()]
    return f"M {' L '.join(pairs)}{' Z' if closed else ''}"


def _letter(command: str, steps: list[int]) -> tuple[str, list[int]]:
    if command == "L" and steps[1] == 0:
        return "h", steps[:1]
    if command == "L" and steps[0] == 0:
        return "v", steps[1:]
    return command.lower(), steps


def _joined(steps: Iterable[int], decimals: int) -> str:
    text = before = ""
    for step in steps:
        word = _written(step, decimals)
        bare = not text or word[0] == "-" or (word[0] == "." and "." in before)
        text, before = text + ("" if bare else " ") + word, word
    return text


def _last(words: str) -> str:
    """The last number in a stretch of path data."""
    return re.split(r"[ A-Za-z]|(?=-)", words)[-1]


@lru_cache(maxsize=65536)
def _written(step: int, decimals: int) -> str:
    if decimals == 0:
        return str(step)
    whole, part = divmod(abs(step), 10**decimals)
    rest = f"{part:0{decimals}d}".rstrip("0")
    return ("-" if step < 0 else "") + (f"{whole or ''}.{rest}" if rest else str(whole))
