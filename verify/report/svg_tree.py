"""Matplotlib's SVG in few letters: what only names or groups is left out, letters and marks are named once.

What is seen stays as it is: places are rounded to a hundredth of a pixel, nothing else changes.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from markupsafe import escape

from verify.report.path_data import compact

_SPACES = ("{http://www.w3.org/2000/svg}", "{http://www.w3.org/1999/xlink}")
_NUMBER = re.compile(r"-?\d+\.\d+")
_SHIFT = re.compile(r"translate\((-?[\d.]+) 0(?:\.0)?\)")
_SCALE = re.compile(r"scale\((-?[\d.]+)[ ,)]")
_REFERENCE = re.compile(r"url\(#([^)]+)\)")
_CLASS = re.compile(r"class-(\d+)")
LETTER_UNITS = 64.0  # of a letter's outline in one unit of its line, as matplotlib writes both


@dataclass(frozen=True)
class Rim:
    """A rim around the letters of a text."""

    width: float  # [px] of the whole stroke, half of it outside
    colour: str


@dataclass
class _Drawing:
    key: str
    rims: Mapping[str, Rim]
    colour: Callable[[str], str]
    ids: dict[str, str] = field(default_factory=dict)  # matplotlib's id -> the one in the page
    shared: dict[str, str] = field(default_factory=dict)  # markup of what is drawn several times -> id
    origin: dict[str, ET.Element] = field(default_factory=dict)  # defined elements by matplotlib's id

    def define(self, kind: str, inside: str) -> str:
        """The id of `inside`, markup with {} where its id belongs."""
        return self.shared.setdefault(inside, f"{self.key}-{kind}{len(self.shared)}")


def compact_svg(text: str, *, key: str, rims: Mapping[str, Rim], colour: Callable[[str], str]) -> str:
    """The inside of matplotlib's `<svg>` element, as small as it gets.

    Parameters
    ----------
    text : what matplotlib wrote.
    key : prefix of every id.
    rims : by the ids of groups that hold texts, whose letters are drawn with a rim below.
    colour : how a colour is written in the page.

    Returns
    -------
    One `<defs>` with everything that is drawn several times, one element after the other as
    `<path id=...>` or `<g id=...>`, then the drawing. A group with the id `class-2` has `data-class="2"`.
    """
    root = ET.fromstring(text)
    for element in root.iter():
        _plain(element, colour)
    drawing = _Drawing(key=key, rims=rims, colour=colour)
    for parent in root.iter():
        for element in parent:
            if parent.tag == "defs" and "id" in element.attrib:
                drawing.origin[element.attrib["id"]] = element
    body = "".join(_written(element, drawing) for element in root)
    clips = "".join(_clip(name, own, drawing) for name, own in drawing.ids.items())
    shared = "".join(inside.replace("{}", name) for inside, name in drawing.shared.items())
    return (f"<defs>{shared}</defs>" if shared else "") + (f"<defs>{clips}</defs>" if clips else "") + body


def _plain(element: ET.Element, colour: Callable[[str], str]) -> None:
    """No name spaces, no inline styles, short numbers."""
    for space in _SPACES:
        element.tag = element.tag.replace(space, "")
    found: dict[str, str] = {}
    for name, value in element.attrib.items():
        if name == "style":  # as attributes: the page's policy then needs no leave for inline styles
            pairs = (item.split(":", 1) for item in value.split(";") if ":" in item)
            found |= {own.strip(): colour(said.strip()) for own, said in pairs}
        else:
            found[name.split("}")[-1]] = colour(value)
    if "d" in found:
        found["d"] = compact(found["d"])
    for name in ("x", "y", "transform", "stroke-dasharray", "width", "height"):
        if name in found:
            found[name] = _shortened(found[name], keep="scale(" if name == "transform" else "")
    if found.get("stroke-dashoffset") == "0":
        del found["stroke-dashoffset"]
    element.attrib.clear()
    element.attrib.update(found)


def _shortened(text: str, keep: str = "") -> str:
    if keep and keep in text:
        cut = text.index(keep)
        return _shortened(text[:cut]) + text[cut:]
    return _NUMBER.sub(lambda m: f"{float(m[0]):.2f}".rstrip("0").rstrip("."), text)


def _written(element: ET.Element, drawing: _Drawing) -> str:
    """Markup of an element and what is in it."""
    tag = element.tag
    if tag in ("defs", "metadata", "style", "title"):
        return ""
    if tag == "g":
        return _group(element, drawing)
    if tag == "use":
        return _use(element, drawing)
    if element.get("fill") == "none" and "stroke" not in element.attrib:
        return ""  # the ground of figure and axes, which has no colour
    return f"<{tag}{_attributes(element.attrib, drawing)}/>"


def _group(element: ET.Element, drawing: _Drawing) -> str:
    attributes = dict(element.attrib)
    name = attributes.pop("id", "")
    rim = drawing.rims.get(name)
    if rim is not None:
        return "".join(_line(line, drawing, rim) for line in element)
    found = _CLASS.fullmatch(name)
    if found:
        attributes["data-class"] = found[1]
    drawn = [child for child in element if child.tag != "defs"]
    if drawn and all(_is_letter(child) for child in drawn):
        return _line(element, drawing, None)
    inside = "".join(_written(child, drawing) for child in drawn)
    if not inside:
        return ""
    if not attributes:
        return inside
    return f"<g{_attributes(attributes, drawing)}>{inside}</g>"


def _is_letter(element: ET.Element) -> bool:
    shift = element.get("transform", "")
    plain = set(element.attrib) <= {"href", "transform"}
    return element.tag == "use" and plain and (not shift or _SHIFT.fullmatch(shift) is not None)


def _line(element: ET.Element, drawing: _Drawing, rim: Rim | None) -> str:
    """A line of letters, all in one: drawn once, or twice where it has a rim."""
    letters = [child for child in element if child.tag == "use"]
    if not letters:
        return ""
    names = []
    for letter in letters:
        shift = _SHIFT.fullmatch(letter.get("transform", ""))
        x = f"{float(shift[1]):.1f}".removesuffix(".0") if shift else ""
        names.append((_defined(letter, drawing), x))
    if len(names) == 1 and not names[0][1]:
        word = names[0][0]
    else:
        uses = "".join(
            f'<use href="#{name}"{f" x={chr(34)}{x}{chr(34)}" if x else ""}/>' for name, x in names
        )
        word = drawing.define("t", f'<g id="{{}}">{uses}</g>')
    attributes = {name: value for name, value in element.attrib.items() if name != "id"}
    if rim is None:
        return f'<use href="#{word}"{_attributes(attributes, drawing)}/>'
    scale = _SCALE.search(attributes.get("transform", ""))
    width = rim.width * LETTER_UNITS / float(scale[1] if scale else 1.0)
    stroke = f'stroke="{drawing.colour(rim.colour)}" stroke-width="{width:.4g}"'
    below, above = f'<use href="#{word}" {stroke}/>', f'<use href="#{word}"/>'
    return f"<g{_attributes(attributes, drawing)}>{below}{above}</g>"


def _defined(use: ET.Element, drawing: _Drawing) -> str:
    """The id of what an element refers to."""
    origin = drawing.origin[use.attrib["href"].removeprefix("#")]
    attributes = {name: value for name, value in origin.attrib.items() if name != "id"}
    return drawing.define("m", f'<{origin.tag} id="{{}}"{_attributes(attributes, drawing)}/>')


def _use(element: ET.Element, drawing: _Drawing) -> str:
    """A mark; what its outline says itself it need not say."""
    origin = drawing.origin[element.attrib["href"].removeprefix("#")]
    told = {
        name: value
        for name, value in element.attrib.items()
        if name != "href" and (name in ("x", "y") or name not in origin.attrib)
    }
    return f'<use href="#{_defined(element, drawing)}"{_attributes(told, drawing)}/>'


def _clip(name: str, own: str, drawing: _Drawing) -> str:
    origin = drawing.origin[name]
    inside = "".join(_written(child, drawing) for child in origin)
    return f'<clipPath id="{own}">{inside}</clipPath>'


def _attributes(attributes: Mapping[str, str], drawing: _Drawing) -> str:
    return "".join(_said(name, value, drawing) for name, value in attributes.items() if name != "id")


def _said(name: str, value: str, drawing: _Drawing) -> str:
    found = _REFERENCE.fullmatch(value)
    if found:
        own = drawing.ids.setdefault(found[1], f"{drawing.key}-c{len(drawing.ids)}")
        value = f"url(#{own})"
    return f' {name}="{escape(value)}"'
