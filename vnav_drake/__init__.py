"""Planning with velocity constraints: the problem, the methods and what they return."""

from vnav_drake.braking import UniformBraking
from vnav_drake.collocation import Seed, plan_full, plan_variational
from vnav_drake.plan import Path, Plan, Trajectory
from vnav_drake.problem import End, NoPathError, PlanningError, Problem
from vnav_drake.robot import Robot
from vnav_drake.scenario import Scenario, ScenarioError, load_scenario
from vnav_drake.speed_profile import fastest_profile
from vnav_drake.voronoi import VoronoiDiagram, build_diagram
from vnav_drake.voronoi_route import k_best_routes, plan_voronoi_route
from vnav_drake.world import Obstacle, World, WorldError

__all__ = [
    "End",
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
    "Trajectory",
    "UniformBraking",
    "VoronoiDiagram",
    "World",
    "WorldError",
    "build_diagram",
    "fastest_profile",
    "k_best_routes",
    "load_scenario",
    "plan_full",
    "plan_variational",
    "plan_voronoi_route",
]
