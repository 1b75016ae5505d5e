"""Figures as inline SVG: no fonts, no dates, no references, colours as CSS variables.

Letters are drawn as outlines, so a picture looks the same without any font installed, and text from files is
never text of the page. Every `id` carries the figure's key, as one page holds many figures.
"""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import matplotlib
from markupsafe import Markup, escape
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from verify.report.palette import INK, MUTED, RULE, variable_of_colour

UNITS_PER_INCH = 72.0  # one unit of the picture is one CSS pixel at its natural width
WIDE = 900.0  # [px] natural width of a picture that fills the page
NARROW = 360.0  # [px] the same on a telephone
PANEL = 440.0  # [px] one of several pictures side by side

_STYLE: Any = {
    "svg.fonttype": "path",
    "text.parse_math": False,  # names from files may hold dollar signs
    "font.family": ["DejaVu Sans"],  # comes with matplotlib
    "font.size": 11.0,
    "axes.titlesize": 11.5,
    "axes.titlelocation": "left",
    "axes.labelsize": 11.0,
    "axes.labelcolor": INK.light,
    "axes.edgecolor": MUTED.light,
    "axes.linewidth": 0.8,
    "axes.facecolor": "none",
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "grid.color": RULE.light,
    "grid.linewidth": 0.7,
    "xtick.color": MUTED.light,
    "ytick.color": MUTED.light,
    "xtick.labelsize": 10.0,
    "ytick.labelsize": 10.0,
    "text.color": INK.light,
    "figure.facecolor": "none",
    "figure.dpi": UNITS_PER_INCH,
    "savefig.facecolor": "none",
    "lines.solid_capstyle": "round",
    "path.simplify": False,  # we thin the data ourselves and keep extremes
}


@contextmanager
def drawing_style() -> Iterator[None]:
    """The report's look, whatever the user's matplotlibrc says; the old settings return afterwards."""
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(_STYLE)
        yield


def new_figure(width: float, height: float) -> Figure:
    """An empty figure of `width` x `height` CSS pixels that arranges its axes itself."""
    layout = ConstrainedLayoutEngine(w_pad=4 / 72, h_pad=4 / 72, hspace=0.04, wspace=0.04)
    figure = Figure(figsize=(width / UNITS_PER_INCH, height / UNITS_PER_INCH), layout=layout)
    FigureCanvasSVG(figure)
    return figure


def new_axes(width: float, height: float, *, x: str, y: str) -> tuple[Figure, Axes]:
    """A figure with one pair of axes and their labels."""
    figure = new_figure(width, height)
    axes = figure.add_subplot()
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    return figure, axes


def arrange(figure: Figure, *, final: bool = True) -> None:
    """Put all axes where they will stand, so that pixels can be reckoned; nothing is drawn.

    As `Figure.draw_without_rendering`, at half its cost: that one also walks through every artist. Where
    it is `final`, everything outside the axes is there already: they stay where they are now.
    """
    layout = figure.get_layout_engine()
    if layout is not None:
        layout.execute(figure)
    if final:
        figure.set_layout_engine("none")
    for axes in figure.axes:
        axes.apply_aspect()


class Drawn(Markup):
    """A drawing's text for the page, which still knows the figure it was made from."""

    figure: Figure | None = None  # arranged; None of a text that was put together from others

    @classmethod
    def of(cls, text: str, figure: Figure) -> Drawn:
        """The drawing of `figure`."""
        drawn = cls(text)
        drawn.figure = figure
        return drawn


@dataclass(frozen=True, kw_only=True)
class Picture:
    """One finished figure for the page."""

    key: str  # letters, digits and hyphens; unique in the page
    title: str  # short name, read aloud
    description: str  # what it shows, for those who do not see it
    svg: Markup
    narrow: Markup | None = None  # another drawing for small screens
    caption: str = ""  # below the picture
    heading: str = ""  # above the picture


def both_widths(
    draw: Callable[[dict[str, str], float], Markup], described: dict[str, str], **around: str
) -> Picture:
    """A picture drawn twice, for wide and for small screens; `around`: its heading and caption."""
    with drawing_style():
        return Picture(
            **described,
            svg=draw(described, WIDE),
            narrow=draw({**described, "key": f"{described['key']}-narrow"}, NARROW),
            **around,
        )


def to_svg(figure: Figure, *, key: str, title: str, description: str) -> Drawn:
    """The figure as one `<svg role="img">` element. The same figure gives the same text."""
    buffer = io.StringIO()
    arrange(figure)  # which leaves no layout to do: that would draw everything once more to no end
    with matplotlib.rc_context({"svg.hashsalt": key}):
        figure.savefig(
            buffer, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None}
        )
    body = buffer.getvalue()
    body = body[body.index("<svg") :]
    body = re.sub(r"<!--.*?-->", "", body, flags=re.DOTALL)
    body = re.sub(r"<metadata>.*?</metadata>|<style.*?</style>", "", body, flags=re.DOTALL)
    body = re.sub(r"<defs>\s*</defs>", "", body)
    opening, inside = body.split(">", 1)
    found = re.search(r'viewBox="([-0-9. ]+)"', opening)
    if found is None:
        raise ValueError(f"figure {key}: the drawing has no viewBox")
    inside = inside.replace("xlink:href=", "href=")
    inside = re.sub(r'\bid="([^"]+)"', rf'id="{key}-\1"', inside)
    inside = re.sub(r'href="#([^"]+)"', rf'href="#{key}-\1"', inside)
    inside = re.sub(r"url\(#([^)]+)\)", rf"url(#{key}-\1)", inside)
    inside = re.sub(r' ?style="([^"]*)"', _attributes, inside)
    inside = re.sub(r' d="([^"]*)"', _rounded, inside)
    inside = _RIM.sub(_one_path, inside)
    inside = re.sub(r' [xy]="-?\d+\.\d{3,}"', lambda m: re.sub(r"-?\d+\.\d+", _short, m[0]), inside)
    variables = variable_of_colour()
    inside = re.sub(
        r"#[0-9a-f]{6}\b", lambda m: f"var({variables[m[0]]})" if m[0] in variables else m[0], inside
    )
    inside = re.sub(r"\s*\n\s*", "\n", inside)
    width, height = found[1].split()[2:]
    head = (
        f'<svg viewBox="{found[1]}" width="{width}" height="{height}" role="img" '
        f'aria-labelledby="{key}-title {key}-desc" stroke-linejoin="round">'
        f'<title id="{key}-title">{escape(title)}</title><desc id="{key}-desc">{escape(description)}</desc>'
    )
    return Drawn.of(head + inside.strip(), figure)


def _attributes(match: re.Match[str]) -> str:
    """Inline styles as attributes: the page's policy then needs no leave for inline styles."""
    pairs = (item.split(":", 1) for item in match[1].split(";") if ":" in item)
    return "".join(f' {name.strip()}="{value.strip()}"' for name, value in pairs)


def _rounded(match: re.Match[str]) -> str:
    numbers = re.sub(r"-?\d+\.\d{3,}", _short, match[1])
    return f' d="{" ".join(numbers.split())}"'


def _short(match: re.Match[str]) -> str:
    return f"{float(match[0]):.2f}".rstrip("0").rstrip(".")


# Letters with a rim come as two outlines, the one below stroked: one outline can say both.
_RIM = re.compile(
    r'<path d="([^"]*)" fill="([^"]*)" stroke="([^"]*)" stroke-width="([^"]*)"/>\s*<path d="\1" fill="\2"/>'
)


def _one_path(match: re.Match[str]) -> str:
    outline, fill, rim, width = match.groups()
    return f'<path d="{outline}" fill="{fill}" stroke="{rim}" stroke-width="{width}" paint-order="stroke"/>'
