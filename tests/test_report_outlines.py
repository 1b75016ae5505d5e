"""Pictures in few letters: what is drawn stays, what is drawn twice is defined once for the page."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET

import pytest

from verify.report.curves import halo
from verify.report.outlines import share_outlines
from verify.report.svg import drawing_style, new_axes, to_svg


def drawn(key: str, word: str, *, rim: bool = False) -> str:
    with drawing_style():
        figure, axes = new_axes(200.0, 100.0, x="", y="")
        axes.set_axis_off()
        text = axes.text(0.5, 0.5, word, fontsize=20.0)
        if rim:
            halo(text)
        svg = str(to_svg(figure, key=key, title="a word", description="a word in a picture"))
        if rim:
            assert text.get_path_effects()  # as before: other files are drawn from the same figure
            assert text.get_gid() is None
        return svg


def page_of(*pictures: str) -> str:
    return share_outlines(f"<body>\n{''.join(pictures)}</body>")


def test_the_letters_of_two_pictures_are_defined_once():
    text = page_of(drawn("one", "abca"), drawn("two", "abca"), drawn("three", "cab"))
    hidden = re.search(r'<svg class="outlines".*?</svg>', text)[0]
    # Three letters, and two words of them; the first word is the same in two pictures.
    assert len(re.findall(r"<path id=", hidden)) == 3
    assert len(re.findall(r"<g id=", hidden)) == 2
    assert "<path id=" not in text.replace(hidden, "")
    ids = re.findall(r'\bid="([^"]+)"', text)
    assert len(ids) == len(set(ids))
    assert set(re.findall(r'href="#([^"]+)"', text)) <= set(ids)
    ET.fromstring(text)


def test_a_picture_alone_holds_all_that_it_refers_to():
    svg = drawn("one", "abca")
    ids = set(re.findall(r'\bid="([^"]+)"', svg))
    assert set(re.findall(r'href="#([^"]+)"', svg)) <= ids


def test_a_rim_lies_below_its_letters_and_is_as_wide_as_asked_for():
    svg = ET.fromstring(drawn("one", "ab", rim=True))
    line = next(g for g in svg.iter("g") if "scale" in g.get("transform", ""))
    below, above = line.findall("use")
    assert below.get("href") == above.get("href")
    assert above.get("stroke") is None
    assert below.get("stroke") == "var(--paper)"
    # 3 px in the picture: letters are scaled by the line (20 px / 100 units) and by 1/64 themselves.
    assert "scale(0.2 -0.2)" in line.get("transform")
    letter = next(path for path in svg.iter("path") if path.get("transform"))
    assert letter.get("transform") == f"scale({1 / 64})"
    assert float(below.get("stroke-width")) * 0.2 / 64 == pytest.approx(3.0, rel=1e-3)


def test_what_belongs_to_a_class_says_so():
    with drawing_style():
        figure, axes = new_axes(200.0, 100.0, x="", y="")
        axes.plot([0, 1], [0, 1], gid="class-2")
        svg = str(to_svg(figure, key="k", title="t", description="one line"))
    assert svg.count('data-class="2"') == 1


def test_a_page_without_pictures_is_left_alone():
    page = '<body>\n<svg class="swatch"><path id="a" d="M0 0"/></svg></body>'
    assert share_outlines(page) == page
