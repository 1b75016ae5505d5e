"""The report's pictures as files for papers: PDF or SVG, one column or two wide, letters of 6 pt or more.

A picture is scaled as a whole, lines and letters alike. Of its two drawings, that for small screens is made
for a width at which letters stay legible in one column; the wide one takes two. Letters that would still
come out a little too small are raised.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.figure import Figure
from matplotlib.text import Text
from pypdf import PdfReader, PdfWriter

from verify.by_products import FIGURES, FIGURES_LIST, FigureFormat, list_entry
from verify.markdown import paragraph, unmarked
from verify.report.section import Section
from verify.report.svg import Drawn, Picture, arrange, drawing_style, new_layout

COLUMN = 88.0  # [mm], of a page with two columns
TWO_COLUMNS = 181.0  # [mm]
LEAST_LETTERS = 6.0  # [pt] on paper, the least that publishers take
MOST_RAISED = 1.2  # by this factor letters may be raised to that: a fifth more fits beside the lines
MM_PER_INCH = 25.4

_EMBEDDED: Any = {
    "pdf.fonttype": 42,  # TrueType, as publishers ask: letters stay text
    "svg.fonttype": "path",  # outlines: no reader needs the font
}


@dataclass(frozen=True, kw_only=True)
class PaperFigure:
    """A drawing and the width that it gets."""

    figure: Figure
    width: float  # [mm]

    @property
    def scale(self) -> float:
        """Size on paper over the size at which it was drawn."""
        return self.width / (MM_PER_INCH * float(self.figure.get_size_inches()[0]))

    @property
    def height(self) -> float:
        """[mm]"""
        return MM_PER_INCH * float(self.figure.get_size_inches()[1]) * self.scale

    @property
    def least_letters(self) -> float:
        """Size [pt] of the smallest letters on paper; that to aim at where there are none."""
        sizes = [float(text.get_fontsize()) for text in _texts(self.figure)]
        return self.scale * min(sizes) if sizes else LEAST_LETTERS


def write_figures(
    folder: Path, values: Iterable[object], form: FigureFormat, *, name: str
) -> dict[str, PaperFigure]:
    """Write each picture of a report as `figures/<key>.pdf` or `.svg`, and a list with captions beside them.

    The figures are changed on the way: letters may be raised. The same picture gives the same file.

    Parameters
    ----------
    folder : the result folder.
    values : what the report's template is given; pictures in sections and sequences of it are written.
    name : the scenario's, for the titles in the files.

    Returns
    -------
    What was written, by key.

    Raises
    ------
    OSError : a file cannot be written.
    """
    (folder / FIGURES).mkdir(exist_ok=True)
    written: dict[str, PaperFigure] = {}
    lines = [
        f"# Figures of {unmarked(name)}",
        "",
        f"The pictures of the report, {COLUMN:g} mm wide for one column and {TWO_COLUMNS:g} mm for two, "
        f"letters of {LEAST_LETTERS:g} pt or more, fonts embedded. A run replaces them.",
    ]
    with drawing_style(), matplotlib.rc_context(_EMBEDDED):
        for picture in pictures_of(values):
            paper = choose(picture)
            if paper is None:
                continue
            _raise_letters(paper)
            file = folder / FIGURES / f"{picture.key}.{form}"
            about = {"Title": f"{name}: {picture.title}", "Subject": picture.description}
            file.write_bytes(_pdf(paper, about) if form == "pdf" else _svg(paper, picture.key, about))
            written[picture.key] = paper
            lines += [
                "",
                list_entry(file.name),
                "",
                f"{paragraph(picture.title)}. {paper.width:g} x {paper.height:.0f} mm.",
            ]
            lines += ["", paragraph(picture.caption or picture.description)]
    (folder / FIGURES_LIST).write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")
    return written


def pictures_of(values: Iterable[object]) -> Iterator[Picture]:
    """All pictures in sections and sequences, in their order."""
    for value in values:
        if isinstance(value, Picture):
            yield value
        elif isinstance(value, Section):
            yield from value.pictures
        elif isinstance(value, list | tuple):
            yield from pictures_of(value)


def choose(picture: Picture) -> PaperFigure | None:
    """The narrowest column in which a picture's letters are, or can be made, large enough.

    None of a picture that is no figure of ours. Where even two columns leave the letters too small, two
    columns it is: they are raised all the same.
    """
    order = ((picture.narrow, COLUMN), (picture.svg, COLUMN), (picture.svg, TWO_COLUMNS))
    tried = [
        PaperFigure(figure=drawn.figure, width=width)
        for drawn, width in order
        if isinstance(drawn, Drawn) and drawn.figure is not None
    ]
    fits = (paper for paper in tried if paper.least_letters * MOST_RAISED >= LEAST_LETTERS)
    return next(fits, tried[-1] if tried else None)


def _texts(figure: Figure) -> list[Text]:
    found = figure.findobj(Text)
    return [text for text in found if isinstance(text, Text) and text.get_visible() and text.get_text()]


def _raise_letters(paper: PaperFigure) -> None:
    """Letters below the least size become as large as that, and the axes make room."""
    least = LEAST_LETTERS / paper.scale
    small = [text for text in _texts(paper.figure) if float(text.get_fontsize()) < least]
    if not small:
        return
    for text in small:
        text.set_fontsize(least)
    if any(axes.get_subplotspec() is not None for axes in paper.figure.axes):  # placed by the layout
        paper.figure.set_layout_engine(new_layout())
        arrange(paper.figure)


def _pdf(paper: PaperFigure, about: Mapping[str, str]) -> bytes:
    drawn, scaled = io.BytesIO(), io.BytesIO()
    paper.figure.savefig(drawn, format="pdf", metadata={"CreationDate": None})
    writer = PdfWriter()
    page = writer.add_page(PdfReader(drawn).pages[0])
    page.scale_by(paper.scale)
    page.compress_content_streams()
    writer.add_metadata({f"/{key}": value for key, value in about.items()})
    writer.write(scaled)
    return scaled.getvalue()


def _svg(paper: PaperFigure, key: str, about: Mapping[str, str]) -> bytes:
    drawn = io.StringIO()
    described = {"Title": about["Title"], "Description": about["Subject"]}
    with matplotlib.rc_context({"svg.hashsalt": key}):
        paper.figure.savefig(drawn, format="svg", metadata={**described, "Date": None})
    head, opening, rest = drawn.getvalue().partition("<svg ")
    tag, close, inside = rest.partition(">")
    sizes = {"width": paper.width, "height": paper.height}
    for side, size in sizes.items():
        tag = re.sub(rf'\b{side}="[^"]*"', f'{side}="{size:.6g}mm"', tag, count=1)
    return (head + opening + tag + close + inside).encode()
