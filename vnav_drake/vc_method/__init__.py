"""The vc-method (Manor 2015, Ch. 2): critical points, cells, adjacency graph of position-velocity space."""

from vnav_drake.vc_method.adjacency import AdjacencyGraph, build_adjacency, published_cost
from vnav_drake.vc_method.cells import (
    Cell,
    CellDecomposition,
    HorizontalPartition,
    Stack,
    VerticalPartition,
    decompose,
)
from vnav_drake.vc_method.critical import MAXIMUM, SADDLE, CriticalPoints, critical_points
from vnav_drake.vc_method.planner import VcResult, as_plan, plan_vc_method, vc_method
from vnav_drake.vc_method.profile import arc_minimum_time
from vnav_drake.vc_method.realise import Realisation, realise
from vnav_drake.vc_method.search import CellRoute, search
from vnav_drake.vc_method.topology import euler_characteristic, free_components

__all__ = [
    "MAXIMUM",
    "SADDLE",
    "AdjacencyGraph",
    "Cell",
    "CellDecomposition",
    "CellRoute",
    "CriticalPoints",
    "HorizontalPartition",
    "Realisation",
    "Stack",
    "VcResult",
    "VerticalPartition",
    "arc_minimum_time",
    "as_plan",
    "build_adjacency",
    "critical_points",
    "decompose",
    "euler_characteristic",
    "free_components",
    "plan_vc_method",
    "published_cost",
    "realise",
    "search",
    "vc_method",
]
