"""Templates to files: escaping, the page's content policy, and writing whole files."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from verify.atomic import replace_file
from verify.report.outlines import share_outlines
from verify.report.palette import css_variables
from verify.report.text import plain, visible

LIBRARY = "bokeh.min.js"  # of linked views: Bokeh's own file, as installed


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=ChoiceLoader([PackageLoader("verify.report"), PackageLoader("bokeh", "server/static/js")]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["plain"] = plain
    environment.filters["visible"] = visible
    return environment


@cache
def stylesheet() -> str:
    """The style sheet with the palette filled in."""
    environment = _environment()
    loader = environment.loader
    source = "".join(loader.get_source(environment, name)[0] for name in ("style.css", "explorer.css"))  # type: ignore[union-attr]
    return source.replace("/*light*/", css_variables(dark=False)).replace(
        "/*dark*/", css_variables(dark=True)
    )


@cache
def script(name: str) -> str:
    """One of our own scripts."""
    environment = _environment()
    return environment.loader.get_source(environment, name)[0]  # type: ignore[union-attr]


def content_policy(scripts: Sequence[str] = (), *, inline_styles: bool = False) -> str:
    """Nothing may be loaded or run, but our own style sheet and `scripts`, each known by its hash.

    With `inline_styles` any style in the page holds, as Bokeh writes its own while it runs.
    """
    styles = "'unsafe-inline'" if inline_styles else _digest(stylesheet())
    own = f"style-src {styles}; img-src data:; base-uri 'none'; form-action 'none'"
    run = "".join(f" {_digest(text)}" for text in scripts)
    return f"default-src 'none'; {f'script-src{run}; ' if run else ''}{own}"


def _digest(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def render(template: str, *, scripts: Sequence[str] = (), **values: Any) -> str:
    """A page from its template, with our own `scripts`. All values are escaped except our own drawings."""
    style, texts = Markup(stylesheet()), [script(name) for name in scripts]
    page = _environment().get_template(template)
    policy = content_policy(texts, inline_styles=LIBRARY in scripts)
    known = {"style": style, "scripts": [Markup(text) for text in texts], "policy": policy}
    return share_outlines(page.render(**known, **values)) + "\n"


def write_whole(file: Path, text: str) -> None:
    """Write `text` aside and rename: readers see the old file or the new one, never half of it.

    Raises
    ------
    OSError : the file cannot be written; an older one is untouched.
    """
    replace_file(file, lambda aside: aside.write_text(text, encoding="utf-8", newline="\n"))
