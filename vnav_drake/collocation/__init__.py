"""Direct collocation through Drake's MathematicalProgram, in the path domain."""

from vnav_drake.collocation.planner import plan_full, plan_variational
from vnav_drake.collocation.seed import Seed

__all__ = ["Seed", "plan_full", "plan_variational"]
