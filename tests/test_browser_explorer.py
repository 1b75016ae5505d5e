"""The linked views in a browser: one cursor, layers, classes, zoom, light and dark, narrow and wide."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from browser_case import Opened, browser, opened, ready
from explorer_case import Case, make_case, write_page
from pypdf import PdfReader
from report_case import warehouse

from verify.report import write_report
from verify.report.palette import PAPER, rank_tone

if TYPE_CHECKING:
    from playwright.sync_api import Browser

__all__ = ["browser"]

NAMED = "Bokeh.documents[0].get_model_by_name"
TO = "(t) => document.dispatchEvent(new CustomEvent('vnav:time', { detail: { t, source: 'test' } }))"
CHOOSE = (
    "(rank) => document.dispatchEvent(new CustomEvent('vnav:class', { detail: { rank, source: 'test' } }))"
)


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Case:
    return make_case(tmp_path_factory.mktemp("explorer") / "warehouse")


@pytest.fixture(scope="module")
def file(case: Case, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_page(tmp_path_factory.mktemp("page") / "views.html", case)


@pytest.fixture(scope="module")
def views(browser: Browser, file: Path) -> Iterator[Opened]:
    """One page for all tests that leave it as they found it; at the end it has said nothing."""
    with opened(browser, file) as seen:
        ready(seen)
        yield seen
        seen.assert_quiet()


def now(views: Opened) -> float:
    return views.run("vnavReport.state().t")


def robot(views: Opened) -> tuple[float, float]:
    return tuple(views.run(f"(({{ x, y }}) => [x[0], y[0]])({NAMED}('robot-columns').data)"))


def on_axis(views: Opened, plot: str, x: float, y: float) -> tuple[float, float]:
    """Where a point of a plot is in the window [px]; the plot is scrolled into view."""
    views.page.locator(f"#explore-{plot}").scroll_into_view_if_needed()
    return tuple(
        views.run(
            f"""([name, x, y]) => {{
              const view = Bokeh.index[{NAMED}(name).id], box = view.canvas_view.el.getBoundingClientRect();
              return [box.left + view.frame.x_scale.compute(x), box.top + view.frame.y_scale.compute(y)];
            }}""",
            [plot, x, y],
        )
    )


def test_pointing_at_the_speed_moves_the_robot_on_the_map(views: Opened, case: Case):
    views.page.mouse.move(*on_axis(views, "speed", 8.0, 0.5))
    assert now(views) == pytest.approx(8.0, abs=0.1)  # half a pixel of some 500 px for 27 s
    x, y, *_ = case.motion.at(now(views))
    assert robot(views) == pytest.approx((float(x), float(y)), abs=1e-3)  # chords of 0.05 m


def test_pointing_at_the_map_moves_the_line_in_the_curves(views: Opened, case: Case):
    views.run(TO, 3.0)
    x, y, *_ = case.motion.at(6.0)
    views.page.mouse.move(*on_axis(views, "map", float(x), float(y)))
    line = views.run(f"[{NAMED}('speed-line').location, {NAMED}('margins-line').location]")
    assert line == pytest.approx([6.0, 6.0], abs=0.1)
    assert line == [now(views), now(views)]


def test_an_instant_from_elsewhere_moves_every_view(views: Opened, case: Case):
    bent = case.motion.t[:-1][case.motion.curvature[:-1] != 0.0]
    middle = float(bent.mean())  # of the corner, a circle of 1.6 m to the right
    views.run(TO, middle)
    *_, v, a, curvature = (float(value) for value in case.motion.at(middle))
    assert curvature == pytest.approx(-1.0 / 1.6)
    cursor = views.run(f"(({{ x, y }}) => [x[0], y[0]])({NAMED}('friction-cursor-columns').data)")
    # joined rows: within a thousandth of a_max = 1 m/s^2
    assert cursor == pytest.approx([v * v * curvature, a], abs=2e-3)
    speed = views.run(f"{NAMED}('speed-dots-columns').data.y.at(-1)")
    assert speed == pytest.approx(v, abs=0.01)
    assert views.page.locator("#explore-now").inner_text().startswith(f"{middle:.2f} s")
    # the disc in which it stops: radius 0.4 m plus v^2 / (2 a_b), a_b = 1 m/s^2
    xs = views.run(f"Array.from({NAMED}('disc-columns').data.x)")
    assert (max(xs) - min(xs)) / 2.0 == pytest.approx(0.4 + v * v / 2.0, abs=0.01)


def test_keys_step_and_play(views: Opened, case: Case):
    views.run(TO, 5.0)
    slider = views.page.locator("#explore-time")
    slider.focus()
    for key, t in (("ArrowRight", 5.1), ("Shift+ArrowRight", 6.1), ("ArrowLeft", 6.0), ("Home", 0.0)):
        views.page.keyboard.press(key)
        assert now(views) == pytest.approx(t, abs=1e-9)
    views.page.keyboard.press("End")
    assert now(views) == pytest.approx(case.motion.t[-1], abs=1e-5)  # single precision
    views.page.keyboard.press("Home")
    views.page.keyboard.press("Space")
    views.until("vnavReport.state().t > 0.05")
    views.page.keyboard.press("Space")
    stopped = now(views)
    views.run("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    assert now(views) == stopped < 5.0


def test_layers_are_filled_when_they_are_shown_first(views: Opened):
    assert views.run(f"{NAMED}('lines-arcs-columns').data.xs.length") == 0
    box = views.page.locator("[data-layer=arcs]")
    box.check()
    assert views.run(f"{NAMED}('arcs').visible")
    assert views.run("vnavReport.state().layers.arcs")
    # the one arc is straight, two points, whole steps of its box: exact
    assert views.run(f"{NAMED}('lines-arcs-columns').data.xs") == [[pytest.approx(2.0), pytest.approx(30.0)]]
    box.uncheck()
    assert not views.run(f"{NAMED}('arcs').visible")
    absent = views.page.locator("[data-layer=mesh]")
    assert absent.is_disabled()
    assert "no lower bound was computed" in absent.locator("xpath=..").inner_text()


def test_a_chosen_class_is_drawn_everywhere_and_dims_the_others(views: Opened):
    views.page.locator("[data-layer=plan-collocation]").check()
    assert not views.run(f"{NAMED}('class-2').visible")
    views.run(CHOOSE, 2)
    assert views.run("vnavReport.state().rank") == 2
    for name in ("class-2", "speed-class-2", "friction-class-2", "margin-class"):
        assert views.run(f"{NAMED}('{name}').visible"), name
    assert views.run(f"{NAMED}('margin-class').glyph.line_color.value") == rank_tone(2).light
    dimmed = views.run(f"{NAMED}('plan-collocation').glyph.line_alpha.value")
    assert dimmed < views.run(f"{NAMED}('class-2').glyph.line_alpha.value")
    views.run(CHOOSE, None)
    assert views.run("vnavReport.state().rank") is None
    assert not views.run(f"{NAMED}('class-2').visible")
    assert views.run(f"{NAMED}('plan-collocation').glyph.line_alpha.value") == 1
    views.page.locator("[data-layer=plan-collocation]").uncheck()


def test_one_margin_is_shown_in_its_unit(views: Opened):
    views.page.locator("[data-margin=friction]").click()
    shown = views.run(f"['friction', 'steering'].map((key) => {NAMED}(`margin-${{key}}`).visible)")
    assert shown == [True, False]
    assert views.run(f"{NAMED}('margins').left[0].axis_label") == "friction circle [m/s²]"
    views.page.locator("[data-margin='']").click()
    assert views.run(f"{NAMED}('margin-steering').visible")


def test_scales_are_equal_and_the_wheel_zooms_only_where_one_has_clicked(views: Opened):
    scale = f"""(() => {{ const p = {NAMED}('map'), x = p.x_range, y = p.y_range;
      return [(x.end - x.start) / p.inner_width, (y.end - y.start) / p.inner_height]; }})()"""
    across, up = views.run(scale)
    assert across == pytest.approx(up, rel=1e-6)
    views.run("window.scrollTo(0, 0)")
    at = on_axis(views, "map", 16.0, 24.5)
    views.page.mouse.move(*at)
    views.page.mouse.wheel(0, 60)
    views.until("window.scrollY > 0")
    assert views.run(scale) == [across, up]
    at = on_axis(views, "map", 16.0, 24.5)
    views.page.mouse.click(*at)
    views.page.mouse.wheel(0, -100)
    views.until(f"{scale}[0] < {across!r}")
    closer = views.run(scale)
    assert closer[0] == pytest.approx(closer[1], rel=1e-6)
    views.page.mouse.move(5, 5)
    views.page.locator("[data-plot=map][data-zoom=all]").click()
    assert views.run(scale) == pytest.approx([across, up])
    views.page.locator("[data-plot=map][data-zoom=in]").click()
    assert views.run(scale)[0] == pytest.approx(across / 1.5)
    views.page.locator("#explore-map").focus()
    views.page.keyboard.press("0")
    assert views.run(scale)[0] == pytest.approx(across)


def test_colours_follow_the_scheme_and_print_leaves_the_views_out(views: Opened):
    background = f"{NAMED}('map').background_fill_color"
    assert views.run(background) == PAPER.light
    views.page.emulate_media(color_scheme="dark")
    views.until(f"{background} === '{PAPER.dark}'")
    assert views.run(f"{NAMED}('class-2').glyph.line_color.value") == rank_tone(2).dark
    views.page.emulate_media(color_scheme="light", media="print")
    assert not views.page.locator("#explore").is_visible()
    views.page.emulate_media(media="screen")
    views.until(f"{background} === '{PAPER.light}'")


def test_on_a_telephone_in_the_dark_with_an_address(browser: Browser, file: Path):
    context = {"is_mobile": True, "has_touch": True}
    with opened(browser, file, width=390, scheme="dark", fragment="t=5.6", **context) as seen:
        assert ready(seen)["t"] == pytest.approx(5.6)
        assert seen.run("document.documentElement.scrollWidth") == 390
        # a finger scrolls the page over the map, and up and down over curves of time
        assert seen.run(
            """['map', 'speed'].map((name) => {
              const place = document.getElementById(`explore-${name}`);
              const view = Bokeh.index[Bokeh.documents[0].get_model_by_name(name).id];
              return [place, view.canvas_view.events_el].map((shown) => getComputedStyle(shown).touchAction);
            })"""
        ) == [["auto", "auto"], ["pan-y", "auto"]]
        seen.page.touchscreen.tap(*on_axis(seen, "speed", 10.0, 0.5))
        assert now(seen) == pytest.approx(10.0, abs=0.2)
        for key in ("play", "rate", "time"):
            assert seen.page.locator(f"#explore-{key}").bounding_box()["height"] >= 44.0  # px: WCAG 2.5.5
        seen.assert_quiet()


def test_without_scripts_the_page_points_to_the_stills(browser: Browser, file: Path):
    with opened(browser, file, java_script_enabled=False) as seen:
        assert seen.page.locator("noscript a[href='#stills']").is_visible()
        assert not seen.page.locator("#explore-views").is_visible()


def test_on_paper_a_report_has_its_stills_and_no_controls(browser: Browser, tmp_path: Path):
    shown = make_case(tmp_path / "warehouse")
    file = tmp_path / "report.html"
    write_report(
        file, scenario=warehouse(), result=shown.result, folder=tmp_path / "warehouse", extras=shown.extras
    )
    with opened(browser, file) as seen:
        ready(seen)
        headings = seen.page.locator("#stills h2, #stills h3").all_inner_texts()
        captions = seen.page.locator("#stills figcaption").evaluate_all(
            "(all) => all.map((one) => one.textContent)"
        )
        # the sections asked about alone: reading all pages takes long
        seen.run(
            "document.querySelectorAll('section:not(#explore, :has(#stills))').forEach((one) => one.remove())"
        )
        seen.page.pdf(path=str(tmp_path / "report.pdf"))
    text = "".join("".join(page.extract_text() for page in PdfReader(tmp_path / "report.pdf").pages).split())
    assert headings
    assert captions
    # words only: signs of formulas and ligatures are the fonts' affair
    for words in [*headings, *(caption.strip() for caption in captions)]:
        start = re.match(r"[A-Za-z ,]*", words)
        assert start is not None
        assert "".join(start.group().split()) in text, words
    for control in ("Explore the motion", "all, in %", "One instant in all views", "Braking disc"):
        assert "".join(control.split()) not in text, control
