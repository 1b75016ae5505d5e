"""The small map of a result: its world and the path that is executed."""

from __future__ import annotations

import numpy as np

from verify.report.palette import Tone, method
from verify.report.thumbnail import ThumbnailPath, thumbnail_file
from vnav_drake.plan import Trajectory
from vnav_drake.problem import Problem


def executed_thumbnail(problem: Problem, executed: tuple[str, Trajectory] | None) -> str:
    """The text of an SVG file with its own colours for light and dark grounds.

    Parameters
    ----------
    executed : the plan's method and motion; None draws the world alone.
    """
    if executed is None:
        return thumbnail_file(problem, [], words="map without an executed path")
    name, motion = executed
    look = method(name)
    path = ThumbnailPath(
        points=np.column_stack([motion.x, motion.y]),
        tone=Tone(look.light, look.dark),
        variable=look.variable,
    )
    return thumbnail_file(problem, [path], words=f"map with the executed path: {look.label}")
