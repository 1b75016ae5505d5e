"""The speed graph of Manor 2015, ch. 3: homotopy classes and the fastest path of each."""

from vnav_drake.speed_graph.classes import ClassOptimum
from vnav_drake.speed_graph.planner import SpeedGraphResult, as_plan, plan_speed_graph, speed_graph

__all__ = ["ClassOptimum", "SpeedGraphResult", "as_plan", "plan_speed_graph", "speed_graph"]
