"""The index in a browser: sorting, finding, phones, keyboards, without scripts."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from browser_case import Opened, browser, opened
from report_case import warehouse
from test_index import FAILED, folder_of
from test_previous import RESULT, after

from verify.by_products import THUMBNAIL
from verify.report import executed_thumbnail, write_index

__all__ = ["browser"]

# Travel times 26, 9 and 101 s: as words they would come in another order. The failed one has no gap.
TIMES = {"room_2": 26.0, "room_10": 9.0, "hall": 101.0}


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("index")
    results = {name: after(plans__refined__travel_time=time) for name, time in TIMES.items()}
    results["broken"] = {**FAILED, "plans": {}, "gaps": {}, "lower_bound": {}}
    for name, result in results.items():
        folder_of(out, name, result, before=RESULT if name == "hall" else None)
        (out / name / THUMBNAIL).write_text(executed_thumbnail(warehouse().problem, None), encoding="utf-8")
    write_index(out / "index.html", list(results.items()))
    return out / "index.html"


@pytest.fixture
def seen(browser, page) -> Iterator[Opened]:
    with opened(browser, page) as shown:
        yield shown
        shown.assert_quiet()


def names(seen: Opened) -> list[str]:
    """Scenarios in the order shown."""
    return seen.run(
        "[...document.querySelectorAll('#index tbody tr')].filter(row => row.getClientRects().length)"
        ".map(row => row.cells[0].dataset.value)"
    )


def press(seen: Opened, column: str) -> None:
    seen.page.get_by_role("button", name=column, exact=True).click()


def sorts(seen: Opened) -> list[list[str]]:
    return seen.run(
        "[...document.querySelectorAll('[aria-sort]')]"
        ".map(head => [head.dataset.sort, head.getAttribute('aria-sort')])"
    )


def test_failing_ones_come_first_until_a_column_is_pressed(seen):
    assert names(seen) == ["broken", "hall", "room_10", "room_2"]
    assert sorts(seen) == [["Verdict", "ascending"]]
    press(seen, "Travel time")
    # by number; what has none stays last, whichever way round
    assert names(seen) == ["room_10", "room_2", "hall", "broken"]
    assert sorts(seen) == [["Travel time", "ascending"]]
    press(seen, "Travel time")
    assert names(seen) == ["hall", "room_2", "room_10", "broken"]
    assert sorts(seen) == [["Travel time", "descending"]]


def test_names_sort_as_people_count(seen):
    press(seen, "Scenario")
    assert names(seen) == ["broken", "hall", "room_2", "room_10"]


def test_what_got_worse_comes_first(seen):
    press(seen, "Since the last run")
    assert names(seen)[0] == "hall"  # 26 to 101 s; the others are new


def test_every_column_sorts_and_keeps_every_row(seen):
    for column in seen.run("[...document.querySelectorAll('th[data-sort]')].map(h => h.dataset.sort)"):
        press(seen, column)
        assert sorts(seen)[0][0] == column
        assert sorted(names(seen)) == sorted([*TIMES, "broken"])


def test_the_keyboard_sorts(seen):
    seen.run("document.querySelector('[data-sort=Length] button').focus()")
    for key, way in (("Enter", "ascending"), ("Space", "descending")):
        seen.page.keyboard.press(key)
        assert sorts(seen) == [["Length", way]]


def test_rows_are_found_by_words_and_by_failing(seen):
    seen.page.get_by_label("Find").fill("ROOM_")
    assert names(seen) == ["room_10", "room_2"]
    assert seen.page.locator("#index-now").text_content().startswith("2 of 4 shown")
    seen.page.get_by_label("Find").fill("")
    seen.page.get_by_label("failing only").check()
    assert names(seen) == ["broken"]


def test_on_a_telephone_a_list_sorts_and_nothing_is_wider_than_the_page(browser, page):
    with opened(browser, page, width=390, scheme="dark") as shown:
        assert shown.run("document.documentElement.scrollWidth") <= 390
        shown.page.get_by_label("Sort by").select_option("Travel time")
        assert names(shown) == ["room_10", "room_2", "hall", "broken"]
        shown.page.get_by_role("button", name="Turn round").click()
        assert names(shown) == ["hall", "room_2", "room_10", "broken"]
        shown.assert_quiet()


def test_small_maps_are_seen(seen):
    widths = seen.run("[...document.images].map(image => image.complete && image.naturalWidth)")
    assert len(widths) == 4
    assert all(widths)


def test_without_scripts_all_rows_are_there_and_no_dead_controls(browser, page):
    with opened(browser, page, java_script_enabled=False) as shown:
        assert shown.page.locator("#index tbody tr").count() == 4
        assert shown.page.locator("button:visible, input:visible, select:visible").count() == 0
