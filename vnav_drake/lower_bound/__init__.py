"""A global lower bound: no path of any homotopy class is faster, with a certificate that proves it."""

from vnav_drake.lower_bound.bound import LowerBound, Round, lower_bound
from vnav_drake.lower_bound.certificate import Certificate

__all__ = ["Certificate", "LowerBound", "Round", "lower_bound"]
