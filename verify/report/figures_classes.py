"""Homotopy classes: their optimal paths on the map, their speeds, and how Newton's method converged."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from verify.report.curves import Curve, halo, label_curves
from verify.report.drawings import ClassDrawing
from verify.report.figures_map import draw_ends, draw_world, map_height
from verify.report.figures_mesh import logarithmic
from verify.report.numbers import count, seconds, significant
from verify.report.palette import INK, PAPER, rank_tone
from verify.report.series import in_steps, thinned, thinned_path
from verify.report.svg import PANEL, WIDE, Picture, both_widths, drawing_style, new_axes, new_figure, to_svg
from verify.report.text import label
from vnav_drake.plan import Trajectory
from vnav_drake.problem import Problem

Array = NDArray[np.float64]

MOST_CLASSES = 6  # drawn: as many as there are tones
BAND = 1.7  # [px] by which the line of a class is broader than that of the class before
LABEL_ROOM = 24.0  # [px] between the middles of two numbers
LABEL_PLACES = 200  # along a path at which its number may stand
STRIP = 78.0  # [px] height of one speed profile


def draw_class_map(problem: Problem, classes: Sequence[ClassDrawing]) -> Picture:
    """The optimal path of each class; better ones lie on top as narrower lines, so none hides another."""
    shown = classes[:MOST_CLASSES]
    spoken = "; ".join(f"{c.rank}: {label(c.name, 60)}" for c in shown)
    more = (
        f" The {count(len(classes) - len(shown))} further ones are not drawn."
        if len(shown) < len(classes)
        else ""
    )
    described = {
        "key": "classes-map",
        "title": "Map of the optimal paths of the homotopy classes",
        "description": f"The fastest path of each class, numbered by rank: {spoken}.{more}",
    }
    return both_widths(
        partial(_map, problem, shown),
        described,
        caption="The fastest path of each class in the variational model, numbered by rank. Where paths "
        f"run together, the lines of better classes lie on top as narrower bands.{more}",
    )


def _map(
    problem: Problem, classes: Sequence[ClassDrawing], described: dict[str, str], width: float
) -> Markup:
    world = problem.world
    figure, axes = new_axes(width, map_height(world, width, bar=False), x="x [m]", y="y [m]")
    draw_world(axes, world, names=width == WIDE)
    scale = 1.0 if width == WIDE else 0.6
    for item in reversed(classes):
        broad = scale * (2.2 + BAND * (item.rank - 1))
        axes.plot(
            *thinned_path(item.points[:, 0], item.points[:, 1], world.diameter),
            color=rank_tone(item.rank).light,
            lw=broad,
            gid=f"class-{item.rank}",
        )
    draw_ends(axes, problem, classes[0].motion if classes else None)
    room = LABEL_ROOM * float(np.ptp(world.bounds[::2])) / width
    for item, place in zip(classes, _label_places(problem, classes, room), strict=True):
        _number(axes, item.rank, place)
    return to_svg(figure, **described)


def _label_places(problem: Problem, classes: Sequence[ClassDrawing], room: float) -> list[Array]:
    """Where the number of each class stands: on its path, far from the other paths.

    `room` [m] is the least distance from the other numbers and from both ends, where that can be.
    """
    taken = [problem.start.point, problem.goal.point]
    places = []
    for item in classes:
        candidates = _spread(item.points, LABEL_PLACES)
        apart = np.minimum(cKDTree(np.array(taken)).query(candidates)[0] - room, 0.0)
        rest = [other.points for other in classes if other is not item]
        alone = cKDTree(np.concatenate(rest)).query(candidates)[0] if rest else -apart
        best = int(np.lexsort([alone, apart])[-1])
        places.append(candidates[best])
        taken.append(places[-1])
    return places


def _spread(points: Array, most: int) -> Array:
    """Points at equal distances along a polyline."""
    run = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    at = np.linspace(0.0, run[-1], most)
    return np.column_stack([np.interp(at, run, points[:, k]) for k in (0, 1)])


def _number(axes: Axes, rank: int, place: Array) -> None:
    tone = rank_tone(rank)
    gid = f"class-{rank}"
    axes.plot(*place, "o", ms=15, mfc=PAPER.light, mec=tone.light, mew=2.2, zorder=6, gid=gid)
    axes.annotate(
        str(rank),
        (place[0], place[1]),
        ha="center",
        va="center_baseline",
        fontsize=10,
        weight="bold",
        color=INK.light,
        zorder=7,
        gid=gid,
    )


def draw_class_speeds(problem: Problem, classes: Sequence[ClassDrawing]) -> Picture | None:
    """Speed over time along the optimum of each class, one strip a class on one time axis."""
    moving = [(item, item.motion) for item in classes[:MOST_CLASSES] if item.motion is not None]
    if not moving:
        return None
    spoken = "; ".join(
        f"{item.rank}: {seconds(motion.travel_time)}, greatest speed {motion.v.max():.2f} m/s"
        for item, motion in moving
    )
    described = {
        "key": "classes-speed",
        "title": "Speed over time of the classes",
        "description": f"Speed along the optimal path of each class: {spoken}.",
    }
    return both_widths(
        partial(_speeds, moving),
        described,
        heading="Speed along the optimal path of each class",
        caption="At every instant the braking limit V(d) of the place: the variational model knows no "
        "limit of acceleration or turning.",
    )


def _speeds(
    moving: Sequence[tuple[ClassDrawing, Trajectory]], described: dict[str, str], width: float
) -> Markup:
    figure = new_figure(width, STRIP * len(moving) + 48.0)
    every = list(figure.subplots(len(moving), 1, sharex=True, sharey=True, squeeze=False)[:, 0])
    end = max(motion.travel_time for _, motion in moving)
    top = 1.15 * max(float(motion.v.max()) for _, motion in moving)
    for axes, (item, motion) in zip(every, moving, strict=True):
        axes.set_gid(f"class-{item.rank}")
        t, _, v, _ = in_steps(motion, 2)
        tone = rank_tone(item.rank)
        axes.plot(*thinned(t, v, 220), color=tone.light, lw=1.8)
        axes.plot([t[-1]] * 2, [0.0, v[-1]], color=tone.light, lw=1.0, ls=(0, (2, 2)))
        words = f"{item.rank}   {seconds(motion.travel_time)}"
        if width == WIDE:
            words += f"   {label(item.name, 80)}"
        halo(
            axes.annotate(
                words, (0.0, 1.0), (4, -2), xycoords="axes fraction", textcoords="offset points",
                va="top", fontsize=9.5, weight="bold" if item.rank == 1 else "normal", color=INK.light,
            )
        )  # fmt: skip
        axes.set_xlim(0.0, 1.02 * end)
        axes.set_ylim(0.0, 1.35 * top)
        axes.locator_params(axis="y", nbins=3)
    every[-1].set_xlabel("time [s]")
    figure.supylabel("speed [m/s]", fontsize=11)
    return to_svg(figure, **described)


def draw_newton(classes: Sequence[ClassDrawing]) -> Sequence[Picture]:
    """Residual and distance from the final travel time over Newton's iterations, one curve a class."""
    pictures = []
    told = [item for item in classes[:MOST_CLASSES] if len(item.residuals) or len(item.iteration_times)]
    with drawing_style():
        for key, title, unit, series in (
            ("newton-residual", "Residual of the optimality conditions", "residual", _residuals),
            ("newton-time", "Distance from the final travel time", "|T of iteration − T| [s]", _remainders),
        ):
            curves = [(item.rank, *series(item)) for item in told]
            drawable = [curve for curve in curves if len(curve[1])]
            if drawable:
                pictures.append(_convergence(key, title, unit, drawable))
    return pictures


Series = tuple[Array, Array]  # iterations and values > 0, which a logarithm needs


def _positive(values: Array) -> Series:
    kept = np.flatnonzero(np.isfinite(values) & (values > 0.0))
    return kept.astype(float), values[kept]


def _residuals(item: ClassDrawing) -> Series:
    return _positive(np.abs(np.asarray(item.residuals, dtype=float)))


def _remainders(item: ClassDrawing) -> Series:
    times = np.asarray(item.iteration_times, dtype=float)
    return _positive(np.abs(times - times[-1])) if len(times) else (times, times)


def _convergence(key: str, title: str, unit: str, curves: Sequence[tuple[int, Array, Array]]) -> Picture:
    figure, axes = new_axes(PANEL, 0.62 * PANEL, x="iteration of Newton's method", y=unit)
    labelled = []
    for rank, x, y in reversed(curves):
        axes.plot(x, y, "o-", color=rank_tone(rank).light, lw=1.6, ms=4.5, gid=f"class-{rank}")
        labelled.append(Curve(x=x, y=y, text=str(rank), colour=INK.light))
    low, high = (f([f(y) for _, _, y in curves]) for f in (min, max))
    longest = int(max(x[-1] for _, x, _ in curves))
    axes.set_xlim(-0.3, longest + 0.3)
    axes.set_xticks(range(0, longest + 1, max(1, longest // 8)))
    logarithmic(axes, 0.5 * float(low), 2.0 * float(high))
    label_curves(axes, labelled, gaps=(7.0, 13.0))
    spoken = "; ".join(
        f"class {rank} from {significant(float(y[0]), 2)} to {significant(float(y[-1]), 2)}"
        for rank, _, y in curves
    )
    described = {"key": key, "title": title, "description": f"{title} by iteration: {spoken}."}
    caption = (
        "One curve a class, numbered by rank, over all its iterations; where a curve jumps up, the structure "
        "of the path was changed. Zero has no place on this scale. Compare Manor 2015, Fig. 3.10."
    )
    svg = to_svg(figure, **described)
    return Picture(**described, svg=svg, narrow=None, heading=title, caption=caption)
