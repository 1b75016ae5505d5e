"""The dynamic window approach: the baseline of Manor 2015, Sec. 2.7.2, on the same robot and world.

D. Fox, W. Burgard, S. Thrun, "The dynamic window approach to collision avoidance", IEEE Robotics and
Automation Magazine 4(1), 1997, with the braking safety of O. Brock and O. Khatib, "High-speed navigation
using the global dynamic window approach", ICRA 1999.
"""

from vnav_drake.dwa.objective import Objective
from vnav_drake.dwa.run import DwaRun, plan_dwa
from vnav_drake.dwa.stuck import Stuck

__all__ = ["DwaRun", "Objective", "Stuck", "plan_dwa"]
