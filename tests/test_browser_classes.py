"""The table of homotopy classes in a browser: a class chosen by mouse, key and event."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from browser_case import Opened, browser, opened
from report_case import warehouse
from test_report_classes import drawing, with_speed_graph

from verify.report import ReportExtras, write_report

if TYPE_CHECKING:
    from playwright.sync_api import Browser

__all__ = ["browser"]

LISTEN = """() => {
  window.heard = [];
  document.addEventListener("vnav:class", ({ detail }) => window.heard.push([detail.rank, detail.source]));
}"""
CHOSEN = """[...document.querySelectorAll('.pick[aria-pressed="true"]')].map((pick) => pick.dataset.class)"""
DIMMED = (
    """[...new Set([...document.querySelectorAll("figure .dimmed")].map((part) => part.dataset.class))]"""
)


@pytest.fixture
def table(browser: Browser, tmp_path: Path) -> Iterator[Opened]:
    """A page with two classes and no motion: without linked views the table stands alone."""
    scenario, folder = warehouse(), tmp_path / "case"
    result, file = with_speed_graph(folder, scenario), tmp_path / "report.html"
    extras = ReportExtras(speed_graph=drawing(scenario))
    write_report(file, scenario=scenario, result=result, folder=tmp_path, extras=extras)
    with opened(browser, file) as seen:
        seen.run(LISTEN)
        yield seen
        seen.assert_quiet()


def test_a_class_is_chosen_by_click_key_and_event_and_taken_back(table):
    first, second = table.page.locator("button.pick").all()
    second.click()
    assert (table.run(CHOSEN), table.run(DIMMED)) == (["2"], ["1"])
    second.click()  # once more takes it back
    assert (table.run(CHOSEN), table.run(DIMMED)) == ([], [])
    first.press("Enter")
    assert (table.run(CHOSEN), table.run(DIMMED)) == (["1"], ["2"])
    table.page.keyboard.press("Escape")
    assert table.run(CHOSEN) == []
    first.press(" ")
    table.page.locator("#class-table td[data-name='Class']").nth(1).click()  # anywhere in a row
    assert table.run(CHOSEN) == ["2"]
    ours = [
        [2, "classes"],
        [None, "classes"],
        [1, "classes"],
        [None, "classes"],
        [1, "classes"],
        [2, "classes"],
    ]
    assert table.run("window.heard") == ours
    table.run("document.dispatchEvent(new CustomEvent('vnav:class', { detail: { rank: 1, source: 'x' } }))")
    assert (table.run(CHOSEN), table.run(DIMMED)) == (["1"], ["2"])
    assert len(table.run("window.heard")) == len(ours) + 1  # it does not answer what it hears
