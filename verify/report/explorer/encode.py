"""Numbers as short text for a data block of the page: four bytes a value, two a coordinate of a line."""

from __future__ import annotations

import base64
import json
from collections.abc import Iterable
from typing import Any

import numpy as np
import shapely
from markupsafe import Markup
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

FINEST = 65535  # steps of a coordinate across the box of the lines: below a millimetre on a floor of 60 m
PIXELS = 5000.0  # of a map at its greatest: thinner than that nothing is drawn


def numbers(values: ArrayLike) -> str:
    """Values (n,) in single precision, little-endian, base64; what is not finite becomes NaN."""
    array = np.asarray(values, dtype=float)
    single = np.where(np.isfinite(array), array, np.nan).astype("<f4")
    return base64.b64encode(single.tobytes()).decode()


def lines(polylines: Iterable[Array], size: float) -> dict[str, Any]:
    """Polylines (n_i, 2) [m] thinned to within size / 5000 [m], with coordinates as whole steps in their box.

    Returns `at` (2,) [m], `step` (2,) [m], `first`: where each line begins, and `xy`: all points as pairs.
    Lines of fewer than two points are left out.
    """
    drawn = [np.asarray(line, dtype=float) for line in polylines if len(line) > 1]
    if not drawn:
        return {"at": [0.0, 0.0], "step": [1.0, 1.0], "first": "", "xy": ""}
    thin = shapely.simplify(np.array([shapely.LineString(line) for line in drawn]), size / PIXELS)
    points, owner = shapely.get_coordinates(thin, return_index=True)
    low = points.min(axis=0)
    step = np.maximum(np.ptp(points, axis=0), 1e-9) / FINEST
    whole = np.round((points - low) / step).astype("<u2")
    first = np.searchsorted(owner, np.arange(len(drawn) + 1)).astype("<u4")
    return {
        "at": low.tolist(),
        "step": step.tolist(),
        "first": base64.b64encode(first.tobytes()).decode(),
        "xy": base64.b64encode(whole.tobytes()).decode(),
    }


def data_block(data: Any) -> Markup:
    """JSON as the text of a script element: no character in it ends the element or opens a comment.

    Raises
    ------
    ValueError : a number is not finite.
    """
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    return Markup(text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029"))
