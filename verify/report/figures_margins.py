"""How far every limit is from being reached along the motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from verify.report.numbers import seconds, with_unit
from verify.report.palette import BAD_FILL, INK, LIMIT, method
from verify.report.series import Margin, thinned
from verify.report.svg import PANEL, Picture, drawing_style, new_axes, to_svg


@dataclass(frozen=True, kw_only=True)
class MarginsData:
    """Margins of the executed motion, and of the variational one to compare with."""

    executed: Sequence[Margin]
    plan: str  # method of the executed motion
    variational: Mapping[str, Margin]  # by key; empty if there is none or it is executed
    other: str = "collocation"  # method of the variational motion


def draw_margins(data: MarginsData) -> Sequence[Picture]:
    """One panel a limit: margin over time, zero dashed, the least margin marked."""
    pictures = []
    with drawing_style():
        for margin in data.executed:
            i = margin.worst
            least = with_unit(float(margin.value[i]), margin.unit)
            where = f"at {seconds(float(margin.t[i]))}, ({margin.x[i]:.2f}, {margin.y[i]:.2f}) m"
            key, title = f"margin-{margin.key}", f"{margin.name}: margin over time"
            spoken = f"Margin {margin.formula}. Least margin {least} {where}; the limit is at zero."
            svg = _panel(
                margin, data.variational.get(margin.key), (data.plan, data.other), key, title, spoken
            )
            pictures.append(
                Picture(
                    key=key,
                    title=title,
                    description=spoken,
                    svg=svg,
                    heading=margin.name,
                    caption=f"{margin.formula}. Least {least} {where}.",
                )
            )
    return pictures


def _panel(
    margin: Margin, other: Margin | None, methods: tuple[str, str], key: str, title: str, spoken: str
) -> Markup:
    """`methods` are those of the executed motion and of the other one."""
    figure, axes = new_axes(PANEL, 190, x="time [s]", y=f"margin [{margin.unit}]")
    look, variational = map(method, methods)
    low, high = min(0.0, float(margin.value.min())), float(margin.value.max())
    if other is not None:
        axes.plot(
            *thinned(other.t, other.value, 220),
            color=variational.light,
            lw=1.0,
            ls=variational.dash,
            dash_capstyle="butt",
        )
        low, high = min(low, float(other.value.min())), max(high, float(other.value.max()))
    axes.plot(*thinned(margin.t, margin.value, 220), color=look.light, lw=1.7)
    span = max(high - low, 1e-12)
    bottom, top = low - 0.12 * span, high + 0.1 * span
    axes.axhspan(bottom, 0.0, color=BAD_FILL.light, lw=0, zorder=0)
    axes.axhline(0.0, color=LIMIT.light, ls=(0, (5, 2)), lw=1.3)
    i = margin.worst
    axes.plot(margin.t[i], margin.value[i], "o", mfc="none", mec=INK.light, ms=9, mew=1.5, clip_on=False)
    end = max(float(m.t[-1]) for m in (margin, other) if m is not None)
    axes.set_xlim(0.0, end)
    axes.set_ylim(bottom, top)
    axes.locator_params(axis="y", nbins=5)
    if np.ptp(margin.value) < 1e-9 * max(1.0, high):
        axes.yaxis.get_major_formatter().set_useOffset(False)  # type: ignore[attr-defined]
    return to_svg(figure, key=key, title=title, description=spoken)
