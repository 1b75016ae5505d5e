"""Every colour of the report, defined once: for light pages, dark pages and print.

Figures are drawn with the light colours; `svg.py` then turns each of them into a CSS variable, so that one
picture serves both grounds. Method colours are those of Okabe and Ito (2008, "Color Universal Design"),
lightened for dark grounds.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from verify.report.text import label

Dash = str | tuple[float, tuple[float, ...]]


@dataclass(frozen=True, kw_only=True)
class Method:
    """How one source of travel times looks and reads everywhere."""

    key: str
    label: str
    kind: str  # analytic, optimised, simulated, proven
    light: str  # line on a light ground
    dark: str  # line on a dark ground
    text: str  # text on a light ground, contrast at least 4.5
    marker: str
    dash: Dash = "solid"

    @property
    def variable(self) -> str:
        """CSS variable of the line colour."""
        return f"--{self.key.replace('_', '-')}"


# Order of rows in tables and of rows in the time bracket.
METHODS: Mapping[str, Method] = MappingProxyType(
    {
        method.key: method
        for method in (
            Method(key="lower_bound", label="Lower bound", kind="proven",
                   light="#2b2b2a", dark="#e6e6e2", text="#2b2b2b", marker=">"),
            Method(key="voronoi_route", label="Voronoi route", kind="analytic",
                   light="#e69f00", dark="#f0b53c", text="#8a5f00", marker="D", dash=(0, (5, 1.5))),
            Method(key="vc_method", label="vc-method", kind="analytic",
                   light="#cc79a7", dark="#e3a3c6", text="#9a3f72", marker="v", dash=(0, (6, 1.5, 1, 1.5))),
            Method(key="speed_graph", label="Speed graph", kind="analytic",
                   light="#56b4e9", dark="#8ed2fb", text="#17699c", marker="P", dash=(0, (3, 1.5))),
            Method(key="dwa", label="Dynamic window", kind="baseline",
                   light="#c9b800", dark="#f0e442", text="#6e6400", marker="X", dash=(0, (1, 1.2))),
            Method(key="cold_start", label="Cold start", kind="seed",
                   light="#8a6d5a", dash=(0, (4, 2)), dark="#c7a993", text="#6b503f", marker="d"),
            Method(key="collocation", label="Variational collocation", kind="optimised",
                   light="#0072b2", dark="#4ba3e3", text="#00629a", marker="o", dash=(0, (2.2, 1.4))),
            Method(key="refined", label="Full-robot collocation", kind="optimised",
                   light="#009e73", dark="#2cc795", text="#00714f", marker="s"),
            Method(key="uniform", label="Uniform braking", kind="optimised",
                   light="#6f56b0", dark="#b3a0ec", text="#573f97", marker="p", dash=(0, (7, 2))),
            Method(key="simulation", label="Simulated run", kind="simulated",
                   light="#d55e00", dark="#ff8a4a", text="#a84900", marker="^", dash=(0, (4, 1, 1, 1))),
        )
    }
)  # fmt: skip


def method(key: str) -> Method:
    """The look of `key`; a method of no name of its own is drawn in grey and called by its key."""
    if key in METHODS:
        return METHODS[key]
    return Method(key="other", label=label(key.replace("_", " ")) or "unnamed", kind="other",
                  light="#77777a", dark="#a5a5a8", text="#5a5a5c", marker="h")  # fmt: skip


@dataclass(frozen=True)
class Tone:
    """A neutral or warning colour on both grounds."""

    light: str
    dark: str


INK = Tone("#1f2328", "#e8eaed")  # text and axes
MUTED = Tone("#5b6470", "#a9b1bb")  # secondary text, ticks
STRAIGHTENED = Tone("#4d6a9a", "#9db7e8")  # stops with the wheels straightened
FRONT_WHEEL = Tone("#472c86", "#d3c4ff")  # wheels: front and rear by lightness, left and right by dash
REAR_WHEEL = Tone("#a17fd0", "#8d6fc4")
RULE = Tone("#d5dae0", "#3b424b")  # grid lines
PAPER = Tone("#fefefe", "#161a1f")  # ground of figures
FLOOR = Tone("#f8f8f6", "#1d2228")  # free floor on maps
RACK = Tone("#c9ced6", "#4a525d")  # obstacles on maps
RACK_EDGE = Tone("#7f8894", "#8b95a2")
ARC = Tone("#a3abb6", "#66707c")  # Voronoi arcs
LIMIT = Tone("#a3122f", "#ff8095")  # limits and violations
BAD_FILL = Tone("#fbe3e6", "#46202a")  # ground where a limit is broken
CASING = Tone("#2f353c", "#dfe3e8")  # outline of the line that carries the speed colours

# Homotopy classes by rank, the best first: lightness alone orders them, so grey print and every colour
# vision do too; strongest against the ground first.
RANKS: tuple[Tone, ...] = (
    Tone("#2a0a5e", "#fdf3b0"),
    Tone("#66187f", "#fecb80"),
    Tone("#9f2a7d", "#fb9d6b"),
    Tone("#cf4763", "#ec6b66"),
    Tone("#e0752f", "#c7508a"),
    Tone("#d99a2b", "#9a55b4"),
)


def rank_tone(rank: int) -> Tone:
    """The tone of a class of this rank, from 1; all beyond the last tone share it."""
    return RANKS[min(max(rank, 1), len(RANKS)) - 1]


def rank_variable(rank: int) -> str:
    """CSS variable of `rank_tone`."""
    return f"--rank-{min(max(rank, 1), len(RANKS))}"


# What holds a motion at an instant, see `zone_along.LIMITS`; in pictures each has a row of its own besides.
HOLDING: Mapping[str, Tone] = MappingProxyType(
    {
        "zone": Tone("#12809c", "#5cc3dd"),
        "arc": Tone("#b4387c", "#f08cc0"),
        "reserve": Tone("#c9661f", "#f5a06b"),
        "friction": Tone("#a33d2a", "#f2897a"),
        "tip": Tone("#7d4a24", "#d8a27c"),
        "steering": Tone("#4b6b2b", "#a9cc83"),
        "speed": Tone("#3f4a9c", "#9aa6f2"),
        "drive": Tone("#b08a12", "#e3c766"),
        "brakes": Tone("#7a6a12", "#c2b25a"),
        "none": Tone("#8b9199", "#838b94"),
    }
)

# Relative slack of a certificate's triangles, from loose to tight: the tight ones stand out on both grounds.
SLACKS: tuple[Tone, ...] = (
    Tone("#faf4ec", "#241f22"),
    Tone("#f2d8bb", "#48332f"),
    Tone("#e2a67b", "#85533f"),
    Tone("#bc634f", "#ce8957"),
    Tone("#792939", "#ffd8a1"),
)


def _ramp(first: str, middle: str, last: str, steps: int) -> list[str]:
    """Colours at equal steps through three, linear in sRGB."""
    known = [[int(colour[i : i + 2], 16) for i in (1, 3, 5)] for colour in (first, middle, last)]
    colours = []
    for k in range(steps):
        at = 2.0 * k / (steps - 1)
        below, share = min(int(at), 1), at - min(int(at), 1)
        pair = zip(known[below], known[below + 1], strict=True)
        colours.append("#" + "".join(f"{round(a + share * (b - a)):02x}" for a, b in pair))
    return colours


# Bands of a potential between isochrones, from early to late: quiet, as paths cross them.
BANDS: tuple[Tone, ...] = tuple(
    Tone(light, dark)
    for light, dark in zip(
        _ramp("#f3f8ef", "#a8d5b1", "#4e997f", 18), _ramp("#182420", "#27574a", "#4d9480", 18), strict=True
    )
)


_TONES: Mapping[str, Tone] = MappingProxyType(
    {
        "--ink": INK,
        "--muted": MUTED,
        "--rule": RULE,
        "--paper": PAPER,
        "--floor": FLOOR,
        "--rack": RACK,
        "--rack-edge": RACK_EDGE,
        "--arc": ARC,
        "--limit": LIMIT,
        "--straightened": STRAIGHTENED,
        "--front-wheel": FRONT_WHEEL,
        "--rear-wheel": REAR_WHEEL,
        "--bad-fill": BAD_FILL,
        "--casing": CASING,
        **{rank_variable(k): tone for k, tone in enumerate(RANKS, 1)},
        **{f"--holding-{key}": tone for key, tone in HOLDING.items()},
        **{f"--slack-{k}": tone for k, tone in enumerate(SLACKS, 1)},
        **{f"--band-{k}": tone for k, tone in enumerate(BANDS, 1)},
    }
)

SPEED_MAP = "cividis"  # matplotlib's name: sequential, reads the same for every colour vision, prints in grey


def _pairs() -> dict[str, Tone]:
    pairs = dict(_TONES)
    for item in (*METHODS.values(), method("other")):
        pairs[item.variable] = Tone(item.light, item.dark)
        pairs[item.variable + "-text"] = Tone(item.text, item.dark)
    return pairs


def css_variables(*, dark: bool) -> str:
    """Declarations of all colours, for the inside of a CSS rule."""
    return " ".join(f"{name}: {tone.dark if dark else tone.light};" for name, tone in _pairs().items())


def variable_of_colour() -> Mapping[str, str]:
    """CSS variable of each light colour; the light colours are all different."""
    return {tone.light: name for name, tone in _pairs().items()}
