"""The vc-method of Manor 2015, Ch. 2: critical points, cells and adjacency graph of position-velocity space."""

from vnav_drake.vc_method.critical import MAXIMUM, SADDLE, CriticalPoints, critical_points
from vnav_drake.vc_method.topology import euler_characteristic, free_components

__all__ = [
    "MAXIMUM",
    "SADDLE",
    "CriticalPoints",
    "critical_points",
    "euler_characteristic",
    "free_components",
]
