"""Planning with velocity constraints: the problem, the methods and what they return.

Names are loaded when first used, so that who only reads scenario files does not load Drake.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vnav_drake.braking import UniformBraking
    from vnav_drake.collocation import Seed, plan_full, plan_variational
    from vnav_drake.dwa import DwaRun, plan_dwa
    from vnav_drake.lower_bound import Certificate, LowerBound
    from vnav_drake.plan import Path, Plan, Trajectory
    from vnav_drake.problem import End, NoPathError, PlanningError, Problem
    from vnav_drake.robot import Robot
    from vnav_drake.scenario import Scenario, ScenarioError, load_scenario
    from vnav_drake.speed_graph import ClassOptimum, SpeedGraphResult, plan_speed_graph
    from vnav_drake.speed_profile import fastest_profile
    from vnav_drake.vc_method import VcResult, plan_vc_method
    from vnav_drake.voronoi import VoronoiDiagram, build_diagram
    from vnav_drake.voronoi_route import k_best_routes, plan_voronoi_route
    from vnav_drake.world import Obstacle, World, WorldError

__all__ = [
    "Certificate",
    "ClassOptimum",
    "DwaRun",
    "End",
    "LowerBound",
    "NoPathError",
    "Obstacle",
    "Path",
    "Plan",
    "PlanningError",
    "Problem",
    "Robot",
    "Scenario",
    "ScenarioError",
    "Seed",
    "SpeedGraphResult",
    "Trajectory",
    "UniformBraking",
    "VcResult",
    "VoronoiDiagram",
    "World",
    "WorldError",
    "build_diagram",
    "fastest_profile",
    "k_best_routes",
    "load_scenario",
    "plan_dwa",
    "plan_full",
    "plan_speed_graph",
    "plan_variational",
    "plan_vc_method",
    "plan_voronoi_route",
]

_HOMES = {
    "braking": ("UniformBraking",),
    "collocation": (
        "Seed",
        "plan_full",
        "plan_variational",
    ),
    "dwa": (
        "DwaRun",
        "plan_dwa",
    ),
    "lower_bound": (
        "Certificate",
        "LowerBound",
    ),
    "plan": (
        "Path",
        "Plan",
        "Trajectory",
    ),
    "problem": (
        "End",
        "NoPathError",
        "PlanningError",
        "Problem",
    ),
    "robot": ("Robot",),
    "scenario": (
        "Scenario",
        "ScenarioError",
        "load_scenario",
    ),
    "speed_graph": (
        "ClassOptimum",
        "SpeedGraphResult",
        "plan_speed_graph",
    ),
    "speed_profile": ("fastest_profile",),
    "vc_method": (
        "VcResult",
        "plan_vc_method",
    ),
    "voronoi": (
        "VoronoiDiagram",
        "build_diagram",
    ),
    "voronoi_route": (
        "k_best_routes",
        "plan_voronoi_route",
    ),
    "world": (
        "Obstacle",
        "World",
        "WorldError",
    ),
}
_HOME = {name: module for module, names in _HOMES.items() for name in names}


def __getattr__(name: str) -> Any:
    """Load a public name from its module (PEP 562)."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
