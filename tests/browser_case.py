"""Pages in headless Chromium: one browser a module, and what each page said and asked for."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

try:
    from playwright.sync_api import Browser, Page, sync_playwright
except ImportError:  # locally it may be absent, where tests of pages are skipped
    sync_playwright = None  # type: ignore[assignment]

CHROMIUM = ("chromium", "chromium-browser", "google-chrome")
LONGEST = 20_000.0  # [ms] for anything in a page
QUIET = ("log", "info", "debug")  # what a page may say


@dataclass(frozen=True)
class Opened:
    """A page, and what it said: console messages but the quiet ones, errors, and requests beyond its file."""

    page: Page
    said: list[str] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)

    def assert_quiet(self) -> None:
        """Nothing was said, nothing broke, nothing was asked for."""
        assert (self.said, self.errors, self.requests) == ([], [], [])

    def run(self, script: str, *arguments: Any) -> Any:
        """The value of a JavaScript expression or function in the page."""
        return self.page.evaluate(script, *arguments)

    def until(self, condition: str) -> None:
        """Wait until a JavaScript expression holds. Playwright's own way needs eval, which pages forbid."""
        self.run(
            f"""async () => {{
              const end = performance.now() + {LONGEST};
              while (!({condition})) {{
                if (performance.now() > end) throw new Error({json.dumps("never held: " + condition)});
                await new Promise((next) => setTimeout(next, 20));
              }}
            }}"""
        )


def _absent(reason: str) -> None:
    if os.environ.get("CI"):
        pytest.fail(f"continuous integration has to look at pages: {reason}")
    pytest.skip(reason)


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """Chromium of the system; without it tests are skipped, in continuous integration they fail."""
    program = next(filter(None, map(shutil.which, CHROMIUM)), None)
    if sync_playwright is None:
        _absent("playwright is not installed")
    if program is None:
        _absent(f"none of {', '.join(CHROMIUM)} is on the path")
    with sync_playwright() as playwright:
        own = playwright.chromium.launch(executable_path=program, args=["--no-sandbox", "--disable-gpu"])
        yield own
        own.close()


@contextmanager
def opened(
    browser: Browser,
    file: Path,
    *,
    width: int = 1440,
    height: int = 900,
    scheme: str = "light",
    fragment: str = "",
    **context: Any,
) -> Iterator[Opened]:
    """`file` in a window of its own; `context`: what else Playwright's new_context takes."""
    window = browser.new_context(
        viewport={"width": width, "height": height},
        color_scheme=scheme,
        **context,  # type: ignore[arg-type]
    )
    try:
        page = window.new_page()
        page.set_default_timeout(LONGEST)
        seen = Opened(page)
        address = file.as_uri()
        page.on("console", lambda m: None if m.type in QUIET else seen.said.append(f"{m.type}: {m.text}"))
        page.on("pageerror", lambda error: seen.errors.append(str(error)))
        page.on("request", lambda r: None if r.url.split("#")[0] == address else seen.requests.append(r.url))
        page.goto(f"{address}#{fragment}" if fragment else address)
        yield seen
    finally:
        window.close()


def ready(seen: Opened) -> Mapping[str, Any]:
    """The linked views' state once they are there."""
    return seen.run("async () => { await vnavReport.ready; return vnavReport.state(); }")
