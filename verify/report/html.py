"""Templates to files: escaping, the page's content policy, and writing whole files."""

from __future__ import annotations

import base64
import hashlib
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from verify.atomic import replace_file
from verify.report.palette import css_variables
from verify.report.text import plain, visible


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("verify.report"),
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
    source = environment.loader.get_source(environment, "style.css")[0]  # type: ignore[union-attr]
    return source.replace("/*light*/", css_variables(dark=False)).replace(
        "/*dark*/", css_variables(dark=True)
    )


def content_policy() -> str:
    """Nothing may be loaded or run; the one style sheet is known by its hash."""
    digest = base64.b64encode(hashlib.sha256(stylesheet().encode()).digest()).decode()
    return (
        f"default-src 'none'; style-src 'sha256-{digest}'; img-src data:; base-uri 'none'; form-action 'none'"
    )


def render(template: str, **values: Any) -> str:
    """A page from its template. All values are escaped except our own drawings."""
    style = Markup(stylesheet())
    return _environment().get_template(template).render(style=style, policy=content_policy(), **values) + "\n"


def write_whole(file: Path, text: str) -> None:
    """Write `text` aside and rename: readers see the old file or the new one, never half of it.

    Raises
    ------
    OSError : the file cannot be written; an older one is untouched.
    """
    replace_file(file, lambda aside: aside.write_text(text, encoding="utf-8", newline="\n"))
