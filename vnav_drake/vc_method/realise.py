"""From a route along Voronoi arcs to a motion (Manor 2015, sec. 2.6)."""

from __future__ import annotations

from vnav_drake.vc_method.profile import ArcProfile, arc_minimum_time, arc_profile

__all__ = ["ArcProfile", "arc_minimum_time", "arc_profile"]
