"""Figures for papers: each picture of the page as a file, a column wide, letters legible, fonts embedded."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from pypdf import PdfReader
from report_case import HISTORY, vc_case, warehouse, write_folder, write_vc_folder

from verify.atomic import ResultFolder
from verify.by_products import FIGURES, FIGURES_LIST, by_products
from verify.evidence import manifest, write_result
from verify.report import ReportExtras, write_report
from verify.report.paper import COLUMN, LEAST_LETTERS, TWO_COLUMNS, choose, write_figures
from verify.report.section import Section
from verify.report.svg import NARROW, PANEL, WIDE, Drawn, Picture, drawing_style, new_axes, to_svg

POINTS_PER_MM = 72.0 / 25.4
KEYS = re.compile(r'<figure class="picture[^"]*" id="figure-([^"]+)"')


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A report of three motions in a warehouse with its figures as PDF."""
    made, scenario = tmp_path_factory.mktemp("paper") / "warehouse", warehouse()
    result = write_folder(made, scenario)
    extras = ReportExtras(history=HISTORY)
    file = made / "report.html"
    write_report(file, scenario=scenario, result=result, folder=made, extras=extras, figures="pdf")
    write_result(made, result)
    return made


@pytest.fixture(scope="module")
def pages(folder: Path) -> dict[str, PdfReader]:
    return {file.stem: PdfReader(file) for file in sorted((folder / FIGURES).glob("*.pdf"))}


def drawing(key: str, width: float, letters: float = 10.0) -> Drawn:
    with drawing_style():
        figure, axes = new_axes(width, 0.5 * width, x="time [s]", y="speed [m/s]")
        axes.plot([0.0, 1.0], [0.0, 1.0])
        axes.set_title("Names may hold $signs_", fontsize=12.0)
        axes.annotate("limit", (0.5, 0.5), fontsize=letters)
        return to_svg(figure, key=key, title="A line", description="One line.")


def picture(width: float, letters: float = 10.0, *, narrow: bool = False) -> Picture:
    twin = drawing("line-narrow", NARROW, letters) if narrow else None
    svg = drawing("line", width, letters)
    return Picture(key="line", title="A line", description="One line, from 0 to 1.", svg=svg, narrow=twin)


def test_every_picture_of_the_page_is_a_file(folder, pages):
    shown = KEYS.findall((folder / "report.html").read_text(encoding="utf-8"))
    assert {"bracket", "map", "friction", "mesh-map"} <= set(shown)
    assert sorted(pages) == sorted(shown)


def test_pictures_that_are_drawn_beside_a_viewer_are_files_too(tmp_path):
    scenario, _, drawn = vc_case()
    result = write_vc_folder(tmp_path / "r")
    extras, file = ReportExtras(vc_method=drawn), tmp_path / "r" / "report.html"
    write_report(file, scenario=scenario, result=result, folder=tmp_path / "r", extras=extras, figures="svg")
    written = {file.stem for file in (tmp_path / "r" / FIGURES).glob("*.svg")}
    assert written == set(KEYS.findall(file.read_text(encoding="utf-8")))
    assert {"vc-space", "vc-unfolded", "vc-cells"} <= written


def test_a_picture_is_one_column_wide_or_two(pages):
    widths = {key: float(page.pages[0].mediabox.width) / POINTS_PER_MM for key, page in pages.items()}
    for width in widths.values():
        assert width == pytest.approx(COLUMN, abs=0.01) or width == pytest.approx(TWO_COLUMNS, abs=0.01)
    assert widths["friction"] == pytest.approx(COLUMN, abs=0.01)


def fonts(page: Any) -> Iterator[Any]:
    for entry in page.get("/Resources", {}).get("/Font", {}).values():
        yield entry.get_object()


def test_fonts_are_embedded_as_truetype(pages):
    found = [font for page in pages.values() for font in fonts(page.pages[0])]
    assert len(found) >= len(pages)  # no picture is without letters
    for font in found:
        inner = font["/DescendantFonts"][0].get_object() if "/DescendantFonts" in font else font
        assert inner["/Subtype"] in ("/CIDFontType2", "/TrueType")  # as PDF calls TrueType
        assert "/FontFile2" in inner["/FontDescriptor"].get_object()  # the font's program itself


def least_letters(page: Any) -> float:
    """Size [pt] of the smallest letters as printed, from the page's own text matrices."""
    sizes: list[float] = []

    def visit(text: str, outer: list[float], matrix: list[float], _font: Any, size: float) -> None:
        if text.strip() and size:
            a, b = matrix[0] * outer[0] + matrix[1] * outer[2], matrix[0] * outer[1] + matrix[1] * outer[3]
            sizes.append(size * (a * a + b * b) ** 0.5)

    page.extract_text(visitor_text=visit)
    return min(sizes)


def test_letters_are_legible_in_print(pages):
    for key, reader in pages.items():
        assert least_letters(reader.pages[0]) >= LEAST_LETTERS - 1e-3, key  # digits of the file


def test_text_is_found_in_the_file(pages):
    text = pages["friction"].pages[0].extract_text()
    assert "across the path" in text


def test_the_file_says_what_it_shows_and_not_when(pages):
    for reader in pages.values():
        assert reader.metadata is not None
        assert reader.metadata.title.startswith("warehouse: ")
        assert reader.metadata.subject
        assert not {"/CreationDate", "/ModDate"} & set(reader.metadata)


def test_the_list_has_every_file_with_its_caption(folder, pages):
    text = (folder / FIGURES_LIST).read_text(encoding="utf-8")
    for key in pages:
        assert f"## [{key}.pdf]({key}.pdf)" in text
    assert by_products(folder) >= {f"{FIGURES}/{key}.pdf" for key in pages}


@pytest.mark.parametrize("form", ["pdf", "svg"])
def test_the_same_picture_gives_the_same_file(tmp_path, form):
    for run in ("one", "two"):
        (tmp_path / run).mkdir()
        write_figures(tmp_path / run, [[Section(pictures=[picture(PANEL)])]], form, name="room")
    files = [tmp_path / run / FIGURES / f"line.{form}" for run in ("one", "two")]
    assert files[0].read_bytes() == files[1].read_bytes()


def test_a_vector_file_needs_no_font_and_no_style_sheet(tmp_path):
    write_figures(tmp_path, [picture(PANEL)], "svg", name="room <&>")
    text = (tmp_path / FIGURES / "line.svg").read_text(encoding="utf-8")
    root = ElementTree.fromstring(text)
    assert root.get("width") == f"{COLUMN:g}mm"
    # the height keeps the drawing's shape: half of its width
    assert float(root.get("height", "").removesuffix("mm")) == pytest.approx(0.5 * COLUMN, rel=1e-6)
    assert root.get("viewBox", "").split()[2:] == [f"{PANEL:g}", f"{0.5 * PANEL:g}"]
    names = {element.tag.rpartition("}")[2] for element in root.iter()}
    assert "text" not in names  # letters are outlines
    assert "image" not in names
    assert "var(" not in text
    assert root.findtext("{http://www.w3.org/2000/svg}title") == "room <&>: A line"
    assert "<dc:date>" not in text


def test_the_drawing_whose_letters_stay_legible_in_one_column_is_taken():
    # 10 pt at 360 px (127 mm) are 6.9 pt in 88 mm; at 900 px (317.5 mm) 2.8 pt, and 5.7 pt in 181 mm.
    both = choose(picture(WIDE, narrow=True))
    wide = choose(picture(WIDE))
    assert both is not None
    assert wide is not None
    assert (both.width, wide.width) == (COLUMN, TWO_COLUMNS)
    assert both.least_letters == pytest.approx(10.0 * 88.0 / 127.0)
    assert wide.least_letters == pytest.approx(10.0 * 181.0 / 317.5)


def test_letters_that_come_out_too_small_are_raised_and_others_stay(tmp_path):
    # 440 px are 155.2 mm: in 88 mm, 9 pt come out at 5.1 pt and 12 pt at 6.8 pt.
    written = write_figures(tmp_path, [picture(PANEL, letters=9.0)], "pdf", name="room")
    paper = written["line"]
    assert paper.least_letters == pytest.approx(LEAST_LETTERS)
    assert paper.figure.axes[0].get_title(loc="left")
    title = paper.figure.axes[0]._left_title  # type: ignore[attr-defined]
    assert title.get_fontsize() == 12.0


def test_a_picture_that_is_no_figure_of_ours_is_left_out(tmp_path):
    bare = Picture(key="bare", title="Bare", description="Bare.", svg=Drawn("<svg></svg>"))
    assert write_figures(tmp_path, [bare], "pdf", name="room") == {}
    assert [file.name for file in (tmp_path / FIGURES).iterdir()] == ["README.md"]


@pytest.mark.parametrize(
    ("caption", "written"),
    [
        ("Gates A*B* and _C_, | $1$.", r"Gates A\*B\* and \_C\_, \| \$1\$."),
        ("[link](http://x) <img src=x> `code`", r"\[link\](http://x) &lt;img src=x&gt; \`code\`"),
        ("## [mine.pdf](mine.pdf)", r"\## \[mine.pdf\](mine.pdf)"),
        ("- no\nlist", r"\- no list"),
        ("1. no list", r"1\. no list"),
    ],
)
def test_captions_are_text(tmp_path, caption, written):
    write_figures(tmp_path, [replace(picture(PANEL), caption=caption)], "svg", name="a_b")
    lines = (tmp_path / FIGURES_LIST).read_text(encoding="utf-8").splitlines()
    assert lines[0] == r"# Figures of a\_b"
    assert lines[-1] == written
    listed = {name for name in by_products(tmp_path) if name.startswith(f"{FIGURES}/")}
    assert listed == {FIGURES_LIST, f"{FIGURES}/line.svg"}  # a caption names no other file as ours


def test_figures_are_no_evidence(folder):
    assert not any(name.startswith(FIGURES) for name in manifest(folder))


def test_the_next_run_replaces_its_own_figures_and_keeps_those_of_others(tmp_path):
    scenario = warehouse()
    with ResultFolder(tmp_path, "room") as first:
        write_result(first.work, {"schema": 1, "scenario_sha256": scenario.sha256})
        write_figures(first.work, [picture(PANEL)], "pdf", name="room")
        first.publish()
    (tmp_path / "room" / FIGURES / "mine.pdf").write_bytes(b"drawn by hand")
    with ResultFolder(tmp_path, "room") as second:
        write_result(second.work, {"schema": 1, "scenario_sha256": scenario.sha256})
        second.publish()
    left = [file.name for file in (tmp_path / "room" / FIGURES).iterdir()]
    assert left == ["mine.pdf"]
