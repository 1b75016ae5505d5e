"""What a run leaves in a result folder beside the evidence: no judge reads it, and no manifest lists it."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

PREVIOUS = "previous.json"  # key figures of the result that this one replaced
THUMBNAIL = "thumbnail.svg"  # the executed path on a small map, for the index
FIGURES = "figures"  # the report's pictures as files
FIGURES_LIST = f"{FIGURES}/README.md"  # what is in there, with captions

FigureFormat = Literal["pdf", "svg"]
FIGURE_FORMATS: Sequence[FigureFormat] = ("pdf", "svg")

_ENTRY = re.compile(r"^## \[([a-z0-9-]+\.(?:pdf|svg))\]", re.MULTILINE)


def list_entry(name: str) -> str:
    """How `FIGURES_LIST` heads what it says of one file, `name` being letters, digits, hyphens and `.pdf`."""
    return f"## [{name}]({name})"


def by_products(folder: Path) -> set[str]:
    """Names of the files in a result folder that a run wrote beside the evidence.

    Pictures are those that the folder's own list names: other files there are somebody else's. A list that
    cannot be read names none.
    """
    names = {PREVIOUS, THUMBNAIL, FIGURES_LIST}
    try:
        listed = (folder / FIGURES_LIST).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return names
    return names | {f"{FIGURES}/{name}" for name in _ENTRY.findall(listed)}
