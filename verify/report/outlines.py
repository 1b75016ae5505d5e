"""Letters, words and marks of all pictures of a page, each defined once."""

from __future__ import annotations

import re

_PICTURE = re.compile(
    r'(<svg viewBox="[-0-9. ]+" width="[0-9.]+" height="[0-9.]+" role="img" '
    r'aria-labelledby="([\w-]+)-title \2-desc".*?</desc>)<defs>(.*?)</defs>(.*?</svg>)',
    flags=re.DOTALL,
)
_DEFINED = re.compile(r'<path id="([^"]+)"[^>]*/>|<g id="([^"]+)">.*?</g>', flags=re.DOTALL)
_REFERENCE = re.compile(r'href="#([^"]+)"')


def share_outlines(page: str) -> str:
    """The page with one hidden picture at its top that holds what its pictures (`svg.to_svg`) define.

    Texts from files are escaped, so nothing in them reads as a picture.
    """
    known: dict[str, str] = {}  # markup with {} for the id -> id

    def shared(found: re.Match[str]) -> str:
        head, key, defined, rest = found.groups()
        names: dict[str, str] = {}

        def renamed(reference: re.Match[str]) -> str:
            return f'href="#{names.get(reference[1], reference[1])}"'

        for part in _DEFINED.finditer(defined):
            own = part[1] or part[2]
            if own.startswith(f"{key}-"):
                inside = _REFERENCE.sub(renamed, part[0].replace(f'id="{own}"', 'id="{}"', 1))
                names[own] = known.setdefault(inside, f"g{len(known)}")
        return head + _REFERENCE.sub(renamed, rest)

    text = _PICTURE.sub(shared, page)
    if not known:
        return page
    inside = "".join(markup.replace("{}", name, 1) for markup, name in known.items())
    hidden = f'<svg class="outlines" width="0" height="0" aria-hidden="true"><defs>{inside}</defs></svg>\n'
    return text.replace("<body>\n", f"<body>\n{hidden}", 1)
