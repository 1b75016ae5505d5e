"""Every report of the gallery in a browser, on a desk and on a telephone: linked, quiet, alone, small."""

import pytest
from browser_case import browser, opened, ready  # noqa: F401
from gallery_runs import NAMES, verified

DESK, TELEPHONE = 1440, 390
LARGEST = 6_000_000  # [bytes]
CURSOR = "(id) => document.getElementById(id)?.textContent"


@pytest.fixture(scope="module", params=NAMES)
def folder(request, tmp_path_factory):
    return verified(request.param, tmp_path_factory)


@pytest.mark.parametrize("width", [DESK, TELEPHONE])
def test_it_is_linked_and_says_and_asks_for_nothing(folder, browser, width):  # noqa: F811
    with opened(browser, folder / "report.html", width=width) as seen:
        state = ready(seen)
        page = seen.page

        # The cursor: time that one view tells is the time of all.
        page.locator("#explore-time").evaluate(
            "(slider) => { slider.value = slider.max / 2; slider.dispatchEvent(new Event('input')); }"
        )
        half = seen.run("vnavReport.state().t")
        assert half == pytest.approx(float(page.locator("#explore-time").get_attribute("max")) / 2, rel=0.01)
        before = page.locator("#explore-now").inner_text()
        plot = page.locator("#explore-speed")
        plot.scroll_into_view_if_needed()
        box = plot.bounding_box()
        touch = (box["x"] + 0.8 * box["width"], box["y"] + 0.45 * box["height"])
        page.mouse.move(*touch)
        seen.until(f"vnavReport.state().t !== {half}")
        assert seen.run("vnavReport.state().t") > half  # further to the right is later
        assert page.locator("#explore-now").inner_text() != before

        # Layers: each can be toggled, or says why it is empty.
        for layer in page.locator("#explore-layers input[data-layer]").all():
            key = layer.get_attribute("data-layer")
            if layer.is_disabled():
                assert len(layer.locator("xpath=ancestor::label").inner_text()) > len(key)
                continue
            shown = layer.is_checked()
            layer.scroll_into_view_if_needed()
            layer.set_checked(not shown)
            assert seen.run("(key) => vnavReport.state().layers[key]", key) != shown
            layer.set_checked(shown)
        assert {"arcs", "mesh", "stops", "disc"} <= {
            layer.get_attribute("data-layer")
            for layer in page.locator("#explore-layers input[data-layer]").all()
        }

        # Classes: a row chooses its class everywhere, and takes it back.
        rows = page.locator("button.pick[data-class]")
        for row in rows.all()[:3]:
            rank = int(row.get_attribute("data-class"))
            row.scroll_into_view_if_needed()
            row.click()
            assert row.get_attribute("aria-pressed") == "true"
            assert seen.run("vnavReport.state().rank") == rank
            row.click()
            assert seen.run("vnavReport.state().rank") is None
        assert state["rank"] is None

        # What there is no picture of is told: methods that the scenario does not ask for.
        told = seen.run("[...document.querySelectorAll('.absent')].map((e) => e.textContent.trim())")
        assert len(told) <= 6, told
        assert page.locator("figure.picture svg").count() >= 20

        # Nothing is wider than the window.
        assert seen.run("document.documentElement.scrollWidth") <= width
        seen.assert_quiet()


def test_it_is_small(folder):
    assert (folder / "report.html").stat().st_size <= LARGEST
