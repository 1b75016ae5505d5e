"""Text from files: made fit to be read and drawn. Escaping is the template's work, not this module's."""

from __future__ import annotations

import re
import unicodedata

from matplotlib.font_manager import FontProperties, findfont, get_font

LABEL_LENGTH = 24  # characters of a name on a map
_INVISIBLE = ("Cc", "Cf", "Co", "Cs", "Cn", "Zl", "Zp")  # control, direction marks, unassigned


def plain(text: str) -> str:
    """Text from a file without control and direction characters; line ends become spaces."""
    spaced = re.sub(r"\s+", " ", text)
    return "".join(c for c in spaced if unicodedata.category(c) not in _INVISIBLE).strip()


def label(text: str, longest: int = LABEL_LENGTH) -> str:
    """A name that can be drawn: plain, short, and only letters that the font has."""
    font = get_font(findfont(FontProperties(family="DejaVu Sans")))
    shown = "".join(c if font.get_char_index(ord(c)) else "□" for c in plain(text))
    return shown if len(shown) <= longest else shown[: longest - 1] + "…"


_KEPT = "\n\t"


def visible(text: str) -> str:
    """Text line by line, with control and direction characters spelt out: what one reads is what it says."""
    lines = re.sub(r"\r\n?", "\n", text)
    return "".join(
        f"⟨U+{ord(c):04X}⟩"
        if c not in _KEPT and unicodedata.category(c) in ("Cc", "Cf", "Cs", "Zl", "Zp")
        else c
        for c in lines
    )
