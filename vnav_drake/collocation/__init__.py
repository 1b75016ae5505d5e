"""Direct collocation through Drake's MathematicalProgram, in the path domain."""

from vnav_drake.collocation.planner import Effort, plan_full, plan_variational
from vnav_drake.collocation.seed import Seed

__all__ = ["Effort", "Seed", "plan_full", "plan_variational"]
