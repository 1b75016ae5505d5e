"""docs/reproduction.md, written whole from docs/data/reproduction.json.

A topic is a module of this package with

    def measure() -> dict                       plain JSON: what is printed, with its place, and ours
    def section(data) -> str                    Markdown that begins with a heading; every number from data
    def summary(data) -> list[Row]              rows of the table at the top of the page
    def figures(data) -> dict[str, Figure]      optional: NAME is drawn to docs/images/reproduction_NAME.svg

and its name in TOPICS. The last two may be left out.
"""

from __future__ import annotations

import importlib
import importlib.util
import json
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

from benchmarks.figures import STYLE

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "reproduction.md"
DATA = ROOT / "docs" / "data" / "reproduction.json"
IMAGES = ROOT / "docs" / "images"

# In the order of the page.
TOPICS = ("warehouse", "office", "room", "two_rooms", "clusters", "create", "fire", "ratios")

Data = dict[str, Any]

_NUMBERS = re.compile(r"\[[-+.\deE,\s]+\]")  # a list of nothing else, which goes on one line


@dataclass(frozen=True, kw_only=True)
class Row:
    """One printed figure beside ours."""

    what: str
    place: str  # in the thesis
    printed: str
    ours: str
    note: str  # what it means, in a few words


@dataclass(frozen=True, kw_only=True)
class Topic:
    """A module of this package that keeps the agreement above."""

    name: str
    measure: Callable[[], Data]
    section: Callable[[Data], str]
    summary: Callable[[Data], Sequence[Row]]
    figures: Callable[[Data], Mapping[str, Figure]]


def topics() -> dict[str, Topic]:
    """All topics of TOPICS that there is a module of, by name."""
    found = {}
    for name in TOPICS:
        place = f"{__package__}.{name}"
        if importlib.util.find_spec(place) is None:
            continue
        module = importlib.import_module(place)
        found[name] = Topic(
            name=name,
            measure=module.measure,
            section=module.section,
            summary=getattr(module, "summary", _no_rows),
            figures=getattr(module, "figures", _no_figures),
        )
    return found


def _no_rows(_data: Data) -> list[Row]:
    return []


def _no_figures(_data: Data) -> dict[str, Figure]:
    return {}


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table. Raises ValueError where a row is longer or shorter than its head."""
    lines = [head, ["---"] * len(head), *rows]
    if any(len(line) != len(head) for line in lines):
        raise ValueError(f"a row has not the {len(head)} columns of its table {list(head)}")
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def read() -> Data:
    """What is kept: `topics` (name to data) and `seconds` (name to the processor time that it took)."""
    if not DATA.exists():
        return {"topics": {}, "seconds": {}}
    return dict(json.loads(DATA.read_text(encoding="utf-8")))


def write(kept: Data) -> None:
    """Keep it, topics in the order of the page."""
    ordered = {part: {t: kept[part][t] for t in TOPICS if t in kept[part]} for part in ("topics", "seconds")}
    text = json.dumps(ordered, indent=1, allow_nan=False)
    DATA.write_text(_NUMBERS.sub(lambda found: " ".join(found[0].split()), text) + "\n", encoding="utf-8")


def draw(topic: Topic, data: Data) -> list[Path]:
    """Draw the topic's pictures; their files."""
    files = []
    with mpl.rc_context(STYLE):
        for name, figure in topic.figures(data).items():
            file = IMAGES / f"reproduction_{name}.svg"
            figure.savefig(file, facecolor="white", dpi=130, metadata={"Date": None})
            files.append(file)
    return files


def render(kept: Data) -> str:
    """The page."""
    known = {name: topic for name, topic in topics().items() if name in kept["topics"]}
    rows = [row for name, topic in known.items() for row in topic.summary(kept["topics"][name])]
    total = sum(kept["seconds"].values())
    took = f"{total / 60.0:.0f} minutes" if total >= 90.0 else f"{total:.0f} s"
    head = (
        "# The figures of Manor 2015 beside ours\n\n"
        'G. Manor, "Autonomous Mobile Robot Navigation with Velocity Constraints", PhD thesis, Technion,'
        " 2015.\n\n"
        "The page is written by `python -m benchmarks.reproduction` (`make reproduction`): about"
        f" {took} of processor time; do not edit it. What it shows is kept in"
        " [data/reproduction.json](data/reproduction.json), and a test recomputes the quick part.\n\n"
        "A **reconstruction** is a map laid out by us in the manner of the text, where the thesis gives"
        " coordinates only in a figure that cannot be read. Its times need not be those printed; where they"
        " agree that is no proof, and where they differ that is no refutation. A **contradiction** is a"
        " printed figure that its own text rules out, and comes with a proof.\n\n"
    )
    summary = table(
        ("figure", "in the thesis", "printed", "ours", "what it means"),
        ((r.what, r.place, r.printed, r.ours, r.note) for r in rows),
    )
    sections = [topic.section(kept["topics"][name]).strip() for name, topic in known.items()]
    return head + summary + "\n" + "\n\n".join(sections) + "\n"
