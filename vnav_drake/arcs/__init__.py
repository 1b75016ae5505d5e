"""Time-optimal arcs near one feature: times, tangents, derivatives and points, many at once.

Manor 2015, Sec. 3.3 and Appendix B, for any speed law of `UniformBraking`.
"""

from vnav_drake.arcs.along import CurveLegs, along_curves
from vnav_drake.arcs.legs import Legs, leg_points, solve_legs

__all__ = ["CurveLegs", "Legs", "along_curves", "leg_points", "solve_legs"]
