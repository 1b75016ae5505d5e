"""Figures as inline SVG: no fonts, no dates, no references, colours as CSS variables.

Letters are drawn as outlines, so a picture looks the same without any font installed, and text from files is
never text of the page. Every `id` carries the figure's key, as one page holds many figures.
"""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import matplotlib
from markupsafe import Markup, escape
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.patheffects import withStroke
from matplotlib.text import Text

from verify.report.palette import INK, MUTED, RULE, variable_of_colour
from verify.report.svg_tree import Rim, compact_svg

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


class Halo(withStroke):
    """A rim around letters as matplotlib draws it, which `to_svg` draws in fewer bytes."""

    def __init__(self, rim: Rim) -> None:
        super().__init__(linewidth=rim.width, foreground=rim.colour)
        self.rim = rim


@contextmanager
def drawing_style() -> Iterator[None]:
    """The report's look, whatever the user's matplotlibrc says; the old settings return afterwards."""
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(_STYLE)
        yield


def new_figure(width: float, height: float) -> Figure:
    """An empty figure of `width` x `height` CSS pixels that arranges its axes itself."""
    figure = Figure(figsize=(width / UNITS_PER_INCH, height / UNITS_PER_INCH), layout=new_layout())
    FigureCanvasSVG(figure)
    return figure


def new_layout() -> ConstrainedLayoutEngine:
    """How axes share the room of a figure."""
    return ConstrainedLayoutEngine(w_pad=4 / 72, h_pad=4 / 72, hspace=0.04, wspace=0.04)


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
    with matplotlib.rc_context({"svg.hashsalt": key}), _rims_apart(figure) as rims:
        figure.savefig(
            buffer, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None}
        )
    body = buffer.getvalue()
    found = re.search(r'<svg[^>]*viewBox="([-0-9. ]+)"', body)
    if found is None:
        raise ValueError(f"figure {key}: the drawing has no viewBox")
    variables = variable_of_colour()
    inside = compact_svg(
        body[body.index("<svg") :],
        key=key,
        rims=rims,
        colour=lambda value: f"var({variables[value]})" if value in variables else value,
    )
    width, height = found[1].split()[2:]
    head = (
        f'<svg viewBox="{found[1]}" width="{width}" height="{height}" role="img" '
        f'aria-labelledby="{key}-title {key}-desc" stroke-linejoin="round">'
        f'<title id="{key}-title">{escape(title)}</title><desc id="{key}-desc">{escape(description)}</desc>'
    )
    return Drawn.of(f"{head}{inside}</svg>", figure)


@contextmanager
def _rims_apart(figure: Figure) -> Iterator[Mapping[str, Rim]]:
    """Texts drawn without their rims, which are told by the ids that the texts get for that while.

    Matplotlib would draw a text with a rim as one outline of its own, twice: ten times the size.
    """
    rims: dict[str, Rim] = {}
    before = []
    for text in figure.findobj(Text):
        effects = text.get_path_effects()
        if effects and isinstance(effects[0], Halo):
            name = f"rim-{len(rims)}"
            rims[name] = effects[0].rim
            before.append((text, effects, text.get_gid()))
            text.set(path_effects=[], gid=name)
    yield rims
    for text, effects, gid in before:
        text.set(path_effects=effects, gid=gid)
