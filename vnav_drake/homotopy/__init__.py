"""Names of homotopy classes, for any path of any method."""

from vnav_drake.homotopy.build import build_gates, feet_of
from vnav_drake.homotopy.gates import Gates, Word, reduced
from vnav_drake.homotopy.motion import class_of, homotopic_polyline, word_of
from vnav_drake.homotopy.outlines import DIRECT

__all__ = [
    "DIRECT",
    "Gates",
    "Word",
    "build_gates",
    "class_of",
    "feet_of",
    "homotopic_polyline",
    "reduced",
    "word_of",
]
