"""What the wheels did along the run: small pictures over one clock."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from numpy.typing import NDArray

from verify.report.curves import Curve, halo, label_curves
from verify.report.evidence import SimulatedRun
from verify.report.numbers import significant
from verify.report.palette import (
    BAD_FILL,
    FRONT_WHEEL,
    INK,
    LIMIT,
    MUTED,
    REAR_WHEEL,
    RULE,
    Dash,
    method,
)
from verify.report.series import thinned
from verify.report.svg import WIDE, Picture, both_widths, new_figure, to_svg

Array = NDArray[np.float64]

MODES = ("tracks", "emergency stop", "stopped", "fallen")
_FILLS = (RULE, BAD_FILL, RULE, BAD_FILL)
BUCKETS = (90, 50)  # of the curves, wide and narrow: keeps the extremes of every bucket
HEIGHT, STRIP = 105.0, 34.0  # [px] of a panel and of the strip of modes
DASHED = (0, (3.0, 1.6))


@dataclass(frozen=True, kw_only=True)
class Panel:
    """One quantity over the run."""

    title: str
    unit: str
    curves: Sequence[tuple[str, Array, str, Dash]]  # label, values, colour, dash
    level: tuple[float, str] | None = None  # a value that means something, and its name
    words: str = ""  # what is seen in it, for those who do not see it


def panels(run: SimulatedRun, max_steering: float) -> list[Panel]:
    """Those of wheel loads, slip, torque and steering that the run has recorded."""
    found = []
    for kind, title, unit, level in (
        ("load", "Wheel loads", "N", (0.0, "lifted")),
        ("slip", "Slip over the floor", "m/s", None),
        ("torque", "Torque", "N m", None),
    ):
        wheels = run.of_wheels(kind)
        if wheels:
            every = np.array(list(wheels.values()))
            found.append(
                Panel(
                    title=title,
                    unit=unit,
                    curves=[_wheel(name, values) for name, values in wheels.items()],
                    level=level,
                    words=f"{title.lower()} {significant(float(every.min()))} to "
                    f"{significant(float(every.max()))} {unit}",
                )
            )
    angle, command = run.channels.get("steering"), run.channels.get("steering_command")
    if angle is not None:
        look = method("simulation")
        curves: list[tuple[str, Array, str, Dash]] = []
        if command is not None:
            curves.append(("commanded", command, MUTED.light, DASHED))
        curves.append(("steering", angle, look.light, "solid"))
        most = float(np.abs(angle).max())
        limit = (float(np.sign(angle[np.abs(angle).argmax()]) or 1.0) * max_steering, "limit")
        found.append(
            Panel(
                title="Steering",
                unit="rad",
                curves=curves,
                level=limit if most > 0.5 * max_steering else None,
                words=f"steering up to {significant(most)} rad",
            )
        )
    return found


def _wheel(name: str, values: Array) -> tuple[str, Array, str, Dash]:
    tone = FRONT_WHEEL if name.startswith("front") else REAR_WHEEL
    return name.replace("_", " "), values, tone.light, "solid" if name.endswith("left") else DASHED


def draw_run(run: SimulatedRun, max_steering: float) -> Picture | None:
    """Wheel loads, slip, torque, steering and the supervisor's mode over time; None without any."""
    rows, mode = panels(run, max_steering), run.channels.get("mode")
    if not rows:
        return None
    spoken = "; ".join(panel.words for panel in rows)
    title = "What the wheels did" if len(rows) > 1 else rows[0].title
    described = {
        "key": "run-channels",
        "title": title,
        "description": f"Over {run.t[-1]:.2f} s: {spoken}.",
    }
    return both_widths(
        partial(_draw, run.t, rows, mode),
        described,
        heading=title,
        caption="Every extreme is kept where curves are thinned."
        + (" Torque: drive and brake together, negative slows." if run.of_wheels("torque") else ""),
    )


def _draw(
    t: Array, rows: Sequence[Panel], mode: Array | None, described: dict[str, str], width: float
) -> Markup:
    wide = width == WIDE
    heights = [*([] if mode is None else [STRIP]), *([HEIGHT if wide else 0.95 * HEIGHT] * len(rows))]
    figure = new_figure(width, sum(heights) + 44.0)
    every = list(figure.subplots(len(heights), 1, sharex=True, squeeze=False, height_ratios=heights)[:, 0])
    every[0].set_xlim(float(t[0]), float(t[-1]))
    below: list[Callable[[], None]] = []
    if mode is not None:
        _modes(every[0], t, mode)
    for axes, panel in zip(every[len(heights) - len(rows) :], rows, strict=True):
        below.append(_panel(axes, t, panel, BUCKETS[0] if wide else BUCKETS[1], wide=wide))
    every[-1].set_xlabel("time [s]")
    for write in below:  # labels when all limits are final
        write()
    return to_svg(figure, **described)


def _panel(axes: Axes, t: Array, panel: Panel, buckets: int, *, wide: bool) -> Callable[[], None]:
    drawn = []
    for name, values, colour, dash in panel.curves:
        x, y = thinned(t, values, buckets)
        axes.plot(x, y, color=colour, lw=1.1, ls=dash, dash_capstyle="butt")
        drawn.append(Curve(x=x, y=y, text=name, colour=colour if colour != REAR_WHEEL.light else INK.light))
    low, high = (float(f([f(curve.y) for curve in drawn])) for f in (min, max))
    if panel.level is not None:
        low, high = min(low, panel.level[0]), max(high, panel.level[0])
        axes.axhline(panel.level[0], color=LIMIT.light, lw=1.2, ls="--")
    reach = max(high - low, 1e-3 * max(abs(high), abs(low)), 1e-6)
    axes.set_ylim(low - 0.1 * reach, high + (0.5 if wide else 0.4) * reach)
    axes.set_ylabel(f"[{panel.unit}]")
    axes.locator_params(axis="y", nbins=3)
    halo(
        axes.annotate(
            panel.title, (0.0, 1.0), (4, -1), xycoords="axes fraction", textcoords="offset points", va="top",
            fontsize=10.5, weight="bold", color=INK.light,
        )
    )  # fmt: skip
    if panel.level is not None:
        halo(
            axes.annotate(
                panel.level[1], (1.0, panel.level[0]), (-3, 3), xycoords=("axes fraction", "data"),
                textcoords="offset points", ha="right", va="bottom", fontsize=9.5, color=LIMIT.light,
            )
        )  # fmt: skip
    return partial(label_curves, axes, drawn if wide else [], size=9.0, gaps=(3.0, 9.0))


def _modes(axes: Axes, t: Array, mode: Array) -> None:
    """The supervisor's modes as a strip, each named where there is room."""
    axes.set_ylim(0.0, 1.0)
    axes.set_yticks([])
    axes.grid(False)
    for side in axes.spines.values():
        side.set_visible(False)
    axes.tick_params(length=0)
    numbers = np.clip(np.round(mode), 0, len(MODES) - 1).astype(np.int64)
    starts = np.concatenate([[0], np.flatnonzero(np.diff(numbers)) + 1])
    ends = np.append(starts[1:], len(t) - 1)
    for start, end in list(zip(starts.tolist(), ends.tolist(), strict=True))[:200]:
        kind, begin, until = int(numbers[start]), float(t[start]), float(t[end])
        axes.axvspan(begin, until, color=_FILLS[kind].light, lw=0.0)
        axes.axvline(begin, color=MUTED.light, lw=0.8)
        if until - begin > 0.16 * float(t[-1] - t[0]):
            axes.text(
                0.5 * (begin + until),
                0.5,
                MODES[kind],
                ha="center",
                va="center",
                fontsize=10,
                color=INK.light,
            )
