"""Meshcat's page made one that needs nothing but itself: contents at once, a panel, and a strict policy."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from typing import Any

from markupsafe import Markup, escape

from verify.report.html import render, script

PANEL = "replay_panel.html"
PANEL_SCRIPT = "replay_panel.js"
_MESSAGE = re.compile(
    r'fetch\("data:[^,"]*;base64,([A-Za-z0-9+/=]*)"\)\s*\.then\(res => res\.arrayBuffer\(\)\)'
    r"\s*\.then\(buffer => viewer\.handle_command_bytearray\(new Uint8Array\(buffer\)\)\);"
)
_SCRIPT = re.compile(r"<script(?: [^>]*)?>(.*?)</script>", re.DOTALL)
_HEAD = re.compile(r"<html>(\s*)<head>(\s*)<meta charset=utf-8>(\s*)<title>[^<]*</title>")


class ReplayError(Exception):
    """The replay could not be made; the message says why. Nothing else depends on it."""


def finished(page: str, *, title: str, panel: Mapping[str, Any], data: Mapping[str, Any]) -> str:
    """The page as written to disk.

    Meshcat hands each part of the scene to the browser in a request for a `data:` address of its own. Those
    need not be answered in the order in which they are asked, and a scene that arrives before its lights or
    after its animation looks wrong: the parts are decoded in place instead, one after the other. The policy
    allows the page's own scripts, each known by its hash, and no request at all.

    Parameters
    ----------
    page : of `Meshcat.StaticHtml`.
    title : name of the page.
    panel : what the panel's template shows;  data : what its script reads.

    Raises
    ------
    ReplayError : the page is not of the form that is known.
    """
    page, parts = _MESSAGE.subn(_in_place, page.replace("\r\n", "\n"))
    if not parts or "handle_command_bytearray(new Uint8Array(buffer))" in page:
        raise ReplayError("this version of Drake writes its page in a way that is not known")
    inside = render(PANEL, title=title, data=Markup(_json(data)), code=Markup(script(PANEL_SCRIPT)), **panel)
    page = page.replace("</body>", inside + "</body>", 1)
    head = (
        '<html lang="en">\\1<head>\\2<meta charset=utf-8>\\3'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\\3'
        f'<meta http-equiv="Content-Security-Policy" content="{policy(_SCRIPT.findall(page))}">\\3'
        f"<title>{_literal(str(escape(title)))}</title>"
    )
    page, heads = _HEAD.subn(head, page, count=1)
    if heads != 1:
        raise ReplayError("this version of Drake writes a page whose head is not known")
    return page


def policy(scripts: Sequence[str]) -> str:
    """What the page may do: run these scripts, have styles and pictures of its own, load nothing."""
    digests = (base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in scripts)
    run = " ".join(sorted({f"'sha256-{digest}'" for digest in digests}))
    return (
        f"default-src 'none'; script-src {run}; style-src 'unsafe-inline'; img-src data: blob:; "
        "base-uri 'none'; form-action 'none'"
    )


def _in_place(message: re.Match[str]) -> str:
    return f'viewer.handle_command_bytearray(Uint8Array.from(atob("{message[1]}"), (c) => c.charCodeAt(0)));'


def _json(data: Mapping[str, Any]) -> str:
    """Data inside a script element: no `<` that could end it."""
    return json.dumps(data, sort_keys=True, separators=(",", ":")).replace("<", "\\u003c")


def _literal(text: str) -> str:
    """Text as a replacement of a regular expression."""
    return text.replace("\\", "\\\\")
