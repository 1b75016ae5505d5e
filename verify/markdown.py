"""Text from files in Markdown, as GitHub reads it."""

from __future__ import annotations

import re
from html import escape

_SPECIAL = re.compile(r"([\\`*_\[\]|~$])")  # begin or end emphasis, code, links, cells and formulas
_OPENING = re.compile(r"^(\d*)([#+=.)-])")  # make a line a heading, a rule, or an item of a list


def unmarked(text: str) -> str:
    """Text within a line that Markdown takes for nothing else."""
    return _SPECIAL.sub(r"\\\1", no_tags(text))


def paragraph(text: str) -> str:
    """The same as a paragraph of one line."""
    return _OPENING.sub(r"\1\\\2", unmarked(" ".join(text.split())))


def no_tags(text: str) -> str:
    """Printable text that HTML takes for nothing else."""
    return escape("".join(c if c.isprintable() or c == "\u00a0" else "\ufffd" for c in text), quote=False)
