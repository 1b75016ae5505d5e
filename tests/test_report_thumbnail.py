"""Small maps and path data: what is written is what was drawn, within what is shown."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from report_case import corner_path, warehouse

from verify.report.palette import rank_tone
from verify.report.path_data import compact, polyline
from verify.report.thumbnail import MARGIN, SIDE, ThumbnailPath, draw_floor, thumbnail, thumbnail_file

NUMBER = r"-?(?:\d+\.?\d*|\.\d+)"
PAIRS = {"m": 1, "l": 1, "q": 2, "c": 3}


def points_of(data: str) -> list[tuple[float, float]]:
    """End points of all steps of relative path data, by the rules of SVG 2, sec. 9.3."""
    found: list[tuple[float, float]] = []
    x = y = 0.0
    begin = (x, y)
    for letter, rest in re.findall(r"([A-Za-z])([^A-Za-z]*)", data):
        numbers = [float(word) for word in re.findall(NUMBER, rest)]
        kind = letter.lower()
        if kind == "z":
            x, y = begin
            continue
        if kind in "hv":
            for step in numbers:
                x, y = (x + step, y) if kind == "h" else (x, y + step)
                found.append((x, y))
            continue
        size = 2 * PAIRS[kind]
        assert len(numbers) % size == 0
        assert letter == kind or (letter == "M" and len(numbers) == 2), "further pairs would be absolute"
        for i in range(0, len(numbers), size):
            x, y = x + numbers[i + size - 2], y + numbers[i + size - 1]
            if kind == "m" and i == 0:
                begin = (x, y)
            found.append((x, y))
    return found


places = st.lists(st.tuples(*[st.floats(-2000, 2000, allow_subnormal=False)] * 2), min_size=2, max_size=30)


@settings(max_examples=60, deadline=None)
@given(places, st.integers(0, 3), st.booleans())
def test_compact_data_visit_the_same_points_rounded(points, decimals, closed):
    given_points = np.round(np.array(points), 6)
    data = compact(polyline(given_points, closed=closed), decimals)
    # Half a unit of the last digit, the sixth significant digit of `polyline` (2000 m: 0.005), and rounding.
    assert np.abs(np.array(points_of(data)) - given_points).max() <= 0.5 * 10.0**-decimals + 0.005 + 1e-9


def test_errors_do_not_add_up_along_a_path():
    # 1000 steps of 0.004: rounded step by step to two decimals the path would end at 0, not at 4.
    x = 0.004 * np.arange(1001)
    end = points_of(compact(polyline(np.column_stack([x, x]))))[-1]
    assert end == pytest.approx((4.0, 4.0), abs=0.0051)


def test_curves_closed_parts_and_further_parts_are_kept():
    # Drawn by hand: a closed triangle, then a part that begins elsewhere with both kinds of curves.
    data = compact("M 1 1 L 3 1 L 3 2 Z M 10 10 Q 11 12 12 10 C 13 9 14 8 15.5 7.25 L 15.5 8")
    assert data == "M1 1h2v1zm9 9q1 2 2 0c1-1 2-2 3.5-2.75v.75"


@pytest.mark.parametrize("data", ["M 1", "A 1 1 0 0 1 2 2", "1 2", "M 1 2 L 3"])
def test_data_that_cannot_be_read_are_refused(data):
    with pytest.raises(ValueError, match="cannot be read"):
        compact(data)


def paths() -> list[ThumbnailPath]:
    path = corner_path()
    return [ThumbnailPath(points=np.column_stack([path.x, path.y]), tone=rank_tone(1), variable="--rank-1")]


def test_a_thumbnail_is_small_and_names_what_is_seen():
    picture = str(thumbnail(warehouse().problem, paths(), words='best <"way">', floor="floor"))
    assert len(picture) < 3000
    drawn = ET.fromstring(picture)
    assert drawn.get("aria-label") == 'best <"way">'
    assert drawn.find("use").get("href") == "#floor"
    assert 'id="floor"' in draw_floor(warehouse().problem, "floor")


def test_the_way_on_a_thumbnail_is_the_way_to_scale():
    problem = warehouse().problem
    drawn = ET.fromstring(thumbnail(problem, paths(), words="w"))
    way = [p for p in drawn.findall("path") if p.get("stroke") == "var(--rank-1)"]
    line = shapely.LineString(points_of(way[0].get("d")))
    # The floor is 32 m by 31 m, so a metre is 240 / 32 units; the second axis points down from y = 31 m.
    there = MARGIN + SIDE / 32.0 * (paths()[0].points - [0.0, 31.0]) * [1.0, -1.0]
    # One unit of simplification and half a unit of rounding both ways.
    assert max(line.distance(shapely.Point(p)) for p in there) <= 1.0 + np.hypot(0.5, 0.5)


def test_a_thumbnail_file_brings_its_own_colours():
    text = thumbnail_file(warehouse().problem, paths(), words="w")
    drawn = ET.fromstring(text)
    used = set(re.findall(r"var\((--[a-z0-9-]+)\)", text))
    light, dark = drawn.find("{http://www.w3.org/2000/svg}style").text.split("@media", 1)
    assert used
    for name in used:
        assert f"{name}:#" in light
        assert f"{name}:#" in dark
    assert len(text) < 4000
