"""Direct collocation through Drake's MathematicalProgram, in the path domain."""

from vnav_drake.collocation.planner import plan_full, plan_variational

__all__ = ["plan_full", "plan_variational"]
