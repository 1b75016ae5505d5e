"""Every report of the gallery in a browser, on a desk and on a telephone: linked, quiet, alone, small."""

import pytest
from browser_case import browser, opened, ready  # noqa: F401
from gallery_runs import NAMES, verified

from verify.evidence import read_result

DESK, TELEPHONE = 1440, 390
LARGEST = 6_000_000  # [bytes]
LOOKED_AT = {"turning_field", "two_room_office"}  # here the map must change with every layer


@pytest.fixture(scope="module", params=NAMES)
def folder(request, tmp_path_factory):
    return verified(request.param, tmp_path_factory)


def looked_at(folder, width):
    return width == DESK and folder.name in LOOKED_AT


def drawn(page):
    """The map as it is on the screen."""
    return page.locator("#explore-map").screenshot()


@pytest.mark.parametrize("width", [DESK, TELEPHONE])
def test_it_is_linked_and_says_and_asks_for_nothing(folder, browser, width):  # noqa: F811
    with opened(browser, folder / "report.html", width=width) as seen:
        state, page, result = ready(seen), seen.page, read_result(folder)

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

        # Layers: each can be toggled, or says why it is empty. Every plan has one.
        boxes = {box.get_attribute("data-layer"): box for box in page.locator("[data-layer]").all()}
        plans = {f"plan-{name}" for name in result["plans"] if (folder / f"trajectories/{name}.csv").exists()}
        assert {"arcs", "graph", "classes", "mesh", "stops", "disc"} | plans <= set(boxes)
        for key, box in boxes.items():
            if box.is_disabled():
                assert box.locator("xpath=ancestor::label").locator("em").inner_text().strip()
                continue
            shown = box.is_checked()
            box.scroll_into_view_if_needed()
            before = drawn(page) if looked_at(folder, width) else b""
            box.set_checked(not shown)
            assert seen.run("(key) => vnavReport.state().layers[key]", key) != shown
            if looked_at(folder, width):
                seen.run("() => new Promise((next) => requestAnimationFrame(() => setTimeout(next, 60)))")
                assert drawn(page) != before, f"nothing changed on the map with the layer {key}"
            box.set_checked(shown)

        # Classes: a row chooses its class everywhere, and takes it back.
        rows = page.locator("button.pick[data-class]")
        assert rows.count() == len(result["plans"].get("speed_graph", {}).get("classes", ()))
        for row in rows.all()[:3]:
            rank = int(row.get_attribute("data-class"))
            row.scroll_into_view_if_needed()
            row.click()
            assert row.get_attribute("aria-pressed") == "true"
            assert seen.run("vnavReport.state().rank") == rank
            row.click()
            assert seen.run("vnavReport.state().rank") is None
        assert state["rank"] is None

        # Nothing is wider than the window.
        assert seen.run("document.documentElement.scrollWidth") <= width
        seen.assert_quiet()


def test_it_is_small(folder):
    assert (folder / "report.html").stat().st_size <= LARGEST
